//! Warnings about a fit: facts that a reader should know, although they do not speak against it.

use crate::clutter::kind::ClutterKind;
use std::fmt;

/// A fact to know about a fit. Shares are of 1.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The fit was cancelled or reached its time limit.
    Stopped,
    /// Too many points look isolated for these to be left out of the search.
    Isolated {
        /// Share of the points examined.
        share: f64,
    },
    /// Isolated points were left out of the search.
    LeftOut {
        /// Share of the points examined.
        share: f64,
    },
    /// Points far off the model.
    Outliers {
        /// Number of outliers.
        count: usize,
        /// Number of all points.
        points: usize,
    },
    /// Only a part of the points determined the parameters.
    SomeFitted {
        /// Number of points that were fitted.
        count: usize,
        /// Number of all points.
        points: usize,
    },
    /// A parameter at a bound.
    AtBound {
        /// Name of the parameter.
        name: String,
        /// Bounds of the parameter.
        bounds: (f64, f64),
    },
    /// Surface of the model near the data, but outside their box.
    Outside {
        /// Share of the surface.
        share: f64,
    },
    /// Points of clutter that were left out.
    Beside {
        /// Kind of clutter.
        why: ClutterKind,
        /// Number of points of this kind.
        count: usize,
        /// Number of all points.
        points: usize,
    },
    /// Points that repeat an earlier one.
    Repeated {
        /// Number of these points.
        count: usize,
        /// Number of all points.
        points: usize,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stopped => f.write_str("stopped early: this is the best so far"),
            Self::Isolated { share } => write!(
                f,
                "{:.0} % of the points look isolated; none was left out of the search",
                100.0 * share
            ),
            Self::LeftOut { share } => write!(
                f,
                "{:.1} % of the points are isolated and were left out of the search",
                100.0 * share
            ),
            Self::Outliers { count, points } => write!(
                f,
                "{count} of {points} points ({:.1} %) are outliers",
                100.0 * (*count as f64 / (*points).max(1) as f64)
            ),
            Self::SomeFitted { count, points } => write!(
                f,
                "{count} of {points} points were fitted: more would not narrow an interval by a \
                 tenth"
            ),
            Self::AtBound { name, bounds } => {
                write!(f, "{name} ran into a bound ({} to {})", bounds.0, bounds.1)
            }
            Self::Outside { share } => write!(
                f,
                "{:.0} % of the model's surface near the data lies outside their box",
                100.0 * share
            ),
            Self::Beside { why, count, points } => write!(
                f,
                "{count} points ({:.1} %) lie {} and were left out",
                100.0 * *count as f64 / *points as f64,
                match why {
                    ClutterKind::Plane => "on a plane beyond the part",
                    ClutterKind::Apart => "apart from the part",
                    ClutterKind::Stray => "astray",
                }
            ),
            Self::Repeated { count, points } => write!(
                f,
                "{count} of {points} points repeat another one exactly and count once"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_in_per_cent() {
        let stray = Warning::Beside {
            why: ClutterKind::Stray,
            count: 3,
            points: 200,
        };
        assert_eq!(
            stray.to_string(),
            "3 points (1.5 %) lie astray and were left out"
        );
        assert_eq!(
            Warning::Outliers {
                count: 1,
                points: 8
            }
            .to_string(),
            "1 of 8 points (12.5 %) are outliers"
        );
    }
}
