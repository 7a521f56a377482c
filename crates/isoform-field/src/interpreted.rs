//! Residual of a fit for programs that cannot be compiled to an expression, because a loop or an
//! index depends on the point or on a parameter.
//!
//! The program is run point by point in forward-mode jets, for a few parameters at a time, about a
//! hundred times slower than a [`Tape`]. The value is NaN where the program stops with an error.

use crate::hyperfun::{Evaluator, Model};
use crate::tape::Tape;
use isoform_geom::{ParamField, Point3};
use isoform_num::{Jet1, Real};

/// Number of parameters by which one run differentiates.
const PARAMETERS_PER_RUN: usize = 8;

/// A program run statement by statement.
#[derive(Clone, Debug)]
pub struct Interpreted {
    model: Model,
    /// Map from the point of space and all parameters to the model's point.
    point: Tape,
    /// True if values are divided by the length of the gradient in space.
    is_metric: bool,
}

/// Evaluator of the program in one number type, with memory reused between points.
struct Runner<'m, R: Real + 'static> {
    of: &'m Interpreted,
    /// The program.
    evaluator: Evaluator<'m, R>,
    /// Scratch space of the tape that computes the model's point.
    scratch: Vec<R>,
}

impl<R: Real + 'static> Runner<'_, R> {
    /// Evaluates the program at a point of space.
    fn run(&mut self, x: &[R; 3], a: &[R]) -> R {
        let p = self.of.point.eval_all(x, a, &mut self.scratch);
        let own = &a[..self.of.model.n_params()];
        self.evaluator
            .eval(&p, own, &[])
            .unwrap_or_else(|_| R::constant(f64::NAN))
    }
}

impl Interpreted {
    /// Creates the residual: the program's value, or (`is_metric`) the first-order distance f/|∇f|.
    /// The three results of `point` are the model's point.
    ///
    /// # Panics
    /// If `point` does not map three coordinates to three results, or has fewer parameters than the
    /// model.
    pub fn new(model: Model, point: Tape, is_metric: bool) -> Self {
        assert_eq!(
            (point.dimension(), point.n_results()),
            (3, 3),
            "a tape from points to points"
        );
        assert!(
            point.n_params() >= model.n_params(),
            "the tape knows all parameters"
        );
        Self {
            model,
            point,
            is_metric,
        }
    }

    /// Creates an evaluator in one number type.
    fn runner<R: Real + 'static>(&self) -> Runner<'_, R> {
        Runner {
            of: self,
            evaluator: self.model.evaluator(),
            scratch: Vec::new(),
        }
    }

    /// Computes f and ∇f of the program at each point.
    fn slopes(&self, points: &[Point3], a: &[f64]) -> Vec<Jet1<3>> {
        let mut runner = self.runner::<Jet1<3>>();
        let a: Vec<Jet1<3>> = a.iter().map(|&v| Real::constant(v)).collect();
        points
            .iter()
            .map(|p| runner.run(&std::array::from_fn(|i| Jet1::variable(p[i], i)), &a))
            .collect()
    }

    /// Returns the divisors of values and derivatives: 1, or |∇f|.
    fn divisors(&self, points: &[Point3], a: &[f64]) -> Vec<f64> {
        if !self.is_metric {
            return vec![1.0; points.len()];
        }
        // Where the gradient vanishes the value is far from zero; any finite result is acceptable.
        self.slopes(points, a)
            .iter()
            .map(|s| isoform_geom::norm(s.g).max(1e-30))
            .collect()
    }
}

/// Returns the parameters as jets that differentiate by the parameters with indices `from` and
/// above.
fn seeded(a: &[f64], from: usize) -> Vec<Jet1<PARAMETERS_PER_RUN>> {
    let jet = |(i, &v): (usize, &f64)| {
        if (from..from + PARAMETERS_PER_RUN).contains(&i) {
            Jet1::variable(v, i - from)
        } else {
            Real::constant(v)
        }
    };
    a.iter().enumerate().map(jet).collect()
}

impl ParamField for Interpreted {
    fn dim(&self) -> usize {
        self.point.n_params()
    }

    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
        let mut runner = self.runner::<f64>();
        for ((p, d), out) in points.iter().zip(self.divisors(points, a)).zip(out) {
            *out = runner.run(p, a) / d;
        }
    }

    /// Computes the Jacobian by the parameters. For metric values the dependence of the gradient on
    /// the parameters is neglected: it is multiplied by f, which vanishes on the surface
    /// (Gauss-Newton approximation).
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
        let n = self.dim();
        let divisors = self.divisors(points, a);
        let mut runner = self.runner::<Jet1<PARAMETERS_PER_RUN>>();
        for from in (0..n.max(1)).step_by(PARAMETERS_PER_RUN) {
            let seeded = seeded(a, from);
            for (k, (p, d)) in points.iter().zip(&divisors).enumerate() {
                let f = runner.run(&p.map(Real::constant), &seeded);
                out[k] = f.v / d;
                for i in from..n.min(from + PARAMETERS_PER_RUN) {
                    jac[k * n + i] = f.g[i - from] / d;
                }
            }
        }
    }

    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        for ((s, out), gradient) in self.slopes(points, a).iter().zip(out).zip(gradients) {
            let d = if self.is_metric {
                isoform_geom::norm(s.g).max(1e-30)
            } else {
                1.0
            };
            *out = s.v / d;
            *gradient = s.g.map(|v| v / d);
        }
    }
}
