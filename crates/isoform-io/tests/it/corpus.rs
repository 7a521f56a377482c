//! Seeds of the fuzz targets `read_points` and `read_meshes`: every fixture, preceded by a byte
//! with the index of its format.

use crate::common;
use std::path::Path;

/// Writes the seeds of points; run with `--ignored` after a fixture has changed.
#[test]
#[ignore = "writes into fuzz/corpus"]
fn write_seeds() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_points");
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, bytes) in common::fixtures() {
        let format = name
            .rsplit_once('.')
            .and_then(|(_, e)| isoform_io::format_named(e))
            .expect("known");
        let number = isoform_io::formats()
            .iter()
            .position(|f| f.name == format.name)
            .expect("listed");
        let seed: Vec<u8> = [number as u8].into_iter().chain(bytes).collect();
        std::fs::write(folder.join(format!("seed-{name}")), seed).expect("written");
    }
}

/// Writes the seeds of meshes.
#[test]
#[ignore = "writes into fuzz/corpus"]
fn write_mesh_seeds() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_meshes");
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, format, bytes) in common::meshes::mesh_fixtures() {
        let bare = format
            .trim_end_matches("-ascii")
            .trim_end_matches("-binary");
        let number = isoform_io::mesh_formats()
            .iter()
            .position(|f| f.name == bare)
            .expect("listed");
        let seed: Vec<u8> = [number as u8].into_iter().chain(bytes).collect();
        std::fs::write(folder.join(format!("seed-{name}")), seed).expect("written");
    }
}

/// Writes models of 3MF packages, which the target packs.
#[test]
#[ignore = "writes into fuzz/corpus"]
fn write_3mf_seeds() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_3mf");
    std::fs::create_dir_all(&folder).expect("a folder");
    let assembly = "<basematerials id=\"9\"><base name=\"steel\"/></basematerials><object \
        id=\"2\" pid=\"9\" pindex=\"0\"><components><component objectid=\"1\" \
        transform=\"-1 0 0 0 1 0 0 0 1 1 2 3\"/><component objectid=\"1\"/></components>\
        </object>";
    let resources = common::package::tetrahedron(1) + assembly;
    for (name, build) in [
        (
            "seed-assembly",
            "<item objectid=\"2\"/><item objectid=\"1\"/>",
        ),
        ("seed-nothing", ""),
    ] {
        let text = common::package::model(&resources, build);
        std::fs::write(folder.join(name), text).expect("written");
    }
    let text = crate::level_sets::seed();
    std::fs::write(folder.join("seed-level-sets"), text).expect("written");
}

/// Calls a function with the first byte and the rest of every file kept by fuzzing, some of which
/// are in the repository.
fn for_corpus(target: &str, visit: impl Fn(u8, &[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fuzz/corpus")
        .join(target);
    let mut visited = 0;
    for entry in std::fs::read_dir(folder).expect("the corpus") {
        let bytes = std::fs::read(entry.expect("readable").path()).expect("readable");
        if let Some((&first, rest)) = bytes.split_first() {
            visit(first, rest);
            visited += 1;
        }
    }
    assert!(visited > 0, "the corpus of {target} is empty");
}

/// Reads or refuses every file of the corpus, without a panic.
#[test]
fn the_corpus_survives() {
    for_corpus("read_points", |first, rest| {
        let format = isoform_io::formats()
            .get(usize::from(first & 15))
            .map(|f| f.name);
        let source = isoform_io::Source::Bytes {
            name: "seed",
            bytes: rest,
        };
        let _ = isoform_io::read(source, format, &isoform_io::ReadOptions::default());
    });
    for_corpus("read_3mf", |first, rest| {
        let text = [&[first], rest].concat();
        let bytes = common::package::package(&String::from_utf8_lossy(&text));
        let source = isoform_io::Source::Bytes {
            name: "seed",
            bytes: &bytes,
        };
        let _ = isoform_io::read_mesh(source, Some("3mf"), &Default::default());
        let _ = isoform_io::read_implicit(source);
    });
    for_corpus("read_meshes", |first, rest| {
        let format = isoform_io::mesh_formats()
            .get(usize::from(first & 15))
            .map(|f| f.name);
        let source = isoform_io::Source::Bytes {
            name: "seed",
            bytes: rest,
        };
        let _ = isoform_io::read_mesh(source, format, &isoform_io::MeshReadOptions::default());
    });
}
