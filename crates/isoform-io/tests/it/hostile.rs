//! Damaged and malicious files: reading gives a result or an error in bounded time, and never
//! panics.

use crate::common;
use crate::common::damage::{apply, damage};
use isoform_io::{MeshPoints, ReadOptions, Source, inspect, read};
use proptest::prelude::*;
use std::time::{Duration, Instant};

/// Time limit per file: far above the time that any of them takes, far below that of a hang.
const SOON: Duration = Duration::from_secs(5);

/// Fragments of tables: names, units, quotes, numbers, words and separators.
const FIELDS: &[&str] = &[
    "x",
    "Y [mm]",
    "z",
    "Point ID",
    "n",
    "e",
    "nx",
    "[mm]",
    "mm",
    "(",
    "\"",
    "\"\"",
    "\"1,5\"",
    "\"a;b",
    "1",
    "2",
    "3",
    "1,5",
    "-2.5e3",
    "nan",
    "P1",
    "é",
    "坐标",
    "#",
    "//",
    ",",
    ",",
    ";",
    ";",
    "\t",
    " ",
    " ",
    "\n",
    "\n",
    "\n",
    "x,y,z\n",
    "1,2,3\n",
    "P1,1,2,3\n",
    "1 2 3 4\n",
    "2 2.5 3 4\n",
    "3 3 3 3.5\n",
];

fn survive(name: &str, format: Option<&str>, bytes: &[u8]) {
    let start = Instant::now();
    for options in [
        ReadOptions {
            max_points: Some(3),
            ..ReadOptions::default()
        },
        ReadOptions {
            mesh: MeshPoints::Samples(5),
            ..ReadOptions::default()
        },
        ReadOptions::default(),
    ] {
        match read(Source::Bytes { name, bytes }, format, &options) {
            Ok((cloud, report)) => {
                assert!(
                    cloud.points.iter().flatten().all(|v| v.is_finite()),
                    "{name}"
                );
                assert!(
                    cloud.normals.iter().flatten().all(|v| v.is_finite()),
                    "{name}"
                );
                assert!(
                    cloud
                        .triangles
                        .iter()
                        .flatten()
                        .all(|&i| (i as usize) < cloud.points.len()),
                    "{name}"
                );
                inspect(&cloud, &report);
            }
            Err(e) => assert!(
                !e.why.is_empty() && !e.hint.is_empty() && !e.code().is_empty(),
                "{name}"
            ),
        }
    }
    assert!(start.elapsed() < SOON, "{name} took {:?}", start.elapsed());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files(damages in prop::collection::vec(damage(), 1..4)) {
        for (name, mut bytes) in common::fixtures() {
            damages.iter().for_each(|d| apply(&mut bytes, d));
            if name.ends_with(".e57") {
                // Once unchanged, once with corrected checksums.
                survive(name, Some("e57"), &bytes);
                common::mend_e57(&mut bytes);
            }
            let format = name.rsplit('.').next();
            survive(name, format, &bytes);
            survive(name, None, &bytes);
        }
    }

    #[test]
    fn noise(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        for format in isoform_io::formats() {
            survive("noise", Some(format.name), &bytes);
        }
        survive("noise", None, &bytes);
    }

    #[test]
    fn tables(fields in prop::collection::vec(prop::sample::select(FIELDS), 0..60)) {
        for format in ["xyz", "csv"] {
            survive("table", Some(format), fields.concat().as_bytes());
        }
        survive("table.pts", None, fields.concat().as_bytes());
        survive("-", None, fields.concat().as_bytes());
    }

    #[test]
    fn text(text in "[-0-9 .,;enaN#/\n\t\"xyz]{0,200}") {
        for format in ["xyz", "csv", "obj", "off", "stl", "ply", "pcd"] {
            survive("text", Some(format), text.as_bytes());
        }
        survive("text.pts", None, text.as_bytes());
    }
}

#[test]
fn every_prefix_of_every_file() {
    for (name, bytes) in common::fixtures() {
        let step = 1 + bytes.len() / 500;
        for n in (0..bytes.len()).step_by(step) {
            survive(name, name.rsplit('.').next(), &bytes[..n]);
        }
    }
}

#[test]
fn every_byte_of_the_binary_headers() {
    for (name, bytes) in common::fixtures().into_iter().filter(|f| {
        ["las", "laz", "e57", "pcd", "stl"]
            .iter()
            .any(|e| f.0.ends_with(e))
    }) {
        // The decoder of LAZ takes milliseconds to start; therefore only the header and its records
        // are changed, to two values.
        let is_laz = name.ends_with("laz");
        for at in 0..bytes.len().min(if is_laz { 340 } else { 700 }) {
            for value in if is_laz {
                &[0, 0xff][..]
            } else {
                &[0, 1, 0x7f, 0x80, 0xff]
            } {
                let mut changed = bytes.clone();
                changed[at] = *value;
                if name.ends_with("e57") {
                    common::mend_e57(&mut changed);
                }
                survive(name, name.rsplit('.').next(), &changed);
            }
        }
    }
}

#[test]
fn one_endless_line() {
    // More than the limit of 16 MiB.
    for byte in [b' ', b'1', b','] {
        let bytes = vec![byte; 17 << 20];
        for format in ["xyz", "ply", "off", "obj", "stl", "pcd"] {
            let start = Instant::now();
            let _ = read(
                Source::Bytes {
                    name: "line",
                    bytes: &bytes,
                },
                Some(format),
                &ReadOptions::default(),
            );
            assert!(start.elapsed() < SOON, "{format}");
        }
    }
}

#[cfg(feature = "e57")]
#[test]
fn e57_without_bits_and_with_deep_xml() {
    let sealed = |xml: &str| {
        let mut logical = vec![0; 48];
        logical[..8].copy_from_slice(b"ASTM-E57");
        logical[8] = 1;
        // A compressed vector section at 48 whose data start at 80: one packet with one empty
        // stream.
        logical.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        for v in [48_u64, 80, 0] {
            logical.extend(v.to_le_bytes());
        }
        logical.extend([1, 0, 11, 0, 1, 0, 0, 0, 0, 0, 0, 0]);
        let start = logical.len();
        logical.extend(xml.as_bytes());
        logical.resize(logical.len().div_ceil(1020) * 1020, b' ');
        let physical = (logical.len() / 1020 * 1024) as u64;
        logical[16..24].copy_from_slice(&physical.to_le_bytes());
        logical[24..32].copy_from_slice(&(start as u64).to_le_bytes());
        logical[32..40].copy_from_slice(&(xml.len() as u64).to_le_bytes());
        logical[40..48].copy_from_slice(&1024_u64.to_le_bytes());
        let mut bytes: Vec<u8> = logical
            .chunks(1020)
            .flat_map(|c| c.iter().copied().chain([0; 4]))
            .collect();
        common::mend_e57(&mut bytes);
        bytes
    };
    let file = |fields: &str| {
        sealed(&format!(
            "<?xml version=\"1.0\"?><e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\"><formatName \
             type=\"String\">ASTM E57 3D Imaging Data File</formatName><guid type=\"String\">a</guid><versionMajor type=\"Integer\">1\
             </versionMajor><data3D type=\"Vector\"><vectorChild type=\"Structure\"><guid type=\"String\">b</guid><points \
             type=\"CompressedVector\" fileOffset=\"48\" recordCount=\"999999999999\"><prototype type=\"Structure\">{fields}</prototype>\
             </points></vectorChild></data3D></e57Root>"
        ))
    };
    let field =
        |axis: &str| format!("<cartesian{axis} type=\"Integer\" minimum=\"5\" maximum=\"5\"/>");
    let bytes = file(&["X", "Y", "Z"].map(field).concat());
    let e = read(
        Source::Bytes {
            name: "a.e57",
            bytes: &bytes,
        },
        None,
        &ReadOptions::default(),
    )
    .expect_err("no data");
    assert!(e.why.contains("no fields"), "{e}");
    let deep = format!("{}{}", "<a>".repeat(200_000), "</a>".repeat(200_000));
    survive("deep.e57", None, &sealed(&deep));
    survive("deep.e57", None, &file(&deep));
}

/// A LAZ file whose second point switches between its series of GPS times half a million times;
/// `laz` recurses at each switch.
#[cfg(feature = "laz")]
#[test]
fn laz_that_recurses_without_end() {
    use laz::las::v2::LasPoint0Compressor;
    use laz::models::ArithmeticModelBuilder;
    use laz::record::FieldCompressor;
    let file = common::las_file(1, true, 2);
    let start = u32::from_le_bytes([96, 97, 98, 99].map(|i| file[i])) as usize;
    let mut bytes = file[..start + 8].to_vec();
    bytes[start..].fill(0);
    let mut point = LasPoint0Compressor::default();
    let mut first = Vec::new();
    point.compress_first(&mut first, &[0; 20]).expect("memory");
    bytes.extend(first);
    bytes.extend([0; 8]);
    let mut encoder = laz::encoders::ArithmeticEncoder::new(Vec::new());
    point.compress_with(&mut encoder, &[0; 20]).expect("memory");
    let mut model = ArithmeticModelBuilder::new(6).build();
    for _ in 0..500_000 {
        encoder.encode_symbol(&mut model, 3).expect("memory");
    }
    encoder.done().expect("memory");
    bytes.extend(encoder.into_inner());
    // The offset of a chunk table, and one without chunks.
    bytes.extend([0; 64]);
    let table = (bytes.len() as u64).to_le_bytes();
    bytes[start..start + 8].copy_from_slice(&table);
    bytes.extend([0; 8]);
    // The compiler may turn the recursive call into a tail call: then the file has two points, else
    // it is an error, but never an abort.
    match read(
        Source::Bytes {
            name: "a.laz",
            bytes: &bytes,
        },
        None,
        &ReadOptions::default(),
    ) {
        Ok((cloud, _)) => assert_eq!(cloud.points.len(), 2),
        Err(e) => assert!(e.why.contains("damaged"), "{e}"),
    }
}
