//! Membership probabilities: points near an edge belong to each of its faces with some probability.
//! Fits with these weights are not drawn over the edge, unlike fits to points that are assigned to
//! the nearer surface.

use crate::chart::{Primitive, PrimitiveDistances, unit};
use crate::cloud::{Cloud, MAX_NEIGHBOURS};
use crate::cost::Cost;
use crate::fit::mean;
use crate::labels::{ISOLATION_COST, UNLABELLED};
use isoform_geom::{Point3, dot, sub};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Minimum share of the points next to another surface that lie on one side of it, and their
/// minimum number.
const MIN_ONE_SIDED: (f64, usize) = (0.9, 6);

/// Points with their weights.
pub(crate) type MembershipWeights = Vec<(u32, f64)>;

/// Side of a surface (first) on which a face (second) lies: +1 or −1; absent if it lies on both.
type FaceSides = BTreeMap<(u32, u32), f64>;

/// Returns the points of each surface with the probability that they are its own.
pub(crate) fn shares(
    cloud: &Cloud,
    surfaces: &[Primitive],
    labels: &[u32],
    noise: f64,
) -> Vec<MembershipWeights> {
    let faces = FaceLikelihoods::new(cloud, surfaces, labels, noise);
    // By threads, in the order of points.
    // Fewer points per thread take longer to hand out, more leave threads without work at the end.
    let found: Vec<Vec<(u32, u32, f64)>> = (0..labels.len())
        .into_par_iter()
        .with_min_len(1024)
        .fold(Vec::new, |mut found, i| {
            faces.add_shares(i, &mut found);
            found
        })
        .collect();
    let mut shares = vec![MembershipWeights::new(); surfaces.len()];
    for (label, i, share) in found.into_iter().flatten() {
        shares[label as usize].push((i, share));
    }
    shares
}

/// Returns the labels of points, where those next to an edge belong to the face on whose side of
/// the other surface they lie, however near the other is. Sides are ignored if the faces are
/// tangent.
pub(crate) fn labels_by_side(
    cloud: &Cloud,
    surfaces: &[Primitive],
    labels: &[u32],
    noise: f64,
) -> Vec<u32> {
    let faces = FaceLikelihoods::new(cloud, surfaces, labels, noise);
    let likeliest = |i: usize| {
        let own = labels[i];
        if own == UNLABELLED || is_inside(cloud, labels, i) {
            return own;
        }
        let around = around(cloud, labels, i);
        if faces.are_tangent(&around, i) {
            return own;
        }
        let near = cloud.near(i as u32);
        let likely = |label: u32| {
            let apart = near
                .iter()
                .filter(|j| labels[**j as usize] != label)
                .count();
            let cost = ISOLATION_COST * apart as f64 / near.len() as f64;
            faces.likelihood(&around, label, i) * (-cost).exp()
        };
        let mut best = (likely(own), own);
        for label in around.iter().copied().filter(|label| *label != own) {
            let other = likely(label);
            if other > best.0 {
                best = (other, label);
            }
        }
        best.1
    };
    (0..labels.len()).into_par_iter().map(likeliest).collect()
}

/// Returns true if all labelled neighbours of a point belong to its own face.
fn is_inside(cloud: &Cloud, labels: &[u32], i: usize) -> bool {
    let is_own = |j: &u32| [labels[i], UNLABELLED].contains(&labels[*j as usize]);
    cloud.near(i as u32).iter().all(is_own)
}

/// Distinct labels in ascending order.
#[derive(Default)]
struct LabelSet {
    all: [u32; MAX_NEIGHBOURS + 1],
    count: usize,
}

impl LabelSet {
    fn add(&mut self, label: u32) {
        if let Err(at) = self.all[..self.count].binary_search(&label) {
            self.all.copy_within(at..self.count, at + 1);
            self.all[at] = label;
            self.count += 1;
        }
    }

    fn iter(&self) -> std::slice::Iter<'_, u32> {
        self.all[..self.count].iter()
    }
}

/// Returns the labels of a point and its neighbours.
fn around(cloud: &Cloud, labels: &[u32], i: usize) -> LabelSet {
    let near = cloud.near(i as u32).iter().map(|j| labels[*j as usize]);
    let mut around = LabelSet::default();
    near.chain([labels[i]])
        .filter(|l| *l != UNLABELLED)
        .for_each(|l| around.add(l));
    around
}

/// The faces of the current segmentation.
struct FaceLikelihoods<'a> {
    cloud: &'a Cloud,
    surfaces: Vec<PrimitiveDistances<'a>>,
    labels: &'a [u32],
    sides: FaceSides,
    noise: f64,
}

impl<'a> FaceLikelihoods<'a> {
    fn new(cloud: &'a Cloud, surfaces: &'a [Primitive], labels: &'a [u32], noise: f64) -> Self {
        let surfaces: Vec<PrimitiveDistances<'a>> =
            surfaces.iter().map(Primitive::distances).collect();
        Self {
            cloud,
            labels,
            sides: sides(cloud, &surfaces, labels, noise),
            surfaces,
            noise,
        }
    }

    /// Adds the surfaces on which a point may be, with the point and the probability of each.
    fn add_shares(&self, i: usize, shares: &mut Vec<(u32, u32, f64)>) {
        let own = self.labels[i];
        if own == UNLABELLED {
            return;
        }
        if is_inside(self.cloud, self.labels, i) {
            shares.push((own, i as u32, 1.0));
            return;
        }
        let around = around(self.cloud, self.labels, i);
        let mut likely = [0.0; MAX_NEIGHBOURS + 1];
        for (likely, label) in likely.iter_mut().zip(around.iter()) {
            *likely = self.likelihood(&around, *label, i);
        }
        let sum: f64 = likely.iter().sum();
        for (label, l) in around.iter().zip(likely) {
            if l > 1e-3 * sum {
                shares.push((*label, i as u32, l / sum));
            }
        }
    }

    /// Returns true if two of some faces are nearly tangent at a point.
    fn are_tangent(&self, around: &LabelSet, i: usize) -> bool {
        let normal = |label: &u32| self.surfaces[*label as usize].normal(self.cloud.points[i]);
        let normals: Vec<Point3> = around.iter().map(normal).collect();
        let mut rest = normals.as_slice();
        while let Some((first, others)) = rest.split_first() {
            if others.iter().any(|other| are_along(*first, *other)) {
                return true;
            }
            rest = others;
        }
        false
    }

    /// Returns the likelihood of a point on a surface: by its distance, and by the probability that
    /// its projection is on the face.
    fn likelihood(&self, around: &LabelSet, label: u32, i: usize) -> f64 {
        let (p, surface) = (self.cloud.points[i], &self.surfaces[label as usize]);
        let r = surface.at(p);
        if r.abs() > Cost::with_noise(self.noise).reach() {
            return 0.0;
        }
        let n = surface.normal(p);
        let foot = std::array::from_fn(|k| p[k] - r * n[k]);
        let mut likely = (-r * r / (2.0 * self.noise * self.noise)).exp();
        for other in around.iter().filter(|o| **o != label) {
            let next = &self.surfaces[*other as usize];
            let inside = if are_along(n, next.normal(p)) {
                before_contact(self.cloud, self.labels, i, [label, *other], [surface, next])
            } else {
                let side = self.sides.get(&(*other, label));
                side.map(|side| side * next.at(foot))
            };
            if let Some(inside) = inside {
                // Points beyond an edge are there by the noise along the surface.
                likely /= 1.0 + (-inside / (0.3 * self.noise)).exp();
            }
        }
        likely
    }
}

/// Returns true if the normals are those of nearly tangent surfaces.
fn are_along(m: Point3, n: Point3) -> bool {
    // Surfaces that meet below 26° touch or nearly do.
    dot(m, n).abs() > 0.9
}

/// Returns the distance of a point from the curve in which two surfaces touch or meet, positive on
/// the side of the first. With D the difference of their distances it is 2|D|/|∇D·u| along the
/// direction u from the points of one to those of the other. Along tangent surfaces D has one sign,
/// and only its growth determines the side.
fn before_contact(
    cloud: &Cloud,
    labels: &[u32],
    i: usize,
    [own, other]: [u32; 2],
    [first, second]: [&PrimitiveDistances<'_>; 2],
) -> Option<f64> {
    let p = cloud.points[i];
    let middle = |label: u32| {
        let near = cloud.near(i as u32).iter().copied().chain([i as u32]);
        let of: Vec<u32> = near.filter(|j| labels[*j as usize] == label).collect();
        (!of.is_empty()).then(|| mean(&cloud.at(&of)))
    };
    let way = unit(sub(middle(other)?, middle(own)?));
    let (m, n) = (first.normal(p), second.normal(p));
    let sign = dot(m, n).signum();
    let difference = sign * second.at(p) - first.at(p);
    let slope: f64 = (0..3).map(|k| (sign * n[k] - m[k]) * way[k]).sum();
    let length = 2.0 * difference / slope;
    length.is_finite().then_some(-length)
}

/// Returns the sides of their neighbours' surfaces on which faces lie.
fn sides(
    cloud: &Cloud,
    surfaces: &[PrimitiveDistances<'_>],
    labels: &[u32],
    noise: f64,
) -> FaceSides {
    let mut counts: BTreeMap<(u32, u32), [usize; 2]> = BTreeMap::new();
    for (i, own) in labels.iter().enumerate() {
        if *own == UNLABELLED || is_inside(cloud, labels, i) {
            continue;
        }
        for other in around(cloud, labels, i).iter().copied() {
            let r = surfaces[other as usize].at(cloud.points[i]);
            // Points this far from another surface show on which side of it a face lies.
            if other != *own && r.abs() > 1.5 * noise {
                counts.entry((other, *own)).or_default()[usize::from(r > 0.0)] += 1;
            }
        }
    }
    let (share, least) = MIN_ONE_SIDED;
    let side = |[minus, plus]: [usize; 2]| {
        let all = minus + plus;
        let most = minus.max(plus);
        (all >= least && most as f64 >= share * all as f64).then_some(if plus > minus {
            1.0
        } else {
            -1.0
        })
    };
    let found = counts.into_iter().filter_map(|(k, c)| Some((k, side(c)?)));
    found.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_in_order_and_once() {
        let mut labels = LabelSet::default();
        [7, 2, 9, 2, 7, 0, 8]
            .into_iter()
            .for_each(|l| labels.add(l));
        assert!(labels.iter().eq(&[0, 2, 7, 8, 9]));
        (20..28).for_each(|l| labels.add(l));
        assert_eq!(labels.count, MAX_NEIGHBOURS + 1);
    }
}
