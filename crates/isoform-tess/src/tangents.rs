//! Tangents of curves at base points, exactly, over the fields of these points.

use crate::base::{BasePoint, BinaryForm, BlowUp, Local, Near, expand, order};
use crate::coefficients::{self, Coefficients};
use crate::field::{Algebraic, Element, NumberField};
use crate::univariate;
use crate::zeros::Zero;
use isoform_algebra::{DOUBLED, Poly, RBig, RealRoot, real_roots, refine_until};
use isoform_control::{Control, Stopped};
use std::cmp::Ordering;
use std::sync::Arc;

/// Returns the terms of least degree of a curve in the local coordinates of a base point, or of the
/// last one of `chain`, each point of which is infinitely near to the one before; factors that
/// vanish on the exceptional lines are divided out. The degree is the multiplicity of the point on
/// the curve, and the zeros are the tangents.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn tangent_form(
    base: &BasePoint,
    chain: &[&Near],
    curve: &Poly,
    control: &Control<'_>,
) -> Result<BinaryForm, Stopped> {
    let (variables, _) = base.chart.variables();
    let first = &base.point[variables[0]];
    let (mut field, mut root) = (Arc::clone(first.field()), first.root());
    let zero = Zero {
        chart: base.chart,
        field: Arc::clone(&field),
        at: variables.map(|k| base.point[k].element().clone()),
    };
    let whole = curve.total_degree();
    let mut local = Local::new();
    let mut room = if chain.is_empty() { 1 } else { whole };
    // At the base point itself only the terms of least degree are needed.
    while local.is_empty() {
        control.check()?;
        local = expand(curve, &zero, room.min(whole));
        assert!(!local.is_empty() || room < whole, "a curve has terms");
        room *= 2;
    }
    for near in chain {
        control.check()?;
        let target = near.direction[0].field();
        let [across, along] = &near.direction;
        let there = BlowUp {
            from: &field,
            to: target,
            theta: &near.theta,
            direction: (!across.is_zero()).then_some(along.element()),
        };
        local = there.moved(&local, order(&local).expect("terms"));
        (field, root) = (Arc::clone(target), near.direction[0].root());
    }
    let order = order(&local).expect("terms");
    let number = |j: usize| local.get(&[order - j, j]).cloned().unwrap_or_default();
    let coefficients = (0..=order).map(|j| Algebraic::new(&field, root, number(j)));
    Ok(BinaryForm {
        coefficients: coefficients.collect(),
    })
}

/// Returns the real zeros (a, b) of a binary form that is not 0, each once; their number is exact,
/// their values are rounded.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn real_zeros(
    form: &BinaryForm,
    control: &Control<'_>,
) -> Result<Vec<[f64; 2]>, Stopped> {
    let first = &form.coefficients[0];
    let (k, root) = (first.field(), first.root());
    let elements = form.coefficients.iter().map(|c| c.element().clone());
    let mut p: Coefficients = elements.collect();
    let is_vertical = p.last().is_some_and(Element::is_zero);
    coefficients::trim(&mut p);
    let mut found = Vec::new();
    if p.len() > 1 {
        let p = univariate::squarefree_part(k, &p, control)?;
        let count = count_real_roots(k, root, &p, control)?;
        // Simple roots stay real and distinct under sufficiently small changes of the coefficients.
        // Coefficients start with 64 bits, slightly more than doubles have.
        let roots = refine_until(64, DOUBLED, control, |bits| {
            let roots = roots_nearly(k, root, &p, bits);
            Ok::<_, Stopped>(roots.filter(|r| r.len() == count))
        })?;
        found.extend(roots.iter().map(|r| [1.0, r.to_f64()]));
    }
    if is_vertical {
        found.push([0.0, 1.0]);
    }
    Ok(found)
}

/// Returns the real roots of a polynomial with its coefficients rounded to a number of bits; `None`
/// if it is zero.
fn roots_nearly(
    k: &Arc<NumberField>,
    root: usize,
    p: &Coefficients,
    bits: usize,
) -> Option<Vec<RealRoot>> {
    let number = |(j, c): (usize, &Element)| {
        let (lo, hi) = Algebraic::new(k, root, c.clone()).interval(bits);
        ([j as u16, 0, 0, 0], (lo + hi) / RBig::from(2))
    };
    let near = Poly::from_terms(p.iter().enumerate().map(number));
    near.to_upoly(0).map(|p| real_roots(&p.squarefree_part()))
}

/// Returns the number of real roots of a squarefree polynomial, by Sturm's theorem.
fn count_real_roots(
    k: &Arc<NumberField>,
    root: usize,
    p: &Coefficients,
    control: &Control<'_>,
) -> Result<usize, Stopped> {
    let derivative = (1..p.len()).map(|i| p[i].scaled(&RBig::from(i)));
    let (mut before, mut here) = (p.clone(), derivative.collect::<Coefficients>());
    // The signs at −∞ and +∞.
    let signs = |p: &Coefficients| {
        let lead = p.last().expect("a polynomial that is not 0");
        let sign = Algebraic::new(k, root, lead.clone()).sign();
        let is_odd = p.len().is_multiple_of(2);
        [if is_odd { sign.reverse() } else { sign }, sign]
    };
    let mut changes = [0; 2];
    let mut last: [Ordering; 2] = signs(&before);
    while !here.is_empty() {
        control.check()?;
        let now = signs(&here);
        for i in 0..2 {
            changes[i] += usize::from(now[i] != last[i]);
        }
        last = now;
        let (_, rest) = coefficients::divide(k, &before, &coefficients::monic(k, &here));
        before = std::mem::replace(&mut here, rest.iter().map(Element::negated).collect());
    }
    Ok(changes[0] - changes[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::base_points;
    use crate::map::{Map, MapOptions};
    use isoform_algebra::UPoly;

    /// A multiple of √2 beyond the range of doubles is not taken for 0 or infinity.
    #[test]
    fn coefficients_beyond_doubles() {
        let (field, root) = NumberField::new(&UPoly::from_i64(&[-2, 0, 1]));
        let power = (0..400).fold(RBig::ONE, |p, _| p * RBig::from(10));
        let at = |index: usize| {
            let coefficients = [root.scaled(&power), Element::rational(&-&power)];
            let number = |c: Element| Algebraic::new(&field, index, c);
            BinaryForm {
                coefficients: coefficients.map(number).to_vec(),
            }
        };
        for (index, sign) in [(0, -1.0), (1, 1.0)] {
            let found = real_zeros(&at(index), &Control::default()).unwrap();
            assert_eq!(found, [[1.0, sign * 2f64.sqrt()]]);
        }
    }

    /// The form (b − √3 a)² (b² + a²) a has one double tangent, two that are not real, and the
    /// second axis. With rounded coefficients the double one would become two or none.
    #[test]
    fn double_tangents_are_one() {
        let (field, root) = NumberField::new(&UPoly::from_i64(&[-3, 0, 1]));
        let n = |n: i64| Element::rational(&RBig::from(n));
        // The coefficients of (3 − 2 √3 t + t²)(1 + t²), and 0 for t⁵.
        let minus = root.scaled(&RBig::from(-2));
        let terms = [n(3), minus.clone(), n(4), minus, n(1), Element::zero()];
        let coefficients = terms.map(|c| Algebraic::new(&field, 1, c)).to_vec();
        let found = real_zeros(&BinaryForm { coefficients }, &Control::default()).unwrap();
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0][1] - 3f64.sqrt()).abs() < 1e-15);
        assert_eq!(found[1], [0.0, 1.0]);
    }

    /// A curve with a cusp at (√2, 1/3) has one double tangent there.
    #[test]
    fn a_cusp_at_an_irrational_point() {
        // All forms vanish at s = ±√2, t = 1/3.
        let texts = ["s^2 - 2", "3*t - 1", "(s^2 - 2)*(3*t - 1)", "(s^2 - 2)^2"];
        let map = Map::parse(texts, MapOptions::default()).unwrap();
        let cusp = "(s^2 - 2)^3 - (3*t - 1)^2";
        let others = Map::parse(["1", "s", "t", cusp], MapOptions::default()).unwrap();
        let points = base_points(&map, &Control::default()).unwrap();
        let [here] = points
            .iter()
            .filter(|p| p.to_f64()[0] > 1.0)
            .collect::<Vec<_>>()[..]
        else {
            panic!("one base point with s = √2 in {points:?}");
        };
        let form = tangent_form(here, &[], &others.forms()[3], &Control::default()).unwrap();
        assert_eq!(form.degree(), 2);
        // The form −9 b², with b = 0 at t = 1/3: the tangent is t = 1/3.
        let found = real_zeros(&form, &Control::default()).unwrap();
        assert_eq!(found, [[1.0, 0.0]]);
    }
}
