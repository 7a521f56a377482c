//! Results of verbs in memory, for callers who need more than the document.

use crate::fit::job::Job;
use crate::memory::MapObject;
use isoform::geom::{Mesh, PointCloud};
use isoform::io::ReadReport;
use isoform::patch::Parameterized;
use isoform::{Implicit, ImplicitSurface, ModelBrep, Recognized};
use std::path::Path;
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
        /// Triangles of the surface.
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

/// Unit, product name and schema of a file of solids.
#[derive(Clone, Debug, Default)]
pub struct Statement {
    /// Unit of length, if it is known.
    pub unit: Option<String>,
    /// Name of the product.
    pub name: String,
    /// AP214 instead of AP242.
    pub ap214: bool,
}

impl Statement {
    /// Returns the statement of a model that a file or a template names.
    pub(crate) fn named_after(model: &str, unit: Option<String>) -> Self {
        let name = Path::new(model).file_stem().unwrap_or_default();
        Self {
            unit,
            name: name.to_string_lossy().into_owned(),
            ap214: false,
        }
    }
}
