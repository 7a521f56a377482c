//! The verdict on a fit: accepted, doubtful or refused, with the findings that justify it.
//!
//! Limits compare the misfit with the thickness of the part's walls, with its size and with the
//! noise between neighbouring points. They were calibrated on the scans and templates of
//! docs/fitting.md, on which correct and wrong models differ by the factors stated at each limit.

mod finding;
mod warning;

pub use self::finding::{Finding, Verdict};
pub use self::warning::Warning;

use crate::clutter::Beside;
use crate::outliers::{HAS_OUTLIERS, MOST_DROPPED};
use crate::report::{Estimate, Fit, Status};
use crate::scan::MANY_STRAYS;
use crate::task::Task;
use crate::{Method, Parameter};

/// A misfit above this share of the data's diagonal is refused.
const BAD_RMS: f64 = 0.02;
/// Systematic misfit above this share of the diagonal is doubtful. Right models of real objects
/// show up to 0.0035 (stitches of a baseball, soft foam), wrong ones 0.0042 and more.
const SYSTEMATIC: f64 = 0.0039;
/// A systematic misfit above this share of the thinnest wall is doubtful: the model's wall may lie
/// on the other side of the points.
const OF_WALL: f64 = 0.3;
/// Root mean square over robust deviation below which distances are split: 1 for normal noise, 0.78
/// for even spread, 0.67 for two places alike on either side.
const SPLIT: f64 = 0.85;
/// Bounds of 95 % of the distances and of all of them over their root mean square, below which
/// points lie on two sheets ten deviations of their noise apart or more: the first is 1.96 for
/// normal noise, 1.65 for even spread, 1.41 for a wave, and small beside outliers, which the second
/// tells.
const TWO_SHEETS: [f64; 2] = [1.3, 2.0];
/// Relative deviation of the robust deviation of n normal numbers, times √n.
const DEVIATION_OF_SCALE: f64 = 1.17;
/// Residuals of neighbours are alike beyond chance from this many deviations on.
const SURE: f64 = 5.0;
/// A misfit this many times the deviation between neighbours is no noise. Right models of real
/// objects show up to 7, exact points of another part hundreds.
const OF_NOISE: f64 = 12.0;
/// A misfit this many times the deviation in the flattest tenth of the neighbourhoods is no noise.
const OF_FLATTEST: f64 = 60.0;
/// Noise above the smallest detail over this number: no distance says which side a point is on.
const OF_DETAIL: f64 = 3.8;
/// A share of the model's surface without data above this is doubtful: right models of whole scans
/// show less than a hundredth, half of an object unseen from one side less than this.
const BARE: f64 = 0.35;
/// A model with more than this share of its surface without data is refused.
const BAD_BARE: f64 = 0.6;
/// Bare surface above this share is doubtful where what faces the same way was seen. Right models
/// of whole scans show less than 0.01, a ring taken for a can with lids inside 0.07.
const OVERLOOKED: f64 = 0.04;
/// Outliers that lie on surfaces of their own, as a share of the points: above the first they are
/// doubtful (right models of real objects: up to 0.08, wrong ones from 0.105 on), above the second
/// refused.
const CLUSTERS: (f64, f64) = (0.09, 0.3);
/// Clusters are doubtful from this share on where the other points show nothing but noise.
const CLUSTERS_IN_NOISE: f64 = 0.015;
/// Outliers above this share are doubtful beside bare surface: the model found its way around the
/// data (a cup in a closed can: 0.07).
const OUTLIERS_BESIDE: f64 = 0.03;
/// Bare surface above this share is doubtful beside outliers (a cup in a closed can: 0.11).
const BARE_BESIDE: f64 = 0.05;
/// Fewer outliers than this leave a minimum at the noise beyond doubt, however it was found.
const FEW_OUTLIERS: f64 = 0.01;
/// Root mean square of the points used over their robust deviation that is a tail.
const TAIL: f64 = 1.3;
/// Outliers of any kind above this share are refused: there is no majority to trust.
const BAD_OUTLIERS: f64 = 0.4;
/// Half width of the interval of a parameter at a bound, as a share of the size, from which nothing
/// but the bound holds it.
const LOOSE: f64 = 0.05;
/// Points apart, or on a plane beyond the others, are told of from this share on.
const APART: f64 = 0.01;
/// Points in clusters off a model that meets the rest exactly: this many are another shape.
const CLUSTER: f64 = 5.0;
/// Robust noise below this share of the size makes data exact.
const EXACT_NOISE: f64 = 1e-7;
/// Surface of the model outside the data's box is told of from this share on.
const OUTSIDE: f64 = 0.1;

impl Fit {
    /// Sets the verdict that follows from the findings.
    fn decide(&mut self) {
        let worst = self.findings.iter().map(Finding::verdict).max();
        self.verdict = worst.unwrap_or(Verdict::Accepted);
        self.acceptable = self.verdict == Verdict::Accepted;
        self.reasons = self.findings.iter().map(ToString::to_string).collect();
    }

    /// Adds a finding and updates the verdict.
    pub fn add_finding(&mut self, finding: Finding) {
        self.findings.push(finding);
        self.decide();
    }

    /// Removes findings and updates the verdict.
    pub(crate) fn drop_findings(&mut self, is_dropped: impl Fn(&Finding) -> bool) {
        self.findings.retain(|f| !is_dropped(f));
        self.decide();
    }

    /// Returns the share of outliers among the points.
    fn share_of_outliers(&self) -> f64 {
        self.n_outliers as f64 / self.n_points.max(1) as f64
    }

    /// Returns true if the residuals of neighbours are not significantly correlated.
    fn is_clean(&self) -> bool {
        self.evidence.systematic_z < SURE
    }

    /// Returns true if the robust deviation significantly exceeds the root mean square, as it does
    /// if few residuals are near zero. The ratio is 1 for normal noise, 0.78 for a uniform
    /// distribution, 0.67 for two equal values on either side.
    fn is_split(&self) -> bool {
        let chance = SURE * DEVIATION_OF_SCALE / (self.n_used.max(1) as f64).sqrt();
        self.rms < self.noise * (1.0 - chance).min(SPLIT)
    }
}

/// A free parameter of the template itself with its estimate.
type Own<'a> = (&'a Parameter, &'a Estimate);

/// Returns true if a parameter is at a bound, and the bound alone determines it: the half width of
/// its interval exceeds 5 % of the size.
fn is_loose((_, e): Own<'_>, size: f64) -> bool {
    let half = e.ci95.map_or(0.0, |(lo, hi)| 0.5 * (hi - lo));
    e.status == Status::AtBound && half > LOOSE * size
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
        if !out.is_empty() || strays(fit) > MANY_STRAYS {
            out.extend(self.clutter_findings(fit));
        }
        out.extend(self.uncertain(fit));
        out
    }

    fn misfit_findings(&self, fit: &Fit) -> impl Iterator<Item = Finding> {
        let (size, rms) = (self.size(), fit.rms);
        let is_far = rms > BAD_RMS * size;
        let is_split = fit.is_split() && rms > SYSTEMATIC * size;
        let off = &fit.data_to_model;
        let [most, all] = TWO_SHEETS.map(|bound| bound * off.rms);
        let are_sheets = off.p95 < most && off.max < all && rms > self.rounding();
        let is_two_walls = is_split || are_sheets;
        let is_thin = OF_DETAIL * fit.noise > fit.evidence.detail;
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
        fit.evidence.systematic_z > SURE && fit.rms > self.rounding()
    }

    /// Reports a shared misfit above the limits for thin walls and for real objects. Above 0.3 of a
    /// wall's thickness, the wall of the model may lie on the other side of the points.
    fn systematic(&self, fit: &Fit) -> Option<Finding> {
        let (wall, usual) = (OF_WALL * fit.evidence.thickness, SYSTEMATIC * self.size());
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
        let noise = local.min(flattest * OF_FLATTEST / OF_NOISE);
        (self.is_shared(fit) && fit.rms > OF_NOISE * noise).then_some(Finding::AboveNoise {
            rms: fit.rms,
            noise: local.min(flattest),
        })
    }

    fn outlier_findings(&self, fit: &Fit) -> impl Iterator<Item = Finding> {
        let share = fit.share_of_outliers();
        let clustered = share * fit.evidence.clustered;
        let count = clustered * fit.n_points as f64;
        let is_exact = fit.noise < EXACT_NOISE * self.size();
        // Where the other points show nothing but noise, clusters have no excuse; nor where the
        // model has surface that is not there instead.
        let is_clustered =
            clustered > CLUSTERS.0 || (fit.is_clean() && clustered > CLUSTERS_IN_NOISE);
        let bare = fit.evidence.bare;
        [
            (is_exact && count > CLUSTER).then_some(Finding::OffExact {
                count: count.round() as usize,
            }),
            is_clustered.then_some(Finding::Clusters { share: clustered }),
            (bare > BARE_BESIDE && share > OUTLIERS_BESIDE)
                .then_some(Finding::Around { bare, share }),
            (share > BAD_OUTLIERS).then_some(Finding::Outliers { share }),
        ]
        .into_iter()
        .flatten()
    }

    /// Reports clutter around the part. It is called only if the fit is in doubt, since a plane or
    /// a gap is not a defect by itself.
    fn clutter_findings(&self, fit: &Fit) -> impl Iterator<Item = Finding> {
        let clutter = self.scan.clutter();
        let (apart, plane) = (clutter.share(Beside::Apart), clutter.share(Beside::Plane));
        let stray = strays(fit);
        [
            (apart > APART).then_some(Finding::Apart { share: apart }),
            (plane > APART).then_some(Finding::Table { share: plane }),
            (stray > MANY_STRAYS).then_some(Finding::Stray { share: stray }),
        ]
        .into_iter()
        .flatten()
    }

    /// Returns the free parameters of the template itself, without those of the pose.
    fn own<'b>(&'b self, fit: &'b Fit) -> Vec<Own<'b>> {
        let all = self.template.parameters().iter().zip(&fit.parameters);
        let is_own = |(p, e): &Own<'_>| !p.is_pose && e.status != Status::Fixed;
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
        [
            (4 * open > free).then_some(Finding::Undetermined { open, free }),
            is_bound.then_some(Finding::AtBounds { names }),
        ]
        .into_iter()
        .flatten()
    }

    /// Reports that the search may have missed a better minimum.
    fn uncertain(&self, fit: &Fit) -> Option<Finding> {
        let share = fit.share_of_outliers();
        let is_noise = fit.is_clean() && share < FEW_OUTLIERS;
        // Outliers around a fit that is clean otherwise are more often a piece astray.
        let is_clean = fit.is_clean() && fit.noise > self.rounding();
        let has_tail = is_clean && share > FEW_OUTLIERS && fit.rms > TAIL * fit.noise;
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
        let outside = (outside > OUTSIDE).then_some(Warning::Outside { share: outside });
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
        (bare > BARE).then_some(Finding::Bare { share: bare })
    };
    let second = (overlooked > OVERLOOKED).then_some(Finding::Overlooked { share: overlooked });
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
    if share > MOST_DROPPED {
        Some(Warning::Isolated { share })
    } else {
        (share > HAS_OUTLIERS).then_some(Warning::LeftOut { share })
    }
}
