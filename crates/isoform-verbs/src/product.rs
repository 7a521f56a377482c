//! What verbs make, in memory: for callers who want more of it than its document.

use crate::fit::job::Job;
use crate::memory::MapObject;
use crate::solids::Statement;
use isoform::geom::{Mesh, PointCloud};
use isoform::io::ReadReport;
use isoform::patch::Parameterized;
use isoform::{Implicit, ImplicitSurface, ModelBrep, Recognized};
use std::sync::Arc;

/// A result in memory.
pub enum Product {
    /// Points of a file.
    Points(PointCloud, ReadReport),
    /// A template fitted to points.
    Fit(Box<Job>),
    /// A mesh and its unit of length.
    Mesh(Mesh, Option<String>),
    /// Solids of exact faces.
    Solids(Box<ModelBrep>, Statement),
    /// Rational patches on a surface.
    Patches(ImplicitSurface, Vec<Parameterized>),
    /// A triangulated rational surface.
    Map {
        /// Its triangles.
        mesh: Mesh,
        /// Parameters s and t of the nodes.
        parameters: Vec<[f64; 2]>,
        /// The document of --report.
        report: String,
        /// The map, unless the surface consists of patches.
        map: Option<Arc<MapObject>>,
    },
    /// A function fitted to points.
    Function(Implicit),
    /// Entities that were recognised in points.
    Entities(Box<Recognized<'static>>),
}
