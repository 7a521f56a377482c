//! Intersection curve of two surfaces, between two vertices.
//!
//! Points of the curve are found by Newton's method from the nodes of the mesh. Lines, circles and
//! ellipses are recognised from these points. All other curves become quintic B-splines: between
//! two points the polynomial with their tangents and curvatures, in arc length, which differs from
//! the curve by the sixth power of the distance; pieces are halved until the spline lies on both
//! surfaces.

use crate::locus::{Distance, Locus};
use crate::newton::{MEETING_ROUNDING, gap, meet};
use isoform_geom::brep::{Axes, BSpline, Curve, Surface};
use isoform_geom::{Point3, cross, dot, norm, sub};
use isoform_num::gauss_legendre;

/// Minimum number of pieces between points from which a curve is recognised: any three points are
/// on a circle.
const MIN_CURVE_PIECES: usize = 8;

/// Input for the curve of an edge.
pub(crate) struct CurveRequest<'a> {
    /// Loci that intersect in it.
    pub(crate) surfaces: [&'a Locus; 2],
    /// Ends of the edge.
    pub(crate) ends: [Point3; 2],
    /// Points near it, in order, ends excluded.
    pub(crate) between: &'a [Point3],
    /// Size of the model.
    pub(crate) size: f64,
}

/// Returns the curve; `None` if no spline was found that lies on both surfaces.
pub(crate) fn curve(wanted: &CurveRequest<'_>) -> Option<Curve> {
    let mut path = vec![wanted.ends[0]];
    path.extend_from_slice(wanted.between);
    path.push(wanted.ends[1]);
    let parts = MIN_CURVE_PIECES.div_ceil(path.len() - 1).max(2);
    let mut near: Vec<(Point3, Point3)> = Vec::with_capacity(parts * path.len());
    for (i, w) in path.windows(2).enumerate() {
        let ahead = sub(path[(i + 2).min(path.len() - 1)], path[i.max(1) - 1]);
        near.extend((i > 0).then_some((w[0], ahead)));
        near.extend((1..parts).map(|n| {
            let s = n as f64 / parts as f64;
            let p = std::array::from_fn(|k| (1.0 - s) * w[0][k] + s * w[1][k]);
            (p, ahead)
        }));
    }
    let near = near
        .into_iter()
        .map(|(p, ahead)| (meet(wanted.surfaces, p), ahead));
    let mut points = forward(wanted.ends, near);
    while points.len() <= MIN_CURVE_PIECES {
        points = with_middles(&points, wanted.surfaces);
    }
    let on = MEETING_ROUNDING * wanted.size;
    if is_line(&points, on) {
        return Some(Curve::Line);
    }
    circle(&points, on)
        .or_else(|| ellipse(&points, wanted.surfaces, on))
        .or_else(|| spline(wanted, &points).map(Curve::BSpline))
}

/// Returns the ends and the points between them, in order. `near` gives each point with the
/// direction in which the curve runs there. Nodes of the mesh near an end may project behind it, so
/// that the curve would turn back: such points are left out.
fn forward(ends: [Point3; 2], near: impl Iterator<Item = (Point3, Point3)>) -> Vec<Point3> {
    let mut points = vec![ends[0]];
    let mut last = [0.0; 3];
    for (p, ahead) in near {
        if dot(sub(p, points[points.len() - 1]), ahead) > 0.0 {
            points.push(p);
        }
        last = ahead;
    }
    while points.len() > 1 && dot(sub(ends[1], points[points.len() - 1]), last) <= 0.0 {
        points.pop();
    }
    points.push(ends[1]);
    points
}

/// Returns the points of a curve with one more between each two.
fn with_middles(points: &[Point3], surfaces: [&Locus; 2]) -> Vec<Point3> {
    let mut all = vec![points[0]];
    for w in points.windows(2) {
        let half = std::array::from_fn(|k| 0.5 * (w[0][k] + w[1][k]));
        all.extend([meet(surfaces, half), w[1]]);
    }
    all
}

fn is_line(points: &[Point3], on: f64) -> bool {
    let ends = [points[0], points[points.len() - 1]];
    let d = sub(ends[1], ends[0]);
    let length = norm(d);
    length > 0.0
        && points
            .iter()
            .all(|p| norm(cross(sub(*p, ends[0]), d)) <= on * length)
}

/// Returns the point farthest from the line through the ends.
fn farthest(points: &[Point3]) -> Point3 {
    let (a, b) = (points[0], points[points.len() - 1]);
    let d = sub(b, a);
    let off = |p: &Point3| norm(cross(sub(*p, a), d));
    let best = points.iter().max_by(|p, q| off(p).total_cmp(&off(q)));
    *best.unwrap_or(&a)
}

/// Returns axes about `z` oriented so that points run counterclockwise, with x towards `x`. All
/// points count: the second may lie behind the first if an end is not exactly at a node of the
/// mesh.
fn oriented(center: Point3, z: Point3, x: Point3, points: &[Point3]) -> Axes {
    let swept = points.windows(2).map(|w| {
        let (r, d) = (sub(w[0], center), sub(w[1], w[0]));
        dot(z, cross(r, d))
    });
    let z = if swept.sum::<f64>() < 0.0 {
        z.map(|v| -v)
    } else {
        z
    };
    Axes::along(center, z).turned(x)
}

fn circle(points: &[Point3], on: f64) -> Option<Curve> {
    let (a, b, m) = (points[0], points[points.len() - 1], farthest(points));
    let (u, v) = (sub(m, a), sub(b, a));
    let n = cross(u, v);
    let n2 = dot(n, n);
    if n2 == 0.0 {
        return None;
    }
    // The centre of the circle through a, a + u and a + v.
    let (p, q) = (cross(v, n), cross(n, u));
    let (uu, vv) = (dot(u, u), dot(v, v));
    let center: Point3 = std::array::from_fn(|k| a[k] + (uu * p[k] + vv * q[k]) / (2.0 * n2));
    let radius = norm(sub(a, center));
    let axes = oriented(center, n.map(|v| v / n2.sqrt()), sub(a, center), points);
    let is_on = |p: &Point3| {
        let [x, y, z] = axes.local(*p);
        z.abs() <= on && (x.hypot(y) - radius).abs() <= on
    };
    points
        .iter()
        .all(is_on)
        .then_some(Curve::Circle(axes, radius))
}

/// Returns the section of a cylinder, cone or ellipsoid by the plane of the points.
fn ellipse(points: &[Point3], surfaces: [&Locus; 2], on: f64) -> Option<Curve> {
    let exact = || surfaces.iter().filter_map(|s| s.surface());
    let plane = exact().find_map(|s| match s {
        Surface::Plane(axes) => Some((axes.origin, axes.z)),
        _ => None,
    });
    let (p, n) = plane.or_else(|| {
        let (a, b, m) = (points[0], points[points.len() - 1], farthest(points));
        let n = cross(sub(m, a), sub(b, a));
        let length = norm(n);
        (length > 0.0).then(|| (a, n.map(|v| v / length)))
    })?;
    exact().find_map(|surface| {
        let (center, x, a, b) = match *surface {
            Surface::Cylinder(axes, radius) => of_cylinder(&axes, radius, p, n)?,
            Surface::Cone(_, _, half_angle) => of_cone(surface, half_angle, p, n)?,
            Surface::Ellipsoid(ball) => {
                let (center, [a, b]) = ball.section(p, n)?;
                (center, a, norm(a), norm(b))
            }
            _ => return None,
        };
        let axes = oriented(center, n, x, points);
        let is_on = |p: &Point3| {
            let [x, y, z] = axes.local(*p);
            z.abs() <= on && ((x / a).hypot(y / b) - 1.0).abs() * b <= on
        };
        points
            .iter()
            .all(is_on)
            .then_some(Curve::Ellipse(axes, a, b))
    })
}

/// Centre, direction of the larger half axis, and half axes.
type Section = (Point3, Point3, f64, f64);

fn of_cylinder(axes: &Axes, radius: f64, p: Point3, n: Point3) -> Option<Section> {
    let cos = dot(n, axes.z);
    if cos.abs() < 1e-6 {
        return None;
    }
    let t = dot(n, sub(p, axes.origin)) / cos;
    let center = axes.point([0.0, 0.0, t]);
    let x = std::array::from_fn(|k| axes.z[k] - cos * n[k]);
    Some((center, x, radius / cos.abs(), radius))
}

fn of_cone(cone: &Surface, half_angle: f64, p: Point3, n: Point3) -> Option<Section> {
    let (apex, z) = (cone.apex()?, cone.axes().z);
    let flat: Point3 = std::array::from_fn(|k| n[k] - dot(n, z) * z[k]);
    let length = norm(flat);
    if length < 1e-6 {
        return None;
    }
    let e = flat.map(|v| v / length);
    let (sin, cos) = half_angle.sin_cos();
    // The two lines of the cone in its plane of symmetry.
    let at = |side: f64| {
        let d: Point3 = std::array::from_fn(|k| cos * z[k] + side * sin * e[k]);
        let t = dot(n, sub(p, apex)) / dot(n, d);
        (t, std::array::from_fn::<f64, 3, _>(|k| apex[k] + t * d[k]))
    };
    let ((s, first), (t, second)) = (at(1.0), at(-1.0));
    if !(s * t > 0.0 && s.is_finite() && t.is_finite()) {
        return None;
    }
    let center: Point3 = std::array::from_fn(|k| 0.5 * (first[k] + second[k]));
    let (height, off) = (dot(sub(center, apex), z), dot(sub(center, apex), e));
    let b2 = (height * half_angle.tan()).powi(2) - off * off;
    let x = sub(first, second);
    (b2 > 0.0).then(|| (center, x, 0.5 * norm(x), b2.sqrt()))
}

/// A point of a curve with its tangent and its curvature vector.
#[derive(Clone, Copy)]
pub(crate) struct Jet {
    pub(crate) p: Point3,
    pub(crate) t: Point3,
    pub(crate) k: Point3,
}

impl Jet {
    /// Returns the jet of the reversed curve.
    fn turned(self) -> Self {
        let t = self.t.map(|v| -v);
        Self { t, ..self }
    }
}

/// Returns the tangent and curvature of the curve of two surfaces, its tangent along `direction`;
/// `None` if the surfaces are nearly tangent.
pub(crate) fn jet(surfaces: [&Locus; 2], p: Point3, direction: Point3) -> Option<Jet> {
    let [a, b] = surfaces.map(|s| s.distance(p).1);
    let c = cross(a, b);
    let sin = norm(c);
    // Surfaces that are nearly tangent leave the direction of the curve open.
    if sin.is_nan() || sin < 1e-6 {
        return None;
    }
    let sign = if dot(c, direction) < 0.0 { -1.0 } else { 1.0 };
    let t = c.map(|v| sign * v / sin);
    // a·k = −t·A t, b·k = −t·B t, t·k = 0.
    let [ra, rb] = surfaces.map(|s| -s.bending(p, t));
    let cos = dot(a, b);
    let (fa, fb) = ((ra - cos * rb) / (sin * sin), (rb - cos * ra) / (sin * sin));
    let k = std::array::from_fn(|i| fa * a[i] + fb * b[i]);
    Some(Jet { p, t, k })
}

/// Bézier points of a quintic over an arc of a length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bezier {
    control: [Point3; 6],
    length: f64,
}

impl Bezier {
    /// Returns the point and the derivative at a parameter, 1 at the end.
    pub(crate) fn at(&self, s: f64) -> (Point3, Point3) {
        bezier(&self.control, s)
    }
    /// Returns the polynomial restricted to the interval from its beginning to a parameter, which
    /// may lie beyond the end.
    pub(crate) fn up_to(&self, s: f64) -> Self {
        let mut d = self.control;
        let mut control = self.control;
        for r in 1..6 {
            for j in 0..6 - r {
                d[j] = std::array::from_fn(|k| (1.0 - s) * d[j][k] + s * d[j + 1][k]);
            }
            control[r] = d[0];
        }
        let length = s * self.length;
        Self { control, length }
    }
    /// Returns the reversed curve.
    pub(crate) fn reversed(mut self) -> Self {
        self.control.reverse();
        self
    }
}

/// Returns the Bézier points of the quintic between two jets over an arc of a length.
fn quintic(a: &Jet, b: &Jet, length: f64) -> [Point3; 6] {
    let (l, l2) = (length, length * length);
    let at = |f: &dyn Fn(usize) -> f64| -> Point3 { std::array::from_fn(f) };
    [
        a.p,
        at(&|i| a.p[i] + l / 5.0 * a.t[i]),
        at(&|i| a.p[i] + 0.4 * l * a.t[i] + l2 / 20.0 * a.k[i]),
        at(&|i| b.p[i] - 0.4 * l * b.t[i] + l2 / 20.0 * b.k[i]),
        at(&|i| b.p[i] - l / 5.0 * b.t[i]),
        b.p,
    ]
}

/// Returns a point of a Bézier curve, and its derivative.
fn bezier(control: &[Point3; 6], s: f64) -> (Point3, Point3) {
    let mut d = *control;
    let mut derivative = [0.0; 3];
    for r in (1..6).rev() {
        if r == 1 {
            derivative = sub(d[1], d[0]).map(|v| 5.0 * v);
        }
        for j in 0..r {
            d[j] = std::array::from_fn(|k| (1.0 - s) * d[j][k] + s * d[j + 1][k]);
        }
    }
    (d[0], derivative)
}

/// Returns the quintic between two jets whose assumed length is its own.
fn piece(a: &Jet, b: &Jet) -> Bezier {
    let (nodes, weights) = gauss_legendre(8);
    let mut length = norm(sub(b.p, a.p));
    for _ in 0..6 {
        let control = quintic(a, b, length);
        let speed = |x: &f64| norm(bezier(&control, *x).1);
        length = nodes.iter().zip(&weights).map(|(x, w)| w * speed(x)).sum();
    }
    let control = quintic(a, b, length);
    Bezier { control, length }
}

/// Returns the spline through points of a curve, ends included, that lies on both surfaces.
fn spline(wanted: &CurveRequest<'_>, points: &[Point3]) -> Option<BSpline> {
    Some(joined(&pieces(wanted, points)?))
}

/// Returns the pieces of that spline.
pub(crate) fn pieces(wanted: &CurveRequest<'_>, points: &[Point3]) -> Option<Vec<Bezier>> {
    let start = starts(wanted, points)?;
    let mut pieces = Vec::new();
    for pair in start.windows(2) {
        // Each piece is halved at most twelve times.
        refine(wanted, [pair[0], pair[1]], 12, &mut pieces)?;
    }
    Some(pieces)
}

/// Returns points of the curve between which tangents turn little.
fn starts(wanted: &CurveRequest<'_>, points: &[Point3]) -> Option<Vec<Jet>> {
    let last = points.len() - 1;
    let jets: Option<Vec<Jet>> = (0..=last)
        .map(|i| {
            let direction = sub(points[(i + 1).min(last)], points[i.max(1) - 1]);
            let found = jet(wanted.surfaces, points[i], direction);
            // At an end the curve needs a direction on one side only.
            let other = match i {
                0 => near_end(wanted, points[0], direction),
                _ if i == last => near_end(wanted, points[last], direction.map(|v| -v)),
                _ => return found,
            };
            let other = other.map(|jet| if i == 0 { jet } else { jet.turned() });
            match (found, other) {
                // A larger difference of the tangents at an end and near it (moved back) shows a
                // tip; otherwise it is the change of the curvature on the way.
                (Some(a), Some(b)) if norm(sub(a.t, b.t)) <= 1e-4 => Some(a),
                (_, Some(b)) => Some(b),
                (a, None) => a,
            }
        })
        .collect();
    let jets = jets?;
    let mut kept = vec![jets[0]];
    for i in 1..last {
        // Between points that splines start with, tangents turn by less than 30°.
        if dot(kept[kept.len() - 1].t, jets[i + 1].t) < 0.866 {
            kept.push(jets[i]);
        }
    }
    kept.push(jets[last]);
    Some(kept)
}

/// Returns the jet at an end of the curve where a surface has no normal, as at a tip: that of a
/// point near it in a direction, moved back.
fn near_end(wanted: &CurveRequest<'_>, end: Point3, direction: Point3) -> Option<Jet> {
    // A millionth of the size away the curve has a direction, and the error of moving its tangent
    // back is of the third power of this distance.
    let by = 1e-6 * wanted.size / norm(direction);
    let near = std::array::from_fn(|k| end[k] + by * direction[k]);
    let Jet { p, t, k } = jet(wanted.surfaces, meet(wanted.surfaces, near), direction)?;
    let way = norm(sub(p, end));
    let t = std::array::from_fn(|i| t[i] - way * k[i]);
    Some(Jet { p: end, t, k })
}

/// Returns the maximum distance of a spline from its surfaces, in sizes of the model.
fn spline_gap(wanted: &CurveRequest<'_>) -> f64 {
    if wanted.surfaces.iter().all(|s| s.surface().is_some()) {
        // Far below what readers resolve (1e-8); a smaller gap makes splines longer without a
        // benefit.
        5e-10
    } else {
        // Faces on functions are splines themselves, a hundred times farther away.
        1e-8
    }
}

/// Adds pieces between two jets that lie on both surfaces; `None` if `depth` halvings do not
/// suffice.
fn refine(
    wanted: &CurveRequest<'_>,
    [a, b]: [Jet; 2],
    depth: usize,
    pieces: &mut Vec<Bezier>,
) -> Option<()> {
    let made = piece(&a, &b);
    let off = (1..8).map(|i| gap(wanted.surfaces, made.at(f64::from(i) / 8.0).0));
    if off.fold(0.0, f64::max) <= spline_gap(wanted) * wanted.size {
        pieces.push(made);
        return Some(());
    }
    if depth == 0 {
        return None;
    }
    let (near, direction) = made.at(0.5);
    let middle = jet(wanted.surfaces, meet(wanted.surfaces, near), direction)?;
    refine(wanted, [a, middle], depth - 1, pieces)?;
    refine(wanted, [middle, b], depth - 1, pieces)
}

/// Joins pieces with two continuous derivatives to one spline with triple knots.
pub(crate) fn joined(pieces: &[Bezier]) -> BSpline {
    let mut knots = vec![0.0];
    for Bezier { length, .. } in pieces {
        knots.push(knots[knots.len() - 1] + length);
    }
    let n = pieces.len();
    let mut multiplicities = vec![3; n + 1];
    (multiplicities[0], multiplicities[n]) = (6, 6);
    let mut control = pieces[0].control[..3].to_vec();
    for (i, Bezier { control: b, length }) in pieces.iter().enumerate() {
        control.push(b[3]);
        let Some(Bezier { control: next, .. }) = pieces.get(i + 1) else {
            control.extend_from_slice(&b[4..]);
            break;
        };
        // The blossom at one knot before, three times this and one after.
        let share = (knots[i + 2] - knots[i]) / length;
        control.push(std::array::from_fn(|k| {
            b[3][k] + (b[4][k] - b[3][k]) * share
        }));
        control.push(next[2]);
    }
    BSpline {
        degree: 5,
        knots,
        multiplicities,
        control,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted<'a>(
        surfaces: [&'a Locus; 2],
        between: &'a [Point3],
        guess: [Point3; 2],
    ) -> CurveRequest<'a> {
        CurveRequest {
            surfaces,
            ends: guess.map(|p| meet(surfaces, p)),
            between,
            size: 1.0,
        }
    }

    #[test]
    fn sections_of_a_cylinder() {
        let upright = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
        let cylinder = Locus::Exact(Surface::Cylinder(upright, 0.5));
        let plane = |n| Locus::Exact(Surface::Plane(Axes::along([0.1, 0.0, 0.0], n)));
        let between = [[0.0, 0.5, 0.0]];
        let ends = [[0.5, 0.0, 0.0], [-0.5, 0.1, 0.0]];
        let flat = plane([0.0, 0.0, 1.0]);
        let made = curve(&wanted([&flat, &cylinder], &between, ends));
        assert!(matches!(made, Some(Curve::Circle(_, r)) if (r - 0.5).abs() < 1e-14));
        let tilted = plane([0.6, 0.0, 0.8]);
        let made = curve(&wanted([&cylinder, &tilted], &between, ends));
        let Some(Curve::Ellipse(axes, a, b)) = made else {
            panic!("{made:?}")
        };
        assert!((a - 0.625).abs() < 1e-14 && (b - 0.5).abs() < 1e-14);
        assert!(axes.z[2] > 0.0, "counterclockwise from +x over +y");
        let along = plane([1.0, 0.0, 0.0]);
        let up = [[0.1, 0.5, 0.0], [0.1, 0.5, 1.0]];
        let made = curve(&wanted([&cylinder, &along], &[[0.1, 0.5, 0.4]], up));
        assert_eq!(made, Some(Curve::Line));
    }

    #[test]
    fn a_node_behind_an_end_does_not_turn_a_curve_back() {
        let round = |z, radius| Locus::Exact(Surface::Cylinder(Axes::along([0.0; 3], z), radius));
        let first = round([0.0, 0.0, 1.0], 1.0);
        let second = round([1.0, 0.0, 0.0], 0.6);
        let at = |t: f64| [1.0, 0.6 * t.cos(), 0.6 * t.sin()];
        let ends = [at(0.0), at(3.0)];
        let length = |first_node: f64, last_node: f64| {
            let mut between: Vec<Point3> = (1..8).map(|i| at(f64::from(i) * 0.375)).collect();
            between.insert(0, at(first_node));
            between.push(at(last_node));
            match curve(&wanted([&first, &second], &between, ends)) {
                Some(Curve::BSpline(spline)) => spline.knots[spline.knots.len() - 1],
                made => panic!("{made:?}"),
            }
        };
        let right = length(0.2, 2.8);
        for (a, b) in [(-0.01, 2.8), (0.2, 3.01), (-0.01, 3.01)] {
            assert!((length(a, b) / right - 1.0).abs() < 1e-6, "{a} {b}");
        }
    }

    #[test]
    fn two_cylinders_meet_in_a_spline_on_both() {
        let round = |z, radius| Locus::Exact(Surface::Cylinder(Axes::along([0.0; 3], z), radius));
        let first = round([0.0, 0.0, 1.0], 1.0);
        let second = round([1.0, 0.0, 0.0], 0.6);
        let between: Vec<Point3> = (1..8)
            .map(|i| {
                let (s, c) = (f64::from(i) * std::f64::consts::PI / 8.0).sin_cos();
                [1.0, 0.6 * c, 0.6 * s]
            })
            .collect();
        let ends = [[1.0, 0.6, 0.0], [1.0, -0.6, 0.0]];
        let made = curve(&wanted([&first, &second], &between, ends));
        let Some(Curve::BSpline(spline)) = made else {
            panic!("{made:?}")
        };
        let length = spline.knots[spline.knots.len() - 1];
        for i in 0..=200 {
            let (p, v) = spline.evaluate(length * f64::from(i) / 200.0);
            assert!(gap([&first, &second], p) < 1e-9, "{i} {p:?}");
            assert!((norm(v) - 1.0).abs() < 1e-4, "in arc length: {}", norm(v));
        }
        assert!(spline.knots.len() < 60, "{}", spline.knots.len());
    }
}
