//! Proof that W keeps its sign in a sector.

use super::node::Form;
use super::{Fan, Sector};
use isoform_geom::plane::{cross, dot};

/// A proof that a polynomial keeps its sign on a triangle; the flag is true if the first corner is
/// the origin.
type Proof<'a> = &'a dyn Fn(&Form, [[f64; 2]; 3], bool) -> bool;

/// Factor by which the triangles of a proof are enlarged: well above rounding, and small enough not
/// to spoil the proof.
const ENLARGEMENT_FACTOR: f64 = 1.02;

impl Fan {
    /// Returns true if W is proved to keep its sign between the two rays of a sector, from the base
    /// point to points of the unit triangle: those on the chord between the rays, and others up to
    /// which the sector extends. The proof uses the coordinates of the node farther from the base
    /// point, in which W is divided by the factors that vanish on exceptional lines.
    pub(crate) fn keeps_sign(
        &self,
        quadrant: usize,
        sector: &Sector,
        points: &[[f64; 2]],
        proof: Proof<'_>,
    ) -> bool {
        let nodes = sector.rays.map(|r| self.directions[r.0].node);
        let [first, second] = nodes.map(|n| self.nodes[n].chain.len());
        let deep = usize::from(first <= second);
        let lifted = points
            .iter()
            .map(|&x| self.lifted(quadrant, x, nodes[deep]));
        let points: Vec<[f64; 2]> = lifted.collect();
        if points.iter().flatten().any(|x| !x.is_finite()) {
            return false;
        }
        let w = &self.nodes[nodes[deep]].forms[3];
        let rays = sector
            .rays
            .map(|(k, backward)| self.directions[k].signed(backward));
        if nodes[0] == nodes[1] {
            let triangle = triangle_around(rays, points);
            return triangle.is_some_and(|triangle| proof(w, triangle, true));
        }
        let line = Crossing::new(rays[deep], sector.marks[deep]);
        let triangles = line.triangles_around(&points);
        triangles.is_some_and(|all| all.iter().flatten().all(|t| proof(w, *t, true)))
    }
}

/// Returns the bounding directions of the smallest cone that contains two directions and points;
/// `turn` is the orientation of the two directions.
fn cone_around([mut p, mut q]: [[f64; 2]; 2], points: &[[f64; 2]], turn: f64) -> [[f64; 2]; 2] {
    for x in points {
        let x = x.map(|c| c / x[0].hypot(x[1]));
        if turn * cross(x, p) > 0.0 {
            p = x;
        }
        if turn * cross(q, x) > 0.0 {
            q = x;
        }
    }
    [p, q]
}

/// Returns a triangle with its first corner in the origin that contains the starts of two rays, and
/// points.
fn triangle_around([a, b]: [[f64; 2]; 2], mut points: Vec<[f64; 2]>) -> Option<[[f64; 2]; 3]> {
    let turn = cross(a, b).signum();
    // The triangle contains the beginning of both rays, so that it is not empty without points.
    points.extend([a, b].map(|x| x.map(|x| 1e-9 * x)));
    let [p, q] = cone_around([a, b], &points, turn);
    let area = cross(p, q);
    let height = |&x: &[f64; 2]| cross(x, q) / area + cross(p, x) / area;
    let reach = points.iter().map(height).fold(0.0, f64::max) * ENLARGEMENT_FACTOR;
    (turn * area > 0.0).then(|| [[0.0; 2], p.map(|x| reach * x), q.map(|x| reach * x)])
}

/// A sector between the seams of two nodes, in the coordinates of the deeper one: from its ray to
/// the exceptional line of the other one, which is an axis.
///
/// ```text
///   beside
///     |   ray
///     |  /
///     | /
///   origin ------- along: the other node's line
/// ```
struct Crossing {
    along: [f64; 2],
    beside: [f64; 2],
    ray: [f64; 2],
}

impl Crossing {
    fn new(ray: [f64; 2], along: [f64; 2]) -> Self {
        let beside = if along[0] == 0.0 {
            [ray[0].signum(), 0.0]
        } else {
            [0.0, ray[1].signum()]
        };
        Self { along, beside, ray }
    }
    /// Returns the coordinates along the line and perpendicular to it.
    fn split(&self, x: [f64; 2]) -> [f64; 2] {
        [dot(x, self.along), dot(x, self.beside)]
    }
    /// Returns one or two triangles that contain the sector up to some points; `None` if one of the
    /// points is beyond the line.
    ///
    /// ```text
    ///       p ---- q     p is on the ray, or on the steepest of the points
    ///      /       |
    ///     /        |
    ///   o -------- r
    /// ```
    fn triangles_around(&self, points: &[[f64; 2]]) -> Option<[Option<[[f64; 2]; 3]>; 2]> {
        let points: Vec<[f64; 2]> = points.iter().map(|&x| self.split(x)).collect();
        if points.iter().any(|x| x[1] < 0.0) {
            return None;
        }
        let slope = |[along, beside]: [f64; 2]| along / beside;
        let off_line = points.iter().filter(|x| x[1] > 0.0);
        let low = off_line
            .map(|&x| slope(x))
            .fold(slope(self.split(self.ray)), f64::min);
        let far = |i: usize| points.iter().map(|x| x[i]).fold(0.0, f64::max) * ENLARGEMENT_FACTOR;
        let (high, wide) = (far(0).max(low * far(1)), far(1));
        let at = |x: f64, y: f64| [0, 1].map(|i| x * self.along[i] + y * self.beside[i]);
        let o = [0.0; 2];
        let (p, q, r) = (at(low * wide, wide), at(high, wide), at(high, 0.0));
        let is_flat = low * wide >= high;
        Some([(!is_flat).then_some([o, p, q]), Some([o, q, r])])
    }
}
