//! Greatest common divisors and squarefree parts of polynomials over Q.
//!
//! Brown's modular algorithm (W. S. Brown, J. ACM 18, 1971, pages 478–504): modulo primes, then at
//! points in all variables but one, where Euclid's algorithm decides; back by interpolation and
//! Chinese remainders. A candidate counts only if it divides both polynomials, and its degree
//! cannot be too low: the result is proven. Squarefree decomposition by D. Y. Y. Yun (SYMSAC 1976).

use crate::modpoly;
use crate::modular::{Crt, Fp, primes};
use crate::poly::{Exponents, MAX_VARS, Poly};
use crate::upoly::UPoly;
use dashu_base::Gcd;
use dashu_int::{IBig, UBig};
use std::collections::{BTreeMap, BTreeSet};

/// Terms modulo a prime, in descending lexicographic order, all non-zero.
type Terms = Vec<(Exponents, u64)>;

impl Poly {
    /// Returns the greatest common divisor over Q, primitive; 0 only of two zeros.
    ///
    /// ```
    /// use isoform_algebra::Poly;
    /// let p = |text| Poly::parse(text, &["x", "y"]);
    /// assert_eq!(p("x^2 - y^2")?.gcd(&p("2*x^2 + 4*x*y + 2*y^2")?), p("x + y")?);
    /// # Ok::<(), isoform_algebra::ParseError>(())
    /// ```
    pub fn gcd(&self, other: &Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return if self.is_zero() {
                other.primitive()
            } else {
                self.primitive()
            };
        }
        let (a, b) = (self.primitive(), other.primitive());
        let variables: Vec<usize> = (0..MAX_VARS)
            .filter(|&v| a.degree(v) + b.degree(v) > 0)
            .collect();
        if variables.iter().any(|&v| a.degree(v).min(b.degree(v)) > 0) {
            if variables.len() > 1 && a.is_homogeneous() && b.is_homogeneous() {
                return gcd_of_forms(&a, &b, variables[variables.len() - 1]);
            }
            gcd_primitive(&a, &b, &variables)
        } else {
            Self::one()
        }
    }

    /// Returns the greatest common divisor of the coefficients of this polynomial in the powers of
    /// a variable, primitive.
    pub fn content_in(&self, var: usize) -> Self {
        let mut common = Self::zero();
        let mut coefficients = self.coefficients_in(var);
        // The smallest coefficients come first: the content is often 1, which is seen there.
        coefficients.sort_by_key(|c| c.terms().len());
        for c in &coefficients {
            common = common.gcd(c);
            if common.is_constant() && !common.is_zero() {
                break;
            }
        }
        common
    }

    /// Returns the primitive squarefree polynomials, coprime in pairs, not constant, with different
    /// multiplicities in ascending order: this polynomial is the product of their powers up to a
    /// constant. Empty for constants.
    pub fn squarefree(&self) -> Vec<(Self, usize)> {
        let mut parts: BTreeMap<usize, Self> = BTreeMap::new();
        squarefree_into(&self.primitive(), &mut parts);
        parts.into_iter().map(|(n, p)| (p.primitive(), n)).collect()
    }

    /// Returns the product of the distinct irreducible factors, primitive; 1 for constants, 0 for
    /// 0.
    pub fn squarefree_part(&self) -> Self {
        if self.is_zero() {
            return Self::zero();
        }
        self.squarefree()
            .into_iter()
            .fold(Self::one(), |product, (p, _)| product * p)
            .primitive()
    }
}

fn squarefree_into(p: &Poly, parts: &mut BTreeMap<usize, Poly>) {
    let Some(&var) = p.variables().first() else {
        return;
    };
    let content = p.content_in(var);
    squarefree_into(&content, parts);
    let p = quotient(p, &content);
    let derivative = p.derivative(var);
    let common = p.gcd(&derivative);
    let mut w = quotient(&p, &common);
    let mut z = quotient(&derivative, &common) - w.derivative(var);
    let mut multiplicity = 1;
    while !w.is_constant() {
        let factor = w.gcd(&z);
        if !factor.is_constant() {
            parts
                .entry(multiplicity)
                .and_modify(|q| *q = &*q * &factor)
                .or_insert_with(|| factor.clone());
        }
        w = quotient(&w, &factor);
        z = quotient(&z, &factor) - w.derivative(var);
        multiplicity += 1;
    }
}

fn quotient(a: &Poly, b: &Poly) -> Poly {
    a.div_exact(b).expect("a divisor found before")
}

/// Returns the greatest common divisor of forms: that of the polynomials at the value 1 of a
/// variable, made homogeneous, times their common power of the variable.
fn gcd_of_forms(a: &Poly, b: &Poly, var: usize) -> Poly {
    let power = |p: &Poly| p.terms().iter().map(|(e, _)| e[var]).min().unwrap_or(0);
    let flat = a.dehomogenise(var).gcd(&b.dehomogenise(var));
    let common = u32::from(power(a).min(power(b)));
    flat.homogenise(var, flat.total_degree()) * Poly::var(var).pow(common)
}

/// Returns the greatest common divisor of two polynomials that are primitive over Z and not
/// constant.
fn gcd_primitive(a: &Poly, b: &Poly, variables: &[usize]) -> Poly {
    let (lead_a, lead_b) = (&a.terms()[0].1, &b.terms()[0].1);
    let lead = IBig::from(lead_a.gcd(lead_b));
    let mut found: Option<Images> = None;
    for f in primes() {
        if f.of_ibig(lead_a) == 0 || f.of_ibig(lead_b) == 0 {
            continue;
        }
        let [a_here, b_here] = [a, b].map(|p| nonzero_residues(&f, p));
        let mut image = gcd_modular(&f, &a_here, &b_here, variables);
        let highest = image[0].0;
        if highest == [0; MAX_VARS] {
            return Poly::one();
        }
        // A prime is unlucky if the leading term of its image is too high.
        if found.as_ref().is_some_and(|i| highest > i.exponents[0]) {
            continue;
        }
        let scale = f.of_ibig(&lead);
        image.iter_mut().for_each(|(_, c)| *c = f.mul(*c, scale));
        let lucky = found.take().filter(|i| highest == i.exponents[0]);
        let images = found.insert(lucky.unwrap_or_else(|| Images::new(&image)));
        if images.push(&f, &image) {
            let candidate = images.candidate();
            if a.is_multiple_of(&candidate) && b.is_multiple_of(&candidate) {
                return candidate;
            }
        }
    }
    unreachable!("there are enough primes below 2^62")
}

fn nonzero_residues(f: &Fp, p: &Poly) -> Terms {
    p.terms()
        .iter()
        .map(|(e, c)| (*e, f.of_ibig(c)))
        .filter(|(_, c)| *c != 0)
        .collect()
}

/// Polynomial over Z, by its images modulo primes.
struct Images {
    /// Exponents of all terms found so far, descending.
    exponents: Vec<Exponents>,
    crt: Crt,
}

impl Images {
    /// Creates the polynomial without an image, but with the exponents of the first one.
    fn new(image: &Terms) -> Self {
        Self {
            exponents: image.iter().map(|t| t.0).collect(),
            crt: Crt::new(image.len()),
        }
    }

    /// Adds an image. Returns true if the coefficients may be complete: at the first prime, and if
    /// a prime changes none.
    fn push(&mut self, f: &Fp, image: &Terms) -> bool {
        let exponents = image.iter().map(|t| &t.0);
        if !exponents.eq(&self.exponents) {
            self.begin_again(image);
        }
        let find = |e: &Exponents| {
            image
                .binary_search_by(|t| e.cmp(&t.0))
                .map_or(0, |i| image[i].1)
        };
        let first = self.crt.modulus().is_one();
        let coefficients: Vec<u64> = self.exponents.iter().map(find).collect();
        let changed = self.crt.push(f, &coefficients);
        !changed || first
    }

    /// Restricts the images to the terms of one in which some vanish: other terms are removed, and
    /// terms that only this image lacks have the coefficient 0.
    fn begin_again(&mut self, image: &Terms) {
        let known = self.exponents.iter().copied();
        let all: BTreeSet<Exponents> = known.chain(image.iter().map(|t| t.0)).collect();
        self.exponents = all.into_iter().rev().collect();
        self.crt = Crt::new(self.exponents.len());
    }

    /// Returns the primitive polynomial with the least coefficients that has these images.
    fn candidate(&self) -> Poly {
        let terms = self.exponents.iter().copied().zip(self.crt.symmetric());
        Poly::from_integers(terms, UBig::ONE).primitive()
    }
}

/// Polynomial in the variables before `var` with dense coefficients in `var`, modulo a prime.
type InLast = BTreeMap<Exponents, Vec<u64>>;

fn in_last(terms: &[(Exponents, u64)], var: usize) -> InLast {
    let mut grouped = InLast::new();
    for (e, c) in terms {
        let mut rest = *e;
        rest[var] = 0;
        let coefficient = grouped.entry(rest).or_default();
        let n = usize::from(e[var]);
        if coefficient.len() <= n {
            coefficient.resize(n + 1, 0);
        }
        coefficient[n] = *c;
    }
    grouped
}

/// Divides a polynomial with coefficients in the last variable by its content, and returns the
/// content, monic.
fn take_content(f: &Fp, p: &mut InLast) -> Vec<u64> {
    let mut content: Vec<u64> = Vec::new();
    for c in p.values() {
        content = modpoly::gcd(f, &content, c);
        if content.len() == 1 {
            return content;
        }
    }
    for c in p.values_mut() {
        *c = modpoly::div_rem(f, c, &content);
    }
    content
}

/// Returns the leading coefficient of the highest term in the other variables.
fn leading(p: &InLast) -> &Vec<u64> {
    let (_, lead) = p.last_key_value().expect("a polynomial that is not zero");
    lead
}

/// Returns the degree in the last variable, plus 1.
fn length(p: &InLast) -> usize {
    p.values().map(Vec::len).max().unwrap_or(0)
}

/// Returns the values at a point of the last variable.
fn at(f: &Fp, p: &InLast, point: u64) -> Terms {
    let values = p
        .iter()
        .rev()
        .map(|(e, c)| (*e, modpoly::eval(f, c, point)));
    values.filter(|(_, c)| *c != 0).collect()
}

/// Returns the exponents with a power of one more variable.
fn with_power(e: &Exponents, var: usize, n: usize) -> Exponents {
    let mut e = *e;
    e[var] = n as u16;
    e
}

/// Returns the terms of a polynomial, descending.
fn terms_of(p: &InLast, var: usize) -> Terms {
    let mut terms: Terms = Vec::new();
    for (e, c) in p.iter().rev() {
        let powers = c.iter().enumerate().rev().filter(|(_, c)| **c != 0);
        terms.extend(powers.map(|(n, &c)| (with_power(e, var, n), c)));
    }
    terms
}

/// Returns the terms divided by the leading coefficient.
fn monic(f: &Fp, mut terms: Terms) -> Terms {
    let inverse = terms.first().map_or(0, |t| f.inv(t.1));
    terms.iter_mut().for_each(|(_, c)| *c = f.mul(*c, inverse));
    terms
}

/// Returns the greatest common divisor modulo a prime, its lexicographic leading coefficient 1. Not
/// proven: evaluation points may be unlucky, which the division by the caller would show.
fn gcd_modular(
    f: &Fp,
    a: &[(Exponents, u64)],
    b: &[(Exponents, u64)],
    variables: &[usize],
) -> Terms {
    match *variables {
        [] => vec![([0; MAX_VARS], f.one())],
        [var] => {
            let dense =
                |p: &[(Exponents, u64)]| in_last(p, var).into_values().next().unwrap_or_default();
            let g = modpoly::gcd(f, &dense(a), &dense(b));
            terms_of(&InLast::from([([0; MAX_VARS], g)]), var)
        }
        [ref rest @ .., var] => gcd_by_points(f, [in_last(a, var), in_last(b, var)], rest, var),
    }
}

/// First point at which polynomials are evaluated; further ones follow by x ↦ x² + x, without a
/// pattern: simple polynomials often agree at small integers.
const FIRST_POINT: u64 = 0x9e37_79b9_7f4a_7c15;

/// Returns the greatest common divisor modulo a prime from those at points of the last variable.
fn gcd_by_points(f: &Fp, mut pair: [InLast; 2], rest: &[usize], var: usize) -> Terms {
    let [content_a, content_b] = pair.each_mut().map(|p| take_content(f, p));
    let content = modpoly::gcd(f, &content_a, &content_b);
    let [a, b] = &pair;
    let lead = modpoly::gcd(f, leading(a), leading(b));
    let enough = length(a).min(length(b)) + lead.len();
    let mut point = f.of_u64(FIRST_POINT);
    let mut found: Option<Interpolated> = None;
    loop {
        point = f.mul(point, f.add(point, f.one()));
        let vanishes = |p: &[u64]| modpoly::eval(f, p, point) == 0;
        if vanishes(leading(a))
            || vanishes(leading(b))
            || found.as_ref().is_some_and(|i| vanishes(&i.nodes))
        {
            point = f.add(point, f.one());
            continue;
        }
        let image = gcd_modular(f, &at(f, a, point), &at(f, b, point), rest);
        let highest = image[0].0;
        if highest == [0; MAX_VARS] {
            let constant = InLast::from([([0; MAX_VARS], content)]);
            return monic(f, terms_of(&constant, var));
        }
        // A point is unlucky if the leading term of its image is too high.
        if found.as_ref().is_some_and(|i| highest > i.highest) {
            continue;
        }
        let lucky = found.take().filter(|i| highest == i.highest);
        let divisor = found.insert(lucky.unwrap_or_else(|| Interpolated::new(f, highest)));
        let changed = divisor.push(f, point, image, modpoly::eval(f, &lead, point));
        if !changed || divisor.nodes.len() > enough {
            return monic(f, terms_of(&divisor.with_content(f, &content), var));
        }
    }
}

/// Polynomial that is interpolated in its last variable v, by Newton's formula.
struct Interpolated {
    /// Leading exponents of all values.
    highest: Exponents,
    sum: InLast,
    /// ∏ (v − x) over the points x so far.
    nodes: Vec<u64>,
}

impl Interpolated {
    fn new(f: &Fp, highest: Exponents) -> Self {
        Self {
            highest,
            sum: InLast::new(),
            nodes: vec![f.one()],
        }
    }

    /// Adds the value `image` · `scale` at a point. Returns true if that changes the polynomial.
    fn push(&mut self, f: &Fp, point: u64, image: Terms, scale: u64) -> bool {
        let inverse = f.inv(modpoly::eval(f, &self.nodes, point));
        let mut image: BTreeMap<Exponents, u64> = image.into_iter().collect();
        for e in self.sum.keys() {
            image.entry(*e).or_insert(0);
        }
        let mut changed = false;
        for (e, value) in image {
            let coefficient = self.sum.entry(e).or_default();
            let missing = f.sub(f.mul(value, scale), modpoly::eval(f, coefficient, point));
            if missing != 0 {
                changed = true;
                let step = modpoly::scale(f, &self.nodes, f.mul(missing, inverse));
                *coefficient = modpoly::add(f, coefficient, &step);
            }
        }
        self.nodes = modpoly::mul(f, &self.nodes, &[f.neg(point), f.one()]);
        changed
    }

    /// Returns the polynomial with another content.
    fn with_content(&mut self, f: &Fp, content: &[u64]) -> InLast {
        let mut p = std::mem::take(&mut self.sum);
        p.retain(|_, c| !c.is_empty());
        take_content(f, &mut p);
        for c in p.values_mut() {
            *c = modpoly::mul(f, c, content);
        }
        p
    }
}

impl UPoly {
    /// Returns the greatest common divisor over Q, primitive; 0 only of two zeros.
    pub fn gcd(&self, other: &Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return if self.is_zero() {
                other.primitive()
            } else {
                self.primitive()
            };
        }
        let (a, b) = (self.primitive(), other.primitive());
        let (lead_a, lead_b) = (a.leading(), b.leading());
        let lead = IBig::from((&lead_a).gcd(&lead_b));
        let mut crt: Option<Crt> = None;
        let mut length = usize::MAX;
        for f in primes() {
            if f.of_ibig(&lead_a) == 0 || f.of_ibig(&lead_b) == 0 {
                continue;
            }
            let image = modpoly::gcd(&f, &a.residues(&f), &b.residues(&f));
            if image.len() == 1 {
                return Self::one();
            }
            if image.len() > length {
                continue;
            }
            if image.len() < length {
                length = image.len();
                crt = None;
            }
            let first = crt.is_none();
            let crt = crt.get_or_insert_with(|| Crt::new(length));
            let changed = crt.push(&f, &modpoly::scale(&f, &image, f.of_ibig(&lead)));
            if !changed || first {
                let candidate = Self::new(crt.symmetric()).primitive();
                if a.div_exact(&candidate).is_some() && b.div_exact(&candidate).is_some() {
                    return candidate;
                }
            }
        }
        unreachable!("there are enough primes below 2^62")
    }

    /// Returns residues of the coefficients, without zeros at the top.
    pub(crate) fn residues(&self, f: &Fp) -> Vec<u64> {
        let mut residues: Vec<u64> = self.coefficients().iter().map(|c| f.of_ibig(c)).collect();
        modpoly::trim(&mut residues);
        residues
    }

    /// Returns the primitive squarefree polynomials, coprime in pairs, not constant, with different
    /// multiplicities in ascending order: this polynomial is the product of their powers up to a
    /// constant. Empty for constants.
    pub fn squarefree(&self) -> Vec<(Self, usize)> {
        let divide = |a: &Self, b: &Self| a.div_exact(b).expect("a divisor found before");
        let p = self.primitive();
        let derivative = p.derivative();
        let common = p.gcd(&derivative);
        if common.is_zero() {
            return Vec::new();
        }
        let mut w = divide(&p, &common);
        let mut z = &divide(&derivative, &common) - &w.derivative();
        let mut parts = Vec::new();
        let mut multiplicity = 1;
        while w.degree() > 0 {
            let factor = w.gcd(&z);
            w = divide(&w, &factor);
            z = &divide(&z, &factor) - &w.derivative();
            if factor.degree() > 0 {
                parts.push((factor, multiplicity));
            }
            multiplicity += 1;
        }
        parts
    }

    /// Returns the product of the distinct irreducible factors, primitive; 1 for constants, 0 for
    /// 0.
    pub fn squarefree_part(&self) -> Self {
        let p = self.primitive();
        let common = p.gcd(&p.derivative());
        if common.degree() == 0 {
            p
        } else {
            p.div_exact(&common).expect("a divisor").primitive()
        }
    }
}

/// Returns pairwise coprime squarefree polynomials of which the given ones are products, up to
/// multiplicities and constants, and for each given one the indices of its divisors among them,
/// ascending. Constants have no divisors.
///
/// ```
/// use isoform_algebra::{Poly, coprime_base};
/// let p = |text| Poly::parse(text, &["x", "y"]).expect("a polynomial");
/// let (base, divisors) = coprime_base(&[p("x^2*y"), p("x^2 - y^2"), p("x*(x + y)"), p("3")]);
/// assert_eq!(base, [p("y"), p("x"), p("x - y"), p("x + y")]);
/// assert_eq!(divisors, [vec![0, 1], vec![2, 3], vec![1, 3], vec![]]);
/// ```
pub fn coprime_base(given: &[Poly]) -> (Vec<Poly>, Vec<Vec<usize>>) {
    let mut base: Vec<(Poly, Vec<usize>)> = Vec::new();
    for (k, p) in given.iter().enumerate() {
        let mut rest = p.squarefree_part();
        let mut next = Vec::with_capacity(base.len() + 1);
        for (q, of) in base {
            let g = if rest.is_constant() {
                Poly::one()
            } else {
                q.gcd(&rest)
            };
            if g.is_constant() {
                next.push((q, of));
                continue;
            }
            let of_both = of.iter().copied().chain([k]).collect();
            let without = q.div_exact(&g).expect("a common divisor divides");
            if !without.is_constant() {
                next.push((without.primitive(), of));
            }
            rest = rest.div_exact(&g).expect("a common divisor divides");
            next.push((g.primitive(), of_both));
        }
        if !rest.is_constant() && !rest.is_zero() {
            next.push((rest.primitive(), vec![k]));
        }
        base = next;
    }
    let divisors_of = |k: usize| {
        (0..base.len())
            .filter(|&b| base[b].1.contains(&k))
            .collect()
    };
    let divisors = (0..given.len()).map(divisors_of).collect();
    (base.into_iter().map(|b| b.0).collect(), divisors)
}
