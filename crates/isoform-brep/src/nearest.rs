//! Nearest point of a face: of its surface within its loops, otherwise of its edges.
//!
//! The projection onto the surface is exact, by formula or by iteration. Whether it lies within the
//! loops is decided at the nearest point of these: there the inside is on the left of the border.
//! At a vertex both adjacent edges count (as for normals of meshes, J. A. Bærentzen and H. Aanæs,
//! IEEE Trans. Vis. Comput. Graph. 11, 2005).

use crate::facets::Facets;
use isoform_geom::brep::{Brep, Coedge, Curve, Face, Surface};
use isoform_geom::{Point3, cross, distance_squared, distance_to_segment, dot, norm, sub};

/// Length of a negligible step, relative to the coordinates.
const MIN_RELATIVE_STEP: f64 = 1e-14;

/// Faces and edges of a solid, with the triangles that give starting points.
#[derive(Debug)]
pub struct FaceProjector<'a> {
    brep: &'a Brep,
    facets: &'a Facets,
}

/// A point on a border.
struct BorderPoint {
    at: Point3,
    /// Index of the loop, and of the coedge in it.
    of: [usize; 2],
    /// Parameter on the edge.
    s: f64,
}

impl<'a> FaceProjector<'a> {
    /// Creates the projector of a solid and its triangles.
    pub fn new(brep: &'a Brep, facets: &'a Facets) -> Self {
        Self { brep, facets }
    }

    /// Returns the point of a face that is nearest to `p`. On ellipsoids and splines it is the
    /// local minimum reached from `near`, a point near the face: its distance is never less than
    /// the true one.
    pub fn nearest(&self, face: usize, p: Point3, near: Point3) -> Point3 {
        let foot = foot(&self.brep.faces[face].surface, p, near);
        if self.holds(face, foot) {
            return foot;
        }
        let place = self.on_border(face, p);
        place.map_or(foot, |place| place.at)
    }

    /// Returns true if a point of a face's surface lies within its loops.
    fn holds(&self, face: usize, x: Point3) -> bool {
        if x.iter().any(|v| !v.is_finite()) {
            return false;
        }
        let Some(place) = self.on_border(face, x) else {
            return true;
        };
        let face = &self.brep.faces[face];
        let around = &face.loops[place.of[0]];
        let coedge = around[place.of[1]];
        let mut inward = self.inward(face, coedge, place.s);
        let is_end = |s: f64| (place.s - s).abs() <= 1e-7;
        if is_end(0.0) || is_end(1.0) {
            let at_last = is_end(1.0) == coedge.forward;
            let (i, n) = (place.of[1], around.len());
            let other = around[if at_last { i + 1 } else { i + n - 1 } % n];
            let s = if at_last == other.forward { 0.0 } else { 1.0 };
            let more = self.inward(face, other, s);
            inward = std::array::from_fn(|k| inward[k] + more[k]);
        }
        dot(sub(x, place.at), inward) >= 0.0
    }

    /// Returns the unit direction into a face from its border.
    fn inward(&self, face: &Face, coedge: Coedge, s: f64) -> Point3 {
        let (p, velocity) = self.brep.along(coedge.edge, s);
        let normal = face.surface.distance(p).1;
        // Left of the border, seen from outside.
        let sense = if coedge.forward == face.agrees {
            1.0
        } else {
            -1.0
        };
        let left = cross(normal, velocity).map(|v| sense * v);
        let length = norm(left);
        left.map(|v| if length > 0.0 { v / length } else { 0.0 })
    }

    /// Returns the point of the loops of a face that is nearest to `p`: on the curve of the nearest
    /// piece of their polygons.
    fn on_border(&self, face: usize, p: Point3) -> Option<BorderPoint> {
        let mut best: Option<(f64, [usize; 2], usize)> = None;
        for (l, around) in self.brep.faces[face].loops.iter().enumerate() {
            for (c, coedge) in around.iter().enumerate() {
                let along = &self.facets.along[coedge.edge as usize];
                for (i, ends) in along.windows(2).enumerate() {
                    let piece = [ends[0], ends[1]].map(|n| self.facets.points[n.1 as usize]);
                    let d = distance_to_segment(p, piece);
                    if best.is_none_or(|best| d < best.0) {
                        best = Some((d, [l, c], i));
                    }
                }
            }
        }
        let (_, of, i) = best?;
        let edge = self.brep.faces[face].loops[of[0]][of[1]].edge;
        let along = &self.facets.along[edge as usize];
        let (from, to) = (i.saturating_sub(1), (i + 2).min(along.len() - 1));
        let s = self.on_edge(edge, [along[from].0, along[to].0], p);
        let at = self.brep.along(edge, s).0;
        Some(BorderPoint { at, of, s })
    }

    /// Returns the parameter between two others at which an edge is nearest to `p`.
    fn on_edge(&self, edge: u32, [mut a, mut b]: [f64; 2], p: Point3) -> f64 {
        if matches!(self.brep.edges[edge as usize].curve, Curve::Line) {
            let (from, way) = self.brep.along(edge, 0.0);
            return (dot(sub(p, from), way) / dot(way, way)).clamp(a, b);
        }
        let far = |s: f64| distance_squared(self.brep.along(edge, s).0, p);
        let golden = 0.5 * (5f64.sqrt() - 1.0);
        let ends = [a, b];
        let (mut s, mut t) = (b - golden * (b - a), a + golden * (b - a));
        let (mut at_s, mut at_t) = (far(s), far(t));
        // Golden-section search: 48 steps narrow an interval to 1e-10 of it, and the distance is
        // flat there.
        for _ in 0..48 {
            if at_s < at_t {
                (b, t, at_t) = (t, s, at_s);
                s = b - golden * (b - a);
                at_s = far(s);
            } else {
                (a, s, at_s) = (s, t, at_t);
                t = a + golden * (b - a);
                at_t = far(t);
            }
        }
        let best = 0.5 * (a + b);
        let candidates = [best, ends[0], ends[1]];
        let nearest = candidates
            .into_iter()
            .min_by(|x, y| far(*x).total_cmp(&far(*y)));
        nearest.unwrap_or(best)
    }
}

/// Returns the point of a surface nearest to `p`.
fn foot(surface: &Surface, p: Point3, near: Point3) -> Point3 {
    let direct = || -> Point3 {
        let (d, n) = surface.distance(p);
        std::array::from_fn(|k| p[k] - d * n[k])
    };
    match surface {
        Surface::Ellipsoid(_) | Surface::Graph(_) => iterated(surface, p, near),
        Surface::Cone(axes, _, half_angle) => {
            // Beyond the apex the line in the half-plane continues on the other side.
            let direct = direct();
            let beyond = (axes.local(direct)[2] - surface.base_of_v()) * half_angle.signum();
            match surface.apex() {
                Some(apex) if beyond < 0.0 => apex,
                _ => direct,
            }
        }
        Surface::Revolved(turned) => {
            // Beyond a tip the curve would continue on the other side.
            let [first, last] = turned.domain();
            let [u, v] = turned.parameters(p);
            turned.point([u, v.clamp(first, last)])
        }
        _ => direct(),
    }
}

/// Projects a point near a surface onto it.
fn lifted(surface: &Surface, mut x: Point3) -> Point3 {
    for _ in 0..8 {
        let (d, n) = surface.distance(x);
        let next: Point3 = std::array::from_fn(|k| x[k] - d * n[k]);
        if next.iter().any(|v| !v.is_finite()) {
            break;
        }
        let way = norm(sub(next, x));
        x = next;
        if way <= MIN_RELATIVE_STEP * norm(x) {
            break;
        }
    }
    x
}

/// Returns the projection by Newton's method in the tangent plane, from a point near the surface;
/// if steps lead no nearer, the nearest point so far.
fn iterated(surface: &Surface, p: Point3, near: Point3) -> Point3 {
    let mut x = lifted(surface, near);
    let mut far = norm(sub(p, x));
    for _ in 0..40 {
        let step = tangent_step(surface, p, x);
        let mut next = lifted(surface, moved(x, step, 1.0));
        // A step that increases the distance is too long.
        let mut share = 1.0;
        while norm(sub(p, next)) > far && share > 1e-3 {
            share *= 0.5;
            next = lifted(surface, moved(x, step, share));
        }
        let now = norm(sub(p, next));
        if now.is_nan() || now > far {
            break;
        }
        let way = norm(sub(next, x));
        (x, far) = (next, now);
        if way <= MIN_RELATIVE_STEP * norm(x) {
            break;
        }
    }
    x
}

fn moved(x: Point3, step: Point3, share: f64) -> Point3 {
    std::array::from_fn(|k| x[k] + share * step[k])
}

/// Returns the step in the tangent plane at x towards the projection of `p`. With r = p − x = rₜ +
/// off n, and the surface x + t − ½ b(t, t) n near x (b: the second derivative of the distance),
/// the square of the distance is |rₜ − t|² + (off + ½ b(t, t))², minimal to second order where (1 +
/// off b) t = rₜ.
fn tangent_step(surface: &Surface, p: Point3, x: Point3) -> Point3 {
    let n = surface.distance(x).1;
    let [e, f] = isoform_geom::orthonormal_complement(n);
    let r = sub(p, x);
    let (off, a, c) = (dot(r, n), dot(r, e), dot(r, f));
    let bend = |t: Point3| surface.bending(x, t);
    let (ee, ff) = (bend(e), bend(f));
    let both = bend(std::array::from_fn(|k| e[k] + f[k]));
    let ef = 0.5 * (both - ee - ff);
    let [k, l, m] = [1.0 + off * ee, off * ef, 1.0 + off * ff];
    let det = k * m - l * l;
    // Beyond a centre of curvature the second-order model has no minimum.
    let (s, t) = if k > 0.0 && det > 0.0 {
        ((m * a - l * c) / det, (k * c - l * a) / det)
    } else {
        (a, c)
    };
    std::array::from_fn(|i| s * e[i] + t * f[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facets::tests::can;
    use crate::{Control, FacetOptions, facets};
    use isoform_geom::brep::{Axes, Edge, Ellipsoid};

    /// Returns the distance of a point from the can of radius 1 between z = 0 and z = 2.
    fn from_can([x, y, z]: Point3) -> f64 {
        let (out, above) = (x.hypot(y) - 1.0, (z - 1.0).abs() - 1.0);
        if out <= 0.0 && above <= 0.0 {
            -out.max(above)
        } else {
            out.max(0.0).hypot(above.max(0.0))
        }
    }

    #[test]
    fn distances_from_a_can_are_the_closed_form() {
        let brep = can();
        // The triangles may be coarse: they only give starting points.
        for chord in [0.2, 1e-3] {
            let options = FacetOptions {
                chord,
                longest: f64::INFINITY,
            };
            let facets = facets(&brep, &options, &Control::default()).expect("triangles");
            let skin = FaceProjector::new(&brep, &facets);
            for i in 0..500 {
                let at = |k: f64| 5.0 * (k * f64::from(i)).fract() - 2.0;
                let p = [at(0.754_877), at(0.569_840), at(0.430_159)];
                let feet = (0..4).map(|f| skin.nearest(f, p, p));
                let least = feet.map(|q| norm(sub(p, q))).fold(f64::INFINITY, f64::min);
                assert!((least - from_can(p)).abs() < 1e-13, "{p:?} {least}");
            }
        }
    }

    #[test]
    fn points_near_a_border_know_their_side() {
        let brep = can();
        let options = FacetOptions {
            chord: 0.2,
            longest: f64::INFINITY,
        };
        let facets = facets(&brep, &options, &Control::default()).expect("triangles");
        let skin = FaceProjector::new(&brep, &facets);
        // Between the polygon and the circle, and just outside of the circle.
        for i in 0..64 {
            let (sin, cos) = (0.1 * f64::from(i)).sin_cos();
            let at = |r: f64| [r * cos, r * sin, 2.0];
            assert!(norm(sub(skin.nearest(1, at(0.999), at(0.999)), at(0.999))) < 1e-15);
            let out = skin.nearest(1, at(1.001), at(1.001));
            assert!(norm(sub(out, at(1.0))) < 1e-9, "{out:?}");
        }
    }

    /// Returns both sides of a flat triangle with its tip at the origin.
    fn blade() -> Brep {
        let axes = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
        let line = |ends| Edge {
            curve: Curve::Line,
            ends,
        };
        let side = |forward: bool| {
            let mut around: Vec<Coedge> = (0..3).map(|edge| Coedge { edge, forward }).collect();
            if !forward {
                around.reverse();
            }
            Face {
                surface: Surface::Plane(axes),
                agrees: forward,
                part: 0,
                chart: u32::from(!forward),
                loops: vec![around],
            }
        };
        Brep {
            vertices: vec![[0.0; 3], [1.0, -0.2, 0.0], [1.0, 0.2, 0.0]],
            edges: vec![line([0, 1]), line([1, 2]), line([2, 0])],
            faces: vec![side(true), side(false)],
            parts: vec!["blade".to_owned()],
            solids: Vec::new(),
        }
    }

    #[test]
    fn before_a_sharp_tip_both_borders_count() {
        let brep = blade();
        let options = FacetOptions {
            chord: 0.1,
            longest: f64::INFINITY,
        };
        let facets = facets(&brep, &options, &Control::default()).expect("triangles");
        let skin = FaceProjector::new(&brep, &facets);
        // To the left of one border each, but on the right of the other.
        for face in [0, 1] {
            for y in [0.3, -0.3] {
                let p = [-0.1, y, 0.0];
                assert_eq!(skin.nearest(face, p, p), [0.0; 3], "{face} {y}");
            }
            let within = [0.5, 0.05, 0.0];
            assert!(norm(sub(skin.nearest(face, within, within), within)) < 1e-16);
        }
    }

    #[test]
    fn feet_on_an_ellipsoid_are_where_its_normal_leads() {
        let axes = Axes::along([0.3, -0.2, 0.1], [0.6, 0.0, 0.8]);
        let ball = Ellipsoid::new(axes, [0.9, 0.6, 0.4]);
        let surface = Surface::Ellipsoid(ball);
        for at in [[0.3, 0.2], [2.0, -1.0], [4.0, 1.2]] {
            let q = surface.point(at);
            let n = surface.distance(q).1;
            // Down to half of the smallest radius of curvature, 0.4²/0.9.
            for d in [3.0, 0.2, 0.0, -0.08] {
                let p = std::array::from_fn(|k| q[k] + d * n[k]);
                let near = std::array::from_fn(|k| q[k] + 0.05 * axes.x[k]);
                let found = foot(&surface, p, near);
                let away = norm(sub(found, q));
                // The distance is flat at its minimum: it determines the foot to half of the
                // digits.
                assert!(away < 1e-8, "{at:?} {d} {away}");
                assert!(
                    (norm(sub(found, p)) - f64::abs(d)).abs() < 1e-14,
                    "{at:?} {d}"
                );
            }
        }
    }

    #[test]
    fn beyond_the_tip_of_a_cone_the_tip_is_nearest() {
        let axes = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
        let cone = Surface::Cone(axes, 1.0, 0.5);
        let tip = [0.0, 0.0, -1.0 / 0.5f64.tan()];
        let p = [0.1, 0.0, tip[2] - 2.0];
        assert!(norm(sub(foot(&cone, p, p), tip)) < 1e-14);
    }
}
