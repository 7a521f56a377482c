//! Report on a file of solids.

use crate::{SolidMeasures, measure_solid};
use isoform_geom::Point3;
use isoform_io::SolidFile;
use serde::Serialize;

/// Report of `inspect` on a file of solids: measures stated in the file, and measured from its
/// faces. Lengths are in the unit of the file.
#[derive(Clone, Debug, Serialize)]
pub struct SolidReport {
    /// Name of the verb: `inspect`.
    pub verb: &'static str,
    /// Name of the file.
    pub file: String,
    /// Format of the file: `step` or `brep.json`.
    pub format: &'static str,
    /// Name of the product; may be empty.
    pub name: String,
    /// Unit of length; `None` if unknown.
    pub unit: Option<String>,
    /// Number of solids.
    pub solids: usize,
    /// Number of voids in the solids.
    pub voids: usize,
    /// Faces, in the order of the file.
    pub faces: Vec<SolidFaceReport>,
    /// Number of edges.
    pub edges: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Euler characteristic: vertices − edges + Euler characteristics of the faces.
    pub euler: i64,
    /// Measured volume, in cubic units.
    pub volume: f64,
    /// Measured area, in square units.
    pub area: f64,
    /// Measured centroid of the volume.
    pub centroid: Point3,
    /// Largest distance of samples of the edges from the surfaces of their faces, and of the ends
    /// of edges from their vertices.
    pub gap: f64,
    /// Measures that the file states.
    pub stated: StatedReport,
}

/// Face of a file of solids.
#[derive(Clone, Debug, Serialize)]
pub struct SolidFaceReport {
    /// Name of the face's part.
    pub part: String,
    /// Kind of surface of the face.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Measured area of the face, in square units.
    pub area: f64,
}

/// Measures that a file states for its solids.
#[derive(Clone, Debug, Serialize)]
pub struct StatedReport {
    /// Volume, in cubic units.
    pub volume: f64,
    /// Area, in square units.
    pub area: f64,
    /// Centroid of the volume.
    pub centroid: Point3,
    /// Largest distance of edges from their faces.
    pub gap: f64,
}

impl SolidReport {
    /// Measures the solids of a file and creates the report.
    pub fn new(file: &str, format: &'static str, solids: &SolidFile) -> Self {
        let SolidFile {
            brep,
            name,
            unit,
            properties,
        } = solids;
        let SolidMeasures {
            areas,
            area,
            volume,
            centroid,
            gap,
            euler,
        } = measure_solid(brep);
        let face = |(f, area)| SolidFaceReport {
            part: brep.face_name(f),
            kind: brep.faces[f].surface.name(),
            area,
        };
        Self {
            verb: "inspect",
            file: file.to_owned(),
            format,
            name: name.clone(),
            unit: unit.clone(),
            solids: brep.solids.len(),
            voids: brep.solids.iter().map(|s| s.voids.len()).sum(),
            faces: areas.into_iter().enumerate().map(face).collect(),
            edges: brep.edges.len(),
            vertices: brep.vertices.len(),
            euler,
            volume,
            area,
            centroid,
            gap,
            stated: StatedReport {
                volume: properties.volume,
                area: properties.area,
                centroid: properties.centroid,
                gap: properties.gap,
            },
        }
    }
}
