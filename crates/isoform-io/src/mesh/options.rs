//! Options for reading and writing meshes.

/// Options for writing a mesh.
#[derive(Clone, Debug, Default)]
pub struct MeshWriteOptions {
    /// True for text and false for binary, if the format has both. The default is text for .msh and
    /// binary for .vtu, .stl and .ply.
    pub ascii: Option<bool>,
    /// Unit of length of the coordinates, `mm`, `m`, `in`, …, stated in the file if the format
    /// allows it.
    pub units: Option<String>,
}

impl MeshWriteOptions {
    /// Returns the metres in the unit of length; `None` if it is unknown.
    pub(super) fn metres(&self) -> Option<f64> {
        Some(match self.units.as_deref()? {
            "um" => 1e-6,
            "mm" => 1e-3,
            "cm" => 1e-2,
            "m" => 1.0,
            "in" => 0.0254,
            "ft" => 0.3048,
            _ => return None,
        })
    }
}

/// Options for reading a mesh.
#[derive(Clone, Debug)]
pub struct MeshReadOptions {
    /// True if a volume mesh without triangles shall get its boundary: the faces that belong to
    /// only one volume element.
    pub boundary: bool,
}

impl Default for MeshReadOptions {
    fn default() -> Self {
        Self { boundary: true }
    }
}
