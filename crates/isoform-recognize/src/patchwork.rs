//! Patches of a free-form surface: entities that meet others without an edge where none was
//! designed.

use crate::accuracy::uncertain_surface;
use crate::blends::{MIN_BORDER_PAIRS, blends};
use crate::chart::{Primitive, PrimitiveKind};
use crate::cloud::Cloud;
use crate::fit::squares;
use crate::kinds::guess;
use crate::relations::UncertainSurface;
use crate::segment::Segmentation;
use isoform_geom::{Point3, dot};
use std::collections::BTreeMap;

/// Returns for each entity whether it is a patch: true if it meets another one smoothly although a
/// plane, sphere, cylinder or cone follows both within this tolerance, which a designer would have
/// used.
pub(crate) fn patches(cloud: &Cloud, found: &Segmentation, tolerance: f64) -> Vec<bool> {
    let members = found.members();
    let mut is_patch = vec![false; members.len()];
    let blends = blends_of(cloud, found, &members);
    for ((a, b), border) in borders(cloud, found) {
        let pair = [a as usize, b as usize];
        let is_new = pair.iter().any(|k| !is_patch[*k]);
        // Patches that follow a bent form within a tolerance meet at 10° at most, and 15° are
        // allowed.
        if is_new && meet_smoothly(found, &members, &blends, pair, &border, 0.966) {
            let both = [&members[pair[0]][..], &members[pair[1]]].concat();
            if is_simple(cloud, &both, tolerance) {
                pair.iter().for_each(|k| is_patch[*k] = true);
            }
        }
    }
    is_patch
}

/// Returns the share of the points on surfaces that meet others smoothly in combinations that
/// designed parts do not have, such as a sphere and a sphere. On a free form these are most points.
pub(crate) fn free_share(cloud: &Cloud, found: &Segmentation) -> f64 {
    let members = found.members();
    let mut is_free = vec![false; members.len()];
    let blends = blends_of(cloud, found, &members);
    for ((a, b), border) in borders(cloud, found) {
        let pair = [a as usize, b as usize];
        let [one, two] = pair.map(|k| found.surfaces[k].kind);
        let is_usual = are_rounded(one, two) || [one, two].contains(&PrimitiveKind::Cone);
        // Tapers of parts meet cylinders at 10 to 15°: a free form is reported below 8°.
        if !is_usual && meet_smoothly(found, &members, &blends, pair, &border, 0.99) {
            pair.iter().for_each(|k| is_free[*k] = true);
        }
    }
    let free = is_free
        .iter()
        .zip(&members)
        .filter(|(is_free, _)| **is_free);
    free.map(|(_, of)| of.len() as f64).sum::<f64>() / cloud.points.len().max(1) as f64
}

/// Returns true if two entities meet along a border at an angle whose cosine is at least `smooth`,
/// without a step, and neither is a round of the other. Planes meet at folds, however flat these
/// are.
fn meet_smoothly(
    found: &Segmentation,
    members: &[Vec<u32>],
    is_blend: &[bool],
    pair: [usize; 2],
    border: &BorderSums,
    smooth: f64,
) -> bool {
    let [one, two] = pair.map(|k| found.surfaces[k].kind);
    let counts = pair.map(|k| members[k].len() as f64);
    let (large, small) = (counts[0].max(counts[1]), counts[0].min(counts[1]));
    let is_small = small <= 0.5 * large || pair.iter().any(|k| is_blend[*k]);
    let is_round = is_small && are_rounded(one, two);
    border.cosines >= smooth * border.pairs
        && border.gaps <= 5.0 * found.noise * border.pairs
        && border.pairs >= 2.0 * small.sqrt()
        && !is_round
        && (one, two) != (PrimitiveKind::Plane, PrimitiveKind::Plane)
}

/// Returns for each entity whether it is a blend: surfaces that touch two others exactly are
/// designed.
fn blends_of(cloud: &Cloud, found: &Segmentation, members: &[Vec<u32>]) -> Vec<bool> {
    let known: Vec<UncertainSurface> = (members.iter().enumerate())
        .map(|(label, of)| uncertain_surface(cloud, found, of, label))
        .collect();
    let points: Vec<Vec<Point3>> = members.iter().map(|of| cloud.at(of)).collect();
    let mut is_blend = vec![false; members.len()];
    let pairs = (found.neighbours(cloud), MIN_BORDER_PAIRS);
    for blend in blends(&known, &points, pairs, 1.0) {
        is_blend[blend.entity] = true;
    }
    is_blend
}

/// Returns true if a plane, sphere, cylinder or cone follows points within a tolerance.
pub(crate) fn is_simple(cloud: &Cloud, points: &[u32], tolerance: f64) -> bool {
    let at = cloud.at(points);
    let most = tolerance * tolerance * points.len() as f64;
    let follows = |s: Primitive| squares(&s, &at) <= most;
    let simple = PrimitiveKind::Torus.simpler().iter();
    simple
        .filter_map(|kind| guess(cloud, points, *kind))
        .any(follows)
}

/// The common border of two entities.
#[derive(Default)]
struct BorderSums {
    /// Number of pairs of neighbours across it.
    pairs: f64,
    /// Sum of the |cosine| between the normals there.
    cosines: f64,
    /// Sum of the distances between the surfaces.
    gaps: f64,
}

/// Returns the borders of entities, by their indices.
fn borders(cloud: &Cloud, found: &Segmentation) -> BTreeMap<(u32, u32), BorderSums> {
    let mut borders: BTreeMap<(u32, u32), BorderSums> = BTreeMap::new();
    let surface = |label: u32| found.surfaces.get(label as usize);
    for (i, own) in found.labels.iter().enumerate() {
        for j in cloud.near(i as u32) {
            let other = found.labels[*j as usize];
            let (Some(one), Some(two)) = (surface(*own), surface(other)) else {
                continue;
            };
            if *own == other {
                continue;
            }
            let (p, q) = (cloud.points[i], cloud.points[*j as usize]);
            let middle = std::array::from_fn(|k| (p[k] + q[k]) / 2.0);
            let cosine = dot(one.normal(middle), two.normal(middle)).abs();
            let border = borders.entry((*own.min(&other), *own.max(&other)));
            let border = border.or_default();
            border.pairs += 1.0;
            border.cosines += cosine;
            border.gaps += gap(one, two, middle);
        }
    }
    borders
}

/// Returns the distance at a point between two surfaces whose normals are nearly parallel there.
fn gap(one: &Primitive, two: &Primitive, p: Point3) -> f64 {
    let side = dot(one.normal(p), two.normal(p)).signum();
    (one.distance(p) - side * two.distance(p)).abs()
}

/// Returns true if surfaces of these kinds meet smoothly on designed parts: one rounds an edge of
/// the other or ends it, such as the torus at the foot of a cylinder.
fn are_rounded(one: PrimitiveKind, two: PrimitiveKind) -> bool {
    use PrimitiveKind::{Cone, Cylinder, Plane, Sphere, Torus};
    matches!(
        (one.min(two), one.max(two)),
        (Plane, Cylinder | Torus) | (Sphere, Cylinder | Cone | Torus) | (Cylinder | Cone, Torus)
    )
}
