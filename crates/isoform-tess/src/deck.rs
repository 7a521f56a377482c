//! Improper maps: their deck transformations, and a part of the plane that has one of all
//! parameters that these exchange.
//!
//! A deck transformation of φ is a birational map σ of the parameter plane with φ∘σ = φ. Those with
//! rational coefficients take a general rational point to a rational point of its fibre, one for
//! each such point at most. From there σ is continued as a power series along lines, by Newton's
//! method modulo primes; forms of the least degree that agree with all series come from a linear
//! system, by Chinese remainders and rational reconstruction. φ∘σ = φ proves them.
//!
//! With a rational function r = l/m of the parameters that no σ leaves as it is, the points with
//! r > r∘σ for every σ are a fundamental domain. Its border consists of curves on which r = r∘σ,
//! or r or r∘σ has a pole. σ takes it to itself: the surface goes on there, or it is a fold, a
//! curve all of whose points stay where they are.

use crate::base::BasePoint;
use crate::field::{Algebraic, exact, vanishes};
use crate::map::Map;
use crate::zeros::common_zeros;
use isoform_algebra::modular::{Crt, Echelon, Fp, primes, residues};
use isoform_algebra::{Exponents, FactorError, Poly, RBig};
use isoform_control::{Control, Stopped};
use isoform_geom::{cross, norm};
use std::collections::{BTreeMap, BTreeSet};

/// Largest degree of the forms of a deck transformation that is looked for. Those of maps that
/// people write have degree 1 or 2; the next degree costs twice the time of all before.
const MOST: usize = 4;
/// Lines through a point along which a transformation is continued, and terms of each power series:
/// three forms of degree n have 3(n + 1) coefficients on a line, of which each term settles two;
/// n + 1 lines settle all. More of them refute forms that only happen to agree.
const LINES: usize = MOST + 3;
const TERMS: usize = 2 * MOST + 4;
/// Primes of 62 bits at most: a transformation has coefficients of some ten digits.
const PRIMES: usize = 12;

/// Linear forms of whose products quadratic ones are made: 78 of them, and 6000 quotients, take a
/// fraction of a second.
const SQUARED: usize = 12;
/// Quotients of quadratic forms among which the best one is taken.
const ENOUGH: usize = 5;
/// Sines of angles between points (s : t : w) as vectors that are taken for one another: partners
/// on a border are found to some ten digits, half of them next to folds; what has one image by
/// chance is farther apart.
const NEAR: f64 = 1e-5;

/// Three forms in (s, t, w), of one degree and without a common factor.
type Transformation = [Poly; 3];
type Point = [RBig; 3];

/// The deck transformations of a map, and a fundamental domain.
#[derive(Clone, Debug)]
pub(crate) struct Deck {
    /// All but the identity.
    transformations: Vec<Transformation>,
    /// l and m, whose quotient is compared.
    ratio: [Poly; 2],
    /// The border of the fundamental domain, but folds.
    pub(crate) seams: Border,
    /// Curves all of whose points a transformation leaves where they are.
    pub(crate) folds: Border,
    /// Which real base points a transformation leaves where they are, and all lines through them:
    /// the curves that they are blown up to are folds.
    pub(crate) folded: BTreeSet<usize>,
}

/// Irreducible curves.
#[derive(Clone, Debug, Default)]
pub(crate) struct Border {
    /// All but s = 0, t = 0 and w = 0.
    pub(crate) curves: Vec<Poly>,
    /// Which of these three belong to it.
    pub(crate) sides: [bool; 3],
}

impl Border {
    fn new(all: impl IntoIterator<Item = Poly>) -> Self {
        let mut border = Self::default();
        for curve in all {
            match (0..3).find(|&k| curve.is_associate(&Poly::var(k))) {
                Some(side) => border.sides[side] = true,
                None => border.curves.push(curve),
            }
        }
        border
    }
    /// The sum of the degrees.
    fn degree(&self) -> usize {
        let sides = self.sides.iter().filter(|s| **s).count();
        sides + self.curves.iter().map(Poly::total_degree).sum::<usize>()
    }
}

impl Deck {
    /// Nothing, if there is no transformation but the identity among those that are looked for, or
    /// no fundamental domain of which no real base point is blown up to a part of the border.
    pub(crate) fn new(
        map: &Map,
        base_points: &[BasePoint],
        control: &Control<'_>,
    ) -> Result<Option<Self>, Stopped> {
        let transformations = transformations(map, control)?;
        if transformations.is_empty() {
            return Ok(None);
        }
        let is_folded = |p: &[Algebraic; 3]| transformations.iter().any(|t| keeps_lines(t, p));
        let folded = (0..base_points.len()).filter(|&k| is_folded(&base_points[k].point));
        let deck = Self {
            folded: folded.collect(),
            transformations,
            ratio: Default::default(),
            seams: Border::default(),
            folds: Border::default(),
        };
        let around: Vec<Vec<[Point; 2]>> = (0..base_points.len())
            .filter(|k| !deck.folded.contains(k))
            .map(|k| across(&base_points[k].point))
            .collect();
        let lines = linear_forms(base_points);
        // Quadratic forms where linear ones do not serve, as where all base points are on a fold.
        let squares: Vec<Poly> = (0..lines.len().min(SQUARED))
            .flat_map(|i| (0..=i).map(move |j| [i, j]))
            .map(|[i, j]| &lines[i] * &lines[j])
            .collect();
        for (forms, most) in [(lines, usize::MAX), (squares, ENOUGH)] {
            let found = deck.least(&forms, &around, most, control)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }
    /// With the quotient of two forms that has the border of least degree, of the first so many
    /// that no base point is blown up to a part of.
    fn least(
        &self,
        forms: &[Poly],
        around: &[Vec<[Point; 2]>],
        most: usize,
        control: &Control<'_>,
    ) -> Result<Option<Self>, Stopped> {
        let mut best: Option<(usize, Self)> = None;
        let mut count = 0;
        let mut deck = self.clone();
        for (m, l) in (0..forms.len()).flat_map(|m| (0..forms.len()).map(move |l| (m, l))) {
            control.check()?;
            if m == l || count == most {
                continue;
            }
            deck.ratio = [forms[l].clone(), forms[m].clone()];
            let is_split = |[p, q]: &[Point; 2]| deck.holds(p) != deck.holds(q);
            if around.iter().flatten().any(is_split) {
                continue;
            }
            let [l, m] = &deck.ratio;
            let Some([seams, folds]) = border(&deck.transformations, [l, m], control)? else {
                continue;
            };
            count += 1;
            let degree = seams.degree() + folds.degree();
            if best.as_ref().is_none_or(|b| degree < b.0) {
                (deck.seams, deck.folds) = (seams, folds);
                best = Some((degree, deck.clone()));
            }
        }
        Ok(best.map(|b| b.1))
    }
    /// How many parameters are exchanged.
    pub(crate) fn order(&self) -> usize {
        self.transformations.len() + 1
    }
    /// Where the transformations take a point (s : t : w); nothing for one that has no value there.
    pub(crate) fn others(&self, p: [f64; 3]) -> impl Iterator<Item = Option<[f64; 3]>> {
        self.transformations.iter().map(move |t| image(t, p))
    }
    /// Whether a transformation takes one of two points (s : t : w) near to the other one, or has
    /// no value at both.
    pub(crate) fn may_exchange(&self, p: [f64; 3], q: [f64; 3]) -> bool {
        let is_near = |a, b| norm(cross(a, b)) <= NEAR * norm(a) * norm(b);
        self.transformations
            .iter()
            .any(|t| match (image(t, p), image(t, q)) {
                (Some(other), _) => is_near(other, q),
                (None, Some(other)) => is_near(other, p),
                (None, None) => true,
            })
    }
    /// Whether a point (s : t : w) that is on no curve of the border is in the fundamental domain.
    pub(crate) fn holds(&self, p: &Point) -> bool {
        let value = |p: &Point| {
            let [l, m] = self.ratio.each_ref().map(|f| f.eval(p));
            (!m.is_zero()).then(|| l / m)
        };
        let own = value(p);
        self.transformations.iter().all(|t| {
            let other = value(&t.each_ref().map(|f| f.eval(p)));
            matches!((&own, &other), (Some(a), Some(b)) if a > b)
        })
    }
}

/// Linear forms, also of lines through rational base points.
fn linear_forms(base_points: &[BasePoint]) -> Vec<Poly> {
    /// Simple ones, and some in no special place.
    const LINEAR: [[i64; 3]; 9] = [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 2, 0],
        [2, -1, 0],
        [1, 0, -2],
        [0, 1, 3],
        [1, 3, -2],
        [3, -2, 7],
    ];
    /// Directions of lines through rational base points.
    const THROUGH: [[i64; 3]; 3] = [[1, 2, -1], [3, -1, 2], [-2, 1, 5]];
    let mut forms: Vec<[RBig; 3]> = LINEAR.map(|c| c.map(RBig::from)).to_vec();
    for p in base_points {
        if let [Some(s), Some(t), Some(w)] = p.point.each_ref().map(Algebraic::as_rational) {
            let line = |d: [i64; 3]| {
                let [a, b, c] = d.map(RBig::from);
                [&b * &w - &c * &t, &c * &s - &a * &w, &a * &t - &b * &s]
            };
            forms.extend(THROUGH.map(line));
        }
    }
    forms.iter().map(linear).collect()
}

/// The linear form with coefficients of s, t and w.
pub(crate) fn linear(c: &[RBig; 3]) -> Poly {
    (0..3).fold(Poly::zero(), |sum, v| sum + Poly::var(v).scale(&c[v]))
}

/// l m∘σ − m l∘σ, m and m∘σ: where r − r∘σ may change its sign.
fn comparison(t: &Transformation, [l, m]: [&Poly; 2]) -> [Poly; 3] {
    let [moved_l, moved_m] = [l, m].map(|f| f.compose(t));
    [l * &moved_m - m * &moved_l, m.clone(), moved_m]
}

/// Pairs of points on both hands of the curve that a base point is blown up to, in several
/// directions.
fn across(p: &[Algebraic; 3]) -> Vec<[Point; 2]> {
    /// How far from the base point: farther than it is rounded, nearer than other curves, or else
    /// a domain is passed over.
    const STEP: f64 = 1e-5;
    const DIRECTIONS: usize = 12;
    let at = p.each_ref().map(Algebraic::to_f64);
    // The plane that the largest coordinate is 1 in.
    let largest = (0..3)
        .max_by(|&i, &j| at[i].abs().total_cmp(&at[j].abs()))
        .unwrap_or(0);
    let step = |angle: f64, sign: f64| {
        let (sin, cos) = angle.sin_cos();
        let mut d = [cos, sin].into_iter();
        let moved = |i: usize| match i == largest {
            true => 1.0,
            false => {
                let d = d.next().expect("two coordinates beside the largest one");
                at[i] / at[largest] + sign * STEP * d
            }
        };
        [0, 1, 2].map(moved).map(exact)
    };
    let angle = |k: usize| (k as f64 + 0.37) * std::f64::consts::PI / DIRECTIONS as f64;
    (0..DIRECTIONS)
        .map(|k| [1.0, -1.0].map(|sign| step(angle(k), sign)))
        .collect()
}

/// Whether a transformation leaves a point where it is, and all lines through it: its derivative
/// there is a multiple of the identity.
fn keeps_lines(t: &Transformation, p: &[Algebraic; 3]) -> bool {
    let Some(one) = (0..3).find(|&k| !p[k].is_zero()) else {
        return false;
    };
    let [i, j] = [(one + 1) % 3, (one + 2) % 3];
    let is_kept = |k: usize| vanishes(&(&t[k] * Poly::var(one) - &t[one] * Poly::var(k)), p);
    if vanishes(&t[one], p) || !is_kept(i) || !is_kept(j) {
        return false;
    }
    // Of the quotients of two forms, but for a common factor.
    let slope = |k: usize, by: usize| t[k].derivative(by) * &t[one] - &t[k] * t[one].derivative(by);
    [slope(i, j), slope(j, i), slope(i, i) - slope(j, j)]
        .iter()
        .all(|f| vanishes(f, p))
}

/// The irreducible curves across which r > r∘σ turns into r < r∘σ for one of the transformations,
/// and those of them that are folds; nothing if r = r∘σ everywhere.
fn border(
    transformations: &[Transformation],
    ratio: [&Poly; 2],
    control: &Control<'_>,
) -> Result<Option<[Border; 2]>, Stopped> {
    let mut curves: BTreeMap<_, (Poly, bool)> = BTreeMap::new();
    for t in transformations {
        control.check()?;
        let parts = comparison(t, ratio);
        if parts[0].is_zero() {
            return Ok(None);
        }
        let mut orders: Vec<(Poly, usize)> = Vec::new();
        for form in parts {
            for (f, n) in form.factor(control).map_err(FactorError::only_stopped)? {
                match orders.iter_mut().find(|o| o.0 == f) {
                    Some(known) => known.1 += n,
                    None => orders.push((f, n)),
                }
            }
        }
        for (f, _) in orders.into_iter().filter(|o| o.1 % 2 == 1) {
            let is_fold = is_fixed(t, &f);
            let known = curves
                .entry((f.total_degree(), f.terms().to_vec()))
                .or_insert((f, false));
            known.1 |= is_fold;
        }
    }
    let (folds, seams): (Vec<_>, Vec<_>) = curves.into_values().partition(|c| c.1);
    Ok(Some(
        [seams, folds].map(|list| Border::new(list.into_iter().map(|c| c.0))),
    ))
}

/// Whether a transformation leaves all points of a curve where they are.
fn is_fixed(t: &Transformation, curve: &Poly) -> bool {
    [[0, 1], [1, 2], [2, 0]]
        .into_iter()
        .all(|[i, j]| (&t[i] * Poly::var(j) - &t[j] * Poly::var(i)).is_multiple_of(curve))
}

/// Where a transformation takes a point, if it has a value there.
fn image(t: &Transformation, p: [f64; 3]) -> Option<[f64; 3]> {
    let at = t.each_ref().map(|form| value(form, p));
    let is_lost = at.iter().all(|(x, size)| x.abs() <= NEAR * size);
    (!is_lost).then(|| at.map(|x| x.0))
}

/// The value of a form, and the sum of the sizes of its terms.
pub(crate) fn value(form: &Poly, p: [f64; 3]) -> (f64, f64) {
    let term = |e: &[u16; 4]| (0..3).map(|v| p[v].powi(i32::from(e[v]))).product::<f64>();
    let terms = form.to_f64();
    let add = |(sum, size): (f64, f64), x: f64| (sum + x, size + x.abs());
    terms.iter().map(|(e, c)| c * term(e)).fold((0.0, 0.0), add)
}

/// The deck transformations with rational coefficients, but the identity.
fn transformations(map: &Map, control: &Control<'_>) -> Result<Vec<Transformation>, Stopped> {
    /// Rational points, in no special place of maps that people write.
    const POINTS: [[i64; 2]; 6] = [[2, 3], [-3, 5], [5, -7], [7, 4], [-11, 6], [13, -9]];
    let mut found = Vec::new();
    for at in POINTS {
        let at = [at[0].into(), at[1].into(), RBig::ONE];
        if let Some(others) = rational_fibre(map, &at, control)? {
            for other in others {
                found.extend(transformation(map, &at, &other, control)?);
            }
            break;
        }
    }
    Ok(found)
}

/// The other rational points with the image of a rational point; nothing if it is a base point or
/// on a contracted curve.
fn rational_fibre(
    map: &Map,
    at: &Point,
    control: &Control<'_>,
) -> Result<Option<Vec<Point>>, Stopped> {
    let forms = map.forms();
    let image = forms.each_ref().map(|f| f.eval(at));
    let Some(pivot) = image.iter().position(|x| !x.is_zero()) else {
        return Ok(None);
    };
    let planes: Vec<Poly> = (0..4)
        .filter(|&i| i != pivot)
        .map(|i| forms[i].scale(&image[pivot]) - forms[pivot].scale(&image[i]))
        .filter(|f| !f.is_zero())
        .collect();
    if !planes
        .iter()
        .fold(Poly::zero(), |g, p| g.gcd(p))
        .is_constant()
    {
        return Ok(None);
    }
    let mut points = Vec::new();
    for zero in common_zeros(&planes, true, control)? {
        let rational = zero.homogeneous().each_ref().map(|e| e.as_rational());
        let [Some(s), Some(t), Some(w)] = rational else {
            continue;
        };
        let p = [s, t, w];
        let is_at = (0..3).all(|i| (0..i).all(|j| &p[i] * &at[j] == &p[j] * &at[i]));
        if !is_at && !forms[pivot].eval(&p).is_zero() {
            points.push(p);
        }
    }
    Ok(Some(points))
}

/// The deck transformation of one point to another one of its fibre, if there is one.
fn transformation(
    map: &Map,
    from: &Point,
    to: &Point,
    control: &Control<'_>,
) -> Result<Option<Transformation>, Stopped> {
    let mut degree = 1;
    // The coefficient that is 1, and all of them.
    let mut known: Option<(usize, Crt)> = None;
    for field in primes().take(PRIMES) {
        control.check()?;
        let Some(lines) = continued(&field, map, from, to) else {
            continue;
        };
        let solution = (degree..=MOST).find_map(|n| Some((n, agreeing(&field, &lines, n)?)));
        let Some((n, (one, values))) = solution else {
            return Ok(None);
        };
        if n > degree {
            // The primes before were special.
            (degree, known) = (n, None);
        }
        let crt = match &mut known {
            Some((place, crt)) if *place == one => crt,
            Some(_) => continue,
            None => &mut known.insert((one, Crt::new(values.len()))).1,
        };
        crt.push(&field, &values);
        if let Some((numerators, denominator)) = crt.rational() {
            let list = monomials(degree);
            let coefficients: Vec<RBig> = numerators
                .into_iter()
                .map(|n| RBig::from_parts(n, denominator.clone()))
                .collect();
            let form = |k: usize| {
                let part = &coefficients[k * list.len()..][..list.len()];
                Poly::from_terms(
                    list.iter()
                        .map(|e| [e[0], e[1], e[2], 0])
                        .zip(part.iter().cloned()),
                )
            };
            let candidate = [0, 1, 2].map(form);
            if is_deck(map, &candidate) {
                return Ok(Some(candidate));
            }
        }
    }
    Ok(None)
}

/// Whether φ∘σ = φ.
fn is_deck(map: &Map, t: &Transformation) -> bool {
    let [forms @ .., w] = map.forms();
    let moved = w.compose(t);
    !moved.is_zero() && forms.iter().all(|f| f.compose(t) * w == &moved * f)
}

/// The exponents of the monomials of a degree.
fn monomials(degree: usize) -> Vec<[u16; 3]> {
    let n = degree as u16;
    let row = |i: u16| (0..=n - i).map(move |j| [i, j, n - i - j]);
    (0..=n).flat_map(row).collect()
}

/// A power series modulo a prime, [`TERMS`] terms.
type Series = [u64; TERMS];

fn product(f: &Fp, a: &Series, b: &Series) -> Series {
    let mut c = [0; TERMS];
    for (i, &x) in a.iter().enumerate().filter(|(_, x)| **x != 0) {
        for (y, sum) in b.iter().zip(&mut c[i..]) {
            *sum = f.add(*sum, f.mul(x, *y));
        }
    }
    c
}

/// The powers of three series up to a degree.
fn powers(f: &Fp, at: &[Series; 3], degree: usize) -> [Vec<Series>; 3] {
    at.each_ref().map(|x| {
        let mut one = [0; TERMS];
        one[0] = f.one();
        let mut list = vec![one];
        for k in 0..degree {
            list.push(product(f, &list[k], x));
        }
        list
    })
}

/// The monomial with exponents, of powers of three series.
fn monomial(f: &Fp, powers: &[Vec<Series>; 3], e: [u16; 3]) -> Series {
    let [x, y, z] = [0, 1, 2].map(|v| &powers[v][usize::from(e[v])]);
    product(f, &product(f, x, y), z)
}

/// Forms modulo a prime.
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
            let mut sum = [0; TERMS];
            for (e, c) in terms {
                let term = monomial(f, &powers, [e[0], e[1], e[2]]);
                (0..TERMS).for_each(|k| sum[k] = f.add(sum[k], f.mul(*c, term[k])));
            }
            sum
        })
    }
}

/// Points on lines through a point, and the points of their fibres that continue another one:
/// nothing where the prime, or the point, is special.
fn continued(f: &Fp, map: &Map, from: &Point, to: &Point) -> Option<Vec<[[Series; 3]; 2]>> {
    let forms = Forms::new(f, map);
    let residues = |p: &Point| {
        let [a, b, c] = p.each_ref().map(|x| f.of_rbig(x));
        Some([a?, b?, c?])
    };
    let (from, to) = (residues(from)?, residues(to)?);
    let constant = |x: u64| {
        let mut series = [0; TERMS];
        series[0] = x;
        series
    };
    let along = |k: usize| {
        let mut p = from.map(constant);
        (p[0][1], p[1][1]) = (f.one(), f.of_u64(k as u64));
        let source = forms.at(f, &p);
        Some([p, lifted(f, &forms, &source, to.map(constant))?])
    };
    (0..LINES).map(along).collect()
}

/// The series of which the forms are proportional to given ones, from its first term.
fn lifted(f: &Fp, forms: &Forms, source: &[Series; 4], mut q: [Series; 3]) -> Option<[Series; 3]> {
    let pivot = (0..4).find(|&i| source[i][0] != 0)?;
    let fixed = (0..3).find(|&v| q[v][0] != 0)?;
    let free: Vec<usize> = (0..3).filter(|&v| v != fixed).collect();
    let rows: Vec<usize> = (0..4).filter(|&i| i != pivot).collect();
    let residual = |q: &[Series; 3], order: usize| {
        let values = forms.at(f, q);
        rows.iter()
            .map(|&i| {
                let [a, b] = [
                    product(f, &values[i], &source[pivot]),
                    product(f, &values[pivot], &source[i]),
                ];
                f.sub(a[order], b[order])
            })
            .collect::<Vec<u64>>()
    };
    // The derivatives by the two free coordinates, read off the first order.
    let mut slopes: Vec<Vec<u64>> = Vec::new();
    let at_rest = residual(&q, 1);
    for &v in &free {
        let mut moved = q;
        moved[v][1] = f.one();
        let by = residual(&moved, 1);
        slopes.push(
            by.iter()
                .zip(&at_rest)
                .map(|(a, b)| f.sub(*a, *b))
                .collect(),
        );
    }
    let determinant = |i: usize, j: usize| {
        f.sub(
            f.mul(slopes[0][i], slopes[1][j]),
            f.mul(slopes[0][j], slopes[1][i]),
        )
    };
    let (i, j) = [(0, 1), (0, 2), (1, 2)]
        .into_iter()
        .find(|&(i, j)| determinant(i, j) != 0)?;
    let inverse = f.inv(determinant(i, j));
    for order in 1..TERMS {
        let r = residual(&q, order);
        let [by_0, by_1] = [
            f.sub(f.mul(r[i], slopes[1][j]), f.mul(r[j], slopes[1][i])),
            f.sub(f.mul(slopes[0][i], r[j]), f.mul(slopes[0][j], r[i])),
        ];
        q[free[0]][order] = f.neg(f.mul(by_0, inverse));
        q[free[1]][order] = f.neg(f.mul(by_1, inverse));
    }
    Some(q)
}

/// The coefficients of the three forms of a degree that take all points of lines to those continued,
/// if there are any, and the place of one that is 1.
fn agreeing(f: &Fp, lines: &[[[Series; 3]; 2]], degree: usize) -> Option<(usize, Vec<u64>)> {
    let list = monomials(degree);
    let n = list.len();
    let mut rows: Vec<Vec<u64>> = Vec::new();
    for [p, q] in lines {
        let powers = powers(f, p, degree);
        let values: Vec<Series> = list.iter().map(|&e| monomial(f, &powers, e)).collect();
        for [i, j] in [[0, 1], [1, 2], [2, 0]] {
            let on_i: Vec<Series> = values.iter().map(|v| product(f, v, &q[j])).collect();
            let on_j: Vec<Series> = values.iter().map(|v| product(f, v, &q[i])).collect();
            for k in 0..TERMS {
                let mut row = vec![0; 3 * n];
                for c in 0..n {
                    row[i * n + c] = on_i[c][k];
                    row[j * n + c] = f.neg(on_j[c][k]);
                }
                rows.push(row);
            }
        }
    }
    let mut echelon = Echelon::new(3 * n);
    for row in rows {
        echelon.insert(f, row);
        if echelon.rank() == 3 * n {
            return None;
        }
    }
    echelon.kernel(f)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::base_points;

    fn deck(texts: [&str; 4]) -> Option<Deck> {
        let map = Map::parse(texts, Default::default()).expect("a map");
        let points = base_points(&map, &Control::default()).expect("not stopped");
        Deck::new(&map, &points, &Control::default()).expect("not stopped")
    }
    /// A sphere by longitude and latitude, both of them full turns.
    const LONGITUDES: [&str; 4] = [
        "s^2*t^2 - s^2 - t^2 + 1",
        "-2*s*t^2 + 2*s",
        "2*s^2*t + 2*t",
        "s^2*t^2 + s^2 + t^2 + 1",
    ];
    /// What (s : t : w) -> (t : w : s) leaves as it is.
    const CYCLIC: [&str; 4] = ["s^3 + t^3 + 1", "s*t", "s^2*t + t^2 + s", "s*t^2 + t + s^2"];
    const FOUR: [&str; 4] = ["s^2", "t^2", "s^2*t^2 + s^4", "1"];

    #[test]
    fn known_groups() {
        for (texts, order) in [
            (LONGITUDES, 2),
            (CYCLIC, 3),
            (FOUR, 4),
            (["s + t", "s*t", "s^2*t + s*t^2", "1"], 2),
            // (s, t) -> (-1/s, t), after a projectivity.
            (
                ["s^2 - 2*s*t + t^2 - 1", "2*s - 2*t", "t*(s - t)", "s - t"],
                2,
            ),
        ] {
            let found = deck(texts).expect("transformations");
            assert_eq!(found.order(), order, "{texts:?}");
        }
        // Proper; three to one, but with one real parameter.
        assert!(deck(["s", "t", "s*t", "1"]).is_none());
        assert!(deck(["s^3", "t", "s^6 + t^2", "1"]).is_none());
    }

    /// Of the parameters that are exchanged one is in the fundamental domain.
    #[test]
    fn domains_have_one_of_each() {
        let mut random = fastrand::Rng::with_seed(1);
        for texts in [LONGITUDES, CYCLIC, FOUR] {
            let found = deck(texts).expect("transformations");
            for _ in 0..100 {
                let p = [(); 3].map(|()| RBig::from(random.i32(-1000..=1000)));
                let others = found
                    .transformations
                    .iter()
                    .map(|t| t.each_ref().map(|f| f.eval(&p)));
                let held = others.chain([p.clone()]).filter(|q| found.holds(q)).count();
                assert_eq!(held, 1, "{texts:?} {p:?}");
            }
        }
    }

    #[test]
    fn folds_are_fixed_curves() {
        let found = deck(FOUR).expect("transformations");
        assert_eq!(found.folds.sides[..2], [true, true]);
        let found = deck(["s + t", "s*t", "s^2*t + s*t^2", "1"]).expect("a transformation");
        let diagonal = Poly::var(0) - Poly::var(1);
        assert!(found.folds.curves.iter().any(|c| c.is_associate(&diagonal)));
        let found = deck(LONGITUDES).expect("a transformation");
        assert!(found.folds.curves.is_empty() && found.folds.sides == [false; 3]);
        assert!(found.may_exchange([2.0, 3.0, 1.0], [-0.5, 1.0 / 3.0, 1.0]));
        assert!(!found.may_exchange([2.0, 3.0, 1.0], [-0.5, 1.0 / 2.0, 1.0]));
    }
}
