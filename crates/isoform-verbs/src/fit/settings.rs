//! Starts, bounds and fixed values as the user gives them, for a template's parameters.

use crate::output::{self, Failure};
use isoform::NamedBounds;
use serde_json::Value;
use std::path::Path;

/// Where to start.
#[derive(Clone, Debug)]
pub(crate) enum Start {
    /// The template's own start, else the data decide.
    Auto,
    /// Here.
    Values(Vec<f64>),
}

/// Reads `auto` or numbers with commas.
pub(crate) fn start(text: &str) -> Result<Start, String> {
    if text.trim().eq_ignore_ascii_case("auto") {
        return Ok(Start::Auto);
    }
    output::numbers(text).map(Start::Values)
}

/// Reads a bounds file: {"NAME or 1-based index": [lo, hi], ...}.
pub(crate) fn bounds(path: &Path) -> Result<NamedBounds, Failure> {
    let text = output::text(output::read_file(path)?);
    let document: Value = serde_json::from_str(&text).map_err(|e| {
        let line = text
            .lines()
            .nth(e.line().saturating_sub(1))
            .unwrap_or_default();
        Failure::input("bounds", format!("not a JSON document: {e}"))
            .at(path, e.line().max(1), e.column().max(1))
            .drawn(line)
    })?;
    let Value::Object(entries) = document else {
        return Err(bad_bounds(path, "an object is expected"));
    };
    let interval = |(key, value): (&String, &Value)| {
        // JSON has no infinity: null is an open end.
        let end = |value: &Value, open: f64| match value {
            Value::Null => Some(open),
            value => value.as_f64(),
        };
        let pair = match value.as_array().map(Vec::as_slice) {
            Some([lo, hi]) => end(lo, f64::NEG_INFINITY).zip(end(hi, f64::INFINITY)),
            _ => None,
        };
        let Some((lo, hi)) = pair else {
            return Err(format!("{key}: two numbers are expected, not {value}"));
        };
        // JSON has no NaN.
        if lo >= hi {
            return Err(format!(
                "{key}: the lower bound {lo} is not below the upper bound {hi}"
            ));
        }
        Ok((key.clone(), (lo, hi)))
    };
    let intervals: Result<Vec<_>, String> = entries.iter().map(interval).collect();
    intervals.map_err(|message| bad_bounds(path, &message))
}

/// What is wrong in a bounds file.
pub(crate) fn bad_bounds(path: &Path, message: &str) -> Failure {
    let mut failure = Failure::input("bounds", format!("{}: {message}", path.display()));
    failure.place.file = Some(path.to_owned());
    failure.hint(
        "{\"radius\": [1, 5], \"2\": [0, 1]}: a name or a 1-based index, then lower and upper bound",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_on_the_command_line() {
        assert!(matches!(start("AUTO"), Ok(Start::Auto)));
        assert!(matches!(start("1,-2.5"), Ok(Start::Values(v)) if v == [1.0, -2.5]));
        assert!(start("1,x").is_err());
    }
}
