//! As much of reading ZIP as a 3MF package needs (PKWARE, "APPNOTE.TXT", 4.3): members by their
//! names, stored or deflated, unpacked as a stream.
//!
//! Names, sizes and places are those of the central directory at the end of the file, with its
//! extension to 64 bits (ZIP64). A directory can claim anything, and members may share their bytes:
//! what all members unpack to is bounded by the size of the file, and length and checksum of each
//! are compared with what the directory says.

use crate::input::{Input, Result};
use crate::{At, ErrorKind};
use flate2::Crc;
use flate2::bufread::DeflateDecoder;
use std::io::{self, BufRead, BufReader, ErrorKind as Io, Read};

/// What failed, as the errors of this reader say.
const WHAT: &str = "cannot read the package";
/// What to try.
const HINT: &str = "export the model again, or as STL or OBJ";
/// Bytes of the end record without its comment, and of the longest comment.
const END: [u64; 2] = [22, 65_535];
/// Bytes of an entry of the directory and of a local header without names and extra fields.
const FIXED: [usize; 2] = [46, 30];
/// Members may unpack to this many times the size of the file in all. Models in XML need 5 to 30;
/// deflate reaches 1000 where nothing but one byte is repeated.
const RATIO: u64 = 100;
/// Bytes that members may unpack to whatever the size of the file.
const FLOOR: u64 = 64 << 20;

/// What is wrong in a member; the reader of the file adds where.
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

/// A member, as the directory has it.
#[derive(Debug, Default)]
struct Member {
    name: String,
    /// 0 for stored, 8 for deflated.
    method: u16,
    is_encrypted: bool,
    /// CRC-32 of the unpacked bytes.
    crc: u32,
    /// Numbers of bytes.
    packed: u64,
    unpacked: u64,
    /// Where its local header begins.
    header: u64,
}

/// The directory of an archive.
#[derive(Debug)]
pub(crate) struct Archive {
    members: Vec<Member>,
    /// Bytes that members may still unpack to.
    left: u64,
}

/// A number in two, four or eight bytes, the lowest first; 0 behind the end.
fn number<const N: usize>(bytes: &[u8], at: usize) -> u64 {
    let some = bytes.get(at..at + N).unwrap_or(&[]);
    some.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b))
}

fn corrupt<T>(input: &Input<'_>, why: impl Into<String>) -> Result<T> {
    Err(input.error(ErrorKind::Corrupt, At::File, WHAT, why, HINT))
}

impl Archive {
    /// Reads the directory.
    pub(crate) fn open(input: &mut Input<'_>) -> Result<Self> {
        let [count, size, start] = end_record(input)?;
        if start.checked_add(size).is_none_or(|end| end > input.size) {
            return Err(input.truncated("the list of its members lies beyond the end"));
        }
        input.seek(start)?;
        // No more than the file has.
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
        let left = input.size.saturating_mul(RATIO).max(FLOOR);
        Ok(Self { members, left })
    }

    /// The name, as it is written there, of a member that is called so but for capitals.
    pub(crate) fn find(&self, name: &str) -> Option<&str> {
        let mut names = self.names();
        names.find(|n| n.eq_ignore_ascii_case(name))
    }

    /// The names of all members.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.members.iter().map(|m| m.name.as_str())
    }

    /// Lets `work` read the bytes of a member, of which it may leave some, and compares them all
    /// with the checksum.
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
            return Err(input.error(ErrorKind::UnsupportedFormat, At::File, WHAT, why, HINT));
        }
        let Some(left) = self.left.checked_sub(member.unpacked) else {
            let why = format!("{name} unpacks to far more than a model needs");
            return Err(input.error(ErrorKind::TooLarge, At::File, WHAT, why, HINT));
        };
        self.left = left;
        go_to(input, member)?;
        let at = input.offset;
        let result = unpack(input, member, work);
        input.seek(at)?;
        result.map_err(|p| {
            let why = format!("{name}: {}", p.why);
            input.error(p.kind, At::File, WHAT, why, HINT)
        })
    }
}

/// Goes to the packed bytes of a member, behind its local header.
fn go_to(input: &mut Input<'_>, member: &Member) -> Result<()> {
    let missing = || "a member lies beyond the end".to_owned();
    if member.header > input.size {
        return Err(input.truncated(missing()));
    }
    input.seek(member.header)?;
    let mut local = [0; FIXED[1]];
    input.exact(&mut local, missing)?;
    if !local.starts_with(b"PK\x03\x04") {
        return corrupt(input, "a member is not where the list says");
    }
    let behind = number::<2>(&local, 26) + number::<2>(&local, 28);
    input.skip(behind, missing)
}

/// Unpacks a member whose bytes come next.
fn unpack<T>(
    input: &mut Input<'_>,
    member: &Member,
    work: impl FnOnce(&mut dyn BufRead) -> std::result::Result<T, Problem>,
) -> std::result::Result<T, Problem> {
    let packed = input.stream().take(member.packed);
    let inner: Box<dyn Read + '_> = match member.method {
        0 => Box::new(packed),
        _ => Box::new(DeflateDecoder::new(packed)),
    };
    let counted = Counted {
        inner,
        crc: Crc::new(),
        count: 0,
        most: member.unpacked,
    };
    let mut reader = BufReader::new(counted);
    let made = work(&mut reader)?;
    io::copy(&mut reader, &mut io::sink())?;
    let Counted { crc, count, .. } = reader.into_inner();
    if count != member.unpacked || crc.sum() != member.crc {
        let why = "its length or its checksum is not what the package says";
        return Err(Problem::new(ErrorKind::Corrupt, why));
    }
    Ok(made)
}

/// Counts and sums up what passes.
struct Counted<'r> {
    inner: Box<dyn Read + 'r>,
    crc: Crc,
    count: u64,
    /// More than this is a fault.
    most: u64,
}

impl Read for Counted<'_> {
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

/// Number of members, and bytes and start of the directory.
fn end_record(input: &mut Input<'_>) -> Result<[u64; 3]> {
    let tail = input.size.min(END[0] + END[1]);
    let start = input.size - tail;
    input.seek(start)?;
    let mut bytes = vec![0; tail as usize];
    input.exact(&mut bytes, || "its end is missing".into())?;
    let mark = bytes.windows(4).rposition(|w| w == b"PK\x05\x06");
    let mark = mark.filter(|at| bytes.len() - at >= END[0] as usize);
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
    // The locator of the 64-bit record stands right before.
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

/// The first entry of a directory, and its length in bytes.
fn entry(bytes: &[u8]) -> Option<(Member, usize)> {
    if bytes.len() < FIXED[0] || !bytes.starts_with(b"PK\x01\x02") {
        return None;
    }
    let [name, extra, comment] = [28, 30, 32].map(|at| number::<2>(bytes, at) as usize);
    let length = FIXED[0] + name + extra + comment;
    let texts = bytes.get(FIXED[0]..length)?;
    let (name, rest) = texts.split_at(name);
    let mut member = Member {
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

/// Takes numbers that need 64 bits from the extra field 1: those that stand as all ones in the
/// entry itself, in this order.
fn widen(member: &mut Member, mut extra: &[u8]) {
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
