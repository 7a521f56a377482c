//! Patches of a free-form surface: entities that meet others without an edge where none was
//! designed.

use crate::blends::{PAIRS, blends};
use crate::chart::{Kind, Surface};
use crate::cloud::Cloud;
use crate::fit::squares;
use crate::kinds::guess;
use crate::recognize::known;
use crate::relations::Known;
use crate::segment::Segmentation;
use isoform_geom::{Point3, dot};
use std::collections::BTreeMap;

/// The cosine of the angle below which two surfaces meet without an edge: 15°. Patches that follow
/// a bent form within a tolerance meet at 10° at most.
const SMOOTH: f64 = 0.966;
/// That cosine where a free form is told of: 8°, since tapers of parts meet cylinders at 10 to 15°.
const FREE: f64 = 0.99;
/// Pairs of neighbours across a border for it to count, in square roots of the points of the
/// smaller entity: a border all round it has about 16.
const BORDER: f64 = 2.0;
/// The largest mean distance between two surfaces at their border, in deviations of the noise:
/// patches meet within 3, with more there is a step.
const STEP: f64 = 5.0;
/// Maximum number of points of a round, as a share of those of the adjacent face.
const ROUND: f64 = 0.5;

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
        if is_new && meet_smoothly(found, &members, &blends, pair, &border, SMOOTH) {
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
        let is_usual = are_rounded(one, two) || [one, two].contains(&Kind::Cone);
        if !is_usual && meet_smoothly(found, &members, &blends, pair, &border, FREE) {
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
    border: &Border,
    smooth: f64,
) -> bool {
    let [one, two] = pair.map(|k| found.surfaces[k].kind);
    let counts = pair.map(|k| members[k].len() as f64);
    let (large, small) = (counts[0].max(counts[1]), counts[0].min(counts[1]));
    let is_small = small <= ROUND * large || pair.iter().any(|k| is_blend[*k]);
    let is_round = is_small && are_rounded(one, two);
    border.cosines >= smooth * border.pairs
        && border.gaps <= STEP * found.noise * border.pairs
        && border.pairs >= BORDER * small.sqrt()
        && !is_round
        && (one, two) != (Kind::Plane, Kind::Plane)
}

/// Returns for each entity whether it is a blend: surfaces that touch two others exactly are
/// designed.
fn blends_of(cloud: &Cloud, found: &Segmentation, members: &[Vec<u32>]) -> Vec<bool> {
    let known: Vec<Known> = (members.iter().enumerate())
        .map(|(label, of)| known(cloud, found, of, label))
        .collect();
    let points: Vec<Vec<Point3>> = members.iter().map(|of| cloud.at(of)).collect();
    let mut is_blend = vec![false; members.len()];
    let pairs = (found.neighbours(cloud), PAIRS);
    for blend in blends(&known, &points, pairs, 1.0) {
        is_blend[blend.entity] = true;
    }
    is_blend
}

/// Returns true if a plane, sphere, cylinder or cone follows points within a tolerance.
pub(crate) fn is_simple(cloud: &Cloud, points: &[u32], tolerance: f64) -> bool {
    let at = cloud.at(points);
    let most = tolerance * tolerance * points.len() as f64;
    let follows = |s: Surface| squares(&s, &at) <= most;
    let simple = Kind::Torus.simpler().iter();
    simple
        .filter_map(|kind| guess(cloud, points, *kind))
        .any(follows)
}

/// The common border of two entities.
#[derive(Default)]
struct Border {
    /// Number of pairs of neighbours across it.
    pairs: f64,
    /// Sum of the |cosine| between the normals there.
    cosines: f64,
    /// Sum of the distances between the surfaces.
    gaps: f64,
}

/// Returns the borders of entities, by their indices.
fn borders(cloud: &Cloud, found: &Segmentation) -> BTreeMap<(u32, u32), Border> {
    let mut borders: BTreeMap<(u32, u32), Border> = BTreeMap::new();
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
fn gap(one: &Surface, two: &Surface, p: Point3) -> f64 {
    let side = dot(one.normal(p), two.normal(p)).signum();
    (one.distance(p) - side * two.distance(p)).abs()
}

/// Returns true if surfaces of these kinds meet smoothly on designed parts: one rounds an edge of
/// the other or ends it, such as the torus at the foot of a cylinder.
fn are_rounded(one: Kind, two: Kind) -> bool {
    use Kind::{Cone, Cylinder, Plane, Sphere, Torus};
    matches!(
        (one.min(two), one.max(two)),
        (Plane, Cylinder | Torus) | (Sphere, Cylinder | Cone | Torus) | (Cylinder | Cone, Torus)
    )
}
