//! The report of a fit.

use crate::deviation::{self, Surface};
use crate::evidence::Evidence;
use crate::fit::{Clock, EXACT, OUTLIER_DEVIATIONS, Task};
use crate::identify::{Knowledge, student95};
use crate::judge::Verdict;
use crate::objective::sum_of_squares;
use crate::polish::weight;
use crate::report::{Estimate, Fit, Open, OtherMinimum, PartStatistics, Status};
use crate::search::Outcome;
use crate::settle::{Fitted, Measured};
use crate::{Kind, Loss};
use isoform_geom::Point3;

/// ... and farther than this share of the point spacing (edges rounded by a mesher or a scanner are
/// no outliers).
const OUTLIER_SPACINGS: f64 = 0.3;
/// A deviation above this share of the diagonal (0.1 rad or 0.1 for angles and ratios) makes a
/// parameter weak.
const WEAK: f64 = 0.02;
/// Most other minima told of.
const MOST_MINIMA: usize = 5;

impl Task<'_> {
    /// The report of a fit, judged.
    pub(crate) fn report(&self, fitted: Fitted, mut clock: Clock) -> Fit {
        let Fitted {
            found,
            noise,
            measured,
            surface,
            open_parts,
            knowledge,
            covariance,
            correlation,
            fitted,
            correction,
        } = fitted;
        let (n, near) = (self.points.len(), self.near);
        let mut a = vec![0.0; self.template.parameters().len()];
        self.space.parameters_at(&found.x, &mut a);
        let parts = measured.parts();
        let is_open: Vec<bool> = measured.on(&open_parts).collect();
        let Measured { residuals, at, .. } = measured;
        let outliers = self.outliers(&residuals, noise, found.loss);
        let n_outliers = outliers.iter().filter(|v| **v).count();
        let weights = residuals
            .iter()
            .zip(is_open)
            .map(|(r, open)| match r.is_finite() && !open {
                true => weight(found.loss, r / noise.max(f64::MIN_POSITIVE)),
                false => 0.0,
            })
            .collect();
        let used: Vec<f64> = if n_outliers > 0 {
            outliers
                .iter()
                .map(|o| if *o { 0.0 } else { 1.0 })
                .collect()
        } else {
            Vec::new()
        };
        let sum_f2 = self.algebraic_sum(&used, &outliers, &a);
        let data_to_model = deviation::data_to_model(&residuals, &outliers);
        let part_statistics = self.part_statistics(&residuals, &outliers, &parts, &surface);
        let clusters = self.clusters(&residuals, &outliers);
        let scale = noise.max(EXACT * self.data.diagonal());
        let widened = 1.0 + clusters.misfit / (scale * scale);
        let mut covariance = self.space.push_forward(&covariance);
        covariance.iter_mut().for_each(|v| *v *= widened);
        let parameters = self.estimates(&found.x, &a, &covariance, &knowledge, fitted);
        let undetermined = self.words(&knowledge, &a, &surface, &part_statistics);
        let neighbour_correlation = deviation::neighbour_correlation(
            self.points,
            &residuals,
            &outliers,
            &near.tree,
            self.order,
        );
        let evidence = Evidence {
            clustered: clusters.share,
            ..self.evidence(&a, &residuals, &at, &outliers, &surface, &open_parts)
        };
        let local = [
            self.misplaced(&residuals, &outliers, &at, &parts, &part_statistics, noise),
            self.together(&residuals, &at),
        ];
        let other_minima = self.others(&found.outcome, &found.x, &used, &outliers);
        let mut fit = Fit {
            parameters,
            sum_f2,
            rms: data_to_model.rms,
            noise,
            n_points: n,
            n_used: n - n_outliers,
            n_fitted: fitted,
            n_outliers,
            n_left_out: 0,
            isolated: self.scan.isolated,
            spacing: near.spacing,
            data_to_model,
            model_to_data: surface.summary,
            starts: found.outcome.starts,
            hits: found.outcome.minima.first().map_or(0, |m| m.hits),
            evaluations: found.evaluations,
            other_minima,
            undetermined,
            warnings: Vec::new(),
            verdict: Verdict::Accepted,
            findings: Vec::new(),
            acceptable: true,
            reasons: Vec::new(),
            loss: found.loss,
            residuals,
            weights,
            outliers,
            parts,
            part_statistics,
            covariance,
            neighbour_correlation,
            correlation,
            evidence,
            certain: found.outcome.certain,
            misfit: clusters.misfit.sqrt(),
            correction: correction.map_or_else(Vec::new, |c| self.in_parameters(&c)),
            history: found.history,
            stop: found.stop,
            seconds: Vec::new(),
            complete: found.complete,
        };
        self.judge(&mut fit, local.into_iter().flatten());
        clock.lap("report");
        clock.seconds.insert(0, ("outliers", self.scan.seconds));
        fit.seconds = clock.seconds;
        self.control.report("report", 1.0);
        fit
    }

    /// Which points are outliers: too far off, where the loss allows for any.
    fn outliers(&self, residuals: &[f64], noise: f64, loss: Loss) -> Vec<bool> {
        let limit = (OUTLIER_DEVIATIONS * noise).max(OUTLIER_SPACINGS * self.near.spacing);
        residuals
            .iter()
            .map(|r| !r.is_finite() || (loss.is_robust() && r.abs() > limit))
            .collect()
    }

    /// A step of the variables in the parameters.
    fn in_parameters(&self, step: &[f64]) -> Vec<f64> {
        let mut by = vec![0.0; self.template.parameters().len()];
        for (k, v) in step.iter().enumerate() {
            for &(i, c) in self.space.column(k) {
                by[i] += c * v;
            }
        }
        by
    }

    /// Σ f² over the points used, NaN left out.
    fn algebraic_sum(&self, used: &[f64], outliers: &[bool], a: &[f64]) -> f64 {
        if used.is_empty() {
            return sum_of_squares(self.template.algebraic(), self.points, &[], a);
        }
        let kept: Vec<Point3> = self
            .points
            .iter()
            .zip(outliers)
            .filter(|(_, o)| !**o)
            .map(|(p, _)| *p)
            .collect();
        sum_of_squares(self.template.algebraic(), &kept, &[], a)
    }

    fn part_statistics(
        &self,
        r: &[f64],
        out: &[bool],
        parts: &[u32],
        surface: &Surface,
    ) -> Vec<PartStatistics> {
        let names = self.template.part_names();
        let mut stats: Vec<PartStatistics> = names
            .iter()
            .map(|name| PartStatistics {
                name: name.clone(),
                count: 0,
                rms: 0.0,
                mean: 0.0,
                max: 0.0,
                uncovered: None,
            })
            .collect();
        for ((r, out), part) in r.iter().zip(out).zip(parts) {
            if let Some(s) = stats.get_mut(*part as usize).filter(|_| !out) {
                s.count += 1;
                s.rms += r * r;
                s.mean += r;
                s.max = s.max.max(r.abs());
            }
        }
        let mut samples = vec![(0_usize, 0_usize); names.len()];
        for (bare, part) in surface.bare.iter().zip(&surface.parts) {
            if let Some(s) = samples.get_mut(*part as usize) {
                s.0 += 1;
                s.1 += usize::from(*bare);
            }
        }
        for (s, (all, bare)) in stats.iter_mut().zip(samples) {
            let n = s.count.max(1) as f64;
            s.rms = (s.rms / n).sqrt();
            s.mean /= n;
            s.uncovered = (all > 0).then(|| bare as f64 / all as f64);
        }
        stats
    }

    fn estimates(
        &self,
        x: &[f64],
        a: &[f64],
        covariance: &[f64],
        knowledge: &Knowledge,
        n: usize,
    ) -> Vec<Estimate> {
        let parameters = self.template.parameters();
        let count = parameters.len();
        let width = student95(n as f64 - self.space.len() as f64);
        let mut open = vec![false; count];
        for &k in knowledge.open.iter().flatten() {
            for &(i, _) in self.space.column(k) {
                open[i] = true;
            }
        }
        let mut variable = vec![None; count];
        for k in 0..self.space.len() {
            variable[self.space.parameter(k)] = Some(k);
        }
        let moves: Vec<bool> = {
            let mut moves = vec![false; count];
            (0..self.space.len()).for_each(|k| {
                self.space
                    .column(k)
                    .iter()
                    .for_each(|&(i, _)| moves[i] = true)
            });
            moves
        };
        (0..count)
            .map(|i| {
                let p = &parameters[i];
                let sd = covariance[i * count + i].max(0.0).sqrt();
                let (lo, hi) = self.space.bounds[i];
                let at_bound = variable[i]
                    .is_some_and(|k| self.space.is_at_bound(x, k, 0.01 * sd / self.space.unit(k)));
                let is_weak = match p.kind {
                    Kind::Angle | Kind::Ratio => sd > 0.1,
                    _ => sd > WEAK * self.data.diagonal().max(1e-300),
                };
                let status = if !moves[i] {
                    Status::Fixed
                } else if open[i] {
                    Status::Undetermined
                } else if at_bound {
                    Status::AtBound
                } else if is_weak || !sd.is_finite() {
                    Status::Weak
                } else {
                    Status::Determined
                };
                let known = matches!(status, Status::Determined | Status::Weak | Status::AtBound)
                    && sd.is_finite()
                    && (sd > 0.0 || status != Status::AtBound);
                let half = width * sd;
                Estimate {
                    name: p.name.clone(),
                    value: a[i],
                    sd: known.then_some(sd),
                    ci95: known.then_some((a[i] - half, a[i] + half)),
                    status,
                    bounds: (lo, hi),
                    unit: p.unit.clone(),
                }
            })
            .collect()
    }

    /// The open groups in words: pieces that these parameters move and no data support, else the
    /// bare fact.
    fn words(
        &self,
        knowledge: &Knowledge,
        a: &[f64],
        surface: &Surface,
        stats: &[PartStatistics],
    ) -> Vec<Open> {
        let parameters = self.template.parameters();
        let n = parameters.len();
        if knowledge.open.is_empty() {
            return Vec::new();
        }
        let (mut f, mut jac) = (
            vec![0.0; surface.points.len()],
            vec![0.0; surface.points.len() * n],
        );
        self.template
            .metric()
            .jacobian(&surface.points, a, &mut f, &mut jac);
        knowledge
            .open
            .iter()
            .map(|group| {
                let indices: Vec<usize> = {
                    let mut v: Vec<usize> = group
                        .iter()
                        .flat_map(|&k| self.space.column(k).iter().map(|c| c.0))
                        .collect();
                    v.sort_unstable();
                    v.dedup();
                    v
                };
                let names: Vec<String> = indices
                    .iter()
                    .map(|&i| parameters[i].name.clone())
                    .collect();
                let mut bare: Vec<&str> = Vec::new();
                for (k, s) in stats.iter().enumerate() {
                    let moved = |row: &[f64]| indices.iter().any(|&i| row[i].abs() > 1e-6);
                    let is_moved = surface
                        .parts
                        .iter()
                        .zip(jac.chunks_exact(n))
                        .any(|(p, row)| *p as usize == k && moved(row));
                    if is_moved && (s.count < 4 || s.uncovered.is_some_and(|u| u > 0.8)) {
                        bare.push(&s.name);
                    }
                }
                let verb = if names.len() == 1 { "is" } else { "are" };
                let why = if bare.is_empty() {
                    format!(
                        "{} {verb} not determined: the points leave {} open",
                        listed(&names),
                        if names.len() == 1 {
                            "it"
                        } else {
                            "a common direction"
                        }
                    )
                } else {
                    format!(
                        "{} {verb} not determined: no points near {}",
                        listed(&names),
                        listed(&bare)
                    )
                };
                Open {
                    parameters: names,
                    why,
                }
            })
            .collect()
    }

    fn others(
        &self,
        outcome: &Outcome,
        x: &[f64],
        used: &[f64],
        outliers: &[bool],
    ) -> Vec<OtherMinimum> {
        let distance = |m: &[f64]| {
            m.iter()
                .zip(x)
                .map(|(u, v)| (u - v).abs())
                .fold(0.0, f64::max)
        };
        let chosen = outcome
            .minima
            .iter()
            .enumerate()
            .min_by(|a, b| distance(&a.1.x).total_cmp(&distance(&b.1.x)))
            .map(|m| m.0);
        let others = outcome
            .minima
            .iter()
            .enumerate()
            .filter(|(k, _)| Some(*k) != chosen)
            .take(MOST_MINIMA);
        others
            .map(|(_, m)| {
                let mut a = vec![0.0; self.template.parameters().len()];
                self.space.parameters_at(&m.x, &mut a);
                OtherMinimum {
                    sum_f2: self.algebraic_sum(used, outliers, &a),
                    parameters: a,
                    hits: m.hits,
                }
            })
            .collect()
    }
}

/// "a", "a and b", "a, b and c".
pub(crate) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
        None => String::new(),
    }
}
