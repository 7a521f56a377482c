//! Any text as the model of a 3MF package: a mesh, a program of level sets, or an error. The target
//! `read_meshes` gets no further than the checksums of packages; here they are right.
//!
//! `cargo +nightly fuzz run read_3mf -- -rss_limit_mb=2048 -timeout=10`
#![no_main]

use flate2::Crc;
use isoform_field::hyperfun::{Mode, Model};
use isoform_io::{MeshReadOptions, MeshWriteOptions, Source, read_implicit, read_mesh, write_mesh};
use libfuzzer_sys::fuzz_target;

const NAME: &[u8] = b"3D/3dmodel.model";

/// A ZIP archive of one stored member.
fn package(model: &[u8]) -> Vec<u8> {
    let mut crc = Crc::new();
    crc.update(model);
    let length = (model.len() as u32).to_le_bytes();
    let common = [
        &[20, 0, 0, 0, 0, 0, 0, 0, 0, 0][..],
        &crc.sum().to_le_bytes(),
        &length,
        &length,
        &[NAME.len() as u8, 0, 0, 0],
    ]
    .concat();
    let member = [b"PK\x03\x04", &common[..], NAME, model].concat();
    let directory = [b"PK\x01\x02\x14\0", &common[..], &[0; 14], NAME].concat();
    let end = [
        b"PK\x05\x06\0\0\0\0\x01\0\x01\0",
        &(directory.len() as u32).to_le_bytes()[..],
        &(member.len() as u32).to_le_bytes(),
        &[0; 2],
    ]
    .concat();
    [member, directory, end].concat()
}

fuzz_target!(|data: &[u8]| {
    let bytes = package(data);
    let source = Source::Bytes {
        name: "fuzz",
        bytes: &bytes,
    };
    if let Ok((mesh, _)) = read_mesh(source, Some("3mf"), &MeshReadOptions::default()) {
        // Indices and labels are checked before writing.
        let mut bytes = Vec::new();
        write_mesh(&mesh, &mut bytes, "3mf", &MeshWriteOptions::default()).expect("a mesh");
    }
    if let Ok(Some(program)) = read_implicit(source) {
        // What is read is HyperFun, unless it is too long for it.
        let model = Model::parse(&program.text, Mode::Default);
        assert!(
            model.is_ok() || program.text.len() > 1 << 26,
            "{}",
            program.text
        );
    }
});
