//! Samples of the solid, and the sides of the half spaces on which they lie: samples on both sides
//! of the points, and samples throughout the box classified by the generalised winding number of
//! the oriented points.

use super::half::HalfSpace;
use super::solid::Bits;
use super::winding::DipoleTree;
use crate::cloud::thinned;
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, KdTree, Point3, dot, norm};
use isoform_num::Random;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Distance of the samples on both sides of a point from its surface, in diagonals and in
/// deviations of the noise.
const SAMPLE_DISTANCE: (f64, f64) = (1e-3, 2.0);
/// Number of neighbours whose distance determines the area of a point.
const AREA_NEIGHBOURS: usize = 8;

/// A sample of space whose side of the solid is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct SideSample {
    pub(super) at: Point3,
    pub(super) is_inside: bool,
    pub(super) weight: f64,
}

/// Points with outward unit normals and the indices of their half spaces.
pub(super) struct OrientedPoints<'a> {
    pub(super) points: &'a [Point3],
    pub(super) normals: &'a [Point3],
    pub(super) halves: &'a [Option<usize>],
    pub(super) noise: f64,
}

/// Returns samples whose side is known, from points on their surfaces and throughout the box.
pub(super) fn places(
    cloud: &OrientedPoints<'_>,
    feet: &[Foot],
    control: &Control<'_>,
) -> Result<Vec<SideSample>, Stopped> {
    let bounds = Aabb::from_points(cloud.points);
    let mut places = samples_on_both_sides(feet, cloud.noise, bounds.diagonal());
    control.check()?;
    places.extend(all_over(cloud, &bounds));
    control.check()?;
    Ok(places)
}

/// A point projected onto the surface of its entity.
pub(super) struct Foot {
    /// Index of the entity.
    pub(super) own: usize,
    pub(super) at: Point3,
    /// Outward unit normal.
    normal: Point3,
    /// Distance from the nearest other surface.
    clearance: f64,
    /// Probability that the point lies on its surface, less that it lies on the nearest other one.
    pub(super) certainty: f64,
}

/// Projects points onto the surfaces of their entities, whose half spaces are given; sorted by
/// entity, those away from other surfaces first.
pub(super) fn feet(cloud: &OrientedPoints<'_>, halves: &[HalfSpace]) -> Vec<Foot> {
    let diagonal = Aabb::from_points(cloud.points).diagonal();
    let variance = cloud.noise.max(1e-9 * diagonal).powi(2);
    let foot = |i: usize| {
        let own = cloud.halves[i]?;
        let (p, surface) = (cloud.points[i], &halves[own].surface);
        let (d, n) = (surface.distance(p), surface.normal(p));
        let at: Point3 = std::array::from_fn(|k| p[k] - d * n[k]);
        let others = halves.iter().enumerate().filter(|(j, _)| *j != own);
        let nearest = |p: Point3| {
            let distances = others.clone().map(|(_, h)| h.value(p).abs());
            distances.fold(f64::INFINITY, f64::min)
        };
        let other = nearest(p);
        let sign = if dot(n, cloud.normals[i]) < 0.0 {
            -1.0
        } else {
            1.0
        };
        Some(Foot {
            own,
            at,
            normal: n.map(|x| sign * x),
            clearance: nearest(at),
            // The difference of two probabilities with squared distances d² and e²: both surfaces
            // are as likely, the noise is normal.
            certainty: ((other * other - d * d) / (4.0 * variance)).tanh(),
        })
    };
    let numbers: Vec<usize> = thinned(cloud.points.len(), 8000).collect();
    let mut feet: Vec<Foot> = numbers.into_par_iter().filter_map(foot).collect();
    feet.sort_by(|a, b| (a.own.cmp(&b.own)).then(b.clearance.total_cmp(&a.clearance)));
    feet
}

/// Returns samples on both sides of points, away from all other surfaces.
fn samples_on_both_sides(feet: &[Foot], noise: f64, diagonal: f64) -> Vec<SideSample> {
    // Single precision has seven digits.
    let least = (1e-6 * diagonal).max(SAMPLE_DISTANCE.1 * noise);
    let off = least.max(SAMPLE_DISTANCE.0 * diagonal);
    let of_entity = |feet: &[Foot]| -> Vec<SideSample> {
        // Samples may be closer to the surface at the eight points of an entity that are farthest
        // from all other surfaces, so that small faces have samples, too.
        let is_free =
            |(k, foot): &(usize, &Foot)| foot.clearance > 2.0 * if *k < 8 { least } else { off };
        let free = feet.iter().enumerate().filter(is_free);
        free.flat_map(|(_, foot)| on_both_sides(foot, off.min(foot.clearance / 2.0)))
            .collect()
    };
    feet.chunk_by(|a, b| a.own == b.own)
        .flat_map(of_entity)
        .collect()
}

fn on_both_sides(foot: &Foot, off: f64) -> [SideSample; 2] {
    [true, false].map(|is_inside| {
        let way = if is_inside { -off } else { off };
        SideSample {
            at: std::array::from_fn(|k| foot.at[k] + way * foot.normal[k]),
            is_inside,
            // A sample away from the points has the weight 1.
            weight: 2.0,
        }
    })
}

/// Returns the area that each point represents, from the distance of a few neighbours.
pub(super) fn areas(points: &[Point3], tree: &KdTree) -> Vec<f64> {
    let of = |found: &mut Vec<(f64, u32)>, p: &Point3| {
        tree.nearest_k(*p, AREA_NEIGHBOURS + 1, found);
        let squared = found.last().map_or(0.0, |f| f.0);
        std::f64::consts::PI * squared / AREA_NEIGHBOURS as f64
    };
    points.par_iter().map_init(Vec::new, of).collect()
}

/// Returns samples throughout the box, away from the points.
fn all_over(cloud: &OrientedPoints<'_>, bounds: &Aabb) -> Vec<SideSample> {
    let some: Vec<usize> = thinned(cloud.points.len(), 3000).collect();
    let points: Vec<Point3> = some.iter().map(|i| cloud.points[*i]).collect();
    let tree = KdTree::new(&points);
    let areas = areas(&points, &tree);
    let all: f64 = areas.iter().sum();
    let spacing = (all / areas.len().max(1) as f64).sqrt();
    // The vector area of a closed surface is zero; if much is missing, winding numbers between the
    // points are meaningless.
    let vector_area = |(i, area): (&usize, &f64)| cloud.normals[*i].map(|v| area * v);
    let vectors: Vec<Point3> = some.iter().zip(&areas).map(vector_area).collect();
    let vector: Point3 = std::array::from_fn(|k| vectors.iter().map(|v| v[k]).sum());
    // The vector area of a box without one face is a fifth of its area, that of one seen from a
    // corner 0.58.
    let is_open = norm(vector) > 0.3 * all;
    let [lo, hi] = widened(bounds);
    let mut random = Random::new(1);
    // A cell that has a hundred-thousandth of the box is hardly met.
    let at: Vec<Point3> = (0..30_000)
        .map(|_| std::array::from_fn(|k| lo[k] + random.unit() * (hi[k] - lo[k])))
        .collect();
    let dipoles = DipoleTree::new(points.iter().copied().zip(vectors).collect());
    let place = |at: Point3| {
        let is_within = (0..3).all(|k| at[k] >= bounds.lo[k] && at[k] <= bounds.hi[k]);
        if is_open && is_within {
            return None;
        }
        let near = tree.nearest(at).map_or(0.0, |f| f.1.sqrt());
        // Closer samples are those on both sides of the points.
        if near < 2.0 * spacing {
            return None;
        }
        let w = dipoles.winding(at);
        // Winding numbers close to 1/2 are undecided.
        ((w - 0.5).abs() > 0.25).then_some(SideSample {
            at,
            is_inside: w > 0.5,
            weight: 1.0,
        })
    };
    at.into_par_iter().filter_map(place).collect()
}

/// Returns the corners of the box in which samples are taken.
pub(super) fn widened(bounds: &Aabb) -> [Point3; 2] {
    let more = 0.05 * bounds.diagonal();
    [bounds.lo.map(|x| x - more), bounds.hi.map(|x| x + more)]
}

/// Returns the half spaces that contain each sample.
pub(super) fn sides(halves: &[HalfSpace], places: &[SideSample]) -> Vec<Bits> {
    places.par_iter().map(|p| bits_of(halves, p.at)).collect()
}

/// Returns the half spaces that contain a point.
pub(super) fn bits_of(halves: &[HalfSpace], at: Point3) -> Bits {
    let add = |bits: Bits, (k, h): (usize, &HalfSpace)| bits | bit(h, k, at);
    halves.iter().enumerate().fold(0, add)
}

/// Returns the bit of half space `k` if it contains a point, else 0.
pub(super) fn bit(half: &HalfSpace, k: usize, at: Point3) -> Bits {
    Bits::from(half.value(at) > 0.0) << k
}

/// Weight of the samples in each cell, outside and inside.
pub(super) type Votes = BTreeMap<Bits, [f64; 2]>;

/// Sums the weights of samples by cell.
pub(super) fn votes(sides: &[Bits], places: &[SideSample]) -> Votes {
    let mut votes = Votes::new();
    for (place, bits) in places.iter().zip(sides) {
        votes.entry(*bits).or_default()[usize::from(place.is_inside)] += place.weight;
    }
    votes
}

/// Returns the inconsistency of cells that hold samples of both sides: Σ ab/(a + b) with the
/// weights a and b of a cell (Gini's impurity times the weight), 0 if none does. It falls with each
/// of several steps that divide a cell, unlike the weight of the smaller side alone.
pub(super) fn contradiction(votes: &Votes) -> f64 {
    let of = |[a, b]: &[f64; 2]| a * b / (a + b);
    votes.values().map(of).sum()
}
