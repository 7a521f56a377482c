//! Findings against a fit, with their severity.

use crate::phrases::listed;
use std::fmt;

/// Verdict on a fit, from the best to the worst.
///
/// ```
/// use isoform_fit::Verdict;
///
/// assert!(Verdict::Accepted < Verdict::Doubtful && Verdict::Doubtful < Verdict::Refused);
/// assert_eq!(Verdict::Refused.as_str(), "refused");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The template fits, and no finding speaks against it.
    Accepted,
    /// A finding suggests that the template, or its position, could be wrong.
    Doubtful,
    /// The template does not fit.
    Refused,
}

impl Verdict {
    /// The word of the JSON contract.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Doubtful => "doubtful",
            Self::Refused => "refused",
        }
    }
}

/// A reason to distrust a fit. Lengths are in the units of the scan, shares are of 1.
///
/// ```
/// use isoform_fit::{Finding, Verdict};
///
/// let bare = Finding::Bare { share: 0.4 };
/// assert_eq!(bare.verdict(), Verdict::Doubtful);
/// assert_eq!(bare.to_string(), "40 % of the model's surface has no data near it");
/// // If most of the surface is bare, the template does not fit.
/// assert_eq!(Finding::Bare { share: 0.7 }.verdict(), Verdict::Refused);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// The template was derived from the scan and is incomplete.
    Incomplete {
        /// Description of the missing part.
        what: String,
    },
    /// The points lie far off the model.
    FarOff {
        /// Root mean square distance.
        rms: f64,
        /// Diagonal of the data.
        size: f64,
    },
    /// Neighbouring points share a misfit: the shape differs.
    Systematic {
        /// Root mean square of the shared misfit.
        misfit: f64,
        /// Limit of the misfit.
        limit: f64,
        /// True if the limit follows from the thinnest wall.
        is_wall: bool,
    },
    /// Large distances, few of them near zero: two walls on either side of the model, not noise.
    TwoWalls {
        /// Root mean square distance from the model.
        rms: f64,
    },
    /// A piece is off its points while the others show only noise.
    Misplaced {
        /// Name of the piece.
        piece: String,
        /// Root mean square of its points' distances, in deviations of the noise.
        ratio: f64,
    },
    /// Neighbouring points of a piece are off it alike, while most others show only noise.
    Misshapen {
        /// Name of the piece.
        piece: String,
        /// Root mean square of the misfit that its points share.
        misfit: f64,
    },
    /// A group of points off the model on one side, while the others show only noise.
    Together {
        /// Number of points.
        count: usize,
    },
    /// The points are much nearer to the planes of their neighbours than to the model.
    AboveNoise {
        /// Root mean square distance from the model.
        rms: f64,
        /// Deviation of points from planes through their neighbours.
        noise: f64,
    },
    /// Noise of the size of the smallest detail.
    Thin {
        /// Standard deviation of the noise.
        noise: f64,
        /// Smallest wall thickness or gap width of the model.
        detail: f64,
    },
    /// Surface of the model without data.
    Bare {
        /// Share of the surface.
        share: f64,
    },
    /// Surface of the model without data that must have been visible in the views of the rest.
    Overlooked {
        /// Share of the surface.
        share: f64,
    },
    /// Points on surfaces that the template does not have.
    Clusters {
        /// Share of the points.
        share: f64,
    },
    /// Outliers together with bare surface of the model.
    Around {
        /// Share of the surface without data.
        bare: f64,
        /// Share of the points that are outliers.
        share: f64,
    },
    /// Points off the model, of any kind.
    Outliers {
        /// Share of the points.
        share: f64,
    },
    /// A cluster of points off a model that meets the others exactly.
    OffExact {
        /// Number of points in the cluster.
        count: usize,
    },
    /// More than a quarter of the template's own parameters are open.
    Undetermined {
        /// Number of open parameters.
        open: usize,
        /// Number of free parameters.
        free: usize,
    },
    /// The points that the model meets do not outnumber its parameters.
    Untested {
        /// Number of points.
        points: usize,
        /// Number of free parameters.
        free: usize,
    },
    /// Parameters at bounds.
    AtBounds {
        /// Names of the parameters.
        names: Vec<String>,
    },
    /// The search did not reach its best minimum again.
    Uncertain {
        /// Number of starts that led there.
        hits: usize,
        /// Number of all starts.
        starts: usize,
    },
    /// Points in components apart from the rest.
    Apart {
        /// Share of the points.
        share: f64,
    },
    /// Points on a plane that extends beyond the others.
    Table {
        /// Share of the points.
        share: f64,
    },
    /// Isolated points, too many to interpret the others.
    Stray {
        /// Share of the points.
        share: f64,
    },
    /// The model has no surface near the data.
    NoSurface,
}

impl Finding {
    /// Returns the verdict that this finding causes alone.
    pub fn verdict(&self) -> Verdict {
        if self.is_refusal() {
            Verdict::Refused
        } else {
            Verdict::Doubtful
        }
    }

    fn is_refusal(&self) -> bool {
        match self {
            Self::FarOff { .. } | Self::OffExact { .. } | Self::NoSurface => true,
            Self::Outliers { .. } => true,
            Self::Bare { share } => *share > 0.6,
            Self::Clusters { share } => *share > 0.3,
            _ => false,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Incomplete { what } => f.write_str(what),
            Self::FarOff { rms, size } => write!(
                f,
                "the points lie {} off the model (rms), {:.1} % of their size",
                short(*rms),
                100.0 * rms / size
            ),
            Self::Systematic {
                misfit,
                limit,
                is_wall,
            } => write!(
                f,
                "neighbouring points are off the model alike, by {} (rms): the shape differs by \
                 more than {}, {}",
                short(*misfit),
                short(*limit),
                if *is_wall {
                    "a good part of its thinnest wall"
                } else {
                    "what real objects of this size differ by"
                }
            ),
            Self::TwoWalls { rms } => write!(
                f,
                "the points lie {} off the model (rms), most of them to either side and few on it: \
                 two walls, no noise",
                short(*rms)
            ),
            Self::Misplaced { piece, ratio } => write!(
                f,
                "the points of {piece} lie off it by {ratio:.1} times the noise, those of other \
                 pieces do not: it has another size, place or shape"
            ),
            Self::Misshapen { piece, misfit } => write!(
                f,
                "neighbouring points of {piece} are off it alike, by {} (rms), and most other \
                 points show nothing but noise: it has another shape, or ends elsewhere",
                short(*misfit)
            ),
            Self::Together { count } => write!(
                f,
                "{count} points lie together, off the model by more than four times the noise, and \
                 the others show nothing but noise: clutter, or a feature that the template lacks \
                 or has too much"
            ),
            Self::AboveNoise { rms, noise } => write!(
                f,
                "the points lie {} off the model (rms), but only {} off planes through their \
                 neighbours: this is no noise",
                short(*rms),
                short(*noise)
            ),
            Self::Thin { noise, detail } => write!(
                f,
                "the noise ({}) is as large as the smallest detail of the model ({}) allows: which \
                 side of it points belong to is not known",
                short(*noise),
                short(*detail)
            ),
            Self::Bare { share } => write!(
                f,
                "{:.0} % of the model's surface has no data near it",
                100.0 * share
            ),
            Self::Overlooked { share } => write!(
                f,
                "{:.0} % of the model's surface has no data near it, though the scan saw what \
                 faces the same way: holes in the scan, or a shape that is not there",
                100.0 * share
            ),
            Self::Clusters { share } => write!(
                f,
                "{:.0} % of the points are outliers that lie on surfaces of their own: clutter, or \
                 a shape that the template lacks",
                100.0 * share
            ),
            Self::Around { bare, share } => write!(
                f,
                "{:.0} % of the points are outliers, and {:.0} % of the model's surface has no \
                 data near it: the model may lie beside the shape",
                100.0 * share,
                100.0 * bare
            ),
            Self::Outliers { share } => {
                write!(f, "{:.0} % of the points are outliers", 100.0 * share)
            }
            Self::OffExact { count } => write!(
                f,
                "{count} outliers lie together, off a model that meets the other points exactly"
            ),
            Self::Undetermined { open, free } => write!(
                f,
                "{open} of the template's {free} parameters are not determined by the points"
            ),
            Self::Untested { points, free } => write!(
                f,
                "{free} parameters meet {points} points, whatever the template: more points than \
                 parameters are needed to test it"
            ),
            Self::AtBounds { names } => write!(f, "{} ran into bounds", listed(names)),
            Self::Uncertain { hits, starts } => write!(
                f,
                "the best place was found {hits} {} in {starts} {}; there may be a better one",
                if *hits == 1 { "time" } else { "times" },
                if *starts == 1 { "start" } else { "starts" }
            ),
            Self::Apart { share } => write!(
                f,
                "{:.1} % of the points lie apart from the rest: another object, or clutter",
                100.0 * share
            ),
            Self::Table { share } => write!(
                f,
                "{:.1} % of the points lie on a plane that reaches beyond the others: a table?",
                100.0 * share
            ),
            Self::Stray { share } => write!(
                f,
                "{:.0} % of the points looked at are stray outliers",
                100.0 * share
            ),
            Self::NoSurface => f.write_str("the model has no surface near the data"),
        }
    }
}

/// Formats a number with three significant digits.
fn short(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    if !(1e-6..1e9).contains(&v.abs()) {
        return format!("{v:.2e}");
    }
    let digits = (2 - v.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{v:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_three_digits() {
        let texts = [0.0, 12345.6, 0.012345, 1.5e-7, 2e12].map(short);
        assert_eq!(texts, ["0", "12346", "0.0123", "1.50e-7", "2.00e12"]);
    }
}
