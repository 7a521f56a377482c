//! Whether pieces bound the solid at a point: in a face, along an edge, at a corner.
//!
//! The tree is asked for the sign around the point. Pieces that vanish there get the values that
//! they have, to first order, in some direction from it; all others keep their signs.

use super::{Surface, TANGENT};
use crate::points::unit;
use isoform_geom::{Csg, Point3, cross, dot, norm};

/// Directions within a face that are tried.
const DIRECTIONS: u32 = 16;
/// Angle from one direction to the next, and of the first one: in no simple ratio to each other,
/// so that none lies in another piece by design.
const TURN: [f64; 2] = [0.4, 0.123];

/// A value that no other can outweigh, with the sign of the one given.
fn far(value: f64) -> f64 {
    value.signum() * f64::MAX
}

/// Another piece that vanishes at the same point as a face's.
struct Beside {
    piece: u32,
    normal: Point3,
}

impl Surface<'_> {
    /// Whether the two pieces meet at `p` in an edge of the solid: the sign in the four quadrants
    /// between them depends on both, and they meet at an angle.
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
        if norm(cross(n[0], n[1])) < TANGENT {
            return false;
        }
        let inside = |quadrant: [f64; 2]| {
            reduced.tree.value(&|i| {
                if let Some(k) = pair.iter().position(|&k| k == i) {
                    return quadrant[k];
                }
                // A third piece that vanishes as well is followed into the quadrant.
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

    /// Whether the three pieces meet at `p` in a corner of the solid: the sign in the eight octants
    /// between them depends on each.
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

    /// Whether pieces of several layers cross at `p`: each bounds its own layer there, those of one
    /// layer in an edge, and all meet at an angle.
    fn is_crossing(&self, pieces: &[u32], p: Point3) -> bool {
        let pairs = (0..pieces.len()).flat_map(|k| (0..k).map(move |j| [pieces[j], pieces[k]]));
        self.are_bounded_at(pieces, p)
            && pieces.iter().all(|&piece| self.is_face(piece, p))
            && pairs.into_iter().all(|pair| {
                !self.are_parallel(pair, p)
                    && (self.common_layer(&pair).is_none() || self.is_edge(pair, p))
            })
    }

    /// Whether a piece that vanishes at `p` is the surface somewhere around: in some direction
    /// within it, its sign decides the solid's when the other pieces that vanish there go with
    /// their gradients, and those tangential to it with it.
    pub(crate) fn is_face(&self, piece: u32, p: Point3) -> bool {
        let Some(reduced) = self.reduced_in(self.layer_of(piece), p) else {
            return false;
        };
        let normal = |i: u32| unit(self.solid.gradient(i, p).1);
        let n = normal(piece);
        let beside: Vec<Beside> = reduced
            .pieces
            .iter()
            .filter(|&&i| i != piece && self.distance(i, p) == 0.0)
            .map(|&piece| Beside {
                piece,
                normal: normal(piece),
            })
            .collect();
        if beside.is_empty() {
            return true;
        }
        let (a, b) = frame(n);
        (0..DIRECTIONS).any(|k| {
            let (s, c) = (TURN[0] * f64::from(k) + TURN[1]).sin_cos();
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

    /// Value of a piece to first order in the quadrant where the two normals give `s` and `t`.
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

impl Beside {
    /// Its value in a direction within the face with normal `n`, on one side of that.
    fn value(&self, n: Point3, along: Point3, side: f64) -> f64 {
        if norm(cross(self.normal, n)) < TANGENT {
            side * dot(self.normal, n).signum()
        } else {
            dot(self.normal, along)
        }
    }
}

/// Two directions of equal length across a unit vector, and to each other.
fn frame(n: Point3) -> (Point3, Point3) {
    let axis = (0..3)
        .min_by(|&i, &j| n[i].abs().total_cmp(&n[j].abs()))
        .unwrap_or(0);
    let mut e = [0.0; 3];
    e[axis] = 1.0;
    let a = cross(n, e);
    (a, cross(n, a))
}
