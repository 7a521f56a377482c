//! Greatest common divisors and squarefree parts.
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
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Terms modulo a prime, in descending lexicographic order, none zero.
type Terms = Vec<(Exponents, u64)>;

impl Poly {
    /// The greatest common divisor over Q, primitive; 0 only of two zeros.
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

    /// The greatest common divisor of the coefficients of this polynomial in the powers of a
    /// variable, primitive.
    pub fn content_in(&self, var: usize) -> Self {
        let mut common = Self::zero();
        let mut coefficients = self.coefficients_in(var);
        // The smallest first: the content is often 1, and seen there.
        coefficients.sort_by_key(|c| c.terms().len());
        for c in &coefficients {
            common = common.gcd(c);
            if common.is_constant() && !common.is_zero() {
                break;
            }
        }
        common
    }

    /// Primitive squarefree polynomials, coprime in pairs, not constant, with different
    /// multiplicities in ascending order: this polynomial is the product of their powers up to a
    /// constant. Empty for constants.
    pub fn squarefree(&self) -> Vec<(Self, usize)> {
        let mut parts: BTreeMap<usize, Self> = BTreeMap::new();
        squarefree_into(&self.primitive(), &mut parts);
        parts.into_iter().map(|(n, p)| (p.primitive(), n)).collect()
    }

    /// The product of the distinct irreducible factors, primitive; 1 for constants, 0 for 0.
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

/// Forms lose a variable: their common divisor is that of what is left at 1, made homogeneous,
/// times the common power of it.
fn gcd_of_forms(a: &Poly, b: &Poly, var: usize) -> Poly {
    let power = |p: &Poly| p.terms().iter().map(|(e, _)| e[var]).min().unwrap_or(0);
    let flat = a.dehomogenise(var).gcd(&b.dehomogenise(var));
    let common = u32::from(power(a).min(power(b)));
    flat.homogenise(var, flat.total_degree()) * Poly::var(var).pow(common)
}

/// Both primitive over Z, not constant.
fn gcd_primitive(a: &Poly, b: &Poly, variables: &[usize]) -> Poly {
    let (lead_a, lead_b) = (&a.terms()[0].1, &b.terms()[0].1);
    let lead = IBig::from(lead_a.gcd(lead_b));
    // The lexicographic leading exponents, their residues and the exponents of all terms found so
    // far.
    let mut best: Option<(Vec<Exponents>, Crt)> = None;
    for f in primes() {
        if f.of_ibig(lead_a) == 0 || f.of_ibig(lead_b) == 0 {
            continue;
        }
        let residues = |p: &Poly| -> Terms {
            p.terms()
                .iter()
                .map(|(e, c)| (*e, f.of_ibig(c)))
                .filter(|(_, c)| *c != 0)
                .collect()
        };
        let image = gcd_modular(&f, &residues(a), &residues(b), variables);
        if image[0].0 == [0; MAX_VARS] {
            return Poly::one();
        }
        let scale = f.of_ibig(&lead);
        let image: Terms = image
            .into_iter()
            .map(|(e, c)| (e, f.mul(c, scale)))
            .collect();
        // A prime is unlucky if the leading term of its image is too high.
        match best
            .as_ref()
            .map_or(Ordering::Less, |(e, _)| image[0].0.cmp(&e[0]))
        {
            Ordering::Greater => continue,
            Ordering::Less => {
                best = Some((image.iter().map(|t| t.0).collect(), Crt::new(image.len())))
            }
            Ordering::Equal => {}
        }
        let Some((exponents, crt)) = &mut best else {
            unreachable!("just set")
        };
        if exponents.len() != image.len() || exponents.iter().zip(&image).any(|(e, t)| *e != t.0) {
            // Terms that vanish modulo one of the primes: begin again, with zeros for the terms of
            // this one only.
            let all: std::collections::BTreeSet<Exponents> = exponents
                .iter()
                .copied()
                .chain(image.iter().map(|t| t.0))
                .collect();
            *exponents = all.into_iter().rev().collect();
            *crt = Crt::new(exponents.len());
        }
        let find = |e: &Exponents| {
            image
                .binary_search_by(|t| e.cmp(&t.0))
                .map_or(0, |i| image[i].1)
        };
        let first = crt.modulus().is_one();
        let changed = crt.push(&f, &exponents.iter().map(find).collect::<Vec<_>>());
        if !changed || first {
            let candidate =
                Poly::from_integers(exponents.iter().copied().zip(crt.symmetric()), UBig::ONE)
                    .primitive();
            if a.is_multiple_of(&candidate) && b.is_multiple_of(&candidate) {
                return candidate;
            }
        }
    }
    unreachable!("there are enough primes below 2^62")
}

/// A polynomial in the variables before `var` with dense coefficients in `var`, modulo a prime.
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

/// Takes the content out of a polynomial with coefficients in the last variable and returns it,
/// monic.
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

/// The greatest common divisor modulo a prime, its lexicographic leading coefficient 1. Not proven:
/// evaluation points may be unlucky, which the division by the caller would show.
fn gcd_modular(
    f: &Fp,
    a: &[(Exponents, u64)],
    b: &[(Exponents, u64)],
    variables: &[usize],
) -> Terms {
    let [rest @ .., var] = variables else {
        return vec![([0; MAX_VARS], f.one())];
    };
    let var = *var;
    let with_power = |e: &Exponents, n: usize| {
        let mut e = *e;
        e[var] = n as u16;
        e
    };
    if rest.is_empty() {
        let dense =
            |p: &[(Exponents, u64)]| in_last(p, var).into_values().next().unwrap_or_default();
        let g = modpoly::gcd(f, &dense(a), &dense(b));
        let terms = g.iter().enumerate().rev().filter(|(_, c)| **c != 0);
        return terms
            .map(|(n, &c)| (with_power(&[0; MAX_VARS], n), c))
            .collect();
    }
    let (mut a, mut b) = (in_last(a, var), in_last(b, var));
    let content = modpoly::gcd(f, &take_content(f, &mut a), &take_content(f, &mut b));
    let expand = |p: &InLast| -> Terms {
        let mut terms: Terms = Vec::new();
        for (e, c) in p.iter().rev() {
            terms.extend(
                c.iter()
                    .enumerate()
                    .rev()
                    .filter(|(_, c)| **c != 0)
                    .map(|(n, &c)| (with_power(e, n), c)),
            );
        }
        let inverse = terms.first().map_or(0, |t| f.inv(t.1));
        terms
            .into_iter()
            .map(|(e, c)| (e, f.mul(c, inverse)))
            .collect()
    };
    let (Some(lead_a), Some(lead_b)) = (
        a.values().next_back().cloned(),
        b.values().next_back().cloned(),
    ) else {
        unreachable!("polynomials that are not zero")
    };
    let lead = modpoly::gcd(f, &lead_a, &lead_b);
    let degree = |p: &InLast| p.values().map(Vec::len).max().unwrap_or(0);
    let enough = degree(&a).min(degree(&b)) + lead.len();
    // A fixed pseudo-random stream of points: at small integers polynomials that people write agree
    // by design.
    let mut point = f.of_u64(0x9e37_79b9_7f4a_7c15);
    let mut found: Option<(Exponents, InLast)> = None;
    let mut product = vec![f.one()];
    loop {
        point = f.mul(point, f.add(point, f.one()));
        if modpoly::eval(f, &lead_a, point) == 0
            || modpoly::eval(f, &lead_b, point) == 0
            || modpoly::eval(f, &product, point) == 0
        {
            point = f.add(point, f.one());
            continue;
        }
        let at = |p: &InLast| -> Terms {
            let values = p
                .iter()
                .rev()
                .map(|(e, c)| (*e, modpoly::eval(f, c, point)));
            values.filter(|(_, c)| *c != 0).collect()
        };
        let image = gcd_modular(f, &at(&a), &at(&b), rest);
        if image[0].0 == [0; MAX_VARS] {
            return expand(&InLast::from([([0; MAX_VARS], content)]));
        }
        match found
            .as_ref()
            .map_or(Ordering::Less, |(e, _)| image[0].0.cmp(e))
        {
            Ordering::Greater => continue,
            Ordering::Less => {
                found = Some((image[0].0, InLast::new()));
                product = vec![f.one()];
            }
            Ordering::Equal => {}
        }
        let Some((_, sum)) = &mut found else {
            unreachable!("just set")
        };
        let scale = modpoly::eval(f, &lead, point);
        let inverse = f.inv(modpoly::eval(f, &product, point));
        let mut changed = false;
        let mut image: BTreeMap<Exponents, u64> = image.into_iter().collect();
        for e in sum.keys() {
            image.entry(*e).or_insert(0);
        }
        for (e, value) in image {
            let coefficient = sum.entry(e).or_default();
            let step = f.mul(
                f.sub(f.mul(value, scale), modpoly::eval(f, coefficient, point)),
                inverse,
            );
            if step != 0 {
                changed = true;
                *coefficient = modpoly::add(f, coefficient, &modpoly::scale(f, &product, step));
            }
        }
        product = modpoly::mul(f, &product, &[f.neg(point), f.one()]);
        if !changed || product.len() > enough {
            sum.retain(|_, c| !c.is_empty());
            take_content(f, sum);
            for c in sum.values_mut() {
                *c = modpoly::mul(f, c, &content);
            }
            return expand(sum);
        }
    }
}

impl UPoly {
    /// The greatest common divisor over Q, primitive; 0 only of two zeros.
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

    /// Residues of the coefficients, without zeros at the top.
    pub(crate) fn residues(&self, f: &Fp) -> Vec<u64> {
        let mut residues: Vec<u64> = self.coefficients().iter().map(|c| f.of_ibig(c)).collect();
        modpoly::trim(&mut residues);
        residues
    }

    /// Primitive squarefree polynomials, coprime in pairs, not constant, with different
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

    /// The product of the distinct irreducible factors, primitive; 1 for constants, 0 for 0.
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

/// Squarefree polynomials, pairwise coprime, of which those given are products up to multiplicities
/// and constants; and for each given one which of them divide it, ascending. Constants have none.
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
    let divisors = (0..given.len())
        .map(|k| {
            (0..base.len())
                .filter(|&b| base[b].1.contains(&k))
                .collect()
        })
        .collect();
    (base.into_iter().map(|b| b.0).collect(), divisors)
}
