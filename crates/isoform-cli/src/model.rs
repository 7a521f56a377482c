//! Reading HyperFun programs.

use crate::output::{self, Context, Failure};
use isoform::field::hyperfun::{Mode, Model};
use std::path::Path;

/// Reads a program, chooses its object and says what is doubtful in it.
pub(crate) fn read(path: &Path, object: Option<&str>, mode: Mode, context: &Context) -> Result<Model, Failure> {
    let text = output::text(output::read_file(path)?);
    let model = Model::parse(&text, mode).map_err(|e| {
        let line = text.strip_prefix('\u{feff}').unwrap_or(&text).split('\n').nth(e.line - 1).unwrap_or_default();
        let failure = Failure::input("syntax", &e.message).at(path, e.line, e.column).drawn(line);
        if e.expected.is_empty() { failure } else { failure.hint(format!("{} there", e.expected)) }
    })?;
    for w in model.warnings() {
        context.warn(format_args!("{}:{}:{}: {}", path.display(), w.line, w.column, w.message));
    }
    model.object(object).map_err(|e| {
        let failure = Failure::usage(format!("{}: no object is called `{}`", path.display(), e.name));
        failure.hint(format!("--object with one of: {}", e.objects.join(", ")))
    })
}
