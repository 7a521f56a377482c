//! A triangulation of a part of the parameter plane, refined and flipped by the shape of its
//! triangles in space.
//!
//! A Delaunay triangulation of the parameters is unsuitable where the map stretches directions
//! differently, as it does without bound around base points: triangles have to be long in the
//! parameters to be round in space.
//!
//! ```text
//!          c = corner 0             Corner i of a triangle is opposite to its edge i: neighbours
//!         / \                       and fixed edges have the number of that corner. Two triangles
//!        /   \                      (c, a, b) and (d, b, a) at an edge a b are a quad; beyond its
//!       a --- b   edge 0            sides c a, a d, d b, b c are the outer triangles.
//!        \   /
//!         \ /
//!          d
//! ```

use super::names::Node;
use crate::surface::Point3;
use robust::{Coord, orient2d};
use shape::TriangleShape;
use std::cell::Cell;
use std::collections::{BTreeMap, VecDeque};

mod collapsing;
mod flipping;
mod improving;
mod inserting;
mod measure;
mod refining;
mod shape;
mod splitting;
mod step_counter;
#[cfg(test)]
mod tests;

pub(super) use measure::{Measure, Shared};
pub(super) use shape::is_turned;

/// Index in place of a neighbour beyond a border.
const NO_TRIANGLE: u32 = u32::MAX;
/// Excess above which an edge is to be split.
const SPLIT_EXCESS: f64 = 1.0;

/// Remaining defects after a refinement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RefinementDefects {
    /// Number of triangles on which the sign of W is not proved.
    pub(super) unsound: usize,
    /// Number of triangles that are not near enough to the surface.
    pub(super) coarse: usize,
    /// Number of edges that coincide in space.
    pub(super) clashes: usize,
    /// True if the time was over before all coincident edges were found.
    pub(super) is_stopped: bool,
}

/// A triangulation of parameters.
#[derive(Default)]
pub(super) struct Plane {
    pub(super) nodes: Vec<Node>,
    images: Vec<Point3>,
    shared: Vec<Option<Shared>>,
    /// Triangles, counterclockwise.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Neighbours opposite to the corners.
    adjacent: Vec<[u32; 3]>,
    /// True for each edge, opposite to a corner, that is fixed.
    fixed: Vec<[bool; 3]>,
    /// Shapes of the triangles, computed by [`Self::shape_of`] on demand.
    shapes: Vec<Cell<Option<TriangleShape>>>,
    /// True for each triangle that the pole curve provably misses.
    sound: Vec<bool>,
    /// Edges beyond which triangles are added at the end, smaller vertex first, and the vertices at
    /// which they were split.
    rim: BTreeMap<[u32; 2], Option<u32>>,
    queued: Vec<bool>,
    queue: VecDeque<u32>,
    ended: RefinementDefects,
}

/// The triangle beyond an edge, with true if the edge is fixed.
type Beyond = (u32, bool);

/// Two triangles (c, a, b) and (d, b, a) with a common edge.
struct Quad {
    /// Corners c, a, d, b: counterclockwise.
    corners: [u32; 4],
    /// Index of the second triangle.
    n: u32,
    /// Triangles beyond the edges c a, a d, d b, b c.
    outer: [Beyond; 4],
}

impl Quad {
    /// Returns the four triangles after a vertex is inserted on the edge a b.
    fn halves(&self, m: u32) -> [[u32; 3]; 4] {
        let [c, a, d, b] = self.corners;
        [[c, a, m], [c, m, b], [d, b, m], [d, m, a]]
    }
}

/// Returns the neighbours of triangles, opposite to their corners.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut sides: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for (k, t) in triangles.iter().enumerate() {
        for i in 0..3 {
            sides.insert((t[(i + 1) % 3], t[(i + 2) % 3]), k as u32);
        }
    }
    let beyond = |a: u32, b: u32| sides.get(&(b, a)).copied().unwrap_or(NO_TRIANGLE);
    let of = |t: &[u32; 3]| [0, 1, 2].map(|i| beyond(t[(i + 1) % 3], t[(i + 2) % 3]));
    triangles.iter().map(of).collect()
}

impl Plane {
    /// Creates the triangulation from counterclockwise triangles. Edges of a single triangle and
    /// edges in `fixed` are fixed, but edges of the rim may be split.
    pub(super) fn new(
        nodes: Vec<Node>,
        triangles: Vec<[u32; 3]>,
        fixed: &dyn Fn(u32, u32) -> bool,
        rim: &[[u32; 2]],
        measure: &dyn Measure,
    ) -> Self {
        let adjacent = neighbours(&triangles);
        let stays = |(t, n): (&[u32; 3], &[u32; 3])| {
            [0, 1, 2].map(|i| n[i] == NO_TRIANGLE || fixed(t[(i + 1) % 3], t[(i + 2) % 3]))
        };
        let is_sound = |t: &[u32; 3]| measure.is_sound(t.map(|v| nodes[v as usize].at));
        let rim = rim.iter().map(|&[a, b]| ([a.min(b), a.max(b)], None));
        Self {
            images: nodes.iter().map(|n| measure.image(n)).collect(),
            shared: nodes.iter().map(|n| measure.shared(n)).collect(),
            fixed: triangles.iter().zip(&adjacent).map(stays).collect(),
            shapes: vec![Cell::new(None); triangles.len()],
            sound: triangles.iter().map(is_sound).collect(),
            rim: rim.collect(),
            queued: vec![true; triangles.len()],
            queue: (0..triangles.len() as u32).collect(),
            ended: RefinementDefects::default(),
            nodes,
            triangles,
            adjacent,
        }
    }

    /// Returns the places of vertices.
    #[inline]
    fn places<const N: usize>(&self, vertices: [u32; N]) -> [[f64; 2]; N] {
        vertices.map(|v| self.nodes[v as usize].at)
    }
    /// Returns the places of the corners of a triangle.
    fn corners(&self, t: u32) -> [[f64; 2]; 3] {
        self.places(self.triangles[t as usize])
    }
    fn images_of(&self, t: u32) -> [Point3; 3] {
        self.triangles[t as usize].map(|v| self.images[v as usize])
    }
    /// Returns the ends of the edge opposite to corner i.
    #[inline]
    fn ends(&self, t: u32, i: usize) -> [u32; 2] {
        let v = self.triangles[t as usize];
        [v[(i + 1) % 3], v[(i + 2) % 3]]
    }
    /// Returns the length in the parameters of the edge opposite to corner i.
    fn length(&self, t: u32, i: usize) -> f64 {
        let at = self.corners(t);
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        (at[j][0] - at[k][0]).hypot(at[j][1] - at[k][1])
    }
    fn is_counterclockwise(&self, t: [u32; 3]) -> bool {
        let [a, b, c] = self.places(t).map(|[x, y]| Coord { x, y });
        orient2d(a, b, c) > 0.0
    }
    /// Returns true if the area of a triangle in the parameters exceeds a multiple of the square of
    /// its longest edge.
    fn is_thick(&self, t: [u32; 3], least: f64) -> bool {
        let [a, b, c] = self.places(t);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        let long = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
        area > least * long(a, b).max(long(b, c)).max(long(c, a))
    }
    /// Returns true if there is room for a new triangle, and for further vertices in it.
    fn has_room(&self, t: [u32; 3]) -> bool {
        // Three parameters that are collinear up to rounding form a degenerate triangle.
        self.is_counterclockwise(t) && self.is_thick(t, 1e-11)
    }

    /// Returns the corner of a triangle opposite to its edge with a neighbour.
    fn place(&self, t: u32, neighbour: u32) -> usize {
        self.adjacent[t as usize]
            .iter()
            .position(|&n| n == neighbour)
            .expect("neighbours know each other")
    }
    /// Returns the triangle beyond an edge, which is given by the opposite corner, modulo 3.
    #[inline]
    fn beyond(&self, t: u32, i: usize) -> Beyond {
        (
            self.adjacent[t as usize][i % 3],
            self.fixed[t as usize][i % 3],
        )
    }
    /// Returns the two triangles at the edge opposite to corner i of one of them.
    fn quad(&self, t: u32, i: usize) -> Quad {
        let n = self.adjacent[t as usize][i];
        let j = self.place(n, t);
        let corner = |t: u32, k: usize| self.triangles[t as usize][k % 3];
        Quad {
            corners: [
                corner(t, i),
                corner(t, i + 1),
                corner(n, j),
                corner(t, i + 2),
            ],
            n,
            outer: [
                self.beyond(t, i + 2),
                self.beyond(n, j + 1),
                self.beyond(n, j + 2),
                self.beyond(t, i + 1),
            ],
        }
    }

    fn push(&mut self, t: u32) {
        if !self.queued[t as usize] {
            self.queued[t as usize] = true;
            self.queue.push_back(t);
        }
    }
    fn add(&mut self, at: [f64; 2], measure: &dyn Measure) -> u32 {
        self.add_node(Node::inner(at, 0), measure)
    }
    fn add_node(&mut self, node: Node, measure: &dyn Measure) -> u32 {
        self.images.push(measure.image(&node));
        self.shared.push(measure.shared(&node));
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }
    /// Removes the last vertex.
    fn drop_last(&mut self) {
        self.nodes.pop();
        self.images.pop();
        self.shared.pop();
    }
    /// Sets the corners, neighbours and fixed edges of a triangle, and updates its neighbours.
    fn set(&mut self, t: u32, v: [u32; 3], n: [u32; 3], fixed: [bool; 3]) {
        self.triangles[t as usize] = v;
        self.adjacent[t as usize] = n;
        self.fixed[t as usize] = fixed;
        self.shapes[t as usize].set(None);
        for (i, &n) in n.iter().enumerate() {
            if n != NO_TRIANGLE {
                // The edge as seen from the neighbour.
                let [a, b] = self.ends(t, i);
                if let Some(j) = (0..3).find(|&j| self.ends(n, j) == [b, a]) {
                    self.adjacent[n as usize][j] = t;
                }
            }
        }
    }
    fn new_triangle(&mut self) -> u32 {
        self.triangles.push([0; 3]);
        self.adjacent.push([NO_TRIANGLE; 3]);
        self.fixed.push([false; 3]);
        self.shapes.push(Cell::new(None));
        self.sound.push(false);
        self.queued.push(false);
        self.triangles.len() as u32 - 1
    }

    /// Returns a defect of the triangulation, if it has one: a triangle of wrong orientation, or
    /// neighbours that disagree on their edge. For tests and debug assertions.
    pub(super) fn fault(&self) -> Option<String> {
        let n = self.triangles.len();
        let lengths = [
            self.adjacent.len(),
            self.fixed.len(),
            self.shapes.len(),
            self.sound.len(),
            self.queued.len(),
        ];
        if lengths != [n; 5] || [self.images.len(), self.shared.len()] != [self.nodes.len(); 2] {
            return Some(format!("{n} triangles, but {lengths:?}"));
        }
        (0..n as u32).find_map(|t| {
            let v = self.triangles[t as usize];
            if !self.is_counterclockwise(v) {
                return Some(format!("triangle {t} is not counterclockwise: {v:?}"));
            }
            (0..3).find_map(|i| self.fault_at(t, i))
        })
    }
    /// Returns a defect of the edge opposite to corner i.
    fn fault_at(&self, t: u32, i: usize) -> Option<String> {
        let [a, b] = self.ends(t, i);
        let (n, fixed) = self.beyond(t, i);
        if n == NO_TRIANGLE {
            let free = !fixed;
            return free.then(|| format!("edge {a} {b} of {t} is a border, but not fixed"));
        }
        let back = (0..3).find(|&j| self.ends(n, j) == [b, a]);
        let agrees = |j: usize| self.beyond(n, j) == (t, fixed);
        (!back.is_some_and(agrees)).then(|| format!("edge {a} {b} of {t}: {n} does not agree"))
    }
}
