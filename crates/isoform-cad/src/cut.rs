//! Faces that go round, cut open in the parameter plane.
//!
//! The face is cut along one line of each closed direction. Pieces of loops that cross the line
//! need a node there, which the faces on their other side share; both sides of the line have one
//! set of nodes, so that the triangles close over it.

use crate::loops::Piece;
use crate::plane::{Domain, PlaneNode};
use crate::trim::{Extent, TrimmedFace};
use isoform_geom::cad::Shape;

/// Distance from the line within which a node lies on it, in periods: rounding of its parameters.
const ON_LINE: f64 = 1e-9;
/// Maximum number of nodes along an interval of a line.
const MAX_LINE_NODES: f64 = 4096.0;

/// Share of an edge at which it needs a node.
pub(crate) type Split = (u32, f64);

/// Parameters at which a face is cut; `None` in a direction that does not close.
type Cuts = [Option<f64>; 2];

/// Returns the shares of edges at which a face that goes round needs nodes.
pub(crate) fn splits(shape: &Shape, face: &TrimmedFace) -> Vec<Split> {
    let cuts = cuts(face);
    let mut splits = Vec::new();
    for piece in face.face.loops.iter().flat_map(|l| &l.pieces) {
        let Some(edge) = piece.edge else { continue };
        for k in 0..2 {
            let (Some(cut), Some(period)) = (cuts[k], face.face.chart.periods[k]) else {
                continue;
            };
            let turn = |at: [f64; 2]| (at[k] - cut) / period;
            let [a, b] = piece.at.map(turn);
            let whole = if (a - a.round()).abs() < ON_LINE || (b - b.round()).abs() < ON_LINE {
                // One end lies on a line; another one may be between.
                (a.min(b) + 2.0 * ON_LINE).ceil()
            } else {
                a.min(b).ceil()
            };
            if whole < a.max(b) - 2.0 * ON_LINE {
                splits.push((edge, crossing(shape, face, piece, k, cut + whole * period)));
            }
        }
    }
    splits
}

/// Returns the share at which a piece crosses a line, by bisection.
fn crossing(shape: &Shape, face: &TrimmedFace, piece: &Piece, k: usize, line: f64) -> f64 {
    let edge = &shape.edges[piece.edge.unwrap_or(0) as usize];
    let is_beyond = piece.at[0][k] > line;
    let (mut a, mut b) = (piece.shares[0], piece.shares[1]);
    let mut near = piece.at[0];
    for _ in 0..60 {
        let half = 0.5 * (a + b);
        let at = face.face.place_on(edge, half, near);
        if (at[k] > line) == is_beyond {
            (a, near) = (half, at);
        } else {
            b = half;
        }
    }
    0.5 * (a + b)
}

/// Returns the lines along which a face is cut: through a node, or the start of the domain.
fn cuts(face: &TrimmedFace) -> Cuts {
    let first = face.face.loops.iter().flat_map(|l| &l.pieces);
    let first = first.map(|p| p.at[0]).next();
    [0, 1].map(|k| {
        face.face.chart.periods[k]?;
        let start = face.face.chart.surface.domain()[k][0];
        Some(first.map_or(start, |at| at[k]))
    })
}

/// Collects nodes and sides of the face, cut open.
pub(crate) fn opened(
    shape: &Shape,
    face: &TrimmedFace,
    steps: [f64; 2],
    mut domain: Domain,
) -> Domain {
    let cuts = cuts(face);
    let mut on_lines: [Vec<(f64, u32)>; 2] = [Vec::new(), Vec::new()];
    for piece in face.face.loops.iter().flat_map(|l| &l.pieces) {
        let at = shifted(face, piece, cuts);
        for (number, at) in piece.nodes.into_iter().zip(at) {
            for k in 0..2 {
                if let (Some(cut), Some(period)) = (cuts[k], face.face.chart.periods[k])
                    && (at[k] == cut || at[k] == cut + period)
                {
                    on_lines[k].push((at[1 - k], number));
                }
            }
        }
        let [a, b] = [0, 1].map(|i| domain.node(at[i], piece.nodes[i]));
        domain.side(a, b);
    }
    let work = Opening {
        shape,
        face,
        cuts,
        steps,
    };
    for k in 0..2 {
        if let (Some(cut), Some(period)) = (cuts[k], face.face.chart.periods[k]) {
            let nodes = std::mem::take(&mut on_lines[k]);
            work.close_line(k, [cut, cut + period], nodes, &mut domain);
        }
    }
    work.close_poles(&mut domain);
    domain
}

/// Returns the parameters of a piece within the box between the cuts.
fn shifted(face: &TrimmedFace, piece: &Piece, cuts: Cuts) -> [[f64; 2]; 2] {
    let mut at = piece.at;
    for k in 0..2 {
        let (Some(cut), Some(period)) = (cuts[k], face.face.chart.periods[k]) else {
            continue;
        };
        let middle = (0.5 * (at[0][k] + at[1][k]) - cut) / period;
        let on_line = at.iter().all(|at| {
            let turn = (at[k] - cut) / period;
            (turn - turn.round()).abs() < ON_LINE
        });
        let turns = if on_line {
            // The face is on one side of a piece along the line.
            let rises = at[1][1 - k] > at[0][1 - k];
            let is_below = (rises == face.face.is_left) == (k == 0);
            middle.round() - if is_below { 1.0 } else { 0.0 }
        } else {
            middle.floor()
        };
        for at in &mut at {
            let turn = (at[k] - cut) / period - turns;
            at[k] = if turn.abs() < ON_LINE {
                cut
            } else if (turn - 1.0).abs() < ON_LINE {
                cut + period
            } else {
                at[k] - turns * period
            };
        }
    }
    at
}

struct Opening<'a> {
    shape: &'a Shape,
    face: &'a TrimmedFace,
    cuts: Cuts,
    steps: [f64; 2],
}

impl Opening<'_> {
    /// Adds the sides along a line, on both copies of it; `nodes` are those of loops on it.
    fn close_line(
        &self,
        k: usize,
        copies: [f64; 2],
        mut nodes: Vec<(f64, u32)>,
        domain: &mut Domain,
    ) {
        let other = 1 - k;
        let place = |line: f64, t: f64| if k == 0 { [line, t] } else { [t, line] };
        let chart = &self.face.face.chart;
        if let (Some(cut), Some(period)) = (self.cuts[other], chart.periods[other]) {
            let corner = domain.corner(chart.surface.at(place(copies[0], cut)).p);
            nodes.push((cut, corner));
            nodes.push((cut + period, corner));
        }
        for pole in chart.poles.iter().filter(|p| p.direction == other) {
            nodes.push((pole.at, domain.pole(pole.point)));
        }
        nodes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nodes.dedup_by(|a, b| a.0 == b.0 && a.1 == b.1);
        for pair in nodes.windows(2) {
            let [(from, first), (to, last)] = [pair[0], pair[1]];
            let ends = copies.map(|line| {
                [(from, first), (to, last)].map(|(t, number)| domain.node(place(line, t), number))
            });
            let is_side = ends.iter().any(|[a, b]| domain.has_side(*a, *b));
            let middle = place(copies[0], 0.5 * (from + to));
            if from == to || is_side || !self.face.holds(self.shape, middle) {
                continue;
            }
            let count = ((to - from) / self.steps[other])
                .ceil()
                .clamp(1.0, MAX_LINE_NODES);
            let mut before = ends.map(|e| e[0]);
            for i in 1..count as usize {
                let t = from + (to - from) * i as f64 / count;
                let number = domain.add(chart.surface.at(place(copies[0], t)).p);
                for (copy, before) in copies.into_iter().zip(&mut before) {
                    let next = domain.node(place(copy, t), number);
                    domain.side(*before, next);
                    *before = next;
                }
            }
            for (before, end) in before.into_iter().zip(ends) {
                domain.side(before, end[1]);
            }
        }
    }

    /// Adds the sides along poles within the face.
    fn close_poles(&self, domain: &mut Domain) {
        let chart = &self.face.face.chart;
        for pole in &chart.poles {
            let (k, other) = (pole.direction, 1 - pole.direction);
            let (Some(cut), Some(period)) = (self.cuts[other], chart.periods[other]) else {
                continue;
            };
            let place = |t: f64| if k == 0 { [pole.at, t] } else { [t, pole.at] };
            let on_pole = |p: &&Piece| p.edge.is_none() && p.at[0][k] == pole.at;
            let mut pieces = self.face.face.loops.iter().flat_map(|l| &l.pieces);
            if pieces.any(|p| on_pole(&p))
                || !self.face.holds(self.shape, place(cut + 0.4 * period))
            {
                continue;
            }
            let number = domain.pole(pole.point);
            let count = (period / self.steps[other]).ceil().clamp(3.0, 64.0);
            let mut before = domain.node(place(cut), number);
            for i in 1..=count as usize {
                let t = if i == count as usize {
                    cut + period
                } else {
                    cut + period * i as f64 / count
                };
                let next = domain.node(place(t), number);
                domain.side(before, next);
                before = next;
            }
        }
    }
}

/// Returns the smallest and largest parameters of a face, those of its box if it goes round.
pub(crate) fn bounds(face: &TrimmedFace) -> [[f64; 2]; 2] {
    let chart = &face.face.chart;
    let own = face.bounds();
    if face.extent == Extent::Bounded {
        return own;
    }
    let cuts = cuts(face);
    [0, 1].map(|k| {
        if let (Some(cut), Some(period)) = (cuts[k], chart.periods[k]) {
            return [cut, cut + period];
        }
        let mut bounds = own[k];
        for pole in chart.poles.iter().filter(|p| p.direction == k) {
            bounds = [bounds[0].min(pole.at), bounds[1].max(pole.at)];
        }
        bounds
    })
}

/// Returns a node of the plane, with coordinates that spade accepts.
pub(crate) fn plane_node(at: [f64; 2], number: u32) -> PlaneNode {
    // Spade refuses smaller numbers other than 0.
    let at = at.map(|v| if v.abs() < 1e-40 { 0.0 } else { v });
    PlaneNode { at, number }
}
