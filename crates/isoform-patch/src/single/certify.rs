//! The proof of a grown patch: how far from the surface it is, and that it does not fold over.

use crate::distance::{Distances, distances_on};
use crate::fold;
use crate::grow::Growth;
use crate::options::Error;
use crate::parameterized::{Clock, Parameterized};
use crate::whole::NearSingular;

/// A patch whose samples are this near to the surface, in diagonals of the region, may be exact to
/// rounding.
const EXACT: f64 = 1e-12;
/// It is so if it is proved to be this near everywhere: where it passes a self-intersection, or the
/// function is no polynomial, proofs end here.
const PROVED: f64 = 1e-6;
/// The shares by which patches become shorter, in turn, at each side where nothing can be proved.
const RETREATS: [f64; 4] = [0.02, 0.03, 0.05, 0.1];
/// A bound above this multiple of the sampled distance is loose.
const LOOSE: f64 = 3.0;
/// How often sides are taken back for a tighter bound.
const TRIMMINGS: usize = 4;
/// A distance below this share of the region's diagonal is rounding's.
const ROUNDING: f64 = 1e-13;

/// What is known of a growing patch.
struct Known {
    distances: Distances,
    /// A place from which a loose bound comes.
    place: Option<(f64, f64)>,
    /// A place where the patch may fold over.
    fold: Option<(f64, f64)>,
}

impl Known {
    /// Proves what can be proved of a patch; `bound` is proved already, and that the patch does not
    /// fold over with it.
    fn of(growth: &Growth<'_>, bound: Option<f64>) -> Self {
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

    /// Whether there is a bound, and no fold.
    fn is_proved(&self) -> bool {
        self.distances.bound.is_some() && self.fold.is_none()
    }

    /// Whether the bound is larger than samples show: a side that comes over an edge between
    /// samples makes one.
    fn is_loose(&self, diagonal: f64) -> bool {
        let most = LOOSE * self.distances.sampled + ROUNDING * diagonal;
        self.distances.bound.is_some_and(|b| b > most)
    }
}

/// Proves how far from the surface a patch is, and that it does not fold over; it is made smaller
/// where that fails.
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

/// What is known of a patch made shorter until it is proved: of a smaller one it may be.
fn retreated(growth: &mut Growth<'_>, proved: Option<f64>) -> Known {
    let mut known = Known::of(growth, proved);
    for share in RETREATS {
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
        known = Known::of(growth, None);
    }
    known
}

/// What is known of a patch whose sides were taken back as long as that makes a loose bound
/// tighter, on a surface with parts.
fn trimmed(growth: &mut Growth<'_>, mut known: Known) -> Known {
    let diagonal = growth.options.region.diagonal();
    for _ in 0..TRIMMINGS {
        if growth.on().whole.is_single() || !known.is_loose(diagonal) || growth.is_over() {
            break;
        }
        let before = growth.state();
        let allowed = known.distances.sampled.max(ROUNDING * diagonal);
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
        known = Known {
            distances,
            place,
            fold: growth.prove_unfolded().err(),
        };
    }
    known
}

/// The patch with what is known of it.
fn finished(growth: Growth<'_>, known: &Known, clock: Clock) -> Parameterized {
    let on = growth.on();
    let diagonal = growth.options.region.diagonal();
    // Proofs on parts need not come near rounding, which their samples show to first order only.
    let proved = if on.whole.is_single() { PROVED } else { EXACT };
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
        is_exact: known.distances.sampled <= EXACT * diagonal
            && bound.is_some_and(|b| b <= proved * diagonal),
        seconds: clock.seconds,
    }
}
