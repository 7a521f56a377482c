//! Footprint of a part: the face that the table hides.
//!
//! Points of the side faces just above the table, with their outward normals, are the boundary of
//! the footprint. Its indicator is the winding number in the plane, by Gauss's formula w(q) = 1/2π
//! ∫ n·(p − q)/|p − q|² ds, averaged over the height of these points.

use super::cells::areas;
use isoform_geom::{Aabb, KdTree, Point3};

/// Returns points of the hidden face, and its outward normal: `axis` is across the table, which the
/// end of the box lies on.
pub(super) fn footprint(
    points: &[Point3],
    normals: &[Point3],
    bounds: &Aabb,
    (axis, is_upper): (usize, bool),
) -> (Vec<Point3>, Point3) {
    let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
    let end = if is_upper { bounds.hi } else { bounds.lo }[axis];
    let areas = areas(points, &KdTree::new(points));
    let step = (areas.iter().sum::<f64>() / areas.len().max(1) as f64).sqrt();
    let heights = points.iter().map(|p| (p[axis] - end).abs());
    let lowest = heights.fold(f64::INFINITY, f64::min);
    // Some rows of points.
    let height = 6.0 * step;
    let is_border = |k: &usize| (points[*k][axis] - end).abs() <= lowest + height;
    let border: Vec<usize> = (0..points.len()).filter(is_border).collect();
    let winding = |q: [f64; 2]| -> f64 {
        let of = |k: &usize| {
            let d = [points[*k][i] - q[0], points[*k][j] - q[1]];
            let across = normals[*k][i] * d[0] + normals[*k][j] * d[1];
            areas[*k] * across / (d[0] * d[0] + d[1] * d[1]).max(step * step)
        };
        border.iter().map(of).sum::<f64>() / (std::f64::consts::TAU * height)
    };
    let extent = [bounds.hi[i] - bounds.lo[i], bounds.hi[j] - bounds.lo[j]];
    let cell = extent[0].max(extent[1]) / 64.0;
    let counts = extent.map(|e| (e / cell).ceil() as usize);
    let mut face = Vec::new();
    for u in 0..counts[0] {
        for v in 0..counts[1] {
            let q = [
                bounds.lo[i] + (u as f64 + 0.5) * cell,
                bounds.lo[j] + (v as f64 + 0.5) * cell,
            ];
            if winding(q) > 0.5 {
                let mut p = [0.0; 3];
                (p[axis], p[i], p[j]) = (end, q[0], q[1]);
                face.push(p);
            }
        }
    }
    let mut normal = [0.0; 3];
    normal[axis] = if is_upper { 1.0 } else { -1.0 };
    (face, normal)
}
