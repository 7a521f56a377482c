//! Mathematical functions that check their argument.

use super::{Call, Outcome};
use crate::hyperfun::machine::Machine;
use crate::library::Native;
use crate::ops::Unary;

/// Bound on |cos u| below which the tangent is rejected, as in the reference implementation.
const MIN_TANGENT_COSINE: f64 = 1e-6;

pub(super) fn sqrt<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    match c.value(&c.n(0)) {
        Some(u) if u < 0.0 => c.fail(format!("square root of the negative number {u}")),
        _ => Ok(c.n(0).sqrt()),
    }
}

pub(super) fn log<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    match c.value(&c.n(0)) {
        Some(u) if u <= 0.0 => c.fail(format!("logarithm of {u}; only positive numbers have one")),
        _ => Ok(c.n(0).unary(Unary::Ln)),
    }
}

pub(super) fn logd<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    Ok(log(c)? / std::f64::consts::LN_10)
}

pub(super) fn tan<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    match c.value(&c.n(0)) {
        Some(u) if u.cos().abs() < MIN_TANGENT_COSINE => {
            c.fail(format!("tangent of {u}, where it has a pole"))
        }
        _ => Ok(c.n(0).unary(Unary::Tan)),
    }
}

pub(super) fn asin<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    in_unit(c, Unary::Asin)
}

pub(super) fn acos<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    in_unit(c, Unary::Acos)
}

fn in_unit<'c, M: Machine>(c: &mut Call<'c, M>, op: Unary) -> Outcome<'c, M> {
    match c.value(&c.n(0)) {
        Some(u) if u.abs() > 1.0 => c.fail(format!("the argument {u} is outside -1 to 1")),
        _ => Ok(c.n(0).unary(op)),
    }
}

pub(super) fn modulo<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let round = |i: usize| (c.n(i) + 0.5).floor();
    let (u, v) = (round(0), round(1));
    Ok(u.native(Native::Fmod, &[&v]))
}

/// Returns the sign of u; 1 in strict mode, as the reference implementation does.
pub(super) fn sign<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    Ok(if c.strict {
        c.c(1.0)
    } else {
        c.n(0).unary(Unary::Sign)
    })
}
