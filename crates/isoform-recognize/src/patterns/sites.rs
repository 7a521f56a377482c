//! Classes of equal entities, and their places: pieces of one plane or one bore share a place.

use crate::chart::{MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind, ROUNDING_DEVIATION};
use crate::compare::{Whitener, add_covariance, difference, is_angle, limit};
use crate::relations::{
    MAX_DIRECTION_DEVIATION, MAX_PARALLEL_ANGLE, MAX_PLACE_DEVIATION, UncertainSurface,
};
use isoform_geom::{Point3, UnionFind, dot, norm};

/// Maximum error of equal steps, and of predicted places, relative to the step.
pub(super) const MAX_STEP_ERROR: f64 = 0.05;

/// Returns the parameters in which members of a pattern are equal: the position of a cone along its
/// axis is ignored.
pub(super) fn compared(kind: PrimitiveKind) -> &'static [usize] {
    match kind {
        PrimitiveKind::Plane => &[0, 1, 2],
        PrimitiveKind::Sphere => &[0, 1, 2, 3],
        PrimitiveKind::Cylinder => &[0, 1, 2, 3, 4],
        PrimitiveKind::Cone => &[0, 1, 2, 3, 5],
        PrimitiveKind::Torus => &[0, 1, 2, 3, 4, 5, 6],
    }
}

/// Returns the parameters that are sizes.
fn sizes(kind: PrimitiveKind) -> &'static [usize] {
    match kind {
        PrimitiveKind::Plane => &[],
        PrimitiveKind::Sphere => &[3],
        PrimitiveKind::Cylinder => &[4],
        PrimitiveKind::Cone => &[5],
        PrimitiveKind::Torus => &[5, 6],
    }
}

/// Returns classes of three or more entities that are equal up to their places.
pub(super) fn classes(known: &[UncertainSurface], outward: &[i8], noise: f64) -> Vec<Vec<usize>> {
    let told: Vec<usize> = (0..known.len())
        .filter(|i| outward[*i] != 0 && is_determined(&known[*i], noise))
        .collect();
    let mut sets = UnionFind::new(known.len());
    for (n, i) in told.iter().enumerate() {
        for j in &told[n + 1..] {
            if are_equal(&known[*i], &known[*j], outward[*i] * outward[*j]) {
                sets.unite(*i as u32, *j as u32);
            }
        }
    }
    let mut classes: Vec<(u32, Vec<usize>)> = Vec::new();
    for i in told {
        let root = sets.root(i as u32);
        match classes.iter_mut().find(|c| c.0 == root) {
            Some(class) => class.1.push(i),
            None => classes.push((root, vec![i])),
        }
    }
    let all = classes.into_iter().map(|c| c.1);
    all.filter(|c| c.len() >= 3).collect()
}

/// Returns true if an entity is known accurately enough to be a member of a pattern.
fn is_determined(known: &UncertainSurface, noise: f64) -> bool {
    let kind = known.surface.kind;
    compared(kind).iter().all(|k| {
        let (least, noises) = if is_angle(kind, *k) {
            MAX_DIRECTION_DEVIATION
        } else {
            MAX_PLACE_DEVIATION
        };
        known.covariance[*k][*k].sqrt() <= least.max(noises * noise)
    })
}

/// Returns true if two entities have equal sizes within some deviations and parallel axes, and
/// their outer sides agree (`facing` is the product of both).
fn are_equal(a: &UncertainSurface, b: &UncertainSurface, facing: i8) -> bool {
    let (s, t) = (&a.surface, &b.surface);
    if s.kind != t.kind {
        return false;
    }
    let cosine = dot(s.axis, t.axis);
    if s.kind != PrimitiveKind::Sphere
        && cosine.abs() < 1.0 - MAX_PARALLEL_ANGLE * MAX_PARALLEL_ANGLE / 2.0
    {
        return false;
    }
    let along = if s.kind == PrimitiveKind::Plane && cosine < 0.0 {
        -1
    } else {
        1
    };
    let off = difference(s, t);
    let is_near = |k: &usize| {
        let variance =
            a.covariance[*k][*k] + b.covariance[*k][*k] + ROUNDING_DEVIATION * ROUNDING_DEVIATION;
        // Sizes of equal entities differ by at most six deviations.
        off[*k].abs() <= 6.0 * variance.sqrt()
    };
    facing * along > 0 && sizes(s.kind).iter().all(is_near)
}

/// The places of a class.
pub(super) struct Sites<'a> {
    pub(super) known: &'a [UncertainSurface],
    /// Entities of each place, those with most points first.
    places: Vec<Vec<usize>>,
    /// Whitener of each entity of the class; `None` for all others.
    whiteners: Vec<Option<Whitener>>,
}

impl<'a> Sites<'a> {
    pub(super) fn new(known: &'a [UncertainSurface], class: &[usize]) -> Self {
        let mut places: Vec<Vec<usize>> = Vec::new();
        for i in class {
            let same = places
                .iter_mut()
                .find(|p| are_one(&known[p[0]], &known[*i]));
            match same {
                Some(place) => place.push(*i),
                None => places.push(vec![*i]),
            }
        }
        let mut whiteners = vec![None; known.len()];
        for i in class {
            let of = rounded(&known[*i].covariance);
            let which = compared(known[*i].surface.kind);
            whiteners[*i] = Some(Whitener::from_covariance(&of, which, None));
        }
        Self {
            known,
            places,
            whiteners,
        }
    }

    pub(super) fn count(&self) -> usize {
        self.places.len()
    }

    /// Returns true if an entity belongs to the class.
    pub(super) fn has(&self, entity: usize) -> bool {
        self.whiteners[entity].is_some()
    }

    pub(super) fn entities(&self, place: usize) -> Vec<usize> {
        self.places[place].clone()
    }

    pub(super) fn surface(&self, place: usize) -> &'a Primitive {
        &self.known[self.places[place][0]].surface
    }

    pub(super) fn whitener(&self, entity: usize) -> Whitener {
        self.whiteners[entity]
            .clone()
            .expect("entities of a class have one")
    }

    /// Returns the vector from one place to another, in the directions in which the kind of surface
    /// has a position.
    pub(super) fn way(&self, from: usize, to: usize) -> Point3 {
        way(self.surface(from), self.surface(to))
    }

    /// Returns the place nearest to the end of a vector from another place, within `off`.
    pub(super) fn at(&self, from: usize, way: Point3, off: f64) -> Option<usize> {
        let distance = |k: &usize| {
            let there = self.way(from, *k);
            norm(std::array::from_fn(|i| there[i] - way[i]))
        };
        let others = (0..self.count()).filter(|k| *k != from);
        let near = others.map(|k| (distance(&k), k)).filter(|n| n.0 <= off);
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|n| n.1)
    }

    /// Returns the places nearest to one, at most `most`.
    pub(super) fn near(&self, from: usize, most: usize) -> Vec<usize> {
        let mut others: Vec<usize> = (0..self.count()).filter(|k| *k != from).collect();
        others.sort_by(|a, b| {
            let of = |k: &usize| norm(self.way(from, *k));
            of(a).total_cmp(&of(b))
        });
        others.truncate(most);
        others
    }
}

/// Returns the vector from a surface to an equal one.
pub(super) fn way(from: &Primitive, to: &Primitive) -> Point3 {
    let off = difference(from, to);
    let [e, f] = from.frame();
    match from.kind {
        PrimitiveKind::Plane => from.axis.map(|x| x * off[2]),
        PrimitiveKind::Sphere => [off[0], off[1], off[2]],
        PrimitiveKind::Torus => [off[2], off[3], off[4]],
        _ => std::array::from_fn(|k| off[2] * e[k] + off[3] * f[k]),
    }
}

fn rounded(covariance: &[ParameterRow; MAX_PARAMETERS]) -> [ParameterRow; MAX_PARAMETERS] {
    let mut sum = *covariance;
    (0..MAX_PARAMETERS).for_each(|k| sum[k][k] += ROUNDING_DEVIATION * ROUNDING_DEVIATION);
    sum
}

/// Returns true if two entities are pieces of one surface within the uncertainty. Equal tori and
/// spheres at one position are one entity.
fn are_one(a: &UncertainSurface, b: &UncertainSurface) -> bool {
    let which = compared(a.surface.kind);
    let mut sum = rounded(&a.covariance);
    add_covariance(&mut sum, b, |s| difference(&a.surface, s));
    let off = difference(&a.surface, &b.surface);
    Whitener::from_covariance(&sum, which, None).squared(&off) <= limit(which.len())
}
