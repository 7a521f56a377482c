//! Settings of a fit as the user gives them: method, starts, bounds, fixed values.

use crate::arguments;
use crate::arguments::one_of;
use crate::disk;
use crate::failure::Failure;
use crate::language::Language;
use crate::parameters;
use clap::builder::PossibleValuesParser;
use isoform::field::hyperfun::Pose;
use isoform::fit::{ClutterKind, Loss, Method};
use isoform::{CadDialect, NamedBounds};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Settings of a fit, shared with `recover`.
#[derive(clap::Args)]
pub(crate) struct Settings {
    #[command(flatten)]
    pub(crate) language: Language,
    /// Start values of the parameters in their order, or auto: the template's, else the data decide
    #[arg(long, value_name = "NUMBERS|auto", allow_hyphen_values = true, value_parser = start)]
    pub(super) start: Option<Start>,
    /// Bounds: a JSON file, {"radius": [1, 5], "2": [0, 1]}
    #[arg(long, value_name = "FILE")]
    pub(super) bounds: Option<PathBuf>,
    /// Search method; hybrid, local, annealing and bfgs are those of Fayolle et al. (2004)
    #[arg(long, default_value = "default", value_parser = one_of(&Method::ALL))]
    pub(super) method: Method,
    /// The loss of the last, metric stage; auto is robust where it must be
    #[arg(long, default_value = "auto", value_parser = one_of(&Loss::ALL))]
    pub(super) loss: Loss,
    /// Hold a parameter at a value; may be repeated
    #[arg(
        long,
        visible_alias = "set",
        value_name = "NAME=VALUE",
        allow_hyphen_values = true,
        value_parser = parameters::setting
    )]
    pub(super) fix: Vec<(String, f64)>,
    /// Motion of the whole template as further parameters [default: as the template says]
    #[arg(long, value_parser = one_of(&Pose::ALL))]
    pub(super) pose: Option<Pose>,
    /// Coordinates of the program, the solid and the mesh that are written
    #[arg(long, value_enum, default_value_t = FrameName::Scan)]
    pub(super) frame: FrameName,
    /// Language of .py files: the program of the part in its own frame
    #[arg(long, default_value = "build123d", value_parser = one_of(&CadDialect::PYTHON))]
    pub(super) dialect: CadDialect,
    /// Keep isolated points
    #[arg(long)]
    pub(super) no_outlier_filter: bool,
    /// Fit tables and walls, too: where a fit is in doubt, planes beyond the part are left out
    #[arg(long)]
    keep_planes: bool,
    /// Fit other objects, too: where a fit is in doubt, points apart from the part are left out
    #[arg(long)]
    keep_apart: bool,
    /// Unit of the scan's numbers [default: as the file says, else guessed from the size]
    #[arg(long, value_parser = PossibleValuesParser::new(UNITS))]
    pub(super) units: Option<String>,
}

/// Units of length of scans.
const UNITS: [&str; 5] = ["mm", "cm", "m", "in", "ft"];

/// Coordinates in which a fitted model is written.
#[derive(Clone, Copy, clap::ValueEnum)]
pub(super) enum FrameName {
    /// Those of the scan
    Scan,
    /// Those of the part: of the template, before its pose
    Part,
}

impl Settings {
    /// Returns the kinds of clutter that are fitted like the rest.
    pub(crate) fn keep(&self) -> Vec<ClutterKind> {
        let kept = [
            (self.keep_planes, ClutterKind::Plane),
            (self.keep_apart, ClutterKind::Apart),
            (self.no_outlier_filter, ClutterKind::Stray),
        ];
        kept.into_iter().filter(|k| k.0).map(|k| k.1).collect()
    }
}

/// Start values of the search.
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
    arguments::numbers(text).map(Start::Values)
}

/// Reads a bounds file: {"NAME or 1-based index": [lo, hi], ...}.
pub(crate) fn bounds(path: &Path) -> Result<NamedBounds, Failure> {
    let text = disk::text(disk::read_file(path)?);
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

/// Makes the failure of an invalid bounds file.
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
