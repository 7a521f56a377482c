//! The quasi-Newton method of paper C (BFGS with a line search), with bounds by projection.
//!
//! Variables at a bound that the gradient pushes against are held for the step. The line search
//! follows the projected path and requires Armijo's decrease; the inverse Hessian is updated if the
//! curvature is positive (Nocedal and Wright 2006, ch. 6).

use crate::Objective;
use crate::bounds::Bounds;
use crate::lm::{Minimum, Stop};
use crate::objective::ModelPoint;
use crate::vector::{dot, is_finite, minus, norm};

/// Settings of [`minimize`].
#[derive(Clone, Debug)]
pub struct BfgsOptions {
    /// Maximum number of evaluations.
    pub max_iterations: usize,
    /// Relative decrease of the value below which a step ends the run.
    pub decrease: f64,
    /// Largest component of the projected gradient, relative to its maximum so far, below which the
    /// run ends.
    pub gradient: f64,
}

impl Default for BfgsOptions {
    fn default() -> Self {
        Self {
            max_iterations: 2000,
            decrease: 1e-12,
            gradient: 1e-9,
        }
    }
}

/// Minimises within `lo` and `hi` from `x`. `monitor` is called with every accepted point and ends
/// the run by returning `false`.
///
/// ```
/// use isoform_fit::{Objective, bfgs};
///
/// /// (x − 1)² + (y − x)², with its minimum at (1, 1).
/// struct Slide;
/// impl Objective for Slide {
///     fn dim(&self) -> usize {
///         2
///     }
///     fn value(&mut self, x: &[f64]) -> f64 {
///         (x[0] - 1.0).powi(2) + (x[1] - x[0]).powi(2)
///     }
///     fn model(&mut self, x: &[f64], g: &mut [f64], _: &mut [f64]) -> f64 {
///         // The gradient of half the value; BFGS does not use the matrix.
///         g.copy_from_slice(&[2.0 * x[0] - 1.0 - x[1], x[1] - x[0]]);
///         self.value(x)
///     }
/// }
///
/// let (lo, hi) = ([-4.0; 2], [4.0; 2]);
/// let options = bfgs::BfgsOptions::default();
/// let start = vec![3.0, -2.0];
/// let found = bfgs::minimize(&mut Slide, start, &lo, &hi, &options, &mut |_, _, _| true);
/// assert!(found.x.iter().all(|v| (v - 1.0).abs() < 1e-6));
/// ```
pub fn minimize(
    objective: &mut dyn Objective,
    x: Vec<f64>,
    lo: &[f64],
    hi: &[f64],
    options: &BfgsOptions,
    monitor: &mut dyn FnMut(usize, &[f64], f64) -> bool,
) -> Minimum {
    let mut descent = BfgsRun::new(objective, x, Bounds { lo, hi }, options);
    if !descent.here.has_gradient() {
        return Minimum::not_finite(descent.here.x, descent.iterations);
    }
    descent.restart();
    let stop = loop {
        let ModelPoint { x, value, .. } = &descent.here;
        if !monitor(descent.iterations, x, *value) {
            break Stop::Told;
        }
        if let Some(stop) = descent.advance() {
            break stop;
        }
    };
    Minimum {
        x: descent.here.x,
        value: descent.here.value,
        normal: None,
        iterations: descent.iterations,
        stop,
    }
}

/// State of a run from one start.
struct BfgsRun<'a> {
    objective: &'a mut dyn Objective,
    bounds: Bounds<'a>,
    options: &'a BfgsOptions,
    here: ModelPoint,
    trial: ModelPoint,
    /// Inverse of the Hessian of half the value, as approximated so far.
    inverse: Vec<f64>,
    /// True until the first update of the inverse.
    is_fresh: bool,
    /// Largest component of the projected gradient so far.
    steepest: f64,
    iterations: usize,
}

impl<'a> BfgsRun<'a> {
    fn new(
        objective: &'a mut dyn Objective,
        x: Vec<f64>,
        bounds: Bounds<'a>,
        options: &'a BfgsOptions,
    ) -> Self {
        let n = objective.dim();
        let mut here = ModelPoint::new(x, n);
        here.evaluate(objective);
        Self {
            bounds,
            options,
            here,
            trial: ModelPoint::new(vec![0.0; n], n),
            inverse: Vec::new(),
            is_fresh: true,
            steepest: 0.0,
            iterations: 1,
            objective,
        }
    }

    /// Resets the inverse Hessian: the next step is one of steepest descent, of length 1.
    fn restart(&mut self) {
        let length = norm(&self.here.gradient).max(f64::MIN_POSITIVE);
        self.inverse = identity(self.here.x.len(), 1.0 / length);
        self.is_fresh = true;
    }

    /// Makes one line search and updates the inverse Hessian. Returns the reason to stop, if any.
    fn advance(&mut self) -> Option<Stop> {
        let held = self.held();
        if self.is_stationary(&held) {
            return Some(Stop::Converged);
        }
        let direction = self.direction(&held);
        match self.search(&direction) {
            None => self.take(),
            Some(Stop::Converged) if !self.is_fresh => {
                self.restart();
                None
            }
            stop => stop,
        }
    }

    /// Flags the variables at a bound that descent would cross.
    fn held(&self) -> Vec<bool> {
        let ModelPoint { x, gradient, .. } = &self.here;
        let Bounds { lo, hi } = self.bounds;
        let is_held =
            |i: usize| (x[i] <= lo[i] && gradient[i] > 0.0) || (x[i] >= hi[i] && gradient[i] < 0.0);
        (0..x.len()).map(is_held).collect()
    }

    fn is_stationary(&mut self, held: &[bool]) -> bool {
        let free = self.here.gradient.iter().zip(held).filter(|(_, h)| !**h);
        let slope = free.map(|(g, _)| g.abs()).fold(0.0, f64::max);
        self.steepest = self.steepest.max(slope);
        self.here.value == 0.0 || slope <= self.options.gradient * self.steepest
    }

    /// Returns −H g in the variables that are not held, or steepest descent if that is not a
    /// descent direction.
    fn direction(&mut self, held: &[bool]) -> Vec<f64> {
        let p = self.newton(held);
        if dot(&p, &self.here.gradient) < 0.0 && is_finite(&p) {
            return p;
        }
        self.restart();
        let slopes = self.here.gradient.iter().zip(held);
        slopes
            .map(|(g, held)| if *held { 0.0 } else { -self.inverse[0] * g })
            .collect()
    }

    fn newton(&self, held: &[bool]) -> Vec<f64> {
        let (n, g) = (held.len(), &self.here.gradient);
        let row = |i: usize| {
            let free = (0..n).filter(|&j| !held[j]);
            -free.map(|j| self.inverse[i * n + j] * g[j]).sum::<f64>()
        };
        (0..n).map(|i| if held[i] { 0.0 } else { row(i) }).collect()
    }

    /// Backtracks along the projected path by quadratic interpolation until the trial is low
    /// enough. Returns the reason to stop if no such point exists.
    fn search(&mut self, direction: &[f64]) -> Option<Stop> {
        let mut t: f64 = 1.0;
        loop {
            if self.iterations >= self.options.max_iterations {
                return Some(Stop::Iterations);
            }
            let step = self.set_trial(direction, t);
            self.trial.evaluate(self.objective);
            self.iterations += 1;
            let descent = 2.0 * dot(&self.here.gradient, &step);
            if self.is_low_enough(descent) {
                return None;
            }
            // A step below this is rounding in variables of order one.
            if step.iter().all(|v| v.abs() < 1e-14) {
                return Some(Stop::Converged);
            }
            t *= self.cut(descent);
        }
    }

    /// Sets the trial to t times the direction, projected onto the bounds and limited to the step
    /// that the objective allows. Returns the projected step.
    fn set_trial(&mut self, direction: &[f64], t: f64) -> Vec<f64> {
        let (x, Bounds { lo, hi }) = (&self.here.x, self.bounds);
        for i in 0..x.len() {
            self.trial.x[i] = (x[i] + t * direction[i]).clamp(lo[i], hi[i]);
        }
        let step = minus(&self.trial.x, x);
        let limit = self.objective.step_limit(x, &step);
        if limit < 1.0 {
            for i in 0..x.len() {
                self.trial.x[i] = x[i] + limit * step[i];
            }
        }
        step
    }

    /// Armijo's rule with constant 1e-4; `descent` is the change that the slope predicts.
    fn is_low_enough(&self, descent: f64) -> bool {
        let (here, trial) = (&self.here, &self.trial);
        trial.has_gradient()
            && trial.value <= here.value + 1e-4 * descent.min(0.0)
            && trial.value < here.value
    }

    /// Returns the factor, between 0.1 and 0.5, at which the parabola through value, slope and
    /// trial is lowest.
    fn cut(&self, descent: f64) -> f64 {
        let parabola = -0.5 * descent / (self.trial.value - self.here.value - descent);
        if self.trial.value.is_finite() && parabola.is_finite() {
            parabola.clamp(0.1, 0.5)
        } else {
            0.1
        }
    }

    /// Moves to the trial and updates the inverse Hessian. Returns `Converged` if the decrease was
    /// too small.
    fn take(&mut self) -> Option<Stop> {
        let s = minus(&self.trial.x, &self.here.x);
        let y = minus(&self.trial.gradient, &self.here.gradient);
        let fall = self.here.value - self.trial.value;
        std::mem::swap(&mut self.here, &mut self.trial);
        let sy = dot(&s, &y);
        // Below this cosine between step and change of the gradient, rounding decides the sign.
        if sy > 1e-12 * norm(&s) * norm(&y) {
            if self.is_fresh {
                self.inverse = identity(s.len(), sy / dot(&y, &y));
                self.is_fresh = false;
            }
            update(&mut self.inverse, &s, &y, sy);
        }
        (fall <= self.options.decrease * self.here.value).then_some(Stop::Converged)
    }
}

/// H ← (I − ρ s yᵀ) H (I − ρ y sᵀ) + ρ s sᵀ, where ρ = 1 / sᵀy.
fn update(inverse: &mut [f64], s: &[f64], y: &[f64], sy: f64) {
    let n = s.len();
    let hy: Vec<f64> = inverse.chunks_exact(n).map(|row| dot(row, y)).collect();
    let yhy = dot(y, &hy);
    for i in 0..n {
        for j in 0..n {
            inverse[i * n + j] +=
                (1.0 + yhy / sy) * s[i] * s[j] / sy - (hy[i] * s[j] + s[i] * hy[j]) / sy;
        }
    }
}

fn identity(n: usize, v: f64) -> Vec<f64> {
    (0..n * n)
        .map(|k| if k / n == k % n { v } else { 0.0 })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Powell, Rosenbrock};

    fn run(objective: &mut dyn Objective, start: &[f64], lo: f64, hi: f64) -> Minimum {
        let n = start.len();
        minimize(
            objective,
            start.to_vec(),
            &vec![lo; n],
            &vec![hi; n],
            &BfgsOptions::default(),
            &mut |_, _, _| true,
        )
    }

    #[test]
    fn rosenbrock_without_and_with_bounds() {
        let free = run(
            &mut Rosenbrock,
            &[-1.2, 1.0],
            f64::NEG_INFINITY,
            f64::INFINITY,
        );
        assert!(free.x.iter().all(|v| (v - 1.0).abs() < 1e-5), "{free:?}");
        let bound = run(&mut Rosenbrock, &[-1.2, -1.0], -2.0, 0.5);
        assert!(
            (bound.x[0] - 0.5).abs() < 1e-6 && (bound.x[1] - 0.25).abs() < 1e-4,
            "{bound:?}"
        );
    }

    #[test]
    fn singular_at_the_solution() {
        let m = run(&mut Powell, &[3.0, -1.0, 0.0, 1.0], -4.0, 4.0);
        assert!(m.value < 1e-8, "{m:?}");
    }

    #[test]
    fn a_function_without_numbers_is_left_alone() {
        assert_eq!(
            run(&mut crate::testing::Nothing, &[0.5], 0.0, 1.0).stop,
            Stop::NotFinite
        );
    }
}
