//! Factors of polynomials in one variable.
//!
//! D. G. Cantor and H. Zassenhaus (Math. Comp. 36, 1981, pages 587–592) modulo a small prime,
//! Hensel lifting (J. von zur Gathen, J. Gerhard, *Modern Computer Algebra*, algorithm 15.10)
//! beyond M. Mignotte's bound, recombination by trial.

use super::FactorError;
use super::recombination::by_subsets;
use super::residue;
use crate::modpoly;
use crate::modular::{Fp, is_prime, sqrt_floor};
use crate::upoly::UPoly;
use dashu_base::UnsignedAbs;
use dashu_int::{IBig, UBig};
use isoform_control::Control;
use isoform_num::Random;

/// Maximum number of small primes tried for a polynomial; the one with the fewest factors is taken.
const MAX_TRIED_PRIMES: usize = 6;
/// Start of the search for small primes.
const FIRST_PRIME: u64 = 1009;

/// Returns the irreducible factors of a primitive squarefree polynomial.
pub(super) fn factor_univariate(
    p: &UPoly,
    control: &Control<'_>,
) -> Result<Vec<UPoly>, FactorError> {
    match p.degree() {
        0 => return Ok(Vec::new()),
        1 => return Ok(vec![p.primitive()]),
        _ => {}
    }
    if p.coefficients()[0].is_zero() {
        let mut factors = factor_univariate(&UPoly::new(p.coefficients()[1..].to_vec()), control)?;
        factors.push(UPoly::from_i64(&[0, 1]));
        return Ok(factors);
    }
    let Some((field, modular)) = best_small_prime(p, control)? else {
        return Ok(vec![p.primitive()]);
    };
    let bound = modulus_bound(p);
    let mut modulus = UBig::from(field.prime());
    let mut squarings = 0;
    while modulus <= bound {
        modulus = modulus.pow(2);
        squarings += 1;
    }
    let lifting = HenselLifting { field, squarings };
    let mut lifted = Vec::new();
    lifting.lift(p.coefficients().to_vec(), &modular, &mut lifted);
    recombine(p, &lifted, &IBig::from(modulus), control)
}

/// Returns twice a bound on the coefficients of a factor times lc(p), |lc| 2ⁿ ‖p‖₂ (Mignotte).
fn modulus_bound(p: &UPoly) -> UBig {
    let squares = p.coefficients().iter().map(|c| c.clone().unsigned_abs());
    let norm = sqrt_floor(&squares.map(|c| c.pow(2)).sum::<UBig>()) + UBig::ONE;
    ((norm * p.leading().unsigned_abs()) << p.degree()) << 1
}

/// Returns the monic irreducible factors of a monic squarefree polynomial modulo a small odd prime.
fn factor_modular(f: &Fp, p: &[u64]) -> Vec<Vec<u64>> {
    let mut factors = Vec::new();
    let mut rest = p.to_vec();
    let x = [0, f.one()];
    let mut power = x.to_vec();
    let mut stream = Random::xorshift(0);
    let mut degree = 0;
    while rest.len() > 1 {
        degree += 1;
        if 2 * degree > rest.len() - 1 {
            factors.push(rest);
            break;
        }
        // x^(p^d) − x is the product of all irreducible polynomials of degrees dividing d.
        power = modpoly::pow_mod(f, &power, f.prime(), &rest);
        let together = modpoly::gcd(f, &modpoly::sub(f, &power, &x), &rest);
        if together.len() > 1 {
            rest = modpoly::div_rem(f, &mut rest, &together);
            power = modpoly::rem(f, power, &rest);
            split_equal_degrees(f, together, degree, &mut stream, &mut factors);
        }
    }
    factors.sort();
    factors
}

/// Splits a product of irreducible factors of one degree by random polynomials, recursively.
fn split_equal_degrees(
    f: &Fp,
    p: Vec<u64>,
    degree: usize,
    stream: &mut Random,
    factors: &mut Vec<Vec<u64>>,
) {
    if p.len() - 1 == degree {
        factors.push(p);
        return;
    }
    loop {
        let mut h: Vec<u64> = (1..p.len()).map(|_| f.of_u64(stream.bits())).collect();
        modpoly::trim(&mut h);
        // h^((p^d − 1)/2) is ±1 modulo each factor: the norm h^(1 + p + … + p^(d−1)) to the power
        // (p − 1)/2.
        let (mut norm, mut conjugate) = (h.clone(), h);
        for _ in 1..degree {
            conjugate = modpoly::pow_mod(f, &conjugate, f.prime(), &p);
            norm = modpoly::rem(f, modpoly::mul(f, &norm, &conjugate), &p);
        }
        let sign = modpoly::pow_mod(f, &norm, (f.prime() - 1) / 2, &p);
        let part = modpoly::gcd(f, &modpoly::sub(f, &sign, &[f.one()]), &p);
        if part.len() > 1 && part.len() < p.len() {
            let other = modpoly::div_rem(f, &mut p.clone(), &part);
            split_equal_degrees(f, part, degree, stream, factors);
            split_equal_degrees(f, other, degree, stream, factors);
            return;
        }
    }
}

/// Field, with the monic factors of a polynomial over it.
type Modular = (Fp, Vec<Vec<u64>>);

/// Returns the field and the monic factors for the small prime that leaves the fewest; `None` if
/// one proves irreducibility.
fn best_small_prime(p: &UPoly, control: &Control<'_>) -> Result<Option<Modular>, FactorError> {
    let mut best: Option<Modular> = None;
    // Sums of degrees of modular factors that are possible for all primes so far.
    let mut possible = vec![true; p.degree() + 1];
    let fields = (FIRST_PRIME..).step_by(2).filter(|&q| is_prime(q));
    let mut tried = 0;
    for field in fields.map(Fp::new) {
        control.check()?;
        let Some(image) = squarefree_image(&field, p) else {
            continue;
        };
        let factors = factor_modular(&field, &image);
        let sums = sums_of_degrees(&factors, p.degree());
        possible.iter_mut().zip(sums).for_each(|(a, b)| *a &= b);
        if possible[1..p.degree()].iter().all(|d| !d) {
            return Ok(None);
        }
        if best.as_ref().is_none_or(|(_, b)| factors.len() < b.len()) {
            best = Some((field, factors));
        }
        tried += 1;
        if tried == MAX_TRIED_PRIMES {
            break;
        }
    }
    Ok(best)
}

/// Returns the polynomial modulo a prime, monic, if it keeps its degree and stays squarefree.
fn squarefree_image(field: &Fp, p: &UPoly) -> Option<Vec<u64>> {
    let image = p.residues(field);
    if image.len() != p.degree() + 1 {
        return None;
    }
    let image = modpoly::monic(field, &image);
    let common = modpoly::gcd(field, &image, &modpoly::derivative(field, &image));
    (common.len() == 1).then_some(image)
}

/// Returns true for each degree up to n that a product of the factors has.
fn sums_of_degrees(factors: &[Vec<u64>], n: usize) -> Vec<bool> {
    let mut sums = vec![false; n + 1];
    sums[0] = true;
    for f in factors {
        for d in (f.len() - 1..sums.len()).rev() {
            sums[d] |= sums[d + 1 - f.len()];
        }
    }
    sums
}

/// Hensel lifting from a prime p to p^(2^squarings).
struct HenselLifting {
    field: Fp,
    squarings: usize,
}

impl HenselLifting {
    /// Lifts the factorisation lc·∏ factors of a polynomial modulo the prime, by halves; the lifted
    /// monic factors are appended.
    fn lift(&self, p: Vec<IBig>, factors: &[Vec<u64>], lifted: &mut Vec<Vec<IBig>>) {
        let (first, second) = factors.split_at(factors.len() / 2);
        if first.is_empty() {
            lifted.push(self.monic(&p));
            return;
        }
        let mut halves = FactorPair::new(&self.field, &p, first, second);
        let mut m = IBig::from(self.field.prime());
        for _ in 0..self.squarings {
            m = &m * &m;
            halves.square(&p, &m);
        }
        self.lift(halves.g, first, lifted);
        self.lift(halves.h, second, lifted);
    }

    /// Returns the only factor, the polynomial itself, made monic by Newton's iteration for 1/lc.
    fn monic(&self, p: &[IBig]) -> Vec<IBig> {
        let lead = p.last().expect("not zero");
        let field = &self.field;
        let mut m = IBig::from(field.prime());
        let mut inverse = IBig::from(field.value(field.inv(field.of_ibig(lead))));
        for _ in 0..self.squarings {
            m = &m * &m;
            let next = (IBig::from(2) - lead * &inverse) * &inverse;
            inverse = residue::reduce(vec![next], &m).swap_remove(0);
        }
        residue::mul(p, &[inverse], &m)
    }
}

/// Factorisation g h of a polynomial modulo m, h monic, with s g + t h = 1.
struct FactorPair {
    g: Vec<IBig>,
    h: Vec<IBig>,
    s: Vec<IBig>,
    t: Vec<IBig>,
}

impl FactorPair {
    /// Creates the factorisation modulo the prime; the leading coefficient goes to g.
    fn new(field: &Fp, p: &[IBig], first: &[Vec<u64>], second: &[Vec<u64>]) -> Self {
        let plain =
            |a: &[u64]| -> Vec<IBig> { a.iter().map(|&c| IBig::from(field.value(c))).collect() };
        let product = |of: &[Vec<u64>]| {
            of.iter()
                .fold(vec![field.one()], |a, b| modpoly::mul(field, &a, b))
        };
        let lead = field.of_ibig(p.last().expect("not zero"));
        let g = modpoly::scale(field, &product(first), lead);
        let h = product(second);
        let (_, s, t) = modpoly::gcd_extended(field, &g, &h);
        Self {
            g: plain(&g),
            h: plain(&h),
            s: plain(&s),
            t: plain(&t),
        }
    }

    /// Lifts the factorisation from a modulus to its square m (algorithm 15.10).
    fn square(&mut self, p: &[IBig], m: &IBig) {
        let mul = |a: &[IBig], b: &[IBig]| residue::mul(a, b, m);
        let add = |a: &[IBig], b: &[IBig]| residue::combine(a, b, 1, m);
        let sub = |a: &[IBig], b: &[IBig]| residue::combine(a, b, -1, m);
        let Self { g, h, s, t } = self;
        let length = g.len();
        let e = sub(p, &mul(g, h));
        let (q, r) = residue::div_rem(mul(s, &e), h, m);
        *g = add(g, &add(&mul(t, &e), &mul(&q, g)));
        g.truncate(length);
        *h = add(h, &r);
        let mut b = add(&mul(s, g), &mul(t, h));
        b[0] -= IBig::ONE;
        let (c, d) = residue::div_rem(mul(s, &b), h, m);
        *s = sub(s, &d);
        *t = sub(t, &add(&mul(t, &b), &mul(&c, g)));
        t.truncate(length - 1);
        s.truncate(h.len() - 1);
    }
}

/// Returns the factors over Z from the monic ones modulo a number that exceeds twice their
/// coefficients.
fn recombine(
    p: &UPoly,
    lifted: &[Vec<IBig>],
    modulus: &IBig,
    control: &Control<'_>,
) -> Result<Vec<UPoly>, FactorError> {
    let half = modulus >> 1usize;
    let symmetric = |c: IBig| if c > half { c - modulus } else { c };
    let mut rest = p.clone();
    let (mut factors, left) = by_subsets(lifted.len(), control, |chosen| {
        let lead = rest.leading();
        // The constant coefficient of a factor times lc divides that of the polynomial times lc.
        let one = |product: IBig, i: &usize| {
            residue::reduce(vec![product * &lifted[*i][0]], modulus).swap_remove(0)
        };
        let constant = symmetric(chosen.iter().fold(
            residue::reduce(vec![lead.clone()], modulus).swap_remove(0),
            one,
        ));
        if constant.is_zero() || !((&rest.coefficients()[0] * &lead) % &constant).is_zero() {
            return None;
        }
        let product = chosen
            .iter()
            .fold(residue::reduce(vec![lead], modulus), |a, &i| {
                residue::mul(&a, &lifted[i], modulus)
            });
        let candidate = UPoly::new(product.into_iter().map(symmetric).collect()).primitive();
        rest = rest.div_exact(&candidate)?;
        Some(candidate)
    })?;
    if !left.is_empty() {
        factors.push(rest.primitive());
    }
    Ok(factors)
}
