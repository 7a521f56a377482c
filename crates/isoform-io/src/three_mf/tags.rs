//! Streaming parser of the tags of an XML text.
//!
//! The text of a model may exceed memory, so only one tag is held at a time, of at most [`MAX_TAG`]
//! bytes. Text between tags is skipped, since 3MF stores all numbers in attributes. Document type
//! declarations are refused, as 3MF requires: they could define entities that expand without bound.

use crate::ErrorKind;
use crate::unzip::Problem;
use std::io::BufRead;

/// Maximum length of a tag or comment, in bytes.
const MAX_TAG: u64 = 1 << 20;

/// Tag of an element.
#[derive(Debug, PartialEq)]
pub(super) enum Tag<'t> {
    /// `<name attributes>`, or `<name attributes/>`, which is already closed.
    Open {
        name: &'t str,
        attributes: &'t str,
        is_closed: bool,
    },
    /// `</name>`.
    Close(&'t str),
}

/// Iterator over the tags of a text.
pub(super) struct Tags<'r> {
    input: &'r mut dyn BufRead,
    /// Present tag, without its opening bracket.
    bytes: Vec<u8>,
    /// Line of the text, from 1.
    pub(super) line: u64,
}

impl<'r> Tags<'r> {
    pub(super) fn new(input: &'r mut dyn BufRead) -> Self {
        Self {
            input,
            bytes: Vec::new(),
            line: 1,
        }
    }

    /// Returns the next tag; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Tag<'_>>, Problem> {
        loop {
            if !self.skip_text()? {
                return Ok(None);
            }
            self.bytes.clear();
            self.until(|bytes| bytes.ends_with(b">"))?;
            match self.bytes.as_slice() {
                [b'!', b'-', b'-', ..] => self.until(|bytes| bytes[3..].ends_with(b"-->"))?,
                [b'!', b'[', ..] => self.until(|bytes| bytes.ends_with(b"]]>"))?,
                [b'?', ..] => self.until(|bytes| bytes.ends_with(b"?>"))?,
                [b'!', ..] => return Err(self.problem("a declaration of types is not allowed")),
                _ => break,
            }
        }
        let (mut quote, mut seen) = (None, 0);
        self.until(|bytes| {
            quote = open_quote(quote, &bytes[seen..]);
            seen = bytes.len();
            quote.is_none()
        })?;
        tag(&self.bytes).map(Some).ok_or_else(|| {
            let why = format!("line {}: a tag is no text in UTF-8", self.line);
            Problem::new(ErrorKind::Corrupt, why)
        })
    }

    /// Skips the text before the next tag and its opening bracket; returns false at the end.
    fn skip_text(&mut self) -> Result<bool, Problem> {
        loop {
            let block = self.input.fill_buf()?;
            if block.is_empty() {
                return Ok(false);
            }
            let at = block.iter().position(|&b| b == b'<');
            let used = at.map_or(block.len(), |at| at + 1);
            self.line += block[..used].iter().filter(|&&b| b == b'\n').count() as u64;
            self.input.consume(used);
            if at.is_some() {
                return Ok(true);
            }
        }
    }

    /// Reads up to the first `>` at which `is_end` accepts all bytes of the tag so far, unless it
    /// accepts them already.
    fn until(&mut self, mut is_end: impl FnMut(&[u8]) -> bool) -> Result<(), Problem> {
        while !is_end(&self.bytes) {
            let before = self.bytes.len();
            let most = MAX_TAG.saturating_sub(before as u64);
            std::io::Read::take(&mut *self.input, most).read_until(b'>', &mut self.bytes)?;
            let new = &self.bytes[before..];
            self.line += new.iter().filter(|&&b| b == b'\n').count() as u64;
            if new.last() != Some(&b'>') {
                return Err(self.problem("a tag does not end"));
            }
        }
        Ok(())
    }

    /// Returns an error at the present line.
    pub(super) fn problem(&self, why: &str) -> Problem {
        Problem::new(ErrorKind::Corrupt, format!("line {}: {why}", self.line))
    }
}

/// Returns the quote that is open after some bytes, given the one open before them.
fn open_quote(before: Option<u8>, bytes: &[u8]) -> Option<u8> {
    bytes.iter().fold(before, |quote, &b| match quote {
        Some(open) if open == b => None,
        None if b == b'"' || b == b'\'' => Some(b),
        quote => quote,
    })
}

/// Parses the bytes of a tag, which end in `>`.
fn tag(bytes: &[u8]) -> Option<Tag<'_>> {
    let text = std::str::from_utf8(bytes).ok()?.strip_suffix('>')?;
    if let Some(name) = text.strip_prefix('/') {
        return Some(Tag::Close(name.trim()));
    }
    let inner = text.strip_suffix('/');
    let is_closed = inner.is_some();
    let text = inner.unwrap_or(text);
    let end = text.find(|c: char| c.is_ascii_whitespace());
    let (name, attributes) = text.split_at(end.unwrap_or(text.len()));
    Some(Tag::Open {
        name,
        attributes,
        is_closed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> Result<Vec<String>, String> {
        let mut bytes = text.as_bytes();
        let mut tags = Tags::new(&mut bytes);
        let mut all = Vec::new();
        loop {
            match tags.next().map_err(|p| p.why)? {
                None => return Ok(all),
                Some(Tag::Close(name)) => all.push(format!("/{name}")),
                Some(Tag::Open {
                    name,
                    attributes,
                    is_closed,
                }) => all.push(format!(
                    "{name}{attributes}{}",
                    if is_closed { "." } else { "" }
                )),
            }
        }
    }

    #[test]
    fn tags_in_their_order() {
        let text = "<?xml a='>'?>\n<a b='x>y' c=\"'\">text<!-- <no> > --><![CDATA[<no>]]><d/></a >";
        assert_eq!(told(text).expect("tags"), ["a b='x>y' c=\"'\"", "d.", "/a"]);
        assert_eq!(told("").expect("nothing"), Vec::<String>::new());
        assert_eq!(
            told("<!--><no>-->").expect("a comment"),
            Vec::<String>::new()
        );
    }

    #[test]
    fn what_does_not_end_or_grows_is_refused() {
        for (text, why) in [
            ("<a>\n<b", "line 2: a tag does not end"),
            ("<a b='>", "line 1: a tag does not end"),
            ("<!-- >", "line 1: a tag does not end"),
            (
                "<!DOCTYPE a [<!ENTITY b 'c'>]>",
                "line 1: a declaration of types is not allowed",
            ),
        ] {
            assert_eq!(told(text).expect_err(text), why);
        }
        let long = format!("<a b='{}'>", "x".repeat(MAX_TAG as usize));
        assert_eq!(told(&long).expect_err("long"), "line 1: a tag does not end");
    }
}
