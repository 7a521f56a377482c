//! OBJ (Wavefront): vertices with colours, vertex normals, faces. Texture coordinates, lines and
//! free-form surfaces are passed over.

use crate::collect::{Collector, ColorScale, Parts};
use crate::format::Sniff;
use crate::input::{Input, Result, parse_number, shorten, stated_unit};
use crate::{ErrorKind, ReadOptions, ReadReport};
use isoform_geom::{Point3, PointCloud};
use std::collections::HashMap;

const WHAT: &str = "cannot read the OBJ file";
/// Corners of the largest polygon that is taken.
const MAX_CORNERS: usize = 1 << 20;

/// Maybe, if a line is a vertex of OBJ.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head);
    let is_vertex = |l: &str| {
        let mut words = l.split_ascii_whitespace();
        words.next() == Some("v")
            && words.clone().count() >= 3
            && words.take(3).all(|w| parse_number(w).is_some())
    };
    // The last line of the head may be cut anywhere.
    if !head.contains(&0) && text.lines().any(is_vertex) {
        Sniff::Maybe
    } else {
        Sniff::No
    }
}

/// Normals as the corners of the faces name them.
struct Normals {
    /// All `vn` of the file.
    given: Vec<Point3>,
    /// Per vertex: number of its normal, `u32::MAX` while unknown.
    of_vertex: Vec<u32>,
    /// Two corners of one vertex disagree (a crease): then there is no normal per point.
    differ: bool,
}

impl Normals {
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
    let mut vertices: Vec<(Point3, Option<[f32; 3]>)> = Vec::new();
    let mut normals = Normals {
        given: Vec::new(),
        of_vertex: Vec::new(),
        differ: false,
    };
    let mut collector = Collector::new(options);
    collector.mesh(options);
    let (mut text, mut bytes, mut more, mut corners) =
        (String::new(), Vec::new(), String::new(), Vec::new());
    let mut any_color = false;
    let mut parts: HashMap<String, u32> = HashMap::new();
    while input.read_line(&mut text, &mut bytes)? {
        while text.ends_with('\\') && text.len() < MAX_CORNERS * 16 {
            text.pop();
            if !input.read_line(&mut more, &mut bytes)? {
                break;
            }
            text.push(' ');
            text.push_str(&more);
        }
        if let Some(at) = text.find('#') {
            report.units = report.units.take().or_else(|| stated_unit(&text[at..]));
            text.truncate(at);
        }
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let (v, n) = numbers(input, &text, words)?;
                if n < 3 {
                    let why = format!("a vertex needs three numbers, this one has {n}");
                    return Err(input.error(
                        ErrorKind::Number,
                        input.at_line(0),
                        WHAT,
                        why,
                        "correct the line",
                    ));
                }
                // x y z, x y z w, x y z r g b, or x y z r g b a.
                let color = (n >= 6).then(|| [v[3] as f32, v[4] as f32, v[5] as f32]);
                any_color |= color.is_some();
                vertices.push(([v[0], v[1], v[2]], color));
                normals.of_vertex.push(u32::MAX);
            }
            Some("vn") => {
                let (v, n) = numbers(input, &text, words)?;
                normals
                    .given
                    .push(if n >= 3 { [v[0], v[1], v[2]] } else { [0.0; 3] });
            }
            Some("f" | "fo") => {
                corners.clear();
                for word in words {
                    let mut parts = word.split('/');
                    let v = index(input, parts.next().unwrap_or(""), vertices.len())?;
                    if corners.len() < MAX_CORNERS {
                        corners.push(v);
                    }
                    if let Some(n) = parts.nth(1)
                        && !n.is_empty()
                    {
                        let n = index(input, n, normals.given.len())?;
                        normals.corner(v, n);
                    }
                }
                collector.polygon(&corners, input.at_line(0));
            }
            Some("g" | "o") => {
                let name = words.collect::<Vec<_>>().join(" ");
                let part = *parts
                    .entry(name)
                    .or_insert_with_key(|name| collector.add_part(name));
                collector.set_part(part);
            }
            Some("curv" | "curv2" | "surf" | "cstype") => {
                report.warn("free-form curves and surfaces were passed over")
            }
            // Materials, texture coordinates, lines and points: nothing of a cloud.
            _ => {}
        }
    }
    let by_order = !normals.given.is_empty()
        && normals.given.len() == vertices.len()
        && normals
            .of_vertex
            .iter()
            .enumerate()
            .all(|(i, &n)| n == u32::MAX || n as usize == i);
    let by_face = !normals.differ && normals.of_vertex.iter().any(|&n| n != u32::MAX);
    if normals.differ {
        report
            .warn("the normals differ between the faces of a vertex (creases); they were left out");
    }
    if by_order || by_face {
        collector.with_normals();
    }
    if any_color {
        collector.with_colors(ColorScale::Guess);
    }
    for (i, (p, color)) in vertices.iter().enumerate() {
        let Some(slot) = collector.offer(*p) else {
            continue;
        };
        if by_order || by_face {
            let n = if by_order {
                Some(&normals.given[i])
            } else {
                normals.given.get(normals.of_vertex[i] as usize)
            };
            collector.set_normal(slot, n.copied().unwrap_or_default());
        }
        if let Some(c) = color {
            collector.set_color(slot, c.map(f64::from));
        }
    }
    collector.finish_with_parts(input, options, report)
}

/// Up to seven numbers of a line, and how many there are.
fn numbers<'t>(
    input: &Input<'_>,
    line: &str,
    words: impl Iterator<Item = &'t str>,
) -> Result<([f64; 7], usize)> {
    let mut values = [0.0; 7];
    let mut n = 0;
    for word in words.take(7) {
        let Some(v) = parse_number(word) else {
            // Both are parts of one line, so that their addresses tell the column.
            let column = (word.as_ptr() as usize).wrapping_sub(line.as_ptr() as usize) + 1;
            let why = format!("\"{}\" is not a number", shorten(word));
            return Err(input.error(
                ErrorKind::Number,
                input.at_line(column),
                WHAT,
                why,
                "correct the line",
            ));
        };
        values[n] = v;
        n += 1;
    }
    Ok((values, n))
}

/// An index from 0 out of one from 1, or from the end where it is negative.
fn index(input: &Input<'_>, word: &str, count: usize) -> Result<u64> {
    let bad = |why: String| {
        Err(input.error(
            ErrorKind::Index,
            input.at_line(0),
            WHAT,
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
