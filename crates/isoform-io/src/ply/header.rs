//! Header of a PLY file: the encoding, and the elements with their properties.

use super::PLY_HEADER_FAILURE;
use crate::binary::NumberType;
use crate::input::{Input, Result, shorten, stated_unit};
use crate::{ErrorKind, ReadError, ReadReport};
use std::collections::BTreeMap;

/// Maximum number of header lines; real files have far fewer.
const MAX_HEADER_LINES: u64 = 10_000;

/// Encoding of the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PlyEncoding {
    /// Text, one row per line.
    Ascii,
    /// Little-endian bytes.
    Little,
    /// Big-endian bytes.
    Big,
}

/// Named value, or list of values, of every row of an element.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    /// Type of the value, or of the items of the list.
    pub(super) kind: NumberType,
    /// Type of the length of a list; `None` for a scalar.
    pub(super) list: Option<NumberType>,
}

/// Kind of rows, such as vertices or faces.
#[derive(Debug)]
pub(super) struct PlyElement {
    pub(super) name: String,
    /// Number of rows.
    pub(super) count: u64,
    /// Properties in the order of a row.
    pub(super) properties: Vec<Property>,
}

impl PlyElement {
    /// Returns the number of bytes of a row; `None` if it has lists.
    pub(super) fn stride(&self) -> Option<usize> {
        self.properties.iter().try_fold(0_usize, |sum, p| {
            p.list.is_none().then(|| sum + p.kind.size())
        })
    }
    /// Returns true if the rows are faces or strips of triangles.
    pub(super) fn is_face(&self) -> bool {
        matches!(self.name.as_str(), "face" | "faces" | "tristrips") && self.count > 0
    }
    /// Returns the index of the list of corners.
    pub(super) fn corners(&self) -> Option<usize> {
        /// Names of the list of corners: the standard one first, then common variants.
        const CORNER_LIST_NAMES: [&str; 3] = ["vertex_indices", "vertex_index", "vertex_indexes"];
        self.properties
            .iter()
            .position(|p| p.list.is_some() && CORNER_LIST_NAMES.contains(&p.name.as_str()))
    }
}

/// Names of parts by tag, from comments `part 1 name` as written by this crate.
pub(super) type PartNames = BTreeMap<i64, String>;

/// Header of a file.
pub(super) struct PlyHeader {
    pub(super) encoding: PlyEncoding,
    /// Elements in the order of the file.
    pub(super) elements: Vec<PlyElement>,
    /// Names of parts from comments.
    pub(super) part_names: PartNames,
}

impl PlyHeader {
    /// Reads the lines up to `end_header`.
    pub(super) fn read(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Self> {
        let (mut text, mut bytes) = (String::new(), Vec::new());
        if !input.read_line(&mut text, &mut bytes)? || text.trim_end() != "ply" {
            let first = shorten(&text);
            let why = format!("a PLY file starts with the line \"ply\", this one with \"{first}\"");
            return Err(bad(input, why));
        }
        let mut lines = PlyHeaderLines::default();
        loop {
            if !input.read_line(&mut text, &mut bytes)? {
                return Err(input.error(
                    ErrorKind::Truncated,
                    input.at_byte(),
                    PLY_HEADER_FAILURE,
                    "there is no line \"end_header\"",
                    "get the file again",
                ));
            }
            if input.line > MAX_HEADER_LINES {
                let why = format!("the header has more than {MAX_HEADER_LINES} lines");
                return Err(bad(input, why));
            }
            if lines.take(&text, input, report)? {
                return lines.header(input);
            }
        }
    }

    /// Returns the index of the element with the points.
    pub(super) fn vertices(&self) -> Option<usize> {
        ["vertex", "vertices", "point", "points"]
            .iter()
            .find_map(|n| self.elements.iter().position(|e| e.name == *n))
    }
}

/// Returns the error for an invalid header at the last line read.
fn bad(input: &Input<'_>, why: impl Into<String>) -> ReadError {
    let hint = "save the file again, as binary PLY if there is a choice";
    input.error(
        ErrorKind::Header,
        input.at_line(0),
        PLY_HEADER_FAILURE,
        why,
        hint,
    )
}

/// Declarations of the lines so far.
#[derive(Default)]
struct PlyHeaderLines {
    encoding: Option<PlyEncoding>,
    elements: Vec<PlyElement>,
    part_names: PartNames,
}

impl PlyHeaderLines {
    /// Processes a line; returns true if it ends the header.
    fn take(&mut self, text: &str, input: &Input<'_>, report: &mut ReadReport) -> Result<bool> {
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words[..] {
            ["format", kind, ..] => self.encoding = Some(encoding(kind, input)?),
            ["element", name, count, ..] => self.element(name, count, input)?,
            ["property", "list", length, kind, name, ..] => {
                self.list([length, kind], name, input)?;
            }
            ["property", kind, name, ..] => self.scalar(kind, name, input)?,
            ["comment", "part", tag, _, ..] if tag.parse::<i64>().is_ok() => {
                let name = text.splitn(4, ' ').nth(3).unwrap_or("");
                self.part_names
                    .insert(tag.parse().unwrap_or(0), name.to_owned());
            }
            ["comment" | "obj_info", ..] => {
                report.units = report.units.take().or_else(|| stated_unit(text));
            }
            ["end_header", ..] => return Ok(true),
            [] => {}
            ["element" | "property" | "format", ..] => {
                return Err(bad(input, format!("incomplete line \"{}\"", shorten(text))));
            }
            // Some files have "remark" for "comment". A line that is not a declaration cannot
            // change the layout.
            [word, ..] => report.warn(format!(
                "line {}: unknown header word \"{}\" was passed over",
                input.line,
                shorten(word)
            )),
        }
        Ok(false)
    }

    /// Processes a line `element name count`.
    fn element(&mut self, name: &str, count: &str, input: &Input<'_>) -> Result<()> {
        let Ok(rows) = count.parse() else {
            let why = format!("\"{}\" is not a number of elements", shorten(count));
            return Err(bad(input, why));
        };
        self.elements.push(PlyElement {
            name: name.to_ascii_lowercase(),
            count: rows,
            properties: Vec::new(),
        });
        Ok(())
    }

    /// Processes a line `property list length-type type name`.
    fn list(&mut self, types: [&str; 2], name: &str, input: &Input<'_>) -> Result<()> {
        let [Some(length), Some(kind)] = types.map(NumberType::named) else {
            let why = format!("unknown type in the list property \"{}\"", shorten(name));
            return Err(bad(input, why));
        };
        self.property(name, kind, Some(length), input)
    }

    /// Processes a line `property type name`.
    fn scalar(&mut self, kind: &str, name: &str, input: &Input<'_>) -> Result<()> {
        let Some(known) = NumberType::named(kind) else {
            let (kind, name) = (shorten(kind), shorten(name));
            let why = format!("unknown type \"{kind}\" of the property \"{name}\"");
            return Err(bad(input, why));
        };
        self.property(name, known, None, input)
    }

    /// Adds a property to the last element.
    fn property(
        &mut self,
        name: &str,
        kind: NumberType,
        list: Option<NumberType>,
        input: &Input<'_>,
    ) -> Result<()> {
        let Some(element) = self.elements.last_mut() else {
            return Err(bad(input, "a property before any element"));
        };
        element.properties.push(Property {
            name: name.into(),
            kind,
            list,
        });
        Ok(())
    }

    /// Assembles the header from all lines; the line `format` is required.
    fn header(self, input: &Input<'_>) -> Result<PlyHeader> {
        let encoding = self
            .encoding
            .ok_or_else(|| bad(input, "the line \"format\" is missing"))?;
        Ok(PlyHeader {
            encoding,
            elements: self.elements,
            part_names: self.part_names,
        })
    }
}

/// Parses the encoding of a line `format`.
fn encoding(kind: &str, input: &Input<'_>) -> Result<PlyEncoding> {
    match kind {
        "ascii" => Ok(PlyEncoding::Ascii),
        "binary_little_endian" => Ok(PlyEncoding::Little),
        "binary_big_endian" => Ok(PlyEncoding::Big),
        _ => Err(bad(
            input,
            format!("unknown encoding \"{}\"", shorten(kind)),
        )),
    }
}
