//! Names in meshes and messages that the mesher itself chooses.

/// Names of the axes.
pub(crate) const AXES: [char; 3] = ['x', 'y', 'z'];
/// Name of the region outside of all requested regions.
pub const REST: &str = "rest";
