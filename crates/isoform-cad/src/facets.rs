//! Triangles of all faces: edges are divided once for the faces that share them, so that the
//! triangles are closed if the shape is.

use crate::chart::Chart;
use crate::cut::{Split, bounds, opened, splits};
use crate::edges::{Divided, FacetOptions, divide};
use crate::lattice::steps;
use crate::loops::FaceChart;
use crate::plane::{Domain, FaceTriangles};
use crate::trim::{Extent, TrimmedFace};
use isoform_control::{Control, Stopped};
use isoform_geom::cad::{CadSurface, Shape};
use isoform_geom::{Aabb, Point3, middle, norm, sub};
use rayon::prelude::*;

/// Maximum distance of triangles from the surface, in chords of the options: beyond it the lattice
/// is refined.
const MAX_DEVIATION_IN_CHORDS: f64 = 3.0;
/// Maximum number of refinements of all edges if borders cross as polygons.
const MAX_REFINEMENTS: usize = 3;
/// Maximum number of refinements of a lattice, each of which doubles its points.
const MAX_LATTICE_REFINEMENTS: usize = 4;
/// Maximum number of nodes: with their triangles some two gigabytes.
const MAX_NODES: usize = 1 << 24;
/// Maximum number of rounds in which nodes are added where faces are cut; the second finds none
/// unless an edge crosses the line twice between two nodes.
const MAX_SPLIT_ROUNDS: usize = 4;

/// Triangles of the faces of a shape.
#[derive(Clone, Debug, Default)]
pub struct ShapeFacets {
    /// Nodes: the vertices, then those on edges, then those within faces.
    pub points: Vec<Point3>,
    /// Triangles, counterclockwise seen from the side of the face's normal.
    pub triangles: Vec<[u32; 3]>,
    /// Face of each triangle.
    pub face_of: Vec<u32>,
    /// Parameters of the corners of each triangle on the surface of its face.
    pub places: Vec<[[f64; 2]; 3]>,
    /// Largest distance of middles of triangles and of their edges from the faces, by face.
    pub deviations: Vec<f64>,
}

/// Reasons why a shape has no triangles.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// The loops of a face cross, or bound nothing.
    #[error("the face {face} cannot be divided into triangles: {why}")]
    Face {
        /// Entity number, line and kind of the face.
        face: String,
        /// Reason.
        why: &'static str,
    },
    /// Edges need more than four million nodes, or all faces more than sixteen million.
    #[error("so fine, there are more than four million nodes on edges or sixteen in all")]
    TooMany,
    /// The work was stopped.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for ShapeError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

/// Faces with their borders in the parameter plane, and their triangles.
pub(crate) struct Made {
    pub(crate) faces: Vec<TrimmedFace>,
    pub(crate) divided: Divided,
    pub(crate) facets: ShapeFacets,
}

/// Triangulates all faces.
pub(crate) fn make(
    shape: &Shape,
    options: &FacetOptions,
    control: &Control<'_>,
) -> Result<Made, ShapeError> {
    let mut options = *options;
    let mut tried = 0;
    loop {
        match at(shape, &options, control) {
            // Polygons may cross although the curves do not.
            Err(ShapeError::Face { .. }) if tried < MAX_REFINEMENTS => options.chord /= 4.0,
            other => return other,
        }
        tried += 1;
    }
}

fn at(shape: &Shape, options: &FacetOptions, control: &Control<'_>) -> Result<Made, ShapeError> {
    let mut divided = divide(shape, options).ok_or(ShapeError::TooMany)?;
    let mut round = 0;
    let faces = loop {
        control.begin("faces")?;
        let indices = 0..shape.faces.len();
        let faces = indices.into_par_iter().map(|f| {
            control.check()?;
            let face = &shape.faces[f];
            let border = face.loops.iter().flatten();
            let border = border.flat_map(|c| &divided.along[c.edge as usize]);
            let border = Aabb::from_points(border.map(|n| &divided.points[n.1 as usize]));
            let border = if border.is_empty() {
                whole(&face.surface)
            } else {
                border
            };
            let chart = Chart::new(&face.surface, &border);
            let chart = FaceChart::new(shape, face, &divided, chart);
            Ok(TrimmedFace::new(shape, chart))
        });
        let faces: Vec<TrimmedFace> = faces.collect::<Result<_, Stopped>>()?;
        let going_round = faces.iter().filter(|f| f.extent != Extent::Bounded);
        let wanted: Vec<Split> = going_round.flat_map(|f| splits(shape, f)).collect();
        if wanted.is_empty() || round == MAX_SPLIT_ROUNDS {
            break faces;
        }
        divided.split(shape, wanted);
        round += 1;
    };
    let mut facets = ShapeFacets {
        points: divided.points.clone(),
        ..ShapeFacets::default()
    };
    for (f, face) in faces.iter().enumerate() {
        control.begin("triangles")?;
        let wrong = |why| ShapeError::Face {
            face: shape.faces[f].name.clone(),
            why,
        };
        let (made, far) = triangulated(shape, face, &facets.points, options).map_err(wrong)?;
        facets
            .face_of
            .extend(made.triangles.iter().map(|_| f as u32));
        facets.points.extend(made.points);
        facets.triangles.extend(made.triangles);
        facets.places.extend(made.places);
        facets.deviations.push(far);
        if facets.points.len() > MAX_NODES {
            return Err(ShapeError::TooMany);
        }
    }
    Ok(Made {
        faces,
        divided,
        facets,
    })
}

/// Returns a box around a surface that is a face as a whole.
pub(crate) fn whole(surface: &CadSurface) -> Aabb {
    let (origin, reach) = match surface {
        CadSurface::Sphere(axes, r) => (axes.origin, *r),
        CadSurface::Torus(axes, major, minor) => (axes.origin, major + minor),
        CadSurface::Nurbs(spline) => {
            let control: Vec<Point3> = spline.control().collect();
            return Aabb::from_points(&control);
        }
        _ => return Aabb::from_points(&[[0.0; 3], [1.0; 3]]),
    };
    Aabb::from_points(&[origin]).widened(reach)
}

/// Triangulates a face, with a finer lattice while it is too far from the surface. Also returns the
/// largest distance.
fn triangulated(
    shape: &Shape,
    face: &TrimmedFace,
    points: &[Point3],
    options: &FacetOptions,
) -> Result<(FaceTriangles, f64), &'static str> {
    let chart = &face.face.chart;
    let bounds = bounds(face);
    if bounds.iter().flatten().any(|v| !v.is_finite()) {
        return Err("it has no bounds");
    }
    let mut step = steps(face, bounds, options);
    let mut tried = 0;
    loop {
        let first = points.len() as u32;
        let mut domain = Domain::new(step, face.face.scale, first);
        let pieces = || face.face.loops.iter().flat_map(|l| &l.pieces);
        if face.extent == Extent::Bounded {
            for piece in pieces() {
                let [a, b] = [0, 1].map(|i| domain.node(piece.at[i], piece.nodes[i]));
                domain.side(a, b);
            }
        } else {
            let vertices = pieces().map(|p| (points[p.nodes[0] as usize], p.nodes[0]));
            domain = opened(shape, face, step, domain.with_vertices(vertices));
        }
        let is_curved = step.iter().all(|s| s.is_finite());
        let made = domain.triangles(face, is_curved)?;
        let corner = |v: u32| {
            let v = v as usize;
            let new = || made.points[v - points.len()];
            points.get(v).copied().unwrap_or_else(new)
        };
        let mut far = 0.0f64;
        for (t, at) in made.triangles.iter().zip(&made.places) {
            far = far.max(deviation(chart, t.map(corner), at));
        }
        if far > MAX_DEVIATION_IN_CHORDS * options.chord
            && tried < MAX_LATTICE_REFINEMENTS
            && is_curved
        {
            step = step.map(|s| s / std::f64::consts::SQRT_2);
            tried += 1;
            continue;
        }
        return Ok((made, far));
    }
}

/// Returns the largest distance of the middles of a triangle and of its edges from the surface.
fn deviation(chart: &Chart, [a, b, c]: [Point3; 3], at: &[[f64; 2]; 3]) -> f64 {
    let half = |p: Point3, q: Point3| middle([p, q]);
    let mean = |list: &[usize]| {
        let n = list.len() as f64;
        [0, 1].map(|k| list.iter().map(|i| at[*i][k]).sum::<f64>() / n)
    };
    let off = |p: Point3, list: &[usize]| {
        let foot = chart.place_near(p, mean(list));
        norm(sub(chart.surface.at(foot).p, p))
    };
    off(middle([a, b, c]), &[0, 1, 2])
        .max(off(half(a, b), &[0, 1]))
        .max(off(half(b, c), &[1, 2]))
        .max(off(half(c, a), &[2, 0]))
}
