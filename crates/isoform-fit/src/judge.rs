//! The verdict on a fit: accepted, doubtful or refused, with the findings that justify it.
//!
//! Limits compare the misfit with the thickness of the part's walls, with its size and with the
//! noise between neighbouring points. They were calibrated on the scans and templates of
//! docs/fitting.md, on which correct and wrong models differ by the factors stated at each limit.

use crate::clutter::kind::ClutterKind;
use crate::compose::weighted;
use crate::outliers::{MAX_DROPPED_SHARE, MIN_OUTLIER_SHARE};
use crate::report::finding::Finding;
use crate::report::warning::Warning;
use crate::report::{Estimate, Fit, Status};
use crate::task::Task;
use crate::thresholds::{CLUTTER_STRAY_SHARE, SIGNIFICANT_DEVIATIONS};
use crate::{Method, Parameter};

/// Systematic misfit, as a share of the diagonal, above which a fit is doubtful. Correct models of
/// real objects show up to 0.0035 (stitches of a baseball, soft foam), wrong ones 0.0042 and more.
const MAX_SYSTEMATIC_SHARE: f64 = 0.0039;
/// Ratio of a misfit to the deviation between neighbours above which it is not noise. Correct
/// models of real objects show up to 7, exact points of another part hundreds.
const MAX_NOISE_RATIO: f64 = 12.0;
/// Share of outliers below which a minimum at the noise is certain, however it was found.
const FEW_OUTLIERS_SHARE: f64 = 0.01;
/// Share of the points from which components apart, or points on a plane beyond the others, are
/// reported.
const MIN_CLUTTER_SHARE: f64 = 0.01;

impl Fit {
    /// Returns the share of outliers among the points.
    fn share_of_outliers(&self) -> f64 {
        self.n_outliers as f64 / self.n_points.max(1) as f64
    }

    /// Returns true if the residuals of neighbours are not significantly correlated.
    fn is_clean(&self) -> bool {
        self.evidence.systematic_z < SIGNIFICANT_DEVIATIONS
    }

    /// Returns true if the robust deviation significantly exceeds the root mean square, as it does
    /// if few residuals are near zero. The ratio is 1 for normal noise, 0.78 for a uniform
    /// distribution, 0.67 for two equal values on either side.
    fn is_split(&self) -> bool {
        // The relative deviation of the robust deviation of n normal numbers is 1.17 / √n.
        let chance = SIGNIFICANT_DEVIATIONS * 1.17 / (self.n_used.max(1) as f64).sqrt();
        self.rms < self.noise * (1.0 - chance).min(0.85)
    }
}

/// A free parameter of the template itself with its estimate.
type OwnParameter<'a> = (&'a Parameter, &'a Estimate);

/// Returns true if a parameter is at a bound, and the bound alone determines it: the half width of
/// its interval exceeds 5 % of the size.
fn is_loose((_, e): OwnParameter<'_>, size: f64) -> bool {
    let half = e.ci95.map_or(0.0, |(lo, hi)| 0.5 * (hi - lo));
    e.status == Status::AtBound && half > 0.05 * size
}

impl Task<'_> {
    /// Sets the warnings, the findings and the verdict of a fit. `local` are findings about single
    /// pieces and groups of points.
    pub(crate) fn judge(&self, fit: &mut Fit, local: impl Iterator<Item = Finding>) {
        fit.warnings = self.warnings(fit);
        fit.findings = self.findings(fit, local.collect());
        fit.decide();
    }

    fn findings(&self, fit: &Fit, local: Vec<Finding>) -> Vec<Finding> {
        let mut out = local;
        out.extend(self.misfit_findings(fit));
        out.extend(self.outlier_findings(fit));
        out.extend(surface_findings(fit));
        out.extend(self.parameter_findings(fit));
        if !out.is_empty() || strays(fit) > CLUTTER_STRAY_SHARE {
            out.extend(self.clutter_findings(fit));
        }
        out.extend(self.uncertain(fit));
        out
    }

    fn misfit_findings(&self, fit: &Fit) -> impl Iterator<Item = Finding> {
        let (size, rms) = (self.size(), fit.rms);
        let is_far = rms > 0.02 * size;
        let is_split = fit.is_split() && rms > MAX_SYSTEMATIC_SHARE * size;
        let off = &fit.data_to_model;
        // Points on two sheets that are at least ten deviations of their noise apart: 95 % of the
        // distances are below 1.96 rms for normal noise, 1.65 for a uniform distribution, 1.41 for
        // a wave. The ratio is also small with outliers, which the maximum reveals.
        let [most, all] = [1.3, 2.0].map(|bound| bound * off.rms);
        let are_sheets = off.p95 < most && off.max < all && rms > self.rounding();
        let is_two_walls = is_split || are_sheets;
        // With noise above the detail over 3.8, no distance shows on which side a point is.
        let is_thin = 3.8 * fit.noise > fit.evidence.detail;
        [
            is_far.then_some(Finding::FarOff { rms, size }),
            self.systematic(fit),
            is_two_walls.then_some(Finding::TwoWalls { rms }),
            self.above_noise(fit),
            is_thin.then_some(Finding::Thin {
                noise: fit.noise,
                detail: fit.evidence.detail,
            }),
        ]
        .into_iter()
        .flatten()
    }

    /// Returns true if neighbours share a misfit that is not rounding.
    fn is_shared(&self, fit: &Fit) -> bool {
        fit.evidence.systematic_z > SIGNIFICANT_DEVIATIONS && fit.rms > self.rounding()
    }

    /// Reports a shared misfit above the limits for thin walls and for real objects. Above 0.3 of a
    /// wall's thickness, the wall of the model may lie on the other side of the points.
    fn systematic(&self, fit: &Fit) -> Option<Finding> {
        let wall = 0.3 * fit.evidence.thickness;
        let usual = MAX_SYSTEMATIC_SHARE * self.size();
        let (misfit, limit) = (fit.evidence.systematic, wall.min(usual));
        (self.is_shared(fit) && misfit > limit).then_some(Finding::Systematic {
            misfit,
            limit,
            is_wall: wall < usual,
        })
    }

    /// Reports a shared misfit above the noise between neighbours: 12 times its median, or 60 times
    /// its first decile.
    fn above_noise(&self, fit: &Fit) -> Option<Finding> {
        let (local, flattest) = (fit.evidence.local_noise, self.scan.least_noise);
        let noise = local.min(flattest * 60.0 / MAX_NOISE_RATIO);
        let is_above = fit.rms > (MAX_NOISE_RATIO * noise).max(self.exact());
        (self.is_shared(fit) && is_above).then_some(Finding::AboveNoise {
            rms: fit.rms,
            noise: local.min(flattest),
        })
    }

    fn outlier_findings(&self, fit: &Fit) -> impl Iterator<Item = Finding> {
        let share = fit.share_of_outliers();
        let clustered = share * fit.evidence.clustered;
        let count = clustered * fit.n_points as f64;
        let is_exact = fit.noise < self.exact();
        // Correct models of real objects have up to 0.08 of the points in clusters of outliers,
        // wrong ones at least 0.105. If the other points show only noise, less is doubtful.
        let is_clustered = clustered > 0.09 || (fit.is_clean() && clustered > 0.015);
        let bare = fit.evidence.bare;
        [
            (is_exact && count > 5.0).then_some(Finding::OffExact {
                count: count.round() as usize,
            }),
            is_clustered.then_some(Finding::Clusters { share: clustered }),
            // The model found its way around the data; a cup in a closed can has 0.11 and 0.07.
            (bare > 0.05 && share > 0.03).then_some(Finding::Around { bare, share }),
            // Without a majority on the model, the fit cannot be trusted.
            (share > 0.4).then_some(Finding::Outliers { share }),
        ]
        .into_iter()
        .flatten()
    }

    /// Reports clutter around the part. It is called only if the fit is in doubt, since a plane or
    /// a gap is not a defect by itself.
    fn clutter_findings(&self, fit: &Fit) -> impl Iterator<Item = Finding> {
        let clutter = self.scan.clutter();
        let (apart, plane) = (
            clutter.share(ClutterKind::Apart),
            clutter.share(ClutterKind::Plane),
        );
        let stray = strays(fit);
        [
            (apart > MIN_CLUTTER_SHARE).then_some(Finding::Apart { share: apart }),
            (plane > MIN_CLUTTER_SHARE).then_some(Finding::Table { share: plane }),
            (stray > CLUTTER_STRAY_SHARE).then_some(Finding::Stray { share: stray }),
        ]
        .into_iter()
        .flatten()
    }

    /// Returns the free parameters of the template itself, without those of the pose.
    fn own<'b>(&'b self, fit: &'b Fit) -> Vec<OwnParameter<'b>> {
        let all = self.template.parameters().iter().zip(&fit.parameters);
        let is_own = |(p, e): &OwnParameter<'_>| !p.is_pose && e.status != Status::Fixed;
        all.filter(is_own).collect()
    }

    fn parameter_findings(&self, fit: &Fit) -> impl Iterator<Item = Finding> {
        let own = self.own(fit);
        let of = |status: Status| own.iter().filter(move |(_, e)| e.status == status);
        let (free, open) = (own.len(), of(Status::Undetermined).count());
        let names: Vec<String> = of(Status::AtBound).map(|(_, e)| e.name.clone()).collect();
        // A single one is only a warning, unless the bound alone determines it.
        let is_loose = own.iter().any(|own| is_loose(*own, self.size()));
        let is_bound = (names.len() > 1 && 4 * names.len() > free) || is_loose;
        let points = weighted(&fit.weights);
        let is_tested = points > self.space.len();
        [
            (!is_tested).then_some(Finding::Untested {
                points,
                free: self.space.len(),
            }),
            (is_tested && 4 * open > free).then_some(Finding::Undetermined { open, free }),
            is_bound.then_some(Finding::AtBounds { names }),
        ]
        .into_iter()
        .flatten()
    }

    /// Reports that the search may have missed a better minimum.
    fn uncertain(&self, fit: &Fit) -> Option<Finding> {
        let share = fit.share_of_outliers();
        let is_noise = fit.is_clean() && share < FEW_OUTLIERS_SHARE;
        // Outliers around a fit that is otherwise clean usually belong to a misplaced piece.
        let is_clean = fit.is_clean() && fit.noise > self.rounding();
        let has_tail = is_clean && share > FEW_OUTLIERS_SHARE && fit.rms > 1.3 * fit.noise;
        let is_unsure = !is_noise && !fit.certain;
        let is_asked = self.options.method == Method::Default;
        (is_asked && (is_unsure || has_tail)).then_some(Finding::Uncertain {
            hits: fit.hits,
            starts: fit.starts,
        })
    }

    fn warnings(&self, fit: &Fit) -> Vec<Warning> {
        let points = self.scan.count();
        let outside = fit.model_to_data.share_outside;
        let first = [
            (!fit.complete).then_some(Warning::Stopped),
            isolated(fit.isolated),
            (fit.n_outliers > 0).then_some(Warning::Outliers {
                count: fit.n_outliers,
                points: fit.n_points,
            }),
            (fit.n_fitted < points).then_some(Warning::SomeFitted {
                count: fit.n_fitted,
                points,
            }),
        ];
        let bound = fit
            .parameters
            .iter()
            .filter(|p| p.status == Status::AtBound);
        let bound = bound.map(|p| Warning::AtBound {
            name: p.name.clone(),
            bounds: p.bounds,
        });
        let outside = (outside > 0.1).then_some(Warning::Outside { share: outside });
        first
            .into_iter()
            .flatten()
            .chain(bound)
            .chain(outside)
            .collect()
    }
}

/// Reports surface without data: correct models of whole scans have less than 0.01 of it bare, half
/// an object unseen from one side less than 0.35.
fn surface_findings(fit: &Fit) -> impl Iterator<Item = Finding> {
    let (bare, overlooked) = (fit.evidence.bare, fit.evidence.overlooked);
    let first = if fit.model_to_data.samples == 0 {
        Some(Finding::NoSurface)
    } else {
        (bare > 0.35).then_some(Finding::Bare { share: bare })
    };
    // A ring taken for a can with lids inside has 0.07.
    let second = (overlooked > 0.04).then_some(Finding::Overlooked { share: overlooked });
    first.into_iter().chain(second)
}

/// Returns the share of the points that are isolated and off the model; vertices of meshes can be
/// isolated and on it.
fn strays(fit: &Fit) -> f64 {
    fit.isolated
        .min(fit.n_outliers as f64 / fit.n_points.max(1) as f64)
}

/// Warns of isolated points, which were left out of the search if they are not too many.
fn isolated(share: f64) -> Option<Warning> {
    if share > MAX_DROPPED_SHARE {
        Some(Warning::Isolated { share })
    } else {
        (share > MIN_OUTLIER_SHARE).then_some(Warning::LeftOut { share })
    }
}
