//! Local topology at a point: tests if pieces bound the solid in a face, along an edge, or at a
//! corner.
//!
//! The tree's sign is evaluated around the point. Pieces that vanish there get their first-order
//! values in some direction; all others keep their signs.

use super::{MAX_TANGENT_SINE, Surface};
use crate::points::unit;
use isoform_geom::{Csg, Point3, cross, dot, norm};

/// Angle between consecutive directions, and of the first one, in radians: incommensurable, so that
/// no direction lies in another piece by design.
const PROBE_ANGLES: [f64; 2] = [0.4, 0.123];

/// Returns a value that no other can outweigh, with the sign of the given one.
fn far(value: f64) -> f64 {
    value.signum() * f64::MAX
}

/// A piece that vanishes at the examined point of another piece.
struct VanishingPiece {
    piece: u32,
    normal: Point3,
}

impl Surface<'_> {
    /// Returns true if the two pieces meet at `p` in an edge of the solid: the sign in the four
    /// quadrants between them depends on both, and they meet at an angle.
    pub(crate) fn is_edge(&self, pair: [u32; 2], p: Point3) -> bool {
        let Some(layer) = self.common_layer(&pair) else {
            return self.is_crossing(&pair, p);
        };
        let Some(reduced) = self.reduced_in(layer, p) else {
            return false;
        };
        let n = pair.map(|i| {
            let d = self.solid.gradient(i, p).1;
            let l = norm(d);
            d.map(|v| v / l)
        });
        if norm(cross(n[0], n[1])) < MAX_TANGENT_SINE {
            return false;
        }
        let inside = |quadrant: [f64; 2]| {
            reduced.tree.value(&|i| {
                if let Some(k) = pair.iter().position(|&k| k == i) {
                    return quadrant[k];
                }
                // A third piece that vanishes as well is evaluated in the quadrant.
                let d = self.distance(i, p);
                if d != 0.0 {
                    far(d)
                } else {
                    self.follow(i, n, quadrant, p)
                }
            }) >= 0.0
        };
        let [a, b] = [[1.0, 1.0], [1.0, -1.0]].map(inside);
        let [c, d] = [[-1.0, 1.0], [-1.0, -1.0]].map(inside);
        (a != b || c != d) && (a != c || b != d)
    }

    /// Returns true if the three pieces meet at `p` in a corner of the solid: the sign in the eight
    /// octants between them depends on each.
    pub(crate) fn is_corner(&self, on: &[u32], p: Point3) -> bool {
        let Some(layer) = self.common_layer(on) else {
            return self.is_crossing(on, p);
        };
        let Some(reduced) = self.reduced_in(layer, p) else {
            return false;
        };
        let inside = |octant: usize| {
            reduced
                .tree
                .value(&|i| match on.iter().position(|&o| o == i) {
                    Some(at) if octant >> at & 1 == 1 => 1.0,
                    Some(_) => -1.0,
                    None => far(self.distance(i, p)),
                })
                >= 0.0
        };
        (0..3).all(|at| (0..8usize).any(|octant| inside(octant) != inside(octant ^ 1 << at)))
    }

    /// Returns true if pieces of several layers cross at `p`: each bounds its own layer there,
    /// those of one layer in an edge, and all meet at an angle.
    fn is_crossing(&self, pieces: &[u32], p: Point3) -> bool {
        let pairs = (0..pieces.len()).flat_map(|k| (0..k).map(move |j| [pieces[j], pieces[k]]));
        self.are_bounded_at(pieces, p)
            && pieces.iter().all(|&piece| self.is_face(piece, p))
            && pairs.into_iter().all(|pair| {
                !self.are_parallel(pair, p)
                    && (self.common_layer(&pair).is_none() || self.is_edge(pair, p))
            })
    }

    /// Returns true if a piece that vanishes at `p` is the surface in some direction around it:
    /// there its sign decides the solid's, with the other vanishing pieces evaluated by their
    /// gradients, and those tangential to it with its sign.
    pub(crate) fn is_face(&self, piece: u32, p: Point3) -> bool {
        let Some(reduced) = self.reduced_in(self.layer_of(piece), p) else {
            return false;
        };
        let normal = |i: u32| unit(self.solid.gradient(i, p).1);
        let n = normal(piece);
        let beside: Vec<VanishingPiece> = reduced
            .pieces
            .iter()
            .filter(|&&i| i != piece && self.distance(i, p) == 0.0)
            .map(|&piece| VanishingPiece {
                piece,
                normal: normal(piece),
            })
            .collect();
        if beside.is_empty() {
            return true;
        }
        let (a, b) = frame(n);
        (0..16).any(|k| {
            let (s, c) = (PROBE_ANGLES[0] * f64::from(k) + PROBE_ANGLES[1]).sin_cos();
            let along = std::array::from_fn(|i| c * a[i] + s * b[i]);
            let inside = |side: f64| {
                let value = |i: u32| {
                    if i == piece {
                        return side;
                    }
                    match beside.iter().find(|z| z.piece == i) {
                        Some(other) => other.value(n, along, side),
                        None => far(self.distance(i, p)),
                    }
                };
                is_inside(&reduced.tree, &value)
            };
            inside(1.0) != inside(-1.0)
        })
    }

    /// Returns the first-order value of a piece in the quadrant where the two normals give `s` and
    /// `t`.
    fn follow(&self, piece: u32, n: [Point3; 2], [s, t]: [f64; 2], p: Point3) -> f64 {
        let k = dot(n[0], n[1]);
        let det = 1.0 - k * k;
        let (alpha, beta) = ((s - k * t) / det, (t - k * s) / det);
        let along: Point3 = std::array::from_fn(|i| alpha * n[0][i] + beta * n[1][i]);
        dot(self.solid.gradient(piece, p).1, along)
    }
}

fn is_inside(tree: &Csg, value: &impl Fn(u32) -> f64) -> bool {
    tree.value(value) >= 0.0
}

impl VanishingPiece {
    /// Returns the piece's value in a direction within the face with normal `n`, on one side of the
    /// face.
    fn value(&self, n: Point3, along: Point3, side: f64) -> f64 {
        if norm(cross(self.normal, n)) < MAX_TANGENT_SINE {
            side * dot(self.normal, n).signum()
        } else {
            dot(self.normal, along)
        }
    }
}

/// Returns two vectors of equal length that are orthogonal to a unit vector and to each other.
fn frame(n: Point3) -> (Point3, Point3) {
    let axis = (0..3)
        .min_by(|&i, &j| n[i].abs().total_cmp(&n[j].abs()))
        .unwrap_or(0);
    let mut e = [0.0; 3];
    e[axis] = 1.0;
    let a = cross(n, e);
    (a, cross(n, a))
}
