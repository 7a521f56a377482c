//! Loops of faces in the parameter plane, unwrapped over periods.

use crate::chart::Chart;
use crate::edges::Divided;
use isoform_geom::cad::{Edge, Face, Shape};
use isoform_geom::{Point3, plane};

/// Factor of the measured distance of a piece from its chord, in which the true one lies: three
/// samples of a smooth arc find three quarters of it or more.
const BULGE_MARGIN: f64 = 1.5;
/// Share of a period below which the turn of a loop at a pole counts as a full turn: directions
/// before and after a seam differ by rounding.
const MIN_POLE_TURN: f64 = 1e-6;

/// Piece of a loop between two nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Index of the edge, `None` for a piece along a pole.
    pub(crate) edge: Option<u32>,
    /// Shares of the edge at both ends, in the direction of the loop.
    pub(crate) shares: [f64; 2],
    /// Nodes at both ends.
    pub(crate) nodes: [u32; 2],
    /// Parameters at both ends.
    pub(crate) at: [[f64; 2]; 2],
    /// Bound of the distance of the piece from its chord, in scaled parameters.
    pub(crate) bulge: f64,
}

/// Loop in the parameter plane.
#[derive(Clone, Debug, Default)]
pub(crate) struct LoopChart {
    pub(crate) pieces: Vec<Piece>,
    /// Numbers of periods of u and v by which the end lies beyond the start.
    pub(crate) turns: [i64; 2],
    /// Smallest and largest u and v.
    pub(crate) bounds: [[f64; 2]; 2],
}

/// Face in the parameter plane.
#[derive(Debug)]
pub(crate) struct FaceChart {
    pub(crate) chart: Chart,
    /// True if the face is on the left of its loops in the parameter plane.
    pub(crate) is_left: bool,
    /// Lengths in space of a unit of u and of v, about.
    pub(crate) scale: [f64; 2],
    pub(crate) loops: Vec<LoopChart>,
}

/// Node of a loop before it has parameters.
struct LoopNode {
    edge: u32,
    /// Share of the edge at this node, and at the next.
    shares: [f64; 2],
    number: u32,
}

impl FaceChart {
    /// Computes the loops of a face, whose edges are divided.
    pub(crate) fn new(shape: &Shape, face: &Face, divided: &Divided, chart: Chart) -> Self {
        let mut made = Self {
            chart,
            is_left: face.agrees,
            scale: [1.0; 2],
            loops: Vec::new(),
        };
        for around in &face.loops {
            let nodes = nodes_of(around, divided);
            if !nodes.is_empty() {
                let placed = made.walk(shape, &nodes, divided);
                made.loops.push(placed);
            }
        }
        // Faces may be many, and their samples more than their loops.
        made.chart.forget_samples();
        made.scale = made.scales();
        for k in 0..made.loops.len() {
            for i in 0..made.loops[k].pieces.len() {
                made.loops[k].pieces[i].bulge = made.bulge(shape, &made.loops[k].pieces[i]);
            }
        }
        made
    }

    /// Returns scaled parameters, in which lengths are about those in space.
    pub(crate) fn scaled(&self, at: [f64; 2]) -> [f64; 2] {
        [at[0] * self.scale[0], at[1] * self.scale[1]]
    }

    /// Returns the parameters of a point of an edge near others.
    pub(crate) fn place_on(&self, edge: &Edge, share: f64, near: [f64; 2]) -> [f64; 2] {
        self.place_near(edge.at(share)[0], near)
    }

    /// Returns the parameters of a point near others; at a pole, the parameter that it leaves open
    /// is that of the others.
    fn place_near(&self, p: Point3, near: [f64; 2]) -> [f64; 2] {
        if let Some(pole) = self.chart.pole_at(p) {
            let mut at = near;
            at[pole.direction] = pole.at;
            return at;
        }
        self.chart.place_near(p, near)
    }

    /// Returns the loop with parameters.
    fn walk(&self, shape: &Shape, nodes: &[LoopNode], divided: &Divided) -> LoopChart {
        let point = |n: &LoopNode| divided.points[n.number as usize];
        let is_pole = |n: &LoopNode| self.chart.pole_at(point(n)).is_some();
        let start = nodes.iter().position(|n| !is_pole(n)).unwrap_or(0);
        let mut made = LoopChart::default();
        let first = self.chart.place(point(&nodes[start]));
        let mut here = first;
        for step in 0..nodes.len() {
            let node = &nodes[(start + step) % nodes.len()];
            let next = &nodes[(start + step + 1) % nodes.len()];
            let edge = &shape.edges[node.edge as usize];
            let mut from = here;
            if let Some(pole) = self.chart.pole_at(point(node)).copied() {
                // Just behind the pole the open parameter is that of the edge.
                let [a, b] = node.shares;
                let p = edge.at(a + 0.01 * (b - a))[0];
                let mut after = if self.chart.pole_at(p).is_some() {
                    self.place_near(point(next), from)
                } else {
                    self.chart.place_near(p, from)
                };
                after[pole.direction] = pole.at;
                let other = 1 - pole.direction;
                if let Some(period) = self.chart.periods[other] {
                    // Along a pole the face is on the same side of the loop as elsewhere.
                    let before = made.pieces.last().map_or(from, |p: &Piece| p.at[0]);
                    let is_high = before[pole.direction] < pole.at;
                    let is_v = pole.direction == 1;
                    let descends = is_high == (self.is_left == is_v);
                    let sign = if descends { -1.0 } else { 1.0 };
                    let mut turn = (sign * (after[other] - from[other])).rem_euclid(period);
                    if turn < MIN_POLE_TURN * period {
                        turn += period;
                    }
                    after[other] = from[other] + sign * turn;
                }
                made.pieces.push(Piece {
                    edge: None,
                    shares: [0.0; 2],
                    nodes: [node.number; 2],
                    at: [from, after],
                    bulge: 0.0,
                });
                from = after;
            }
            let to = self.follow(edge, node.shares, from, point(next));
            made.pieces.push(Piece {
                edge: Some(node.edge),
                shares: node.shares,
                nodes: [node.number, next.number],
                at: [from, to],
                bulge: 0.0,
            });
            here = to;
        }
        for k in 0..2 {
            let mut end = first[k];
            if let Some(period) = self.chart.periods[k] {
                let turns = ((here[k] - first[k]) / period).round();
                made.turns[k] = turns as i64;
                end += turns * period;
            }
            // The loop closes without rounding.
            if let Some(last) = made.pieces.last_mut() {
                last.at[1][k] = end;
            }
            let values = || made.pieces.iter().flat_map(|p| p.at).map(|at| at[k]);
            made.bounds[k] = [
                values().fold(f64::INFINITY, f64::min),
                values().fold(f64::NEG_INFINITY, f64::max),
            ];
        }
        made
    }

    /// Returns the parameters of the end of a piece that begins at others. Where the surface has
    /// no formula, the piece is followed in short steps if one step leads astray.
    fn follow(&self, edge: &Edge, [a, b]: [f64; 2], from: [f64; 2], to: Point3) -> [f64; 2] {
        let at = self.place_near(to, from);
        if self.chart.surface.feet(to).is_some() {
            return at;
        }
        let off = |at: [f64; 2], p: Point3| {
            isoform_geom::norm(isoform_geom::sub(self.chart.surface.at(at).p, p))
        };
        let reach = isoform_geom::norm(isoform_geom::sub(edge.at(a)[0], to));
        if off(at, to) <= 1e-3 * reach {
            return at;
        }
        let mut here = from;
        for k in 1..=8 {
            let p = edge.at(a + (b - a) * f64::from(k) / 8.0)[0];
            here = self.place_near(p, here);
        }
        let anew = self.chart.unwrapped(self.chart.place(to), here);
        if off(anew, to) < 0.5 * off(here, to) {
            anew
        } else {
            here
        }
    }

    /// Returns the lengths of a unit of u and of v: means over the nodes.
    fn scales(&self) -> [f64; 2] {
        let mut sums = [0.0; 2];
        let mut count = 0.0;
        let mut add = |at: [f64; 2]| {
            let jet = self.chart.surface.at(at);
            sums[0] += isoform_geom::norm(jet.u);
            sums[1] += isoform_geom::norm(jet.v);
            count += 1.0;
        };
        for piece in self.loops.iter().flat_map(|l| &l.pieces) {
            add(piece.at[0]);
        }
        if self.loops.is_empty() {
            let domain = self.chart.surface.domain();
            for i in 0..5 {
                for j in 0..5 {
                    let share = |k: usize, i: i32| {
                        let [lo, hi] = domain[k];
                        lo + (hi - lo) * (0.5 + f64::from(i)) / 5.0
                    };
                    add([share(0, i), share(1, j)]);
                }
            }
        }
        let mean = |sum: f64| sum / count;
        let is_scale = |s: f64| s > 0.0 && s.is_finite();
        sums.map(|s| if is_scale(mean(s)) { mean(s) } else { 1.0 })
    }

    /// Returns a bound of the distance of a piece from its chord in scaled parameters.
    fn bulge(&self, shape: &Shape, piece: &Piece) -> f64 {
        let Some(edge) = piece.edge else { return 0.0 };
        let edge = &shape.edges[edge as usize];
        let ends = piece.at.map(|at| self.scaled(at));
        let off = |k: i32| {
            let t = f64::from(k) / 4.0;
            let share = piece.shares[0] + t * (piece.shares[1] - piece.shares[0]);
            let near = blend(piece.at, t);
            let at = self.scaled(self.place_on(edge, share, near));
            distance_to_chord(at, ends)
        };
        BULGE_MARGIN * (1..4).map(off).fold(0.0, f64::max)
    }
}

/// Returns the point at a share of a segment.
pub(crate) fn blend([a, b]: [[f64; 2]; 2], t: f64) -> [f64; 2] {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

/// Returns the distance of a point from a segment.
pub(crate) fn distance_to_chord(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let (d, e) = (plane::sub(b, a), plane::sub(p, a));
    let d2 = plane::dot(d, d);
    let t = if d2 > 0.0 {
        (plane::dot(d, e) / d2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    plane::distance_squared(p, blend([a, b], t)).sqrt()
}

/// Returns the nodes of a loop.
fn nodes_of(around: &[isoform_geom::cad::Coedge], divided: &Divided) -> Vec<LoopNode> {
    let mut nodes = Vec::new();
    for coedge in around {
        let along = &divided.along[coedge.edge as usize];
        let mut push = |from: &(f64, u32), to: &(f64, u32)| {
            nodes.push(LoopNode {
                edge: coedge.edge,
                shares: [from.0, to.0],
                number: from.1,
            });
        };
        if coedge.forward {
            along.windows(2).for_each(|w| push(&w[0], &w[1]));
        } else {
            along.windows(2).rev().for_each(|w| push(&w[1], &w[0]));
        }
    }
    nodes
}
