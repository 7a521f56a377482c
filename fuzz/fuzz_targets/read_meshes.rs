//! Any bytes as a mesh of any format: a mesh or an error. The first byte chooses the format, the
//! rest is the file.
//!
//! `cargo +nightly fuzz run read_meshes -- -rss_limit_mb=1024 -timeout=10`
#![no_main]

use isoform_io::{MeshReadOptions, MeshWriteOptions, Source, mesh_formats, read_mesh, write_mesh};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&first, rest)) = data.split_first() else {
        return;
    };
    let format = mesh_formats().get(usize::from(first & 15)).map(|f| f.name);
    let options = MeshReadOptions {
        boundary: first & 128 == 0,
    };
    if let Ok((mesh, _)) = read_mesh(
        Source::Bytes {
            name: "fuzz",
            bytes: rest,
        },
        format,
        &options,
    ) {
        // What was read is a mesh: indices and labels are checked before writing, and what is
        // written reads back the same.
        let mut bytes = Vec::new();
        write_mesh(&mesh, &mut bytes, "vtu", &MeshWriteOptions::default()).expect("a mesh");
        let source = Source::Bytes {
            name: "again",
            bytes: &bytes,
        };
        let (again, _) = read_mesh(source, Some("vtu"), &MeshReadOptions { boundary: false })
            .expect("our own file");
        assert_eq!(
            (again.points, again.triangles, again.tets),
            (mesh.points, mesh.triangles, mesh.tets)
        );
    }
});
