//! Pinch points: isolated parameters at which the rank of the Jacobian drops.

use crate::field::{Algebraic, Element, NumberField};
use crate::map::Map;
use crate::singular::signed_minors;
use crate::zeros::common_zeros;
use isoform_algebra::{Poly, RBig};
use isoform_control::{Control, Stopped};

/// Returns the real isolated points (s : t : w) at which the rank of the Jacobian drops, without
/// base points.
///
/// They are the common zeros of the four signed 3 × 3 minors of the forms' Jacobian, divided by
/// their greatest common divisor. At a general one of them the surface has a pinch point, where a
/// double curve turns from one with real parameters into a solitary one.
///
/// ```
/// use isoform_tess::{Control, Map, pinch_points};
///
/// // The umbrella of Whitney, y² = x² z, has one pinch point in space, and one at infinity.
/// let map = Map::parse(["s", "s*t", "t^2", "1"], Default::default())?;
/// let found = pinch_points(&map, &Control::default())?;
/// let found: Vec<[f64; 3]> = found.iter().map(|p| p.each_ref().map(|x| x.to_f64())).collect();
/// assert!(found.contains(&[0.0, 0.0, 1.0]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Stopped`].
pub fn pinch_points(map: &Map, control: &Control<'_>) -> Result<Vec<[Algebraic; 3]>, Stopped> {
    pinches(map, &reduced_minors(map, control)?, control)
}

/// Returns the signed minors divided by their greatest common divisor.
pub(super) fn reduced_minors(map: &Map, control: &Control<'_>) -> Result<[Poly; 4], Stopped> {
    let minors = signed_minors(map, control)?;
    let mut common = Poly::zero();
    for m in &minors {
        control.check()?;
        common = common.gcd(m);
    }
    Ok(minors
        .each_ref()
        .map(|m| m.div_exact(&common).expect("a common divisor divides")))
}

/// Returns the real zeros of the reduced minors that are not base points.
pub(super) fn pinches(
    map: &Map,
    minors: &[Poly; 4],
    control: &Control<'_>,
) -> Result<Vec<[Algebraic; 3]>, Stopped> {
    let mut found = Vec::new();
    for zero in common_zeros(minors, true, control)? {
        let at = zero.homogeneous();
        let mut is_base = true;
        for form in map.forms() {
            control.check()?;
            is_base &= value(&zero.field, form, &at).is_zero();
        }
        if !is_base {
            found.extend(zero.real());
        }
    }
    Ok(found)
}

/// Returns the value of a form in three variables at a point over a number field.
fn value(field: &NumberField, form: &Poly, at: &[Element; 3]) -> Element {
    let powers = [0, 1, 2].map(|v| {
        let mut powers = vec![Element::rational(&RBig::ONE)];
        for i in 0..form.degree(v) {
            powers.push(field.mul(&powers[i], &at[v]));
        }
        powers
    });
    let mut sum = Element::zero();
    for (e, c) in form.terms() {
        let [s, t, w] = [0, 1, 2].map(|v| &powers[v][usize::from(e[v])]);
        let monomial = field.mul(&field.mul(s, t), w);
        sum = sum.add(&monomial.scaled(&RBig::from(c.clone())));
    }
    sum
}
