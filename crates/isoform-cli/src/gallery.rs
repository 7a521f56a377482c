//! The templates that the program carries: one file each in examples/templates/.

use crate::model::{self, Language};
use crate::output::{Context, Failure};
use isoform::field::hyperfun::Model;
use serde_json::{Value, json};
use std::path::Path;

/// Names and programs, in alphabetical order.
static GALLERY: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/gallery.rs"));

/// The program of that name; letters fold, and an ending .hf does not matter.
fn program(name: &str) -> Option<(&'static str, &'static str)> {
    let name = name.strip_suffix(".hf").unwrap_or(name);
    GALLERY
        .iter()
        .copied()
        .find(|(n, _)| n.eq_ignore_ascii_case(name))
}

/// Reads a template: the file if there is one, else the one of that name in the gallery.
pub(crate) fn template(
    path: &Path,
    language: &Language,
    context: &Context,
) -> Result<Model, Failure> {
    if !path.exists() && path != Path::new("-") {
        let name = path.to_string_lossy();
        if let Some((name, text)) = program(&name) {
            return model::parse(Path::new(name), text, language, context);
        }
        let names: Vec<&str> = GALLERY.iter().map(|g| g.0).collect();
        let failure = Failure::input(
            "template",
            format!("no file and no template is called {name}"),
        );
        return Err(failure.hint(format!("a HyperFun file, or one of: {}", names.join(", "))));
    }
    model::read(path, language, context)
}

/// What `fit --list` says: name, what it fits, parameters.
pub(crate) fn list(context: &Context) -> Result<(String, Value), Failure> {
    let mut text = String::new();
    let mut rows = Vec::new();
    let width = GALLERY.iter().map(|g| g.0.len()).max().unwrap_or(0);
    for (name, program) in GALLERY {
        let model = model::parse(Path::new(name), program, &Language::default(), context)?;
        let parameters: Vec<&str> = model.params().iter().map(|p| p.name.as_str()).collect();
        let fits = model.info().fits.clone().unwrap_or_default();
        text += &format!(
            "{name:width$}  {fits}\n{:width$}  {}\n",
            "",
            parameters.join(", ")
        );
        rows.push(json!({"name": name, "title": model.info().title, "fits": fits, "parameters": parameters}));
    }
    if GALLERY.is_empty() {
        text += "this build carries no templates\n";
    }
    Ok((text, json!({"templates": rows})))
}
