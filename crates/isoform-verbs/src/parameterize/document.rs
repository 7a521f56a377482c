//! The documents of patches: their file, the trace, and what --json prints.

use super::MadePatches;
use crate::outcome;
use isoform::io::write_patches;
use isoform::patch::{Grown, Phase};
use isoform::patch_records;
use isoform::report::{AboutPatches, PatchesReport};
use serde_json::Value;

/// The file of the patches. Equal patches give equal bytes.
pub(super) fn patches(made: &MadePatches) -> Vec<u8> {
    write_patches(&patch_records(&made.patches))
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

/// Returns the document that --json prints.
pub(super) fn document(made: &MadePatches) -> Value {
    outcome::json_of(&PatchesReport::new(&AboutPatches {
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
