//! Improper maps: their deck transformations, and a fundamental domain of the parameter plane.
//!
//! A deck transformation of φ is a birational map σ of the parameter plane with φ∘σ = φ. One with
//! rational coefficients maps a general rational point to a rational point of its fibre, and each
//! such point belongs to at most one transformation. From there σ is continued as a power series
//! along lines, by Newton's method modulo primes. Forms of least degree that agree with all series
//! come from a linear system, by Chinese remainders and rational reconstruction. The identity φ∘σ =
//! φ proves them.
//!
//! For a rational function r = l/m of the parameters that is invariant under no σ, the points with
//! r > r∘σ for every σ form a fundamental domain. Its border consists of curves on which r = r∘σ,
//! or on which r or r∘σ has a pole. σ maps the border to itself: the surface continues there, or
//! the curve is a fold, all of whose points are fixed.

mod series;
mod transformations;

use crate::base::BasePoint;
use crate::field::{Algebraic, exact, vanishes};
use crate::map::Map;
use isoform_algebra::{FactorError, Poly, RBig};
use isoform_control::{Control, Stopped};
use isoform_geom::{cross, norm};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use transformations::transformations;

/// Sine of the angle up to which two points (s : t : w), as vectors, are identified. Partners on a
/// border are found to some ten digits, of which half are lost next to folds; distinct parameters
/// that share an image by chance are farther apart.
const SAME_POINT_SINE: f64 = 1e-5;

/// Three forms in (s, t, w), of equal degree and without a common factor.
type Transformation = [Poly; 3];
type Point = [RBig; 3];

/// Deck transformations of a map, and a fundamental domain.
#[derive(Clone, Debug)]
pub(crate) struct Deck {
    /// All transformations but the identity.
    transformations: Vec<Transformation>,
    /// Forms l and m of the ratio r = l/m that is compared.
    ratio: [Poly; 2],
    /// Border of the fundamental domain, without folds.
    pub(crate) seams: Border,
    /// Folds: curves all of whose points are fixed by a transformation.
    pub(crate) folds: Border,
    /// Indices of the real base points at which a transformation fixes the point and all lines
    /// through it: the curves to which they are blown up are folds.
    pub(crate) folded: BTreeSet<usize>,
}

/// A set of irreducible curves.
#[derive(Clone, Debug, Default)]
pub(crate) struct Border {
    /// Curves other than s = 0, t = 0 and w = 0.
    pub(crate) curves: Vec<Poly>,
    /// True for each of s = 0, t = 0, w = 0 that belongs to the set.
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
    /// Returns the sum of the degrees.
    fn degree(&self) -> usize {
        let sides = self.sides.iter().filter(|s| **s).count();
        sides + self.curves.iter().map(Poly::total_degree).sum::<usize>()
    }
}

impl Deck {
    /// Returns the deck; `None` if no transformation but the identity is found, or if every
    /// fundamental domain tried has a real base point that is blown up to a part of its border.
    ///
    /// # Errors
    /// [`Stopped`].
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
        let others = (0..base_points.len()).filter(|k| !deck.folded.contains(k));
        let around: Vec<[Point; 2]> = others.flat_map(|k| across(&base_points[k].point)).collect();
        let lines = linear_forms(base_points);
        let found = deck.least(&lines, &around, usize::MAX, control)?;
        if found.is_some() {
            return Ok(found);
        }
        // Quadratic forms serve if linear ones do not, as when all base points are on a fold.
        // Twelve linear forms have 78 products with 6000 quotients, which take a fraction of a
        // second.
        let squared = &lines[..lines.len().min(12)];
        let products = |i: usize| squared[..=i].iter().map(move |l| &squared[i] * l);
        let squares: Vec<Poly> = (0..squared.len()).flat_map(products).collect();
        // The best of the first five quotients found is taken.
        deck.least(&squares, &around, 5, control)
    }
    /// Returns the deck whose quotient of two forms gives the border of least degree, among the
    /// first `most` quotients that separate none of the pairs of points around base points.
    fn least(
        &self,
        forms: &[Poly],
        around: &[[Point; 2]],
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
            if around.iter().any(|[p, q]| deck.holds(p) != deck.holds(q)) {
                continue;
            }
            let ratio = deck.ratio.each_ref();
            let Some([seams, folds]) = border(&deck.transformations, ratio, control)? else {
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
    /// Returns the matrices of the linear transformations.
    pub(crate) fn linear(&self) -> impl Iterator<Item = [[RBig; 3]; 3]> {
        let is_linear = |t: &&Transformation| t.iter().all(|f| f.total_degree() <= 1);
        let row =
            |f: &Poly| [0, 1, 2].map(|v| f.coefficient(std::array::from_fn(|k| u16::from(k == v))));
        let linear = self.transformations.iter().filter(is_linear);
        linear.map(move |t| t.each_ref().map(row))
    }
    /// Returns the order of the group: the number of parameters that are exchanged.
    pub(crate) fn order(&self) -> usize {
        self.transformations.len() + 1
    }
    /// Returns the images of a point (s : t : w) under the transformations; `None` for one that is
    /// undefined there.
    pub(crate) fn others(&self, p: [f64; 3]) -> impl Iterator<Item = Option<[f64; 3]>> {
        self.transformations.iter().map(move |t| image(t, p))
    }
    /// Returns true if a transformation maps one of two points (s : t : w) to within
    /// [`SAME_POINT_SINE`] of the other, or is undefined at both.
    pub(crate) fn may_exchange(&self, p: [f64; 3], q: [f64; 3]) -> bool {
        let is_near = |a, b| norm(cross(a, b)) <= SAME_POINT_SINE * norm(a) * norm(b);
        self.transformations
            .iter()
            .any(|t| match (image(t, p), image(t, q)) {
                (Some(other), _) => is_near(other, q),
                (None, Some(other)) => is_near(other, p),
                (None, None) => true,
            })
    }
    /// Returns true if a point (s : t : w) that is on no curve of the border is in the fundamental
    /// domain.
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

/// Coefficients of linear forms: simple ones, and some in general position.
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
/// Second points of the lines through a rational base point.
const THROUGH: [[i64; 3]; 3] = [[1, 2, -1], [3, -1, 2], [-2, 1, 5]];

/// Returns the line through a point and another one: their cross product.
fn line_through([s, t, w]: &[&RBig; 3], other: [i64; 3]) -> [RBig; 3] {
    let [a, b, c] = other.map(RBig::from);
    [&b * *w - &c * *t, &c * *s - &a * *w, &a * *t - &b * *s]
}

/// Returns linear forms, including those of lines through rational base points.
fn linear_forms(base_points: &[BasePoint]) -> Vec<Poly> {
    let mut forms: Vec<[RBig; 3]> = LINEAR.map(|c| c.map(RBig::from)).to_vec();
    for p in base_points {
        if let [Some(s), Some(t), Some(w)] = p.point.each_ref().map(Algebraic::as_rational) {
            forms.extend(THROUGH.map(|d| line_through(&[&s, &t, &w], d)));
        }
    }
    forms.iter().map(linear).collect()
}

/// Returns the linear form with given coefficients of s, t and w.
pub(crate) fn linear(c: &[RBig; 3]) -> Poly {
    (0..3).fold(Poly::zero(), |sum, v| sum + Poly::var(v).scale(&c[v]))
}

/// Returns l m∘σ − m l∘σ, m and m∘σ: r − r∘σ can change its sign only at their zeros.
fn comparison(t: &Transformation, [l, m]: [&Poly; 2]) -> [Poly; 3] {
    let [moved_l, moved_m] = [l, m].map(|f| f.compose(t));
    [l * &moved_m - m * &moved_l, m.clone(), moved_m]
}

/// Moves a point by a distance in a direction, in the plane in which its largest coordinate is 1.
fn beside(at: [f64; 3], largest: usize, angle: f64, distance: f64) -> [f64; 3] {
    let (sin, cos) = angle.sin_cos();
    let mut moved = at.map(|x| x / at[largest]);
    let others = (0..3).filter(|&i| i != largest);
    for (i, d) in others.zip([cos, sin]) {
        moved[i] += distance * d;
    }
    moved[largest] = 1.0;
    moved
}

/// Returns pairs of points on opposite sides of a base point, in several directions. If a pair is
/// not on one side of a domain's border, the seam of the base point is a part of that border.
fn across(p: &[Algebraic; 3]) -> Vec<[Point; 2]> {
    /// Number of directions between 0 and π at which the surface is sampled around the base point.
    const HALF_TURN_DIRECTIONS: usize = 12;
    let at = p.each_ref().map(Algebraic::to_f64);
    // The plane in which the largest coordinate is 1.
    let by_size = |i: &usize, j: &usize| at[*i].abs().total_cmp(&at[*j].abs());
    let largest = (0..3).max_by(by_size).unwrap_or(0);
    // The distance exceeds the rounding of the base point. If other curves are nearer, the domain
    // is rejected.
    let step = |angle: f64, sign: f64| beside(at, largest, angle, sign * 1e-5).map(exact);
    let angle = |k: usize| (k as f64 + 0.37) * PI / HALF_TURN_DIRECTIONS as f64;
    let pair = |k: usize| [1.0, -1.0].map(|sign| step(angle(k), sign));
    (0..HALF_TURN_DIRECTIONS).map(pair).collect()
}

/// Returns true if a transformation fixes a point and all lines through it: its derivative there is
/// a multiple of the identity.
fn keeps_lines(t: &Transformation, p: &[Algebraic; 3]) -> bool {
    let Some(one) = (0..3).find(|&k| !p[k].is_zero()) else {
        return false;
    };
    let [i, j] = [(one + 1) % 3, (one + 2) % 3];
    let is_kept = |k: usize| vanishes(&(&t[k] * Poly::var(one) - &t[one] * Poly::var(k)), p);
    if vanishes(&t[one], p) || !is_kept(i) || !is_kept(j) {
        return false;
    }
    // Derivatives of the quotients of two forms, up to a common factor.
    let slope = |k: usize, by: usize| t[k].derivative(by) * &t[one] - &t[k] * t[one].derivative(by);
    [slope(i, j), slope(j, i), slope(i, i) - slope(j, j)]
        .iter()
        .all(|f| vanishes(f, p))
}

/// Returns the irreducible curves across which r > r∘σ changes to r < r∘σ for one of the
/// transformations, split into seams and folds; `None` if r = r∘σ everywhere.
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
        for f in odd_factors(parts, control)? {
            let is_fold = is_fixed(t, &f);
            let name = (f.total_degree(), f.terms().to_vec());
            curves.entry(name).or_insert((f, false)).1 |= is_fold;
        }
    }
    let (folds, seams): (Vec<_>, Vec<_>) = curves.into_values().partition(|c| c.1);
    let border = |list: Vec<(Poly, bool)>| Border::new(list.into_iter().map(|c| c.0));
    Ok(Some([seams, folds].map(border)))
}

/// Returns the irreducible factors of odd multiplicity of a product.
fn odd_factors(product: [Poly; 3], control: &Control<'_>) -> Result<Vec<Poly>, Stopped> {
    let mut orders: Vec<(Poly, usize)> = Vec::new();
    for form in product {
        for (f, n) in form.factor(control).map_err(FactorError::only_stopped)? {
            match orders.iter_mut().find(|o| o.0 == f) {
                Some(known) => known.1 += n,
                None => orders.push((f, n)),
            }
        }
    }
    let odd = orders.into_iter().filter(|o| o.1 % 2 == 1);
    Ok(odd.map(|o| o.0).collect())
}

/// Returns true if a transformation fixes all points of a curve.
fn is_fixed(t: &Transformation, curve: &Poly) -> bool {
    [[0, 1], [1, 2], [2, 0]]
        .into_iter()
        .all(|[i, j]| (&t[i] * Poly::var(j) - &t[j] * Poly::var(i)).is_multiple_of(curve))
}

/// Returns the image of a point; `None` if the transformation is undefined there.
fn image(t: &Transformation, p: [f64; 3]) -> Option<[f64; 3]> {
    let at = t.each_ref().map(|form| value(form, p));
    let is_lost = at.iter().all(|(x, size)| x.abs() <= SAME_POINT_SINE * size);
    (!is_lost).then(|| at.map(|x| x.0))
}

/// Returns the value of a form, and the sum of the absolute values of its terms.
pub(crate) fn value(form: &Poly, p: [f64; 3]) -> (f64, f64) {
    let term = |e: &[u16; 4]| (0..3).map(|v| p[v].powi(i32::from(e[v]))).product::<f64>();
    let terms = form.to_f64();
    let add = |(sum, size): (f64, f64), x: f64| (sum + x, size + x.abs());
    terms.iter().map(|(e, c)| c * term(e)).fold((0.0, 0.0), add)
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
    /// A sphere by longitude and latitude, each running through a full turn.
    const LONGITUDES: [&str; 4] = [
        "s^2*t^2 - s^2 - t^2 + 1",
        "-2*s*t^2 + 2*s",
        "2*s^2*t + 2*t",
        "s^2*t^2 + s^2 + t^2 + 1",
    ];
    /// Invariants of (s : t : w) -> (t : w : s).
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
        // A proper map, and one of degree 3 with a single real parameter.
        assert!(deck(["s", "t", "s*t", "1"]).is_none());
        assert!(deck(["s^3", "t", "s^6 + t^2", "1"]).is_none());
    }

    /// Exactly one point of each orbit lies in the fundamental domain.
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
