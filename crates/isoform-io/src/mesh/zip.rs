//! Minimal writer of ZIP for 3MF packages: compressed members, streamed (PKWARE, "APPNOTE.TXT",
//! 4.3).
//!
//! A member is a local header, its compressed bytes, and a data descriptor with checksum and sizes,
//! which are known only at the end. The central directory repeats all headers at the end of the
//! file. Sizes have 32 bits.

use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};
use std::io::{self, Write};

/// Compression method 8: deflate.
const DEFLATE_METHOD: u16 = 8;
/// General flags: sizes and checksum follow the member (bit 3); names are UTF-8 (bit 11).
const MEMBER_FLAGS: u16 = 1 << 3 | 1 << 11;
/// Date of every member: 1 January 1980, the earliest date that ZIP can store. A fixed date makes
/// the output reproducible.
const MEMBER_DATE: u16 = 1 << 5 | 1;

/// Sink that counts the bytes written.
struct CountingWriter<'o> {
    out: &'o mut dyn Write,
    /// Number of bytes written.
    count: u64,
}

impl Write for CountingWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.out.write(bytes)?;
        self.count += n as u64;
        Ok(n)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Sink of a member: computes checksum and length, and compresses.
struct MemberWriter<'d, W: Write> {
    deflate: &'d mut DeflateEncoder<W>,
    /// CRC-32 of the uncompressed bytes.
    crc: Crc,
    /// Number of uncompressed bytes.
    length: u64,
}

impl<W: Write> Write for MemberWriter<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.deflate.write(bytes)?;
        self.crc.update(&bytes[..n]);
        self.length += n as u64;
        Ok(n)
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writer of an archive, member by member.
pub(super) struct Zip<'o> {
    out: CountingWriter<'o>,
    /// Central directory so far.
    directory: Vec<u8>,
    /// Number of members so far.
    members: u16,
}

/// Returns the error for a package whose sizes exceed 32 bits.
fn too_large(_: std::num::TryFromIntError) -> io::Error {
    io::Error::other("a ZIP package holds at most 4 GiB")
}

impl<'o> Zip<'o> {
    pub(super) fn new(out: &'o mut dyn Write) -> Self {
        Self {
            out: CountingWriter { out, count: 0 },
            directory: Vec::new(),
            members: 0,
        }
    }

    /// Adds a member whose content is written by a function.
    pub(super) fn member(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<()> {
        let start = u32::try_from(self.out.count).map_err(too_large)?;
        // Version 2.0, flags, method, time and date.
        let common: Vec<u8> = [20, MEMBER_FLAGS, DEFLATE_METHOD, 0, MEMBER_DATE]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let name_length = (name.len() as u16).to_le_bytes();
        self.out.write_all(b"PK\x03\x04")?;
        self.out.write_all(&common)?;
        self.out.write_all(&[0; 12])?;
        self.out.write_all(&name_length)?;
        self.out.write_all(&[0; 2])?;
        self.out.write_all(name.as_bytes())?;
        let sizes = self.deflated(write)?;
        self.out.write_all(b"PK\x07\x08")?;
        self.out.write_all(&sizes)?;
        // The directory repeats these fields, without extra fields, comment, disk and attributes.
        for bytes in [
            b"PK\x01\x02\x14\0",
            &common[..],
            &sizes,
            &name_length,
            &[0; 12],
            &start.to_le_bytes(),
            name.as_bytes(),
        ] {
            self.directory.extend_from_slice(bytes);
        }
        self.members += 1;
        Ok(())
    }

    /// Writes the compressed bytes of a member, and returns its data descriptor: CRC-32, compressed
    /// and uncompressed length.
    fn deflated(
        &mut self,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<Vec<u8>> {
        let before = self.out.count;
        let mut deflate = DeflateEncoder::new(&mut self.out, Compression::fast());
        let mut member = MemberWriter {
            deflate: &mut deflate,
            crc: Crc::new(),
            length: 0,
        };
        write(&mut member)?;
        let (crc, length) = (member.crc.sum(), member.length);
        deflate.finish()?;
        let packed = u32::try_from(self.out.count - before).map_err(too_large)?;
        let length = u32::try_from(length).map_err(too_large)?;
        Ok([crc, packed, length]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect())
    }

    /// Writes the central directory.
    pub(super) fn finish(mut self) -> io::Result<()> {
        let start = u32::try_from(self.out.count).map_err(too_large)?;
        self.out.write_all(&self.directory)?;
        self.out.write_all(b"PK\x05\x06\0\0\0\0")?;
        for n in [self.members, self.members] {
            self.out.write_all(&n.to_le_bytes())?;
        }
        for n in [self.directory.len() as u32, start] {
            self.out.write_all(&n.to_le_bytes())?;
        }
        self.out.write_all(&[0; 2])
    }
}
