//! Solid of exact faces, as read from a file: its measures, its triangles, and distances from it.

use isoform_brep::{
    FaceProjector, FacetOptions, Facets, FacetsError, Measure, facets, of_face, total,
};
use isoform_control::Control;
use isoform_geom::brep::Brep;
use isoform_geom::{Aabb, Mesh, Point3, norm, sub};

/// Default distance of the triangles from the faces, in diagonals of the box. The triangles only
/// select the nearest face; its distance is computed exactly.
const DEFAULT_CHORD_SHARE: f64 = 1e-3;
/// Number of intervals into which a piece of an edge is divided, at whose ends the distance from
/// its faces is measured. Gaps that are narrower than an interval may be underestimated.
const INTERVALS_PER_EDGE_PIECE: usize = 8;

/// Measures of a solid, computed from its faces without a function.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidMeasures {
    /// Area of each face, in square units.
    pub areas: Vec<f64>,
    /// Total area of the faces, in square units.
    pub area: f64,
    /// Volume, in cubic units, by integrals along the edges.
    pub volume: f64,
    /// Centroid of the volume.
    pub centroid: Point3,
    /// Largest distance of samples of the edges from the surfaces of their faces, and of the ends
    /// of edges from their vertices.
    pub gap: f64,
    /// Euler characteristic: vertices − edges + Euler characteristics of the faces.
    pub euler: i64,
}

/// Measures solids that are valid by [`Brep::validate`].
pub fn measure_solid(brep: &Brep) -> SolidMeasures {
    let center = Aabb::from_points(&brep.vertices).center();
    let faces: Vec<Measure> = (0..brep.faces.len())
        // This control stops nothing.
        .map(|f| of_face(brep, f, center, &Control::default()).unwrap_or_default())
        .collect();
    let Measure {
        area,
        volume,
        moment,
    } = total(&faces);
    let of_faces: i64 = brep.faces.iter().map(|f| 2 - f.loops.len() as i64).sum();
    SolidMeasures {
        areas: faces.iter().map(|f| f.area).collect(),
        area,
        volume,
        centroid: std::array::from_fn(|k| center[k] + moment[k] / volume),
        gap: solid_gap(brep),
        euler: brep.vertices.len() as i64 - brep.edges.len() as i64 + of_faces,
    }
}

/// Returns the largest distance of samples of the edges from their faces, and of the ends of edges
/// from their vertices; infinite if one is not a number. A valid boundary representation may still
/// have faces that do not meet.
pub fn solid_gap(brep: &Brep) -> f64 {
    let worse = |a: f64, b: f64| if b.is_nan() { f64::INFINITY } else { a.max(b) };
    let mut gap = 0.0;
    for face in &brep.faces {
        for coedge in face.loops.iter().flatten() {
            for piece in brep.breaks(coedge.edge).windows(2) {
                for k in 0..=INTERVALS_PER_EDGE_PIECE {
                    let s = piece[0]
                        + (piece[1] - piece[0]) * k as f64 / INTERVALS_PER_EDGE_PIECE as f64;
                    let p = brep.along(coedge.edge, s).0;
                    gap = worse(gap, face.surface.distance(p).0.abs());
                }
            }
        }
    }
    for e in 0..brep.edges.len() as u32 {
        for (s, end) in [0.0, 1.0].into_iter().zip(brep.ends(e)) {
            gap = worse(gap, norm(sub(brep.along(e, s).0, end)));
        }
    }
    gap
}

/// Solids of exact faces, with a triangulation of the faces.
///
/// ```
/// use isoform::{Control, ExactSolid, MeshModelOptions, Side, brep_model, compare, template};
/// use isoform::geom::PointCloud;
/// let ball = template("sphere").expect("a template of the gallery").model();
/// let control = Control::default();
/// let made = brep_model(&ball, &[0.0, 0.0, 0.0, 2.0], &MeshModelOptions::default(), None, &control)?;
/// let solid = ExactSolid::new(made.built.brep, None, &control)?;
/// let points = PointCloud::from_points(vec![[0.0, 0.0, 5.0], [0.0, 0.0, 0.5], [2.0, 0.0, 0.0]]);
/// let there = compare(Side::Points(&points), Side::Solid(&solid), None, 1000)?.there;
/// assert!((there.max - 3.0).abs() < 1e-12 && (there.mean - 1.5).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ExactSolid {
    brep: Brep,
    facets: Facets,
}

impl ExactSolid {
    /// Triangulates solids that are valid by [`Brep::validate`], as finely as `options` say; by
    /// default, triangles are within a thousandth of the diagonal of the box from their faces.
    ///
    /// # Errors
    /// [`FacetsError`] where a face has no triangles.
    pub fn new(
        brep: Brep,
        options: Option<FacetOptions>,
        control: &Control<'_>,
    ) -> Result<Self, FacetsError> {
        let options = options.unwrap_or_else(|| FacetOptions {
            chord: DEFAULT_CHORD_SHARE * bounds_of_edges(&brep).diagonal(),
            longest: f64::INFINITY,
        });
        let facets = facets(&brep, &options, control)?;
        Ok(Self { brep, facets })
    }
    /// Returns the boundary representation of the solids.
    pub fn brep(&self) -> &Brep {
        &self.brep
    }
    /// Returns the triangles of the faces.
    pub fn facets(&self) -> &Facets {
        &self.facets
    }
    /// Returns the triangles as a mesh whose parts are those of the solids. It is closed, since
    /// faces share the nodes of their edges.
    pub fn mesh(&self) -> Mesh {
        self.facets.mesh(&self.brep)
    }
    /// Returns the faces in a form that finds nearest points.
    pub(crate) fn skin(&self) -> FaceProjector<'_> {
        FaceProjector::new(&self.brep, &self.facets)
    }
}

/// Returns the bounding box of samples of all edges. Faces may bulge out of it, but by no more than
/// its size.
fn bounds_of_edges(brep: &Brep) -> Aabb {
    let mut bounds = Aabb::from_points(&brep.vertices);
    for e in 0..brep.edges.len() as u32 {
        for s in brep.breaks(e) {
            bounds.add(brep.along(e, s).0);
        }
    }
    bounds
}
