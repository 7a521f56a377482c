//! Whether a template fits: accepted, doubtful or refused, with the findings that say so.
//!
//! Limits compare the misfit with the part's own walls, with its size and with the noise that
//! neighbouring points show; they were set on the scans and templates of docs/fitting.md, where
//! right models and wrong ones lie apart by the factors told beside each.

use crate::Method;
use crate::clutter::Beside;
use crate::fit::{EXACT, Task};
use crate::outliers::{HAS_OUTLIERS, MOST_DROPPED};
use crate::report::{Fit, Status};
use crate::scan::MANY_STRAYS;
use crate::tell::listed;
use std::fmt;

/// A misfit above this share of the data's diagonal is refused.
const BAD_RMS: f64 = 0.02;
/// Systematic misfit above this share of the diagonal is doubtful. Right models of real objects
/// show up to 0.0035 (stitches of a baseball, soft foam), wrong ones 0.0042 and more.
const SYSTEMATIC: f64 = 0.0039;
/// Systematic misfit above this share of the thinnest wall is doubtful: it may be on its other
/// side.
const OF_WALL: f64 = 0.3;
/// Root mean square over robust deviation below which distances are split: 1 for normal noise, 0.78
/// for even spread, 0.67 for two places alike on either side.
const SPLIT: f64 = 0.85;
/// Relative deviation of the robust deviation of n normal numbers, times √n.
const DEVIATION_OF_SCALE: f64 = 1.17;
/// Residuals of neighbours are alike beyond chance from this many deviations on.
const SURE: f64 = 5.0;
/// A misfit this many times the deviation between neighbours is no noise. Right models of real
/// objects show up to 7, exact points of another part hundreds.
const OF_NOISE: f64 = 12.0;
/// The same of the deviation that the flattest tenth of the neighbourhoods shows.
const OF_FLATTEST: f64 = 60.0;
/// Noise above the smallest detail over this number: no distance says which side a point is on.
const OF_DETAIL: f64 = 3.8;
/// A share of the model's surface without data above this is doubtful: right models of whole scans
/// show less than a hundredth, half of an object unseen from one side less than this...
const BARE: f64 = 0.35;
/// ... and above this the model is refused.
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
/// Outliers and bare surface together are doubtful from these shares on: the model found its way
/// around the data (a cup in a closed can: 0.07 and 0.11).
const OUTLIERS_BESIDE: f64 = 0.03;
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

/// Whether to trust a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The template fits, and nothing found speaks against it.
    Accepted,
    /// Something found could mean that the template, or its place, is wrong.
    Doubtful,
    /// The template does not fit.
    Refused,
}

impl Verdict {
    /// The word of the JSON contract.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Doubtful => "doubtful",
            Self::Refused => "refused",
        }
    }
}

/// What speaks against a fit. Lengths are in the units of the scan, shares of 1.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// The points lie far off the model.
    FarOff {
        /// Root mean square distance.
        rms: f64,
        /// Diagonal of the data.
        size: f64,
    },
    /// Neighbouring points are off alike: the shape differs.
    Systematic {
        /// Root mean square of the shared misfit.
        misfit: f64,
        /// What it may be.
        limit: f64,
        /// Whether the limit is that of the thinnest wall.
        is_wall: bool,
    },
    /// Large distances with a gap in the middle: two walls about the model, no noise.
    TwoWalls {
        /// Root mean square distance from the model.
        rms: f64,
    },
    /// A piece is off its points while the others show nothing but noise.
    Misplaced {
        /// Its name.
        piece: String,
        /// Root mean square of its points' distances, in deviations of the noise.
        ratio: f64,
    },
    /// Points together and off the model to one side, while the others show nothing but noise.
    Together {
        /// Points.
        count: usize,
    },
    /// The points are much nearer to each other's planes than to the model.
    AboveNoise {
        /// Root mean square distance from the model.
        rms: f64,
        /// Deviation of points from planes through their neighbours.
        noise: f64,
    },
    /// Noise as large as the smallest detail.
    Thin {
        /// Noise.
        noise: f64,
        /// Smallest wall or gap of the model.
        detail: f64,
    },
    /// Surface of the model without data.
    Bare {
        /// Share of the surface.
        share: f64,
    },
    /// Surface of the model without data where views that saw the rest must have seen it.
    Overlooked {
        /// Share of the surface.
        share: f64,
    },
    /// Points that lie on surfaces which the template does not have.
    Clusters {
        /// Share of the points.
        share: f64,
    },
    /// Points off the model, and surface of the model off the points.
    Around {
        /// Share of the surface without data.
        bare: f64,
        /// Share of the points that are outliers.
        share: f64,
    },
    /// Points off the model, of any kind.
    Outliers {
        /// Share of the points.
        share: f64,
    },
    /// A cluster of points off a model that meets the others exactly.
    OffExact {
        /// Points.
        count: usize,
    },
    /// More than a quarter of the template's own parameters are open.
    Undetermined {
        /// Open ones.
        open: usize,
        /// All that are free.
        free: usize,
    },
    /// Parameters at bounds.
    AtBounds {
        /// Names.
        names: Vec<String>,
    },
    /// The search did not come back to its best place.
    Uncertain {
        /// Starts that led there.
        hits: usize,
        /// All starts.
        starts: usize,
    },
    /// Points apart from the rest.
    Apart {
        /// Share of the points.
        share: f64,
    },
    /// Points on a plane that reaches beyond the others.
    Table {
        /// Share of the points.
        share: f64,
    },
    /// Isolated points, too many to tell what the others mean.
    Stray {
        /// Share of the points.
        share: f64,
    },
    /// The model has no surface near the data.
    NoSurface,
}

impl Finding {
    /// How much it weighs.
    pub fn verdict(&self) -> Verdict {
        let refused = match self {
            Self::FarOff { .. } | Self::OffExact { .. } | Self::NoSurface => true,
            Self::Bare { share } => *share > BAD_BARE,
            Self::Clusters { share } => *share > CLUSTERS.1,
            Self::Outliers { .. } => true,
            _ => false,
        };
        if refused {
            Verdict::Refused
        } else {
            Verdict::Doubtful
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FarOff { rms, size } => write!(
                f,
                "the points lie {} off the model (rms), {:.1} % of their size",
                short(*rms),
                100.0 * rms / size
            ),
            Self::Systematic {
                misfit,
                limit,
                is_wall,
            } => write!(
                f,
                "neighbouring points are off the model alike, by {} (rms): the shape differs by \
                 more than {}, {}",
                short(*misfit),
                short(*limit),
                if *is_wall {
                    "a good part of its thinnest wall"
                } else {
                    "what real objects of this size differ by"
                }
            ),
            Self::TwoWalls { rms } => write!(
                f,
                "the points lie {} off the model (rms), most of them to either side and few on it: \
                 two walls, no noise",
                short(*rms)
            ),
            Self::Misplaced { piece, ratio } => write!(
                f,
                "the points of {piece} lie off it by {ratio:.1} times the noise, those of other \
                 pieces do not: it has another size, place or shape"
            ),
            Self::Together { count } => write!(
                f,
                "{count} points lie together, off the model by more than four times the noise, and \
                 the others show nothing but noise: clutter, or a feature that the template lacks \
                 or has too much"
            ),
            Self::AboveNoise { rms, noise } => write!(
                f,
                "the points lie {} off the model (rms), but only {} off planes through their \
                 neighbours: this is no noise",
                short(*rms),
                short(*noise)
            ),
            Self::Thin { noise, detail } => write!(
                f,
                "the noise ({}) is as large as the smallest detail of the model ({}) allows: which \
                 side of it points belong to is not known",
                short(*noise),
                short(*detail)
            ),
            Self::Bare { share } => write!(
                f,
                "{:.0} % of the model's surface has no data near it",
                100.0 * share
            ),
            Self::Overlooked { share } => write!(
                f,
                "{:.0} % of the model's surface has no data near it, though the scan saw what faces \
                 the same way: holes in the scan, or a shape that is not there",
                100.0 * share
            ),
            Self::Clusters { share } => write!(
                f,
                "{:.0} % of the points are outliers that lie on surfaces of their own: clutter, or \
                 a shape that the template lacks",
                100.0 * share
            ),
            Self::Around { bare, share } => write!(
                f,
                "{:.0} % of the points are outliers, and {:.0} % of the model's surface has no data \
                 near it: the model may lie beside the shape",
                100.0 * share,
                100.0 * bare
            ),
            Self::Outliers { share } => {
                write!(f, "{:.0} % of the points are outliers", 100.0 * share)
            }
            Self::OffExact { count } => write!(
                f,
                "{count} outliers lie together, off a model that meets the other points exactly"
            ),
            Self::Undetermined { open, free } => write!(
                f,
                "{open} of the template's {free} parameters are not determined by the points"
            ),
            Self::AtBounds { names } => write!(f, "{} ran into bounds", listed(names)),
            Self::Uncertain { hits, starts } => write!(
                f,
                "the best place was found {hits} {} in {starts} {}; there may be a better one",
                if *hits == 1 { "time" } else { "times" },
                if *starts == 1 { "start" } else { "starts" }
            ),
            Self::Apart { share } => write!(
                f,
                "{:.1} % of the points lie apart from the rest: another object, or clutter",
                100.0 * share
            ),
            Self::Table { share } => write!(
                f,
                "{:.1} % of the points lie on a plane that reaches beyond the others: a table?",
                100.0 * share
            ),
            Self::Stray { share } => write!(
                f,
                "{:.0} % of the points looked at are stray outliers",
                100.0 * share
            ),
            Self::NoSurface => f.write_str("the model has no surface near the data"),
        }
    }
}

/// Three significant digits.
fn short(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    if !(1e-6..1e9).contains(&v.abs()) {
        return format!("{v:.2e}");
    }
    let digits = (2 - v.abs().log10().floor() as i32).clamp(0, 12) as usize;
    format!("{v:.digits$}")
}

impl Fit {
    /// The verdict that the findings make.
    fn decide(&mut self) {
        let worst = self.findings.iter().map(Finding::verdict).max();
        self.verdict = worst.unwrap_or(Verdict::Accepted);
        self.acceptable = self.verdict == Verdict::Accepted;
        self.reasons = self.findings.iter().map(ToString::to_string).collect();
    }

    /// Takes findings back.
    pub(crate) fn drop_findings(&mut self, is_dropped: impl Fn(&Finding) -> bool) {
        self.findings.retain(|f| !is_dropped(f));
        self.decide();
    }
}

impl Task<'_> {
    /// The verdict, its findings, and warnings.
    /// `local` is what was found at places.
    pub(crate) fn judge(&self, fit: &mut Fit, local: impl Iterator<Item = Finding>) {
        self.warn(fit);
        fit.findings = self.findings(fit, local.collect());
        fit.decide();
    }

    fn findings(&self, fit: &Fit, local: Vec<Finding>) -> Vec<Finding> {
        let mut out = local;
        self.misfit_findings(fit, &mut out);
        self.outlier_findings(fit, &mut out);
        let bare = fit.evidence.bare;
        if fit.model_to_data.samples == 0 {
            out.push(Finding::NoSurface);
        } else if bare > BARE {
            out.push(Finding::Bare { share: bare });
        }
        if fit.evidence.overlooked > OVERLOOKED {
            out.push(Finding::Overlooked {
                share: fit.evidence.overlooked,
            });
        }
        self.parameter_findings(fit, &mut out);
        if !out.is_empty() || fit.isolated > MANY_STRAYS {
            self.clutter_findings(fit, &mut out);
        }
        let share = fit.n_outliers as f64 / fit.n_points.max(1) as f64;
        let is_noise = fit.evidence.systematic_z < SURE && share < FEW_OUTLIERS;
        // Outliers around a fit that is clean otherwise are more often a piece astray.
        let is_clean = fit.evidence.systematic_z < SURE && fit.noise > EXACT * self.data.diagonal();
        let has_tail = is_clean && share > FEW_OUTLIERS && fit.rms > TAIL * fit.noise;
        let is_unsure = !is_noise && !fit.certain;
        if self.options.method == Method::Default && (is_unsure || has_tail) {
            out.push(Finding::Uncertain {
                hits: fit.hits,
                starts: fit.starts,
            });
        }
        out
    }

    fn misfit_findings(&self, fit: &Fit, out: &mut Vec<Finding>) {
        let (size, e) = (self.data.diagonal(), &fit.evidence);
        if fit.rms > BAD_RMS * size {
            out.push(Finding::FarOff { rms: fit.rms, size });
        }
        let is_shared = e.systematic_z > SURE && fit.rms > EXACT * size;
        let wall = OF_WALL * e.thickness;
        let limit = wall.min(SYSTEMATIC * size);
        if is_shared && e.systematic > limit {
            out.push(Finding::Systematic {
                misfit: e.systematic,
                limit,
                is_wall: wall < SYSTEMATIC * size,
            });
        }
        // The robust deviation is above the root mean square where the middle is empty.
        let chance = SURE * DEVIATION_OF_SCALE / (fit.n_used.max(1) as f64).sqrt();
        let is_split = fit.rms < fit.noise * (1.0 - chance).min(SPLIT);
        if is_split && fit.rms > SYSTEMATIC * size {
            out.push(Finding::TwoWalls { rms: fit.rms });
        }
        let noise = e
            .local_noise
            .min(self.scan.least_noise * OF_FLATTEST / OF_NOISE);
        if is_shared && fit.rms > OF_NOISE * noise {
            out.push(Finding::AboveNoise {
                rms: fit.rms,
                noise: e.local_noise.min(self.scan.least_noise),
            });
        }
        if OF_DETAIL * fit.noise > e.detail {
            out.push(Finding::Thin {
                noise: fit.noise,
                detail: e.detail,
            });
        }
    }

    fn outlier_findings(&self, fit: &Fit, out: &mut Vec<Finding>) {
        let share = fit.n_outliers as f64 / fit.n_points.max(1) as f64;
        let clustered = share * fit.evidence.clustered;
        let count = clustered * fit.n_points as f64;
        if fit.noise < EXACT_NOISE * self.data.diagonal() && count > CLUSTER {
            out.push(Finding::OffExact {
                count: count.round() as usize,
            });
        }
        // Where the other points show nothing but noise, clusters have no excuse; nor where the
        // model has surface that is not there instead.
        let is_clean = fit.evidence.systematic_z < SURE;
        if clustered > CLUSTERS.0 || (is_clean && clustered > CLUSTERS_IN_NOISE) {
            out.push(Finding::Clusters { share: clustered });
        }
        let bare = fit.evidence.bare;
        if bare > BARE_BESIDE && share > OUTLIERS_BESIDE {
            out.push(Finding::Around { bare, share });
        }
        if share > BAD_OUTLIERS {
            out.push(Finding::Outliers { share });
        }
    }

    /// What lies beside the part, if anything: looked for only where the fit is in doubt, since a
    /// plane or a gap is no fault by itself.
    fn clutter_findings(&self, fit: &Fit, out: &mut Vec<Finding>) {
        let clutter = self.scan.clutter();
        let share = clutter.share(Beside::Apart);
        if share > APART {
            out.push(Finding::Apart { share });
        }
        let share = clutter.share(Beside::Plane);
        if share > APART {
            out.push(Finding::Table { share });
        }
        if fit.isolated > MANY_STRAYS {
            out.push(Finding::Stray {
                share: fit.isolated,
            });
        }
    }

    fn parameter_findings(&self, fit: &Fit, out: &mut Vec<Finding>) {
        let own = || {
            let parameters = self.template.parameters().iter().zip(&fit.parameters);
            parameters.filter(|(p, e)| !p.is_pose && e.status != Status::Fixed)
        };
        let free = own().count();
        let open = own()
            .filter(|(_, e)| e.status == Status::Undetermined)
            .count();
        if 4 * open > free {
            out.push(Finding::Undetermined { open, free });
        }
        let bound: Vec<String> = own()
            .filter(|(_, e)| e.status == Status::AtBound)
            .map(|(_, e)| e.name.clone())
            .collect();
        // One alone is told of, unless nothing holds it there.
        let is_loose = own().any(|(_, e)| {
            let half = e.ci95.map_or(0.0, |(lo, hi)| 0.5 * (hi - lo));
            e.status == Status::AtBound && half > LOOSE * self.data.diagonal()
        });
        if (bound.len() > 1 && 4 * bound.len() > free) || is_loose {
            out.push(Finding::AtBounds { names: bound });
        }
    }

    fn warn(&self, fit: &mut Fit) {
        let share = fit.n_outliers as f64 / fit.n_points.max(1) as f64;
        if !fit.complete {
            fit.warnings
                .push("stopped early: this is the best so far".to_owned());
        }
        if fit.isolated > MOST_DROPPED {
            fit.warnings.push(format!(
                "{:.0} % of the points look isolated; none was left out of the search",
                100.0 * fit.isolated
            ));
        } else if fit.isolated > HAS_OUTLIERS {
            fit.warnings.push(format!(
                "{:.1} % of the points are isolated and were left out of the search",
                100.0 * fit.isolated
            ));
        }
        if fit.n_outliers > 0 {
            fit.warnings.push(format!(
                "{} of {} points ({:.1} %) are outliers",
                fit.n_outliers,
                fit.n_points,
                100.0 * share
            ));
        }
        if fit.n_fitted < self.points.len() {
            fit.warnings.push(format!(
                "{} of {} points were fitted: more would not narrow an interval by a tenth",
                fit.n_fitted,
                self.points.len()
            ));
        }
        for p in &fit.parameters {
            if p.status == Status::AtBound {
                fit.warnings.push(format!(
                    "{} ran into a bound ({} to {})",
                    p.name, p.bounds.0, p.bounds.1
                ));
            }
        }
        if fit.model_to_data.share_outside > 0.1 {
            fit.warnings.push(format!(
                "{:.0} % of the model's surface near the data lies outside their box",
                100.0 * fit.model_to_data.share_outside
            ));
        }
    }
}
