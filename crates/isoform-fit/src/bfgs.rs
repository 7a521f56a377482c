//! The quasi-Newton method of the paper (BFGS with a line search), within bounds by projection.
//!
//! Variables at a bound that the gradient pushes against are held for the step; the line search
//! follows the projected path and asks for Armijo's decrease; the inverse Hessian is updated where
//! the curvature is positive (Nocedal and Wright 2006, ch. 6).

use crate::Objective;
use crate::lm::{Minimum, Stop};

/// Settings of [`minimize`].
#[derive(Clone, Debug)]
pub struct Options {
    /// Most evaluations.
    pub max_iterations: usize,
    /// Stop when a step lowers the cost by less than this share.
    pub decrease: f64,
    /// Stop when the projected gradient is below this share of the first one.
    pub gradient: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            max_iterations: 2000,
            decrease: 1e-12,
            gradient: 1e-9,
        }
    }
}

/// Minimises within `lo` and `hi` from `x`. `monitor` sees every accepted point and ends the run by
/// returning `false`.
pub fn minimize(
    objective: &mut dyn Objective,
    mut x: Vec<f64>,
    lo: &[f64],
    hi: &[f64],
    options: &Options,
    monitor: &mut dyn FnMut(usize, &[f64], f64) -> bool,
) -> Minimum {
    let n = objective.dim();
    let (mut g, mut g_new, mut unused) = (vec![0.0; n], vec![0.0; n], vec![0.0; n * n]);
    let mut value = objective.model(&x, &mut g, &mut unused);
    let mut iterations = 1;
    if !value.is_finite() || g.iter().any(|v| !v.is_finite()) {
        return Minimum {
            x,
            value: f64::INFINITY,
            normal: None,
            iterations,
            stop: Stop::NotFinite,
        };
    }
    let mut inverse = identity(n, 1.0 / norm(&g).max(f64::MIN_POSITIVE));
    let mut is_fresh = true;
    let mut first = 0.0_f64;
    let stop = loop {
        if !monitor(iterations, &x, value) {
            break Stop::Told;
        }
        let held: Vec<bool> = (0..n)
            .map(|i| (x[i] <= lo[i] && g[i] > 0.0) || (x[i] >= hi[i] && g[i] < 0.0))
            .collect();
        let slope = (0..n)
            .filter(|&i| !held[i])
            .map(|i| g[i].abs())
            .fold(0.0, f64::max);
        first = first.max(slope);
        if value == 0.0 || slope <= options.gradient * first {
            break Stop::Converged;
        }
        let mut p: Vec<f64> = (0..n)
            .map(|i| {
                if held[i] {
                    0.0
                } else {
                    -(0..n)
                        .filter(|&j| !held[j])
                        .map(|j| inverse[i * n + j] * g[j])
                        .sum::<f64>()
                }
            })
            .collect();
        if dot(&p, &g) >= 0.0 || p.iter().any(|v| !v.is_finite()) {
            inverse = identity(n, 1.0 / norm(&g).max(f64::MIN_POSITIVE));
            is_fresh = true;
            p = (0..n)
                .map(|i| if held[i] { 0.0 } else { -inverse[0] * g[i] })
                .collect();
        }
        // Backtracking by interpolation along the projected path.
        let mut t: f64 = 1.0;
        let taken = loop {
            if iterations >= options.max_iterations {
                break Err(Stop::Iterations);
            }
            let trial: Vec<f64> = (0..n)
                .map(|i| (x[i] + t * p[i]).clamp(lo[i], hi[i]))
                .collect();
            let s: Vec<f64> = trial.iter().zip(&x).map(|(u, v)| u - v).collect();
            let limit = objective.step_limit(&x, &s);
            let trial: Vec<f64> = if limit < 1.0 {
                x.iter().zip(&s).map(|(v, s)| v + limit * s).collect()
            } else {
                trial
            };
            let found = objective.model(&trial, &mut g_new, &mut unused);
            iterations += 1;
            let descent = 2.0 * dot(&g, &s);
            if found.is_finite()
                && g_new.iter().all(|v| v.is_finite())
                && found <= value + 1e-4 * descent.min(0.0)
                && found < value
            {
                break Ok((trial, found));
            }
            if s.iter().all(|v| v.abs() < 1e-14) {
                break Err(Stop::Converged);
            }
            let cut = if found.is_finite() {
                -0.5 * descent / (found - value - descent)
            } else {
                0.1
            };
            t *= if cut.is_finite() {
                cut.clamp(0.1, 0.5)
            } else {
                0.1
            };
        };
        let (trial, found) = match taken {
            Ok(taken) => taken,
            Err(Stop::Converged) if !is_fresh => {
                inverse = identity(n, 1.0 / norm(&g).max(f64::MIN_POSITIVE));
                is_fresh = true;
                continue;
            }
            Err(stop) => break stop,
        };
        let s: Vec<f64> = trial.iter().zip(&x).map(|(u, v)| u - v).collect();
        let y: Vec<f64> = g_new.iter().zip(&g).map(|(u, v)| u - v).collect();
        let fall = value - found;
        x = trial;
        value = found;
        std::mem::swap(&mut g, &mut g_new);
        let sy = dot(&s, &y);
        if sy > 1e-12 * norm(&s) * norm(&y) {
            if is_fresh {
                inverse = identity(n, sy / dot(&y, &y));
                is_fresh = false;
            }
            update(&mut inverse, &s, &y, sy);
        }
        if fall <= options.decrease * value {
            break Stop::Converged;
        }
    };
    Minimum {
        x,
        value,
        normal: None,
        iterations,
        stop,
    }
}

/// H ← (I − ρ s yᵀ) H (I − ρ y sᵀ) + ρ s sᵀ.
fn update(inverse: &mut [f64], s: &[f64], y: &[f64], sy: f64) {
    let n = s.len();
    let hy: Vec<f64> = (0..n)
        .map(|i| dot(&inverse[i * n..(i + 1) * n], y))
        .collect();
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
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
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
            &Options::default(),
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
