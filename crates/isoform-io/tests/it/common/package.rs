//! 3MF packages built byte by byte, to test the reader independently of the writer.

use flate2::{Compression, Crc, write::DeflateEncoder};
use std::io::Write;

/// Variant of a package's encoding.
#[derive(Clone, Copy, Default)]
pub(crate) struct Packing {
    pub(crate) is_deflated: bool,
    /// True if sizes and positions are stored in 64-bit fields only.
    pub(crate) is_zip64: bool,
}

/// Relationships that lead to the usual model.
pub(crate) const RELATIONS: &str = "<Relationships xmlns=\"http://schemas.openxmlformats.org/\
    package/2006/relationships\"><Relationship Target=\"/3D/3dmodel.model\" Id=\"r\" \
    Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";

/// Returns a package of one stored model.
pub(crate) fn package(model: &str) -> Vec<u8> {
    let members = [("_rels/.rels", RELATIONS), ("3D/3dmodel.model", model)];
    packed(&members, Packing::default())
}

/// Returns a package that builds the object with number 1.
pub(crate) fn built(object: &str) -> Vec<u8> {
    package(&model(object, "<item objectid=\"1\"/>"))
}

/// Returns a package of members.
pub(crate) fn packed(members: &[(&str, &str)], packing: Packing) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, text) in members {
        let start = bytes.len() as u64;
        let mut crc = Crc::new();
        crc.update(text.as_bytes());
        let data = if packing.is_deflated {
            let mut deflate = DeflateEncoder::new(Vec::new(), Compression::best());
            deflate.write_all(text.as_bytes()).expect("memory");
            deflate.finish().expect("memory")
        } else {
            text.as_bytes().to_vec()
        };
        let sizes = [data.len() as u64, text.len() as u64];
        let method = if packing.is_deflated { 8_u16 } else { 0 };
        let common = |bytes: &mut Vec<u8>, extra: usize| {
            bytes.extend(20_u16.to_le_bytes());
            bytes.extend([0; 2]);
            bytes.extend(method.to_le_bytes());
            bytes.extend([0; 4]);
            bytes.extend(crc.sum().to_le_bytes());
            for size in sizes {
                let size = if packing.is_zip64 {
                    u32::MAX
                } else {
                    size as u32
                };
                bytes.extend(size.to_le_bytes());
            }
            bytes.extend((name.len() as u16).to_le_bytes());
            bytes.extend((extra as u16).to_le_bytes());
        };
        bytes.extend(b"PK\x03\x04");
        common(&mut bytes, 0);
        bytes.extend(name.as_bytes());
        bytes.extend(data);
        let extra: Vec<u8> = if packing.is_zip64 {
            // A field of another kind, then field 1: decompressed size, compressed size, start.
            let head = [9_u16, 3].map(u16::to_le_bytes).concat();
            let kind = [1_u16, 24].map(u16::to_le_bytes).concat();
            let wide = [sizes[1], sizes[0], start].map(u64::to_le_bytes).concat();
            [&head[..], b"xyz", &kind, &wide].concat()
        } else {
            Vec::new()
        };
        directory.extend(b"PK\x01\x02\x14\0");
        common(&mut directory, extra.len());
        directory.extend([0; 10]);
        let start = if packing.is_zip64 {
            u32::MAX
        } else {
            start as u32
        };
        directory.extend(start.to_le_bytes());
        directory.extend(name.as_bytes());
        directory.extend(extra);
    }
    end(&mut bytes, &directory, members.len() as u64, packing);
    bytes
}

/// Writes the directory and the end records.
fn end(bytes: &mut Vec<u8>, directory: &[u8], count: u64, packing: Packing) {
    let start = bytes.len() as u64;
    bytes.extend(directory);
    let large = bytes.len() as u64;
    let size = directory.len() as u64;
    if packing.is_zip64 {
        bytes.extend(b"PK\x06\x06");
        bytes.extend(44_u64.to_le_bytes());
        bytes.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        for n in [count, count, size, start] {
            bytes.extend(n.to_le_bytes());
        }
        bytes.extend(b"PK\x06\x07\0\0\0\0");
        bytes.extend(large.to_le_bytes());
        bytes.extend(1_u32.to_le_bytes());
    }
    let small = |n: u64| if packing.is_zip64 { u32::MAX } else { n as u32 };
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    for _ in 0..2 {
        bytes.extend((small(count) as u16).to_le_bytes());
    }
    bytes.extend(small(size).to_le_bytes());
    bytes.extend(small(start).to_le_bytes());
    bytes.extend([0; 2]);
}

/// Returns a model with these resources and items, in millimetres.
pub(crate) fn model(resources: &str, build: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model unit=\"millimeter\" xmlns=\"http://\
         schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources>{resources}</resources>\
         <build>{build}</build></model>"
    )
}

/// Returns a tetrahedron as an object with this number.
pub(crate) fn tetrahedron(id: u32) -> String {
    let vertices: String = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"]
        .map(|p| {
            let p: Vec<&str> = p.split(' ').collect();
            format!("<vertex x=\"{}\" y=\"{}\" z=\"{}\"/>\n", p[0], p[1], p[2])
        })
        .concat();
    let triangles: String = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
        .map(|[a, b, c]| format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>\n"))
        .concat();
    format!(
        "<object id=\"{id}\" type=\"model\"><mesh><vertices>{vertices}</vertices><triangles>\
         {triangles}</triangles></mesh></object>\n"
    )
}
