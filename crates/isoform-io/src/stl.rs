//! STL: binary and ASCII (any number of solids), welded into a mesh.
//!
//! STL repeats every vertex in each of its facets. Corners with bitwise equal coordinates (0 and −0
//! count as equal) become one vertex; corners are not merged by distance. Facet normals are
//! ignored: they repeat the order of the corners, which is what other programs use.

use crate::collect::{Collector, TriangleParts};
use crate::format::Sniff;
use crate::input::{Input, Result, parse_number, shorten, stated_unit};
use crate::{At, ErrorKind, ReadOptions, ReadReport};
use isoform_geom::{Point3, PointCloud};
use std::collections::HashMap;

const STL_FAILURE: &str = "cannot read the STL file";
/// Size of the part of a binary file before its facets, in bytes: 80 of text, and the number of
/// facets.
const HEADER_BYTES: u64 = 84;
/// Size of a facet in bytes: a normal and three corners of 32-bit numbers, and two bytes of
/// attributes.
const FACET_BYTES: u64 = 50;

/// Returns `Maybe` at best: binary STL has no signature, and binary files may start with "solid"
/// too.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    if is_ascii(head) {
        Sniff::Maybe
    } else {
        Sniff::No
    }
}

/// Returns true for text that starts with `solid` and soon contains `facet`, `endsolid` or `end
/// solid`.
fn is_ascii(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head).to_ascii_lowercase();
    text.trim_start().starts_with("solid")
        && !head.contains(&0)
        && (text.contains("facet") || text.contains("endsolid") || text.contains("end solid"))
}

/// Welder of equal corners into vertices.
struct CornerWelder<'c> {
    /// Collector of vertices and triangles.
    collector: &'c mut Collector,
    /// Vertex indices by the bits of their coordinates.
    known: HashMap<[u64; 3], u64>,
}

impl CornerWelder<'_> {
    /// Returns the index of the vertex at a corner; a new vertex is passed to the collector.
    fn vertex(&mut self, p: Point3) -> u64 {
        // Adding 0 turns −0 into 0.
        let key = p.map(|v| (v + 0.0).to_bits());
        let next = self.known.len() as u64;
        *self.known.entry(key).or_insert_with(|| {
            self.collector.offer(p);
            next
        })
    }
    /// Adds a triangle.
    fn facet(&mut self, corners: [Point3; 3], at: At) {
        let corners = corners.map(|p| self.vertex(p));
        self.collector.polygon(&corners, at);
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
    let mut collector = Collector::new(options);
    collector.mesh(options);
    let mut weld = CornerWelder {
        collector: &mut collector,
        known: HashMap::new(),
    };
    let head = input.head(4096)?;
    let announced = head
        .get(80..84)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let fits = announced.is_some_and(|n| HEADER_BYTES + FACET_BYTES * u64::from(n) == input.size);
    if !fits && (is_ascii(&head) || announced.is_none()) {
        read_ascii(input, &mut weld, report)?;
    } else {
        read_binary(input, &mut weld, report)?;
    }
    collector.finish_with_parts(input, options, report)
}

/// Reads the facets of a binary file, whose number and possibly unit its header states.
fn read_binary(
    input: &mut Input<'_>,
    weld: &mut CornerWelder<'_>,
    report: &mut ReadReport,
) -> Result<()> {
    let mut head = [0; HEADER_BYTES as usize];
    input.exact(&mut head, || {
        "a binary STL file has 84 bytes before its facets".into()
    })?;
    report.units = stated_unit(&String::from_utf8_lossy(&head[..80]));
    let n = u32::from_le_bytes([head[80], head[81], head[82], head[83]]);
    let mut facet = [0; FACET_BYTES as usize];
    for i in 0..n {
        let at = input.at_byte();
        input.exact(&mut facet, || format!("{i} of {n} facets are there"))?;
        let number = |k: usize| {
            f64::from(f32::from_le_bytes(std::array::from_fn(|b| {
                facet[4 * k + b]
            })))
        };
        weld.facet(
            std::array::from_fn(|c| std::array::from_fn(|k| number(3 + 3 * c + k))),
            at,
        );
    }
    if input.left() > 0 {
        report.warn(format!(
            "{} bytes after the last facet were not read",
            input.left()
        ));
    }
    Ok(())
}

/// Reads the solids of an ASCII file.
fn read_ascii(
    input: &mut Input<'_>,
    weld: &mut CornerWelder<'_>,
    report: &mut ReadReport,
) -> Result<()> {
    let (mut text, mut bytes) = (String::new(), Vec::new());
    let mut solids = AsciiSolids::default();
    while input.read_line(&mut text, &mut bytes)? {
        solids.line(&text, input, weld, report)?;
    }
    if solids.count == 0 {
        let hint = "check that it is an STL file";
        let why = "there is no \"solid\" in it";
        return Err(input.error(ErrorKind::Header, At::File, STL_FAILURE, why, hint));
    }
    if solids.is_open || !solids.corners.is_empty() {
        return Err(input.truncated("the line \"endsolid\" is missing"));
    }
    if solids.polygons > 0 {
        report.warn(format!(
            "{} facets do not have three corners and were passed over",
            solids.polygons
        ));
    }
    Ok(())
}

/// State of reading an ASCII file.
#[derive(Default)]
struct AsciiSolids {
    /// Number of solids begun.
    count: u64,
    /// True from the start of a solid to its end.
    is_open: bool,
    /// Corners of the present facet.
    corners: Vec<Point3>,
    /// Number of facets that are not triangles.
    polygons: u64,
}

impl AsciiSolids {
    /// Processes a line by its first word, in any case.
    fn line(
        &mut self,
        text: &str,
        input: &Input<'_>,
        weld: &mut CornerWelder<'_>,
        report: &mut ReadReport,
    ) -> Result<()> {
        let mut words = text.split_ascii_whitespace();
        let mut word = words.next().unwrap_or("").to_ascii_lowercase();
        if word == "end" {
            // Some programs write `end solid` and the like.
            word += &words.next().unwrap_or("").to_ascii_lowercase();
        }
        match word.as_str() {
            "vertex" => {
                let p = vertex(words, text, input)?;
                // More than three corners are invalid; they are counted but not kept.
                if self.corners.len() < 4 {
                    self.corners.push(p);
                }
            }
            "endloop" | "endfacet" => self.end_facet(input, weld),
            "solid" => {
                report.units = report.units.take().or_else(|| stated_unit(text));
                self.begin(text.trim().get(5..).unwrap_or("").trim(), weld);
            }
            "endsolid" => self.is_open = false,
            "" | "facet" | "outer" | "color" => {}
            _ if self.count == 0 => {
                let why = format!(
                    "neither binary STL nor text that starts with \"solid\": \"{}\"",
                    shorten(text.trim())
                );
                let (at, hint) = (input.at_line(0), "check that it is an STL file");
                return Err(input.error(ErrorKind::Header, at, STL_FAILURE, why, hint));
            }
            other => report.warn(format!(
                "line {}: unknown word \"{}\" was passed over",
                input.line,
                shorten(other)
            )),
        }
        Ok(())
    }

    /// Adds the corners so far as a facet if there are three.
    fn end_facet(&mut self, input: &Input<'_>, weld: &mut CornerWelder<'_>) {
        if let [a, b, c] = self.corners[..] {
            weld.facet([a, b, c], input.at_line(0));
        } else if !self.corners.is_empty() {
            self.polygons += 1;
        }
        self.corners.clear();
    }

    /// Begins a solid, which is a part; an unnamed one is named by its number.
    fn begin(&mut self, name: &str, weld: &mut CornerWelder<'_>) {
        self.count += 1;
        self.is_open = true;
        let part = match name {
            "" => weld.collector.add_part(&format!("solid {}", self.count)),
            name => weld.collector.add_part(name),
        };
        weld.collector.set_part(part);
    }
}

/// Parses the three coordinates of a corner.
fn vertex<'t>(
    mut words: impl Iterator<Item = &'t str>,
    line: &str,
    input: &Input<'_>,
) -> Result<Point3> {
    let mut p = [0.0; 3];
    for v in &mut p {
        let word = words.next().unwrap_or("");
        *v = parse_number(word).ok_or_else(|| {
            let (word, line) = (shorten(word), shorten(line.trim()));
            let why = format!("\"{word}\" is not a number in \"{line}\"");
            input.error(
                ErrorKind::Number,
                input.at_line(0),
                STL_FAILURE,
                why,
                "correct the line",
            )
        })?;
    }
    Ok(p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn read_all(bytes: &[u8]) -> Result<(PointCloud, ReadReport)> {
        crate::read(
            Source::Bytes {
                name: "t.STL",
                bytes,
            },
            None,
            &ReadOptions::default(),
        )
    }
    fn binary(facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes[..16].copy_from_slice(b"solid UNITS = mm");
        bytes.extend((facets.len() as u32).to_le_bytes());
        for f in facets {
            bytes.extend([0; 12]);
            f.iter()
                .flatten()
                .for_each(|v| bytes.extend(v.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn binary_is_welded_bit_by_bit() {
        let facets = [
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[-0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.000_000_1, 0.0]],
        ];
        let (cloud, report) = read_all(&binary(&facets)).expect("valid");
        assert_eq!(cloud.points.len(), 4);
        assert_eq!(cloud.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(report.units.as_deref(), Some("mm"));
        let (cloud, report) = read_all(&binary(&[])).expect("valid");
        assert!(cloud.points.is_empty() && report.warnings.len() == 1);
        let mut long = binary(&facets);
        long.push(0);
        assert_eq!(read_all(&long).expect("valid").1.warnings.len(), 1);
        long.truncate(150);
        assert_eq!(read_all(&long).expect_err("short").code(), "file-truncated");
    }

    #[test]
    fn ascii_solids() {
        let facet = |z: f64| {
            format!(
                "  facet normal 0 0 1\n outer loop\n vertex 0 0 {z}\n VERTEX 1 0 {z}\n vertex 0 1 {z}\n endloop\n endfacet\n"
            )
        };
        let text = format!(
            "solid a\n{}endsolid a\nSOLID b\n{}{}endsolid\n",
            facet(0.0),
            facet(1.0),
            facet(1.0)
        );
        let (cloud, _) = read_all(text.as_bytes()).expect("valid");
        assert_eq!((cloud.points.len(), cloud.triangles.len()), (6, 3));
        let spaced = text.replace("end", "End ");
        let again = read_all(spaced.as_bytes()).expect("`end solid` is written as well");
        assert_eq!((&again.0, again.1.warnings.len()), (&cloud, 0));
        for lines in [3, 7, 9, 18] {
            let cut: Vec<&str> = text.lines().take(lines).collect();
            let code = read_all(cut.join("\n").as_bytes()).map_err(|e| e.code());
            assert_eq!(code.is_ok(), lines == 9, "whole after the first solid only");
            assert_ne!(code, Err("bad-number"));
        }
        assert_eq!(
            read_all(b"solid a\nfacet\nvertex 0 zero 0\n")
                .expect_err("bad")
                .place
                .to_string(),
            "t.STL:3"
        );
        assert_eq!(
            read_all(b"something\n").expect_err("bad").code(),
            "bad-header"
        );
    }
}
