//! Coordinate changes between a base point's nodes and the unit triangles.

use super::Fan;
use super::blow_up::lifts;
use super::direction::{Direction, Key};
use isoform_algebra::QUADRANTS;
use isoform_geom::plane::{cross, dot};

/// Multiplies homogeneous coordinates by the signs of a quadrant.
#[inline]
fn signed(quadrant: usize, x: [f64; 3]) -> [f64; 3] {
    let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
    [s * x[0], t * x[1], x[2]]
}

/// Returns the sign by which homogeneous coordinates, signed as above, become coordinates of the
/// unit triangle, if the point is in it.
fn sign_in(y: [f64; 3]) -> Option<f64> {
    let is_in = |sign: &f64| y.iter().all(|y| sign * y >= 0.0);
    [1.0, -1.0].into_iter().find(is_in)
}

impl Fan {
    /// Returns the sign of the base point's coordinates in a quadrant and their absolute values, if
    /// the point is in it.
    fn point_in(&self, quadrant: usize) -> Option<(f64, [f64; 3])> {
        let y = signed(quadrant, self.point);
        let sign = sign_in(y)?;
        Some((sign, y.map(|y| sign * y)))
    }
    /// Converts a displacement in the coordinates of the base point to one of (s, t, w).
    fn shift(&self, [a, b]: [f64; 2]) -> [f64; 3] {
        let mut x = [0.0; 3];
        x[self.variables[0]] = a;
        x[self.variables[1]] = b;
        x
    }
    /// Returns u and v of the base point in the unit triangle of a quadrant, if it is in it.
    pub(crate) fn place(&self, quadrant: usize) -> Option<[f64; 2]> {
        let (_, y) = self.point_in(quadrant)?;
        let sum: f64 = y.iter().sum();
        Some([y[0] / sum, y[1] / sum])
    }
    /// Converts a displacement in the coordinates of the base point to one in the unit triangle, up
    /// to a positive factor, if it leads into the triangle or along its sides.
    fn displaced(&self, quadrant: usize, by: [f64; 2]) -> Option<[f64; 2]> {
        let (sign, y) = self.point_in(quadrant)?;
        let dy = signed(quadrant, self.shift(by)).map(|y| sign * y);
        if (0..3).any(|k| y[k] == 0.0 && dy[k] < 0.0) {
            return None;
        }
        let (sum, rate): (f64, f64) = (y.iter().sum(), dy.iter().sum());
        let [u, v] = [0, 1].map(|k| (dy[k] - y[k] / sum * rate) / sum);
        let is_along_third_side = y[2] == 0.0 && dy[2] == 0.0;
        Some(if is_along_third_side { [u, -u] } else { [u, v] })
    }
    /// Returns the direction ± d in the unit triangle of a quadrant, if it leads into the triangle
    /// or along its sides; for directions of the base point itself.
    pub(crate) fn direction_in(
        &self,
        quadrant: usize,
        d: &Direction,
        backward: bool,
    ) -> Option<[f64; 2]> {
        self.displaced(quadrant, d.signed(backward))
    }
    /// Returns the start of a ray as a small displacement in the unit triangle, up to a positive
    /// factor, if it is in the triangle.
    pub(crate) fn beginning(
        &self,
        quadrant: usize,
        d: &Direction,
        backward: bool,
    ) -> Option<[f64; 2]> {
        if d.node == 0 {
            return self.direction_in(quadrant, d, backward);
        }
        // Near enough for the base point's own coordinates to show the order of rays; a power of
        // two, so that scaling is exact.
        let near = d.signed(backward).map(|x| x * (1.0 / 1024.0));
        self.displaced(quadrant, self.lowered(d.node, near))
    }
    /// Returns true if the coordinates of the base point and of a unit triangle have one
    /// orientation.
    pub(crate) fn keeps_turn(&self, quadrant: usize) -> bool {
        let y = signed(quadrant, self.point);
        let sign = if y.iter().sum::<f64>() < 0.0 {
            -1.0
        } else {
            1.0
        };
        let sum: f64 = y.iter().map(|y| sign * y).sum();
        let [a, b] = [[1.0, 0.0], [0.0, 1.0]].map(|axis| {
            let dy = signed(quadrant, self.shift(axis)).map(|y| sign * y);
            let rate: f64 = dy.iter().sum();
            [0, 1].map(|k| dy[k] - sign * y[k] / sum * rate)
        });
        cross(a, b) > 0.0
    }
    /// Converts coordinates of a node to those of the base point.
    pub(super) fn lowered(&self, node: usize, at: [f64; 2]) -> [f64; 2] {
        let steps = self.nodes[node].chain.iter().rev();
        steps.fold(at, |at, step| step.lower(at))
    }
    /// Converts a point of a unit triangle to the coordinates of a node.
    pub(crate) fn lifted(&self, quadrant: usize, [u, v]: [f64; 2], node: usize) -> [f64; 2] {
        let x = signed(quadrant, [u, v, 1.0 - u - v]);
        let local = self.variables.map(|k| x[k] / x[self.one] - self.point[k]);
        let steps = self.nodes[node].chain.iter();
        steps.fold(local, |at, step| step.lift(at))
    }
    /// Returns the point of a ray at a distance in the coordinates of its node, if it is in the
    /// unit triangle.
    pub(crate) fn on_ray(
        &self,
        quadrant: usize,
        d: &Direction,
        backward: bool,
        distance: f64,
    ) -> Option<[f64; 2]> {
        let at = self.lowered(d.node, d.at_distance(backward, distance, 0.0));
        let mut x = self.point;
        x[self.variables[0]] += at[0];
        x[self.variables[1]] += at[1];
        let y = signed(quadrant, x);
        let sign = sign_in(y)?;
        let sum: f64 = y.iter().map(|y| sign * y).sum();
        Some([sign * y[0] / sum, sign * y[1] / sum])
    }

    /// Returns the indices of the lines s = 0, t = 0, w = 0 that pass through the base point in a
    /// direction.
    pub(crate) fn sides_along(&self, d: &Direction) -> impl Iterator<Item = usize> {
        let lifts = lifts(&self.nodes[d.node].chain);
        let is_along = [0, 1].map(|i| {
            let k = self.variables[i];
            self.point[k] == 0.0 && d.at[i] == 0.0 && lifts[i]
        });
        let variables = self.variables;
        (0..2)
            .filter(move |&i| is_along[i])
            .map(move |i| variables[i])
    }
    pub(crate) fn is_side(&self, d: &Direction) -> bool {
        self.sides_along(d).next().is_some()
    }
    /// Returns the ray along a side toward a point of that side.
    pub(crate) fn ray_along(
        &self,
        quadrant: usize,
        side: usize,
        to: [f64; 2],
    ) -> Option<(Key, bool)> {
        let is_along = |d: &&Direction| self.sides_along(d).any(|s| s == side);
        let d = self.directions.iter().find(is_along)?;
        let x = self.lifted(quadrant, to, d.node);
        Some((d.key(), dot(d.at, x) < 0.0))
    }
}
