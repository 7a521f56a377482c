//! Seam curves covered twice: the involution that pairs the directions with a common image.
//!
//! A seam curve c(a : b) of degree q, its forms without a common factor, is a map of degree k, a
//! divisor of q, onto its image. Over a general point (1 : m) the greatest common divisor of the
//! minors of c(x) and c(1 : m) has the degree k; it has a higher degree only where the image is
//! singular, for fewer than q² values of m. For k = 2 the two directions of a pair are exchanged by
//! an involution α·y·y′ + β·(y + y′) + γ = 0 of y = b/a, which two pairs determine. In a fixed
//! direction of the involution the seam turns back: a pinch point.

use crate::base::BinaryForm;
use crate::coefficients::{Coefficients, divide, trim};
use crate::field::{Algebraic, Element, NumberField};
use crate::univariate::gcd;
use isoform_algebra::RBig;
use isoform_control::{Control, Stopped};
use std::cmp::Ordering;

/// Involution that exchanges the two directions with a common image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Involution {
    /// Coefficients α, β, γ.
    form: [f64; 3],
    /// True if the involution has two real fixed directions, false if it has none.
    folds: bool,
}

/// Linear condition on (α : β : γ) imposed by a pair of directions.
type Condition = [Element; 3];

impl Involution {
    /// Returns the involution of a seam curve, if the curve covers its image exactly twice.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn find(
        curve: &[BinaryForm; 4],
        control: &Control<'_>,
    ) -> Result<Option<Self>, Stopped> {
        let q = curve[0].degree();
        if q < 2 || !q.is_multiple_of(2) {
            return Ok(None);
        }
        let first = &curve[0].coefficients[0];
        let (field, root) = (first.field(), first.root());
        let mut pairs: Vec<Condition> = Vec::new();
        for m in (0..=q * q).map(RBig::from) {
            let fibre = Fibre::over(curve, &m, control)?;
            match fibre.degree() {
                1 => return Ok(None),
                2 => pairs.push(fibre.condition(field, &m)),
                _ => {}
            }
        }
        let Some(form) = pairs
            .split_first()
            .and_then(|(first, rest)| rest.iter().find_map(|other| meet(field, first, other)))
        else {
            return Ok(None);
        };
        let number = |e: Element| Algebraic::new(field, root, e);
        let folds = number(discriminant(field, &form)).sign() == Ordering::Greater;
        Ok(Some(Self {
            form: form.map(|e| number(e).to_f64()),
            folds,
        }))
    }

    /// Returns the other direction with an identical image.
    pub(crate) fn partner(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let [x, y, z] = self.form;
        [x * b + y * a, -(y * b + z * a)]
    }

    /// Returns the fixed directions.
    pub(crate) fn fixed(&self) -> Vec<[f64; 2]> {
        if !self.folds {
            return Vec::new();
        }
        let [x, y, z] = self.form;
        // x·b² + 2y·a·b + z·a² = 0, without cancellation.
        let r = (y * y - x * z).sqrt();
        let s = if y < 0.0 { -y + r } else { -y - r };
        vec![[x, s], [s, z]]
    }
}

/// Directions whose image is that of a direction (1 : m).
struct Fibre {
    /// Polynomial in y = b/a whose roots are the directions, (1 : m) included.
    common: Coefficients,
    /// Multiplicity of the direction (0 : 1) among them.
    vertical: usize,
}

impl Fibre {
    /// Returns the fibre over the image of (1 : m): the common zeros of the minors of c(x) and c(1
    /// : m).
    fn over(curve: &[BinaryForm; 4], m: &RBig, control: &Control<'_>) -> Result<Self, Stopped> {
        let field = curve[0].coefficients[0].field();
        let value = |f: &BinaryForm| f.eval(&RBig::ONE, m).element().clone();
        let at = curve.each_ref().map(value);
        // The power of a that divides all minors is lost where these are trimmed.
        let q = curve[0].degree();
        let (mut common, mut vertical) = (Coefficients::new(), q);
        for (i, j) in (0..4).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let mut minor = minor([&curve[i], &curve[j]], [&at[i], &at[j]]);
            trim(&mut minor);
            if !minor.is_empty() {
                vertical = vertical.min(q + 1 - minor.len());
                common = gcd(field, &common, &minor, control)?;
            }
        }
        Ok(Self { common, vertical })
    }
    /// Returns the number of directions, with multiplicities.
    fn degree(&self) -> usize {
        self.common.len() - 1 + self.vertical
    }
    /// Returns the condition imposed by (1 : m) and the other direction of a fibre of two.
    fn condition(&self, field: &NumberField, m: &RBig) -> Condition {
        let one = || Element::rational(&RBig::ONE);
        let (a, b) = if self.vertical == 1 {
            (Element::zero(), one())
        } else {
            let known = vec![Element::rational(&-m.clone()), one()];
            (one(), divide(field, &self.common, &known).0[0].negated())
        };
        [b.scaled(m), a.scaled(m).add(&b), a]
    }
}

/// Returns the form that satisfies two linear conditions, their cross product; `None` if they
/// coincide.
fn meet(field: &NumberField, first: &Condition, second: &Condition) -> Option<[Element; 3]> {
    let minor = |i: usize, j: usize| {
        let product = field.mul(&first[i], &second[j]);
        product.sub(&field.mul(&first[j], &second[i]))
    };
    let form = [minor(1, 2), minor(2, 0), minor(0, 1)];
    form.iter().any(|e| !e.is_zero()).then_some(form)
}

/// Returns the minor c₁(x)·a₂ − c₂(x)·a₁ of two coordinates of a curve and their values at a point.
fn minor(coordinates: [&BinaryForm; 2], values: [&Element; 2]) -> Coefficients {
    let [first, second] = coordinates.map(|c| &c.coefficients);
    let field = first[0].field();
    let terms = first.iter().zip(second).map(|(x, y)| {
        let product = field.mul(x.element(), values[1]);
        product.sub(&field.mul(y.element(), values[0]))
    });
    terms.collect()
}

/// Returns β² − αγ of the form α, β, γ.
fn discriminant(field: &NumberField, [alpha, beta, gamma]: &[Element; 3]) -> Element {
    field.mul(beta, beta).sub(&field.mul(alpha, gamma))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(forms: [&[i64]; 4]) -> [BinaryForm; 4] {
        forms.map(|f| BinaryForm {
            coefficients: f
                .iter()
                .map(|&c| Algebraic::rational(&RBig::from(c)))
                .collect(),
        })
    }
    fn involution(forms: [&[i64]; 4]) -> Option<Involution> {
        Involution::find(&curve(forms), &Control::default()).expect("not stopped")
    }

    /// The conoid of Plücker: z = 2ab/(a² + b²).
    #[test]
    fn exchanges_the_directions_of_a_fold() {
        let found = involution([&[0, 0, 0], &[0, 0, 0], &[0, 2, 0], &[1, 0, 1]]).expect("twice");
        let is = |x: [f64; 2], y: [f64; 2]| (x[0] * y[1] - x[1] * y[0]).abs() < 1e-15;
        assert!(
            is(found.partner([1.0, 3.0]), [3.0, 1.0]) && is(found.partner([1.0, 0.0]), [0.0, 1.0])
        );
        let fixed = found.fixed();
        assert!(
            fixed.len() == 2 && fixed.iter().all(|f| f[0].abs() == f[1].abs()),
            "{fixed:?}"
        );
    }

    /// z = a²/b² folds at 0 and infinity; z = (a² − b²)/(a·b) has no fold, as (a : b) and (b : −a)
    /// are the pairs.
    #[test]
    fn special_directions() {
        let found = involution([&[0, 0, 0], &[0, 0, 0], &[1, 0, 0], &[0, 0, 1]]).expect("twice");
        assert_eq!(found.fixed().len(), 2);
        let found = involution([&[0, 0, 0], &[0, 0, 0], &[1, 0, -1], &[0, 1, 0]]).expect("twice");
        assert_eq!(found.fixed(), Vec::<[f64; 2]>::new());
        assert_eq!(found.partner([1.0, 0.0])[0], 0.0);
    }

    #[test]
    fn curves_that_run_once() {
        // A conic, a line, a quartic with nodes.
        assert_eq!(
            involution([&[0, 1, 0], &[1, 0, 0], &[0, 0, 0], &[0, 0, 1]]),
            None
        );
        assert_eq!(involution([&[0, 1], &[1, 0], &[0, 0], &[1, 1]]), None);
        assert_eq!(
            involution([
                &[1, 0, 0, 0, 0],
                &[0, 1, 0, 2, 0],
                &[0, 0, 3, 0, 0],
                &[0, 1, 0, 0, 1]
            ]),
            None
        );
    }
}
