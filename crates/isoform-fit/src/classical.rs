//! The paper's methods: the algebraic residual on all points, from one start.

use crate::fit::{Clock, Found, Task};
use crate::objective::{Objective, Residuals};
use crate::report::Fit;
use crate::search::{Found as Minimum, Outcome, Step};
use crate::{FitError, Local, Loss, Method, annealing, bfgs, lm};

impl Task<'_> {
    /// The paper's methods: algebraic residual on all points, no polish.
    pub(crate) fn classical(&self, method: Method) -> Result<Fit, FitError> {
        let mut clock = Clock::new();
        let control = self.control;
        let mut objective =
            Residuals::new(self.template.algebraic(), self.points, &[], &self.space);
        let count = self.points.len() as f64;
        let x = self.first().unwrap_or_else(|| {
            let mut x: Vec<f64> = self
                .space
                .start_lo
                .iter()
                .zip(&self.space.start_hi)
                .map(|(a, b)| 0.5 * (a + b))
                .collect();
            self.space.into_interior(&mut x, 1e-4);
            x
        });
        let mut outcome = Outcome {
            starts: 1,
            ..Outcome::default()
        };
        let mut history = Vec::new();
        let (mut x, mut evaluations, mut stop) = (x, 0, None);
        let then = match method {
            Method::Default => Some(Local::Lm),
            Method::Local(local) => Some(local),
            Method::Annealing | Method::Hybrid { .. } => {
                let mut settings = annealing::Options {
                    seed: self.options.seed,
                    max_evaluations: self.options.annealing_evaluations,
                    ..annealing::Options::default()
                };
                let mut then = None;
                if let Method::Hybrid { local, threshold } = method {
                    settings.threshold = threshold
                        .unwrap_or_else(|| self.threshold(&mut objective))
                        .powi(2)
                        * count;
                    then = Some(local);
                }
                let most = self.options.annealing_evaluations.max(1) as f64;
                let cooled = annealing::minimize(
                    &mut objective,
                    x,
                    &self.space.lo,
                    &self.space.hi,
                    &settings,
                    &mut |k, value| {
                        history.push(Step {
                            start: 0,
                            iteration: k,
                            rms: (value / count).sqrt(),
                        });
                        control.report("annealing", (k as f64 / most).min(1.0));
                        !control.is_stopped()
                    },
                );
                evaluations += cooled.evaluations;
                x = cooled.x;
                self.space.into_interior(&mut x, 1e-9);
                clock.lap("annealing");
                then
            }
        };
        if let Some(local) = then {
            let mut monitor = |k: usize, _: &[f64], value: f64| {
                history.push(Step {
                    start: 0,
                    iteration: evaluations + k,
                    rms: (value / count).sqrt(),
                });
                !control.is_stopped()
            };
            let (lo, hi) = (&self.space.lo, &self.space.hi);
            let m = match local {
                Local::Lm => lm::minimize(
                    &mut objective,
                    x,
                    lo,
                    hi,
                    &lm::Options {
                        exact: true,
                        ..lm::Options::default()
                    },
                    &mut monitor,
                ),
                Local::Bfgs => bfgs::minimize(
                    &mut objective,
                    x,
                    lo,
                    hi,
                    &bfgs::Options::default(),
                    &mut monitor,
                ),
            };
            evaluations += m.iterations;
            stop = Some(m.stop);
            if m.stop == lm::Stop::NotFinite {
                return Err(FitError::NoFiniteStart { starts: 1 });
            }
            x = m.x;
            clock.lap("local");
        }
        let value = objective.value(&x);
        if !value.is_finite() {
            return Err(FitError::NoFiniteStart { starts: 1 });
        }
        outcome.minima.push(Minimum {
            x: x.clone(),
            value,
            hits: 1,
        });
        let complete = !control.is_stopped();
        let found = Found {
            x,
            loss: Loss::Squares,
            outcome,
            evaluations,
            history,
            stop,
            complete,
            is_at_noise: false,
        };
        let fitted = self.ask(found);
        Ok(self.report(fitted, clock))
    }

    /// The paper ends its annealing at a mean |f| of 0.04; here of the typical |f| of random
    /// starts.
    fn threshold(&self, objective: &mut Residuals) -> f64 {
        let mut random = fastrand::Rng::with_seed(self.options.seed);
        let count = self.points.len() as f64;
        let mut v: Vec<f64> = (0..15)
            .map(|_| {
                let x: Vec<f64> = self
                    .space
                    .start_lo
                    .iter()
                    .zip(&self.space.start_hi)
                    .map(|(a, b)| a + (b - a) * random.f64())
                    .collect();
                (objective.value(&x) / count).sqrt()
            })
            .filter(|v| v.is_finite())
            .collect();
        0.04 * crate::outliers::median(&mut v)
    }
}
