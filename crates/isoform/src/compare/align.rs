//! Rigid motion that brings points onto the other side: the best fit.

use isoform_geom::cad::Placement;
use isoform_geom::{Point3, dot, norm, sub};
use isoform_num::linalg::{cholesky, cholesky_solve, symmetric_eigen_3};

/// Number of points with which starts are compared: enough to tell turned poses apart.
const POINTS_OF_STARTS: usize = 400;
/// Maximum number of points with which the motion is refined: the error of six numbers from these
/// is below a hundredth of the noise.
const POINTS_OF_MOTION: usize = 20_000;
/// Number of steps from each start, and maximum number of steps of the refinement.
const STEPS_OF_STARTS: usize = 10;
const MAX_STEPS: usize = 60;
/// Step for differences of distances, relative to the size of the points: the cube root of the
/// rounding error.
const DIFFERENCE: f64 = 6e-6;
/// Motion, relative to the size of the points, at which the refinement ends: far below the noise of
/// scans, and above the error of the differences.
const SMALLEST_MOTION: f64 = 1e-9;

/// Finds the motion of least squares of the distances, from the pose as given and from the 24 poses
/// in which the principal axes of the points agree with those of the other side.
///
/// `distances` returns the distances of points from the other side, signed where it has an inside;
/// `rough` does so to the deviation of its triangles, in less time.
pub(super) fn best_fit(
    points: &[Point3],
    other: &[Point3],
    rough: &DistanceFunction<'_>,
    distances: &DistanceFunction<'_>,
) -> Placement {
    let few = spread(points, POINTS_OF_STARTS);
    let mut best = (f64::INFINITY, Placement::IDENTITY);
    for start in starts(points, other) {
        let found = refined(&few, start, STEPS_OF_STARTS, rough, rough);
        let sum = squares(&rough(&moved(&few, &found)));
        // The first start is the pose as given: others must be better by more than rounding.
        if sum < best.0 * (1.0 - 1e-9) {
            best = (sum, found);
        }
    }
    let most = spread(points, POINTS_OF_MOTION);
    let near = refined(&most, best.1, MAX_STEPS, rough, rough);
    refined(&most, near, MAX_STEPS, distances, rough)
}

/// Function that returns the distances of points.
type DistanceFunction<'a> = dyn Fn(&[Point3]) -> Vec<f64> + 'a;

/// Returns about `n` of the points, evenly by their order.
fn spread(points: &[Point3], n: usize) -> Vec<Point3> {
    let step = points.len().div_ceil(n).max(1);
    points.iter().step_by(step).copied().collect()
}

/// Returns the images of points.
pub(super) fn moved(points: &[Point3], motion: &Placement) -> Vec<Point3> {
    points.iter().map(|p| motion.point(*p)).collect()
}

/// Returns the sum of the squares of finite numbers; infinite without any.
fn squares(distances: &[f64]) -> f64 {
    let finite = distances.iter().filter(|d| d.is_finite());
    match finite.clone().count() {
        0 => f64::INFINITY,
        _ => finite.map(|d| d * d).sum(),
    }
}

/// Returns the poses from which the search starts.
fn starts(points: &[Point3], other: &[Point3]) -> Vec<Placement> {
    let mut all = vec![Placement::IDENTITY];
    if points.is_empty() || other.is_empty() {
        return all;
    }
    let (from, source) = principal(points);
    let (to, target) = principal(other);
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ] {
        for signs in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
            let x = target[order[0]].map(|v| signs[0] * v);
            let y = target[order[1]].map(|v| signs[1] * v);
            let columns = [x, y, isoform_geom::cross(x, y)];
            let rotation = std::array::from_fn(|i| {
                std::array::from_fn(|j| (0..3).map(|k| columns[k][i] * source[k][j]).sum())
            });
            let turned = Placement {
                rotation,
                ..Placement::IDENTITY
            };
            all.push(Placement {
                shift: sub(to, turned.point(from)),
                ..turned
            });
        }
    }
    all
}

/// Returns the centre of points and their principal axes, right-handed.
fn principal(points: &[Point3]) -> (Point3, [Point3; 3]) {
    let center = centroid(points);
    let mut moments = [[0.0; 3]; 3];
    for p in points {
        let d = sub(*p, center);
        (0..3).for_each(|i| (0..3).for_each(|j| moments[i][j] += d[i] * d[j]));
    }
    let (_, [x, y, _]) = symmetric_eigen_3(&moments);
    (center, [x, y, isoform_geom::cross(x, y)])
}

fn centroid(points: &[Point3]) -> Point3 {
    let n = points.len().max(1) as f64;
    std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / n)
}

/// Returns the motion after at most `most` steps by Gauss and Newton; each step makes the sum of
/// squares smaller. `slopes` are distances whose differences stand for those of `distances`: an
/// error of them makes steps shorter, not the result wrong.
fn refined(
    points: &[Point3],
    start: Placement,
    most: usize,
    distances: &DistanceFunction<'_>,
    slopes: &DistanceFunction<'_>,
) -> Placement {
    let mut motion = start;
    let mut at = moved(points, &motion);
    let mut known = distances(&at);
    let center = centroid(points);
    let size = points
        .iter()
        .fold(0.0, |m: f64, p| m.max(norm(sub(*p, center))));
    for _ in 0..most {
        let Some(step) = gauss_newton(&at, &known, size, slopes) else {
            break;
        };
        // Half steps, down to a thousandth, where the distances are not smooth.
        let mut share = 1.0;
        let better = (0..10).find_map(|_| {
            let next = turned(step.map(|v| share * v), centroid(&at)).after(&motion);
            let points = moved(points, &next);
            let found = distances(&points);
            let is_better = squares(&found) < squares(&known);
            share *= 0.5;
            is_better.then_some((next, points, found))
        });
        let Some(better) = better else { break };
        (motion, at, known) = better;
        let length = step[..3]
            .iter()
            .map(|v| v.abs() * size)
            .chain(step[3..].iter().map(|v| v.abs()));
        if length.fold(0.0, f64::max) <= SMALLEST_MOTION * size {
            break;
        }
    }
    motion
}

/// Returns the step of Gauss and Newton: a rotation vector about the centroid, in radians, then a
/// shift; `None` if no distance depends on the motion.
fn gauss_newton(
    points: &[Point3],
    known: &[f64],
    size: f64,
    slopes: &DistanceFunction<'_>,
) -> Option<[f64; 6]> {
    let center = centroid(points);
    let h = DIFFERENCE * size;
    let mut gradients = vec![[0.0; 3]; points.len()];
    for k in 0..3 {
        let beside = |by: f64| -> Vec<f64> {
            let beside = points.iter().map(|p| {
                let mut p = *p;
                p[k] += by;
                p
            });
            slopes(&beside.collect::<Vec<_>>())
        };
        for (g, (above, below)) in gradients.iter_mut().zip(beside(h).iter().zip(beside(-h))) {
            g[k] = (above - below) / (2.0 * h);
        }
    }
    let (mut normal, mut right) = (vec![0.0; 36], vec![0.0; 6]);
    for ((p, d), g) in points.iter().zip(known).zip(&gradients) {
        if !d.is_finite() || !g.iter().all(|v| v.is_finite()) {
            continue;
        }
        // Turns are measured by the displacement at the size of the points.
        let arm = sub(*p, center).map(|v| v / size);
        let turn = isoform_geom::cross(arm, *g);
        let row = [turn[0], turn[1], turn[2], g[0], g[1], g[2]];
        for i in 0..6 {
            (0..6).for_each(|j| normal[6 * i + j] += row[i] * row[j]);
            right[i] -= row[i] * d;
        }
    }
    // Directions that no distance depends on stay: those of a ball or of a plane.
    let trace: f64 = (0..6).map(|i| normal[7 * i]).sum();
    (0..6).for_each(|i| normal[7 * i] += 1e-9 * trace);
    let is_known = trace > 0.0 && cholesky(&mut normal, 6);
    if !is_known {
        return None;
    }
    cholesky_solve(&normal, 6, &mut right);
    let step: [f64; 6] = std::array::from_fn(|i| if i < 3 { right[i] / size } else { right[i] });
    step.iter().all(|v| v.is_finite()).then_some(step)
}

/// Returns the motion by a rotation vector about a point, then a shift (Rodrigues' formula).
fn turned(step: [f64; 6], center: Point3) -> Placement {
    let [x, y, z, a, b, c] = step;
    let angle = norm([x, y, z]);
    let axis = [x, y, z].map(|v| if angle > 0.0 { v / angle } else { 0.0 });
    let (sin, cos) = angle.sin_cos();
    let cross = [
        [0.0, -axis[2], axis[1]],
        [axis[2], 0.0, -axis[0]],
        [-axis[1], axis[0], 0.0],
    ];
    let rotation: [Point3; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let unit = if i == j { cos } else { 0.0 };
            unit + sin * cross[i][j] + (1.0 - cos) * axis[i] * axis[j]
        })
    });
    let about = rotation.map(|row| dot(row, center));
    Placement {
        rotation,
        scale: 1.0,
        shift: [
            center[0] - about[0] + a,
            center[1] - about[1] + b,
            center[2] - about[2] + c,
        ],
    }
}
