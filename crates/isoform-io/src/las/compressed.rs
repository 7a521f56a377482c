//! LAZ: decompression by the crate `laz`, with the checks that make it safe on arbitrary bytes.
//!
//! `laz` trusts the file: it reserves memory for the announced number of chunks and the announced
//! sizes of layers, and panics on inconsistent item lists. Therefore the item list, the length of
//! the chunk table and all layer sizes are compared with the length of the file before it is
//! called. Remaining panics in its arithmetic decoder are caught and reported as damage.

use super::{LasHeader, corrupt, u32_at};
use crate::input::{Input, Result};
use crate::{At, ErrorKind, ReadError};
use laz::laszip::{ChunkTable, CompressorType};
use laz::{DecompressionSelection, LasZipDecompressor, LazItem, LazItemType, LazVlr};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Maximum number of points per byte of LAZ. Real files have at most a few; runs of equal points
/// may have some hundred. Without the limit a small file could announce endless points.
const MAX_POINTS_PER_BYTE: u64 = 1000;
/// Stack size of the decoder's thread, in bytes; memory is committed only on use.
const DECODER_STACK_BYTES: usize = 256 << 20;
/// Maximum stack depth of the decoder, in bytes; far below the stack size, which leaves room for
/// the functions it calls.
const MAX_USED_STACK_BYTES: usize = 32 << 20;
/// Number of points decompressed at a time.
const POINTS_PER_BATCH: u64 = 1024;

/// Returns the expected size of an item in bytes, and its number of layers (0 for versions without
/// layers).
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

/// Decompresses all records and passes each to `take`.
pub(super) fn records(
    input: &mut Input<'_>,
    header: &LasHeader,
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

/// Reason why decompression stopped, and the number of points before it.
struct DecoderFailure {
    /// Number of points decompressed before the failure.
    done: u64,
    why: String,
    /// True if the file ended too early.
    is_end: bool,
}

/// Reader that fails if the stack of its caller is too deep.
struct StackGuard<R> {
    inner: BufReader<R>,
    /// Stack address at which the decoder starts.
    base: usize,
}

/// Returns the approximate address of the top of the stack.
#[inline(never)]
fn stack_address() -> usize {
    let mark = 0_u8;
    std::hint::black_box(&raw const mark) as usize
}

impl<R: Read> Read for StackGuard<R> {
    /// Reads, or fails if the decoder has recursed too deep.
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if stack_address().abs_diff(self.base) > MAX_USED_STACK_BYTES {
            return Err(io::Error::other("the compressed data is damaged"));
        }
        self.inner.read(to)
    }
}

impl<R: Seek> Seek for StackGuard<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}

/// Decompresses in a thread of its own, for a larger stack; a panic ends the thread and becomes an
/// error.
fn unpack(
    stream: impl Read + Seek + Send + Sync,
    vlr: LazVlr,
    header: &LasHeader,
    take: &mut (impl FnMut(&[u8]) + Send),
) -> std::result::Result<(), DecoderFailure> {
    let failure = |why: &str| DecoderFailure {
        done: 0,
        why: why.into(),
        is_end: false,
    };
    // WebAssembly has no threads; there a damaged file that exhausts the stack ends the run.
    if cfg!(target_family = "wasm") {
        let work = AssertUnwindSafe(|| unpack_here(stream, vlr, header, take));
        return catch_unwind(work)
            .unwrap_or_else(|_| Err(failure("the compressed data is damaged")));
    }
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name("laz".into())
            .stack_size(DECODER_STACK_BYTES);
        let running = thread.spawn_scoped(scope, || unpack_here(stream, vlr, header, take));
        let running = running.map_err(|e| failure(&format!("no thread could be started ({e})")))?;
        running
            .join()
            .unwrap_or_else(|_| Err(failure("the compressed data is damaged")))
    })
}

/// Decompresses in batches on this thread, from whose present depth the stack is measured.
fn unpack_here(
    stream: impl Read + Seek + Send + Sync,
    vlr: LazVlr,
    header: &LasHeader,
    take: &mut impl FnMut(&[u8]),
) -> std::result::Result<(), DecoderFailure> {
    let stream = StackGuard {
        inner: BufReader::with_capacity(1 << 16, stream),
        base: stack_address(),
    };
    let failure = |done, e: &io::Error| DecoderFailure {
        done,
        why: e.to_string(),
        is_end: e.kind() == io::ErrorKind::UnexpectedEof,
    };
    // The layers of the newer formats are decompressed from memory, which bypasses the guard. The
    // GPS time, whose decoder recurses, therefore stays compressed there.
    let fields = DecompressionSelection::all().skip_gps_time();
    let mut decoder =
        LasZipDecompressor::selective(stream, vlr, fields).map_err(|e| DecoderFailure {
            done: 0,
            why: e.to_string(),
            is_end: false,
        })?;
    let record = usize::from(header.record);
    let mut buffer = vec![0; POINTS_PER_BATCH as usize * record];
    let mut done = 0;
    while done < header.points {
        let n = POINTS_PER_BATCH.min(header.points - done);
        let out = &mut buffer[..n as usize * record];
        decoder
            .decompress_many(out)
            .map_err(|e| failure(done, &e))?;
        out.chunks_exact(record).for_each(&mut *take);
        done += n;
    }
    Ok(())
}

/// Returns the description of the items after comparing everything that `laz` would trust with the
/// file.
fn check(input: &mut Input<'_>, header: &LasHeader) -> Result<LazVlr> {
    let bad = |input: &Input<'_>, why: String| corrupt(input, At::Byte(header.start), why);
    let Some(data) = &header.laszip else {
        let why = "the record \"laszip encoded\" is missing";
        return Err(bad(input, why.into()));
    };
    let vlr = LazVlr::from_buffer(data).map_err(|e| bad(input, e.to_string()))?;
    // The crate does not expose the kind of compressor, which is the first number of the record.
    let compressor = u16::from_le_bytes([data[0], data[1]]);
    if !items_fit(&vlr, compressor, header.record) {
        let why = format!(
            "the LAZ items do not make records of {} bytes",
            header.record
        );
        return Err(bad(input, why));
    }
    if header.points > input.size.saturating_mul(MAX_POINTS_PER_BYTE) {
        let why = format!("{} points cannot be in {} bytes", header.points, input.size);
        return Err(bad(input, why));
    }
    if compressor != CompressorType::PointWise as u16 {
        check_chunks(input, header, &vlr)?;
    }
    Ok(vlr)
}

/// Returns true if the first item belongs to the formats from 6 on, whose fields lie in layers.
fn is_layered(vlr: &LazVlr) -> bool {
    let first = vlr.items().first();
    first.is_some_and(|i| i.item_type() == LazItemType::Point14)
}

/// Returns true if the items belong to one family, fit the compressor and add up to a record of
/// this size.
fn items_fit(vlr: &LazVlr, compressor: u16, record: u16) -> bool {
    let (items, is_layered) = (vlr.items(), is_layered(vlr));
    let is_basic = items
        .first()
        .is_some_and(|i| i.item_type() == LazItemType::Point10);
    let fits_compressor = if is_layered {
        compressor == CompressorType::LayeredChunked as u16
    } else {
        is_basic
            && (compressor == CompressorType::PointWise as u16
                || compressor == CompressorType::PointWiseChunked as u16)
    };
    let total: u64 = items.iter().map(|i| u64::from(i.size())).sum();
    let mut numbered = items.iter().enumerate();
    fits_compressor
        && total == u64::from(record)
        && numbered.all(|(k, item)| item_is_good(item, k == 0, is_layered))
}

/// Returns true if an item has the size of its type, and a version and a type of the family.
fn item_is_good(item: &LazItem, is_first: bool, is_layered: bool) -> bool {
    let kind = item.item_type();
    let (size, layers) = expected(item);
    let is_point = matches!(kind, LazItemType::Point10 | LazItemType::Point14);
    let versions = if is_layered { 3..=4 } else { 1..=2 };
    let is_of_family = is_layered == (layers > 0) || matches!(kind, LazItemType::Byte14(0));
    item.size() == size
        && size > 0
        && is_point == is_first
        && versions.contains(&item.version())
        && is_of_family
}

/// Checks the length of the chunk table and the sizes of all layers against the length of the file.
fn check_chunks(input: &mut Input<'_>, header: &LasHeader, vlr: &LazVlr) -> Result<()> {
    let table = chunk_table(input, header, vlr)?;
    if let Some(table) = &table {
        let mut counts = table.as_ref().iter().map(|c| c.point_count);
        let sum = counts.try_fold(0_u64, u64::checked_add);
        if sum.is_none_or(|sum| sum < header.points) {
            let why = format!("the chunks do not hold {} points", header.points);
            return Err(damaged(input, why));
        }
    }
    if !is_layered(vlr) {
        return Ok(());
    }
    let layers: u64 = vlr.items().iter().map(|i| expected(i).1).sum();
    let (mut at, mut points, mut number) = (header.start + 8, 0_u64, 0_usize);
    while points < header.points {
        input.seek(at)?;
        let chunk = LayeredChunk::read(input, number, header.record, layers)?;
        // Number of points that the decoder will take from this chunk, whatever the chunk states.
        let taken = match &table {
            Some(table) => table.as_ref().get(number).map_or(0, |c| c.point_count),
            None => u64::from(vlr.chunk_size()),
        };
        let is_last = points + chunk.points >= header.points;
        if taken == 0 || chunk.points > taken || (chunk.points < taken && !is_last) {
            let stored = chunk.points;
            let why = format!("LAZ chunk {number} has {stored} points instead of {taken}");
            return Err(damaged(input, why));
        }
        points += taken;
        at = input.offset + chunk.bytes;
        number += 1;
    }
    Ok(())
}

/// Returns the error for inconsistent compressed data.
fn damaged(input: &Input<'_>, why: impl Into<String>) -> ReadError {
    corrupt(input, input.at_byte(), why)
}

/// Header of a layered chunk.
struct LayeredChunk {
    points: u64,
    /// Size of all layers in bytes.
    bytes: u64,
}

impl LayeredChunk {
    /// Reads past the first point, and decodes the number of points and the sizes of the layers.
    fn read(input: &mut Input<'_>, number: usize, record: u16, layers: u64) -> Result<Self> {
        let cut = || format!("LAZ chunk {number} is cut off");
        input.skip(u64::from(record), cut)?;
        let mut sizes = vec![0; 4 + 4 * layers as usize];
        input.exact(&mut sizes, cut)?;
        let layers = sizes[4..].chunks_exact(4);
        let bytes: u64 = layers.map(|b| u64::from(u32_at(b, 0))).sum();
        if bytes > input.left() {
            return Err(input.truncated(format!(
                "LAZ chunk {number} should have {bytes} bytes, {} are there",
                input.left()
            )));
        }
        Ok(Self {
            points: u64::from(u32_at(&sizes, 0)),
            bytes,
        })
    }
}

/// Returns the chunk table if chunks differ in their numbers of points; its length is checked in
/// any case.
fn chunk_table(
    input: &mut Input<'_>,
    header: &LasHeader,
    vlr: &LazVlr,
) -> Result<Option<ChunkTable>> {
    let start = header.start;
    let table = chunk_table_start(input, start)?;
    let is_there = table > start as i64 && (table as u64).saturating_add(8) <= input.size;
    if !is_there {
        return match vlr.uses_variable_size_chunks() {
            true => Err(damaged(input, "the LAZ chunk table is missing")),
            false => Ok(None),
        };
    }
    input.seek(table as u64)?;
    let chunks = u64::from(u32_at(&word(input)?, 4));
    // Every chunk starts with an uncompressed point.
    if chunks > header.points || chunks.saturating_mul(u64::from(header.record)) > input.size {
        let why = format!("{chunks} chunks cannot be in {} bytes", input.size);
        return Err(damaged(input, why));
    }
    if !vlr.uses_variable_size_chunks() {
        return Ok(None);
    }
    input.seek(start)?;
    let stream = input.stream();
    match catch_unwind(AssertUnwindSafe(|| ChunkTable::read_from(stream, vlr))) {
        Ok(Ok(table)) => Ok(Some(table)),
        _ => Err(damaged(input, "the LAZ chunk table is damaged")),
    }
}

/// Returns the offset of the chunk table. Writers that cannot seek state it at the end of the file
/// instead of before the points.
fn chunk_table_start(input: &mut Input<'_>, start: u64) -> Result<i64> {
    let table = i64::from_le_bytes(word(input)?);
    if table > start as i64 || input.size < 8 {
        return Ok(table);
    }
    input.seek(input.size - 8)?;
    Ok(i64::from_le_bytes(word(input)?))
}

/// Reads the next eight bytes of the file.
fn word(input: &mut Input<'_>) -> Result<[u8; 8]> {
    let mut word = [0; 8];
    input.exact(&mut word, || "the LAZ chunk table is cut off".to_owned())?;
    Ok(word)
}
