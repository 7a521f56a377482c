//! OFF (Geomview): ASCII, with the prefixes ST, C and N (texture, colour, normal) and comments.

use crate::collect::{Collector, ColorScale};
use crate::format::Sniff;
use crate::input::{Input, Result, Words, parse_number, shorten};
use crate::{ErrorKind, ReadOptions, ReadReport};
use isoform_geom::PointCloud;

const WHAT: &str = "cannot read the OFF file";
/// Corners of the largest polygon that is taken.
const MAX_CORNERS: u64 = 1 << 20;

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
    texture: bool,
    color: bool,
    normal: bool,
    odd: bool,
}

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

/// A line without comments and with something in it.
struct Lines {
    text: String,
    bytes: Vec<u8>,
}

impl Lines {
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

pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    let mut lines = Lines {
        text: String::new(),
        bytes: Vec::new(),
    };
    let mut kind = Keyword {
        texture: false,
        color: false,
        normal: false,
        odd: false,
    };
    if !lines.next(input)? {
        return Err(input.truncated("there is nothing but comments"));
    }
    let first = lines
        .text
        .split_ascii_whitespace()
        .next()
        .unwrap_or("")
        .to_owned();
    let mut counts = lines.text.trim_start().to_owned();
    if let Some(k) = keyword(&first) {
        counts = counts[first.len()..].trim().to_owned();
        if k.odd || counts.starts_with("BINARY") {
            let why = format!(
                "the variant \"{} {}\" is not read",
                shorten(&first),
                shorten(&counts)
            );
            return Err(input.error(
                ErrorKind::UnsupportedFormat,
                input.at_line(0),
                WHAT,
                why,
                "save it as plain OFF or PLY",
            ));
        }
        kind = k;
        if counts.is_empty() {
            if !lines.next(input)? {
                return Err(input.truncated("the numbers of vertices and faces are missing"));
            }
            counts.clone_from(&lines.text);
        }
    }
    let numbers: Vec<Option<u64>> = counts
        .split_ascii_whitespace()
        .take(3)
        .map(|w| w.parse().ok())
        .collect();
    let (vertices, faces) = match numbers[..] {
        [Some(v), Some(f)] | [Some(v), Some(f), _] => (v, f),
        _ => {
            let why = format!(
                "\"{}\" should be the numbers of vertices, faces and edges",
                shorten(counts.trim())
            );
            return Err(input.error(
                ErrorKind::Header,
                input.at_line(0),
                WHAT,
                why,
                "correct the line",
            ));
        }
    };
    report.declared = Some(vertices);
    let mut collector = Collector::new(options);
    collector.mesh(options);
    read_vertices(input, &mut lines, &kind, vertices, &mut collector)?;
    read_faces(input, lines, faces, &mut collector)?;
    collector.finish(input, options, report)
}

fn read_vertices(
    input: &mut Input<'_>,
    lines: &mut Lines,
    kind: &Keyword,
    count: u64,
    collector: &mut Collector,
) -> Result<()> {
    let mut values: Vec<f64> = Vec::new();
    let after_normal = if kind.normal { 6 } else { 3 };
    let mut has_color = kind.color;
    for i in 0..count {
        if !lines.next(input)? {
            return Err(input.truncated(format!("{i} of {count} vertices are there")));
        }
        values.clear();
        for word in lines.text.split_ascii_whitespace().take(16) {
            let Some(v) = parse_number(word) else {
                let column =
                    (word.as_ptr() as usize).wrapping_sub(lines.text.as_ptr() as usize) + 1;
                let why = format!("\"{}\" is not a number", shorten(word));
                return Err(input.error(
                    ErrorKind::Number,
                    input.at_line(column),
                    WHAT,
                    why,
                    "correct the line",
                ));
            };
            values.push(v);
        }
        if values.len() < 3 {
            let why = format!("vertex {i} has {} of 3 numbers", values.len());
            return Err(input.error(
                ErrorKind::Number,
                input.at_line(0),
                WHAT,
                why,
                "correct the line",
            ));
        }
        if i == 0 {
            // Colours without the C are common.
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

fn read_faces(
    input: &mut Input<'_>,
    mut lines: Lines,
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
                WHAT,
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
            // A long face may go on in the next line.
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
