//! Levenberg-Marquardt on accumulated normal equations, within bounds.
//!
//! A step minimises the Gauss-Newton model in scaled variables x̂ = D⁻¹x within a ball: (D JᵀJ D +
//! C + μI) p̂ = −D Jᵀr, |p̂| ≤ Δ. D² = diag(v), with v the distance to the bound that the descent
//! direction approaches (1 without one), and C = diag(|g|) are Coleman and Li's (1996, SIAM J.
//! Optim. 6:418–445). A step that meets a bound competes with its reflection there and with the
//! scaled gradient (Branch, Coleman, Li 1999, SIAM J. Sci. Comput. 21:1–23); iterates stay strictly
//! inside. The ball grows and shrinks with the quality of the model.
//!
//! The way in which a long step is fitted into the ball decides how many wide starts reach the
//! global minimum. Measured on a part with 12 parameters and 512 points, 1000 starts per variant:
//!
//! | variant | wide starts | starts informed by the data |
//! |---|---|---|
//! | μ from Moré's iteration, the textbook's way | 67 to 82 % | 82 to 96 % |
//! | Gauss-Newton step (a least μ only) cut to length | 63 to 99 % | 86 to 99.6 % |
//!
//! The cut step also takes a third fewer evaluations: large μ turns the step towards the gradient,
//! which moves steep directions and leaves misplaced primitives where they are. It is the default;
//! Moré's iteration is [`LmOptions::exact`]. Without the reflection half of the wide starts fail.
//! The ball must be one in the variables' own units: measured by diag(JᵀJ), Marquardt's way, only 2
//! to 33 % succeed, because on the zero sets of R-functions inactive primitives have derivatives
//! near zero and fly off.
//!
//! ```
//! use isoform_fit::{Objective, lm};
//!
//! /// Σ r² of r = (x − 3, 2 (y + 1)).
//! struct Bowl;
//! impl Objective for Bowl {
//!     fn dim(&self) -> usize {
//!         2
//!     }
//!     fn value(&mut self, x: &[f64]) -> f64 {
//!         (x[0] - 3.0).powi(2) + 4.0 * (x[1] + 1.0).powi(2)
//!     }
//!     fn model(&mut self, x: &[f64], g: &mut [f64], h: &mut [f64]) -> f64 {
//!         g.copy_from_slice(&[x[0] - 3.0, 4.0 * (x[1] + 1.0)]);
//!         h.copy_from_slice(&[1.0, 0.0, 0.0, 4.0]);
//!         self.value(x)
//!     }
//! }
//!
//! let (lo, hi) = ([-5.0; 2], [2.0, 5.0]);
//! let options = lm::LmOptions::default();
//! let found = lm::minimize(&mut Bowl, vec![0.0; 2], &lo, &hi, &options, &mut |_, _, _| true);
//! // The bound of x keeps it at 2, where the sum is (2 − 3)².
//! assert!((found.x[0] - 2.0).abs() < 1e-6 && (found.x[1] + 1.0).abs() < 1e-6);
//! assert!((found.value - 1.0).abs() < 1e-6);
//! ```

mod region;

use self::region::TrustRegion;
use crate::Objective;
use crate::bounds::Bounds;
use crate::objective::ModelPoint;

/// Settings of [`minimize`].
#[derive(Clone, Debug)]
pub struct LmOptions {
    /// Maximum number of evaluations of the model.
    pub max_iterations: usize,
    /// Largest move of a variable, in its unit, below which the run ends.
    pub step: f64,
    /// Relative decrease of the cost below which a good step ends the run.
    pub decrease: f64,
    /// Largest gradient component, scaled by its distance to the bound and by its column and
    /// relative to the residual, below which the run ends.
    pub gradient: f64,
    /// Number of steps over which the cost must fall by `stagnation_share`, or the run ends.
    pub stagnation_window: usize,
    /// Least relative decrease of the cost over `stagnation_window` steps.
    pub stagnation_share: f64,
    /// Radius Δ of the first step, in scaled variables. 0.02 to 1 do equally well; from 10 on wide
    /// starts are lost to bad first steps.
    pub radius: f64,
    /// True to shorten long steps by damping, as in textbooks, instead of cutting them.
    pub exact: bool,
}

impl Default for LmOptions {
    fn default() -> Self {
        Self {
            max_iterations: 200,
            step: 1e-10,
            decrease: 1e-9,
            gradient: 1e-10,
            stagnation_window: 12,
            stagnation_share: 1e-4,
            radius: 0.3,
            exact: false,
        }
    }
}

/// Reason for which a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// Gradient, step or decrease fell below its tolerance.
    Converged,
    /// The cost hardly fell over many steps.
    Stagnated,
    /// The maximum number of evaluations was reached.
    Iterations,
    /// The caller's monitor ended the run.
    Told,
    /// The function has no finite value at the start.
    NotFinite,
}

/// Result of a solver.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// Variables.
    pub x: Vec<f64>,
    /// Value Σ w r² at x.
    pub value: f64,
    /// Gauss-Newton matrix Jᵀ W J at x, row-major; `None` from solvers without one.
    pub normal: Option<Vec<f64>>,
    /// Number of evaluations.
    pub iterations: usize,
    /// Reason for which it stopped.
    pub stop: Stop,
}

impl Minimum {
    /// Makes the result of a solver whose start has no finite value.
    pub(crate) fn not_finite(x: Vec<f64>, iterations: usize) -> Self {
        Self {
            x,
            value: f64::INFINITY,
            normal: None,
            iterations,
            stop: Stop::NotFinite,
        }
    }
}

/// Minimises within `lo` and `hi` from `x`, which must lie strictly between. `monitor` is called
/// with every accepted point (iteration, x, value) and ends the run by returning `false`.
pub fn minimize(
    objective: &mut dyn Objective,
    x: Vec<f64>,
    lo: &[f64],
    hi: &[f64],
    options: &LmOptions,
    monitor: &mut dyn FnMut(usize, &[f64], f64) -> bool,
) -> Minimum {
    let mut descent = LmRun::new(objective, x, Bounds { lo, hi }, options);
    if !descent.here.is_finite() {
        return Minimum::not_finite(descent.here.x, descent.iterations);
    }
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
        normal: Some(descent.here.matrix),
        iterations: descent.iterations,
        stop,
    }
}

/// Outcome of an attempted step.
enum StepOutcome {
    Taken,
    Refused,
    Ended(Stop),
}

/// State of a run from one start.
struct LmRun<'a> {
    objective: &'a mut dyn Objective,
    bounds: Bounds<'a>,
    options: &'a LmOptions,
    here: ModelPoint,
    trial: ModelPoint,
    region: TrustRegion,
    /// Values at the points accepted so far.
    past: Vec<f64>,
    /// True if the last step lowered the sum by about the predicted amount.
    is_trusted: bool,
    iterations: usize,
}

impl<'a> LmRun<'a> {
    fn new(
        objective: &'a mut dyn Objective,
        x: Vec<f64>,
        bounds: Bounds<'a>,
        options: &'a LmOptions,
    ) -> Self {
        let n = objective.dim();
        let mut here = ModelPoint::new(x, n);
        here.evaluate(objective);
        Self {
            bounds,
            options,
            past: vec![here.value],
            here,
            trial: ModelPoint::new(vec![0.0; n], n),
            region: TrustRegion::new(n, options.radius, options.exact),
            is_trusted: false,
            iterations: 1,
            objective,
        }
    }

    /// Makes a step that lowers the value. Returns the reason to stop, if any.
    fn advance(&mut self) -> Option<Stop> {
        let slope = self.region.set(&self.here, self.bounds);
        if self.here.value == 0.0 || self.region.is_stationary(&self.here, self.options.gradient) {
            return Some(Stop::Converged);
        }
        // Share of the way to a bound that a cut step covers; towards 1 as the gradient vanishes.
        let share = 0.995_f64.max(1.0 - slope);
        // Refused steps shrink the region, so the loop ends.
        let ended = loop {
            match self.attempt(share) {
                StepOutcome::Refused => {}
                StepOutcome::Taken => break None,
                StepOutcome::Ended(stop) => break Some(stop),
            }
        };
        ended.or_else(|| self.has_stagnated().then_some(Stop::Stagnated))
    }

    /// Attempts the step that the region proposes.
    fn attempt(&mut self, share: f64) -> StepOutcome {
        if self.iterations >= self.options.max_iterations {
            return StepOutcome::Ended(Stop::Iterations);
        }
        let Some(predicted) = self.region.step(&self.here.x, self.bounds, share) else {
            return StepOutcome::Ended(Stop::Stagnated);
        };
        // The last prediction was right: a fall below the tolerance need not be evaluated.
        if self.is_trusted && 2.0 * predicted <= self.options.decrease * self.here.value {
            return StepOutcome::Ended(Stop::Converged);
        }
        if self.set_trial() <= self.options.step {
            return StepOutcome::Ended(Stop::Converged);
        }
        self.trial.evaluate(self.objective);
        self.iterations += 1;
        if !self.trial.is_finite() {
            self.region.shrink();
            return StepOutcome::Refused;
        }
        self.compare(predicted)
    }

    /// Sets the trial one step ahead, strictly inside the bounds. Returns the largest move of a
    /// variable.
    fn set_trial(&mut self) -> f64 {
        let x = &self.here.x;
        let limit = self.objective.step_limit(x, &self.region.step);
        let mut length: f64 = 0.0;
        for i in 0..x.len() {
            let p = self.region.step[i] * limit;
            length = length.max(p.abs());
            // Strictly interior, yet invisible in a result.
            let gap = 1e-12 * self.bounds.range(i).min(1.0);
            self.trial.x[i] = (x[i] + p).clamp(self.bounds.lo[i] + gap, self.bounds.hi[i] - gap);
        }
        length
    }

    /// Compares the trial with the current point, and moves there if it is lower.
    fn compare(&mut self, predicted: f64) -> StepOutcome {
        let fall = self.here.value - self.trial.value;
        let ratio = self.region.judge(0.5 * fall, predicted);
        // Near a minimum predictions are right to one per cent; far from it they are off by tens.
        self.is_trusted = (ratio - 1.0).abs() < 0.2;
        if self.trial.value < self.here.value {
            self.region.refused = 0;
            std::mem::swap(&mut self.here, &mut self.trial);
            self.past.push(self.here.value);
            let is_small = fall <= self.options.decrease * self.here.value;
            return if is_small && ratio > 0.25 {
                StepOutcome::Ended(Stop::Converged)
            } else {
                StepOutcome::Taken
            };
        }
        self.region.refused += 1;
        // The predicted fall is rounding: no step can be judged by it.
        if predicted <= 1e-15 * self.here.value {
            StepOutcome::Ended(Stop::Converged)
        } else {
            StepOutcome::Refused
        }
    }

    /// Returns true if the cost hardly fell over the last steps.
    fn has_stagnated(&self) -> bool {
        let window = self.options.stagnation_window;
        let before = self.past.iter().rev().nth(window);
        let share = self.options.stagnation_share;
        before.is_some_and(|v| v - self.here.value < share * self.here.value)
    }
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
            &LmOptions::default(),
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
        assert!(free.x.iter().all(|v| (v - 1.0).abs() < 1e-8), "{free:?}");
        assert!(free.iterations < 60, "{free:?}");
        // In [−2, ½]² the minimum is at (½, ¼), on the upper bound of x: there f = 4·0 + ... = (1 −
        // ½)².
        let bound = run(&mut Rosenbrock, &[-1.2, -1.0], -2.0, 0.5);
        assert!(
            (bound.x[0] - 0.5).abs() < 1e-5 && (bound.x[1] - 0.25).abs() < 1e-5,
            "{bound:?}"
        );
        assert!(bound.x[0] < 0.5);
        assert!((bound.value - 0.25).abs() < 1e-5);
    }

    #[test]
    fn singular_at_the_solution() {
        let m = run(&mut Powell, &[3.0, -1.0, 0.0, 1.0], -4.0, 4.0);
        assert!(m.value < 1e-10, "{m:?}");
    }

    #[test]
    fn a_function_without_numbers_is_left_alone() {
        let m = run(&mut crate::testing::Nothing, &[0.5], 0.0, 1.0);
        assert_eq!((m.stop, m.x[0]), (Stop::NotFinite, 0.5));
    }
}
