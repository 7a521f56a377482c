//! Settings and errors of a fit.

/// A local method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LocalMethod {
    /// Levenberg-Marquardt ([`crate::lm`]).
    #[default]
    Lm,
    /// Quasi-Newton ([`crate::bfgs`]), as in paper C.
    Bfgs,
}

/// Method of the minimisation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Method {
    /// Seeded restarts of Levenberg-Marquardt on a subsample until the best minimum recurs, then
    /// comparison of minima and polish.
    #[default]
    Default,
    /// The local method of paper C, from the start alone, on all points.
    Local(LocalMethod),
    /// The simulated annealing of paper C on all points.
    Annealing,
    /// The hybrid of paper C: annealing until the mean of |f| falls below `threshold`, then the
    /// local method. Without a threshold, 0.04 (as in the paper) of the median |f| over random
    /// starts, which does not depend on the scale of f.
    Hybrid {
        /// Local method after the annealing.
        local: LocalMethod,
        /// Root of the mean f² at which the annealing ends, in the units of f.
        threshold: Option<f64>,
    },
}

impl Method {
    /// Methods with a name of their own.
    pub const ALL: [(&str, Self); 5] = [
        ("default", Self::Default),
        (
            "hybrid",
            Self::Hybrid {
                local: LocalMethod::Lm,
                threshold: None,
            },
        ),
        ("local", Self::Local(LocalMethod::Lm)),
        ("bfgs", Self::Local(LocalMethod::Bfgs)),
        ("annealing", Self::Annealing),
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Local(LocalMethod::Lm) => "local",
            Self::Local(LocalMethod::Bfgs) => "bfgs",
            Self::Annealing => "annealing",
            Self::Hybrid { .. } => "hybrid",
        }
    }
}

/// Loss of the polish.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Loss {
    /// Robust if outliers were found, residuals have heavy tails or neighbours share misfit; least
    /// squares otherwise.
    #[default]
    Auto,
    /// Least squares.
    Squares,
    /// Cauchy's loss.
    Cauchy,
    /// Tukey's biweight, reached through Cauchy.
    Tukey,
}

impl Loss {
    /// All losses, each with its name.
    pub const ALL: [(&str, Self); 4] = [
        ("auto", Self::Auto),
        ("squares", Self::Squares),
        ("cauchy", Self::Cauchy),
        ("tukey", Self::Tukey),
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        let is_it = |l: &(&str, Self)| l.1 == self;
        Self::ALL.into_iter().find(is_it).map_or("", |l| l.0)
    }

    /// Returns true if distant points count less than by their square; `Auto` counts as least
    /// squares until it is decided.
    pub(crate) fn is_robust(self) -> bool {
        matches!(self, Self::Cauchy | Self::Tukey)
    }
}

/// Settings of [`crate::fit`]. The defaults are meant for use as they are.
///
/// ```
/// use isoform_fit::{Loss, Options};
///
/// // Bounds on the second of two parameters, and least squares for any residuals.
/// let options = Options {
///     bounds: vec![None, Some((0.0, 2.5))],
///     loss: Loss::Squares,
///     ..Options::default()
/// };
/// assert!(options.filter_outliers && options.start.is_none());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Method of the minimisation.
    pub method: Method,
    /// Loss of the polish.
    pub loss: Loss,
    /// Start of the caller; `None` for the template's start or, without one, one from the data.
    pub start: Option<Vec<f64>>,
    /// True if the start was measured on the points, each value on those of its own face, as
    /// recognition does. If its residuals are noise, no search is made. Otherwise it competes with
    /// the minima of the search, and of exact points those on faces that the template lacks move
    /// nothing. A face of a template that has no points of its own would be held by such points.
    pub is_start_measured: bool,
    /// Bounds by parameter, empty or one each; `None` leaves a parameter to the template and the
    /// data.
    pub bounds: Vec<Option<(f64, f64)>>,
    /// Random seed: one seed gives one result, for any number of threads.
    pub seed: u64,
    /// Largest rounding error of a coordinate, 0 if unknown. Smaller deviations do not count
    /// against a model, and no length is known more accurately.
    pub rounding: f64,
    /// Number of points of the search. Fewer give minima of noise, more only cost time (512: 3 to
    /// 13 % of informed starts end elsewhere).
    pub search_points: usize,
    /// Number of points on which candidates are compared, and of the first level of the polish.
    pub confirm_points: usize,
    /// Minimum number of starts before the search may stop; with a share q of starts that reach the
    /// best minimum, (1 − q)ⁿ of searches miss it.
    pub least_starts: usize,
    /// Maximum number of starts.
    pub most_starts: usize,
    /// Number of times that the best minimum must be found.
    pub recurrences: usize,
    /// Bound on the estimated probability that a minimum as wide as the best one was missed.
    pub miss: f64,
    /// True to refine an uncertain minimum by distances: pieces are perturbed and polished. Off for
    /// quick comparisons of many poses.
    pub refine: bool,
    /// True to filter isolated outliers before the search.
    pub filter_outliers: bool,
    /// Approximate number of samples of the model's surface that are compared with the data, at
    /// most [`MAX_SURFACE_SAMPLES`](crate::MAX_SURFACE_SAMPLES).
    pub surface_samples: usize,
    /// Maximum number of evaluations of the annealing.
    pub annealing_evaluations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::Default,
            loss: Loss::Auto,
            start: None,
            is_start_measured: false,
            bounds: Vec::new(),
            seed: 1,
            rounding: 0.0,
            search_points: 512,
            confirm_points: 2048,
            least_starts: 4,
            most_starts: 64,
            recurrences: 3,
            miss: 1e-3,
            refine: true,
            filter_outliers: true,
            surface_samples: 2000,
            annealing_evaluations: 400_000,
        }
    }
}

/// Reason for which a fit failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A parameter's bounds are in the wrong order, equal or not numbers.
    #[error("bounds of {name} are not an interval: {lo} to {hi}")]
    Bounds {
        /// Name of the parameter.
        name: String,
        /// Lower bound.
        lo: f64,
        /// Upper bound.
        hi: f64,
    },
    /// A tie is circular, names a parameter that does not exist, or has a factor that is not
    /// finite.
    #[error("{name} is tied in a circle or to a parameter that does not exist")]
    Tie {
        /// Name of the parameter.
        name: String,
    },
    /// Every parameter is fixed or tied to fixed ones.
    #[error("no parameter is free")]
    NothingFree,
    /// An input number is NaN or infinite.
    #[error("{what} is not finite (index {index})")]
    NotFinite {
        /// Name of the input.
        what: &'static str,
        /// Index in the input.
        index: usize,
    },
    /// The start or the bounds differ in length from the parameters.
    #[error("{what} has {found} values for {expected} parameters")]
    Length {
        /// Name of the input.
        what: &'static str,
        /// Number of values given.
        found: usize,
        /// Number of parameters of the template.
        expected: usize,
    },
    /// Fewer points than free parameters, or all at one point.
    #[error("{found} distinct points cannot fix {free} free parameters")]
    TooFewPoints {
        /// Number of distinct points, counted up to the number needed.
        found: usize,
        /// Number of free parameters.
        free: usize,
    },
    /// The template is not finite on the points from any of the starts.
    #[error("the template has no finite value on the points from any of {starts} starts")]
    NoFiniteStart {
        /// Number of starts tried.
        starts: usize,
    },
    /// Cancelled or out of time before any result.
    #[error("stopped before there was any result")]
    Stopped,
}
