//! The methods of paper C: the algebraic residual on all points, from one start, without a polish.

use crate::clock::Clock;
use crate::minimum::FitMinimum;
use crate::objective::Objective;
use crate::outliers::median;
use crate::report::Fit;
use crate::residuals::Residuals;
use crate::search::{ConvergenceStep, SearchMinimum, SearchOutcome};
use crate::space::Space;
use crate::task::Task;
use crate::{FitError, LocalMethod, Loss, Method, annealing, bfgs, lm};

/// State of a run of one of the methods.
struct MethodRun<'a> {
    task: &'a Task<'a>,
    objective: Residuals<'a>,
    clock: Clock,
    x: Vec<f64>,
    evaluations: usize,
    history: Vec<ConvergenceStep>,
    stop: Option<lm::Stop>,
}

impl Task<'_> {
    /// Fits by one of the methods of paper C.
    pub(crate) fn classical(&self, method: Method) -> Result<Fit, FitError> {
        let mut course = MethodRun::new(self);
        match method {
            Method::Default => course.descend(LocalMethod::Lm)?,
            Method::Local(local) => course.descend(local)?,
            Method::Annealing => course.anneal(0.0),
            Method::Hybrid { local, threshold } => {
                let mean = threshold.unwrap_or_else(|| course.threshold());
                course.anneal(mean.powi(2) * course.count());
                course.descend(local)?;
            }
        }
        let (found, clock) = course.end()?;
        Ok(self.report(self.examine_fixed(found), clock))
    }

    /// Returns the centre of the ranges from which starts are drawn.
    fn middle(&self) -> Vec<f64> {
        let ends = self.space.start_lo.iter().zip(&self.space.start_hi);
        let mut x: Vec<f64> = ends.map(|(a, b)| 0.5 * (a + b)).collect();
        self.space.into_interior(&mut x, 1e-4);
        x
    }
}

impl<'a> MethodRun<'a> {
    fn new(task: &'a Task<'a>) -> Self {
        let field = task.template.algebraic();
        Self {
            clock: Clock::new(),
            objective: Residuals::new(field, task.points, &[], &task.space),
            x: task.first().unwrap_or_else(|| task.middle()),
            evaluations: 0,
            history: Vec::new(),
            stop: None,
            task,
        }
    }

    fn count(&self) -> f64 {
        self.task.points.len() as f64
    }

    /// Anneals until the sum of squares falls to the threshold.
    fn anneal(&mut self, threshold: f64) {
        let (space, control, count) = (&self.task.space, self.task.control, self.count());
        let options = self.task.options;
        let settings = annealing::AnnealingOptions {
            seed: options.seed,
            max_evaluations: options.annealing_evaluations,
            threshold,
            ..annealing::AnnealingOptions::default()
        };
        let most = options.annealing_evaluations.max(1) as f64;
        let history = &mut self.history;
        let mut monitor = |k: usize, value: f64| {
            history.push(ConvergenceStep::new(0, k, value, count));
            control.report("annealing", (k as f64 / most).min(1.0));
            !control.is_stopped()
        };
        let cooled = annealing::minimize(
            &mut self.objective,
            std::mem::take(&mut self.x),
            &space.lo,
            &space.hi,
            &settings,
            &mut monitor,
        );
        self.evaluations += cooled.evaluations;
        self.x = cooled.x;
        space.into_interior(&mut self.x, 1e-9);
        self.clock.lap("annealing");
    }

    /// Descends by a local method.
    fn descend(&mut self, local: LocalMethod) -> Result<(), FitError> {
        let (space, control, count) = (&self.task.space, self.task.control, self.count());
        let (before, history) = (self.evaluations, &mut self.history);
        let mut monitor = |k: usize, _: &[f64], value: f64| {
            history.push(ConvergenceStep::new(0, before + k, value, count));
            !control.is_stopped()
        };
        let x = std::mem::take(&mut self.x);
        let found = match local {
            LocalMethod::Lm => textbook_lm(&mut self.objective, x, space, &mut monitor),
            LocalMethod::Bfgs => plain_bfgs(&mut self.objective, x, space, &mut monitor),
        };
        self.evaluations += found.iterations;
        self.stop = Some(found.stop);
        self.x = found.x;
        self.clock.lap("local");
        if found.stop == lm::Stop::NotFinite {
            return Err(FitError::NoFiniteStart { starts: 1 });
        }
        Ok(())
    }

    /// Returns the minimum and the times of the phases.
    fn end(mut self) -> Result<(FitMinimum, Clock), FitError> {
        let value = self.objective.value(&self.x);
        if !value.is_finite() {
            return Err(FitError::NoFiniteStart { starts: 1 });
        }
        let found = FitMinimum {
            outcome: outcome_of_one(self.x.clone(), value),
            x: self.x,
            loss: Loss::Squares,
            evaluations: self.evaluations,
            history: self.history,
            stop: self.stop,
            complete: !self.task.control.is_stopped(),
            is_at_noise: false,
        };
        Ok((found, self.clock))
    }

    /// Returns the root mean square of f at which the annealing of a hybrid ends: 0.04 (at which
    /// the paper ends it) of the median over 15 random starts.
    fn threshold(&mut self) -> f64 {
        let mut random = fastrand::Rng::with_seed(self.task.options.seed);
        let (space, count) = (&self.task.space, self.count());
        let mut typical = |_: usize| {
            let x: Vec<f64> = (0..space.len())
                .map(|k| space.drawn(k, &mut random))
                .collect();
            (self.objective.value(&x) / count).sqrt()
        };
        let values = (0..15).map(&mut typical);
        let mut finite: Vec<f64> = values.filter(|v| v.is_finite()).collect();
        0.04 * median(&mut finite)
    }
}

/// Monitor of a local method, called with iteration, variables and value; it ends the run by
/// returning false.
type Monitor<'a> = dyn FnMut(usize, &[f64], f64) -> bool + 'a;

/// Runs Levenberg-Marquardt with exactly damped steps, as in textbooks.
fn textbook_lm(
    objective: &mut Residuals<'_>,
    x: Vec<f64>,
    space: &Space,
    monitor: &mut Monitor<'_>,
) -> lm::Minimum {
    let settings = lm::LmOptions {
        exact: true,
        ..lm::LmOptions::default()
    };
    lm::minimize(objective, x, &space.lo, &space.hi, &settings, monitor)
}

/// Runs the quasi-Newton method with its defaults.
fn plain_bfgs(
    objective: &mut Residuals<'_>,
    x: Vec<f64>,
    space: &Space,
    monitor: &mut Monitor<'_>,
) -> lm::Minimum {
    let settings = bfgs::BfgsOptions::default();
    bfgs::minimize(objective, x, &space.lo, &space.hi, &settings, monitor)
}

/// Returns the outcome of a search with one start.
fn outcome_of_one(x: Vec<f64>, value: f64) -> SearchOutcome {
    let hits = 1;
    SearchOutcome {
        starts: 1,
        minima: vec![SearchMinimum { x, value, hits }],
        ..SearchOutcome::default()
    }
}
