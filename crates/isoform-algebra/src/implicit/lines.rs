//! The equation of a map by its values on lines.
//!
//! The lines go through a point (1 : a : b : c) off the surface. With x′ = x, y′ = y − ax, z′ = z −
//! bx, w′ = w − cx the equation is monic in x′. On the line y′ = ηw′, z′ = ζw′ its roots are the
//! values of X/W′ at the n² − e points that Y′ − ηW′ and Z′ − ζW′ have in common besides base
//! points. These points are
//!
//! ```text
//!   s : the roots of the resultant S₀(s)    t = −S₁₀(s)/S₁₁(s) of the first subresultant
//! ```
//!
//! Traces of powers of X/W′ modulo the resultant and Newton's identities give the coefficients on
//! the line, and values on a triangle of pairs (η, ζ) give these as polynomials in η and ζ.

use super::pullback::{Pullback, Residues};
use super::{MapDegrees, MapError};
use crate::compose::interpolate;
use crate::modpoly;
use crate::modular::{Crt, Fp, primes};
use crate::poly::{Exponents, Poly};
use crate::resultant::subresultants_at;
use dashu_int::{IBig, UBig};
use isoform_control::Control;

/// Point (1 : a : b : c) through which lines pass.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Centre([i64; 3]);

/// Points that are tried as centres; at least one of them is off any typical surface of low degree.
const CENTRES: [Centre; 6] = [
    Centre([0, 0, 0]),
    Centre([1, 0, 0]),
    Centre([0, 0, 1]),
    Centre([1, -1, 2]),
    Centre([2, 3, -5]),
    Centre([-7, 5, 11]),
];

impl Centre {
    /// Returns the coordinate a, b or c that belongs to variable 1, 2 or 3, times a sign.
    fn tilt(self, v: usize, sign: i64) -> Poly {
        Poly::constant(sign * self.0[v - 1])
    }
    /// Returns the map in coordinates in which this is the point (1 : 0 : 0 : 0).
    fn moved(self, map: &[Poly; 4]) -> [Poly; 4] {
        std::array::from_fn(|v| match v {
            0 => map[0].clone(),
            _ => &map[v] - &map[0] * self.tilt(v, 1),
        })
    }
    /// Converts an equation in these coordinates to the given ones.
    fn back(self, equation: Poly) -> Poly {
        if self.0 == [0; 3] {
            return equation;
        }
        let moved: [Poly; 4] = std::array::from_fn(|v| match v {
            0 => Poly::var(0),
            _ => Poly::var(v) + Poly::var(0) * self.tilt(v, -1),
        });
        equation.compose(&moved).primitive()
    }
}

/// Returns the equation of a map of degree 2 or more; `None` if the numbers of points differ from
/// the counts.
///
/// The equation has the minimum degree: on some line modulo some prime its roots are distinct, and
/// all of them are roots of every equation.
pub(super) fn equation_by_lines(
    map: &[Poly; 4],
    degrees: &MapDegrees,
    control: &Control<'_>,
) -> Result<Option<Poly>, MapError> {
    for centre in CENTRES {
        if let Some(equation) = equation_about_origin(&centre.moved(map), degrees, control)? {
            return Ok(Some(centre.back(equation)));
        }
    }
    Ok(None)
}

/// Returns the equation by lines through (1 : 0 : 0 : 0), if that is off the surface.
fn equation_about_origin(
    map: &[Poly; 4],
    degrees: &MapDegrees,
    control: &Control<'_>,
) -> Result<Option<Poly>, MapError> {
    let mut crt: Option<Crt> = None;
    let mut last: Option<Poly> = None;
    let mut stream = Residues::new(4);
    let mut failures = 0;
    let mut is_minimal = false;
    for f in primes() {
        let Some(found) = residues_by_lines(&f, map, degrees, &mut stream, control)? else {
            failures += 1;
            if failures > 1 {
                break;
            }
            continue;
        };
        is_minimal |= found.are_roots_distinct;
        let crt = crt.get_or_insert_with(|| Crt::new(found.coefficients.len()));
        crt.push(&f, &found.coefficients);
        let Some((numerators, denominator)) = crt.rational() else {
            continue;
        };
        let candidate = equation_of(degrees.implicit_degree, numerators, denominator);
        if last.as_ref() == Some(&candidate) && is_minimal && candidate.composes_to_zero(map) {
            return Ok(Some(candidate));
        }
        last = Some(candidate);
    }
    Ok(None)
}

/// Returns the primitive equation of degree d with these coefficients over the one of x^d, in the
/// order of [`OnLines`].
fn equation_of(d: usize, numerators: Vec<IBig>, denominator: UBig) -> Poly {
    let places = (1..=d).flat_map(|k| {
        (0..=k).flat_map(move |i| (0..=k - i).map(move |j| [d - k, i, j, k - i - j]))
    });
    let exponents = places.map(|e| e.map(|n| n as u16));
    let mut terms: Vec<(Exponents, IBig)> = vec![([d as u16, 0, 0, 0], denominator.into())];
    terms.extend(exponents.zip(numerators));
    Poly::from_integers(terms, UBig::ONE).primitive()
}

/// Equation that is monic in x, modulo a prime.
struct OnLines {
    /// Coefficients of x^(d−k) yⁱ zʲ w^(k−i−j), k from 1 to d.
    coefficients: Vec<u64>,
    /// True if the roots are distinct on some line.
    are_roots_distinct: bool,
}

fn residues_by_lines(
    f: &Fp,
    map: &[Poly; 4],
    degrees: &MapDegrees,
    stream: &mut Residues,
    control: &Control<'_>,
) -> Result<Option<OnLines>, MapError> {
    let pullback = Pullback::new(f, map, degrees.degree, stream);
    let Some(lines) = LineValues::new(&pullback, degrees, stream) else {
        return Ok(None);
    };
    let d = lines.degree;
    let origin = stream.next(f);
    let rows: Vec<usize> = (0..=d).map(|i| d + 1 - i).collect();
    let mut grids: Vec<Vec<u64>> = vec![Vec::new(); d + 1];
    let mut are_roots_distinct = false;
    for (i, &row) in rows.iter().enumerate() {
        if control.is_stopped() {
            return Err(MapError::Stopped);
        }
        for j in 0..row {
            let line = [i, j].map(|v| f.neg(f.add(origin, f.of_u64(v as u64))));
            let Some(equation) = lines.equation(line) else {
                return Ok(None);
            };
            if !are_roots_distinct {
                let derivative = modpoly::derivative(f, &equation);
                are_roots_distinct = modpoly::gcd(f, &equation, &derivative).len() == 1;
            }
            for (k, grid) in grids.iter_mut().enumerate() {
                grid.push(equation[d - k]);
            }
        }
    }
    let mut coefficients = Vec::new();
    for (k, grid) in grids.iter_mut().enumerate().skip(1) {
        interpolate(f, &rows, grid, origin);
        let mut start = 0;
        for (i, &row) in rows.iter().enumerate().take(k + 1) {
            coefficients.extend_from_slice(&grid[start..=start + k - i]);
            start += row;
        }
    }
    Ok(Some(OnLines {
        coefficients,
        are_roots_distinct,
    }))
}

/// Values shared by all lines through (1 : 0 : 0 : 0).
struct LineValues<'p> {
    pullback: &'p Pullback,
    /// Polynomial in s whose roots are the base points.
    base: Vec<u64>,
    /// Number of preimages of a general point.
    map_degree: usize,
    /// Degree of the equation.
    degree: usize,
    /// X and W as polynomials in t with coefficients in s.
    x: Vec<Vec<u64>>,
    w: Vec<Vec<u64>>,
}

impl<'p> LineValues<'p> {
    /// Computes the values; `None` if the number of base points differs from the count.
    fn new(pullback: &'p Pullback, degrees: &MapDegrees, stream: &mut Residues) -> Option<Self> {
        let base = pullback.base(stream)?;
        (base.len() == degrees.base_multiplicity + 1).then(|| Self {
            pullback,
            base,
            map_degree: degrees.map_degree,
            degree: degrees.implicit_degree,
            x: pullback.in_t(0),
            w: pullback.in_t(3),
        })
    }

    /// Returns the monic polynomial whose roots are the values of X/W at the moving common points
    /// of Y + ηW and Z + ζW, each taken as often as the map degree.
    fn equation(&self, line: [u64; 2]) -> Option<Vec<u64>> {
        let f = &self.pullback.field;
        let (points, t) = self.common_points(line)?;
        let w = points.inverse(&points.value(&self.w, &t))?;
        let element = points.times(&points.value(&self.x, &t), &w);
        let sums = points.power_sums();
        let share = f.inv(f.of_u64(self.map_degree as u64));
        let mut traces = vec![0];
        let mut power = vec![f.one()];
        for _ in 1..=self.degree {
            power = points.times(&power, &element);
            traces.push(f.mul(trace(f, &power, &sums), share));
        }
        Some(self.with_power_sums(&traces))
    }

    /// Returns the moving common points on a line: the ring of functions on them, and t as one of
    /// these.
    fn common_points(&self, [eta, zeta]: [u64; 2]) -> Option<(Functions<'p>, Vec<u64>)> {
        let f = &self.pullback.field;
        let pairs = self
            .pullback
            .planes(&[0, f.one(), 0, eta], &[0, 0, f.one(), zeta])?;
        let mut columns = [Vec::new(), Vec::new(), Vec::new()];
        for (a, b) in &pairs {
            let chain = subresultants_at(f, a, b);
            let at = |j: usize, i: usize| chain[j].get(i).copied().unwrap_or(0);
            for (column, v) in columns.iter_mut().zip([at(0, 0), at(1, 0), at(1, 1)]) {
                column.push(v);
            }
        }
        let [mut resultant, s10, s11] = columns.map(|c| self.pullback.interpolate(&c));
        if resultant.len() != self.pullback.points() + 1 {
            return None;
        }
        let moving = modpoly::div_rem(f, &mut resultant, &self.base);
        if !resultant.is_empty() || moving.len() != self.map_degree * self.degree + 1 {
            return None;
        }
        let points = Functions { f, points: moving };
        let t = points.times(&s10, &points.inverse(&s11)?);
        let t = modpoly::scale(f, &t, f.neg(f.one()));
        Some((points, t))
    }

    /// Returns the monic polynomial with roots of these power sums, by Newton's identities.
    fn with_power_sums(&self, sums: &[u64]) -> Vec<u64> {
        let (f, d) = (&self.pullback.field, self.degree);
        let mut p = vec![0; d + 1];
        p[d] = f.one();
        for k in 1..=d {
            let sum = (1..=k).fold(0, |s, i| f.add(s, f.mul(sums[i], p[d + i - k])));
            p[d - k] = f.neg(f.mul(sum, self.pullback.inverses[k]));
        }
        p
    }
}

/// Ring of functions on the roots of a polynomial in s, as polynomials modulo it.
struct Functions<'f> {
    f: &'f Fp,
    points: Vec<u64>,
}

impl Functions<'_> {
    fn times(&self, a: &[u64], b: &[u64]) -> Vec<u64> {
        modpoly::rem(self.f, modpoly::mul(self.f, a, b), &self.points)
    }

    /// Returns the inverse of a function; `None` if it vanishes at a point.
    fn inverse(&self, a: &[u64]) -> Option<Vec<u64>> {
        let reduced = modpoly::rem(self.f, a.to_vec(), &self.points);
        let (g, u, _) = modpoly::gcd_extended(self.f, &reduced, &self.points);
        (g.len() == 1).then_some(u)
    }

    /// Returns a polynomial in t with coefficients in s, where t is a function.
    fn value(&self, p: &[Vec<u64>], t: &[u64]) -> Vec<u64> {
        p.iter().rev().fold(Vec::new(), |sum: Vec<u64>, c| {
            let next = modpoly::add(self.f, &self.times(&sum, t), c);
            modpoly::rem(self.f, next, &self.points)
        })
    }

    /// Returns the sums of the powers of s over the points, from exponent 0: the traces of the
    /// powers.
    fn power_sums(&self) -> Vec<u64> {
        let f = self.f;
        let top = self.points.len() - 1;
        let monic = modpoly::scale(f, &self.points, f.inv(self.points[top]));
        let mut sums = vec![f.of_u64(top as u64)];
        for k in 1..top {
            let first = f.mul(f.of_u64(k as u64), monic[top - k]);
            let known = (1..k).fold(first, |s, i| f.add(s, f.mul(monic[top - i], sums[k - i])));
            sums.push(f.neg(known));
        }
        sums
    }
}

/// Returns the sum of the values of a function, from the power sums.
fn trace(f: &Fp, function: &[u64], sums: &[u64]) -> u64 {
    let terms = function.iter().zip(sums);
    terms.fold(0, |s, (&a, &b)| f.add(s, f.mul(a, b)))
}
