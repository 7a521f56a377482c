//! Edges as readers of files reconstruct them on faces.
//!
//! Files hold edges in space only. Readers project some points of an edge onto the surface of each
//! of its faces, and interpolate between their parameters: a face ends at this curve, and not at
//! the edge. OpenCASCADE (ShapeConstruct_ProjectCurveOnSurface) takes 23 points at equal steps of
//! the curve's own parameter, more for splines of many spans, and the cubic spline through them; if
//! the curve is long, or passes near a pole, the two are far apart between the points. Edges are
//! divided until they agree.

use crate::tolerance::{READER_TOLERANCE, worse};
use crate::vertices::follow;
use isoform_control::{Control, Stopped};
use isoform_geom::brep::{Brep, Curve, Edge, Surface};
use isoform_geom::{Point3, cross, norm, sub};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Number of steps between the points of an edge that readers project; multiples of it for splines.
const READER_STEPS: usize = 22;
/// Number of parts of a step at whose ends the curves are compared.
const PARTS_PER_STEP: usize = 4;

/// Returns by edge the largest distance from its images in the parameters of its faces.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn deviations(brep: &Brep, control: &Control<'_>) -> Result<Vec<f64>, Stopped> {
    let faces = brep.faces.par_iter().flat_map_iter(|face| {
        let coedges = face.loops.iter().flatten();
        coedges.map(move |coedge| (coedge.edge as usize, &face.surface))
    });
    let all = faces.map(|(edge, surface)| {
        control.check()?;
        Ok((edge, deviation(brep, edge as u32, surface)))
    });
    let mut worst = vec![0.0f64; brep.edges.len()];
    for (edge, off) in all.collect::<Result<Vec<_>, Stopped>>()? {
        worst[edge] = worst[edge].max(off);
    }
    Ok(worst)
}

/// Divides edges whose images leave them by more than readers resolve in a model of this size;
/// returns the divided edges in the order of the edges that are added.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn divide(
    brep: &mut Brep,
    size: f64,
    control: &Control<'_>,
) -> Result<Vec<usize>, Stopped> {
    let limit = READER_TOLERANCE * size;
    let mut divided = Vec::new();
    for _ in 0..3 {
        let worst = deviations(brep, control)?;
        let before = brep.edges.len();
        for (e, off) in worst.into_iter().enumerate() {
            if off > limit {
                let parts = (off / limit).powf(0.25).ceil();
                // The error falls with the fourth power of the number of parts. The bound also
                // holds for infinity.
                let parts = parts.min(32.0) as usize;
                divided.extend(std::iter::repeat_n(e, divide_edge(brep, e, parts)));
            }
        }
        if brep.edges.len() == before {
            break;
        }
    }
    Ok(divided)
}

/// Divides an edge into equal parts, a spline by knots; returns the number of edges that were
/// added.
fn divide_edge(brep: &mut Brep, edge: usize, parts: usize) -> usize {
    match &mut brep.edges[edge].curve {
        Curve::Line => 0,
        Curve::BSpline(spline) => {
            spline.divide(parts);
            0
        }
        Curve::Circle(..) | Curve::Ellipse(..) => {
            let at = |k: usize| brep.along(edge as u32, k as f64 / parts as f64).0;
            let inner: Vec<Point3> = (1..parts).map(at).collect();
            let first = brep.edges[edge].clone();
            let mut before = edge as u32;
            for p in inner {
                let (vertex, added) = (brep.vertices.len() as u32, brep.edges.len() as u32);
                brep.vertices.push(p);
                brep.edges[before as usize].ends[1] = vertex;
                brep.edges.push(Edge {
                    curve: first.curve.clone(),
                    ends: [vertex, first.ends[1]],
                });
                follow(brep, before, added);
                before = added;
            }
            parts - 1
        }
    }
}

/// Returns the largest distance between an edge and its image in the parameters of a surface.
fn deviation(brep: &Brep, edge: u32, surface: &Surface) -> f64 {
    let curve = &brep.edges[edge as usize].curve;
    // Projection is linear there: conics and splines keep their form.
    if matches!(surface, Surface::Plane(_)) || matches!(curve, Curve::Line) {
        return 0.0;
    }
    let steps = match curve {
        Curve::BSpline(spline) => {
            let points = (spline.knots.len() - 1) * (spline.degree + 1);
            READER_STEPS * (points - 1).div_ceil(READER_STEPS)
        }
        _ => READER_STEPS,
    };
    let at = |x: f64| brep.along(edge, x / steps as f64);
    let points: Vec<Point3> = (0..=steps).map(|k| at(k as f64).0).collect();
    let parameters = projected(surface, &points);
    let slopes = [0, 1].map(|k| slopes(&parameters.iter().map(|q| q[k]).collect::<Vec<_>>()));
    let mut worst = 0.0f64;
    for i in 0..steps {
        for n in 1..PARTS_PER_STEP {
            let x = n as f64 / PARTS_PER_STEP as f64;
            let seen = point(
                surface,
                [0, 1].map(|k| {
                    let ends = [parameters[i][k], parameters[i + 1][k]];
                    hermite(ends, [slopes[k][i], slopes[k][i + 1]], x)
                }),
            );
            let (p, velocity) = at(i as f64 + x);
            // A shift along the edge does not change the face.
            let across = norm(cross(sub(seen, p), velocity)) / norm(velocity);
            worst = worse(worst, across);
        }
    }
    worst
}

/// Returns the parameters of a point in the parametrisation that files use.
fn parameters(surface: &Surface, p: Point3) -> [f64; 2] {
    match surface {
        Surface::Ellipsoid(ball) => ball.in_chart(p),
        _ => surface.parameters(p),
    }
}

fn point(surface: &Surface, at: [f64; 2]) -> Point3 {
    match surface {
        Surface::Ellipsoid(ball) => ball.from_chart(at),
        _ => surface.point(at),
    }
}

/// Returns the parameters of points in order, angles without jumps; a point on the axis, which has
/// no angle, takes that of its neighbour.
fn projected(surface: &Surface, points: &[Point3]) -> Vec<[f64; 2]> {
    let angles = match surface {
        Surface::Plane(_) | Surface::Graph(_) | Surface::Ellipsoid(_) => 0,
        Surface::Torus(..) => 2,
        _ => 1,
    };
    let out = |p: &Point3| {
        let [x, y, _] = surface.axes().local(*p);
        x.hypot(y)
    };
    let widest = points.iter().map(out).fold(0.0, f64::max);
    let mut all: Vec<[f64; 2]> = points.iter().map(|p| parameters(surface, *p)).collect();
    if angles > 0 {
        let on_axis = |p: &Point3| out(p) <= 1e-9 * widest;
        let last = all.len() - 1;
        if on_axis(&points[0]) {
            all[0][0] = all[1][0];
        }
        if on_axis(&points[last]) {
            all[last][0] = all[last - 1][0];
        }
    }
    for i in 1..all.len() {
        for k in 0..angles {
            let by = (all[i][k] - all[i - 1][k] + PI).rem_euclid(TAU) - PI;
            all[i][k] = all[i - 1][k] + by;
        }
    }
    all
}

/// Returns the slopes of the cubic spline through values at equal steps of 1; at its ends those of
/// the cubic through the four values there.
fn slopes(values: &[f64]) -> Vec<f64> {
    let last = values.len() - 1;
    let end = |v: [f64; 4]| -11.0 / 6.0 * v[0] + 3.0 * v[1] - 1.5 * v[2] + v[3] / 3.0;
    let mut m = vec![0.0; last + 1];
    m[0] = end([values[0], values[1], values[2], values[3]]);
    m[last] = -end([
        values[last],
        values[last - 1],
        values[last - 2],
        values[last - 3],
    ]);
    // m(i−1) + 4 m(i) + m(i+1) = 3 (v(i+1) − v(i−1)), by elimination.
    let mut pivot = vec![4.0; last];
    for i in 1..last {
        m[i] = 3.0 * (values[i + 1] - values[i - 1]);
        if i == 1 {
            m[1] -= m[0];
        } else {
            pivot[i] -= 1.0 / pivot[i - 1];
            m[i] -= m[i - 1] / pivot[i - 1];
        }
    }
    for i in (1..last).rev() {
        m[i] = (m[i] - m[i + 1]) / pivot[i];
    }
    m
}

/// Returns the cubic with values and slopes at 0 and 1.
fn hermite([a, b]: [f64; 2], [p, q]: [f64; 2], x: f64) -> f64 {
    let y = 1.0 - x;
    y * y * ((1.0 + 2.0 * x) * a + x * p) + x * x * ((1.0 + 2.0 * y) * b - y * q)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::brep::{Axes, Coedge, Face};
    use isoform_geom::dot;

    fn seen(brep: &Brep) -> Vec<f64> {
        deviations(brep, &Control::default()).expect("nothing stops it")
    }

    /// Returns a cap of the unit sphere about z within an angle of a direction, its border in two
    /// halves.
    fn cap(direction: Point3, angle: f64) -> Brep {
        let (sin, cos) = angle.sin_cos();
        let around = Axes::along(direction.map(|v| cos * v), direction);
        let ends = [[sin, 0.0, 0.0], [-sin, 0.0, 0.0]].map(|p| around.point(p));
        let half = |ends| Edge {
            curve: Curve::Circle(around, sin),
            ends,
        };
        let coedge = |edge| Coedge {
            edge,
            forward: true,
        };
        Brep {
            vertices: ends.to_vec(),
            edges: vec![half([0, 1]), half([1, 0])],
            faces: vec![Face {
                surface: Surface::Sphere(Axes::along([0.0; 3], [0.0, 0.0, 1.0]), 1.0),
                agrees: true,
                part: 0,
                chart: 0,
                loops: vec![vec![coedge(0), coedge(1)]],
            }],
            ..Brep::default()
        }
    }

    #[test]
    fn cubics_are_their_own_splines_and_sines_are_near_theirs() {
        let f = |x: f64| 2.0 - x + 0.5 * x * x - 0.3 * x * x * x;
        let between = |values: &[f64], i: usize, x: f64| {
            let m = slopes(values);
            hermite([values[i], values[i + 1]], [m[i], m[i + 1]], x)
        };
        let values: Vec<f64> = (0..6).map(|k| f(f64::from(k))).collect();
        for i in 0..5 {
            assert!((between(&values, i, 0.3) - f(i as f64 + 0.3)).abs() < 1e-12);
        }
        // Between values at steps h a spline of degree 3 misses h⁴/384 of the fourth derivative.
        let h = 0.1f64;
        let sines: Vec<f64> = (0..40).map(|k| (h * f64::from(k)).sin()).collect();
        let off = between(&sines, 15, 0.5) - (h * 15.5).sin();
        let expected = -h.powi(4) / 384.0 * (h * 15.5).sin();
        assert!((off / expected - 1.0).abs() < 0.01, "{off} {expected}");
    }

    #[test]
    fn parallels_are_seen_as_they_are_and_circles_by_a_pole_are_not() {
        let level = seen(&cap([0.0, 0.0, 1.0], 1.0));
        assert!(level.into_iter().all(|d| d < 1e-15));
        // As near as 20 degrees to a pole: some thousandths of the radius.
        let near = seen(&cap([1.0, 0.0, 0.0], 70f64.to_radians()));
        assert!(near.into_iter().all(|d| d > 1e-4));
    }

    #[test]
    fn divided_edges_are_seen_where_they_are() {
        let mut brep = cap([1.0, 0.0, 0.0], 70f64.to_radians());
        let divided = divide(&mut brep, 2.0, &Control::default()).expect("nothing stops it");
        assert_eq!(brep.edges.len(), 2 + divided.len());
        assert!(!divided.is_empty() && divided.iter().all(|e| *e < brep.edges.len()));
        assert!(seen(&brep).into_iter().all(|d| d <= 2.0 * READER_TOLERANCE));
        // The loop runs through all edges once, from each to the next, and all are on the circle.
        let around = &brep.faces[0].loops[0];
        assert_eq!(around.len(), brep.edges.len());
        for (a, b) in around.iter().zip(around.iter().cycle().skip(1)) {
            assert_eq!(brep.ends_of(a)[1], brep.ends_of(b)[0]);
            let p = brep.along(a.edge, 0.5).0;
            assert!((p[0] - 70f64.to_radians().cos()).abs() < 1e-14);
            assert!((dot(p, p) - 1.0).abs() < 1e-14);
        }
    }
}
