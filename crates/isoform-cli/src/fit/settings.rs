//! Starts, bounds and fixed values as the user gives them, for a template's parameters.

use crate::output::{self, Failure};
use isoform::FrepTemplate;
use isoform::fit::{Parameter, Template};
use isoform::geom::{DistanceField, Frame, ParamField, Point3};
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

/// Reads `name=value`.
pub(crate) fn fix(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').ok_or("NAME=VALUE is expected")?;
    let value: f64 = value
        .trim()
        .parse()
        .map_err(|_| format!("`{}` is not a number", value.trim()))?;
    if value.is_finite() {
        Ok((name.trim().to_owned(), value))
    } else {
        Err(format!("`{value}` is not finite"))
    }
}

/// A template with other parameters than its author wrote: the ones the user holds.
pub(crate) struct Adjusted {
    pub(crate) frep: FrepTemplate,
    parameters: Vec<Parameter>,
    /// Per parameter, what is added to a relative value to get the file's: the origin, for the
    /// translations of a pose.
    pub(crate) shift: Vec<f64>,
}

impl Template for Adjusted {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn algebraic(&self) -> &dyn ParamField {
        self.frep.algebraic()
    }
    fn metric(&self) -> &dyn ParamField {
        self.frep.metric()
    }
    fn distance(&self) -> Option<&dyn DistanceField> {
        self.frep.distance()
    }
    fn frame(&self, a: &[f64]) -> Frame {
        self.frep.frame(a)
    }
    fn part_names(&self) -> &[String] {
        self.frep.part_names()
    }
    fn parts(&self, points: &[Point3], a: &[f64], out: &mut [u32]) {
        self.frep.parts(points, a, out);
    }
}

impl Adjusted {
    pub(crate) fn new(frep: FrepTemplate, origin: Point3) -> Self {
        let parameters = frep.parameters().to_vec();
        let own = frep.model().n_params();
        let shift = |(i, p): (usize, &Parameter)| match p.name.as_str() {
            _ if i < own => 0.0,
            "pose_x" => origin[0],
            "pose_y" => origin[1],
            "pose_z" => origin[2],
            _ => 0.0,
        };
        let shift = parameters.iter().enumerate().map(shift).collect();
        Self {
            frep,
            parameters,
            shift,
        }
    }

    /// Whether a motion of the whole template follows its data.
    pub(crate) fn moves(&self) -> bool {
        self.parameters[self.frep.model().n_params()..]
            .iter()
            .any(|p| p.name == "pose_x")
    }

    fn names(&self) -> String {
        self.parameters
            .iter()
            .map(|p| p.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    }

    /// A parameter by name (letters fold), 1-based index, or `a[index]`.
    fn index(&self, key: &str) -> Result<usize, String> {
        let n = self.parameters.len();
        if let Some(i) = self
            .parameters
            .iter()
            .position(|p| p.name.eq_ignore_ascii_case(key))
        {
            return Ok(i);
        }
        let low = key.to_ascii_lowercase();
        let number = low
            .strip_prefix("a[")
            .and_then(|k| k.strip_suffix(']'))
            .unwrap_or(&low);
        match number.trim().parse::<usize>() {
            Ok(i) if (1..=n).contains(&i) => Ok(i - 1),
            Ok(i) => Err(format!(
                "there is no parameter {i}; the template has {n}: {}",
                self.names()
            )),
            Err(_) => Err(format!(
                "no parameter is called {key}; there are {}",
                self.names()
            )),
        }
    }

    /// Holds parameters.
    pub(crate) fn hold(&mut self, fixed: &[(String, f64)]) -> Result<(), Failure> {
        let mut held = Vec::new();
        for (name, value) in fixed {
            let i = self
                .index(name)
                .map_err(|why| Failure::usage(format!("--fix {name}: {why}")))?;
            if held.contains(&i) {
                return Err(Failure::usage(format!(
                    "--fix {name}: {} is held twice",
                    self.parameters[i].name
                )));
            }
            held.push(i);
            let p = &mut self.parameters[i];
            p.fixed = Some(value - self.shift[i]);
            p.tie = None;
        }
        Ok(())
    }

    /// The start for all parameters; the pose may be left to the data.
    pub(crate) fn start(&self, start: Option<&Start>) -> Result<Option<Vec<f64>>, Failure> {
        let Some(Start::Values(values)) = start else {
            return Ok(None);
        };
        let (own, n) = (self.frep.model().n_params(), self.parameters.len());
        if values.len() != n && values.len() != own {
            let pose = if n > own {
                format!(" (or {own}, without the pose)")
            } else {
                String::new()
            };
            let message = format!(
                "--start has {} values for {n} parameters{pose}",
                values.len()
            );
            return Err(Failure::usage(message).hint(format!(
                "values for {}, in this order; or --start auto",
                self.names()
            )));
        }
        let pose = |p: &Parameter| {
            p.start
                .unwrap_or(if p.name == "pose_scale" { 1.0 } else { 0.0 })
        };
        Ok(Some(
            (0..n)
                .map(|i| {
                    values
                        .get(i)
                        .map_or_else(|| pose(&self.parameters[i]), |v| v - self.shift[i])
                })
                .collect(),
        ))
    }

    /// Reads a bounds file: {"NAME or 1-based index": [lo, hi], ...}.
    pub(crate) fn bounds(&self, path: &Path) -> Result<Vec<Option<(f64, f64)>>, Failure> {
        let text = output::text(output::read_file(path)?);
        let bad = |message: String| {
            let mut failure = Failure::input("bounds", format!("{}: {message}", path.display()));
            failure.place.file = Some(path.to_owned());
            failure.hint("{\"radius\": [1, 5], \"2\": [0, 1]}: a name or a 1-based index, then lower and upper bound")
        };
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
            return Err(bad("an object is expected".to_owned()));
        };
        let mut bounds = vec![None; self.parameters.len()];
        for (key, value) in &entries {
            let i = self.index(key).map_err(bad)?;
            let pair = value
                .as_array()
                .map(|v| v.iter().map(Value::as_f64).collect::<Vec<_>>());
            let Some([Some(lo), Some(hi)]) = pair.as_deref() else {
                return Err(bad(format!("{key}: two numbers are expected, not {value}")));
            };
            // JSON has no NaN.
            if lo >= hi {
                return Err(bad(format!(
                    "{key}: the lower bound {lo} is not below the upper bound {hi}"
                )));
            }
            if bounds[i].is_some() {
                return Err(bad(format!(
                    "{key}: {} has bounds already",
                    self.parameters[i].name
                )));
            }
            bounds[i] = Some((lo - self.shift[i], hi - self.shift[i]));
        }
        Ok(bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_on_the_command_line() {
        assert!(matches!(start("AUTO"), Ok(Start::Auto)));
        assert!(matches!(start("1,-2.5"), Ok(Start::Values(v)) if v == [1.0, -2.5]));
        assert!(start("1,x").is_err());
        assert_eq!(fix("a[3]= 2"), Ok(("a[3]".to_owned(), 2.0)));
        assert!(fix("radius").is_err() && fix("r=inf").is_err());
    }
}
