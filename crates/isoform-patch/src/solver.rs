//! Descent on the objective: damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963), or
//! Newton's with the same damping.
//!
//! J has neither gradient nor second derivatives at w = 1, and scaling all control points changes
//! nothing but J: the system is singular from the start, so that some damping is always there. With
//! the exact Hessian, which is indefinite in up to two thirds of the steps, the damping also rises
//! until the system is positive definite; each step then descends.

use crate::objective::{Derivatives, Evaluated, Objective, Terms, Weights};
use isoform_geom::RationalPatch;
use isoform_num::linalg::{cholesky, cholesky_solve};

/// The damping a phase starts with, relative to the diagonal: small enough for steps of nearly full
/// length from the start.
const FIRST_DAMPING: f64 = 1e-4;
/// Below this, damping no longer changes steps but lets rounding decide along the singular
/// directions.
const LEAST_DAMPING: f64 = 1e-9;
/// Beyond this, steps are too short to be of use: the phase ends.
const MOST_DAMPING: f64 = 1e8;
/// What the diagonal entries are lifted to, as a share of the mean one, before they are multiplied
/// by the damping.
const LEAST_DIAGONAL: f64 = 1e-4;
/// The acceleration a of a step v may be so long that 2|a| is this share of |v|, in lengths that
/// damping has: with more, what bends the step is not to be had from second derivatives. The
/// paper's value.
const MOST_BENT: f64 = 0.75;

/// A factor is lowered while its term has more than this share of I. The paper says 1, which leaves
/// terms that are nearly as large as I where they are, and with them a quarter of the area.
const MOST_SHARE: f64 = 0.05;
/// The same of E where there is a tolerance, as a share of that of the others.
const CORNERS: f64 = 0.02;

/// When a phase of steps ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stop {
    /// After so many steps.
    pub(crate) steps: usize,
    /// After a step that lowers S by less than this share, once no factor ω falls any more.
    pub(crate) decrease: f64,
}

/// Minimises S from a patch. Factors ω whose term exceeds I are lowered tenfold after each step,
/// down to `floor` (section 3.3).
/// `each` is told of every accepted step.
///
/// The patch must have been evaluated to `at`; gives back its value at the end, and the number of
/// steps. S never rises.
pub(crate) fn minimise(
    objective: &mut Objective<'_>,
    patch: &mut RationalPatch,
    at: Evaluated,
    floor: &Weights,
    stop: Stop,
    damping: &mut f64,
    each: &mut dyn FnMut(&Objective<'_>, &Terms),
) -> (Evaluated, usize) {
    let mut at = at;
    *damping = damping.clamp(LEAST_DAMPING, 1.0);
    let mut rejected_growth = 4.0;
    for step in 0..stop.steps {
        let Some(d) = objective.derivatives(patch, &at) else {
            return (at, step);
        };
        let before = objective.sum(&at.terms);
        let mut accepted = None;
        while *damping <= MOST_DAMPING {
            if let Some(trial) = damped_step(objective, &d, patch, (&at, *damping))
                && let Some(value) = objective.evaluate(&trial.patch)
            {
                let after = objective.sum(&value.terms);
                if after < before {
                    accepted = Some((trial, value, after));
                    break;
                }
                // A step that should lower S by less than rounding shows: converged.
                if trial.expected <= 1e-13 * before {
                    return (at, step);
                }
            }
            *damping *= rejected_growth;
            rejected_growth *= 2.0;
        }
        let Some((trial, value, after)) = accepted else {
            *damping = FIRST_DAMPING;
            return (at, step);
        };
        rejected_growth = 4.0;
        // Nielsen's rule: by how well the quadratic model foretold the decrease.
        let gain = (before - after) / trial.expected.max(f64::MIN_POSITIVE);
        *damping = (*damping * (1.0 - (2.0 * gain.clamp(0.0, 1.0) - 1.0).powi(3)).clamp(0.1, 2.0))
            .max(LEAST_DAMPING);
        *patch = trial.patch;
        at = value;
        let lowered = lower(&mut objective.weights, &at.terms, floor, objective.little);
        each(objective, &at.terms);
        if !lowered && before - after < stop.decrease * before {
            return (at, step + 1);
        }
    }
    (at, stop.steps)
}

/// A damping to start with.
pub(crate) fn first_damping() -> f64 {
    FIRST_DAMPING
}

/// Lowers factors whose term exceeds I (section 3.3), or `little` where that is more; whether any
/// was.
fn lower(w: &mut Weights, t: &Terms, floor: &Weights, little: f64) -> bool {
    let most = MOST_SHARE * t.i.max(little);
    let mut lowered = false;
    // With a tolerance, corners that hold on to where they were keep a patch from its best
    // proportions.
    let corners = if little > 0.0 { CORNERS * most } else { most };
    let mut one = |w: &mut f64, term: f64, most: f64, floor: f64| {
        if *w * term > most && *w > floor {
            *w = (0.1 * *w).max(floor);
            lowered = true;
        }
    };
    one(&mut w.j, t.j, most, floor.j);
    one(&mut w.l, t.l, most, floor.l);
    one(&mut w.r, t.r, most, floor.r);
    one(&mut w.e, t.e, corners, floor.e);
    lowered
}

struct Trial {
    patch: RationalPatch,
    /// The decrease of S by the quadratic model.
    expected: f64,
}

/// The patch after the step v = −(H + λD)⁻¹ g and half of a = −(H + λD)⁻¹ b, where b is how the
/// residuals bend along v; none where that matrix is not positive definite, or where a is too long
/// against v for such a step to be trusted.
///
/// Patches of nearly the same shape make valleys of S, as wide as distances are small against the
/// patch, that bend; v leads out of them, a back (Transtrum, Sethna: Improvements to the
/// Levenberg-Marquardt algorithm for nonlinear least-squares minimization, arXiv 1201.5885 (2012),
/// section 4).
fn damped_step(
    objective: &Objective<'_>,
    d: &Derivatives,
    patch: &RationalPatch,
    (at, damping): (&Evaluated, f64),
) -> Option<Trial> {
    let n = d.gradient.len();
    let mean = (0..n).map(|i| d.hessian[i * n + i].abs()).sum::<f64>() / n as f64;
    let mut a = d.hessian.clone();
    let scale: Vec<f64> = (0..n)
        .map(|i| d.hessian[i * n + i].abs().max(LEAST_DIAGONAL * mean))
        .collect();
    for i in 0..n {
        a[i * n + i] += damping * scale[i];
    }
    if !cholesky(&mut a, n) {
        return None;
    }
    let mut x: Vec<f64> = d.gradient.iter().map(|g| -g).collect();
    cholesky_solve(&a, n, &mut x);
    // −gᵀx − xᵀHx/2 with (H + D) x = −g.
    let expected = (0..n)
        .map(|i| x[i] * (damping * scale[i] * x[i] - d.gradient[i]))
        .sum::<f64>()
        * 0.5;
    let mut back = vec![0.0; n];
    if objective.bends {
        back = objective.bending(patch, at, &x);
        cholesky_solve(&a, n, &mut back);
    }
    let length = |x: &[f64]| x.iter().zip(&scale).map(|(x, s)| s * x * x).sum::<f64>();
    let is_trusted = length(&back) <= (0.5 * MOST_BENT).powi(2) * length(&x);
    let mut patch = patch.clone();
    let count = n / 4;
    for (i, c) in patch.control_mut().iter_mut().enumerate() {
        for k in 0..4 {
            c[k] += x[k * count + i] - 0.5 * back[k * count + i];
        }
    }
    let is_finite = expected.is_finite() && patch.control().iter().flatten().all(|v| v.is_finite());
    (is_trusted && is_finite).then_some(Trial { patch, expected })
}
