//! One patch: seed, growth, exactness, tolerance, proof.

use crate::distance::{Distances, distances};
use crate::exact::make_exact;
use crate::grow::{Grown, Growth};
use crate::objective::{Method, Objective};
use crate::options::{Error, Options};
use crate::quadric::quadric;
use crate::{MOST_DEGREE, surface};
use isoform_geom::{Field, Quadric};
use std::time::Instant;

/// A patch whose samples are this near to the surface, in diagonals of the region, is exact to rounding,
const EXACT: f64 = 1e-12;
/// if it is proved to be this near everywhere: where it passes a self-intersection, or the function is no polynomial, proofs end here.
const PROVED: f64 = 1e-6;
/// How much shorter patches become, in turn, at each side where nothing can be proved.
const RETREATS: [f64; 4] = [0.02, 0.03, 0.05, 0.1];

/// A patch with what is known of it.
#[derive(Clone, Debug)]
pub struct Parameterized {
    /// The patch and the way to it.
    pub grown: Grown,
    /// How far it is from the surface.
    pub distances: Distances,
    /// Whether S keeps its bound.
    pub is_within_limit: bool,
    /// Whether the time was over before the patch was as large as it gets.
    pub is_late: bool,
    /// Whether the patch lies on the surface, to rounding.
    pub is_exact: bool,
    /// The quadric on which an exact patch lies, if it does.
    pub quadric: Option<Quadric>,
    /// Seconds by phase.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Grows one patch on the surface `field` = 0, and proves how far from it the patch is.
pub fn parameterize(field: &dyn Field, options: &Options) -> Result<Parameterized, Error> {
    check(options)?;
    let mut clock = Clock::default();
    let (asked, options) = (options, &options.relaxed());
    let seed = match options.seed_point {
        Some(p) => surface::given(field, p, &options.region)?,
        None => surface::chosen(field, options.seed, &options.region)?,
    };
    // Tori and cylinders have exact patches of low degree only along their lines of curvature.
    let seed = if options.exact { surface::frame(field, seed.point, 0.0, options.region.diagonal())? } else { seed };
    if options.method == Method::Newton && field.jet3(seed.point).is_none() {
        return Err(Error::NoThirdDerivatives);
    }
    clock.phase("seed");
    let objective = |degree| Objective::new(field, degree, options.method, options.nodes).with_inner(options.inner);
    let mut growth = Growth::start(objective(options.degree), seed, options)?;
    growth.grow_to_limit();
    if options.exact {
        make_exact(&mut growth, |degree, share| {
            let small = Options { degree, limit: share * asked.limit, tolerance: None, ..*asked };
            let options = if share < 1.0 { small } else { Options { degree, ..*options } };
            let mut other = Growth::start(objective(degree), seed, &options).ok()?;
            other.grow_to_limit();
            Some(other)
        });
    }
    growth.keep_tolerance();
    clock.phase("grow");
    let mut known = distances(field, &growth.patch, options.tolerance);
    // Where nothing can be proved, of a smaller patch it may be.
    for share in RETREATS {
        if known.bound.is_some() || !growth.retreat(share) {
            break;
        }
        known = distances(field, &growth.patch, options.tolerance);
    }
    clock.phase("certify");
    let is_within_limit = growth.is_within_limit();
    let diagonal = options.region.diagonal();
    let is_exact = known.sampled <= EXACT * diagonal && known.bound.is_some_and(|b| b <= PROVED * diagonal);
    let quadric = if is_exact { quadric(&growth.patch) } else { None };
    Ok(Parameterized {
        quadric,
        is_late: growth.is_late,
        grown: growth.finish(),
        distances: known,
        is_within_limit,
        is_exact,
        seconds: clock.seconds,
    })
}

/// Takes the time of phases.
struct Clock {
    since: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Default for Clock {
    fn default() -> Self {
        Self { since: Instant::now(), seconds: Vec::new() }
    }
}

impl Clock {
    /// A phase has ended.
    fn phase(&mut self, name: &'static str) {
        self.seconds.push((name, self.since.elapsed().as_secs_f64()));
        self.since = Instant::now();
    }
}

pub(crate) fn check(options: &Options) -> Result<(), Error> {
    let (m, n) = options.degree;
    if !(1..=MOST_DEGREE).contains(&m) || !(1..=MOST_DEGREE).contains(&n) {
        return Err(Error::Degree(m, n));
    }
    let size = options.region.size();
    if !size.iter().all(|s| *s > 0.0 && s.is_finite()) {
        return Err(Error::Region);
    }
    for (name, value) in [("the bound on S", Some(options.limit)), ("the tolerance", options.tolerance)] {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
            return Err(Error::Option { name, value });
        }
    }
    if let Some(p) = options.seed_point.filter(|p| !p.iter().all(|v| v.is_finite())) {
        return Err(Error::NotFinite { at: p });
    }
    Ok(())
}
