//! Simulated annealing of Goffe, Ferrier and Rogers (1994, J. Econometrics 60:65–99) after Corana
//! et al. (1987).
//!
//! One coordinate at a time is moved by a uniform random step; uphill moves pass with probability
//! exp(−Δ/T). After 20 rounds the step of each coordinate is adapted so that about half of its
//! moves pass, and after `adaptations` of those the temperature falls to `cooling` times itself.
//! Cooling by a factor goes through all scales of the function: linear cooling, which paper C
//! (section 5) names, ends with a step that is far above the noise of the data.

use crate::Objective;
use crate::bounds::Bounds;
use crate::vector::minus;

/// Number of moves of each coordinate between two adaptations of the steps (Corana's N_s).
const CYCLES_PER_ADAPTATION: usize = 20;

/// Settings of [`minimize`].
#[derive(Clone, Debug)]
pub struct AnnealingOptions {
    /// First temperature, relative to the median value of [`AnnealingOptions::probes`] random
    /// points.
    pub temperature: f64,
    /// Factor from one temperature to the next (Goffe's r_T).
    pub cooling: f64,
    /// Adaptations of the steps at each temperature.
    pub adaptations: usize,
    /// Random points that set the temperature's scale.
    pub probes: usize,
    /// Maximum number of evaluations.
    pub max_evaluations: usize,
    /// Value at or below which the annealing ends.
    pub threshold: f64,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl Default for AnnealingOptions {
    fn default() -> Self {
        Self {
            temperature: 1.0,
            cooling: 0.85,
            adaptations: 5,
            probes: 32,
            max_evaluations: 400_000,
            threshold: 0.0,
            seed: 2004,
        }
    }
}

/// Result of [`minimize`].
#[derive(Clone, Debug)]
pub struct AnnealingResult {
    /// Best variables found.
    pub x: Vec<f64>,
    /// Value there.
    pub value: f64,
    /// Number of evaluations.
    pub evaluations: usize,
    /// True if the value fell to the threshold.
    pub reached: bool,
}

/// Anneals within finite bounds. `monitor` is called after each adaptation with the number of
/// evaluations and the best value; it ends the run by returning `false`.
///
/// ```
/// use isoform_fit::{Objective, annealing};
///
/// /// Two basins on [−2, 2]: (x² − 1)² + 0.3 x, the deeper one on the left.
/// struct Double;
/// impl Objective for Double {
///     fn dim(&self) -> usize {
///         1
///     }
///     fn value(&mut self, x: &[f64]) -> f64 {
///         (x[0] * x[0] - 1.0).powi(2) + 0.3 * x[0]
///     }
///     fn model(&mut self, x: &[f64], _: &mut [f64], _: &mut [f64]) -> f64 {
///         self.value(x)
///     }
/// }
///
/// let options = annealing::AnnealingOptions {
///     max_evaluations: 40_000,
///     threshold: f64::NEG_INFINITY,
///     ..Default::default()
/// };
/// let found =
///     annealing::minimize(&mut Double, vec![1.0], &[-2.0], &[2.0], &options, &mut |_, _| true);
/// // The derivative 4x(x² − 1) + 0.3 vanishes at the minimum.
/// let x = found.x[0];
/// assert!(x < 0.0 && (4.0 * x * (x * x - 1.0) + 0.3).abs() < 1e-3);
/// ```
pub fn minimize(
    objective: &mut dyn Objective,
    x: Vec<f64>,
    lo: &[f64],
    hi: &[f64],
    options: &AnnealingOptions,
    monitor: &mut dyn FnMut(usize, f64) -> bool,
) -> AnnealingResult {
    let mut walk = AnnealingWalk::new(objective, x, Bounds { lo, hi }, options);
    let mut temperature = options.temperature * walk.typical();
    // The search is frozen (Goffe's N_ε and ε) once the values at the ends of four temperatures are
    // within 1e-9 of the best one, relatively.
    let mut ends = [f64::INFINITY; 4];
    while walk.best.evaluations < options.max_evaluations {
        if !walk.stay(temperature, options.adaptations, monitor) {
            break;
        }
        ends.rotate_left(1);
        ends[3] = walk.value;
        let best = walk.best.value;
        if ends.iter().all(|end| end - best <= 1e-9 * best.abs()) {
            break;
        }
        walk.back_to_best();
        temperature *= options.cooling;
    }
    walk.best
}

/// A random walk with the best point visited.
struct AnnealingWalk<'a> {
    objective: &'a mut dyn Objective,
    bounds: Bounds<'a>,
    random: fastrand::Rng,
    /// Values at random points, ascending.
    probes: Vec<f64>,
    threshold: f64,
    x: Vec<f64>,
    value: f64,
    /// Largest move of each variable.
    step: Vec<f64>,
    trial: Vec<f64>,
    best: AnnealingResult,
}

impl<'a> AnnealingWalk<'a> {
    fn new(
        objective: &'a mut dyn Objective,
        x: Vec<f64>,
        bounds: Bounds<'a>,
        options: &AnnealingOptions,
    ) -> Self {
        let n = objective.dim();
        let mut random = fastrand::Rng::with_seed(options.seed);
        let value = comparable(objective.value(&x));
        let probes = probes(objective, bounds, options.probes.max(1), &mut random);
        let best = AnnealingResult {
            x: x.clone(),
            value,
            evaluations: 1 + probes.len(),
            reached: value <= options.threshold,
        };
        Self {
            objective,
            bounds,
            random,
            probes,
            threshold: options.threshold,
            trial: x.clone(),
            x,
            value,
            step: (0..n).map(|i| 0.5 * bounds.range(i)).collect(),
            best,
        }
    }

    /// Returns the median value of the random points.
    fn typical(&self) -> f64 {
        self.probes[self.probes.len() / 2].min(f64::MAX)
    }

    /// Returns to the best point so far, from which Goffe starts each temperature.
    fn back_to_best(&mut self) {
        self.x.copy_from_slice(&self.best.x);
        self.value = self.best.value;
    }

    /// Walks at one temperature. Returns false at the threshold or if the monitor ends the run.
    fn stay(
        &mut self,
        temperature: f64,
        adaptations: usize,
        monitor: &mut dyn FnMut(usize, f64) -> bool,
    ) -> bool {
        (0..adaptations).all(|_| {
            let Some(passed) = self.cycles(temperature) else {
                return false;
            };
            for (i, passed) in passed.iter().enumerate() {
                self.adapt(i, *passed as f64 / CYCLES_PER_ADAPTATION as f64);
            }
            monitor(self.best.evaluations, self.best.value)
        })
    }

    /// Moves each variable [`CYCLES_PER_ADAPTATION`] times. Returns the number of accepted moves by
    /// variable; `None` at the threshold.
    fn cycles(&mut self, temperature: f64) -> Option<Vec<usize>> {
        let n = self.x.len();
        let mut passed = vec![0_usize; n];
        for i in (0..CYCLES_PER_ADAPTATION).flat_map(|_| 0..n) {
            passed[i] += usize::from(self.passes(i, temperature));
            if self.best.value <= self.threshold {
                self.best.reached = true;
                return None;
            }
        }
        Some(passed)
    }

    /// Proposes a move of variable i. Returns true if it is accepted.
    fn passes(&mut self, i: usize, temperature: f64) -> bool {
        let found = self.propose(i);
        let is_taken =
            found <= self.value || self.random.f64() < ((self.value - found) / temperature).exp();
        if is_taken {
            self.x[i] = self.trial[i];
            self.value = found;
            if found < self.best.value {
                self.best.x.copy_from_slice(&self.x);
                self.best.value = found;
            }
        }
        is_taken
    }

    /// Moves variable i of the trial at random. Returns the value at the trial.
    fn propose(&mut self, i: usize) -> f64 {
        self.trial.copy_from_slice(&self.x);
        self.trial[i] += self.step[i] * (2.0 * self.random.f64() - 1.0);
        if self.trial[i] < self.bounds.lo[i] || self.trial[i] > self.bounds.hi[i] {
            self.trial[i] = self.bounds.drawn(i, &mut self.random);
        }
        self.best.evaluations += 1;
        let moved = minus(&self.trial, &self.x);
        if self.objective.step_limit(&self.x, &moved) >= 1.0 {
            comparable(self.objective.value(&self.trial))
        } else {
            f64::INFINITY
        }
    }

    /// Adapts the step of variable i to the rate of accepted moves: with Corana's c = 2, towards a
    /// rate between 0.4 and 0.6.
    fn adapt(&mut self, i: usize, rate: f64) {
        let step = &mut self.step[i];
        if rate > 0.6 {
            *step *= 1.0 + 2.0 * (rate - 0.6) / 0.4;
        } else if rate < 0.4 {
            *step /= 1.0 + 2.0 * (0.4 - rate) / 0.4;
        }
        *step = step.min(self.bounds.range(i));
    }
}

/// Returns the values at random points, ascending.
fn probes(
    objective: &mut dyn Objective,
    bounds: Bounds<'_>,
    count: usize,
    random: &mut fastrand::Rng,
) -> Vec<f64> {
    let mut probe = |_: usize| {
        let n = objective.dim();
        let p: Vec<f64> = (0..n).map(|i| bounds.drawn(i, random)).collect();
        comparable(objective.value(&p))
    };
    let mut probes: Vec<f64> = (0..count).map(&mut probe).collect();
    probes.sort_by(f64::total_cmp);
    probes
}

/// Replaces NaN by infinity, so that values can be compared.
fn comparable(v: f64) -> f64 {
    if v.is_nan() { f64::INFINITY } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Egg;

    /// A single descent from a random start finds the lowest of the 5³ minima less than once in a
    /// hundred runs.
    #[test]
    fn finds_the_lowest_of_many_minima() {
        let run = |seed: u64| {
            let options = AnnealingOptions {
                max_evaluations: 60_000,
                seed,
                ..AnnealingOptions::default()
            };
            let (start, [lo, hi]) = (vec![3.1, -2.4, 3.9], [[-4.0; 3], [4.0; 3]]);
            minimize(&mut Egg(3), start, &lo, &hi, &options, &mut |_, _| true)
        };
        let found = (0..20).filter(|seed| run(*seed).value < 1e-9).count();
        assert!(found >= 10, "{found} of 20");
        assert_eq!(run(1).x, run(1).x);
    }

    /// A narrow valley, oblique to all coordinates: cooling continues below any scale of the
    /// function.
    #[test]
    fn cools_down_to_the_digits_of_a_minimum() {
        struct Valley;
        impl Objective for Valley {
            fn dim(&self) -> usize {
                3
            }
            fn value(&mut self, x: &[f64]) -> f64 {
                let [a, b, c] = [x[0] - 1.0, x[1] + 0.5, x[2] - 0.25];
                (a + b + c).powi(2) + 0.01 * ((a - b).powi(2) + (b - c).powi(2))
            }
            fn model(&mut self, x: &[f64], _: &mut [f64], _: &mut [f64]) -> f64 {
                self.value(x)
            }
        }
        let (options, [lo, hi]) = (AnnealingOptions::default(), [[-4.0; 3], [4.0; 3]]);
        let start = vec![-3.0, 3.0, 2.0];
        let found = minimize(&mut Valley, start, &lo, &hi, &options, &mut |_, _| true);
        assert!(found.value < 1e-9, "{found:?}");
    }

    #[test]
    fn ends_at_the_threshold() {
        let options = AnnealingOptions {
            threshold: 1.0,
            ..AnnealingOptions::default()
        };
        let out = minimize(
            &mut Egg(2),
            vec![3.1, -2.4],
            &[-4.0; 2],
            &[4.0; 2],
            &options,
            &mut |_, _| true,
        );
        assert!(
            out.reached && out.value <= 1.0 && out.evaluations < 20_000,
            "{out:?}"
        );
    }
}
