//! Tips of cones: points of a surface where its gradient vanishes or jumps.
//!
//! Near the tip a of a cone a function is homogeneous of some degree m about a: m g(q) = ∇g(q) · (q
//! − a). So n · a + m d = n · q for the distances d and normals n at several points q, which is
//! linear in (a, m). Where the surface is smooth the normals about the solution agree; about a tip
//! they differ as much at a small distance as at a large one.

use super::context::FeatureContext;
use super::newton::{PieceDistance, add_scaled, normalised};
use crate::decide::{Local, decisive};
use isoform_geom::{Aabb, Point3, dot, norm, sub};
use isoform_num::Interval;

/// Maximum of the least cosine between normals at points around a tip: they differ by at least 25
/// degrees.
const MAX_APEX_NORMAL_COSINE: f64 = 0.9;
/// Distance of the last probe around a tip, in sizes. At a larger distance a ball of this size is
/// indistinguishable from a tip; at a much smaller one rounding decides.
const MIN_APEX_PROBE_DISTANCE: f64 = 1e-4;
/// Minimum ratio of the angles between normals in consecutive probes of a tip. On a smooth surface
/// the angle shrinks to a quarter or less.
const MIN_APEX_ANGLE_RATIO: f64 = 0.6;
/// Maximum first-order distance of a piece at points around its tip, in distances of these points
/// from it. The ratio is 1 divided by the degree of the function; this value allows the fourth root
/// of a cone. The centre of a ball, about which normals point in all directions, too, is much
/// farther from the surface.
const MAX_APEX_DISTANCE_RATIO: f64 = 4.0;
/// Directions from a cell's centre in which normals are compared: the corners of a cube, rotated
/// off the axes.
const APEX_PROBE_DIRECTIONS: [Point3; 8] = [
    [0.93, 0.31, 0.19],
    [-0.93, -0.31, -0.19],
    [-0.36, 0.87, 0.33],
    [0.36, -0.87, -0.33],
    [-0.07, -0.38, 0.92],
    [0.07, 0.38, -0.92],
    [0.55, 0.61, -0.57],
    [-0.55, -0.61, 0.57],
];

impl FeatureContext<'_> {
    /// Returns the tip of a piece in a cell; `None` if it has none.
    pub(crate) fn apex(&self, cell: Aabb, piece: u32) -> Option<Point3> {
        let (center, mut reach) = (cell.center(), 0.5 * cell.diagonal());
        let mut tip = center;
        let mut last = None;
        while reach > MIN_APEX_PROBE_DISTANCE * self.options.size {
            let (spread, next) = self.probe_normals(piece, tip, reach)?;
            if spread > MAX_APEX_NORMAL_COSINE
                || last.is_some_and(|l: f64| spread.acos() < MIN_APEX_ANGLE_RATIO * l.acos())
                // The tip moved away from the place where it was sought.
                || norm(sub(next, tip)) > 1.2 * reach
            {
                return None;
            }
            (tip, last) = (next, Some(spread));
            // Each probe uses an eighth of the last distance.
            reach *= 0.125;
        }
        // In the cell, up to rounding.
        let is_within = |i: usize| cell.lo[i] - 1e-9 <= tip[i] && tip[i] <= cell.hi[i] + 1e-9;
        ((0..3).all(is_within) && self.matters(piece, tip)).then_some(tip)
    }

    /// Returns the least cosine between normals around a point, and the tip to which they point.
    fn probe_normals(&self, piece: u32, p: Point3, reach: f64) -> Option<(f64, Point3)> {
        let mut spread: f64 = 1.0;
        let mut normals = Vec::with_capacity(APEX_PROBE_DIRECTIONS.len());
        // Normal equations of n · (a − p) + m d = n · (q − p).
        let (mut m, mut b) = ([[0.0; 4]; 4], [0.0; 4]);
        for u in APEX_PROBE_DIRECTIONS {
            let q = add_scaled(p, u, reach);
            let Some(g) = normalised(self.solid, piece, q) else {
                continue;
            };
            if g.d.abs() > MAX_APEX_DISTANCE_RATIO * reach {
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
        Some((spread, add_scaled(p, [x[0], x[1], x[2]], reach)))
    }

    /// Returns true if the piece bounds the solid at a point where it vanishes.
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
            // Pieces through the tip, such as the plane between a cone and its opposite half, take
            // both signs there; tips are accurate to some 1e-9 sizes.
            let passes = |g: PieceDistance| g.d.abs() <= 1e-6 * self.options.size;
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

/// Solves a linear system by Gaussian elimination with pivoting; `None` if the matrix is singular.
fn solve(mut m: [[f64; 4]; 4], mut b: [f64; 4]) -> Option<[f64; 4]> {
    for k in 0..4 {
        let pivot = (k..4).max_by(|x, y| m[*x][k].abs().total_cmp(&m[*y][k].abs()))?;
        // The normals do not determine a tip.
        if m[pivot][k].is_nan() || m[pivot][k].abs() < 1e-10 {
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
