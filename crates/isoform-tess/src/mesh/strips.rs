//! Triangles between two paths of vertices.

use crate::surface::Point3;
use isoform_geom::{cross, dot, norm, sub};

/// A vertex and its parameters.
pub(super) type PathVertex = (u32, [f64; 2]);

/// Returns triangles between an edge from `a` to `b` and a path of three or more vertices next to
/// it: with `a` up to one of its inner vertices, then with `b`, chosen such that no triangle is
/// turned against the others, if possible.
pub(super) fn around(
    points: &[Point3],
    a: PathVertex,
    way: &[PathVertex],
    b: PathVertex,
) -> Vec<[PathVertex; 3]> {
    let made = |k: usize| {
        let before = way[..=k].windows(2).map(|w| [w[0], w[1], a]);
        let after = way[k..].windows(2).map(|w| [w[0], w[1], b]);
        before
            .chain([[a, way[k], b]])
            .chain(after)
            .collect::<Vec<_>>()
    };
    let worst = |k: usize| {
        let normals: Vec<Point3> = made(k).iter().map(|t| normal(points, t)).collect();
        least_along_sum(&normals)
    };
    let best = (1..way.len() - 1).max_by(|&k, &l| worst(k).total_cmp(&worst(l)));
    made(best.expect("three vertices or more"))
}

/// Returns triangles of least total area between two paths, from an edge between their first
/// vertices to one between their last ones. Shortest diagonals would instead leave the region
/// between bent paths, such as rays of infinitely near points.
pub(super) fn between(
    points: &[Point3],
    first: &[PathVertex],
    second: &[PathVertex],
) -> Vec<[PathVertex; 3]> {
    let least = least_areas(points, first, second);
    walked_back(&least, first, second)
}

/// Returns the least area of triangles up to each edge from one path to the other, with true if the
/// last step is on the second path.
fn least_areas(
    points: &[Point3],
    first: &[PathVertex],
    second: &[PathVertex],
) -> Vec<Vec<(f64, bool)>> {
    let area = |t: [PathVertex; 3]| norm(normal(points, &t));
    let mut least = vec![vec![(0.0, false); second.len()]; first.len()];
    for i in 0..first.len() {
        for j in 0..second.len() {
            let on_first = (i > 0).then(|| {
                (
                    least[i - 1][j].0 + area([first[i - 1], second[j], first[i]]),
                    false,
                )
            });
            let on_second = (j > 0).then(|| {
                (
                    least[i][j - 1].0 + area([first[i], second[j - 1], second[j]]),
                    true,
                )
            });
            least[i][j] = lesser(on_first, on_second);
        }
    }
    least
}

/// Returns the alternative of less area; 0 at the start of both paths.
#[inline]
fn lesser(on_first: Option<(f64, bool)>, on_second: Option<(f64, bool)>) -> (f64, bool) {
    let ways = on_first.into_iter().chain(on_second);
    ways.min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((0.0, false))
}

/// Returns the triangles that lead to the last edge, from the recorded steps.
fn walked_back(
    least: &[Vec<(f64, bool)>],
    first: &[PathVertex],
    second: &[PathVertex],
) -> Vec<[PathVertex; 3]> {
    let (mut i, mut j) = (first.len() - 1, second.len() - 1);
    let mut made = Vec::new();
    while i + j > 0 {
        if least[i][j].1 {
            made.push([first[i], second[j - 1], second[j]]);
            j -= 1;
        } else {
            made.push([first[i - 1], second[j], first[i]]);
            i -= 1;
        }
    }
    made.reverse();
    made
}

/// Returns the normal of a triangle, of twice its area in length.
fn normal(points: &[Point3], t: &[PathVertex; 3]) -> Point3 {
    let [p, q, r] = t.map(|v| points[v.0 as usize]);
    cross(sub(q, p), sub(r, p))
}

/// Returns the least component of normals in the direction of their sum: negative if a triangle is
/// turned against the others.
fn least_along_sum(normals: &[Point3]) -> f64 {
    let sum = normals
        .iter()
        .fold([0.0; 3], |sum, n| std::array::from_fn(|i| sum[i] + n[i]));
    normals
        .iter()
        .map(|n| dot(*n, sum) / norm(sum))
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between the parabola y = −z² / 3 and an axis that it touches, shortest diagonals would leave
    /// the region. The triangles have the area between the paths, by the shoelace formula, and so
    /// do not overlap.
    #[test]
    fn strips_beside_bent_paths() {
        let heights = [0.4, 0.3, 0.2, 0.1, 0.0];
        let mut points: Vec<Point3> = heights.iter().map(|z| [0.0, -z * z / 3.0, *z]).collect();
        points.extend([[0.0, 0.0, 0.6], [0.0, 0.0, 0.0]]);
        let path = |vertices: &[u32]| vertices.iter().map(|&v| (v, [0.0; 2])).collect::<Vec<_>>();
        let made = between(&points, &path(&[5, 6]), &path(&[0, 1, 2, 3, 4]));
        let area = |polygon: &[u32]| {
            let at = |k: usize| points[polygon[k % polygon.len()] as usize];
            0.5 * (0..polygon.len())
                .map(|k| at(k)[1] * at(k + 1)[2] - at(k)[2] * at(k + 1)[1])
                .sum::<f64>()
        };
        let sum: f64 = made.iter().map(|t| area(&t.map(|v| v.0)).abs()).sum();
        assert!(
            (sum - area(&[5, 0, 1, 2, 3, 4]).abs()).abs() < 1e-15,
            "{sum}"
        );
        assert_eq!(made.len(), 5);
    }
}
