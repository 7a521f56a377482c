//! Test functions of the solvers.

use crate::Objective;

fn model_of(r: &[f64], j: &[&[f64]], g: &mut [f64], h: &mut [f64]) -> f64 {
    let n = g.len();
    for k in 0..n {
        g[k] = r.iter().zip(j).map(|(r, row)| r * row[k]).sum();
        for l in 0..n {
            h[k * n + l] = j.iter().map(|row| row[k] * row[l]).sum();
        }
    }
    r.iter().map(|v| v * v).sum()
}

/// Rosenbrock's valley; minimum 0 at (1, 1).
pub(crate) struct Rosenbrock;

impl Objective for Rosenbrock {
    fn dim(&self) -> usize {
        2
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        (10.0 * (x[1] - x[0] * x[0])).powi(2) + (1.0 - x[0]).powi(2)
    }
    fn model(&mut self, x: &[f64], g: &mut [f64], h: &mut [f64]) -> f64 {
        model_of(
            &[10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]],
            &[&[-20.0 * x[0], 10.0], &[-1.0, 0.0]],
            g,
            h,
        )
    }
}

/// Powell's singular function; minimum 0 at the origin, where the Jacobian has rank 2.
pub(crate) struct Powell;

impl Objective for Powell {
    fn dim(&self) -> usize {
        4
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        let (mut g, mut h) = ([0.0; 4], [0.0; 16]);
        self.model(x, &mut g, &mut h)
    }
    fn model(&mut self, x: &[f64], g: &mut [f64], h: &mut [f64]) -> f64 {
        let (u, v) = (x[1] - 2.0 * x[2], x[0] - x[3]);
        let (s5, s10) = (5f64.sqrt(), 10f64.sqrt());
        let r = [x[0] + 10.0 * x[1], s5 * (x[2] - x[3]), u * u, s10 * v * v];
        let rows: [&[f64]; 4] = [
            &[1.0, 10.0, 0.0, 0.0],
            &[0.0, 0.0, s5, -s5],
            &[0.0, 2.0 * u, -4.0 * u, 0.0],
            &[2.0 * s10 * v, 0.0, 0.0, -2.0 * s10 * v],
        ];
        model_of(&r, &rows, g, h)
    }
}

/// A function with many local minima along each axis: Σ xᵢ² + (3 sin 4xᵢ)², with one global minimum
/// at 0.
pub(crate) struct Egg(pub(crate) usize);

impl Objective for Egg {
    fn dim(&self) -> usize {
        self.0
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        x.iter()
            .map(|v| v * v + (3.0 * (4.0 * v).sin()).powi(2))
            .sum()
    }
    fn model(&mut self, x: &[f64], g: &mut [f64], h: &mut [f64]) -> f64 {
        let n = self.0;
        h.fill(0.0);
        for (i, v) in x.iter().enumerate() {
            let (s, c) = (3.0 * (4.0 * v).sin(), 12.0 * (4.0 * v).cos());
            g[i] = v + s * c;
            h[i * n + i] = 1.0 + c * c;
        }
        self.value(x)
    }
}

/// A function that is NaN everywhere.
pub(crate) struct Nothing;

impl Objective for Nothing {
    fn dim(&self) -> usize {
        1
    }
    fn value(&mut self, _: &[f64]) -> f64 {
        f64::NAN
    }
    fn model(&mut self, _: &[f64], _: &mut [f64], _: &mut [f64]) -> f64 {
        f64::NAN
    }
}
