//! Drawing of the sides of a unit triangle, of points of walls, arcs, and segments of walls.

use super::Drawing;
use crate::mesh::gluing::Track;
use crate::mesh::names::{Node, name_on};
use crate::mesh::opening::ALL_FACES;
use crate::mesh::places::{on_side, sides_of};
use crate::mesh::stretch::Columns;
use spade::Triangulation;
use std::collections::BTreeMap;

impl Drawing<'_> {
    /// Draws the sides: their places, and the edges between them that are in the region.
    pub(super) fn draw_sides(&mut self) {
        let (atlas, q) = (self.glued.atlas, self.q);
        let mut on_sides = BTreeMap::new();
        for (side, key) in sides_of(q).iter().enumerate() {
            let places = &self.glued.sides[key];
            let mut before = None;
            let mut last = (0, 0);
            for (i, &(x, inside)) in places.iter().enumerate() {
                let next = match inside {
                    true => (
                        atlas.faces_along(q, side),
                        atlas.side_bit(q, side, x, places[i + 1].0),
                    ),
                    false => (0, 0),
                };
                let node = Node::inner(on_side(side, x), 0);
                let name = name_on(q, side, x);
                let Some(v) = self.vertex(Node { name, ..node }) else {
                    continue;
                };
                // Corners belong to two sides.
                let all = on_sides.entry(v.index()).or_insert((0u8, 0u64));
                *all = (all.0 | last.0 | next.0, all.1 | last.1 | next.1);
                let node = self.cdt.vertex_data_mut(v);
                (node.faces, node.borders) = *all;
                last = next;
                self.edge(before, Some(v));
                before = inside.then_some(v);
            }
        }
    }

    /// Draws the points of walls in the region, with their faces; those on sides exist already.
    pub(super) fn draw_points(&mut self) {
        let a = &self.triangle.arrangement;
        let passed: Vec<(usize, usize)> = self
            .glued
            .openings
            .sites_in(self.q)
            .flat_map(|(_, s)| &s.arcs)
            .flat_map(|x| x.passed(a))
            .collect();
        for (k, wall) in a.walls.iter().enumerate() {
            for p in 0..wall.points.len() {
                if self.triangle.holds_point(k, p)
                    && !passed.contains(&(k, p))
                    && let Some(node) = self.point(k, p)
                    && let Some(v) = self.vertex(node)
                {
                    self.at_wall.insert((k, p), v);
                }
            }
        }
    }
    /// Returns the node of a point of a wall; `None` if only lines of sides pass through it.
    fn point(&self, k: usize, p: usize) -> Option<Node> {
        let (atlas, curves, q) = (self.glued.atlas, self.glued.curves, self.q);
        let wall = &self.triangle.arrangement.walls[k];
        let faces = atlas.faces_at(q, k, p);
        let apex = faces == ALL_FACES;
        let is_on_side = k == 0 || p == 0 || p + 1 == wall.points.len();
        if is_on_side && !self.triangle.is_real(k, p) && !apex {
            return None;
        }
        // The line of a side continues inside.
        let is_line = |f: &usize| {
            let line = atlas.region.lines.get(*f);
            line.is_none_or(|l| *l != 0 && !curves.is_drawn_inside(*f))
        };
        let borders = atlas.region.sides_of_point(q, k, p);
        let mut through = wall.points[p].curves.iter().chain(&wall.vertical);
        if borders == 0 && faces == 0 && through.all(is_line) {
            return None;
        }
        Some(Node {
            at: atlas.place(q, k, p),
            name: atlas.wall_name(q, k, p),
            faces,
            image: if apex { None } else { curves.image_at(q, k, p) },
            apex,
            borders,
        })
    }

    /// Draws the arcs of a slab.
    pub(super) fn draw_arcs(&mut self, k: usize) {
        let (glued, q, a) = (self.glued, self.q, &self.triangle.arrangement);
        let mut over = Columns::new(a, k);
        let mut lines = Vec::new();
        for i in glued.curves.drawn(q, k) {
            let arc = a.slabs[k].arcs[i];
            let stretch = glued.openings.stretch(q, k, i);
            let line = match glued.gluing.line(Track::Arc(q, k, i)) {
                Some(line) => line.clone(),
                None => {
                    let in_order = &mut self.in_order;
                    glued.openings.polyline(q, &stretch, i, &mut over, in_order)
                }
            };
            if stretch.is_open() {
                let borders = glued.atlas.region.side_of_arc(q, k, i);
                // From a vertex of a rectangle, or a point of a wall, to the next.
                let points = [(k, arc.left), (k + 1, arc.right)];
                let ends = [0, 1].map(|e| (!stretch.based[e]).then_some(points[e]));
                self.draw_arc(&line, arc.curve, borders, ends);
            }
            lines.push((i, stretch.whole(line)));
        }
        self.lines.push(lines);
    }
    /// Draws a polyline of a curve between points of walls, or between new vertices where none is
    /// given.
    fn draw_arc(
        &mut self,
        line: &[[f64; 2]],
        curve: usize,
        borders: u64,
        ends: [Option<(usize, usize)>; 2],
    ) {
        let places = [line[0], line[line.len() - 1]];
        let [mut before, last] = [0, 1].map(|e| match ends[e] {
            Some(point) => self.at_wall.get(&point).copied(),
            None => self.vertex(self.curve_node(places[e], curve, borders)),
        });
        for &at in &line[1..line.len() - 1] {
            let Some(v) = self.vertex(self.curve_node(at, curve, borders)) else {
                continue;
            };
            self.edge(before, Some(v));
            before = Some(v);
        }
        self.edge(before, last);
    }
    /// Returns the node of a vertex on a curve.
    fn curve_node(&self, at: [f64; 2], curve: usize, borders: u64) -> Node {
        Node {
            image: self.glued.curves.nearest_image(self.q, curve, at),
            borders,
            ..Node::inner(at, self.glued.atlas.bits(curve))
        }
    }

    /// Draws the segments of a wall that bound or cross the region.
    pub(super) fn draw_upright(&mut self, wall: usize) {
        let (glued, q) = (self.glued, self.q);
        for p in 0..self.triangle.arrangement.walls[wall].points.len() - 1 {
            let Some(curve) = glued.curves.drawn_on(q, wall, p) else {
                continue;
            };
            let borders = glued.atlas.region.side_of_wall(q, wall, p);
            let (stretch, mut line) = glued.openings.upright(q, wall, p);
            if let Some(known) = glued.gluing.line(Track::Wall(q, wall, p)) {
                line.clone_from(known);
            }
            let last = line.len() - 1;
            let mut before = None;
            for (i, &at) in line.iter().enumerate() {
                // From points of the wall, or from the rectangles around base points.
                let known = match i {
                    0 if !stretch.based[0] => self.at_wall.get(&(wall, p)).copied(),
                    i if i == last && !stretch.based[1] => {
                        self.at_wall.get(&(wall, p + 1)).copied()
                    }
                    _ => self.vertex(self.curve_node(at, curve, borders)),
                };
                if known.is_some() {
                    self.edge(before, known);
                    before = known;
                }
            }
        }
    }
}
