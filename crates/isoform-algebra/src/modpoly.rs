//! Dense univariate polynomials modulo a prime: `Vec<u64>` of Montgomery residues, lowest
//! coefficient first, without zeros at the top (the zero polynomial is empty). The algorithms are
//! in the textbook (J. von zur Gathen, J. Gerhard, *Modern Computer Algebra*).

use crate::modular::Fp;

pub(crate) fn trim(a: &mut Vec<u64>) {
    while a.last() == Some(&0) {
        a.pop();
    }
}

pub(crate) fn eval(f: &Fp, a: &[u64], x: u64) -> u64 {
    a.iter().rev().fold(0, |sum, &c| f.add(f.mul(sum, x), c))
}

pub(crate) fn scale(f: &Fp, a: &[u64], c: u64) -> Vec<u64> {
    a.iter().map(|&v| f.mul(v, c)).collect()
}

pub(crate) fn add(f: &Fp, a: &[u64], b: &[u64]) -> Vec<u64> {
    let (long, short) = if a.len() >= b.len() { (a, b) } else { (b, a) };
    let mut sum = long.to_vec();
    for (s, &v) in sum.iter_mut().zip(short) {
        *s = f.add(*s, v);
    }
    trim(&mut sum);
    sum
}

pub(crate) fn sub(f: &Fp, a: &[u64], b: &[u64]) -> Vec<u64> {
    let mut difference = a.to_vec();
    difference.resize(a.len().max(b.len()), 0);
    for (s, &v) in difference.iter_mut().zip(b) {
        *s = f.sub(*s, v);
    }
    trim(&mut difference);
    difference
}

pub(crate) fn mul(f: &Fp, a: &[u64], b: &[u64]) -> Vec<u64> {
    if a.is_empty() || b.is_empty() {
        return Vec::new();
    }
    let mut product = vec![0; a.len() + b.len() - 1];
    for (i, &x) in a.iter().enumerate() {
        if x != 0 {
            for (j, &y) in b.iter().enumerate() {
                product[i + j] = f.add(product[i + j], f.mul(x, y));
            }
        }
    }
    product
}

/// Replaces a by the remainder of a by b, and returns the quotient. b must not be zero.
pub(crate) fn div_rem(f: &Fp, a: &mut Vec<u64>, b: &[u64]) -> Vec<u64> {
    if a.len() < b.len() {
        return Vec::new();
    }
    let n = b.len() - 1;
    let lead = b[n];
    let inverse = if lead == f.one() { lead } else { f.inv(lead) };
    let mut quotient = vec![0; a.len() - n];
    for i in (0..quotient.len()).rev() {
        let q = f.mul(a[i + n], inverse);
        quotient[i] = q;
        if q != 0 {
            for (j, &v) in b[..n].iter().enumerate() {
                a[i + j] = f.sub(a[i + j], f.mul(q, v));
            }
        }
    }
    a.truncate(n);
    trim(a);
    quotient
}

pub(crate) fn rem(f: &Fp, mut a: Vec<u64>, b: &[u64]) -> Vec<u64> {
    div_rem(f, &mut a, b);
    a
}

pub(crate) fn monic(f: &Fp, a: &[u64]) -> Vec<u64> {
    match a.last() {
        Some(&lead) if lead != f.one() => scale(f, a, f.inv(lead)),
        _ => a.to_vec(),
    }
}

/// Returns the monic greatest common divisor; empty if both are zero.
pub(crate) fn gcd(f: &Fp, a: &[u64], b: &[u64]) -> Vec<u64> {
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    if a.len() < b.len() {
        std::mem::swap(&mut a, &mut b);
    }
    while !b.is_empty() {
        div_rem(f, &mut a, &b);
        std::mem::swap(&mut a, &mut b);
    }
    monic(f, &a)
}

/// Returns (g, u, v) with u·a + v·b = g, the monic greatest common divisor, by the extended
/// Euclidean algorithm.
pub(crate) fn gcd_extended(f: &Fp, a: &[u64], b: &[u64]) -> (Vec<u64>, Vec<u64>, Vec<u64>) {
    let (mut r0, mut r1) = (a.to_vec(), b.to_vec());
    let (mut u0, mut u1) = (vec![f.one()], Vec::new());
    let (mut v0, mut v1) = (Vec::new(), vec![f.one()]);
    while !r1.is_empty() {
        let q = div_rem(f, &mut r0, &r1);
        std::mem::swap(&mut r0, &mut r1);
        for (x0, x1) in [(&mut u0, &mut u1), (&mut v0, &mut v1)] {
            *x0 = sub(f, x0, &mul(f, &q, x1));
            std::mem::swap(x0, x1);
        }
    }
    match r0.last() {
        Some(&lead) => [r0, u0, v0].map(|p| scale(f, &p, f.inv(lead))).into(),
        None => (r0, u0, v0),
    }
}

pub(crate) fn derivative(f: &Fp, a: &[u64]) -> Vec<u64> {
    let mut d: Vec<u64> = a
        .iter()
        .enumerate()
        .skip(1)
        .map(|(i, &c)| f.mul(c, f.of_u64(i as u64)))
        .collect();
    trim(&mut d);
    d
}

/// Returns the power base^n modulo `modulus`, by squaring.
pub(crate) fn pow_mod(f: &Fp, base: &[u64], mut n: u64, modulus: &[u64]) -> Vec<u64> {
    let mut result = rem(f, vec![f.one()], modulus);
    let mut base = rem(f, base.to_vec(), modulus);
    while n > 0 {
        if n & 1 == 1 {
            result = rem(f, mul(f, &result, &base), modulus);
        }
        n >>= 1;
        if n > 0 {
            base = rem(f, mul(f, &base, &base), modulus);
        }
    }
    result
}

/// Replaces a by the remainder by b of its product with a power of the leading coefficient of b,
/// and returns the exponent. This avoids an inverse, which costs as much as some hundred products.
fn pseudo_rem(f: &Fp, a: &mut Vec<u64>, b: &[u64]) -> u64 {
    let n = b.len() - 1;
    let lead = b[n];
    let mut exponent = 0;
    while a.len() > n {
        let q = a.pop().expect("longer than the divisor");
        if q == 0 {
            continue;
        }
        exponent += 1;
        let at = a.len() - n;
        let (low, high) = a.split_at_mut(at);
        low.iter_mut().for_each(|x| *x = f.mul(*x, lead));
        for (x, &v) in high.iter_mut().zip(b) {
            *x = f.sub(f.mul(*x, lead), f.mul(q, v));
        }
    }
    trim(a);
    exponent
}

/// Returns Res(a, b) of two polynomials by Euclid's algorithm; zero if one of them is zero.
pub(crate) fn resultant(f: &Fp, a: &[u64], b: &[u64]) -> u64 {
    if a.is_empty() || b.is_empty() {
        return 0;
    }
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    // The result is the resultant of the current pair times the one, divided by the other.
    let (mut factor, mut divisor) = (f.one(), f.one());
    let mut negative = false;
    if a.len() < b.len() {
        std::mem::swap(&mut a, &mut b);
        negative ^= (a.len() - 1) & (b.len() - 1) & 1 == 1;
    }
    loop {
        // Res(a, b) = (−1)^(nm) Res(b, a) = (−1)^(nm) lc(b)^(n − k) Res(b, r) for r = a mod b of
        // degree k; and Res(b, c r) = c^m Res(b, r).
        let (n, m) = (a.len() - 1, b.len() - 1);
        if m == 0 {
            let r = f.mul(factor, f.pow(b[0], n as u64));
            let r = f.div(r, divisor);
            return if negative { f.neg(r) } else { r };
        }
        let lead = b[m];
        let exponent = pseudo_rem(f, &mut a, &b) * m as u64;
        if a.is_empty() {
            return 0;
        }
        negative ^= n & m & 1 == 1;
        let gained = (n + 1 - a.len()) as u64;
        if gained > exponent {
            factor = f.mul(factor, f.pow(lead, gained - exponent));
        } else {
            divisor = f.mul(divisor, f.pow(lead, exponent - gained));
        }
        std::mem::swap(&mut a, &mut b);
    }
}

/// Returns the inverses 1/k for k = 1 … n, at index k; index 0 is unused.
pub(crate) fn small_inverses(f: &Fp, n: usize) -> Vec<u64> {
    let mut factorials = vec![f.one(); n + 1];
    for k in 1..=n {
        factorials[k] = f.mul(factorials[k - 1], f.of_u64(k as u64));
    }
    let mut inverse = f.inv(factorials[n]);
    let mut result = vec![0; n + 1];
    for k in (1..=n).rev() {
        result[k] = f.mul(inverse, factorials[k - 1]);
        inverse = f.mul(inverse, f.of_u64(k as u64));
    }
    result
}

/// Returns the polynomial of degree below n with given values at the increasing integers `nodes`,
/// by Newton's divided differences and Horner's rule; `inverses` are from [`small_inverses`], up to
/// the largest difference of nodes.
pub(crate) fn interpolate(f: &Fp, nodes: &[usize], values: &[u64], inverses: &[u64]) -> Vec<u64> {
    let n = values.len();
    let mut c = values.to_vec();
    for level in 1..n {
        for i in (level..n).rev() {
            c[i] = f.mul(f.sub(c[i], c[i - 1]), inverses[nodes[i] - nodes[i - level]]);
        }
    }
    let nodes: Vec<u64> = nodes.iter().map(|&x| f.of_u64(x as u64)).collect();
    newton_to_monomial(f, &nodes, &mut c);
    trim(&mut c);
    c
}

/// Converts coefficients in the basis 1, (x − x₀), (x − x₀)(x − x₁), … to coefficients of powers of
/// x, in place.
pub(crate) fn newton_to_monomial(f: &Fp, nodes: &[u64], c: &mut [u64]) {
    let n = c.len();
    for i in (0..n.saturating_sub(1)).rev() {
        let x = nodes[i];
        for j in i..n - 1 {
            c[j] = f.sub(c[j], f.mul(x, c[j + 1]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modular::primes;

    fn random(f: &Fp, rng: &mut fastrand::Rng, n: usize) -> Vec<u64> {
        (0..n).map(|_| f.of_u64(rng.u64(1..))).collect()
    }

    #[test]
    fn identities_of_the_ring() {
        let f = primes().next().expect("a prime");
        let mut rng = fastrand::Rng::with_seed(1);
        for _ in 0..50 {
            let sizes: [usize; 3] = std::array::from_fn(|_| rng.usize(1..9));
            let [a, b, c] = sizes.map(|n| random(&f, &mut rng, n));
            let mut r = a.clone();
            let q = div_rem(&f, &mut r, &b);
            assert_eq!(add(&f, &mul(&f, &q, &b), &r), a);
            let (ac, bc) = (mul(&f, &a, &c), mul(&f, &b, &c));
            assert_eq!(
                gcd(&f, &ac, &bc),
                monic(&f, &c),
                "random polynomials have no common factor"
            );
            let (g, u, v) = gcd_extended(&f, &ac, &bc);
            assert_eq!(add(&f, &mul(&f, &u, &ac), &mul(&f, &v, &bc)), g);
            // The resultant is multiplicative: Res(ab, c) = Res(a, c) Res(b, c).
            let product = f.mul(resultant(&f, &a, &c), resultant(&f, &b, &c));
            assert_eq!(resultant(&f, &mul(&f, &a, &b), &c), product);
            let nodes: Vec<usize> = (0..a.len()).map(|i| i * i + 2).collect();
            let values: Vec<u64> = nodes
                .iter()
                .map(|&x| eval(&f, &a, f.of_u64(x as u64)))
                .collect();
            assert_eq!(interpolate(&f, &nodes, &values, &small_inverses(&f, 70)), a);
        }
        // Res(x − 2, x − 5) = −3 and Res(x² − 2, x − 5) = 23.
        let poly = |c: &[i64]| c.iter().map(|&v| f.of_i64(v)).collect::<Vec<_>>();
        assert_eq!(
            resultant(&f, &poly(&[-2, 1]), &poly(&[-5, 1])),
            f.of_i64(-3)
        );
        assert_eq!(
            resultant(&f, &poly(&[-2, 0, 1]), &poly(&[-5, 1])),
            f.of_i64(23)
        );
    }
}
