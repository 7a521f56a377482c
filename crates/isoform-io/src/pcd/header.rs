//! Header of a PCD file: lines of a keyword and its values, up to the line DATA.

use super::PCD_FAILURE;
use crate::binary::NumberType;
use crate::input::{Input, Result, shorten};
use crate::{ErrorKind, ReadError, ReadReport};

/// Maximum number of values of a row; descriptors such as VFH have 308.
const MAX_VALUES_PER_ROW: u64 = 4096;
/// Maximum number of lines up to the line DATA; real headers have about ten.
const MAX_HEADER_LINES: u64 = 100;
/// Viewpoint at the origin, without rotation.
const IDENTITY_VIEWPOINT: [&str; 7] = ["0", "0", "0", "1", "0", "0", "0"];

/// Encoding of the values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PcdEncoding {
    /// Text, one point per line.
    Ascii,
    /// Bytes, point by point.
    Binary,
    /// Bytes compressed by LZF, field by field.
    Compressed,
}

/// Named value or values of a point.
#[derive(Clone, Debug)]
pub(super) struct PcdField {
    pub(super) name: String,
    pub(super) kind: NumberType,
    /// Number of values per point.
    pub(super) count: usize,
}

impl PcdField {
    /// Returns the number of bytes per value.
    #[inline]
    pub(super) fn size(&self) -> usize {
        self.kind.size()
    }
    /// Returns true if values are floating-point numbers.
    pub(super) fn is_float(&self) -> bool {
        matches!(self.kind, NumberType::F32 | NumberType::F64)
    }
    /// Returns true for a colour packed as 0xAARRGGBB in an integer or in the bits of a float.
    pub(super) fn is_packed_color(&self) -> bool {
        matches!(self.name.as_str(), "rgb" | "rgba") && self.size() == 4 && self.count == 1
    }
}

/// Returns the type of numbers for a TYPE (F, I or U) and a SIZE.
fn type_of(kind: u8, size: u64) -> Option<NumberType> {
    Some(match (kind, size) {
        (b'F', 4) => NumberType::F32,
        (b'F', 8) => NumberType::F64,
        (b'I', 1) => NumberType::I8,
        (b'I', 2) => NumberType::I16,
        (b'I', 4) => NumberType::I32,
        (b'I', 8) => NumberType::I64,
        (b'U', 1) => NumberType::U8,
        (b'U', 2) => NumberType::U16,
        (b'U', 4) => NumberType::U32,
        (b'U', 8) => NumberType::U64,
        _ => return None,
    })
}

/// Header of a file.
pub(super) struct PcdHeader {
    pub(super) fields: Vec<PcdField>,
    /// Number of points: stated, or width times height.
    pub(super) points: u64,
    pub(super) data: PcdEncoding,
}

impl PcdHeader {
    /// Returns the number of bytes of a point.
    pub(super) fn stride(&self) -> usize {
        self.fields.iter().map(|f| f.size() * f.count).sum()
    }

    /// Reads the lines up to DATA.
    pub(super) fn read(input: &mut Input<'_>, report: &mut ReadReport) -> Result<Self> {
        let (mut text, mut bytes) = (String::new(), Vec::new());
        let mut lines = PcdHeaderLines::default();
        loop {
            if input.line > MAX_HEADER_LINES || !input.read_line(&mut text, &mut bytes)? {
                let why = "there is no line DATA within the first hundred";
                return Err(bad(input, why));
            }
            if let Some(data) = lines.take(&text, input, report)? {
                return lines.header(data, input);
            }
        }
    }
}

/// Returns the error for an invalid header at the last line read.
fn bad(input: &Input<'_>, why: impl Into<String>) -> ReadError {
    let hint = "save the file again";
    input.error(ErrorKind::Header, input.at_line(0), PCD_FAILURE, why, hint)
}

/// Values of the header lines before they are checked against each other.
#[derive(Default)]
struct PcdHeaderLines {
    /// FIELDS, in lower case.
    names: Vec<String>,
    /// SIZE: bytes per value.
    sizes: Vec<u64>,
    /// TYPE: F, I or U.
    kinds: Vec<u8>,
    /// COUNT: values per point.
    counts: Vec<u64>,
    /// POINTS.
    points: Option<u64>,
    /// WIDTH: number of points in a row of the scan.
    width: Option<u64>,
    /// HEIGHT: number of rows of the scan; 1 for unordered clouds.
    height: Option<u64>,
}

/// Words of a line after its key.
struct HeaderLineValues<'l> {
    /// First word of the line, for errors.
    key: &'l str,
    /// Words after the key, at most one more than [`MAX_VALUES_PER_ROW`].
    words: Vec<&'l str>,
    /// Input, for errors.
    input: &'l Input<'l>,
}

impl HeaderLineValues<'_> {
    /// Returns the first word.
    fn first(&self) -> Option<&str> {
        self.words.first().copied()
    }
    /// Maps each word to a value.
    fn each<T>(&self, value: impl Fn(&str) -> T) -> Vec<T> {
        self.words.iter().map(|w| value(w)).collect()
    }
    /// Parses the first word as a number; an error if it is missing.
    fn number(&self) -> Result<u64> {
        number(self.input, self.key, self.first())
    }
    /// Parses all words as numbers.
    fn numbers(&self) -> Result<Vec<u64>> {
        let number = |w: &&str| number(self.input, self.key, Some(w));
        self.words.iter().map(number).collect()
    }
}

impl PcdHeaderLines {
    /// Processes a line; returns the encoding if the line is DATA, which ends the header.
    fn take(
        &mut self,
        line: &str,
        input: &Input<'_>,
        report: &mut ReadReport,
    ) -> Result<Option<PcdEncoding>> {
        let line = line.split('#').next().unwrap_or("");
        let mut words = line.split_ascii_whitespace();
        let Some(key) = words.next() else {
            return Ok(None);
        };
        let words: Vec<&str> = words.take(MAX_VALUES_PER_ROW as usize + 1).collect();
        let values = HeaderLineValues { key, words, input };
        match key {
            "FIELDS" | "COLUMNS" => {
                self.names = values.each(str::to_ascii_lowercase);
            }
            "SIZE" => self.sizes = values.numbers()?,
            "TYPE" => self.kinds = values.each(|w| w.as_bytes()[0].to_ascii_uppercase()),
            "COUNT" => self.counts = values.numbers()?,
            "WIDTH" => self.width = Some(values.number()?),
            "HEIGHT" => self.height = Some(values.number()?),
            "POINTS" => self.points = Some(values.number()?),
            "VIEWPOINT" if values.words != IDENTITY_VIEWPOINT => {
                report.warn("the VIEWPOINT is not applied to the points");
            }
            "VIEWPOINT" | "VERSION" => {}
            "DATA" => return data(input, values.first()).map(Some),
            _ => report.warn(format!(
                "line {}: unknown header word \"{}\" was passed over",
                input.line,
                shorten(key)
            )),
        }
        Ok(None)
    }

    /// Assembles the header from all lines.
    fn header(mut self, data: PcdEncoding, input: &Input<'_>) -> Result<PcdHeader> {
        let n = self.names.len();
        if n == 0 {
            return Err(bad(input, "the line FIELDS is missing"));
        }
        fill(&mut self.counts, n, 1);
        if data == PcdEncoding::Ascii {
            // Text needs neither sizes nor types.
            fill(&mut self.sizes, n, 4);
            fill(&mut self.kinds, n, b'F');
        }
        let (sizes, kinds, counts) = (self.sizes.len(), self.kinds.len(), self.counts.len());
        if [sizes, kinds, counts] != [n; 3] {
            let why = format!("{n} FIELDS, {sizes} SIZE, {kinds} TYPE, {counts} COUNT");
            return Err(bad(input, why));
        }
        let fields = self.fields(input)?;
        match self.points.or_else(|| self.grid()) {
            Some(points) => Ok(PcdHeader {
                fields,
                points,
                data,
            }),
            None => Err(bad(input, "neither POINTS nor WIDTH and HEIGHT")),
        }
    }

    /// Assembles the fields from names, types, sizes and counts, with at most
    /// [`MAX_VALUES_PER_ROW`] values per row.
    fn fields(&mut self, input: &Input<'_>) -> Result<Vec<PcdField>> {
        let mut fields = Vec::new();
        let mut values = 0_u64;
        for (i, name) in std::mem::take(&mut self.names).into_iter().enumerate() {
            let (kind, size, count) = (self.kinds[i], self.sizes[i], self.counts[i]);
            values = values.saturating_add(count);
            match type_of(kind, size) {
                Some(kind) if values <= MAX_VALUES_PER_ROW => fields.push(PcdField {
                    name,
                    kind,
                    count: count as usize,
                }),
                _ => {
                    let why = format!(
                        "field \"{}\" of type {}, size {size}, count {count}",
                        shorten(&name),
                        char::from(kind)
                    );
                    return Err(bad(input, why));
                }
            }
        }
        Ok(fields)
    }

    /// Returns the number of points of an organised scan, width times height.
    fn grid(&self) -> Option<u64> {
        self.width?.checked_mul(self.height.unwrap_or(1))
    }
}

/// Fills an empty list with a default value for each field.
fn fill<T: Clone>(list: &mut Vec<T>, n: usize, value: T) {
    if list.is_empty() {
        list.resize(n, value);
    }
}

/// Parses a word as a non-negative integer.
fn number(input: &Input<'_>, key: &str, word: Option<&str>) -> Result<u64> {
    let number = word.and_then(|w| w.parse().ok());
    number.ok_or_else(|| bad(input, format!("\"{}\" needs a number", shorten(key))))
}

/// Parses the encoding of a line DATA.
fn data(input: &Input<'_>, word: Option<&str>) -> Result<PcdEncoding> {
    match word.map(str::to_ascii_lowercase).as_deref() {
        Some("ascii") => Ok(PcdEncoding::Ascii),
        Some("binary") => Ok(PcdEncoding::Binary),
        Some("binary_compressed") => Ok(PcdEncoding::Compressed),
        _ => Err(bad(
            input,
            "DATA is none of ascii, binary, binary_compressed",
        )),
    }
}
