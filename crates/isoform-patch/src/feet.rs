//! Feet: the nearest places of a patch from points.

use crate::cells::{Place, middle_of};
use crate::surface::contains;
use isoform_geom::{Aabb, Point3, RationalPatch, Tangents, dot, norm, sub};

/// Cells of a patch in each direction, from whose middles feet of samples are sought,
const GRID: usize = 32;
/// and from those of their quarters, so often in turn, where
const MOST_QUARTERINGS: u32 = 4;
/// normals at corners differ by more than 30°: round sharp ridges Newton's method needs near
/// starts.
const ALIKE: f64 = 0.87;
/// Newton steps towards the foot of a sample on a patch.
const STEPS: usize = 12;

/// Which points lie within `tolerance` of a patch: the foot is sought by Newton's method from the
/// nearest of some places, which are closer together where the patch is more curved.
pub fn reached(patch: &RationalPatch, points: &[Point3], tolerance: f64) -> Vec<bool> {
    let mut starts = Starts::default();
    let at = |i: usize| i as f64 / GRID as f64;
    for k in 0..GRID * GRID {
        let (i, j) = (k / GRID, k % GRID);
        starts.add(patch, [(at(i), at(i + 1)), (at(j), at(j + 1))], 0);
    }
    let near = tolerance + starts.reach;
    let wide = beyond(patch, tolerance);
    let tree = isoform_geom::KdTree::new(&starts.points);
    let reaches = |p: Point3| {
        let Some((k, d2)) = tree.nearest(p).map(|n| (n.0, n.1)) else {
            return false;
        };
        d2 <= near * near && comes_to(patch, p, starts.parameters[k], tolerance)
    };
    points
        .iter()
        .map(|p| contains(&wide, *p) && reaches(*p))
        .collect()
}

/// A box beyond which nothing is within a distance of a patch, whose control points span it where
/// their weights are positive.
fn beyond(patch: &RationalPatch, distance: f64) -> Aabb {
    let Some(all) = patch.control_box() else {
        return Aabb {
            lo: [f64::NEG_INFINITY; 3],
            hi: [f64::INFINITY; 3],
        };
    };
    // Twice as much, as quotients are rounded.
    Aabb {
        lo: all.lo.map(|v| v - 2.0 * distance),
        hi: all.hi.map(|v| v + 2.0 * distance),
    }
}

/// Places of a patch from which feet are sought.
#[derive(Default)]
struct Starts {
    parameters: Vec<(f64, f64)>,
    points: Vec<Point3>,
    /// No point of the patch should be farther from one of them.
    reach: f64,
}

impl Starts {
    /// The middle of a cell, or of its quarters where its normals differ much.
    fn add(&mut self, patch: &RationalPatch, cell: Place, depth: u32) {
        let [(u0, u1), (v0, v1)] = cell;
        let corners = [(u0, v0), (u0, v1), (u1, v0), (u1, v1)].map(|(u, v)| patch.tangents(u, v));
        let normals = corners.map(|t| {
            let n = t.normal();
            n.map(|v| v / norm(n))
        });
        let turns = (1..4).any(|k| dot(normals[0], normals[k]) < ALIKE);
        let (u, v) = middle_of(cell);
        if turns && depth < MOST_QUARTERINGS {
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

/// Whether Newton's method for the foot of a point comes within `tolerance` of it.
fn comes_to(patch: &RationalPatch, p: Point3, from: (f64, f64), tolerance: f64) -> bool {
    let (mut u, mut v) = from;
    for _ in 0..STEPS {
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

/// A step of the method of Gauss and Newton towards the foot of a point, r away from where the
/// patch has these tangents.
pub(crate) fn step_to_foot(t: &Tangents, r: Point3) -> (f64, f64) {
    let (a, b, c) = (dot(t.u, t.u), dot(t.u, t.v), dot(t.v, t.v));
    let (e, f) = (dot(t.u, r), dot(t.v, r));
    let determinant = (a * c - b * b).max(f64::MIN_POSITIVE);
    ((c * e - b * f) / determinant, (a * f - b * e) / determinant)
}
