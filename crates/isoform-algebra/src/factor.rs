//! Factorisation over Q of polynomials in one or two variables and of forms in up to three.
//!
//! One variable: D. G. Cantor and H. Zassenhaus (Math. Comp. 36, 1981, pages 587–592) modulo a
//! small prime, Hensel lifting (J. von zur Gathen, J. Gerhard, *Modern Computer Algebra*, algorithm
//! 15.10) beyond M. Mignotte's bound, recombination by trial.
//!
//! Two variables: a shear makes the leading coefficient constant, so that a factor of degree d has
//! total degree d; one variable is set to a number, the univariate factors are lifted as power
//! series in it modulo primes, and a product of them counts if its coefficients end where those of
//! a factor must. It is lifted modulo more primes until it divides.
//!
//! Every factor is proven by division and irreducible because all smaller products were tried.

use crate::modpoly;
use crate::modular::{Crt, Fp, bit_len, is_prime, primes, sqrt_floor};
use crate::poly::{MAX_VARS, Poly};
use crate::upoly::UPoly;
use dashu_base::{Abs, UnsignedAbs};
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use isoform_control::{Control, Stopped};
use isoform_num::Random;

/// Why there is no factorisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FactorError {
    /// More than two variables, or three in a polynomial that is no form.
    #[error(
        "factorisation of polynomials in more than two variables, or of forms in more than three"
    )]
    TooManyVariables,
    /// The work was cancelled, or its deadline is over.
    #[error("stopped")]
    Stopped,
}

impl FactorError {
    /// Where the number of variables is right, only [`Stopped`] is left.
    ///
    /// # Panics
    /// If there were too many variables.
    pub fn only_stopped(self) -> Stopped {
        assert_eq!(self, Self::Stopped, "polynomials in few variables");
        Stopped
    }
}

/// Small primes tried for a univariate polynomial; the one with the fewest factors is taken.
const PRIMES_TRIED: usize = 6;
/// Numbers tried in place of a variable; the one that leaves the fewest factors is taken.
const POINTS_TRIED: usize = 3;

impl Poly {
    /// The irreducible factors with multiplicities: primitive, by ascending total degree, then in
    /// the order of terms. Their product is this polynomial up to a constant; constants have none.
    ///
    /// ```
    /// use isoform_algebra::Poly;
    /// use isoform_control::Control;
    /// let p = |text| Poly::parse(text, &["x", "y", "z"]).expect(text);
    /// let factors = p("x^4*z - y^4*z").factor(&Control::default());
    /// assert_eq!(factors, Ok(vec![(p("z"), 1), (p("x - y"), 1), (p("x + y"), 1), (p("x^2 + y^2"), 1)]));
    /// ```
    ///
    /// # Errors
    /// [`FactorError`].
    pub fn factor(&self, control: &Control<'_>) -> Result<Vec<(Self, usize)>, FactorError> {
        let mut factors = Vec::new();
        for (part, multiplicity) in self.squarefree() {
            let irreducible = factor_squarefree(&part, control)?;
            factors.extend(
                irreducible
                    .into_iter()
                    .map(|p| (p.primitive(), multiplicity)),
            );
        }
        factors.sort_by(|(a, _), (b, _)| {
            (a.total_degree(), a.terms()).cmp(&(b.total_degree(), b.terms()))
        });
        Ok(factors)
    }
}

impl UPoly {
    /// The irreducible factors with multiplicities: primitive, by ascending degree, then by
    /// coefficients from below.
    ///
    /// # Errors
    /// [`FactorError::Stopped`].
    pub fn factor(&self, control: &Control<'_>) -> Result<Vec<(Self, usize)>, FactorError> {
        let mut factors = Vec::new();
        for (part, multiplicity) in self.squarefree() {
            factors.extend(
                factor_univariate(&part, control)?
                    .into_iter()
                    .map(|p| (p, multiplicity)),
            );
        }
        factors.sort_by(|(a, _), (b, _)| {
            (a.degree(), a.coefficients()).cmp(&(b.degree(), b.coefficients()))
        });
        Ok(factors)
    }
}

/// Primitive, squarefree, not constant.
fn factor_squarefree(p: &Poly, control: &Control<'_>) -> Result<Vec<Poly>, FactorError> {
    let variables = p.variables();
    match variables[..] {
        [] => Ok(Vec::new()),
        [.., last] if variables.len() > 1 && p.is_homogeneous() => {
            let flat = p.dehomogenise(last);
            let power = p.total_degree() - flat.total_degree();
            let forms = factor_squarefree(&flat.primitive(), control)?;
            let own = (power > 0).then(|| Poly::var(last));
            Ok(forms
                .into_iter()
                .map(|q| q.homogenise(last, q.total_degree()))
                .chain(own)
                .collect())
        }
        [x] => {
            let dense = p.to_upoly(x).expect("one variable");
            Ok(factor_univariate(&dense, control)?
                .iter()
                .map(|q| Poly::from_upoly(q, x))
                .collect())
        }
        [x, y] => {
            let mut factors = Vec::new();
            let mut rest = p.clone();
            for (var, other) in [(x, y), (y, x)] {
                let content = rest.content_in(var);
                if let Some(dense) = content.to_upoly(other).filter(|c| c.degree() > 0) {
                    factors.extend(
                        factor_univariate(&dense, control)?
                            .iter()
                            .map(|q| Poly::from_upoly(q, other)),
                    );
                    rest = rest.div_exact(&content).expect("the content divides");
                }
            }
            if !rest.is_constant() {
                factors.extend(factor_bivariate(&rest, x, y, control)?);
            }
            Ok(factors)
        }
        _ => Err(FactorError::TooManyVariables),
    }
}

/// The monic irreducible factors of a monic squarefree polynomial modulo a small odd prime.
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

/// The irreducible factors of a primitive squarefree polynomial.
fn factor_univariate(p: &UPoly, control: &Control<'_>) -> Result<Vec<UPoly>, FactorError> {
    let n = p.degree();
    if n < 2 {
        return Ok(if n == 0 {
            Vec::new()
        } else {
            vec![p.primitive()]
        });
    }
    if p.coefficients()[0].is_zero() {
        let mut factors = factor_univariate(&UPoly::new(p.coefficients()[1..].to_vec()), control)?;
        factors.push(UPoly::from_i64(&[0, 1]));
        return Ok(factors);
    }
    let Some((field, modular)) = best_small_prime(p, control)? else {
        return Ok(vec![p.primitive()]);
    };
    // A factor times lc(p) has coefficients at most |lc| 2ⁿ ‖p‖₂.
    let norm = sqrt_floor(
        &p.coefficients()
            .iter()
            .map(|c| c.clone().unsigned_abs().pow(2))
            .sum::<UBig>(),
    ) + UBig::ONE;
    let bound = ((norm * p.leading().unsigned_abs()) << n) << 1;
    let mut modulus = UBig::from(field.prime());
    let mut squarings = 0;
    while modulus <= bound {
        modulus = modulus.pow(2);
        squarings += 1;
    }
    let modulus = IBig::from(modulus);
    let mut lifted = Vec::new();
    lift_tree(
        &field,
        p.coefficients().to_vec(),
        &modular,
        squarings,
        &mut lifted,
    );
    recombine(p, &lifted, &modulus, control)
}

/// A field and the monic factors of a polynomial over it.
type Modular = (Fp, Vec<Vec<u64>>);

/// The field and the monic factors for the small prime that leaves the fewest, nothing if one
/// proves irreducibility.
fn best_small_prime(p: &UPoly, control: &Control<'_>) -> Result<Option<Modular>, FactorError> {
    let mut best: Option<Modular> = None;
    // Sums of degrees of modular factors that are possible for all primes so far.
    let mut possible = vec![true; p.degree() + 1];
    let mut tried = 0;
    for prime in (1009..).step_by(2).filter(|&q| is_prime(q)) {
        if control.is_stopped() {
            return Err(FactorError::Stopped);
        }
        let field = Fp::new(prime);
        let image = p.residues(&field);
        if image.len() != p.degree() + 1 {
            continue;
        }
        let image = modpoly::monic(&field, &image);
        if modpoly::gcd(&field, &image, &modpoly::derivative(&field, &image)).len() > 1 {
            continue;
        }
        let factors = factor_modular(&field, &image);
        let mut sums = vec![false; p.degree() + 1];
        sums[0] = true;
        for f in &factors {
            for d in (f.len() - 1..sums.len()).rev() {
                sums[d] |= sums[d + 1 - f.len()];
            }
        }
        for (a, b) in possible.iter_mut().zip(sums) {
            *a &= b;
        }
        if possible[1..p.degree()].iter().all(|d| !d) {
            return Ok(None);
        }
        if best.as_ref().is_none_or(|(_, b)| factors.len() < b.len()) {
            best = Some((field, factors));
        }
        tried += 1;
        if tried == PRIMES_TRIED {
            break;
        }
    }
    Ok(best)
}

/// Polynomials with integer coefficients modulo a number, lowest first, not trimmed.
mod residue {
    use dashu_base::RemEuclid;
    use dashu_int::IBig;

    pub(super) fn reduce(a: Vec<IBig>, m: &IBig) -> Vec<IBig> {
        a.into_iter().map(|c| IBig::from(c.rem_euclid(m))).collect()
    }
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
    pub(super) fn combine(a: &[IBig], b: &[IBig], sign: i32, m: &IBig) -> Vec<IBig> {
        let mut sum = a.to_vec();
        sum.resize(a.len().max(b.len()), IBig::ZERO);
        for (s, v) in sum.iter_mut().zip(b) {
            *s += v * sign;
        }
        reduce(sum, m)
    }
    /// Quotient and remainder by a monic polynomial.
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
}

/// Lifts the factorisation lc·∏ factors of p modulo a prime to the prime's 2^squarings-th power;
/// the lifted monic factors are appended. Two halves at a time.
fn lift_tree(
    field: &Fp,
    p: Vec<IBig>,
    factors: &[Vec<u64>],
    squarings: usize,
    lifted: &mut Vec<Vec<IBig>>,
) {
    let plain =
        |a: &[u64]| -> Vec<IBig> { a.iter().map(|&c| IBig::from(field.value(c))).collect() };
    let lead = p.last().expect("not zero").clone();
    let mut m = IBig::from(field.prime());
    let (first, second) = factors.split_at(factors.len() / 2);
    if first.is_empty() {
        // One factor: the polynomial itself, made monic by Newton's iteration for 1/lc.
        let mut inverse = IBig::from(field.value(field.inv(field.of_ibig(&lead))));
        for _ in 0..squarings {
            m = &m * &m;
            inverse = residue::reduce(vec![(IBig::from(2) - &lead * &inverse) * &inverse], &m)
                .swap_remove(0);
        }
        lifted.push(residue::mul(&p, &[inverse], &m));
        return;
    }
    let product = |of: &[Vec<u64>]| {
        of.iter()
            .fold(vec![field.one()], |a, b| modpoly::mul(field, &a, b))
    };
    let g = modpoly::scale(field, &product(first), field.of_ibig(&lead));
    let h = product(second);
    let (_, s, t) = modpoly::gcd_extended(field, &g, &h);
    let (mut g, mut h, mut s, mut t) = (plain(&g), plain(&h), plain(&s), plain(&t));
    for _ in 0..squarings {
        m = &m * &m;
        let e = residue::combine(&p, &residue::mul(&g, &h, &m), -1, &m);
        let (q, r) = residue::div_rem(residue::mul(&s, &e, &m), &h, &m);
        let degree = g.len();
        g = residue::combine(
            &g,
            &residue::combine(&residue::mul(&t, &e, &m), &residue::mul(&q, &g, &m), 1, &m),
            1,
            &m,
        );
        g.truncate(degree);
        h = residue::combine(&h, &r, 1, &m);
        let mut b = residue::combine(&residue::mul(&s, &g, &m), &residue::mul(&t, &h, &m), 1, &m);
        b[0] -= IBig::ONE;
        let (c, d) = residue::div_rem(residue::mul(&s, &b, &m), &h, &m);
        s = residue::combine(&s, &d, -1, &m);
        let correction =
            residue::combine(&residue::mul(&t, &b, &m), &residue::mul(&c, &g, &m), 1, &m);
        t = residue::combine(&t, &correction, -1, &m);
        t.truncate(degree - 1);
        s.truncate(h.len() - 1);
    }
    lift_tree(field, g, first, squarings, lifted);
    lift_tree(field, h, second, squarings, lifted);
}

/// All subsets of 0 … n − 1 of a size in lexicographic order, one after the other.
fn next_subset(subset: &mut [usize], n: usize) -> bool {
    let k = subset.len();
    for i in (0..k).rev() {
        if subset[i] + (k - i) < n {
            subset[i] += 1;
            for j in i + 1..k {
                subset[j] = subset[j - 1] + 1;
            }
            return true;
        }
    }
    false
}

/// Takes factors off `rest` that are products of subsets, small ones first: `test` returns the
/// factor that a subset of the indices gives, if it is one.
fn by_subsets<F: Clone>(
    count: usize,
    control: &Control<'_>,
    mut test: impl FnMut(&[usize]) -> Option<F>,
) -> Result<(Vec<F>, Vec<usize>), FactorError> {
    let mut left: Vec<usize> = (0..count).collect();
    let mut factors = Vec::new();
    let mut size = 1;
    while 2 * size <= left.len() {
        let mut subset: Vec<usize> = (0..size).collect();
        let mut trials = 0usize;
        let found = loop {
            trials += 1;
            if trials.is_multiple_of(256) && control.is_stopped() {
                return Err(FactorError::Stopped);
            }
            let chosen: Vec<usize> = subset.iter().map(|&i| left[i]).collect();
            if let Some(f) = test(&chosen) {
                break Some((f, chosen));
            }
            if !next_subset(&mut subset, left.len()) {
                break None;
            }
        };
        match found {
            Some((f, chosen)) => {
                factors.push(f);
                left.retain(|i| !chosen.contains(i));
            }
            None => size += 1,
        }
    }
    Ok((factors, left))
}

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

/// Primitive over Z, squarefree, without factors in one variable alone.
fn factor_bivariate(
    p: &Poly,
    x: usize,
    y: usize,
    control: &Control<'_>,
) -> Result<Vec<Poly>, FactorError> {
    let degree = p.total_degree();
    if degree == 1 {
        return Ok(vec![p.clone()]);
    }
    // y + c x in place of y makes the coefficient of x^degree the value of the leading form at (1,
    // c).
    let top = p.homogeneous_part(degree).dehomogenise(x);
    let sheared = |c: &RBig, p: &Poly| p.substitute(y, &(Poly::var(y) + Poly::var(x).scale(c)));
    let c = small_numbers()
        .find(|c| !top.set(y, c).is_zero())
        .expect("a form has few zeros");
    let f = sheared(&c, p).primitive();
    let mut best: Option<(RBig, Vec<UPoly>)> = None;
    let mut tried = 0;
    for point in small_numbers() {
        let line = f.set(y, &point).to_upoly(x).expect("one variable");
        if line.squarefree_part().degree() < degree {
            continue;
        }
        let factors = factor_univariate(&line, control)?;
        if factors.len() == 1 {
            return Ok(vec![p.clone()]);
        }
        if best.as_ref().is_none_or(|(_, b)| factors.len() < b.len()) {
            best = Some((point, factors));
        }
        tried += 1;
        if tried == POINTS_TRIED {
            break;
        }
    }
    let (point, lines) = best.expect("a squarefree polynomial stays so almost everywhere");
    let moved = f
        .substitute(y, &(Poly::var(y) + Poly::constant(point.clone())))
        .primitive();
    let back = |q: &Poly| -> Poly {
        let centred = q.substitute(y, &(Poly::var(y) - Poly::constant(point.clone())));
        sheared(&-c.clone(), &centred).primitive()
    };
    let first = Lifted::new(&moved, x, y, &lines).next().expect("a prime");
    let mut rest = moved;
    let (factors, left) = by_subsets(lines.len(), control, |chosen| {
        if !first.is_plausible(chosen) {
            return None;
        }
        let groups: Vec<UPoly> = [true, false]
            .map(|inside| {
                (0..lines.len())
                    .filter(|i| {
                        chosen.contains(i) == inside && divides_line(&rest, x, y, &lines[*i])
                    })
                    .map(|i| &lines[i])
                    .fold(UPoly::one(), |a, b| &a * b)
            })
            .into();
        let candidate = reconstruct(&rest, x, y, &groups)?;
        rest = rest.div_exact(&candidate)?;
        Some(candidate)
    })?;
    let mut factors: Vec<Poly> = factors.iter().map(back).collect();
    if !left.is_empty() {
        factors.push(back(&rest));
    }
    Ok(factors)
}

/// Whether a univariate factor belongs to what is left at y = 0.
fn divides_line(rest: &Poly, x: usize, y: usize, line: &UPoly) -> bool {
    rest.set(y, &RBig::ZERO)
        .to_upoly(x)
        .is_some_and(|r| r.div_exact(line).is_some())
}

/// 0, 1, −1, 2, −2, …
fn small_numbers() -> impl Iterator<Item = RBig> {
    (0i64..).map(|i| RBig::from(if i % 2 == 1 { (i + 1) / 2 } else { -i / 2 }))
}

/// Factors of a polynomial f(x, y)/lc as power series in y modulo a prime, monic in x.
struct Lifted {
    field: Fp,
    /// For every factor the coefficients of y⁰, y¹, … as polynomials in x.
    series: Vec<Vec<Vec<u64>>>,
}

impl Lifted {
    /// The lifts modulo one prime after the other; the lines are coprime and their product is f(x,
    /// 0) up to a constant.
    fn new(f: &Poly, x: usize, y: usize, lines: &[UPoly]) -> impl Iterator<Item = Self> {
        let degree = f.total_degree();
        primes().filter_map(move |field| {
            let mut rows = vec![vec![0; degree + 1]; degree + 1];
            for (e, c) in f.terms() {
                rows[usize::from(e[y])][usize::from(e[x])] = field.of_ibig(c);
            }
            let lead = rows[0][degree];
            if lead == 0 {
                return None;
            }
            let inverse = field.inv(lead);
            let rows: Vec<Vec<u64>> = rows
                .iter()
                .map(|r| modpoly::scale(&field, r, inverse))
                .collect();
            let bases: Vec<Vec<u64>> = lines
                .iter()
                .map(|l| modpoly::monic(&field, &l.residues(&field)))
                .collect();
            // 1/∏ of the others modulo each, if they are coprime modulo the prime.
            let mut cofactors = Vec::new();
            for (i, base) in bases.iter().enumerate() {
                let others = bases
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| *j != i)
                    .map(|(_, b)| b);
                let product = others.fold(vec![field.one()], |a, b| {
                    modpoly::rem(&field, modpoly::mul(&field, &a, b), base)
                });
                let (g, inverse, _) = modpoly::gcd_extended(&field, &product, base);
                if g.len() != 1 {
                    return None;
                }
                cofactors.push(inverse);
            }
            Some(Self {
                series: lift_series(&field, &rows, &bases, &cofactors),
                field,
            })
        })
    }

    /// Whether the product of the chosen series ends like a factor: the coefficient of x^(d−m) has
    /// degree at most m in y.
    fn is_plausible(&self, chosen: &[usize]) -> bool {
        let f = &self.field;
        let precision = self.series[0].len();
        // The sum of the coefficients of x^(dᵢ−1) is that of the product; it has degree at most 1.
        let trace = |k: usize| {
            chosen.iter().fold(0, |sum, &i| {
                let s = &self.series[i];
                f.add(sum, s[k].get(s[0].len() - 2).copied().unwrap_or(0))
            })
        };
        if (2..precision).any(|k| trace(k) != 0) {
            return false;
        }
        let product = self.product(chosen);
        let d = product[0].len() - 1;
        product
            .iter()
            .enumerate()
            .all(|(k, row)| row.is_empty() || row.len() + k <= d + 1)
    }

    fn product(&self, chosen: &[usize]) -> Vec<Vec<u64>> {
        let f = &self.field;
        let precision = self.series[0].len();
        let mut product = vec![Vec::new(); precision];
        product[0] = vec![f.one()];
        for &i in chosen {
            product = (0..precision)
                .map(|k| {
                    (0..=k).fold(Vec::new(), |s, a| {
                        modpoly::add(f, &s, &modpoly::mul(f, &product[a], &self.series[i][k - a]))
                    })
                })
                .collect();
        }
        product
    }
}

/// Linear Hensel lifting of all factors together: at y^k the error e is Σ σᵢ ∏ⱼ≠ᵢ with σᵢ =
/// e·cofactorᵢ modulo the i-th.
fn lift_series(
    f: &Fp,
    rows: &[Vec<u64>],
    bases: &[Vec<u64>],
    cofactors: &[Vec<u64>],
) -> Vec<Vec<Vec<u64>>> {
    let precision = rows.len();
    let mut series: Vec<Vec<Vec<u64>>> = bases.iter().map(|b| vec![b.clone()]).collect();
    // Products of the first i series, coefficient by coefficient.
    let mut products: Vec<Vec<Vec<u64>>> = vec![Vec::new(); bases.len() + 1];
    products[0] = (0..precision)
        .map(|k| if k == 0 { vec![f.one()] } else { Vec::new() })
        .collect();
    for i in 0..bases.len() {
        let next = modpoly::mul(f, &products[i][0], &bases[i]);
        products[i + 1].push(next);
    }
    for k in 1..precision {
        for s in &mut series {
            s.push(Vec::new());
        }
        let update = |products: &mut Vec<Vec<Vec<u64>>>, series: &[Vec<Vec<u64>>]| {
            for (i, s) in series.iter().enumerate() {
                let sum = (0..=k).fold(Vec::new(), |sum, a| {
                    modpoly::add(f, &sum, &modpoly::mul(f, &products[i][a], &s[k - a]))
                });
                products[i + 1].truncate(k);
                products[i + 1].push(sum);
            }
        };
        update(&mut products, &series);
        let mut target = rows[k].clone();
        modpoly::trim(&mut target);
        let error = modpoly::sub(f, &target, &products[bases.len()][k]);
        if error.is_empty() {
            continue;
        }
        for ((s, base), cofactor) in series.iter_mut().zip(bases).zip(cofactors) {
            let reduced = modpoly::rem(f, error.clone(), base);
            s[k] = modpoly::rem(f, modpoly::mul(f, &reduced, cofactor), base);
        }
        update(&mut products, &series);
    }
    series
}

/// The factor of f whose line is the first group, from lifts modulo more and more primes; nothing
/// if coefficients as large as a factor can have do not give one.
fn reconstruct(f: &Poly, x: usize, y: usize, groups: &[UPoly]) -> Option<Poly> {
    let d = groups[0].degree();
    if groups[1].degree() == 0 {
        return Some(f.primitive());
    }
    // A. O. Gelfond: the heights of factors multiply up to at most 2^(sum of degrees) times the
    // height of the product; numerators and denominators of the monic factor are bounded so too.
    let height = f
        .terms()
        .iter()
        .map(|(_, c)| bit_len(&c.clone().abs().unsigned_abs()))
        .max()
        .unwrap_or(0);
    let enough = 2 * (height + 2 * f.total_degree() + 2) + 2;
    let mut crt: Option<Crt> = None;
    for lifted in Lifted::new(f, x, y, groups) {
        let series = &lifted.series[0];
        let mut residues = Vec::new();
        for k in 0..=d {
            for i in 0..=d - k {
                residues.push(
                    series
                        .get(k)
                        .and_then(|row| row.get(i))
                        .copied()
                        .unwrap_or(0),
                );
            }
        }
        let crt = crt.get_or_insert_with(|| Crt::new(residues.len()));
        crt.push(&lifted.field, &residues);
        if let Some((numerators, _)) = crt.rational() {
            let places = (0..=d).flat_map(|k| (0..=d - k).map(move |i| (k, i)));
            let terms = places.zip(numerators).map(|((k, i), c)| {
                let mut e = [0; MAX_VARS];
                (e[x], e[y]) = (i as u16, k as u16);
                (e, c)
            });
            let candidate = Poly::from_integers(terms, UBig::ONE).primitive();
            if f.is_multiple_of(&candidate) {
                return Some(candidate);
            }
        }
        if bit_len(crt.modulus()) > enough {
            return None;
        }
    }
    None
}
