//! Iterations that bring a nearby patch onto the surface to rounding, for the option `exact`.
//!
//! On a quadric (and other rational surfaces of low degree) there are patches with I = 0, and they
//! form a manifold of larger dimension than the number of unknowns less equations suggests: the
//! system F∘p = 0 is singular at its solutions. Gauss-Newton steps whose damping decreases with the
//! squared residual (Yamashita and Fukushima 2001) still converge quadratically there, to a nearby
//! solution: directions along the manifold, whose singular values are of the order of the error,
//! are damped out.

use crate::grow::{Growth, LEAST_WEIGHT, MOST_GROWTH};
use crate::grown::area;
use crate::least_squares::damped_least_squares;
use crate::objective::{Evaluated, Objective};
use crate::places::grid;
use crate::stretch::longer;
use crate::surface::ON_SURFACE;
use crate::terms::Targets;
use isoform_geom::{Point3, RationalPatch, dot};

/// The most steps; where there is a solution some twenty are needed, as convergence is linear until
/// the error is small.
const STEPS: usize = 80;
/// A step that leaves less than this share of the best value makes progress.
const PROGRESS: f64 = 0.9;
/// The least damping, relative to the largest column: beyond what rounding leaves.
const LEAST_DAMPING: f64 = 1e-14;
/// Steps without progress after which there is nothing more to be had.
const PATIENCE: usize = 5;
/// A root of I below this, relative to the largest coordinate, is only rounding.
const ENOUGH: f64 = 3e-16;

/// Fractions by which a patch is shortened at each side, in turn, until an exact patch is found
/// nearby: I is far smaller for the middle of a patch.
const SHORTER: [f64; 3] = [0.0, 0.2, 0.35];
/// Bisections of the extrapolation of an exact patch.
const BISECTIONS: usize = 10;
/// Extrapolations of an exact patch.
const EXTRAPOLATIONS: usize = 12;
/// The first extrapolation may take back this share of the patch: an exact one nearby may be too
/// large.
const TAKEN_BACK: f64 = 0.25;
/// Samples in each direction at which normals are compared.
const NORMALS: usize = 13;
/// Maximum degrees of the other patches from which exact ones are sought, in turn, and their
/// fractions of the bound on S. With a fraction below 1, the shape terms of the paper apply even if
/// a tolerance is given.
const OTHERS: [(usize, f64); 5] = [(3, 1.0), (2, 1.0), (2, 0.5), (2, 1e-3), (2, 1e-6)];
/// The cosine of the largest angle between a normal and that in the middle: the faces of STEP's own
/// entities have to keep away from poles and seams.
const LEAST_TURN: f64 = 0.175;
/// An exact patch with this share of the area that it had before is large enough.
const ENOUGH_AREA: f64 = 0.3;
/// One with less than this share is none: patches that are small enough are near any surface.
const LEAST_AREA: f64 = 0.05;
/// Root of I, in units of the region, below which a patch counts as exact: rounding stays below it,
/// and steps that converge slowly end above it.
const RESOLVED: f64 = 5e-15;
/// The share of the bound on S up to which an exact patch is extrapolated: polishing changes S a
/// little.
const AIM: f64 = 0.998;
/// The least area element, as a share of the largest.
const LEAST_ELEMENT: f64 = 1e-3;

/// Patch with its targets and its value.
struct Fitting {
    patch: RationalPatch,
    targets: Targets,
    at: Evaluated,
}

/// Brings a grown patch onto the surface to rounding, if possible, and extrapolates it, which
/// leaves I at 0, as far as the bound on S and positive control weights admit. Returns true if it
/// succeeded.
///
/// If there is no exact patch nearby, or only a small one, `grow` makes patches of lower degrees in
/// turn, each for a degree and a fraction of the bound on S, with small patches last. They are
/// brought onto the surface, raised to the required degree and extrapolated: a large patch with
/// wrong angles is not near an exact one.
pub(crate) fn make_exact<'f>(
    growth: &mut Growth<'f>,
    grow: impl Fn((usize, usize), f64) -> Option<Growth<'f>>,
) -> bool {
    let (m, n) = growth.patch.degree();
    let before = area(&growth.patch);
    let mut best: Option<(f64, Fitting)> = None;
    let others = OTHERS.map(|(k, share)| ((m.min(k), n.min(k)), share));
    let others = others
        .into_iter()
        .filter(|(d, share)| *share < 1.0 || *d != (m, n))
        .filter_map(|(d, share)| grow(d, share));
    // The patch itself comes first; the others are grown only when their turn comes.
    for source in std::iter::once(None).chain(others.map(Some)) {
        let source = source.as_ref().unwrap_or(growth);
        let least = LEAST_AREA * before;
        let least = best.as_ref().map_or(least, |b| least.max(b.0.next_up()));
        best = growth.exact_from(source, least).or(best);
        if best.as_ref().is_some_and(|b| b.0 >= ENOUGH_AREA * before) {
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
    fn exact_from(&self, source: &Growth<'_>, least: f64) -> Option<(f64, Fitting)> {
        let degree = self.patch.degree();
        SHORTER.into_iter().find_map(|share| {
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
        (root <= RESOLVED * self.unit && patch.control_weights().0 > 0.0 && is_regular(&patch))
            .then_some(patch)
    }

    /// Extrapolates an exact patch as far as the bound on S, positive control weights and the
    /// region admit.
    fn extended(&self, mut patch: RationalPatch) -> Option<Fitting> {
        let (mut least, mut longest) = (-TAKEN_BACK, None);
        for _ in 0..EXTRAPOLATIONS {
            let inside = self.sides_inside(&patch);
            let (share, best) = self.farthest(&patch, inside, least);
            let Some(found) = best.and_then(|best| self.polished(&best)) else {
                break;
            };
            patch = found.patch.clone();
            longest = Some(found);
            if share < 0.5 * MOST_GROWTH || inside == [false; 4] {
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
    ) -> (f64, Option<Fitting>) {
        let longer = |share: f64| {
            let by = |inside: bool| if share < 0.0 || inside { share } else { 0.0 };
            longer(patch, inside.map(by))
        };
        let (mut lo, mut hi) = (least, MOST_GROWTH);
        let mut best = self.fitting(longer(lo), AIM);
        for _ in 0..BISECTIONS {
            let share = 0.5 * (lo + hi);
            match self.fitting(longer(share), AIM) {
                Some(found) => (lo, best) = (share, Some(found)),
                None => hi = share,
            }
        }
        (lo, best)
    }

    /// Removes from a patch the rounding errors that extrapolation has amplified.
    fn polished(&self, rough: &Fitting) -> Option<Fitting> {
        let polished = onto(&self.objective, &rough.patch).0;
        self.fitting(polished, 1.0)
            .filter(|f| f.at.terms.i.sqrt() <= RESOLVED * self.unit)
    }

    /// Returns a nearly exact patch with its value; `None` if it is not acceptable or exceeds a
    /// fraction of the bound on S.
    fn fitting(&self, patch: RationalPatch, share: f64) -> Option<Fitting> {
        let (targets, at) = self.retargeted(&patch)?;
        let fits = match self.options.tolerance {
            Some(_) => turns_little(&patch),
            None => self.objective.sum(&at.terms) <= share * self.limit(),
        };
        let is_exact = at.terms.i.sqrt() <= ON_SURFACE * self.unit;
        (fits && is_exact && patch.control_weights().0 > LEAST_WEIGHT && is_regular(&patch))
            .then_some(Fitting { patch, targets, at })
    }
}

/// Returns the normals of a patch on a grid, row by row.
fn normals(patch: &RationalPatch) -> Vec<Point3> {
    let normal = |(u, v): (f64, f64)| patch.tangents(u, v).normal();
    grid(NORMALS).map(normal).collect()
}

/// Returns true if every normal of a patch is at less than about a right angle to the normal at the
/// centre.
fn turns_little(patch: &RationalPatch) -> bool {
    let normals = normals(patch);
    let middle = normals[normals.len() / 2];
    let length = dot(middle, middle).sqrt();
    normals
        .iter()
        .all(|n| dot(*n, middle) >= LEAST_TURN * length * dot(*n, *n).sqrt())
}

/// Returns true if a patch neither folds nor degenerates to a curve: such patches have I = 0, too.
fn is_regular(patch: &RationalPatch) -> bool {
    let normals = normals(patch);
    let squares = normals.iter().map(|n| dot(*n, *n));
    let (lo, hi) = squares.fold((f64::INFINITY, 0.0f64), |(lo, hi), n| {
        (lo.min(n), hi.max(n))
    });
    let turns = |k: usize, next: usize| dot(normals[k], normals[next]) <= 0.0;
    let folds = (0..NORMALS * NORMALS).any(|k| {
        (k % NORMALS + 1 < NORMALS && turns(k, k + 1))
            || (k + NORMALS < NORMALS * NORMALS && turns(k, k + NORMALS))
    });
    lo > LEAST_ELEMENT * LEAST_ELEMENT * hi && !folds
}

/// Iterates from a patch; returns the patch with the least I found, and the root of that I.
fn onto(objective: &Objective<'_>, patch: &RationalPatch) -> (RationalPatch, f64) {
    let mut patch = patch.clone();
    let Some(mut at) = objective.evaluate(&patch) else {
        return (patch, f64::INFINITY);
    };
    let mut best = (patch.clone(), at.terms.i.sqrt());
    let mut since = 0;
    for _ in 0..STEPS {
        let scale = largest(&patch);
        let Some(next) = step(objective, &patch, &at, scale) else {
            break;
        };
        let Some(value) = objective.evaluate(&next) else {
            break;
        };
        (patch, at) = (next, value);
        let root = at.terms.i.sqrt();
        let is_progress = root < PROGRESS * best.1;
        since = if is_progress { 0 } else { since + 1 };
        if root < best.1 {
            best = (patch.clone(), root);
        }
        if since >= PATIENCE || root <= ENOUGH * scale {
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
    let damping = column * (at.terms.i.sqrt() / scale).max(LEAST_DAMPING);
    let x = damped_least_squares(rows, &residuals, n, damping)?;
    let mut next = patch.clone();
    for (i, c) in next.control_mut().iter_mut().enumerate() {
        for k in 0..4 {
            c[k] -= x[k * n / 4 + i];
        }
    }
    Some(next)
}
