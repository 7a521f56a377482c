//! Formulas in place of files: `isoform mesh "x^2 + y^2 + z^4 = 1"`, and files `{"F": "…"}`.

use crate::context::Context;
use crate::failure::Failure;
use crate::kind;
use crate::memory;
use crate::model::SolidModel;
use crate::parameters::{self, Given};
use isoform::field::hyperfun::Model;
use isoform::geom::Aabb;
use isoform::{FormulaError, FormulaSolid, FormulaSurface, ImplicitSurface};
use serde_json::Value;
use std::path::Path;

/// An example of the JSON that is read, for hints.
pub(crate) const EXAMPLE: &str = r#"{"F": "x^2 + y^2 + z^2 - 1/4"}"#;

/// Characters of formulas that names of files and templates rarely have.
const OPERATORS: &str = "^*+=<>(²³≤≥";

/// A formula with what its file says of it.
pub(crate) struct StatedFormula {
    /// Surface of the formula.
    pub(crate) surface: FormulaSurface,
    /// Values of parameters.
    pub(crate) defaults: Vec<(String, f64)>,
    /// Region in which the surface is shown.
    pub(crate) region: Option<Aabb>,
    /// True if it was typed in place of a file. Patches of files have the region of the paper.
    is_typed: bool,
}

/// Returns the formula that stands in place of a file: a path that names nothing, and reads as a
/// formula.
pub(crate) fn in_place_of_file(path: &Path) -> Result<Option<StatedFormula>, Failure> {
    let text = path.to_string_lossy();
    if path == Path::new("-")
        || memory::exists(path)
        || isoform::template(&text).is_some()
        || kind::is_named_file(path)
        // Text of a program, or of a term of one.
        || text.contains(['{', ';', '\n', '"'])
    {
        return Ok(None);
    }
    let surface = match FormulaSurface::parse(&text) {
        Ok(surface) => surface,
        Err(error) if text.contains(|c| OPERATORS.contains(c)) => {
            return Err(refused(&error, None, &text));
        }
        Err(_) => return Ok(None),
    };
    Ok(Some(StatedFormula {
        surface,
        defaults: Vec::new(),
        region: None,
        is_typed: true,
    }))
}

/// Returns the formula of a document with the key F; `None` for other documents.
pub(crate) fn of_document(path: &Path, json: &Value) -> Result<Option<StatedFormula>, Failure> {
    let text = match json.get("F") {
        Some(Value::String(text)) => text.clone(),
        Some(Value::Number(constant)) => constant.to_string(),
        _ => return Ok(None),
    };
    let surface = FormulaSurface::parse(&text).map_err(|e| refused(&e, Some(path), &text))?;
    let mut defaults = Vec::new();
    for name in &surface.parameters {
        let Some(value) = json.get(name) else {
            continue;
        };
        let number = match value {
            Value::Number(number) => number.as_f64(),
            Value::String(text) => text.trim().parse().ok(),
            _ => None,
        };
        let number = number.filter(|v: &f64| v.is_finite()).ok_or_else(|| {
            let message = format!("{}: {name}: {value} is not a number", path.display());
            Failure::input("formula", message)
        })?;
        defaults.push((name.clone(), number));
    }
    Ok(Some(StatedFormula {
        surface,
        defaults,
        region: region_of_document(path, json)?,
        is_typed: false,
    }))
}

/// Returns the box of a document: half a width, as a number or text, or six numbers.
pub(crate) fn region_of_document(path: &Path, json: &Value) -> Result<Option<Aabb>, Failure> {
    let text = match json.get("box") {
        None | Some(Value::Null) => return Ok(None),
        Some(Value::String(text)) => text.clone(),
        Some(Value::Array(list)) => {
            let words: Vec<String> = list.iter().map(Value::to_string).collect();
            words.join(",")
        }
        Some(other) => other.to_string(),
    };
    let region = crate::layers::place(&text).map_err(|problem| {
        let mut failure = Failure::input("box", format!("{}: box: {problem}", path.display()));
        failure.place.file = Some(path.to_owned());
        failure.place.key = Some("box");
        failure
    })?;
    Ok(Some(region.region()))
}

impl StatedFormula {
    /// Returns the model with the inside that the formula states, or that is usual.
    pub(crate) fn stated(&self) -> Result<Model, Failure> {
        self.surface
            .stated_model(&self.defaults)
            .map_err(without_model)
    }

    /// Returns the model with the function as written.
    pub(crate) fn as_written(&self) -> Result<Model, Failure> {
        self.surface
            .model(&self.defaults, false)
            .map_err(without_model)
    }

    /// Returns the values of the parameters, and says which are taken that nobody gave.
    fn values(&self, given: &Given, context: &Context) -> Result<Vec<f64>, Failure> {
        let values = parameters::values(&self.stated()?, given, context)?;
        let is_given = |name: &str| {
            given.names(&self.surface.parameters).any(|n| n == name)
                || self.defaults.iter().any(|(n, _)| n == name)
        };
        let assumed = self
            .surface
            .parameters
            .iter()
            .filter(|name| !is_given(name));
        let assumed: Vec<String> = assumed.map(|name| format!("{name}=1")).collect();
        if !assumed.is_empty() {
            context.warn(format_args!(
                "values that are not given: {}; --set {} changes one",
                assumed.join(", "),
                assumed[0]
            ));
        }
        Ok(values)
    }

    /// Returns the solid that the surface bounds.
    pub(crate) fn solid(
        &self,
        given: &Given,
        region: Option<Aabb>,
        context: &Context,
    ) -> Result<SolidModel, Failure> {
        let values = self.values(given, context)?;
        let stated = region.or(self.region);
        let control = context.control();
        let found = self
            .surface
            .solid(&values, &self.defaults, stated, &control);
        let FormulaSolid { model, region } = found.map_err(without_model)?;
        if let Some(region) = region.filter(|_| stated.is_none()) {
            let corners = region.lo.iter().chain(&region.hi).map(f64::to_string);
            context.warn(format_args!(
                "the surface has no end: it is cut by --box={}",
                corners.collect::<Vec<_>>().join(",")
            ));
        }
        Ok(SolidModel {
            model,
            values,
            region,
            is_surface: self.surface.is_equation(),
        })
    }

    /// Returns the surface, and a box that holds or shows it; `None` if it has none.
    pub(crate) fn surface(
        &self,
        given: &Given,
        context: &Context,
    ) -> Result<(ImplicitSurface, Option<Aabb>), Failure> {
        let values = self.values(given, context)?;
        let surface = self
            .surface
            .surface(&values, &self.defaults)
            .map_err(without_model)?;
        let control = context.control();
        let bounds = match self.region {
            None if self.is_typed => self.surface.bounds(&values, &self.defaults, &control).ok(),
            region => region,
        };
        Ok((surface, bounds))
    }
}

/// Returns the failure of a formula without a model.
fn without_model(error: FormulaError) -> Failure {
    Failure::input("formula", error.to_string()).hint(error.hint())
}

/// Returns the failure of a text that is not the formula of a surface, with its place drawn.
fn refused(error: &FormulaError, path: Option<&Path>, text: &str) -> Failure {
    let message = match path {
        Some(path) => format!("{}: F: {error}", path.display()),
        None => format!("no file is called {text}, and it is not a formula: {error}"),
    };
    let mut failure = Failure::input("formula", message).hint(error.hint());
    failure.place.column = error.column();
    failure.place.file = path.map(Path::to_owned);
    failure.place.key = path.map(|_| "F");
    failure
}
