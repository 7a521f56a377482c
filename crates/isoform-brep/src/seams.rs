//! Seams: curves at which the function of a part changes.
//!
//! Each function of a part has limits, beyond which another one applies. A limit divides only
//! triangles in which the function changes: most limits have no effect on the surface.

use crate::cut::{Cut, LabelledMesh, crossing, imprint};
use crate::locus::{Distance, Locus};
use crate::newton::meet;
use crate::piece::{SmoothPiece, triangles_of_part};
use crate::topology::ends_of;
use crate::whole::SolidPiece;
use isoform_geom::brep::{Axes, Surface};
use isoform_geom::{Field, Point3, SmoothPart, cross, dot, middle, norm, sub};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A question: the sign of a limit. The negative of the limit may be another limit.
struct LimitSign {
    limit: Arc<dyn Field>,
    /// Values at some nodes of the part.
    values: Vec<f64>,
}

/// The seams of a part.
pub(crate) struct Seams<'a> {
    part: u32,
    whole: SolidPiece<'a>,
    branches: Vec<&'a SmoothPart>,
    questions: Vec<LimitSign>,
    /// Questions of each branch, with true if the limit is that of the question, false if it is its
    /// negative.
    asked: Vec<Vec<(usize, bool)>>,
}

/// The answers at a node, and the function that follows from them.
struct NodeSigns {
    values: Vec<f64>,
    function: usize,
}

impl<'a> Seams<'a> {
    /// Creates the seams of a part with the smooth parts of its piece.
    pub(crate) fn new(
        mesh: &LabelledMesh,
        part: u32,
        whole: SolidPiece<'a>,
        branches: &[&'a SmoothPart],
    ) -> Self {
        let own = triangles_of_part(mesh, part);
        // Limits are compared at about 48 nodes.
        let every = own.len().div_ceil(48).max(1);
        let corners = own.iter().step_by(every);
        let points: Vec<Point3> = corners
            .map(|t| mesh.points[mesh.triangles[*t as usize][0] as usize])
            .collect();
        let mut made = Self {
            part,
            whole,
            branches: branches.to_vec(),
            questions: Vec::new(),
            asked: Vec::new(),
        };
        for branch in branches {
            let limits = branch.limits.iter();
            let asked = limits.filter_map(|l| made.ask(l, &points)).collect();
            made.asked.push(asked);
        }
        made
    }

    /// Returns the index of the question that a limit answers, and true if it is the question's
    /// limit, false if it is its negative.
    fn ask(&mut self, limit: &Arc<dyn Field>, points: &[Point3]) -> Option<(usize, bool)> {
        let is_it = |q: &LimitSign| Arc::ptr_eq(&q.limit, limit);
        if let Some(k) = self.questions.iter().position(is_it) {
            return Some((k, true));
        }
        let values: Vec<f64> = points.iter().map(|p| limit.value(*p)).collect();
        let scale = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let near = |sign: f64| {
            let is_near = |known: &LimitSign| {
                let mut each = known.values.iter().zip(&values);
                // Limits that differ only by rounding are one, or opposite.
                each.all(|(a, b)| (a - sign * b).abs() <= 1e-12 * scale)
            };
            self.questions.iter().position(is_near)
        };
        let known = near(1.0).map(|k| (k, true));
        if let Some(known) = known.or_else(|| near(-1.0).map(|k| (k, false))) {
            return Some(known);
        }
        // Limits beyond 128 questions are ignored.
        if self.questions.len() >= 128 {
            return None;
        }
        let limit = limit.clone();
        self.questions.push(LimitSign { limit, values });
        Some((self.questions.len() - 1, true))
    }

    /// Returns the answers at a point. The branch is that whose least limit is largest: if none
    /// holds, as just off a seam, the nearest one.
    fn answers(&self, p: Point3) -> NodeSigns {
        let questions = self.questions.iter();
        let values: Vec<f64> = questions.map(|q| q.limit.value(p)).collect();
        let least = |b: usize| {
            let asked = self.asked[b].iter();
            let each = asked.map(|&(k, is_own)| if is_own { values[k] } else { -values[k] });
            each.fold(f64::INFINITY, f64::min)
        };
        let best = (0..self.branches.len()).max_by(|a, b| {
            let by_limit = least(*a).total_cmp(&least(*b));
            by_limit.then(b.cmp(a))
        });
        let function = self.branches[best.unwrap_or(0)].function;
        NodeSigns { values, function }
    }

    /// Divides the part where its function changes; returns by function its branches and its
    /// triangles.
    pub(crate) fn divide(
        &self,
        mesh: &mut LabelledMesh,
    ) -> BTreeMap<usize, (Vec<&'a SmoothPart>, Vec<u32>)> {
        let mut answers: BTreeMap<u32, NodeSigns> = BTreeMap::new();
        for k in 0..self.questions.len() {
            let changing = self.changing(mesh, k, &mut answers);
            if changing.is_empty() {
                continue;
            }
            let locus = Locus::Zero(self.questions[k].limit.clone());
            let cut = Cut {
                own: &changing,
                number: 0,
                locus: &locus,
                crossing: &|ends| crossing(ends, &self.whole, &locus),
                is_vertex: &|_| false,
            };
            let _new = imprint(mesh, &cut);
        }
        let mut made: BTreeMap<usize, (Vec<&SmoothPart>, Vec<u32>)> = BTreeMap::new();
        for t in triangles_of_part(mesh, self.part) {
            let p = middle(mesh.corners(t));
            let function = self.answers(p).function;
            made.entry(function).or_default().1.push(t);
        }
        for &branch in &self.branches {
            if let Some(of) = made.get_mut(&branch.function) {
                of.0.push(branch);
            }
        }
        made
    }

    /// Returns the triangles with an edge along which both the function and the answer to a
    /// question change.
    fn changing(
        &self,
        mesh: &LabelledMesh,
        k: usize,
        answers: &mut BTreeMap<u32, NodeSigns>,
    ) -> Vec<u32> {
        let mut own = triangles_of_part(mesh, self.part);
        for v in own.iter().flat_map(|t| mesh.triangles[*t as usize]) {
            let at = || self.answers(mesh.points[v as usize]);
            answers.entry(v).or_insert_with(at);
        }
        own.retain(|t| {
            (0..3).any(|side| {
                let [a, b] = ends_of(&mesh.triangles[*t as usize], side).map(|v| &answers[&v]);
                a.function != b.function && (a.values[k] > 0.0) != (b.values[k] > 0.0)
            })
        });
        own
    }
}

/// Returns the locus along which two pieces that touch join, near some points in order: a limit of
/// one, or a surface that crosses both where they touch; `None` if none is within the points'
/// distances.
pub(crate) fn seam(
    pieces: [&SmoothPiece; 2],
    loci: [&Locus; 2],
    points: &[Point3],
) -> Option<Locus> {
    let reach = points
        .windows(2)
        .map(|w| norm(sub(w[0], w[1])))
        .fold(0.0, f64::max);
    let limits = pieces.into_iter().flat_map(|p| &p.limits);
    let limits = limits.map(|l| Locus::Zero(l.clone()));
    let [a, b] = loci.map(Locus::surface);
    let crossing = a
        .zip(b)
        .map(|(a, b)| [crossing_contact(a, b), crossing_contact(b, a)]);
    let crossing = crossing.into_iter().flatten().flatten().map(Locus::Exact);
    let off = |locus: &Locus| {
        let each = points.iter().map(|p| {
            let (d, n) = locus.distance(*p);
            if dot(n, n) > 0.5 {
                d.abs()
            } else {
                f64::INFINITY
            }
        });
        each.fold(0.0, f64::max)
    };
    let all = limits.chain(crossing).map(|locus| (off(&locus), locus));
    let best = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 <= reach).then_some(best.1)
}

/// Returns a surface that crosses two others along the line or circle where they touch: a tube `s`,
/// and the surface that it continues into.
fn crossing_contact(s: &Surface, other: &Surface) -> Option<Surface> {
    use Surface::{Cone, Cylinder, Plane, Sphere, Torus};
    let plane = |at, normal: Point3| {
        let length = norm(normal);
        (length > 0.0).then(|| Plane(Axes::along(at, normal.map(|x| x / length))))
    };
    match (s, other) {
        (Cylinder(s, _), Plane(o)) => plane(s.origin, cross(s.z, o.z)),
        (Cylinder(s, _), Torus(o, ..) | Sphere(o, _)) => plane(o.origin, s.z),
        (Torus(s, major, _), Plane(_)) => Some(Cylinder(*s, *major)),
        (Torus(s, ..), Sphere(o, _)) => plane(o.origin, cross(s.z, sub(o.origin, s.origin))),
        (Cone(s, _, half_angle), Sphere(o, radius)) => {
            let up = dot(sub(o.origin, s.origin), s.z) - radius * half_angle.sin();
            plane(std::array::from_fn(|k| s.origin[k] + up * s.z[k]), s.z)
        }
        _ => None,
    }
}

/// Returns the largest angle between the normals of two loci along points (radians): a measure of
/// how far they are from touching.
pub(crate) fn largest_angle(loci: [&Locus; 2], points: &[Point3]) -> f64 {
    let sine = |p: &Point3| {
        let [a, b] = loci.map(|l| l.distance(meet([l], *p)).1);
        norm(cross(a, b))
    };
    points.iter().map(sine).fold(0.0, f64::max).min(1.0).asin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::Random;
    use std::f64::consts::TAU;

    /// Two surfaces that touch, and the points where they do.
    type Case<'a> = (Surface, Surface, &'a dyn Fn(f64) -> Point3);

    /// The normals of touching surfaces agree at a contact, and the surface that crosses them there
    /// is at an angle to them.
    #[test]
    fn contacts_are_crossed() {
        let axes = |origin, z| Axes::along(origin, z);
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let origin = [0.0; 3];
        let half_angle: f64 = 0.3;
        let (s, c) = half_angle.sin_cos();
        let cases: [Case<'_>; 6] = [
            (
                Surface::Cylinder(axes(origin, x), 2.0),
                Surface::Plane(axes([0.0, 0.0, 2.0], z)),
                &|t| [t, 0.0, 2.0],
            ),
            (
                Surface::Cylinder(axes([5.0, 0.0, 0.0], y), 2.0),
                Surface::Torus(axes(origin, z), 5.0, 2.0),
                &|t| [5.0 + 2.0 * t.cos(), 0.0, 2.0 * t.sin()],
            ),
            (
                Surface::Cylinder(axes(origin, z), 2.0),
                Surface::Sphere(axes([0.0, 0.0, 7.0], z), 2.0),
                &|t| [2.0 * t.cos(), 2.0 * t.sin(), 7.0],
            ),
            (
                Surface::Torus(axes(origin, z), 5.0, 2.0),
                Surface::Plane(axes([0.0, 0.0, -2.0], z)),
                &|t| [5.0 * t.cos(), 5.0 * t.sin(), -2.0],
            ),
            (
                Surface::Torus(axes(origin, z), 5.0, 2.0),
                Surface::Sphere(axes([5.0, 0.0, 0.0], z), 2.0),
                &|t| [5.0 + 2.0 * t.cos(), 0.0, 2.0 * t.sin()],
            ),
            // A ball of radius 1 within the cone of radius 0 at the origin.
            (
                Surface::Cone(axes(origin, z), 0.0, half_angle),
                Surface::Sphere(axes([0.0, 0.0, 1.0 / s], z), 1.0),
                &|t| [c * t.cos(), c * t.sin(), 1.0 / s - s],
            ),
        ];
        let mut random = Random::new(1);
        for (a, b, at) in cases {
            let crossing = crossing_contact(&a, &b).expect("a crossing");
            for _ in 0..20 {
                let p = at(TAU * random.unit());
                let [a, b, crossing] = [&a, &b, &crossing].map(|s| s.distance(p));
                for (d, _) in [a, b, crossing] {
                    assert!(d.abs() < 1e-12, "{d}");
                }
                assert!(norm(cross(a.1, b.1)) < 1e-12);
                assert!(dot(a.1, crossing.1).abs() < 0.3);
            }
        }
    }
}
