//! Reader of nodes, tetrahedra, wedges and shells; element sets become regions or parts, and
//! surfaces of element faces become parts.
//!
//! A keyword line (`*NODE`, `*ELEMENT, TYPE=C3D4`, …) determines the meaning of the following data
//! lines, up to the next keyword; an element may extend over several lines. Surfaces list element
//! faces by element and side, or by element set and side, and therefore become triangles and
//! quadrilaterals only at the end, when all elements are known.

use crate::input::{Input, Result, parse_number, shorten, stated_unit};
use crate::mesh::boundary::face_with_mids;
use crate::mesh::build::MeshBuilder;
use crate::{At, ErrorKind, ReadError, ReadReport};
use isoform_geom::{Mesh, WEDGE_QUADS, WEDGE_TRIANGLES};
use std::collections::HashMap;

const ABAQUS_FAILURE: &str = "cannot read the Abaqus file";
/// Maximum number of values stored for one element, over all its lines.
const MAX_VALUES_PER_ELEMENT: usize = 64;

/// Average number of times that element sets may be traversed for surfaces. Bounds the time for
/// hostile files.
const MAX_SET_TRAVERSALS: usize = 64;

/// Corner of a tetrahedron opposite to the faces S1 to S4.
const OPPOSITE_CORNERS: [usize; 4] = [3, 2, 0, 1];

/// Range of element numbers: first, last and step.
type NumberRange = [u32; 3];

/// Elements whose faces a surface lists.
enum FaceSetEntry {
    /// One element, by number.
    Element(u32),
    /// All elements of a set, by its name in capitals.
    Set(String),
}

/// Meaning of the present data lines.
enum DataMode {
    /// Lines that are ignored.
    Other,
    /// Nodes.
    Nodes,
    /// Elements of a kind, with the tag of their set.
    Elements { kind: ElementKind, tag: i64 },
    /// Element set, listed or generated.
    ElementSet { name: String, generate: bool },
    /// Faces of a surface with this tag.
    Surface { tag: i64 },
}

/// Kind of an element that a mesh can store, with its number of nodes if that varies.
#[derive(Clone, Copy, PartialEq)]
enum ElementKind {
    Triangle { nodes: usize },
    Quad,
    Tet { nodes: usize },
    Wedge,
    Other,
}

/// Returns the kind of an Abaqus element type: family, then number of nodes.
fn kind_of(name: &str) -> ElementKind {
    let name = name.to_ascii_uppercase();
    let families = [
        ("C3D", 3),
        ("DC3D", 3),
        ("AC3D", 3),
        ("STRI", 2),
        ("CPS", 2),
        ("CPE", 2),
        ("M3D", 2),
        ("SFM3D", 2),
        ("R3D", 2),
        ("DS", 2),
        ("S", 2),
    ];
    for (family, dim) in families {
        let Some(rest) = name.strip_prefix(family) else {
            continue;
        };
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        return match (dim, digits.as_str()) {
            (3, "4") => ElementKind::Tet { nodes: 4 },
            (3, "10") => ElementKind::Tet { nodes: 10 },
            (3, "6") => ElementKind::Wedge,
            (2, "3") => ElementKind::Triangle { nodes: 3 },
            (2, "6" | "65") => ElementKind::Triangle { nodes: 6 },
            (2, "4") => ElementKind::Quad,
            _ => continue,
        };
    }
    ElementKind::Other
}

/// Tetrahedron or wedge, by its index among those of its kind.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum VolumeElement {
    Tet(usize),
    Wedge(usize),
}

/// State of the reader.
struct InpReader<'i, 'a> {
    input: &'i mut Input<'a>,
    builder: MeshBuilder,
    /// Meaning of the present data lines.
    mode: DataMode,
    /// Tetrahedra and wedges with their numbers, in the order of the file.
    volumes: Vec<(u32, VolumeElement)>,
    /// Ranges of element numbers by name of the set, in capitals.
    sets: HashMap<String, Vec<NumberRange>>,
    /// Faces with the tags of their surfaces.
    faces: Vec<(FaceSetEntry, u8, i64)>,
    /// Tags of element sets (regions, parts) and surfaces, by name.
    tags: HashMap<String, i64>,
    /// Numbers of the present element: its own, then those of its nodes.
    numbers: Vec<u32>,
}

/// Reads the lines, then converts surfaces to triangles and quadrilaterals.
pub(in crate::mesh) fn read(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Mesh> {
    let mut reader = InpReader {
        input,
        builder: MeshBuilder::new(),
        mode: DataMode::Other,
        volumes: Vec::new(),
        sets: HashMap::new(),
        faces: Vec::new(),
        tags: HashMap::new(),
        numbers: Vec::new(),
    };
    let (mut text, mut bytes) = (String::new(), Vec::new());
    while reader.input.read_line(&mut text, &mut bytes)? {
        let line = text.trim();
        if line.is_empty() {
            continue;
        }
        if let Some(comment) = line.strip_prefix("**") {
            report.units = report.units.take().or_else(|| stated_unit(comment));
        } else if let Some(keyword) = line.strip_prefix('*') {
            reader.end_element()?;
            reader.keyword(keyword, report);
        } else {
            reader.data(line)?;
        }
    }
    reader.end_element()?;
    reader.add_faces()?;
    if reader.builder.node_count() == 0 {
        report.warn("there is no *NODE in the file");
    }
    reader.builder.finish(reader.input, report)
}

/// Returns the value of a parameter of a keyword line.
fn parameter<'t>(line: &'t str, name: &str) -> Option<&'t str> {
    line.split(',').skip(1).find_map(|p| {
        let (key, value) = p.split_once('=').unwrap_or((p, ""));
        key.trim()
            .eq_ignore_ascii_case(name)
            .then(|| value.trim().trim_matches('"'))
    })
}

impl InpReader<'_, '_> {
    /// Returns the tag of a name for a dimension, from 1 in the order of appearance.
    fn tag(&mut self, dim: usize, name: &str) -> i64 {
        let next = self.builder.names[dim].len() as i64 + 1;
        let tag = *self
            .tags
            .entry(format!("{dim} {}", name.to_ascii_uppercase()))
            .or_insert(next);
        if tag == next {
            self.builder.names[dim].insert(tag, name.to_owned());
        }
        tag
    }

    /// Processes a keyword line, which determines the meaning of the following data lines.
    fn keyword(&mut self, line: &str, report: &mut ReadReport) {
        let word = line
            .split(',')
            .next()
            .unwrap_or("")
            .trim()
            .to_ascii_uppercase();
        self.mode = match word.as_str() {
            "NODE" => DataMode::Nodes,
            "ELEMENT" => self.elements(line, report),
            "ELSET" => {
                let name = parameter(line, "ELSET").unwrap_or("").to_ascii_uppercase();
                DataMode::ElementSet {
                    name,
                    generate: parameter(line, "GENERATE").is_some(),
                }
            }
            "SURFACE"
                if parameter(line, "TYPE").is_none_or(|t| t.eq_ignore_ascii_case("ELEMENT")) =>
            {
                let name = parameter(line, "NAME").unwrap_or("").to_owned();
                DataMode::Surface {
                    tag: self.tag(2, &name),
                }
            }
            "INCLUDE" => {
                report.warn("*INCLUDE was passed over: the file that it names was not read");
                DataMode::Other
            }
            _ => DataMode::Other,
        };
    }

    /// Interprets an `*ELEMENT` line, with type and set.
    fn elements(&mut self, line: &str, report: &mut ReadReport) -> DataMode {
        let name = parameter(line, "TYPE").unwrap_or("");
        let kind = kind_of(name);
        let dim = match kind {
            ElementKind::Tet { .. } | ElementKind::Wedge => 3,
            _ => 2,
        };
        let tag = match parameter(line, "ELSET") {
            Some(set) if kind != ElementKind::Other => self.tag(dim, set),
            _ => 0,
        };
        if kind == ElementKind::Other {
            report.warn(format!(
                "elements of the type \"{}\" were passed over",
                shorten(name)
            ));
        }
        DataMode::Elements { kind, tag }
    }

    /// Parses the number of a node or an element.
    fn number<T: std::str::FromStr>(&self, word: &str) -> Result<T> {
        word.trim().parse().map_err(|_| {
            let why = format!(
                "\"{}\" is not the number of a node or an element",
                shorten(word.trim())
            );
            self.input.error(
                ErrorKind::Number,
                self.input.at_line(0),
                ABAQUS_FAILURE,
                why,
                "correct the line",
            )
        })
    }

    /// Processes a data line.
    fn data(&mut self, line: &str) -> Result<()> {
        match &mut self.mode {
            DataMode::Other => Ok(()),
            DataMode::Nodes => self.node(line),
            DataMode::Elements {
                kind: ElementKind::Other,
                ..
            } => Ok(()),
            DataMode::Elements { .. } => {
                for word in line.split(',').filter(|w| !w.trim().is_empty()) {
                    if self.numbers.len() < MAX_VALUES_PER_ELEMENT {
                        let n = self.number(word)?;
                        self.numbers.push(n);
                    }
                }
                // A trailing comma continues the line.
                if line.ends_with(',') {
                    Ok(())
                } else {
                    self.end_element()
                }
            }
            DataMode::ElementSet { name, generate } => {
                let (name, generate) = (name.clone(), *generate);
                self.set_line(line, name, generate)
            }
            DataMode::Surface { tag } => {
                let tag = *tag;
                self.surface_line(line, tag);
                Ok(())
            }
        }
    }

    /// Processes a line `element or set, side` of a surface. Sides of shells and other labels,
    /// which are not faces of volumes, are skipped.
    fn surface_line(&mut self, line: &str, tag: i64) {
        let mut words = line.split(',').map(str::trim);
        let (whose, face) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
        let face = face.strip_prefix(['S', 's']).and_then(|f| f.parse().ok());
        let Some(face @ 1..=5) = face else {
            return;
        };
        let faces = match whose.parse() {
            Ok(number) => FaceSetEntry::Element(number),
            Err(_) => FaceSetEntry::Set(whose.to_ascii_uppercase()),
        };
        self.faces.push((faces, face, tag));
    }

    /// Processes a line `number, x, y, z`.
    fn node(&mut self, line: &str) -> Result<()> {
        let mut words = line.split(',');
        let id = self.number(words.next().unwrap_or(""))?;
        let mut p = [0.0; 3];
        for (v, word) in p.iter_mut().zip(words) {
            let word = word.trim();
            // Missing coordinates are 0.
            *v = match parse_number(word) {
                Some(v) => v,
                None if word.is_empty() => 0.0,
                None => {
                    let why = format!("\"{}\" is not a number", shorten(word));
                    return Err(self.input.error(
                        ErrorKind::Number,
                        self.input.at_line(0),
                        ABAQUS_FAILURE,
                        why,
                        "correct the line",
                    ));
                }
            };
        }
        let at = self.input.at_line(0);
        self.builder.node(id, p, self.input, at)
    }

    /// Processes a line of a set: element numbers, or a range `first, last, step`.
    fn set_line(&mut self, line: &str, name: String, generate: bool) -> Result<()> {
        let words: Vec<&str> = line
            .split(',')
            .map(str::trim)
            .filter(|w| !w.is_empty())
            .collect();
        let mut runs = Vec::new();
        if generate {
            if let [first, last, step @ ..] = &words[..] {
                let step = step.first().map_or(Ok(1), |s| self.number(s))?;
                runs.push([self.number(first)?, self.number(last)?, u32::max(step, 1)]);
            }
        } else {
            // Names of other sets among the numbers are skipped.
            runs.extend(
                words
                    .iter()
                    .filter_map(|w| w.parse().ok())
                    .map(|n: u32| [n, n, 1]),
            );
        }
        self.sets.entry(name).or_default().extend(runs);
        Ok(())
    }

    /// Adds the element whose numbers have been collected.
    fn end_element(&mut self) -> Result<()> {
        let DataMode::Elements { kind, tag } = self.mode else {
            return Ok(());
        };
        let Some((&number, nodes)) = self.numbers.split_first() else {
            return Ok(());
        };
        let at = self.input.at_line(0);
        let want = match kind {
            ElementKind::Triangle { nodes } | ElementKind::Tet { nodes } => nodes,
            ElementKind::Wedge => 6,
            _ => 4,
        };
        if nodes.len() < want {
            let why = format!("element {number} has {} of {want} nodes", nodes.len());
            return Err(self.input.error(
                ErrorKind::Corrupt,
                at,
                ABAQUS_FAILURE,
                why,
                "correct the line",
            ));
        }
        match kind {
            ElementKind::Triangle { nodes: n } => {
                self.builder
                    .triangles
                    .push(&nodes[..n], tag, Some(number), at)
            }
            ElementKind::Quad => self.builder.quad(&nodes[..4], tag, None, at),
            ElementKind::Tet { nodes: n } => {
                let place = VolumeElement::Tet(self.builder.tets.len());
                self.builder.tets.push(&nodes[..n], tag, Some(number), at);
                self.volumes.push((number, place));
            }
            ElementKind::Wedge => {
                let place = VolumeElement::Wedge(self.builder.wedges.len());
                let wedges = &mut self.builder.wedges;
                wedges.push(&nodes[..6], tag, Some(number), at);
                self.volumes.push((number, place));
            }
            ElementKind::Other => {}
        }
        self.numbers.clear();
        Ok(())
    }

    /// Adds the faces listed by surfaces. The total work is bounded: each face may be listed once,
    /// and sets may be traversed many times, but not once per line and range.
    fn add_faces(&mut self) -> Result<()> {
        let mut by_number = std::mem::take(&mut self.volumes);
        by_number.sort_unstable();
        let runs = self.sets.values().map(Vec::len).sum::<usize>();
        let most = 4 * self.builder.tets.len() + 5 * self.builder.wedges.len();
        let work_limit = 1000 + MAX_SET_TRAVERSALS * (runs + self.faces.len() + by_number.len());
        let (mut count, mut work) = (0, 0);
        for (faces, face, tag) in std::mem::take(&mut self.faces) {
            let runs = match &faces {
                FaceSetEntry::Element(number) => &[[*number, *number, 1]][..],
                FaceSetEntry::Set(name) => self.sets.get(name).map_or(&[][..], Vec::as_slice),
            };
            for &[first, last, step] in runs {
                work += 1;
                let from = by_number.partition_point(|(number, _)| *number < first);
                for &(number, volume) in by_number[from..]
                    .iter()
                    .take_while(|(number, _)| *number <= last)
                {
                    work += 1;
                    if (number - first) % step == 0 {
                        count += 1;
                        add_face(&mut self.builder, volume, face, tag);
                    }
                    if count > most || work > work_limit {
                        break;
                    }
                }
                if count > most || work > work_limit {
                    return Err(self.too_many_faces(most));
                }
            }
        }
        Ok(())
    }

    /// Returns the error for surfaces that list more faces than all volumes have.
    fn too_many_faces(&self, most: usize) -> ReadError {
        let why = format!(
            "the surfaces list more than the {most} faces of all elements, or name sets over and \
             over"
        );
        let hint = "check the surfaces";
        self.input
            .error(ErrorKind::Corrupt, At::File, ABAQUS_FAILURE, why, hint)
    }
}

/// Adds face S1 to S5 of a volume as a triangle or quadrilateral of the part `tag`; S5 of a
/// tetrahedron is ignored.
fn add_face(builder: &mut MeshBuilder, volume: VolumeElement, face: u8, tag: i64) {
    let side = usize::from(face) - 1;
    match volume {
        VolumeElement::Tet(row) => {
            let Some(&corner) = OPPOSITE_CORNERS.get(side) else {
                return;
            };
            let (corners, mids) = builder.tets.get(row);
            let (nodes, n) = face_with_mids(corners, mids, corner);
            builder.triangles.push(&nodes[..n], tag, None, At::File);
        }
        VolumeElement::Wedge(row) => {
            let (&corners, _) = builder.wedges.get(row);
            if let Some(face) = WEDGE_TRIANGLES.get(side) {
                let nodes = face.map(|c| corners[c]);
                builder.triangles.push(&nodes, tag, None, At::File);
            } else {
                let nodes = WEDGE_QUADS[side - WEDGE_TRIANGLES.len()].map(|c| corners[c]);
                builder.quad(&nodes, tag, None, At::File);
            }
        }
    }
}
