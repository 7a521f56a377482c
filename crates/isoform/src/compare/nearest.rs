//! Distances of many points from a triangle mesh.
//!
//! A tree of bounding boxes over the triangles prunes the search (Ericson, Real-Time Collision
//! Detection, 2005, chapter 6, and 5.1.5 for the distance from a triangle). Each point is first
//! compared with the triangle nearest to the point before it. Successive samples of a surface are
//! close together, so this prunes all but a few boxes.
//!
//! Points are processed in runs of fixed length, so that results are identical to the last bit for
//! any number of threads.

use isoform_geom::{Aabb, Point3, cross, dot, norm, sub};
use rayon::prelude::*;

/// Maximum number of triangles in a leaf. Values from 2 to 8 differ by less than a third in time.
const MAX_LEAF_TRIANGLES: usize = 4;
/// Number of points in a run: large enough to amortise the first one, which has no triangle to
/// begin with. Distances do not depend on it.
const POINTS_PER_RUN: usize = 512;
/// Relative margin by which boxes count as nearer than computed, so that rounding prunes no
/// triangle: some hundred times the rounding error of a squared distance.
const PRUNING_MARGIN: f64 = 1e-13;
/// Capacity of the stack of boxes to visit: one per level of a tree of 2³² triangles, which has 33,
/// and one more.
const STACK_CAPACITY: usize = 34;

/// Node of the tree: a box around triangles.
#[derive(Clone, Copy, Debug)]
struct BoxNode {
    bounds: Aabb,
    /// Index of the second child (the first one is next in the list), or of the first triangle of a
    /// leaf.
    at: u32,
    /// Number of triangles of a leaf; 0 for a node with children.
    count: u32,
}

/// Tree of bounding boxes over the triangles of a mesh.
pub(crate) struct TriangleTree {
    nodes: Vec<BoxNode>,
    /// Triangles in the order of the leaves.
    triangles: Vec<[Point3; 3]>,
    /// Index of each of them among the given ones.
    order: Vec<u32>,
}

impl TriangleTree {
    /// Builds the tree of finite triangles; without triangles, all distances are infinite.
    pub(crate) fn new(triangles: &[[Point3; 3]]) -> Self {
        let items = triangles.iter().zip(0..);
        let mut items: Vec<LeafTriangle> = items.map(LeafTriangle::new).collect();
        let mut nodes = Vec::with_capacity(2 * items.len().div_ceil(MAX_LEAF_TRIANGLES));
        if !items.is_empty() {
            build(&mut items, 0, &mut nodes);
        }
        Self {
            nodes,
            order: items.iter().map(|item| item.index).collect(),
            triangles: items.into_iter().map(|item| item.triangle).collect(),
        }
    }

    /// Returns the index and the corners of the nearest triangle; `None` if no distance is finite.
    pub(super) fn nearest_triangle(&self, p: Point3) -> Option<(u32, [Point3; 3])> {
        let (distance, place) = self.nearest(p, 0);
        let is_near = distance.is_finite() && place < self.triangles.len();
        is_near.then(|| self.triangle(place))
    }

    /// Returns the index and the corners of the triangle at a place in the order of the leaves.
    pub(super) fn triangle(&self, place: usize) -> (u32, [Point3; 3]) {
        (self.order[place], self.triangles[place])
    }

    /// Returns the distance of each point from the nearest triangle; infinite if its square
    /// overflows.
    pub(super) fn distances(&self, points: &[Point3]) -> Vec<f64> {
        let mut distances = vec![f64::INFINITY; points.len()];
        let runs = distances
            .par_chunks_mut(POINTS_PER_RUN)
            .zip(points.par_chunks(POINTS_PER_RUN));
        runs.for_each(|(out, points)| {
            let mut last = 0;
            for (out, p) in out.iter_mut().zip(points) {
                (*out, last) = self.nearest(*p, last);
            }
        });
        distances
    }

    /// Returns the distance from the nearest triangle, and its place in the order of the leaves;
    /// `guess` is the place of a triangle that is probably near.
    pub(super) fn nearest(&self, p: Point3, guess: usize) -> (f64, usize) {
        let known = self.triangles.get(guess);
        let known = known.map_or(f64::INFINITY, |t| to_triangle(p, t));
        let mut best = (if known.is_nan() { f64::INFINITY } else { known }, guess);
        let mut stack = [(0.0, 0); STACK_CAPACITY];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let (squared, k) = stack[depth];
            if !is_nearer(squared, best.0) {
                continue;
            }
            let node = &self.nodes[k];
            if node.count > 0 {
                self.compare_leaf(p, node, &mut best);
                continue;
            }
            let children = [k + 1, node.at as usize];
            let mut pair = children.map(|c| (to_box(p, &self.nodes[c].bounds), c));
            // The nearer child is pushed last, and visited first.
            if pair[0].0 < pair[1].0 {
                pair.swap(0, 1);
            }
            for waiting in pair {
                if is_nearer(waiting.0, best.0) {
                    stack[depth] = waiting;
                    depth += 1;
                }
            }
        }
        best
    }

    /// Compares a point with the triangles of a leaf.
    fn compare_leaf(&self, p: Point3, leaf: &BoxNode, best: &mut (f64, usize)) {
        let first = leaf.at as usize;
        for place in first..first + leaf.count as usize {
            let d = to_triangle(p, &self.triangles[place]);
            if d < best.0 {
                *best = (d, place);
            }
        }
    }
}

/// Returns true if an object of at least this squared distance can be nearer than a known one.
#[inline]
fn is_nearer(squared: f64, known: f64) -> bool {
    squared.is_finite() && squared * (1.0 - PRUNING_MARGIN) <= known * known
}

/// Triangle to be sorted into the tree.
#[derive(Clone, Copy)]
struct LeafTriangle {
    index: u32,
    triangle: [Point3; 3],
    bounds: Aabb,
    centre: Point3,
}

impl LeafTriangle {
    fn new((triangle, index): (&[Point3; 3], u32)) -> Self {
        let bounds = Aabb::from_points(triangle);
        Self {
            index,
            triangle: *triangle,
            bounds,
            centre: bounds.center(),
        }
    }
}

/// Adds the node of some triangles and all nodes below it; `first` is the index of the first
/// triangle.
fn build(items: &mut [LeafTriangle], first: usize, nodes: &mut Vec<BoxNode>) {
    let mut bounds = Aabb::EMPTY;
    let mut centres = Aabb::EMPTY;
    for item in items.iter() {
        bounds.add(item.bounds.lo);
        bounds.add(item.bounds.hi);
        centres.add(item.centre);
    }
    let own = nodes.len();
    nodes.push(BoxNode {
        bounds,
        at: first as u32,
        count: 0,
    });
    if items.len() <= MAX_LEAF_TRIANGLES {
        nodes[own].count = items.len() as u32;
        return;
    }
    let size = centres.size();
    let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    let (lower, upper) = items.split_at_mut(middle);
    build(lower, first, nodes);
    nodes[own].at = nodes.len() as u32;
    build(upper, first + middle, nodes);
}

/// Returns the squared distance of a point from a box.
#[inline]
fn to_box(p: Point3, b: &Aabb) -> f64 {
    let off = |i: usize| (b.lo[i] - p[i]).max(p[i] - b.hi[i]).max(0.0);
    (0..3).map(|i| off(i) * off(i)).sum()
}

/// Returns the distance of a point from a triangle: from its plane if the foot lies inside, else
/// from the nearest edge.
fn to_triangle(p: Point3, t: &[Point3; 3]) -> f64 {
    let edges: [Point3; 3] = [0, 1, 2].map(|k| sub(t[(k + 1) % 3], t[k]));
    let from: [Point3; 3] = [0, 1, 2].map(|k| sub(p, t[k]));
    let n = cross(edges[0], sub(t[2], t[0]));
    let is_inside = (0..3).all(|k| dot(cross(edges[k], from[k]), n) >= 0.0);
    if is_inside && norm(n) > 0.0 {
        return (dot(from[0], n) / norm(n)).abs();
    }
    let to_edge = |k: usize| {
        let (e, v) = (edges[k], from[k]);
        let ee = dot(e, e);
        let s = if ee > 0.0 {
            (dot(v, e) / ee).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let off = sub(v, e.map(|c| s * c));
        dot(off, off)
    };
    (0..3).map(to_edge).fold(f64::INFINITY, f64::min).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_of_a_triangle() {
        let t = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(to_triangle([0.2, 0.2, -3.0], &t), 3.0);
        assert_eq!(to_triangle([-3.0, -4.0, 0.0], &t), 5.0);
        assert_eq!(to_triangle([0.5, -2.0, 0.0], &t), 2.0);
    }

    /// Returns pseudo-random numbers between −1 and 1.
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    #[test]
    fn the_nearest_of_all_is_found() {
        let mut number = numbers();
        let mut point = |size: f64, about: Point3| about.map(|c| c + size * number());
        // Large and small triangles, needles, and degenerate ones.
        let triangles: Vec<[Point3; 3]> = (0..700)
            .map(|i| {
                let about = point(1.0, [0.0; 3]);
                let size = [1.0, 0.1, 0.01, 0.0][i % 4];
                [(); 3].map(|()| point(size, about))
            })
            .collect();
        let points: Vec<Point3> = (0..3000).map(|_| point(2.0, [0.0; 3])).collect();
        let found = TriangleTree::new(&triangles).distances(&points);
        for (p, found) in points.iter().zip(found) {
            let all = triangles.iter().map(|t| to_triangle(*p, t));
            assert_eq!(all.fold(f64::INFINITY, f64::min), found);
        }
    }

    #[test]
    fn odd_sets_of_triangles() {
        assert_eq!(
            TriangleTree::new(&[]).distances(&[[1.0; 3]]),
            [f64::INFINITY]
        );
        let one = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        // All at one position: no axis separates them.
        let many = TriangleTree::new(&vec![one; 1000]);
        assert_eq!(
            many.distances(&[[0.0, 0.0, 2.0], [1e200; 3]]),
            [2.0, f64::INFINITY]
        );
    }
}
