//! Iteration to a foot point on one to three pieces.

use isoform_geom::{Foot, Point3, distance_squared, dot, sub};

/// Maximum number of steps to a foot point. Each reduces the error by the factor distance ×
/// curvature: if that is 1/10, eight steps reach rounding.
pub(super) const MAX_FOOT_STEPS: usize = 12;
/// Ratio of the last step to the distance at or below which a foot point counts as converged.
pub(super) const CONVERGED_STEP_RATIO: f64 = 1e-6;
/// Rounding error relative to the size of coordinates; a step below it counts as converged as well.
pub(super) const COORDINATE_ROUNDING: f64 = 1e-14;
/// Ratio of the last step to the distance at or below which a foot point is accepted without
/// convergence: the relative error of the distance is then about the square of this.
pub(super) const ACCEPTED_STEP_RATIO: f64 = 1e-2;
/// Ratio of the distance of a foot point to the first-order distance above which it is rejected.
/// Near an axis, the first-order distance is meaningless and the iteration leads to wrong points
/// farther away.
pub(super) const MAX_DISTANCE_RATIO: f64 = 4.0;
/// Length of the step from a foot point at which the sign of the tree is tested, relative to the
/// size of coordinates: above the rounding errors of foot points, below any detail.
const SIGN_TEST_STEP: f64 = 1e-8;
/// Gram determinant of unit normals below which they count as parallel and do not form an edge.
const PARALLEL_GRAM_DETERMINANT: f64 = 1e-6;

/// Search of a foot point on one to three pieces, with its state.
#[derive(Clone, Copy, Debug)]
pub(super) struct FootSearch {
    /// Index of the point.
    pub(super) point: u32,
    /// Pieces; the first `order` entries are used.
    pub(super) pieces: [u32; 3],
    /// Number of pieces: 1 for a face, 2 for an edge, 3 for a corner.
    pub(super) order: u8,
    /// Current position of the foot point.
    pub(super) q: Point3,
    /// Distance beyond which the foot point is not useful.
    pub(super) most: f64,
    /// Values of the pieces at q.
    pub(super) g: [f64; 3],
    /// Gradients of the pieces at q.
    pub(super) grad: [Point3; 3],
    /// True if the search has ended.
    pub(super) done: bool,
    /// True if the foot point is accurate enough.
    pub(super) good: bool,
}

impl FootSearch {
    /// Returns a search that starts at q.
    pub(super) fn new(point: usize, pieces: [u32; 3], order: u8, q: Point3) -> Self {
        Self {
            point: point as u32,
            pieces,
            order,
            q,
            most: f64::INFINITY,
            g: [0.0; 3],
            grad: [[0.0; 3]; 3],
            done: false,
            good: false,
        }
    }

    /// Returns a finished search for a foot point on one face.
    pub(super) fn finished(foot: &Foot) -> Self {
        Self {
            good: true,
            ..Self::new(0, foot.pieces, 1, foot.at)
        }
    }

    /// Makes one step to the foot point of p, from the values and gradients at q.
    pub(super) fn step(&mut self, p: Point3) {
        let order = self.order as usize;
        let away = sub(self.q, p);
        let wanted: [f64; 3] = std::array::from_fn(|c| {
            if c < order {
                dot(self.grad[c], away) - self.g[c]
            } else {
                0.0
            }
        });
        let Some(shares) = solve(&self.grad[..order], &wanted) else {
            (self.done, self.good) = (true, false);
            return;
        };
        let q: Point3 = std::array::from_fn(|x| {
            p[x] + (0..order).map(|c| shares[c] * self.grad[c][x]).sum::<f64>()
        });
        let moved = distance_squared(q, self.q).sqrt();
        let far = distance_squared(q, p).sqrt();
        let size = p.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
        self.q = q;
        // The last evaluation was at the previous position, near the present one after convergence.
        // A search may take a detour, but is abandoned beyond twice the useful distance.
        let is_lost = !far.is_finite() || far > 2.0 * self.most;
        self.done = moved <= CONVERGED_STEP_RATIO * far + COORDINATE_ROUNDING * size || is_lost;
        self.good =
            !is_lost && moved <= ACCEPTED_STEP_RATIO * far + 1e3 * COORDINATE_ROUNDING * size;
    }

    /// Writes the foot point if it is accurate enough.
    pub(super) fn settle(&self, points: &[Point3], out: &mut [Foot]) {
        if !self.good {
            return;
        }
        let i = self.point as usize;
        let (p, foot) = (points[i], &mut out[i]);
        let normals: [Point3; 3] = std::array::from_fn(|c| first_order(1.0, self.grad[c]).1);
        let away = sub(p, self.q);
        let far = dot(away, away).sqrt();
        let sign = if foot.distance < 0.0 { -1.0 } else { 1.0 };
        let order = self.order as usize;
        let is_of_own_face = order == 1 && foot.order == 0 && foot.pieces[0] == self.pieces[0];
        foot.distance = if is_of_own_face {
            dot(away, normals[0])
        } else {
            sign * far
        };
        (foot.inward, foot.shares) = if order > 1 && far > aside(p) {
            let inward = away.map(|v| v / foot.distance);
            (inward, shares_of(inward, &normals[..order]))
        } else {
            (normals[0], [1.0, 0.0, 0.0])
        };
        (foot.at, foot.pieces, foot.order) = (self.q, self.pieces, self.order);
    }
}

/// Returns the coefficients of unit normals in a direction that lies in their span.
fn shares_of(direction: Point3, normals: &[Point3]) -> [f64; 3] {
    let wanted: [f64; 3] =
        std::array::from_fn(|c| normals.get(c).map_or(0.0, |n| dot(*n, direction)));
    solve(normals, &wanted).unwrap_or([1.0, 0.0, 0.0])
}

/// Returns the length of the step that tests the sign on either side of p.
pub(super) fn aside(p: Point3) -> f64 {
    SIGN_TEST_STEP * p.iter().fold(1e-300, |s: f64, v| s.max(v.abs()))
}

/// Returns g/|∇g| and ∇g/|∇g|; a very large distance if the gradient vanishes or is not finite.
pub(super) fn first_order(g: f64, grad: Point3) -> (f64, Point3) {
    let length = dot(grad, grad).sqrt();
    if length > 0.0 && length.is_finite() && g.is_finite() {
        let d = g / length;
        (d.clamp(-1e150, 1e150), grad.map(|v| v / length))
    } else {
        (if g < 0.0 { -1e150 } else { 1e150 }, [0.0; 3])
    }
}

/// Solves G Gᵀ x = b for one to three rows G; `None` if they are nearly parallel.
pub(super) fn solve(rows: &[Point3], b: &[f64; 3]) -> Option<[f64; 3]> {
    match *rows {
        [u] => {
            let uu = dot(u, u);
            (uu > 0.0).then(|| [b[0] / uu, 0.0, 0.0])
        }
        [u, v] => {
            let (uu, uv, vv) = (dot(u, u), dot(u, v), dot(v, v));
            let det = uu * vv - uv * uv;
            (det > PARALLEL_GRAM_DETERMINANT * uu * vv).then(|| {
                [
                    (b[0] * vv - b[1] * uv) / det,
                    (b[1] * uu - b[0] * uv) / det,
                    0.0,
                ]
            })
        }
        [u, v, w] => solve_three([u, v, w], b),
        _ => None,
    }
}

/// Returns x = G⁻ᵀ G⁻¹ b for three rows G, by the reciprocal basis.
fn solve_three([u, v, w]: [Point3; 3], b: &[f64; 3]) -> Option<[f64; 3]> {
    let cross = isoform_geom::cross;
    let det = dot(u, cross(v, w));
    let sizes = dot(u, u) * dot(v, v) * dot(w, w);
    (det * det > PARALLEL_GRAM_DETERMINANT * sizes).then(|| {
        let dual = [cross(v, w), cross(w, u), cross(u, v)].map(|c| c.map(|x| x / det));
        let y: Point3 = std::array::from_fn(|x| (0..3).map(|c| b[c] * dual[c][x]).sum());
        std::array::from_fn(|c| dot(dual[c], y))
    })
}
