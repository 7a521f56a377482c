//! Polynomials over Q in up to four variables.
//!
//! A [`Poly`] knows its variables by number only: x₀ … x₃. Names belong to text ([`Poly::parse`],
//! [`Poly::display`]), so that (X : Y : Z : W) in s, t and an implicit equation in x, y, z, w meet
//! without conversions, and homogenising is choosing a number.
//!
//! Coefficients are integers over one common denominator without common factor; terms are in
//! descending lexicographic order. Equal polynomials are equal values, and the order of all results
//! derived from them is deterministic.

use crate::UPoly;
use dashu_base::{Gcd, Signed, UnsignedAbs};
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::ops::{Add, Mul, Neg, Sub};

/// Maximum number of variables.
pub const MAX_VARS: usize = 4;

/// Exponents of the four variables in a term.
pub type Exponents = [u16; MAX_VARS];

/// Polynomial over Q in the variables x₀ … x₃.
///
/// ```
/// use isoform_algebra::Poly;
/// let circle = Poly::parse("s^2 + t^2 - 1/4", &["s", "t"])?;
/// let line = Poly::parse("2*s - 3*t", &["s", "t"])?;
/// let product = &circle * &line;
/// assert_eq!(product.total_degree(), 3);
/// assert_eq!(product.div_exact(&line), Some(circle));
/// assert_eq!(line.display(&["s", "t"]).to_string(), "2*s - 3*t");
/// # Ok::<(), isoform_algebra::ParseError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Poly {
    terms: Vec<(Exponents, IBig)>,
    denominator: UBig,
}

impl Default for Poly {
    fn default() -> Self {
        Self::zero()
    }
}

impl Poly {
    /// Returns 0.
    pub fn zero() -> Self {
        Self {
            terms: Vec::new(),
            denominator: UBig::ONE,
        }
    }
    /// Returns 1.
    pub fn one() -> Self {
        Self::constant(1)
    }
    /// Returns a constant.
    pub fn constant(c: impl Into<RBig>) -> Self {
        Self::term(c, [0; MAX_VARS])
    }
    /// Returns the variable with an index.
    ///
    /// # Panics
    /// If var is not below [`MAX_VARS`].
    pub fn var(var: usize) -> Self {
        let mut exponents = [0; MAX_VARS];
        exponents[var] = 1;
        Self::term(1, exponents)
    }
    /// Returns a constant times a product of powers.
    pub fn term(c: impl Into<RBig>, exponents: Exponents) -> Self {
        let (n, denominator) = c.into().into_parts();
        if n.is_zero() {
            Self::zero()
        } else {
            Self {
                terms: vec![(exponents, n)],
                denominator,
            }
        }
    }
    /// Returns the sum of terms in any order, in which exponents may repeat.
    pub fn from_terms(terms: impl IntoIterator<Item = (Exponents, RBig)>) -> Self {
        let mut sum: BTreeMap<Exponents, RBig> = BTreeMap::new();
        for (e, c) in terms {
            *sum.entry(e).or_insert(RBig::ZERO) += c;
        }
        let mut denominator = UBig::ONE;
        for c in sum.values() {
            denominator = lcm(&denominator, c.denominator());
        }
        let lifted = sum
            .into_iter()
            .rev()
            .map(|(e, c)| (e, c.numerator() * (&denominator / c.denominator())));
        let terms = lifted.filter(|(_, c)| !c.is_zero()).collect();
        Self { terms, denominator }
    }
    /// Returns the sum of integer terms over a denominator, in any order, in which exponents may
    /// repeat.
    ///
    /// # Panics
    /// If the denominator is zero.
    pub fn from_integers(
        terms: impl IntoIterator<Item = (Exponents, IBig)>,
        denominator: UBig,
    ) -> Self {
        let mut sum: BTreeMap<Exponents, IBig> = BTreeMap::new();
        for (e, c) in terms {
            *sum.entry(e).or_insert(IBig::ZERO) += c;
        }
        Self::normalised(
            sum.into_iter()
                .rev()
                .filter(|(_, c)| !c.is_zero())
                .collect(),
            denominator,
        )
    }
    /// Returns the sum of terms whose coefficients are the exact values of doubles.
    ///
    /// `None` if a coefficient is infinite or NaN.
    pub fn from_f64(terms: impl IntoIterator<Item = (Exponents, f64)>) -> Option<Self> {
        let exact: Option<Vec<_>> = terms
            .into_iter()
            .map(|(e, c)| Some((e, RBig::try_from(c).ok()?)))
            .collect();
        exact.map(Self::from_terms)
    }

    /// Returns the polynomial of non-zero terms in descending order over a denominator, after
    /// cancelling common factors of all coefficients and the denominator.
    pub(crate) fn normalised(mut terms: Vec<(Exponents, IBig)>, mut denominator: UBig) -> Self {
        assert!(!denominator.is_zero(), "a zero denominator");
        if terms.is_empty() {
            return Self::zero();
        }
        if !denominator.is_one() {
            let mut common = denominator.clone();
            for (_, c) in &terms {
                if common.is_one() {
                    break;
                }
                common = common.gcd(c.clone().unsigned_abs());
            }
            if !common.is_one() {
                for (_, c) in &mut terms {
                    *c /= &common;
                }
                denominator /= common;
            }
        }
        Self { terms, denominator }
    }

    /// Returns the terms with integer coefficients over [`Poly::denominator`], all non-zero, in
    /// descending lexicographic order of exponents.
    pub fn terms(&self) -> &[(Exponents, IBig)] {
        &self.terms
    }
    /// Returns the least common denominator of the coefficients.
    pub fn denominator(&self) -> &UBig {
        &self.denominator
    }
    /// Returns the coefficient of a product of powers.
    pub fn coefficient(&self, exponents: Exponents) -> RBig {
        match self.terms.binary_search_by(|(e, _)| exponents.cmp(e)) {
            Ok(i) => RBig::from_parts(self.terms[i].1.clone(), self.denominator.clone()),
            Err(_) => RBig::ZERO,
        }
    }
    /// Returns the coefficient of the lexicographically highest term; 0 for the zero polynomial.
    pub fn leading_coefficient(&self) -> RBig {
        self.terms.first().map_or(RBig::ZERO, |(_, c)| {
            RBig::from_parts(c.clone(), self.denominator.clone())
        })
    }
    /// Returns true if this is 0.
    pub fn is_zero(&self) -> bool {
        self.terms.is_empty()
    }
    /// Returns true if no variable occurs.
    pub fn is_constant(&self) -> bool {
        self.as_constant().is_some()
    }
    /// Returns the value if no variable occurs.
    pub fn as_constant(&self) -> Option<RBig> {
        match &self.terms[..] {
            [] => Some(RBig::ZERO),
            [(e, c)] if *e == [0; MAX_VARS] => {
                Some(RBig::from_parts(c.clone(), self.denominator.clone()))
            }
            _ => None,
        }
    }
    /// Returns the largest sum of exponents; 0 for the zero polynomial.
    pub fn total_degree(&self) -> usize {
        self.terms.iter().map(|(e, _)| sum(e)).max().unwrap_or(0)
    }
    /// Returns the least sum of exponents, the order of vanishing at the origin; 0 for the zero
    /// polynomial.
    pub fn order(&self) -> usize {
        self.terms.iter().map(|(e, _)| sum(e)).min().unwrap_or(0)
    }
    /// Returns the largest exponent of a variable; 0 for the zero polynomial.
    pub fn degree(&self, var: usize) -> usize {
        self.terms
            .iter()
            .map(|(e, _)| usize::from(e[var]))
            .max()
            .unwrap_or(0)
    }
    /// Returns the largest exponents of all variables.
    pub fn degrees(&self) -> [usize; MAX_VARS] {
        std::array::from_fn(|v| self.degree(v))
    }
    /// Returns true if the sum of exponents is equal for all terms.
    pub fn is_homogeneous(&self) -> bool {
        self.total_degree() == self.order()
    }
    /// Returns the terms whose sum of exponents is `degree`.
    pub fn homogeneous_part(&self, degree: usize) -> Self {
        let terms = self
            .terms
            .iter()
            .filter(|(e, _)| sum(e) == degree)
            .cloned()
            .collect();
        Self::normalised(terms, self.denominator.clone())
    }

    /// Returns this polynomial times a number.
    pub fn scale(&self, c: &RBig) -> Self {
        if c.is_zero() {
            return Self::zero();
        }
        let terms = self
            .terms
            .iter()
            .map(|(e, v)| (*e, v * c.numerator()))
            .collect();
        Self::normalised(terms, &self.denominator * c.denominator())
    }
    /// Returns this polynomial to a power; the zeroth is 1.
    ///
    /// # Panics
    /// If an exponent exceeds 65535.
    pub fn pow(&self, n: u32) -> Self {
        let mut result = Self::one();
        for bit in (0..u32::BITS - n.leading_zeros()).rev() {
            result = &result * &result;
            if n >> bit & 1 == 1 {
                result = &result * self;
            }
        }
        result
    }
    /// Returns the partial derivative.
    pub fn derivative(&self, var: usize) -> Self {
        let lower = |(e, c): &(Exponents, IBig)| {
            let mut lowered = *e;
            lowered[var] = e[var].checked_sub(1)?;
            Some((lowered, c * e[var]))
        };
        Self::normalised(
            self.terms.iter().filter_map(lower).collect(),
            self.denominator.clone(),
        )
    }
    /// Returns the value where variable i is `at[i]`; variables beyond the slice must not occur.
    ///
    /// # Panics
    /// If a variable beyond the slice occurs.
    pub fn eval(&self, at: &[RBig]) -> RBig {
        let tables: Vec<Vec<IBig>> = at
            .iter()
            .enumerate()
            .map(|(v, r)| fraction_powers(r, self.degree(v)))
            .collect();
        let mut numerator = IBig::ZERO;
        for (e, c) in &self.terms {
            assert!(
                e[at.len().min(MAX_VARS)..].iter().all(|&n| n == 0),
                "a variable without value"
            );
            numerator += tables
                .iter()
                .zip(e)
                .fold(c.clone(), |product, (table, &n)| {
                    product * &table[usize::from(n)]
                });
        }
        let mut denominator = self.denominator.clone();
        for (v, r) in at.iter().enumerate().take(MAX_VARS) {
            denominator *= r.denominator().pow(self.degree(v));
        }
        RBig::from_parts(numerator, denominator)
    }
    /// Returns this polynomial with a number in place of a variable.
    pub fn set(&self, var: usize, value: &RBig) -> Self {
        let degree = self.degree(var);
        let table = fraction_powers(value, degree);
        let replaced = self.terms.iter().map(|(e, c)| {
            let mut rest = *e;
            rest[var] = 0;
            (rest, c * &table[usize::from(e[var])])
        });
        Self::from_integers(
            replaced,
            &self.denominator * value.denominator().pow(degree),
        )
    }
    /// Returns this polynomial with a polynomial in place of a variable.
    pub fn substitute(&self, var: usize, by: &Self) -> Self {
        let mut parts: Vec<Self> = (0..MAX_VARS).map(Self::var).collect();
        parts[var] = by.clone();
        self.compose(&parts)
    }
    /// Returns this polynomial with variable `permutation[i]` in place of variable i.
    pub fn rename(&self, permutation: [usize; MAX_VARS]) -> Self {
        let moved = self.terms.iter().map(|(e, c)| {
            let mut target = [0; MAX_VARS];
            for (i, &n) in e.iter().enumerate() {
                target[permutation[i]] += n;
            }
            (target, c.clone())
        });
        Self::from_integers(moved, self.denominator.clone())
    }
    /// Returns the form of a degree that becomes this polynomial with 1 in place of a variable:
    /// each term is multiplied by a power of the variable.
    ///
    /// # Panics
    /// If the degree is below the total degree.
    pub fn homogenise(&self, var: usize, degree: usize) -> Self {
        let filled = self.terms.iter().map(|(e, c)| {
            let mut target = *e;
            let missing = degree
                .checked_sub(sum(e))
                .expect("a degree no less than the total degree");
            target[var] += u16::try_from(missing).expect("an exponent below 65536");
            (target, c.clone())
        });
        Self::from_integers(filled, self.denominator.clone())
    }
    /// Returns this polynomial with 1 in place of a variable.
    pub fn dehomogenise(&self, var: usize) -> Self {
        self.set(var, &RBig::ONE)
    }
    /// Returns the coefficients of the powers of a variable, lowest first; empty for the zero
    /// polynomial.
    pub fn coefficients_in(&self, var: usize) -> Vec<Self> {
        if self.is_zero() {
            return Vec::new();
        }
        let mut parts = vec![Vec::new(); self.degree(var) + 1];
        for (e, c) in &self.terms {
            let mut rest = *e;
            rest[var] = 0;
            parts[usize::from(e[var])].push((rest, c.clone()));
        }
        parts
            .into_iter()
            .map(|terms| Self::normalised(terms, self.denominator.clone()))
            .collect()
    }

    /// Returns the content: the positive number that [`Poly::primitive`] has to be multiplied by to
    /// give this polynomial up to sign; 0 for the zero polynomial.
    pub fn content(&self) -> RBig {
        RBig::from_parts(IBig::from(self.integer_content()), self.denominator.clone())
    }
    /// Returns the greatest common divisor of the integer coefficients; 0 for the zero polynomial.
    fn integer_content(&self) -> UBig {
        let mut common = UBig::ZERO;
        for (_, c) in &self.terms {
            common = if common.is_zero() {
                c.clone().unsigned_abs()
            } else {
                common.gcd(c.clone().unsigned_abs())
            };
            if common.is_one() {
                break;
            }
        }
        common
    }
    /// Returns the primitive part: the multiple with integer coefficients without common factor and
    /// with a positive leading coefficient.
    pub fn primitive(&self) -> Self {
        let Some((_, lead)) = self.terms.first() else {
            return Self::zero();
        };
        let mut divisor = IBig::from(self.integer_content());
        if lead.is_negative() {
            divisor = -divisor;
        }
        let terms = self.terms.iter().map(|(e, c)| (*e, c / &divisor)).collect();
        Self {
            terms,
            denominator: UBig::ONE,
        }
    }
    /// Returns true if one polynomial is a non-zero constant times the other.
    pub fn is_associate(&self, other: &Self) -> bool {
        self.primitive() == other.primitive()
    }
    /// Returns the quotient if `divisor` divides this polynomial over Q; `None` otherwise, and for
    /// a zero divisor.
    pub fn div_exact(&self, divisor: &Self) -> Option<Self> {
        if divisor.is_zero() {
            return None;
        }
        if let Some(c) = divisor.as_constant() {
            return Some(self.scale(&(RBig::ONE / c)));
        }
        if self.is_zero() {
            return Some(Self::zero());
        }
        // Primitive parts divide over Z if the polynomials divide over Q (lemma of Gauss).
        let (f, g) = (self.primitive(), divisor.primitive());
        let quotient = f.integer_quotient(&g)?;
        Some(quotient.scale(
            &(self.leading_coefficient()
                / divisor.leading_coefficient()
                / quotient.leading_coefficient()),
        ))
    }
    /// Returns the quotient of two polynomials with integer coefficients, if it is one, by long
    /// division in the order of the terms.
    fn integer_quotient(&self, divisor: &Self) -> Option<Self> {
        let (degrees, divisor_degrees) = (self.degrees(), divisor.degrees());
        let mut rest = Accumulator::new(&degrees, self.terms.len());
        for (e, c) in &self.terms {
            rest.add(*e, c.clone());
        }
        let (lead, lead_coefficient) = divisor.terms.first()?;
        let mut terms = Vec::new();
        while let Some((e, c)) = rest.pop_highest() {
            let mut q = [0; MAX_VARS];
            for v in 0..MAX_VARS {
                q[v] = e[v].checked_sub(lead[v])?;
                if usize::from(q[v]) + divisor_degrees[v] > degrees[v] {
                    return None;
                }
            }
            let (ratio, remainder) = dashu_base::DivRem::div_rem(&c, lead_coefficient);
            if !remainder.is_zero() {
                return None;
            }
            for (e, c) in &divisor.terms[1..] {
                rest.add(std::array::from_fn(|v| q[v] + e[v]), -(&ratio * c));
            }
            terms.push((q, ratio));
        }
        Some(Self {
            terms,
            denominator: UBig::ONE,
        })
    }
    /// Returns true if `divisor` divides this polynomial over Q.
    pub fn is_multiple_of(&self, divisor: &Self) -> bool {
        self.div_exact(divisor).is_some()
    }

    /// Returns the terms with coefficients rounded to nearest, ties to even.
    pub fn to_f64(&self) -> Vec<(Exponents, f64)> {
        let round = |c: &IBig| {
            RBig::from_parts(c.clone(), self.denominator.clone())
                .to_f64()
                .value()
        };
        self.terms.iter().map(|(e, c)| (*e, round(c))).collect()
    }
    /// Returns the primitive univariate polynomial of which this is a multiple, if no variable but
    /// `var` occurs.
    pub fn to_upoly(&self, var: usize) -> Option<UPoly> {
        let mut coefficients = vec![IBig::ZERO; self.degree(var) + 1];
        for (e, c) in &self.terms {
            if sum(e) != usize::from(e[var]) {
                return None;
            }
            coefficients[usize::from(e[var])] = c.clone();
        }
        Some(UPoly::new(coefficients).primitive())
    }
    /// Returns the polynomial of a univariate one in a variable.
    pub fn from_upoly(p: &UPoly, var: usize) -> Self {
        let terms = p.coefficients().iter().enumerate().map(|(i, c)| {
            let mut e = [0; MAX_VARS];
            e[var] = u16::try_from(i).expect("a degree below 65536");
            (e, c.clone())
        });
        Self::from_integers(terms, UBig::ONE)
    }
    /// Returns the indices of the variables that occur, ascending.
    pub fn variables(&self) -> Vec<usize> {
        (0..MAX_VARS).filter(|&v| self.degree(v) > 0).collect()
    }

    /// Returns the sum with ± another polynomial, over the least common denominator.
    fn add_scaled(&self, other: &Self, sign: i8) -> Self {
        let denominator = lcm(&self.denominator, &other.denominator);
        let one = ScaledTerms {
            terms: &self.terms,
            by: IBig::from(&denominator / &self.denominator),
        };
        let two = ScaledTerms {
            terms: &other.terms,
            by: IBig::from(&denominator / &other.denominator) * sign,
        };
        Self::normalised(one.plus(&two), denominator)
    }

    /// Returns the product, term by term.
    ///
    /// # Panics
    /// If an exponent exceeds 65535.
    fn product(&self, other: &Self) -> Self {
        let degrees: [usize; MAX_VARS] = std::array::from_fn(|v| self.degree(v) + other.degree(v));
        assert!(
            degrees.iter().all(|&d| d <= usize::from(u16::MAX)),
            "an exponent exceeds 65535"
        );
        let mut sum = Accumulator::new(&degrees, self.terms.len() * other.terms.len());
        for (e, c) in &self.terms {
            for (f, d) in &other.terms {
                sum.add(std::array::from_fn(|v| e[v] + f[v]), c * d);
            }
        }
        Self::normalised(sum.into_terms(), &self.denominator * &other.denominator)
    }
}

/// Returns the total degree of a term.
fn sum(e: &Exponents) -> usize {
    e.iter().map(|&n| usize::from(n)).sum()
}

/// Returns the least common multiple; denominators are often equal, or 1.
fn lcm(a: &UBig, b: &UBig) -> UBig {
    if a == b || b.is_one() {
        a.clone()
    } else if a.is_one() {
        b.clone()
    } else {
        a / a.gcd(b) * b
    }
}

/// Returns the products n^i d^(degree − i) for i = 0 … degree, where r = n/d.
pub(crate) fn fraction_powers(r: &RBig, degree: usize) -> Vec<IBig> {
    let mut table = vec![IBig::ONE; degree + 1];
    for i in 1..=degree {
        table[i] = &table[i - 1] * r.numerator();
    }
    if !r.denominator().is_one() {
        let mut d = UBig::ONE;
        for i in (0..degree).rev() {
            d *= r.denominator();
            table[i] *= &d;
        }
    }
    table
}

/// Terms, highest first, each of whose coefficients is to be multiplied by an integer.
struct ScaledTerms<'a> {
    terms: &'a [(Exponents, IBig)],
    by: IBig,
}

impl ScaledTerms<'_> {
    /// Returns the coefficient of the term at an index.
    #[inline]
    fn coefficient(&self, place: usize) -> IBig {
        let c = &self.terms[place].1;
        if self.by.is_one() {
            c.clone()
        } else {
            c * &self.by
        }
    }
    /// Returns the terms of the sum, highest first, by merging.
    fn plus(&self, other: &Self) -> Vec<(Exponents, IBig)> {
        let mut sum = Vec::with_capacity(self.terms.len() + other.terms.len());
        let (mut i, mut j) = (0, 0);
        while i < self.terms.len() || j < other.terms.len() {
            let order = match (self.terms.get(i), other.terms.get(j)) {
                (Some((e, _)), Some((f, _))) => f.cmp(e),
                (Some(_), None) => Ordering::Less,
                _ => Ordering::Greater,
            };
            let (e, c) = match order {
                Ordering::Less => (self.terms[i].0, self.coefficient(i)),
                Ordering::Greater => (other.terms[j].0, other.coefficient(j)),
                Ordering::Equal => {
                    let c = self.coefficient(i) + other.coefficient(j);
                    (self.terms[i].0, c)
                }
            };
            i += usize::from(order.is_le());
            j += usize::from(order.is_ge());
            if !c.is_zero() {
                sum.push((e, c));
            }
        }
        sum
    }
}

/// Sum of terms: an array over the box of exponents where that is not much larger than the number
/// of terms, a sorted map otherwise.
enum Accumulator {
    Dense {
        strides: [usize; MAX_VARS],
        cells: Vec<IBig>,
    },
    Sparse(BTreeMap<Exponents, IBig>),
}

/// Maximum number of cells of the array per term that will be added: with more, most cells are
/// empty, and the map is faster.
const MAX_CELLS_PER_TERM: usize = 8;

impl Accumulator {
    /// Creates a sum without terms, for a number of additions of terms up to some degrees.
    fn new(degrees: &[usize; MAX_VARS], additions: usize) -> Self {
        let mut strides = [0; MAX_VARS];
        let mut size = 1usize;
        for v in (0..MAX_VARS).rev() {
            strides[v] = size;
            size = size.saturating_mul(degrees[v] + 1);
        }
        if size
            <= additions
                .saturating_mul(MAX_CELLS_PER_TERM)
                .saturating_add(16)
        {
            Self::Dense {
                strides,
                cells: vec![IBig::ZERO; size],
            }
        } else {
            Self::Sparse(BTreeMap::new())
        }
    }
    /// Adds a term.
    fn add(&mut self, e: Exponents, c: IBig) {
        match self {
            Self::Dense { strides, cells } => {
                cells[(0..MAX_VARS)
                    .map(|v| strides[v] * usize::from(e[v]))
                    .sum::<usize>()] += c
            }
            Self::Sparse(map) => *map.entry(e).or_insert(IBig::ZERO) += c,
        }
    }
    /// Returns the exponents of a cell of the array.
    fn exponents(strides: &[usize; MAX_VARS], mut index: usize) -> Exponents {
        strides.map(|stride| {
            let n = index / stride;
            index %= stride;
            n as u16
        })
    }
    /// Removes the highest term that is not zero; later additions must be below it.
    fn pop_highest(&mut self) -> Option<(Exponents, IBig)> {
        match self {
            Self::Dense { strides, cells } => loop {
                let c = cells.pop()?;
                if !c.is_zero() {
                    return Some((Self::exponents(strides, cells.len()), c));
                }
            },
            Self::Sparse(map) => loop {
                let (e, c) = map.pop_last()?;
                if !c.is_zero() {
                    return Some((e, c));
                }
            },
        }
    }
    /// Returns the terms that are not zero, highest first.
    fn into_terms(mut self) -> Vec<(Exponents, IBig)> {
        std::iter::from_fn(|| self.pop_highest()).collect()
    }
}

impl Neg for &Poly {
    type Output = Poly;
    fn neg(self) -> Poly {
        Poly {
            terms: self.terms.iter().map(|(e, c)| (*e, -c)).collect(),
            denominator: self.denominator.clone(),
        }
    }
}

impl Neg for Poly {
    type Output = Self;
    fn neg(self) -> Self {
        -&self
    }
}

macro_rules! binary {
    ($trait:ident, $method:ident, $with:expr) => {
        impl $trait<&Poly> for &Poly {
            type Output = Poly;
            fn $method(self, other: &Poly) -> Poly {
                $with(self, other)
            }
        }
        impl $trait<Poly> for &Poly {
            type Output = Poly;
            fn $method(self, other: Poly) -> Poly {
                $with(self, &other)
            }
        }
        impl $trait<&Self> for Poly {
            type Output = Self;
            fn $method(self, other: &Self) -> Self {
                $with(&self, other)
            }
        }
        impl $trait for Poly {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                $with(&self, &other)
            }
        }
    };
}
binary!(Add, add, |a: &Poly, b: &Poly| a.add_scaled(b, 1));
binary!(Sub, sub, |a: &Poly, b: &Poly| a.add_scaled(b, -1));
binary!(Mul, mul, Poly::product);
