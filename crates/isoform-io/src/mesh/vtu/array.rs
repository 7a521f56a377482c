//! Arrays of a VTK file: text, base64 or raw bytes, uncompressed or deflated.
//!
//! Binary data are preceded by their size; compressed data consist of blocks, preceded by the
//! number and sizes of the blocks. Sizes in the file are not trusted: reading ends with the bytes
//! present, and decompression at the limit of [`ArrayCoding`].

use crate::binary::NumberType;
use crate::input::parse_number;
use flate2::read::ZlibDecoder;
use std::io::{self, Read};

/// Encoding of the arrays of a file.
#[derive(Clone, Copy)]
pub(super) struct ArrayCoding {
    /// True if numbers are big endian.
    pub(super) big_endian: bool,
    /// True if sizes have 64 bits instead of 32.
    pub(super) wide_header: bool,
    /// True if arrays are deflated in blocks.
    pub(super) zlib: bool,
    /// Maximum size of a decompressed array, in bytes.
    pub(super) limit: u64,
}

/// Decoded array.
pub(super) struct VtkArray {
    bytes: Vec<u8>,
    kind: NumberType,
    big_endian: bool,
}

impl VtkArray {
    /// Returns the number of values.
    pub(super) fn len(&self) -> usize {
        self.bytes.len() / self.kind.size()
    }
    /// Returns the size in bytes.
    pub(super) fn size(&self) -> u64 {
        self.bytes.len() as u64
    }
    /// Returns a value; 0 beyond the end.
    pub(super) fn get(&self, i: usize) -> f64 {
        match self.bytes.get(i * self.kind.size()..) {
            Some(bytes) if bytes.len() >= self.kind.size() => {
                self.kind.decode(bytes, self.big_endian)
            }
            _ => 0.0,
        }
    }
    /// Returns a value as a non-negative integer; `None` if it is not one.
    pub(super) fn index(&self, i: usize) -> Option<u64> {
        let v = self.get(i);
        (i < self.len() && v >= 0.0 && v.fract() == 0.0 && v <= 2f64.powi(53)).then_some(v as u64)
    }
    /// Returns the tag of a group; 0 beyond the end.
    pub(super) fn tag(&self, i: usize) -> i64 {
        self.get(i) as i64
    }
}

/// Parses numbers in text.
pub(super) fn from_text(text: &[u8]) -> Result<VtkArray, String> {
    let text = std::str::from_utf8(text).map_err(|_| "it is not text".to_owned())?;
    let mut bytes = Vec::new();
    for word in text.split_ascii_whitespace() {
        let v = parse_number(word)
            .ok_or_else(|| format!("\"{}\" is not a number", crate::input::shorten(word)))?;
        bytes.extend_from_slice(&v.to_le_bytes());
    }
    Ok(VtkArray {
        bytes,
        kind: NumberType::F64,
        big_endian: false,
    })
}

/// Decodes an array that follows its size, or compressed blocks that follow their sizes.
pub(super) fn from_bytes(
    source: impl Read,
    kind: NumberType,
    coding: ArrayCoding,
) -> Result<VtkArray, String> {
    let bytes = if coding.zlib {
        inflate(source, coding)
    } else {
        plain(source, coding)
    };
    let bytes = bytes.map_err(|e| e.to_string())?;
    Ok(VtkArray {
        bytes,
        kind,
        big_endian: coding.big_endian,
    })
}

/// Reads a size of 32 or 64 bits.
fn size(source: &mut impl Read, coding: ArrayCoding) -> io::Result<u64> {
    let mut bytes = [0; 8];
    let n = if coding.wide_header { 8 } else { 4 };
    source.read_exact(&mut bytes[..n])?;
    if coding.big_endian {
        bytes[..n].reverse();
    }
    Ok(u64::from_le_bytes(bytes))
}

/// Reads uncompressed bytes that follow their size.
fn plain(mut source: impl Read, coding: ArrayCoding) -> io::Result<Vec<u8>> {
    let n = size(&mut source, coding)?;
    let mut bytes = Vec::new();
    source.take(n).read_to_end(&mut bytes)?;
    if bytes.len() as u64 != n {
        return Err(io::Error::other(format!(
            "{} of {n} bytes are there",
            bytes.len()
        )));
    }
    Ok(bytes)
}

/// Decompresses an array. Its header is the number of blocks, the uncompressed size of all blocks
/// but the last, that of the last, and the compressed size of each.
fn inflate(mut source: impl Read, coding: ArrayCoding) -> io::Result<Vec<u8>> {
    let blocks = size(&mut source, coding)?;
    size(&mut source, coding)?;
    size(&mut source, coding)?;
    let mut sizes = Vec::new();
    for _ in 0..blocks {
        sizes.push(size(&mut source, coding)?);
    }
    let mut bytes = Vec::new();
    for n in sizes {
        let mut block = source.by_ref().take(n);
        let room = coding.limit.saturating_sub(bytes.len() as u64);
        ZlibDecoder::new(&mut block)
            .take(room + 1)
            .read_to_end(&mut bytes)?;
        if bytes.len() as u64 > coding.limit {
            return Err(io::Error::other(format!(
                "it unpacks to more than {} bytes, too many for this file",
                coding.limit
            )));
        }
        io::copy(&mut block, &mut io::sink())?;
    }
    Ok(bytes)
}

/// Streaming decoder of base64. Blanks are skipped; padding in the middle ends a piece, not the
/// stream.
pub(super) struct Base64<'b> {
    /// Remaining characters.
    text: &'b [u8],
    /// Decoded bytes, last byte first.
    ready: [u8; 3],
    /// Number of bytes in `ready` that are not yet read.
    count: usize,
}

impl<'b> Base64<'b> {
    pub(super) fn new(text: &'b [u8]) -> Self {
        Self {
            text,
            ready: [0; 3],
            count: 0,
        }
    }
    /// Decodes four characters; returns false at the end and at an invalid character.
    fn refill(&mut self) -> bool {
        let (mut bits, mut digits, mut seen) = (0_u32, 0, 0);
        while seen < 4 {
            let Some((&c, rest)) = self.text.split_first() else {
                break;
            };
            let digit = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => 64,
                b' ' | b'\t' | b'\r' | b'\n' => {
                    self.text = rest;
                    continue;
                }
                _ => break,
            };
            self.text = rest;
            seen += 1;
            bits <<= 6;
            if digit < 64 {
                bits |= u32::from(digit);
                digits += 1;
            }
        }
        if seen < 4 || digits < 2 {
            return false;
        }
        let [_, a, b, c] = bits.to_be_bytes();
        self.count = digits - 1;
        // Reversed, because `read` takes the bytes from the end.
        self.ready = match self.count {
            1 => [a, 0, 0],
            2 => [b, a, 0],
            _ => [c, b, a],
        };
        true
    }
}

impl Read for Base64<'_> {
    /// Decodes as many bytes as fit.
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let mut n = 0;
        while n < to.len() && (self.count > 0 || self.refill()) {
            self.count -= 1;
            to[n] = self.ready[self.count];
            n += 1;
        }
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(text: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        Base64::new(text.as_bytes())
            .read_to_end(&mut bytes)
            .expect("never fails");
        bytes
    }

    #[test]
    fn base64() {
        assert_eq!(decoded("aGVsbG8gd29ybGQ="), b"hello world");
        assert_eq!(decoded(" aGVs\nbG8= IQ== \n"), b"hello!");
        assert_eq!(decoded("aGVsb"), b"hel");
        assert_eq!(decoded("====<"), b"");
    }

    #[test]
    fn sizes_are_not_believed() {
        let coding = ArrayCoding {
            big_endian: false,
            wide_header: true,
            zlib: false,
            limit: 1000,
        };
        assert!(from_bytes(&[0xff; 20][..], NumberType::U8, coding).is_err());
        assert!(
            from_bytes(
                &[0xff; 20][..],
                NumberType::U8,
                ArrayCoding {
                    zlib: true,
                    ..coding
                }
            )
            .is_err()
        );
        let mut bomb = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        io::Write::write_all(&mut bomb, &[0; 2000]).expect("memory");
        let bomb = bomb.finish().expect("memory");
        let file: Vec<u8> = [1, 2000, 2000, bomb.len() as u64]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .chain(bomb)
            .collect();
        assert!(
            from_bytes(
                &file[..],
                NumberType::U8,
                ArrayCoding {
                    zlib: true,
                    ..coding
                }
            )
            .is_err()
        );
        let enough = ArrayCoding {
            zlib: true,
            limit: 2000,
            ..coding
        };
        assert_eq!(
            from_bytes(&file[..], NumberType::U8, enough)
                .expect("fits")
                .len(),
            2000
        );
    }
}
