//! Any text as a file of patches: patches or an error; their maps and bounds are made where they
//! are small.
//!
//! `cargo +nightly fuzz run read_patches -- -rss_limit_mb=1024 -timeout=10`
#![no_main]

use isoform_tess::{is_patch_file, patch_bounds, read_patches};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(json) = serde_json::from_slice::<serde_json::Value>(data) else {
        return;
    };
    if let Ok(patches) = read_patches(&json) {
        assert!(is_patch_file(&json) && !patches.is_empty());
        if patches.len() < 10 && data.len() < 2000 {
            patch_bounds(&patches);
            for patch in &patches {
                let _ = patch.map();
            }
        }
    }
});
