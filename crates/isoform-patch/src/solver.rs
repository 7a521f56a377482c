//! Minimisation of the objective by damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963), or
//! Newton steps with equal damping.
//!
//! J has neither gradient nor second derivatives at w = 1, and scaling all control points changes J
//! alone: the system is singular from the start, so there is always some damping. With the exact
//! Hessian, which is indefinite in up to two thirds of the steps, the damping also rises until the
//! system is positive definite; so each step descends.

use crate::objective::{Derivatives, Evaluated, Objective};
use crate::terms::{Terms, Weights};
use isoform_geom::RationalPatch;
use isoform_num::linalg::{cholesky, cholesky_solve};

/// Initial damping of a phase, relative to the diagonal: small enough for steps of nearly full
/// length from the start.
const INITIAL_DAMPING: f64 = 1e-4;
/// Minimum damping: smaller values no longer change steps but let rounding decide along the
/// singular directions.
const MIN_DAMPING: f64 = 1e-9;
/// Maximum damping: with larger values steps are too short to be useful, and the phase ends.
const MAX_DAMPING: f64 = 1e8;

/// Maximum share of a term in I; the factor of a term with more is lowered. With 1, as in the
/// paper, terms nearly as large as I keep their factors, which costs a quarter of the area.
const MAX_TERM_SHARE: f64 = 0.05;

/// Stopping rule of a phase of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StopRule {
    /// Maximum number of steps.
    pub(crate) steps: usize,
    /// Relative decrease of S: the phase ends after a step with a smaller one, once all factors ω
    /// have settled.
    pub(crate) decrease: f64,
}

/// State of the minimisation that one phase hands on to the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Minimiser {
    damping: f64,
    /// Thresholds to which factors ω are lowered.
    pub(crate) floor: Weights,
}

/// Callback for every accepted step.
pub(crate) type StepCallback<'a> = dyn FnMut(&Objective<'_>, &Terms) + 'a;

impl Minimiser {
    pub(crate) fn new(floor: Weights) -> Self {
        Self {
            damping: INITIAL_DAMPING,
            floor,
        }
    }

    /// Minimises S from a patch that has been evaluated to `at`; returns the value at the end. S
    /// never increases. After each step, factors ω whose term exceeds its share of I are lowered
    /// tenfold, down to their thresholds (section 3.3).
    pub(crate) fn minimise(
        &mut self,
        objective: &mut Objective<'_>,
        patch: &mut RationalPatch,
        mut at: Evaluated,
        stop: StopRule,
        each: &mut StepCallback<'_>,
    ) -> Evaluated {
        self.damping = self.damping.clamp(MIN_DAMPING, 1.0);
        for _ in 0..stop.steps {
            let before = objective.sum(&at.terms);
            let Some(step) = self.step(objective, patch, &at) else {
                return at;
            };
            let decrease = before - objective.sum(&step.value.terms);
            self.relax(decrease, step.expected);
            *patch = step.patch;
            at = step.value;
            let lowered = lower(
                &mut objective.weights,
                &at.terms,
                &self.floor,
                objective.little,
            );
            each(objective, &at.terms);
            if !lowered && decrease < stop.decrease * before {
                return at;
            }
        }
        at
    }

    /// Finds a step that lowers S, with more damping if needed; `None` if the phase ends.
    fn step(
        &mut self,
        objective: &Objective<'_>,
        patch: &RationalPatch,
        at: &Evaluated,
    ) -> Option<AcceptedStep> {
        let d = objective.derivatives(patch, at)?;
        let before = objective.sum(&at.terms);
        // Growth of damping after a rejected step, doubled with each further one.
        let mut rejected_growth = 4.0;
        while self.damping <= MAX_DAMPING {
            if let Some(trial) = damped_step(objective, &d, patch, at, self.damping)
                && let Some(value) = objective.evaluate(&trial.patch)
            {
                if objective.sum(&value.terms) < before {
                    return Some(AcceptedStep {
                        patch: trial.patch,
                        value,
                        expected: trial.expected,
                    });
                }
                // A smaller decrease is lost in rounding.
                if trial.expected <= 1e-13 * before {
                    return None;
                }
            }
            self.damping *= rejected_growth;
            rejected_growth *= 2.0;
        }
        self.damping = INITIAL_DAMPING;
        None
    }

    /// Updates the damping by Nielsen's rule, from the ratio of the decrease to the one predicted
    /// by the quadratic model.
    fn relax(&mut self, decrease: f64, expected: f64) {
        let gain = decrease / expected.max(f64::MIN_POSITIVE);
        let factor = (1.0 - (2.0 * gain.clamp(0.0, 1.0) - 1.0).powi(3)).clamp(0.1, 2.0);
        self.damping = (self.damping * factor).max(MIN_DAMPING);
    }
}

/// Accepted step.
struct AcceptedStep {
    patch: RationalPatch,
    value: Evaluated,
    /// Decrease of S predicted by the quadratic model.
    expected: f64,
}

/// Lowers factors whose term exceeds its share of I (section 3.3), or of `little` if that is
/// larger; returns true if any was lowered.
fn lower(w: &mut Weights, t: &Terms, floor: &Weights, little: f64) -> bool {
    let most = MAX_TERM_SHARE * t.i.max(little);
    let mut lowered = false;
    // With a tolerance, corners that are held in their places keep a patch from its best
    // proportions.
    let corners = if little > 0.0 { 0.02 * most } else { most };
    let mut one = |w: &mut f64, term: f64, most: f64, floor: f64| {
        if *w * term > most && *w > floor {
            *w = (0.1 * *w).max(floor);
            lowered = true;
        }
    };
    let Weights { j, l, r, e } = w;
    one(j, t.j, most, floor.j);
    one(l, t.l, most, floor.l);
    one(r, t.r, most, floor.r);
    one(e, t.e, corners, floor.e);
    lowered
}

struct TrialStep {
    patch: RationalPatch,
    /// Decrease of S predicted by the quadratic model.
    expected: f64,
}

/// Returns the patch after the step v = −(H + λD)⁻¹ g plus half of a = −(H + λD)⁻¹ b, where b is
/// the gradient made of the second derivatives of residuals along v; `None` if the matrix is not
/// positive definite, or if a is too long compared with v for the step to be trusted.
///
/// Patches of nearly equal shape form curved valleys of S, which are narrow if distances are small
/// compared with the patch; v leads out of them, a back (Transtrum, Sethna: Improvements to the
/// Levenberg-Marquardt algorithm for nonlinear least-squares minimization, arXiv 1201.5885 (2012),
/// section 4).
fn damped_step(
    objective: &Objective<'_>,
    d: &Derivatives,
    patch: &RationalPatch,
    at: &Evaluated,
    damping: f64,
) -> Option<TrialStep> {
    let system = DampedSystem::new(d, damping)?;
    let step = system.solve(d.gradient.iter().map(|g| -g).collect());
    let expected = system.expected_decrease(d, &step);
    let back = if objective.bends {
        system.solve(objective.bending(patch, at, &step))
    } else {
        vec![0.0; step.len()]
    };
    // 2|a| ≤ 0.75 |v|, the paper's bound: longer accelerations are beyond what second derivatives
    // can predict.
    let most = (0.5f64 * 0.75).powi(2) * system.squared_length(&step);
    let is_trusted = system.squared_length(&back) <= most;
    let patch = moved(patch, &step, &back);
    let is_finite = expected.is_finite() && patch.control().iter().flatten().all(|v| v.is_finite());
    (is_trusted && is_finite).then_some(TrialStep { patch, expected })
}

/// Matrix H + λD, as its Cholesky factor.
struct DampedSystem {
    factor: Vec<f64>,
    /// Diagonal of D.
    scale: Vec<f64>,
    /// Damping λ.
    damping: f64,
}

impl DampedSystem {
    /// Factors H + λD; `None` if it is not positive definite.
    fn new(d: &Derivatives, damping: f64) -> Option<Self> {
        let n = d.gradient.len();
        let scale = scales(d);
        let mut factor = d.hessian.clone();
        for i in 0..n {
            factor[i * n + i] += damping * scale[i];
        }
        cholesky(&mut factor, n).then_some(Self {
            factor,
            scale,
            damping,
        })
    }

    /// Solves (H + λD) x = b.
    fn solve(&self, mut b: Vec<f64>) -> Vec<f64> {
        cholesky_solve(&self.factor, self.scale.len(), &mut b);
        b
    }

    /// Returns −gᵀx − xᵀHx/2 for (H + λD) x = −g.
    fn expected_decrease(&self, d: &Derivatives, x: &[f64]) -> f64 {
        (0..x.len())
            .map(|i| x[i] * (self.damping * self.scale[i] * x[i] - d.gradient[i]))
            .sum::<f64>()
            * 0.5
    }

    /// Returns |x|² in the metric of the damping, xᵀDx.
    fn squared_length(&self, x: &[f64]) -> f64 {
        x.iter().zip(&self.scale).map(|(x, s)| s * x * x).sum()
    }
}

/// Returns the diagonal of H, each entry raised to at least 1e-4 times the mean.
fn scales(d: &Derivatives) -> Vec<f64> {
    let n = d.gradient.len();
    let diagonal = |i: usize| d.hessian[i * n + i].abs();
    let mean = (0..n).map(diagonal).sum::<f64>() / n as f64;
    (0..n).map(|i| diagonal(i).max(1e-4 * mean)).collect()
}

/// Moves a patch by a step, less half of the acceleration `back`.
fn moved(patch: &RationalPatch, step: &[f64], back: &[f64]) -> RationalPatch {
    let mut patch = patch.clone();
    let count = step.len() / 4;
    for (i, c) in patch.control_mut().iter_mut().enumerate() {
        for k in 0..4 {
            c[k] += step[k * count + i] - 0.5 * back[k * count + i];
        }
    }
    patch
}
