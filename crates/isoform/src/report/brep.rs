//! The report of a boundary representation and of its certificate.

use super::{ModelName, Seconds};
use crate::ModelBrep;
use isoform_geom::Point3;
use isoform_geom::brep::Surface;
use serde::Serialize;

/// Everything that is known of the boundary representation of a model.
#[derive(Clone, Debug, Serialize)]
pub struct BrepReport {
    /// Whether the certificate holds.
    pub ok: bool,
    /// `brep`.
    pub verb: &'static str,
    /// The model.
    pub model: ModelName,
    /// Solids.
    pub solids: usize,
    /// Voids in them.
    pub voids: usize,
    /// The faces.
    pub faces: Vec<FaceReport>,
    /// Edges.
    pub edges: usize,
    /// Vertices.
    pub vertices: usize,
    /// Vertices − edges + Euler numbers of the faces.
    pub euler: i64,
    /// Volume, in cubic units of the model.
    pub volume: f64,
    /// Area, in square units.
    pub area: f64,
    /// The centre of the volume.
    pub centroid: Point3,
    /// Largest distance of an edge or vertex from a surface that meets there.
    pub gap: f64,
    /// Largest angle between faces along smooth edges, in degrees.
    pub smooth_angle: f64,
    /// What is proved, or looked for in vain.
    pub certificate: BrepCertificateReport,
    /// What else is good to know.
    pub notes: Vec<String>,
    /// Files written.
    pub files: Vec<String>,
    /// Seconds by phase.
    pub seconds: Seconds,
}

/// A face.
#[derive(Clone, Debug, Serialize)]
pub struct FaceReport {
    /// Its name: that of its part, and the number of its chart if the part has several.
    pub part: String,
    /// The kind of its surface; `spline` for ellipsoids, too, which CAD has no name for.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Its area.
    pub area: f64,
    /// The largest distance of places on it from the function of its part.
    pub max_distance: f64,
}

/// The certificate.
#[derive(Clone, Debug, Serialize)]
pub struct BrepCertificateReport {
    /// Whether nothing is wrong and nothing left open.
    pub holds: bool,
    /// What is.
    pub failures: Vec<String>,
    /// The volume that finer meshes tend to.
    pub mesh_limit: f64,
    /// The length of the shortest edge.
    pub shortest_edge: f64,
    /// The area of the smallest face.
    pub smallest_face: f64,
}

/// The kind of a surface as CAD knows it.
fn kind(surface: &Surface) -> &'static str {
    match surface {
        Surface::Ellipsoid(_) => "spline",
        other => other.name(),
    }
}

impl BrepReport {
    /// The report of a model's boundary representation, with the files that it went to.
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
