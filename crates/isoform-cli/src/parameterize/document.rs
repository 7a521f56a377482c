//! The documents of patches: their file, the trace, and what --json prints.

use super::Made;
use crate::output;
use isoform::io::{PatchRecord, write_patches};
use isoform::patch::{Grown, Parameterized, Phase};
use isoform::report::{AboutPatches, PatchesReport};
use serde_json::Value;

/// The file of the patches. Equal patches give equal bytes.
pub(super) fn patches(made: &Made) -> Vec<u8> {
    let records: Vec<PatchRecord> = made.patches.iter().map(record).collect();
    write_patches(&records)
}

/// A patch as an entry of the file, with the bound on its distance.
fn record(p: &Parameterized) -> PatchRecord {
    PatchRecord {
        patch: p.grown.patch.clone(),
        // Without a proof the largest sampled distance, and `certified` says so.
        max_distance: p.distances.bound.unwrap_or(p.distances.sampled),
        certified: p.distances.bound.is_some() && p.is_unfolded,
        rms_distance: p.distances.rms,
        seed_point: p.grown.seed_point,
    }
}

/// Every step of a patch.
pub(super) fn trace(grown: &Grown) -> String {
    let mut text = "phase,step,S,I,J,L,R,E,l1,l2,wJ,wL,wR,wE\n".to_owned();
    for (step, r) in grown.trace.iter().enumerate() {
        let phase = if r.phase == Phase::Newton {
            "newton"
        } else {
            "grow"
        };
        let (t, w) = (&r.terms, &r.weights);
        let numbers = [
            r.sum,
            t.i,
            t.j,
            t.l,
            t.r,
            t.e,
            r.lengths.0,
            r.lengths.1,
            w.j,
            w.l,
            w.r,
            w.e,
        ];
        text += &format!("{phase},{}", step + 1);
        for v in numbers {
            text += &format!(",{v:?}");
        }
        text.push('\n');
    }
    text
}

/// What --json prints.
pub(super) fn document(made: &Made) -> Value {
    output::json_of(&PatchesReport::new(&AboutPatches {
        model: &made.name,
        options: &made.options,
        patches: &made.patches,
        coverage: made.coverage.as_ref(),
        findings: &made.findings(),
        files: &made.written,
        warnings: &made.warnings,
        seconds: &made.seconds,
    }))
}
