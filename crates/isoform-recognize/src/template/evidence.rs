//! Sides of the cells of space, by evidence on the surfaces between them: two cells that meet on a
//! surface lie on different sides of the solid where the surface has points, and on one side where
//! it has none. Samples of known side, and the space around the points, relate cells to the
//! outside.
//!
//! The strongest relations are taken first, and those that contradict them are left out: a spanning
//! tree of most evidence (J. B. Kruskal, Proc. Amer. Math. Soc. 7, 1956).

use super::cells::{Foot, Votes, areas, bits_of, widened};
use super::half::{HalfSpace, HalfSpaceSource};
use super::solid::{Bits, SolidCell};
use crate::chart::{Primitive, PrimitiveKind, frame, unit};
use isoform_geom::{Aabb, KdTree, Point3, UnionFind, cross, dot, norm, sub};
use isoform_num::Random;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Expected number of wrongly labelled points where a surface is not a face, as a share of the
/// points of a face of equal area.
const STRAY_SHARE: f64 = 0.1;
/// Minimum strength of a relation by samples, and of one by points on a surface, in nats: single
/// samples and points may be on the wrong side.
const MIN_STRENGTHS: [f64; 2] = [3.0, 7.0];
/// Weight of evidence that a surface has no points: a scan does not see all of a surface.
const ABSENCE_WEIGHT: f64 = 0.25;
/// Number of places tried on a surface to measure areas between cells.
const AREA_TRIALS: usize = 3000;

/// Part of a surface between two cells.
#[derive(Clone, Copy, Debug, Default)]
struct Interface {
    /// Number of points on it, each counted by the certainty of its label.
    points: f64,
    /// Number of points that may as well lie on other surfaces: the rest of each count.
    uncertain: f64,
    area: f64,
}

impl Interface {
    /// Returns the logarithm of the likelihood of its points if it is a face with this number of
    /// points per area, over that if it is not (Poisson).
    fn gain(&self, density: f64) -> f64 {
        let expected = (density * self.area - self.uncertain).max(0.0);
        -self.points * STRAY_SHARE.ln() - expected * (1.0 - STRAY_SHARE)
    }
}

/// Interfaces by the index of their half space and the sides of the others.
type Interfaces = BTreeMap<(usize, Bits), Interface>;

/// A relation between two cells.
struct Relation {
    cells: [u32; 2],
    /// True if they lie on different sides of the solid.
    differ: bool,
    /// Logarithm of the likelihood ratio, in nats.
    strength: f64,
}

/// Cells on known sides, and the share of the evidence that contradicts them.
pub(super) struct KnownCells {
    pub(super) cells: Vec<SolidCell>,
    pub(super) contradicted: f64,
}

/// Finds the sides of cells.
pub(super) fn known_cells(
    halves: &[HalfSpace],
    feet: &[Foot],
    votes: &Votes,
    bounds: &Aabb,
) -> KnownCells {
    let mut graph = CellGraph::default();
    for (bits, [outside, inside]) in votes {
        let strength = (inside - outside).abs();
        if strength >= MIN_STRENGTHS[0] {
            let cell = graph.number(*bits);
            graph.relate([OUTSIDE, cell], inside > outside, strength);
        }
    }
    let densities = densities(feet);
    for ((half, bits), interface) in &interfaces(halves, feet, bounds) {
        let entity = halves[*half].source.entity();
        let density = entity.and_then(|e| densities.get(&e)).copied();
        let gain = interface.gain(density.unwrap_or(0.0));
        let strength = gain.max(-ABSENCE_WEIGHT * gain);
        if strength >= MIN_STRENGTHS[1] {
            let cells = [*bits, bits | 1 << half].map(|b| graph.number(b));
            graph.relate(cells, gain > 0.0, strength);
        }
    }
    graph.solved()
}

/// Number of the space around the points in a [`CellGraph`].
const OUTSIDE: u32 = 0;

/// Cells, numbered from 1, and relations between them.
#[derive(Default)]
struct CellGraph {
    numbers: BTreeMap<Bits, u32>,
    relations: Vec<Relation>,
}

impl CellGraph {
    fn number(&mut self, bits: Bits) -> u32 {
        let next = self.numbers.len() as u32 + 1;
        *self.numbers.entry(bits).or_insert(next)
    }

    fn relate(&mut self, cells: [u32; 2], differ: bool, strength: f64) {
        self.relations.push(Relation {
            cells,
            differ,
            strength,
        });
    }

    /// Returns the sides of all cells that relations connect with the outside.
    fn solved(mut self) -> KnownCells {
        self.relations.sort_by(|a, b| {
            let strength = b.strength.total_cmp(&a.strength);
            strength.then(a.cells.cmp(&b.cells))
        });
        // Each cell has two numbers, of the statement that it is outside and of its opposite.
        let count = self.numbers.len() + 1;
        let mut sets = UnionFind::new(2 * count);
        let (mut all, mut contradicted) = (0.0, 0.0);
        let mut weights = vec![0.0; count];
        for relation in &self.relations {
            let [a, b] = relation.cells;
            let [b, opposite] = match relation.differ {
                true => [2 * b + 1, 2 * b],
                false => [2 * b, 2 * b + 1],
            };
            all += relation.strength;
            if sets.root(2 * a) == sets.root(opposite) {
                contradicted += relation.strength;
                continue;
            }
            sets.unite(2 * a, b);
            sets.unite(2 * a + 1, opposite);
            for cell in relation.cells {
                weights[cell as usize] += relation.strength;
            }
        }
        let sides = [sets.root(2 * OUTSIDE), sets.root(2 * OUTSIDE + 1)];
        let mut cell = |(bits, number): (&Bits, &u32)| {
            let side = sides.iter().position(|s| *s == sets.root(2 * number))?;
            Some(SolidCell {
                bits: *bits,
                is_inside: side == 1,
                weight: weights[*number as usize],
            })
        };
        KnownCells {
            cells: self.numbers.iter().filter_map(&mut cell).collect(),
            contradicted: contradicted / f64::max(all, 1.0),
        }
    }
}

/// Returns the points and areas between cells.
fn interfaces(halves: &[HalfSpace], feet: &[Foot], bounds: &Aabb) -> Interfaces {
    let of_entity = |(k, half): (usize, &HalfSpace)| match half.source {
        HalfSpaceSource::Entity(entity) => Some((entity, k)),
        _ => None,
    };
    let own: BTreeMap<usize, usize> = halves.iter().enumerate().filter_map(of_entity).collect();
    let key = |k: usize, at: Point3| (k, bits_of(halves, at) & !(1 << k));
    let keys: Vec<Option<(usize, Bits)>> = feet
        .par_iter()
        .map(|foot| Some(key(*own.get(&foot.own)?, foot.at)))
        .collect();
    let mut all = Interfaces::new();
    for (foot, key) in feet.iter().zip(keys) {
        if let Some(key) = key {
            let interface = all.entry(key).or_default();
            let certainty = foot.certainty.max(0.0);
            interface.points += certainty;
            interface.uncertain += 1.0 - certainty;
        }
    }
    let areas: Vec<Vec<((usize, Bits), f64)>> = own
        .par_iter()
        .map(|(_, k)| {
            let places = places_on(&halves[*k].surface, bounds).into_iter();
            places.map(|(at, area)| (key(*k, at), area)).collect()
        })
        .collect();
    for (key, area) in areas.into_iter().flatten() {
        all.entry(key).or_default().area += area;
    }
    all
}

/// Returns the number of points per area on the faces of each entity: the median over its points,
/// from the distance of some neighbours among them.
fn densities(feet: &[Foot]) -> BTreeMap<usize, f64> {
    let of_entity = |of: &[Foot]| {
        let places: Vec<Point3> = of.iter().map(|f| f.at).collect();
        let mut areas = areas(&places, &KdTree::new(&places));
        let half = areas.len() / 2;
        let median = *areas.select_nth_unstable_by(half, f64::total_cmp).1;
        (of[0].own, if median > 0.0 { 1.0 / median } else { 0.0 })
    };
    feet.chunk_by(|a, b| a.own == b.own)
        .map(of_entity)
        .collect()
}

/// Returns random places on a surface within a box, uniform by area, each with the area that it
/// represents.
fn places_on(surface: &Primitive, bounds: &Aabb) -> Vec<(Point3, f64)> {
    let (middle, [lo, hi]) = (bounds.center(), widened(bounds));
    let reach = norm(sub(hi, lo));
    let mut random = Random::new(1);
    let Primitive {
        kind,
        place,
        axis,
        size,
        other,
    } = *surface;
    // Across the axis from it, and along it from the height of the middle.
    let height = dot(sub(middle, place), axis);
    let across: Point3 = std::array::from_fn(|k| middle[k] - place[k] - height * axis[k]);
    let [e, f] = match norm(across) > 1e-6 * reach {
        true => {
            let e = unit(across);
            [e, cross(axis, e)]
        }
        false => frame(axis),
    };
    let mut place_on = || -> (Point3, f64) {
        let [u, v] = [random.symmetric(), random.symmetric()];
        let along = |r: f64, turn: f64, h: f64| -> Point3 {
            let (sin, cos) = turn.sin_cos();
            std::array::from_fn(|k| place[k] + r * (cos * e[k] + sin * f[k]) + h * axis[k])
        };
        match kind {
            PrimitiveKind::Plane => {
                let foot = surface.foot(middle);
                let at = |k: usize| foot[k] + 0.5 * reach * (u * e[k] + v * f[k]);
                (std::array::from_fn(at), reach * reach)
            }
            PrimitiveKind::Cylinder => {
                // The angle about the direction of the middle in which it may meet the box.
                let turn = PI.min(2.0 * reach / size);
                let at = along(size, turn * u, height + 0.5 * reach * v);
                (at, 2.0 * turn * size * reach)
            }
            PrimitiveKind::Cone => {
                let h = height + 0.5 * reach * v;
                let r = size + h * other.tan();
                (along(r, PI * u, h), TAU * r * reach / other.cos())
            }
            PrimitiveKind::Sphere => {
                let (turn, h) = (PI * u, size * v);
                let r = (size * size - h * h).max(0.0).sqrt();
                (along(r, turn, h), 2.0 * TAU * size * size)
            }
            PrimitiveKind::Torus => {
                let (sin, cos) = (PI * v).sin_cos();
                let r = size + other * cos;
                (along(r, PI * u, other * sin), TAU * TAU * r * other)
            }
        }
    };
    (0..AREA_TRIALS)
        .map(|_| place_on())
        .filter(|(p, area)| *area > 0.0 && (0..3).all(|k| p[k] >= lo[k] && p[k] <= hi[k]))
        .map(|(p, area)| (p, area / AREA_TRIALS as f64))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_represent_the_area_within_the_box() {
        let bounds = Aabb {
            lo: [-2.0; 3],
            hi: [2.0; 3],
        };
        let axis = [0.48, 0.6, 0.64];
        let of = |kind, size, other| Primitive {
            kind,
            place: [0.1, -0.1, 0.2],
            axis,
            size,
            other,
        };
        let (sphere, torus) = (2.0 * TAU * 0.49, TAU * TAU * 0.6 * 0.2);
        for (surface, area) in [
            (of(PrimitiveKind::Sphere, 0.7, 0.0), sphere),
            (of(PrimitiveKind::Torus, 0.6, 0.2), torus),
        ] {
            let found = places_on(&surface, &bounds);
            let sum: f64 = found.iter().map(|f| f.1).sum();
            assert!((sum / area - 1.0).abs() < 0.03, "{surface:?}: {sum} {area}");
            assert!(found.iter().all(|f| surface.distance(f.0).abs() < 1e-12));
        }
        // The box is widened by 5 % of its diagonal, 4 √3, on each side.
        let side = 4.0 + 0.4 * 3.0_f64.sqrt();
        let along = |kind, size, other| Primitive {
            kind,
            place: [0.1, -0.1, 30.0],
            axis: [0.0, 0.0, 1.0],
            size,
            other,
        };
        let slope = 0.02_f64;
        for (surface, area) in [
            (along(PrimitiveKind::Plane, 0.0, 0.0), 0.0),
            (along(PrimitiveKind::Cylinder, 1.5, 0.0), TAU * 1.5 * side),
            (
                along(PrimitiveKind::Cone, 1.5 + 30.0 * slope, slope.atan()),
                { TAU * 1.5 * side * slope.hypot(1.0) },
            ),
        ] {
            let found = places_on(&surface, &bounds);
            let sum: f64 = found.iter().map(|f| f.1).sum();
            assert!(
                (sum - area).abs() <= 0.04 * area,
                "{surface:?}: {sum} {area}"
            );
            assert!(found.iter().all(|f| surface.distance(f.0).abs() < 1e-12));
        }
        let plane = Primitive::plane([0.0; 3], [0.0, 1.0, 0.0]);
        let sum: f64 = places_on(&plane, &bounds).iter().map(|f| f.1).sum();
        assert!((sum / (side * side) - 1.0).abs() < 0.05, "{sum}");
    }

    /// The walls of a tube, 0 and 1 are the radii: relations chain the bore to the outside although
    /// samples of the bore contradict each other.
    #[test]
    fn strong_relations_decide_before_weak_ones() {
        let mut graph = CellGraph::default();
        let [outside, wall, bore, apart] = [0b00, 0b01, 0b11, 0b100].map(|b| graph.number(b));
        graph.relate([OUTSIDE, outside], false, 100.0);
        graph.relate([outside, wall], true, 50.0);
        graph.relate([wall, bore], true, 40.0);
        graph.relate([OUTSIDE, bore], true, 10.0);
        graph.relate([apart, apart], false, 1.0);
        let known = graph.solved();
        let sides: Vec<(Bits, bool)> = known.cells.iter().map(|c| (c.bits, c.is_inside)).collect();
        assert_eq!(sides, [(0b00, false), (0b01, true), (0b11, false)]);
        assert!((known.contradicted - 10.0 / 201.0).abs() < 1e-12);
    }
}
