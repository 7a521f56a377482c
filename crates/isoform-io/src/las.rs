//! LAS 1.0 to 1.4 (ASPRS), streamed; LAZ through the crate `laz` (feature `laz`).
//!
//! Points flagged as withheld, which by the standard "should not be included in processing", and
//! those in the classes of noise are left out and counted in a warning.
//!
//! Header and records are decoded here because every size in them is first checked against the
//! length of the file, and because a header is less code than the four crates that come with a
//! decoder of it.

#[cfg(feature = "laz")]
mod compressed;

use crate::collect::{Collector, ColorScale};
use crate::format::Sniff;
use crate::input::{Input, Result};
use crate::roles::{Role, RowLayout};
use crate::{At, ErrorKind, ReadError, ReadOptions, ReadReport};
use isoform_geom::PointCloud;

const LAS_FAILURE: &str = "cannot read the LAS file";
/// Size in bytes of each point record format from 0 to 10, without extra bytes.
const RECORD_BYTES: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Returns `Yes` for the signature of LAS, which LAZ shares.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    if head.starts_with(b"LASF") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// Decodes a little-endian u16 at an offset within the bytes.
pub(crate) fn u16_at(b: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([b[at], b[at + 1]])
}
/// Decodes a little-endian u32 at an offset within the bytes.
pub(crate) fn u32_at(b: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| b[at + i]))
}
/// Decodes a little-endian f64 at an offset within the bytes.
fn f64_at(b: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(std::array::from_fn(|i| b[at + i]))
}

/// Contents of the header that the points need.
pub(crate) struct LasHeader {
    /// Number of point records.
    pub(crate) points: u64,
    /// Byte offset of the first record.
    pub(crate) start: u64,
    /// Size of a record in bytes.
    pub(crate) record: u16,
    /// Point record format, 0 to 10.
    format: u8,
    /// True for LAS 1.0, in which classes and flags have no fixed meaning.
    is_first_version: bool,
    /// True if the records are LAZ, which the upper bits of the format tell.
    is_compressed: bool,
    /// Coordinates are `scale` · integer + `offset`.
    scale: [f64; 3],
    offset: [f64; 3],
    /// Data of the "laszip encoded" record.
    pub(crate) laszip: Option<Vec<u8>>,
}

/// Returns the error for an inconsistent file.
fn corrupt(input: &Input<'_>, at: At, why: impl Into<String>) -> ReadError {
    input.error(
        ErrorKind::Corrupt,
        at,
        LAS_FAILURE,
        why,
        "get the file again, or repair it with the software that made it",
    )
}

/// Size in bytes of the header of LAS 1.0, the minimum of all versions.
const HEADER_BYTES: usize = 227;
/// Size in bytes of the header of LAS 1.4, which counts points in 64 bits.
const LAS_14_HEADER_BYTES: usize = 375;

/// Reads and checks the header and the following records, which hold the unit and the parameters of
/// LAZ.
fn header(input: &mut Input<'_>, report: &mut ReadReport) -> Result<LasHeader> {
    let mut b = [0_u8; LAS_14_HEADER_BYTES];
    input.exact(&mut b[..HEADER_BYTES], || {
        "a LAS header has 227 bytes".into()
    })?;
    if &b[..4] != b"LASF" {
        return Err(corrupt(input, At::Byte(0), "it does not start with LASF"));
    }
    let (version, size) = ((b[24], b[25]), u16_at(&b, 94));
    let is_14 = version >= (1, 4) && usize::from(size) >= LAS_14_HEADER_BYTES;
    if is_14 {
        let missing = || "a LAS 1.4 header has 375 bytes".into();
        input.exact(&mut b[HEADER_BYTES..], missing)?;
    }
    warn_of_oddities(&b, report);
    let mut header = LasHeader::decode(&b, is_14);
    header.check(input, size)?;
    records(input, u64::from(size), u32_at(&b, 100), &mut header, report)?;
    Ok(header)
}

/// Warns of an unknown version and an impossible date.
fn warn_of_oddities(b: &[u8], report: &mut ReadReport) {
    let (version, day, year) = ((b[24], b[25]), u16_at(b, 90), u16_at(b, 92));
    if version.0 != 1 || version.1 > 4 {
        report.warn(format!("unknown LAS version {}.{}", version.0, version.1));
    }
    if (day, year) != (0, 0) && (!(1..=366).contains(&day) || !(2000..2200).contains(&year)) {
        report.warn(format!(
            "the creation date (day {day} of {year}) cannot be true"
        ));
    }
}

impl LasHeader {
    /// Decodes the header; LAS 1.4 has a second, wider count of points.
    fn decode(b: &[u8], is_14: bool) -> Self {
        let legacy = u64::from(u32_at(b, 107));
        let points = match is_14 {
            true => u64::from_le_bytes(std::array::from_fn(|i| b[247 + i])),
            false => legacy,
        };
        Self {
            points: if points == 0 { legacy } else { points },
            start: u64::from(u32_at(b, 96)),
            record: u16_at(b, 105),
            format: b[104] & 0x3f,
            is_first_version: (b[24], b[25]) == (1, 0),
            is_compressed: b[104] & 0xc0 != 0,
            scale: std::array::from_fn(|k| f64_at(b, 131 + 8 * k)),
            offset: std::array::from_fn(|k| f64_at(b, 155 + 8 * k)),
            laszip: None,
        }
    }

    /// Decodes the coordinates of a record.
    #[inline]
    fn point(&self, record: &[u8]) -> [f64; 3] {
        std::array::from_fn(|k| {
            let step = i32::from_le_bytes(std::array::from_fn(|i| record[4 * k + i]));
            f64::from(step) * self.scale[k] + self.offset[k]
        })
    }

    /// Checks the header against itself and the file; `size` is the header's length in bytes.
    fn check(&self, input: &Input<'_>, size: u16) -> Result<()> {
        let refuse = |at, why: String| Err(corrupt(input, At::Byte(at), why));
        let (format, record) = (self.format, self.record);
        let Some(&least) = RECORD_BYTES.get(usize::from(format)) else {
            return refuse(104, format!("unknown point format {format}"));
        };
        if record < least {
            let why = format!("records of {record} bytes; format {format} needs {least}");
            return refuse(105, why);
        }
        let (scale, offset) = (self.scale, self.offset);
        let is_scale = scale.iter().all(|s| s.is_finite() && *s != 0.0);
        if !is_scale || !offset.iter().all(|o| o.is_finite()) {
            return refuse(131, format!("scale {scale:?} and offset {offset:?}"));
        }
        let (start, length) = (self.start, input.size);
        if u64::from(size) > start || start > length || usize::from(size) < HEADER_BYTES {
            let why = format!(
                "a header of {size} bytes and points from byte {start} in a file of {length} bytes"
            );
            return refuse(94, why);
        }
        Ok(())
    }
}

/// Reads the variable length records: coordinate system, for the unit, and parameters of LAZ.
fn records(
    input: &mut Input<'_>,
    from: u64,
    count: u32,
    header: &mut LasHeader,
    report: &mut ReadReport,
) -> Result<()> {
    input.seek(from)?;
    for i in 0..count {
        if input.offset + 54 > header.start {
            report.warn(format!("{i} of {count} variable length records are there"));
            break;
        }
        let mut b = [0; 54];
        input.exact(&mut b, || "a variable length record is cut off".into())?;
        let (user, id, length) = (&b[2..18], u16_at(&b, 18), u16_at(&b, 20));
        let is = |name: &[u8]| user.starts_with(name);
        let mut data = Vec::new();
        if is(b"LASF_Projection") || is(b"laszip encoded") {
            data.resize(usize::from(length), 0);
            input.exact(&mut data, || "a variable length record is cut off".into())?;
        } else {
            input.skip(u64::from(length), || {
                "a variable length record is cut off".into()
            })?;
        }
        match id {
            22204 if is(b"laszip encoded") => header.laszip = Some(data),
            34735 if is(b"LASF_Projection") => geo_keys(&data, report),
            2112 if is(b"LASF_Projection") => {
                well_known_text(&String::from_utf8_lossy(&data), report)
            }
            _ => {}
        }
    }
    input.seek(header.start)
}

/// Interprets GeoTIFF keys: 1024 distinguishes geographic from projected coordinates, 3076 is the
/// linear unit.
fn geo_keys(data: &[u8], report: &mut ReadReport) {
    for entry in data.chunks_exact(8).skip(1) {
        match (u16_at(entry, 0), u16_at(entry, 6)) {
            (1024, 2) => report
                .warn("the coordinates are longitude and latitude in degrees: angles, not lengths"),
            (3076, 9001) => report.units = Some("m".into()),
            (3076, 9002) => report.units = Some("ft".into()),
            (3076, 9003) => report.units = Some("ft (US survey)".into()),
            _ => {}
        }
    }
}

/// Interprets the unit of a coordinate system in well-known text (OGC).
fn well_known_text(text: &str, report: &mut ReadReport) {
    let low = text.to_ascii_lowercase();
    if low.starts_with("geogcs") || low.starts_with("geogcrs") {
        report.warn("the coordinates are longitude and latitude in degrees: angles, not lengths");
    } else if low.contains("us survey foot") || low.contains("foot_us") {
        report.units = Some("ft (US survey)".into());
    } else if low.contains("unit[\"foot") {
        report.units = Some("ft".into());
    } else if low.contains("unit[\"met") {
        report.units = Some("m".into());
    }
}

/// Classes of noise: low points and high noise.
const NOISE_CLASSES: [u8; 2] = [7, 18];

/// Offsets of the fields of a record other than the coordinates.
struct RecordFields {
    /// Bit of byte 15 that flags a withheld point.
    withheld: u8,
    /// Offset of the classification, and mask of its class bits.
    class: (usize, u8),
    /// Mask of the return number in byte 14.
    returns: u8,
    /// Offset of the GPS time.
    time: Option<usize>,
    /// Offset of red, green and blue.
    color: Option<usize>,
}

impl RecordFields {
    /// Returns the offsets for a point record format: 0 to 5, or 6 to 10 with their longer core.
    fn for_format(format: u8) -> Self {
        let new = format >= 6;
        Self {
            withheld: if new { 0x04 } else { 0x80 },
            class: if new { (16, 0xff) } else { (15, 0x1f) },
            returns: if new { 0x0f } else { 0x07 },
            time: match format {
                1 | 3..=5 => Some(20),
                6.. => Some(22),
                _ => None,
            },
            color: match format {
                2 => Some(20),
                3 | 5 => Some(28),
                7 | 8 | 10 => Some(30),
                _ => None,
            },
        }
    }
}

impl RecordFields {
    /// Returns the values of a point, coordinates first.
    fn layout(&self) -> RowLayout {
        let mut names = vec![
            "x",
            "y",
            "z",
            "intensity",
            "classification",
            "return_number",
        ];
        names.extend(self.time.map(|_| "gps_time"));
        if self.color.is_some() {
            names.extend(["red", "green", "blue"]);
        }
        let mut layout = RowLayout::named(names);
        layout.scale = layout.has(Role::Color(0)).then_some(ColorScale::Word);
        layout
    }
    /// Returns the class of a record.
    #[inline]
    fn class(&self, record: &[u8]) -> u8 {
        record[self.class.0] & self.class.1
    }
    /// Decodes the values of a record after the coordinates.
    #[inline]
    fn values(&self, record: &[u8], values: &mut Vec<f64>) {
        values.push(f64::from(u16_at(record, 12)));
        values.push(f64::from(self.class(record)));
        values.push(f64::from(record[14] & self.returns));
        if let Some(at) = self.time {
            values.push(f64_at(record, at));
        }
        if let Some(at) = self.color {
            values.extend((0..3).map(|k| f64::from(u16_at(record, at + 2 * k))));
        }
    }
}

/// Reads the points with intensity, class and return number, and with time and colour if the format
/// has them.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    let header = header(input, report)?;
    report.declared = Some(header.points);
    let mut fields = RecordFields::for_format(header.format);
    if header.is_compressed && header.format >= 6 {
        fields.time = None; // not unpacked, see compressed.rs
    }
    let mut layout = fields.layout();
    let mut collector = Collector::new(options);
    layout.announce(&mut collector);
    let mut values: Vec<f64> = Vec::new();
    let (mut withheld, mut noise) = (0_u64, 0_u64);
    let mut take = |record: &[u8]| {
        if !header.is_first_version && record[15] & fields.withheld != 0 {
            withheld += 1;
            return;
        }
        if !header.is_first_version && NOISE_CLASSES.contains(&fields.class(record)) {
            noise += 1;
            return;
        }
        values.clear();
        values.extend(header.point(record));
        fields.values(record, &mut values);
        layout.offer(&mut collector, &values);
    };
    if header.is_compressed {
        #[cfg(feature = "laz")]
        compressed::records(input, &header, &mut take)?;
        #[cfg(not(feature = "laz"))]
        {
            let hint = "convert it to LAS, or use a build with the feature laz";
            return Err(input.error(
                ErrorKind::UnsupportedFormat,
                At::File,
                LAS_FAILURE,
                "this build does not read LAZ",
                hint,
            ));
        }
    } else {
        let mut record = vec![0; usize::from(header.record)];
        for i in 0..header.points {
            input.exact(&mut record, || {
                format!("{i} of {} points are there", header.points)
            })?;
            take(&record);
        }
    }
    let left_out = [
        (withheld, "flagged as withheld"),
        (noise, "classified as noise (classes 7 and 18)"),
    ];
    for (count, why) in left_out.into_iter().filter(|l| l.0 > 0) {
        report.warn(format!(
            "{count} of {} points are {why} and were left out",
            header.points
        ));
    }
    collector.finish(input, options, report)
}
