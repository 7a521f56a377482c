//! PCD (Point Cloud Library): ASCII, binary (streamed) and binary_compressed (LZF, held), versions
//! 0.5 to 0.7.

use crate::collect::{Collector, ColorScale};
use crate::format::Sniff;
use crate::input::{Input, Result, Words, shorten};
use crate::roles::{Layout, Role};
use crate::{At, ErrorKind, ReadOptions, ReadReport};
use isoform_geom::PointCloud;

const WHAT: &str = "cannot read the PCD file";
/// Values of a row; descriptors such as VFH have 308.
const MAX_VALUES: u64 = 4096;
/// Fields with more values than this are descriptors, not columns.
const MAX_COUNT: u64 = 8;

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

#[derive(Clone, Copy, Debug, PartialEq)]
enum Data {
    Ascii,
    Binary,
    Compressed,
}

#[derive(Clone, Debug)]
struct Field {
    name: String,
    /// Bytes per value: 1, 2, 4 or 8.
    size: usize,
    /// `F`, `I` or `U`.
    kind: u8,
    /// Values per point.
    count: usize,
}

impl Field {
    #[inline]
    fn decode(&self, b: &[u8]) -> f64 {
        fn take<const N: usize>(b: &[u8]) -> [u8; N] {
            std::array::from_fn(|i| b[i])
        }
        match (self.kind, self.size) {
            (b'F', 4) => f64::from(f32::from_le_bytes(take(b))),
            (b'F', _) => f64::from_le_bytes(take(b)),
            (b'I', 1) => f64::from(b[0] as i8),
            (b'I', 2) => f64::from(i16::from_le_bytes(take(b))),
            (b'I', 4) => f64::from(i32::from_le_bytes(take(b))),
            (b'I', _) => i64::from_le_bytes(take(b)) as f64,
            (_, 1) => f64::from(b[0]),
            (_, 2) => f64::from(u16::from_le_bytes(take(b))),
            (_, 4) => f64::from(u32::from_le_bytes(take(b))),
            (_, _) => u64::from_le_bytes(take(b)) as f64,
        }
    }
    /// Colour packed as 0xAARRGGBB in an integer or in the bits of a float.
    fn is_packed_color(&self) -> bool {
        matches!(self.name.as_str(), "rgb" | "rgba") && self.size == 4 && self.count == 1
    }
}

struct Header {
    fields: Vec<Field>,
    points: u64,
    data: Data,
}

impl Header {
    fn stride(&self) -> usize {
        self.fields.iter().map(|f| f.size * f.count).sum()
    }
}

fn header(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Header> {
    let bad = |input: &Input<'_>, why: String| {
        input.error(
            ErrorKind::Header,
            input.at_line(0),
            WHAT,
            why,
            "save the file again",
        )
    };
    let (mut text, mut bytes) = (String::new(), Vec::new());
    let (mut names, mut sizes, mut kinds, mut counts) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut points, mut grid) = (None, [None, None]);
    let data = loop {
        if input.line > 100 || !input.read_line(&mut text, &mut bytes)? {
            return Err(bad(
                input,
                "there is no line DATA within the first hundred".into(),
            ));
        }
        let line = text.split('#').next().unwrap_or("");
        let mut words = line.split_ascii_whitespace();
        let Some(key) = words.next() else { continue };
        let words: Vec<&str> = words.take(MAX_VALUES as usize + 1).collect();
        let number = |input: &Input<'_>, word: Option<&&str>| match word
            .and_then(|w| w.parse::<u64>().ok())
        {
            Some(n) => Ok(n),
            None => Err(bad(input, format!("\"{}\" needs a number", shorten(key)))),
        };
        match key {
            "FIELDS" | "COLUMNS" => names = words.iter().map(|w| w.to_ascii_lowercase()).collect(),
            "SIZE" => {
                sizes = words
                    .iter()
                    .map(|w| number(input, Some(w)))
                    .collect::<Result<_>>()?
            }
            "TYPE" => {
                kinds = words
                    .iter()
                    .map(|w| w.as_bytes()[0].to_ascii_uppercase())
                    .collect()
            }
            "COUNT" => {
                counts = words
                    .iter()
                    .map(|w| number(input, Some(w)))
                    .collect::<Result<_>>()?
            }
            "WIDTH" => grid[0] = Some(number(input, words.first())?),
            "HEIGHT" => grid[1] = Some(number(input, words.first())?),
            "POINTS" => points = Some(number(input, words.first())?),
            "VIEWPOINT" => {
                if words != ["0", "0", "0", "1", "0", "0", "0"] {
                    report.warn("the VIEWPOINT is not applied to the points");
                }
            }
            "VERSION" => {}
            "DATA" => match words.first().map(|w| w.to_ascii_lowercase()).as_deref() {
                Some("ascii") => break Data::Ascii,
                Some("binary") => break Data::Binary,
                Some("binary_compressed") => break Data::Compressed,
                _ => {
                    return Err(bad(
                        input,
                        "DATA is none of ascii, binary, binary_compressed".into(),
                    ));
                }
            },
            _ => report.warn(format!(
                "line {}: unknown header word \"{}\" was passed over",
                input.line,
                shorten(key)
            )),
        }
    };
    if names.is_empty() {
        return Err(bad(input, "the line FIELDS is missing".into()));
    }
    counts.resize(
        if counts.is_empty() {
            names.len()
        } else {
            counts.len()
        },
        1,
    );
    if data == Data::Ascii {
        // Text needs neither.
        sizes.resize(
            if sizes.is_empty() {
                names.len()
            } else {
                sizes.len()
            },
            4,
        );
        kinds.resize(
            if kinds.is_empty() {
                names.len()
            } else {
                kinds.len()
            },
            b'F',
        );
    }
    if [sizes.len(), kinds.len(), counts.len()] != [names.len(); 3] {
        let why = format!(
            "{} FIELDS, {} SIZE, {} TYPE, {} COUNT",
            names.len(),
            sizes.len(),
            kinds.len(),
            counts.len()
        );
        return Err(bad(input, why));
    }
    let mut fields = Vec::new();
    let mut values = 0_u64;
    for (i, name) in names.into_iter().enumerate() {
        let good = matches!(
            (kinds[i], sizes[i]),
            (b'I' | b'U', 1 | 2 | 4 | 8) | (b'F', 4 | 8)
        );
        values = values.saturating_add(counts[i]);
        if !good || values > MAX_VALUES {
            let why = format!(
                "field \"{}\" of type {}, size {}, count {}",
                shorten(&name),
                char::from(kinds[i]),
                sizes[i],
                counts[i]
            );
            return Err(bad(input, why));
        }
        fields.push(Field {
            name,
            size: sizes[i] as usize,
            kind: kinds[i],
            count: counts[i] as usize,
        });
    }
    let by_grid = match grid {
        [Some(w), h] => w.checked_mul(h.unwrap_or(1)),
        _ => None,
    };
    match points.or(by_grid) {
        Some(points) => Ok(Header {
            fields,
            points,
            data,
        }),
        None => Err(bad(input, "neither POINTS nor WIDTH and HEIGHT".into())),
    }
}

pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    let header = header(input, report)?;
    report.declared = Some(header.points);
    let mut reader = Reader::new(&header, report);
    if let Some(name) = reader.layout.missing_coordinate() {
        let why = format!("there is no field \"{name}\"");
        return Err(input.error(
            ErrorKind::Header,
            At::File,
            WHAT,
            why,
            "points need x, y and z",
        ));
    }
    let mut collector = Collector::new(options);
    reader.layout.announce(&mut collector);
    match header.data {
        Data::Ascii => reader.ascii(input, &header, &mut collector)?,
        Data::Binary => reader.binary(input, &header, &mut collector)?,
        Data::Compressed => reader.compressed(input, &header, &mut collector)?,
    }
    collector.finish(input, options, report)
}

/// Rows of values by field to rows of the layout.
struct Reader {
    layout: Layout,
    /// Per field: whether its values are in the row, or three out of a packed colour.
    parts: Vec<Part>,
    row: Vec<f64>,
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    Values,
    Packed,
    Nothing,
}

impl Reader {
    fn new(header: &Header, report: &mut ReadReport) -> Self {
        let mut names: Vec<String> = Vec::new();
        let mut parts = Vec::new();
        let mut packed = false;
        for field in &header.fields {
            parts.push(if field.is_packed_color() && !packed {
                packed = true;
                names.extend(["red", "green", "blue"].map(String::from));
                Part::Packed
            } else if field.name == "_" || field.count == 0 {
                Part::Nothing
            } else if field.count as u64 > MAX_COUNT {
                report.warn(format!(
                    "field \"{}\" with {} values per point was passed over",
                    shorten(&field.name),
                    field.count
                ));
                Part::Nothing
            } else {
                match field.count {
                    1 => names.push(field.name.clone()),
                    n => names.extend((0..n).map(|k| format!("{}_{k}", field.name))),
                }
                Part::Values
            });
        }
        let mut layout = Layout::named(names.iter().map(String::as_str));
        if packed && layout.roles.contains(&Role::Color(0)) {
            layout.scale = Some(ColorScale::Byte);
        }
        Self {
            layout,
            parts,
            row: Vec::new(),
        }
    }

    fn packed(&mut self, bits: u32) {
        self.row
            .extend([16, 8, 0].map(|s| f64::from(bits >> s & 0xff)));
    }

    fn ascii(
        &mut self,
        input: &mut Input<'_>,
        header: &Header,
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
                        Part::Values => self.row.push(v),
                        // Integers as such, or the float whose bits they are (then it is tiny, or
                        // not a whole number).
                        Part::Packed
                            if field.kind == b'F'
                                && !(v >= 1.0 && v.fract() == 0.0 && v <= f64::from(u32::MAX)) =>
                        {
                            self.packed((v as f32).to_bits());
                        }
                        Part::Packed => self.packed(v as i64 as u32),
                        Part::Nothing => {}
                    }
                }
            }
            self.layout.offer(collector, &self.row);
        }
        Ok(())
    }

    fn binary(
        &mut self,
        input: &mut Input<'_>,
        header: &Header,
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
                    at += field.size;
                }
            }
            self.layout.offer(collector, &self.row);
        }
        Ok(())
    }

    fn value(&mut self, field: &Field, part: Part, bytes: &[u8]) {
        match part {
            Part::Values => self.row.push(field.decode(bytes)),
            Part::Packed => {
                self.packed(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
            }
            Part::Nothing => {}
        }
    }

    /// All of the first field, then all of the second, …, packed by LZF.
    fn compressed(
        &mut self,
        input: &mut Input<'_>,
        header: &Header,
        collector: &mut Collector,
    ) -> Result<()> {
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
        if header.points == 0 {
            return Ok(());
        }
        let mut sizes = [0; 8];
        input.exact(&mut sizes, || {
            "the sizes of the compressed data are missing".into()
        })?;
        let [packed, unpacked] = [0, 4]
            .map(|k| u32::from_le_bytes([sizes[k], sizes[k + 1], sizes[k + 2], sizes[k + 3]]));
        let n = header.points;
        if n.checked_mul(header.stride() as u64) != Some(u64::from(unpacked)) {
            return corrupt(
                input,
                format!(
                    "{n} points of {} bytes are not {unpacked} bytes",
                    header.stride()
                ),
            );
        }
        if u64::from(packed) > input.left() {
            return Err(input.truncated(format!(
                "{packed} bytes of compressed data are announced, {} are there",
                input.left()
            )));
        }
        let mut bytes = vec![0; packed as usize];
        input.exact(&mut bytes, || "compressed data is missing".into())?;
        let Some(data) = lzf_unpack(&bytes, unpacked as usize) else {
            return corrupt(
                input,
                format!("the compressed data is damaged: it does not give {unpacked} bytes"),
            );
        };
        let n = n as usize;
        for i in 0..n {
            self.row.clear();
            let mut start = 0;
            for (f, field) in header.fields.iter().enumerate() {
                let block = field.size * field.count;
                for k in 0..field.count {
                    self.value(
                        field,
                        self.parts[f],
                        &data[start + i * block + k * field.size..],
                    );
                }
                start += n * block;
            }
            self.layout.offer(collector, &self.row);
        }
        Ok(())
    }
}

/// Unpacks LZF (Marc Lehmann's LibLZF): a control byte below 32 starts a run of that many bytes and
/// one; else its three high bits are the length less two of a copy (7: one more byte of length)
/// from up to 8192 bytes back. `None` unless exactly `size` bytes come out.
fn lzf_unpack(packed: &[u8], size: usize) -> Option<Vec<u8>> {
    // A copy of three bytes gives 264 at most, so that a small input cannot ask for much memory.
    if size / 264 > packed.len() {
        return None;
    }
    let mut out = Vec::with_capacity(size);
    let mut rest = packed;
    while let Some((&control, after)) = rest.split_first() {
        let control = usize::from(control);
        rest = after;
        if control < 32 {
            let (run, after) = rest.split_at_checked(control + 1)?;
            out.extend_from_slice(run);
            rest = after;
        } else {
            let mut byte = || {
                let (&b, after) = rest.split_first()?;
                rest = after;
                Some(usize::from(b))
            };
            let mut length = control >> 5;
            if length == 7 {
                length += byte()?;
            }
            let back = ((control & 31) << 8) + byte()? + 1;
            let from = out.len().checked_sub(back)?;
            for k in 0..length + 2 {
                out.push(out[from + k]);
            }
        }
        if out.len() > size {
            return None;
        }
    }
    (out.len() == size).then_some(out)
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
    fn lzf() {
        assert_eq!(
            lzf_unpack(&[2, b'a', b'b', b'c', 0x20, 2], 6).as_deref(),
            Some(&b"abcabc"[..])
        );
        assert_eq!(
            lzf_unpack(&[0, b'x', 0xe0, 3, 0], 13).as_deref(),
            Some(&b"xxxxxxxxxxxxx"[..]),
            "a copy may overlap itself"
        );
        assert_eq!(lzf_unpack(&[0, b'x', 0x20, 5], 4), None, "before the start");
        assert_eq!(lzf_unpack(&[5, b'x'], 6), None);
        assert_eq!(lzf_unpack(&[0, b'x', 0xe0], 12), None);
        assert_eq!(lzf_unpack(&[], usize::MAX), None);
        assert_eq!(lzf_unpack(&[], 0).as_deref(), Some(&b""[..]));
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
