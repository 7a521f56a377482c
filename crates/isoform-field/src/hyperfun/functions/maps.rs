//! Maps of space that change the point in place and return 1. They apply the inverse map to the
//! point, so that the shape evaluated there is moved forward.

use super::{Call, Outcome};
use crate::hyperfun::formula::{E, minus};
use crate::hyperfun::machine::{Machine, TRUTH_TOLERANCE};
use crate::library::Axis;

pub(super) fn scale<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    for i in 0..3 {
        c.put(0, i, c.item(0, i) / c.n(i + 1));
    }
    Ok(c.c(1.0))
}

pub(super) fn shift<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    for i in 0..3 {
        c.put(0, i, c.item(0, i) - c.n(i + 1));
    }
    Ok(c.c(1.0))
}

/// Replaces p by cᵢ + (pᵢ − cᵢ)/sᵢ.
pub(super) fn stretch<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    for i in 0..3 {
        let center = c.item(1, i);
        c.put(0, i, &center + (c.item(0, i) - &center) / c.n(i + 2));
    }
    Ok(c.c(1.0))
}

pub(super) fn rotate<'c, M: Machine>(c: &mut Call<'c, M>, axis: Axis) -> Outcome<'c, M> {
    let angle = c.n(1);
    turn(c, axis, &angle);
    Ok(c.c(1.0))
}

/// Twists about an axis by an angle linear in the axis coordinate, also outside of \[z1, z2\].
pub(super) fn twist<'c, M: Machine>(c: &mut Call<'c, M>, axis: Axis) -> Outcome<'c, M> {
    let angle = c.n(3) + along(c, axis) * (c.n(4) - c.n(3));
    turn(c, axis, &angle);
    Ok(c.c(1.0))
}

/// Divides the other two coordinates by a scale that is linear in the axis coordinate and constant
/// outside of \[z1, z2\]. A scale near 0 counts as 1.
pub(super) fn taper<'c, M: Machine>(c: &mut Call<'c, M>, axis: Axis) -> Outcome<'c, M> {
    let (p, q, h) = axis.indices();
    let (z, s1, s2) = (c.item(0, h), c.n(3), c.n(4));
    let inside = &s1 + along(c, axis) * (&s2 - &s1);
    let scale = z
        .less_eq(&c.n(1))
        .select(&s1, &c.n(2).less_eq(&z).select(&s2, &inside));
    let scale = scale.abs().below(TRUTH_TOLERANCE).select(&c.c(1.0), &scale);
    for i in [p, q] {
        c.put(0, i, c.item(0, i) / &scale);
    }
    Ok(c.c(1.0))
}

/// Returns (axis coordinate − z1)/(z2 − z1).
fn along<'c, M: Machine>(c: &Call<'c, M>, axis: Axis) -> E<'c, M> {
    let (_, _, h) = axis.indices();
    (c.item(0, h) - c.n(1)) / (c.n(2) - c.n(1))
}

fn turn<'c, M: Machine>(c: &mut Call<'c, M>, axis: Axis, angle: &E<'c, M>) {
    let (p, q, _) = axis.indices();
    let (u, v, sin, cos) = (c.item(0, p), c.item(0, q), angle.sin(), angle.cos());
    c.put(0, p, &u * &cos + &v * &sin);
    c.put(0, q, v * cos - u * sin);
}

/// Maps space with the weight (1 − q)³/(1 + q) for q ≤ 1, else 0.
pub(super) fn space_map_cubic<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    space_map(c, |q2| {
        let q = q2.sqrt();
        let weight = (1.0 - &q).powi(3) / (1.0 + &q);
        q.at_most(1.0).select(&weight, &q.constant(0.0))
    })
}

/// Maps space with the weight exp(−q²).
pub(super) fn space_map_exp<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    space_map(c, |q2| (-q2).exp())
}

/// Subtracts D weight(q) from p for each pair in turn, with D = target − source and q² = Σ ((pᵢ −
/// targetᵢ)/(bᵢ (1 + |Dᵢ|)))².
fn space_map<'c, M: Machine>(
    c: &mut Call<'c, M>,
    weight: impl Fn(E<'c, M>) -> E<'c, M>,
) -> Outcome<'c, M> {
    let mut p = c.point(0);
    for n in 0..c.len(1) / 3 {
        let (target, b) = (c.triple(2, n), c.triple(3, n));
        let d = minus(&target, &c.triple(1, n));
        let u = minus(&p, &target);
        let q2 = (0..3).fold(c.c(0.0), |sum, i| {
            sum + (&u[i] / (&b[i] * (1.0 + d[i].abs()))).square()
        });
        let w = weight(q2);
        p = std::array::from_fn(|i| &p[i] - &d[i] * &w);
    }
    c.put_point(0, p);
    Ok(c.c(1.0))
}
