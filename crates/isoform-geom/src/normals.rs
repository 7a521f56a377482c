//! Normals of points: estimated by local planes, oriented consistently along a spanning tree.
//!
//! The normal at a point is the direction of least variance of its nearest neighbours (Hoppe et al.
//! 1992). The orientation is propagated from neighbour to neighbour along the minimum spanning tree
//! of the cost `OrientationPair::unsafety`.

use crate::{KdTree, Point3, UnionFind, cross, dot, norm, sub};
use isoform_num::linalg::symmetric_eigen;
use rayon::prelude::*;

/// Number of nearest neighbours to which a point propagates its orientation. Fewer split a cloud of
/// uneven density into pieces, more connect the opposite sides of thin walls.
const ORIENTATION_NEIGHBOURS: usize = 8;

/// Largest cosine of the angle between a normal and the direction of a neighbour at which the pair
/// counts as flat: 60° from the normal. Steeper pairs are due to noise or across a wall.
const MAX_FLAT_COSINE: f64 = 0.5;

/// Smallest cosine of the angle between the inward normal and the direction of a point that counts
/// as behind: 87°. Rounding and noise exceed it only if points are as close as the noise.
const MIN_BEHIND_COSINE: f64 = 0.05;

/// Consistency of the orientation of normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Share of the flat pairs of neighbours whose normals point to one side, from 0 to 1.
    pub share: f64,
    /// Number of pieces of the cloud that were oriented independently.
    pub pieces: usize,
}

/// Returns unit normals of the planes through the nearest `neighbours` of each point, with
/// arbitrary signs, and the median over the points of the ratio of the least variance to the sum of
/// all three: 0 for points in planes, 1/3 for points that fill space.
pub fn estimate_normals(points: &[Point3], tree: &KdTree, neighbours: usize) -> (Vec<Point3>, f64) {
    let both: Vec<(Point3, f64)> = points
        .par_iter()
        .with_min_len(256)
        .map_init(Vec::new, |found, p| {
            tree.nearest_k(*p, neighbours, found);
            plane_of(points, found)
        })
        .collect();
    let mut variation: Vec<f64> = both.iter().map(|b| b.1).collect();
    let half = variation.len() / 2;
    let median = match variation.is_empty() {
        true => 0.0,
        false => *variation.select_nth_unstable_by(half, f64::total_cmp).1,
    };
    (both.into_iter().map(|b| b.0).collect(), median)
}

/// Returns the direction of least variance, and the ratio of that variance to the sum of all three.
fn plane_of(points: &[Point3], found: &[(f64, u32)]) -> (Point3, f64) {
    let count = found.len() as f64;
    let mut center = [0.0; 3];
    for (_, i) in found {
        for k in 0..3 {
            center[k] += points[*i as usize][k] / count;
        }
    }
    let mut moments = [0.0; 9];
    for (_, i) in found {
        let d = sub(points[*i as usize], center);
        for a in 0..3 {
            for b in 0..3 {
                moments[3 * a + b] += d[a] * d[b];
            }
        }
    }
    let (values, vectors) = symmetric_eigen(&moments, 3);
    let sum: f64 = values.iter().sum();
    let variation = if sum > 0.0 {
        (values[0] / sum).max(0.0)
    } else {
        0.0
    };
    ([vectors[0], vectors[1], vectors[2]], variation)
}

/// Pair of neighbouring points.
struct OrientationPair {
    ends: [u32; 2],
    /// Larger one of the cosines between a normal and the direction of the other point.
    steepness: f64,
    /// Cost of propagating the orientation: `steepness` + 1 − |cosine of the angle between the
    /// normals|.
    unsafety: f64,
    /// True if the normals point to different sides.
    is_opposite: bool,
    /// True if each point lies behind the other, as on the two sides of a wall.
    is_wall: bool,
}

fn pairs(points: &[Point3], normals: &[Point3], tree: &KdTree) -> Vec<OrientationPair> {
    (0..points.len() as u32)
        .into_par_iter()
        .with_min_len(256)
        .map_init(Vec::new, |found, i| {
            tree.nearest_k(points[i as usize], ORIENTATION_NEIGHBOURS + 1, found);
            found
                .iter()
                .filter(|(_, j)| *j != i)
                .map(|(_, j)| pair(points, normals, [i, *j]))
                .collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect()
}

fn pair(points: &[Point3], normals: &[Point3], ends: [u32; 2]) -> OrientationPair {
    let [i, j] = ends.map(|e| e as usize);
    let (a, b) = (normals[i], normals[j]);
    let along = sub(points[j], points[i]);
    let length = norm(along);
    let e = if length > 0.0 {
        along.map(|v| v / length)
    } else {
        [0.0; 3]
    };
    let (straight, steep) = (dot(a, b), [dot(a, e), dot(b, e)]);
    let steepness = steep[0].abs().max(steep[1].abs());
    OrientationPair {
        ends,
        steepness,
        unsafety: steepness + 1.0 - straight.abs(),
        // On circles, across edges and through walls, the reflection of b in the perpendicular
        // bisector plane of the points is a (König and Gumhold 2009).
        is_opposite: straight - 2.0 * steep[0] * steep[1] < 0.0,
        is_wall: straight < 0.0 && steep[0] < -MIN_BEHIND_COSINE && steep[1] > MIN_BEHIND_COSINE,
    }
}

/// Returns the share of flat pairs of neighbours whose normals point to one side, from 0 to 1;
/// pairs across a wall are not counted.
pub fn agreement(points: &[Point3], normals: &[Point3], tree: &KdTree) -> f64 {
    let pairs = pairs(points, normals, tree);
    let flat = pairs
        .iter()
        .filter(|p| p.steepness < MAX_FLAT_COSINE && !p.is_wall);
    let (all, agree) = flat.fold((0u32, 0), |(n, m), p| {
        (n + 1, m + u32::from(!p.is_opposite))
    });
    if all == 0 {
        1.0
    } else {
        f64::from(agree) / f64::from(all)
    }
}

/// Orients normals consistently and outward: in each piece of the cloud the sum of (p − c)·n is
/// made positive, c the mean of its points, which holds for a uniformly sampled closed surface by
/// the divergence theorem.
pub fn orient_normals(points: &[Point3], normals: &mut [Point3], tree: &KdTree) -> Agreement {
    let mut pairs = pairs(points, normals, tree);
    pairs.par_sort_unstable_by(|a, b| a.unsafety.total_cmp(&b.unsafety).then(a.ends.cmp(&b.ends)));
    let mut sets = UnionFind::new(points.len());
    let mut branches: Vec<Vec<(u32, bool)>> = vec![Vec::new(); points.len()];
    for pair in &pairs {
        let [i, j] = pair.ends;
        if sets.unite(i, j) {
            branches[i as usize].push((j, pair.is_opposite));
            branches[j as usize].push((i, pair.is_opposite));
        }
    }
    let mut is_known = vec![false; points.len()];
    let mut pieces = 0;
    for start in 0..points.len() {
        if !is_known[start] {
            let piece = pass_on(start, &branches, &mut is_known, normals);
            turn_outwards(points, normals, &piece);
            pieces += 1;
        }
    }
    Agreement {
        share: agreement(points, normals, tree),
        pieces,
    }
}

/// Propagates the orientation of a point to all points that the tree connects with it. Returns
/// these.
fn pass_on(
    start: usize,
    branches: &[Vec<(u32, bool)>],
    is_known: &mut [bool],
    normals: &mut [Point3],
) -> Vec<usize> {
    let mut piece = vec![start];
    is_known[start] = true;
    let mut next = vec![(start, false)];
    while let Some((i, is_turned)) = next.pop() {
        for (j, is_opposite) in &branches[i] {
            let j = *j as usize;
            if !is_known[j] {
                is_known[j] = true;
                let turn = is_turned != *is_opposite;
                if turn {
                    normals[j] = normals[j].map(|v| -v);
                }
                piece.push(j);
                next.push((j, turn));
            }
        }
    }
    piece
}

fn turn_outwards(points: &[Point3], normals: &mut [Point3], piece: &[usize]) {
    let mut center = [0.0; 3];
    for i in piece {
        for k in 0..3 {
            center[k] += points[*i][k] / piece.len() as f64;
        }
    }
    let flux: f64 = piece
        .iter()
        .map(|i| dot(sub(points[*i], center), normals[*i]))
        .sum();
    if flux < 0.0 {
        for i in piece {
            normals[*i] = normals[*i].map(|v| -v);
        }
    }
}

/// Returns unit normals at the vertices of a mesh: means of those of the triangles, weighted by
/// area; 0 at vertices without a triangle.
pub fn vertex_normals(points: &[Point3], triangles: &[[u32; 3]]) -> Vec<Point3> {
    let mut normals = vec![[0.0; 3]; points.len()];
    for t in triangles {
        let [a, b, c] = t.map(|i| points[i as usize]);
        let n = cross(sub(b, a), sub(c, a));
        for i in t {
            for k in 0..3 {
                normals[*i as usize][k] += n[k];
            }
        }
    }
    for n in &mut normals {
        let length = norm(*n);
        *n = if length > 0.0 {
            n.map(|v| v / length)
        } else {
            [0.0; 3]
        };
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::middle;
    use isoform_num::Random;

    /// Returns points of a torus of radii 1 and 0.4, uniform in both angles, with their normals.
    fn torus(n: usize) -> (Vec<Point3>, Vec<Point3>) {
        let mut random = Random::new(7);
        (0..n)
            .map(|_| {
                let (u, v) = (random.unit(), random.unit());
                let (u, v) = (u * std::f64::consts::TAU, v * std::f64::consts::TAU);
                let n = [u.cos() * v.cos(), u.sin() * v.cos(), v.sin()];
                ([u.cos() + 0.4 * n[0], u.sin() + 0.4 * n[1], 0.4 * n[2]], n)
            })
            .unzip()
    }

    #[test]
    fn normals_of_a_torus_point_outwards() {
        let (points, truth) = torus(4000);
        let tree = KdTree::new(&points);
        let (mut normals, variation) = estimate_normals(&points, &tree, 16);
        assert!(variation < 0.02, "{variation}");
        let agreement = orient_normals(&points, &mut normals, &tree);
        assert_eq!(agreement.pieces, 1);
        assert!(agreement.share > 0.999, "{agreement:?}");
        for (n, t) in normals.iter().zip(&truth) {
            assert!(dot(*n, *t) > 0.9, "{n:?} for {t:?}");
        }
    }

    #[test]
    fn sides_are_passed_on_across_edges_and_not_through_walls() {
        // A plate of 4 × 4 × 0.15: its sides are as far apart as its points.
        let mut random = Random::new(3);
        let (mut points, mut truth) = (Vec::new(), Vec::new());
        for _ in 0..6000 {
            let [x, y] = [4.0 * random.unit(), 4.0 * random.unit()];
            let side = if random.unit() < 0.5 { 1.0 } else { -1.0 };
            points.push([x, y, 0.075 * side]);
            truth.push([0.0, 0.0, side]);
        }
        for _ in 0..900 {
            let [s, z] = [4.0 * random.unit(), 0.15 * random.unit() - 0.075];
            let k = (random.unit() * 4.0) as usize;
            points.push([[0.0, s, z], [4.0, s, z], [s, 0.0, z], [s, 4.0, z]][k]);
            truth.push(
                [
                    [-1.0, 0.0, 0.0],
                    [1.0, 0.0, 0.0],
                    [0.0, -1.0, 0.0],
                    [0.0, 1.0, 0.0],
                ][k],
            );
        }
        let tree = KdTree::new(&points);
        let mut random = Random::new(4);
        let mut normals: Vec<Point3> = truth
            .iter()
            .map(|n| {
                if random.unit() < 0.5 {
                    *n
                } else {
                    n.map(|v| -v)
                }
            })
            .collect();
        assert!(agreement(&points, &normals, &tree) < 0.6);
        orient_normals(&points, &mut normals, &tree);
        let wrong = normals
            .iter()
            .zip(&truth)
            .filter(|(n, t)| dot(**n, **t) < 0.0)
            .count();
        assert_eq!(wrong, 0);
    }

    #[test]
    fn nothing_and_one_point_are_no_matter() {
        for points in [vec![], vec![[1.0, 2.0, 3.0]], vec![[0.0; 3]; 20]] {
            let tree = KdTree::new(&points);
            let (mut normals, _) = estimate_normals(&points, &tree, 16);
            orient_normals(&points, &mut normals, &tree);
            assert!(normals.iter().flatten().all(|v| v.is_finite()));
        }
    }

    #[test]
    fn vertices_of_a_cube_look_away_from_its_middle() {
        let p = |i: usize| [(i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64];
        let points: Vec<Point3> = (0..8).map(p).collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles: Vec<[u32; 3]> = quads
            .iter()
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
            .collect();
        let m = middle([points[0], points[7]]);
        for (n, p) in vertex_normals(&points, &triangles).iter().zip(&points) {
            assert!(dot(*n, sub(*p, m)) > 0.5);
        }
    }
}
