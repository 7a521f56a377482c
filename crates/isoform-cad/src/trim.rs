//! Decision on which side of the loops of a face a point of its surface lies.
//!
//! A path from the point to a reference whose side is known crosses the loops an even or an odd
//! number of times. A piece of a loop may be replaced by its chord if neither end of the path is
//! near it, since the one can be moved to the other without passing an end; a piece near an end is
//! halved, with its middle on the exact edge. So the answer is that of the exact curves.

use crate::loops::{FaceChart, LoopChart, Piece, blend, distance_to_chord};
use isoform_geom::cad::Shape;
use isoform_geom::plane;

/// Maximum number of halvings of a piece: each divides its bulge by four; 25 exhaust the digits.
const MAX_HALVINGS: usize = 30;
/// Distance of the reference from a border, relative to the piece next to it.
const REFERENCE_SHARE: f64 = 1e-3;

/// Kind of a face, by its loops in the parameter plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Extent {
    /// Whole surface, without a border.
    Whole,
    /// Loops close in the plane, and the face lies within an outer one.
    Bounded,
    /// The face goes round. A point inside is known.
    Round([f64; 2]),
}

/// Face with its border.
#[derive(Debug)]
pub(crate) struct TrimmedFace {
    pub(crate) face: FaceChart,
    pub(crate) extent: Extent,
}

impl TrimmedFace {
    pub(crate) fn new(shape: &Shape, mut face: FaceChart) -> Self {
        let extent = if face.loops.is_empty() {
            Extent::Whole
        } else if let Some(outer) = outer(&face) {
            gather(&mut face, outer);
            Extent::Bounded
        } else {
            Extent::Round(inner_point(shape, &face))
        };
        Self { face, extent }
    }

    /// Returns true if parameters lie within the loops.
    pub(crate) fn holds(&self, shape: &Shape, at: [f64; 2]) -> bool {
        match self.extent {
            Extent::Whole => true,
            Extent::Bounded => self.is_bounded(shape, at),
            Extent::Round(inside) => {
                let at = self.face.chart.unwrapped(at, inside);
                let crossings: usize = self
                    .face
                    .loops
                    .iter()
                    .map(|around| {
                        self.shifts(around, [at, inside])
                            .map(|shift| {
                                let path = [at, inside].map(|p| plane::sub(p, shift));
                                self.crossings(shape, around, path)
                            })
                            .sum::<usize>()
                    })
                    .sum();
                crossings.is_multiple_of(2)
            }
        }
    }

    /// Returns true if parameters, or others that differ by periods, lie within the loops.
    fn is_bounded(&self, shape: &Shape, at: [f64; 2]) -> bool {
        let bounds = self.bounds();
        let shifts = [0, 1].map(|k| match self.face.chart.periods[k] {
            Some(period) => {
                let [lo, hi] = bounds[k];
                let slack = 1e-9 * period;
                let first = ((lo - slack - at[k]) / period).ceil();
                let last = ((hi + slack - at[k]) / period).floor();
                // A loop that is closed in the plane spans few periods.
                let count = (last - first + 1.0).clamp(0.0, 8.0) as usize;
                (0..count).map(|m| (first + m as f64) * period).collect()
            }
            None => vec![0.0],
        });
        let is_within = |at: [f64; 2]| {
            let size = [0, 1].map(|k| bounds[k][1] - bounds[k][0]);
            let beyond =
                |k: usize| at[k] < bounds[k][0] - size[k] || at[k] > bounds[k][1] + size[k];
            if beyond(0) || beyond(1) {
                return false;
            }
            // Beyond the corner, at an angle that no side of a box has.
            let far = [
                bounds[0][0] - 0.731 * size[0],
                bounds[1][0] - 0.377 * size[1],
            ];
            let far = [far[0] - self.unit(0), far[1] - self.unit(1)];
            let loops = self.face.loops.iter();
            let count = loops.map(|l| self.crossings(shape, l, [at, far]));
            count.sum::<usize>() % 2 == 1
        };
        shifts[0].iter().any(|u| {
            let mut v = shifts[1].iter();
            v.any(|v| is_within([at[0] + u, at[1] + v]))
        })
    }

    /// Returns the parameter step that is a thousandth of the size of the face, so that a reference
    /// is beyond it even if it has no extent in a direction.
    fn unit(&self, k: usize) -> f64 {
        let bounds = self.bounds();
        let scale = self.face.scale;
        let size = [0, 1].map(|k| (bounds[k][1] - bounds[k][0]) * scale[k]);
        1e-3 * (size[0] + size[1]) / scale[k]
    }

    /// Returns the smallest and largest parameters of the loops.
    pub(crate) fn bounds(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|k| {
            let all = || self.face.loops.iter().map(|l| l.bounds[k]);
            [
                all().map(|b| b[0]).fold(f64::INFINITY, f64::min),
                all().map(|b| b[1]).fold(f64::NEG_INFINITY, f64::max),
            ]
        })
    }

    /// Returns the shifts by periods with which a loop may meet a path.
    fn shifts(
        &self,
        around: &LoopChart,
        path: [[f64; 2]; 2],
    ) -> impl Iterator<Item = [f64; 2]> + use<> {
        let lists = [0, 1].map(|k| match self.face.chart.periods[k] {
            Some(period) => {
                let [lo, hi] = around.bounds[k];
                let [from, to] = [path[0][k].min(path[1][k]), path[0][k].max(path[1][k])];
                let slack = 1e-9 * period;
                let first = ((from - hi - slack) / period).ceil();
                let last = ((to - lo + slack) / period).floor();
                let count = (last - first + 1.0).clamp(0.0, 64.0) as usize;
                (0..count).map(|m| (first + m as f64) * period).collect()
            }
            None => vec![0.0],
        });
        let [us, vs] = lists;
        us.into_iter()
            .flat_map(move |u| vs.clone().into_iter().map(move |v| [u, v]))
    }

    /// Returns the number of crossings of a loop with a path.
    fn crossings(&self, shape: &Shape, around: &LoopChart, path: [[f64; 2]; 2]) -> usize {
        let path = path.map(|p| self.face.scaled(p));
        let pieces = around.pieces.iter();
        pieces
            .map(|piece| self.crossings_of(shape, piece, piece.bulge, path, 0))
            .sum()
    }

    fn crossings_of(
        &self,
        shape: &Shape,
        piece: &Piece,
        bulge: f64,
        path: [[f64; 2]; 2],
        depth: usize,
    ) -> usize {
        let chord = piece.at.map(|at| self.face.scaled(at));
        let is_near = |p: [f64; 2]| distance_to_chord(p, chord) <= bulge;
        let Some(edge) = piece.edge else {
            return usize::from(cross(chord, path));
        };
        let rounding = 1e-15 * (chord[0][0].abs() + chord[0][1].abs());
        if depth == MAX_HALVINGS || bulge <= rounding || !path.iter().any(|p| is_near(*p)) {
            return usize::from(cross(chord, path));
        }
        let half = 0.5 * (piece.shares[0] + piece.shares[1]);
        let middle = blend(piece.at, 0.5);
        let middle = self
            .face
            .place_on(&shape.edges[edge as usize], half, middle);
        let off = distance_to_chord(self.face.scaled(middle), chord);
        let halves = [
            ([piece.shares[0], half], [piece.at[0], middle]),
            ([half, piece.shares[1]], [middle, piece.at[1]]),
        ];
        // Halves of a smooth arc bulge by a quarter of it, those of an S by up to all of it.
        let bulge = (0.4 * bulge).max(if depth == 0 { 0.0 } else { 0.4 * off });
        let of_half = |(shares, at)| {
            let piece = Piece {
                shares,
                at,
                ..*piece
            };
            self.crossings_of(shape, &piece, bulge, path, depth + 1)
        };
        halves.into_iter().map(of_half).sum()
    }
}

/// Returns true if two segments cross; of one with an end on the other, a neighbour that continues
/// it counts.
fn cross([a, b]: [[f64; 2]; 2], [p, r]: [[f64; 2]; 2]) -> bool {
    let side = |q: [f64; 2]| plane::orient(p, r, q) >= 0.0;
    if side(a) == side(b) {
        return false;
    }
    (plane::orient(a, b, p) >= 0.0) != (plane::orient(a, b, r) >= 0.0)
}

/// Returns the index of the loop within which the face lies; `None` if it goes round.
fn outer(face: &FaceChart) -> Option<usize> {
    if face.loops.iter().any(|l| l.turns != [0; 2]) {
        return None;
    }
    let area = |l: &LoopChart| {
        let doubled: f64 = l
            .pieces
            .iter()
            .map(|p| plane::cross(p.at[0], p.at[1]))
            .sum();
        if face.is_left { doubled } else { -doubled }
    };
    let areas: Vec<f64> = face.loops.iter().map(area).collect();
    let is_flat = face.chart.periods == [None; 2];
    let size = |i: &usize| if is_flat { areas[*i].abs() } else { areas[*i] };
    let best = (0..areas.len()).max_by(|i, j| size(i).total_cmp(&size(j)))?;
    (is_flat || areas[best] > 0.0).then_some(best)
}

/// Shifts all loops by periods to where the outer one is.
fn gather(face: &mut FaceChart, outer: usize) {
    let middle = |l: &LoopChart| [0, 1].map(|k| 0.5 * (l.bounds[k][0] + l.bounds[k][1]));
    let to = middle(&face.loops[outer]);
    for i in 0..face.loops.len() {
        let from = middle(&face.loops[i]);
        let shift = plane::sub(face.chart.unwrapped(from, to), from);
        if shift == [0.0; 2] {
            continue;
        }
        let around = &mut face.loops[i];
        for piece in &mut around.pieces {
            piece.at = piece.at.map(|at| [at[0] + shift[0], at[1] + shift[1]]);
        }
        for k in 0..2 {
            around.bounds[k] = around.bounds[k].map(|b| b + shift[k]);
        }
    }
}

/// Returns parameters inside a face: next to its longest piece.
fn inner_point(shape: &Shape, face: &FaceChart) -> [f64; 2] {
    let length = |p: &Piece| {
        let [a, b] = p.at.map(|at| face.scaled(at));
        plane::distance_squared(a, b)
    };
    let pieces = face.loops.iter().flat_map(|l| &l.pieces);
    let real = pieces.filter(|p| p.edge.is_some());
    let Some(piece) = real.max_by(|a, b| length(a).total_cmp(&length(b))) else {
        return [0.0; 2];
    };
    let edge = &shape.edges[piece.edge.unwrap_or(0) as usize];
    let at = |t: f64| {
        let share = piece.shares[0] + t * (piece.shares[1] - piece.shares[0]);
        face.place_on(edge, share, blend(piece.at, t))
    };
    let (middle, before, after) = (at(0.5), at(0.49), at(0.51));
    let way = plane::sub(face.scaled(after), face.scaled(before));
    let left = plane::left(way);
    let reach = length(piece).sqrt() * REFERENCE_SHARE / plane::dot(left, left).sqrt();
    let sign = if face.is_left { 1.0 } else { -1.0 };
    [0, 1].map(|k| middle[k] + sign * reach * left[k] / face.scale[k])
}
