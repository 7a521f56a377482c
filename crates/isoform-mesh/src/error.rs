//! Why there is no mesh, and where it may not follow the solid.

use crate::features::ExtentError;
use isoform_control::Stopped;
use isoform_geom::Point3;

/// Why there is no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The solid has no box.
    #[error(transparent)]
    Extent(ExtentError),
    /// An option has no meaning.
    #[error("{name} must be {wanted}, not {value}")]
    Option {
        /// The option.
        name: &'static str,
        /// What it must be.
        wanted: &'static str,
        /// What it is.
        value: f64,
    },
    /// The mesh would not fit.
    #[error("a mesh of size {size} takes about {needed} MiB, {allowed} MiB are allowed")]
    Memory {
        /// Edge length asked for.
        size: f64,
        /// MiB by estimate.
        needed: u64,
        /// MiB allowed.
        allowed: u64,
    },
    /// The function is not a number at a place where the mesh needs it.
    #[error("the function is not a number near ({}, {}, {})", .at[0], .at[1], .at[2])]
    NotANumber {
        /// Where.
        at: Point3,
    },
    /// The solid is so thin or small that no lattice point or edge meets it.
    #[error("nothing of the solid is seen at size {size}")]
    TooCoarse {
        /// Edge length asked for.
        size: f64,
    },
    /// A mesh given to be adapted is no volume mesh of the solid.
    #[error("the mesh given {why}")]
    Input {
        /// What is wrong with it.
        why: String,
    },
    /// A fault of the mesher.
    #[error("the mesher made an error of its own: {what}")]
    Internal {
        /// What it left.
        what: String,
    },
    /// Stopped from outside or by time.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for MeshError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

impl From<ExtentError> for MeshError {
    fn from(error: ExtentError) -> Self {
        match error {
            ExtentError::Stopped => Self::Stopped,
            ExtentError::NotANumber { at } => Self::NotANumber { at },
            error => Self::Extent(error),
        }
    }
}

/// A place where the mesh may not follow the solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// What happened.
    pub message: String,
    /// Where, as far as there is one place.
    pub at: Option<Point3>,
}

impl Warning {
    /// A warning of a place.
    pub(crate) fn at(message: &str, at: Point3) -> Self {
        Self {
            message: message.into(),
            at: Some(at),
        }
    }

    /// One warning for each of the places.
    pub(crate) fn each(message: &str, places: impl IntoIterator<Item = Point3>) -> Vec<Self> {
        places.into_iter().map(|at| Self::at(message, at)).collect()
    }
}
