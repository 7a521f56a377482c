//! Proof of a grown patch: a bound on its distance from the surface, and the absence of folds.

use crate::distance::{Distances, distances_on};
use crate::fold;
use crate::grow::Growth;
use crate::options::Error;
use crate::parameterized::{Clock, Parameterized};
use crate::surface::SURFACE_DISTANCE_TOLERANCE;
use crate::whole::NearSingular;

/// Fractions by which patches are shortened at each side, in turn, as long as nothing can be
/// proved.
const RETREAT_SHARES: [f64; 4] = [0.02, 0.03, 0.05, 0.1];
/// Fraction of the region's diagonal below which distances are rounding errors.
const ROUNDING_DISTANCE: f64 = 1e-13;

/// Proved and measured properties of a growing patch.
struct ProvedProperties {
    distances: Distances,
    /// Parameters of a point from which a loose bound comes.
    place: Option<(f64, f64)>,
    /// Parameters of a point where the patch may fold over.
    fold: Option<(f64, f64)>,
}

impl ProvedProperties {
    /// Proves what can be proved of a patch. If `bound` is given, that bound and the absence of
    /// folds are already proved.
    fn prove(growth: &Growth<'_>, bound: Option<f64>) -> Self {
        let (tolerance, whole) = (growth.options.tolerance, growth.on().whole);
        let (distances, place) =
            distances_on(whole, &growth.patch, tolerance, bound, growth.control);
        let fold = match bound {
            Some(_) => None,
            None => growth.prove_unfolded().err(),
        };
        Self {
            distances,
            place,
            fold,
        }
    }

    /// Returns true if there is a bound and no fold.
    fn is_proved(&self) -> bool {
        self.distances.bound.is_some() && self.fold.is_none()
    }

    /// Returns true if the bound is much larger than the sampled distance, as when a side crosses
    /// an edge between samples.
    fn is_loose(&self, diagonal: f64) -> bool {
        let most = 3.0 * self.distances.sampled + ROUNDING_DISTANCE * diagonal;
        self.distances.bound.is_some_and(|b| b > most)
    }
}

/// Proves a bound on the distance of a patch from the surface and that it does not fold over;
/// shortens it if that fails.
pub(super) fn certified(mut growth: Growth<'_>, mut clock: Clock) -> Result<Parameterized, Error> {
    let (seed_point, control) = (growth.seed_point(), growth.control);
    control.report("certify", 0.0);
    let proved = growth.keep_tolerance();
    if proved.is_none() && matches!(growth.on().near_singular, NearSingular::Try) {
        return Err(Error::NoPatch { at: seed_point });
    }
    let known = retreated(&mut growth, proved);
    let known = trimmed(&mut growth, known);
    if known.fold.is_some() && fold::seen(&growth.patch).is_some() {
        return Err(Error::Folded { at: seed_point });
    }
    clock.phase("certify");
    control.report("certify", 1.0);
    Ok(finished(growth, &known, clock))
}

/// Shortens a patch until it is proved, as a proof may succeed on a smaller one; returns its
/// properties.
fn retreated(growth: &mut Growth<'_>, proved: Option<f64>) -> ProvedProperties {
    let mut known = ProvedProperties::prove(growth, proved);
    for share in RETREAT_SHARES {
        if known.is_proved() || growth.is_over() {
            break;
        }
        let left = match known.fold {
            Some(place) => growth.leave(place, share),
            None => growth.retreat(share),
        };
        if !left {
            break;
        }
        known = ProvedProperties::prove(growth, None);
    }
    known
}

/// Trims the sides of a patch on a surface with parts as long as that tightens a loose bound;
/// returns its properties.
fn trimmed(growth: &mut Growth<'_>, mut known: ProvedProperties) -> ProvedProperties {
    let diagonal = growth.options.region.diagonal();
    for _ in 0..4 {
        if growth.on().whole.is_single() || !known.is_loose(diagonal) || growth.is_over() {
            break;
        }
        let before = growth.state();
        let allowed = known.distances.sampled.max(ROUNDING_DISTANCE * diagonal);
        growth.trim_finely(allowed, known.place);
        if growth.is_as(&before) {
            break;
        }
        let (tolerance, whole) = (growth.options.tolerance, growth.on().whole);
        let (distances, place) =
            distances_on(whole, &growth.patch, tolerance, None, growth.control);
        let is_tighter =
            (distances.bound).is_some_and(|b| known.distances.bound.is_none_or(|k| b < k));
        if !is_tighter {
            growth.settle(before);
            break;
        }
        known = ProvedProperties {
            distances,
            place,
            fold: growth.prove_unfolded().err(),
        };
    }
    known
}

/// Assembles the result.
fn finished(growth: Growth<'_>, known: &ProvedProperties, clock: Clock) -> Parameterized {
    let on = growth.on();
    let diagonal = growth.options.region.diagonal();
    // A single function is proved to this distance only across self-intersections and if it is not
    // a polynomial. On parts, samples show distances to first order only; so the proved bound must
    // be near rounding, too.
    let proved = if on.whole.is_single() {
        1e-6
    } else {
        SURFACE_DISTANCE_TOLERANCE
    };
    let bound = known.distances.bound;
    Parameterized {
        part: on.part,
        quadric: None,
        is_late: growth.is_late,
        shortenings: growth.shortenings,
        is_within_limit: growth.is_within_limit(),
        grown: growth.finish(),
        distances: known.distances,
        is_unfolded: known.fold.is_none(),
        is_exact: known.distances.sampled <= SURFACE_DISTANCE_TOLERANCE * diagonal
            && bound.is_some_and(|b| b <= proved * diagonal),
        seconds: clock.seconds,
    }
}
