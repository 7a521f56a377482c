//! Any bytes as a file of any format: an answer or an error. The first byte chooses the format, the
//! rest is the file.
//!
//! `cargo +nightly fuzz run read_points -- -rss_limit_mb=1024 -timeout=10`
#![no_main]

use isoform_io::{MeshPoints, ReadOptions, Source, formats, inspect, read};
use libfuzzer_sys::fuzz_target;
use std::sync::Once;

static QUIET: Once = Once::new();

fuzz_target!(|data: &[u8]| {
    // libfuzzer's hook aborts on every panic, also on those of laz and e57 that are caught and
    // become errors. Without it only panics that leave this function count.
    QUIET.call_once(|| std::panic::set_hook(Box::new(|_| {})));
    let Some((&first, rest)) = data.split_first() else {
        return;
    };
    let format = formats().get(usize::from(first & 15)).map(|f| f.name);
    let mut bytes = rest.to_vec();
    if format == Some("e57") {
        mend_e57(&mut bytes);
    }
    let options = match first >> 6 {
        0 => ReadOptions::default(),
        1 => ReadOptions {
            max_points: Some(5),
            ..ReadOptions::default()
        },
        2 => ReadOptions {
            mesh: MeshPoints::Samples(5),
            ..ReadOptions::default()
        },
        _ => ReadOptions {
            recenter: false,
            ..ReadOptions::default()
        },
    };
    if let Ok((cloud, report)) = read(
        Source::Bytes {
            name: "fuzz",
            bytes: &bytes,
        },
        format,
        &options,
    ) {
        let n = cloud.points.len();
        assert!(
            cloud
                .points
                .iter()
                .chain(&cloud.normals)
                .flatten()
                .all(|v| v.is_finite())
        );
        assert!(
            [cloud.normals.len(), cloud.colors.len()]
                .iter()
                .all(|&m| m == 0 || m == n)
        );
        assert!(cloud.columns.iter().all(|c| c.values.len() == n));
        assert!(cloud.triangles.iter().flatten().all(|&i| (i as usize) < n));
        if n < 1000 {
            inspect(&cloud, &report);
        }
    }
});

/// Checksums that are right, so that the rest of the reader is reached.
fn mend_e57(bytes: &mut [u8]) {
    for page in bytes.chunks_exact_mut(1024) {
        let mut crc = !0_u32;
        for &b in &page[..1020] {
            crc ^= u32::from(b);
            for _ in 0..8 {
                crc = crc >> 1 ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
            }
        }
        page[1020..].copy_from_slice(&(!crc).to_be_bytes());
    }
}
