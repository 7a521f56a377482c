//! The regions of `isoform mesh --regions`: objects of the model's program, or other programs.

use crate::context::Context;
use crate::failure::Failure;
use crate::language::Language;
use crate::memory;
use crate::model;
use crate::parameters::{self, Given};
use isoform::field::hyperfun::Model;
use std::path::Path;

/// A region of a model.
#[derive(Debug)]
pub(crate) struct NamedRegion {
    /// Name of the region.
    pub(crate) name: String,
    /// Model that is positive in the region.
    pub(crate) model: Model,
    /// The values of its parameters.
    pub(crate) values: Vec<f64>,
}

/// Reads the regions of a model whose parameters have some values. Objects of the model's program
/// get these values, programs in files those that they say themselves.
pub(super) fn read(
    given: &[String],
    whole: (&Model, &[f64]),
    language: &Language,
    context: &Context,
) -> Result<Vec<NamedRegion>, Failure> {
    let regions = given.iter();
    regions
        .map(|text| one(text.trim(), whole, language, context))
        .collect()
}

/// Reads one region.
fn one(
    text: &str,
    (whole, values): (&Model, &[f64]),
    language: &Language,
    context: &Context,
) -> Result<NamedRegion, Failure> {
    if text.is_empty() {
        return Err(Failure::usage("--regions has an empty name")
            .hint("names of objects or files, with a comma between two"));
    }
    let path = Path::new(text);
    if path.extension().is_some() || text.contains(std::path::MAIN_SEPARATOR) {
        let language = Language {
            object: None,
            ..language.clone()
        };
        let model = model::read(path, &language, context)?.into_stated(path)?;
        if model.dimension() != 3 {
            let found = model.dimension();
            let message = format!("{text}: the model has {found} coordinates, a solid has 3");
            return Err(Failure::input("dimension", message));
        }
        let stem = memory::name(Path::new(path.file_stem().unwrap_or_default()));
        return Ok(NamedRegion {
            name: stem,
            values: parameters::values(&model, &Given::default(), context)?,
            model,
        });
    }
    let model = whole.clone().object(Some(text)).map_err(|e| {
        Failure::usage(format!("--regions: {e}"))
            .hint("name objects of the program, or files that end in .hf")
    })?;
    let n = model.n_params();
    let Some(values) = values.get(..n) else {
        let has = |n: usize| format!("{n} parameters");
        return Err(Failure::usage(format!(
            "region {text} has {}, {} has {}: a region gets the values of the model",
            has(n),
            whole.name(),
            has(values.len())
        ))
        .hint(format!(
            "declare {text} with no more parameters than {}",
            whole.name()
        )));
    };
    Ok(NamedRegion {
        name: model.name().to_owned(),
        values: values.to_vec(),
        model,
    })
}
