//! Files whose functions are terms of a program.

use super::SourceToken;
use crate::imported::Imported;

/// Kind of a file's function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// `mesh("part.stl")`: the signed distance from closed triangles, positive inside.
    Mesh,
    /// `surface("scan.json")`: the function of the file.
    Surface,
}

impl FileKind {
    /// Returns the name of the function in programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mesh => "mesh",
            Self::Surface => "surface",
        }
    }
}

/// File whose function is a term of a program.
#[derive(Clone, Debug)]
pub struct FileTerm {
    /// Kind of the function.
    pub kind: FileKind,
    /// Name of the file, as written.
    pub path: String,
    /// Accuracy, in units of length; `None` for the default.
    pub accuracy: Option<f64>,
    /// Position of the name in the program.
    pub place: SourceToken,
    /// Absolute path, once the file has been read: programs that are written elsewhere have it.
    pub(crate) found: Option<String>,
    /// The function, once it has been read.
    pub(crate) function: Option<Imported>,
}

impl FileTerm {
    /// Returns the term of a file whose function was not read yet.
    pub(super) fn new(
        function: &str,
        path: &str,
        accuracy: Option<f64>,
        place: SourceToken,
    ) -> Self {
        let is_mesh = function == FileKind::Mesh.name();
        Self {
            kind: if is_mesh {
                FileKind::Mesh
            } else {
                FileKind::Surface
            },
            path: path.to_owned(),
            accuracy,
            place,
            found: None,
            function: None,
        }
    }

    /// Returns true if the function of another term is the function of this one.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        (self.kind, &self.path, self.accuracy) == (other.kind, &other.path, other.accuracy)
    }
}
