//! Minimal reader of ZIP for 3MF packages (PKWARE, "APPNOTE.TXT", 4.3): members by name, stored or
//! deflated, decompressed as a stream.
//!
//! Names, sizes and positions are those of the central directory at the end of the file, including
//! its 64-bit extension (ZIP64). They are not trusted, and members may overlap: the total
//! decompressed size is bounded by the size of the file, and length and checksum of each member are
//! compared with the directory.

use crate::input::{Input, Result};
use crate::{At, ErrorKind};
use flate2::Crc;
use flate2::bufread::DeflateDecoder;
use std::io::{self, BufRead, BufReader, ErrorKind as Io, Read};

const PACKAGE_FAILURE: &str = "cannot read the package";
const PACKAGE_HINT: &str = "export the model again, or as STL or OBJ";
/// Size of the end record without its comment, and of the longest comment, in bytes.
const END_RECORD_BYTES: [u64; 2] = [22, 65_535];
/// Size of a directory entry and of a local header, without names and extra fields, in bytes.
const FIXED_HEADER_BYTES: [usize; 2] = [46, 30];
/// Maximum ratio of the total decompressed size to the size of the file. XML models need 5 to 30;
/// deflate reaches 1000 for a single repeated byte.
const MAX_EXPANSION_RATIO: u64 = 100;
/// Decompressed size allowed for any file, in bytes.
const MIN_EXPANSION_BYTES: u64 = 64 << 20;

/// Problem of a member; the reader of the file adds the position.
#[derive(Debug)]
pub(crate) struct Problem {
    pub(crate) kind: ErrorKind,
    pub(crate) why: String,
}

impl Problem {
    pub(crate) fn new(kind: ErrorKind, why: impl Into<String>) -> Self {
        let why = why.into();
        Self { kind, why }
    }
}

impl From<io::Error> for Problem {
    fn from(e: io::Error) -> Self {
        let kind = match e.kind() {
            Io::UnexpectedEof => ErrorKind::Truncated,
            _ => ErrorKind::Corrupt,
        };
        Self::new(kind, e.to_string())
    }
}

/// Member, as described by the directory.
#[derive(Debug, Default)]
struct ZipMember {
    name: String,
    /// Compression method: 0 for stored, 8 for deflated.
    method: u16,
    is_encrypted: bool,
    /// CRC-32 of the decompressed bytes.
    crc: u32,
    /// Compressed and decompressed size, in bytes.
    packed: u64,
    unpacked: u64,
    /// Position of the local header in the file.
    header: u64,
}

/// Directory of an archive.
#[derive(Debug)]
pub(crate) struct Archive {
    members: Vec<ZipMember>,
    /// Remaining number of bytes that members may decompress to.
    left: u64,
}

/// Decodes a little-endian number of two, four or eight bytes; 0 beyond the end.
fn number<const N: usize>(bytes: &[u8], at: usize) -> u64 {
    let some = bytes.get(at..at + N).unwrap_or(&[]);
    some.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b))
}

fn corrupt<T>(input: &Input<'_>, why: impl Into<String>) -> Result<T> {
    Err(input.error(
        ErrorKind::Corrupt,
        At::File,
        PACKAGE_FAILURE,
        why,
        PACKAGE_HINT,
    ))
}

impl Archive {
    /// Reads the directory.
    pub(crate) fn open(input: &mut Input<'_>) -> Result<Self> {
        let [count, size, start] = end_record(input)?;
        if start.checked_add(size).is_none_or(|end| end > input.size) {
            return Err(input.truncated("the list of its members lies beyond the end"));
        }
        input.seek(start)?;
        // The size is bounded by that of the file.
        let mut bytes = vec![0; size as usize];
        input.exact(&mut bytes, || "the list of its members is cut off".into())?;
        let mut rest = &bytes[..];
        let mut members = Vec::new();
        while members.len() < count as usize {
            let Some((member, length)) = entry(rest) else {
                return corrupt(input, "the list of its members is damaged");
            };
            members.push(member);
            rest = &rest[length..];
        }
        let left = input
            .size
            .saturating_mul(MAX_EXPANSION_RATIO)
            .max(MIN_EXPANSION_BYTES);
        Ok(Self { members, left })
    }

    /// Returns the exact name of a member, given its name in any case.
    pub(crate) fn find(&self, name: &str) -> Option<&str> {
        let mut names = self.names();
        names.find(|n| n.eq_ignore_ascii_case(name))
    }

    /// Returns the names of all members.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(|m| m.name.as_str())
    }

    /// Decompresses a member for `work`, which need not read all of it, and verifies the checksum.
    pub(crate) fn read<T>(
        &mut self,
        input: &mut Input<'_>,
        name: &str,
        work: impl FnOnce(&mut dyn BufRead) -> std::result::Result<T, Problem>,
    ) -> Result<T> {
        let Some(member) = self.members.iter().find(|m| m.name == name) else {
            return corrupt(input, format!("there is no member {name}"));
        };
        if member.is_encrypted || ![0, 8].contains(&member.method) {
            let why = format!("{name} is encrypted, or packed in another way than by deflate");
            return Err(input.error(
                ErrorKind::UnsupportedFormat,
                At::File,
                PACKAGE_FAILURE,
                why,
                PACKAGE_HINT,
            ));
        }
        let Some(left) = self.left.checked_sub(member.unpacked) else {
            let why = format!("{name} unpacks to far more than a model needs");
            return Err(input.error(
                ErrorKind::TooLarge,
                At::File,
                PACKAGE_FAILURE,
                why,
                PACKAGE_HINT,
            ));
        };
        self.left = left;
        go_to(input, member)?;
        let at = input.offset;
        let result = unpack(input, member, work);
        input.seek(at)?;
        result.map_err(|p| {
            let why = format!("{name}: {}", p.why);
            input.error(p.kind, At::File, PACKAGE_FAILURE, why, PACKAGE_HINT)
        })
    }
}

/// Seeks to the compressed bytes of a member, after its local header.
fn go_to(input: &mut Input<'_>, member: &ZipMember) -> Result<()> {
    let missing = || "a member lies beyond the end".to_owned();
    if member.header > input.size {
        return Err(input.truncated(missing()));
    }
    input.seek(member.header)?;
    let mut local = [0; FIXED_HEADER_BYTES[1]];
    input.exact(&mut local, missing)?;
    if !local.starts_with(b"PK\x03\x04") {
        return corrupt(input, "a member is not where the list says");
    }
    let behind = number::<2>(&local, 26) + number::<2>(&local, 28);
    input.skip(behind, missing)
}

/// Decompresses a member from the present position.
fn unpack<T>(
    input: &mut Input<'_>,
    member: &ZipMember,
    work: impl FnOnce(&mut dyn BufRead) -> std::result::Result<T, Problem>,
) -> std::result::Result<T, Problem> {
    let packed = input.stream().take(member.packed);
    let inner: Box<dyn Read + '_> = match member.method {
        0 => Box::new(packed),
        _ => Box::new(DeflateDecoder::new(packed)),
    };
    let counted = ChecksumReader {
        inner,
        crc: Crc::new(),
        count: 0,
        most: member.unpacked,
    };
    let mut reader = BufReader::new(counted);
    let made = work(&mut reader)?;
    io::copy(&mut reader, &mut io::sink())?;
    let ChecksumReader { crc, count, .. } = reader.into_inner();
    if count != member.unpacked || crc.sum() != member.crc {
        let why = "its length or its checksum is not what the package says";
        return Err(Problem::new(ErrorKind::Corrupt, why));
    }
    Ok(made)
}

/// Reader that counts the bytes and computes their checksum.
struct ChecksumReader<'r> {
    inner: Box<dyn Read + 'r>,
    crc: Crc,
    count: u64,
    /// Maximum count; more is an error.
    most: u64,
}

impl Read for ChecksumReader<'_> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(to)?;
        self.crc.update(&to[..n]);
        self.count += n as u64;
        if self.count > self.most {
            return Err(io::Error::other("it unpacks to more than the package says"));
        }
        Ok(n)
    }
}

/// Returns the number of members, and the size and position of the directory.
fn end_record(input: &mut Input<'_>) -> Result<[u64; 3]> {
    let tail = input.size.min(END_RECORD_BYTES[0] + END_RECORD_BYTES[1]);
    let start = input.size - tail;
    input.seek(start)?;
    let mut bytes = vec![0; tail as usize];
    input.exact(&mut bytes, || "its end is missing".into())?;
    let mark = bytes.windows(4).rposition(|w| w == b"PK\x05\x06");
    let mark = mark.filter(|at| bytes.len() - at >= END_RECORD_BYTES[0] as usize);
    let Some(at) = mark else {
        return Err(input.truncated("the list of its members is missing"));
    };
    let end = &bytes[at..];
    let found = [
        number::<2>(end, 10),
        number::<4>(end, 12),
        number::<4>(end, 16),
    ];
    let is_large = found[0] == u64::from(u16::MAX) || found[1..].contains(&u64::from(u32::MAX));
    // The locator of the 64-bit record directly precedes the end record.
    let locator = at.checked_sub(20).map(|l| &bytes[l..at]);
    let locator = locator.filter(|l| is_large && l.starts_with(b"PK\x06\x07"));
    let Some(locator) = locator else {
        return Ok(found);
    };
    let place = number::<8>(locator, 8);
    if place.checked_add(56).is_none_or(|end| end > input.size) {
        return Err(input.truncated("the list of its members lies beyond the end"));
    }
    input.seek(place)?;
    let mut large = [0; 56];
    input.exact(&mut large, || "its end is cut off".into())?;
    if !large.starts_with(b"PK\x06\x06") {
        return corrupt(input, "the list of its members is not where it says");
    }
    Ok([32, 40, 48].map(|at| number::<8>(&large, at)))
}

/// Parses the first entry of a directory, and returns it with its length in bytes.
fn entry(bytes: &[u8]) -> Option<(ZipMember, usize)> {
    if bytes.len() < FIXED_HEADER_BYTES[0] || !bytes.starts_with(b"PK\x01\x02") {
        return None;
    }
    let [name, extra, comment] = [28, 30, 32].map(|at| number::<2>(bytes, at) as usize);
    let length = FIXED_HEADER_BYTES[0] + name + extra + comment;
    let texts = bytes.get(FIXED_HEADER_BYTES[0]..length)?;
    let (name, rest) = texts.split_at(name);
    let mut member = ZipMember {
        name: String::from_utf8_lossy(name).into_owned(),
        is_encrypted: number::<2>(bytes, 8) & 1 > 0,
        method: number::<2>(bytes, 10) as u16,
        crc: number::<4>(bytes, 16) as u32,
        packed: number::<4>(bytes, 20),
        unpacked: number::<4>(bytes, 24),
        header: number::<4>(bytes, 42),
    };
    widen(&mut member, &rest[..extra]);
    Some((member, length))
}

/// Replaces numbers that need 64 bits by those in extra field 1, which lists, in this order, the
/// ones stored as all ones in the entry.
fn widen(member: &mut ZipMember, mut extra: &[u8]) {
    while extra.len() >= 4 {
        let (kind, length) = (number::<2>(extra, 0), number::<2>(extra, 2) as usize);
        let Some(field) = extra.get(4..4 + length) else {
            return;
        };
        if kind == 1 {
            let mut values = field.chunks_exact(8).map(|c| number::<8>(c, 0));
            for small in [&mut member.unpacked, &mut member.packed, &mut member.header] {
                if *small == u64::from(u32::MAX) {
                    *small = values.next().unwrap_or(*small);
                }
            }
        }
        extra = &extra[4 + length..];
    }
}
