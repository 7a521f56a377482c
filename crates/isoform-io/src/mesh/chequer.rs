//! Chequered texture as PNG, which makes the parameter lines of a surface visible.

use flate2::write::ZlibEncoder;
use flate2::{Compression, Crc};
use std::io::Write;

/// Number of fields along each side.
const FIELDS_PER_SIDE: usize = 8;
/// Grey values of the fields.
const FIELD_GREYS: [u8; 2] = [255, 150];

/// Returns the texture with one pixel per field, in 8-bit grey.
pub(super) fn png() -> Vec<u8> {
    let mut rows = Vec::new();
    for i in 0..FIELDS_PER_SIDE {
        // Each row begins with the number of its filter: 0, none.
        rows.push(0);
        rows.extend((0..FIELDS_PER_SIDE).map(|j| FIELD_GREYS[(i + j) % 2]));
    }
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&rows).expect("memory takes all");
    let size = (FIELDS_PER_SIDE as u32).to_be_bytes();
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    chunk(
        &mut png,
        b"IHDR",
        &[&size[..], &size, &[8, 0, 0, 0, 0]].concat(),
    );
    chunk(
        &mut png,
        b"IDAT",
        &packed.finish().expect("memory takes all"),
    );
    chunk(&mut png, b"IEND", &[]);
    png
}

/// Appends a PNG chunk: length, kind, data, CRC-32 of kind and data.
fn chunk(png: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    let mut crc = Crc::new();
    crc.update(kind);
    crc.update(data);
    png.extend((data.len() as u32).to_be_bytes());
    png.extend(kind);
    png.extend(data);
    png.extend(crc.sum().to_be_bytes());
}
