//! Maps modulo primes: pullbacks of planes, and the degrees that they count.

use super::MapDegrees;
use crate::compose::eval_terms;
use crate::modpoly;
use crate::modular::{Fp, residues};
use crate::poly::{Exponents, MAX_VARS, Poly};
use isoform_num::Random;

/// Pseudo-random residues modulo varying primes.
pub(super) struct Residues(Random);

impl Residues {
    pub(super) fn new(seed: u64) -> Self {
        Self(Random::xorshift(seed))
    }
    pub(super) fn next(&mut self, f: &Fp) -> u64 {
        f.of_u64(self.0.bits())
    }
}

/// Returns the value of a form in three variables at a point.
pub(super) fn eval_at(f: &Fp, terms: &[(Exponents, u64)], at: &[u64; 3]) -> u64 {
    let tables: [Vec<u64>; MAX_VARS] = std::array::from_fn(|v| {
        let degree = terms
            .iter()
            .map(|(e, _)| usize::from(e[v]))
            .max()
            .unwrap_or(0);
        // The fourth variable does not occur: only its power 0 is used.
        powers(f, at.get(v).copied().unwrap_or(0), degree)
    });
    eval_terms(f, terms, &tables)
}

/// Returns the powers 1, x, x², … up to a degree.
pub(super) fn powers(f: &Fp, x: u64, degree: usize) -> Vec<u64> {
    let mut table = vec![f.one(); degree + 1];
    for k in 1..=degree {
        table[k] = f.mul(table[k - 1], x);
    }
    table
}

/// Map modulo a prime in a random frame of the parameter plane, without base points at infinity and
/// without two of them on a vertical line.
pub(super) struct Pullback {
    pub(super) field: Fp,
    /// Degree of the map.
    n: usize,
    frame: [[u64; 3]; 3],
    forms: Vec<Vec<(Exponents, u64)>>,
    /// Lines s = 0 … n².
    nodes: Vec<usize>,
    /// Inverses of small numbers, for interpolation.
    pub(super) inverses: Vec<u64>,
    /// The four forms on these lines, as polynomials in t.
    lines: Vec<[Vec<u64>; 4]>,
}

impl Pullback {
    pub(super) fn new(f: &Fp, map: &[Poly; 4], n: usize, stream: &mut Residues) -> Self {
        let mut pullback = Self {
            field: *f,
            n,
            frame: std::array::from_fn(|_| std::array::from_fn(|_| stream.next(f))),
            forms: map
                .iter()
                .map(|p| residues(f, &p.homogenise(2, n)))
                .collect(),
            nodes: (0..=n * n).collect(),
            inverses: modpoly::small_inverses(f, n * n + 1),
            lines: Vec::new(),
        };
        let lines = pullback.nodes.iter().map(|&s| pullback.line(s)).collect();
        pullback.lines = lines;
        pullback
    }
    /// Returns the four forms in t on the line of a value of s, from their values at the first
    /// nodes.
    fn line(&self, s: usize) -> [Vec<u64>; 4] {
        let f = &self.field;
        let values: Vec<[u64; 4]> = (0..=self.n)
            .map(|t| self.image(f.of_u64(s as u64), f.of_u64(t as u64)))
            .collect();
        std::array::from_fn(|i| {
            let column: Vec<u64> = values.iter().map(|v| v[i]).collect();
            modpoly::interpolate(f, &self.nodes[..=self.n], &column, &self.inverses)
        })
    }
    fn image(&self, s: u64, t: u64) -> [u64; 4] {
        let f = &self.field;
        let point = self
            .frame
            .map(|r| f.add(f.add(f.mul(r[0], s), f.mul(r[1], t)), r[2]));
        std::array::from_fn(|i| eval_at(f, &self.forms[i], &point))
    }
    /// Returns the pullbacks of two planes on every line, if they keep their degrees.
    pub(super) fn planes(&self, a: &[u64; 4], b: &[u64; 4]) -> Option<Vec<(Vec<u64>, Vec<u64>)>> {
        let f = &self.field;
        let on = |line: &[Vec<u64>; 4], c: &[u64; 4]| {
            let parts = line.iter().zip(c).filter(|(_, c)| **c != 0);
            parts.fold(Vec::new(), |sum, (p, &c)| {
                modpoly::add(f, &sum, &modpoly::scale(f, p, c))
            })
        };
        let pairs = self.lines.iter().map(|line| (on(line, a), on(line, b)));
        pairs
            .map(|(a, b)| (a.len() == self.n + 1 && b.len() == self.n + 1).then_some((a, b)))
            .collect()
    }
    pub(super) fn interpolate(&self, values: &[u64]) -> Vec<u64> {
        modpoly::interpolate(
            &self.field,
            &self.nodes[..values.len()],
            values,
            &self.inverses,
        )
    }
    /// Returns the resultant of the pullbacks of two planes, whose roots are s of the common
    /// points, with multiplicities.
    fn meet(&self, a: &[u64; 4], b: &[u64; 4]) -> Option<Vec<u64>> {
        let values: Vec<u64> = self
            .planes(a, b)?
            .iter()
            .map(|(a, b)| modpoly::resultant(&self.field, a, b))
            .collect();
        let r = self.interpolate(&values);
        (r.len() == self.nodes.len()).then_some(r)
    }
    /// Returns the number of points that two pullbacks have in common, n².
    pub(super) fn points(&self) -> usize {
        self.nodes.len() - 1
    }
    /// Returns a form of the map as a polynomial in t whose coefficients are polynomials in s.
    pub(super) fn in_t(&self, form: usize) -> Vec<Vec<u64>> {
        let coefficient = |line: &[Vec<u64>; 4], j: usize| line[form].get(j).copied().unwrap_or(0);
        let lines = &self.lines[..=self.n];
        (0..=self.n)
            .map(|j| {
                let values: Vec<u64> = lines.iter().map(|l| coefficient(l, j)).collect();
                self.interpolate(&values)
            })
            .collect()
    }
    /// Returns the polynomial in s whose roots are the base points, with multiplicities, from two
    /// general pairs of planes.
    pub(super) fn base(&self, stream: &mut Residues) -> Option<Vec<u64>> {
        let [a, b, c, d] = [(); 4].map(|()| [(); 4].map(|()| stream.next(&self.field)));
        Some(modpoly::gcd(
            &self.field,
            &self.meet(&a, &b)?,
            &self.meet(&c, &d)?,
        ))
    }
}

/// Counts all degrees modulo a prime.
pub(super) fn count_degrees(
    f: &Fp,
    map: &[Poly; 4],
    n: usize,
    stream: &mut Residues,
) -> Option<MapDegrees> {
    let pullback = Pullback::new(f, map, n, stream);
    let base_multiplicity = pullback.base(stream)?.len() - 1;
    // Planes through the image of a point: one coefficient is determined by the others.
    let at = pullback.image(stream.next(f), stream.next(f));
    let pivot = at.iter().position(|&v| v != 0)?;
    let [a, b, c, d] = [(); 4].map(|()| {
        let mut c = [(); 4].map(|()| stream.next(f));
        c[pivot] = 0;
        let sum = (0..4).fold(0, |sum, i| f.add(sum, f.mul(c[i], at[i])));
        c[pivot] = f.neg(f.div(sum, at[pivot]));
        c
    });
    let common = modpoly::gcd(f, &pullback.meet(&a, &b)?, &pullback.meet(&c, &d)?);
    let map_degree = (common.len() - 1)
        .checked_sub(base_multiplicity)
        .filter(|&m| m > 0)?;
    let moving = n * n - base_multiplicity;
    moving.is_multiple_of(map_degree).then_some(MapDegrees {
        degree: n,
        map_degree,
        implicit_degree: moving / map_degree,
        base_multiplicity,
    })
}
