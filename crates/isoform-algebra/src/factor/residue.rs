//! Polynomials with integer coefficients modulo a number, lowest first, not trimmed.

use dashu_base::RemEuclid;
use dashu_int::IBig;

/// Reduces coefficients to 0 … m − 1.
pub(super) fn reduce(a: Vec<IBig>, m: &IBig) -> Vec<IBig> {
    a.into_iter().map(|c| IBig::from(c.rem_euclid(m))).collect()
}
/// Returns a·b.
pub(super) fn mul(a: &[IBig], b: &[IBig], m: &IBig) -> Vec<IBig> {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let mut product = vec![IBig::ZERO; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    reduce(product, m)
}
/// Returns a + b, or a − b for the sign −1.
pub(super) fn combine(a: &[IBig], b: &[IBig], sign: i32, m: &IBig) -> Vec<IBig> {
    let mut sum = a.to_vec();
    sum.resize(a.len().max(b.len()), IBig::ZERO);
    for (s, v) in sum.iter_mut().zip(b) {
        *s += v * sign;
    }
    reduce(sum, m)
}
/// Returns the quotient and remainder by a monic polynomial.
pub(super) fn div_rem(mut a: Vec<IBig>, b: &[IBig], m: &IBig) -> (Vec<IBig>, Vec<IBig>) {
    let n = b.len() - 1;
    let mut quotient = vec![IBig::ZERO; a.len().saturating_sub(n)];
    for i in (0..quotient.len()).rev() {
        let q = IBig::from((&a[i + n]).rem_euclid(m));
        for (j, c) in b[..n].iter().enumerate() {
            a[i + j] -= &q * c;
        }
        quotient[i] = q;
    }
    a.truncate(n);
    (quotient, reduce(a, m))
}
