//! OBJ (Wavefront): vertices with colours, vertex normals, faces. Texture coordinates, lines and
//! free-form surfaces are skipped.
//!
//! Faces refer to vertices and normals by index, from 1 or from the end. A cloud has one normal per
//! point: normals are kept if they come in the order of the vertices, or if all faces at a vertex
//! agree, and omitted at creases. Colours after the coordinates are not part of the format, but
//! many scanners write them.

use crate::collect::{Collector, ColorScale, TriangleParts};
use crate::format::Sniff;
use crate::input::{Input, Result, parse_number, shorten, stated_unit};
use crate::{ErrorKind, ReadOptions, ReadReport};
use isoform_geom::{Point3, PointCloud};
use std::collections::HashMap;

const OBJ_FAILURE: &str = "cannot read the OBJ file";
/// Maximum number of corners of a polygon.
const MAX_CORNERS: usize = 1 << 20;

/// Returns `Maybe` if a line is a vertex of OBJ.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head);
    let is_vertex = |l: &str| {
        let mut words = l.split_ascii_whitespace();
        words.next() == Some("v")
            && words.clone().count() >= 3
            && words.take(3).all(|w| parse_number(w).is_some())
    };
    // The last line of the head may be truncated.
    if !head.contains(&0) && text.lines().any(is_vertex) {
        Sniff::Maybe
    } else {
        Sniff::No
    }
}

/// Normals as referenced by the corners of faces.
struct CornerNormals {
    /// All `vn` of the file.
    given: Vec<Point3>,
    /// Index of the normal of each vertex; `u32::MAX` while unknown.
    of_vertex: Vec<u32>,
    /// True if two corners of a vertex disagree (a crease); then points have no normals.
    differ: bool,
}

impl CornerNormals {
    /// Records the normal of a corner of a face for its vertex.
    fn corner(&mut self, vertex: u64, normal: u64) {
        let (Ok(v), Ok(n)) = (usize::try_from(vertex), u32::try_from(normal)) else {
            return;
        };
        if v >= self.of_vertex.len() || n as usize >= self.given.len() {
            return; // before its vertex: not worth a second pass
        }
        let old = self.of_vertex[v];
        if old == u32::MAX {
            self.of_vertex[v] = n;
        } else if self.given[old as usize] != self.given[n as usize] {
            self.differ = true;
        }
    }
}

/// Assignment of normals to vertices.
#[derive(Clone, Copy, PartialEq)]
enum NormalBy {
    /// The i-th normal belongs to the i-th vertex.
    Order,
    /// Corners of faces assign them.
    Face,
}

impl CornerNormals {
    /// Returns the assignment that gives each vertex one normal; `None` if neither does.
    fn per_point(&self, report: &mut ReadReport) -> Option<NormalBy> {
        if self.differ {
            report.warn(
                "the normals differ between the faces of a vertex (creases); they were left out",
            );
        }
        let mut named = self.of_vertex.iter().enumerate();
        if !self.given.is_empty()
            && self.given.len() == self.of_vertex.len()
            && named.all(|(i, &n)| n == u32::MAX || n as usize == i)
        {
            return Some(NormalBy::Order);
        }
        let by_face = !self.differ && self.of_vertex.iter().any(|&n| n != u32::MAX);
        by_face.then_some(NormalBy::Face)
    }
    /// Returns the normal of a vertex; `None` if it has none.
    fn normal(&self, vertex: usize, by: NormalBy) -> Option<&Point3> {
        let normal = match by {
            NormalBy::Order => vertex,
            NormalBy::Face => self.of_vertex[vertex] as usize,
        };
        self.given.get(normal)
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
    let mut lines = ObjLines::default();
    let mut reader = ObjReader::new(options);
    while lines.next(input, report)? {
        reader.line(&lines.text, input, report)?;
    }
    reader.offer_points(report);
    reader.collector.finish_with_parts(input, options, report)
}

/// Logical lines: with continuations joined and comments removed.
#[derive(Default)]
struct ObjLines {
    /// Present line.
    text: String,
    /// Continuation of the present line.
    more: String,
    bytes: Vec<u8>,
}

impl ObjLines {
    /// Reads the next line; returns false at the end. A unit stated in a comment is added to the
    /// report.
    fn next(&mut self, input: &mut Input<'_>, report: &mut ReadReport) -> Result<bool> {
        if !input.read_line(&mut self.text, &mut self.bytes)? {
            return Ok(false);
        }
        while self.text.ends_with('\\') && self.text.len() < MAX_CORNERS * 16 {
            self.text.pop();
            if !input.read_line(&mut self.more, &mut self.bytes)? {
                break;
            }
            self.text.push(' ');
            self.text.push_str(&self.more);
        }
        if let Some(at) = self.text.find('#') {
            let unit = report.units.take();
            report.units = unit.or_else(|| stated_unit(&self.text[at..]));
            self.text.truncate(at);
        }
        Ok(true)
    }
}

/// Vertex with its colour.
struct ColoredVertex {
    point: Point3,
    color: Option<[f32; 3]>,
}

/// State of reading. Points are passed to the collector at the end, when their properties are
/// known.
struct ObjReader {
    collector: Collector,
    /// All vertices of the file.
    vertices: Vec<ColoredVertex>,
    /// All normals, and their use by faces.
    normals: CornerNormals,
    /// Part indices by name.
    parts: HashMap<String, u32>,
    /// Corners of the present face.
    corners: Vec<u64>,
}

impl ObjReader {
    fn new(options: &ReadOptions) -> Self {
        let mut collector = Collector::new(options);
        collector.mesh(options);
        Self {
            collector,
            vertices: Vec::new(),
            normals: CornerNormals {
                given: Vec::new(),
                of_vertex: Vec::new(),
                differ: false,
            },
            parts: HashMap::new(),
            corners: Vec::new(),
        }
    }

    /// Processes a line by its first word.
    fn line(&mut self, text: &str, input: &Input<'_>, report: &mut ReadReport) -> Result<()> {
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("v") => self.vertex(text, words, input)?,
            Some("vn") => {
                let (v, n) = numbers(input, text, words)?;
                let normal = if n >= 3 { [v[0], v[1], v[2]] } else { [0.0; 3] };
                self.normals.given.push(normal);
            }
            Some("f" | "fo") => self.face(words, input)?,
            Some("g" | "o") => self.group(words.collect::<Vec<_>>().join(" ")),
            Some("curv" | "curv2" | "surf" | "cstype") => {
                report.warn("free-form curves and surfaces were passed over");
            }
            // Materials, texture coordinates, lines and points do not affect a cloud.
            _ => {}
        }
        Ok(())
    }

    /// Parses a vertex: x y z, x y z w, x y z r g b, or x y z r g b a.
    fn vertex<'t>(
        &mut self,
        line: &'t str,
        words: impl Iterator<Item = &'t str>,
        input: &Input<'_>,
    ) -> Result<()> {
        let (v, n) = numbers(input, line, words)?;
        if n < 3 {
            let why = format!("a vertex needs three numbers, this one has {n}");
            let at = input.at_line(0);
            return Err(input.error(ErrorKind::Number, at, OBJ_FAILURE, why, "correct the line"));
        }
        self.vertices.push(ColoredVertex {
            point: [v[0], v[1], v[2]],
            color: (n >= 6).then(|| [v[3] as f32, v[4] as f32, v[5] as f32]),
        });
        self.normals.of_vertex.push(u32::MAX);
        Ok(())
    }

    /// Parses a face with corners v, v/vt, v//vn or v/vt/vn.
    fn face<'t>(&mut self, words: impl Iterator<Item = &'t str>, input: &Input<'_>) -> Result<()> {
        self.corners.clear();
        for word in words {
            let mut parts = word.split('/');
            let v = index(input, parts.next().unwrap_or(""), self.vertices.len())?;
            if self.corners.len() < MAX_CORNERS {
                self.corners.push(v);
            }
            if let Some(n) = parts.nth(1)
                && !n.is_empty()
            {
                let n = index(input, n, self.normals.given.len())?;
                self.normals.corner(v, n);
            }
        }
        self.collector.polygon(&self.corners, input.at_line(0));
        Ok(())
    }

    /// Assigns the following triangles to the group of this name.
    fn group(&mut self, name: String) {
        let collector = &mut self.collector;
        let part = *self
            .parts
            .entry(name)
            .or_insert_with_key(|name| collector.add_part(name));
        self.collector.set_part(part);
    }

    /// Passes all vertices with their properties to the collector.
    fn offer_points(&mut self, report: &mut ReadReport) {
        let per_point = self.normals.per_point(report);
        if per_point.is_some() {
            self.collector.with_normals();
        }
        if self.vertices.iter().any(|v| v.color.is_some()) {
            self.collector.with_colors(ColorScale::Guess);
        }
        for (i, vertex) in self.vertices.iter().enumerate() {
            let Some(slot) = self.collector.offer(vertex.point) else {
                continue;
            };
            if let Some(by) = per_point {
                let n = self.normals.normal(i, by);
                self.collector
                    .set_normal(slot, n.copied().unwrap_or_default());
            }
            if let Some(c) = vertex.color {
                self.collector.set_color(slot, c.map(f64::from));
            }
        }
    }
}

/// Parses up to seven numbers of a line, and returns their count.
fn numbers<'t>(
    input: &Input<'_>,
    line: &str,
    words: impl Iterator<Item = &'t str>,
) -> Result<([f64; 7], usize)> {
    let mut values = [0.0; 7];
    let mut n = 0;
    for word in words.take(7) {
        let Some(v) = parse_number(word) else {
            // Both are slices of one line, so their addresses give the column.
            let column = (word.as_ptr() as usize).wrapping_sub(line.as_ptr() as usize) + 1;
            let why = format!("\"{}\" is not a number", shorten(word));
            return Err(input.error(
                ErrorKind::Number,
                input.at_line(column),
                OBJ_FAILURE,
                why,
                "correct the line",
            ));
        };
        values[n] = v;
        n += 1;
    }
    Ok((values, n))
}

/// Converts an index from 1, or a negative one from the end, to an index from 0.
fn index(input: &Input<'_>, word: &str, count: usize) -> Result<u64> {
    let bad = |why: String| {
        Err(input.error(
            ErrorKind::Index,
            input.at_line(0),
            OBJ_FAILURE,
            why,
            "export the mesh again",
        ))
    };
    match word.parse::<i64>() {
        Ok(i) if i > 0 => Ok(i as u64 - 1),
        Ok(i) if i < 0 && i.unsigned_abs() <= count as u64 => Ok(count as u64 - i.unsigned_abs()),
        Ok(i) => bad(format!("{i} is no index where {count} came before")),
        Err(_) => bad(format!("\"{}\" is not an index", shorten(word))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn read_all(text: &str) -> Result<(PointCloud, ReadReport)> {
        crate::read(
            Source::Bytes {
                name: "t.obj",
                bytes: text.as_bytes(),
            },
            None,
            &ReadOptions::default(),
        )
    }

    #[test]
    fn indices_from_both_ends_and_continued_lines() {
        let text = "# Units: mm\no a\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\nf -4 -3 \\\n -2 -1\nf 1/1 3/2/ 4//\nvt 0 0\nl 1 2\n";
        let (cloud, report) = read_all(text).expect("valid");
        assert_eq!(cloud.triangles, [[0, 1, 2], [0, 2, 3], [0, 2, 3]]);
        assert_eq!(report.units.as_deref(), Some("mm"));
        assert!(cloud.normals.is_empty() && cloud.colors.is_empty());
    }

    #[test]
    fn normals_by_corner_unless_they_differ() {
        let base = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nv 9 9 9\nvn 0 0 1\nvn 1 0 0\n";
        let (cloud, _) = read_all(&format!("{base}f 1//1 2//1 3//2\n")).expect("valid");
        assert_eq!(
            cloud.normals,
            [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0; 3]]
        );
        assert_eq!(cloud.colors[..3], [[255, 0, 0], [0, 255, 0], [0, 0, 128]]);
        let (cloud, report) =
            read_all(&format!("{base}f 1//1 2//1 3//2\nf 1//2 2//1 4//1\n")).expect("valid");
        assert!(cloud.normals.is_empty());
        assert_eq!(report.warnings.len(), 1);
        let (cloud, _) = read_all("v 0 0 0\nvn 0 0 1\nv 1 1 1\nvn 0 1 0\n").expect("valid");
        assert_eq!(cloud.normals, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    }

    #[test]
    fn refusals_say_where() {
        let e = read_all("v 0 0 0\nv 1 x 0\n").expect_err("invalid");
        assert_eq!(
            (e.code(), e.place.to_string().as_str()),
            ("bad-number", "t.obj:2:5")
        );
        let e = read_all("v 0 0 0\nf 1 2 3\n").expect_err("invalid");
        assert_eq!(
            (e.code(), e.place.to_string().as_str()),
            ("bad-index", "t.obj:2")
        );
        assert_eq!(
            read_all("v 0 0 0\nf 1 0 1\n").expect_err("invalid").code(),
            "bad-index"
        );
        assert_eq!(
            read_all("v 0 0 0\nf 1 -2 1\n").expect_err("invalid").code(),
            "bad-index"
        );
        assert_eq!(
            read_all("v 0 0\n").expect_err("invalid").code(),
            "bad-number"
        );
    }
}
