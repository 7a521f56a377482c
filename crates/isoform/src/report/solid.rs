//! The report on a file of solids.

use crate::{SolidMeasures, measure_solid};
use isoform_geom::Point3;
use isoform_io::SolidFile;
use serde::Serialize;

/// What is in a file of solids, as stated and as measured.
#[derive(Clone, Debug, Serialize)]
pub struct SolidReport {
    /// `inspect`.
    pub verb: &'static str,
    /// The file.
    pub file: String,
    /// `step` or `brep.json`.
    pub format: &'static str,
    /// The name of the product.
    pub name: String,
    /// The unit of length, if it is known.
    pub unit: Option<String>,
    /// Solids.
    pub solids: usize,
    /// Voids in them.
    pub voids: usize,
    /// The faces.
    pub faces: Vec<SolidFaceReport>,
    /// Edges.
    pub edges: usize,
    /// Vertices.
    pub vertices: usize,
    /// Vertices − edges + Euler numbers of the faces.
    pub euler: i64,
    /// As measured here.
    pub volume: f64,
    /// As measured here.
    pub area: f64,
    /// As measured here.
    pub centroid: Point3,
    /// Largest distance of places on edges from the surfaces of their faces.
    pub gap: f64,
    /// As the file says.
    pub stated: StatedReport,
}

/// A face of a file of solids.
#[derive(Clone, Debug, Serialize)]
pub struct SolidFaceReport {
    /// Its name.
    pub part: String,
    /// The kind of its surface.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Its area.
    pub area: f64,
}

/// What a file says of its solids.
#[derive(Clone, Debug, Serialize)]
pub struct StatedReport {
    /// The volume.
    pub volume: f64,
    /// The area.
    pub area: f64,
    /// The centre of the volume.
    pub centroid: Point3,
    /// What edges leave their faces by at most.
    pub gap: f64,
}

impl SolidReport {
    /// Measures the solids of a file.
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
