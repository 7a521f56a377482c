//! Proof that the surface lies inside patches by a margin.

use super::Depth;
use super::rounds::CoverState;
use crate::depth::{DepthClaim, DepthPatch, DepthProof, prove};
use crate::places::{contains, wider};
use crate::surface::project;
use isoform_geom::{Aabb, Point3};

/// Maximum number of proofs of the margin. Between two proofs, patches are added where the first
/// one failed.
const MAX_MARGIN_PROOFS: usize = 4;

impl CoverState<'_> {
    /// Tries to prove the margin for the whole surface, and adds patches where the proof fails.
    pub(super) fn prove_margin(&mut self, margin: f64) -> Depth {
        self.control.report("margin", 0.0);
        let mut proof = self.proof(margin);
        for round in 1..MAX_MARGIN_PROOFS {
            self.control
                .report("margin", round as f64 / MAX_MARGIN_PROOFS as f64);
            let before = self.patches.len();
            let fresh = self.points_of(&proof.open);
            if fresh.is_empty() || self.control.is_stopped() {
                break;
            }
            self.add(&fresh);
            self.cover_samples(1);
            if self.patches.len() == before {
                break;
            }
            proof = self.proof(margin);
        }
        self.control.report("margin", 1.0);
        Depth {
            margin,
            distance: proof.open.is_empty().then_some(proof.distance),
            open: proof.open,
        }
    }

    /// Projects the centres of boxes to the surface; returns those in the region, with the index of
    /// the only part.
    fn points_of(&self, boxes: &[Aabb]) -> Vec<(Point3, usize)> {
        let (scale, field) = (self.region.diagonal(), self.whole.field(0));
        (boxes.iter())
            .filter_map(|cell| project(field, cell.center(), scale))
            .filter(|p| contains(&self.region, *p))
            .map(|p| (p, 0))
            .collect()
    }

    fn proof(&self, margin: f64) -> DepthProof {
        let sheets: Vec<DepthPatch<'_>> = (self.patches.iter())
            .map(|p| &p.made)
            .filter_map(|made| DepthPatch::new(&made.grown.patch, made.distances.bound?, margin))
            .collect();
        let is_left_out = self.samples.iter().any(|s| s.is_left_out);
        // The corners of the region are rounded on the way into the unit box. The added 1e-9
        // diagonals exceed that error for regions up to about a million times as far away as they
        // are large.
        let more = 1e-9 * self.region.diagonal();
        let question = DepthClaim {
            field: self.whole.field(0),
            region: wider(&self.region, more),
            depth: margin,
            singular: if is_left_out { &self.singular } else { &[] },
            apart: self.apart,
        };
        prove(&question, &sheets, &self.control)
    }
}
