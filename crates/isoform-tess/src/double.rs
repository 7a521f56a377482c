//! Pinch points, and solitary curves: real points of a surface that only pairs of complex conjugate
//! parameters reach.
//!
//! A map of degree 1 takes a non-real parameter p to a real point only where it takes the conjugate
//! of p to the same point: p lies on the double locus D. Along an irreducible factor f of D that is
//! not contracted, real points are the solutions of f(p) = 0, Im φ(p) = 0, of which one real
//! equation is left where f = 0 is smooth; where it is not, the second condition alone still has
//! the rank 3 of a curve as long as the sheets at p and at its conjugate cross. Both together are
//! solved by Gauss–Newton, in the affine chart of the complex projective plane around the point
//! itself, so that no parameter is at infinity.
//!
//! An improper map may take whole regions of non-real parameters to real points, where a deck
//! transformation gives the conjugate. Of these only what lies on D is found.
//!
//! A real base point is blown up to a line, of which a pair of conjugate directions may reach real
//! points, too (the conoid of Plücker): its seam curves are traced in the same way, as maps of the
//! line c = 0 in a plane (a : b : c).
//!
//! Curves are found by sections: the points of f = 0 in a general complex plane of space, from
//! those on lines of the parameter plane by homotopy, are carried to planes that cut the box into
//! slices, and to its faces.

use crate::base::{BasePoint, Seam, base_points};
use crate::complex::{
    C, Form, Monomials, Plane, Stream, V, along, conj, distance, dot, eval_all, frame, in_frame,
    in_half_widths, inner, largest, length, norm, normalised, real_line, real_plane, real_point,
    rounded,
};
use crate::deck::Deck;
use crate::field::{Algebraic, Element, NumberField};
use crate::finding::{Finding, Phase};
use crate::homotopy::{follow, newton, runge_kutta};
use crate::map::Map;
use crate::singular::{CurveKind, Singular, SingularCurve, signed_minors};
use crate::zeros::common_zeros;
use isoform_algebra::{Poly, RBig};
use isoform_control::{Control, Stopped};
use isoform_geom::distance_to_segment;

/// Slices of the box in each of three directions, at most and at least; in between about as many
/// points as said are followed from one plane to the next.
const SLICES: [usize; 2] = [17, 7];
const POINTS: usize = 500;

/// Degree of the forms up to which pinch points are computed as ends of short arcs: 24 conjugates,
/// a fraction of a second.
const PINCH_DEGREE: usize = 6;

/// The real isolated points (s : t : w) where the rank of the Jacobian drops, without base points.
///
/// They are the common zeros of the four signed 3 × 3 minors of the forms' Jacobian, divided by
/// their greatest common divisor. At a general one of them the surface has a pinch point, where a
/// double curve turns from one with real parameters into a solitary one.
///
/// # Errors
/// [`Stopped`].
pub fn pinch_points(map: &Map, control: &Control<'_>) -> Result<Vec<[Algebraic; 3]>, Stopped> {
    pinches(map, &reduced_minors(map, control)?, control)
}

/// The signed minors divided by their greatest common divisor.
fn reduced_minors(map: &Map, control: &Control<'_>) -> Result<[Poly; 4], Stopped> {
    let minors = signed_minors(map, control)?;
    let mut common = Poly::zero();
    for m in &minors {
        control.check()?;
        common = common.gcd(m);
    }
    Ok(minors
        .each_ref()
        .map(|m| m.div_exact(&common).expect("a common divisor divides")))
}

fn pinches(
    map: &Map,
    minors: &[Poly; 4],
    control: &Control<'_>,
) -> Result<Vec<[Algebraic; 3]>, Stopped> {
    let mut found = Vec::new();
    for zero in common_zeros(minors, true, control)? {
        let at = zero.homogeneous();
        let mut base = true;
        for form in map.forms() {
            control.check()?;
            base &= value(&zero.field, form, &at).is_zero();
        }
        if !base {
            found.extend(zero.real());
        }
    }
    Ok(found)
}

/// The value of a form in three variables at a point over a number field.
fn value(field: &NumberField, form: &Poly, at: &[Element; 3]) -> Element {
    let powers = [0, 1, 2].map(|v| {
        let mut powers = vec![Element::rational(&RBig::ONE)];
        for i in 0..form.degree(v) {
            powers.push(field.mul(&powers[i], &at[v]));
        }
        powers
    });
    let mut sum = Element::zero();
    for (e, c) in form.terms() {
        let [s, t, w] = [0, 1, 2].map(|v| &powers[v][usize::from(e[v])]);
        sum = sum.add(
            &field
                .mul(&field.mul(s, t), w)
                .scaled(&RBig::from(c.clone())),
        );
    }
    sum
}

/// Solitary curves in the box |x|, |y|, |z| ≤ `half_width`, as polylines whose vertices lie on them
/// up to rounding and whose chords leave them by at most about `tolerance`, and what could not be
/// completed; nothing if all is well.
///
/// The points of these curves have no real parameter, apart from isolated ones, but a pair of
/// conjugate ones; conjugate directions of real base points are included. The curves end at pinch
/// points, where the pair becomes real, at faces of the box, and where a real parameter joins them.
/// The first point of a closed curve is repeated as its last. Curves that lie between two of the
/// planes by which they are looked for (a seventh to a seventeenth of the box's diagonal apart in
/// each of three directions, the fewer points are followed the nearer), and reach neither a face
/// nor a pinch point, may be missed.
pub fn solitary_arcs(
    map: &Map,
    singular: &Singular,
    half_width: f64,
    tolerance: f64,
    control: &Control<'_>,
) -> (Vec<Vec<[f64; 3]>>, Vec<Finding>) {
    let mut problems = Vec::new();
    if singular.double.is_none() {
        problems.push(Finding::DoubleLocusUnknown);
        return (Vec::new(), problems);
    }
    let mut search = Search {
        sources: Vec::new(),
        tolerance: tolerance / half_width,
        arcs: Vec::new(),
        problems,
    };
    if search.run(map, singular, half_width, control).is_err() {
        search.problems.push(Finding::Stopped(Phase::SolitaryArcs));
    }
    let scale = |x: [f64; 3]| x.map(|v| v * half_width);
    (
        search
            .arcs
            .into_iter()
            .map(|arc| arc.into_iter().map(scale).collect())
            .collect(),
        search.problems,
    )
}

/// The parameters of points of the double curve.
pub(crate) struct Fibres {
    search: Search,
    half_width: f64,
    /// How many of the sources are curves of parameters: the rest are seams.
    curves: usize,
}

impl Fibres {
    pub(crate) fn new(
        map: &Map,
        singular: &Singular,
        half_width: f64,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut search = Search {
            sources: Vec::new(),
            tolerance: 1e-3,
            arcs: Vec::new(),
            problems: Vec::new(),
        };
        search.prepare(map, singular, half_width, control)?;
        let curves = curves_of(map, singular).count();
        Ok(Self {
            search,
            half_width,
            curves,
        })
    }
    /// Whether one real parameter and conjugate ones lead to a point, and nothing else. Those that
    /// deck transformations exchange count as one.
    pub(crate) fn is_met_by_conjugates(&self, p: [f64; 3], deck: Option<&Deck>) -> bool {
        let found = self.search.fibre(&[
            p[0] / self.half_width,
            p[1] / self.half_width,
            p[2] / self.half_width,
            1.0,
        ]);
        let real: Vec<&V> = found.iter().filter(|f| f.2).map(|f| &f.1).collect();
        let is_one = |p: &V, q: &V| {
            distance(p, q) < 1e-5
                || deck.is_some_and(|d| d.may_exchange(real_point(p), real_point(q)))
        };
        found.len() > real.len() && real.windows(2).all(|w| is_one(w[0], w[1]))
    }
    /// Whether all the partners of a real parameter (s : t : w) with a given image were found to be
    /// conjugate or in a part of the plane.
    pub(crate) fn is_alone(
        &self,
        p: [f64; 3],
        own: [f64; 3],
        is_elsewhere: &dyn Fn([f64; 3]) -> bool,
    ) -> bool {
        let found = self.search.fibre(&[
            p[0] / self.half_width,
            p[1] / self.half_width,
            p[2] / self.half_width,
            1.0,
        ]);
        let own = normalised(&own.map(|x| C::new(x, 0.0)));
        let is_other = |f: &&(usize, V, bool)| !f.2 || distance(&f.1, &own) > 1e-5;
        found.iter().any(|f| is_other(&f))
            && found
                .iter()
                .filter(|f| f.2)
                .filter(is_other)
                .all(|(k, v, _)| *k < self.curves && is_elsewhere(real_point(v)))
    }
}

/// The curves with images that are curves in space.
pub(crate) fn curves_of<'a>(
    map: &'a Map,
    singular: &'a Singular,
) -> impl Iterator<Item = &'a SingularCurve> {
    let is_left_out = |c: &&SingularCurve| {
        matches!(c.kind, CurveKind::Contracted(_)) || map.forms()[3].is_multiple_of(&c.curve)
    };
    singular.curves.iter().filter(move |c| !is_left_out(c))
}

/// A curve in a plane and a map of it into space.
struct Source {
    curve: Form,
    curve_degree: usize,
    /// In units in which the box has the half-width 1.
    forms: [Form; 4],
    degree: usize,
    /// Points of the curve in a general complex plane of space, base points left out.
    section: Vec<V>,
}

/// Everything at a point.
struct Values {
    f: C,
    df: V,
    g: [C; 4],
    dg: [V; 4],
}

impl Source {
    fn new(
        curve: Form,
        curve_degree: usize,
        forms: [Vec<([usize; 3], f64)>; 4],
        degree: usize,
        half_width: f64,
    ) -> Self {
        Self {
            curve,
            curve_degree,
            forms: in_half_widths(forms, half_width),
            degree,
            section: Vec::new(),
        }
    }
    fn eval(&self, p: &V) -> Values {
        let m = Monomials::new(p, self.curve_degree.max(self.degree));
        let (f, df) = self.curve.eval(&m);
        let (g, dg) = eval_all(&self.forms, &m);
        Values { f, df, g, dg }
    }
    /// The norm of the forms' values: small near base points only.
    fn size(&self, p: &V) -> f64 {
        norm(&self.eval(p).g)
    }
}

/// q, its gradient and its derivative by the time, for the second equation q = 0 besides f = 0.
type Path<'a> = dyn Fn(f64, &V, &Values) -> (C, V, C) + 'a;

fn solve2(rows: [[C; 2]; 2], right: [C; 2]) -> Option<[C; 2]> {
    let determinant = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0];
    if determinant.norm2() == 0.0 {
        return None;
    }
    let inverse = determinant.inverse();
    let x = (right[0] * rows[1][1] - right[1] * rows[0][1]) * inverse;
    let y = (rows[0][0] * right[1] - rows[1][0] * right[0]) * inverse;
    (x.norm() + y.norm()).is_finite().then_some([x, y])
}

/// The directions at a point in which f and the second equation change, and how much.
fn rows(basis: &[V; 2], v: &Values, dq: &V) -> [[C; 2]; 2] {
    [
        basis.each_ref().map(|b| dot(&v.df, b)),
        basis.each_ref().map(|b| dot(dq, b)),
    ]
}

/// A solution at the time 1 from one at the time 0; if the path cannot be followed to its end, as
/// to a singular point, the time and the point up to which it was.
fn track(source: &Source, path: &Path, start: &V) -> Result<V, (f64, V)> {
    follow(start, |p, span| {
        let basis = frame(p);
        let d = runge_kutta(span, |time, d, h| {
            let at = along(p, &in_frame(&basis, *d), h);
            let v = source.eval(&at);
            let (_, dq, dt) = path(time, &at, &v);
            solve2(rows(&basis, &v, &dq), [C::ZERO, -dt])
        })?;
        if d[0].norm() + d[1].norm() >= 0.3 {
            return None;
        }
        let predicted = normalised(&along(p, &in_frame(&basis, d), 1.0));
        newton(&predicted, 1e-9, |p| {
            let v = source.eval(p);
            let (q, dq, _) = path(span.to, p, &v);
            let basis = frame(p);
            let d = solve2(rows(&basis, &v, &dq), [-v.f, -q])?;
            let next = normalised(&along(p, &in_frame(&basis, d), 1.0));
            Some((next, d[0].norm() + d[1].norm()))
        })
    })
}

/// The points of a curve on the line through two points, by the method of Aberth.
fn on_line(curve: &Form, degree: usize, a: &V, b: &V) -> Vec<V> {
    let mut roots = vec![C::new(0.8, 0.3)];
    while roots.len() < degree {
        roots.push(roots[roots.len() - 1] * C::new(0.4, 0.9));
    }
    roots.truncate(degree);
    let at = |x: C| [0, 1, 2].map(|i| a[i] + b[i] * x);
    for _ in 0..300 {
        let mut largest = 0.0f64;
        for k in 0..degree {
            let (f, df) = curve.eval(&Monomials::new(&at(roots[k]), degree));
            let slope = dot(&df, b);
            if f.norm2() == 0.0 || slope.norm2() == 0.0 {
                continue;
            }
            let newton = f * slope.inverse();
            let others = (0..degree)
                .filter(|&j| j != k)
                .map(|j| (roots[k] - roots[j]).inverse())
                .fold(C::ZERO, |s, c| s + c);
            let d = newton * (C::ONE - newton * others).inverse();
            if d.norm().is_finite() {
                roots[k] = roots[k] - d;
                largest = largest.max(d.norm() / (1.0 + roots[k].norm()));
            }
        }
        if largest < 1e-14 {
            break;
        }
    }
    roots.into_iter().map(|x| normalised(&at(x))).collect()
}

/// From the section by one plane to that by another, both times a factor, so that the planes in
/// between are complex.
fn between<'a>(
    from: &'a Plane,
    to: &'a Plane,
    phase: C,
) -> impl Fn(f64, &V, &Values) -> (C, V, C) + 'a {
    move |time, _, v| {
        let plane: Plane =
            [0, 1, 2, 3].map(|i| (from[i] * phase).times(1.0 - time) + to[i].times(time));
        let speed: Plane = [0, 1, 2, 3].map(|i| to[i] - from[i] * phase);
        let gradient =
            [0, 1, 2].map(|k| (0..4).fold(C::ZERO, |sum, i| sum + plane[i] * v.dg[i][k]));
        (dot(&plane, &v.g), gradient, dot(&speed, &v.g))
    }
}

/// Each point once, without the base points.
fn distinct(source: &Source, points: impl IntoIterator<Item = V>) -> Vec<V> {
    let mut found: Vec<V> = Vec::new();
    for p in points {
        if source.size(&p) > 1e-8 && found.iter().all(|q| distance(&p, q) > 1e-8) {
            found.push(p);
        }
    }
    found
}

/// The section of a source by a general plane; whether no path was lost.
fn first_section(
    source: &mut Source,
    plane: &Plane,
    control: &Control<'_>,
) -> Result<bool, Stopped> {
    let mut stream = Stream(7);
    // Another try has other lines and other planes in between.
    for _ in 0..4 {
        let lines: Vec<V> = (0..source.degree)
            .map(|_| normalised(&stream.complex()))
            .collect();
        let phase = stream.phase();
        let path = |time: f64, p: &V, v: &Values| {
            let factors: Vec<C> = lines.iter().map(|l| dot(l, p)).collect();
            let mut product = phase;
            let mut gradient = [C::ZERO; 3];
            for (i, line) in lines.iter().enumerate() {
                let others = factors
                    .iter()
                    .enumerate()
                    .filter(|&(k, _)| k != i)
                    .fold(phase, |product, (_, &c)| product * c);
                gradient = [0, 1, 2].map(|k| gradient[k] + line[k] * others);
                product = product * factors[i];
            }
            let target = dot(plane, &v.g);
            let slope =
                [0, 1, 2].map(|k| (0..4).fold(C::ZERO, |sum, i| sum + plane[i] * v.dg[i][k]));
            let mixed = [0, 1, 2].map(|k| gradient[k].times(1.0 - time) + slope[k].times(time));
            (
                product.times(1.0 - time) + target.times(time),
                mixed,
                target - product,
            )
        };
        let mut ends = Vec::new();
        let mut lost = false;
        for line in &lines {
            // Vectors without zeros: with them the only point of a coordinate line may be infinite
            // on this one.
            let [a, b] = frame(&conj(line));
            let [a, b] = [
                [C::new(0.6, 0.3), C::new(0.2, -0.7)],
                [C::new(-0.2, -0.7), C::new(0.6, -0.3)],
            ]
            .map(|c| in_frame(&[a, b], c));
            for p in on_line(&source.curve, source.curve_degree, &a, &b) {
                control.check()?;
                match track(source, &path, &p) {
                    Ok(p) => ends.push(p),
                    // Paths to multiple points at base points stop before their end.
                    Err((time, p)) => lost |= time < 0.99 && source.size(&p) > 1e-4,
                }
            }
        }
        let found = distinct(source, ends);
        // All general planes have the same number of points.
        let complete = !lost || !found.is_empty() && found.len() == source.section.len();
        if found.len() > source.section.len() {
            source.section = found;
        }
        if complete {
            return Ok(true);
        }
    }
    Ok(false)
}

/// A real point of space on the image of a source: a solution of f = 0, Im φ = 0.
#[derive(Clone, Copy, Debug)]
struct State {
    p: V,
    /// In the direction of the solutions nearby, of norm 1; either of the two.
    tangent: V,
    /// (X : Y : Z : W), of norm 1.
    image: [f64; 4],
}

impl State {
    fn inside(&self) -> bool {
        (0..3).all(|i| self.image[i].abs() <= self.image[3].abs())
    }
    fn point(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.image[i] / self.image[3])
    }
}

/// The vector of norm 1 that is real up to a phase, and how far it is from being so.
fn real_image(g: &[C; 4]) -> Option<([f64; 4], f64)> {
    let size = norm(g);
    if size < 1e-13 {
        return None;
    }
    let largest = largest(g);
    let turned = g.map(|c| (c * largest.conj()).times(1.0 / (largest.norm() * size)));
    let real = turned.iter().map(|c| c.re * c.re).sum::<f64>().sqrt();
    let imaginary = turned.iter().map(|c| c.im * c.im).sum::<f64>().sqrt();
    Some((turned.map(|c| c.re / real), imaginary))
}

/// Singular values in descending order, with right singular vectors and the products of the left
/// ones with the right-hand side, of a
/// 5 × 4 matrix: by rotations of its columns (M. R. Hestenes), which finds small values to their
/// own precision.
fn singular_values(mut a: [[f64; 5]; 4], right: &[f64; 5]) -> [(f64, [f64; 4], f64); 4] {
    let mut v: [[f64; 4]; 4] = Default::default();
    for (i, row) in v.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    let product = |x: &[f64; 5], y: &[f64; 5]| (0..5).map(|k| x[k] * y[k]).sum::<f64>();
    for _ in 0..30 {
        let mut rotated = false;
        for i in 0..3 {
            for j in i + 1..4 {
                let (p, q, r) = (
                    product(&a[i], &a[i]),
                    product(&a[j], &a[j]),
                    product(&a[i], &a[j]),
                );
                if r.abs() <= 1e-15 * (p * q).sqrt() || r == 0.0 {
                    continue;
                }
                rotated = true;
                let zeta = (q - p) / (2.0 * r);
                let t = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let c = 1.0 / (1.0 + t * t).sqrt();
                let s = c * t;
                for k in 0..5 {
                    (a[i][k], a[j][k]) = (c * a[i][k] - s * a[j][k], s * a[i][k] + c * a[j][k]);
                }
                for k in 0..4 {
                    (v[i][k], v[j][k]) = (c * v[i][k] - s * v[j][k], s * v[i][k] + c * v[j][k]);
                }
            }
        }
        if !rotated {
            break;
        }
    }
    let mut found = [0, 1, 2, 3].map(|i| {
        let size = product(&a[i], &a[i]).sqrt();
        (
            size,
            v[i],
            if size > 0.0 {
                product(&a[i], right) / size
            } else {
                0.0
            },
        )
    });
    found.sort_by(|x, y| y.0.total_cmp(&x.0));
    found
}

/// The nearest solution of f = 0, Im φ = 0, by the method of Gauss and Newton.
fn settle(source: &Source, start: &V) -> Option<State> {
    let mut p = *start;
    let mut done = false;
    let mut last = f64::INFINITY;
    for _ in 0..12 {
        let v = source.eval(&p);
        let (image, _) = real_image(&v.g)?;
        // Reflection that takes the image to ∓ a unit vector; its other columns are orthogonal to
        // the image.
        let m = (0..4)
            .max_by(|&i, &j| image[i].abs().total_cmp(&image[j].abs()))
            .expect("four");
        let mut n = image;
        n[m] += image[m].signum();
        let n2 = n.iter().map(|x| x * x).sum::<f64>();
        let column =
            |j: usize| [0, 1, 2, 3].map(|i| f64::from(u8::from(i == j)) - 2.0 * n[i] * n[j] / n2);
        let combined = |w: &[f64; 4]| {
            let value = (0..4).fold(C::ZERO, |sum, i| sum + v.g[i].times(w[i]));
            (
                value,
                [0, 1, 2].map(|k| (0..4).fold(C::ZERO, |sum, i| sum + v.dg[i][k].times(w[i]))),
            )
        };
        let (c, dc) = combined(&image);
        let inverse = c.inverse();
        let basis = frame(&p);
        let mut columns = [[0.0; 5]; 4];
        let mut right = [0.0; 5];
        let mut set = |row: usize, value: f64, k: [C; 2], imaginary: bool| {
            right[row] = value;
            for i in 0..2 {
                (columns[2 * i][row], columns[2 * i + 1][row]) = if imaginary {
                    (k[i].im, k[i].re)
                } else {
                    (k[i].re, -k[i].im)
                };
            }
        };
        let k = basis.each_ref().map(|b| dot(&v.df, b));
        set(0, v.f.re, k, false);
        set(1, v.f.im, k, true);
        for (row, j) in (0..4).filter(|&j| j != m).enumerate() {
            let (g, dg) = combined(&column(j));
            let u = g * inverse;
            let du = [0, 1, 2].map(|k| (dg[k] - u * dc[k]) * inverse);
            set(row + 2, u.im, basis.each_ref().map(|b| dot(&du, b)), true);
        }
        let found = singular_values(columns, &right);
        let to_vector = |x: &[f64; 4]| in_frame(&basis, [C::new(x[0], x[1]), C::new(x[2], x[3])]);
        // The forms are small near base points, their rounding errors are not.
        let rounding = 1e-15 / c.norm();
        let residual = right.iter().map(|x| x * x).sum::<f64>().sqrt();
        if done || residual < rounding {
            return (residual < 1e-11 + 4.0 * rounding).then(|| State {
                p,
                tangent: to_vector(&found[3].1),
                image,
            });
        }
        let mut d = [0.0; 4];
        for (size, vector, product) in &found[..3] {
            if *size > 1e-300 {
                for i in 0..4 {
                    d[i] -= product / size * vector[i];
                }
            }
        }
        let size = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Near base points steps in the stiff directions come first, and longer ones in the others
        // after them.
        if !size.is_finite() || size > 0.3 || size > (2.0 * last).max(1e-3) {
            return None;
        }
        p = normalised(&along(&p, &to_vector(&d), 1.0));
        done = size < 1e-10 || size < 1e-6 && size > 0.3 * last;
        last = size;
    }
    None
}

/// Where a branch of a solitary curve ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Face,
    Real,
    Closed,
    Lost,
}

/// Follows a curve from a solution in the direction of its tangent: the solutions after it.
fn trace(source: &Source, start: &State, tolerance: f64) -> (Vec<State>, End) {
    let mut nodes = vec![*start];
    let mut step = 0.02f64;
    while nodes.len() < 100_000 {
        let here = nodes[nodes.len() - 1];
        let go = |h: f64| settle(source, &normalised(&along(&here.p, &here.tangent, h)));
        let attempt = || -> Option<(State, Option<End>, f64)> {
            let predicted = normalised(&along(&here.p, &here.tangent, step));
            let mut next = settle(source, &predicted)?;
            let error = distance(&predicted, &next.p);
            let mut turn = inner(&here.tangent, &next.tangent).re;
            if turn < 0.0 {
                next.tangent = next.tangent.map(|c| -c);
                turn = -turn;
            }
            if turn < 0.95 || error > 0.25 * step {
                return None;
            }
            let mut end = None;
            let same_side = real_line(&here.p)
                .iter()
                .zip(real_line(&next.p))
                .map(|(a, b)| a * b)
                .sum::<f64>()
                > 0.0;
            if !same_side {
                // Beyond a real parameter the curve comes back along the conjugate ones, unless f =
                // 0 has conjugate branches there.
                let back = blend(&here.p, -1.0);
                let chord = [0, 1, 2].map(|i| back[i] - here.p[i]);
                if inner(&here.tangent, &chord).re > 0.9 * inner(&chord, &chord).re.sqrt() {
                    (next, end) = (real_end(source, &here)?, Some(End::Real));
                }
            }
            if !next.inside() {
                let (mut lo, mut hi, mut best) = (0.0, step, here);
                while hi - lo > 1e-15 + 1e-14 * hi {
                    let middle = 0.5 * (lo + hi);
                    let state = go(middle)?;
                    if state.inside() {
                        (lo, best) = (middle, state);
                    } else {
                        hi = middle;
                    }
                }
                let x = best.image;
                let i = (0..3)
                    .max_by(|&i, &j| x[i].abs().total_cmp(&x[j].abs()))
                    .expect("three");
                best.image[i] = x[3].abs() * x[i].signum();
                (next, end) = (best, Some(End::Face));
            }
            // Between here and a base point nothing more can be told.
            let middle = settle(source, &normalised(&along(&here.p, &next.p, 1.0)));
            let Some(middle) = middle else {
                return if end == Some(End::Real) {
                    Some((next, end, error))
                } else {
                    None
                };
            };
            if step > 1e-7
                && distance_to_segment(middle.point(), [here.point(), next.point()])
                    > 0.5 * tolerance
            {
                return None;
            }
            Some((next, end, error))
        };
        let Some((next, end, error)) = attempt() else {
            step /= 2.0;
            if step < 1e-10 {
                return (nodes, End::Lost);
            }
            continue;
        };
        let moved = distance(&here.p, &next.p);
        if nodes.len() > 2
            && [start.p, conj(&start.p)]
                .iter()
                .any(|p| on_step(p, &here.p, &next.p, moved))
        {
            nodes.push(*start);
            return (nodes, End::Closed);
        }
        nodes.push(next);
        if let Some(end) = end {
            return (nodes, end);
        }
        if error < 0.05 * step {
            step = (1.5 * step).min(0.1);
        }
    }
    (nodes, End::Lost)
}

/// The end of a curve at a real parameter nearby, if there is one: extrapolated, since close to it
/// the equations are all but singular.
///
/// The curve goes on along the conjugate parameters; with a coordinate u on it that changes its
/// sign with conjugation, the image is even in u.
fn real_end(source: &Source, here: &State) -> Option<State> {
    let side = real_line(&here.p);
    let coordinate = |p: &V| {
        real_line(p)
            .iter()
            .zip(&side)
            .map(|(a, b)| a * b)
            .sum::<f64>()
            / length(&side)
    };
    let mut last = *here;
    let mut squares: Vec<f64> = Vec::new();
    let mut row: Vec<[f64; 3]> = Vec::new();
    let mut found: Option<(f64, [f64; 3])> = None;
    for k in 0..12 {
        let u = coordinate(&last.p);
        // Neville's scheme in u², one row for each value.
        let mut next = vec![last.point()];
        squares.push(u * u);
        for (order, old) in row.iter().enumerate() {
            let weight = squares[k] / (squares[k - order - 1] - squares[k]);
            let value = [0, 1, 2].map(|c| next[order][c] + (next[order][c] - old[c]) * weight);
            let change =
                [&next[order], old].map(|other| length(&[0, 1, 2].map(|c| value[c] - other[c])));
            let error = change[0].max(change[1]);
            if error.is_finite() && found.is_none_or(|(least, _)| error < least) {
                found = Some((error, value));
            }
            next.push(value);
        }
        row = next;
        // Half as far from the real parameter, from here and the conjugate, which is at the same
        // distance beyond it.
        let Some(nearer) = settle(source, &normalised(&blend(&last.p, 0.5))) else {
            break;
        };
        let v = coordinate(&nearer.p);
        if !(0.4 * u..0.6 * u).contains(&v) || distance(&nearer.p, &last.p) > 2.0 * u {
            break;
        }
        last = nearer;
    }
    let (_, x) =
        found.filter(|(error, _)| squares.len() > 4 || squares.len() > 2 && *error < 1e-8)?;
    let size = (1.0 + x.iter().map(|v| v * v).sum::<f64>()).sqrt();
    Some(State {
        p: normalised(&blend(&last.p, 0.0)),
        tangent: last.tangent,
        image: [x[0], x[1], x[2], 1.0].map(|v| v / size),
    })
}

/// Between a point, at 1, and its conjugate, at −1.
fn blend(p: &V, at: f64) -> V {
    let other = conj(p);
    let product = inner(&other, p);
    let phase = product.times(1.0 / product.norm());
    [0, 1, 2].map(|i| p[i].times(0.5 * (1.0 + at)) + (other[i] * phase).times(0.5 * (1.0 - at)))
}

/// Whether a point lies on the way from one to the next, whose tangents differ by little.
fn on_step(p: &V, a: &V, b: &V, moved: f64) -> bool {
    distance(p, a) + distance(p, b) <= 1.03 * moved + 1e-9
}

/// A solution in one of the planes.
struct Hit {
    source: usize,
    state: State,
    /// Whether a real parameter leads to the same point.
    covered: bool,
    /// The other non-real parameters of the same point, with their sources.
    others: Vec<(usize, V)>,
}

struct Traced {
    source: usize,
    nodes: Vec<State>,
}

impl Traced {
    /// The index of the node before a parameter, or before its conjugate, if it is on the curve.
    fn place(&self, p: &V) -> Option<usize> {
        let other = conj(p);
        self.nodes.windows(2).position(|w| {
            let moved = distance(&w[0].p, &w[1].p);
            on_step(p, &w[0].p, &w[1].p, moved) || on_step(&other, &w[0].p, &w[1].p, moved)
        })
    }
}

struct Search {
    sources: Vec<Source>,
    /// In units of the half-width, as all points.
    tolerance: f64,
    arcs: Vec<Vec<[f64; 3]>>,
    problems: Vec<Finding>,
}

/// The plane whose section is computed first.
fn general_plane() -> Plane {
    Stream(11).complex()
}

/// An orthogonal matrix without pattern, so that lines of symmetric surfaces are not parallel to
/// the planes.
fn directions() -> [[f64; 3]; 3] {
    // The rotation of the quaternion (5, 1, −2, 3).
    let [w, x, y, z] = [5.0, 1.0, -2.0, 3.0];
    let n = w * w + x * x + y * y + z * z;
    [
        [
            w * w + x * x - y * y - z * z,
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            w * w - x * x + y * y - z * z,
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            w * w - x * x - y * y + z * z,
        ],
    ]
    .map(|row| row.map(|v| v / n))
}

impl Search {
    /// The curves, and their sections by a general plane.
    fn prepare(
        &mut self,
        map: &Map,
        singular: &Singular,
        half_width: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let forms = rounded(map.forms().each_ref());
        for curve in curves_of(map, singular) {
            let [terms] = rounded([&curve.curve]);
            let source = Source::new(
                Form::new(terms),
                curve.curve.total_degree(),
                forms.clone(),
                map.degree(),
                half_width,
            );
            self.sources.push(source);
        }
        for BasePoint { seam, .. } in base_points(map, control)? {
            self.add_seams(&seam, half_width);
        }
        let general = general_plane();
        for source in &mut self.sources {
            if !first_section(source, &general, control)? {
                self.problems.push(Finding::SectionLost);
            }
        }
        Ok(())
    }

    fn run(
        &mut self,
        map: &Map,
        singular: &Singular,
        half_width: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        self.prepare(map, singular, half_width, control)?;
        let hits = self.hits(control)?;
        let mut traced = Vec::new();
        for hit in &hits {
            control.check()?;
            // Several pairs may lead to the same curve.
            if !hit.others.iter().any(|(k, p)| {
                traced
                    .iter()
                    .any(|t: &Traced| t.source == *k && t.place(p).is_some())
            }) {
                traced.push(self.both_ways(hit.source, &hit.state));
            }
        }
        let minors = reduced_minors(map, control)?;
        if minors.iter().map(Poly::total_degree).max().unwrap_or(0) <= PINCH_DEGREE {
            for pinch in pinches(map, &minors, control)? {
                let p = normalised(&pinch.map(|x| C::new(x.to_f64(), 0.0)));
                for k in 0..self.sources.len() {
                    control.check()?;
                    if let Some(arc) = self.arc_at_pinch(k, &p, &traced) {
                        traced.push(arc);
                    }
                }
            }
        }
        for arc in &traced {
            self.keep_uncovered(arc, &hits, control)?;
        }
        Ok(())
    }

    fn add_seams(&mut self, seam: &Seam, half_width: f64) {
        let degree = seam.curve[0].degree();
        if degree > 0 {
            let forms = seam.curve.each_ref().map(|f| {
                let terms = f
                    .to_f64()
                    .into_iter()
                    .enumerate()
                    .filter(|(_, c)| *c != 0.0);
                terms
                    .map(|(j, c)| ([degree - j, j, 0], c))
                    .collect::<Vec<_>>()
            });
            if !forms[3].is_empty() {
                let line = Form::new([([0, 0, 1], 1.0)]);
                self.sources
                    .push(Source::new(line, 1, forms, degree, half_width));
            }
        }
        for near in &seam.near {
            self.add_seams(&near.seam, half_width);
        }
    }

    /// The section of a source by a plane, from that by the plane before and if need be from the
    /// general one.
    fn section(&self, source: usize, before: Option<(&Plane, &[V])>, plane: &Plane) -> Vec<V> {
        let source = &self.sources[source];
        let mut stream = Stream(13);
        let general = general_plane();
        let mut found = Vec::new();
        for (from, points) in before.into_iter().chain([
            (&general, &source.section[..]),
            (&general, &source.section[..]),
        ]) {
            let phase = stream.phase();
            let path = between(from, plane, phase);
            let ends = points.iter().filter_map(|p| track(source, &path, p).ok());
            let ends = distinct(source, ends.collect::<Vec<_>>());
            if ends.len() > found.len() {
                found = ends;
            }
            if found.len() == source.section.len() {
                break;
            }
        }
        found
    }

    /// Non-real parameters of real points in the box, in all planes.
    fn hits(&self, control: &Control<'_>) -> Result<Vec<Hit>, Stopped> {
        let mut hits = Vec::new();
        let diagonal = 3f64.sqrt();
        let mut pencils: Vec<Vec<Plane>> = Vec::new();
        let points: usize = self.sources.iter().map(|source| source.section.len()).sum();
        let slices = (POINTS / points.max(1)).clamp(SLICES[1], SLICES[0]);
        for normal in directions() {
            let offset = |i: usize| diagonal * ((2 * i + 1) as f64 / slices as f64 - 1.0 + 0.013);
            pencils.push((0..slices).map(|i| real_plane(normal, offset(i))).collect());
        }
        for i in 0..3 {
            let mut normal = [0.0; 3];
            normal[i] = 1.0;
            pencils.extend([-1.0, 1.0].map(|side| vec![real_plane(normal, side)]));
        }
        for pencil in pencils {
            let mut before: Vec<Option<Vec<V>>> = self.sources.iter().map(|_| None).collect();
            for (i, plane) in pencil.iter().enumerate() {
                control.check()?;
                let mut candidates = Vec::new();
                let mut real = Vec::new();
                for k in 0..self.sources.len() {
                    let from = before[k].as_deref().map(|points| (&pencil[i - 1], points));
                    let points = self.section(k, from, plane);
                    for p in &points {
                        let Some((image, imaginary)) = real_image(&self.sources[k].eval(p).g)
                        else {
                            continue;
                        };
                        if imaginary > 1e-7
                            || (0..3).any(|i| image[i].abs() > (1.0 + 1e-9) * image[3].abs())
                        {
                            continue;
                        }
                        if length(&real_line(p)) < 1e-6 {
                            real.push(image);
                        } else {
                            candidates.push((k, *p, image));
                        }
                    }
                    // A chain goes on only from complete sections.
                    before[k] = (points.len() == self.sources[k].section.len()).then_some(points);
                }
                for &(k, p, _) in &candidates {
                    let Some(state) = settle(&self.sources[k], &p) else {
                        continue;
                    };
                    if distance(&state.p, &p) > 1e-6 {
                        continue;
                    }
                    let covered = real.iter().any(|image| same_point(image, &state.image));
                    let same = candidates
                        .iter()
                        .filter(|other| same_point(&other.2, &state.image));
                    hits.push(Hit {
                        source: k,
                        state,
                        covered,
                        others: same.map(|other| (other.0, other.1)).collect(),
                    });
                }
            }
        }
        Ok(hits)
    }

    fn report(&mut self, end: End, last: &State) {
        if end == End::Lost {
            self.problems
                .push(Finding::SolitaryLost { at: last.point() });
        }
    }

    fn both_ways(&mut self, source: usize, start: &State) -> Traced {
        let (ahead, end) = trace(&self.sources[source], start, self.tolerance);
        self.report(end, &ahead[ahead.len() - 1]);
        if end == End::Closed {
            return Traced {
                source,
                nodes: ahead,
            };
        }
        let back = State {
            tangent: start.tangent.map(|c| -c),
            ..*start
        };
        let (mut nodes, end) = trace(&self.sources[source], &back, self.tolerance);
        self.report(end, &nodes[nodes.len() - 1]);
        nodes.reverse();
        nodes.extend(&ahead[1..]);
        Traced { source, nodes }
    }

    /// The solitary arc at a real parameter where the rank of the Jacobian drops, unless it is
    /// known.
    fn arc_at_pinch(&mut self, source: usize, p: &V, traced: &[Traced]) -> Option<Traced> {
        let v = self.sources[source].eval(p);
        let gradient = norm(&v.df);
        if gradient < 1e-12 || v.f.norm() > 1e-6 * gradient {
            return None;
        }
        // Along f = 0 the map is even at p: imaginary steps lead to real points.
        let along_curve = [[1, 2], [2, 0], [0, 1]].map(|[i, j]| p[i] * v.df[j] - p[j] * v.df[i]);
        let tangent = normalised(&along_curve).map(|c| c * C::new(0.0, 1.0));
        let (image, _) = real_image(&v.g)?;
        // Far enough for the equations to be regular, near enough for other pinch points not to
        // interfere.
        let (mut start, far) = [1e-3, 1e-4, 1e-5].into_iter().find_map(|far| {
            let predicted = normalised(&along(p, &tangent, far));
            let state = settle(&self.sources[source], &predicted)?;
            (distance(&state.p, &predicted) < 0.2 * far && state.inside()).then_some((state, far))
        })?;
        let ends_here = |t: &Traced| {
            [&t.nodes[0], &t.nodes[t.nodes.len() - 1]]
                .iter()
                .any(|s| distance(&s.p, p) < far)
        };
        if traced
            .iter()
            .any(|t| t.source == source && (ends_here(t) || t.place(&start.p).is_some()))
        {
            return None;
        }
        if self.fibre(&start.image).iter().any(|(k, p, _)| {
            traced
                .iter()
                .any(|t| t.source == *k && t.place(p).is_some())
        }) {
            return None;
        }
        if inner(&tangent, &start.tangent).re < 0.0 {
            start.tangent = start.tangent.map(|c| -c);
        }
        let (nodes, end) = trace(&self.sources[source], &start, self.tolerance);
        self.report(end, &nodes[nodes.len() - 1]);
        let first = State {
            p: *p,
            tangent,
            image,
        };
        Some(Traced {
            source,
            nodes: [first].into_iter().chain(nodes).collect(),
        })
    }

    /// All parameters of a point on double curves, with their sources, and whether they are real.
    fn fibre(&self, image: &[f64; 4]) -> Vec<(usize, V, bool)> {
        let normal = directions()[0];
        let offset = (0..3).map(|i| normal[i] * image[i]).sum::<f64>() / image[3];
        let plane = real_plane(normal, offset);
        let mut found = Vec::new();
        for (k, source) in self.sources.iter().enumerate() {
            for p in self.section(k, None, &plane) {
                if real_image(&source.eval(&p).g)
                    .is_some_and(|(other, imaginary)| imaginary < 1e-7 && same_point(&other, image))
                {
                    found.push((k, p, length(&real_line(&p)) < 1e-6));
                }
            }
        }
        found
    }

    /// Whether a real parameter leads to the point, too.
    fn is_covered(&self, image: &[f64; 4]) -> bool {
        self.fibre(image).iter().any(|found| found.2)
    }

    /// Adds the parts of a curve that no real parameters reach.
    fn keep_uncovered(
        &mut self,
        arc: &Traced,
        hits: &[Hit],
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let mut known: Vec<(usize, bool)> = Vec::new();
        for hit in hits.iter().filter(|hit| hit.source == arc.source) {
            known.extend(arc.place(&hit.state.p).map(|i| (i, hit.covered)));
        }
        if known.is_empty() {
            let middle = arc.nodes.len() / 2;
            known.push((middle, self.is_covered(&arc.nodes[middle].image)));
        }
        known.sort_unstable();
        let mut part: Vec<[f64; 3]> = Vec::new();
        let mut from = 0;
        for pair in known.windows(2).filter(|pair| pair[0].1 != pair[1].1) {
            // Real parameters come and go in pairs, at points that are found by bisection: between
            // nodes, and between two of them.
            let before = pair[0].1;
            let (mut lo, mut hi) = (pair[0].0, pair[1].0 + 1);
            while hi - lo > 1 {
                control.check()?;
                let middle = usize::midpoint(lo, hi);
                if self.is_covered(&arc.nodes[middle].image) == before {
                    lo = middle;
                } else {
                    hi = middle;
                }
            }
            let (mut a, mut b) = (arc.nodes[lo], arc.nodes[hi]);
            for _ in 0..30 {
                control.check()?;
                let Some(middle) = settle(
                    &self.sources[arc.source],
                    &normalised(&along(&a.p, &b.p, 1.0)),
                ) else {
                    break;
                };
                if self.is_covered(&middle.image) == before {
                    a = middle;
                } else {
                    b = middle;
                }
            }
            if before {
                part = vec![b.point()];
            } else {
                part.extend(arc.nodes[from..=lo].iter().map(State::point));
                part.push(a.point());
                self.arcs.push(std::mem::take(&mut part));
            }
            from = hi;
        }
        if !known[known.len() - 1].1 {
            part.extend(arc.nodes[from..].iter().map(State::point));
            self.arcs.push(part);
        }
        Ok(())
    }
}

fn same_point(a: &[f64; 4], b: &[f64; 4]) -> bool {
    (0..3).all(|i| (a[i] * b[3] - b[i] * a[3]).abs() < 1e-6 * (a[3] * b[3]).abs())
}
