//! Real roots of f(α, y) for a polynomial f(x, y) over Q and a real algebraic number α.
//!
//! Where the resultant of f and ∂f/∂y vanishes, which is decided exactly, the two have a common
//! divisor, and f divided by it has simple roots only. If it is linear, Euclid's algorithm in balls
//! gives it, in which leading coefficients are proved not to vanish (`linear_divisor`). Otherwise
//! it is the first subresultant whose principal coefficient does not vanish at α, again exactly; or
//! Euclid's algorithm over Q gives it, if α is rational.
//!
//! The simple roots are isolated by Descartes' rule on coefficients known to a growing precision
//! (after A. Eigenwillig, L. Kettner, W. Krandick, K. Mehlhorn, S. Schmitt, N. Wolpert, CASC 2005),
//! with ends at which signs are certain. Multiplicities are certain by Pellet's test: if |aₘ| rᵐ
//! exceeds the sum of the other |aᵢ| rⁱ, the disk of radius r around the centre of expansion holds
//! exactly m roots. No genericity is assumed.

mod balls;

use crate::ball::{self, Ball};
use crate::poly::Poly;
use crate::precision::{DOUBLED, refine_until};
use crate::resultant::{ResultantError, Subresultants};
use crate::roots::RealRoot;
use crate::upoly::UPoly;
use balls::{divide, euclid, isolate_simple, narrow, pellet};
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use isoform_control::Control;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Reason why a fibre could not be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FibreError {
    /// Every coefficient vanishes: the whole line belongs to the curve.
    #[error("the polynomial vanishes on the whole fibre")]
    Vertical,
    /// More than two variables, or stopped.
    #[error(transparent)]
    Resultant(#[from] ResultantError),
}

/// Polynomial in two variables prepared for queries about its roots over points of one of them.
pub struct Fibres {
    f: Poly,
    var: usize,
    other: usize,
    /// Coefficients of powers of y as integer polynomials in x.
    coefficients: Vec<UPoly>,
    /// Subresultants of f and its derivative, if the degree in y is at least two.
    chain: Option<Subresultants>,
    /// Complete subresultants computed so far, as coefficients of powers of y.
    whole: Mutex<BTreeMap<usize, Vec<UPoly>>>,
}

/// Real root over a point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FibreRoot {
    /// Lower bound: the root is strictly between `lo` and `hi`, and all other roots are outside of
    /// the closed interval.
    pub lo: RBig,
    /// Upper bound.
    pub hi: RBig,
    /// Multiplicity in f(α, y).
    pub multiplicity: usize,
}

/// Real roots of f(α, y).
pub struct Fibre {
    alpha: RealRoot,
    /// Coefficients in y of f, without leading ones that vanish at α; `divisor` is the common
    /// divisor with the derivative.
    coefficients: Vec<UPoly>,
    divisor: Divisor,
    /// Both at α, at the precision of the last query.
    near: Option<Approximation>,
    /// Real roots in ascending order.
    pub roots: Vec<FibreRoot>,
    /// Number of distinct complex roots.
    pub distinct_complex: usize,
    /// Degree of f(α, y); less than that of f if a root is at infinity.
    pub degree: usize,
}

/// Common divisor of f(α, y) and its derivative.
enum Divisor {
    /// 1: all roots are simple.
    None,
    /// A linear divisor, which Euclid's algorithm gives to any precision.
    Linear,
    /// Coefficients in y as polynomials in x.
    Whole(Vec<UPoly>),
}

/// Coefficients in y at α to a precision.
struct Approximation {
    precision: usize,
    f: Vec<Ball>,
    /// Quotient with simple roots.
    simple: Vec<Ball>,
}

/// Initial number of bits; doubled until everything is decided.
const FIRST_PRECISION: usize = 128;
/// Number of guard bits per degree with which Euclid's algorithm begins: random curves of degree 18
/// lose about 10 of them.
const EUCLID_BITS_PER_DEGREE: usize = 16;
/// Maximum number of attempts of Euclid's algorithm, each with twice the bits of the one before.
const MAX_EUCLID_ATTEMPTS: usize = 3;
/// Number of bits of α beyond the precision of results computed with it.
const GUARD_BITS: usize = 4;
/// Number of bits of α that fibres request first.
pub(crate) const FIRST_BITS: usize = FIRST_PRECISION + GUARD_BITS;

/// Number of bits of roots that are requested first: the maximum that needs no higher precision.
pub(crate) const FIRST_FIBRE_BITS: usize = FIRST_PRECISION / 2;

impl Fibres {
    /// Prepares a polynomial for fibres in which `var` varies and the other variable is fixed.
    ///
    /// # Errors
    /// [`ResultantError`].
    pub fn new(f: &Poly, var: usize, control: &Control<'_>) -> Result<Self, ResultantError> {
        let others: Vec<usize> = f.variables().into_iter().filter(|&v| v != var).collect();
        if others.len() > 1 {
            return Err(ResultantError::TooManyVariables);
        }
        let other = others.first().copied().unwrap_or(usize::from(var == 0));
        let derivative = f.derivative(var);
        let chain = if derivative.degree(var) > 0 {
            Some(Subresultants::new(f, &derivative, var, control)?)
        } else {
            None
        };
        Ok(Self {
            coefficients: coefficients_in(f, var, other),
            f: f.clone(),
            var,
            other,
            chain,
            whole: Mutex::default(),
        })
    }
    /// Returns the coefficient of the highest power of y, as a polynomial in x.
    pub(crate) fn leading(&self) -> &UPoly {
        &self.coefficients[self.coefficients.len() - 1]
    }
    /// Returns the subresultants of f and its derivative, if the degree is at least two.
    pub fn subresultants(&self) -> Option<&Subresultants> {
        self.chain.as_ref()
    }

    /// Returns the real roots over a point, isolated, with multiplicities.
    ///
    /// # Errors
    /// [`FibreError`].
    pub fn at(&self, alpha: &RealRoot, control: &Control<'_>) -> Result<Fibre, FibreError> {
        let kept = (0..self.coefficients.len())
            .rev()
            .find(|&i| alpha.sign_of(&self.coefficients[i]).is_ne());
        let degree = kept.ok_or(FibreError::Vertical)?;
        if degree + 1 < self.coefficients.len() {
            // Over α the polynomial without its vanishing leading terms has equal roots, and its
            // chain specialises.
            let truncated = self
                .f
                .coefficients_in(self.var)
                .into_iter()
                .take(degree + 1)
                .enumerate();
            let truncated = truncated.fold(Poly::zero(), |sum, (i, c)| {
                sum + c * Poly::var(self.var).pow(i as u32)
            });
            return Self::new(&truncated, self.var, control)?.at(alpha, control);
        }
        let mut fibre = Fibre {
            alpha: alpha.clone(),
            coefficients: self.coefficients.clone(),
            divisor: Divisor::None,
            near: None,
            roots: Vec::new(),
            distinct_complex: degree,
            degree,
        };
        if let Some(chain) = self
            .chain
            .as_ref()
            .filter(|c| alpha.sign_of(&c.resultant).is_eq())
        {
            let (divisor, repeated) = match fibre.linear_divisor(FIRST_PRECISION) {
                Some(_) => (Divisor::Linear, 1),
                None => self.divisor(chain, alpha, control)?,
            };
            fibre.divisor = divisor;
            fibre.distinct_complex -= repeated;
        }
        let mut attempts = 0..;
        fibre.roots = refine_until(FIRST_PRECISION, DOUBLED, control, |precision| {
            let attempt = attempts.next().expect("there are enough numbers");
            Ok::<_, ResultantError>(fibre.isolate(precision, attempt))
        })?;
        Ok(fibre)
    }

    /// Returns the common divisor over a rational number, by univariate polynomials, and its
    /// degree.
    fn rational_divisor(&self, x: &RBig) -> (Divisor, usize) {
        let over = self.f.set(self.other, x).to_upoly(self.var);
        let over = over.expect("one variable is left");
        let common = over.gcd(&over.derivative());
        let coefficients = common.coefficients().iter();
        let divisor = coefficients.map(|c| UPoly::new(vec![c.clone()])).collect();
        (Divisor::Whole(divisor), common.degree())
    }
    /// Returns the common divisor over a point where the resultant vanishes, and its degree.
    fn divisor(
        &self,
        chain: &Subresultants,
        alpha: &RealRoot,
        control: &Control<'_>,
    ) -> Result<(Divisor, usize), ResultantError> {
        if let Some(x) = known(alpha) {
            return Ok(self.rational_divisor(&x));
        }
        for k in 1..chain.count() {
            let whole = self.subresultant(chain, k, control)?;
            if whole.get(k).is_some_and(|c| alpha.sign_of(c).is_ne()) {
                return Ok((Divisor::Whole(whole), k));
            }
        }
        let derivative = coefficients_in(&self.f.derivative(self.var), self.var, self.other);
        Ok((Divisor::Whole(derivative), chain.count()))
    }

    fn subresultant(
        &self,
        chain: &Subresultants,
        k: usize,
        control: &Control<'_>,
    ) -> Result<Vec<UPoly>, ResultantError> {
        let mut whole = self.whole.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = whole.get(&k) {
            return Ok(known.clone());
        }
        let made = coefficients_in(&chain.polynomial(k, control)?, self.var, self.other);
        whole.insert(k, made.clone());
        Ok(made)
    }

    /// Returns the number of real roots over a point where the leading coefficient does not vanish,
    /// by the signs of the principal subresultants alone (Sturm–Habicht); `None` where it vanishes.
    ///
    /// # Errors
    /// [`ResultantError::Stopped`].
    pub fn count_at(
        &self,
        alpha: &RealRoot,
        control: &Control<'_>,
    ) -> Result<Option<usize>, ResultantError> {
        let lead = self.coefficients.last().map(|c| alpha.sign_of(c));
        let Some(lead) = lead.filter(|s| s.is_ne()) else {
            return Ok(None);
        };
        let Some(chain) = &self.chain else {
            return Ok(Some(self.coefficients.len() - 1));
        };
        let signs: Result<Vec<Ordering>, ResultantError> = (0..chain.count())
            .map(|j| Ok(alpha.sign_of(&chain.principal(j, control)?)))
            .collect();
        Ok(Some(count_by_signs(lead, &signs?)))
    }
}

/// Returns the number of distinct real roots of a polynomial of degree n from the signs of its
/// leading coefficient and of the principal subresultant coefficients S₀ … Sₙ₋₂ of it and its
/// derivative: generalised permanences minus variations (S. Basu, R. Pollack, M.-F. Roy,
/// *Algorithms in Real Algebraic Geometry*, theorem 4.32).
pub fn count_by_signs(lead: Ordering, principal: &[Ordering]) -> usize {
    let n = principal.len() + 1;
    let alternating = |i: usize| {
        if i * i.saturating_sub(1) / 2 % 2 == 1 {
            -1
        } else {
            1
        }
    };
    // Index n: the polynomial itself; n − 1: its derivative; below with the sign (−1)^(i(i−1)/2) of
    // reversing i = n − j rows.
    let signed = |j: usize| {
        if j + 1 >= n {
            lead as i32
        } else {
            principal[j] as i32 * alternating(n - j)
        }
    };
    let mut count = 0;
    let mut last = n;
    for j in (0..n).rev() {
        let s = signed(j);
        if s != 0 {
            if (last - j) % 2 == 1 {
                count += alternating(last - j) * signed(last) * s;
            }
            last = j;
        }
    }
    usize::try_from(count)
        .expect("permanences outweigh variations for a polynomial and its derivative")
}

fn coefficients_in(p: &Poly, var: usize, other: usize) -> Vec<UPoly> {
    let mut rows = vec![vec![IBig::ZERO; p.degree(other) + 1]; p.degree(var) + 1];
    for (e, c) in p.terms() {
        rows[usize::from(e[var])][usize::from(e[other])] = c.clone();
    }
    rows.into_iter().map(UPoly::new).collect()
}

impl Fibre {
    /// Narrows the interval of a root to a width of at most 2^−bits.
    ///
    /// # Errors
    /// [`ResultantError::Stopped`].
    ///
    /// # Panics
    /// If the index is out of range.
    pub fn refine(
        &mut self,
        index: usize,
        bits: usize,
        control: &Control<'_>,
    ) -> Result<(), ResultantError> {
        refine_until(
            FIRST_PRECISION.max(2 * bits),
            DOUBLED,
            control,
            |precision| Ok(self.try_refine(index, bits, precision).then_some(())),
        )
    }
    fn try_refine(&mut self, index: usize, bits: usize, precision: usize) -> bool {
        if !self.approximate(precision) {
            return false;
        }
        let simple = self.near.as_ref().map_or(&[][..], |near| &near.simple);
        let root = &mut self.roots[index];
        let Some((lo, hi)) = narrow(
            simple,
            (to_fixed(&root.lo, precision), to_fixed(&root.hi, precision)),
            bits,
            precision,
        ) else {
            return false;
        };
        // Ends that were rounded could have left the interval only by less than the last place;
        // keep what is certain.
        root.lo = from_fixed(&lo, precision).max(root.lo.clone());
        root.hi = from_fixed(&hi, precision).min(root.hi.clone());
        true
    }

    /// Computes the coefficients of f(α, y) and of its quotient with simple roots; returns false if
    /// that precision is too low.
    fn approximate(&mut self, precision: usize) -> bool {
        if self
            .near
            .as_ref()
            .is_none_or(|near| near.precision != precision)
        {
            // Kept, so that it is refined once.
            self.alpha.refine(precision + GUARD_BITS);
            self.near = self.at_precision(precision);
        }
        self.near.is_some()
    }
    fn at_precision(&self, precision: usize) -> Option<Approximation> {
        let f = self.specialised(&self.coefficients, precision);
        let simple = match &self.divisor {
            Divisor::None => f.clone(),
            Divisor::Linear => divide(&f, &self.linear_divisor(precision)?, precision)?,
            Divisor::Whole(divisor) => {
                divide(&f, &self.specialised(divisor, precision), precision)?
            }
        };
        simple.last()?.sign().filter(|s| s.is_ne())?;
        Some(Approximation {
            precision,
            f,
            simple,
        })
    }
    /// Returns polynomials in x, evaluated at α.
    fn specialised(&self, polynomials: &[UPoly], precision: usize) -> Vec<Ball> {
        let mut alpha = self.alpha.clone();
        alpha.refine(precision + GUARD_BITS);
        let (lo, hi) = alpha.interval();
        let middle = to_fixed(&((&lo + &hi) / RBig::from(2)), precision);
        let x = if lo == hi && from_fixed(&middle, precision) == lo {
            Ball::exact(middle)
        } else {
            Ball {
                middle,
                radius: IBig::from(2),
            }
        };
        let specialise = |c: &UPoly| {
            let coefficients: Vec<Ball> = c
                .coefficients()
                .iter()
                .map(|c| Ball::integer(c, precision))
                .collect();
            ball::eval(&coefficients, &x, precision)
        };
        polynomials.iter().map(specialise).collect()
    }
    /// Returns the divisor y − y₀ of f(α, y) and its derivative, whose resultant vanishes, if it is
    /// of degree 1. In Euclid's algorithm only the last leading coefficient can vanish then. The
    /// algorithm loses digits at each step, and begins with more.
    fn linear_divisor(&self, precision: usize) -> Option<Vec<Ball>> {
        let n = self.coefficients.len() - 1;
        let mut working = 2 * precision + EUCLID_BITS_PER_DEGREE * n;
        for _ in 0..MAX_EUCLID_ATTEMPTS {
            let f = self.specialised(&self.coefficients, working);
            let y0 = euclid(&f, working).filter(|y0| {
                // The radius is small enough for the requested number of bits.
                y0[0].radius <= IBig::ONE << (working - precision)
            });
            if let Some(divisor) = y0 {
                let shift = working - precision;
                let cut = |c: &Ball| Ball {
                    middle: &c.middle >> shift,
                    radius: (&c.radius >> shift) + 2,
                };
                return Some(divisor.iter().map(cut).collect());
            }
            working *= 2;
        }
        None
    }

    /// Isolates all roots at one precision; `None` if that does not decide.
    fn isolate(&mut self, precision: usize, attempt: usize) -> Option<Vec<FibreRoot>> {
        self.approximate(precision);
        let Approximation { f, simple, .. } = self.near.as_ref()?;
        if simple.len() == 1 {
            return Some(Vec::new());
        }
        let mut roots = Vec::new();
        for (lo, hi) in isolate_simple(simple, precision, attempt)? {
            let (mut lo, mut hi) = (lo, hi);
            let mut multiplicity = 1;
            if !matches!(self.divisor, Divisor::None) {
                let mut bits = 4;
                multiplicity = loop {
                    if 3 * bits > precision {
                        return None;
                    }
                    (lo, hi) = narrow(simple, (lo, hi), bits, precision)?;
                    if let Some(m) = pellet(f, simple, &lo, &hi, precision) {
                        break m;
                    }
                    bits *= 2;
                };
            }
            roots.push(FibreRoot {
                lo: from_fixed(&lo, precision),
                hi: from_fixed(&hi, precision),
                multiplicity,
            });
        }
        Some(roots)
    }
}

/// Returns the rational value of a number, if it is obvious.
fn known(alpha: &RealRoot) -> Option<RBig> {
    let (lo, hi) = alpha.interval();
    if lo == hi {
        return Some(lo);
    }
    (alpha.poly().degree() == 1).then(|| alpha.to_rational())?
}

fn to_fixed(r: &RBig, precision: usize) -> IBig {
    (r.numerator() << precision) / r.denominator()
}

fn from_fixed(n: &IBig, precision: usize) -> RBig {
    RBig::from_parts(n.clone(), UBig::ONE << precision)
}

impl FibreRoot {
    /// Returns the middle of the interval.
    pub fn middle(&self) -> RBig {
        (&self.lo + &self.hi) / RBig::from(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_count_roots() {
        use Ordering::{Equal, Greater, Less};
        // y² + c: S₀ = Res(f, f′) = 4c, the discriminant −4c with the sign turned.
        assert_eq!(count_by_signs(Greater, &[Less]), 2);
        assert_eq!(count_by_signs(Greater, &[Equal]), 1);
        assert_eq!(count_by_signs(Greater, &[Greater]), 0);
        assert_eq!(count_by_signs(Less, &[]), 1);
    }
}
