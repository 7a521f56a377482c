//! Reading implicit splines and polynomials that were fitted to points.

use crate::failure::Failure;
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
