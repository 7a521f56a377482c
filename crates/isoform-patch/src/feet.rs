//! Feet: the points of a patch nearest to given points.

use crate::cells::{ParameterBox, middle_of};
use crate::places::{contains, normalized, wider};
use isoform_geom::{Aabb, KdTree, Point3, RationalPatch, Tangents, dot, norm, sub};

/// Returns, for each point, whether it lies within `tolerance` of a patch. The foot is sought by
/// Newton's method from the nearest of a set of start points, which are denser where the patch is
/// more curved.
///
/// ```
/// use isoform_geom::RationalPatch;
/// use isoform_patch::reached;
///
/// let square = RationalPatch::planar((2, 2), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
/// let points = [[0.3, 0.7, 0.009], [0.3, 0.7, 0.011], [-0.1, 0.5, 0.0]];
/// assert_eq!(reached(&square, &points, 0.01), [true, false, false]);
/// ```
pub fn reached(patch: &RationalPatch, points: &[Point3], tolerance: f64) -> Vec<bool> {
    let starts = FootStarts::new(patch);
    let near = tolerance + starts.reach;
    let wide = beyond(patch, tolerance);
    let tree = KdTree::new(&starts.points);
    let reaches = |p: Point3| {
        tree.nearest(p).is_some_and(|(k, d2)| {
            d2 <= near * near && comes_to(patch, p, starts.parameters[k], tolerance)
        })
    };
    points
        .iter()
        .map(|p| contains(&wide, *p) && reaches(*p))
        .collect()
}

/// Returns a box that contains all points within a distance of a patch: its control points span it
/// if their weights are positive.
fn beyond(patch: &RationalPatch, distance: f64) -> Aabb {
    let Some(all) = patch.control_box() else {
        return Aabb {
            lo: [f64::NEG_INFINITY; 3],
            hi: [f64::INFINITY; 3],
        };
    };
    // Twice the distance allows for the rounding of quotients.
    wider(&all, 2.0 * distance)
}

/// Start points of a patch for the search of feet.
#[derive(Default)]
struct FootStarts {
    parameters: Vec<(f64, f64)>,
    points: Vec<Point3>,
    /// Estimated upper bound on the distance of a point of the patch from the nearest start point.
    reach: f64,
}

impl FootStarts {
    /// Returns the centres of 32 × 32 cells, more of them where the patch is strongly curved.
    fn new(patch: &RationalPatch) -> Self {
        let side = 32;
        let at = |i: usize| i as f64 / side as f64;
        let mut starts = Self::default();
        for k in 0..side * side {
            let (i, j) = (k / side, k % side);
            starts.add(patch, [(at(i), at(i + 1)), (at(j), at(j + 1))], 0);
        }
        starts
    }

    /// Adds the centre of a cell, or of its quarters if its normals differ much.
    fn add(&mut self, patch: &RationalPatch, cell: ParameterBox, depth: u32) {
        let [(u0, u1), (v0, v1)] = cell;
        let corners = [(u0, v0), (u0, v1), (u1, v0), (u1, v1)].map(|(u, v)| patch.tangents(u, v));
        let (u, v) = middle_of(cell);
        // Around sharp ridges Newton's method needs start points nearby.
        if depth < 4 && turns(&corners) {
            for side in [(u0, u), (u, u1)] {
                for other in [(v0, v), (v, v1)] {
                    self.add(patch, [side, other], depth + 1);
                }
            }
            return;
        }
        let point = patch.point(u, v);
        for corner in corners {
            self.reach = self.reach.max(norm(sub(corner.point, point)));
        }
        self.parameters.push((u, v));
        self.points.push(point);
    }
}

/// Returns true if the normals at the corners differ by more than 30°.
fn turns(corners: &[Tangents; 4]) -> bool {
    let normals = corners.each_ref().map(|t| normalized(t.normal()));
    (1..4).any(|k| dot(normals[0], normals[k]) < 0.87)
}

/// Returns true if Newton's method for the foot of a point comes within `tolerance` of it.
fn comes_to(patch: &RationalPatch, p: Point3, from: (f64, f64), tolerance: f64) -> bool {
    let (mut u, mut v) = from;
    for _ in 0..12 {
        let t = patch.tangents(u, v);
        let r = sub(p, t.point);
        if dot(r, r) <= tolerance * tolerance {
            return true;
        }
        let (du, dv) = step_to_foot(&t, r);
        u = (u + du).clamp(0.0, 1.0);
        v = (v + dv).clamp(0.0, 1.0);
    }
    false
}

/// Returns a step of the Gauss-Newton method towards the foot of a point, for the tangents at the
/// current parameters and the offset r of the point from there.
pub(crate) fn step_to_foot(t: &Tangents, r: Point3) -> (f64, f64) {
    let (a, b, c) = (dot(t.u, t.u), dot(t.u, t.v), dot(t.v, t.v));
    let (e, f) = (dot(t.u, r), dot(t.v, r));
    let determinant = (a * c - b * b).max(f64::MIN_POSITIVE);
    ((c * e - b * f) / determinant, (a * f - b * e) / determinant)
}
