//! Rows of a PLY file, in text and bytes. Rows without lists have a fixed length and are read or
//! skipped in one step; lists are read item by item.

use super::header::{PlyElement, PlyEncoding};
use crate::ErrorKind;
use crate::binary::NumberType;
use crate::input::{Input, Result, Words, parse_number, shorten};

const PLY_DATA_FAILURE: &str = "cannot read the PLY data";

/// Reader of the rows of one element after another.
pub(super) struct PlyRows {
    pub(super) encoding: PlyEncoding,
    /// Words of a text file, across line ends.
    words: Words,
    /// Bytes of the present row.
    row: Vec<u8>,
    /// Scalars of the row by property; NaN for lists.
    pub(super) values: Vec<f64>,
    /// Items of the requested list.
    pub(super) list: Vec<f64>,
}

impl PlyRows {
    pub(super) fn new(encoding: PlyEncoding) -> Self {
        Self {
            encoding,
            words: Words::new(),
            row: Vec::new(),
            values: Vec::new(),
            list: Vec::new(),
        }
    }

    /// Returns true if any content follows the rows.
    pub(super) fn has_more(&mut self, input: &mut Input<'_>) -> Result<bool> {
        match self.encoding {
            PlyEncoding::Ascii => Ok(self.words.next(input)?.is_some()),
            _ => Ok(input.left() > 0),
        }
    }

    /// Reads row `i`: scalars into `values`, the items of property `wanted` into `list`.
    pub(super) fn next(
        &mut self,
        input: &mut Input<'_>,
        element: &PlyElement,
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
        if self.encoding != PlyEncoding::Ascii
            && let Some(stride) = element.stride()
        {
            self.row.resize(stride, 0);
            input.exact(&mut self.row, missing)?;
            self.decode_row(element);
            return Ok(());
        }
        for (k, p) in element.properties.iter().enumerate() {
            let Some(length) = p.list else {
                let v = self.number(input, p.kind, missing)?;
                self.values.push(v);
                continue;
            };
            self.values.push(f64::NAN);
            for _ in 0..self.list_length(input, length, missing)? {
                let v = self.number(input, p.kind, missing)?;
                if wanted == Some(k) {
                    self.list.push(v);
                }
            }
        }
        Ok(())
    }

    /// Decodes the scalars of the bytes in `row`.
    #[inline]
    fn decode_row(&mut self, element: &PlyElement) {
        let big = self.encoding == PlyEncoding::Big;
        let mut at = 0;
        for p in &element.properties {
            self.values.push(p.kind.decode(&self.row[at..], big));
            at += p.kind.size();
        }
    }

    /// Reads the length of a list, which must be a non-negative integer.
    fn list_length(
        &mut self,
        input: &mut Input<'_>,
        kind: NumberType,
        missing: impl Fn() -> String,
    ) -> Result<u64> {
        let place = input.at_byte();
        let n = self.number(input, kind, missing)?;
        if n >= 0.0 && n <= u64::MAX as f64 && n.fract() == 0.0 {
            return Ok(n as u64);
        }
        let why = format!("{n} is not the length of a list");
        Err(input.error(
            ErrorKind::Corrupt,
            place,
            PLY_DATA_FAILURE,
            why,
            "get the file again",
        ))
    }

    /// Reads the next number of a type, from text or bytes.
    fn number(
        &mut self,
        input: &mut Input<'_>,
        kind: NumberType,
        missing: impl Fn() -> String,
    ) -> Result<f64> {
        if self.encoding == PlyEncoding::Ascii {
            return self.word(input, missing);
        }
        let mut bytes = [0; 8];
        input.exact(&mut bytes[..kind.size()], missing)?;
        Ok(kind.decode(&bytes, self.encoding == PlyEncoding::Big))
    }

    /// Parses the next number of a text.
    fn word(&mut self, input: &mut Input<'_>, missing: impl Fn() -> String) -> Result<f64> {
        let Some(word) = self.words.next(input)? else {
            return Err(input.truncated(missing()));
        };
        if let Some(v) = parse_number(word).or_else(|| truth(word)) {
            return Ok(v);
        }
        let why = format!("\"{}\" is not a number", shorten(word));
        let at = input.at_line(self.words.column);
        let hint = "correct the line, or save the file again";
        Err(input.error(ErrorKind::Number, at, PLY_DATA_FAILURE, why, hint))
    }

    /// Skips all rows of an element.
    pub(super) fn skip(&mut self, input: &mut Input<'_>, element: &PlyElement) -> Result<()> {
        if self.encoding != PlyEncoding::Ascii
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

/// Parses a `bool` property, which some writers store as a word.
fn truth(word: &str) -> Option<f64> {
    let truth: bool = word.to_ascii_lowercase().parse().ok()?;
    Some(f64::from(truth))
}
