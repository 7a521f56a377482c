//! Least squares on orthogonal distances, with the covariance of the parameters.

use crate::chart::{MOST, Row, Surface};
use isoform_geom::Point3;
use isoform_num::linalg::{cholesky, cholesky_solve};

/// Steps of Levenberg–Marquardt; six are usual. A fit that needs more creeps along a valley, and
/// its surface is hardly determined.
const STEPS: usize = 40;
/// Steps of a rough fit.
const ROUGH_STEPS: usize = 12;
/// The fit has converged when a step moves no point of the surface by more than this, in units of
/// the scan's diagonal: some ulps.
const STILL: f64 = 1e-14;
/// The fit of a growing region has converged when the sum of squares falls by less than this share.
const LITTLE: f64 = 1e-3;
/// The first damping, as a share of the diagonal of JᵀJ, and its least and largest values.
const DAMPING: [f64; 3] = [1e-3, 1e-12, 1e8];

/// How far a fit goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Precision {
    /// As far as the growing of a region needs.
    Rough,
    /// To rounding.
    Full,
}

/// Normal equations of the distances: JᵀJ, Jᵀr and rᵀr.
struct Normal {
    matrix: [[f64; MOST]; MOST],
    side: Row,
    squares: f64,
    /// The largest |J| by column, to tell how far a step moves the surface.
    reach: Row,
}

fn normal(surface: &Surface, points: &[Point3], weights: Option<&[f64]>) -> Normal {
    let n = surface.kind.parameters();
    let mut sum = Normal {
        matrix: [[0.0; MOST]; MOST],
        side: [0.0; MOST],
        squares: 0.0,
        reach: [0.0; MOST],
    };
    let frame = surface.frame();
    for (k, p) in points.iter().enumerate() {
        let (r, row) = surface.distance_row(&frame, *p);
        let w = weights.map_or(1.0, |w| w[k]);
        for i in 0..n {
            for j in 0..=i {
                sum.matrix[i][j] += w * row[i] * row[j];
            }
            sum.side[i] += w * row[i] * r;
            sum.reach[i] = sum.reach[i].max(row[i].abs());
        }
        sum.squares += w * r * r;
    }
    sum
}

/// Σ r² over points.
pub(crate) fn squares(surface: &Surface, points: &[Point3]) -> f64 {
    points.iter().map(|p| surface.distance(*p).powi(2)).sum()
}

/// The mean of points; 0 without any.
pub(crate) fn mean(points: &[Point3]) -> Point3 {
    let mut sum = [0.0; 3];
    for p in points {
        for k in 0..3 {
            sum[k] += p[k];
        }
    }
    sum.map(|s| s / points.len().max(1) as f64)
}

/// The surface of least squares of the distances of points, from a start near it; with Σ r². `None`
/// where there is none: too few points, sizes that are no surface's.
pub(crate) fn fit(
    start: &Surface,
    points: &[Point3],
    precision: Precision,
) -> Option<(Surface, f64)> {
    fit_weighted(start, points, None, precision)
}

/// As [`fit`], each square times a weight.
pub(crate) fn fit_weighted(
    start: &Surface,
    points: &[Point3],
    weights: Option<&[f64]>,
    precision: Precision,
) -> Option<(Surface, f64)> {
    if points.len() < start.kind.parameters() {
        return None;
    }
    let mut surface = start.about(mean(points));
    let mut now = normal(&surface, points, weights);
    let [mut damping, least, most] = DAMPING;
    let steps = match precision {
        Precision::Rough => ROUGH_STEPS,
        Precision::Full => STEPS,
    };
    for _ in 0..steps {
        let Some(step) = solve(&now, surface.kind.parameters(), damping) else {
            damping *= 10.0;
            if damping > most {
                return None;
            }
            continue;
        };
        let tried = surface.moved(&step);
        let next = tried.is_proper().then(|| normal(&tried, points, weights));
        let moves: f64 = (0..MOST).map(|k| (step[k] * now.reach[k]).abs()).sum();
        match next {
            Some(next) if next.squares <= now.squares => {
                let gain = now.squares - next.squares;
                let is_over = precision == Precision::Rough && gain <= LITTLE * now.squares;
                (surface, now) = (tried, next);
                damping = (damping / 10.0).max(least);
                if is_over || moves < STILL {
                    break;
                }
            }
            _ if moves < STILL => break,
            _ => {
                damping *= 10.0;
                if damping > most {
                    break;
                }
            }
        }
    }
    let squares = now.squares;
    (surface.is_proper() && squares.is_finite()).then_some((surface, squares))
}

/// The damped step; `None` where the equations are singular.
fn solve(normal: &Normal, n: usize, damping: f64) -> Option<Row> {
    let mut a = [0.0; MOST * MOST];
    for i in 0..n {
        for j in 0..n {
            a[i * n + j] = normal.matrix[i.max(j)][i.min(j)];
        }
        a[i * n + i] *= 1.0 + damping;
    }
    let a = &mut a[..n * n];
    if !cholesky(a, n) {
        return None;
    }
    let mut step = normal.side.map(|x| -x);
    cholesky_solve(a, n, &mut step[..n]);
    step.iter().all(|x| x.is_finite()).then_some(step)
}

/// (JᵀJ)⁻¹ of the distances of points: the covariance of the parameters of [`Surface::moved`] for
/// points of unit deviation. `None` where the points leave a parameter open.
pub(crate) fn covariance(surface: &Surface, points: &[Point3]) -> Option<[Row; MOST]> {
    let n = surface.kind.parameters();
    let normal = normal(surface, points, None);
    let mut a: Vec<f64> = (0..n * n)
        .map(|k| normal.matrix[(k / n).max(k % n)][(k / n).min(k % n)])
        .collect();
    if !cholesky(&mut a, n) {
        return None;
    }
    let mut inverse = [[0.0; MOST]; MOST];
    for k in 0..n {
        inverse[k][k] = 1.0;
        cholesky_solve(&a, n, &mut inverse[k][..n]);
    }
    Some(inverse)
}
