//! The surface to parameterize: a HyperFun program, a formula, or a function fitted to points.

use crate::context::Context;
use crate::failure::Failure;
use crate::gallery;
use crate::language::Language;
use crate::memory;
use crate::model::GivenModel;
use crate::parameters::{self, Given};
use isoform::ImplicitSurface;
use isoform::field::SolidError;
use isoform::geom::Aabb;
use std::path::Path;

/// A surface with its name for messages.
pub(super) struct PatchInput {
    pub(super) name: String,
    pub(super) surface: ImplicitSurface,
    /// Box that holds or shows the surface; `None` if unknown.
    pub(super) bounds: Option<Aabb>,
    pub(super) warnings: Vec<String>,
}

/// Reads a surface: a function fitted to points, a formula, or a model.
pub(super) fn read(
    path: &Path,
    language: &Language,
    given: &Given,
    context: &Context,
) -> Result<PatchInput, Failure> {
    let name = memory::name(path);
    let input = |surface, bounds| PatchInput {
        name: name.clone(),
        surface,
        bounds,
        warnings: Vec::new(),
    };
    match gallery::model(path, language, context)? {
        GivenModel::Formula(formula) => {
            let (surface, bounds) = formula.surface(given, context)?;
            Ok(input(surface, bounds))
        }
        GivenModel::Fitted(fitted) => Ok(input((*fitted).into(), None)),
        GivenModel::Program(model) => program(&model, given, name, context),
    }
}

/// The surface of a HyperFun program.
fn program(
    model: &isoform::field::hyperfun::Model,
    given: &Given,
    name: String,
    context: &Context,
) -> Result<PatchInput, Failure> {
    let values = parameters::values(model, given, context)?;
    let surface = ImplicitSurface::of_model(model, &values).map_err(|e| {
        let failure = Failure::input("model", format!("{name}: {e}"));
        if matches!(e, SolidError::Dimension { .. }) {
            failure.hint("--object with one of three coordinates")
        } else {
            failure
        }
    })?;
    let warning = "the program is no expression: it is run statement by statement, and nothing is proved of it";
    let warnings = if surface.is_run {
        vec![warning.to_owned()]
    } else {
        Vec::new()
    };
    Ok(PatchInput {
        name,
        surface,
        bounds: None,
        warnings,
    })
}
