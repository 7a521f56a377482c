//! The seeds of the fuzz target `read_points`: every fixture, the first byte being the number of its format.

mod common;

use std::path::Path;

/// Writes them; run with `--ignored` after a fixture has changed.
#[test]
#[ignore = "writes into fuzz/corpus"]
fn write_seeds() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_points");
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, bytes) in common::fixtures() {
        let format = name.rsplit_once('.').and_then(|(_, e)| isoform_io::format_named(e)).expect("known");
        let number = isoform_io::formats().iter().position(|f| f.name == format.name).expect("listed");
        let seed: Vec<u8> = [number as u8].into_iter().chain(bytes).collect();
        std::fs::write(folder.join(format!("seed-{name}")), seed).expect("written");
    }
}

/// All that fuzzing has kept still reads, or is refused.
#[test]
fn the_corpus_survives() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_points");
    let Ok(entries) = std::fs::read_dir(folder) else { return println!("skipped: no corpus") };
    for entry in entries {
        let bytes = std::fs::read(entry.expect("readable").path()).expect("readable");
        let Some((&first, rest)) = bytes.split_first() else { continue };
        let format = isoform_io::formats().get(usize::from(first & 15)).map(|f| f.name);
        let source = isoform_io::Source::Bytes { name: "seed", bytes: rest };
        let _ = isoform_io::read(source, format, &isoform_io::ReadOptions::default());
    }
}
