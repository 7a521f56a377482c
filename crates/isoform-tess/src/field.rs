//! Number fields Q(θ) = Q\[x\]/(p) with exact zero tests, and the real numbers in them.
//!
//! A field represents all conjugates of θ at once: every decision in it (orders, common divisors)
//! holds at each of them. A real root of p selects one; an [`Algebraic`] is an element at a root.
//! The modulus is monic with integer coefficients, so that reduction needs no division.

use crate::dense;
use dashu_base::{Gcd, Signed, UnsignedAbs};
use isoform_algebra::{IBig, Poly, RBig, RealRoot, UBig, UPoly, decide, real_roots};
use std::cmp::Ordering;
use std::fmt;
use std::sync::Arc;

/// The field Q(θ) for a root θ of a monic irreducible polynomial with integer coefficients.
///
/// ```
/// use isoform_algebra::UPoly;
/// use isoform_tess::{Algebraic, NumberField};
///
/// // The golden ratio x: x² = x + 1, and 1/x = x − 1.
/// let (field, x) = NumberField::new(&UPoly::from_i64(&[-1, -1, 1]));
/// let one = field.div(&x, &x);
/// assert_eq!(field.mul(&x, &x), x.add(&one));
/// assert_eq!(field.inverse(&x), x.sub(&one));
/// // At the larger of the two real roots.
/// let golden = Algebraic::new(&field, 1, x);
/// assert_eq!(golden.to_f64(), 0.5 * (1.0 + 5f64.sqrt()));
/// ```
#[derive(Debug)]
pub struct NumberField {
    modulus: UPoly,
    roots: Vec<RealRoot>,
}

/// An element of a [`NumberField`]: a polynomial in θ of lower degree than the modulus.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Element {
    /// Coefficients of powers of θ, lowest first, the last one not zero.
    numerator: Vec<IBig>,
    /// Positive denominator, coprime to the numerator. Zero is `Default` and has the denominator 0,
    /// which is never read.
    denominator: UBig,
}

impl Element {
    /// Returns the sum of coefficients times powers of θ over a denominator; there are at most as
    /// many coefficients as the degree of the field.
    pub(crate) fn normalised(mut numerator: Vec<IBig>, mut denominator: UBig) -> Self {
        while numerator.last().is_some_and(IBig::is_zero) {
            numerator.pop();
        }
        if numerator.is_empty() {
            return Self::default();
        }
        if !denominator.is_one() {
            let mut common = denominator.clone();
            for c in &numerator {
                if common.is_one() {
                    break;
                }
                common = common.gcd(c.clone().unsigned_abs());
            }
            if !common.is_one() {
                for c in &mut numerator {
                    *c /= &common;
                }
                denominator /= common;
            }
        }
        Self {
            numerator,
            denominator,
        }
    }
    /// Returns 0.
    pub fn zero() -> Self {
        Self::default()
    }
    /// Returns a rational number as an element.
    pub fn rational(r: &RBig) -> Self {
        Self::normalised(vec![r.numerator().clone()], r.denominator().clone())
    }
    /// Returns true if this is 0.
    pub fn is_zero(&self) -> bool {
        self.numerator.is_empty()
    }
    /// Returns this element as a rational number, if it is one; exact, since 1, θ, θ², … are
    /// linearly independent over Q.
    pub fn as_rational(&self) -> Option<RBig> {
        match &self.numerator[..] {
            [] => Some(RBig::ZERO),
            [c] => Some(RBig::from_parts(c.clone(), self.denominator.clone())),
            _ => None,
        }
    }
    /// Returns the coefficient of a power of θ.
    pub fn coefficient(&self, power: usize) -> RBig {
        self.numerator.get(power).map_or(RBig::ZERO, |c| {
            RBig::from_parts(c.clone(), self.denominator.clone())
        })
    }
    /// Returns the sum.
    pub fn add(&self, other: &Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return if self.is_zero() {
                other.clone()
            } else {
                self.clone()
            };
        }
        let common = (&self.denominator).gcd(&other.denominator);
        let (left, right) = (
            IBig::from(&other.denominator / &common),
            IBig::from(&self.denominator / &common),
        );
        let zero = IBig::ZERO;
        let sum = (0..self.numerator.len().max(other.numerator.len()))
            .map(|i| {
                self.numerator.get(i).unwrap_or(&zero) * &left
                    + other.numerator.get(i).unwrap_or(&zero) * &right
            })
            .collect();
        Self::normalised(
            sum,
            &self.denominator * UBig::try_from(left).expect("a positive factor"),
        )
    }
    /// Returns the negative.
    pub fn negated(&self) -> Self {
        Self {
            numerator: self.numerator.iter().map(|c| -c).collect(),
            denominator: self.denominator.clone(),
        }
    }
    /// Returns the difference.
    pub fn sub(&self, other: &Self) -> Self {
        self.add(&other.negated())
    }
    /// Returns the product with a rational number.
    pub fn scaled(&self, r: &RBig) -> Self {
        if self.is_zero() || *r == RBig::ZERO {
            return Self::zero();
        }
        let numerator = self.numerator.iter().map(|c| c * r.numerator()).collect();
        Self::normalised(numerator, &self.denominator * r.denominator())
    }
    /// Returns the integer coefficients of powers of θ, lowest first, and their denominator.
    pub(crate) fn parts(&self) -> (&[IBig], UBig) {
        (
            &self.numerator,
            if self.is_zero() {
                UBig::ONE
            } else {
                self.denominator.clone()
            },
        )
    }
}

impl NumberField {
    /// Returns the field Q.
    pub fn rationals() -> Arc<Self> {
        Self::new(&UPoly::from_i64(&[0, 1])).0
    }
    /// Returns the field of a root x of an irreducible polynomial, with x as an element; θ is x
    /// times the leading coefficient.
    ///
    /// # Panics
    /// If the polynomial is constant. Irreducibility is not checked.
    pub fn new(p: &UPoly) -> (Arc<Self>, Element) {
        let p = p.primitive();
        let (d, lead) = (p.degree(), p.leading());
        assert!(d > 0, "a polynomial that is not constant");
        // lead^(d−1)·p(x/lead)
        let scaled = p.coefficients().iter().enumerate().map(|(i, c)| {
            if i == d {
                IBig::ONE
            } else {
                c * lead.pow(d - 1 - i)
            }
        });
        let modulus = UPoly::new(scaled.collect());
        let field = Self {
            roots: real_roots(&modulus),
            modulus,
        };
        let x = field
            .reduce(vec![IBig::ZERO, IBig::ONE], UBig::ONE)
            .scaled(&RBig::from_parts_signed(IBig::ONE, lead));
        (Arc::new(field), x)
    }
    /// Returns the degree over Q.
    pub fn degree(&self) -> usize {
        self.modulus.degree()
    }
    /// Returns the monic minimal polynomial of θ.
    pub fn modulus(&self) -> &UPoly {
        &self.modulus
    }
    /// Returns the real roots of the modulus in ascending order.
    pub fn real_roots(&self) -> &[RealRoot] {
        &self.roots
    }
    /// Returns θ.
    pub fn generator(&self) -> Element {
        self.reduce(vec![IBig::ZERO, IBig::ONE], UBig::ONE)
    }

    fn reduce(&self, mut c: Vec<IBig>, denominator: UBig) -> Element {
        let d = self.degree();
        while c.len() > d {
            let top = c.pop().expect("a coefficient above the degree");
            let offset = c.len() - d;
            if !top.is_zero() {
                for (i, m) in self.modulus.coefficients()[..d].iter().enumerate() {
                    c[offset + i] -= m * &top;
                }
            }
        }
        Element::normalised(c, denominator)
    }
    /// Returns the product.
    pub fn mul(&self, a: &Element, b: &Element) -> Element {
        if a.is_zero() || b.is_zero() {
            return Element::zero();
        }
        let mut c = vec![IBig::ZERO; a.numerator.len() + b.numerator.len() - 1];
        for (i, x) in a.numerator.iter().enumerate() {
            for (j, y) in b.numerator.iter().enumerate() {
                c[i + j] += x * y;
            }
        }
        self.reduce(c, &a.denominator * &b.denominator)
    }
    /// Evaluates a polynomial over Q in one variable.
    pub fn eval(&self, p: &Poly, var: usize, at: &Element) -> Element {
        let mut value = Element::zero();
        for c in p.coefficients_in(var).iter().rev() {
            value = self
                .mul(&value, at)
                .add(&Element::rational(&c.as_constant().expect("one variable")));
        }
        value
    }
    /// Maps an element of this field to another field, given the image of θ there.
    pub fn embed(&self, a: &Element, target: &Self, theta: &Element) -> Element {
        let mut value = Element::zero();
        for i in (0..a.numerator.len()).rev() {
            value = target
                .mul(&value, theta)
                .add(&Element::rational(&a.coefficient(i)));
        }
        value
    }
    /// Returns 1/a.
    ///
    /// # Panics
    /// If a is 0.
    pub fn inverse(&self, a: &Element) -> Element {
        assert!(!a.is_zero(), "division by zero");
        if let Some(r) = a.as_rational() {
            return Element::rational(&(RBig::ONE / r));
        }
        // The linear system Σ yⱼ θʲ·a = 1 over Z, for the numerator of a.
        let mut unit = vec![IBig::ZERO; self.degree()];
        unit[0] = IBig::from(a.denominator.clone());
        let (mut y, determinant) = dense::solve(self.multiplication(&a.numerator), unit)
            .expect("an element that is not zero is invertible");
        if determinant.is_negative() {
            for c in &mut y {
                *c = -std::mem::take(c);
            }
        }
        Element::normalised(y, determinant.unsigned_abs())
    }
    /// Returns the matrix of the multiplication by an integral element, given by its numerator:
    /// column j has the coefficients of θʲ times the element.
    fn multiplication(&self, numerator: &[IBig]) -> Vec<Vec<IBig>> {
        let d = self.degree();
        let theta = self.generator();
        let mut column = Element {
            numerator: numerator.to_vec(),
            denominator: UBig::ONE,
        };
        let mut rows = vec![Vec::with_capacity(d); d];
        for _ in 0..d {
            for (i, row) in rows.iter_mut().enumerate() {
                row.push(column.numerator.get(i).cloned().unwrap_or(IBig::ZERO));
            }
            // Products of integral elements are integral: the denominator stays 1.
            column = self.mul(&column, &theta);
        }
        rows
    }
    /// Returns the linearly independent powers 1, a, a², …, and the coefficients of the next power
    /// in terms of them.
    pub(crate) fn powers(&self, a: &Element) -> (Vec<Element>, Vec<RBig>) {
        let mut powers = vec![Element::rational(&RBig::ONE)];
        loop {
            let next = self.mul(powers.last().expect("at least 1"), a);
            if let Some(relation) = self.combination(&powers, &next) {
                return (powers, relation);
            }
            powers.push(next);
        }
    }
    /// Returns the minimal polynomial of an element over Q, up to a factor.
    pub(crate) fn minimal_polynomial(&self, a: &Element) -> UPoly {
        monic(&self.powers(a).1)
    }
    /// Returns the rational coefficients of `target` as a combination of linearly independent
    /// elements; `None` if it is not in their span.
    pub(crate) fn combination(
        &self,
        independent: &[Element],
        target: &Element,
    ) -> Option<Vec<RBig>> {
        let degree = self.degree();
        let n = independent.len();
        let columns = independent.iter().chain([target]);
        let columns: Vec<Vec<RBig>> = columns
            .map(|e| (0..degree).map(|i| e.coefficient(i)).collect())
            .collect();
        let mut rows: Vec<Vec<RBig>> = (0..degree)
            .map(|i| columns.iter().map(|c| c[i].clone()).collect())
            .collect();
        for k in 0..n {
            let pivot = (k..degree).find(|&i| rows[i][k] != RBig::ZERO)?;
            rows.swap(k, pivot);
            eliminate(&mut rows, k);
        }
        let is_in_span = rows[n..].iter().all(|row| row[n] == RBig::ZERO);
        is_in_span.then(|| rows[..n].iter().map(|row| row[n].clone()).collect())
    }

    /// Returns a/b.
    ///
    /// # Panics
    /// If b is 0.
    pub fn div(&self, a: &Element, b: &Element) -> Element {
        self.mul(a, &self.inverse(b))
    }
}

/// Returns the polynomial xⁿ − cₙ₋₁xⁿ⁻¹ − … − c₀, multiplied by the common denominator of the c.
pub(crate) fn monic(c: &[RBig]) -> UPoly {
    let terms = c
        .iter()
        .enumerate()
        .map(|(i, c)| ([i as u16, 0, 0, 0], -c.clone()));
    let lead = [([c.len() as u16, 0, 0, 0], RBig::ONE)];
    Poly::from_terms(terms.chain(lead))
        .to_upoly(0)
        .expect("one variable")
}

/// A real algebraic number: an element of a number field at a real root of the field's modulus.
#[derive(Clone)]
pub struct Algebraic {
    field: Arc<NumberField>,
    root: usize,
    element: Element,
}

impl Algebraic {
    /// Returns an element at the real root with an index.
    ///
    /// # Panics
    /// If the field has no such root.
    pub fn new(field: &Arc<NumberField>, root: usize, element: Element) -> Self {
        assert!(root < field.roots.len(), "a real root of the modulus");
        Self {
            field: Arc::clone(field),
            root,
            element,
        }
    }
    /// Returns a rational number.
    pub fn rational(r: &RBig) -> Self {
        Self::new(&NumberField::rationals(), 0, Element::rational(r))
    }
    /// Returns the field.
    pub fn field(&self) -> &Arc<NumberField> {
        &self.field
    }
    /// Returns the index of the real root of the field's modulus.
    pub fn root(&self) -> usize {
        self.root
    }
    /// Returns the element of the field.
    pub fn element(&self) -> &Element {
        &self.element
    }
    /// Returns the rational value, if this is a rational number.
    pub fn as_rational(&self) -> Option<RBig> {
        self.element.as_rational()
    }
    /// Returns true if this is 0; exact.
    pub fn is_zero(&self) -> bool {
        self.element.is_zero()
    }
    /// Returns the sign; exact.
    pub fn sign(&self) -> Ordering {
        match self.element.numerator.len() {
            0 => Ordering::Equal,
            _ => self.field.roots[self.root].sign_of(&UPoly::new(self.element.numerator.clone())),
        }
    }

    /// Returns rational bounds at a distance of at most 2^−bits; equal for rational numbers.
    pub fn interval(&self, bits: usize) -> (RBig, RBig) {
        if let Some(r) = self.as_rational() {
            return (r.clone(), r);
        }
        let value = UPoly::new(self.element.numerator.clone());
        let slope = value.derivative();
        let sizes = slope.coefficients().iter();
        let sizes = sizes.map(|c| IBig::from(c.unsigned_abs()));
        let absolute = UPoly::new(sizes.collect());
        let denominator = RBig::from(IBig::from(self.element.denominator.clone()));
        let allowed = RBig::from_parts(IBig::ONE, UBig::ONE << bits);
        let mut root = self.field.roots[self.root].clone();
        decide(
            bits + 8,
            |precision| precision + bits.max(32),
            |precision| {
                root.refine(precision);
                let (lo, hi) = root.interval();
                // |g(x) − g(m)| ≤ (hi − lo)/2·Σ i|gᵢ| R^(i−1) around the middle m, R the larger
                // absolute end.
                let middle = (&lo + &hi) / RBig::from(2);
                let far = lo.clone().max(-&lo).max(hi.clone()).max(-&hi);
                let reach = absolute.eval(&far) * (hi - lo) / (RBig::from(2) * &denominator);
                let is_near = &reach + &reach <= allowed;
                is_near.then(|| {
                    let centre = value.eval(&middle) / &denominator;
                    (&centre - &reach, centre + reach)
                })
            },
        )
    }
    /// Returns the nearest `f64`, ties to even.
    pub fn to_f64(&self) -> f64 {
        /// Number of bits by which the interval is refined from one attempt to the next.
        const INTERVAL_REFINEMENT_BITS: usize = 64;
        if let Some(r) = self.as_rational() {
            return r.to_f64().value();
        }
        decide(
            INTERVAL_REFINEMENT_BITS,
            |bits| bits + INTERVAL_REFINEMENT_BITS,
            |bits| {
                // An irrational number is never a tie.
                let (lo, hi) = self.interval(bits);
                let (lo, hi) = (lo.to_f64().value(), hi.to_f64().value());
                (lo == hi).then_some(lo)
            },
        )
    }
}

/// Returns the exact value of a double.
///
/// # Panics
/// If the double is not finite. Non-finite numbers have to be handled where they arise: taken for
/// 0, they would stand for another place, or drop a curve.
pub(crate) fn exact(x: f64) -> RBig {
    RBig::try_from(x).expect("a finite number")
}

/// Returns true if a form vanishes at a point whose coordinates belong to one root of one field, or
/// are rational.
pub(crate) fn vanishes(form: &Poly, at: &[Algebraic; 3]) -> bool {
    let field = at
        .iter()
        .map(Algebraic::field)
        .max_by_key(|f| f.degree())
        .expect("three coordinates");
    let power = |k: usize, e: u16| {
        (0..e).fold(Element::rational(&RBig::ONE), |p, _| {
            field.mul(&p, at[k].element())
        })
    };
    let term = |e: &isoform_algebra::Exponents| {
        (0..3).fold(Element::rational(&RBig::ONE), |p, k| {
            field.mul(&p, &power(k, e[k]))
        })
    };
    form.terms()
        .iter()
        .fold(Element::zero(), |sum, (e, c)| {
            sum.add(&term(e).scaled(&RBig::from(c.clone())))
        })
        .is_zero()
}

impl fmt::Debug for Algebraic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.as_rational() {
            Some(r) => write!(f, "{r}"),
            None => write!(f, "{}", self.to_f64()),
        }
    }
}

impl fmt::Display for Algebraic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

/// Eliminates column k by Gauss–Jordan with row k, whose entry there is not zero.
fn eliminate(rows: &mut [Vec<RBig>], k: usize) {
    let inverse = RBig::ONE / &rows[k][k];
    let top: Vec<RBig> = rows[k].iter().map(|c| c * &inverse).collect();
    for (i, row) in rows.iter_mut().enumerate() {
        if i != k && row[k] != RBig::ZERO {
            let factor = row[k].clone();
            for j in k..top.len() {
                row[j] -= &factor * &top[j];
            }
        }
    }
    rows[k] = top;
}
