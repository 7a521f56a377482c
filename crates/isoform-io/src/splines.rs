//! Functions fitted to points as JSON: implicit splines, and polynomials.
//!
//! ```json
//! {"schema": 1, "kind": "implicit_spline", "degree": 3, "corner": [x, y, z], "spacing": h,
//!  "count": [i, j, k], "levels": [{"cells": [i, j, k, …], "coefficients": [c, …]}, …]}
//! ```
//!
//! The function is a sum of tensor-product B-splines on lattices of cells with the edges h, h/2,
//! h/4, …; the first lattice has `count` cells and starts at `corner`. `cells` lists, by three
//! indices each, the cells of a level that contain data. `coefficients` belong to the B-splines
//! whose support meets one of them (on the first level to all), ordered by z, then y, then x.
//! Coefficients of other B-splines follow from the previous level by the two-scale relation.
//!
//! ```json
//! {"schema": 1, "kind": "implicit_polynomial", "degree": 4, "origin": [x, y, z], "unit": u,
//!  "coefficients": [c, …], "corner": [x, y, z], "spacing": h, "count": [i, j, k],
//!  "cells": [i, j, k, …]}
//! ```
//!
//! With q = (p − origin)/unit, f(p) is the sum of c qxⁱ qyʲ qzᵏ over i + j + k ≤ degree, ordered by
//! k, then j, then i. The lattice contains the points.

use isoform_geom::{LevelData, Point3, PolynomialData, SplineData};
use serde_json::{Value, json};

/// Value of the key `kind` of a spline.
const SPLINE_KIND: &str = "implicit_spline";

/// Value of the key `kind` of a polynomial.
const POLYNOMIAL_KIND: &str = "implicit_polynomial";

/// Reason why a document is not an implicit spline or polynomial.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: {problem}")]
pub struct SplineFileError {
    /// Key with the problem.
    pub at: String,
    /// Description of the problem.
    pub problem: &'static str,
}

/// Returns true if a JSON document is an implicit spline.
pub fn is_spline_file(json: &Value) -> bool {
    json.get("kind").and_then(Value::as_str) == Some(SPLINE_KIND)
}

/// Returns true if a JSON document is a polynomial fitted to points.
pub fn is_polynomial_file(json: &Value) -> bool {
    json.get("kind").and_then(Value::as_str) == Some(POLYNOMIAL_KIND)
}

/// Writes an implicit spline. Equal splines give equal bytes.
///
/// ```
/// use isoform_geom::{LevelData, SplineData};
/// use isoform_io::{read_spline, write_spline};
/// let level = LevelData { cells: vec![[0, 0, 0]], coefficients: vec![0.5; 27] };
/// let spline = SplineData {
///     degree: 2,
///     corner: [0.0, 1.0, 2.0],
///     spacing: 0.25,
///     count: [1, 1, 1],
///     levels: vec![level],
/// };
/// let bytes = write_spline(&spline);
/// assert_eq!(read_spline(&serde_json::from_slice(&bytes)?)?, spline);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_spline(spline: &SplineData) -> Vec<u8> {
    let level = |level: &LevelData| {
        json!({
            "cells": level.cells.as_flattened(),
            "coefficients": level.coefficients,
        })
    };
    let levels: Vec<Value> = spline.levels.iter().map(level).collect();
    let mut bytes = json!({
        "schema": 1,
        "kind": SPLINE_KIND,
        "degree": spline.degree,
        "corner": spline.corner,
        "spacing": spline.spacing,
        "count": spline.count,
        "levels": levels,
    })
    .to_string()
    .into_bytes();
    bytes.push(b'\n');
    bytes
}

/// Reads the data of an implicit spline. Their consistency is not checked here.
///
/// # Errors
/// [`SplineFileError`] if a key is missing or has a wrong value.
pub fn read_spline(json: &Value) -> Result<SplineData, SplineFileError> {
    if !is_spline_file(json) {
        return Err(wrong("kind", "implicit_spline is expected"));
    }
    let levels = json.get("levels").and_then(Value::as_array);
    let levels = levels.ok_or_else(|| wrong("levels", "a list is expected"))?;
    Ok(SplineData {
        degree: whole(json, "degree")?,
        corner: point(json, "corner")?,
        spacing: number(json, "spacing")?,
        count: count(json)?,
        levels: levels
            .iter()
            .enumerate()
            .map(|(i, level)| read_level(i, level))
            .collect::<Result<_, _>>()?,
    })
}

/// Writes a polynomial fitted to points. Equal polynomials give equal bytes.
///
/// ```
/// use isoform_geom::PolynomialData;
/// use isoform_io::{read_polynomial, write_polynomial};
/// // z/4 about (1, 0, 0).
/// let plane = PolynomialData {
///     degree: 1,
///     origin: [1.0, 0.0, 0.0],
///     unit: 2.0,
///     coefficients: vec![0.0, 0.0, 0.0, 0.5],
///     corner: [0.0, -1.0, -1.0],
///     spacing: 0.5,
///     count: [4; 3],
///     cells: vec![[1, 2, 1]],
/// };
/// let bytes = write_polynomial(&plane);
/// assert_eq!(read_polynomial(&serde_json::from_slice(&bytes)?)?, plane);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_polynomial(polynomial: &PolynomialData) -> Vec<u8> {
    let mut bytes = json!({
        "schema": 1,
        "kind": POLYNOMIAL_KIND,
        "degree": polynomial.degree,
        "origin": polynomial.origin,
        "unit": polynomial.unit,
        "coefficients": polynomial.coefficients,
        "corner": polynomial.corner,
        "spacing": polynomial.spacing,
        "count": polynomial.count,
        "cells": polynomial.cells.as_flattened(),
    })
    .to_string()
    .into_bytes();
    bytes.push(b'\n');
    bytes
}

/// Reads the data of a polynomial. Their consistency is not checked here.
///
/// # Errors
/// [`SplineFileError`] if a key is missing or has a wrong value.
pub fn read_polynomial(json: &Value) -> Result<PolynomialData, SplineFileError> {
    if !is_polynomial_file(json) {
        return Err(wrong("kind", "implicit_polynomial is expected"));
    }
    let coefficients = json.get("coefficients").and_then(numbers);
    let cells = json.get("cells").and_then(places);
    Ok(PolynomialData {
        degree: whole(json, "degree")?,
        origin: point(json, "origin")?,
        unit: number(json, "unit")?,
        coefficients: coefficients
            .ok_or_else(|| wrong("coefficients", "a list of numbers is expected"))?,
        corner: point(json, "corner")?,
        spacing: number(json, "spacing")?,
        count: count(json)?,
        cells: cells.ok_or_else(|| wrong("cells", "whole numbers are expected, three per cell"))?,
    })
}

fn wrong(at: &str, problem: &'static str) -> SplineFileError {
    SplineFileError {
        at: at.to_owned(),
        problem,
    }
}

fn whole(json: &Value, key: &str) -> Result<usize, SplineFileError> {
    let value = json.get(key).and_then(Value::as_u64);
    let value = value.and_then(|v| usize::try_from(v).ok());
    value.ok_or_else(|| wrong(key, "a whole number is expected"))
}

fn number(json: &Value, key: &str) -> Result<f64, SplineFileError> {
    let value = json.get(key).and_then(Value::as_f64);
    value.ok_or_else(|| wrong(key, "a number is expected"))
}

fn point(json: &Value, key: &str) -> Result<Point3, SplineFileError> {
    let value = json.get(key).and_then(numbers);
    let value = value.and_then(|c| Point3::try_from(c).ok());
    value.ok_or_else(|| wrong(key, "three numbers are expected"))
}

fn count(json: &Value) -> Result<[i32; 3], SplineFileError> {
    let value = json.get("count").and_then(places);
    let value = value.filter(|c| c.len() == 1).map(|c| c[0]);
    value.ok_or_else(|| wrong("count", "three whole numbers are expected"))
}

fn read_level(i: usize, level: &Value) -> Result<LevelData, SplineFileError> {
    let wrong = |key: &str, problem| SplineFileError {
        at: format!("level {}, {key}", i + 1),
        problem,
    };
    Ok(LevelData {
        cells: level
            .get("cells")
            .and_then(places)
            .ok_or_else(|| wrong("cells", "whole numbers are expected, three per cell"))?,
        coefficients: level
            .get("coefficients")
            .and_then(numbers)
            .ok_or_else(|| wrong("coefficients", "a list of numbers is expected"))?,
    })
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

/// Parses triples of integers.
fn places(value: &Value) -> Option<Vec<[i32; 3]>> {
    let whole = |v: &Value| v.as_i64().and_then(|v| i32::try_from(v).ok());
    let list: Option<Vec<i32>> = value.as_array()?.iter().map(whole).collect();
    let (threes, rest) = list.as_ref()?.as_chunks::<3>();
    rest.is_empty().then(|| threes.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_said() {
        let said = |text: &str| {
            let json: Value = serde_json::from_str(text).expect("JSON");
            read_spline(&json).expect_err(text).to_string()
        };
        assert_eq!(said("{}"), "kind: implicit_spline is expected");
        let with = |keys: &str| said(&format!("{{\"kind\": \"implicit_spline\", {keys}}}"));
        assert_eq!(with("\"levels\": 3"), "levels: a list is expected");
        assert_eq!(
            with("\"levels\": [], \"degree\": -1"),
            "degree: a whole number is expected"
        );
        assert_eq!(
            with("\"levels\": [], \"degree\": 3, \"corner\": [1, 2]"),
            "corner: three numbers are expected"
        );
        let all = "\"degree\": 3, \"corner\": [0, 0, 0], \"spacing\": 1, \"count\": [1, 1, 1]";
        assert_eq!(
            with(&format!("{all}, \"levels\": [{{\"cells\": [1, 2]}}]")),
            "level 1, cells: whole numbers are expected, three per cell"
        );
        assert_eq!(
            with(&format!(
                "{all}, \"levels\": [{{\"cells\": [], \"coefficients\": [null]}}]"
            )),
            "level 1, coefficients: a list of numbers is expected"
        );
    }
}
