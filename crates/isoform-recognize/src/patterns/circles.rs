//! Equal surfaces on a circle at equal angles.

use super::chain::{Chain, Circle};
use super::sites::{MAX_STEP_ERROR, Sites, way};
use crate::chart::{Primitive, PrimitiveKind, unit};
use crate::relations::MAX_PARALLEL_ANGLE;
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::collections::BTreeSet;
use std::f64::consts::TAU;

/// Maximum error of the angle of a closed circle, relative to a full turn over the members.
const MAX_CLOSING_ERROR: f64 = 0.02;

/// Returns the longest circles and arcs from each three places; `rows` are known.
pub(super) fn circles(sites: &Sites<'_>, rows: &[Chain]) -> Vec<Chain> {
    if sites.count() < 3 || sites.surface(0).kind == PrimitiveKind::Plane {
        return Vec::new();
    }
    let in_grid: Vec<bool> = (0..sites.count())
        .map(|m| rows.iter().filter(|r| r.members.contains(&m)).count() >= 2)
        .collect();
    let mut found: Vec<Chain> = Vec::new();
    let mut known = BTreeSet::new();
    for j in 0..sites.count() {
        // The next place on a circle is one of 24 neighbours.
        let near = sites.near(j, 24);
        for (n, i) in near.iter().enumerate() {
            for k in &near[n + 1..] {
                let three = [*i, j, *k];
                if three.iter().all(|m| in_grid[*m]) || known.contains(&three) {
                    continue;
                }
                if let Some(circle) = longest(sites, three) {
                    remember(&circle, &mut known);
                    found.push(circle);
                }
            }
        }
    }
    found
}

/// Records all consecutive triples of a circle, in both directions.
fn remember(circle: &Chain, known: &mut BTreeSet<[usize; 3]>) {
    let mut of = circle.members.clone();
    if circle.circle.is_some_and(|c| c.is_closed) {
        of.extend_from_slice(&circle.members[..2]);
    }
    for three in of.windows(3) {
        known.insert([three[0], three[1], three[2]]);
        known.insert([three[2], three[1], three[0]]);
    }
}

/// Returns the circle through three places, extended as far as it goes.
fn longest(sites: &Sites<'_>, three: [usize; 3]) -> Option<Chain> {
    let circle = through(sites, three)?;
    let mut chain = Chain::row(sites, three.to_vec());
    chain.circle = Some(circle);
    if !is_promising(sites, &chain) {
        return None;
    }
    let mut chain = chain.fitted(sites)?;
    while let Some(longer) = grown(sites, &chain) {
        chain = longer;
    }
    let mut chain = turned_round(sites, &chain).fitted(sites)?;
    while let Some(longer) = grown(sites, &chain) {
        chain = longer;
    }
    let chain = closed(sites, &chain).unwrap_or(chain);
    let circle = chain.circle?;
    let chain = with_axis(sites, &chain).unwrap_or(chain);
    let is_other = |i: usize| !sites.has(i);
    let has_axis = chain
        .circle
        .is_some_and(|c| c.coaxial.is_some_and(is_other));
    // Four members make an arc; three suffice about the axis of another kind of entity.
    let is_complete = circle.is_closed || chain.members.len() >= 4 || has_axis;
    is_complete.then_some(chain)
}

/// Returns the circle through three places of which the second is equally far from the other two.
fn through(sites: &Sites<'_>, [i, j, k]: [usize; 3]) -> Option<Circle> {
    let (p, q) = (sites.way(j, i), sites.way(j, k));
    let (a, b) = (norm(p), norm(q));
    let cosine = dot(p, q) / (a * b);
    let angle = std::f64::consts::PI - cosine.clamp(-1.0, 1.0).acos();
    // Smaller angles are those of a row; the largest is that of three places on a circle.
    if (a - b).abs() > MAX_STEP_ERROR * a || !(0.03..=TAU / 3.0 + MAX_STEP_ERROR).contains(&angle) {
        return None;
    }
    let radius = (a + b) / (4.0 * (angle / 2.0).sin());
    let halves = (unit(p), unit(q));
    let inwards = unit(std::array::from_fn(|k| halves.0[k] + halves.1[k]));
    let middle = sites.surface(j);
    let axis = unit(cross(p.map(|x| -x), q));
    let line = Primitive {
        kind: PrimitiveKind::Cylinder,
        place: std::array::from_fn(|k| middle.place[k] + radius * inwards[k]),
        axis,
        size: 0.0,
        other: 0.0,
    };
    let is_along = middle.kind == PrimitiveKind::Sphere
        || dot(axis, middle.axis).abs() > 1.0 - MAX_PARALLEL_ANGLE;
    is_along.then_some(Circle {
        line,
        angle,
        is_closed: false,
        coaxial: None,
    })
}

/// Returns true if three places are a closed circle, a fourth one follows, or the axis is known:
/// most triples lead to nothing.
fn is_promising(sites: &Sites<'_>, chain: &Chain) -> bool {
    let Some(circle) = chain.circle else {
        return false;
    };
    let is_whole = (3.0 * circle.angle - TAU).abs() <= MAX_CLOSING_ERROR * TAU;
    is_whole
        || next(sites, chain).is_some()
        || next(sites, &turned_round(sites, chain)).is_some()
        || !axes(sites, &circle, norm(chain.step)).is_empty()
}

/// Returns the place where a circle continues.
fn next(sites: &Sites<'_>, chain: &Chain) -> Option<usize> {
    let n = chain.members.len();
    let last = chain.members[n - 1];
    let expected = chain.next(n as f64);
    let place = way(sites.surface(last), &expected);
    let found = sites.at(last, place, MAX_STEP_ERROR * norm(place))?;
    (!chain.members.contains(&found)).then_some(found)
}

fn grown(sites: &Sites<'_>, chain: &Chain) -> Option<Chain> {
    let longer = Chain {
        members: [chain.members.as_slice(), &[next(sites, chain)?]].concat(),
        ..chain.clone()
    };
    longer.fitted(sites)
}

/// Returns the circle started from its other end.
fn turned_round(sites: &Sites<'_>, chain: &Chain) -> Chain {
    let mut members = chain.members.clone();
    members.reverse();
    let mut new = Chain::row(sites, members);
    new.circle = chain.circle.map(|mut c| {
        c.line.axis = c.line.axis.map(|x| -x);
        c
    });
    new
}

/// Returns the circle closed: its angle is a full turn over its members, and it starts at the
/// entity of the smallest index.
fn closed(sites: &Sites<'_>, chain: &Chain) -> Option<Chain> {
    let mut circle = chain.circle?;
    let n = chain.members.len();
    let angle = TAU / n as f64;
    if (circle.angle - angle).abs() > MAX_CLOSING_ERROR * angle {
        return None;
    }
    circle.angle = angle;
    circle.is_closed = true;
    let mut members = chain.members.clone();
    let first = (0..n).min_by_key(|k| members[*k])?;
    members.rotate_left(first);
    let mut new = Chain::row(sites, members);
    new.circle = Some(circle);
    new.fitted(sites)
}

/// Returns the entities whose axes pass near the circle's, those with most points first.
fn axes(sites: &Sites<'_>, circle: &Circle, step: f64) -> Vec<usize> {
    let near = |i: &usize| {
        let s = &sites.known[*i].surface;
        let is_along = dot(s.axis, circle.line.axis).abs()
            > 1.0 - MAX_PARALLEL_ANGLE * MAX_PARALLEL_ANGLE / 2.0;
        let off = sub(circle.line.about(s.place).place, s.place);
        s.kind > PrimitiveKind::Sphere
            && sites.known[*i].covariance[0][0].is_finite()
            && is_along
            && norm(off) <= MAX_STEP_ERROR * step
    };
    (0..sites.known.len()).filter(near).collect()
}

/// Returns the circle about an entity's axis; `None` if it fits no entity's.
fn with_axis(sites: &Sites<'_>, chain: &Chain) -> Option<Chain> {
    let circle = chain.circle?;
    let step: Point3 = chain.step;
    let with = |i: usize| {
        let mut new = chain.clone();
        new.circle = Some(Circle {
            coaxial: Some(i),
            ..circle
        });
        new.fitted(sites)
    };
    let all = axes(sites, &circle, norm(step));
    all.into_iter().find_map(with)
}
