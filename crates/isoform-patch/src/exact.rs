//! Iterations that bring a nearby patch onto the surface to rounding, for the option `exact`.
//!
//! On a quadric (and other rational surfaces of low degree) there are patches with I = 0, and they
//! form a manifold of larger dimension than the number of unknowns less equations suggests: the
//! system F∘p = 0 is singular at its solutions. Gauss-Newton steps whose damping decreases with the
//! squared residual (Yamashita and Fukushima 2001) still converge quadratically there, to a nearby
//! solution: directions along the manifold, whose singular values are of the order of the error,
//! are damped out.

use crate::grow::{Growth, MAX_EXTRAPOLATION, MIN_CONTROL_WEIGHT};
use crate::grown::area;
use crate::least_squares::damped_least_squares;
use crate::objective::{Evaluated, Objective};
use crate::places::grid;
use crate::stretch::longer;
use crate::surface::SURFACE_DISTANCE_TOLERANCE;
use crate::terms::Targets;
use isoform_geom::{Point3, RationalPatch, dot};

/// Fractions by which a patch is shortened at each side, in turn, until an exact patch is found
/// nearby: I is far smaller for the middle of a patch.
const SHORTENING_SHARES: [f64; 3] = [0.0, 0.2, 0.35];
/// Number of samples in each direction at which normals are compared.
const NORMAL_SAMPLES: usize = 13;
/// Maximum degrees of the other patches from which exact ones are sought, in turn, and their
/// fractions of the bound on S. With a fraction below 1, the shape terms of the paper apply even if
/// a tolerance is given.
const OTHER_SOURCES: [(usize, f64); 5] = [(3, 1.0), (2, 1.0), (2, 0.5), (2, 1e-3), (2, 1e-6)];
/// Root of I, in units of the region, below which a patch counts as exact: rounding stays below it,
/// and steps that converge slowly end above it.
const MAX_EXACT_RESIDUAL: f64 = 5e-15;

/// Patch with its targets and its value.
struct ExactCandidate {
    patch: RationalPatch,
    targets: Targets,
    at: Evaluated,
}

/// Brings a grown patch onto the surface to rounding, if possible, and extrapolates it, which
/// leaves I at 0, as far as the bound on S and positive control weights admit. Returns true if it
/// succeeded.
///
/// If no exact patch is nearby, or only a small one, `grow` makes patches of lower degrees in
/// turn, each for a degree and a fraction of the bound on S, with small patches last. They are
/// brought onto the surface, raised to the required degree and extrapolated: a large patch with
/// wrong angles is not near an exact one.
pub(crate) fn make_exact<'f>(
    growth: &mut Growth<'f>,
    grow: impl Fn((usize, usize), f64) -> Option<Growth<'f>>,
) -> bool {
    let (m, n) = growth.patch.degree();
    let before = area(&growth.patch);
    let mut best: Option<(f64, ExactCandidate)> = None;
    let others = OTHER_SOURCES.map(|(k, share)| ((m.min(k), n.min(k)), share));
    let others = others
        .into_iter()
        .filter(|(d, share)| *share < 1.0 || *d != (m, n))
        .filter_map(|(d, share)| grow(d, share));
    // The patch itself comes first; the others are grown only when their turn comes.
    for source in std::iter::once(None).chain(others.map(Some)) {
        let source = source.as_ref().unwrap_or(growth);
        // Any surface has an exact patch nearby that is small enough: less than a twentieth of the
        // area does not count.
        let least = 0.05 * before;
        let least = best.as_ref().map_or(least, |b| least.max(b.0.next_up()));
        best = growth.exact_from(source, least).or(best);
        if best.as_ref().is_some_and(|b| b.0 >= 0.3 * before) {
            break;
        }
    }
    let Some((_, found)) = best else {
        return false;
    };
    growth.take(found.patch, found.targets, found.at);
    true
}

impl Growth<'_> {
    /// Returns an exact patch near a source, and its area; `None` if its area is below `least`.
    fn exact_from(&self, source: &Growth<'_>, least: f64) -> Option<(f64, ExactCandidate)> {
        let degree = self.patch.degree();
        SHORTENING_SHARES.into_iter().find_map(|share| {
            let nearby = source.exact_nearby(share)?;
            let found = self.extended(nearby.elevated(degree))?;
            let size = area(&found.patch);
            (size >= least).then_some((size, found))
        })
    }

    /// Returns the exact patch to which iterations lead from the current one, shortened by a
    /// fraction at each side.
    fn exact_nearby(&self, share: f64) -> Option<RationalPatch> {
        let (patch, root) = onto(&self.objective, &self.longer([-share; 4]));
        (root <= MAX_EXACT_RESIDUAL * self.unit
            && patch.control_weights().0 > 0.0
            && is_regular(&patch))
        .then_some(patch)
    }

    /// Extrapolates an exact patch as far as the bound on S, positive control weights and the
    /// region admit.
    fn extended(&self, mut patch: RationalPatch) -> Option<ExactCandidate> {
        // The first extrapolation may shorten the patch: an exact patch nearby may be too large.
        let (mut least, mut longest) = (-0.25, None);
        for _ in 0..12 {
            let inside = self.sides_inside(&patch);
            let (share, best) = self.farthest(&patch, inside, least);
            let Some(found) = best.and_then(|best| self.polished(&best)) else {
                break;
            };
            patch = found.patch.clone();
            longest = Some(found);
            if share < 0.5 * MAX_EXTRAPOLATION || inside == [false; 4] {
                break;
            }
            least = 0.0;
        }
        longest
    }

    /// Returns the largest fraction, from `least` on, by which an exact patch can be extended at
    /// its sides inside the region, and the extended patch.
    fn farthest(
        &self,
        patch: &RationalPatch,
        inside: [bool; 4],
        least: f64,
    ) -> (f64, Option<ExactCandidate>) {
        let longer = |share: f64| {
            let by = |inside: bool| if share < 0.0 || inside { share } else { 0.0 };
            longer(patch, inside.map(by))
        };
        let (mut lo, mut hi) = (least, MAX_EXTRAPOLATION);
        // The bound on S is not used up, as polishing changes S a little.
        let aim = 0.998;
        let mut best = self.fitting(longer(lo), aim);
        for _ in 0..10 {
            let share = 0.5 * (lo + hi);
            match self.fitting(longer(share), aim) {
                Some(found) => (lo, best) = (share, Some(found)),
                None => hi = share,
            }
        }
        (lo, best)
    }

    /// Removes from a patch the rounding errors that extrapolation has amplified.
    fn polished(&self, rough: &ExactCandidate) -> Option<ExactCandidate> {
        let polished = onto(&self.objective, &rough.patch).0;
        self.fitting(polished, 1.0)
            .filter(|f| f.at.terms.i.sqrt() <= MAX_EXACT_RESIDUAL * self.unit)
    }

    /// Returns a nearly exact patch with its value; `None` if it is not acceptable or exceeds a
    /// fraction of the bound on S.
    fn fitting(&self, patch: RationalPatch, share: f64) -> Option<ExactCandidate> {
        let (targets, at) = self.retargeted(&patch)?;
        let fits = match self.options.tolerance {
            Some(_) => turns_little(&patch),
            None => self.objective.sum(&at.terms) <= share * self.limit(),
        };
        let is_exact = at.terms.i.sqrt() <= SURFACE_DISTANCE_TOLERANCE * self.unit;
        (fits && is_exact && patch.control_weights().0 > MIN_CONTROL_WEIGHT && is_regular(&patch))
            .then_some(ExactCandidate { patch, targets, at })
    }
}

/// Returns the normals of a patch on a grid, row by row.
fn normals(patch: &RationalPatch) -> Vec<Point3> {
    let normal = |(u, v): (f64, f64)| patch.tangents(u, v).normal();
    grid(NORMAL_SAMPLES).map(normal).collect()
}

/// Returns true if every normal of a patch is at less than 80° to the normal at the centre: faces
/// of STEP's own surfaces must avoid poles and seams.
fn turns_little(patch: &RationalPatch) -> bool {
    let normals = normals(patch);
    let middle = normals[normals.len() / 2];
    let length = dot(middle, middle).sqrt();
    normals
        .iter()
        .all(|n| dot(*n, middle) >= 0.175 * length * dot(*n, *n).sqrt())
}

/// Returns true if a patch neither folds nor degenerates to a curve: such patches have I = 0, too.
fn is_regular(patch: &RationalPatch) -> bool {
    let normals = normals(patch);
    let squares = normals.iter().map(|n| dot(*n, *n));
    let (lo, hi) = squares.fold((f64::INFINITY, 0.0f64), |(lo, hi), n| {
        (lo.min(n), hi.max(n))
    });
    let turns = |k: usize, next: usize| dot(normals[k], normals[next]) <= 0.0;
    let folds = (0..NORMAL_SAMPLES * NORMAL_SAMPLES).any(|k| {
        (k % NORMAL_SAMPLES + 1 < NORMAL_SAMPLES && turns(k, k + 1))
            || (k + NORMAL_SAMPLES < NORMAL_SAMPLES * NORMAL_SAMPLES
                && turns(k, k + NORMAL_SAMPLES))
    });
    // Minimum area element, as a fraction of the largest.
    let least = 1e-3;
    lo > least * least * hi && !folds
}

/// Iterates from a patch; returns the patch with the least I found, and the root of that I.
fn onto(objective: &Objective<'_>, patch: &RationalPatch) -> (RationalPatch, f64) {
    let mut patch = patch.clone();
    let Some(mut at) = objective.evaluate(&patch) else {
        return (patch, f64::INFINITY);
    };
    let mut best = (patch.clone(), at.terms.i.sqrt());
    let mut since = 0;
    // About twenty steps suffice if there is a solution: convergence is linear until the error is
    // small.
    for _ in 0..80 {
        let scale = largest(&patch);
        let Some(next) = step(objective, &patch, &at, scale) else {
            break;
        };
        let Some(value) = objective.evaluate(&next) else {
            break;
        };
        (patch, at) = (next, value);
        let root = at.terms.i.sqrt();
        let is_progress = root < 0.9 * best.1;
        since = if is_progress { 0 } else { since + 1 };
        if root < best.1 {
            best = (patch.clone(), root);
        }
        // A smaller root of I is only rounding.
        if since >= 5 || root <= 3e-16 * scale {
            break;
        }
    }
    best
}

/// Returns the largest absolute value among the homogeneous coordinates of control points.
fn largest(patch: &RationalPatch) -> f64 {
    let all = patch.control().iter().flatten();
    all.fold(0.0f64, |m, v| m.max(v.abs()))
}

/// Returns the patch after a damped Gauss-Newton step for I.
fn step(
    objective: &Objective<'_>,
    patch: &RationalPatch,
    at: &Evaluated,
    scale: f64,
) -> Option<RationalPatch> {
    let n = objective.unknowns();
    let (rows, residuals) = objective.distance_rows(at);
    let square = |k: usize| rows.chunks(n).map(|row| row[k] * row[k]).sum::<f64>();
    let column = (0..n).map(square).fold(0.0, f64::max).sqrt();
    // The minimum is above the rounding errors of the columns.
    let damping = column * (at.terms.i.sqrt() / scale).max(1e-14);
    let x = damped_least_squares(rows, &residuals, n, damping)?;
    let mut next = patch.clone();
    for (i, c) in next.control_mut().iter_mut().enumerate() {
        for k in 0..4 {
            c[k] -= x[k * n / 4 + i];
        }
    }
    Some(next)
}
