//! Blends: entities that round the edge between others. They are cylinders, tori and spheres that
//! touch their neighbours along curves.
//!
//! A ball of constant radius that rolls along two surfaces keeps its centre at that radius from
//! both, and envelops the blend (J. Rossignac and A. Requicha, Constant-radius blending in solid
//! modelling, Computers in Mechanical Engineering 3, 1984). Hence the distance of the spine of the
//! blend (the axis of a cylinder, the circle of a torus, the centre of a sphere) from both surfaces
//! is the radius.

use crate::chart::{Kind, Surface};
use crate::entity::Blend;
use crate::relations::Known;
use isoform_geom::{Point3, dot};
use std::collections::BTreeMap;

/// Number of samples of a torus's circle at which the distance is tested. A plane that cuts the
/// torus is at the distance of the radius at no more than three of them.
const PLACES: usize = 8;
/// Two surfaces touch where the middle curve is off the radius by at most this many deviations.
const WITHIN: f64 = 4.0;
/// The share of the radius by which it may be off at most: of a badly determined radius everything
/// would be a blend.
const OFF: f64 = 0.05;
/// The least deviation, in diagonals: what rounding leaves.
const ROUNDING: f64 = 1e-8;
/// Minimum number of pairs of neighbouring points between two adjacent entities of a cloud.
/// Entities that meet only in a corner have one or two.
pub(crate) const PAIRS: usize = 4;
/// |cosine| of the normals at the two contacts above which the entity is no rounded edge but the
/// round end of a slot.
const OPPOSITE: f64 = 0.99;

/// Returns the blends among entities, in the order of the entities, with lengths in units of
/// `unit`. `points` are those of each entity; `pairs` holds two entities for each place where they
/// are adjacent, and neighbours have at least `fewest` such places.
pub(crate) fn blends(
    known: &[Known],
    points: &[Vec<Point3>],
    (pairs, fewest): (impl Iterator<Item = (usize, usize)>, usize),
    unit: f64,
) -> Vec<Blend> {
    let beside = neighbours(pairs, fewest);
    let mut blends = Vec::new();
    for (i, Known { surface: s, .. }) in known.iter().enumerate() {
        let radius = match s.kind {
            Kind::Cylinder | Kind::Sphere => s.size,
            Kind::Torus => s.other,
            Kind::Plane | Kind::Cone => continue,
        };
        let middle = middle(s, &points[i]);
        let sd = |k: usize| deviation(&known[k]).max(ROUNDING);
        let touches = |j: &usize| {
            let limit = (WITHIN * sd(i).hypot(sd(*j))).min(OFF * radius);
            let off = |p: &Point3| (known[*j].surface.distance(*p).abs() - radius).abs();
            *j != i && middle.iter().all(|p| off(p) <= limit)
        };
        let next = beside.get(&i).into_iter().flatten();
        let between: Vec<usize> = next.copied().filter(touches).collect();
        if between.len() >= 2 && has_angle(known, &between, middle[0]) {
            blends.push(Blend {
                entity: i,
                between,
                radius: radius * unit,
            });
        }
    }
    blends
}

/// Returns true if the normals of two of the surfaces make an angle at their contacts. If not, the
/// entity is the round end of a slot.
fn has_angle(known: &[Known], between: &[usize], p: Point3) -> bool {
    let normal = |i: &usize| known[*i].surface.normal(p);
    let first = normal(&between[0]);
    between[1..]
        .iter()
        .any(|j| dot(first, normal(j)).abs() < OPPOSITE)
}

/// Returns the largest standard deviation of those parameters of a surface that are lengths.
fn deviation(known: &Known) -> f64 {
    let of = |k: usize| known.covariance[k][k].sqrt();
    known.surface.kind.lengths().map(of).fold(0.0, f64::max)
}

/// Returns samples of the spine; of a cylinder, the ends of the part of the axis that its points
/// cover.
fn middle(s: &Surface, points: &[Point3]) -> Vec<Point3> {
    let [e, f] = s.frame();
    match s.kind {
        Kind::Torus => (0..PLACES)
            .map(|k| {
                let (sin, cos) = (k as f64 * std::f64::consts::TAU / PLACES as f64).sin_cos();
                std::array::from_fn(|i| s.place[i] + s.size * (cos * e[i] + sin * f[i]))
            })
            .collect(),
        Kind::Cylinder => {
            let ends = s.extent(points);
            let at = |h: f64| -> Point3 { std::array::from_fn(|k| s.place[k] + h * s.axis[k]) };
            ends.map(at).to_vec()
        }
        _ => vec![s.place],
    }
}

/// Returns the neighbours of each entity.
fn neighbours(
    pairs: impl Iterator<Item = (usize, usize)>,
    fewest: usize,
) -> BTreeMap<usize, Vec<usize>> {
    let mut counts: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for (a, b) in pairs {
        *counts.entry((a, b)).or_default() += 1;
        *counts.entry((b, a)).or_default() += 1;
    }
    let mut beside: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for ((a, b), _) in counts.into_iter().filter(|p| p.1 >= fewest) {
        beside.entry(a).or_default().push(b);
    }
    beside
}
