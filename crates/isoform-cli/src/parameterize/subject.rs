//! The surface to parameterize: a HyperFun program or a polynomial.

use crate::model::{self, Language};
use crate::output::{self, Context, Failure};
use crate::{eval, gallery};
use isoform::ImplicitSurface;
use isoform::algebra::ParseError;
use isoform::field::SolidError;
use serde_json::Value;
use std::path::Path;

/// A surface with its name for messages.
pub(super) struct Subject {
    pub(super) name: String,
    pub(super) surface: ImplicitSurface,
    pub(super) warnings: Vec<String>,
}

pub(super) fn read(
    path: &Path,
    language: &Language,
    params: Option<&eval::Parameters>,
    context: &Context,
) -> Result<Subject, Failure> {
    let is_json = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let name = path.display().to_string();
    if is_json || path == Path::new("-") {
        let text = output::text(output::read_file(path)?);
        if is_json || text.trim_start().starts_with('{') {
            if params.is_some() {
                return Err(
                    Failure::usage("a polynomial has no parameters").hint("leave out --params")
                );
            }
            let surface = polynomial(path, &text)?;
            return Ok(Subject {
                name,
                surface,
                warnings: Vec::new(),
            });
        }
        let model = model::parse(path, &text, language, context)?;
        return program(&model, params, name);
    }
    program(&gallery::template(path, language, context)?, params, name)
}

fn program(
    model: &isoform::field::hyperfun::Model,
    params: Option<&eval::Parameters>,
    name: String,
) -> Result<Subject, Failure> {
    let values = eval::values(model, params.map_or(&[], |p| &p.0))?;
    let surface = ImplicitSurface::of_model(model, &values).map_err(|e| {
        let failure = Failure::input("model", format!("{name}: {e}"));
        if matches!(e, SolidError::Dimension { .. }) {
            failure.hint("--object with one of three coordinates")
        } else {
            failure
        }
    })?;
    let warning = "the program is no expression: it is run statement by statement, and nothing is proved of it";
    let warnings = match surface.is_run {
        true => vec![warning.to_owned()],
        false => Vec::new(),
    };
    Ok(Subject {
        name,
        surface,
        warnings,
    })
}

/// The polynomial of a JSON object's key F.
fn polynomial(path: &Path, text: &str) -> Result<ImplicitSurface, Failure> {
    const EXAMPLE: &str = r#"{"F": "x^2 + y^2 + z^2 - 1/4"}"#;
    let shown = if path == Path::new("-") {
        Path::new("stdin")
    } else {
        path
    };
    let json: Value = serde_json::from_str(text).map_err(|e| {
        let (line, column) = (e.line().max(1), e.column().max(1));
        let failure = Failure::input("json", format!("not JSON: {e}")).at(shown, line, column);
        failure
            .drawn(text.lines().nth(line - 1).unwrap_or_default())
            .hint(EXAMPLE)
    })?;
    let wrong = |code, message: String| {
        let mut failure = Failure::input(code, format!("{}: {message}", shown.display()));
        failure.place.file = Some(shown.to_owned());
        failure.place.key = Some("F");
        failure
    };
    let Some(formula) = json.get("F").and_then(Value::as_str) else {
        return Err(wrong("key", "there is no text under the key F".to_owned()).hint(EXAMPLE));
    };
    let parsed = ImplicitSurface::of_polynomial(formula).map_err(|e: ParseError| {
        let mut failure = wrong("polynomial", format!("F, column {}: {e}", e.column))
            .hint("a polynomial in x, y and z with rational coefficients");
        failure.place.column = Some(e.column);
        failure
    })?;
    parsed.ok_or_else(|| {
        wrong(
            "polynomial",
            "F is constant, or has a coefficient beyond the largest number".to_owned(),
        )
        .hint(EXAMPLE)
    })
}
