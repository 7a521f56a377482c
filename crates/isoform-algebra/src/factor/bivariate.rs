//! Factors of polynomials in two variables.
//!
//! A shear makes the leading coefficient in x constant, so that a factor of degree d in x has total
//! degree d. y is set to a number; the univariate factors on that line are lifted as power series
//! in y modulo primes, and a product of them counts if its coefficients end where the coefficients
//! of a factor must. It is lifted modulo more primes until it divides.

use super::FactorError;
use super::recombination::by_subsets;
use super::univariate::factor_univariate;
use crate::modpoly;
use crate::modular::{Crt, Fp, bit_len, primes};
use crate::poly::{MAX_VARS, Poly};
use crate::upoly::UPoly;
use dashu_base::{Abs, UnsignedAbs};
use dashu_int::UBig;
use dashu_ratio::RBig;
use isoform_control::Control;

/// Maximum number of values tried in place of a variable; the one that leaves the fewest factors is
/// taken.
const MAX_TRIED_POINTS: usize = 3;

/// Returns the factors of a polynomial that is primitive over Z, squarefree, and without factors in
/// one variable alone.
pub(super) fn factor_bivariate(
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
    let Some((point, lines)) = best_line(&f, x, y, control)? else {
        return Ok(vec![p.clone()]);
    };
    let moved = f
        .substitute(y, &(Poly::var(y) + Poly::constant(point.clone())))
        .primitive();
    let factors = factors_from_line(moved, x, y, &lines, control)?;
    let back = |q: &Poly| -> Poly {
        let centred = q.substitute(y, &(Poly::var(y) - Poly::constant(point.clone())));
        sheared(&-c.clone(), &centred).primitive()
    };
    Ok(factors.iter().map(back).collect())
}

/// Returns the value of y that leaves the fewest univariate factors, with these; `None` if one
/// leaves a single factor, which proves irreducibility.
fn best_line(
    f: &Poly,
    x: usize,
    y: usize,
    control: &Control<'_>,
) -> Result<Option<(RBig, Vec<UPoly>)>, FactorError> {
    let mut best: Option<(RBig, Vec<UPoly>)> = None;
    let mut tried = 0;
    for point in small_numbers() {
        let line = f.set(y, &point).to_upoly(x).expect("one variable");
        if line.squarefree_part().degree() < f.total_degree() {
            continue;
        }
        let factors = factor_univariate(&line, control)?;
        if factors.len() == 1 {
            return Ok(None);
        }
        if best.as_ref().is_none_or(|(_, b)| factors.len() < b.len()) {
            best = Some((point, factors));
        }
        tried += 1;
        if tried == MAX_TRIED_POINTS {
            break;
        }
    }
    assert!(
        best.is_some(),
        "a squarefree polynomial stays so almost everywhere"
    );
    Ok(best)
}

/// Returns the factors of a polynomial from those at y = 0.
fn factors_from_line(
    f: Poly,
    x: usize,
    y: usize,
    lines: &[UPoly],
    control: &Control<'_>,
) -> Result<Vec<Poly>, FactorError> {
    let first = LiftedFactors::new(&f, x, y, lines).next().expect("a prime");
    let mut rest = f;
    let (mut factors, left) = by_subsets(lines.len(), control, |chosen| {
        if !first.is_plausible(chosen) {
            return None;
        }
        let is_left = |i: &usize| divides_line(&rest, x, y, &lines[*i]);
        let (chosen, others): (Vec<usize>, Vec<usize>) = (0..lines.len())
            .filter(is_left)
            .partition(|i| chosen.contains(i));
        let product = |of: Vec<usize>| of.iter().fold(UPoly::one(), |a, &i| &a * &lines[i]);
        let candidate = reconstruct(&rest, x, y, &[product(chosen), product(others)])?;
        rest = rest.div_exact(&candidate)?;
        Some(candidate)
    })?;
    if !left.is_empty() {
        factors.push(rest);
    }
    Ok(factors)
}

/// Returns true if a univariate factor divides the remaining polynomial at y = 0.
fn divides_line(rest: &Poly, x: usize, y: usize, line: &UPoly) -> bool {
    rest.set(y, &RBig::ZERO)
        .to_upoly(x)
        .is_some_and(|r| r.div_exact(line).is_some())
}

/// Iterates over 0, 1, −1, 2, −2, …
fn small_numbers() -> impl Iterator<Item = RBig> {
    (0i64..).map(|i| RBig::from(if i % 2 == 1 { (i + 1) / 2 } else { -i / 2 }))
}

/// Returns the coefficients of y⁰, y¹, … as polynomials in x, modulo a prime and monic in x; `None`
/// if the prime divides the leading coefficient in x.
fn monic_rows(field: &Fp, f: &Poly, x: usize, y: usize) -> Option<Vec<Vec<u64>>> {
    let degree = f.total_degree();
    let mut rows = vec![vec![0; degree + 1]; degree + 1];
    for (e, c) in f.terms() {
        rows[usize::from(e[y])][usize::from(e[x])] = field.of_ibig(c);
    }
    let lead = rows[0][degree];
    if lead == 0 {
        return None;
    }
    let inverse = field.inv(lead);
    let monic = |row: &Vec<u64>| modpoly::scale(field, row, inverse);
    Some(rows.iter().map(monic).collect())
}

/// Factors of a polynomial f(x, y)/lc as power series in y modulo a prime, monic in x.
struct LiftedFactors {
    field: Fp,
    /// Coefficients of y⁰, y¹, … of each factor, as polynomials in x.
    series: Vec<Vec<Vec<u64>>>,
}

impl LiftedFactors {
    /// Iterates over the lifts modulo successive primes; the lines are coprime and their product is
    /// f(x, 0) up to a constant.
    fn new(f: &Poly, x: usize, y: usize, lines: &[UPoly]) -> impl Iterator<Item = Self> {
        primes().filter_map(move |field| {
            let rows = monic_rows(&field, f, x, y)?;
            let bases: Vec<Vec<u64>> = lines
                .iter()
                .map(|l| modpoly::monic(&field, &l.residues(&field)))
                .collect();
            let cofactors = cofactors(&field, &bases)?;
            Some(Self {
                series: lift_series(&field, &rows, &bases, &cofactors),
                field,
            })
        })
    }

    /// Returns true if the product of the chosen series may be a factor: the coefficient of x^(d−m)
    /// has degree at most m in y.
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

    /// Returns the coefficients of the first factor up to a total degree, in the order of
    /// [`places_up_to`].
    fn of_first(&self, degree: usize) -> Vec<u64> {
        let series = &self.series[0];
        let at = |[i, k]: [usize; 2]| series.get(k)?.get(i).copied();
        places_up_to(degree)
            .map(|place| at(place).unwrap_or(0))
            .collect()
    }
    /// Returns the product of chosen factors as a power series in y, to the precision of the lifts.
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

/// Returns 1/∏ of the other polynomials modulo each polynomial, if they are coprime modulo the
/// prime.
fn cofactors(f: &Fp, bases: &[Vec<u64>]) -> Option<Vec<Vec<u64>>> {
    let cofactor = |(i, base): (usize, &Vec<u64>)| {
        let others = bases.iter().enumerate().filter(|(j, _)| *j != i);
        let product = others.fold(vec![f.one()], |a, (_, b)| {
            modpoly::rem(f, modpoly::mul(f, &a, b), base)
        });
        let (g, inverse, _) = modpoly::gcd_extended(f, &product, base);
        (g.len() == 1).then_some(inverse)
    };
    bases.iter().enumerate().map(cofactor).collect()
}

/// Lifts all factors together by linear Hensel lifting: at y^k the error e is Σ σᵢ ∏ⱼ≠ᵢ with σᵢ =
/// e·cofactorᵢ modulo the i-th.
fn lift_series(
    f: &Fp,
    rows: &[Vec<u64>],
    bases: &[Vec<u64>],
    cofactors: &[Vec<u64>],
) -> Vec<Vec<Vec<u64>>> {
    let mut series: Vec<Vec<Vec<u64>>> = bases.iter().map(|b| vec![b.clone()]).collect();
    let mut products = PartialProducts::new(f, rows.len(), bases);
    for k in 1..rows.len() {
        for s in &mut series {
            s.push(Vec::new());
        }
        products.set(f, k, &series);
        let mut target = rows[k].clone();
        modpoly::trim(&mut target);
        let error = modpoly::sub(f, &target, products.whole(k));
        if error.is_empty() {
            continue;
        }
        for ((s, base), cofactor) in series.iter_mut().zip(bases).zip(cofactors) {
            let reduced = modpoly::rem(f, error.clone(), base);
            s[k] = modpoly::rem(f, modpoly::mul(f, &reduced, cofactor), base);
        }
        products.set(f, k, &series);
    }
    series
}

/// Products of the first i series, for every i, coefficient by coefficient.
struct PartialProducts(Vec<Vec<Vec<u64>>>);

impl PartialProducts {
    /// Creates the products from the coefficients of y⁰.
    fn new(f: &Fp, precision: usize, bases: &[Vec<u64>]) -> Self {
        let mut one = vec![Vec::new(); precision];
        one[0] = vec![f.one()];
        let mut products = vec![one];
        for (i, base) in bases.iter().enumerate() {
            let next = modpoly::mul(f, &products[i][0], base);
            products.push(vec![next]);
        }
        Self(products)
    }

    /// Computes the coefficients of y^k, replacing existing ones.
    fn set(&mut self, f: &Fp, k: usize, series: &[Vec<Vec<u64>>]) {
        for (i, s) in series.iter().enumerate() {
            let sum = (0..=k).fold(Vec::new(), |sum, a| {
                modpoly::add(f, &sum, &modpoly::mul(f, &self.0[i][a], &s[k - a]))
            });
            self.0[i + 1].truncate(k);
            self.0[i + 1].push(sum);
        }
    }

    /// Returns the coefficient of y^k in the product of all series.
    fn whole(&self, k: usize) -> &[u64] {
        &self.0[self.0.len() - 1][k]
    }
}

/// Iterates over the exponents (i, k) of x and y up to a total degree, in rows of one k.
fn places_up_to(degree: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..=degree).flat_map(move |k| (0..=degree - k).map(move |i| [i, k]))
}

/// Returns the number of bits of a modulus that determines every monic factor of f. The heights of
/// factors multiply up to at most 2^(sum of degrees) times the height of the product (A. O.
/// Gelfond), which bounds numerators and denominators of the monic factor, too.
fn enough_bits(f: &Poly) -> usize {
    let sizes = f.terms().iter();
    let sizes = sizes.map(|(_, c)| bit_len(&c.clone().abs().unsigned_abs()));
    let height = sizes.max().unwrap_or(0);
    2 * (height + 2 * f.total_degree() + 2) + 2
}

/// Returns the factor of f whose line is the first group, from lifts modulo successive primes;
/// `None` if coefficients of the maximum size of a factor do not give one.
fn reconstruct(f: &Poly, x: usize, y: usize, groups: &[UPoly]) -> Option<Poly> {
    let d = groups[0].degree();
    if groups[1].degree() == 0 {
        return Some(f.primitive());
    }
    let enough = enough_bits(f);
    let mut crt: Option<Crt> = None;
    for lifted in LiftedFactors::new(f, x, y, groups) {
        let residues = lifted.of_first(d);
        let crt = crt.get_or_insert_with(|| Crt::new(residues.len()));
        crt.push(&lifted.field, &residues);
        if let Some((numerators, _)) = crt.rational() {
            let terms = places_up_to(d).zip(numerators).map(|([i, k], c)| {
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
