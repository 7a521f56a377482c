//! From near the surface onto it, for `exact`.
//!
//! On a quadric (and other rational surfaces of low degree) there are patches with I = 0, and more
//! of them than unknowns less equations: the system F∘p = 0 is singular at its solutions, which
//! form a manifold. Gauss-Newton steps with damping that falls with the squared residual (Yamashita
//! and Fukushima 2001) still converge quadratically there, to a nearby solution: directions along
//! the manifold, whose singular values are of the order of the error, are left alone. Normal
//! equations would square the small singular values that matter, so that steps come from a QR
//! factorisation.

use crate::grow::{Growth, LEAST_WEIGHT, MOST_GROWTH, area, longer};
use crate::objective::{Evaluated, Objective, Targets};
use crate::surface::ON_SURFACE;
use isoform_geom::{Point3, RationalPatch, dot};

/// Steps; where there is a solution some twenty are needed, as convergence is linear until the
/// error is small.
const STEPS: usize = 80;
/// A step that leaves less than this share of the best value makes progress.
const PROGRESS: f64 = 0.9;
/// The least damping, relative to the largest column: beyond what rounding leaves.
const LEAST_DAMPING: f64 = 1e-14;
/// After so many steps without progress there is nothing more to be had.
const PATIENCE: usize = 5;
/// Below this, relative to the largest coordinate, there is only rounding.
const ENOUGH: f64 = 3e-16;

/// By how much, at each side, a patch is made shorter in turn until there is an exact one nearby: I
/// of the middle is far smaller.
const SHORTER: [f64; 3] = [0.0, 0.2, 0.35];
/// Bisections of the extrapolation of an exact patch.
const BISECTIONS: usize = 10;
/// Extrapolations of an exact patch.
const EXTRAPOLATIONS: usize = 12;
/// Samples in each direction at which normals are looked at.
const NORMALS: usize = 13;
/// The most degree of other patches from which exact ones are sought, in turn, and their share of
/// the bound on S; below 1 with the shape terms of the paper also where a tolerance is asked for.
const OTHERS: [(usize, f64); 5] = [(3, 1.0), (2, 1.0), (2, 0.5), (2, 1e-3), (2, 1e-6)];
/// The cosine of the largest angle between a normal and that in the middle: the faces of STEP's own
/// entities have to keep away from poles and seams.
const LEAST_TURN: f64 = 0.175;
/// An exact patch with this share of the area that it had before is large enough; one with less
/// than that share is none: patches that are small enough are near any surface.
const LEAST_AREA: [f64; 2] = [0.3, 0.05];
/// The root of I, in units of the region, that is left by rounding; steps that converge slowly end
/// above it.
const RESOLVED: f64 = 5e-15;
/// The share of the bound on S up to which an exact patch is extrapolated: polishing changes S a
/// little.
const AIM: f64 = 0.998;
/// The least area element, as a share of the largest.
const LEAST_ELEMENT: f64 = 1e-3;

/// A patch with its targets and its value.
pub(crate) type Fitting = (RationalPatch, Targets, Evaluated);

/// Brings a grown patch onto the surface to rounding, if that succeeds, and extrapolates it, which
/// then costs nothing of I, as far as the bound on S and positive control weights admit. Whether it
/// succeeded.
///
/// Where there is no exact patch nearby, or only a small one, `grow` makes patches of lower degrees
/// in turn, in the end small ones. They are brought there, raised to the degree asked for and
/// extrapolated: a large patch is not near an exact one where its angles are not right.
pub(crate) fn make_exact<'f>(
    growth: &mut Growth<'f>,
    grow: impl Fn((usize, usize), f64) -> Option<Growth<'f>>,
) -> bool {
    let (m, n) = growth.patch.degree();
    let [enough, least] = LEAST_AREA.map(|share| share * area(&growth.patch, &|_| true));
    let mut best: Option<(f64, Fitting)> = None;
    let others = OTHERS.map(|(k, share)| ((m.min(k), n.min(k)), share));
    let others = others
        .into_iter()
        .filter(|(d, share)| *share < 1.0 || *d != (m, n))
        .filter_map(|(d, share)| grow(d, share));
    // The patch itself, then the others, which grow only when it is their turn.
    for source in std::iter::once(None).chain(others.map(Some)) {
        let source = source.as_ref().unwrap_or(growth);
        for share in SHORTER {
            let Some(found) = source
                .exact_nearby(share)
                .and_then(|p| growth.extended(p.elevated((m, n))))
            else {
                continue;
            };
            let size = area(&found.0, &|_| true);
            if size >= least && best.as_ref().is_none_or(|b| size > b.0) {
                best = Some((size, found));
                break;
            }
        }
        if best.as_ref().is_some_and(|b| b.0 >= enough) {
            break;
        }
    }
    let Some((_, (patch, targets, at))) = best else {
        return false;
    };
    growth.take(patch, targets, at);
    true
}

impl Growth<'_> {
    /// The exact patch that steps from the present one lead to, made shorter by a share at each
    /// side.
    fn exact_nearby(&self, share: f64) -> Option<RationalPatch> {
        let (patch, root) = onto(&self.objective, &self.longer([-share; 4]));
        (root <= RESOLVED * self.unit && patch.control_weights().0 > 0.0 && is_regular(&patch))
            .then_some(patch)
    }

    /// An exact patch as long as the bound on S, positive control weights and the region admit.
    fn extended(&self, mut patch: RationalPatch) -> Option<Fitting> {
        let (mut least, mut longest) = (-0.25, None);
        for _ in 0..EXTRAPOLATIONS {
            let inside = self.sides_inside(&patch);
            let longer = |share: f64| {
                longer(
                    &patch,
                    inside.map(|inside| if share < 0.0 || inside { share } else { 0.0 }),
                )
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
            // What extrapolation has made of rounding goes away.
            let Some(best) = best else { break };
            let polished = onto(&self.objective, &best.0).0;
            let Some(found) = self
                .fitting(polished, 1.0)
                .filter(|f| f.2.terms.i.sqrt() <= RESOLVED * self.unit)
            else {
                break;
            };
            patch = found.0.clone();
            longest = Some(found);
            if lo < 0.5 * MOST_GROWTH || inside == [false; 4] {
                break;
            }
            least = 0.0;
        }
        longest
    }

    /// A patch that is nearly exact, if it is fit to be taken, and keeps a share of the bound on S.
    fn fitting(&self, patch: RationalPatch, share: f64) -> Option<Fitting> {
        let (targets, at) = self.retargeted(&patch)?;
        let fits = match self.options.tolerance {
            Some(_) => turns_little(&patch),
            None => self.objective.sum(&at.terms) <= share * self.limit(),
        };
        let is_exact = at.terms.i.sqrt() <= ON_SURFACE * self.unit;
        (fits && is_exact && patch.control_weights().0 > LEAST_WEIGHT && is_regular(&patch))
            .then_some((patch, targets, at))
    }
}

/// The normals of a patch, row by row.
fn normals(patch: &RationalPatch) -> Vec<Point3> {
    let at = |i: usize| i as f64 / (NORMALS - 1) as f64;
    (0..NORMALS * NORMALS)
        .map(|k| patch.tangents(at(k / NORMALS), at(k % NORMALS)).normal())
        .collect()
}

/// Whether no normal of a patch is at nearly a right angle to that in the middle.
fn turns_little(patch: &RationalPatch) -> bool {
    let normals = normals(patch);
    let middle = normals[normals.len() / 2];
    let length = dot(middle, middle).sqrt();
    normals
        .iter()
        .all(|n| dot(*n, middle) >= LEAST_TURN * length * dot(*n, *n).sqrt())
}

/// Whether a patch neither folds nor comes down to a curve: I = 0 holds on those, too.
fn is_regular(patch: &RationalPatch) -> bool {
    let normals = normals(patch);
    let (lo, hi) = normals
        .iter()
        .map(|n| dot(*n, *n))
        .fold((f64::INFINITY, 0.0f64), |(lo, hi), n| {
            (lo.min(n), hi.max(n))
        });
    let turns = |k: usize, next: usize| dot(normals[k], normals[next]) <= 0.0;
    let folds = (0..NORMALS * NORMALS).any(|k| {
        (k % NORMALS + 1 < NORMALS && turns(k, k + 1))
            || (k + NORMALS < NORMALS * NORMALS && turns(k, k + NORMALS))
    });
    lo > LEAST_ELEMENT * LEAST_ELEMENT * hi && !folds
}

/// The patch nearest by with the least I that such steps lead to, and the root of that I.
fn onto(objective: &Objective<'_>, patch: &RationalPatch) -> (RationalPatch, f64) {
    let mut patch = patch.clone();
    let Some(mut at) = objective.evaluate(&patch) else {
        return (patch, f64::INFINITY);
    };
    let mut best = (patch.clone(), at.terms.i.sqrt());
    let (n, mut since) = (objective.unknowns(), 0);
    for _ in 0..STEPS {
        let (rows, residuals) = objective.distance_rows(&at);
        let column = (0..n)
            .map(|k| rows.chunks(n).map(|row| row[k] * row[k]).sum::<f64>())
            .fold(0.0, f64::max)
            .sqrt();
        let scale = patch
            .control()
            .iter()
            .flatten()
            .fold(0.0f64, |m, v| m.max(v.abs()));
        let damping = column * (at.terms.i.sqrt() / scale).max(LEAST_DAMPING);
        let Some(x) = damped_least_squares(rows, &residuals, n, damping) else {
            break;
        };
        let mut next = patch.clone();
        for (i, c) in next.control_mut().iter_mut().enumerate() {
            for k in 0..4 {
                c[k] -= x[k * n / 4 + i];
            }
        }
        let Some(value) = objective.evaluate(&next) else {
            break;
        };
        (patch, at) = (next, value);
        let root = at.terms.i.sqrt();
        since = if root < PROGRESS * best.1 {
            0
        } else {
            since + 1
        };
        if root < best.1 {
            best = (patch.clone(), root);
        }
        if since >= PATIENCE || root <= ENOUGH * scale {
            break;
        }
    }
    best
}

/// The x with the least |A x − b|² + d² |x|², for A given by its rows of `n` numbers: Householder's
/// QR of A above d times the identity.
pub(crate) fn damped_least_squares(
    rows: Vec<f64>,
    b: &[f64],
    n: usize,
    d: f64,
) -> Option<Vec<f64>> {
    let m = b.len() + n;
    // Column by column, so that reflections run along memory.
    let mut a = vec![0.0; m * (n + 1)];
    for (i, row) in rows.chunks(n).enumerate() {
        for (k, v) in row.iter().enumerate() {
            a[k * m + i] = *v;
        }
    }
    for k in 0..n {
        a[k * m + b.len() + k] = d;
    }
    a[n * m..n * m + b.len()].copy_from_slice(b);
    for k in 0..n {
        let (done, rest) = a.split_at_mut((k + 1) * m);
        let v = &mut done[k * m + k..];
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        let alpha = if v[0] > 0.0 { -length } else { length };
        v[0] -= alpha;
        let norm2: f64 = v.iter().map(|x| x * x).sum();
        for column in rest.chunks_mut(m) {
            let c = &mut column[k..];
            let f = 2.0 * v.iter().zip(c.iter()).map(|(x, y)| x * y).sum::<f64>() / norm2;
            for (y, x) in c.iter_mut().zip(v.iter()) {
                *y -= f * x;
            }
        }
        // The diagonal of R; the reflection is no longer needed.
        v[0] = alpha;
    }
    let mut x: Vec<f64> = a[n * m..n * m + n].to_vec();
    for k in (0..n).rev() {
        x[k] /= a[k * m + k];
        for i in 0..k {
            x[i] -= a[k * m + i] * x[k];
        }
    }
    x.iter().all(|v| v.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_solve_the_normal_equations() {
        let rows = vec![1.0, 2.0, 0.5, -1.0, 0.3, 2.0, 4.0, 1.0, 1.0, 0.0, 1.0, -1.0];
        let (b, d) = ([1.0, -2.0, 0.5, 3.0], 0.1);
        let x = damped_least_squares(rows.clone(), &b, 3, d).expect("a solution");
        for k in 0..3 {
            let g: f64 = rows
                .chunks(3)
                .zip(&b)
                .map(|(r, b)| r[k] * (r[0] * x[0] + r[1] * x[1] + r[2] * x[2] - b))
                .sum();
            assert!((g + d * d * x[k]).abs() < 1e-14);
        }
        assert_eq!(
            damped_least_squares(vec![0.0; 6], &[1.0, 1.0], 3, 0.0),
            None
        );
    }
}
