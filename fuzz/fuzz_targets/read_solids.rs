//! Any text as a file of solids, JSON or STEP: solids or an error; what is read can be worked on,
//! and is written and read the same.
//!
//! `cargo +nightly fuzz run read_solids -- -rss_limit_mb=1024 -timeout=10`
#![no_main]

use isoform_io::{SolidFile, is_solid_file, read_solids, read_step_solids, write_solids};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(json) = serde_json::from_slice::<serde_json::Value>(data) {
        if let Ok(file) = read_solids(&json) {
            assert!(is_solid_file(&json));
            work_on(&file);
        }
    }
    if let Ok(file) = read_step_solids(&String::from_utf8_lossy(data)) {
        work_on(&file);
    }
});

fn work_on(file: &SolidFile) {
    let brep = &file.brep;
    assert_eq!(brep.validate(), Ok(()));
    for e in 0..brep.edges.len() as u32 {
        for s in brep.breaks(e) {
            brep.along(e, s);
        }
    }
    for face in &brep.faces {
        let surface = &face.surface;
        surface.distance(surface.point(surface.parameters([0.5, -2.0, 0.25])));
    }
    let json = serde_json::from_slice(&write_solids(file)).expect("JSON");
    assert_eq!(read_solids(&json).expect("our own file"), *file);
}
