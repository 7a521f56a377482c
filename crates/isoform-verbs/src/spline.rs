//! Reading implicit splines and polynomials that were fitted to points.

use crate::disk;
use crate::failure::Failure;
use crate::kind::{self, Kind, is_fitted};
use crate::memory::{self, Object};
use isoform::io::{
    is_polynomial_file, read_polynomial, read_spline, write_polynomial, write_spline,
};
use isoform::spline::ImplicitSpline;
use isoform::{GlobalPolynomial, Implicit};
use serde_json::Value;
use std::path::Path;

/// Returns the file of a function, as `isoform implicitize` writes it.
pub fn file(function: &Implicit) -> Vec<u8> {
    match function {
        Implicit::Spline(spline) => write_spline(&spline.data()),
        Implicit::Polynomial(polynomial) => write_polynomial(polynomial.data()),
    }
}

/// The function of a file, as `isoform implicitize` writes it.
pub(crate) fn read(path: &Path) -> Result<Implicit, Failure> {
    match memory::find(path) {
        Some(Object::Function(function)) => return Ok(function.0.clone()),
        Some(Object::Bytes { .. }) | None => {}
        Some(other) => return Err(other.instead_of("a function of isoform implicitize", path)),
    }
    let text = disk::text(disk::read_file(path)?);
    let json: Value = serde_json::from_str(&text).map_err(|e| {
        Failure::input("json", format!("not JSON: {e}")).at(
            path,
            e.line().max(1),
            e.column().max(1),
        )
    })?;
    if !is_fitted(&json) {
        return Err(
            match Kind::detect(path, kind::head(text.as_bytes()), &text) {
                Some(kind) if !matches!(kind, Kind::Json) => {
                    kind.instead_of("a function of isoform implicitize", path)
                }
                _ => Failure::input("spline", format!("{}: no implicit spline", path.display()))
                    .hint("isoform implicitize writes one; models are HyperFun programs"),
            },
        );
    }
    of_document(path, &json)
}

/// The function of a document.
pub(crate) fn of_document(path: &Path, json: &Value) -> Result<Implicit, Failure> {
    let wrong = |what: String| Failure::input("spline", format!("{}: {what}", path.display()));
    if is_polynomial_file(json) {
        let data = read_polynomial(json).map_err(|e| wrong(e.to_string()))?;
        let made = GlobalPolynomial::from_data(data).map_err(|e| wrong(e.to_string()))?;
        return Ok(Implicit::Polynomial(made));
    }
    let data = read_spline(json).map_err(|e| wrong(e.to_string()))?;
    let made = ImplicitSpline::from_data(&data).map_err(|e| wrong(e.to_string()))?;
    Ok(Implicit::Spline(made))
}
