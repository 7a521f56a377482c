//! The templates of the gallery by their names, and what could be meant by a name that none has.

use crate::context::Context;
use crate::failure::Failure;
use crate::language::Language;
use crate::memory;
use crate::model;
use isoform::field::hyperfun::Model;
use serde_json::{Value, json};
use std::path::Path;

/// Reads a template: the file if there is one, else the one of that name in the gallery.
pub(crate) fn template(
    path: &Path,
    language: &Language,
    context: &Context,
) -> Result<Model, Failure> {
    if !memory::exists(path) && path != Path::new("-") {
        let name = path.to_string_lossy();
        if let Some(found) = isoform::template(&name) {
            return model::parse(Path::new(found.name), found.program, language, context);
        }
        let failure = Failure::input(
            "template",
            format!("no file and no template is called {name}"),
        );
        let all = format!("a HyperFun file, or one of: {}", names().join(", "));
        let near = nearest(&name, &candidates(path));
        return Err(failure.hint(match near.as_slice() {
            [] => all,
            near => format!("did you mean {}? Else {all}", near.join(" or ")),
        }));
    }
    model::read(path, language, context)
}

/// The names of the templates.
pub(crate) fn names() -> Vec<&'static str> {
    isoform::templates().map(|t| t.name).collect()
}

/// What could be meant by a name: the templates, and the programs in the folder that it names.
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

/// Most names that are offered.
const MOST_NAMES: usize = 3;

/// The candidates that differ least from a name, if they differ by a third of its letters at most,
/// and those that begin with it.
pub(crate) fn nearest(name: &str, candidates: &[String]) -> Vec<String> {
    let plain = |s: &str| {
        let low = s.to_lowercase();
        low.strip_suffix(".hf").map_or(low.clone(), str::to_owned)
    };
    let name = plain(name);
    let most = (name.chars().count() / 3).max(1);
    let mut found: Vec<(usize, &String)> = candidates
        .iter()
        .filter_map(|c| {
            let other = plain(c);
            let begins = name.chars().count() > 1 && other.starts_with(&name);
            let steps = edits(&name, &other);
            (begins || steps <= most).then_some((if begins { 1 } else { steps }, c))
        })
        .collect();
    found.sort();
    found
        .into_iter()
        .take(MOST_NAMES)
        .map(|(_, c)| c.clone())
        .collect()
}

/// Letters to add, drop, change or swap with the next one (Damerau 1964, Levenshtein 1966).
fn edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut rows = vec![(0..=b.len()).collect::<Vec<usize>>()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let changed = usize::from(a[i - 1] != b[j - 1]);
            let mut least = (rows[i - 1][j] + 1)
                .min(row[j - 1] + 1)
                .min(rows[i - 1][j - 1] + changed);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

/// What `fit --list` says: name, what it fits, parameters.
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
        }));
    }
    if rows.is_empty() {
        text += "this build carries no templates\n";
    }
    Ok((text, json!({"templates": rows})))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_that_differ() {
        let pairs = [
            ("cup", "cup"),
            ("cpu", "cup"),
            ("cups", "cup"),
            ("kup", "cup"),
        ];
        assert_eq!(pairs.map(|(a, b)| edits(a, b)), [0, 1, 1, 1]);
        assert_eq!(edits("", "abc"), 3);
        assert_eq!(edits("kitten", "sitting"), 3);
    }

    #[test]
    fn names_that_are_near() {
        let all = ["bottle", "box", "cup", "plate-holes", "models/part.hf"].map(str::to_owned);
        let near = |name: &str| nearest(name, &all);
        assert_eq!(near("cpu"), ["cup"]);
        assert_eq!(near("Botle.hf"), ["bottle"]);
        assert_eq!(near("plate"), ["plate-holes"]);
        assert_eq!(near("models/prat.hf"), ["models/part.hf"]);
        assert!(near("teapot").is_empty() && near("").is_empty());
    }
}
