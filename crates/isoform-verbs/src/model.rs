//! Reading HyperFun programs, and level sets of 3MF as programs.

use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::kind::{self, Kind};
use crate::language::{self, Language};
use crate::memory::{self, Object};
use crate::scan;
use isoform::field::hyperfun::{Model, SyntaxError};
use isoform::io::{Source, is_implicit, read_implicit};
use std::path::Path;

/// Code of the failures of programs that do not parse.
const SYNTAX: &str = "syntax";

/// Reads a program, chooses its object and says what is doubtful in it.
pub(crate) fn read(path: &Path, language: &Language, context: &Context) -> Result<Model, Failure> {
    match memory::find(path) {
        Some(Object::Program(model)) if language.is_default() => return Ok(Model::clone(&model)),
        Some(Object::Program(model)) => return parse(path, model.source(), language, context),
        Some(Object::Bytes { .. }) | None => {}
        Some(other) => return Err(other.instead_of("a HyperFun program", path)),
    }
    let bytes = disk::read_file(path)?;
    if let Some(text) = level_sets(path, &bytes, context)? {
        return parse(path, &text, language, context);
    }
    let head = kind::head(&bytes).to_vec();
    let text = disk::text(bytes);
    parse(path, &text, language, context).map_err(|failure| {
        let kind = match failure.code {
            SYNTAX => Kind::detect(path, &head, &text),
            _ => None,
        };
        kind.map_or(failure, |kind| kind.instead_of("a HyperFun program", path))
    })
}

/// Returns true if a file holds a model: by its name a HyperFun program, by its content level sets
/// of 3MF.
pub(crate) fn is_model(path: &Path) -> bool {
    has_ending(path, "hf") || is_level_sets(path)
}

/// Returns true for a 3MF package that builds level sets.
pub(crate) fn is_level_sets(path: &Path) -> bool {
    has_ending(path, "3mf") && memory::find(path).is_none() && is_implicit(Source::Path(path))
}

fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(ending))
}

/// Returns the program of the level sets that a 3MF package builds; `None` for other files.
fn level_sets(path: &Path, bytes: &[u8], context: &Context) -> Result<Option<String>, Failure> {
    let name = memory::name(path);
    let source = Source::Bytes { name: &name, bytes };
    let found = read_implicit(source).map_err(|e| scan::unreadable(path, &e))?;
    let Some(program) = found else {
        return Ok(None);
    };
    for warning in &program.warnings {
        context.warn(format_args!("{}: {warning}", path.display()));
    }
    Ok(Some(program.text))
}

/// Reads a program from text; the path is for messages.
pub(crate) fn parse(
    path: &Path,
    text: &str,
    language: &Language,
    context: &Context,
) -> Result<Model, Failure> {
    let model = language::parse(text, language).map_err(|e| misspelled(&e, path, text))?;
    for w in model.warnings() {
        context.warn(format_args!(
            "{}:{}:{}: {}",
            path.display(),
            w.line,
            w.column,
            w.message
        ));
    }
    model.object(language.object.as_deref()).map_err(|e| {
        let failure = Failure::usage(format!(
            "{}: no object is called `{}`",
            path.display(),
            e.name
        ));
        failure.hint(format!("--object with one of: {}", e.objects.join(", ")))
    })
}

/// The failure of a program that is not HyperFun, with its line drawn.
fn misspelled(error: &SyntaxError, path: &Path, text: &str) -> Failure {
    let line = text
        .strip_prefix('\u{feff}')
        .unwrap_or(text)
        .split('\n')
        .nth(error.line - 1)
        .unwrap_or_default();
    let failure = Failure::input(SYNTAX, &error.message)
        .at(path, error.line, error.column)
        .drawn(line);
    failure.hint(error.hint.clone())
}
