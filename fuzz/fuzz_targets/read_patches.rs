//! Any text as a file of patches: patches or an error; their maps and bounds are made where they
//! are small.
//!
//! `cargo +nightly fuzz run read_patches -- -rss_limit_mb=1024 -timeout=10`
#![no_main]

use isoform_io::{is_patch_file, read_patches};
use isoform_tess::{Patch, patch_bounds};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(json) = serde_json::from_slice::<serde_json::Value>(data) else {
        return;
    };
    if let Ok(patches) = read_patches(&json) {
        assert!(is_patch_file(&json) && !patches.is_empty());
        if patches.len() < 10 && data.len() < 2000 {
            let patches: Vec<Patch> = patches
                .into_iter()
                .map(|p| Patch::new(p.name, p.degree, p.control.exact()))
                .collect();
            patch_bounds(&patches);
            for patch in &patches {
                let _ = patch.map();
            }
        }
    }
});
