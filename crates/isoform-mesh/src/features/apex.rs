//! Tips of cones: points of a surface where its gradient vanishes or jumps.
//!
//! Near the tip a of a cone a function is homogeneous of some degree m about a: m g(q) = ∇g(q) · (q
//! − a). So n · a + m d = n · q for the distances d and normals n at several points q, which is
//! linear in (a, m). Where the surface is smooth the normals about the solution agree; about a tip
//! they differ as much at a small distance as at a large one.

use super::newton::{Distance, along, normalised};
use super::search::Search;
use crate::decide::{Local, decisive};
use isoform_geom::{Aabb, Point3, dot, norm, sub};
use isoform_num::Interval;

/// Cosine of the angle by which normals at points around a tip must differ, 25 degrees.
const SPREAD: f64 = 0.9;
/// Each look at a tip is from this part of the distance of the one before.
const NEARER: f64 = 0.125;
/// Distance, in sizes, of the last look at a tip: from farther away a ball as small as this looks
/// like one from outside; from much nearer rounding decides.
const NEAREST: f64 = 1e-4;
/// A smooth surface looks flatter from nearer: its normals differ by a quarter of the angle or
/// less. Below this part it is no tip.
const FLATTER: f64 = 0.6;
/// Distance, in those at which the points around are, that the tip may be from where it was sought.
const ASTRAY: f64 = 1.2;
/// Distance from a cell, in model units, within which a tip is in it.
const BESIDE: f64 = 1e-9;
/// Distances to a piece at places around its tip, in those of the places from it: at most 1 divided
/// by the degree of the function, and this for the fourth root of a cone. The middle of a ball,
/// about which normals point in all directions, too, is much farther from the surface.
const HEIGHT: f64 = 4.0;
/// Distance of a piece from a tip, in sizes, within which it passes through it: tips are found to
/// some 1e-9.
const THROUGH: f64 = 1e-6;
/// Pivot below which the normals do not determine a tip.
const SINGULAR: f64 = 1e-10;
/// Directions from a cell's centre in which its normals are compared, the corners of a cube turned
/// off the axes.
const AROUND: [Point3; 8] = [
    [0.93, 0.31, 0.19],
    [-0.93, -0.31, -0.19],
    [-0.36, 0.87, 0.33],
    [0.36, -0.87, -0.33],
    [-0.07, -0.38, 0.92],
    [0.07, 0.38, -0.92],
    [0.55, 0.61, -0.57],
    [-0.55, -0.61, 0.57],
];

impl Search<'_> {
    /// The tip of a piece in a cell.
    pub(crate) fn apex(&self, cell: Aabb, piece: u32) -> Option<Point3> {
        let (center, mut reach) = (cell.center(), 0.5 * cell.diagonal());
        let mut tip = center;
        let mut last = None;
        while reach > NEAREST * self.options.size {
            let (spread, next) = self.look(piece, tip, reach)?;
            if spread > SPREAD
                || last.is_some_and(|l: f64| spread.acos() < FLATTER * l.acos())
                || norm(sub(next, tip)) > ASTRAY * reach
            {
                return None;
            }
            (tip, last) = (next, Some(spread));
            reach *= NEARER;
        }
        let is_within = |i: usize| cell.lo[i] - BESIDE <= tip[i] && tip[i] <= cell.hi[i] + BESIDE;
        ((0..3).all(is_within) && self.matters(piece, tip)).then_some(tip)
    }

    /// The least cosine between the normals around a point, and the tip they point to.
    fn look(&self, piece: u32, p: Point3, reach: f64) -> Option<(f64, Point3)> {
        let mut spread: f64 = 1.0;
        let mut normals = Vec::with_capacity(AROUND.len());
        // Normal equations of n · (a − p) + m d = n · (q − p).
        let (mut m, mut b) = ([[0.0; 4]; 4], [0.0; 4]);
        for u in AROUND {
            let q = along(p, u, reach);
            let Some(g) = normalised(self.solid, piece, q) else {
                continue;
            };
            if g.d.abs() > HEIGHT * reach {
                return None;
            }
            let row = [g.n[0], g.n[1], g.n[2], g.d / reach];
            let right = dot(g.n, u);
            for i in 0..4 {
                for j in 0..4 {
                    m[i][j] += row[i] * row[j];
                }
                b[i] += row[i] * right;
            }
            spread = normals.iter().fold(spread, |s, n| s.min(dot(*n, g.n)));
            normals.push(g.n);
        }
        let x = solve(m, b)?;
        Some((spread, along(p, [x[0], x[1], x[2]], reach)))
    }

    /// Whether the piece bounds the solid at a point where it vanishes.
    fn matters(&self, piece: u32, p: Point3) -> bool {
        let Local { tree, pieces } = Local::everywhere(self.solid);
        let mut values = vec![0.0; pieces.len()];
        self.solid.values(&pieces, &[p], &mut values);
        let range = |k: u32| {
            if k == piece {
                return Interval::new(-1.0, 1.0);
            }
            let at = pieces.iter().position(|q| *q == k);
            let v = at.map_or(0.0, |at| values[at]);
            // What passes through the tip, as the plane that parts a cone from its other half, has
            // either sign there.
            let passes = |g: Distance| g.d.abs() <= THROUGH * self.options.size;
            if normalised(self.solid, k, p).is_none_or(passes) {
                return Interval::new(-1.0, 1.0);
            }
            Interval::new(v, v)
        };
        let mut which = Vec::new();
        decisive(&tree, &range, &mut which);
        which.contains(&piece)
    }
}

/// Gaussian elimination with pivots; none for a singular matrix.
fn solve(mut m: [[f64; 4]; 4], mut b: [f64; 4]) -> Option<[f64; 4]> {
    for k in 0..4 {
        let pivot = (k..4).max_by(|x, y| m[*x][k].abs().total_cmp(&m[*y][k].abs()))?;
        if m[pivot][k].is_nan() || m[pivot][k].abs() < SINGULAR {
            return None;
        }
        m.swap(k, pivot);
        b.swap(k, pivot);
        for r in k + 1..4 {
            let f = m[r][k] / m[k][k];
            for c in k..4 {
                m[r][c] -= f * m[k][c];
            }
            b[r] -= f * b[k];
        }
    }
    for k in (0..4).rev() {
        for c in k + 1..4 {
            b[k] -= m[k][c] * b[c];
        }
        b[k] /= m[k][k];
    }
    Some(b)
}
