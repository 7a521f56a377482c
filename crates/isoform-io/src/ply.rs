//! PLY, the Stanford polygon format (Turk 1994): ASCII and binary of both byte orders, streamed.
//!
//! Elements may come in any order and have any properties. Every scalar of the vertices becomes a
//! position, a normal, a colour or a column; `vertex_indices` of the faces becomes triangles
//! (fans), as does `tristrips`; everything else is skipped.

mod header;
mod rows;
mod write;

pub(crate) use write::write;

use crate::binary::NumberType;
use crate::collect::{Collector, ColorScale, TriangleParts};
use crate::format::Sniff;
use crate::input::{Input, Result, shorten};
use crate::roles::{Role, RowLayout};
use crate::{At, ErrorKind, ReadError, ReadOptions, ReadReport};
use header::{PartNames, PlyElement, PlyEncoding, PlyHeader, Property};
use isoform_geom::PointCloud;
use rows::PlyRows;
use std::collections::BTreeMap;

const PLY_HEADER_FAILURE: &str = "cannot read the PLY header";

/// Returns `Yes` for the magic word on a line of its own.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    if head.starts_with(b"ply\n") || head.starts_with(b"ply\r") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// Reads points and triangles.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    read_parts(input, options, report).map(|(cloud, _)| cloud)
}

/// Reads points, triangles and their groups.
pub(crate) fn read_parts(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<(PointCloud, TriangleParts)> {
    let header = PlyHeader::read(input, report)?;
    let vertex = header.vertices();
    let mut collector = Collector::new(options);
    match vertex {
        None => report.warn("the header declares no element \"vertex\""),
        Some(v) => report.declared = Some(header.elements[v].count),
    }
    if header.elements.iter().any(PlyElement::is_face) {
        collector.mesh(options);
    }
    let mut rows = PlyRows::new(header.encoding);
    for (i, element) in header.elements.iter().enumerate() {
        if Some(i) == vertex {
            read_vertices(input, &mut rows, element, &mut collector, report)?;
        } else if element.is_face() {
            let parts = FaceParts::from_element(element, &header.part_names, &mut collector);
            read_faces(input, &mut rows, element, parts, &mut collector, report)?;
        } else if element.count > 0 && !element.properties.is_empty() {
            report.warn(format!(
                "element \"{}\" ({} rows) was passed over",
                shorten(&element.name),
                element.count
            ));
            rows.skip(input, element)?;
        }
    }
    if rows.has_more(input)? {
        report.warn(
            "there is more data after the last element that the header declares; it was not read",
        );
    }
    collector.finish_with_parts(input, options, report)
}

/// Passes all vertices as rows of their properties to the collector.
fn read_vertices(
    input: &mut Input<'_>,
    rows: &mut PlyRows,
    element: &PlyElement,
    collector: &mut Collector,
    report: &mut ReadReport,
) -> Result<()> {
    let mut layout = vertex_layout(element, report);
    if let Some(name) = layout.missing_coordinate() {
        if element.count == 0 {
            return Ok(());
        }
        let why = format!("the vertices have no property \"{name}\"");
        let hint = "vertices need x, y and z";
        return Err(input.error(ErrorKind::Header, At::File, PLY_HEADER_FAILURE, why, hint));
    }
    layout.announce(collector);
    for i in 0..element.count {
        rows.next(input, element, i, None)?;
        layout.offer(collector, &rows.values);
    }
    Ok(())
}

/// Returns the layout of the properties of the vertices; lists are skipped.
fn vertex_layout(element: &PlyElement, report: &mut ReadReport) -> RowLayout {
    let mut layout = RowLayout::named(element.properties.iter().map(|p| p.name.as_str()));
    for (i, p) in element.properties.iter().enumerate() {
        if p.list.is_some() {
            report.warn(format!(
                "the list \"{}\" of the vertices was passed over",
                shorten(&p.name)
            ));
            layout.ignore(i);
        } else if matches!(layout.roles[i], Role::Color(_)) {
            layout.scale = Some(match p.kind {
                NumberType::U8 | NumberType::I8 => ColorScale::Byte,
                NumberType::F32 | NumberType::F64 => ColorScale::Guess,
                _ => ColorScale::Word,
            });
        }
    }
    layout
}

/// Parts of faces: the property with their tags, and the part indices by tag.
struct FaceParts {
    /// Index of the tag among the properties.
    property: Option<usize>,
    /// Part index in the collector, by tag.
    numbers: BTreeMap<i64, u32>,
}

impl FaceParts {
    /// Adds the parts named in comments to the collector; other tags get parts when they occur.
    fn from_element(element: &PlyElement, names: &PartNames, collector: &mut Collector) -> Self {
        let is_part = |p: &Property| p.list.is_none() && p.name == "part";
        let property = element.properties.iter().position(is_part);
        // Faces without the list of corners are skipped, and their parts with them.
        let numbers = match property {
            Some(_) if element.corners().is_some() => names
                .iter()
                .map(|(&tag, name)| (tag, collector.add_part(name)))
                .collect(),
            _ => BTreeMap::new(),
        };
        Self { property, numbers }
    }
    /// Assigns the following face, by its values, to its part.
    fn set(&mut self, values: &[f64], collector: &mut Collector) {
        if let Some(property) = self.property {
            let tag = values[property] as i64;
            let number = *self
                .numbers
                .entry(tag)
                .or_insert_with(|| collector.add_part(&format!("part {tag}")));
            collector.set_part(number);
        }
    }
}

/// Reads all faces or strips of an element as polygons.
fn read_faces(
    input: &mut Input<'_>,
    rows: &mut PlyRows,
    element: &PlyElement,
    mut parts: FaceParts,
    collector: &mut Collector,
    report: &mut ReadReport,
) -> Result<()> {
    let Some(corners) = element.corners() else {
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
    let mut polygon: Vec<u64> = Vec::new();
    for i in 0..element.count {
        let start = input.at_byte();
        rows.next(input, element, i, Some(corners))?;
        let at = if rows.encoding == PlyEncoding::Ascii {
            input.at_line(0)
        } else {
            start
        };
        parts.set(&rows.values, collector);
        // A strip ends at −1, any other polygon at the end of its list.
        for list in rows.list.split(|&v| is_strip && v == -1.0) {
            polygon.clear();
            for &v in list {
                polygon.push(index(v).ok_or_else(|| no_index(input, v, at))?);
            }
            if is_strip {
                strip(collector, &polygon, at);
            } else {
                collector.polygon(&polygon, at);
            }
        }
    }
    Ok(())
}

/// Converts a number to an index from 0; `None` if it is not one.
fn index(v: f64) -> Option<u64> {
    (v >= 0.0 && v.fract() == 0.0).then_some(v as u64)
}

/// Returns the error for a corner that is not an index.
fn no_index(input: &Input<'_>, v: f64, at: At) -> ReadError {
    let why = format!("{v} is not the index of a vertex");
    let hint = "export the mesh again";
    input.error(ErrorKind::Index, at, "cannot read the faces", why, hint)
}

/// Adds the triangles of a strip; every other one is reversed.
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
