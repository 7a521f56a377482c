//! Numbers of points and limits that several stages share.

/// Maximum number of points that determine a fit. With a million points the intervals are a few
/// millionths of the size, less than other errors of a scan.
pub(crate) const MAX_FITTED_POINTS: usize = 1 << 20;
/// Number of points of the random order that represent all: in the first minimum of the distance,
/// in the comparison of neighbours, and for the position of order statistics.
pub(crate) const REPRESENTATIVE_POINTS: usize = 20_000;
/// Maximum number of data points at which the bias is computed: the random error of the correction
/// is then some hundredths of its size.
pub(crate) const MAX_BIAS_FEET: usize = 4000;
/// Share of isolated points above which they are clutter: of those near the surface it is unknown
/// if they are part of it. Scans without stray points have less than a tenth of this share.
pub(crate) const CLUTTER_STRAY_SHARE: f64 = 0.04;
/// Significance, in standard deviations, from which residuals are called correlated or a piece
/// misplaced.
pub(crate) const SIGNIFICANT_DEVIATIONS: f64 = 5.0;
/// Number of robust deviations beyond which a point is far off the model: one of 16,000 by noise
/// alone.
pub(crate) const FAR_DEVIATIONS: f64 = 4.0;
/// Number of robust deviations beyond which a point is an outlier, if it is also farther off than a
/// share of the spacing.
pub(crate) const OUTLIER_DEVIATIONS: f64 = 6.0;
