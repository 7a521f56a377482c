//! OFF (Geomview): ASCII, with the prefixes ST, C and N (texture, colour, normal) and comments.
//!
//! The keyword `[ST][C][N]OFF` states the properties of a vertex. The numbers of vertices, faces
//! and edges follow, then one vertex per line: x y z, the normal, the colour. A face is a number of
//! corners and their indices from 0. Colours of faces, four coordinates and other dimensions are
//! not supported.

use crate::collect::{Collector, ColorScale};
use crate::format::Sniff;
use crate::input::{Input, Result, Words, parse_number, shorten};
use crate::{ErrorKind, ReadOptions, ReadReport};
use isoform_geom::PointCloud;

const OFF_FAILURE: &str = "cannot read the OFF file";
/// Maximum number of corners of a polygon.
const MAX_CORNERS: u64 = 1 << 20;

/// Returns `Yes` if the keyword of a variant starts the file.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    let word: Vec<u8> = head
        .iter()
        .copied()
        .take_while(u8::is_ascii_alphanumeric)
        .take(9)
        .collect();
    if word.ends_with(b"OFF") && keyword(&String::from_utf8_lossy(&word)).is_some() {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// Prefixes of the keyword: texture, colour, normal, fourth coordinate, n dimensions.
struct Keyword {
    /// ST: vertices have texture coordinates.
    texture: bool,
    /// C: vertices have colours.
    color: bool,
    /// N: vertices have normals.
    normal: bool,
    /// 4 or n: a fourth coordinate or another dimension, neither of which is supported.
    odd: bool,
}

/// Properties in a file without a keyword: coordinates only.
const NO_KEYWORD: Keyword = Keyword {
    texture: false,
    color: false,
    normal: false,
    odd: false,
};

/// Parses the keyword of a variant; `None` for any other word.
fn keyword(word: &str) -> Option<Keyword> {
    let rest = word.strip_suffix("OFF")?;
    let (texture, rest) = rest.strip_prefix("ST").map_or((false, rest), |r| (true, r));
    let (color, rest) = rest.strip_prefix('C').map_or((false, rest), |r| (true, r));
    let (normal, rest) = rest.strip_prefix('N').map_or((false, rest), |r| (true, r));
    matches!(rest, "" | "4" | "n" | "4n").then_some(Keyword {
        texture,
        color,
        normal,
        odd: !rest.is_empty(),
    })
}

/// Non-empty line without comments.
struct OffLines {
    text: String,
    bytes: Vec<u8>,
}

impl OffLines {
    /// Reads the next non-empty line; returns false at the end.
    fn next(&mut self, input: &mut Input<'_>) -> Result<bool> {
        while input.read_line(&mut self.text, &mut self.bytes)? {
            if let Some(at) = self.text.find('#') {
                self.text.truncate(at);
            }
            if !self.text.trim().is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Reads points and triangles.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    let mut lines = OffLines {
        text: String::new(),
        bytes: Vec::new(),
    };
    let header = OffHeader::read(input, &mut lines)?;
    report.declared = Some(header.vertices);
    let mut collector = Collector::new(options);
    collector.mesh(options);
    read_vertices(input, &mut lines, &header, &mut collector)?;
    read_faces(input, lines, header.faces, &mut collector)?;
    collector.finish(input, options, report)
}

/// Content of the file before the vertices.
struct OffHeader {
    kind: Keyword,
    vertices: u64,
    faces: u64,
}

impl OffHeader {
    /// Reads the keyword, which may be missing, and the counts, on one line or two.
    fn read(input: &mut Input<'_>, lines: &mut OffLines) -> Result<Self> {
        if !lines.next(input)? {
            return Err(input.truncated("there is nothing but comments"));
        }
        let line = lines.text.trim_start();
        let first = line.split_ascii_whitespace().next().unwrap_or("");
        let Some(kind) = keyword(first) else {
            return Self::parse_counts(NO_KEYWORD, line, input);
        };
        let rest = line[first.len()..].trim();
        if kind.odd || rest.starts_with("BINARY") {
            let (first, rest) = (shorten(first), shorten(rest));
            return Err(input.error(
                ErrorKind::UnsupportedFormat,
                input.at_line(0),
                OFF_FAILURE,
                format!("the variant \"{first} {rest}\" is not read"),
                "save it as plain OFF or PLY",
            ));
        }
        if !rest.is_empty() {
            return Self::parse_counts(kind, rest, input);
        }
        if !lines.next(input)? {
            return Err(input.truncated("the numbers of vertices and faces are missing"));
        }
        Self::parse_counts(kind, &lines.text, input)
    }

    /// Parses the line of counts of a variant; the number of edges may be missing.
    fn parse_counts(kind: Keyword, counts: &str, input: &Input<'_>) -> Result<Self> {
        let words = counts.split_ascii_whitespace().take(3);
        let numbers: Vec<Option<u64>> = words.map(|w| w.parse().ok()).collect();
        let ([Some(vertices), Some(faces)] | [Some(vertices), Some(faces), _]) = numbers[..] else {
            let counts = shorten(counts.trim());
            let why = format!("\"{counts}\" should be the numbers of vertices, faces and edges");
            let (at, hint) = (input.at_line(0), "correct the line");
            return Err(input.error(ErrorKind::Header, at, OFF_FAILURE, why, hint));
        };
        Ok(Self {
            kind,
            vertices,
            faces,
        })
    }
}

/// Passes all vertices to the collector; the first decides if they have colours.
fn read_vertices(
    input: &mut Input<'_>,
    lines: &mut OffLines,
    header: &OffHeader,
    collector: &mut Collector,
) -> Result<()> {
    let (kind, count) = (&header.kind, header.vertices);
    let mut values: Vec<f64> = Vec::new();
    let after_normal = if kind.normal { 6 } else { 3 };
    let mut has_color = kind.color;
    for i in 0..count {
        if !lines.next(input)? {
            return Err(input.truncated(format!("{i} of {count} vertices are there")));
        }
        numbers(&lines.text, input, &mut values)?;
        if values.len() < 3 {
            let why = format!("vertex {i} has {} of 3 numbers", values.len());
            let (at, hint) = (input.at_line(0), "correct the line");
            return Err(input.error(ErrorKind::Number, at, OFF_FAILURE, why, hint));
        }
        if i == 0 {
            // Colours without the prefix C are common.
            has_color |= !kind.texture && values.len() - after_normal.min(values.len()) >= 3;
            if kind.normal {
                collector.with_normals();
            }
            if has_color {
                collector.with_colors(ColorScale::Guess);
            }
        }
        let Some(slot) = collector.offer([values[0], values[1], values[2]]) else {
            continue;
        };
        if kind.normal && values.len() >= 6 {
            collector.set_normal(slot, [values[3], values[4], values[5]]);
        }
        if has_color && values.len() >= after_normal + 3 {
            collector.set_color(slot, std::array::from_fn(|k| values[after_normal + k]));
        }
    }
    Ok(())
}

/// Parses the numbers of a vertex, at most 16 of them.
fn numbers(line: &str, input: &Input<'_>, values: &mut Vec<f64>) -> Result<()> {
    values.clear();
    for word in line.split_ascii_whitespace().take(16) {
        let Some(v) = parse_number(word) else {
            // Both are slices of one line, so their addresses give the column.
            let column = (word.as_ptr() as usize).wrapping_sub(line.as_ptr() as usize) + 1;
            let why = format!("\"{}\" is not a number", shorten(word));
            let (at, hint) = (input.at_line(column), "correct the line");
            return Err(input.error(ErrorKind::Number, at, OFF_FAILURE, why, hint));
        };
        values.push(v);
    }
    Ok(())
}

/// Reads all faces as polygons; values after their corners are skipped.
fn read_faces(
    input: &mut Input<'_>,
    mut lines: OffLines,
    count: u64,
    collector: &mut Collector,
) -> Result<()> {
    let mut corners = Vec::new();
    let mut words = Words::new();
    for i in 0..count {
        if !lines.next(input)? {
            return Err(input.truncated(format!("{i} of {count} faces are there")));
        }
        words.set(&lines.text);
        let missing = || format!("face {i} is incomplete");
        let bad = |input: &Input<'_>, v: f64, what: &str| {
            Err(input.error(
                ErrorKind::Index,
                input.at_line(0),
                OFF_FAILURE,
                format!("{v} is no {what}"),
                "export the mesh again",
            ))
        };
        let n = words.number(input, missing)?;
        if !(n >= 0.0 && n <= MAX_CORNERS as f64 && n.fract() == 0.0) {
            return bad(input, n, "number of corners");
        }
        corners.clear();
        for _ in 0..n as u64 {
            // A long face may continue on the next line.
            let v = words.number(input, missing)?;
            if !(v >= 0.0 && v.fract() == 0.0) {
                return bad(input, v, "index of a vertex");
            }
            corners.push(v as u64);
        }
        collector.polygon(&corners, input.at_line(0));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn read_all(text: &str) -> Result<(PointCloud, ReadReport)> {
        crate::read(
            Source::Bytes {
                name: "t.off",
                bytes: text.as_bytes(),
            },
            None,
            &ReadOptions::default(),
        )
    }

    #[test]
    fn variants() {
        let body = "0 0 0 # a\n\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 1.0 0 0\n3 0 1\n 2\n";
        for head in [
            "OFF\n# c\n4 2 0\n",
            "OFF 4 2 0\n",
            "4 2\n",
            "# c\nOFF # x\n4 2 5 # y\n",
        ] {
            let (cloud, _) = read_all(&format!("{head}{body}")).expect(head);
            assert_eq!(cloud.points.len(), 4);
            assert_eq!(cloud.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        }
        let (cloud, _) = read_all("CNOFF\n1 0 0\n1 2 3 0 0 1 255 0 10 255\n").expect("valid");
        assert_eq!(
            (cloud.normals[0], cloud.colors[0]),
            ([0.0, 0.0, 1.0], [255, 0, 10])
        );
        let (cloud, _) = read_all("OFF\n1 0 0\n1 2 3 0.5 0 1 1\n").expect("valid");
        assert_eq!(cloud.colors[0], [128, 0, 255]);
    }

    #[test]
    fn refusals_say_where() {
        let code = |text: &str| read_all(text).expect_err("invalid").code();
        assert_eq!(code("OFF BINARY\n1 0 0\n"), "format-unsupported");
        assert_eq!(code("4OFF\n1 0 0\n1 2 3 4\n"), "format-unsupported");
        assert_eq!(code("OFF\nmany\n"), "bad-header");
        assert_eq!(
            code("OFF\n18446744073709551615 0 0\n1 2 3\n"),
            "file-truncated"
        );
        assert_eq!(code("OFF\n1 1 0\n0 0 0\n3 0 1 2\n"), "bad-index");
        assert_eq!(code("OFF\n1 1 0\n0 0 0\n1e9 0\n"), "bad-index");
        assert_eq!(code("OFF\n1 1 0\n0 0 0\n"), "file-truncated");
        let e = read_all("OFF\n1 0 0\n0 0 zero\n").expect_err("invalid");
        assert_eq!(e.place.to_string(), "t.off:3:5");
    }
}
