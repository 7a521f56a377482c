//! Arithmetic modulo primes below 2⁶³ and the way back to integers and rationals.
//!
//! Exact results are computed modulo many primes and put together by the Chinese remainder theorem.
//! Residues are kept in Montgomery form (P. L. Montgomery, Math. Comp. 44, 1985, pages 519–521): a
//! residue a is stored as a·2⁶⁴ mod p. Rational numbers come back by the half-way Euclidean
//! algorithm (P. S. Wang, SYMSAC 1981, pages 212–217).
//!
//! The primes are fixed, descending from 2⁶²: results are deterministic.

use crate::poly::{Exponents, Poly};
use dashu_base::{Gcd, Sign, UnsignedAbs};
use dashu_int::{IBig, UBig, Word};
use dashu_ratio::RBig;
use std::sync::{Mutex, PoisonError};

/// Number of words in a digit of 64 bits; words have 32 bits on machines of 32 bits.
const WORDS_PER_DIGIT: usize = (u64::BITS / Word::BITS) as usize;

/// The field of integers modulo an odd prime p < 2⁶³; its elements are `u64` in Montgomery form,
/// made by [`Fp::of_u64`] and read by [`Fp::value`]. Zero is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fp {
    p: u64,
    /// −p⁻¹ mod 2⁶⁴.
    negative_inverse: u64,
    /// 2¹²⁸ mod p.
    r2: u64,
    /// 2⁶⁴ mod p, which is one.
    one: u64,
}

impl Fp {
    /// Creates the field modulo `p`, which has to be prime.
    ///
    /// # Panics
    /// If p is even, below 3 or not below 2⁶³.
    pub fn new(p: u64) -> Self {
        assert!(
            p % 2 == 1 && (3..1 << 63).contains(&p),
            "{p} is no odd prime below 2^63"
        );
        // Newton's iteration doubles the number of correct low bits; 3p xor 2 has five of them.
        let mut inverse = p.wrapping_mul(3) ^ 2;
        for _ in 0..4 {
            inverse = inverse.wrapping_mul(2u64.wrapping_sub(p.wrapping_mul(inverse)));
        }
        let one = ((1u128 << 64) % u128::from(p)) as u64;
        let r2 = (u128::from(one) * u128::from(one) % u128::from(p)) as u64;
        Self {
            p,
            negative_inverse: inverse.wrapping_neg(),
            r2,
            one,
        }
    }

    /// Returns the prime p.
    pub fn prime(&self) -> u64 {
        self.p
    }
    /// One.
    #[inline]
    pub fn one(&self) -> u64 {
        self.one
    }
    /// Returns the element that `a` represents.
    #[inline]
    pub fn of_u64(&self, a: u64) -> u64 {
        self.mul(if a < self.p { a } else { a % self.p }, self.r2)
    }
    /// Returns the element that `a` represents.
    pub fn of_i64(&self, a: i64) -> u64 {
        let magnitude = self.of_u64(a.unsigned_abs());
        if a < 0 {
            self.neg(magnitude)
        } else {
            magnitude
        }
    }
    /// Returns the residue of a large integer.
    pub fn of_ubig(&self, a: &UBig) -> u64 {
        self.of_words(a.as_words())
    }
    /// Returns the residue of a large integer with sign.
    pub fn of_ibig(&self, a: &IBig) -> u64 {
        let (sign, words) = a.as_sign_words();
        let magnitude = self.of_words(words);
        if sign == Sign::Negative {
            self.neg(magnitude)
        } else {
            magnitude
        }
    }
    /// Returns the residue of an integer of these words, the lowest first.
    #[allow(clippy::unnecessary_cast, reason = "words may have 32 bits")]
    fn of_words(&self, words: &[Word]) -> u64 {
        // Horner in base 2^64: multiplication by r2 in Montgomery form is multiplication by 2^64 of
        // plain residues.
        let mut sum = 0;
        for digit in words.chunks(WORDS_PER_DIGIT).rev() {
            let low_first = digit.iter().zip((0..).step_by(Word::BITS as usize));
            let digit: u64 = low_first.map(|(&word, bit)| (word as u64) << bit).sum();
            sum = self.add(self.mul(sum, self.r2), digit % self.p);
        }
        self.mul(sum, self.r2)
    }
    /// Returns the residue of a rational number; `None` if p divides its denominator.
    pub fn of_rbig(&self, a: &RBig) -> Option<u64> {
        let denominator = self.of_ubig(a.denominator());
        (denominator != 0).then(|| self.mul(self.of_ibig(a.numerator()), self.inv(denominator)))
    }
    /// Returns the representative 0 ≤ a < p.
    #[inline]
    pub fn value(&self, a: u64) -> u64 {
        self.reduce(u128::from(a))
    }

    #[inline]
    fn reduce(&self, t: u128) -> u64 {
        let m = (t as u64).wrapping_mul(self.negative_inverse);
        let u = ((t + u128::from(m) * u128::from(self.p)) >> 64) as u64;
        if u >= self.p { u - self.p } else { u }
    }
    /// Returns a + b.
    #[inline]
    pub fn add(&self, a: u64, b: u64) -> u64 {
        let s = a + b;
        if s >= self.p { s - self.p } else { s }
    }
    /// Returns a − b.
    #[inline]
    pub fn sub(&self, a: u64, b: u64) -> u64 {
        if a >= b { a - b } else { a + self.p - b }
    }
    /// Returns −a.
    #[inline]
    pub fn neg(&self, a: u64) -> u64 {
        if a == 0 { 0 } else { self.p - a }
    }
    /// Returns a·b.
    #[inline]
    pub fn mul(&self, a: u64, b: u64) -> u64 {
        self.reduce(u128::from(a) * u128::from(b))
    }
    /// Returns a^n.
    pub fn pow(&self, mut a: u64, mut n: u64) -> u64 {
        let mut result = self.one;
        while n > 0 {
            if n & 1 == 1 {
                result = self.mul(result, a);
            }
            a = self.mul(a, a);
            n >>= 1;
        }
        result
    }
    /// Returns 1/a.
    ///
    /// # Panics
    /// If a is zero.
    pub fn inv(&self, a: u64) -> u64 {
        assert!(a != 0, "zero has no inverse modulo {}", self.p);
        let (mut r0, mut r1) = (self.p, a);
        let (mut t0, mut t1) = (0i64, 1i64);
        while r1 != 0 {
            let q = r0 / r1;
            (r0, r1) = (r1, r0 - q * r1);
            (t0, t1) = (t1, t0.wrapping_sub((q as i64).wrapping_mul(t1)));
        }
        let inverse = if t0 < 0 {
            (t0 + self.p as i64) as u64
        } else {
            t0 as u64
        };
        self.mul(self.mul(inverse, self.r2), self.r2)
    }
    /// Returns a/b.
    ///
    /// # Panics
    /// If b is zero.
    pub fn div(&self, a: u64, b: u64) -> u64 {
        self.mul(a, self.inv(b))
    }
}

/// Returns true if n is prime, by the Miller–Rabin test with the first twelve primes as bases,
/// which is a proof below 3.3·10²⁴ (J. Sorenson, J. Webster, Math. Comp. 86, 2017, pages 985–1003).
pub fn is_prime(n: u64) -> bool {
    /// The first twelve primes.
    const BASES: [u64; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];
    if n < 2 {
        return false;
    }
    for b in BASES {
        if n.is_multiple_of(b) {
            return n == b;
        }
    }
    assert!(n < 1 << 63, "primality is decided below 2^63 only");
    let field = Fp::new(n);
    let (one, minus_one) = (field.one(), field.neg(field.one()));
    let twos = (n - 1).trailing_zeros();
    BASES.iter().all(|&b| {
        let mut x = field.pow(field.of_u64(b), (n - 1) >> twos);
        if x == one || x == minus_one {
            return true;
        }
        (1..twos).any(|_| {
            x = field.mul(x, x);
            x == minus_one
        })
    })
}

/// Iterates over the primes below 2⁶² in descending order, as fields; they are computed once and
/// cached.
pub fn primes() -> impl Iterator<Item = Fp> {
    static KNOWN: Mutex<Vec<u64>> = Mutex::new(Vec::new());
    (0..).map(|i| {
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        while known.len() <= i {
            let mut n = known.last().copied().unwrap_or((1 << 62) + 1) - 2;
            while !is_prime(n) {
                n -= 2;
            }
            known.push(n);
        }
        Fp::new(known[i])
    })
}

/// Integers determined by residues modulo successive primes (Garner's algorithm, one list at a
/// time).
#[derive(Clone, Debug)]
pub struct Crt {
    modulus: UBig,
    values: Vec<UBig>,
}

impl Crt {
    /// Creates `count` undetermined integers.
    pub fn new(count: usize) -> Self {
        Self {
            modulus: UBig::ONE,
            values: vec![UBig::ZERO; count],
        }
    }
    /// Returns the product of the primes so far.
    pub fn modulus(&self) -> &UBig {
        &self.modulus
    }
    /// Adds the residues of the integers modulo one more prime. Returns true if that changes the
    /// symmetric representative of any integer.
    ///
    /// # Panics
    /// If the number of residues differs from the number of integers, or the prime was used before.
    pub fn push(&mut self, field: &Fp, residues: &[u64]) -> bool {
        assert_eq!(
            residues.len(),
            self.values.len(),
            "one residue for each integer"
        );
        let inverse = field.inv(field.of_ubig(&self.modulus));
        let modulus = IBig::from(&self.modulus * field.prime());
        let half = &self.modulus >> 1;
        let mut changed = false;
        for (value, &residue) in self.values.iter_mut().zip(residues) {
            let step = field.value(field.mul(field.sub(residue, field.of_ubig(value)), inverse));
            // A symmetric value v ≥ 0 is unchanged by step 0; v < 0 is stored as M + v and is
            // unchanged by step p − 1.
            changed |= step != if *value > half { field.prime() - 1 } else { 0 };
            if step != 0 {
                *value += &self.modulus * step;
            }
        }
        self.modulus = modulus.unsigned_abs();
        changed
    }
    /// Returns the integers of minimum absolute value with these residues.
    pub fn symmetric(&self) -> Vec<IBig> {
        let half = &self.modulus >> 1;
        let lift = |v: &UBig| {
            if *v > half {
                IBig::from(v.clone()) - IBig::from(self.modulus.clone())
            } else {
                IBig::from(v.clone())
            }
        };
        self.values.iter().map(lift).collect()
    }
    /// Returns a common denominator d and integers nᵢ such that nᵢ/d has these residues, |nᵢ| and d
    /// below √(M/2); `None` if they do not exist. By Wang's reconstruction, where each value is
    /// first multiplied by the denominator found so far.
    pub fn rational(&self) -> Option<(Vec<IBig>, UBig)> {
        let mut denominator = UBig::ONE;
        let mut numerators: Vec<IBig> = Vec::with_capacity(self.values.len());
        for value in &self.values {
            let r =
                rational_reconstruction(&(value * &denominator % &self.modulus), &self.modulus)?;
            let (n, d) = r.into_parts();
            if !d.is_one() {
                for earlier in &mut numerators {
                    *earlier *= &d;
                }
                denominator *= d;
            }
            numerators.push(n);
        }
        Some((numerators, denominator))
    }
}

/// Returns the terms modulo a prime. A denominator that vanishes gives residues of another
/// polynomial; proofs do not rely on them.
pub fn residues(f: &Fp, p: &Poly) -> Vec<(Exponents, u64)> {
    let d = f.of_ubig(p.denominator());
    let inverse = if d == 0 { 0 } else { f.inv(d) };
    p.terms()
        .iter()
        .map(|(e, c)| (*e, f.mul(f.of_ibig(c), inverse)))
        .collect()
}

/// Matrix in echelon form modulo a prime: rows, indexed by their pivots, which are 1.
pub struct Echelon {
    rows: Vec<Option<Vec<u64>>>,
    rank: usize,
}

impl Echelon {
    /// Creates a matrix without rows, with this number of columns.
    pub fn new(columns: usize) -> Self {
        Self {
            rows: vec![None; columns],
            rank: 0,
        }
    }
    /// Adds a row. Returns true if the rank grew.
    pub fn insert(&mut self, f: &Fp, mut row: Vec<u64>) -> bool {
        for c in 0..row.len() {
            let factor = row[c];
            if factor == 0 {
                continue;
            }
            let Some(pivot) = &self.rows[c] else {
                let inverse = f.inv(factor);
                for v in &mut row[c..] {
                    *v = f.mul(*v, inverse);
                }
                self.rows[c] = Some(row);
                self.rank += 1;
                return true;
            };
            for (v, &p) in row[c..].iter_mut().zip(&pivot[c..]) {
                *v = f.sub(*v, f.mul(factor, p));
            }
        }
        false
    }
    /// Returns the number of independent rows.
    pub fn rank(&self) -> usize {
        self.rank
    }
    /// Returns the column without a pivot, and the vector of the kernel with 1 there, if the kernel
    /// has dimension 1.
    pub fn kernel(&self, f: &Fp) -> Option<(usize, Vec<u64>)> {
        if self.rank + 1 != self.rows.len() {
            return None;
        }
        let free = self.rows.iter().position(Option::is_none)?;
        let mut v = vec![0; self.rows.len()];
        v[free] = f.one();
        for (c, row) in self.rows.iter().enumerate().rev() {
            if let Some(row) = row {
                let sum = row[c + 1..]
                    .iter()
                    .zip(&v[c + 1..])
                    .fold(0, |s, (&a, &b)| f.add(s, f.mul(a, b)));
                v[c] = f.neg(sum);
            }
        }
        Some((free, v))
    }
}

/// Returns the fraction n/d ≡ u modulo m with |n| and d at most √(m/2), if there is one; it is
/// unique.
pub fn rational_reconstruction(u: &UBig, m: &UBig) -> Option<RBig> {
    let bound = sqrt_floor(&(m >> 1));
    let (mut r0, mut r1) = (m.clone(), u % m);
    let (mut t0, mut t1) = (IBig::ZERO, IBig::ONE);
    while r1 > bound {
        let q = &r0 / &r1;
        (r0, r1) = (r1.clone(), r0 - &q * &r1);
        (t0, t1) = (t1.clone(), t0 - &t1 * IBig::from(q));
    }
    let (sign, d) = t1.into_parts();
    if d > bound || d.is_zero() || !(&r1).gcd(&d).is_one() {
        return None;
    }
    Some(RBig::from_parts(IBig::from_parts(sign, r1), d))
}

/// Returns ⌊√n⌋ by Newton's iteration from above.
pub(crate) fn sqrt_floor(n: &UBig) -> UBig {
    if n.is_zero() {
        return UBig::ZERO;
    }
    let mut x = UBig::ONE << bit_len(n).div_ceil(2);
    loop {
        let next = (&x + n / &x) >> 1;
        if next >= x {
            return x;
        }
        x = next;
    }
}

/// Returns the number of bits of n; 0 for zero.
pub(crate) fn bit_len(n: &UBig) -> usize {
    dashu_base::BitTest::bit_len(n)
}

/// Returns the number of bits of |n|; 0 for zero.
pub(crate) fn bits(n: &IBig) -> usize {
    let (_, words) = n.as_sign_words();
    words
        .last()
        .map_or(0, |top| words.len() * 64 - top.leading_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn first_primes_below_two_to_the_62() {
        // sympy.prevprime, iterated: 2^62 − 57, −87, −117, −143, −153.
        let found: Vec<u64> = primes().take(5).map(|f| (1 << 62) - f.prime()).collect();
        assert_eq!(found, [57, 87, 117, 143, 153]);
        assert!(
            is_prime(2) && is_prime(37) && is_prime(41) && !is_prime(1) && !is_prime(3_215_031_751)
        );
    }

    #[test]
    fn fractions_come_back() {
        let mut crt = Crt::new(3);
        let third = RBig::from_parts(IBig::from(-22), UBig::from(7u8));
        let wanted = [
            RBig::from(5),
            third,
            RBig::from_parts(IBig::from(123_456_789), UBig::from(987_654_323u64)),
        ];
        for field in primes().take(3) {
            let residues: Vec<u64> = wanted
                .iter()
                .map(|w| field.of_rbig(w).expect("no denominator vanishes"))
                .collect();
            crt.push(&field, &residues);
        }
        let (n, d) = crt.rational().expect("small fractions");
        for (n, w) in n.into_iter().zip(&wanted) {
            assert_eq!(RBig::from_parts(n, d.clone()), *w);
        }
    }

    #[test]
    fn square_roots_are_floors() {
        for n in 0u32..2000 {
            assert_eq!(sqrt_floor(&UBig::from(n)), UBig::from(n.isqrt()));
        }
    }

    proptest! {
        #[test]
        fn the_field_agrees_with_u128(a in any::<u64>(), b in any::<u64>(), which in 0usize..3) {
            let p = [3u64, 1_000_003, (1 << 62) - 57][which];
            let f = Fp::new(p);
            let (x, y) = (f.of_u64(a), f.of_u64(b));
            let wide = |v: u128| (v % u128::from(p)) as u64;
            prop_assert_eq!(f.value(f.mul(x, y)), wide(u128::from(a % p) * u128::from(b % p)));
            prop_assert_eq!(f.value(f.add(x, y)), wide(u128::from(a) + u128::from(b)));
            prop_assert_eq!(f.value(f.sub(x, y)), wide(u128::from(a % p) + u128::from(p - b % p)));
            if x != 0 {
                prop_assert_eq!(f.mul(x, f.inv(x)), f.one());
                prop_assert_eq!(f.pow(x, p - 1), f.one());
            }
        }

        #[test]
        fn large_integers_come_back(parts in prop::collection::vec(any::<i128>(), 1..5)) {
            let values: Vec<IBig> = parts.iter().map(|&v| IBig::from(v) * IBig::from(v) * IBig::from(v)).collect();
            let mut crt = Crt::new(values.len());
            let mut changes = Vec::new();
            for field in primes().take(9) {
                let residues: Vec<u64> = values.iter().map(|v| field.of_ibig(v)).collect();
                for (v, &r) in values.iter().zip(&residues) {
                    let p = IBig::from(field.prime());
                    prop_assert_eq!(IBig::from(field.value(r)), ((v % &p) + &p) % &p);
                }
                changes.push(crt.push(&field, &residues));
            }
            prop_assert_eq!(crt.symmetric(), values);
            prop_assert!(!changes[8], "the ninth prime brings nothing new");
        }
    }
}
