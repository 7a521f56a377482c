//! Patches out of files as maps.

use isoform_io::{FilePatch, read_patches};
use isoform_tess::{Patch, patch_bounds};

fn patch(p: FilePatch) -> Patch {
    Patch::new(p.name, p.degree, p.control.exact())
}

/// What the fuzzing target does, on its seeds.
#[test]
fn the_corpus_is_read() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = folder.join("../../fuzz/corpus/read_patches");
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).expect("a corpus") {
        let bytes = std::fs::read(entry.expect("an entry").path()).expect("readable");
        let json = serde_json::from_slice(&bytes).ok();
        let Some(Ok(read)) = json.map(|json| read_patches(&json)) else {
            continue;
        };
        let patches: Vec<Patch> = read.into_iter().map(patch).collect();
        patch_bounds(&patches);
        for p in &patches {
            assert!(
                p.map().is_ok_and(|m| m.degree() > 0)
                    || p.map().is_err_and(|e| !e.code().is_empty())
            );
            seen += 1;
        }
    }
    assert!(seen > 0);
}
