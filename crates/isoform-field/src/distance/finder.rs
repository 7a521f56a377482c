//! Evaluation of the pieces of a solid at given parameters.

use super::solid::CompiledSolid;
use crate::block::{Block, LANES, Lane, Row};
use isoform_geom::Point3;

/// Ratio of first-order distances above which all other faces are ignored. With less than 2 the
/// foot point could lie beyond an edge; more only sends more points to the slower search over
/// several pieces.
pub(super) const CLEAR_DISTANCE_RATIO: f64 = 2.5;

/// Value of the tree in each lane, and the piece that decides it; of equal pieces the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct NearestPiece {
    /// Value of the tree.
    pub(super) value: Row,
    /// Piece that decides.
    pub(super) piece: [u32; LANES],
}

/// Search for foot points with the pieces at given parameters.
pub(super) struct FootFinder<'t> {
    pub(super) solid: &'t CompiledSolid,
    /// Values of the parameters.
    pub(super) a: &'t [f64],
    /// Scratch memory of the tree over values.
    pub(super) stack: Vec<f64>,
    /// Evaluator of each piece, created at its first use.
    pub(super) blocks: Vec<Option<Block<'t>>>,
    /// First-order distances of a block of points from each piece.
    pub(super) off: Vec<Row>,
    /// Scratch memory of the tree over blocks of values.
    pub(super) nearest: Vec<NearestPiece>,
}

impl<'t> FootFinder<'t> {
    /// Returns a finder at the parameters `a`.
    pub(super) fn new(solid: &'t CompiledSolid, a: &'t [f64]) -> Self {
        Self {
            solid,
            a,
            stack: Vec::new(),
            blocks: solid.pieces.iter().map(|_| None).collect(),
            off: vec![Lane([0.0; LANES]); solid.pieces.len()],
            nearest: Vec::new(),
        }
    }

    /// Returns the evaluator of piece k.
    pub(super) fn block(&mut self, k: usize) -> &mut Block<'t> {
        let (piece, a) = (&self.solid.pieces[k], self.a);
        self.blocks[k].get_or_insert_with(|| {
            let mut block = Block::gradients(&piece.tape, &piece.by_space);
            block.bind(a);
            block
        })
    }

    /// Evaluates g and ∇g of piece k at the points.
    pub(super) fn evaluate(
        &mut self,
        k: usize,
        points: &[Point3],
        mut each: impl FnMut(usize, f64, Point3),
    ) {
        let block = self.block(k);
        for (c, chunk) in points.chunks(LANES).enumerate() {
            block.load(chunk);
            let value = *block.forward();
            block.reverse();
            let rows = block.by_space();
            for l in 0..chunk.len() {
                each(
                    c * LANES + l,
                    value[l],
                    [rows[0].0[l], rows[1].0[l], rows[2].0[l]],
                );
            }
        }
    }
}
