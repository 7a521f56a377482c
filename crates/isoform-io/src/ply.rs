//! PLY, the Stanford polygon format (Turk 1994): ASCII and binary of both byte orders, streamed.
//!
//! Elements may come in any order and have any properties: of the vertices every scalar becomes a
//! position, a normal, a colour or a column; of the faces `vertex_indices` becomes triangles
//! (fans); of `tristrips` too; everything else is passed over.

use crate::binary::Type;
use crate::collect::{Collector, ColorScale, Parts};
use crate::format::Sniff;
use crate::input::{Input, Result, Words, shorten, stated_unit};
use crate::roles::{Layout, Role};
use crate::{At, ErrorKind, ReadOptions, ReadReport, WriteOptions};
use isoform_geom::PointCloud;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// More header lines than any true file has.
const MAX_HEADER_LINES: usize = 10_000;
const WHAT: &str = "cannot read the PLY header";

pub(crate) fn sniff(head: &[u8]) -> Sniff {
    if head.starts_with(b"ply\n") || head.starts_with(b"ply\r") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Debug)]
struct Property {
    name: String,
    kind: Type,
    /// Type of the length, for lists.
    list: Option<Type>,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Bytes of a row, if it has no lists.
    fn stride(&self) -> Option<usize> {
        self.properties.iter().try_fold(0_usize, |sum, p| {
            if p.list.is_some() {
                None
            } else {
                Some(sum + p.kind.size())
            }
        })
    }
}

pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    read_parts(input, options, report).map(|(cloud, _)| cloud)
}

/// The points, the triangles and their groups.
pub(crate) fn read_parts(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<(PointCloud, Parts)> {
    let (encoding, elements, part_names) = header(input, report)?;
    let vertex = ["vertex", "vertices", "point", "points"]
        .iter()
        .find_map(|n| elements.iter().position(|e| e.name == *n));
    let mut collector = Collector::new(options);
    match vertex {
        None => report.warn("the header declares no element \"vertex\""),
        Some(v) => report.declared = Some(elements[v].count),
    }
    let is_face =
        |e: &Element| matches!(e.name.as_str(), "face" | "faces" | "tristrips") && e.count > 0;
    if elements.iter().any(is_face) {
        collector.mesh(options);
    }
    let mut rows = Rows {
        encoding,
        words: Words::new(),
        row: Vec::new(),
        values: Vec::new(),
        list: Vec::new(),
    };
    for (i, element) in elements.iter().enumerate() {
        if Some(i) == vertex {
            read_vertices(input, &mut rows, element, &mut collector, report)?;
        } else if is_face(element) {
            read_faces(
                input,
                &mut rows,
                element,
                &part_names,
                &mut collector,
                report,
            )?;
        } else if element.count > 0 && !element.properties.is_empty() {
            report.warn(format!(
                "element \"{}\" ({} rows) was passed over",
                shorten(&element.name),
                element.count
            ));
            rows.skip(input, element)?;
        }
    }
    let rest = if encoding == Encoding::Ascii {
        u64::from(rows.words.next(input)?.is_some())
    } else {
        input.left()
    };
    if rest > 0 {
        report.warn(
            "there is more data after the last element that the header declares; it was not read",
        );
    }
    collector.finish_with_parts(input, options, report)
}

/// Names of parts by their tags, out of comments `part 1 name` as our own writer makes them.
type PartNames = BTreeMap<i64, String>;

fn header(
    input: &mut Input<'_>,
    report: &mut ReadReport,
) -> Result<(Encoding, Vec<Element>, PartNames)> {
    let bad = |input: &Input<'_>, why: String| {
        input.error(
            ErrorKind::Header,
            input.at_line(0),
            WHAT,
            why,
            "save the file again, as binary PLY if there is a choice",
        )
    };
    let (mut text, mut bytes) = (String::new(), Vec::new());
    if !input.read_line(&mut text, &mut bytes)? || text.trim_end() != "ply" {
        return Err(bad(
            input,
            format!(
                "a PLY file starts with the line \"ply\", this one with \"{}\"",
                shorten(&text)
            ),
        ));
    }
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut part_names = PartNames::new();
    loop {
        if !input.read_line(&mut text, &mut bytes)? {
            return Err(input.error(
                ErrorKind::Truncated,
                input.at_byte(),
                WHAT,
                "there is no line \"end_header\"",
                "get the file again",
            ));
        }
        if input.line as usize > MAX_HEADER_LINES {
            return Err(bad(
                input,
                format!("the header has more than {MAX_HEADER_LINES} lines"),
            ));
        }
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words[..] {
            ["format", kind, ..] => {
                encoding = Some(match kind {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => {
                        return Err(bad(
                            input,
                            format!("unknown encoding \"{}\"", shorten(kind)),
                        ));
                    }
                });
            }
            ["element", name, count, ..] => match count.parse() {
                Ok(count) => elements.push(Element {
                    name: name.to_ascii_lowercase(),
                    count,
                    properties: Vec::new(),
                }),
                Err(_) => {
                    return Err(bad(
                        input,
                        format!("\"{}\" is not a number of elements", shorten(count)),
                    ));
                }
            },
            ["property", "list", length, kind, name, ..] => {
                let types = (Type::named(length), Type::named(kind));
                let (Some(length), Some(kind)) = types else {
                    return Err(bad(
                        input,
                        format!("unknown type in the list property \"{}\"", shorten(name)),
                    ));
                };
                let Some(element) = elements.last_mut() else {
                    return Err(bad(input, "a property before any element".into()));
                };
                element.properties.push(Property {
                    name: name.into(),
                    kind,
                    list: Some(length),
                });
            }
            ["property", kind, name, ..] => {
                let Some(known) = Type::named(kind) else {
                    return Err(bad(
                        input,
                        format!(
                            "unknown type \"{}\" of the property \"{}\"",
                            shorten(kind),
                            shorten(name)
                        ),
                    ));
                };
                let Some(element) = elements.last_mut() else {
                    return Err(bad(input, "a property before any element".into()));
                };
                element.properties.push(Property {
                    name: name.into(),
                    kind: known,
                    list: None,
                });
            }
            ["comment", "part", tag, _, ..] if tag.parse::<i64>().is_ok() => {
                let name = text.splitn(4, ' ').nth(3).unwrap_or("");
                part_names.insert(tag.parse().unwrap_or(0), name.to_owned());
            }
            ["comment" | "obj_info", ..] => {
                report.units = report.units.take().or_else(|| stated_unit(&text));
            }
            ["end_header", ..] => break,
            [] => {}
            ["element" | "property" | "format", ..] => {
                return Err(bad(
                    input,
                    format!("incomplete line \"{}\"", shorten(&text)),
                ));
            }
            // Seen in the wild: "remark" for "comment". What is no declaration cannot change the
            // layout.
            [word, ..] => report.warn(format!(
                "line {}: unknown header word \"{}\" was passed over",
                input.line,
                shorten(word)
            )),
        }
    }
    let encoding = encoding.ok_or_else(|| bad(input, "the line \"format\" is missing".into()))?;
    Ok((encoding, elements, part_names))
}

/// Reads rows of one element after another.
struct Rows {
    encoding: Encoding,
    words: Words,
    row: Vec<u8>,
    /// Scalars of the row by property; NaN for lists.
    values: Vec<f64>,
    /// Items of the list that was asked for.
    list: Vec<f64>,
}

impl Rows {
    /// Reads row `i`: scalars into `values`, the items of property `wanted` into `list`.
    fn next(
        &mut self,
        input: &mut Input<'_>,
        element: &Element,
        i: u64,
        wanted: Option<usize>,
    ) -> Result<()> {
        let missing = || {
            format!(
                "row {i} of {} \"{}\" elements is incomplete",
                element.count,
                shorten(&element.name)
            )
        };
        self.values.clear();
        self.list.clear();
        let big = self.encoding == Encoding::Big;
        if self.encoding != Encoding::Ascii
            && let Some(stride) = element.stride()
        {
            self.row.resize(stride, 0);
            input.exact(&mut self.row, missing)?;
            let mut at = 0;
            for p in &element.properties {
                self.values.push(p.kind.decode(&self.row[at..], big));
                at += p.kind.size();
            }
            return Ok(());
        }
        for (k, p) in element.properties.iter().enumerate() {
            let Some(length) = p.list else {
                let v = self.number(input, p.kind, big, missing)?;
                self.values.push(v);
                continue;
            };
            self.values.push(f64::NAN);
            let place = input.at_byte();
            let n = self.number(input, length, big, missing)?;
            if !(n >= 0.0 && n <= u64::MAX as f64 && n.fract() == 0.0) {
                let why = format!("{n} is not the length of a list");
                return Err(input.error(
                    ErrorKind::Corrupt,
                    place,
                    "cannot read the PLY data",
                    why,
                    "get the file again",
                ));
            }
            for _ in 0..n as u64 {
                let v = self.number(input, p.kind, big, missing)?;
                if wanted == Some(k) {
                    self.list.push(v);
                }
            }
        }
        Ok(())
    }
    fn number(
        &mut self,
        input: &mut Input<'_>,
        kind: Type,
        big: bool,
        missing: impl Fn() -> String,
    ) -> Result<f64> {
        if self.encoding == Encoding::Ascii {
            let Some(word) = self.words.next(input)? else {
                return Err(input.truncated(missing()));
            };
            // `bool` properties come as words from some writers.
            if let Some(v) = crate::input::parse_number(word).or_else(|| {
                word.to_ascii_lowercase()
                    .parse::<bool>()
                    .ok()
                    .map(f64::from)
            }) {
                return Ok(v);
            }
            let why = format!("\"{}\" is not a number", shorten(word));
            let at = input.at_line(self.words.column);
            return Err(input.error(
                ErrorKind::Number,
                at,
                "cannot read the PLY data",
                why,
                "correct the line, or save the file again",
            ));
        }
        let mut bytes = [0; 8];
        input.exact(&mut bytes[..kind.size()], missing)?;
        Ok(kind.decode(&bytes, big))
    }
    fn skip(&mut self, input: &mut Input<'_>, element: &Element) -> Result<()> {
        if self.encoding != Encoding::Ascii
            && let Some(stride) = element.stride()
        {
            let missing = || {
                format!(
                    "{} \"{}\" elements are announced",
                    element.count,
                    shorten(&element.name)
                )
            };
            let bytes = element.count.saturating_mul(stride as u64);
            return input.skip(bytes, missing);
        }
        for i in 0..element.count {
            self.next(input, element, i, None)?;
        }
        Ok(())
    }
}

fn read_vertices(
    input: &mut Input<'_>,
    rows: &mut Rows,
    element: &Element,
    collector: &mut Collector,
    report: &mut ReadReport,
) -> Result<()> {
    let mut layout = Layout::named(element.properties.iter().map(|p| p.name.as_str()));
    for (i, p) in element.properties.iter().enumerate() {
        if p.list.is_some() {
            report.warn(format!(
                "the list \"{}\" of the vertices was passed over",
                shorten(&p.name)
            ));
            layout.ignore(i);
        } else if matches!(layout.roles[i], Role::Color(_)) {
            layout.scale = Some(match p.kind {
                Type::U8 | Type::I8 => ColorScale::Byte,
                Type::F32 | Type::F64 => ColorScale::Guess,
                _ => ColorScale::Word,
            });
        }
    }
    if let Some(name) = layout.missing_coordinate() {
        if element.count == 0 {
            return Ok(());
        }
        let why = format!("the vertices have no property \"{name}\"");
        return Err(input.error(
            ErrorKind::Header,
            At::File,
            WHAT,
            why,
            "vertices need x, y and z",
        ));
    }
    layout.announce(collector);
    for i in 0..element.count {
        rows.next(input, element, i, None)?;
        layout.offer(collector, &rows.values);
    }
    Ok(())
}

fn read_faces(
    input: &mut Input<'_>,
    rows: &mut Rows,
    element: &Element,
    part_names: &PartNames,
    collector: &mut Collector,
    report: &mut ReadReport,
) -> Result<()> {
    let is_corners = |p: &Property| {
        p.list.is_some()
            && matches!(
                p.name.as_str(),
                "vertex_indices" | "vertex_index" | "vertex_indexes"
            )
    };
    let Some(corners) = element.properties.iter().position(is_corners) else {
        report.warn(format!(
            "the {} \"{}\" elements have no list \"vertex_indices\" and were passed over",
            element.count, element.name
        ));
        return if element.properties.is_empty() {
            Ok(())
        } else {
            rows.skip(input, element)
        };
    };
    let is_strip = element.name == "tristrips";
    let part = element
        .properties
        .iter()
        .position(|p| p.list.is_none() && p.name == "part");
    let mut parts: BTreeMap<i64, u32> = BTreeMap::new();
    if part.is_some() {
        parts.extend(
            part_names
                .iter()
                .map(|(&tag, name)| (tag, collector.add_part(name))),
        );
    }
    let mut polygon: Vec<u64> = Vec::new();
    for i in 0..element.count {
        let start = input.at_byte();
        rows.next(input, element, i, Some(corners))?;
        let at = if rows.encoding == Encoding::Ascii {
            input.at_line(0)
        } else {
            start
        };
        if let Some(part) = part {
            let tag = rows.values[part] as i64;
            let part = *parts
                .entry(tag)
                .or_insert_with(|| collector.add_part(&format!("part {tag}")));
            collector.set_part(part);
        }
        polygon.clear();
        for &v in &rows.list {
            if is_strip && v == -1.0 {
                strip(collector, &polygon, at);
                polygon.clear();
            } else if v >= 0.0 && v.fract() == 0.0 {
                polygon.push(v as u64);
            } else {
                let why = format!("{v} is not the index of a vertex");
                return Err(input.error(
                    ErrorKind::Index,
                    at,
                    "cannot read the faces",
                    why,
                    "export the mesh again",
                ));
            }
        }
        if is_strip {
            strip(collector, &polygon, at);
        } else {
            collector.polygon(&polygon, at);
        }
    }
    Ok(())
}

/// Triangles of a strip; every other one is turned round.
fn strip(collector: &mut Collector, strip: &[u64], at: At) {
    for (k, t) in strip.windows(3).enumerate() {
        let turned = if k % 2 == 0 {
            [t[0], t[1], t[2]]
        } else {
            [t[1], t[0], t[2]]
        };
        if turned[0] != turned[1] && turned[1] != turned[2] && turned[0] != turned[2] {
            collector.polygon(&turned, at);
        }
    }
}

/// Writes everything a cloud has; coordinates are absolute. Binary little endian, or ASCII with
/// shortest round-trip numbers.
pub(crate) fn write(
    cloud: &PointCloud,
    out: &mut dyn Write,
    options: &WriteOptions,
) -> io::Result<()> {
    let ascii = options.ascii;
    let names = crate::columns::column_names(cloud);
    writeln!(
        out,
        "ply\nformat {} 1.0",
        if ascii {
            "ascii"
        } else {
            "binary_little_endian"
        }
    )?;
    writeln!(out, "comment written by isoform")?;
    if let Some(units) = &options.units {
        writeln!(out, "comment units: {}", units.replace(['\n', '\r'], " "))?;
    }
    writeln!(out, "element vertex {}", cloud.points.len())?;
    for name in &names.positions {
        writeln!(out, "property double {name}")?;
    }
    for name in &names.normals {
        writeln!(out, "property double {name}")?;
    }
    for name in &names.colors {
        writeln!(out, "property uchar {name}")?;
    }
    for name in &names.columns {
        writeln!(out, "property double {name}")?;
    }
    if !cloud.triangles.is_empty() {
        writeln!(
            out,
            "element face {}\nproperty list uchar int vertex_indices",
            cloud.triangles.len()
        )?;
    }
    writeln!(out, "end_header")?;
    let mut row = Vec::new();
    for i in 0..cloud.points.len() {
        let numbers = cloud
            .absolute(i)
            .into_iter()
            .chain(cloud.normals.get(i).into_iter().flatten().copied());
        let extra = cloud.columns.iter().map(|c| c.values[i]);
        let color = cloud.colors.get(i).into_iter().flatten();
        if ascii {
            crate::columns::row(out, b' ', numbers, color.copied(), extra, &mut row)?;
            continue;
        }
        row.clear();
        numbers.for_each(|v| row.extend_from_slice(&v.to_le_bytes()));
        row.extend(color);
        extra.for_each(|v| row.extend_from_slice(&v.to_le_bytes()));
        out.write_all(&row)?;
    }
    for t in &cloud.triangles {
        if ascii {
            writeln!(out, "3 {} {} {}", t[0], t[1], t[2])?;
        } else {
            row.clear();
            row.push(3);
            t.iter()
                .for_each(|c| row.extend_from_slice(&c.to_le_bytes()));
            out.write_all(&row)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn read_all(bytes: &[u8]) -> Result<(PointCloud, ReadReport)> {
        crate::read(
            Source::Bytes {
                name: "t.ply",
                bytes,
            },
            None,
            &ReadOptions::default(),
        )
    }

    #[test]
    fn faces_before_vertices_lists_and_odd_properties() {
        let text = b"ply\nformat ascii 1.0\nelement face 2\nproperty list uchar int vertex_index\nproperty float quality\n\
            element camera 1\nproperty list uchar double k\nelement vertex 4\nproperty double z\nproperty bool keep\nproperty double x\n\
            property double y\nproperty list uchar int neighbours\nproperty ushort red\nproperty ushort green\nproperty ushort blue\nend_header\n\
            4 0 1 2 3 0.5\n3 0 1 3 0.25\n2 1 2\n1 true 2 3 0 0 65535 257\n4 false 5 6 2 7 8 0 0 0\n7 1 8 9 0\n0 0 0\n10 1 11 12 0 0 0 0\n";
        let (cloud, report) = read_all(text).expect("valid");
        assert_eq!(
            cloud.points,
            [
                [2.0, 3.0, 1.0],
                [5.0, 6.0, 4.0],
                [8.0, 9.0, 7.0],
                [11.0, 12.0, 10.0]
            ]
        );
        assert_eq!(cloud.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
        assert_eq!(cloud.columns[0].name, "keep");
        assert_eq!(cloud.columns[0].values, [1.0, 0.0, 1.0, 1.0]);
        assert_eq!(cloud.colors[0], [0, 255, 1]);
        assert_eq!(report.warnings.len(), 2, "{:?}", report.warnings);
    }

    #[test]
    fn big_endian_and_strips() {
        let mut bytes = b"ply\rformat binary_big_endian 1.0\relement vertex 4\rproperty float x\rproperty double y\rproperty short z\r\
            element tristrips 1\rproperty list int int vertex_indices\rend_header\r"
            .to_vec();
        for v in [0.0_f32, 1.0, 10.0, 11.0] {
            bytes.extend(v.to_be_bytes());
            bytes.extend((f64::from(v) * 0.1).to_be_bytes());
            bytes.extend((v as i16 - 5).to_be_bytes());
        }
        for i in [4_i32, 0, 1, 2, 3] {
            bytes.extend(i.to_be_bytes());
        }
        let (cloud, _) = read_all(&bytes).expect("valid");
        assert_eq!(cloud.points[2], [10.0, 1.0, 5.0]);
        assert_eq!(cloud.triangles, [[0, 1, 2], [2, 1, 3]]);
    }

    #[test]
    fn dropped_points_take_their_triangles() {
        let text = b"ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\nproperty float t\n\
            element face 3\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1\nnan 0 0 2\n1 0 0 3\n0 1 0 4\n0 0 1 5\n\
            3 0 1 2\n3 0 2 3\n3 2 3 4\n";
        let (cloud, report) = read_all(text).expect("valid");
        assert_eq!((report.dropped_points, report.dropped_triangles), (1, 1));
        assert_eq!(cloud.triangles, [[0, 1, 2], [1, 2, 3]]);
        assert_eq!(cloud.columns[0].values, [1.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn refusals_say_where() {
        let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
        let case = |rest: &str| read_all(format!("{head}{rest}").as_bytes()).expect_err("invalid");
        let e = case("end_header\n1 2 3\n4 five 6\n");
        assert_eq!(
            (e.code(), e.place.to_string().as_str()),
            ("bad-number", "t.ply:9:3")
        );
        assert_eq!(case("end_header\n1 2 3\n4 5").code(), "file-truncated");
        assert_eq!(
            case("property quaternion q\nend_header\n").code(),
            "bad-header"
        );
        assert_eq!(case("").code(), "file-truncated");
        let faces =
            "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 1 1\n";
        let e = case(&format!("{faces}3 0 1 2\n"));
        assert_eq!(
            (e.code(), e.place.to_string().as_str()),
            ("bad-index", "t.ply:12")
        );
        assert_eq!(case(&format!("{faces}3 0 1 -2\n")).code(), "bad-index");
    }

    #[test]
    fn announced_sizes_are_not_believed() {
        let big = format!(
            "ply\nformat binary_little_endian 1.0\nelement nothing {0}\nelement vertex {0}\nproperty uchar x\n",
            u64::MAX
        );
        let e = read_all(
            format!("{big}property uchar y\nproperty uchar z\nend_header\nabc").as_bytes(),
        )
        .expect_err("short");
        assert_eq!(e.code(), "file-truncated");
        let skipped = format!(
            "ply\nformat binary_little_endian 1.0\nelement a {}\nproperty double q\nend_header\n",
            u64::MAX
        );
        assert_eq!(
            read_all(skipped.as_bytes()).expect_err("short").code(),
            "file-truncated"
        );
    }
}
