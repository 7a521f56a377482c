//! Input stream that tracks its position.
//!
//! Every reader of the crate reads through [`Input`], so that errors name the file and the line or
//! byte, and sizes announced by a header can be compared with the remaining bytes. Text is read by
//! lines, with any kind of line end, or by words ([`Words`]).

use crate::{At, ErrorKind, Place, ReadError};
use std::io::{BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Maximum length of a line, in bytes: enough for a polygon with a million corners, and bounded for
/// memory.
const MAX_LINE_BYTES: usize = 16 << 20;
/// Size of the read buffer, in bytes.
const READ_BUFFER_BYTES: usize = 1 << 18;

/// Result of the readers.
pub(crate) type Result<T> = std::result::Result<T, ReadError>;

/// Source of a file's content.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// File, which is streamed.
    Path(&'a Path),
    /// Bytes in memory (standard input, an archive member) with a name for messages and for the
    /// format by its ending.
    Bytes {
        /// Name for messages, such as `-`.
        name: &'a str,
        /// Complete content.
        bytes: &'a [u8],
    },
}

/// Buffered reading and seeking, as readers need it.
pub(crate) trait SeekableInput: BufRead + Seek + Send + Sync {}
impl<T: BufRead + Seek + Send + Sync> SeekableInput for T {}

/// Source of bytes with its name and the present position.
pub(crate) struct Input<'a> {
    /// Underlying stream.
    stream: Box<dyn SeekableInput + 'a>,
    /// Name in messages.
    pub(crate) name: String,
    /// Length in bytes.
    pub(crate) size: u64,
    /// Number of bytes consumed.
    pub(crate) offset: u64,
    /// Number of the last line read, from 1.
    pub(crate) line: u64,
    /// True if lines end in a lone carriage return (Mac OS before 2001); decided at the first line
    /// end.
    lone_cr: Option<bool>,
}

/// Stream and its length in bytes.
type SizedStream<'a> = (Box<dyn SeekableInput + 'a>, u64);

/// Wraps bytes in memory as a stream.
fn held<'a>(bytes: impl AsRef<[u8]> + Send + Sync + 'a) -> SizedStream<'a> {
    let size = bytes.as_ref().len() as u64;
    (Box::new(Cursor::new(bytes)), size)
}

/// Opens a file as a stream. A pipe or a device, which cannot be sought, is read into memory.
fn open_file<'a>(path: &Path) -> std::io::Result<SizedStream<'a>> {
    let mut file = std::fs::File::open(path)?;
    let meta = file.metadata()?;
    if meta.is_dir() {
        return Err(std::io::Error::other("it is a folder, not a file"));
    }
    if meta.is_file() {
        let stream = BufReader::with_capacity(READ_BUFFER_BYTES, file);
        return Ok((Box::new(stream), meta.len()));
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(held(bytes))
}

impl<'a> Input<'a> {
    /// Opens a source. Fails if the file is missing, unreadable or a folder.
    pub(crate) fn open(source: Source<'a>) -> Result<Self> {
        let (name, (stream, size)) = match source {
            Source::Bytes { name, bytes } => (name.to_owned(), held(bytes)),
            Source::Path(path) => {
                let name = path.display().to_string();
                let stream = open_file(path).map_err(|e| ReadError {
                    kind: ErrorKind::Unreadable,
                    what: "cannot open the file",
                    place: Place {
                        file: name.clone(),
                        at: At::File,
                    },
                    why: e.to_string(),
                    hint: "check the name and the permissions",
                })?;
                (name, stream)
            }
        };
        Ok(Self {
            stream,
            name,
            size,
            offset: 0,
            line: 0,
            lone_cr: None,
        })
    }

    /// Returns an error at a position of this source.
    pub(crate) fn error(
        &self,
        kind: ErrorKind,
        at: At,
        what: &'static str,
        why: impl Into<String>,
        hint: &'static str,
    ) -> ReadError {
        ReadError {
            kind,
            what,
            place: self.place(at),
            why: why.into(),
            hint,
        }
    }
    /// Returns a position with the name of this source.
    pub(crate) fn place(&self, at: At) -> Place {
        Place {
            file: self.name.clone(),
            at,
        }
    }
    /// Returns the position of the last line read.
    pub(crate) fn at_line(&self, column: usize) -> At {
        At::Line {
            line: self.line,
            column: column as u64,
        }
    }
    /// Returns the position of the next byte.
    pub(crate) fn at_byte(&self) -> At {
        At::Byte(self.offset)
    }
    /// Returns the error for a source that fails while being read.
    pub(crate) fn unreadable(&self, e: &std::io::Error) -> ReadError {
        let hint = "check the disk or the network share";
        self.error(
            ErrorKind::Unreadable,
            self.at_byte(),
            "cannot read on",
            e.to_string(),
            hint,
        )
    }
    /// Returns the error for a source that ends before its content is complete.
    pub(crate) fn truncated(&self, missing: impl Into<String>) -> ReadError {
        let hint = "the file was cut off (an aborted copy or download?): get it again";
        self.error(
            ErrorKind::Truncated,
            self.at_byte(),
            "the file ends too early",
            missing,
            hint,
        )
    }

    /// Returns the first bytes without consuming them.
    pub(crate) fn head(&mut self, n: usize) -> Result<Vec<u8>> {
        let start = self.offset;
        let mut head = Vec::new();
        (&mut self.stream)
            .take(n as u64)
            .read_to_end(&mut head)
            .map_err(|e| self.unreadable(&e))?;
        self.seek(start)?;
        Ok(head)
    }
    /// Seeks to a byte, counted from the start of the source.
    pub(crate) fn seek(&mut self, to: u64) -> Result<()> {
        self.stream
            .seek(SeekFrom::Start(to))
            .map_err(|e| self.unreadable(&e))?;
        self.offset = to;
        Ok(())
    }
    /// Returns the number of remaining bytes.
    pub(crate) fn left(&self) -> u64 {
        self.size.saturating_sub(self.offset)
    }
    /// Returns the underlying stream, for readers that seek on their own.
    pub(crate) fn stream(&mut self) -> &mut (dyn SeekableInput + 'a) {
        &mut *self.stream
    }

    /// Fills `to`; `missing` describes what the file lacks.
    pub(crate) fn exact(&mut self, to: &mut [u8], missing: impl Fn() -> String) -> Result<()> {
        match self.stream.read_exact(to) {
            Ok(()) => {
                self.offset += to.len() as u64;
                Ok(())
            }
            Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
                Err(self.truncated(missing()))
            }
            Err(e) => Err(self.unreadable(&e)),
        }
    }
    /// Skips `n` bytes; `missing` describes what the file lacks.
    pub(crate) fn skip(&mut self, n: u64, missing: impl Fn() -> String) -> Result<()> {
        if n > self.left() {
            return Err(self.truncated(missing()));
        }
        self.stream
            .seek_relative(n as i64)
            .map_err(|e| self.unreadable(&e))?;
        self.offset += n;
        Ok(())
    }

    /// Reads a line without its end into `text`; false at the end of the file. Invalid UTF-8
    /// becomes U+FFFD, and a byte order mark at the start of the file is skipped.
    pub(crate) fn read_line(&mut self, text: &mut String, bytes: &mut Vec<u8>) -> Result<bool> {
        bytes.clear();
        text.clear();
        if !self.read_to_line_end(bytes)? {
            return Ok(false);
        }
        self.line += 1;
        if bytes.last() == Some(&b'\r') {
            bytes.pop();
        }
        let bytes = if self.line == 1 {
            bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
        } else {
            bytes
        };
        match std::str::from_utf8(bytes) {
            Ok(ok) => text.push_str(ok),
            Err(_) => text.push_str(&String::from_utf8_lossy(bytes)),
        }
        Ok(true)
    }

    /// Consumes the bytes up to and including the next line end and appends them without it; false
    /// at the end of the file.
    fn read_to_line_end(&mut self, bytes: &mut Vec<u8>) -> Result<bool> {
        let mut any = false;
        loop {
            let block = match self.stream.fill_buf() {
                Ok(block) => block,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(self.unreadable(&e)),
            };
            if block.is_empty() {
                return Ok(any);
            }
            any = true;
            if self.lone_cr.is_none() {
                self.lone_cr = ends_in_lone_cr(block, self.size.saturating_sub(self.offset));
            }
            let end = if self.lone_cr == Some(true) {
                b'\r'
            } else {
                b'\n'
            };
            let at = block.iter().position(|&b| b == end);
            let used = at.map_or(block.len(), |at| at + 1);
            bytes.extend_from_slice(&block[..at.unwrap_or(block.len())]);
            self.stream.consume(used);
            self.offset += used as u64;
            if bytes.len() > MAX_LINE_BYTES {
                return Err(self.line_too_long());
            }
            if at.is_some() {
                return Ok(true);
            }
        }
    }

    /// Returns the error for a line of more than [`MAX_LINE_BYTES`] bytes.
    fn line_too_long(&self) -> ReadError {
        let why = format!(
            "line {} is longer than {} MiB",
            self.line + 1,
            MAX_LINE_BYTES >> 20
        );
        let hint = "this is probably not a text file; name the format";
        self.error(
            ErrorKind::Corrupt,
            self.at_byte(),
            "cannot read the text",
            why,
            hint,
        )
    }
}

/// Returns true if the first line end in a block is a lone carriage return; `None` if the block
/// leaves it open. `left` is the number of bytes from the start of the block to the end of the
/// file.
fn ends_in_lone_cr(block: &[u8], left: u64) -> Option<bool> {
    let at = block.iter().position(|&b| b == b'\n' || b == b'\r')?;
    match (block[at], block.get(at + 1)) {
        (b'\n', _) | (_, Some(b'\n')) => Some(false),
        // The last byte of a block is inconclusive; the next block decides, at the cost of at most
        // one wrong line.
        (_, None) if at as u64 + 1 < left => None,
        _ => Some(true),
    }
}

/// Reader of blank-separated words across lines, with their positions.
pub(crate) struct Words {
    /// Present line, as text and bytes.
    text: String,
    bytes: Vec<u8>,
    /// Byte offset in the line after the last word.
    at: usize,
    /// Column of the last word.
    pub(crate) column: usize,
}

impl Words {
    pub(crate) fn new() -> Self {
        Self {
            text: String::new(),
            bytes: Vec::new(),
            at: 0,
            column: 0,
        }
    }
    /// Returns the next word; `None` at the end of the file.
    pub(crate) fn next(&mut self, input: &mut Input<'_>) -> Result<Option<&str>> {
        loop {
            let rest = &self.text.as_bytes()[self.at..];
            if let Some(start) = rest.iter().position(|b| !b.is_ascii_whitespace()) {
                let start = self.at + start;
                let word = &self.text.as_bytes()[start..];
                let end = start
                    + word
                        .iter()
                        .position(u8::is_ascii_whitespace)
                        .unwrap_or(word.len());
                self.at = end;
                self.column = start + 1;
                return Ok(Some(&self.text[start..end]));
            }
            self.at = 0;
            if !input.read_line(&mut self.text, &mut self.bytes)? {
                return Ok(None);
            }
        }
    }
    /// Reads the next word as a number.
    pub(crate) fn number(
        &mut self,
        input: &mut Input<'_>,
        missing: impl Fn() -> String,
    ) -> Result<f64> {
        match self.next(input)? {
            None => Err(input.truncated(missing())),
            Some(word) => match parse_number(word) {
                Some(v) => Ok(v),
                None => {
                    let why = format!("\"{}\" is not a number", shorten(word));
                    Err(input.error(
                        ErrorKind::Number,
                        input.at_line(self.column),
                        "cannot read the values",
                        why,
                        "correct the line",
                    ))
                }
            },
        }
    }
    /// Skips the rest of the present line.
    pub(crate) fn pass_line(&mut self) {
        self.at = self.text.len();
    }
    /// Starts on a line that was read already.
    pub(crate) fn set(&mut self, line: &str) {
        self.text.clear();
        self.text.push_str(line);
        self.at = 0;
    }
}

/// Parses a decimal number, also with Fortran's D exponent and the many spellings of "not a
/// number".
pub(crate) fn parse_number(word: &str) -> Option<f64> {
    if let Ok(v) = word.parse() {
        return Some(v);
    }
    let low = word.to_ascii_lowercase();
    match low.as_str() {
        "-nan" | "+nan" | "1.#qnan" | "-1.#ind" | "1.#ind" | "-1.#qnan" | "nan(ind)"
        | "-nan(ind)" | "n/a" | "na" | "null" => Some(f64::NAN),
        "1.#inf" => Some(f64::INFINITY),
        "-1.#inf" => Some(f64::NEG_INFINITY),
        _ if low.contains('d')
            && low
                .bytes()
                .all(|b| b.is_ascii_digit() || b"+-.d".contains(&b)) =>
        {
            low.replace('d', "e").parse().ok()
        }
        _ => None,
    }
}

/// Returns at most 40 characters of a word, without control characters, for messages.
pub(crate) fn shorten(word: &str) -> String {
    let mut s: String = word
        .chars()
        .take(40)
        .map(|c| if c.is_control() { '.' } else { c })
        .collect();
    if s.len() < word.len() {
        s.push('…');
    }
    s
}

/// Returns the unit that a comment or a header states, such as `units: mm` or `UNITS=inch`.
pub(crate) fn stated_unit(comment: &str) -> Option<String> {
    let low = comment.to_ascii_lowercase();
    let rest = &low[low.find("unit")? + 4..];
    let rest = rest.strip_prefix('s').unwrap_or(rest).trim_start();
    let rest = rest
        .strip_prefix([':', '='])
        .or_else(|| rest.strip_prefix("are"))
        .or_else(|| rest.strip_prefix("is"))
        .unwrap_or(rest);
    let word: String = rest
        .trim_start_matches([' ', '"', '\'', '\t'])
        .chars()
        .take_while(char::is_ascii_alphabetic)
        .collect();
    unit_named(&word).map(str::to_owned)
}

/// Returns the unit of length for a word in lower case.
pub(crate) fn unit_named(word: &str) -> Option<&'static str> {
    Some(match word {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => "mm",
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => "cm",
        "m" | "meter" | "meters" | "metre" | "metres" => "m",
        "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "microns" | "micrometer" | "micrometre" => "um",
        "in" | "inch" | "inches" => "in",
        "ft" | "foot" | "feet" => "ft",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: &[u8]) -> Vec<String> {
        let mut input = Input::open(Source::Bytes { name: "t", bytes }).expect("bytes");
        let (mut text, mut buffer, mut all) = (String::new(), Vec::new(), Vec::new());
        while input.read_line(&mut text, &mut buffer).expect("readable") {
            all.push(text.clone());
        }
        all
    }

    #[test]
    fn line_ends_of_three_worlds() {
        let want = ["a", "", "b c"].map(String::from).to_vec();
        assert_eq!(lines(b"a\n\nb c"), want);
        assert_eq!(lines(b"a\r\n\r\nb c\r\n"), want);
        assert_eq!(lines(b"\xef\xbb\xbfa\r\rb c\r"), want);
        assert!(lines(b"").is_empty());
    }

    #[test]
    fn numbers_of_many_hands() {
        assert_eq!(parse_number("1.5D+03"), Some(1500.0));
        assert_eq!(parse_number("-2e-3"), Some(-0.002));
        assert!(parse_number("-nan").is_some_and(f64::is_nan));
        assert_eq!(parse_number("dad"), None);
        assert_eq!(parse_number(""), None);
    }

    #[test]
    fn units_in_comments() {
        assert_eq!(stated_unit("Units: mm").as_deref(), Some("mm"));
        assert_eq!(stated_unit("UNITS=inch").as_deref(), Some("in"));
        assert_eq!(stated_unit("a unitary thing"), None);
        assert_eq!(stated_unit("nothing"), None);
    }
}
