//! Tolerances of solids.

/// Distance within which readers merge points, in sizes of the model; gaps and distances stay ten
/// times below.
pub(crate) const READER_TOLERANCE: f64 = 1e-7;

/// Returns the maximum angle along smooth edges (degrees) if splines may be `tolerance` away from a
/// model of this size.
pub(crate) fn largest_kink(tolerance: f64, size: f64) -> f64 {
    let kink = 0.01 * (tolerance / (1e-6 * size)).max(1.0);
    kink.min(0.1)
}

/// Returns the larger of two figures; infinity if the second is NaN.
pub(crate) fn worse(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}
