//! Any text as a STEP file of any program: a shape or an error; what is read is divided into
//! triangles and measured, or refused.
//!
//! `cargo +nightly fuzz run read_step -- -rss_limit_mb=2048 -timeout=20`
#![no_main]

use isoform_cad::{Control, PreparedShape};
use isoform_io::{StepContent, read_step};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(StepContent::Shape(file)) = read_step(&String::from_utf8_lossy(data)) else {
        return;
    };
    let control = Control::default().for_seconds(5.0);
    if let Ok(shape) = PreparedShape::new(file.shape, None, &control) {
        shape.measures();
        shape.nearest([0.5, -2.0, 0.25]);
        shape.signed_distance([0.5, -2.0, 0.25]);
    }
});
