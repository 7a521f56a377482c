//! Deck transformations as power series along lines, modulo primes.

use super::Point;
use crate::map::Map;
use isoform_algebra::Exponents;
use isoform_algebra::modular::{Echelon, Fp, residues};

/// Maximum degree of the forms of a deck transformation. Typical maps have transformations of
/// degree 1 or 2; each further degree costs twice the time of all lower ones together.
pub(super) const MAX_FORM_DEGREE: usize = 4;
/// Number of terms of each power series. A term determines two coefficients on a line; the surplus
/// refutes forms that agree by chance.
const SERIES_TERMS: usize = 2 * MAX_FORM_DEGREE + 4;

/// Lists the exponents of the monomials of a degree.
pub(super) fn monomials(degree: usize) -> Vec<[u16; 3]> {
    let n = degree as u16;
    let row = |i: u16| (0..=n - i).map(move |j| [i, j, n - i - j]);
    (0..=n).flat_map(row).collect()
}

/// A power series modulo a prime, [`SERIES_TERMS`] terms.
pub(super) type Series = [u64; SERIES_TERMS];

/// Returns the product of two series, truncated to [`SERIES_TERMS`] terms.
fn product(f: &Fp, a: &Series, b: &Series) -> Series {
    let mut c = [0; SERIES_TERMS];
    for (i, &x) in a.iter().enumerate().filter(|(_, x)| **x != 0) {
        for (y, sum) in b.iter().zip(&mut c[i..]) {
            *sum = f.add(*sum, f.mul(x, *y));
        }
    }
    c
}

/// Returns the powers of three series up to a degree.
fn powers(f: &Fp, at: &[Series; 3], degree: usize) -> [Vec<Series>; 3] {
    at.each_ref().map(|x| {
        let mut one = [0; SERIES_TERMS];
        one[0] = f.one();
        let mut list = vec![one];
        for k in 0..degree {
            list.push(product(f, &list[k], x));
        }
        list
    })
}

/// Returns the monomial with given exponents, from the powers of three series.
fn monomial(f: &Fp, powers: &[Vec<Series>; 3], e: [u16; 3]) -> Series {
    let [x, y, z] = [0, 1, 2].map(|v| &powers[v][usize::from(e[v])]);
    product(f, &product(f, x, y), z)
}

/// The four forms of a map modulo a prime.
struct Forms {
    degree: usize,
    terms: [Vec<(Exponents, u64)>; 4],
}

impl Forms {
    fn new(f: &Fp, map: &Map) -> Self {
        Self {
            degree: map.degree(),
            terms: map.forms().each_ref().map(|form| residues(f, form)),
        }
    }
    fn at(&self, f: &Fp, point: &[Series; 3]) -> [Series; 4] {
        let powers = powers(f, point, self.degree);
        self.terms.each_ref().map(|terms| {
            let mut sum = [0; SERIES_TERMS];
            for (e, c) in terms {
                let term = monomial(f, &powers, [e[0], e[1], e[2]]);
                for (sum, term) in sum.iter_mut().zip(term) {
                    *sum = f.add(*sum, f.mul(*c, term));
                }
            }
            sum
        })
    }
}

/// The points on a line, and the points of their fibres, as series.
pub(super) type Continued = [[Series; 3]; 2];

/// Returns a constant as a series.
fn constant(x: u64) -> Series {
    let mut series = [0; SERIES_TERMS];
    series[0] = x;
    series
}

/// Returns points on lines through a point, and the points of their fibres that continue `to`;
/// `None` if the prime, or the point, is special.
pub(super) fn continued(f: &Fp, map: &Map, from: &Point, to: &Point) -> Option<Vec<Continued>> {
    let forms = Forms::new(f, map);
    let residues = |p: &Point| {
        let [a, b, c] = p.each_ref().map(|x| f.of_rbig(x));
        Some([a?, b?, c?])
    };
    let (from, to) = (residues(from)?, residues(to)?);
    let along = |k: usize| {
        let mut p = from.map(constant);
        (p[0][1], p[1][1]) = (f.one(), f.of_u64(k as u64));
        let source = forms.at(f, &p);
        Some([p, lifted(f, &forms, &source, to.map(constant))?])
    };
    // Three forms of degree n have 3(n + 1) coefficients on a line, and n + 1 lines determine them;
    // two more lines refute forms that agree by chance.
    (0..MAX_FORM_DEGREE + 3).map(along).collect()
}

/// Extends a point to a series at which the forms are proportional to given ones, by Newton's
/// method, term by term.
fn lifted(f: &Fp, forms: &Forms, source: &[Series; 4], mut q: [Series; 3]) -> Option<[Series; 3]> {
    let fixed = (0..3).find(|&v| q[v][0] != 0)?;
    let free = [[1, 2], [0, 2], [0, 1]][fixed];
    let proportion = Proportion {
        f,
        forms,
        source,
        pivot: (0..4).find(|&i| source[i][0] != 0)?,
    };
    let slopes = proportion.slopes(&q, free);
    let minor =
        |a: &[u64], b: &[u64], [i, j]: [usize; 2]| f.sub(f.mul(a[i], b[j]), f.mul(a[j], b[i]));
    let mut pairs = [[0, 1], [0, 2], [1, 2]].into_iter();
    let rows = pairs.find(|&rows| minor(&slopes[0], &slopes[1], rows) != 0)?;
    let inverse = f.inv(minor(&slopes[0], &slopes[1], rows));
    for order in 1..SERIES_TERMS {
        let r = proportion.residual(&q, order);
        let by_0 = minor(&r, &slopes[1], rows);
        let by_1 = minor(&slopes[0], &r, rows);
        q[free[0]][order] = f.neg(f.mul(by_0, inverse));
        q[free[1]][order] = f.neg(f.mul(by_1, inverse));
    }
    Some(q)
}

/// Proportionality of the forms at a point to given series. The pivot series has a non-zero
/// constant term.
struct Proportion<'a> {
    f: &'a Fp,
    forms: &'a Forms,
    source: &'a [Series; 4],
    pivot: usize,
}

impl Proportion<'_> {
    /// Returns the coefficients of one order of the minors of forms and given series with the
    /// pivot.
    fn residual(&self, q: &[Series; 3], order: usize) -> Vec<u64> {
        let Self {
            f, source, pivot, ..
        } = *self;
        let values = self.forms.at(f, q);
        let rows = (0..4).filter(|&i| i != pivot);
        let rows = rows.map(|i| {
            let a = product(f, &values[i], &source[pivot]);
            let b = product(f, &values[pivot], &source[i]);
            f.sub(a[order], b[order])
        });
        rows.collect()
    }
    /// Returns the derivatives of the residual by two coordinates, from the first-order
    /// coefficients.
    fn slopes(&self, q: &[Series; 3], free: [usize; 2]) -> [Vec<u64>; 2] {
        let at_rest = self.residual(q, 1);
        free.map(|v| {
            let mut moved = *q;
            moved[v][1] = self.f.one();
            let by = self.residual(&moved, 1);
            let slopes = by.iter().zip(&at_rest);
            slopes.map(|(a, b)| self.f.sub(*a, *b)).collect()
        })
    }
}

/// Evaluates the monomials of one degree at a point, as series.
fn values(f: &Fp, p: &[Series; 3], list: &[[u16; 3]], degree: usize) -> Vec<Series> {
    let powers = powers(f, p, degree);
    list.iter().map(|&e| monomial(f, &powers, e)).collect()
}

/// Returns the linear conditions on the coefficients of three forms that map the points of a line
/// to their continued images: one for each pair of forms and each order.
fn conditions(f: &Fp, [p, q]: &Continued, list: &[[u16; 3]], degree: usize) -> Vec<Vec<u64>> {
    let n = list.len();
    let values = values(f, p, list, degree);
    let mut rows = Vec::new();
    for [i, j] in [[0, 1], [1, 2], [2, 0]] {
        let times = |x: &Series| {
            values
                .iter()
                .map(|v| product(f, v, x))
                .collect::<Vec<Series>>()
        };
        let (on_i, on_j) = (times(&q[j]), times(&q[i]));
        for k in 0..SERIES_TERMS {
            let mut row = vec![0; 3 * n];
            for c in 0..n {
                row[i * n + c] = on_i[c][k];
                row[j * n + c] = f.neg(on_j[c][k]);
            }
            rows.push(row);
        }
    }
    rows
}

/// Returns the three forms of a degree that map the points of all lines to their continued images,
/// as the index of the coefficient normalised to 1 and all coefficients; `None` if such forms do
/// not exist.
pub(super) fn agreeing(f: &Fp, lines: &[Continued], degree: usize) -> Option<(usize, Vec<u64>)> {
    let list = monomials(degree);
    let n = list.len();
    let rows = lines
        .iter()
        .flat_map(|line| conditions(f, line, &list, degree));
    let mut echelon = Echelon::new(3 * n);
    for row in rows {
        echelon.insert(f, row);
        if echelon.rank() == 3 * n {
            return None;
        }
    }
    echelon.kernel(f)
}
