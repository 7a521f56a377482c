//! Sign of a tree in a tetrahedron, from the values of the pieces at its vertices.

use super::Cutter;
use crate::lattice::{INSIDE_CELL, OUTSIDE_CELL};
use crate::surface::Surface;
use isoform_geom::Csg;

/// Classification of a tetrahedron by the signs at its vertices.
pub(super) enum Side {
    In,
    Out,
    /// All relevant values are 0: it lies flat in the surface.
    Flat,
    /// Pieces whose sign changes have to be cut.
    Cut(Vec<u32>),
}

/// Minimum and maximum of a piece over the vertices.
struct Range {
    piece: u32,
    lo: f64,
    hi: f64,
}

impl Cutter<'_> {
    /// Classifies a tetrahedron by the signs at its vertices.
    pub(super) fn side(&mut self, t: u32) -> Side {
        self.side_in(self.surface.focus, t)
    }

    /// Classifies a tetrahedron with respect to a layer.
    fn side_in(&mut self, layer: usize, t: u32) -> Side {
        let surface: &Surface<'_> = self.surface;
        let lattice = surface.lattice_of(layer);
        let state = lattice.state_at(self.complex.middle(t));
        let Some(reduced) = lattice.reduced(state) else {
            debug_assert!(state == INSIDE_CELL || state == OUTSIDE_CELL);
            return if state == INSIDE_CELL {
                Side::In
            } else {
                Side::Out
            };
        };
        let ranges: Vec<Range> = reduced
            .pieces
            .iter()
            .map(|&piece| self.range(t, piece))
            .collect();
        side(&reduced.tree, &ranges)
    }

    fn range(&mut self, t: u32, piece: u32) -> Range {
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in self.complex.tets[t as usize] {
            let d = self.distance_in(t, v, piece);
            (lo, hi) = (lo.min(d), hi.max(d));
        }
        Range { piece, lo, hi }
    }

    /// Marks the tetrahedra inside.
    pub(crate) fn inside(&mut self) -> Vec<bool> {
        let mut inside = vec![false; self.complex.tets.len()];
        for t in 0..self.complex.tets.len() as u32 {
            inside[t as usize] = self.complex.is_there(t) && self.is_in(0, t);
        }
        inside
    }

    /// Returns true if a tetrahedron lies in a layer.
    fn is_in(&mut self, layer: usize, t: u32) -> bool {
        match self.side_in(layer, t) {
            Side::In => true,
            Side::Out => false,
            Side::Flat | Side::Cut(_) => {
                self.surface.value_in(layer, self.complex.middle(t)).0 > 0.0
            }
        }
    }

    /// Returns true if the layer in focus is irrelevant in a tetrahedron: a divider does not matter
    /// outside of the whole, nor in an earlier divider.
    pub(super) fn is_settled(&mut self, t: u32) -> bool {
        let focus = self.surface.focus;
        if focus == 0 {
            return false;
        }
        // Most cells around a region are decided: their values are infinite.
        let [a, b, c, d] = self.complex.tets[t as usize].map(|v| self.value[v as usize]);
        (a.is_infinite() && [b, c, d] == [a; 3])
            || matches!(self.side_in(0, t), Side::Out)
            || (1..focus).any(|layer| matches!(self.side_in(layer, t), Side::In))
    }

    /// Returns the region of a tetrahedron of the whole: that of the first divider in which it
    /// lies, or the remainder.
    pub(super) fn region(&mut self, t: u32) -> u16 {
        let dividers = self.surface.dividers;
        let first = (0..dividers).find(|&k| self.is_in(k + 1, t));
        first.unwrap_or(dividers) as u16
    }
}

/// Returns the sign of a tree from the ranges of its pieces over the vertices, where 0 belongs to
/// both sides.
fn side(tree: &Csg, ranges: &[Range]) -> Side {
    match tree {
        Csg::Piece(i) => side_of_piece(*i, ranges),
        Csg::Min(children) => side_of_many(children, ranges, true),
        Csg::Max(children) => side_of_many(children, ranges, false),
    }
}

/// Returns the sign of one piece; a piece without a range is undecided.
fn side_of_piece(piece: u32, ranges: &[Range]) -> Side {
    let range = ranges.iter().find(|r| r.piece == piece);
    let (lo, hi) = range.map_or((-1.0, 1.0), |r| (r.lo, r.hi));
    match (lo < 0.0, hi > 0.0) {
        (true, true) => Side::Cut(vec![piece]),
        (true, false) => Side::Out,
        (false, true) => Side::In,
        (false, false) => Side::Flat,
    }
}

/// Returns the sign of a minimum or a maximum.
fn side_of_many(children: &[Csg], ranges: &[Range], is_min: bool) -> Side {
    let (mut flat, mut cut) = (false, Vec::new());
    for child in children {
        match (side(child, ranges), is_min) {
            (Side::Out, true) => return Side::Out,
            (Side::In, false) => return Side::In,
            (Side::In, true) | (Side::Out, false) => {}
            (Side::Flat, _) => flat = true,
            (Side::Cut(pieces), _) => cut.extend(pieces),
        }
    }
    if !cut.is_empty() {
        Side::Cut(cut)
    } else if flat {
        Side::Flat
    } else if is_min {
        Side::In
    } else {
        Side::Out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(piece: u32, lo: f64, hi: f64) -> Range {
        Range { piece, lo, hi }
    }

    #[test]
    fn zero_is_on_either_side() {
        let both = Csg::Min(vec![Csg::Piece(0), Csg::Piece(1)]);
        let one = [range(0, 0.0, 1.0), range(1, 0.0, 2.0)];
        assert!(matches!(side(&both, &one), Side::In));
        let flat = [range(0, 0.0, 0.0), range(1, 0.0, 2.0)];
        assert!(matches!(side(&both, &flat), Side::Flat));
        let out = [range(0, -1.0, 0.0), range(1, -1.0, 2.0)];
        assert!(matches!(side(&both, &out), Side::Out));
        let cut = [range(0, 0.0, 1.0), range(1, -1.0, 2.0)];
        assert!(matches!(side(&both, &cut), Side::Cut(pieces) if pieces == [1]));
    }
}
