//! How to read and write meshes.

/// How to write a mesh.
#[derive(Clone, Debug, Default)]
pub struct MeshWriteOptions {
    /// Text or binary where the format has both; else, and by default, what is usual: text for
    /// .msh, binary for .vtu, .stl and .ply.
    pub ascii: Option<bool>,
    /// Unit of length of the coordinates, `mm`, `m`, `in`, …, to state where the format can.
    pub units: Option<String>,
}

/// How to read a mesh.
#[derive(Clone, Debug)]
pub struct MeshReadOptions {
    /// Tetrahedra without a triangle get their boundary: faces that belong to one tetrahedron.
    pub boundary: bool,
}

impl Default for MeshReadOptions {
    fn default() -> Self {
        Self { boundary: true }
    }
}
