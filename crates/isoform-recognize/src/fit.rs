//! Least squares on orthogonal distances, with the covariance of the parameters.

use crate::chart::{MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind};
use isoform_geom::Point3;
use isoform_num::dispatch;
use isoform_num::linalg::{cholesky, cholesky_solve};

/// Convergence limit of a fit: the maximum distance by which a step moves any point of the surface,
/// in diagonals (some units in the last place).
const MAX_CONVERGED_MOVE: f64 = 1e-14;
/// The first damping, as a share of the diagonal of JᵀJ, and its least and largest values.
const DAMPING: [f64; 3] = [1e-3, 1e-12, 1e8];

/// Accuracy of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Precision {
    /// Accuracy that the growth of a region needs.
    Rough,
    /// Convergence to rounding.
    Full,
}

/// Normal equations of the distances: JᵀJ, Jᵀr and rᵀr.
struct NormalEquations {
    matrix: [[f64; MAX_PARAMETERS]; MAX_PARAMETERS],
    side: ParameterRow,
    squares: f64,
    /// Largest |J| by column, from which the motion of the surface in a step is estimated.
    reach: ParameterRow,
}

/// Number of points whose rows are computed at once, one per lane of vector registers. Samples of
/// growing regions have 20 to 200 points: larger blocks leave lanes of the last one empty, smaller
/// ones need more loops.
const POINTS_PER_BLOCK: usize = 16;
/// Number of partial sums of each entry of the equations, so that products do not wait for each
/// other: two registers of two. More take registers from the products.
const PARTIAL_SUMS: usize = 4;

/// One value for each point of a block.
type Column = [f64; POINTS_PER_BLOCK];

dispatch! {
    /// Returns the normal equations of a surface and weighted points.
    fn normal(surface: &Primitive, points: &[Point3], weights: Option<&[f64]>) -> NormalEquations
        = normal_by_kind
}

#[inline(always)]
fn normal_by_kind(
    surface: &Primitive,
    points: &[Point3],
    weights: Option<&[f64]>,
) -> NormalEquations {
    match surface.kind {
        PrimitiveKind::Plane => normal_of::<3>(surface, PrimitiveKind::Plane, points, weights),
        PrimitiveKind::Sphere => normal_of::<4>(surface, PrimitiveKind::Sphere, points, weights),
        PrimitiveKind::Cylinder => {
            normal_of::<5>(surface, PrimitiveKind::Cylinder, points, weights)
        }
        PrimitiveKind::Cone => normal_of::<6>(surface, PrimitiveKind::Cone, points, weights),
        PrimitiveKind::Torus => normal_of::<7>(surface, PrimitiveKind::Torus, points, weights),
    }
}

/// Returns the normal equations of a surface with `N` parameters and weighted points: loops of
/// known length, for a kind known at compile time, take a third of the time.
#[inline(always)]
fn normal_of<const N: usize>(
    surface: &Primitive,
    kind: PrimitiveKind,
    points: &[Point3],
    weights: Option<&[f64]>,
) -> NormalEquations {
    let rows = surface.rows();
    let mut matrix = [[[0.0_f64; PARTIAL_SUMS]; N]; N];
    let (mut side, mut squares) = ([[0.0; PARTIAL_SUMS]; N], [0.0; PARTIAL_SUMS]);
    let mut reach = [[0.0_f64; PARTIAL_SUMS]; N];
    for start in (0..points.len()).step_by(POINTS_PER_BLOCK) {
        let some = &points[start..points.len().min(start + POINTS_PER_BLOCK)];
        // The last point fills the block, without weight.
        let (mut weight, mut block) = (
            [0.0; POINTS_PER_BLOCK],
            [some[some.len() - 1]; POINTS_PER_BLOCK],
        );
        block[..some.len()].copy_from_slice(some);
        match weights {
            Some(weights) => weight[..some.len()].copy_from_slice(&weights[start..][..some.len()]),
            None => weight[..some.len()].fill(1.0),
        }
        let mut columns: [Column; N] = [[0.0; POINTS_PER_BLOCK]; N];
        let mut distance: Column = [0.0; POINTS_PER_BLOCK];
        for lane in 0..POINTS_PER_BLOCK {
            let (r, row) = rows.at(kind, block[lane]);
            distance[lane] = r;
            for i in 0..N {
                columns[i][lane] = row[i];
            }
        }
        for i in 0..N {
            let weighted: Column = std::array::from_fn(|lane| weight[lane] * columns[i][lane]);
            for j in 0..=i {
                add_products(&mut matrix[i][j], &weighted, &columns[j]);
            }
            add_products(&mut side[i], &weighted, &distance);
            for (lane, x) in columns[i].iter().enumerate() {
                let most = &mut reach[i][lane % PARTIAL_SUMS];
                *most = if x.abs() > *most { x.abs() } else { *most };
            }
        }
        let weighted: Column = std::array::from_fn(|lane| weight[lane] * distance[lane]);
        add_products(&mut squares, &weighted, &distance);
    }
    let total = |lanes: [f64; PARTIAL_SUMS]| lanes.iter().sum::<f64>();
    let mut sum = NormalEquations {
        matrix: [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS],
        side: [0.0; MAX_PARAMETERS],
        squares: total(squares),
        reach: [0.0; MAX_PARAMETERS],
    };
    for i in 0..N {
        sum.side[i] = total(side[i]);
        sum.reach[i] = reach[i].into_iter().fold(0.0, f64::max);
        for j in 0..=i {
            sum.matrix[i][j] = total(matrix[i][j]);
        }
    }
    sum
}

/// Adds the products of two columns to partial sums.
#[inline(always)]
fn add_products(sums: &mut [f64; PARTIAL_SUMS], a: &Column, b: &Column) {
    for lane in 0..POINTS_PER_BLOCK {
        sums[lane % PARTIAL_SUMS] += a[lane] * b[lane];
    }
}

/// Returns Σ r² over points.
pub(crate) fn squares(surface: &Primitive, points: &[Point3]) -> f64 {
    let distances = surface.distances();
    points.iter().map(|p| distances.at(*p).powi(2)).sum()
}

/// Returns the mean of points; 0 without any.
pub(crate) fn mean(points: &[Point3]) -> Point3 {
    let mut sum = [0.0; 3];
    for p in points {
        for k in 0..3 {
            sum[k] += p[k];
        }
    }
    sum.map(|s| s / points.len().max(1) as f64)
}

/// Fits a surface to points by least squares of the distances, from a start near it; returns it
/// with Σ r². `None` if there are too few points, or the sizes become invalid.
pub(crate) fn fit(
    start: &Primitive,
    points: &[Point3],
    precision: Precision,
) -> Option<(Primitive, f64)> {
    fit_weighted(start, points, None, precision)
}

/// Fits as [`fit`] does, with a weight for each square.
pub(crate) fn fit_weighted(
    start: &Primitive,
    points: &[Point3],
    weights: Option<&[f64]>,
    precision: Precision,
) -> Option<(Primitive, f64)> {
    if points.len() < start.kind.parameters() {
        return None;
    }
    let mut surface = start.about(mean(points));
    let mut now = normal(&surface, points, weights);
    let [mut damping, least, most] = DAMPING;
    let steps = match precision {
        Precision::Rough => 12,
        // Six steps are usual. A fit that needs more than 40 creeps along a valley, and its surface
        // is hardly determined.
        Precision::Full => 40,
    };
    // In diagonals: √ε of the noise, by which rounding moves a minimum of squares.
    let mut before = 1e-9;
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
        let moves: f64 = (0..MAX_PARAMETERS)
            .map(|k| (step[k] * now.reach[k]).abs())
            .sum();
        match next {
            // Near the minimum rounding hides the decrease: steps that shrink are accepted.
            Some(next) if next.squares <= now.squares || moves < before => {
                let gain = now.squares - next.squares;
                let is_over = precision == Precision::Rough && gain <= 1e-3 * now.squares;
                (surface, now) = (tried, next);
                before = before.min(moves);
                damping = (damping / 10.0).max(least);
                if is_over || moves < MAX_CONVERGED_MOVE {
                    break;
                }
            }
            _ if moves < MAX_CONVERGED_MOVE => break,
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

/// Returns the damped step; `None` if the equations are singular.
fn solve(normal: &NormalEquations, n: usize, damping: f64) -> Option<ParameterRow> {
    let mut a = [0.0; MAX_PARAMETERS * MAX_PARAMETERS];
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

/// Returns (JᵀJ)⁻¹ of the distances of points: the covariance of the parameters of
/// [`Primitive::moved`] for points of unit deviation. `None` if the points leave a parameter
/// undetermined.
pub(crate) fn covariance(
    surface: &Primitive,
    points: &[Point3],
) -> Option<[ParameterRow; MAX_PARAMETERS]> {
    let n = surface.kind.parameters();
    let normal = normal(surface, points, None);
    let mut a: Vec<f64> = (0..n * n)
        .map(|k| normal.matrix[(k / n).max(k % n)][(k / n).min(k % n)])
        .collect();
    if !cholesky(&mut a, n) {
        return None;
    }
    let mut inverse = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
    for k in 0..n {
        inverse[k][k] = 1.0;
        cholesky_solve(&a, n, &mut inverse[k][..n]);
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns points of a fixed sphere of radius 0.5 with errors of this deviation, uniform in ±√3
    /// of it.
    fn sphere(count: usize, deviation: f64, seed: u64) -> Vec<Point3> {
        let mut state = seed;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut point = || {
            let (z, turn) = (2.0 * random() - 1.0, std::f64::consts::TAU * random());
            let r = 0.5 + deviation * 3.0_f64.sqrt() * (2.0 * random() - 1.0);
            let across = (1.0 - z * z).sqrt();
            [
                r * across * turn.cos() + 0.1,
                r * across * turn.sin(),
                r * z - 0.2,
            ]
        };
        (0..count).map(|_| point()).collect()
    }

    fn start() -> Primitive {
        Primitive {
            kind: PrimitiveKind::Sphere,
            place: [0.15, -0.05, -0.1],
            axis: [0.0, 0.0, 1.0],
            size: 0.4,
            other: 0.0,
        }
    }

    #[test]
    fn exact_points_give_their_sphere() {
        let (found, squares) = fit(&start(), &sphere(60, 0.0, 1), Precision::Full).expect("fits");
        assert!(
            (found.size - 0.5).abs() < 1e-13 && squares < 1e-26,
            "{found:?}"
        );
    }

    /// With points all over a sphere the variance of its radius is σ²/n, of each coordinate 3σ²/n.
    #[test]
    fn covariance_of_a_whole_sphere_is_that_of_the_closed_form() {
        let points = sphere(20_000, 0.0, 2);
        let (found, _) = fit(&start(), &points, Precision::Full).expect("fits");
        let c = covariance(&found, &points).expect("all is determined");
        let n = points.len() as f64;
        assert!((c[3][3] * n - 1.0).abs() < 0.01, "{}", c[3][3] * n);
        (0..3).for_each(|k| assert!((c[k][k] * n - 3.0).abs() < 0.1, "{}", c[k][k] * n));
    }

    /// The errors of the radius over many samples agree with the covariance.
    #[test]
    fn errors_are_at_the_limit_of_cramer_and_rao() {
        let (count, sigma, tries) = (200, 1e-3, 300);
        let error = |seed: u64| {
            let points = sphere(count, sigma, 1 + 7919 * seed);
            fit(&start(), &points, Precision::Full)
                .expect("fits")
                .0
                .size
                - 0.5
        };
        let squares: f64 = (0..tries).map(|k| error(k).powi(2)).sum();
        let ratio = (squares / tries as f64).sqrt() / (sigma / (count as f64).sqrt());
        assert!((0.85..1.15).contains(&ratio), "{ratio}");
    }

    /// Blocks of points count each once, with its weight: a whole one, and one point.
    #[test]
    fn equations_are_sums_over_all_points() {
        let points = sphere(POINTS_PER_BLOCK + 1, 0.05, 3);
        let weights: Vec<f64> = (0..points.len()).map(|k| 0.5 + 0.1 * k as f64).collect();
        let surface = start();
        let sum = normal(&surface, &points, Some(&weights));
        let (mut squares, mut radius, mut all) = (0.0, 0.0, 0.0);
        for (p, w) in points.iter().zip(&weights) {
            let r = surface.distance(*p);
            squares += w * r * r;
            // The distance falls by what the radius grows.
            radius -= w * r;
            all += w;
        }
        assert!((sum.squares - squares).abs() < 1e-14);
        assert!((sum.side[3] - radius).abs() < 1e-14);
        assert!((sum.matrix[3][3] - all).abs() < 1e-12);
        assert_eq!(sum.reach[3], 1.0);
    }

    #[test]
    fn open_parameters_have_no_covariance() {
        let points: Vec<Point3> = (0..9).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        let plane = Primitive::plane([0.0; 3], [0.0, 0.0, 1.0]);
        assert!(covariance(&plane, &points).is_none());
    }
}
