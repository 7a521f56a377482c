//! PCD (Point Cloud Library): ASCII, binary (streamed) and binary_compressed (LZF, in memory),
//! versions 0.5 to 0.7.

mod header;
mod lzf;

use crate::collect::{Collector, ColorScale};
use crate::format::Sniff;
use crate::input::{Input, Result, Words, shorten};
use crate::roles::{Role, RowLayout};
use crate::{At, ErrorKind, ReadOptions, ReadReport};
use header::{PcdEncoding, PcdField, PcdHeader};
use isoform_geom::PointCloud;

const PCD_FAILURE: &str = "cannot read the PCD file";
/// Maximum number of values of a field that become columns; fields with more are descriptors.
const MAX_COLUMNS_PER_FIELD: u64 = 8;

/// Returns `Yes` for the initial comment of the library, or for a version line within 512 bytes.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(&head[..head.len().min(512)]);
    let mut lines = text.lines();
    let first = lines.next().unwrap_or("");
    let is_pcd = (first.starts_with('#') && first.contains(".PCD"))
        || text
            .lines()
            .any(|l| l.starts_with("VERSION .7") || l.starts_with("VERSION 0.7"));
    if is_pcd { Sniff::Yes } else { Sniff::No }
}

/// Reads the points with all named fields; packed colours become red, green and blue.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    let header = PcdHeader::read(input, report)?;
    report.declared = Some(header.points);
    let mut reader = PcdRowReader::new(&header, report);
    if let Some(name) = reader.layout.missing_coordinate() {
        let why = format!("there is no field \"{name}\"");
        return Err(input.error(
            ErrorKind::Header,
            At::File,
            PCD_FAILURE,
            why,
            "points need x, y and z",
        ));
    }
    let mut collector = Collector::new(options);
    reader.layout.announce(&mut collector);
    match header.data {
        PcdEncoding::Ascii => reader.ascii(input, &header, &mut collector)?,
        PcdEncoding::Binary => reader.binary(input, &header, &mut collector)?,
        PcdEncoding::Compressed => reader.compressed(input, &header, &mut collector)?,
    }
    collector.finish(input, options, report)
}

/// Converter from values of fields to rows of the layout.
struct PcdRowReader {
    /// Roles of the values of a row.
    layout: RowLayout,
    /// Treatment of each field.
    parts: Vec<FieldTreatment>,
    /// Present row.
    row: Vec<f64>,
}

/// Treatment of the values of a field.
#[derive(Clone, Copy, PartialEq)]
enum FieldTreatment {
    /// Values of the row.
    Values,
    /// Packed colour, which gives three values of the row.
    Packed,
    /// Skipped.
    Nothing,
}

/// Returns the treatment of a field; a second packed colour is a column.
fn part(field: &PcdField, has_color: bool, report: &mut ReadReport) -> FieldTreatment {
    if field.is_packed_color() && !has_color {
        return FieldTreatment::Packed;
    }
    if field.name == "_" || field.count == 0 {
        return FieldTreatment::Nothing;
    }
    if field.count as u64 > MAX_COLUMNS_PER_FIELD {
        report.warn(format!(
            "field \"{}\" with {} values per point was passed over",
            shorten(&field.name),
            field.count
        ));
        return FieldTreatment::Nothing;
    }
    FieldTreatment::Values
}

/// Returns the bits of a packed colour in text: an integer, or the float with these bits (which is
/// tiny, or not an integer).
fn color_bits(field: &PcdField, v: f64) -> u32 {
    let is_integer = v >= 1.0 && v.fract() == 0.0 && v <= f64::from(u32::MAX);
    if field.is_float() && !is_integer {
        (v as f32).to_bits()
    } else {
        v as i64 as u32
    }
}

impl PcdRowReader {
    /// Creates the converter of a header. A field of several values becomes as many columns.
    fn new(header: &PcdHeader, report: &mut ReadReport) -> Self {
        let mut names: Vec<String> = Vec::new();
        let mut parts: Vec<FieldTreatment> = Vec::new();
        for field in &header.fields {
            let part = part(field, parts.contains(&FieldTreatment::Packed), report);
            match part {
                FieldTreatment::Packed => names.extend(["red", "green", "blue"].map(String::from)),
                FieldTreatment::Values if field.count == 1 => names.push(field.name.clone()),
                FieldTreatment::Values => {
                    names.extend((0..field.count).map(|k| format!("{}_{k}", field.name)));
                }
                FieldTreatment::Nothing => {}
            }
            parts.push(part);
        }
        let mut layout = RowLayout::named(names.iter().map(String::as_str));
        if parts.contains(&FieldTreatment::Packed) && layout.roles.contains(&Role::Color(0)) {
            layout.scale = Some(ColorScale::Byte);
        }
        Self {
            layout,
            parts,
            row: Vec::new(),
        }
    }

    /// Adds red, green and blue of the bits 0xRRGGBB to the row.
    fn packed(&mut self, bits: u32) {
        self.row
            .extend([16, 8, 0].map(|s| f64::from(bits >> s & 0xff)));
    }

    /// Reads rows of text.
    fn ascii(
        &mut self,
        input: &mut Input<'_>,
        header: &PcdHeader,
        collector: &mut Collector,
    ) -> Result<()> {
        let mut words = Words::new();
        for i in 0..header.points {
            self.row.clear();
            for (f, field) in header.fields.iter().enumerate() {
                for _ in 0..field.count {
                    let missing = || format!("{i} of {} points are there", header.points);
                    let v = words.number(input, missing)?;
                    match self.parts[f] {
                        FieldTreatment::Values => self.row.push(v),
                        FieldTreatment::Packed => self.packed(color_bits(field, v)),
                        FieldTreatment::Nothing => {}
                    }
                }
            }
            self.layout.offer(collector, &self.row);
        }
        Ok(())
    }

    /// Reads rows of bytes.
    fn binary(
        &mut self,
        input: &mut Input<'_>,
        header: &PcdHeader,
        collector: &mut Collector,
    ) -> Result<()> {
        let mut bytes = vec![0; header.stride()];
        for i in 0..header.points {
            input.exact(&mut bytes, || {
                format!("{i} of {} points are there", header.points)
            })?;
            self.row.clear();
            let mut at = 0;
            for (f, field) in header.fields.iter().enumerate() {
                for _ in 0..field.count {
                    self.value(field, self.parts[f], &bytes[at..]);
                    at += field.size();
                }
            }
            self.layout.offer(collector, &self.row);
        }
        Ok(())
    }

    /// Decodes a value of a field from the first bytes.
    fn value(&mut self, field: &PcdField, part: FieldTreatment, bytes: &[u8]) {
        match part {
            FieldTreatment::Values => self.row.push(field.kind.decode(bytes, false)),
            FieldTreatment::Packed => {
                self.packed(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
            }
            FieldTreatment::Nothing => {}
        }
    }

    /// Reads LZF-compressed data: all values of the first field, then all of the second, …
    fn compressed(
        &mut self,
        input: &mut Input<'_>,
        header: &PcdHeader,
        collector: &mut Collector,
    ) -> Result<()> {
        if header.points == 0 {
            return Ok(());
        }
        let data = unpack(input, header)?;
        // `unpack` has compared the number of points with the bytes present.
        let n = header.points as usize;
        for i in 0..n {
            self.row.clear();
            let mut start = 0;
            for (f, field) in header.fields.iter().enumerate() {
                let (size, block) = (field.size(), field.size() * field.count);
                for k in 0..field.count {
                    let at = start + i * block + k * size;
                    self.value(field, self.parts[f], &data[at..]);
                }
                start += n * block;
            }
            self.layout.offer(collector, &self.row);
        }
        Ok(())
    }
}

/// Decompresses the data of a file: two sizes, then the compressed bytes.
fn unpack(input: &mut Input<'_>, header: &PcdHeader) -> Result<Vec<u8>> {
    let start = input.at_byte();
    let corrupt = |input: &Input<'_>, why: String| {
        Err(input.error(
            ErrorKind::Corrupt,
            start,
            "cannot unpack the PCD data",
            why,
            "get the file again, or save it uncompressed",
        ))
    };
    let mut sizes = [0; 8];
    input.exact(&mut sizes, || {
        "the sizes of the compressed data are missing".into()
    })?;
    let [packed, unpacked] =
        [0, 4].map(|k| u32::from_le_bytes(std::array::from_fn(|i| sizes[k + i])));
    let (n, stride) = (header.points, header.stride());
    if n.checked_mul(stride as u64) != Some(u64::from(unpacked)) {
        let why = format!("{n} points of {stride} bytes are not {unpacked} bytes");
        return corrupt(input, why);
    }
    if u64::from(packed) > input.left() {
        return Err(input.truncated(format!(
            "{packed} bytes of compressed data are announced, {} are there",
            input.left()
        )));
    }
    let mut bytes = vec![0; packed as usize];
    input.exact(&mut bytes, || "compressed data is missing".into())?;
    let damaged = || format!("the compressed data is damaged: it does not give {unpacked} bytes");
    lzf::unpack(&bytes, unpacked as usize).map_or_else(|| corrupt(input, damaged()), Ok)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn read_all(bytes: &[u8]) -> Result<(PointCloud, ReadReport)> {
        crate::read(
            Source::Bytes {
                name: "t.pcd",
                bytes,
            },
            None,
            &ReadOptions::default(),
        )
    }

    #[test]
    fn ascii_with_descriptors_and_packed_colours() {
        let text = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb normal_x normal_y normal_z h _\nSIZE 4 4 4 4 4 4 4 4 1\nTYPE F F F F F F F F U\n\
            COUNT 1 1 1 1 1 1 1 2 3\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n\
            1 2 3 4.2108e+06 0 0 1 8 9 0 0 0\nnan nan nan 0 0 0 0 0 0 0 0 0\n4 5 6 2.34e-38 0 1 0 6 7 0 0 0\n";
        let (cloud, report) = read_all(text.as_bytes()).expect("valid");
        assert_eq!(cloud.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(report.dropped_points, 1);
        assert_eq!(cloud.colors[0], [64, 64, 112]);
        let bits = 2.34e-38_f32.to_bits();
        assert_eq!(
            cloud.colors[1],
            [(bits >> 16) as u8, (bits >> 8) as u8, bits as u8]
        );
        assert_eq!(cloud.normals[1], [0.0, 1.0, 0.0]);
        assert_eq!(cloud.columns[1].values, [9.0, 7.0]);
    }

    #[test]
    fn binary_and_compressed_agree() {
        let head = "# .PCD v0.7\nFIELDS x y z label\nSIZE 4 8 4 2\nTYPE F F F U\nCOUNT 1 1 1 1\nPOINTS 2\nDATA ";
        let mut plain = format!("{head}binary\n").into_bytes();
        for i in 1..=2_u16 {
            plain.extend(f32::from(i).to_le_bytes());
            plain.extend(f64::from(i * 10).to_le_bytes());
            plain.extend(f32::from(i * 100).to_le_bytes());
            plain.extend((i + 7).to_le_bytes());
        }
        let (cloud, _) = read_all(&plain).expect("valid");
        assert_eq!(cloud.points, [[1.0, 10.0, 100.0], [2.0, 20.0, 200.0]]);
        assert_eq!(cloud.columns[0].values, [8.0, 9.0]);
        let mut by_field = Vec::new();
        [1.0_f32, 2.0]
            .iter()
            .for_each(|v| by_field.extend(v.to_le_bytes()));
        [10.0_f64, 20.0]
            .iter()
            .for_each(|v| by_field.extend(v.to_le_bytes()));
        [100.0_f32, 200.0]
            .iter()
            .for_each(|v| by_field.extend(v.to_le_bytes()));
        [8_u16, 9]
            .iter()
            .for_each(|v| by_field.extend(v.to_le_bytes()));
        let mut packed = Vec::new();
        for run in by_field.chunks(32) {
            packed.push(run.len() as u8 - 1);
            packed.extend(run);
        }
        let mut bytes = format!("{head}binary_compressed\n").into_bytes();
        bytes.extend((packed.len() as u32).to_le_bytes());
        bytes.extend((by_field.len() as u32).to_le_bytes());
        bytes.extend(&packed);
        assert_eq!(read_all(&bytes).expect("valid").0, cloud);
        bytes.pop();
        assert_eq!(
            read_all(&bytes).expect_err("short").code(),
            "file-truncated"
        );
        plain.pop();
        assert_eq!(
            read_all(&plain).expect_err("short").code(),
            "file-truncated"
        );
    }

    #[test]
    fn announced_sizes_are_not_believed() {
        let case = |fields: &str, rest: &str| {
            read_all(format!("# .PCD v0.7\nFIELDS {fields}\n{rest}").as_bytes())
                .expect_err("invalid")
                .code()
        };
        let most = u64::MAX;
        assert_eq!(
            case(
                "x y z",
                &format!("SIZE 4 4 4\nTYPE F F F\nPOINTS {most}\nDATA binary\nabc")
            ),
            "file-truncated"
        );
        assert_eq!(
            case(
                "x y z",
                &format!("SIZE 4 4 4\nTYPE F F F\nWIDTH {most}\nHEIGHT 2\nDATA binary\nabc")
            ),
            "bad-header"
        );
        assert_eq!(
            case(
                "x y z",
                &format!("SIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 {most}\nPOINTS 1\nDATA binary\nabc")
            ),
            "bad-header"
        );
        assert_eq!(
            case("x y", "SIZE 4 4\nTYPE F F\nPOINTS 0\nDATA ascii\n"),
            "bad-header"
        );
        assert_eq!(
            case("x y z", "SIZE 4 4 4\nTYPE F F\nPOINTS 0\nDATA binary\n"),
            "bad-header"
        );
        assert_eq!(
            case(
                "x y z",
                &format!("SIZE 4 4 4\nTYPE F F F\nPOINTS {most}\nDATA binary_compressed\n01234567")
            ),
            "file-corrupt"
        );
    }
}
