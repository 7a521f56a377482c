//! Resultants, discriminants and subresultants of polynomials in two variables.
//!
//! Values at points modulo primes, interpolated and lifted (G. E. Collins, J. ACM 18, 1971, pages
//! 515–532). Degrees and the number of primes come from bounds on the Sylvester matrix: of a
//! determinant of polynomials each coefficient is at most the product over the rows of √(Σ‖aᵢⱼ‖₁²)
//! (A. J. Goldstein, R. L. Graham, SIAM Review 16, 1974, pages 394–395). The results are proven.
//!
//! The j-th subresultant of f (degree n) and g (degree m ≤ n) in y is the polynomial of degree at
//! most j
//!
//! ```text
//! Sⱼ = Σᵢ det(Mⱼᵢ) yⁱ,   Mⱼᵢ: rows y^(m−j−1) f, …, f, y^(n−j−1) g, …, g;
//!                             columns y^(n+m−j−1), …, y^(j+1), yⁱ
//! ```
//!
//! and S₀ is the resultant. Where S₀ … S₍ₖ₋₁₎ lose their principal coefficients (of yʲ) and Sₖ does
//! not, Sₖ is the common divisor.

use crate::modpoly;
use crate::modular::{Crt, Fp, primes, sqrt_floor};
use crate::poly::Poly;
use crate::upoly::UPoly;
use dashu_base::UnsignedAbs;
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::{Mutex, PoisonError};

/// Number of points between two checks of the control.
const POINTS_PER_CHECK: usize = 64;

/// Reason why a resultant could not be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ResultantError {
    /// More than one variable besides the eliminated one.
    #[error("the polynomials have more than one variable besides the one to be eliminated")]
    TooManyVariables,
    /// The work was cancelled, or its deadline is over.
    #[error("stopped")]
    Stopped,
}

impl ResultantError {
    /// Converts the error to [`Stopped`], the only one possible if the number of variables is
    /// right.
    ///
    /// # Panics
    /// If there were too many variables.
    pub fn only_stopped(self) -> Stopped {
        assert_eq!(self, Self::Stopped, "polynomials in few variables");
        Stopped
    }
}

impl From<Stopped> for ResultantError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

/// Returns the resultant of two polynomials with respect to a variable; they have at most one other
/// variable. It is zero if one of the polynomials is, and the other's power if one of them lacks
/// the variable.
///
/// ```
/// use isoform_control::Control;
/// use isoform_algebra::{Poly, resultant};
/// let p = |text| Poly::parse(text, &["x", "y"]).expect(text);
/// let circle_on_diagonal = resultant(&p("x^2 + y^2 - 1"), &p("y - x"), 1, &Control::default());
/// assert_eq!(circle_on_diagonal, Ok(p("2*x^2 - 1")));
/// ```
///
/// # Errors
/// [`ResultantError`].
pub fn resultant(
    f: &Poly,
    g: &Poly,
    var: usize,
    control: &Control<'_>,
) -> Result<Poly, ResultantError> {
    let (other, pair) = PolynomialPair::new(f, g, var)?;
    if f.is_zero() || g.is_zero() {
        return Ok(Poly::zero());
    }
    let (n, m) = (pair.f.len() - 1, pair.g.len() - 1);
    let integer = Poly::from_upoly(&pair.resultant(control)?, other);
    Ok(integer.scale(&RBig::from_parts(
        IBig::ONE,
        f.denominator().pow(m) * g.denominator().pow(n),
    )))
}

/// Returns the discriminant with respect to a variable, (−1)^(n(n−1)/2) Res(f, f′)/lc(f); 1 for
/// degree 1 and below.
///
/// # Errors
/// [`ResultantError`].
pub fn discriminant(f: &Poly, var: usize, control: &Control<'_>) -> Result<Poly, ResultantError> {
    let n = f.degree(var);
    if n < 2 {
        return Ok(Poly::one());
    }
    let r = resultant(f, &f.derivative(var), var, control)?;
    let lead = f.coefficients_in(var).swap_remove(n);
    let quotient = r
        .div_exact(&lead)
        .expect("the leading coefficient divides the first column");
    Ok(if n * (n - 1) / 2 % 2 == 1 {
        -quotient
    } else {
        quotient
    })
}

/// Returns the resultant of two univariate polynomials.
pub fn resultant_univariate(f: &UPoly, g: &UPoly) -> IBig {
    if f.is_zero() || g.is_zero() {
        return IBig::ZERO;
    }
    let norm = |p: &UPoly| {
        p.coefficients()
            .iter()
            .map(|c| c.clone().unsigned_abs().pow(2))
            .sum::<UBig>()
    };
    let bound = hadamard(&norm(f), g.degree(), &norm(g), f.degree());
    let mut crt = Crt::new(1);
    for field in primes() {
        let residues = |p: &UPoly| {
            p.coefficients()
                .iter()
                .map(|c| field.of_ibig(c))
                .collect::<Vec<_>>()
        };
        crt.push(&field, &[resultant_at(&field, &residues(f), &residues(g))]);
        if *crt.modulus() > bound {
            break;
        }
    }
    crt.symmetric().swap_remove(0)
}

/// Returns twice √(f^m g^n), rounded up: a modulus above it suffices.
fn hadamard(f: &UBig, m: usize, g: &UBig, n: usize) -> UBig {
    (sqrt_floor(&(f.pow(m) * g.pow(n))) + UBig::ONE) << 1
}

/// Returns the resultant of two polynomials with formal degrees, their lengths less one, even if
/// leading coefficients vanish.
fn resultant_at(f: &Fp, a: &[u64], b: &[u64]) -> u64 {
    let (n, m) = (a.len() - 1, b.len() - 1);
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    modpoly::trim(&mut a);
    modpoly::trim(&mut b);
    let (drop_a, drop_b) = (n + 1 - a.len(), m + 1 - b.len());
    if drop_a > 0 && drop_b > 0 {
        return if n == 0 && m == 0 { f.one() } else { 0 };
    }
    if n == 0 && m == 0 {
        return f.one();
    }
    let r = modpoly::resultant(f, &a, &b);
    if drop_b > 0 {
        if b.is_empty() {
            return if n == 0 { f.pow(a[0], m as u64) } else { 0 };
        }
        return f.mul(r, f.pow(a[n], drop_b as u64));
    }
    if drop_a > 0 {
        if a.is_empty() {
            return if m == 0 { f.pow(b[0], n as u64) } else { 0 };
        }
        let r = f.mul(r, f.pow(b[m], drop_a as u64));
        return if m * drop_a % 2 == 1 { f.neg(r) } else { r };
    }
    r
}

/// Returns all subresultants Sⱼ, j < m, of two polynomials of exact degrees n ≥ m, by Euclid's
/// algorithm: Sⱼ(a, b) = (−1)^((n−j)(m−j)) lc(b)^(n−k) Sⱼ(b, r), where r = a mod b has degree k ≥
/// j.
pub(crate) fn subresultants_at(f: &Fp, a: &[u64], b: &[u64]) -> Vec<Vec<u64>> {
    let mut chain = vec![Vec::new(); b.len() - 1];
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    // The factor of Sⱼ of the current pair, for even and odd j.
    let mut factor = [f.one(); 2];
    let signed = |v: u64, odd: bool| if odd { f.neg(v) } else { v };
    while b.len() > 1 {
        let (n, m) = (a.len() - 1, b.len() - 1);
        let lead = b[m];
        modpoly::div_rem(f, &mut a, &b);
        let c = f.mul(factor[(m - 1) % 2], f.pow(lead, (n - m + 1) as u64));
        chain[m - 1] = modpoly::scale(f, &a, signed(c, (n - m + 1) % 2 == 1));
        if a.is_empty() {
            break;
        }
        let k = a.len() - 1;
        let power = f.pow(lead, (n - k) as u64);
        if k + 1 < m {
            let c = f.mul(f.mul(factor[k % 2], power), f.pow(a[k], (m - k - 1) as u64));
            chain[k] = modpoly::scale(f, &a, signed(c, (n - k) * (m - k) % 2 == 1));
        }
        for (parity, factor) in factor.iter_mut().enumerate() {
            *factor = signed(f.mul(*factor, power), (n + parity) * (m + parity) % 2 == 1);
        }
        std::mem::swap(&mut a, &mut b);
    }
    chain
}

/// Pair of polynomials in y with integer coefficients in x: coefficient of yⁱ at index i.
struct PolynomialPair {
    f: Vec<UPoly>,
    g: Vec<UPoly>,
    /// Total degrees.
    total: (usize, usize),
    /// Σ‖cᵢ‖₁² over the coefficients of f and of g.
    norms: (UBig, UBig),
}

/// Returns the integer multiple by the denominator, as polynomials in `other` for each power of
/// `var`.
fn coefficients(p: &Poly, var: usize, other: usize) -> Vec<UPoly> {
    let mut rows = vec![vec![IBig::ZERO; p.degree(other) + 1]; p.degree(var) + 1];
    for (e, c) in p.terms() {
        rows[usize::from(e[var])][usize::from(e[other])] = c.clone();
    }
    rows.into_iter().map(UPoly::new).collect()
}

/// Returns Σ‖cᵢ‖₁² over the coefficients.
fn squared_norm(p: &[UPoly]) -> UBig {
    let absolute = |c: &IBig| c.clone().unsigned_abs();
    let norm = |c: &UPoly| c.coefficients().iter().map(absolute).sum::<UBig>();
    p.iter().map(|c| norm(c).pow(2)).sum()
}

impl PolynomialPair {
    /// Returns the variable other than `var`, and the coefficients of both polynomials in it.
    fn new(f: &Poly, g: &Poly, var: usize) -> Result<(usize, Self), ResultantError> {
        let mut others: Vec<usize> = f
            .variables()
            .into_iter()
            .chain(g.variables())
            .filter(|&v| v != var)
            .collect();
        others.sort_unstable();
        others.dedup();
        if others.len() > 1 {
            return Err(ResultantError::TooManyVariables);
        }
        let other = others.first().copied().unwrap_or(usize::from(var == 0));
        let total = (f.total_degree(), g.total_degree());
        let (f, g) = (coefficients(f, var, other), coefficients(g, var, other));
        let norms = (squared_norm(&f), squared_norm(&g));
        Ok((other, Self { f, g, total, norms }))
    }

    /// Returns a bound on the degree in x of the coefficient of yⁱ in Sⱼ: by degrees in x, and by
    /// total degrees.
    fn degree_bound(&self, j: usize, i: usize) -> usize {
        let (n, m) = (self.f.len() - 1, self.g.len() - 1);
        let along = |p: &[UPoly]| p.iter().map(UPoly::degree).max().unwrap_or(0);
        let by_x = along(&self.f) * (m - j) + along(&self.g) * (n - j);
        // Row yˢ f has in the column of yᶜ a coefficient of degree at most (total degree of f) + s
        // − c.
        let shifts = |rows: usize| rows * rows.saturating_sub(1) / 2;
        let columns: usize = (j + 1..n + m - j).sum::<usize>() + i;
        let by_total =
            (self.total.0 * (m - j) + self.total.1 * (n - j) + shifts(m - j) + shifts(n - j))
                .saturating_sub(columns);
        by_x.min(by_total)
    }

    /// Returns twice a bound on the coefficients of Sⱼ: its rows are rows of S₀, each at least of
    /// length 1.
    fn modulus_bound(&self, j: usize) -> UBig {
        hadamard(
            &self.norms.0,
            self.g.len() - 1 - j,
            &self.norms.1,
            self.f.len() - 1 - j,
        )
    }

    /// Returns S₀.
    fn resultant(&self, control: &Control<'_>) -> Result<UPoly, ResultantError> {
        let mut values = self.lift(&[(0, 0)], false, control, |field, a, b| {
            vec![resultant_at(field, a, b)]
        })?;
        Ok(values.swap_remove(0))
    }

    /// Returns the coefficients of yⁱ in Sⱼ for pairs (j, i) as integer polynomials in x, from
    /// their values at points modulo primes, which `at` computes from the values of the
    /// coefficients of f and g. With `exact`, points at which a leading coefficient vanishes are
    /// left out.
    fn lift(
        &self,
        wanted: &[(usize, usize)],
        exact: bool,
        control: &Control<'_>,
        at: impl Fn(&Fp, &[u64], &[u64]) -> Vec<u64>,
    ) -> Result<Vec<UPoly>, ResultantError> {
        let mut lifts: Vec<CoefficientLift> = wanted
            .iter()
            .map(|&w| CoefficientLift::new(self, w))
            .collect();
        for field in primes() {
            control.check()?;
            let open = lifts.iter().filter(|l| l.is_open());
            let Some(degree) = open.map(|l| l.degree).max() else {
                break;
            };
            let image = ImagePair::new(field, self);
            if exact && image.loses_degree() {
                continue;
            }
            let samples = image.sample(degree + 1, exact, control, &at)?;
            let last = samples.nodes[samples.nodes.len() - 1];
            let inverses = modpoly::small_inverses(&field, last);
            for (lift, values) in lifts.iter_mut().zip(&samples.columns) {
                if !lift.is_open() {
                    continue;
                }
                if degree > POINTS_PER_CHECK {
                    control.check()?;
                }
                lift.push(&field, &samples.nodes, values, &inverses);
            }
        }
        Ok(lifts
            .iter()
            .map(|l| UPoly::new(l.crt.symmetric()))
            .collect())
    }
}

/// Integer polynomial of bounded degree and coefficients, lifted from its images modulo primes.
struct CoefficientLift {
    degree: usize,
    /// Bound on the modulus: a modulus above it suffices.
    bound: UBig,
    crt: Crt,
}

impl CoefficientLift {
    /// Creates the lift of the coefficient of yⁱ in Sⱼ.
    fn new(pair: &PolynomialPair, (j, i): (usize, usize)) -> Self {
        let degree = pair.degree_bound(j, i);
        Self {
            degree,
            bound: pair.modulus_bound(j),
            crt: Crt::new(degree + 1),
        }
    }

    fn is_open(&self) -> bool {
        *self.crt.modulus() <= self.bound
    }

    /// Adds the image with these values at the nodes, whose number has to suffice.
    fn push(&mut self, field: &Fp, nodes: &[usize], values: &[u64], inverses: &[u64]) {
        let points = self.degree + 1;
        let (nodes, values) = (&nodes[..points], &values[..points]);
        let mut coefficients = modpoly::interpolate(field, nodes, values, inverses);
        coefficients.resize(points, 0);
        self.crt.push(field, &coefficients);
    }
}

/// Pair modulo a prime.
struct ImagePair {
    field: Fp,
    f: Vec<Vec<u64>>,
    g: Vec<Vec<u64>>,
}

/// Values at points of x.
struct PairSamples {
    nodes: Vec<usize>,
    /// Values at the nodes of each requested number.
    columns: Vec<Vec<u64>>,
}

impl ImagePair {
    fn new(field: Fp, pair: &PolynomialPair) -> Self {
        let residues = |p: &[UPoly]| -> Vec<Vec<u64>> {
            p.iter()
                .map(|c| c.coefficients().iter().map(|c| field.of_ibig(c)).collect())
                .collect()
        };
        Self {
            field,
            f: residues(&pair.f),
            g: residues(&pair.g),
        }
    }

    /// Returns true if a leading coefficient vanishes modulo the prime.
    fn loses_degree(&self) -> bool {
        let vanishes = |lead: &Vec<u64>| lead.iter().all(|&c| c == 0);
        [&self.f, &self.g]
            .iter()
            .any(|p| p.last().is_none_or(vanishes))
    }

    /// Returns the values of `at` at the first points x = 0, 1, …; with `exact`, without points at
    /// which a leading coefficient vanishes.
    fn sample(
        &self,
        count: usize,
        exact: bool,
        control: &Control<'_>,
        at: &impl Fn(&Fp, &[u64], &[u64]) -> Vec<u64>,
    ) -> Result<PairSamples, ResultantError> {
        let field = &self.field;
        let mut nodes = Vec::with_capacity(count);
        let mut columns: Vec<Vec<u64>> = Vec::new();
        for x in 0.. {
            if nodes.len() == count {
                break;
            }
            if nodes.len().is_multiple_of(POINTS_PER_CHECK) {
                control.check()?;
            }
            let point = field.of_u64(x as u64);
            let line = |p: &[Vec<u64>]| -> Vec<u64> {
                p.iter().map(|c| modpoly::eval(field, c, point)).collect()
            };
            let (a, b) = (line(&self.f), line(&self.g));
            if exact && (a.last() == Some(&0) || b.last() == Some(&0)) {
                continue;
            }
            let values = at(field, &a, &b);
            columns.resize(values.len(), Vec::new());
            for (column, v) in columns.iter_mut().zip(values) {
                column.push(v);
            }
            nodes.push(x);
        }
        Ok(PairSamples { nodes, columns })
    }
}

/// Subresultants of two polynomials in y with coefficients in x, taken as their integer multiples
/// by the (positive) denominators, so that signs are kept.
pub struct Subresultants {
    /// Resultant S₀, as a polynomial in x.
    pub resultant: UPoly,
    /// Principal coefficients computed so far. Most chains are used for S₀ alone, and all others
    /// cost ten times as much together.
    principal: Mutex<BTreeMap<usize, UPoly>>,
    /// Number of subresultants: the lower degree in y.
    count: usize,
    pair: PolynomialPair,
    var: usize,
    other: usize,
}

impl Subresultants {
    /// Creates the chain of f and g with respect to a variable; their degrees in it are n ≥ m ≥ 1.
    ///
    /// # Errors
    /// [`ResultantError`].
    ///
    /// # Panics
    /// If the degree of g in the variable is 0 or exceeds that of f.
    pub fn new(
        f: &Poly,
        g: &Poly,
        var: usize,
        control: &Control<'_>,
    ) -> Result<Self, ResultantError> {
        let (other, pair) = PolynomialPair::new(f, g, var)?;
        let (n, m) = (pair.f.len() - 1, pair.g.len() - 1);
        assert!(n >= m && m >= 1, "subresultants of degrees {n} and {m}");
        Ok(Self {
            resultant: pair.resultant(control)?,
            principal: Mutex::default(),
            count: m,
            pair,
            var,
            other,
        })
    }
    /// Returns the number of subresultants: S₀ … Sₘ₋₁ for the lower degree m.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the coefficient of yʲ in Sⱼ, as a polynomial in x.
    ///
    /// # Errors
    /// [`ResultantError::Stopped`].
    ///
    /// # Panics
    /// If j is not below the lower degree.
    pub fn principal(&self, j: usize, control: &Control<'_>) -> Result<UPoly, ResultantError> {
        assert!(j < self.count, "there is no subresultant of index {j}");
        if j == 0 {
            return Ok(self.resultant.clone());
        }
        let known = || {
            self.principal
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
        };
        if let Some(c) = known().get(&j) {
            return Ok(c.clone());
        }
        let made = self.coefficients(j, j..=j, control)?.swap_remove(0);
        known().insert(j, made.clone());
        Ok(made)
    }

    /// Returns the whole polynomial Sⱼ.
    ///
    /// # Errors
    /// [`ResultantError::Stopped`].
    ///
    /// # Panics
    /// If j is not below the lower degree.
    pub fn polynomial(&self, j: usize, control: &Control<'_>) -> Result<Poly, ResultantError> {
        assert!(j < self.count, "there is no subresultant of index {j}");
        let columns = self.coefficients(j, 0..=j, control)?;
        let powers = columns
            .iter()
            .enumerate()
            .map(|(i, c)| Poly::from_upoly(c, self.other) * Poly::var(self.var).pow(i as u32));
        Ok(powers.fold(Poly::zero(), |sum, t| sum + t))
    }

    /// Returns the coefficients of powers of y in Sⱼ.
    fn coefficients(
        &self,
        j: usize,
        powers: RangeInclusive<usize>,
        control: &Control<'_>,
    ) -> Result<Vec<UPoly>, ResultantError> {
        let wanted: Vec<(usize, usize)> = powers.map(|i| (j, i)).collect();
        self.pair.lift(&wanted, true, control, |field, a, b| {
            let s = subresultants_at(field, a, b).swap_remove(j);
            let at = |&(_, i): &(usize, usize)| s.get(i).copied().unwrap_or(0);
            wanted.iter().map(at).collect()
        })
    }
}
