//! A smooth piece of a surface.

use crate::cut::LabelledMesh;
use crate::locus::Locus;
use isoform_geom::{Field, Point3};
use std::sync::Arc;

/// A smooth piece of a surface.
#[derive(Clone)]
pub(crate) struct SmoothPiece {
    /// Part of the mesh that it belongs to.
    pub(crate) part: u32,
    /// Locus of the piece.
    pub(crate) locus: Locus,
    /// Nodes on it, away from its borders if there are such.
    pub(crate) nodes: Vec<Point3>,
    /// Functions that may bound it within its part.
    pub(crate) limits: Vec<Arc<dyn Field>>,
    /// Index of its function: equal for pieces of one function; `None` without one.
    pub(crate) function: Option<usize>,
}

/// Returns the triangles of a part.
pub(crate) fn triangles_of_part(mesh: &LabelledMesh, part: u32) -> Vec<u32> {
    let all = 0..mesh.triangles.len() as u32;
    all.filter(|t| mesh.components[*t as usize] == part)
        .collect()
}
