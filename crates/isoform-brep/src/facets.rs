//! Triangulation of solids: edges are divided once for the two faces that share them, so that the
//! triangles are closed if the solid is; faces are triangulated in a plane chart, with a lattice of
//! points inside if they are curved.

use crate::Control;
use crate::flat::{Flat, MAX_GRAPH_STRETCH};
use isoform_control::Stopped;
use isoform_geom::brep::{Brep, Coedge, Curve, Face, Surface};
use isoform_geom::{Mesh, Point3, distance_to_segment, dot, middle, norm, sub};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};

/// Number of points of a piece of an edge that are compared with its chord.
const PROBES_PER_PIECE: usize = 7;
/// Maximum distance of triangles from the surface, in chords of the options: beyond it the lattice
/// is refined.
const MAX_DEVIATION_IN_CHORDS: f64 = 2.0;
/// Maximum number of refinements of a lattice, and of all edges if borders cross as polygons.
const MAX_REFINEMENTS: usize = 3;
/// Smallest coordinate other than 0 that spade accepts.
const MIN_COORDINATE: f64 = 1e-40;
/// Maximum number of points of the lattice of a face.
const MAX_LATTICE_POINTS: f64 = 100_000.0;

/// Size of triangles.
#[derive(Clone, Copy, Debug)]
pub struct FacetOptions {
    /// Maximum distance of edges from their chords, in model units; that of faces is about equal.
    pub chord: f64,
    /// Approximate length of the longest edge of a triangle along an edge of the solid; infinite
    /// for no limit.
    pub longest: f64,
}

/// Triangles of the faces of a solid.
#[derive(Clone, Debug, Default)]
pub struct Facets {
    /// Nodes: the vertices, then those on edges, then those within faces.
    pub points: Vec<Point3>,
    /// Triangles, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Face of each triangle.
    pub face_of: Vec<u32>,
    /// Parameters of each edge from 0 to 1, with the nodes there.
    pub along: Vec<Vec<(f64, u32)>>,
    /// Largest distance of middles of triangles and their edges from their faces.
    pub deviation: f64,
}

/// Reasons why a triangulation fails.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FacetsError {
    /// A face wraps around, or its border crosses itself.
    #[error("the face {face} cannot be divided into triangles: {why}")]
    Face {
        /// Name of the face.
        face: String,
        /// Reason.
        why: &'static str,
    },
    /// Edges need more than four million nodes.
    #[error("so fine, its edges have more than four million nodes")]
    TooMany,
    /// The work was stopped.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for FacetsError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

/// Triangulates all faces. It never panics for a valid boundary representation
/// ([`Brep::validate`]), and fails if loops cross.
///
/// # Errors
/// [`FacetsError`].
pub fn facets(
    brep: &Brep,
    options: &FacetOptions,
    control: &Control<'_>,
) -> Result<Facets, FacetsError> {
    control.begin("triangles")?;
    let mut options = *options;
    let mut tried = 0;
    loop {
        match at(brep, &options, control) {
            // Polygons may cross although the curves do not.
            Err(FacetsError::Face { .. }) if tried < MAX_REFINEMENTS => options.chord /= 4.0,
            other => return other,
        }
        tried += 1;
    }
}

fn at(brep: &Brep, options: &FacetOptions, control: &Control<'_>) -> Result<Facets, FacetsError> {
    let mut made = Facets {
        points: brep.vertices.clone(),
        ..Facets::default()
    };
    for e in 0..brep.edges.len() as u32 {
        control.begin("triangles")?;
        if made.points.len() > 1 << 22 {
            return Err(FacetsError::TooMany);
        }
        made.divide(brep, e, options);
    }
    for f in 0..brep.faces.len() {
        control.begin("triangles")?;
        let wrong = |why| FacetsError::Face {
            face: brep.face_name(f),
            why,
        };
        made.add_face(brep, f, options).map_err(wrong)?;
    }
    Ok(made)
}

impl Facets {
    /// Returns the triangles as a mesh with a part for each part of the solids.
    pub fn mesh(&self, brep: &Brep) -> Mesh {
        let part = |f: &u32| brep.faces[*f as usize].part;
        Mesh {
            triangle_parts: self.face_of.iter().map(part).collect(),
            parts: brep.parts.clone(),
            ..Mesh::from_triangles(self.points.clone(), self.triangles.clone())
        }
    }

    /// Adds the nodes along an edge.
    fn divide(&mut self, brep: &Brep, edge: u32, options: &FacetOptions) {
        let mut all = vec![0.0];
        let coarse = match brep.edges[edge as usize].curve {
            // Knots are where the curve was fitted, not where it turns.
            Curve::BSpline(_) => (0..=4).map(|i| f64::from(i) / 4.0).collect(),
            _ => brep.breaks(edge),
        };
        for piece in coarse.windows(2) {
            // Each piece is halved at most twelve times.
            halve(brep, edge, [piece[0], piece[1]], 12, options, &mut all);
        }
        let [first, last] = brep.edges[edge as usize].ends;
        let end = all.len() - 1;
        let mut nodes = vec![(0.0, first)];
        for s in &all[1..end] {
            nodes.push((*s, self.points.len() as u32));
            self.points.push(brep.along(edge, *s).0);
        }
        nodes.push((1.0, last));
        self.along.push(nodes);
    }

    /// Returns the nodes along a loop; the last one is followed by the first.
    fn around(&self, coedges: &[Coedge]) -> Vec<u32> {
        let mut nodes = Vec::new();
        for coedge in coedges {
            let along = self.along[coedge.edge as usize].iter().map(|n| n.1);
            let count = along.len() - 1;
            if coedge.forward {
                nodes.extend(along.take(count));
            } else {
                nodes.extend(along.rev().take(count));
            }
        }
        nodes
    }

    fn add_face(
        &mut self,
        brep: &Brep,
        f: usize,
        options: &FacetOptions,
    ) -> Result<(), &'static str> {
        let Face {
            surface,
            agrees,
            loops,
            ..
        } = &brep.faces[f];
        let loops: Vec<Vec<u32>> = loops.iter().map(|l| self.around(l)).collect();
        let points = |l: &Vec<u32>| l.iter().map(|v| self.points[*v as usize]).collect();
        let in_space: Vec<Vec<Point3>> = loops.iter().map(points).collect();
        let flat = Flat::new(surface, *agrees, &in_space).ok_or("it goes round")?;
        let border = ChartLoops::new(&flat, loops, &in_space);
        let mut step = step_of(surface, in_space.iter().flatten(), options);
        let mut tried = 0;
        loop {
            let inner = border.lattice(step);
            let triangles = border.triangles(&inner, self.points.len() as u32)?;
            let inner: Vec<Point3> = inner.iter().map(|at| flat.point(*at)).collect();
            let far = deviation(surface, &triangles, &self.points, &inner);
            if far > MAX_DEVIATION_IN_CHORDS * options.chord && tried < MAX_REFINEMENTS {
                step /= 2.0;
                tried += 1;
                continue;
            }
            self.deviation = self.deviation.max(far);
            self.points.extend(inner);
            self.face_of.extend(triangles.iter().map(|_| f as u32));
            self.triangles.extend(triangles);
            return Ok(());
        }
    }
}

/// Adds parameters up to the end of a piece of an edge, so that it is near its chords.
fn halve(
    brep: &Brep,
    edge: u32,
    [a, b]: [f64; 2],
    depth: usize,
    options: &FacetOptions,
    all: &mut Vec<f64>,
) {
    let ((p, v), (q, w)) = (brep.along(edge, a), brep.along(edge, b));
    let is_line = matches!(brep.edges[edge as usize].curve, Curve::Line);
    let probe = |k: usize| a + (b - a) * k as f64 / (PROBES_PER_PIECE + 1) as f64;
    let is_far = |k: usize| {
        let x = brep.along(edge, probe(k)).0;
        distance_to_segment(x, [p, q]) > options.chord
    };
    // A piece of an edge turns by at most 30°.
    let turns = dot(v, w) < 0.866 * norm(v) * norm(w);
    let bends = !is_line && (turns || (1..=PROBES_PER_PIECE).any(is_far));
    if depth > 0 && (bends || norm(sub(p, q)) > options.longest) {
        let half = 0.5 * (a + b);
        halve(brep, edge, [a, half], depth - 1, options, all);
        halve(brep, edge, [half, b], depth - 1, options, all);
    } else {
        all.push(b);
    }
}

/// Returns the step of a lattice whose chords are within the requested distance of the surface: a
/// chord of length L of a curve with the curvature k is k L²/8 away.
fn step_of<'p>(
    surface: &Surface,
    border: impl Iterator<Item = &'p Point3>,
    options: &FacetOptions,
) -> f64 {
    let has_tips = matches!(surface, Surface::Revolved(t) if t.tips().contains(&true));
    let steep = if has_tips || matches!(surface, Surface::Graph(_)) {
        MAX_GRAPH_STRETCH
    } else {
        1.0
    };
    let mut bends: Vec<f64> = border
        .map(|p| {
            let n = surface.distance(*p).1;
            let [e, f] = isoform_geom::orthonormal_complement(n);
            let along = |(a, b)| {
                let t = std::array::from_fn(|k| a * e[k] + b * f[k]);
                surface.bending(*p, t).abs()
            };
            let all = [(1.0, 0.0), (0.0, 1.0), (0.7, 0.7), (0.7, -0.7)];
            all.map(along).into_iter().fold(0.0, f64::max)
        })
        .collect();
    // The median: at the apex of a cone the curvature is infinite, and a lattice that is locally
    // too coarse is refined.
    let half = bends.len() / 2;
    let bend = *bends.select_nth_unstable_by(half, f64::total_cmp).1;
    let cap = (8.0 * options.chord / bend).sqrt();
    cap.min(options.longest) / steep
}

/// Returns the largest distance of the middles of triangles, and of those of their edges, from the
/// surface.
fn deviation(surface: &Surface, triangles: &[[u32; 3]], outer: &[Point3], inner: &[Point3]) -> f64 {
    let point = |v: u32| {
        let v = v as usize;
        let within = || inner[v - outer.len()];
        outer.get(v).copied().unwrap_or_else(within)
    };
    let mut worst = 0.0f64;
    for t in triangles {
        let [a, b, c] = t.map(point);
        let half = |p: Point3, q: Point3| std::array::from_fn(|k| 0.5 * (p[k] + q[k]));
        for at in [middle([a, b, c]), half(a, b), half(b, c), half(c, a)] {
            worst = worst.max(surface.distance(at).0.abs());
        }
    }
    worst
}

/// A node in the plane.
#[derive(Clone, Copy)]
struct PlaneNode {
    at: [f64; 2],
    number: u32,
}

impl HasPosition for PlaneNode {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

type Cdt = ConstrainedDelaunayTriangulation<PlaneNode>;

/// The loops of a face in its chart.
struct ChartLoops {
    loops: Vec<Vec<PlaneNode>>,
}

impl ChartLoops {
    fn new(flat: &Flat, loops: Vec<Vec<u32>>, points: &[Vec<Point3>]) -> Self {
        let node = |(number, p): (u32, &Point3)| PlaneNode {
            at: flat
                .place(*p)
                .map(|v| if v.abs() < MIN_COORDINATE { 0.0 } else { v }),
            number,
        };
        let loops = loops.into_iter().zip(points);
        Self {
            loops: loops
                .map(|(l, p)| l.into_iter().zip(p).map(node).collect())
                .collect(),
        }
    }

    /// Returns the sides, one after another.
    fn sides(&self) -> impl Iterator<Item = [PlaneNode; 2]> {
        self.loops.iter().flat_map(|l| {
            let next = l.iter().cycle().skip(1);
            l.iter().zip(next).map(|(a, b)| [*a, *b])
        })
    }

    /// Returns the points inside of a lattice of equilateral triangles with this side, away from
    /// the border.
    fn lattice(&self, step: f64) -> Vec<[f64; 2]> {
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for node in self.loops.iter().flatten() {
            for k in 0..2 {
                lo[k] = lo[k].min(node.at[k]);
                hi[k] = hi[k].max(node.at[k]);
            }
        }
        let [width, height] = [hi[0] - lo[0], hi[1] - lo[1]];
        let least = (width * height / MAX_LATTICE_POINTS)
            .sqrt()
            .max(width.max(height) / MAX_LATTICE_POINTS);
        let step = step.max(least);
        if !step.is_finite() || step <= 0.0 {
            return Vec::new();
        }
        let rise = 0.75f64.sqrt() * step;
        let rows = (height / rise) as usize;
        let mut places = Vec::new();
        for row in 1..=rows {
            let y = lo[1] + rise * row as f64;
            let shift = if row % 2 == 0 { 0.0 } else { 0.5 * step };
            self.add_row(y, lo[0] + shift, step, &mut places);
        }
        places
    }

    /// Adds the points of a row that are inside and away from the border.
    fn add_row(&self, y: f64, from: f64, step: f64, places: &mut Vec<[f64; 2]>) {
        // Points of the lattice nearer to the border than 45 % of its step would make thin
        // triangles.
        let near = 0.45 * step;
        let mut crossings = Vec::new();
        let mut beside: Vec<[PlaneNode; 2]> = Vec::new();
        for side in self.sides() {
            let [a, b] = side.map(|n| n.at);
            if (a[1] > y) != (b[1] > y) {
                crossings.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
            }
            if a[1].min(b[1]) <= y + near && a[1].max(b[1]) >= y - near {
                beside.push(side);
            }
        }
        crossings.sort_unstable_by(f64::total_cmp);
        for within in crossings.as_chunks::<2>().0 {
            let mut k = ((within[0] - from) / step).ceil();
            while from + k * step < within[1] {
                let at = [from + k * step, y];
                let space = |p: [f64; 2]| [p[0], p[1], 0.0];
                let is_near = |side: &[PlaneNode; 2]| {
                    distance_to_segment(space(at), side.map(|n| space(n.at))) < near
                };
                if !beside.iter().any(is_near) {
                    places.push(at.map(|v| if v.abs() < MIN_COORDINATE { 0.0 } else { v }));
                }
                k += 1.0;
            }
        }
    }

    /// Returns the triangles within the loops; lattice points are numbered from `first`.
    fn triangles(&self, inner: &[[f64; 2]], first: u32) -> Result<Vec<[u32; 3]>, &'static str> {
        const CROSSING: &str = "its border crosses itself";
        let mut cdt = Cdt::new();
        let mut handles: BTreeMap<u32, FixedVertexHandle> = BTreeMap::new();
        // All nodes before all sides: the search for a node that is inserted later might not
        // terminate.
        for node in self.loops.iter().flatten() {
            let handle = cdt.insert(*node).map_err(|_| "it has no extent")?;
            handles.insert(node.number, handle);
        }
        let distinct: BTreeSet<usize> = handles.values().map(|h| h.index()).collect();
        if distinct.len() != handles.len() {
            return Err(CROSSING);
        }
        for (i, at) in inner.iter().enumerate() {
            let number = first + i as u32;
            let node = PlaneNode { at: *at, number };
            cdt.insert(node).map_err(|_| "it has no extent")?;
        }
        for [a, b] in self.sides() {
            let (a, b) = (handles[&a.number], handles[&b.number]);
            if a == b || !cdt.can_add_constraint(a, b) || !cdt.add_constraint(a, b) {
                return Err(CROSSING);
            }
        }
        let inside = self.inside(&cdt, &handles).ok_or(CROSSING)?;
        let faces = cdt.inner_faces().filter(|f| inside[f.fix().index()]);
        Ok(faces
            .map(|f| f.vertices().map(|v| v.data().number))
            .collect())
    }

    /// Returns by face of the triangulation true if it lies on the left of a side, or is reached
    /// from such a face without crossing a side. `None` if the outer face is reached.
    fn inside(&self, cdt: &Cdt, handles: &BTreeMap<u32, FixedVertexHandle>) -> Option<Vec<bool>> {
        let mut inside = vec![false; cdt.num_all_faces()];
        let mut waiting = Vec::new();
        for [a, b] in self.sides() {
            let edge = cdt.get_edge_from_neighbors(handles[&a.number], handles[&b.number])?;
            waiting.push(edge.face().fix());
        }
        while let Some(face) = waiting.pop() {
            let face = cdt.face(face).as_inner()?;
            if std::mem::replace(&mut inside[face.fix().index()], true) {
                continue;
            }
            for edge in face.adjacent_edges() {
                if !edge.is_constraint_edge() {
                    waiting.push(edge.rev().face().fix());
                }
            }
        }
        Some(inside)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use isoform_geom::brep::{Axes, Body, Edge};
    use isoform_geom::cross;
    use std::f64::consts::PI;

    /// Returns a can of radius 1 and height 2 about z, its wall in two halves: top and bottom are
    /// circles of two arcs.
    pub(crate) fn can() -> Brep {
        let up = [0.0, 0.0, 1.0];
        let axes = |height: f64, x: Point3| Axes {
            origin: [0.0, 0.0, height],
            z: up,
            x,
        };
        let (x, back) = ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]);
        let arc = |height, ends| Edge {
            curve: Curve::Circle(axes(height, x), 1.0),
            ends,
        };
        let line = |ends| Edge {
            curve: Curve::Line,
            ends,
        };
        let face = |surface, agrees, part, around: &[(u32, bool)]| {
            let coedge = |&(edge, forward): &(u32, bool)| Coedge { edge, forward };
            Face {
                surface,
                agrees,
                part,
                chart: 0,
                loops: vec![around.iter().map(coedge).collect()],
            }
        };
        // Frames as they are placed: angles begin away from the face.
        let half = |y: f64| Surface::Cylinder(axes(0.0, [0.0, -y, 0.0]), 1.0);
        let at = |x: Point3, z: f64| [x[0], x[1], z];
        Brep {
            vertices: vec![x, back, at(x, 2.0), at(back, 2.0)],
            edges: vec![
                arc(0.0, [0, 1]),
                arc(0.0, [1, 0]),
                arc(2.0, [2, 3]),
                arc(2.0, [3, 2]),
                line([0, 2]),
                line([1, 3]),
            ],
            faces: vec![
                face(
                    Surface::Plane(axes(0.0, x)),
                    false,
                    0,
                    &[(1, false), (0, false)],
                ),
                face(
                    Surface::Plane(axes(2.0, x)),
                    true,
                    1,
                    &[(2, true), (3, true)],
                ),
                face(
                    half(1.0),
                    true,
                    2,
                    &[(0, true), (5, true), (2, false), (4, false)],
                ),
                face(
                    half(-1.0),
                    true,
                    2,
                    &[(1, true), (4, true), (3, false), (5, false)],
                ),
            ],
            parts: ["bottom", "top", "wall"].map(str::to_owned).to_vec(),
            solids: vec![Body {
                outer: vec![0, 1, 2, 3],
                voids: Vec::new(),
            }],
        }
    }

    fn made(chord: f64, longest: f64) -> Facets {
        let options = FacetOptions { chord, longest };
        facets(&can(), &options, &Control::default()).expect("triangles")
    }

    fn volume(made: &Facets) -> f64 {
        let corners = made
            .triangles
            .iter()
            .map(|t| t.map(|v| made.points[v as usize]));
        corners.map(|[a, b, c]| dot(a, cross(b, c)) / 6.0).sum()
    }

    #[test]
    fn a_can_is_closed_and_its_volume_tends_to_the_closed_form() {
        assert_eq!(can().validate(), Ok(()));
        let errors = [1e-2, 2.5e-3].map(|chord| {
            let made = made(chord, f64::INFINITY);
            assert!(
                made.deviation <= MAX_DEVIATION_IN_CHORDS * chord && made.deviation > 0.1 * chord
            );
            let mut sides: BTreeSet<[u32; 2]> = BTreeSet::new();
            for [a, b, c] in &made.triangles {
                for side in [[*a, *b], [*b, *c], [*c, *a]] {
                    assert!(sides.insert(side), "twice in one direction");
                }
            }
            assert!(
                sides.iter().all(|[a, b]| sides.contains(&[*b, *a])),
                "closed"
            );
            2.0 * PI - volume(&made)
        });
        // The error is of the order of the chord: a fourth of it leaves about a fourth.
        assert!(errors[0] > 0.0 && errors[0] < 0.1, "{errors:?}");
        assert!((2.0..8.0).contains(&(errors[0] / errors[1])), "{errors:?}");
    }

    #[test]
    fn edges_along_edges_are_as_short_as_asked() {
        let made = made(1e-2, 0.3);
        let point = |n: &(f64, u32)| made.points[n.1 as usize];
        let pieces = made.along.iter().flat_map(|l| l.windows(2));
        let longest = pieces.map(|w| norm(sub(point(&w[0]), point(&w[1]))));
        let longest = longest.fold(0.0, f64::max);
        assert!(longest <= 0.3 && longest > 0.15, "{longest}");
    }

    #[test]
    fn what_crosses_itself_or_goes_round_is_refused() {
        // The bottom as an eight: its second arc runs the wrong way.
        let mut eight = can();
        eight.edges[1].ends = [0, 1];
        eight.faces[0].loops[0][0].forward = true;
        let said = |brep: &Brep| {
            let options = FacetOptions {
                chord: 1e-2,
                longest: f64::INFINITY,
            };
            let none = facets(brep, &options, &Control::default());
            none.expect_err("no triangles").to_string()
        };
        assert_eq!(
            said(&eight),
            "the face bottom cannot be divided into triangles: its border crosses itself"
        );
        // One wall all the way round, in a loop that passes its seam twice.
        let mut round = can();
        let more = round.faces.pop().expect("a face");
        round.faces[2].loops.extend(more.loops);
        assert!(said(&round).ends_with("it goes round"));
    }
}
