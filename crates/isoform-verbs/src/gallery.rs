//! The templates of the gallery by their names, and what could be meant by a name that none has.

use crate::context::Context;
use crate::failure::Failure;
use crate::formula;
use crate::kind;
use crate::language::Language;
use crate::memory;
use crate::model::{self, GivenModel};
use crate::terms;
use isoform::field::hyperfun::Model;
use isoform::field::suggestion;
use serde_json::{Value, json};
use std::path::Path;

/// Name of a program that was typed, in messages.
const TYPED: &str = "typed.hf";

/// Reads a model: the file if there is one, else a formula, the value of a program with a file, or
/// the template of that name.
pub(crate) fn model(
    path: &Path,
    language: &Language,
    context: &Context,
) -> Result<GivenModel, Failure> {
    let is_other_file = kind::is_named_file(path) && !kind::is_model(path);
    if !memory::exists(path) && path != Path::new("-") && !is_other_file {
        if let Some(formula) = formula::in_place_of_file(path)? {
            return Ok(GivenModel::Formula(Box::new(formula)));
        }
        let name = path.to_string_lossy();
        if let Some(program) = terms::program(&name) {
            let model = model::parse(Path::new(TYPED), &program, language, context)?;
            return Ok(GivenModel::Program(Box::new(model)));
        }
        if let Some(found) = isoform::template(&name) {
            let model = model::parse(Path::new(found.name), found.program, language, context)?;
            return Ok(GivenModel::Program(Box::new(model)));
        }
        let failure = Failure::input(
            "template",
            format!("no file and no template is called {name}"),
        );
        let all = format!(
            "a HyperFun file, a formula as \"x^2 + y^2 = 1\", or one of: {}",
            names().join(", ")
        );
        let candidates = candidates(path);
        let near = suggestion(&name, candidates.iter().map(String::as_str));
        return Err(failure.hint(match near {
            Some(near) => format!("{near} Else {all}"),
            None => all,
        }));
    }
    model::read(path, language, context)
}

/// Returns true if it is the name of a template or a formula, and of no file.
pub(crate) fn is_named(path: &Path) -> Result<bool, Failure> {
    let text = path.to_string_lossy();
    let is_template = || isoform::template(&text).is_some() || terms::program(&text).is_some();
    let is_free = path != Path::new("-") && !memory::exists(path);
    Ok(is_free && (is_template() || formula::in_place_of_file(path)?.is_some()))
}

/// Reads a template, as [`model`] does; the inside of a formula is the usual one.
pub(crate) fn template(
    path: &Path,
    language: &Language,
    context: &Context,
) -> Result<Model, Failure> {
    model(path, language, context)?.into_stated(path)
}

/// The names of the templates.
pub(crate) fn names() -> Vec<&'static str> {
    isoform::templates().map(|t| t.name).collect()
}

/// Returns candidates for a misspelt name: the templates, and the programs in the named folder.
fn candidates(path: &Path) -> Vec<String> {
    let mut all: Vec<String> = names().into_iter().map(str::to_owned).collect();
    let folder = path.parent().unwrap_or(Path::new(""));
    let here = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let entries = std::fs::read_dir(here).into_iter().flatten().flatten();
    let mut files: Vec<String> = entries
        .map(|e| folder.join(e.file_name()))
        .filter(|f| f.extension().is_some_and(|e| e.eq_ignore_ascii_case("hf")))
        .map(|f| f.display().to_string())
        .collect();
    files.sort();
    all.extend(files);
    all
}

/// Returns the text and document of `fit --list`: name, use and parameters of each template.
pub(crate) fn list(context: &Context) -> Result<(String, Value), Failure> {
    let mut text = String::new();
    let mut rows = Vec::new();
    let width = names().iter().map(|name| name.len()).max().unwrap_or(0);
    for template in isoform::templates() {
        let name = template.name;
        let language = Language::default();
        let model = model::parse(Path::new(name), template.program, &language, context)?;
        let parameters: Vec<&str> = model.params().iter().map(|p| p.name.as_str()).collect();
        let fits = model.info().fits.clone().unwrap_or_default();
        let list = parameters.join(", ");
        text += &format!("{name:width$}  {fits}\n{:width$}  {list}\n", "");
        rows.push(json!({
            "name": name,
            "title": model.info().title,
            "fits": fits,
            "parameters": parameters,
            "program": template.program,
        }));
    }
    if rows.is_empty() {
        text += "this build carries no templates\n";
    }
    Ok((text, json!({"templates": rows})))
}
