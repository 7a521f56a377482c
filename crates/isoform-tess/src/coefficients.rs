//! Coefficients of univariate polynomials over a number field: normal form and division.
//!
//! Coefficients are stored lowest first, the last one not zero; the zero polynomial is empty.

use crate::field::{Element, NumberField};

/// Coefficients, lowest first.
pub(crate) type Coefficients = Vec<Element>;

pub(crate) fn trim(p: &mut Coefficients) {
    while p.last().is_some_and(Element::is_zero) {
        p.pop();
    }
}

/// Returns the multiple with the leading coefficient 1.
pub(crate) fn monic(k: &NumberField, p: &Coefficients) -> Coefficients {
    let Some(lead) = p.last() else {
        return Vec::new();
    };
    let inverse = k.inverse(lead);
    p.iter().map(|c| k.mul(c, &inverse)).collect()
}

/// Returns quotient and remainder by a monic divisor.
pub(crate) fn divide(
    k: &NumberField,
    p: &Coefficients,
    divisor: &Coefficients,
) -> (Coefficients, Coefficients) {
    let mut rest = p.clone();
    let d = divisor.len() - 1;
    let mut quotient = vec![Element::zero(); p.len().saturating_sub(d)];
    while rest.len() > d {
        let offset = rest.len() - 1 - d;
        let top = rest.pop().expect("a coefficient above the degree");
        if !top.is_zero() {
            for (i, c) in divisor[..d].iter().enumerate() {
                rest[offset + i] = rest[offset + i].sub(&k.mul(c, &top));
            }
        }
        quotient[offset] = top;
    }
    trim(&mut rest);
    trim(&mut quotient);
    (quotient, rest)
}
