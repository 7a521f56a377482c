//! Singular points of a surface, where F and ∇F vanish: nodes, self-intersections and pinch points.

use crate::stretch::beside;
use isoform_geom::{Field, KdTree, Point3, RationalPatch, distance_squared, norm};
use isoform_num::linalg::symmetric_eigen;

/// Fraction of the radius in which the surface may be left out, within which patches avoid singular
/// points: the ring between is covered.
const AVOIDED_SHARE: f64 = 0.6;
/// Number of samples along a side, and maximum number of samples across an addition to a patch.
const MAX_AVOIDANCE_SAMPLES: usize = 24;

/// Singular points with the distance within which patches avoid them.
#[derive(Clone, Debug)]
pub(crate) struct AvoidedPoints {
    tree: KdTree,
    apart: f64,
}

impl AvoidedPoints {
    pub(crate) fn new(points: &[Point3], apart: f64) -> Self {
        Self {
            tree: KdTree::new(points),
            apart,
        }
    }

    /// Returns true if samples of a patch come near one of the points.
    pub(crate) fn is_near(&self, patch: &RationalPatch) -> bool {
        let at = |i: usize| i as f64 / MAX_AVOIDANCE_SAMPLES as f64;
        let near = (AVOIDED_SHARE * self.apart).powi(2);
        (0..=MAX_AVOIDANCE_SAMPLES).any(|i| {
            (0..=MAX_AVOIDANCE_SAMPLES).any(|j| {
                let p = patch.point(at(i), at(j));
                self.tree.nearest(p).is_some_and(|n| n.1 <= near)
            })
        })
    }

    /// Returns the fraction, at most the given one, by which a patch may grow at a side (of u = 0,
    /// u = 1, v = 0, v = 1) without coming near one of the points, judged by samples of the
    /// addition; 0 if halving does not suffice.
    pub(crate) fn within(&self, patch: &RationalPatch, side: usize, share: f64) -> f64 {
        let mut share = share;
        for _ in 0..5 {
            if !self.is_near_addition(patch, side, share) {
                return share;
            }
            share *= 0.5;
        }
        0.0
    }

    /// Returns true if samples of the addition to a patch at a side come near one of the points.
    /// Across the addition, the spacing of samples is at most the avoided distance.
    fn is_near_addition(&self, patch: &RationalPatch, side: usize, share: f64) -> bool {
        let near = AVOIDED_SHARE * self.apart;
        let t = patch.tangents(0.5, 0.5);
        let edge = norm(if side < 2 { t.u } else { t.v });
        let deep = ((share * edge / near).ceil() as usize).clamp(1, MAX_AVOIDANCE_SAMPLES);
        (0..=deep).any(|i| {
            let e = share * i as f64 / deep as f64;
            (0..=MAX_AVOIDANCE_SAMPLES).any(|k| {
                let (u, v) = beside(side, k as f64 / MAX_AVOIDANCE_SAMPLES as f64, e);
                let p = patch.point(u, v);
                let is_finite = p.iter().all(|v| v.is_finite());
                is_finite && self.tree.nearest(p).is_some_and(|n| n.1 <= near * near)
            })
        })
    }
}

/// Finds singular points by Newton's method from samples of the surface, none within a quarter of
/// `apart` of another. Some may be missed; the region that is left out is described by those that
/// are found.
pub(crate) fn points(field: &dyn Field, samples: &[Point3], apart: f64, scale: f64) -> Vec<Point3> {
    let mut found: Vec<Point3> = Vec::new();
    let least = (0.25 * apart).powi(2);
    for p in samples {
        let Some(s) = near(field, *p, apart, scale) else {
            continue;
        };
        if found.iter().all(|f| distance_squared(*f, s) > least) {
            found.push(s);
        }
    }
    found
}

/// Finds the singular point to which Newton's method for ∇F = 0, with steps of least length, leads;
/// `None` if that is not near.
fn near(field: &dyn Field, from: Point3, apart: f64, scale: f64) -> Option<Point3> {
    let mut p = from;
    for _ in 0..20 {
        let j = field.jet(p);
        let h: [f64; 9] = std::array::from_fn(|k| j.second(k / 3, k % 3));
        let rows = h.as_chunks::<3>().0;
        let size = norm([norm(rows[0]), norm(rows[1]), norm(rows[2])]);
        let slope = norm(j.g);
        // |∇F|/|H| estimates the distance from the singular point; where curvatures differ, it may be
        // wrong by a factor of four.
        if !(size > 0.0 && size.is_finite()) || slope > 4.0 * apart * size {
            return None;
        }
        // Relative values of ∇F, and of the root of F, that count as 0.
        let zero = 1e-6;
        if slope <= zero * size * scale {
            let is_on = j.v.abs() <= zero * zero * size * scale * scale;
            return (is_on && distance_squared(p, from) <= (2.0 * apart).powi(2)).then_some(p);
        }
        p = least_step(p, j.g, &h);
        if !p.iter().all(|v| v.is_finite()) {
            return None;
        }
    }
    None
}

/// Returns the point after the Newton step of least length for ∇F = 0, without components along
/// directions in which second derivatives nearly vanish.
fn least_step(mut p: Point3, g: Point3, h: &[f64; 9]) -> Point3 {
    let (values, vectors) = symmetric_eigen(h, 3);
    let most = values[0].abs().max(values[2].abs());
    for k in 0..3 {
        // Smaller ones belong to the direction of a curve of singular points.
        if values[k].abs() > 1e-3 * most {
            let v = &vectors[3 * k..3 * k + 3];
            let along: f64 = (0..3).map(|i| v[i] * g[i]).sum::<f64>() / values[k];
            for i in 0..3 {
                p[i] -= along * v[i];
            }
        }
    }
    p
}
