//! Univariate polynomials over a number field, and extensions of number fields.
//!
//! Extensions follow B. M. Trager (SYMSAC 1976): the norm of a squarefree polynomial is squarefree
//! after a shift by a multiple of the generator, and its factors over Q define the fields.

use crate::coefficients::{Coefficients, divide, monic, trim};
use crate::field::{Element, NumberField};
use crate::residues;
use dashu_base::Gcd;
use isoform_algebra::{FactorError, IBig, Poly, RBig, ResultantError, UBig, UPoly, resultant};
use isoform_control::{Control, Stopped};
use std::sync::Arc;

/// Returns the monic greatest common divisor; empty if both are zero.
pub(crate) fn gcd(
    k: &NumberField,
    p: &Coefficients,
    q: &Coefficients,
    control: &Control<'_>,
) -> Result<Coefficients, Stopped> {
    if k.degree() == 1 && !p.is_empty() && !q.is_empty() {
        // Over Q there is a modular algorithm.
        return Ok(monic(k, &from_upoly(&to_upoly(p).gcd(&to_upoly(q)))));
    }
    match (p.last(), q.last()) {
        (None, None) => Ok(Vec::new()),
        (Some(lead), None) | (None, Some(lead)) if lead.as_rational().is_some() => {
            Ok(monic(k, if q.is_empty() { p } else { q }))
        }
        _ => residues::gcd(k, p, q, control),
    }
}

fn to_upoly(p: &Coefficients) -> UPoly {
    let values: Vec<RBig> = p
        .iter()
        .map(|c| c.as_rational().expect("a field of degree 1"))
        .collect();
    let denominator = values.iter().fold(UBig::ONE, |l, r| {
        &l / (&l).gcd(r.denominator()) * r.denominator()
    });
    UPoly::new(
        values
            .iter()
            .map(|r| r.numerator() * IBig::from(&denominator / r.denominator()))
            .collect(),
    )
}

pub(crate) fn from_upoly(p: &UPoly) -> Coefficients {
    p.coefficients()
        .iter()
        .map(|c| Element::rational(&RBig::from(c.clone())))
        .collect()
}

/// Returns the product of the distinct monic irreducible factors.
pub(crate) fn squarefree_part(
    k: &NumberField,
    p: &Coefficients,
    control: &Control<'_>,
) -> Result<Coefficients, Stopped> {
    let p = monic(k, p);
    let derivative: Coefficients = p
        .iter()
        .enumerate()
        .skip(1)
        .map(|(i, c)| c.scaled(&RBig::from(i)))
        .collect();
    let repeated = gcd(k, &p, &derivative, control)?;
    Ok(divide(k, &p, &repeated).0)
}

/// An extension of a number field.
pub(crate) struct Extension {
    pub(crate) field: Arc<NumberField>,
    /// Generator of the base field.
    pub(crate) theta: Element,
    /// Root of the polynomial by which the field was extended.
    pub(crate) root: Element,
}

/// Returns the fields of the roots of a squarefree polynomial, one for each class of roots that are
/// conjugate over Q; if `real`, only those with a real root and a real image of the generator.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn roots(
    k: &Arc<NumberField>,
    p: &Coefficients,
    real: bool,
    control: &Control<'_>,
) -> Result<Vec<Extension>, Stopped> {
    match p.len() {
        0 | 1 => Ok(Vec::new()),
        2 => Ok(vec![Extension {
            field: Arc::clone(k),
            theta: k.generator(),
            root: k.div(&p[0], &p[1]).negated(),
        }]),
        _ if k.degree() == 1 => rational_roots(k, p, real, control),
        _ => extensions(k, p, real, control),
    }
}

/// Returns the fields of the roots of a polynomial over Q.
fn rational_roots(
    k: &Arc<NumberField>,
    p: &Coefficients,
    real: bool,
    control: &Control<'_>,
) -> Result<Vec<Extension>, Stopped> {
    let factors = to_upoly(p).factor(control);
    let factors = factors.map_err(FactorError::only_stopped)?;
    let fields = factors.into_iter().map(|(h, _)| NumberField::new(&h));
    let wanted = fields.filter(|(field, _)| !real || !field.real_roots().is_empty());
    let extension = |(field, root)| Extension {
        theta: k.generator(),
        field,
        root,
    };
    Ok(wanted.map(extension).collect())
}

/// Returns the fields of the roots of a polynomial over a field of degree 2 or more, by factoring
/// its norm after a shift.
fn extensions(
    k: &Arc<NumberField>,
    p: &Coefficients,
    real: bool,
    control: &Control<'_>,
) -> Result<Vec<Extension>, Stopped> {
    // p as a polynomial in θ (variable 0) and y (variable 1), up to a rational factor.
    let both = p.iter().enumerate().fold(Poly::zero(), |sum, (j, c)| {
        sum + to_poly(c) * Poly::var(1).pow(j as u32)
    });
    let modulus = Poly::from_upoly(k.modulus(), 0);
    for shift in shifts() {
        control.check()?;
        // Substitutes λ = y + shift·θ for y.
        let by = Poly::var(1) - Poly::var(0).scale(&RBig::from(shift));
        let shifted = both.substitute(1, &by);
        let norm = resultant(&modulus, &shifted, 0, control);
        let norm = norm.map_err(ResultantError::only_stopped)?.to_upoly(1);
        let norm = norm.expect("θ was eliminated");
        if norm.squarefree_part().degree() < norm.degree() {
            continue;
        }
        let mut found = Vec::new();
        for (h, _) in norm.factor(control).map_err(FactorError::only_stopped)? {
            let (field, lambda) = NumberField::new(&h);
            if !real || !field.real_roots().is_empty() {
                let theta = common_root(&field, &lambda, k.modulus(), &shifted, control)?;
                let root = lambda.sub(&theta.scaled(&RBig::from(shift)));
                found.push(Extension { field, theta, root });
            }
        }
        return Ok(found);
    }
    unreachable!("all but finitely many shifts separate")
}

/// Returns θ in the field of λ: the only common root of its modulus and of the shifted polynomial.
fn common_root(
    field: &NumberField,
    lambda: &Element,
    modulus: &UPoly,
    shifted: &Poly,
    control: &Control<'_>,
) -> Result<Element, Stopped> {
    let coefficients = shifted.coefficients_in(0);
    let values = coefficients.iter().map(|c| field.eval(c, 1, lambda));
    let mut column: Coefficients = values.collect();
    trim(&mut column);
    let common = gcd(field, &from_upoly(modulus), &column, control)?;
    assert_eq!(common.len(), 2, "a separating shift");
    Ok(common[0].negated())
}

/// Iterates over 0, 1, −1, 2, −2, …
pub(crate) fn shifts() -> impl Iterator<Item = i64> {
    (0..).map(|i: i64| if i % 2 == 1 { (i + 1) / 2 } else { -i / 2 })
}

/// Returns an element as a polynomial in variable 0.
pub(crate) fn to_poly(e: &Element) -> Poly {
    let (numerator, denominator) = e.parts();
    let terms = numerator
        .iter()
        .enumerate()
        .map(|(i, c)| ([i as u16, 0, 0, 0], c.clone()));
    Poly::from_integers(terms, denominator)
}
