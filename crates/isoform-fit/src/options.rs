//! Settings and errors of a fit.

/// A local method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Local {
    /// Levenberg-Marquardt ([`crate::lm`]).
    #[default]
    Lm,
    /// Quasi-Newton ([`crate::bfgs`]), the paper's.
    Bfgs,
}

/// How the minimum is sought.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Method {
    /// Seeded restarts of Levenberg-Marquardt on a subsample until the best minimum recurs,
    /// confirmation, polish.
    #[default]
    Default,
    /// The paper's local method, from the start alone, on all points.
    Local(Local),
    /// The paper's simulated annealing on all points.
    Annealing,
    /// The paper's hybrid: annealing until the mean of |f| falls below `threshold`, then the local
    /// method. Without a threshold, the paper's 0.04 of the median |f| over starts drawn at random,
    /// a rule that needs no knowledge of f's scale.
    Hybrid {
        /// What follows the annealing.
        local: Local,
        /// Root of the mean f² at which it ends, in the units of f.
        threshold: Option<f64>,
    },
}

impl Method {
    /// All methods that have a name of their own.
    pub const ALL: [(&str, Self); 5] = [
        ("default", Self::Default),
        (
            "hybrid",
            Self::Hybrid {
                local: Local::Lm,
                threshold: None,
            },
        ),
        ("local", Self::Local(Local::Lm)),
        ("bfgs", Self::Local(Local::Bfgs)),
        ("annealing", Self::Annealing),
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Local(Local::Lm) => "local",
            Self::Local(Local::Bfgs) => "bfgs",
            Self::Annealing => "annealing",
            Self::Hybrid { .. } => "hybrid",
        }
    }
}

/// The loss of the polish.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Loss {
    /// Robust where outliers were found, residuals have heavy tails or neighbours are off alike,
    /// else least squares.
    #[default]
    Auto,
    /// Least squares.
    Squares,
    /// Cauchy.
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

    /// Whether far points count less than their square; `Auto` counts as least squares until it is
    /// decided.
    pub(crate) fn is_robust(self) -> bool {
        matches!(self, Self::Cauchy | Self::Tukey)
    }
}

/// Settings of [`crate::fit`]. The defaults are meant for use as they are.
///
/// ```
/// use isoform_fit::{Loss, Options};
///
/// // One bound on the second of two parameters, and least squares whatever the residuals say.
/// let options = Options {
///     bounds: vec![None, Some((0.0, 2.5))],
///     loss: Loss::Squares,
///     ..Options::default()
/// };
/// assert!(options.filter_outliers && options.start.is_none());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How the minimum is sought.
    pub method: Method,
    /// Loss of the polish.
    pub loss: Loss,
    /// Start of the caller; else the template's starts, else the data decide.
    pub start: Option<Vec<f64>>,
    /// Bounds by parameter, empty or one each; `None` leaves a parameter to the template and the
    /// data.
    pub bounds: Vec<Option<(f64, f64)>>,
    /// Seed of everything random: one seed, one result, for any number of threads.
    pub seed: u64,
    /// Largest rounding error of a coordinate, 0 if none is known: deviations below it say nothing
    /// against a model, and no length is known better.
    pub rounding: f64,
    /// Points of the search. Fewer make minima of noise, more only cost time (512: 3 to 13 % of
    /// informed starts end elsewhere).
    pub search_points: usize,
    /// Points on which candidates are compared, and the first level of the polish.
    pub confirm_points: usize,
    /// Fewest starts before the search may stop; with a share q of starts that reach the best
    /// minimum, (1 − q)ⁿ of searches miss it.
    pub least_starts: usize,
    /// Most starts.
    pub most_starts: usize,
    /// How often the best minimum must be found.
    pub recurrences: usize,
    /// Bound on the estimated probability that a minimum as wide as the best one was missed.
    pub miss: f64,
    /// Whether a minimum that is not settled is refined by distances: pieces are thrown elsewhere
    /// and led back. Off for quick looks at many ways that a template may stand.
    pub refine: bool,
    /// Whether isolated outliers are filtered before the search.
    pub filter_outliers: bool,
    /// About how many points of the model's surface are compared with the data, at most
    /// [`MOST_SURFACE_SAMPLES`](crate::MOST_SURFACE_SAMPLES).
    pub surface_samples: usize,
    /// Most evaluations of the annealing.
    pub annealing_evaluations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            method: Method::Default,
            loss: Loss::Auto,
            start: None,
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

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A parameter's bounds are in the wrong order, equal or not numbers.
    #[error("bounds of {name} are not an interval: {lo} to {hi}")]
    Bounds {
        /// Parameter.
        name: String,
        /// Lower bound.
        lo: f64,
        /// Upper bound.
        hi: f64,
    },
    /// A tie runs in a circle, names a parameter that does not exist, or has a factor that is not
    /// finite.
    #[error("{name} is tied in a circle or to a parameter that does not exist")]
    Tie {
        /// Parameter.
        name: String,
    },
    /// Every parameter is fixed or tied to fixed ones.
    #[error("no parameter is free")]
    NothingFree,
    /// A number at the door is NaN or infinite.
    #[error("{what} is not finite (index {index})")]
    NotFinite {
        /// Which input.
        what: &'static str,
        /// Where in it.
        index: usize,
    },
    /// The start or the bounds have another length than the parameters.
    #[error("{what} has {found} values for {expected} parameters")]
    Length {
        /// Which input.
        what: &'static str,
        /// Values given.
        found: usize,
        /// Parameters of the template.
        expected: usize,
    },
    /// Fewer points than free parameters, or all in one place.
    #[error("{found} distinct points cannot fix {free} free parameters")]
    TooFewPoints {
        /// Distinct points, counted up to the number needed.
        found: usize,
        /// Free parameters.
        free: usize,
    },
    /// The template has no finite value at the points, from none of the starts.
    #[error("the template has no finite value on the points from any of {starts} starts")]
    NoFiniteStart {
        /// Starts tried.
        starts: usize,
    },
    /// Cancelled or out of time before any result.
    #[error("stopped before there was any result")]
    Stopped,
}
