//! Entities of points that were given by hand: each label is fitted to exactly its points, and
//! nothing is searched.

use crate::accuracy::degrees_of_freedom;
use crate::chart::{Primitive, PrimitiveKind, frame};
use crate::choose::{KnownSurfaces, Noise, follows};
use crate::cloud::{Cloud, thinned};
use crate::cost::Cost;
use crate::entity::{Recognition, RelationKind};
use crate::faces::FaceLabels;
use crate::fit::{Precision, covariance, fit, mean, squares};
use crate::form::{MAX_FORM_TOLERANCE, MIN_KNOWN_SHARE};
use crate::grow::core;
use crate::kinds::{AllowedSurfaces, coaxial_cone, guess, simplest_kind, zone};
use crate::labels::UNLABELLED;
use crate::local::moments;
use crate::noise::NORMAL_MEDIAN;
use crate::recognize::{Error, Options, PreparedScan};
use crate::related::{LabelRelation, RelationDistance, impose, shown_distance, shown_relation};
use crate::segment::{
    GivenEntity, MAX_NOISE_GROWTH, NOISE_SLACK, Segmentation, directions, lower_noise,
};
use crate::share::MembershipWeights;
use crate::simplify::ZONE_COSINE;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, PointCloud, cross, dot};
use isoform_num::linalg::symmetric_eigen_3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;

/// Minimum standard deviation of points across the line through them, in standard deviations of the
/// noise: points of a line have 1. A larger bound refuses narrow strips, which determine their
/// plane to some degrees.
const MIN_WIDTH_DEVIATIONS: f64 = 2.0;
/// Maximum number of labels. Relations compare all pairs: a minute for this number. Parts have some
/// hundred faces.
const MAX_LABELS: usize = 4096;

/// Ratios of the radius of the circle of a torus to that of its tube from which it is sought: by
/// factors of 2, over which a fit goes by itself, from a full ring to a hardly bent tube.
const BENDS: [f64; 5] = [1.5, 3.0, 6.0, 12.0, 24.0];
/// Number of directions of its bend from which a torus is sought: a fit turns by 30 degrees by
/// itself.
const TURNS: usize = 6;

/// Statements about labels that were given by hand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelFacts {
    /// Kinds asked for, by label. Other labels become the kind that describes their points best.
    pub kinds: BTreeMap<u32, PrimitiveKind>,
    /// Relations that the surfaces are refitted to hold, though the points may not show them.
    pub relations: Vec<LabelRelation>,
}

impl LabelFacts {
    /// Returns the labels of which something is stated.
    pub fn labels(&self) -> impl Iterator<Item = u32> {
        let related = self.relations.iter().flat_map(|r| r.labels);
        self.kinds.keys().copied().chain(related)
    }

    /// Drops the statements about some labels.
    pub fn remove(&mut self, lost: &BTreeSet<u32>) {
        self.kinds.retain(|label, _| !lost.contains(label));
        self.relations
            .retain(|r| r.labels.iter().all(|label| !lost.contains(label)));
    }
}

/// Labels that the points of a scan were given by hand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GivenLabels {
    /// Label of each point of the scan; `None` for points of no entity.
    pub labels: Vec<Option<u32>>,
    /// Kinds and relations of the labels.
    pub facts: LabelFacts,
    /// Error that the coordinates of all points may share, in the scan's unit: the rounding of the
    /// vertices of a CAD mesh, which no average removes; 0 for scans.
    pub rounding: f64,
}

/// Reasons why labels given by hand become no entities.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LabelsError {
    /// The scan has no surface, or the work was stopped.
    #[error(transparent)]
    Scan(#[from] Error),
    /// The number of labels is not that of the points.
    #[error("there are {labels} labels for {points} points")]
    Count {
        /// Number of labels.
        labels: usize,
        /// Number of points.
        points: usize,
    },
    /// Points at one place have different labels.
    #[error(
        "points {} and {} (from 0) are at one place, but one has the label {}, the other {}",
        points[0], points[1], shown(labels[0]), shown(labels[1])
    )]
    Split {
        /// Indices of two of the points.
        points: [usize; 2],
        /// Labels of these points.
        labels: [Option<u32>; 2],
    },
    /// More labels than are compared with one another.
    #[error("{0} labels are too many: {MAX_LABELS} at most become entities")]
    Many(usize),
    /// A label with a kind or a relation that no point has.
    #[error("no point has the label {0}, for which a kind or a relation is given")]
    Unknown(u32),
    /// A relation of a label with itself.
    #[error("the label {0} is related to itself")]
    OneLabel(u32),
    /// A relation that is not defined for two kinds of surfaces.
    #[error(
        "the labels {} and {} cannot be {}: they are a {} and a {}",
        labels[0], labels[1], shown_relation(*relation), kinds[0].name(), kinds[1].name()
    )]
    Unrelated {
        /// Relation that is given.
        relation: RelationKind,
        /// The two labels.
        labels: [u32; 2],
        /// Kinds of their surfaces.
        kinds: [PrimitiveKind; 2],
    },
    /// A relation from which the points are far.
    #[error(
        "the labels {} and {} are too far from being {}: {}",
        labels[0], labels[1], shown_relation(*relation), shown_distance(*off)
    )]
    Far {
        /// Relation that is given.
        relation: RelationKind,
        /// The two labels.
        labels: [u32; 2],
        /// Angle or length off the relation.
        off: RelationDistance,
    },
    /// A relation that the others exclude.
    #[error(
        "the labels {} and {} cannot be {} if the other relations hold, too",
        labels[0], labels[1], shown_relation(*relation)
    )]
    Contradiction {
        /// Relation that is given.
        relation: RelationKind,
        /// The two labels.
        labels: [u32; 2],
    },
    /// The points of a label do not determine a surface.
    #[error(
        "the {points} points of label {label} determine no {}",
        kind.map_or("surface", PrimitiveKind::name)
    )]
    Undetermined {
        /// Label.
        label: u32,
        /// Number of its distinct points.
        points: usize,
        /// Kind asked for; `None` if any kind would do.
        kind: Option<PrimitiveKind>,
    },
}

impl From<Stopped> for LabelsError {
    fn from(stopped: Stopped) -> Self {
        Error::from(stopped).into()
    }
}

/// Returns a label as files have it.
fn shown(label: Option<u32>) -> i64 {
    label.map_or(-1, i64::from)
}

/// Makes an entity of each label, fitted to exactly the points that have it; the entities are in
/// ascending order of their labels. The minimum number of points of the options is of no account.
///
/// An entity that does not explain its points within the noise is kept, and marked.
///
/// # Errors
/// [`LabelsError`].
pub fn recognize_labelled(
    scan: &PointCloud,
    given: &GivenLabels,
    options: &Options,
    control: &Control<'_>,
) -> Result<Recognition, LabelsError> {
    if given.labels.len() != scan.points.len() {
        return Err(LabelsError::Count {
            labels: given.labels.len(),
            points: scan.points.len(),
        });
    }
    let names: BTreeSet<u32> = given.labels.iter().flatten().copied().collect();
    let facts = &given.facts;
    if let Some(label) = facts.labels().find(|label| !names.contains(label)) {
        return Err(LabelsError::Unknown(label));
    }
    if let Some(r) = facts.relations.iter().find(|r| r.labels[0] == r.labels[1]) {
        return Err(LabelsError::OneLabel(r.labels[0]));
    }
    if names.len() > MAX_LABELS {
        return Err(LabelsError::Many(names.len()));
    }
    let ready = PreparedScan::new(scan, options, control)?;
    let names: Vec<u32> = names.into_iter().collect();
    let labels = labels_of_places(given, &names, &ready)?;
    let cloud = &ready.cloud;
    control.report("recognize", 0.0);
    let mut found =
        LabelledFits::new(cloud, given, &names, labels).segmentation(&ready, options)?;
    if !facts.relations.is_empty() {
        impose((&mut found, cloud, ready.unit()), &facts.relations, &names)?;
        explain(&mut found, cloud);
    }
    control.check()?;
    let faces = FaceLabels::of_cloud(cloud, &found, 0);
    Ok(ready.described(scan, found, &faces))
}

/// Flags the labels whose surfaces explain their points.
fn explain(found: &mut Segmentation, cloud: &Cloud) {
    let noise = Noise {
        deviation: found.noise,
        slack: NOISE_SLACK,
        is_form: found.is_form,
    };
    let members = found.members();
    let each = found.given.iter_mut().zip(&found.surfaces).zip(&members);
    for ((given, surface), members) in each {
        given.is_explained = is_explained(cloud, members, surface, noise);
    }
}

/// Returns the index in `names` of the label of each place of a cloud, which all points there
/// share.
fn labels_of_places(
    given: &GivenLabels,
    names: &[u32],
    ready: &PreparedScan,
) -> Result<Vec<u32>, LabelsError> {
    let mut first: Vec<Option<usize>> = vec![None; ready.cloud.points.len()];
    let mut labels = vec![UNLABELLED; first.len()];
    for (i, place) in ready.index.iter().enumerate() {
        let place = *place as usize;
        let label = given.labels[i];
        match first[place] {
            None => {
                first[place] = Some(i);
                let at = label.and_then(|label| names.binary_search(&label).ok());
                labels[place] = at.map_or(UNLABELLED, |at| at as u32);
            }
            Some(other) if given.labels[other] != label => {
                return Err(LabelsError::Split {
                    points: [other, i],
                    labels: [given.labels[other], label],
                });
            }
            Some(_) => {}
        }
    }
    Ok(labels)
}

/// The points of each label, for fits.
struct LabelledFits<'a> {
    cloud: &'a Cloud,
    given: &'a GivenLabels,
    /// Labels in ascending order.
    names: &'a [u32],
    /// Index of the label of each point of the cloud.
    labels: Vec<u32>,
    /// Points of each label.
    members: Vec<Vec<u32>>,
}

impl<'a> LabelledFits<'a> {
    fn new(cloud: &'a Cloud, given: &'a GivenLabels, names: &'a [u32], labels: Vec<u32>) -> Self {
        let mut members = vec![Vec::new(); names.len()];
        for (i, label) in (0..).zip(&labels) {
            if *label != UNLABELLED {
                members[*label as usize].push(i);
            }
        }
        Self {
            cloud,
            given,
            names,
            labels,
            members,
        }
    }

    /// Fits all labels within the noise, or within the tolerance of form that most of them need.
    fn segmentation(
        self,
        ready: &PreparedScan,
        options: &Options,
    ) -> Result<Segmentation, LabelsError> {
        let cloud = self.cloud;
        let rounding = ready.diagonals(self.given.rounding);
        let shown = match cloud.is_volume {
            true => cloud.noise,
            false => lower_noise(cloud, cloud.noise),
        };
        let (surfaces, noise, is_form) = match ready.noise(options) {
            Some(noise) => {
                let is_form = noise > MAX_NOISE_GROWTH * shown;
                (self.surfaces(noise, is_form)?, noise, is_form)
            }
            None => {
                let least = cloud.floor.max(rounding);
                self.within_noise_or_form([shown, cloud.noise].map(|n| n.max(least)), least)?
            }
        };
        let noise = noise.max(rounding);
        let deviation = Noise {
            deviation: noise,
            slack: NOISE_SLACK,
            is_form,
        };
        let given =
            (self.names.iter().zip(&self.members))
                .zip(&surfaces)
                .map(|((label, of), surface)| GivenEntity {
                    label: *label,
                    is_explained: is_explained(cloud, of, surface, deviation),
                });
        let given = given.collect();
        let mut found = Segmentation::new(surfaces, self.labels, noise, is_form);
        found.given = given;
        found.rounding = rounding;
        Ok(found)
    }

    /// Returns the surfaces, the noise or the tolerance of form, and true if it is the latter.
    /// `shown` are estimates of the noise from neighbourhoods, the lower one first.
    fn within_noise_or_form(
        &self,
        shown: [f64; 2],
        least: f64,
    ) -> Result<(Vec<Primitive>, f64, bool), LabelsError> {
        let cloud = self.cloud;
        // Neighbourhoods reach over thin walls and into other labels, and look noisier than these.
        let own = self.own_noise().unwrap_or(shown[0]);
        let own = own.min(shown[0]).max(least);
        let (mut surfaces, mut noise) = self.within_noise(own)?;
        let mut tried = own;
        for more in shown {
            // Surfaces fitted with less noise may show that it was too little.
            if noise <= 1.4 * tried || more <= tried {
                continue;
            }
            let Ok(found) = self.within_noise(more) else {
                break;
            };
            ((surfaces, noise), tried) = (found, more);
        }
        let deviation = Noise {
            deviation: noise,
            slack: NOISE_SLACK,
            is_form: false,
        };
        // What is off by more than any form is a mistake, and tells nothing about the others.
        let (mut near, mut explained, mut form) = (0, 0, 0.0_f64);
        for (surface, of) in surfaces.iter().zip(&self.members) {
            let rms = (squares(surface, &cloud.at(of)) / of.len() as f64).sqrt();
            if rms <= MAX_FORM_TOLERANCE {
                near += of.len();
                form = form.max(rms);
                if is_explained(cloud, of, surface, deviation) {
                    explained += of.len();
                }
            }
        }
        if explained as f64 >= MIN_KNOWN_SHARE * near as f64 {
            return Ok((surfaces, noise, false));
        }
        let noise = form.max(noise);
        Ok((self.surfaces(noise, true)?, noise, true))
    }

    /// Returns the surfaces within the noise, and the noise that those show that explain their
    /// points, starting from an estimate.
    fn within_noise(&self, shown: f64) -> Result<(Vec<Primitive>, f64), LabelsError> {
        let mut noise = shown;
        // The noise hardly changes after the first measurement.
        for _ in 0..2 {
            let surfaces = self.surfaces(noise, false)?;
            noise = self.measured(&surfaces, shown);
        }
        Ok((self.surfaces(noise, false)?, noise))
    }

    /// Returns the noise that labels show: the median over their points of the least deviation from
    /// any kind of surface, which few wrong labels do not change. `None` if all have few points.
    fn own_noise(&self) -> Option<f64> {
        let cloud = self.cloud;
        let of = |members: &Vec<u32>| {
            // The deviation of 400 points is known to 4 %.
            let some: Vec<u32> = thinned(members.len(), 400).map(|k| members[k]).collect();
            let points = cloud.at(&some);
            let deviation = |kind: &PrimitiveKind| {
                // With fewer points a surface follows the noise.
                let free = points.len().checked_sub(2 * kind.parameters())? + kind.parameters();
                let (_, squares) = fit(&guess(cloud, &some, *kind)?, &points, Precision::Full)?;
                Some((squares / free as f64).sqrt())
            };
            let least = PrimitiveKind::ALL.iter().filter_map(deviation);
            let least = least.min_by(f64::total_cmp)?;
            Some((least, members.len()))
        };
        let mut each: Vec<(f64, usize)> = self.members.par_iter().filter_map(of).collect();
        each.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = each.iter().map(|e| e.1).sum::<usize>() / 2;
        let median = each
            .iter()
            .find(|(_, count)| match left.checked_sub(*count) {
                Some(rest) => {
                    left = rest;
                    false
                }
                None => true,
            });
        median.map(|e| e.0)
    }

    /// Returns the noise of points about the surfaces that explain them, given the estimate before
    /// any was known. Of exact points it is that of the entity with the most.
    fn measured(&self, surfaces: &[Primitive], shown: f64) -> f64 {
        let cloud = self.cloud;
        let most = Noise {
            deviation: shown,
            slack: MAX_NOISE_GROWTH,
            is_form: true,
        };
        let of = surfaces.iter().zip(&self.members);
        let good: Vec<(&Primitive, &Vec<u32>)> = of
            .filter(|(surface, of)| is_explained(cloud, of, surface, most))
            .collect();
        if cloud.is_exact(shown) {
            let deviation = |(surface, of): &(&Primitive, &Vec<u32>)| {
                let free = of.len().saturating_sub(surface.kind.parameters()).max(1);
                (squares(surface, &cloud.at(of)) / free as f64).sqrt()
            };
            let each = good.iter().map(deviation);
            return each.fold(cloud.floor, f64::max).min(cloud.exact());
        }
        let distances = good.iter().flat_map(|(surface, of)| {
            let at = |i: &u32| surface.distance(cloud.points[*i as usize]).abs();
            of.iter().map(at)
        });
        let mut distances: Vec<f64> = distances.collect();
        if distances.is_empty() {
            return shown;
        }
        let half = distances.len() / 2;
        let median = *distances.select_nth_unstable_by(half, f64::total_cmp).1;
        (median / NORMAL_MEDIAN)
            .min(MAX_NOISE_GROWTH * shown)
            .max(cloud.floor)
    }

    /// Returns the surface of each label.
    fn surfaces(&self, noise: f64, is_form: bool) -> Result<Vec<Primitive>, LabelsError> {
        let of = |(label, members): (&u32, &Vec<u32>)| {
            let kind = self.given.facts.kinds.get(label).copied();
            let noise = Noise {
                deviation: noise,
                slack: NOISE_SLACK,
                is_form,
            };
            surface(self.cloud, members, kind, noise).ok_or(LabelsError::Undetermined {
                label: *label,
                points: members.len(),
                kind,
            })
        };
        let all = self.names.par_iter().zip(&self.members);
        // The error of the first label, not of the first one to fail.
        let all: Vec<Result<Primitive, LabelsError>> = all.map(of).collect();
        let surfaces: Vec<Primitive> = all.into_iter().collect::<Result<_, _>>()?;
        let labels = (0..surfaces.len()).into_par_iter();
        Ok(labels
            .map(|label| self.turned(&surfaces, label, noise, is_form))
            .collect())
    }

    /// Returns the surface of a label, a cone or a cylinder in place of a sphere of which there is
    /// only a narrow zone about an axis that others have: such zones are chamfers and short bores,
    /// and a cone about a known axis has two parameters of its own, a sphere four.
    fn turned(&self, surfaces: &[Primitive], label: usize, noise: f64, is_form: bool) -> Primitive {
        let sphere = surfaces[label];
        let is_asked = self.given.facts.kinds.contains_key(&self.names[label]);
        if sphere.kind != PrimitiveKind::Sphere || is_asked {
            return sphere;
        }
        let (cloud, members) = (self.cloud, &self.members[label]);
        let points = cloud.at(members);
        let beside: Vec<u32> = members
            .iter()
            .flat_map(|i| cloud.near(*i))
            .copied()
            .collect();
        let known = KnownSurfaces {
            surfaces,
            labels: &self.labels,
        };
        let coaxial = coaxial_cone(&points, &known.axes(&beside)).filter(|cone| {
            // The direction and the place of an axis that is known.
            let saved = 4.0 * (points.len() as f64).ln() / 2.0;
            let more = squares(cone, &points) - squares(&sphere, &points);
            Cost::with_noise(noise).of_squares(more) < saved
        });
        let noise = Noise {
            deviation: noise,
            slack: NOISE_SLACK,
            is_form,
        };
        let directions = directions(surfaces);
        let is_along = |s: &Primitive| {
            directions
                .iter()
                .any(|d| dot(*d, s.axis).abs() > ZONE_COSINE)
        };
        let other =
            coaxial.or_else(|| zone(cloud, &evenly(members), &sphere, noise).filter(is_along));
        let fitted = other.and_then(|other| fit(&other, &points, Precision::Full));
        let is_good = |s: &Primitive| is_determined(s, &points, noise.deviation);
        fitted.map(|f| f.0).filter(is_good).unwrap_or(sphere)
    }
}

/// Returns points with a weight of 1 each.
fn evenly(members: &[u32]) -> MembershipWeights {
    members.iter().map(|i| (*i, 1.0)).collect()
}

/// Returns the surface of given points: of the kind asked for, or of the simplest that explains
/// them as well as any other; `None` if they determine none.
fn surface(
    cloud: &Cloud,
    members: &[u32],
    kind: Option<PrimitiveKind>,
    noise: Noise,
) -> Option<Primitive> {
    let points = cloud.at(members);
    if !is_wide(&points, noise.deviation) {
        return None;
    }
    let found = match kind {
        Some(kind) => {
            let start = guess(cloud, members, kind)?;
            fit(&start, &points, Precision::Full)?.0
        }
        None => {
            let shares = evenly(members);
            // Through as many points as it has parameters a surface always passes.
            let least = |kind: PrimitiveKind| match kind {
                PrimitiveKind::Plane => kind.parameters(),
                _ => kind.parameters() + 1,
            };
            let allowed = AllowedSurfaces {
                least_points: &least,
                is_allowed: &|s| is_determined(s, &points, noise.deviation),
            };
            let simplest = |noise| simplest_kind(cloud, &shares, None, noise, &allowed);
            let within = simplest(noise)?;
            match noise.is_form || is_explained(cloud, members, &within, noise) {
                true => within,
                // Beyond the noise distances are the form of the object, or a mistake: those of
                // neighbours are alike, and small differences are no evidence of a kind.
                false => simplest(Noise {
                    is_form: true,
                    ..noise
                })?,
            }
        }
    };
    let may_be_torus = kind.is_none_or(|kind| kind == PrimitiveKind::Torus);
    let bent = || bent(cloud, members, &points).filter(|s| is_explained(cloud, members, s, noise));
    let found = match may_be_torus && !is_explained(cloud, members, &found, noise) {
        true => bent().unwrap_or(found),
        false => found,
    };
    is_determined(&found, &points, noise.deviation).then_some(found)
}

/// Returns the torus nearest to points of a tube, sought from their cylinder, which is bent more or
/// less in all directions: where there is only a short piece of a tube, normals with noise do not
/// show where its circle is.
fn bent(cloud: &Cloud, members: &[u32], points: &[Point3]) -> Option<Primitive> {
    let some: Vec<u32> = thinned(members.len(), 400).map(|k| members[k]).collect();
    let some = cloud.at(&some);
    let cylinder = guess(cloud, members, PrimitiveKind::Cylinder)?;
    let start = cylinder.about(mean(points));
    let [right, up] = frame(start.axis);
    let turns = (0..TURNS).flat_map(|k| BENDS.map(|bend| (k as f64, bend)));
    let tori = turns.filter_map(|(k, bend)| {
        let (sine, cosine) = (k * TAU / TURNS as f64).sin_cos();
        let inward: Point3 = std::array::from_fn(|i| cosine * right[i] + sine * up[i]);
        let circle = bend * start.size;
        let torus = Primitive {
            kind: PrimitiveKind::Torus,
            place: std::array::from_fn(|i| start.place[i] + circle * inward[i]),
            axis: cross(start.axis, inward),
            size: circle,
            other: start.size,
        };
        fit(&torus, &some, Precision::Rough)
    });
    let best = tori.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(fit(&best.0, points, Precision::Full)?.0)
}

/// Returns true if a surface explains the points of a label.
fn is_explained(cloud: &Cloud, members: &[u32], surface: &Primitive, noise: Noise) -> bool {
    let core = core(cloud, members, surface.kind);
    follows(cloud, [&core, members], surface, noise)
}

/// Returns true if points are not on one line, up to the noise.
fn is_wide(points: &[Point3], noise: f64) -> bool {
    if points.len() < PrimitiveKind::Plane.parameters() {
        return false;
    }
    let (variances, _) = symmetric_eigen_3(&moments(points));
    (variances[1].max(0.0) / points.len() as f64).sqrt() > MIN_WIDTH_DEVIATIONS * noise
}

/// Returns true if points with this noise, or with more if they are farther off, determine a
/// surface: two standard deviations of a direction are less than a radian, of a size less than
/// itself.
fn is_determined(surface: &Primitive, points: &[Point3], noise: f64) -> bool {
    let surface = surface.about(mean(points));
    let Some(covariance) = covariance(&surface, points) else {
        return false;
    };
    let free = degrees_of_freedom(&surface, points.len());
    let noise = noise.max((squares(&surface, points) / free).sqrt());
    let is_within =
        |(k, most): (usize, f64)| 2.0 * noise * covariance[k][k].max(0.0).sqrt() < most.abs();
    let directions = match surface.kind {
        PrimitiveKind::Sphere => 0..0,
        _ => 0..2,
    };
    let directions = directions.map(|k| (k, 1.0));
    directions.chain(surface.sizes()).all(is_within)
}
