//! Tolerance of form: real objects deviate from their ideal surfaces by more than the noise of the
//! points, and a tolerance for that is chosen here.
//!
//! Within the noise such an object consists of many pieces of slightly different curvature, and of
//! points that no surface follows. Wider tolerances are then tried, and the one with the shortest
//! description is taken: that of the distances of points from their surfaces, of the surfaces, and
//! of the points without one (J. Rissanen 1978).

use crate::chart::{Primitive, PrimitiveKind};
use crate::choose::least_points;
use crate::cloud::Cloud;
use crate::fit::{Precision, covariance, fit, squares};
use crate::labels::UNLABELLED;
use crate::patchwork::{is_simple, patches};
use crate::segment::{DistanceTolerance, Limits, MIN_EVIDENCE, Segmentation};
use crate::start::plane;
use crate::whole::share_of_place;
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;

/// Minimum share of the points on entities of known size; with less, wider tolerances are tried.
/// Parts made to their drawings have 90 % and more; with a lower limit, cans pass whose side is a
/// dozen tori.
pub(crate) const MIN_KNOWN_SHARE: f64 = 2.0 / 3.0;
/// Minimum share of the points on planes, spheres, cylinders and cones of known size within a
/// tolerance of form. Tori do not count: a few of them follow any smooth body, such as an
/// ellipsoid, within a hundredth of its size.
const MIN_KNOWN_SHARE_WITHIN_FORM: f64 = 0.5;
/// Maximum standard deviation of a known size, relative to it. Pieces of a flat face that is
/// slightly bent are parts of large cylinders, known to 3 to 50 %; small fillets are, too, but have
/// few points.
const MAX_SIZE_UNCERTAINTY: f64 = 0.03;
/// Minimum tolerance of form, in standard deviations of the noise.
const MIN_FORM_DEVIATIONS: f64 = 2.0;
/// Maximum tolerance of form, in diagonals. Noise of half a per cent hides small faces, and twice
/// that takes whole parts for one plane.
pub(crate) const MAX_FORM_TOLERANCE: f64 = 0.0075;
/// Increase of the description length per point, in nats, that fewer surfaces justify: additional
/// surfaces have to reduce the root mean square by a quarter, exp(−0.3). Deviations of form are
/// correlated between neighbours, and a sum over points overrates them as evidence: without this
/// constant a ball becomes five surfaces.
const NATS_PER_POINT_FOR_FEWER: f64 = 0.3;
/// Minimum share of the squared distances beyond the noise that is a function of the position: it
/// is near 0 where a wide tolerance takes both faces of a plate for one, and near 1 on bent faces.
const MIN_SHARE_OF_PLACE: f64 = 0.5;
/// Maximum number of patches within the noise that may replace an entity within a tolerance of
/// form, and the minimum share of its points that these and other surfaces explain. Curved faces
/// fall into more patches, which leave more points out.
const EXACT_PATCH_LIMITS: (usize, f64) = (3, 0.9);

/// Segments a cloud within the noise that the points show, or within the tolerance of form that
/// describes them best.
///
/// Tolerances of form are tried as soon as the first round within the noise explains too few
/// points: further rounds would add more small pieces, and take most of the time.
pub(crate) fn within_noise_or_form(
    cloud: &Cloud,
    min_points: usize,
    control: &Control<'_>,
) -> Result<Segmentation, Stopped> {
    let limits = Limits {
        min_points,
        allowed: DistanceTolerance::Shown,
    };
    if let Some(found) = Segmentation::whole(cloud) {
        return match found.surfaces.len() {
            1 => Ok(found),
            _ => found.finished(cloud, limits, control),
        };
    }
    let mut first = Segmentation::begin(cloud, limits, control)?;
    let mut dissolved = first.clone();
    dissolved.dissolve(cloud);
    let mut known_first = known_entities(cloud, &dissolved);
    if share(cloud, &known_first) < MIN_KNOWN_SHARE {
        first.sweep(cloud, limits, control)?;
        known_first = known_entities(cloud, &first);
    }
    if share(cloud, &known_first) >= MIN_KNOWN_SHARE {
        return first.finished(cloud, limits, control);
    }
    let mut tried = ToleranceSearch {
        cloud,
        all: vec![(length(cloud, &known_first), first)],
    };
    tried.try_one();
    tried.try_forms(min_points, control)?;
    let best = tried.best();
    let (_, mut taken) = tried.all.swap_remove(best);
    if best > 0 {
        let (_, first) = tried.all.swap_remove(0);
        return match restore(cloud, &mut taken, &first) {
            true => Ok(taken),
            false => first.finished(cloud, limits, control),
        };
    }
    // No tolerance of form describes the points better so far.
    let found = taken.finished(cloud, limits, control)?;
    let known = known_entities(cloud, &found);
    if share(cloud, &known) >= MIN_KNOWN_SHARE {
        return Ok(found);
    }
    tried.all.push((length(cloud, &known), found));
    let best = tried.best();
    let (_, mut taken) = tried.all.swap_remove(best);
    // `swap_remove` moved the last item to the place of the best, if that was not the last itself.
    let exact = tried.all.into_iter().nth(best).filter(|_| taken.is_form);
    Ok(match exact {
        Some((_, exact)) if !restore(cloud, &mut taken, &exact) => exact,
        _ => taken,
    })
}

/// Returns points of an entity to surfaces that they follow within the noise, if few of these
/// explain nearly all of a connected part of it. One tolerance serves a whole scan, and another
/// object in it may have required it. Returns true if any entity of form remains.
fn restore(cloud: &Cloud, taken: &mut Segmentation, exact: &Segmentation) -> bool {
    let members = exact.members();
    let has_known_size: Vec<bool> = (exact.surfaces.iter().zip(&members))
        .map(|(surface, of)| surface.kind != PrimitiveKind::Torus && is_known(cloud, surface, of))
        .collect();
    let is_patch = patches(cloud, exact, MAX_FORM_TOLERANCE);
    let of_form = taken.surfaces.len() as u32;
    for label in 0..of_form {
        let mut is_changed = false;
        for part in cloud.connected(&taken.members_of(label as usize)) {
            let Some(pieces) = exact_pieces(exact, [&has_known_size, &is_patch], &part) else {
                continue;
            };
            let one = length_of(cloud, &taken.surfaces[label as usize], &part);
            let pieces = || {
                pieces
                    .iter()
                    .map(|(s, points)| (&exact.surfaces[*s as usize], points))
            };
            let many: f64 = pieces()
                .map(|(s, points)| length_of(cloud, s, points))
                .sum();
            if many + NATS_PER_POINT_FOR_FEWER * part.len() as f64 >= one {
                continue;
            }
            is_changed = true;
            part.iter()
                .for_each(|i| taken.labels[*i as usize] = UNLABELLED);
            for (surface, points) in pieces() {
                let new = taken.surfaces.len() as u32;
                taken.surfaces.push(*surface);
                points.iter().for_each(|i| taken.labels[*i as usize] = new);
            }
        }
        if is_changed {
            fit_again(cloud, taken, label);
        }
    }
    let is_form = taken.labels.iter().any(|label| *label < of_form);
    taken.drop_empty();
    is_form
}

/// Fits a surface to its remaining points; without enough of them these lose it.
fn fit_again(cloud: &Cloud, taken: &mut Segmentation, label: u32) {
    let left: Vec<u32> = (0..taken.labels.len() as u32)
        .filter(|i| taken.labels[*i as usize] == label)
        .collect();
    let surface = &mut taken.surfaces[label as usize];
    let is_enough = left.len() >= least_points(surface.kind, taken.noise);
    match fit(surface, &cloud.at(&left), Precision::Full).filter(|_| is_enough) {
        Some((fitted, _)) => *surface = fitted,
        None => left
            .iter()
            .for_each(|i| taken.labels[*i as usize] = UNLABELLED),
    }
}

/// Returns the surfaces within the noise that explain nearly all of some points, each with its
/// points; `None` if too many patches are needed.
fn exact_pieces(
    exact: &Segmentation,
    [has_known_size, is_patch]: [&[bool]; 2],
    part: &[u32],
) -> Option<BTreeMap<u32, Vec<u32>>> {
    let mut pieces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for i in part {
        let own = exact.labels[*i as usize];
        if own != UNLABELLED && has_known_size[own as usize] {
            pieces.entry(own).or_default().push(*i);
        }
    }
    let least = |own: &u32| least_points(exact.surfaces[*own as usize].kind, exact.noise);
    pieces.retain(|own, points| points.len() >= least(own));
    let known: usize = pieces.values().map(Vec::len).sum();
    let is_most = known as f64 >= EXACT_PATCH_LIMITS.1 * part.len() as f64;
    let few = pieces.keys().filter(|own| is_patch[**own as usize]).count() <= EXACT_PATCH_LIMITS.0;
    (is_most && few).then_some(pieces)
}

/// Segmentations of a cloud, each with its description length.
struct ToleranceSearch<'a> {
    cloud: &'a Cloud,
    all: Vec<(f64, Segmentation)>,
}

impl ToleranceSearch<'_> {
    /// Adds one surface of all points, if they are off it by no more than a tolerance of form.
    fn try_one(&mut self) {
        let one = Segmentation::one(self.cloud, true).filter(|one| one.noise <= MAX_FORM_TOLERANCE);
        if let Some(one) = one {
            let all: Vec<u32> = (0..self.cloud.points.len() as u32).collect();
            let (surface, noise) = (one.surfaces[0], self.all[0].1.noise);
            if is_one_sheet(self.cloud, &surface, &all, noise) {
                self.all.push((length_of(self.cloud, &surface, &all), one));
            }
        }
    }

    /// Adds segmentations within tolerances of form, until narrower ones describe the points no
    /// better.
    fn try_forms(&mut self, min_points: usize, control: &Control<'_>) -> Result<(), Stopped> {
        let noise = self.all[0].1.noise;
        // Wide tolerances first: they take the least time, and if they fit well narrow ones are not
        // needed.
        // Each tolerance is half of the one before.
        let tolerances = (0..6).map(|k| MAX_FORM_TOLERANCE / 2.0_f64.powi(k));
        let mut in_vain = 0;
        for tolerance in tolerances.filter(|t| *t >= MIN_FORM_DEVIATIONS * noise) {
            let limits = Limits {
                min_points,
                allowed: DistanceTolerance::Form(tolerance),
            };
            let first = Segmentation::begin(self.cloud, limits, control)?;
            if self.all.len() > 1 {
                match self.describe(&first) {
                    // Further rounds shorten the description by only a few per cent.
                    Some(length) if length > self.max_length() => break,
                    // More surfaces that explain too few points are pieces; further rounds find
                    // more of them.
                    None if first.surfaces.len() > self.all[self.best()].1.surfaces.len() => {
                        in_vain += 1;
                        if in_vain == 2 {
                            break;
                        }
                        continue;
                    }
                    _ => in_vain = 0,
                }
            }
            let next = first.finished(self.cloud, limits, control)?;
            let Some(length) = self.describe(&next) else {
                continue;
            };
            self.all.push((length, next));
            if (1..self.all.len() - 1).contains(&self.best()) {
                break;
            }
        }
        Ok(())
    }

    /// Returns the description length within a tolerance of form; `None` if too few points are
    /// explained.
    fn describe(&self, found: &Segmentation) -> Option<f64> {
        let mut known = known_entities(self.cloud, found);
        let noise = self.all[0].1.noise;
        known.retain(|(surface, points)| {
            is_one_sheet(self.cloud, surface, points, noise)
                && match surface.kind {
                    PrimitiveKind::Plane => true,
                    PrimitiveKind::Torus => false,
                    _ => !is_flat(self.cloud, points),
                }
        });
        let is_enough = share(self.cloud, &known) >= MIN_KNOWN_SHARE_WITHIN_FORM;
        is_enough.then(|| length(self.cloud, &known))
    }

    /// Returns the maximum description length at which a segmentation with fewer surfaces is
    /// preferred to the shortest one.
    fn max_length(&self) -> f64 {
        let shortest = self.all.iter().map(|t| t.0).fold(f64::INFINITY, f64::min);
        shortest + NATS_PER_POINT_FOR_FEWER * self.cloud.points.len() as f64
    }

    /// Returns the index of the segmentation with the fewest surfaces among those whose description
    /// is nearly the shortest; the last of several such.
    fn best(&self) -> usize {
        let most = self.max_length();
        let good = (0..self.all.len()).rev().filter(|k| self.all[*k].0 <= most);
        good.min_by_key(|k| self.all[*k].1.surfaces.len())
            .unwrap_or(0)
    }
}

/// Returns true if points lie within a tolerance of form of a plane: their curvature is then a
/// deviation of form.
fn is_flat(cloud: &Cloud, points: &[u32]) -> bool {
    let at = cloud.at(points);
    squares(&plane(&at), &at) <= MAX_FORM_TOLERANCE * MAX_FORM_TOLERANCE * points.len() as f64
}

/// Returns true if points lie on one sheet: deviations of form depend on the position, whereas
/// distances on both faces of a plate do not.
fn is_one_sheet(cloud: &Cloud, surface: &Primitive, points: &[u32], noise: f64) -> bool {
    let points = cloud.at(points);
    let variance = squares(surface, &points) / points.len().max(1) as f64;
    variance <= (MIN_FORM_DEVIATIONS * noise).powi(2)
        || share_of_place(surface, &points) >= MIN_SHARE_OF_PLACE
}

/// Returns the share of the points that belong to entities.
fn share(cloud: &Cloud, known: &[(Primitive, Vec<u32>)]) -> f64 {
    let count: usize = known.iter().map(|(_, points)| points.len()).sum();
    count as f64 / cloud.points.len() as f64
}

/// Returns the entities of known size that are not patches, with their points.
fn known_entities(cloud: &Cloud, found: &Segmentation) -> Vec<(Primitive, Vec<u32>)> {
    // Exact points that one surface explains are not a piece of another form.
    let patches = match cloud.is_exact(found.noise) {
        true => vec![false; found.surfaces.len()],
        false => patches(cloud, found, MAX_FORM_TOLERANCE),
    };
    let members = found.members().into_iter().zip(patches);
    let each = found.surfaces.iter().copied().zip(members);
    each.filter(|(surface, (points, is_patch))| {
        let is_bent =
            || surface.kind == PrimitiveKind::Torus && is_simple(cloud, points, MAX_FORM_TOLERANCE);
        !is_patch && is_known(cloud, surface, points) && !is_bent()
    })
    .map(|(surface, (points, _))| (surface, points))
    .collect()
}

/// Returns true if the points of a surface determine its size.
fn is_known(cloud: &Cloud, surface: &Primitive, members: &[u32]) -> bool {
    let sizes = surface.sizes();
    if sizes.is_empty() {
        return true;
    }
    let points = cloud.at(members);
    let free = points
        .len()
        .saturating_sub(surface.kind.parameters())
        .max(1) as f64;
    let variance = squares(surface, &points) / free;
    covariance(surface, &points).is_some_and(|c| {
        let is_known = |(k, size): &(usize, f64)| {
            (variance * c[*k][*k]).sqrt() <= MAX_SIZE_UNCERTAINTY * size.abs()
        };
        sizes.iter().all(is_known)
    })
}

/// Returns the description length in nats, less the terms common to all descriptions.
fn length(cloud: &Cloud, known: &[(Primitive, Vec<u32>)]) -> f64 {
    let entities = known.iter();
    entities
        .map(|(s, members)| length_of(cloud, s, members))
        .sum()
}

/// Returns the contribution of an entity to the description length.
fn length_of(cloud: &Cloud, surface: &Primitive, members: &[u32]) -> f64 {
    let n = members.len().max(1) as f64;
    let variance = squares(surface, &cloud.at(members)) / n;
    // A point without a surface costs the logarithm of the diagonal, which is 1.
    0.5 * n * variance.max(f64::MIN_POSITIVE).ln()
        + 0.5 * surface.kind.parameters() as f64 * n.ln()
        + MIN_EVIDENCE
}
