//! Simulated annealing of Goffe, Ferrier and Rogers (1994, J. Econometrics 60:65–99) after Corana
//! et al. (1987), cooled linearly.
//!
//! One coordinate at a time is moved by a uniform random step; uphill moves pass with probability
//! exp(−Δ/T). After 20 rounds the step of each coordinate is adapted so that about half of its
//! moves pass, and after `adaptations` of those the temperature falls. The paper cools linearly
//! where Goffe cools geometrically: T runs from its start to 0 in `temperatures` equal steps, in
//! the first half of the evaluations; the rest stays at T = 0 until nothing moves, since the last
//! linear step is still far above the noise.

use crate::Objective;

/// Rounds over all coordinates between adaptations of the steps (Corana's N_s).
const CYCLES: usize = 20;
/// Corana's c: how fast steps adapt.
const ADAPT: f64 = 2.0;
/// At temperature 0 the search ends when a round lowers the value by less than this share.
const FROZEN: f64 = 1e-6;

/// Settings of [`minimize`].
#[derive(Clone, Debug)]
pub struct Options {
    /// First temperature relative to the median value of [`Options::probes`] random points.
    pub temperature: f64,
    /// Number of temperatures, falling linearly to 0.
    pub temperatures: usize,
    /// Adaptations of the steps at each temperature.
    pub adaptations: usize,
    /// Random points that set the temperature's scale.
    pub probes: usize,
    /// Most evaluations; `temperatures` is cut so that the cooling ends there.
    pub max_evaluations: usize,
    /// Ends when the value falls to this.
    pub threshold: f64,
    /// Seed.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            temperature: 0.1,
            temperatures: 100,
            adaptations: 5,
            probes: 32,
            max_evaluations: 400_000,
            threshold: 0.0,
            seed: 2004,
        }
    }
}

/// Where the annealing ended.
#[derive(Clone, Debug)]
pub struct Annealed {
    /// Best variables seen.
    pub x: Vec<f64>,
    /// Value there.
    pub value: f64,
    /// Evaluations.
    pub evaluations: usize,
    /// Whether the value fell to the threshold.
    pub reached: bool,
}

/// Anneals within finite bounds. `monitor` is asked after each adaptation, with the evaluations and
/// the best value.
pub fn minimize(
    objective: &mut dyn Objective,
    x: Vec<f64>,
    lo: &[f64],
    hi: &[f64],
    options: &Options,
    monitor: &mut dyn FnMut(usize, f64) -> bool,
) -> Annealed {
    let n = objective.dim();
    let mut random = fastrand::Rng::with_seed(options.seed);
    let finite = |v: f64| if v.is_nan() { f64::INFINITY } else { v };
    let mut value = finite(objective.value(&x));
    let mut probes: Vec<f64> = (0..options.probes.max(1))
        .map(|_| {
            let p: Vec<f64> = (0..n)
                .map(|i| lo[i] + (hi[i] - lo[i]) * random.f64())
                .collect();
            finite(objective.value(&p))
        })
        .collect();
    probes.sort_by(f64::total_cmp);
    let mut evaluations = 1 + probes.len();
    let typical = probes[probes.len() / 2].min(f64::MAX);
    let per_temperature = (options.adaptations * CYCLES * n).max(1);
    let temperatures = options
        .temperatures
        .min(options.max_evaluations / (2 * per_temperature))
        .max(1);
    let frozen = (options.max_evaluations / per_temperature).saturating_sub(temperatures);
    let mut best = Annealed {
        x: x.clone(),
        value,
        evaluations,
        reached: value <= options.threshold,
    };
    let mut x = x;
    let mut step: Vec<f64> = (0..n).map(|i| 0.5 * (hi[i] - lo[i])).collect();
    let mut trial = x.clone();
    'cooling: for k in 0..temperatures + frozen {
        let temperature =
            options.temperature * typical * (1.0 - k as f64 / temperatures as f64).max(0.0);
        let before = best.value;
        for _ in 0..options.adaptations {
            let mut passed = vec![0_usize; n];
            for _ in 0..CYCLES {
                for i in 0..n {
                    trial.copy_from_slice(&x);
                    trial[i] += step[i] * (2.0 * random.f64() - 1.0);
                    if trial[i] < lo[i] || trial[i] > hi[i] {
                        trial[i] = lo[i] + (hi[i] - lo[i]) * random.f64();
                    }
                    let moved: Vec<f64> = trial.iter().zip(&x).map(|(u, v)| u - v).collect();
                    let allowed = objective.step_limit(&x, &moved) >= 1.0;
                    let found = if allowed {
                        finite(objective.value(&trial))
                    } else {
                        f64::INFINITY
                    };
                    evaluations += 1;
                    if found <= value || random.f64() < ((value - found) / temperature).exp() {
                        x[i] = trial[i];
                        value = found;
                        passed[i] += 1;
                        if value < best.value {
                            best.x.copy_from_slice(&x);
                            best.value = value;
                        }
                    }
                    if best.value <= options.threshold {
                        best.reached = true;
                        break 'cooling;
                    }
                }
            }
            for i in 0..n {
                let rate = passed[i] as f64 / CYCLES as f64;
                if rate > 0.6 {
                    step[i] *= 1.0 + ADAPT * (rate - 0.6) / 0.4;
                } else if rate < 0.4 {
                    step[i] /= 1.0 + ADAPT * (0.4 - rate) / 0.4;
                }
                step[i] = step[i].min(hi[i] - lo[i]);
            }
            if !monitor(evaluations, best.value) {
                break 'cooling;
            }
        }
        if k > temperatures && before - best.value <= FROZEN * best.value {
            break;
        }
        // Goffe's rule: each temperature starts from the best point so far.
        x.copy_from_slice(&best.x);
        value = best.value;
    }
    best.evaluations = evaluations;
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Egg;

    #[test]
    fn finds_the_lowest_of_many_minima() {
        let options = Options {
            max_evaluations: 60_000,
            ..Options::default()
        };
        let out = minimize(
            &mut Egg(3),
            vec![3.1, -2.4, 3.9],
            &[-4.0; 3],
            &[4.0; 3],
            &options,
            &mut |_, _| true,
        );
        assert!(out.value < 0.01, "{out:?}");
        let again = minimize(
            &mut Egg(3),
            vec![3.1, -2.4, 3.9],
            &[-4.0; 3],
            &[4.0; 3],
            &options,
            &mut |_, _| true,
        );
        assert_eq!(out.x, again.x);
    }

    #[test]
    fn ends_at_the_threshold() {
        let options = Options {
            threshold: 1.0,
            ..Options::default()
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
