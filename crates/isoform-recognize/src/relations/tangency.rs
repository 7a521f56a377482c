//! Tangency of two surfaces, as equations.
//!
//! Surfaces of revolution about one axis touch along a circle where their meridians touch: a line
//! at distance r from the centre of a circle of radius r, or two circles whose centres are as far
//! from each other as the sum or the difference of their radii.

use super::{Failure, PairFrame};
use crate::chart::{Primitive, PrimitiveKind};
use isoform_geom::{cross, dot, norm, sub};

/// Returns true if tangency is defined for two kinds of surfaces.
pub(super) fn is_defined(kinds: [PrimitiveKind; 2]) -> bool {
    use PrimitiveKind::{Cone, Cylinder, Plane};
    let [a, b] = sorted(kinds, |k| *k);
    !matches!((a, b), (Plane, Plane) | (Cylinder | Cone, Cone))
}

/// Returns the angle by which the directions of two surfaces are off tangency, in radians; `None`
/// if it is not about directions.
pub(super) fn angle_off(pair: [&Primitive; 2]) -> Option<f64> {
    use PrimitiveKind::{Cone, Cylinder, Plane, Sphere, Torus};
    let [a, b] = sorted(pair, |s| s.kind);
    let cosine = dot(a.axis, b.axis).abs().min(1.0);
    match (a.kind, b.kind) {
        (Sphere, _) | (_, Sphere) => None,
        (Plane, Cylinder | Cone) => Some((cosine - b.slope().0.abs()).abs()),
        (Cylinder, Torus) => Some(cosine.acos().min(cosine.asin())),
        _ => Some(cosine.acos()),
    }
}

/// Returns by what two surfaces fail to be tangent. Where they can touch in several ways, the
/// nearest one counts.
pub(super) fn failure(frame: &PairFrame, pair: [&Primitive; 2]) -> Failure {
    use PrimitiveKind::{Cylinder, Plane, Sphere, Torus};
    let [a, b] = sorted(pair, |s| s.kind);
    let way = sub(b.place, a.place);
    let apart = frame.apart(pair);
    match (a.kind, b.kind) {
        (Plane, Sphere) => Failure::new(&[], &[a.distance(b.place).abs() - b.size]),
        (Plane, Torus) => Failure::new(&frame.tilt(pair), &[a.distance(b.place).abs() - b.other]),
        (Plane, _) => {
            let d = a.distance(b.place);
            let turn = b.slope().0 - d.signum() * dot(a.axis, b.axis);
            Failure::new(&[turn], &[d.abs() - reach(b, 0.0)])
        }
        (Sphere, _) => of_sphere(frame, [a, b]),
        (Cylinder, Cylinder) => {
            let distance = apart[0].hypot(apart[1]);
            Failure::new(
                &frame.tilt(pair),
                &[between_circles(distance, a.size, b.size)],
            )
        }
        (Torus, _) => {
            let centers = (b.size - a.size).hypot(dot(way, a.axis));
            let meridians = between_circles(centers, a.other, b.other);
            Failure::new(&frame.tilt(pair), &[apart[0], apart[1], meridians])
        }
        (Cylinder, Torus) if dot(a.axis, b.axis).abs() < 0.5 => {
            let beside = dot(way, cross(b.axis, a.axis)).abs() - b.size;
            let lengths = [a.size - b.other, dot(way, b.axis), beside];
            Failure::new(&[dot(a.axis, b.axis)], &lengths)
        }
        _ => {
            let line = b.size * a.slope().1 - reach(a, dot(way, a.axis));
            Failure::new(
                &frame.tilt(pair),
                &[apart[0], apart[1], line.abs() - b.other],
            )
        }
    }
}

/// Returns by what a sphere and another surface with a centre or an axis fail to be tangent.
fn of_sphere(frame: &PairFrame, [a, b]: [&Primitive; 2]) -> Failure {
    let way = sub(b.place, a.place);
    // Way from the axis.
    let off = frame.across(way);
    // A contact in a point, from outside or inside, unless one along a circle is near: next to it
    // the former is always nearer.
    let or_point = |circle: Failure| {
        let point = Failure::new(&[], &[b.distance(a.place).abs() - a.size]);
        let is_circle = circle.size() <= 0.1 * a.size || circle.size() <= point.size();
        if is_circle { circle } else { point }
    };
    match b.kind {
        PrimitiveKind::Sphere => Failure::new(&[], &[between_circles(norm(way), a.size, b.size)]),
        PrimitiveKind::Torus => {
            let height = dot(way, b.axis);
            let to_circle = b.size.hypot(height);
            let inside = [off[0], off[1], between_circles(to_circle, a.size, b.other)];
            let end = [a.size - b.other, height, off[0].hypot(off[1]) - b.size];
            let [end, inside] = [end, inside].map(|lengths| Failure::new(&[], &lengths));
            or_point(if end.size() <= inside.size() {
                end
            } else {
                inside
            })
        }
        _ => {
            let distance = reach(b, -dot(way, b.axis));
            or_point(Failure::new(&[], &[off[0], off[1], distance - a.size]))
        }
    }
}

/// Returns a pair in the order of the kinds.
fn sorted<T>([a, b]: [T; 2], kind: impl Fn(&T) -> PrimitiveKind) -> [T; 2] {
    match kind(&a) <= kind(&b) {
        true => [a, b],
        false => [b, a],
    }
}

/// Returns the distance of the generators of a cylinder or a cone from a point of its axis.
fn reach(s: &Primitive, height: f64) -> f64 {
    let (sin, cos) = s.slope();
    s.size * cos + height * sin
}

/// Returns by what two circles fail to touch, from outside or one in the other.
fn between_circles(distance: f64, r: f64, s: f64) -> f64 {
    let [outside, inside] = [distance - (r + s), distance - (r - s).abs()];
    match outside.abs() <= inside.abs() {
        true => outside,
        false => inside,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::turned;
    use isoform_geom::Point3;

    /// Makes a surface about an axis along z, x or y.
    fn surface(
        kind: PrimitiveKind,
        place: Point3,
        axis: usize,
        [size, other]: [f64; 2],
    ) -> Primitive {
        let mut along = [0.0; 3];
        along[axis] = 1.0;
        Primitive {
            kind,
            place,
            axis: along,
            size,
            other,
        }
    }

    /// Returns pairs that touch, and a point in which they do.
    fn touching() -> Vec<([Primitive; 2], Point3)> {
        use PrimitiveKind::{Cone, Cylinder, Plane, Sphere, Torus};
        let (x, y, z) = (0, 1, 2);
        let plane = surface(Plane, [0.3, -0.2, -1.0], z, [0.0, 0.0]);
        let tube = |place, axis, r| surface(Cylinder, place, axis, [r, 0.0]);
        let ball = |place, r| surface(Sphere, place, z, [r, 0.0]);
        let ring = |place, axis, radii| surface(Torus, place, axis, radii);
        // A cone with its apex in the origin, whose generator to (0, 0, 1) + tan a (1, 0, 0) is in
        // the plane of the normal cos a (1, 0, 0) - sin a (0, 0, 1).
        let a: f64 = 0.4;
        let cone = surface(Cone, [0.0, 0.0, 1.0], z, [a.tan(), a]);
        let side = [a.cos(), 0.0, -a.sin()];
        let generator = [a.tan(), 0.0, 1.0];
        let inner: Point3 = std::array::from_fn(|k| generator[k] - 0.2 * side[k]);
        let height = 1.0 + a.tan() * a.tan();
        vec![
            ([plane, ball([0.0, 0.0, -0.4], 0.6)], [0.0, 0.0, -1.0]),
            ([plane, tube([0.0, 0.0, -0.4], x, 0.6)], [0.7, 0.0, -1.0]),
            (
                [plane, ring([0.0, 0.0, -0.8], z, [0.5, 0.2])],
                [0.5, 0.0, -1.0],
            ),
            ([Primitive::plane([0.0; 3], side), cone], generator),
            (
                [Primitive::plane([0.0; 3], side.map(|v| -v)), cone],
                generator,
            ),
            (
                [ball([0.0; 3], 0.3), ball([0.0, 0.5, 0.0], 0.2)],
                [0.0, 0.3, 0.0],
            ),
            (
                [ball([0.0; 3], 0.7), ball([0.0, 0.5, 0.0], 0.2)],
                [0.0, 0.7, 0.0],
            ),
            (
                [tube([0.0, 0.0, 3.0], z, 0.4), ball([0.0; 3], 0.4)],
                [0.4, 0.0, 0.0],
            ),
            (
                [tube([0.0, 0.0, 3.0], z, 0.4), ball([0.6, 0.0, 0.0], 0.2)],
                [0.4, 0.0, 0.0],
            ),
            (
                [cone, ball([0.0, 0.0, height], a.tan() / a.cos())],
                generator,
            ),
            (
                [tube([0.0; 3], z, 0.8), ball([0.6, 0.0, 1.0], 0.2)],
                [0.8, 0.0, 1.0],
            ),
            (
                [ring([0.0; 3], z, [0.5, 0.2]), ball([0.8, 0.0, 0.0], 0.1)],
                [0.7, 0.0, 0.0],
            ),
            (
                [ring([0.0; 3], z, [0.5, 0.2]), ball([0.0; 3], 0.7)],
                [0.7, 0.0, 0.0],
            ),
            (
                [ring([0.0; 3], z, [0.5, 0.2]), ball([0.5, 0.0, 0.0], 0.2)],
                [0.5, 0.0, 0.2],
            ),
            (
                [tube([0.0; 3], z, 0.3), tube([0.0, 0.5, 2.0], z, 0.2)],
                [0.0, 0.3, 1.0],
            ),
            (
                [tube([0.0; 3], z, 0.7), tube([0.0, 0.5, 2.0], z, 0.2)],
                [0.0, 0.7, 1.0],
            ),
            (
                [tube([0.0, 0.0, 3.0], z, 0.3), ring([0.0; 3], z, [0.5, 0.2])],
                [0.3, 0.0, 0.0],
            ),
            (
                [tube([0.0, 0.0, 3.0], z, 0.7), ring([0.0; 3], z, [0.5, 0.2])],
                [0.7, 0.0, 0.0],
            ),
            (
                [tube([0.5, 0.4, 0.0], y, 0.2), ring([0.0; 3], z, [0.5, 0.2])],
                [0.5, 0.0, 0.2],
            ),
            (
                [cone, ring([0.0, 0.0, inner[2]], z, [inner[0], 0.2])],
                generator,
            ),
            (
                [ring([0.0; 3], z, [0.5, 0.2]), ring([0.0; 3], z, [1.0, 0.3])],
                [0.7, 0.0, 0.0],
            ),
        ]
    }

    /// Moves a surface rigidly.
    fn moved(s: &Primitive, axis: Point3, angle: f64) -> Primitive {
        let shift = [0.4, -0.3, 0.2];
        let place = turned(s.place, axis, angle);
        Primitive {
            place: std::array::from_fn(|k| place[k] + shift[k]),
            axis: turned(s.axis, axis, angle),
            ..*s
        }
    }

    #[test]
    fn surfaces_that_touch_are_tangent_in_any_pose_and_order() {
        for (k, (pair, point)) in touching().into_iter().enumerate() {
            let [a, b] = &pair;
            for s in &pair {
                assert!(s.distance(point).abs() < 1e-12, "case {k}: {s:?}");
            }
            let turn = norm(cross(a.normal(point), b.normal(point)));
            assert!(turn < 1e-12, "case {k}: the case itself is wrong, {turn}");
            assert!(is_defined([a.kind, b.kind]), "case {k}");
            assert!(angle_off([a, b]).is_none_or(|off| off < 1e-6), "case {k}");
            for angle in [0.0, 0.7, 2.9] {
                let axis = [0.48, -0.6, 0.64];
                let [a, b] = pair.map(|s| moved(&s, axis, angle));
                for pair in [[&a, &b], [&b, &a]] {
                    let off = failure(&PairFrame::from_pair(pair), pair);
                    let worst = off.values.iter().fold(0.0, |w: f64, v| w.max(v.abs()));
                    assert!(worst < 1e-12, "case {k}: {:?}", off.values);
                }
            }
        }
    }

    /// A surface that is larger than the one that touches does not touch.
    #[test]
    fn surfaces_that_do_not_touch_are_off_by_their_distance() {
        for (k, ([a, b], _)) in touching().into_iter().enumerate() {
            let mut wide = b;
            match b.kind {
                PrimitiveKind::Torus => wide.other += 1e-3,
                _ => wide.size += 1e-3,
            }
            let pair = [&a, &wide];
            let off = failure(&PairFrame::from_pair(pair), pair).size();
            let expected = 1e-3 * wide.slope().1;
            assert!((off - expected).abs() < 1e-5, "case {k}: {off}");
        }
    }
}
