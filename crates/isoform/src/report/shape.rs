//! Report on the shape of a CAD file.

use super::SolidFaceReport;
use isoform_cad::PreparedShape;
use isoform_geom::Point3;
use isoform_io::ShapeFile;
use serde::Serialize;

/// Report on a STEP file of any program.
#[derive(Clone, Debug, Serialize)]
pub struct ShapeReport {
    /// Name of the verb: `inspect`.
    pub verb: &'static str,
    /// Name of the file.
    pub file: String,
    /// Format of the file: `step`.
    pub format: &'static str,
    /// Name of the product; may be empty.
    pub name: String,
    /// Program that wrote the file, as it says; may be empty.
    pub program: String,
    /// Schema of the file, such as `AUTOMOTIVE_DESIGN`.
    pub schema: String,
    /// Unit of length.
    pub unit: String,
    /// Number of parts in their places.
    pub parts: usize,
    /// Number of solids.
    pub solids: usize,
    /// Number of voids in the solids.
    pub voids: usize,
    /// Number of shells that bound no solid.
    pub surfaces: usize,
    /// Faces, in the order of the file.
    pub faces: Vec<SolidFaceReport>,
    /// Number of edges.
    pub edges: usize,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of edges of solids that do not have a face on each side.
    pub open_edges: usize,
    /// Smallest and largest coordinates of the nodes of the triangles.
    pub bounds: [Point3; 2],
    /// Volume of the solids, in cubic units; `None` if there is none.
    pub volume: Option<f64>,
    /// Total area of the faces, in square units.
    pub area: f64,
    /// Centroid of the volume; `None` without a solid.
    pub centroid: Option<Point3>,
    /// Number of faces whose measures are those of their triangles.
    pub by_triangles: usize,
    /// Largest distance of samples of the edges from the surfaces of their faces, and of the ends
    /// of edges from their vertices.
    pub gap: f64,
    /// Items of the file that are not part of the shape.
    pub remarks: Vec<String>,
}

impl ShapeReport {
    /// Creates the report; the shape of `file` has been moved into `shape`.
    pub fn new(name: &str, file: &ShapeFile, shape: &PreparedShape) -> Self {
        let measures = shape.measures();
        let bounds = shape.bounds();
        let own = shape.shape();
        let face = |(face, area): (&isoform_geom::cad::Face, &f64)| SolidFaceReport {
            part: face.name.clone(),
            kind: face.surface.name(),
            area: *area,
        };
        Self {
            verb: "inspect",
            file: name.to_owned(),
            format: "step",
            name: file.name.clone(),
            program: file.program.clone(),
            schema: file.schema.clone(),
            unit: file.unit.clone(),
            parts: file.parts,
            solids: own.solids.len(),
            voids: own.shells.iter().filter(|s| s.is_void).count(),
            surfaces: own.shells.iter().filter(|s| s.solid.is_none()).count(),
            faces: own.faces.iter().zip(&measures.areas).map(face).collect(),
            edges: own.edges.len(),
            vertices: own.vertices.len(),
            open_edges: measures.open_edges,
            bounds: [bounds.lo, bounds.hi],
            volume: measures.volume,
            area: measures.area,
            centroid: measures.centroid,
            by_triangles: measures.by_triangles,
            gap: measures.gap,
            remarks: file.remarks.clone(),
        }
    }
}
