//! Drawing of a unit triangle: the curves that bound and cross the region, as a constrained
//! Delaunay triangulation of the parameters.

mod lines;
mod rectangles;
mod spreading;

use super::glued::Glued;
use super::in_chart::InChart;
use super::names::{Name, Node, Ray};
use super::opening::RingVertex;
use super::plane::Plane;
use super::stretch::height;
use super::unit::Unit;
use crate::finding::Finding;
use crate::region::Triangle;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};

type Cdt = ConstrainedDelaunayTriangulation<Node>;

impl HasPosition for Node {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

/// The drawn part of the region in a unit triangle.
struct Drawing<'a> {
    glued: &'a Glued<'a>,
    q: usize,
    triangle: &'a Triangle,
    /// Coordinates u of its walls.
    walls: Vec<f64>,
    cdt: Cdt,
    constraints: Vec<[FixedVertexHandle; 2]>,
    /// Vertices at points of walls, by wall and point.
    at_wall: BTreeMap<(usize, usize), FixedVertexHandle>,
    /// Fans of the base points, by vertex.
    apexes: BTreeMap<usize, usize>,
    /// Rays of the corners of the rectangles around base points, by vertex and fan.
    rays: BTreeMap<(usize, usize), Ray>,
    /// The arcs drawn over each slab, by place, with their polylines.
    lines: Vec<Vec<(usize, Vec<[f64; 2]>)>>,
    /// True if the order of neighbouring arcs is certain.
    in_order: bool,
}

/// Draws and triangulates the part of the region in a unit triangle, for refinement; `None` if it
/// is empty.
pub(super) fn drawn_unit(glued: &Glued<'_>, q: usize) -> Option<Unit> {
    let t = &glued.atlas.region.triangles[q];
    if !t.inside.iter().flatten().any(|inside| *inside) {
        return None;
    }
    let mut drawing = Drawing::new(glued, q);
    drawing.draw_sides();
    drawing.draw_points();
    drawing.draw_rectangles();
    for slab in 0..t.arrangement.slabs.len() {
        drawing.draw_arcs(slab);
    }
    for wall in 0..t.arrangement.walls.len() {
        drawing.draw_upright(wall);
    }
    drawing.draw_chords();
    let is_drawn = drawing.constrain() && drawing.in_order;
    for at in glued.gluing.points(q) {
        drawing.vertex(Node::inner(at, 0));
    }
    let fixed = drawing.add_rings();
    let measure = InChart { glued, q };
    drawing.spread(&measure);
    let findings = (!is_drawn).then_some(Finding::ArcsNotDrawn);
    Some(drawing.unit(&fixed, &measure, findings.into_iter().collect()))
}

impl<'a> Drawing<'a> {
    fn new(glued: &'a Glued<'a>, q: usize) -> Self {
        let triangle = &glued.atlas.region.triangles[q];
        let walls = &triangle.arrangement.walls;
        Self {
            glued,
            q,
            triangle,
            walls: walls.iter().map(|w| w.u.to_f64()).collect(),
            cdt: Cdt::new(),
            constraints: Vec::new(),
            at_wall: BTreeMap::new(),
            apexes: BTreeMap::new(),
            rays: BTreeMap::new(),
            lines: Vec::new(),
            in_order: true,
        }
    }
    /// Inserts a vertex, unless it has no position.
    fn vertex(&mut self, node: Node) -> Option<FixedVertexHandle> {
        self.cdt.insert(node).ok()
    }
    /// Returns the vertex at a place, or inserts one.
    fn known_or_new(&mut self, node: Node) -> Option<FixedVertexHandle> {
        let known = self.cdt.locate_vertex(node.position()).map(|v| v.fix());
        known.or_else(|| self.vertex(node))
    }
    /// Adds a fixed edge, if both its ends exist.
    fn edge(&mut self, a: Option<FixedVertexHandle>, b: Option<FixedVertexHandle>) {
        self.constraints.extend(a.zip(b).map(|(a, b)| [a, b]));
    }
    /// Returns true if a place is in the region.
    fn is_inside(&self, at: [f64; 2]) -> bool {
        let k = self.walls[1..self.walls.len() - 1].partition_point(|&u| u < at[0]);
        let below = self.lines[k]
            .iter()
            .rev()
            .find(|(_, line)| height(line, at[0]) < at[1])
            .map(|l| l.0);
        self.triangle.inside[k][below.unwrap_or(0)]
    }

    /// Draws the chords of a traced double curve.
    fn draw_chords(&mut self) {
        let (glued, q) = (self.glued, self.q);
        for (_, ends) in glued.gluing.chords.iter().filter(|c| c.0 == q) {
            let [a, b] = ends.map(|node| self.known_or_new(node));
            self.edge(a, b);
        }
    }
    /// Makes the fixed edges constraints; returns false if some cross others.
    fn constrain(&mut self) -> bool {
        let mut crossing = false;
        for [a, b] in std::mem::take(&mut self.constraints) {
            if a != b && self.cdt.can_add_constraint(a, b) {
                self.cdt.add_constraint(a, b);
            } else {
                crossing |= a != b;
            }
        }
        !crossing
    }
    /// Returns the constraint edges, in both directions.
    fn fixed_edges(&self) -> BTreeSet<(u32, u32)> {
        self.cdt
            .undirected_edges()
            .filter(|e| e.is_constraint_edge())
            .map(|e| e.vertices().map(|v| v.index() as u32))
            .flat_map(|[a, b]| [(a, b), (b, a)])
            .collect()
    }
    /// Adds rings of vertices around base points. Their edges are constraints of the first
    /// triangulation only; returns the edges that stay fixed, in both directions.
    fn add_rings(&mut self) -> BTreeSet<(u32, u32)> {
        let known = self.cdt.vertices();
        let known = known.map(|v| (v.data().at.map(f64::to_bits), v.fix()));
        let mut handles: BTreeMap<[u64; 2], FixedVertexHandle> = known.collect();
        let rings = self.glued.openings.rings_around(self.q);
        for RingVertex { at, .. } in &rings {
            let place = at.map(f64::to_bits);
            if self.is_inside(*at) && !handles.contains_key(&place) {
                handles.extend(self.vertex(Node::inner(*at, 0)).map(|v| (place, v)));
            }
        }
        let fixed = self.fixed_edges();
        for RingVertex { at, legs } in &rings {
            for leg in legs {
                let ends = [at, leg].map(|at| handles.get(&at.map(f64::to_bits)).copied());
                self.add_leg(ends);
            }
        }
        fixed
    }
    /// Draws an edge of a ring, unless it crosses a drawn one.
    fn add_leg(&mut self, ends: [Option<FixedVertexHandle>; 2]) {
        if let [Some(a), Some(b)] = ends
            && a != b
            && self.cdt.can_add_constraint(a, b)
        {
            self.cdt.add_constraint(a, b);
        }
    }

    /// Returns the triangles in the region, with those at base points kept separately.
    fn unit(
        self,
        fixed: &BTreeSet<(u32, u32)>,
        measure: &InChart<'_, '_>,
        findings: Vec<Finding>,
    ) -> Unit {
        let nodes: Vec<Node> = self.cdt.vertices().map(|v| *v.data()).collect();
        let (mut plain, mut at_apex) = (Vec::new(), Vec::new());
        for face in self.cdt.inner_faces() {
            let v = face.vertices();
            if is_sliver(v.map(|v| *v.data())) || !self.is_inside(center(v.map(|v| v.data().at))) {
                continue;
            }
            let t = v.map(|v| v.index() as u32);
            match (0..3).find(|&i| v[i].data().apex) {
                Some(i) => at_apex.push([0, 1, 2].map(|k| t[(i + k) % 3])),
                None => plain.push(t),
            }
        }
        let rim: Vec<[u32; 2]> = at_apex.iter().map(|&[_, a, b]| [a, b]).collect();
        let is_fixed = |a, b| fixed.contains(&(a, b));
        Unit {
            quadrant: self.q,
            plane: Plane::new(nodes, plain, &is_fixed, &rim, measure),
            at_apex,
            apexes: self.apexes,
            rays: self.rays,
            findings,
        }
    }
}

/// Returns true if a counterclockwise triangle lies beyond the side u + v = 1, where all its
/// corners are on that line up to rounding.
fn is_sliver(nodes: [Node; 3]) -> bool {
    let on_line = |n: &Node| matches!(n.name, Name::Side(2, ..) | Name::Corner(1 | 2));
    nodes.iter().all(on_line) && {
        let first = (0..3)
            .min_by(|&i, &j| nodes[i].at[0].total_cmp(&nodes[j].at[0]))
            .unwrap_or(0);
        nodes[(first + 1) % 3].at[0] < nodes[(first + 2) % 3].at[0]
    }
}

fn center(at: [[f64; 2]; 3]) -> [f64; 2] {
    [0, 1].map(|i| (at[0][i] + at[1][i] + at[2][i]) / 3.0)
}
