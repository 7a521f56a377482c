//! Blends: entities that round the edge between others. They are cylinders, tori and spheres that
//! touch their neighbours along curves.
//!
//! A ball of constant radius that rolls along two surfaces keeps its centre at that radius from
//! both, and envelops the blend (J. Rossignac and A. Requicha, Constant-radius blending in solid
//! modelling, Computers in Mechanical Engineering 3, 1984). Hence the distance of the spine of the
//! blend (the axis of a cylinder, the circle of a torus, the centre of a sphere) from both surfaces
//! is the radius.

use crate::chart::{Primitive, PrimitiveKind, ROUNDING_DEVIATION};
use crate::entity::Blend;
use crate::noise::CHANCE_DEVIATIONS;
use crate::relations::UncertainSurface;
use isoform_geom::{Point3, dot};
use std::collections::BTreeMap;

/// Maximum distance of a touched surface from the radius of a blend, as a share of the radius: of a
/// badly determined radius everything would be a blend.
pub(crate) const MAX_TOUCH_OFFSET: f64 = 0.05;
/// Minimum number of pairs of neighbouring points between two adjacent entities of a cloud.
/// Entities that meet only in a corner have one or two.
pub(crate) const MIN_BORDER_PAIRS: usize = 4;

/// Returns the blends among entities, in the order of the entities, with lengths in units of
/// `unit`. `points` are those of each entity; `pairs` holds two entities for each place where they
/// are adjacent, and neighbours have at least `fewest` such places.
pub(crate) fn blends(
    known: &[UncertainSurface],
    points: &[Vec<Point3>],
    (pairs, fewest): (impl Iterator<Item = (usize, usize)>, usize),
    unit: f64,
) -> Vec<Blend> {
    let beside = neighbours(pairs, fewest);
    let mut blends = Vec::new();
    for (i, UncertainSurface { surface: s, .. }) in known.iter().enumerate() {
        let radius = match s.kind {
            PrimitiveKind::Cylinder | PrimitiveKind::Sphere => s.size,
            PrimitiveKind::Torus => s.other,
            PrimitiveKind::Plane | PrimitiveKind::Cone => continue,
        };
        let middle = middle(s, &points[i]);
        let sd = |k: usize| deviation(&known[k]).max(ROUNDING_DEVIATION);
        let touches = |j: &usize| {
            let limit = (CHANCE_DEVIATIONS * sd(i).hypot(sd(*j))).min(MAX_TOUCH_OFFSET * radius);
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
fn has_angle(known: &[UncertainSurface], between: &[usize], p: Point3) -> bool {
    let normal = |i: &usize| known[*i].surface.normal(p);
    let first = normal(&between[0]);
    // With opposite normals at the two contacts the entity is the round end of a slot.
    between[1..]
        .iter()
        .any(|j| dot(first, normal(j)).abs() < 0.99)
}

/// Returns the largest standard deviation of those parameters of a surface that are lengths.
fn deviation(known: &UncertainSurface) -> f64 {
    let of = |k: usize| known.covariance[k][k].sqrt();
    known.surface.kind.lengths().map(of).fold(0.0, f64::max)
}

/// Returns samples of the spine; of a cylinder, the ends of the part of the axis that its points
/// cover.
fn middle(s: &Primitive, points: &[Point3]) -> Vec<Point3> {
    let [e, f] = s.frame();
    match s.kind {
        // A plane that cuts the torus is at the distance of the radius at no more than three of
        // eight points of its circle.
        PrimitiveKind::Torus => (0..8)
            .map(|k| {
                let (sin, cos) = (k as f64 * std::f64::consts::TAU / 8.0).sin_cos();
                std::array::from_fn(|i| s.place[i] + s.size * (cos * e[i] + sin * f[i]))
            })
            .collect(),
        PrimitiveKind::Cylinder => {
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
