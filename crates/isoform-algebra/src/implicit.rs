//! Rational maps (s, t) ↦ (X : Y : Z : W) over Q: dimension and degree of the image, degree of the
//! map, implicit equation.
//!
//! A map of degree n whose base points have total multiplicity e satisfies (map degree)·(implicit
//! degree) = n² − e. Both sides are counted on pullbacks of planes modulo primes: two of them meet
//! in the base points and n² − e others; if both contain the image of a point, the common points of
//! two such pairs are the base points and the preimages. Resultants see the multiplicities.
//!
//! The equation of a low degree is the kernel of the matrix of all monomials at as many points,
//! modulo primes, put together by Chinese remainders and rational reconstruction. From degree 5 on
//! it is interpolated from its values on lines, which the same resultants give: the matrix of
//! degree 16 has 969 columns and costs a hundred times more.

use crate::compose::eval_terms;
use crate::modpoly;
use crate::modular::{Crt, Echelon, Fp, primes, residues};
use crate::poly::{Exponents, MAX_VARS, Poly};
use crate::resultant::subresultants_at;
use isoform_control::Control;
use isoform_num::Random;

/// Why a map has no implicit equation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MapError {
    /// All four polynomials are zero.
    #[error("all four polynomials are zero")]
    Zero,
    /// A variable other than the first two occurs.
    #[error("the map has more than two parameters")]
    TooManyVariables,
    /// The four polynomials have a common factor.
    #[error("the four polynomials have the common factor {}", factor.display(&["s", "t"]))]
    CommonFactor {
        /// The greatest common divisor.
        factor: Poly,
    },
    /// The image is not a surface.
    #[error("the image has dimension {dimension}: not a surface")]
    NotASurface {
        /// 0 for a point, 1 for a curve.
        dimension: usize,
    },
    /// Counts at random points did not agree, which no map is known to cause.
    #[error("the degrees could not be counted: no two of {COUNTS} counts at random points agree")]
    Undecided,
    /// The work was cancelled, or its deadline is over.
    #[error("stopped")]
    Stopped,
}

/// Counts of degrees before giving up; two suffice unless a point is not general.
const COUNTS: usize = 64;

/// Degrees of a rational map onto a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapDegrees {
    /// The largest total degree of the four polynomials, n.
    pub degree: usize,
    /// Number of preimages, complex ones included, of a general point of the image.
    pub map_degree: usize,
    /// Degree of the implicit equation.
    pub implicit_degree: usize,
    /// The base points' multiplicities added up, points at infinity included: n² − map degree ·
    /// implicit degree.
    pub base_multiplicity: usize,
}

/// The implicit equation of a rational map onto a surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Implicit {
    /// A primitive form in x, y, z, w (variables 0 … 3) that is irreducible over Q.
    pub equation: Poly,
    /// Degrees of the map; the implicit degree is that of the equation.
    pub degrees: MapDegrees,
}

/// Bound on the implicit degree of [`implicit`] that is advised: 969 monomials.
pub const DEFAULT_MAX_DEGREE: usize = 16;

/// The dimension of the closure of the image of (s, t) ↦ (X : Y : Z : W): 0, 1 or 2. Proven: a
/// lower bound by the rank of the cone's Jacobian at points modulo a prime, an upper bound by
/// minors that vanish identically.
///
/// # Errors
/// [`MapError::Zero`], [`MapError::TooManyVariables`].
pub fn image_dimension(map: &[Poly; 4]) -> Result<usize, MapError> {
    validate(map)?;
    let columns: Vec<[Poly; 4]> = vec![
        map.clone(),
        map.clone().map(|p| p.derivative(0)),
        map.clone().map(|p| p.derivative(1)),
    ];
    let mut rank = 0;
    let mut stream = Residues::new(1);
    for field in primes().take(3) {
        let at = [stream.next(&field), stream.next(&field), field.one()];
        let mut echelon = Echelon::new(4);
        for column in &columns {
            let row = column
                .iter()
                .map(|p| eval_at(&field, &residues(&field, p), &at))
                .collect();
            echelon.insert(&field, row);
        }
        rank = rank.max(echelon.rank());
        if rank == 3 {
            return Ok(2);
        }
    }
    // The rank over Q(s, t) from minors, exact.
    let two = |c: [usize; 2], r: [usize; 2]| {
        &columns[c[0]][r[0]] * &columns[c[1]][r[1]] - &columns[c[0]][r[1]] * &columns[c[1]][r[0]]
    };
    let three = |skip: usize| {
        let r: Vec<usize> = (0..4).filter(|&i| i != skip).collect();
        (0..3).fold(Poly::zero(), |sum, i| {
            let term = &columns[0][r[i]] * two([1, 2], [r[(i + 1) % 3], r[(i + 2) % 3]]);
            sum + term
        })
    };
    if (0..4).any(|skip| !three(skip).is_zero()) {
        return Ok(2);
    }
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let curve = [[0, 1], [0, 2], [1, 2]]
        .into_iter()
        .any(|c| pairs.into_iter().any(|r| !two(c, r).is_zero()));
    Ok(usize::from(curve))
}

/// The degrees of a map onto a surface, counted at random points modulo primes until two counts
/// agree. A count is wrong only if a point is not general, which has a probability of about n⁴/2⁶²
/// each time; [`implicit`] proves the implicit degree.
///
/// # Errors
/// [`MapError`].
pub fn map_degrees(map: &[Poly; 4], control: &Control<'_>) -> Result<MapDegrees, MapError> {
    let degree = validate(map)?;
    let factor = map.iter().fold(Poly::zero(), |g, p| g.gcd(p));
    if !factor.is_constant() {
        return Err(MapError::CommonFactor { factor });
    }
    let dimension = image_dimension(map)?;
    if dimension < 2 {
        return Err(MapError::NotASurface { dimension });
    }
    let mut last = None;
    let mut stream = Residues::new(2);
    for field in primes().take(COUNTS) {
        if control.is_stopped() {
            return Err(MapError::Stopped);
        }
        let count = count_degrees(&field, map, degree, &mut stream);
        if let (Some(degrees), true) = (count, count == last) {
            return Ok(degrees);
        }
        last = count;
    }
    Err(MapError::Undecided)
}

/// The implicit equation of a map onto a surface, or nothing if its degree exceeds the bound.
///
/// Proven: the equation vanishes on the map (modulo enough primes for a bound on the coefficients),
/// and it is irreducible over Q and of the least degree: the matrix modulo a prime leaves one form
/// only of its degree, or a line meets the image in as many points.
///
/// ```
/// use isoform_algebra::{Poly, implicit};
/// use isoform_control::Control;
/// let map = ["2*s", "2*t", "1 - s^2 - t^2", "1 + s^2 + t^2"].map(|text| Poly::parse(text, &["s", "t"]).expect(text));
/// let found = implicit(&map, 16, &Control::default()).expect("a surface").expect("of low degree");
/// assert_eq!(found.equation.to_string(), "x^2 + y^2 + z^2 - w^2");
/// ```
///
/// # Errors
/// [`MapError`].
pub fn implicit(
    map: &[Poly; 4],
    max_degree: usize,
    control: &Control<'_>,
) -> Result<Option<Implicit>, MapError> {
    let mut degrees = map_degrees(map, control)?;
    let mut degree = degrees.implicit_degree;
    loop {
        if degree > max_degree {
            return Ok(None);
        }
        if degree >= LINES_FROM
            && degree == degrees.implicit_degree
            && let Some(equation) = equation_by_lines(map, &degrees, control)?
        {
            return Ok(Some(Implicit { equation, degrees }));
        }
        match equation_of_degree(map, degree, control)? {
            Kernel::One(equation) => {
                degrees.implicit_degree = degree;
                return Ok(Some(Implicit { equation, degrees }));
            }
            // Only after a wrong count.
            Kernel::None => degree += 1,
            Kernel::More => degree -= 1,
        }
    }
}

/// Implicit degree from which lines are faster than the matrix of all monomials (measured).
const LINES_FROM: usize = 5;

/// The degree of the map.
fn validate(map: &[Poly; 4]) -> Result<usize, MapError> {
    if map.iter().any(|p| p.degree(2) + p.degree(3) > 0) {
        return Err(MapError::TooManyVariables);
    }
    if map.iter().all(Poly::is_zero) {
        return Err(MapError::Zero);
    }
    Ok(map.iter().map(Poly::total_degree).max().unwrap_or(0))
}

/// Pseudo-random residues modulo varying primes.
struct Residues(Random);

impl Residues {
    fn new(seed: u64) -> Self {
        Self(Random::xorshift(seed))
    }
    fn next(&mut self, f: &Fp) -> u64 {
        f.of_u64(self.0.bits())
    }
}

fn eval_at(f: &Fp, terms: &[(Exponents, u64)], at: &[u64; 3]) -> u64 {
    let tables: [Vec<u64>; MAX_VARS] = std::array::from_fn(|v| {
        let degree = terms
            .iter()
            .map(|(e, _)| usize::from(e[v]))
            .max()
            .unwrap_or(0);
        let mut table = vec![f.one(); degree + 1];
        for k in 1..=degree {
            table[k] = f.mul(table[k - 1], at[v]);
        }
        table
    });
    eval_terms(f, terms, &tables)
}

/// A map modulo a prime in a random frame of the parameter plane: no base point at infinity, no two
/// on a vertical line.
struct Pullback {
    field: Fp,
    n: usize,
    frame: [[u64; 3]; 3],
    forms: Vec<Vec<(Exponents, u64)>>,
    nodes: Vec<usize>,
    inverses: Vec<u64>,
    /// The four forms on the lines s = 0 … n² as polynomials in t.
    lines: Vec<[Vec<u64>; 4]>,
}

impl Pullback {
    fn new(f: &Fp, map: &[Poly; 4], n: usize, stream: &mut Residues) -> Self {
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
        for &s in &pullback.nodes {
            let values: Vec<[u64; 4]> = (0..=n)
                .map(|t| pullback.image(f.of_u64(s as u64), f.of_u64(t as u64)))
                .collect();
            let line = std::array::from_fn(|i| {
                let column: Vec<u64> = values.iter().map(|v| v[i]).collect();
                modpoly::interpolate(f, &pullback.nodes[..=n], &column, &pullback.inverses)
            });
            pullback.lines.push(line);
        }
        pullback
    }
    fn image(&self, s: u64, t: u64) -> [u64; 4] {
        let f = &self.field;
        let point = self
            .frame
            .map(|r| f.add(f.add(f.mul(r[0], s), f.mul(r[1], t)), r[2]));
        std::array::from_fn(|i| eval_at(f, &self.forms[i], &point))
    }
    /// The pullbacks of two planes on every line, if they keep their degrees.
    fn planes(&self, a: &[u64; 4], b: &[u64; 4]) -> Option<Vec<(Vec<u64>, Vec<u64>)>> {
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
    fn interpolate(&self, values: &[u64]) -> Vec<u64> {
        modpoly::interpolate(
            &self.field,
            &self.nodes[..values.len()],
            values,
            &self.inverses,
        )
    }
    /// The resultant of the pullbacks of two planes: s of the common points, with multiplicities.
    fn meet(&self, a: &[u64; 4], b: &[u64; 4]) -> Option<Vec<u64>> {
        let values: Vec<u64> = self
            .planes(a, b)?
            .iter()
            .map(|(a, b)| modpoly::resultant(&self.field, a, b))
            .collect();
        let r = self.interpolate(&values);
        (r.len() == self.nodes.len()).then_some(r)
    }
    /// The base points' s with multiplicities, from two general pairs of planes.
    fn base(&self, stream: &mut Residues) -> Option<Vec<u64>> {
        let [a, b, c, d] = [(); 4].map(|()| [(); 4].map(|()| stream.next(&self.field)));
        Some(modpoly::gcd(
            &self.field,
            &self.meet(&a, &b)?,
            &self.meet(&c, &d)?,
        ))
    }
}

/// One count of all degrees modulo a prime.
fn count_degrees(f: &Fp, map: &[Poly; 4], n: usize, stream: &mut Residues) -> Option<MapDegrees> {
    let pullback = Pullback::new(f, map, n, stream);
    let base_multiplicity = pullback.base(stream)?.len() - 1;
    // Planes through the image of a point: one coefficient is solved for.
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

/// The equation of a map of degree 2 or more by its values on lines through a point (1 : a : b : c)
/// off the surface.
///
/// With x′ = x, y′ = y − ax, z′ = z − bx, w′ = w − cx the equation is monic in x′. On the line y′ =
/// ηw′, z′ = ζw′ its roots are the values of X/W′ at the n² − e points that Y′ − ηW′ and Z′ − ζW′
/// have in common besides base points. These are s of the resultant and t = −S₁₀/S₁₁ of the first
/// subresultant; traces of powers of X/W′ modulo the resultant and Newton's identities give the
/// coefficients, and values on a triangle of pairs (η, ζ) give these as polynomials.
///
/// Nothing where the numbers of points are not as counted. The equation is of the least degree: on
/// some line modulo some prime its roots are distinct, and all of them are roots of every equation.
fn equation_by_lines(
    map: &[Poly; 4],
    degrees: &MapDegrees,
    control: &Control<'_>,
) -> Result<Option<Poly>, MapError> {
    /// Points off which a surface lies; one of them is off any surface of low degree that people
    /// write.
    const CENTRES: [[i64; 3]; 6] = [
        [0, 0, 0],
        [1, 0, 0],
        [0, 0, 1],
        [1, -1, 2],
        [2, 3, -5],
        [-7, 5, 11],
    ];
    for centre in CENTRES {
        let tilted = |v: usize, sign: i64| Poly::constant(sign * centre[v - 1]);
        let moved: [Poly; 4] = std::array::from_fn(|v| {
            if v == 0 {
                map[0].clone()
            } else {
                &map[v] - &map[0] * tilted(v, 1)
            }
        });
        let d = degrees.implicit_degree;
        let mut crt: Option<Crt> = None;
        let mut last: Option<Poly> = None;
        let mut stream = Residues::new(4);
        let mut failures = 0;
        let mut minimal = false;
        for f in primes() {
            let Some((coefficients, distinct)) =
                residues_by_lines(&f, &moved, degrees, &mut stream, control)?
            else {
                failures += 1;
                if failures > 1 {
                    break;
                }
                continue;
            };
            minimal |= distinct;
            let crt = crt.get_or_insert_with(|| Crt::new(coefficients.len()));
            crt.push(&f, &coefficients);
            let Some((numerators, denominator)) = crt.rational() else {
                continue;
            };
            let mut terms = vec![([d as u16, 0, 0, 0], denominator.into())];
            let places = (1..=d).flat_map(|k| {
                (0..=k).flat_map(move |i| (0..=k - i).map(move |j| [d - k, i, j, k - i - j]))
            });
            terms.extend(places.map(|e| e.map(|n| n as u16)).zip(numerators));
            let candidate = Poly::from_integers(terms, dashu_int::UBig::ONE).primitive();
            if last.as_ref() == Some(&candidate) && minimal && candidate.composes_to_zero(&moved) {
                let back: [Poly; 4] = std::array::from_fn(|v| {
                    if v == 0 {
                        Poly::var(0)
                    } else {
                        Poly::var(v) + Poly::var(0) * tilted(v, -1)
                    }
                });
                return Ok(Some(if centre == [0; 3] {
                    candidate
                } else {
                    candidate.compose(&back).primitive()
                }));
            }
            last = Some(candidate);
        }
    }
    Ok(None)
}

/// Coefficients of x^(d−k) yⁱ zʲ w^(k−i−j), k from 1 to d, of the equation monic in x modulo a
/// prime, and whether its roots on some line are distinct.
fn residues_by_lines(
    f: &Fp,
    map: &[Poly; 4],
    degrees: &MapDegrees,
    stream: &mut Residues,
    control: &Control<'_>,
) -> Result<Option<(Vec<u64>, bool)>, MapError> {
    let (n, d) = (degrees.degree, degrees.implicit_degree);
    let pullback = Pullback::new(f, map, n, stream);
    let Some(base) = pullback
        .base(stream)
        .filter(|b| b.len() == degrees.base_multiplicity + 1)
    else {
        return Ok(None);
    };
    // X and W as polynomials in t with coefficients in s.
    let in_t = |i: usize| -> Vec<Vec<u64>> {
        let coefficient = |line: &[Vec<u64>; 4], j: usize| line[i].get(j).copied().unwrap_or(0);
        (0..=n)
            .map(|j| {
                pullback.interpolate(
                    &pullback.lines[..=n]
                        .iter()
                        .map(|l| coefficient(l, j))
                        .collect::<Vec<_>>(),
                )
            })
            .collect()
    };
    let (x, w) = (in_t(0), in_t(3));
    let origin = stream.next(f);
    let rows: Vec<usize> = (0..=d).map(|i| d + 1 - i).collect();
    let mut grids: Vec<Vec<u64>> = vec![Vec::new(); d + 1];
    let mut distinct = false;
    for (i, &row) in rows.iter().enumerate() {
        if control.is_stopped() {
            return Err(MapError::Stopped);
        }
        for j in 0..row {
            let [eta, zeta] = [i, j].map(|v| f.neg(f.add(origin, f.of_u64(v as u64))));
            let Some(line) = equation_on_line(
                &pullback,
                &base,
                degrees.map_degree,
                d,
                (&x, &w),
                (eta, zeta),
            ) else {
                return Ok(None);
            };
            if !distinct {
                let derivative = modpoly::derivative(f, &line);
                distinct = modpoly::gcd(f, &line, &derivative).len() == 1;
            }
            for (k, grid) in grids.iter_mut().enumerate() {
                grid.push(line[d - k]);
            }
        }
    }
    let mut coefficients = Vec::new();
    for (k, grid) in grids.iter_mut().enumerate().skip(1) {
        crate::compose::interpolate(f, &rows, grid, origin);
        let mut start = 0;
        for (i, &row) in rows.iter().enumerate().take(k + 1) {
            coefficients.extend_from_slice(&grid[start..=start + k - i]);
            start += row;
        }
    }
    Ok(Some((coefficients, distinct)))
}

/// The monic polynomial of degree d whose m-th power has the values of X/W at the moving common
/// points of Y + ηW and Z + ζW as roots.
fn equation_on_line(
    pullback: &Pullback,
    base: &[u64],
    m: usize,
    d: usize,
    (x, w): (&[Vec<u64>], &[Vec<u64>]),
    (eta, zeta): (u64, u64),
) -> Option<Vec<u64>> {
    let f = &pullback.field;
    let pairs = pullback.planes(&[0, f.one(), 0, eta], &[0, 0, f.one(), zeta])?;
    let mut columns = [Vec::new(), Vec::new(), Vec::new()];
    for (a, b) in &pairs {
        let chain = subresultants_at(f, a, b);
        let at = |j: usize, i: usize| chain[j].get(i).copied().unwrap_or(0);
        for (column, v) in columns.iter_mut().zip([at(0, 0), at(1, 0), at(1, 1)]) {
            column.push(v);
        }
    }
    let [mut resultant, s10, s11] = columns.map(|c| pullback.interpolate(&c));
    if resultant.len() != pullback.nodes.len() {
        return None;
    }
    let moving = modpoly::div_rem(f, &mut resultant, base);
    if !resultant.is_empty() || moving.len() != m * d + 1 {
        return None;
    }
    let times = |a: &[u64], b: &[u64]| modpoly::rem(f, modpoly::mul(f, a, b), &moving);
    let inverse = |a: &[u64]| {
        let (g, u, _) = modpoly::gcd_extended(f, &modpoly::rem(f, a.to_vec(), &moving), &moving);
        (g.len() == 1).then_some(u)
    };
    let t = modpoly::scale(f, &times(&s10, &inverse(&s11)?), f.neg(f.one()));
    let at_points = |p: &[Vec<u64>]| {
        p.iter().rev().fold(Vec::new(), |sum: Vec<u64>, c| {
            modpoly::rem(f, modpoly::add(f, &times(&sum, &t), c), &moving)
        })
    };
    let element = times(&at_points(x), &inverse(&at_points(w))?);
    // Power sums of the roots s, which are the traces of the powers of s.
    let inverse_lead = f.inv(moving[m * d]);
    let monic = modpoly::scale(f, &moving, inverse_lead);
    let top = m * d;
    let mut sums = vec![f.of_u64(top as u64)];
    for k in 1..top {
        let known = (1..k).fold(f.mul(f.of_u64(k as u64), monic[top - k]), |s, i| {
            f.add(s, f.mul(monic[top - i], sums[k - i]))
        });
        sums.push(f.neg(known));
    }
    let trace = |p: &[u64]| {
        p.iter()
            .zip(&sums)
            .fold(0, |s, (&a, &b)| f.add(s, f.mul(a, b)))
    };
    let share = f.inv(f.of_u64(m as u64));
    let mut traces = vec![0];
    let mut power = vec![f.one()];
    for _ in 1..=d {
        power = times(&power, &element);
        traces.push(f.mul(trace(&power), share));
    }
    let mut line = vec![0; d + 1];
    line[d] = f.one();
    for k in 1..=d {
        let sum = (1..=k).fold(0, |s, i| f.add(s, f.mul(traces[i], line[d + i - k])));
        line[d - k] = f.neg(f.mul(sum, pullback.inverses[k]));
    }
    Some(line)
}

/// Forms of a degree that vanish on a map.
enum Kernel {
    None,
    One(Poly),
    More,
}

/// Rows beyond the number of columns: the kernel must not shrink by them.
const EXTRA_ROWS: usize = 2;

fn equation_of_degree(
    map: &[Poly; 4],
    degree: usize,
    control: &Control<'_>,
) -> Result<Kernel, MapError> {
    let d = degree as u16;
    let all: Vec<Exponents> = (0..=d)
        .flat_map(|i| {
            (0..=d - i).flat_map(move |j| (0..=d - i - j).map(move |k| [i, j, k, d - i - j - k]))
        })
        .collect();
    let mut support = all;
    let mut free = None;
    let mut crt: Option<Crt> = None;
    let mut last: Option<Poly> = None;
    let mut stream = Residues::new(3);
    for f in primes() {
        let forms: Vec<Vec<(Exponents, u64)>> = map.iter().map(|p| residues(&f, p)).collect();
        let mut echelon = Echelon::new(support.len());
        for _ in 0..support.len() + EXTRA_ROWS {
            if control.is_stopped() {
                return Err(MapError::Stopped);
            }
            let at = [stream.next(&f), stream.next(&f), f.one()];
            let values: [u64; 4] = std::array::from_fn(|i| eval_at(&f, &forms[i], &at));
            let powers = values.map(|x| {
                let mut table = vec![f.one(); degree + 1];
                for k in 1..=degree {
                    table[k] = f.mul(table[k - 1], x);
                }
                table
            });
            let row = support
                .iter()
                .map(|e| (0..4).fold(f.one(), |m, v| f.mul(m, powers[v][usize::from(e[v])])))
                .collect();
            echelon.insert(&f, row);
        }
        let Some((column, vector)) = echelon.kernel(&f) else {
            if crt.is_none() {
                return Ok(if echelon.rank() == support.len() {
                    Kernel::None
                } else {
                    Kernel::More
                });
            }
            // A prime that divides something it should not.
            continue;
        };
        let vector = match free {
            None => {
                // From here on only monomials that occur: sparse equations are cheap modulo the
                // further primes.
                let occurring: Vec<usize> = (0..vector.len()).filter(|&i| vector[i] != 0).collect();
                free = occurring.iter().position(|&i| i == column);
                support = occurring.iter().map(|&i| support[i]).collect();
                occurring.into_iter().map(|i| vector[i]).collect()
            }
            Some(known) if vector[known] != 0 => {
                let scale = f.inv(vector[known]);
                modpoly::scale(&f, &vector, scale)
            }
            Some(_) => continue,
        };
        let crt = crt.get_or_insert_with(|| Crt::new(vector.len()));
        crt.push(&f, &vector);
        let Some((numerators, _)) = crt.rational() else {
            continue;
        };
        let candidate = Poly::from_integers(
            support.iter().copied().zip(numerators),
            dashu_int::UBig::ONE,
        )
        .primitive();
        if last.as_ref() == Some(&candidate) && candidate.composes_to_zero(map) {
            return Ok(Kernel::One(candidate));
        }
        last = Some(candidate);
    }
    unreachable!("there are enough primes below 2^62")
}
