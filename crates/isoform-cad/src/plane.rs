//! Nodes and sides of a face in the parameter plane, and their triangulation.

use crate::lattice;
use crate::trim::TrimmedFace;
use isoform_geom::{Point3, norm, plane, sub};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};

/// Maximum distance of two nodes of one number that are merged, in steps of the lattice: rounding.
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
        let (triangles, places) = self.within(face, &cdt, &handles);
        if triangles.is_empty() {
            return Err(FLAT);
        }
        Ok(FaceTriangles {
            points: self.points,
            triangles,
            places,
        })
    }

    /// Returns the triangles within the sides, with the parameters of their corners.
    fn within(
        &self,
        face: &TrimmedFace,
        cdt: &Cdt,
        handles: &[FixedVertexHandle],
    ) -> (Vec<[u32; 3]>, Vec<[[f64; 2]; 3]>) {
        let inside = self.inside(cdt, handles);
        let (mut triangles, mut places) = (Vec::new(), Vec::new());
        for triangle in cdt.inner_faces() {
            if inside[triangle.fix().index()] != Some(true) {
                continue;
            }
            let nodes = triangle.vertices().map(|v| *v.data());
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
        (triangles, places)
    }

    /// Returns by face of the triangulation true if a path from outside to it passes an odd number
    /// of sides. Rounding does not mislead it where sides are nearly in line.
    fn inside(&self, cdt: &Cdt, handles: &[FixedVertexHandle]) -> Vec<Option<bool>> {
        let mut passes: BTreeMap<[usize; 2], u32> = BTreeMap::new();
        for side in &self.sides {
            let [a, b] = side.map(|i| handles[i].index());
            *passes.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
        let mut inside: Vec<Option<bool>> = vec![None; cdt.num_all_faces()];
        let outer = cdt.outer_face();
        inside[outer.fix().index()] = Some(false);
        // Edges with the state of the face on their left.
        let mut waiting: Vec<_> = cdt.convex_hull().map(|e| (e.fix(), false)).collect();
        while let Some((edge, state)) = waiting.pop() {
            let edge = cdt.directed_edge(edge);
            let ends = edge.vertices().map(|v| v.fix().index());
            let key = [ends[0].min(ends[1]), ends[0].max(ends[1])];
            // A side that passes a node is divided there, and each part counts as one.
            let count = passes.get(&key).copied();
            let count = count.unwrap_or(u32::from(edge.is_constraint_edge()));
            let state = state != (count % 2 == 1);
            let beyond = edge.rev().face();
            let known = &mut inside[beyond.fix().index()];
            if known.is_some() {
                continue;
            }
            *known = Some(state);
            if let Some(triangle) = beyond.as_inner() {
                waiting.extend(triangle.adjacent_edges().map(|e| (e.fix(), state)));
            }
        }
        inside
    }
}
