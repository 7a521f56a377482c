//! Seams of complex base points that contain a curve of real points: double curves of the surface
//! that are not the image of any curve of real parameters.
//!
//! A base point that is not real is blown up to a complex curve. As complex conjugation maps it to
//! the seam of the conjugate base point, it has infinitely many real points only if the two seams
//! coincide. Two conjugate sheets cross there, as along the axis of Cartan's umbrella z(x² + y²) =
//! x³. Whether they coincide is decided by the Chow form of the curve, the resultant of two planes
//! on it, whose values at conjugate curves are conjugate.

use crate::base::{Class, Classes};
use crate::coefficients::Coefficients;
use crate::field::{Element, NumberField};
use crate::map::Map;
use crate::singular::{CurveKind, RealPart, Singular};
use isoform_algebra::{Poly, RBig};
use isoform_control::{Control, Stopped};
use isoform_geom::Point3;

/// Pairs of general planes: the values of x whose planes have the coefficients 1, x, x², x³.
const PLANES: [[i64; 2]; 2] = [[2, -3], [5, -7]];

/// A real line of space to which a pair of conjugate base points is blown up.
#[derive(Clone, Debug, PartialEq)]
pub struct SeamLine {
    /// Two points (X : Y : Z : W) on the line.
    pub points: [[RBig; 4]; 2],
}

/// Returns the real lines to which conjugate base points are blown up, and whether there may be
/// further real curves of that kind, which are not traced.
pub(crate) fn seam_lines(
    classes: &Classes,
    control: &Control<'_>,
) -> Result<(Vec<SeamLine>, bool), Stopped> {
    let (mut lines, mut others) = (Vec::new(), false);
    let mut pending: Vec<&Class> = classes.all().collect();
    while let Some(class) = pending.pop() {
        control.check()?;
        pending.extend(class.near());
        let (field, curve) = (class.field(), class.curve());
        // The seam is a point, or lies at infinity.
        let is_nothing = curve[3].len() == 1 || curve[3].iter().all(Element::is_zero);
        if is_nothing || !may_be_real(field, curve) {
            continue;
        }
        match line(field, curve) {
            Some(line) => {
                if !lines.contains(&line) {
                    lines.push(line);
                }
            }
            None => others = true,
        }
    }
    Ok((lines, others))
}

/// Returns true if the curve at some complex root may coincide with its conjugate.
fn may_be_real(field: &NumberField, curve: &[Coefficients; 4]) -> bool {
    let (roots, real) = (field.degree(), field.real_roots().len());
    if roots == real {
        return false;
    }
    let [a, b] = PLANES.map(|[p, q]| {
        let [p, q] = [p, q].map(|x| on_plane(curve, [1, x, x * x, x * x * x]));
        resultant(field, &p, &q)
    });
    if a.is_zero() || b.is_zero() {
        return true;
    }
    let ratio = field.div(&a, &b);
    let minimal = field.minimal_polynomial(&ratio);
    // Each of its real roots is the ratio at equally many roots of the modulus; real roots of
    // the modulus have real ratios.
    let with_real_ratio = isoform_algebra::real_roots(&minimal).len() * (roots / minimal.degree());
    with_real_ratio > real
}

/// Evaluates the linear form of a plane on a curve.
fn on_plane(curve: &[Coefficients; 4], plane: [i64; 4]) -> Coefficients {
    let term = |i: usize, k: usize| curve[i][k].scaled(&RBig::from(plane[i]));
    (0..curve[0].len())
        .map(|k| (0..4).fold(Element::zero(), |sum, i| sum.add(&term(i, k))))
        .collect()
}

/// Returns Sylvester's matrix of two binary forms of equal degree d: d shifted rows of each.
fn sylvester(p: &Coefficients, q: &Coefficients) -> Vec<Vec<Element>> {
    let d = p.len() - 1;
    let row = |f: &Coefficients, shift: usize| -> Vec<Element> {
        let place = |k: usize| f.get(k.checked_sub(shift)?).cloned();
        (0..2 * d).map(|k| place(k).unwrap_or_default()).collect()
    };
    let both = [p, q].into_iter();
    both.flat_map(|f| (0..d).map(move |s| row(f, s))).collect()
}

/// Returns the resultant of two binary forms of equal degree: the determinant of Sylvester's
/// matrix, by elimination.
fn resultant(field: &NumberField, p: &Coefficients, q: &Coefficients) -> Element {
    let mut rows = sylvester(p, q);
    let n = rows.len();
    let mut determinant = Element::rational(&RBig::ONE);
    for k in 0..n {
        let Some(pivot) = (k..n).find(|&i| !rows[i][k].is_zero()) else {
            return Element::zero();
        };
        if pivot != k {
            rows.swap(pivot, k);
            determinant = determinant.negated();
        }
        determinant = field.mul(&determinant, &rows[k][k]);
        let inverse = field.inverse(&rows[k][k]);
        let top = rows[k].clone();
        for row in &mut rows[k + 1..] {
            let factor = field.mul(&row[k], &inverse);
            for (c, t) in row.iter_mut().zip(&top).skip(k) {
                *c = c.sub(&field.mul(&factor, t));
            }
        }
    }
    determinant
}

/// Returns the image line of a curve, if it is a line with rational Plücker coordinates, covered
/// once or several times.
fn line(field: &NumberField, curve: &[Coefficients; 4]) -> Option<SeamLine> {
    // Two coefficients that span a line; all others have to lie on it.
    let count = curve[0].len();
    let pairs = (0..count).flat_map(|k| (k + 1..count).map(move |l| [k, l]));
    let mut spans = pairs.map(|pair| Span { field, curve, pair });
    let (span, pivot) = spans.find_map(|span| {
        let mut places = (0..4).flat_map(|i| (i + 1..4).map(move |j| [i, j]));
        let pivot = places.find_map(|[i, j]| Some(span.minor(i, j)).filter(|m| !m.is_zero()))?;
        Some((span, pivot))
    })?;
    if !(0..count).all(|other| span.holds(other)) {
        return None;
    }
    // Row i of the matrix of Plücker coordinates is the intersection of the line with the plane
    // xᵢ = 0.
    let mut points: Vec<[RBig; 4]> = Vec::new();
    for i in 0..4 {
        let mut point: [RBig; 4] = Default::default();
        for (j, c) in point.iter_mut().enumerate() {
            *c = field.div(&span.minor(i, j), &pivot).as_rational()?;
        }
        points.push(point);
    }
    let first = points.iter().find(|p| p.iter().any(|c| *c != RBig::ZERO))?;
    let second = points.iter().find(|p| !are_one(p, first))?;
    Some(SeamLine {
        points: [first.clone(), second.clone()],
    })
}

/// Returns true if two vectors are proportional, or one of them is zero.
fn are_one(p: &[RBig; 4], q: &[RBig; 4]) -> bool {
    let is_minor_zero = |i: usize, j: usize| &p[i] * &q[j] == &p[j] * &q[i];
    (0..4).all(|i| (i + 1..4).all(|j| is_minor_zero(i, j)))
}

/// Span of two coefficients of a curve, taken as points of space.
struct Span<'a> {
    field: &'a NumberField,
    curve: &'a [Coefficients; 4],
    pair: [usize; 2],
}

impl Span<'_> {
    /// Returns the Plücker coordinate with indices i and j.
    fn minor(&self, i: usize, j: usize) -> Element {
        let (curve, [k, l]) = (self.curve, self.pair);
        let product = self.field.mul(&curve[i][k], &curve[j][l]);
        product.sub(&self.field.mul(&curve[i][l], &curve[j][k]))
    }
    /// Returns true if another coefficient lies on the span.
    fn holds(&self, other: usize) -> bool {
        let term = |i: usize, j: usize, k: usize| {
            let minor = self.minor(j, k);
            self.field.mul(&self.curve[i][other], &minor)
        };
        [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]
            .iter()
            .all(|&[a, b, c]| {
                let sum = term(a, b, c).add(&term(b, c, a)).add(&term(c, a, b));
                sum.is_zero()
            })
    }
}

impl SeamLine {
    /// Returns true if the image of a curve of real parameters lies on the line and is not a single
    /// point.
    pub(crate) fn is_met(&self, map: &Map, singular: &Singular) -> bool {
        let planes = self.planes();
        let pulled_back = planes.map(|plane| {
            let terms = map.forms().iter().zip(&plane);
            terms.fold(Poly::zero(), |sum, (f, c)| sum + f.scale(c))
        });
        let is_on_line = |curve: &Poly| pulled_back.iter().all(|form| form.is_multiple_of(curve));
        let mut curves = singular.curves.iter();
        curves.any(|c| {
            let is_curve = !matches!(c.kind, CurveKind::Contracted(_));
            is_curve && matches!(c.real, RealPart::Curve) && is_on_line(&c.curve)
        })
    }

    /// Returns four planes through the line, of which two are independent: the minors of its points
    /// with the unit vectors.
    fn planes(&self) -> [[RBig; 4]; 4] {
        let [p, q] = &self.points;
        let minor = |i: usize, j: usize| &p[i] * &q[j] - &p[j] * &q[i];
        std::array::from_fn(|k| {
            // The plane through both points and the k-th unit vector.
            let rest: Vec<usize> = (0..4).filter(|&i| i != k).collect();
            let mut plane: [RBig; 4] = Default::default();
            plane[rest[0]] = minor(rest[1], rest[2]);
            plane[rest[1]] = minor(rest[2], rest[0]);
            plane[rest[2]] = minor(rest[0], rest[1]);
            plane
        })
    }

    /// Returns the segment of the line in the box |x|, |y|, |z| ≤ `half_width`.
    pub(crate) fn within(&self, half_width: f64) -> Option<[Point3; 2]> {
        let [p, q] = &self.points;
        // A point with W = 1 and a direction with W = 0.
        let (at, other) = if p[3] == RBig::ZERO { (q, p) } else { (p, q) };
        if at[3] == RBig::ZERO {
            return None;
        }
        let affine = |i: usize| (&at[i] / &at[3]).to_f64().value();
        let along = |i: usize| (&other[i] - &other[3] * &at[i] / &at[3]).to_f64().value();
        let (at, along): (Point3, Point3) =
            (std::array::from_fn(affine), std::array::from_fn(along));
        let [lo, hi] = clipped(at, along, half_width)?;
        let end =
            |t: f64| std::array::from_fn(|k| (at[k] + t * along[k]).clamp(-half_width, half_width));
        Some([end(lo), end(hi)])
    }
}

/// Returns the parameters between which a line `at` + t·`along` is in the box |x|, |y|, |z| ≤
/// `half_width`; `None` if it misses the box or touches it in one point.
fn clipped(at: Point3, along: Point3, half_width: f64) -> Option<[f64; 2]> {
    let (mut lo, mut hi) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        if along[k] == 0.0 {
            if at[k].abs() > half_width {
                return None;
            }
            continue;
        }
        let ends = [-half_width, half_width].map(|face| (face - at[k]) / along[k]);
        lo = lo.max(ends[0].min(ends[1]));
        hi = hi.min(ends[0].max(ends[1]));
    }
    (lo < hi).then_some([lo, hi])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(forms: [&str; 4]) -> (Vec<SeamLine>, bool) {
        let map = Map::parse(forms, crate::MapOptions::default()).expect("a map");
        let classes = Classes::new(&map, false, &Control::default()).expect("in time");
        seam_lines(&classes, &Control::default()).expect("in time")
    }

    /// z(x² + y²) = x³: two conjugate sheets cross in the z axis.
    #[test]
    fn the_axis_of_cartans_umbrella() {
        let (found, others) = lines(["s*t^2 + s", "s*t^3 + s*t", "s", "t^2 + 1"]);
        assert!(!others);
        let [line] = &found[..] else {
            panic!("{found:?}");
        };
        let mut ends = line.within(1.5).expect("a segment");
        ends.sort_by(|a, b| a[2].total_cmp(&b[2]));
        assert_eq!(ends, [[0.0, 0.0, -1.5], [0.0, 0.0, 1.5]]);
    }

    /// The z axis once more, covered twice: W is a square with zeros in the circular points.
    #[test]
    fn a_line_may_be_covered_twice() {
        let (found, others) = lines(["s", "t", "s^2 + 1", "(s^2 + t^2 - 1)^2"]);
        assert!(!others);
        let [line] = &found[..] else {
            panic!("{found:?}");
        };
        let ends = line.within(1.0).expect("a segment");
        assert!(
            ends.iter()
                .all(|p| p[0] == 0.0 && p[1] == 0.0 && p[2].abs() == 1.0)
        );
    }

    /// The lines to which the conjugate base points of a stereographic projection are blown up meet
    /// only in its centre.
    #[test]
    fn a_sphere_has_none() {
        let sphere = ["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"];
        assert_eq!(lines(sphere), (Vec::new(), false));
    }
}
