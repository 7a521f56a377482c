//! LAZ: the checks that make `laz` safe on any bytes, and the loop around it.
//!
//! `laz` trusts the file: it reserves memory for as many chunks as are announced, for layers of any
//! announced size, and panics on item lists that contradict themselves. So the item list, the chunk
//! table's length and all layer sizes are compared with the length of the file before it is called.
//! What may still panic in its arithmetic decoder is caught and reported as damage.

use super::{Header, corrupt, u32_at};
use crate::input::{Input, Result};
use crate::{At, ErrorKind};
use laz::laszip::{ChunkTable, CompressorType};
use laz::{DecompressionSelection, LasZipDecompressor, LazItem, LazItemType, LazVlr};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Points that one byte of LAZ can stand for. Real files have at most a few; a run of equal points
/// may have some hundred. More would let a small file announce points without end.
const POINTS_PER_BYTE: u64 = 1000;
/// Stack of the thread; it takes memory only as far as it is used.
const STACK: usize = 256 << 20;
const MAX_DEPTH: usize = 32 << 20;
/// Points that are unpacked at a time.
const BATCH: u64 = 1024;

/// Size the item should have, and the number of its layers (0 for the versions without).
fn expected(item: &LazItem) -> (u16, u64) {
    match item.item_type() {
        LazItemType::Byte(n) => (n, 0),
        LazItemType::Point10 => (20, 0),
        LazItemType::GpsTime => (8, 0),
        LazItemType::RGB12 => (6, 0),
        LazItemType::WavePacket13 => (29, 0),
        LazItemType::Point14 => (30, 9),
        LazItemType::RGB14 => (6, 1),
        LazItemType::RGBNIR14 => (8, 2),
        LazItemType::WavePacket14 => (29, 1),
        LazItemType::Byte14(n) => (n, u64::from(n)),
    }
}

pub(super) fn records(
    input: &mut Input<'_>,
    header: &Header,
    take: &mut (impl FnMut(&[u8]) + Send),
) -> Result<()> {
    if header.points == 0 {
        return Ok(());
    }
    let vlr = check(input, header)?;
    input.seek(header.start)?;
    unpack(input.stream(), vlr, header, take).map_err(|failure| {
        let why = format!(
            "{} after {} of {} points",
            failure.why, failure.done, header.points
        );
        let kind = if failure.is_end {
            ErrorKind::Truncated
        } else {
            ErrorKind::Corrupt
        };
        let hint = "get the file again, or repair it with laszip";
        input.error(
            kind,
            At::Byte(header.start),
            "cannot unpack the LAZ points",
            why,
            hint,
        )
    })
}

struct Failure {
    done: u64,
    why: String,
    is_end: bool,
}

/// Refuses to read once the stack below it is deep; see the module's head.
struct Guard<R> {
    inner: BufReader<R>,
    base: usize,
}

/// Address of the top of the stack, roughly.
#[inline(never)]
fn stack_address() -> usize {
    let mark = 0_u8;
    std::hint::black_box(&raw const mark) as usize
}

impl<R: Read> Read for Guard<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if stack_address().abs_diff(self.base) > MAX_DEPTH {
            return Err(io::Error::other("the compressed data is damaged"));
        }
        self.inner.read(to)
    }
}

impl<R: Seek> Seek for Guard<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}

/// Unpacks in a thread of its own, for its stack; a panic ends the thread and is an error here.
fn unpack(
    stream: impl Read + Seek + Send + Sync,
    vlr: LazVlr,
    header: &Header,
    take: &mut (impl FnMut(&[u8]) + Send),
) -> std::result::Result<(), Failure> {
    let failure = |why: &str| Failure {
        done: 0,
        why: why.into(),
        is_end: false,
    };
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name("laz".into())
            .stack_size(STACK);
        let running = thread.spawn_scoped(scope, || unpack_here(stream, vlr, header, take));
        let running = running.map_err(|e| failure(&format!("no thread could be started ({e})")))?;
        running
            .join()
            .unwrap_or_else(|_| Err(failure("the compressed data is damaged")))
    })
}

fn unpack_here(
    stream: impl Read + Seek + Send + Sync,
    vlr: LazVlr,
    header: &Header,
    take: &mut impl FnMut(&[u8]),
) -> std::result::Result<(), Failure> {
    let stream = Guard {
        inner: BufReader::with_capacity(1 << 16, stream),
        base: stack_address(),
    };
    let failure = |done, e: &io::Error| Failure {
        done,
        why: e.to_string(),
        is_end: e.kind() == io::ErrorKind::UnexpectedEof,
    };
    // The layers of the newer formats are unpacked from memory, where no guard can stand: the time,
    // which recurses, stays packed there.
    let fields = DecompressionSelection::all().skip_gps_time();
    let mut decoder = LasZipDecompressor::selective(stream, vlr, fields).map_err(|e| Failure {
        done: 0,
        why: e.to_string(),
        is_end: false,
    })?;
    let record = usize::from(header.record);
    let mut buffer = vec![0; BATCH as usize * record];
    let mut done = 0;
    while done < header.points {
        let n = BATCH.min(header.points - done);
        let out = &mut buffer[..n as usize * record];
        decoder
            .decompress_many(out)
            .map_err(|e| failure(done, &e))?;
        out.chunks_exact(record).for_each(&mut *take);
        done += n;
    }
    Ok(())
}

fn check(input: &mut Input<'_>, header: &Header) -> Result<LazVlr> {
    let bad = |input: &Input<'_>, why: String| corrupt(input, At::Byte(header.start), why);
    let Some(data) = &header.laszip else {
        return Err(bad(
            input,
            "the record \"laszip encoded\" is missing".into(),
        ));
    };
    let vlr = LazVlr::from_buffer(data).map_err(|e| bad(input, e.to_string()))?;
    let items = vlr.items();
    let is_layered = items
        .first()
        .is_some_and(|i| i.item_type() == LazItemType::Point14);
    let is_basic = items
        .first()
        .is_some_and(|i| i.item_type() == LazItemType::Point10);
    let good_items = items.iter().enumerate().all(|(k, i)| {
        let (size, layers) = expected(i);
        let first = matches!(i.item_type(), LazItemType::Point10 | LazItemType::Point14);
        let versions = if is_layered { 3..=4 } else { 1..=2 };
        let is_of_family =
            is_layered == (layers > 0) || matches!(i.item_type(), LazItemType::Byte14(0));
        i.size() == size
            && size > 0
            && first == (k == 0)
            && versions.contains(&i.version())
            && is_of_family
    });
    let total: u64 = items.iter().map(|i| u64::from(i.size())).sum();
    // The kind of compressor is the first number of the record; the crate does not tell it.
    let compressor = u16::from_le_bytes([data[0], data[1]]);
    let good_kind = if is_layered {
        compressor == CompressorType::LayeredChunked as u16
    } else {
        is_basic
            && (compressor == CompressorType::PointWise as u16
                || compressor == CompressorType::PointWiseChunked as u16)
    };
    if !good_items || !good_kind || total != u64::from(header.record) {
        return Err(bad(
            input,
            format!(
                "the LAZ items do not make records of {} bytes",
                header.record
            ),
        ));
    }
    if header.points > input.size.saturating_mul(POINTS_PER_BYTE) {
        return Err(bad(
            input,
            format!("{} points cannot be in {} bytes", header.points, input.size),
        ));
    }
    if compressor != CompressorType::PointWise as u16 {
        check_chunks(input, header, &vlr, is_layered)?;
    }
    Ok(vlr)
}

/// The length of the chunk table and the sizes of all layers against the length of the file.
fn check_chunks(
    input: &mut Input<'_>,
    header: &Header,
    vlr: &LazVlr,
    is_layered: bool,
) -> Result<()> {
    let bad = |input: &Input<'_>, why: String| Err(corrupt(input, input.at_byte(), why));
    let missing = || "the LAZ chunk table is cut off".to_owned();
    let mut word = [0; 8];
    input.exact(&mut word, missing)?;
    let mut table = i64::from_le_bytes(word);
    if table <= header.start as i64 && input.size >= 8 {
        // A writer that could not go back has put it at the end.
        input.seek(input.size - 8)?;
        input.exact(&mut word, missing)?;
        table = i64::from_le_bytes(word);
    }
    let mut counts = None;
    if table > header.start as i64 && (table as u64).saturating_add(8) <= input.size {
        input.seek(table as u64)?;
        input.exact(&mut word, missing)?;
        let chunks = u64::from(u32_at(&word, 4));
        // Every chunk starts with a whole point.
        if chunks > header.points || chunks.saturating_mul(u64::from(header.record)) > input.size {
            return bad(
                input,
                format!("{chunks} chunks cannot be in {} bytes", input.size),
            );
        }
        if vlr.uses_variable_size_chunks() {
            input.seek(header.start)?;
            let stream = input.stream();
            counts = match catch_unwind(AssertUnwindSafe(|| ChunkTable::read_from(stream, vlr))) {
                Ok(Ok(table)) => Some(table),
                _ => return bad(input, "the LAZ chunk table is damaged".into()),
            };
        }
    } else if vlr.uses_variable_size_chunks() {
        return bad(input, "the LAZ chunk table is missing".into());
    }
    if let Some(table) = &counts {
        let sum = table
            .as_ref()
            .iter()
            .try_fold(0_u64, |sum, c| sum.checked_add(c.point_count));
        if sum.is_none_or(|sum| sum < header.points) {
            return bad(
                input,
                format!("the chunks do not hold {} points", header.points),
            );
        }
    }
    if !is_layered {
        return Ok(());
    }
    let layers: u64 = vlr.items().iter().map(|i| expected(i).1).sum();
    let (mut at, mut points, mut chunk) = (header.start + 8, 0_u64, 0_usize);
    let mut sizes = Vec::new();
    while points < header.points {
        input.seek(at)?;
        input.skip(u64::from(header.record), || {
            format!("LAZ chunk {chunk} is cut off")
        })?;
        sizes.resize(4 + 4 * layers as usize, 0);
        input.exact(&mut sizes, || format!("LAZ chunk {chunk} is cut off"))?;
        let stored = u64::from(u32_at(&sizes, 0));
        let bytes: u64 = sizes[4..]
            .chunks_exact(4)
            .map(|b| u64::from(u32_at(b, 0)))
            .sum();
        if bytes > input.left() {
            return Err(input.truncated(format!(
                "LAZ chunk {chunk} should have {bytes} bytes, {} are there",
                input.left()
            )));
        }
        // As many as the decoder will take from this chunk, whatever the chunk says.
        let taken = match &counts {
            Some(table) => table.as_ref().get(chunk).map_or(0, |c| c.point_count),
            None => u64::from(vlr.chunk_size()),
        };
        if taken == 0 || stored > taken || (stored < taken && points + stored < header.points) {
            return bad(
                input,
                format!("LAZ chunk {chunk} has {stored} points instead of {taken}"),
            );
        }
        points += taken;
        at = input.offset + bytes;
        chunk += 1;
    }
    Ok(())
}
