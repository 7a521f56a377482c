//! Approximate rational parameterization of implicit surfaces.
//!
//! E. Wurm, B. Jüttler, M.-S. Kim: Approximate Rational Parameterization of Implicitly Defined Surfaces (2003). A rational
//! tensor-product Bézier patch is fitted to a surface F = 0 by minimising S = I + ω_J J + ω_L L + ω_R R + ω_E E, and grown from a small
//! piece of a tangent plane until S reaches a bound. Any [`Field`] with derivatives will do.
#![forbid(unsafe_code)]

mod distance;
mod exact;
mod grow;
mod local;
mod objective;
mod options;
mod solver;
mod surface;

pub use distance::{Distances, distances, prove, sampled};
pub use grow::{Grown, Phase, Row};
pub use objective::{Derivatives, Evaluated, K, Method, Objective, Targets, Terms, Weights};
pub use options::{Error, Options, PAPER_LIMIT};

use isoform_geom::Field;
use std::time::Instant;

/// The largest degree: beyond it, systems are large and nothing is gained.
pub const MOST_DEGREE: usize = 8;

/// A patch this near to the surface, in diagonals of the region, is exact to rounding.
const EXACT: f64 = 1e-12;

/// Quadrature that is off by more than this share is repeated with more nodes.
const UNRESOLVED: f64 = 0.02;
/// More nodes than this in each direction are not tried.
const MOST_NODES: usize = 40;

/// A patch with what is known of it.
#[derive(Clone, Debug)]
pub struct Parameterized {
    /// The patch and the way to it.
    pub grown: Grown,
    /// How far it is from the surface.
    pub distances: Distances,
    /// Whether S keeps its bound.
    pub is_within_limit: bool,
    /// Whether the patch lies on the surface, to rounding.
    pub is_exact: bool,
    /// Seconds by phase.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Grows one patch on the surface `field` = 0, and proves how far from it the patch is.
pub fn parameterize(field: &dyn Field, options: &Options) -> Result<Parameterized, Error> {
    check(options)?;
    let mut clock = Clock::default();
    let options = &options.relaxed();
    let seed = match options.seed_point {
        Some(p) => surface::given(field, p, &options.region)?,
        None => surface::chosen(field, options.seed, &options.region)?,
    };
    if options.method == Method::Newton && field.jet3(seed.point).is_none() {
        return Err(Error::NoThirdDerivatives);
    }
    clock.phase("seed");
    let mut nodes = options.nodes.unwrap_or(K as usize / 2 * options.degree.0.max(options.degree.1) + 1);
    let (grown, is_within_limit) = loop {
        let objective = Objective::new(field, options.degree, options.method, Some(nodes));
        let mut growth = grow::Growth::start(objective, seed, options)?;
        growth.to_limit();
        if options.exact {
            growth.to_surface();
        }
        growth.to_tolerance();
        let is_within_limit = growth.is_within_limit();
        let grown = growth.finish();
        // Across self-intersections and tight blends integrands have kinks: there, again with more nodes.
        if options.nodes.is_some() || options.tolerance.is_some() || nodes > MOST_NODES || is_resolved(field, &grown, nodes) {
            break (grown, is_within_limit);
        }
        nodes = nodes * 8 / 5;
    };
    clock.phase("grow");
    let distances = distances(field, &grown.patch, options.tolerance);
    clock.phase("certify");
    let is_exact = distances.bound.is_some_and(|b| b <= EXACT * options.region.diagonal());
    Ok(Parameterized { grown, distances, is_within_limit, is_exact, seconds: clock.seconds })
}

/// Whether a rule with more nodes finds nearly the same integrals.
fn is_resolved(field: &dyn Field, grown: &Grown, nodes: usize) -> bool {
    let mut finer = Objective::new(field, grown.patch.degree(), Method::Frozen, Some(nodes * 9 / 5));
    (finer.weights, finer.targets) = (grown.weights, grown.targets);
    let Some(at) = finer.evaluate(&grown.patch) else { return false };
    let sum = grown.sum();
    let near = |a: f64, b: f64, factor: f64| (a - b).abs() <= UNRESOLVED * a.max(b) || factor * (a - b).abs() <= 1e-3 * UNRESOLVED * sum;
    let (a, b, w) = (at.terms, grown.terms, grown.weights);
    near(a.i, b.i, 1.0) && near(a.j, b.j, w.j) && near(a.l, b.l, w.l) && near(a.r, b.r, w.r) && (at.terms.sum(&w) - sum).abs() <= 0.01 * sum
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

fn check(options: &Options) -> Result<(), Error> {
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
