//! What has a surface: a program with values, or a function fitted to points.

use crate::error::Trouble;
use crate::implicitize::Fitted;
use crate::model::Program;
use isoform::{ImplicitSurface, SplineDistance};
use pyo3::prelude::*;

/// A function of space.
#[derive(FromPyObject)]
pub(crate) enum Shape {
    /// A program with the values of its first parameters.
    Model(Py<Program>, Vec<f64>),
    /// A function fitted to points.
    #[pyo3(transparent)]
    Fitted(Py<Fitted>),
}

impl Shape {
    /// With the values of all parameters.
    pub(crate) fn checked(self) -> Result<Self, Trouble> {
        Ok(match self {
            Self::Model(program, given) => {
                let values = program.get().values_of(&given)?;
                Self::Model(program, values)
            }
            fitted @ Self::Fitted(_) => fitted,
        })
    }

    /// Its surface, for patches.
    pub(crate) fn surface(&self) -> Result<ImplicitSurface, Trouble> {
        match self {
            Self::Model(program, values) => {
                Ok(ImplicitSurface::of_model(program.get().model(), values)?)
            }
            Self::Fitted(fitted) => {
                let SplineDistance(function) = fitted.get().metric().clone();
                Ok(function.into())
            }
        }
    }
}
