//! Real objects whose form deviates from its surfaces by more than the noise of the points: how
//! much of that is allowed.
//!
//! Within the noise such an object consists of many pieces, bent by a little each, and of points
//! that nothing follows. Wider tolerances are tried then, and the shortest description is taken:
//! that of the distances of points from their surfaces, of the surfaces, and of the points without
//! one (J. Rissanen 1978).

use crate::chart::{Kind, Surface};
use crate::choose::least_points;
use crate::cloud::Cloud;
use crate::fit::{covariance, squares};
use crate::segment::{Allowed, EVIDENCE, Limits, NONE, Segmentation};
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;

/// The share of points that has to be told by entities of known size, else wider tolerances are
/// tried. Parts made to their drawings have 90 % and more; with less asked for, cans pass whose
/// side is a dozen tori.
const TOLD: f64 = 2.0 / 3.0;
/// The share that planes, spheres, cylinders and cones of known size have to tell within a
/// tolerance of form. Tori do not count: a few of them follow any smooth body within a hundredth of
/// its size, an ellipsoid for one.
const TOLD_BY_FORM: f64 = 0.5;
/// A size is known where its deviation is below this share of it. Pieces of a flat face that is
/// bent by a little are parts of large cylinders, known to 3 to 50 %; small fillets are, too, but
/// have few points.
const KNOWN: f64 = 0.03;
/// Doublings of the noise that are tried at most: 2⁵ times the noise of a scanner of today is a
/// hundredth of the size.
const DOUBLINGS: i32 = 5;
/// The largest tolerance of form, in diagonals. Noise of half a per cent hides small faces, and
/// twice that takes whole parts for one plane.
const WIDEST: f64 = 0.0075;
/// What a point may cost more where fewer surfaces describe all: surfaces more have to bring the
/// root mean square down by a quarter, exp(-0.3). Distances of a form are alike for neighbours, and
/// a sum over points takes them for more evidence than they are: without this a ball is five.
const FEWER: f64 = 0.3;
/// How many entities within the noise may take the place of one within a tolerance of form, and the
/// share of its points that they tell at least. Bent faces fall into more, which leave more out.
const EXACT_PIECES: (usize, f64) = (3, 0.9);

/// What is found within the noise that the points show, or within the tolerance of form that
/// describes them best.
///
/// Tolerances of form are tried as soon as the first round within the noise tells little: what else
/// it finds are more small pieces, and that takes most of the time.
pub(crate) fn within_noise_or_form(
    cloud: &Cloud,
    min_points: usize,
    control: &Control<'_>,
) -> Result<Segmentation, Stopped> {
    let limits = Limits {
        min_points,
        allowed: Allowed::Shown,
    };
    let first = Segmentation::begin(cloud, limits, control)?;
    let told_first = told(cloud, &first);
    if share(cloud, &told_first) >= TOLD {
        return first.finished(cloud, limits, control);
    }
    let mut tried = Tried {
        cloud,
        all: vec![(length(cloud, &told_first), first)],
    };
    tried.try_forms(min_points, control)?;
    let best = tried.best();
    let (_, mut taken) = tried.all.swap_remove(best);
    if best > 0 {
        restore(cloud, &mut taken, &tried.all[0].1);
        return Ok(taken);
    }
    // No form describes the points better so far.
    let found = taken.finished(cloud, limits, control)?;
    let told = told(cloud, &found);
    if share(cloud, &told) >= TOLD {
        return Ok(found);
    }
    tried.all.push((length(cloud, &told), found));
    let best = tried.best();
    Ok(tried.all.swap_remove(best).1)
}

/// Gives the points of an entity back to those that follow them within the noise, where few of
/// these tell nearly all of them. One tolerance serves a whole scan, and another object in it may
/// have asked for that.
fn restore(cloud: &Cloud, taken: &mut Segmentation, exact: &Segmentation) {
    let members = exact.members();
    let is_told: Vec<bool> = (exact.surfaces.iter().zip(&members))
        .map(|(surface, of)| surface.kind != Kind::Torus && is_known(cloud, surface, of))
        .collect();
    for (label, of) in taken.members().into_iter().enumerate() {
        let mut pieces: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for i in &of {
            let own = exact.labels[*i as usize];
            if own != NONE && is_told[own as usize] {
                pieces.entry(own).or_default().push(*i);
            }
        }
        let surface = |own: &u32| exact.surfaces[*own as usize];
        let least = |own: &u32| least_points(surface(own).kind, exact.noise);
        pieces.retain(|own, points| points.len() >= least(own));
        let told: usize = pieces.values().map(Vec::len).sum();
        let size = of.len() as f64;
        if !(1..=EXACT_PIECES.0).contains(&pieces.len()) || (told as f64) < EXACT_PIECES.1 * size {
            continue;
        }
        let one = length_of(cloud, &taken.surfaces[label], &of);
        let pieces = || pieces.iter().map(|(own, points)| (surface(own), points));
        let many: f64 = pieces()
            .map(|(s, points)| length_of(cloud, &s, points))
            .sum();
        if many + FEWER * size < one {
            of.iter().for_each(|i| taken.labels[*i as usize] = NONE);
            for (k, (surface, points)) in pieces().enumerate() {
                let new = if k == 0 { label } else { taken.surfaces.len() };
                match taken.surfaces.get_mut(new) {
                    Some(old) => *old = surface,
                    None => taken.surfaces.push(surface),
                }
                points
                    .iter()
                    .for_each(|i| taken.labels[*i as usize] = new as u32);
            }
        }
    }
}

/// What was found of a cloud, each with the length of its description.
struct Tried<'a> {
    cloud: &'a Cloud,
    all: Vec<(f64, Segmentation)>,
}

impl Tried<'_> {
    /// Adds what is found within tolerances of form, until narrower ones describe the points no
    /// better.
    fn try_forms(&mut self, min_points: usize, control: &Control<'_>) -> Result<(), Stopped> {
        let noise = self.all[0].1.noise;
        // Wide ones first: they take the least time, and where they are good narrow ones need none.
        let tolerances = (1..=DOUBLINGS).rev().map(|k| noise * 2.0_f64.powi(k));
        for tolerance in tolerances.filter(|t| *t <= WIDEST) {
            let limits = Limits {
                min_points,
                allowed: Allowed::Form(tolerance),
            };
            let first = Segmentation::begin(self.cloud, limits, control)?;
            // Further rounds shorten a description by some per cent; this one is not worth them.
            let is_longer = |length: f64| length > self.most();
            if self.all.len() > 1 && self.describe(&first).is_some_and(is_longer) {
                break;
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

    /// The length of a description within a tolerance of form; `None` if it tells too little.
    fn describe(&self, found: &Segmentation) -> Option<f64> {
        let mut told = told(self.cloud, found);
        told.retain(|(surface, _)| surface.kind != Kind::Torus);
        let is_told = share(self.cloud, &told) >= TOLD_BY_FORM;
        is_told.then(|| length(self.cloud, &told))
    }

    /// How long a description may be that has fewer surfaces than the shortest.
    fn most(&self) -> f64 {
        let shortest = self.all.iter().map(|t| t.0).fold(f64::INFINITY, f64::min);
        shortest + FEWER * self.cloud.points.len() as f64
    }

    /// Which has the fewest surfaces, of those whose description is nearly the shortest; the last of
    /// several such.
    fn best(&self) -> usize {
        let most = self.most();
        let good = (0..self.all.len()).rev().filter(|k| self.all[*k].0 <= most);
        good.min_by_key(|k| self.all[*k].1.surfaces.len())
            .unwrap_or(0)
    }
}

/// The share of the points that entities have.
fn share(cloud: &Cloud, told: &[(Surface, Vec<u32>)]) -> f64 {
    let count: usize = told.iter().map(|(_, points)| points.len()).sum();
    count as f64 / cloud.points.len() as f64
}

/// The entities whose size is known, with their points.
fn told(cloud: &Cloud, found: &Segmentation) -> Vec<(Surface, Vec<u32>)> {
    let members = found.members().into_iter();
    let each = found.surfaces.iter().copied().zip(members);
    each.filter(|(surface, points)| is_known(cloud, surface, points))
        .collect()
}

/// Whether points tell the size of their surface.
fn is_known(cloud: &Cloud, surface: &Surface, members: &[u32]) -> bool {
    // The numbers of the sizes among the minimal parameters, with their values.
    let sizes: &[(usize, f64)] = match surface.kind {
        Kind::Plane => return true,
        Kind::Sphere => &[(3, surface.size)],
        Kind::Cylinder => &[(4, surface.size)],
        Kind::Cone => &[(5, surface.other)],
        Kind::Torus => &[(5, surface.size), (6, surface.other)],
    };
    let points = cloud.at(members);
    let free = points
        .len()
        .saturating_sub(surface.kind.parameters())
        .max(1) as f64;
    let variance = squares(surface, &points) / free;
    covariance(surface, &points).is_some_and(|c| {
        let is_known =
            |(k, size): &(usize, f64)| (variance * c[*k][*k]).sqrt() <= KNOWN * size.abs();
        sizes.iter().all(is_known)
    })
}

/// The length of a description in natural units, less what all descriptions have in common.
fn length(cloud: &Cloud, told: &[(Surface, Vec<u32>)]) -> f64 {
    let entities = told.iter();
    entities
        .map(|(s, members)| length_of(cloud, s, members))
        .sum()
}

/// What an entity adds to it.
fn length_of(cloud: &Cloud, surface: &Surface, members: &[u32]) -> f64 {
    let n = members.len().max(1) as f64;
    let variance = squares(surface, &cloud.at(members)) / n;
    // A point without a surface costs the logarithm of the diagonal, which is 1.
    0.5 * n * variance.max(f64::MIN_POSITIVE).ln()
        + 0.5 * surface.kind.parameters() as f64 * n.ln()
        + EVIDENCE
}
