//! Bounds and factors of the noise of a scan.

/// Maximum noise of points that are exact up to rounding, in diagonals.
pub(crate) const MAX_EXACT_NOISE: f64 = 1e-7;
/// Minimum noise, in diagonals: the rounding that a few operations leave.
pub(crate) const MIN_NOISE: f64 = 1e-9;
/// Maximum distance of points that a surface explains, in standard deviations of the noise: 0.3 %
/// of normal errors are larger. Fewer lose points, more take those of neighbours at flat edges.
pub(crate) const EXPLAINED_DEVIATIONS: f64 = 3.0;
/// Number of standard deviations up to which a difference is taken for chance. Of ten thousand
/// differences one is larger by chance.
pub(crate) const CHANCE_DEVIATIONS: f64 = 4.0;
/// Median of |x| of a standard normal deviate.
pub(crate) const NORMAL_MEDIAN: f64 = 0.6745;
