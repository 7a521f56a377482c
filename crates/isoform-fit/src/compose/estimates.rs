//! Estimates of the parameters with their deviations, and their status.

use crate::Kind;
use crate::identify::{Knowledge, student95};
use crate::report::{Estimate, Status};
use crate::task::Task;

/// Data of the intervals of all parameters.
pub(super) struct Intervals<'a> {
    pub(super) x: &'a [f64],
    /// Values of all parameters.
    pub(super) a: &'a [f64],
    /// Covariance of the parameters.
    pub(super) covariance: &'a [f64],
    /// Number of points that were fitted, with a weight in the loss.
    pub(super) weighted: usize,
}

impl Intervals<'_> {
    fn deviation(&self, i: usize) -> f64 {
        self.covariance[i * self.a.len() + i].max(0.0).sqrt()
    }
}

/// Relation of the variables to a parameter.
#[derive(Clone, Copy, Default)]
struct Freedom {
    /// True if a variable moves it.
    is_moved: bool,
    /// True if the data leave open a variable that moves it.
    is_open: bool,
    /// Variable that stands for it; `None` for fixed and tied parameters.
    variable: Option<usize>,
}

impl Task<'_> {
    /// Returns an estimate per parameter.
    pub(super) fn estimates(&self, at: &Intervals<'_>, knowledge: &Knowledge) -> Vec<Estimate> {
        let width = student95(at.weighted as f64 - self.space.len() as f64);
        let mut freedom = self.freedom(knowledge);
        if at.weighted <= self.space.len() {
            // Some variables meet as many points exactly, whatever their noise.
            freedom.iter_mut().for_each(|f| f.is_open = f.is_moved);
        }
        let all = self.template.parameters().iter().zip(freedom).enumerate();
        all.map(|(i, (p, freedom))| {
            let sd = at.deviation(i);
            let status = self.status(p.kind, sd, freedom, at.x);
            let half = width * sd;
            let bounds = self.space.bounds[i];
            // At a bound, an interval that is wider than the bounds tells nothing.
            let is_wide = status == Status::AtBound && half > bounds.1 - bounds.0;
            let is_known = is_known(status, sd) && !is_wide;
            Estimate {
                name: p.name.clone(),
                value: at.a[i],
                sd: is_known.then_some(sd),
                ci95: is_known.then_some((at.a[i] - half, at.a[i] + half)),
                status,
                bounds,
                unit: p.unit.clone(),
            }
        })
        .collect()
    }

    fn freedom(&self, knowledge: &Knowledge) -> Vec<Freedom> {
        let mut freedom = vec![Freedom::default(); self.template.parameters().len()];
        for k in 0..self.space.len() {
            freedom[self.space.parameter(k)].variable = Some(k);
            for &(i, _) in self.space.column(k) {
                freedom[i].is_moved = true;
            }
        }
        for &k in knowledge.open.iter().flatten() {
            for &(i, _) in self.space.column(k) {
                freedom[i].is_open = true;
            }
        }
        freedom
    }

    fn status(&self, kind: Kind, sd: f64, freedom: Freedom, x: &[f64]) -> Status {
        let is_at_bound = |k: usize| {
            // At a bound that is nearer than a hundredth of the deviation.
            let within = 0.01 * sd / self.space.unit(k);
            self.space.is_at_bound(x, k, within)
        };
        if !freedom.is_moved {
            Status::Fixed
        } else if freedom.is_open {
            Status::Undetermined
        } else if freedom.variable.is_some_and(is_at_bound) {
            Status::AtBound
        } else if self.is_weak(kind, sd) || !sd.is_finite() {
            Status::Weak
        } else {
            Status::Determined
        }
    }

    fn is_weak(&self, kind: Kind, sd: f64) -> bool {
        match kind {
            Kind::Angle | Kind::Ratio => sd > 0.1,
            _ => sd > 0.02 * self.size().max(1e-300),
        }
    }
}

/// Returns true if a parameter has an interval: at a bound its deviation may be zero, since no
/// variable moves it.
fn is_known(status: Status, sd: f64) -> bool {
    let has_interval = match status {
        Status::Determined | Status::Weak => true,
        Status::AtBound => sd > 0.0,
        Status::Undetermined | Status::Fixed => false,
    };
    has_interval && sd.is_finite()
}
