//! Intersection of rays with triangles: a tree of boxes over them, and a watertight test.
//!
//! The test is that of Woop, Benthin and Wald (Watertight ray/triangle intersection, JCGT 2(1),
//! 2013): space is sheared so that the ray becomes an axis, and signs of 2D edge functions decide.
//! Two triangles compute the function of their common edge with opposite signs, bit by bit. Where
//! it vanishes, the direction of the edge decides, as in rasterizers, so that a ray through an edge
//! meets exactly one of its two triangles, and the count of crossings distinguishes inside from
//! outside.

use crate::camera::Ray;
use isoform::geom::{Aabb, Point3, inverse_direction, sub};

/// Node of the tree: its box, and its children or its triangles.
#[derive(Clone, Copy, Debug)]
struct TreeNode {
    bounds: Aabb,
    /// Index of the second child (the first is next in the list), or of the first triangle of a
    /// leaf.
    at: u32,
    /// Number of triangles of a leaf; 0 for a node with children.
    count: u32,
    /// Axis along which the children are separated.
    axis: u8,
}

/// Bounding volume hierarchy over triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh {
    nodes: Vec<TreeNode>,
    /// Indices of triangles in the order of the leaves.
    order: Vec<u32>,
}

/// Intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    pub(crate) t: f64,
    pub(crate) triangle: u32,
    /// Barycentric coordinates of the point.
    pub(crate) shares: [f64; 3],
    /// True if the ray comes from the left side of the triangle's edges.
    is_left: bool,
}

/// Shear that maps a ray to the z axis.
struct RayShear {
    axes: [usize; 3],
    shear: Point3,
    o: Point3,
}

impl RayShear {
    fn new(ray: &Ray, o: Point3) -> Self {
        let z = (0..3)
            .max_by(|i, j| ray.d[*i].abs().total_cmp(&ray.d[*j].abs()))
            .unwrap_or(2);
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let d = ray.d;
        Self {
            axes: [x, y, z],
            shear: [d[x] / d[z], d[y] / d[z], 1.0 / d[z]],
            o,
        }
    }

    /// Returns a point in sheared coordinates: its offset from the ray, and its distance along the
    /// ray.
    fn corner(&self, p: Point3) -> Point3 {
        let r = sub(p, self.o);
        let [x, y, z] = self.axes.map(|k| r[k]);
        [
            x - self.shear[0] * z,
            y - self.shear[1] * z,
            self.shear[2] * z,
        ]
    }

    /// Returns the intersection with a triangle: distance, barycentric coordinates and side; `None`
    /// if the ray misses it.
    fn meet(&self, corners: [Point3; 3]) -> Option<(f64, [f64; 3], bool)> {
        let [a, b, c] = corners.map(|p| self.corner(p));
        let (u, u_side) = edge(b, c);
        let (v, v_side) = edge(c, a);
        let (w, w_side) = edge(a, b);
        if u_side != v_side || v_side != w_side {
            return None;
        }
        let sum = u + v + w;
        if sum == 0.0 || !sum.is_finite() {
            return None;
        }
        let shares = [u / sum, v / sum, w / sum];
        let t = shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2];
        Some((t, shares, u_side))
    }
}

/// Returns the edge function of p → q at the ray, and true if the ray is to the left. A ray through
/// the edge is assigned to one side, for the reversed edge to the other.
fn edge(p: Point3, q: Point3) -> (f64, bool) {
    let e = p[0] * q[1] - p[1] * q[0];
    let is_left = if e == 0.0 {
        q[1] > p[1] || (q[1] == p[1] && q[0] > p[0])
    } else {
        e > 0.0
    };
    (e, is_left)
}

impl Bvh {
    /// Builds the tree by median splits of the triangles' box centres.
    pub(crate) fn new(points: &[Point3], triangles: &[[u32; 3]]) -> Self {
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|t| widened(Aabb::from_points(&t.map(|i| points[i as usize]))))
            .collect();
        let middles: Vec<Point3> = boxes.iter().map(Aabb::center).collect();
        let mut tree = Self {
            nodes: Vec::with_capacity(triangles.len()),
            order: (0..triangles.len() as u32).collect(),
        };
        // Ranges of triangles to be made nodes, with the node whose second child they are.
        let mut open = vec![(0, triangles.len(), None)];
        while let Some((from, to, parent)) = open.pop() {
            if from == to {
                continue;
            }
            let number = tree.nodes.len();
            if let Some(parent) = parent {
                let parent: usize = parent;
                tree.nodes[parent].at = number as u32;
            }
            let run = &mut tree.order[from..to];
            let bounds = run
                .iter()
                .fold(Aabb::EMPTY, |all, i| joined(all, &boxes[*i as usize]));
            let spread = Aabb::from_points(run.iter().map(|i| &middles[*i as usize])).size();
            let axis = (0..3)
                .max_by(|i, j| spread[*i].total_cmp(&spread[*j]))
                .unwrap_or(0);
            let is_leaf = run.len() <= 4;
            tree.nodes.push(TreeNode {
                bounds,
                at: from as u32,
                count: if is_leaf { run.len() as u32 } else { 0 },
                axis: axis as u8,
            });
            if !is_leaf {
                let half = run.len() / 2;
                run.select_nth_unstable_by(half, |i, j| {
                    let key = |i: u32| middles[i as usize][axis];
                    key(*i).total_cmp(&key(*j)).then(i.cmp(j))
                });
                open.push((from + half, to, Some(number)));
                open.push((from, from + half, None));
            }
        }
        tree
    }

    /// Returns the box of all triangles.
    pub(crate) fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |n| n.bounds)
    }

    /// Visits the triangles that a ray meets, those of nearer boxes first; `visit` returns the
    /// distance beyond which further intersections are not needed.
    pub(crate) fn visit(
        &self,
        mesh: (&[Point3], &[[u32; 3]]),
        ray: &Ray,
        [from, to]: [f64; 2],
        mut visit: impl FnMut(TriangleHit) -> f64,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        // Parallel rays may begin far from the surface: the shear is computed at the box to avoid
        // cancellation.
        let inverse = inverse_direction(ray.d);
        let [near, far] = self.nodes[0].bounds.crossing(ray.o, inverse);
        if near > far {
            return;
        }
        let shift = if ray.from == f64::NEG_INFINITY {
            near
        } else {
            0.0
        };
        let sheared = RayShear::new(ray, crate::camera::along(ray.o, ray.d, shift));
        let mut to = to;
        let mut stack = [0_u32; 128];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let number = stack[depth] as usize;
            let node = &self.nodes[number];
            let [near, far] = node.bounds.crossing(ray.o, inverse);
            if near > far || near > to || far < from {
                continue;
            }
            if node.count == 0 {
                let (first, second) = (number as u32 + 1, node.at);
                let pair = if ray.d[node.axis as usize] < 0.0 {
                    [first, second]
                } else {
                    [second, first]
                };
                stack[depth..depth + 2].copy_from_slice(&pair);
                depth += 2;
                continue;
            }
            for &triangle in &self.order[node.at as usize..(node.at + node.count) as usize] {
                let corners = mesh.1[triangle as usize].map(|i| mesh.0[i as usize]);
                let Some((t, shares, is_left)) = sheared.meet(corners) else {
                    continue;
                };
                let t = t + shift;
                if t > from && t <= to {
                    to = to.min(visit(TriangleHit {
                        t,
                        triangle,
                        shares,
                        is_left,
                    }));
                }
            }
        }
    }

    /// Returns the winding number of closed triangles around the point of a ray at a distance: the
    /// crossings beyond it from one side less those from the other. It is 2 where bodies overlap;
    /// voids subtract.
    pub(crate) fn winding(&self, mesh: (&[Point3], &[[u32; 3]]), ray: &Ray, from: f64) -> i32 {
        let mut sum = 0;
        self.visit(mesh, ray, [from, f64::INFINITY], |meeting| {
            sum += if meeting.is_left { 1 } else { -1 };
            f64::INFINITY
        });
        sum
    }
}

/// Returns the smallest box around two boxes.
fn joined(mut all: Aabb, b: &Aabb) -> Aabb {
    all.add(b.lo);
    all.add(b.hi);
    all
}

/// Widens a box by the rounding error of the ray test, so that no ray misses it.
fn widened(b: Aabb) -> Aabb {
    let largest =
        b.lo.iter()
            .chain(&b.hi)
            .fold(0.0, |m: f64, v| m.max(v.abs()));
    b.widened(16.0 * f64::EPSILON * largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::unit;

    /// Returns a cube from 0 to 1 made of twelve triangles.
    fn cube() -> (Vec<Point3>, Vec<[u32; 3]>) {
        let points = (0..8)
            .map(|i| [0, 1, 2].map(|k| f64::from(i >> k & 1)))
            .collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = quads
            .iter()
            .flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
        (points, triangles.collect())
    }

    #[test]
    fn rays_through_edges_and_corners_cross_twice() {
        let (points, triangles) = cube();
        let tree = Bvh::new(&points, &triangles);
        let mesh = (points.as_slice(), triangles.as_slice());
        // Through the diagonals of faces, from corner to corner, next to edges.
        for (o, d) in [
            ([0.5, 0.5, -3.0], [0.0, 0.0, 1.0]),
            ([0.25, 0.25, -3.0], [0.0, 0.0, 1.0]),
            ([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]),
            ([-1.0, 0.5, 0.5], [1.0, 0.0, 0.0]),
            ([-1.0, 2.0, 0.5], [1.0, -1.0, 0.0]),
        ] {
            let ray = Ray {
                o,
                d: unit(d),
                from: 0.0,
            };
            let mut count = 0;
            tree.visit(mesh, &ray, [0.0, f64::INFINITY], |_| {
                count += 1;
                f64::INFINITY
            });
            assert!(
                count == 2 || (o[1] == 2.0 && count == 0),
                "{o:?} {d:?} {count}"
            );
            assert_eq!(tree.winding(mesh, &ray, 0.0), 0);
            let inside = Ray { o: [0.5; 3], ..ray };
            assert_eq!(tree.winding(mesh, &inside, 0.0).abs(), 1);
        }
    }

    #[test]
    fn the_tree_finds_what_all_triangles_hold() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut point = || [(); 3].map(|()| random.f64());
        let points: Vec<Point3> = (0..600).map(|_| point()).collect();
        let triangles: Vec<[u32; 3]> = (0..200).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let tree = Bvh::new(&points, &triangles);
        for _ in 0..200 {
            let (o, p) = ([2.0, 0.5, 0.5], point());
            let ray = Ray {
                o,
                d: unit(sub(p, o)),
                from: 0.0,
            };
            let mut nearest = f64::INFINITY;
            tree.visit((&points, &triangles), &ray, [0.0, f64::INFINITY], |m| {
                nearest = nearest.min(m.t);
                nearest
            });
            let sheared = RayShear::new(&ray, o);
            let all = triangles
                .iter()
                .filter_map(|t| sheared.meet(t.map(|i| points[i as usize])));
            let want = all
                .map(|m| m.0)
                .filter(|t| *t > 0.0)
                .fold(f64::INFINITY, f64::min);
            assert_eq!(nearest, want);
        }
    }
}
