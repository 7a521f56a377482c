//! Report of a boundary representation and of its certificate.

use super::{ModelName, Seconds};
use crate::ModelBrep;
use isoform_geom::Point3;
use isoform_geom::brep::Surface;
use serde::Serialize;

/// Report of `brep`: the boundary representation of a model and its certificate. Lengths are in
/// model units, points are `[x, y, z]`.
#[derive(Clone, Debug, Serialize)]
pub struct BrepReport {
    /// True if the certificate holds.
    pub ok: bool,
    /// Name of the verb: `brep`.
    pub verb: &'static str,
    /// The model.
    pub model: ModelName,
    /// Number of solids.
    pub solids: usize,
    /// Number of voids in the solids.
    pub voids: usize,
    /// Faces.
    pub faces: Vec<FaceReport>,
    /// Number of edges.
    pub edges: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Euler characteristic: vertices − edges + Euler characteristics of the faces.
    pub euler: i64,
    /// Volume, in cubic units.
    pub volume: f64,
    /// Area, in square units.
    pub area: f64,
    /// Centroid of the volume.
    pub centroid: Point3,
    /// Largest distance of an edge or vertex from a surface that meets there.
    pub gap: f64,
    /// Largest angle between the normals of faces along smooth edges, in degrees.
    pub smooth_angle: f64,
    /// Results of the checks.
    pub certificate: BrepCertificateReport,
    /// Further remarks, a sentence each.
    pub notes: Vec<String>,
    /// Paths of the files that were written.
    pub files: Vec<String>,
    /// Computing time by phase, in seconds.
    pub seconds: Seconds,
}

/// Face.
#[derive(Clone, Debug, Serialize)]
pub struct FaceReport {
    /// Name of the part of the model, with the number of the chart if the part has several.
    pub part: String,
    /// Kind of surface; also `spline` for ellipsoids, which CAD formats lack.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Area of the face, in square units.
    pub area: f64,
    /// Largest distance of samples of the face from the function of its part.
    pub max_distance: f64,
}

/// Results of the checks of a boundary representation.
#[derive(Clone, Debug, Serialize)]
pub struct BrepCertificateReport {
    /// True if the list of failures is empty.
    pub holds: bool,
    /// Defects, and questions left open, a sentence each.
    pub failures: Vec<String>,
    /// Extrapolated limit of the volumes of finer meshes, to compare with the volume.
    pub mesh_limit: f64,
    /// Length of the shortest edge.
    pub shortest_edge: f64,
    /// Area of the smallest face, in square units.
    pub smallest_face: f64,
}

/// Returns the kind of a surface in CAD formats.
fn kind(surface: &Surface) -> &'static str {
    match surface {
        Surface::Ellipsoid(_) => "spline",
        other => other.name(),
    }
}

impl BrepReport {
    /// Creates the report of a model's boundary representation and of the files that were written.
    pub fn new(made: &ModelBrep, model: ModelName, files: Vec<String>, seconds: Seconds) -> Self {
        let (brep, certificate) = (&made.built.brep, &made.certificate);
        let face = |f: usize| FaceReport {
            part: brep.face_name(f),
            kind: kind(&brep.faces[f].surface),
            area: certificate.faces[f].area,
            max_distance: certificate.distances[f],
        };
        let failures = certificate.failures.iter();
        Self {
            ok: certificate.holds(),
            verb: "brep",
            model,
            solids: brep.solids.len(),
            voids: brep.solids.iter().map(|s| s.voids.len()).sum(),
            faces: (0..brep.faces.len()).map(face).collect(),
            edges: brep.edges.len(),
            vertices: brep.vertices.len(),
            euler: certificate.euler,
            volume: certificate.total.volume,
            area: certificate.total.area,
            centroid: certificate.centroid(),
            gap: certificate.gap,
            smooth_angle: certificate.smooth_angle,
            certificate: BrepCertificateReport {
                holds: certificate.holds(),
                failures: failures.map(ToString::to_string).collect(),
                mesh_limit: certificate.mesh_limit,
                shortest_edge: certificate.shortest_edge,
                smallest_face: certificate.smallest_face,
            },
            notes: made.mesh.notes().iter().map(ToString::to_string).collect(),
            files,
            seconds,
        }
    }
}
