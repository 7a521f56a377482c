//! Polynomials in place of the variables of a polynomial.
//!
//! An implicit equation of degree 16 pulled back through a map of degree 4 has 2145 terms with
//! coefficients of some thousand bits. Where the result has two variables it is evaluated on a grid
//! modulo primes and interpolated there (Newton's formula on a staircase of points); the number of
//! primes comes from a bound on the coefficients, so the result is proven. Elsewhere it is
//! multiplied out by Horner's rule.

use crate::modpoly;
use crate::modular::{Crt, Fp, primes};
use crate::poly::{Exponents, MAX_VARS, Poly};
use dashu_base::UnsignedAbs;
use dashu_int::{IBig, UBig};

/// Product of the numbers of terms of the outer polynomial and of the result above which the grid
/// is faster than Horner's rule (measured).
const MIN_GRID_WORK: usize = 2000;

impl Poly {
    /// Returns this polynomial with `parts[i]` in place of variable i; variables beyond the slice
    /// remain.
    pub fn compose(&self, parts: &[Self]) -> Self {
        let inner: [Self; MAX_VARS] =
            std::array::from_fn(|v| parts.get(v).cloned().unwrap_or_else(|| Self::var(v)));
        let used: Vec<usize> = self.variables();
        let variables: Vec<usize> = (0..MAX_VARS)
            .filter(|&v| used.iter().any(|&u| inner[u].degree(v) > 0))
            .collect();
        if variables.len() == 3
            && let Some(degree) = common_degree(self, &inner, &used)
        {
            // Forms in a form: the result is a form, known from its values with the last variable
            // at 1.
            let flat = inner.map(|p| p.dehomogenise(variables[2]));
            return self.compose(&flat).homogenise(variables[2], degree);
        }
        if variables.len() <= 2
            && let grid = CompositionGrid::new(self, &inner, &variables)
            && self.terms().len() * grid.points() > MIN_GRID_WORK
        {
            return grid.compose();
        }
        horner(self.terms(), 0, &inner).scale(&dashu_ratio::RBig::from_parts(
            IBig::ONE,
            self.denominator().clone(),
        ))
    }

    /// Returns true if this polynomial with `parts[i]` in place of variable i vanishes, proved by
    /// values on a grid modulo primes.
    pub(crate) fn composes_to_zero(&self, parts: &[Self]) -> bool {
        let inner: [Self; MAX_VARS] =
            std::array::from_fn(|v| parts.get(v).cloned().unwrap_or_else(|| Self::var(v)));
        let used = self.variables();
        let variables: Vec<usize> = (0..MAX_VARS)
            .filter(|&v| used.iter().any(|&u| inner[u].degree(v) > 0))
            .collect();
        if variables.len() > 2 {
            return self.compose(parts).is_zero();
        }
        CompositionGrid::new(self, &inner, &variables).vanishes()
    }
}

/// Returns the degree of the result if the outer polynomial is a form, and the inner ones that
/// occur are forms of one degree.
fn common_degree(outer: &Poly, inner: &[Poly; MAX_VARS], used: &[usize]) -> Option<usize> {
    let degree = inner[*used.first()?].total_degree();
    let forms = used.iter().all(|&u| {
        inner[u].is_homogeneous() && !inner[u].is_zero() && inner[u].total_degree() == degree
    });
    (forms && outer.is_homogeneous()).then_some(degree * outer.total_degree())
}

/// Evaluates terms by Horner's rule in the variables from `var`; the terms agree in the exponents
/// before it.
fn horner(terms: &[(Exponents, IBig)], var: usize, inner: &[Poly; MAX_VARS]) -> Poly {
    if var == MAX_VARS {
        return terms
            .first()
            .map_or(Poly::zero(), |(_, c)| Poly::constant(c.clone()));
    }
    let mut result = Poly::zero();
    let mut exponent = terms.first().map_or(0, |(e, _)| e[var]);
    let mut rest = terms;
    while let Some((e, _)) = rest.first() {
        let n = e[var];
        result = result * inner[var].pow(u32::from(exponent - n));
        let group = rest.iter().take_while(|(e, _)| e[var] == n).count();
        result = result + horner(&rest[..group], var + 1, inner);
        (exponent, rest) = (n, &rest[group..]);
    }
    result * inner[var].pow(u32::from(exponent))
}

/// Composition with at most two variables in its result, as values at the points (i, j), j <
/// rows[i].
struct CompositionGrid<'a> {
    /// Terms of the outer polynomial, made homogeneous by powers of the common denominator of the
    /// inner ones.
    outer: Vec<(Exponents, IBig)>,
    /// Inner polynomials over their common denominator: terms (power of u, power of v,
    /// coefficient).
    inner: Vec<Vec<(usize, usize, IBig)>>,
    variables: &'a [usize],
    rows: Vec<usize>,
    denominator: UBig,
}

/// Returns the least common multiple of denominators.
fn common_denominator<'p>(polynomials: impl Iterator<Item = &'p Poly>) -> UBig {
    polynomials.fold(UBig::ONE, |common, p| {
        let d = p.denominator();
        &common / dashu_base::Gcd::gcd(&common, d) * d
    })
}

/// Returns the terms of an inner polynomial over a denominator: power of u, power of v,
/// coefficient.
fn inner_terms(p: &Poly, variables: &[usize], common: &UBig) -> Vec<(usize, usize, IBig)> {
    let factor = IBig::from(common / p.denominator());
    let power = |e: &Exponents, k: usize| variables.get(k).map_or(0, |&v| usize::from(e[v]));
    let terms = p.terms().iter();
    terms
        .map(|(e, c)| (power(e, 0), power(e, 1), c * &factor))
        .collect()
}

/// Returns the maximum number of coefficients of powers of v for each power of u in the
/// composition, from bounds on its degrees in u, in v, and in both.
fn rows(outer: &Poly, inner: &[Poly; MAX_VARS], variables: &[usize]) -> Vec<usize> {
    let bound = |of: &dyn Fn(usize) -> usize| {
        let of_parts: [usize; MAX_VARS] = std::array::from_fn(of);
        let degree_of = |e: &Exponents| {
            let powers = e.iter().zip(of_parts);
            powers.map(|(&n, d)| usize::from(n) * d).sum::<usize>()
        };
        let degrees = outer.terms().iter().map(|(e, _)| degree_of(e));
        degrees.max().unwrap_or(0)
    };
    let along = |k: usize| {
        variables
            .get(k)
            .map_or(0, |&v| bound(&|u| inner[u].degree(v)))
    };
    let (du, dv, total) = (along(0), along(1), bound(&|u| inner[u].total_degree()));
    (0..=du.min(total)).map(|i| dv.min(total - i) + 1).collect()
}

impl<'a> CompositionGrid<'a> {
    fn new(outer: &Poly, inner: &[Poly; MAX_VARS], variables: &'a [usize]) -> Self {
        let used = outer.variables();
        let common = common_denominator(used.iter().map(|&u| &inner[u]));
        let degree = outer.total_degree();
        let weight =
            |e: &Exponents| common.pow(degree - e.iter().map(|&n| usize::from(n)).sum::<usize>());
        let outer_terms = outer
            .terms()
            .iter()
            .map(|(e, c)| (*e, c * IBig::from(weight(e))))
            .collect();
        let inner_terms = (0..MAX_VARS)
            .map(|u| match used.contains(&u) {
                true => inner_terms(&inner[u], variables, &common),
                false => Vec::new(),
            })
            .collect();
        Self {
            outer: outer_terms,
            inner: inner_terms,
            variables,
            rows: rows(outer, inner, variables),
            denominator: outer.denominator() * common.pow(degree),
        }
    }

    fn points(&self) -> usize {
        self.rows.iter().sum()
    }

    /// Returns a bound on the coefficients' absolute values: the sum of absolute coefficients is
    /// submultiplicative.
    fn bound(&self) -> UBig {
        let norms: Vec<UBig> = self
            .inner
            .iter()
            .map(|p| p.iter().map(|(_, _, c)| c.clone().unsigned_abs()).sum())
            .collect();
        let size = |e: &Exponents| {
            norms.iter().zip(e).fold(UBig::ONE, |product, (n, &k)| {
                product * n.pow(usize::from(k))
            })
        };
        self.outer
            .iter()
            .map(|(e, c)| c.clone().unsigned_abs() * size(e))
            .sum()
    }

    fn vanishes(&self) -> bool {
        let bound = self.bound() << 1;
        let mut modulus = UBig::ONE;
        for field in primes() {
            if self.values(&field).iter().any(|&v| v != 0) {
                return false;
            }
            modulus *= field.prime();
            if modulus > bound {
                return true;
            }
        }
        unreachable!("there are enough primes below 2^62")
    }

    fn compose(&self) -> Poly {
        let bound = self.bound() << 1;
        let mut crt = Crt::new(self.points());
        for field in primes() {
            let mut values = self.values(&field);
            interpolate(&field, &self.rows, &mut values, 0);
            crt.push(&field, &values);
            if *crt.modulus() > bound {
                break;
            }
        }
        let cells = self
            .rows
            .iter()
            .enumerate()
            .flat_map(|(i, &n)| (0..n).map(move |j| (i, j)));
        let terms = cells.zip(crt.symmetric()).map(|((i, j), c)| {
            let mut e = [0; MAX_VARS];
            for (&v, n) in self.variables.iter().zip([i, j]) {
                e[v] = u16::try_from(n).expect("an exponent below 65536");
            }
            (e, c)
        });
        Poly::from_integers(terms, self.denominator.clone())
    }

    /// Returns the values of the composition at all points modulo a prime, row by row.
    fn values(&self, f: &Fp) -> Vec<u64> {
        let inner: Vec<Vec<(usize, usize, u64)>> = self
            .inner
            .iter()
            .map(|p| p.iter().map(|(i, j, c)| (*i, *j, f.of_ibig(c))).collect())
            .collect();
        let outer: Vec<(Exponents, u64)> =
            self.outer.iter().map(|(e, c)| (*e, f.of_ibig(c))).collect();
        let mut powers: [Vec<u64>; MAX_VARS] = std::array::from_fn(|v| {
            vec![
                f.one();
                outer
                    .iter()
                    .map(|(e, _)| usize::from(e[v]))
                    .max()
                    .unwrap_or(0)
                    + 1
            ]
        });
        let mut values = Vec::with_capacity(self.points());
        for (i, &n) in self.rows.iter().enumerate() {
            let u = f.of_u64(i as u64);
            let lines: Vec<Vec<u64>> = inner.iter().map(|p| restrict(f, p, u)).collect();
            for j in 0..n {
                let v = f.of_u64(j as u64);
                for (line, table) in lines.iter().zip(&mut powers) {
                    let x = modpoly::eval(f, line, v);
                    for k in 1..table.len() {
                        table[k] = f.mul(table[k - 1], x);
                    }
                }
                values.push(eval_terms(f, &outer, &powers));
            }
        }
        values
    }
}

/// Returns the univariate polynomial in v for a given value of u.
fn restrict(f: &Fp, p: &[(usize, usize, u64)], u: u64) -> Vec<u64> {
    let (du, dv) = p
        .iter()
        .fold((0, 0), |(a, b), (i, j, _)| (a.max(*i), b.max(*j)));
    let mut powers = vec![f.one(); du + 1];
    for k in 1..=du {
        powers[k] = f.mul(powers[k - 1], u);
    }
    let mut line = vec![0; dv + 1];
    for (i, j, c) in p {
        line[*j] = f.add(line[*j], f.mul(*c, powers[*i]));
    }
    line
}

/// Returns the value of terms in lexicographic order from tables of powers; products of leading
/// powers are reused from term to term.
pub(crate) fn eval_terms(f: &Fp, terms: &[(Exponents, u64)], powers: &[Vec<u64>; MAX_VARS]) -> u64 {
    let mut prefix = [f.one(); MAX_VARS + 1];
    let mut last: Option<Exponents> = None;
    let mut sum = 0;
    for (e, c) in terms {
        let shared = last.map_or(0, |l| (0..MAX_VARS).take_while(|&v| l[v] == e[v]).count());
        for v in shared..MAX_VARS {
            prefix[v + 1] = if e[v] == 0 {
                prefix[v]
            } else {
                f.mul(prefix[v], powers[v][usize::from(e[v])])
            };
        }
        last = Some(*e);
        sum = f.add(sum, f.mul(*c, prefix[MAX_VARS]));
    }
    sum
}

/// Converts values at the points (origin + i, origin + j), j < rows[i], rows never growing, to
/// coefficients of uⁱ vʲ, in place.
pub(crate) fn interpolate(f: &Fp, rows: &[usize], values: &mut [u64], origin: u64) {
    let width = rows.first().copied().unwrap_or(0);
    let size = width.max(rows.len());
    let nodes: Vec<u64> = (0..size)
        .map(|i| f.add(origin, f.of_u64(i as u64)))
        .collect();
    let inverses = modpoly::small_inverses(f, size);
    let differences = |line: &mut [u64]| {
        for level in 1..line.len() {
            for i in (level..line.len()).rev() {
                line[i] = f.mul(f.sub(line[i], line[i - 1]), inverses[level]);
            }
        }
    };
    // First both directions to Newton's basis, in which the leading coefficients of a row do not
    // depend on its length; then both to powers, over the staircase.
    along_rows_and_columns(rows, values, differences);
    along_rows_and_columns(rows, values, |line| {
        modpoly::newton_to_monomial(f, &nodes, line)
    });
}

fn along_rows_and_columns(rows: &[usize], values: &mut [u64], along: impl Fn(&mut [u64])) {
    let starts: Vec<usize> = rows
        .iter()
        .scan(0, |at, &n| Some(std::mem::replace(at, *at + n)))
        .collect();
    for (&start, &n) in starts.iter().zip(rows) {
        along(&mut values[start..start + n]);
    }
    let mut column = Vec::new();
    for j in 0..rows.first().copied().unwrap_or(0) {
        let height = rows.iter().take_while(|&&n| n > j).count();
        column.clear();
        column.extend((0..height).map(|i| values[starts[i] + j]));
        along(&mut column);
        for (i, &c) in column.iter().enumerate() {
            values[starts[i] + j] = c;
        }
    }
}
