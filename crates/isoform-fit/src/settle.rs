//! From the metric minimum to the result: minimum of the distance, parts without data, and the bias
//! of noise near edges.
//!
//! A part is *open* if no data support it ([`open`]); a *mask* leaves the points on open parts out;
//! what is *known* about the variables is in [`crate::identify`]; their *spread* is the covariance,
//! including correlation between neighbouring points ([`spread`]).

mod open;
mod spread;
mod state;

use self::spread::Spread;
use self::state::MinimumState;
use crate::Loss;
use crate::bias::{Bias, BiasProblem, FittedPoints};
use crate::chunks::{ChunkSums, Mask};
use crate::clock::Clock;
use crate::deviation::{self, SampledSurface};
use crate::feet::CachedFeet;
use crate::identify::{ExaminedFit, Knowledge, OpenDirection};
use crate::minimum::FitMinimum;
use crate::point_distances::PointDistances;
use crate::polish::{Polish, PolishSums};
use crate::residuals::values;
use crate::rims::rims;
use crate::task::Task;
use crate::thresholds::{MAX_FITTED_POINTS, REPRESENTATIVE_POINTS};
use crate::vector::{add, minus};
use isoform_geom::Point3;

/// A final minimum with what the data say about it.
pub(crate) struct FinalFit {
    pub(crate) found: FitMinimum,
    /// Robust standard deviation of the residuals.
    pub(crate) noise: f64,
    pub(crate) measured: PointDistances,
    pub(crate) surface: SampledSurface,
    /// True for parts of the model that no data support.
    pub(crate) open_parts: Vec<bool>,
    pub(crate) knowledge: Knowledge,
    /// Covariance of the variables.
    pub(crate) covariance: Vec<f64>,
    /// Correlation of the residuals of neighbours that widened the intervals; 0 for none.
    pub(crate) correlation: f64,
    /// Number of points that were fitted.
    pub(crate) fitted: usize,
    /// Step that was added to the variables to remove the bias of noise; `None` without one.
    pub(crate) correction: Option<Vec<f64>>,
}

/// A minimum, the points that determine it, and what they say.
struct FinalMinimum<'a> {
    points: FittedPoints<'a>,
    found: FitMinimum,
    state: MinimumState,
    knowledge: Knowledge,
    spread: Spread,
}

impl<'t> Task<'t> {
    /// Returns the points of the last stages. More are taken if they would shrink an interval (see
    /// [`spread`]).
    pub(crate) fn settling(&self) -> Vec<Point3> {
        if self.points.len() <= 2 * REPRESENTATIVE_POINTS {
            self.points.to_vec()
        } else {
            self.some(REPRESENTATIVE_POINTS)
        }
    }

    /// Minimises the distance from the metric minimum, holds what no data support, and removes the
    /// bias.
    pub(crate) fn settle(&self, mut found: FitMinimum, clock: &mut Clock) -> FinalFit {
        let points = self.settling();
        let mut exact = self.polish_with(self.measure(), found.outcome.starts + 1);
        let normal = self.descend(&exact, &exact.here(&points, &[]), &mut found);
        clock.lap("polish");
        self.control.report("report", 0.0);
        let (mut state, normal) = self.masked(&exact, &points, &mut found, normal);
        let knowledge = self.knowledge(&points, &found, &state, normal);
        let is_unmoved = knowledge.directions.is_empty();
        if !is_unmoved {
            self.free_open_faces(&mut exact, &points, &mut found, &state, &knowledge);
            state = self.state(&points, &found);
        }
        clock.lap("open");
        let normal = is_unmoved.then_some(&knowledge.normal[..]);
        let spread = self.spread(&points, &found, &state, &exact.held, normal);
        clock.lap("spread");
        let settled = FinalMinimum {
            points: FittedPoints::InMemory(points),
            found,
            state,
            knowledge,
            spread,
        };
        self.finish(settled, &exact, clock)
    }

    /// Examines a fit without moving it.
    pub(crate) fn examine_fixed(&self, found: FitMinimum) -> FinalFit {
        let points = self.settling();
        let state = self.state(&points, &found);
        let knowledge = self.knowledge(&points, &found, &state, None);
        let held = vec![false; self.space.len()];
        let spread = self.spread(&points, &found, &state, &held, Some(&knowledge.normal));
        let settled = FinalMinimum {
            points: FittedPoints::InMemory(points),
            found,
            state,
            knowledge,
            spread,
        };
        self.fitted(settled, None)
    }

    /// Returns the state at a minimum. Points on the rims of open parts would hold these: if there
    /// are such points, they are masked, and the minimisation is repeated without them. Also
    /// returns the matrix of the normal equations, if it is known there.
    fn masked(
        &self,
        exact: &Polish<'_>,
        points: &[Point3],
        found: &mut FitMinimum,
        normal: Option<Vec<f64>>,
    ) -> (MinimumState, Option<Vec<f64>>) {
        let state = self.state(points, found);
        if state.mask.is_empty() {
            return (state, normal);
        }
        if self.control.is_stopped() {
            return (state, None);
        }
        let normal = self.descend(exact, &exact.here(points, &state.mask), found);
        let mask = state.mask;
        let state = self.state(points, found);
        let normal = normal.filter(|_| state.mask == mask);
        (state, normal)
    }

    /// Holds the variables of open directions and minimises over the others. Open faces are moved
    /// off the data before, and back afterwards: one that touches noisy points of its neighbours
    /// would be attracted by them, and the end of the data is the best estimate for an open face.
    fn free_open_faces(
        &self,
        exact: &mut Polish<'_>,
        points: &[Point3],
        found: &mut FitMinimum,
        state: &MinimumState,
        knowledge: &Knowledge,
    ) {
        let before = found.x.clone();
        for open in &knowledge.directions {
            self.step_clear(&mut found.x, open, state.noise);
            exact.held[open.variable] = true;
        }
        let step = minus(&found.x, &before);
        self.descend(exact, &exact.here(points, &state.mask), found);
        found.x = minus(&found.x, &step);
        self.space.into_interior(&mut found.x, 1e-12);
    }

    /// Takes more points if they shrink an interval, and removes the bias.
    fn finish(
        &self,
        mut settled: FinalMinimum<'t>,
        exact: &Polish<'_>,
        clock: &mut Clock,
    ) -> FinalFit {
        let most = self.scan.count().min(MAX_FITTED_POINTS);
        let share = settled.points.count() as f64 / most as f64;
        let is_stopped = self.control.is_stopped();
        if settled.points.count() < most && !is_stopped && settled.spread.gains(share) {
            self.take_more(&mut settled, exact, most);
            settled.spread.scale_independent(share);
        }
        clock.lap("all points");
        let correction = self.unbiased(&mut settled);
        clock.lap("bias");
        // A stage that was left out for want of time makes the fit incomplete.
        settled.found.complete &= !self.control.is_stopped();
        self.fitted(settled, correction)
    }

    /// Minimises over more points.
    fn take_more(&self, settled: &mut FinalMinimum<'t>, exact: &Polish<'_>, most: usize) {
        let FinalMinimum { found, state, .. } = settled;
        if let Some(cloud) = self.scan.cloud() {
            let some = |a: &[f64]| self.residuals_of_some(a);
            let sums = ChunkSums {
                cloud,
                template: self.template,
                space: &self.space,
                mask: Mask {
                    a: self.space.parameters(&found.x),
                    open: state.open_parts.clone(),
                },
                some: &some,
            };
            self.descend(exact, &sums, found);
            settled.points = FittedPoints::InChunks(cloud);
            return;
        }
        let points = self.some(most);
        let measured = self.measured(&points, &found.x);
        state.mask = measured.mask(&state.open_parts);
        self.descend(exact, &exact.here(&points, &state.mask), found);
        settled.points = FittedPoints::InMemory(points);
    }

    /// Returns the residuals of some points, as the polish needs them.
    fn residuals_of_some(&self, a: &[f64]) -> Vec<f64> {
        let some = self.some(REPRESENTATIVE_POINTS);
        let mut r = vec![0.0; some.len()];
        values(self.measure(), &some, a, &mut r);
        r
    }

    /// Removes the bias of noise. Returns the step that was added to the variables.
    fn unbiased(&self, settled: &mut FinalMinimum<'_>) -> Option<Vec<f64>> {
        let minimum = settled.found.x.clone();
        let alike = settled.spread.correlation.clamp(0.0, 1.0);
        let mut noise = settled.state.noise * (1.0 - alike).sqrt();
        let mut last: Option<Bias> = None;
        // The bias depends on the fit: if it is large it is estimated again after its removal.
        for _ in 0..3 {
            if self.control.is_stopped() {
                break;
            }
            let Some(bias) = self.bias(settled, noise) else {
                break;
            };
            settled.found.x.clone_from(&minimum);
            add(&mut settled.found.x, &bias.correction);
            self.space.into_interior(&mut settled.found.x, 1e-12);
            // Distances near edges are smaller than the noise that caused them.
            if last.is_none() {
                noise /= bias.shrunk.clamp(0.5, 1.0);
            }
            let is_small = settled.spread.hides(&bias.correction);
            last = Some(bias);
            if is_small {
                break;
            }
        }
        let bias = last?;
        // A fifth of the bias counts as its uncertainty.
        settled.spread.add_correction(&bias, 0.2);
        Some(bias.correction)
    }

    /// Estimates the bias of noise at the fit.
    fn bias(&self, settled: &FinalMinimum<'_>, noise: f64) -> Option<Bias> {
        let FinalMinimum { found, state, .. } = settled;
        let asked = BiasProblem {
            distance: self.template.distance()?,
            space: &self.space,
            x: &found.x,
            points: &settled.points,
            noise,
            loss: found.loss,
            scale: state.noise,
            inverse: &settled.spread.inverse,
            frame: self.template.frame(&self.space.parameters(&found.x)),
            seed: self.options.seed,
        };
        asked.bias()
    }

    fn fitted(&self, settled: FinalMinimum<'_>, correction: Option<Vec<f64>>) -> FinalFit {
        let FinalMinimum {
            points,
            found,
            state,
            mut knowledge,
            spread,
        } = settled;
        let untold = self.undetermined(&found.x, &knowledge, &spread.total);
        knowledge.open.extend(untold);
        let mut measured = self.measured(self.points, &found.x);
        if self.scan.cloud().is_some() {
            // The next stages query chunks, and need the memory.
            measured.at.truncate(REPRESENTATIVE_POINTS);
            measured.at.shrink_to_fit();
            self.distance.iter().for_each(CachedFeet::forget);
        }
        FinalFit {
            noise: state.noise,
            measured,
            surface: state.surface,
            open_parts: state.open_parts,
            knowledge,
            covariance: spread.total,
            correlation: spread.correlation,
            fitted: points.count(),
            correction,
            found,
        }
    }

    /// Returns the variables on which no sum depends, one group each: they have no variance.
    /// Variables at a bound, which have none either, are left out.
    fn undetermined(
        &self,
        x: &[f64],
        knowledge: &Knowledge,
        covariance: &[f64],
    ) -> Vec<Vec<usize>> {
        let m = self.space.len();
        let is_told = |k: usize| {
            self.space.is_at_bound(x, k, 0.0) || knowledge.open.iter().any(|g| g.contains(&k))
        };
        let untold = (0..m).filter(|&k| covariance[k * m + k] <= 0.0 && !is_told(k));
        untold.map(|k| vec![k]).collect()
    }

    /// Minimises from the current variables, and never ends at a higher loss. Returns the matrix of
    /// the normal equations at the end, if it is known.
    fn descend(
        &self,
        exact: &Polish<'_>,
        points: &dyn PolishSums,
        found: &mut FitMinimum,
    ) -> Option<Vec<f64>> {
        let is_robust = found.loss.is_robust();
        let rounds = if is_robust { 8 } else { 1 };
        let from = found.x.clone();
        let mut fine = exact.fine(points, from, found.loss, rounds);
        found.evaluations += fine.evaluations;
        found.history.append(&mut fine.history);
        // Rounds of reweighting do not decrease one sum: points are compared by the loss at one
        // scale.
        if is_robust {
            let [before, after] = points.losses([&found.x, &fine.x]);
            if after > before {
                return None;
            }
        }
        found.x = fine.x;
        fine.normal
    }

    /// Computes noise, open parts and the mask at a minimum.
    fn state(&self, points: &[Point3], found: &FitMinimum) -> MinimumState {
        let measured = self.measured(points, &found.x);
        let noise = self.noise(&measured.residuals, found.loss);
        let a = self.space.parameters(&found.x);
        let (data, samples) = (self.data(noise), self.options.surface_samples);
        let surface = deviation::model_to_data(self.template, &a, &data, samples);
        let open_parts = self.open_parts(&measured, &a, noise, &surface);
        let mut mask = measured.mask(&open_parts);
        let has_rims = self.template.distance().is_none() && noise > self.rounding();
        if mask.is_empty() && has_rims {
            // Minima and maxima evaluate points beyond a rim by the wrong piece.
            mask = rims(self.template, points, &a, noise);
        }
        MinimumState {
            residuals: measured.residuals,
            at: measured.at,
            noise,
            surface,
            open_parts,
            mask,
        }
    }

    /// Returns the deviation of the residuals: robust, or by degrees of freedom.
    fn noise(&self, residuals: &[f64], loss: Loss) -> f64 {
        if loss.is_robust() {
            return Polish::scale(residuals);
        }
        let finite = residuals.iter().filter(|r| r.is_finite());
        let sum: f64 = finite.map(|r| r * r).sum();
        let degrees = residuals.len().saturating_sub(self.space.len()).max(1);
        (sum / degrees as f64).sqrt()
    }

    /// Examines what the points say about the variables. `normal` is the matrix of the normal
    /// equations, if it is known.
    fn knowledge(
        &self,
        points: &[Point3],
        found: &FitMinimum,
        state: &MinimumState,
        normal: Option<Vec<f64>>,
    ) -> Knowledge {
        if self.control.is_stopped() {
            return self.at(points, found, state).without_moves(normal);
        }
        // Variables that move parts with bare surface are suspects.
        let cover = state.surface.cover(self.template.part_names().len());
        let bare: Vec<bool> = cover.iter().map(|c| c.bare > 0).collect();
        let moved = self.moves(found, &state.surface, &bare);
        self.at(points, found, state)
            .knowledge(&|k| moved[k], normal)
    }

    /// Describes the fit for [`crate::identify`].
    fn at<'b>(
        &'b self,
        points: &'b [Point3],
        found: &'b FitMinimum,
        state: &'b MinimumState,
    ) -> ExaminedFit<'b> {
        ExaminedFit {
            field: self.measure(),
            points,
            space: &self.space,
            x: &found.x,
            residuals: &state.residuals,
            mask: &state.mask,
            loss: found.loss,
            scale: state.noise,
            least_scale: self.rounding(),
            rounding: self.options.rounding,
            tested: 4096,
            control: self.control,
        }
    }

    /// Moves along an open direction within bounds: by six deviations of the noise, and at least by
    /// a quarter of the spacing.
    fn step_clear(&self, x: &mut [f64], open: &OpenDirection, noise: f64) {
        let clear = (6.0 * noise).max(0.25 * self.near.spacing);
        let mut t = clear / self.space.unit(open.variable);
        for j in 0..x.len() {
            let by = open.sense * open.direction[j];
            if by != 0.0 {
                let gap = self.space.limits().gap(x, j, by);
                t = t.min(0.5 * gap / by.abs());
            }
        }
        for j in 0..x.len() {
            x[j] += open.sense * t * open.direction[j];
        }
        self.space.into_interior(x, 1e-9);
    }
}
