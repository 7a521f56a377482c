//! Arithmetic on vectors of any length.

/// Returns the inner product.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Returns the Euclidean length.
pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Returns a − b.
pub(crate) fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}

/// Returns the products aᵢ bᵢ.
pub(crate) fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x * y).collect()
}

/// Multiplies all numbers by a factor.
pub(crate) fn scale(a: &mut [f64], by: f64) {
    a.iter_mut().for_each(|v| *v *= by);
}

/// Adds b to a.
pub(crate) fn add(a: &mut [f64], b: &[f64]) {
    a.iter_mut().zip(b).for_each(|(x, y)| *x += y);
}

/// Returns the largest |aᵢ − bᵢ|.
pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    let off = a.iter().zip(b).map(|(x, y)| (x - y).abs());
    off.fold(0.0, f64::max)
}

/// Returns true if all numbers are finite.
pub(crate) fn is_finite(a: &[f64]) -> bool {
    a.iter().all(|v| v.is_finite())
}
