//! What bounds and crosses the region in a unit triangle, as a constrained Delaunay triangulation
//! of the parameters.

use super::geometry::distance;
use super::glued::Glued;
use super::gluing::Track;
use super::in_chart::InChart;
use super::names::{Name, Node, Ray, name_on};
use super::opening::RingVertex;
use super::places::{on_side, sides_of};
use super::plane::{Measure, Plane, is_turned};
use super::stretch::{Columns, height};
use super::unit::Unit;
use super::*;
use crate::region::{FOLD, Triangle};
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

/// Rounds in which vertices are put into triangles that do not look like the surface, the number of
/// triangles that is enough, and the length of edges in the parameters below which they are left to
/// be split in space.
const SPREADS: usize = 12;
const SPREAD: usize = 20_000;
const SPREAD_LENGTH: f64 = 0.03;
/// How far a vertex is put from others at least, in tolerances.
const APART: f64 = 0.2;

/// What is drawn so far.
struct Drawing<'a> {
    triangle: &'a Triangle,
    /// Where its walls are.
    walls: Vec<f64>,
    cdt: Cdt,
    constraints: Vec<[FixedVertexHandle; 2]>,
    /// Points of walls, by wall and place.
    at_wall: BTreeMap<(usize, usize), FixedVertexHandle>,
    /// Base points: their fans, by vertex.
    apexes: BTreeMap<usize, usize>,
    /// Corners of the rectangles around them, by vertex and fan.
    rays: BTreeMap<(usize, usize), Ray>,
    /// The arcs drawn over each slab: their places, and parameters along them.
    lines: Vec<Vec<(usize, Vec<[f64; 2]>)>>,
    /// Whether neighbouring arcs could be told apart.
    in_order: bool,
}

impl Drawing<'_> {
    /// A vertex, unless it has no position.
    fn vertex(&mut self, node: Node) -> Option<FixedVertexHandle> {
        self.cdt.insert(node).ok()
    }
    /// The vertex at a place, a new one if there is none.
    fn known_or_new(&mut self, node: Node) -> Option<FixedVertexHandle> {
        let known = self.cdt.locate_vertex(node.position()).map(|v| v.fix());
        known.or_else(|| self.vertex(node))
    }
    /// An edge that stays, if both its ends are there.
    fn edge(&mut self, a: Option<FixedVertexHandle>, b: Option<FixedVertexHandle>) {
        self.constraints.extend(a.zip(b).map(|(a, b)| [a, b]));
    }
    /// Whether a place is in the region.
    fn is_inside(&self, at: [f64; 2]) -> bool {
        let k = self.walls[1..self.walls.len() - 1].partition_point(|&u| u < at[0]);
        let below = self.lines[k]
            .iter()
            .rev()
            .find(|(_, line)| height(line, at[0]) < at[1])
            .map(|l| l.0);
        self.triangle.inside[k][below.unwrap_or(0)]
    }
}

impl Glued<'_> {
    /// The part of the region in a unit triangle, drawn and triangulated, to be refined. None if
    /// there is none.
    pub(super) fn drawn_unit(&self, q: usize) -> Option<Unit> {
        let t = &self.atlas.region.triangles[q];
        if !t.inside.iter().flatten().any(|inside| *inside) {
            return None;
        }
        let mut drawing = Drawing {
            triangle: t,
            walls: t.arrangement.walls.iter().map(|w| w.u.to_f64()).collect(),
            cdt: Cdt::new(),
            constraints: Vec::new(),
            at_wall: BTreeMap::new(),
            apexes: BTreeMap::new(),
            rays: BTreeMap::new(),
            lines: Vec::new(),
            in_order: true,
        };
        self.draw_sides(q, &mut drawing);
        self.draw_points(q, &mut drawing);
        self.draw_rectangles(q, &mut drawing);
        for slab in 0..t.arrangement.slabs.len() {
            self.draw_arcs(q, slab, &mut drawing);
        }
        for wall in 0..t.arrangement.walls.len() {
            self.draw_upright(q, wall, &mut drawing);
        }
        let chords = self.gluing.chords.iter().filter(|c| c.0 == q);
        for ends in chords.map(|c| c.1) {
            let [a, b] = ends.map(|node| drawing.known_or_new(node));
            drawing.edge(a, b);
        }
        let mut crossing = false;
        for [a, b] in std::mem::take(&mut drawing.constraints) {
            if a != b && drawing.cdt.can_add_constraint(a, b) {
                drawing.cdt.add_constraint(a, b);
            } else {
                crossing |= a != b;
            }
        }
        let mut findings = Vec::new();
        if crossing || !drawing.in_order {
            findings.push(Finding::ArcsNotDrawn);
        }
        for at in self.gluing.points(q) {
            drawing.vertex(Node::inner(at, 0));
        }
        let mut handles: BTreeMap<[u64; 2], _> = drawing
            .cdt
            .vertices()
            .map(|v| (v.data().at.map(f64::to_bits), v.fix()))
            .collect();
        let rings = self.openings.rings_around(q);
        for RingVertex { at, .. } in &rings {
            let place = at.map(f64::to_bits);
            if drawing.is_inside(*at) && !handles.contains_key(&place) {
                handles.extend(drawing.vertex(Node::inner(*at, 0)).map(|v| (place, v)));
            }
        }
        let cdt = &mut drawing.cdt;
        let fixed: BTreeSet<(u32, u32)> = cdt
            .undirected_edges()
            .filter(|e| e.is_constraint_edge())
            .map(|e| e.vertices().map(|v| v.index() as u32))
            .flat_map(|[a, b]| [(a, b), (b, a)])
            .collect();
        // Edges that are there at the beginning only.
        for RingVertex { at, legs } in &rings {
            for leg in legs {
                let [a, b] = [at, leg].map(|x| handles.get(&x.map(f64::to_bits)).copied());
                if let Some((a, b)) = a
                    .zip(b)
                    .filter(|(a, b)| a != b && cdt.can_add_constraint(*a, *b))
                {
                    cdt.add_constraint(a, b);
                }
            }
        }
        let measure = InChart { glued: self, q };
        self.spread(&mut drawing, &measure);
        let nodes: Vec<Node> = drawing.cdt.vertices().map(|v| *v.data()).collect();
        let (mut plain, mut at_apex) = (Vec::new(), Vec::new());
        for face in drawing.cdt.inner_faces() {
            let v = face.vertices();
            if is_sliver(v.map(|v| *v.data())) || !drawing.is_inside(center(v.map(|v| v.data().at)))
            {
                continue;
            }
            let t = v.map(|v| v.index() as u32);
            match (0..3).find(|&i| v[i].data().apex) {
                Some(i) => at_apex.push([0, 1, 2].map(|k| t[(i + k) % 3])),
                None => plain.push(t),
            }
        }
        let rim: Vec<[u32; 2]> = at_apex.iter().map(|&[_, a, b]| [a, b]).collect();
        let plane = Plane::new(
            nodes,
            plain,
            &|a, b| fixed.contains(&(a, b)),
            &rim,
            &measure,
        );
        Some(Unit {
            quadrant: q,
            plane,
            at_apex,
            apexes: drawing.apexes,
            rays: drawing.rays,
            findings,
        })
    }

    /// Puts vertices into large triangles that do not face the way the surface does, or have
    /// another area: flips and splits by what triangles are in space are of use only where they
    /// look like the surface.
    fn spread(&self, drawing: &mut Drawing<'_>, measure: &InChart<'_, '_>) {
        let mut images = Vec::new();
        let mut known = BTreeSet::new();
        for _ in 0..SPREADS {
            let new = drawing.cdt.vertices().skip(images.len());
            images.extend(new.map(|v| (measure.image(v.data()), measure.shared(v.data()))));
            let mut places = Vec::new();
            for face in drawing.cdt.inner_faces() {
                let v = face.vertices();
                let mut sorted = v.map(|v| v.index());
                sorted.sort_unstable();
                if !known.insert(sorted)
                    || v.iter().any(|v| v.data().apex)
                    || is_sliver(v.map(|v| *v.data()))
                {
                    continue;
                }
                let at = v.map(|v| v.data().at);
                let [p, q, r] = v.map(|v| images[v.index()]);
                let is_pinched = [(p.1, q.1), (q.1, r.1), (r.1, p.1)]
                    .iter()
                    .any(|(a, b)| a.is_some() && a == b);
                let is_long = (0..3).any(|i| {
                    (at[i][0] - at[(i + 1) % 3][0]).hypot(at[i][1] - at[(i + 1) % 3][1])
                        > SPREAD_LENGTH
                });
                // Next to contracted curves what is large in the parameters may be nothing in
                // space.
                let there = measure.at(center(at));
                let is_apart = [p.0, q.0, r.0]
                    .iter()
                    .all(|&x| distance(x, there) > APART * measure.tolerance(there));
                if is_long
                    && !is_pinched
                    && is_apart
                    && is_turned(at, [p.0, q.0, r.0], measure)
                    && drawing.is_inside(center(at))
                {
                    places.push(center(at));
                }
            }
            if places.is_empty()
                || drawing.cdt.num_inner_faces() > SPREAD.min(self.atlas.options.triangles / 4)
            {
                break;
            }
            drawing.cdt = with_more(&drawing.cdt, &places);
        }
    }

    fn draw_sides(&self, q: usize, drawing: &mut Drawing<'_>) {
        let sides = &self.sides;
        let mut on_sides = BTreeMap::new();
        for (side, key) in sides_of(q).iter().enumerate() {
            let mut before = None;
            let mut last = (0, 0);
            for (i, &(x, inside)) in sides[key].iter().enumerate() {
                let next = if inside {
                    (
                        self.atlas.faces_along(q, side),
                        self.atlas.side_bit(q, side, x, sides[key][i + 1].0),
                    )
                } else {
                    (0, 0)
                };
                let Some(v) = drawing.vertex(Node {
                    name: name_on(q, side, x),
                    ..Node::inner(on_side(side, x), 0)
                }) else {
                    continue;
                };
                // Corners belong to two sides.
                let all = on_sides.entry(v.index()).or_insert((0u8, 0u64));
                *all = (all.0 | last.0 | next.0, all.1 | last.1 | next.1);
                let node = drawing.cdt.vertex_data_mut(v);
                (node.faces, node.borders) = *all;
                last = next;
                drawing.edge(before, Some(v));
                before = inside.then_some(v);
            }
        }
    }

    /// Points of walls in the region, with the faces that they are on; those on sides are there
    /// already.
    fn draw_points(&self, q: usize, drawing: &mut Drawing<'_>) {
        let t = &self.atlas.region.triangles[q];
        let passed: Vec<(usize, usize)> = self
            .openings
            .sites_in(q)
            .flat_map(|(_, s)| &s.arcs)
            .flat_map(|x| x.passed(&t.arrangement))
            .collect();
        for (k, wall) in t.arrangement.walls.iter().enumerate() {
            let top = wall.points.len() - 1;
            for p in 0..=top {
                if !t.holds_point(k, p) || passed.contains(&(k, p)) {
                    continue;
                }
                let at = self.atlas.place(q, k, p);
                let name = self.atlas.wall_name(q, k, p);
                let faces = self.atlas.faces_at(q, k, p);
                let apex = faces == 0b11_1111;
                if (k == 0 || p == 0 || p == top) && !t.is_real(k, p) && !apex {
                    continue;
                }
                let borders = self.atlas.region.sides_of_point(q, k, p);
                let node = Node {
                    at,
                    name,
                    faces,
                    image: if apex {
                        None
                    } else {
                        self.curves.image_at(q, k, p)
                    },
                    apex,
                    borders,
                };
                // The line of a side goes on inside.
                let is_line = |f: &usize| {
                    self.atlas
                        .region
                        .lines
                        .get(*f)
                        .is_none_or(|l| *l != 0 && !self.curves.is_drawn_inside(*f))
                };
                if borders == 0
                    && faces == 0
                    && wall.points[p]
                        .curves
                        .iter()
                        .chain(&wall.vertical)
                        .all(is_line)
                {
                    continue;
                }
                if let Some(v) = drawing.vertex(node) {
                    drawing.at_wall.insert((k, p), v);
                }
            }
        }
    }

    /// Base points with the rectangles around them.
    fn draw_rectangles(&self, q: usize, drawing: &mut Drawing<'_>) {
        for (&(_, k, p), site) in self.openings.sites_in(q) {
            let Some(&apex) = drawing.at_wall.get(&(k, p)) else {
                continue;
            };
            drawing.apexes.insert(apex.index(), site.fan);
            let fan = &self.openings.fans[site.fan];
            for sector in fan.sectors.iter().filter(|s| s.inside) {
                let Some(ends) = self.openings.sector_ends(q, site, fan, sector) else {
                    continue;
                };
                let insert = |at: [f64; 2], ray: Ray, drawing: &mut Drawing<'_>| {
                    let name = match () {
                        () if at[0] == 0.0 => name_on(q, 0, at[1]),
                        () if at[1] == 0.0 => name_on(q, 1, at[0]),
                        () if at[1] == 1.0 - at[0] && site.at[0] + site.at[1] == 1.0 => {
                            name_on(q, 2, at[0])
                        }
                        () => Name::Inner,
                    };
                    let arc = site.arcs.iter().find(|x| x.ray == ray && x.end == at);
                    let faces = arc.map_or(0, |x| self.atlas.bits(x.curve));
                    let image = arc.and_then(|x| self.curves.nearest_image(q, x.curve, at));
                    let is_fold = match name {
                        Name::Side(side, ..) => self.atlas.region.is_fold_side(side),
                        _ => arc.is_some_and(|x| self.atlas.region.is_fold(x.curve)),
                    };
                    let v = drawing.vertex(Node {
                        name,
                        image,
                        borders: if is_fold { FOLD } else { 0 },
                        ..Node::inner(at, faces)
                    })?;
                    drawing.rays.insert((v.index(), site.fan), ray);
                    Some(v)
                };
                let around = |a, b, drawing: &mut Drawing<'_>| {
                    if let (Some(a), Some(b)) = (a, b) {
                        drawing.constraints.extend([[apex, a], [apex, b], [a, b]]);
                    }
                };
                for (k, backward) in sector.rays {
                    let d = &fan.directions[k];
                    let same: Vec<_> = self
                        .openings
                        .ray(q, site, d, backward)
                        .vertices()
                        .into_iter()
                        .map(|at| insert(at, (d.key(), backward), drawing))
                        .collect();
                    for w in same.windows(2) {
                        around(w[0], w[1], drawing);
                    }
                }
                let [a, b] = [0, 1].map(|i| {
                    insert(
                        ends[i],
                        (fan.directions[sector.rays[i].0].key(), sector.rays[i].1),
                        drawing,
                    )
                });
                around(a, b, drawing);
            }
        }
    }

    /// The arcs of a slab.
    fn draw_arcs(&self, q: usize, k: usize, drawing: &mut Drawing<'_>) {
        let t = &self.atlas.region.triangles[q];
        let mut over = Columns::new(&t.arrangement, k);
        let mut lines = Vec::new();
        for i in self.curves.drawn(q, k) {
            let arc = t.arrangement.slabs[k].arcs[i];
            let (faces, borders) = (
                self.atlas.bits(arc.curve),
                self.atlas.region.side_of_arc(q, k, i),
            );
            let stretch = self.openings.stretch(q, k, i);
            let line = match self.gluing.line(Track::Arc(q, k, i)) {
                Some(line) => line.clone(),
                None => self
                    .openings
                    .polyline(q, &stretch, i, &mut over, &mut drawing.in_order),
            };
            if stretch.is_open() {
                let node = |at: [f64; 2]| Node {
                    image: self.curves.nearest_image(q, arc.curve, at),
                    borders,
                    ..Node::inner(at, faces)
                };
                // From a vertex of a rectangle, or a point of a wall, to the next.
                let ends = [
                    (line[0], (k, arc.left)),
                    (line[line.len() - 1], (k + 1, arc.right)),
                ];
                let [mut before, last] = [0, 1].map(|e| {
                    let (at, known) = ends[e];
                    if stretch.based[e] {
                        drawing.vertex(node(at))
                    } else {
                        drawing.at_wall.get(&known).copied()
                    }
                });
                for &at in &line[1..line.len() - 1] {
                    let Some(v) = drawing.vertex(node(at)) else {
                        continue;
                    };
                    drawing.edge(before, Some(v));
                    before = Some(v);
                }
                drawing.edge(before, last);
            }
            lines.push((i, stretch.whole(line)));
        }
        drawing.lines.push(lines);
    }

    /// Stretches of a wall that are drawn.
    fn draw_upright(&self, q: usize, wall: usize, drawing: &mut Drawing<'_>) {
        for p in 0..self.atlas.region.triangles[q].arrangement.walls[wall]
            .points
            .len()
            - 1
        {
            let Some(curve) = self.curves.drawn_on(q, wall, p) else {
                continue;
            };
            let (faces, borders) = (
                self.atlas.bits(curve),
                self.atlas.region.side_of_wall(q, wall, p),
            );
            let (stretch, mut line) = self.openings.upright(q, wall, p);
            if let Some(known) = self.gluing.line(Track::Wall(q, wall, p)) {
                line.clone_from(known);
            }
            let last = line.len() - 1;
            let mut before = None;
            for (i, &at) in line.iter().enumerate() {
                // From points of the wall, or from the rectangles around base points.
                let known = match i {
                    0 if !stretch.based[0] => drawing.at_wall.get(&(wall, p)).copied(),
                    i if i == last && !stretch.based[1] => {
                        drawing.at_wall.get(&(wall, p + 1)).copied()
                    }
                    _ => drawing.vertex(Node {
                        image: self.curves.nearest_image(q, curve, at),
                        borders,
                        ..Node::inner(at, faces)
                    }),
                };
                if known.is_some() {
                    drawing.edge(before, known);
                    before = known;
                }
            }
        }
    }
}

/// A triangulation with more vertices. They come before its constraints: in a constrained
/// triangulation spade may walk in a circle as it looks for their triangles, and panic.
fn with_more(cdt: &Cdt, places: &[[f64; 2]]) -> Cdt {
    let mut next = Cdt::new();
    let known = cdt.vertices().map(|v| *v.data());
    for node in known.chain(places.iter().map(|&at| Node::inner(at, 0))) {
        // Known ones keep their numbers; others without a position are left out.
        let _ = next.insert(node);
    }
    for edge in cdt.undirected_edges().filter(|e| e.is_constraint_edge()) {
        let [a, b] = edge.vertices().map(|v| v.fix());
        if next.can_add_constraint(a, b) {
            next.add_constraint(a, b);
        }
    }
    next
}

/// Whether a triangle, counterclockwise, lies beyond the side u + v = 1, whose points are on that
/// line but for rounding.
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
