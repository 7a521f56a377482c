//! Local estimates at a point from its neighbours: the normal, also next to edges and on thin
//! walls, and the roughness, the deviation from a smooth surface.

use crate::chart::{frame, unit};
use crate::start::quadratic_row;
use isoform_geom::{Point3, dot, sub};
use isoform_num::linalg::{cholesky, cholesky_solve, symmetric_eigen_3};

/// Number of points whose plane gives the normal. More average noise and round off edges.
const NORMAL_POINTS: usize = 13;

/// Local estimates at a point.
pub(crate) struct LocalEstimates {
    /// Unit normal of arbitrary sign.
    pub(crate) normal: Point3,
    /// Standard deviation of the neighbours from the quadratic height that fits them best; infinite
    /// if they are too few.
    pub(crate) roughness: f64,
}

/// Estimates the normal and the roughness from a point and its neighbours (the point included,
/// nearest first).
pub(crate) fn local(points: &[Point3], i: usize, found: &[(f64, u32)]) -> LocalEstimates {
    let offsets: Vec<Point3> = found
        .iter()
        .map(|f| sub(points[f.1 as usize], points[i]))
        .collect();
    let normal = unit(normal(&offsets));
    LocalEstimates {
        normal,
        roughness: roughness(&offsets, normal),
    }
}

/// Returns the normal of the plane of the nearest points, or of those to one side if these are
/// clearly flatter: next to an edge the normal is then that of the face.
fn normal(offsets: &[Point3]) -> Point3 {
    let (axes, _) = spread(offsets);
    let near = &offsets[..NORMAL_POINTS.min(offsets.len())];
    let (plain, variance) = spread(near);
    // By chance one in fifty of six one-sided planes has a smaller share of the variance.
    let mut best = (variance * 0.2, plain[0]);
    let mut side = Vec::with_capacity(NORMAL_POINTS);
    let radius = offsets.last().map_or(0.0, |d| dot(*d, *d).sqrt());
    for axis in axes {
        for sign in [1.0, -1.0] {
            side.clear();
            // One side reaches beyond the point by a quarter of the radius.
            let to_side = |d: &&Point3| sign * dot(**d, axis) >= -0.25 * radius;
            side.extend(offsets.iter().filter(to_side).take(NORMAL_POINTS));
            if side.len() < 9 {
                continue;
            }
            let moments = moments(&side);
            if least_variance(&moments, side.len()) < best.0 {
                let (axes, variance) = principal(&moments, side.len());
                if variance < best.0 {
                    best = (variance, axes[0]);
                }
            }
        }
    }
    best.1
}

/// Returns the principal axes of points, that of least variance first, and this variance.
fn spread(offsets: &[Point3]) -> ([Point3; 3], f64) {
    principal(&moments(offsets), offsets.len())
}

/// Returns Σ d dᵀ of points about their mean.
pub(crate) fn moments(offsets: &[Point3]) -> [[f64; 3]; 3] {
    let middle = crate::fit::mean(offsets);
    let mut moments = [[0.0; 3]; 3];
    for p in offsets {
        let d = sub(*p, middle);
        for a in 0..3 {
            for b in 0..3 {
                moments[a][b] += d[a] * d[b];
            }
        }
    }
    moments
}

/// Returns [`spread`] of `count` points with these moments.
fn principal(moments: &[[f64; 3]; 3], count: usize) -> ([Point3; 3], f64) {
    let (values, axes) = symmetric_eigen_3(moments);
    (axes, values[0].max(0.0) / free(count))
}

/// Returns a lower bound of the least variance, which takes a tenth of the time: the product of the
/// other two eigenvalues is at most the square of half their sum, and the determinant is the
/// product of all three.
fn least_variance(moments: &[[f64; 3]; 3], count: usize) -> f64 {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = *moments;
    let determinant =
        xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    let trace = xx + yy + zz;
    // The bound is rounded by some ulps of the sum of the variances. With more, bounds exclude
    // nothing, with less they exclude planes that are exact to rounding.
    let least = 4.0 * determinant / (trace * trace) - 1e-14 * trace;
    if least.is_nan() {
        0.0
    } else {
        least / free(count)
    }
}

/// Returns the degrees of freedom of the heights of points over their plane.
fn free(count: usize) -> f64 {
    count.saturating_sub(3).max(1) as f64
}

/// Returns the standard deviation of the neighbours on the point's own sheet from the quadratic
/// height over the tangent plane that fits them best.
fn roughness(offsets: &[Point3], normal: Point3) -> f64 {
    let mut heights: Vec<f64> = offsets.iter().map(|d| dot(*d, normal).abs()).collect();
    let half = heights.len() / 2;
    let median = *heights.select_nth_unstable_by(half, f64::total_cmp).1;
    // Neighbours farther away lie on another sheet.
    let is_near = |d: &&Point3| dot(**d, normal).abs() <= 5.0 * median;
    let own: Vec<&Point3> = offsets.iter().filter(is_near).collect();
    let scale = own.last().map_or(0.0, |d| dot(**d, **d).sqrt());
    if own.len() < 14 || scale == 0.0 {
        return f64::INFINITY;
    }
    quadratic(&own, normal, scale)
}

/// Returns the standard deviation from the quadratic height, of offsets up to the length `scale`.
fn quadratic(offsets: &[&Point3], normal: Point3, scale: f64) -> f64 {
    const N: usize = 6;
    let [e, f] = frame(normal);
    let (mut a, mut b, mut squares) = ([0.0; N * N], [0.0; N], 0.0);
    for d in offsets {
        let d = d.map(|v| v / scale);
        let (u, v, w) = (dot(d, e), dot(d, f), dot(d, normal));
        let row = quadratic_row(u, v);
        for r in 0..N {
            for c in 0..N {
                a[r * N + c] += row[r] * row[c];
            }
            b[r] += row[r] * w;
        }
        squares += w * w;
    }
    let side = b;
    if !cholesky(&mut a, N) {
        return f64::INFINITY;
    }
    cholesky_solve(&a, N, &mut b);
    let explained: f64 = (0..N).map(|k| b[k] * side[k]).sum();
    let free = (offsets.len() - N) as f64;
    scale * ((squares - explained).max(0.0) / free).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::Random;

    /// The bound is below the least variance of sets of any shape, and near it if the other two are
    /// equal.
    #[test]
    fn variances_are_bounded_from_below() {
        let mut random = Random::new(3);
        for k in 0..300 {
            let flat = 10.0_f64.powi(-(k % 10));
            let sizes = [1.0, 0.2 + random.unit(), flat];
            let turn = unit(std::array::from_fn(|_| random.unit() - 0.5));
            let [e, f] = frame(turn);
            let mut point = || -> Point3 {
                let [x, y, z] = sizes.map(|size| size * (random.unit() - 0.5));
                std::array::from_fn(|c| x * e[c] + y * f[c] + z * turn[c])
            };
            let points: Vec<Point3> = (0..13).map(|_| point()).collect();
            let moments = moments(&points);
            let (_, least) = principal(&moments, points.len());
            let bound = least_variance(&moments, points.len());
            assert!(bound <= least, "{bound} {least}");
            assert!(flat < 1e-3 || bound > 0.1 * least, "{bound} {least}");
        }
        assert_eq!(least_variance(&[[0.0; 3]; 3], 13), 0.0);
    }
}
