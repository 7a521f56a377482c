//! Nodes and sides of a face in the parameter plane, and their triangulation.

use crate::lattice;
use crate::trim::TrimmedFace;
use isoform_geom::cad::Shape;
use isoform_geom::{Point3, norm, plane, sub};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};

/// Distance of two nodes of one number that are the same, in steps of the lattice: rounding.
const MERGE_DISTANCE: f64 = 1e-7;
/// Distance of the pole's node from a vertex that is the pole, relative to the coordinates.
const POLE_DISTANCE: f64 = 1e-6;

/// Node in the plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneNode {
    pub(crate) at: [f64; 2],
    pub(crate) number: u32,
}

impl HasPosition for PlaneNode {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

type Cdt = ConstrainedDelaunayTriangulation<PlaneNode>;

/// Nodes and sides of a face, in coordinates in which a step of the lattice has length 1.
pub(crate) struct Domain {
    /// Factors of the parameters.
    metric: [f64; 2],
    nodes: Vec<PlaneNode>,
    /// Places of the nodes by their numbers.
    places: BTreeMap<u32, Vec<usize>>,
    sides: Vec<[usize; 2]>,
    known: BTreeSet<[usize; 2]>,
    /// Number of the first new node.
    first: u32,
    /// New nodes.
    points: Vec<Point3>,
    /// Nodes at corners of the box and at poles, which may be vertices of loops.
    special: Vec<(Point3, u32)>,
}

/// Triangles of a face.
pub(crate) struct FaceTriangles {
    /// New nodes.
    pub(crate) points: Vec<Point3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Parameters of the corners.
    pub(crate) places: Vec<[[f64; 2]; 3]>,
}

impl Domain {
    /// Creates an empty domain; new nodes are numbered from `first`.
    pub(crate) fn new(steps: [f64; 2], scale: [f64; 2], first: u32) -> Self {
        // On a plane all steps are the same.
        let metric = [0, 1].map(|k| {
            let inverse = 1.0 / steps[k];
            if inverse > 0.0 && inverse.is_finite() {
                inverse
            } else {
                0.0
            }
        });
        let metric = if metric.contains(&0.0) { scale } else { metric };
        Self {
            metric,
            nodes: Vec::new(),
            places: BTreeMap::new(),
            sides: Vec::new(),
            known: BTreeSet::new(),
            first,
            points: Vec::new(),
            special: Vec::new(),
        }
    }

    /// Returns the index of a node, which is new unless it is known at this place.
    pub(crate) fn node(&mut self, at: [f64; 2], number: u32) -> usize {
        let at = [at[0] * self.metric[0], at[1] * self.metric[1]];
        let node = crate::cut::plane_node(at, number);
        let known = self.places.entry(number).or_default();
        let reach = MERGE_DISTANCE.max(1e-12 * (at[0].abs() + at[1].abs()));
        for i in known.iter() {
            if plane::distance_squared(self.nodes[*i].at, at).sqrt() <= reach {
                return *i;
            }
        }
        known.push(self.nodes.len());
        self.nodes.push(node);
        self.nodes.len() - 1
    }
    /// Adds a side between two nodes.
    pub(crate) fn side(&mut self, a: usize, b: usize) {
        if a != b {
            self.sides.push([a, b]);
            self.known.insert([a.min(b), a.max(b)]);
        }
    }
    /// Returns true if there is a side between two nodes.
    pub(crate) fn has_side(&self, a: usize, b: usize) -> bool {
        self.known.contains(&[a.min(b), a.max(b)])
    }
    /// Adds a node in space, and returns its number.
    pub(crate) fn add(&mut self, p: Point3) -> u32 {
        self.points.push(p);
        self.first + self.points.len() as u32 - 1
    }
    /// Names the vertices of loops, which may lie at a corner of the box or at a pole.
    pub(crate) fn with_vertices(mut self, vertices: impl Iterator<Item = (Point3, u32)>) -> Self {
        self.special.extend(vertices);
        self
    }
    /// Returns the number of the node at a corner of the box.
    pub(crate) fn corner(&mut self, p: Point3) -> u32 {
        self.pole(p)
    }
    /// Returns the number of the node at a pole: a vertex if there is one.
    pub(crate) fn pole(&mut self, p: Point3) -> u32 {
        let size = norm(p)
            + self
                .special
                .iter()
                .map(|s| norm(sub(s.0, p)))
                .fold(0.0, f64::max);
        let near = |s: &&(Point3, u32)| norm(sub(s.0, p)) <= POLE_DISTANCE * size;
        if let Some((_, number)) = self.special.iter().find(near) {
            return *number;
        }
        let number = self.add(p);
        self.special.push((p, number));
        number
    }

    /// Triangulates the domain: all triangles within the face.
    pub(crate) fn triangles(
        mut self,
        shape: &Shape,
        face: &TrimmedFace,
        with_lattice: bool,
    ) -> Result<FaceTriangles, &'static str> {
        const CROSSING: &str = "its border crosses itself";
        const FLAT: &str = "it has no extent";
        let mut cdt = Cdt::new();
        // All nodes before all sides: the search for a node that is inserted later might not
        // terminate.
        let mut handles: Vec<FixedVertexHandle> = Vec::new();
        for node in &self.nodes {
            handles.push(cdt.insert(*node).map_err(|_| FLAT)?);
        }
        let distinct: BTreeSet<usize> = handles.iter().map(|h| h.index()).collect();
        if distinct.len() != handles.len() {
            return Err(CROSSING);
        }
        if with_lattice {
            let place = |i: usize| self.nodes[i].at;
            let sides: Vec<_> = self.sides.iter().map(|s| s.map(place)).collect();
            for at in lattice::inside(&sides) {
                let place = [at[0] / self.metric[0], at[1] / self.metric[1]];
                let number = self.add(face.face.chart.surface.at(place).p);
                let node = crate::cut::plane_node(at, number);
                cdt.insert(node).map_err(|_| FLAT)?;
            }
        }
        for [a, b] in &self.sides {
            let (a, b) = (handles[*a], handles[*b]);
            if cdt.exists_constraint(a, b) {
                continue;
            }
            if !cdt.can_add_constraint(a, b) || !cdt.add_constraint(a, b) {
                return Err(CROSSING);
            }
        }
        let (triangles, places) = self.within(shape, face, &cdt);
        if triangles.is_empty() {
            return Err(FLAT);
        }
        Ok(FaceTriangles {
            points: self.points,
            triangles,
            places,
        })
    }

    /// Returns the triangles within the face, with the parameters of their corners. Triangles that
    /// no side separates are all within it or all outside: one test decides.
    #[allow(clippy::type_complexity)]
    fn within(
        &self,
        shape: &Shape,
        face: &TrimmedFace,
        cdt: &Cdt,
    ) -> (Vec<[u32; 3]>, Vec<[[f64; 2]; 3]>) {
        let mut seen = vec![false; cdt.num_all_faces()];
        let (mut triangles, mut places) = (Vec::new(), Vec::new());
        for start in cdt.inner_faces() {
            if std::mem::replace(&mut seen[start.fix().index()], true) {
                continue;
            }
            let mut region = vec![start];
            let mut next = 0;
            while next < region.len() {
                for edge in region[next].adjacent_edges() {
                    let beyond = edge.rev().face();
                    if let (false, Some(beyond)) = (edge.is_constraint_edge(), beyond.as_inner())
                        && !std::mem::replace(&mut seen[beyond.fix().index()], true)
                    {
                        region.push(beyond);
                    }
                }
                next += 1;
            }
            let corners = |f: &spade::handles::FaceHandle<'_, _, PlaneNode, _, _, _>| {
                f.vertices().map(|v| *v.data())
            };
            let area = |t: &[PlaneNode; 3]| plane::orient(t[0].at, t[1].at, t[2].at);
            let all: Vec<[PlaneNode; 3]> = region.iter().map(corners).collect();
            let Some(largest) = all.iter().max_by(|a, b| area(a).total_cmp(&area(b))) else {
                continue;
            };
            let middle = |k: usize| {
                let sum: f64 = largest.iter().map(|n| n.at[k]).sum();
                sum / (3.0 * self.metric[k])
            };
            if !face.holds(shape, [middle(0), middle(1)]) {
                continue;
            }
            for nodes in all {
                let mut t = nodes.map(|n| n.number);
                let mut at = nodes.map(|n| [0, 1].map(|k| n.at[k] / self.metric[k]));
                // At a pole triangles shrink to segments.
                if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                    continue;
                }
                if !face.face.is_left {
                    t.swap(1, 2);
                    at.swap(1, 2);
                }
                triangles.push(t);
                places.push(at);
            }
        }
        (triangles, places)
    }
}
