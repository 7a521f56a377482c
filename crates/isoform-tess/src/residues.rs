//! Greatest common divisors over a number field, by residues modulo primes.
//!
//! Modulo a prime, Q(θ) becomes F_p\[x\]/(p), in which Euclid's algorithm is cheap; the monic
//! divisor is recovered by Chinese remainders and rational reconstruction (L. Langemyr, S.
//! McCallum, J. Symbolic Comput. 8, 1989). If the modulus stays squarefree and a leading
//! coefficient stays invertible, the degree modulo the prime is at least the true one; a candidate
//! of that degree that divides both polynomials is proved.

use crate::coefficients::{Coefficients, divide};
use crate::field::{Element, NumberField};
use isoform_algebra::modular::{Crt, Fp, primes};
use isoform_algebra::{IBig, RBig, UBig};
use isoform_control::{Control, Stopped};

/// An element modulo a prime: coefficients of powers of θ, lowest first, trimmed.
type Residue = Vec<u64>;

/// F_p\[x\]/(m) for a monic m; a field only if m is irreducible modulo p.
struct Ring {
    field: Fp,
    modulus: Residue,
}

fn trim(p: &mut Residue) {
    while p.last() == Some(&0) {
        p.pop();
    }
}

impl Ring {
    /// Creates the ring; `None` if the modulus has a repeated factor modulo the prime.
    fn new(k: &NumberField, field: Fp) -> Option<Self> {
        let modulus: Residue = k
            .modulus()
            .coefficients()
            .iter()
            .map(|c| field.of_ibig(c))
            .collect();
        let mut derivative: Residue = k
            .modulus()
            .derivative()
            .coefficients()
            .iter()
            .map(|c| field.of_ibig(c))
            .collect();
        trim(&mut derivative);
        let ring = Self { field, modulus };
        ring.inverse(&derivative).map(|_| ring)
    }
    /// Reduces an element; `None` if the prime divides the denominator.
    fn residue(&self, e: &Element) -> Option<Residue> {
        let (numerator, denominator) = e.parts();
        let d = self.field.of_ubig(&denominator);
        if d == 0 {
            return None;
        }
        let inverse = self.field.inv(d);
        let mut r: Residue = numerator
            .iter()
            .map(|c| self.field.mul(self.field.of_ibig(c), inverse))
            .collect();
        trim(&mut r);
        Some(r)
    }
    /// Subtracts c·x^offset·b from a.
    fn subtract(&self, a: &mut Residue, c: u64, offset: usize, b: &[u64]) {
        if a.len() < b.len() + offset {
            a.resize(b.len() + offset, 0);
        }
        for (x, y) in a[offset..].iter_mut().zip(b) {
            *x = self.field.sub(*x, self.field.mul(c, *y));
        }
        trim(a);
    }
    fn sub(&self, a: &Residue, b: &Residue) -> Residue {
        let mut difference = a.clone();
        self.subtract(&mut difference, self.field.one(), 0, b);
        difference
    }
    fn mul(&self, a: &Residue, b: &Residue) -> Residue {
        if a.is_empty() || b.is_empty() {
            return Vec::new();
        }
        let mut product = vec![0; a.len() + b.len() - 1];
        for (i, x) in a.iter().enumerate() {
            for (j, y) in b.iter().enumerate() {
                product[i + j] = self.field.add(product[i + j], self.field.mul(*x, *y));
            }
        }
        trim(&mut product);
        while product.len() >= self.modulus.len() {
            let (offset, top) = (
                product.len() - self.modulus.len(),
                product[product.len() - 1],
            );
            self.subtract(&mut product, top, offset, &self.modulus);
        }
        product
    }
    /// Computes the inverse by Euclid's algorithm; `None` if it does not exist.
    fn inverse(&self, a: &Residue) -> Option<Residue> {
        let f = &self.field;
        // u·a ≡ r and v·a ≡ s modulo the modulus.
        let (mut r, mut s) = (self.modulus.clone(), a.clone());
        let (mut u, mut v): (Residue, Residue) = (Vec::new(), vec![f.one()]);
        while s.len() > 1 {
            let inverse = f.inv(s[s.len() - 1]);
            while r.len() >= s.len() {
                let (offset, c) = (r.len() - s.len(), f.mul(r[r.len() - 1], inverse));
                self.subtract(&mut r, c, offset, &s);
                self.subtract(&mut u, c, offset, &v);
            }
            (r, s, u, v) = (s, r, v, u);
        }
        let inverse = f.inv(*s.first()?);
        Some(v.iter().map(|&c| f.mul(c, inverse)).collect())
    }
    fn monic(&self, p: &[Residue]) -> Option<Vec<Residue>> {
        let inverse = self.inverse(p.last()?)?;
        Some(p.iter().map(|c| self.mul(c, &inverse)).collect())
    }
    /// Returns the monic greatest common divisor; `None` if a leading coefficient is not
    /// invertible.
    fn gcd(&self, p: Vec<Residue>, q: Vec<Residue>) -> Option<Vec<Residue>> {
        let (mut a, mut b) = if p.len() >= q.len() { (p, q) } else { (q, p) };
        while !b.is_empty() {
            b = self.monic(&b)?;
            while a.len() >= b.len() {
                let (offset, top) = (a.len() - b.len(), a[a.len() - 1].clone());
                for (i, c) in b.iter().enumerate() {
                    a[offset + i] = self.sub(&a[offset + i], &self.mul(c, &top));
                }
                while a.last().is_some_and(Vec::is_empty) {
                    a.pop();
                }
            }
            (a, b) = (b, a);
        }
        self.monic(&a)
    }
    fn polynomial(&self, p: &Coefficients) -> Option<Vec<Residue>> {
        let mut residues = p
            .iter()
            .map(|e| self.residue(e))
            .collect::<Option<Vec<_>>>()?;
        // If a leading coefficient vanishes, the degree of the divisor could become too low.
        if residues.last().is_some_and(Vec::is_empty) {
            return None;
        }
        while residues.last().is_some_and(Vec::is_empty) {
            residues.pop();
        }
        Some(residues)
    }
}

/// Returns the monic greatest common divisor of two polynomials, of which at most one is zero.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn gcd(
    k: &NumberField,
    p: &Coefficients,
    q: &Coefficients,
    control: &Control<'_>,
) -> Result<Coefficients, Stopped> {
    let mut lift = Lift::new(k.degree());
    for field in primes() {
        control.check()?;
        let Some((ring, divisor)) = residue_gcd(k, field, p, q) else {
            continue;
        };
        if divisor.len() == 1 {
            return Ok(vec![Element::rational(&RBig::ONE)]);
        }
        let Some(candidate) = lift.push(&ring, &divisor) else {
            continue;
        };
        let divides = |f: &Coefficients| f.is_empty() || divide(k, f, &candidate).1.is_empty();
        if divides(p) && divides(q) {
            return Ok(candidate);
        }
    }
    unreachable!("there are enough primes below 2^62")
}

/// Returns the greatest common divisor modulo a prime; `None` if the prime is unsuitable.
fn residue_gcd(
    k: &NumberField,
    field: Fp,
    p: &Coefficients,
    q: &Coefficients,
) -> Option<(Ring, Vec<Residue>)> {
    let ring = Ring::new(k, field)?;
    let divisor = ring.gcd(ring.polynomial(p)?, ring.polynomial(q)?)?;
    Some((ring, divisor))
}

/// Residues of one divisor modulo several primes.
struct Lift {
    /// Degree of the field.
    degree: usize,
    /// Number of coefficients of the divisor: the minimum over all primes so far.
    count: usize,
    remainders: Crt,
    /// Number of primes used.
    used: usize,
    /// Number of primes at which the next reconstruction is tried: 1, 2, 3, 4, 6, 9, …
    next_try: usize,
}

impl Lift {
    fn new(degree: usize) -> Self {
        Self {
            degree,
            count: usize::MAX,
            remainders: Crt::new(0),
            used: 0,
            next_try: 1,
        }
    }
    /// Adds a divisor modulo one more prime; returns the reconstructed divisor, if that is tried
    /// and succeeds.
    fn push(&mut self, ring: &Ring, divisor: &[Residue]) -> Option<Coefficients> {
        let d = self.degree;
        if divisor.len() > self.count {
            return None;
        }
        if divisor.len() < self.count {
            self.count = divisor.len();
            self.remainders = Crt::new((self.count - 1) * d);
            (self.used, self.next_try) = (0, 1);
        }
        let padded = |c: &Residue| (0..d).map(|i| c.get(i).copied().unwrap_or(0)).collect();
        let lower = divisor[..self.count - 1].iter();
        let residues: Vec<u64> = lower.flat_map(|c| -> Vec<u64> { padded(c) }).collect();
        self.remainders.push(&ring.field, &residues);
        self.used += 1;
        if self.used < self.next_try {
            return None;
        }
        self.next_try = self.used + self.used.div_ceil(2);
        let (numerators, denominator) = self.remainders.rational()?;
        let element = |c: &[IBig]| Element::normalised(c.to_vec(), denominator.clone());
        let mut candidate: Coefficients = numerators.chunks(d).map(element).collect();
        candidate.push(Element::normalised(vec![1.into()], UBig::ONE));
        Some(candidate)
    }
}
