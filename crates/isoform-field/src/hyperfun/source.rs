//! The program text and positions in it.

use super::SourceToken;
use std::fmt;

/// The text of a program without a byte order mark, with the starts of its lines.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    text: String,
    lines: Vec<u32>,
    ascii: bool,
}

impl Source {
    pub(crate) fn new(text: &str) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text).to_owned();
        let mut lines = vec![0];
        lines.extend(
            text.bytes()
                .enumerate()
                .filter(|(_, b)| *b == b'\n')
                .map(|(i, _)| i as u32 + 1),
        );
        let ascii = text.is_ascii();
        Self { text, lines, ascii }
    }
    pub(crate) fn text(&self) -> &str {
        &self.text
    }
    /// Returns the line and column of a byte offset, from 1; the column counts characters, a tab as
    /// one.
    pub(crate) fn position(&self, offset: u32) -> (usize, usize) {
        let line = self.lines.partition_point(|&l| l <= offset);
        let start = self.lines[line - 1] as usize;
        let offset = (offset as usize).min(self.text.len());
        let column = if self.ascii {
            offset - start
        } else {
            self.text[start..offset].chars().count()
        };
        (line, column + 1)
    }
    /// Returns the word or operator at a byte offset.
    pub(crate) fn place(&self, offset: u32) -> SourceToken {
        let (line, column) = self.position(offset);
        let rest = &self.text[offset as usize..];
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let is_operator = |c: char| matches!(c, '<' | '>' | '=' | '/');
        let end = if rest.starts_with(is_word) {
            rest.find(|c| !is_word(c))
        } else {
            rest.find(|c| !is_operator(c))
        };
        SourceToken {
            line,
            column,
            text: rest[..end.unwrap_or(rest.len())].to_owned(),
        }
    }
    /// Returns the text of line `line` (from 1), without its end.
    pub(crate) fn line(&self, line: usize) -> &str {
        let Some(&start) = line.checked_sub(1).and_then(|l| self.lines.get(l)) else {
            return "";
        };
        let end = self
            .lines
            .get(line)
            .map_or(self.text.len(), |&e| e as usize - 1);
        self.text[start as usize..end].trim_end_matches('\r')
    }
    pub(crate) fn error(
        &self,
        offset: u32,
        message: impl Into<String>,
        hint: impl Into<String>,
    ) -> SyntaxError {
        let (line, column) = self.position(offset);
        SyntaxError {
            line,
            column,
            message: message.into(),
            hint: hint.into(),
        }
    }
}

/// Syntax error of a program. Lines and columns count from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyntaxError {
    /// Line number.
    pub line: usize,
    /// Column number, in characters.
    pub column: usize,
    /// Description of the error.
    pub message: String,
    /// Suggested remedy; empty if the message implies it.
    pub hint: String,
}

impl fmt::Display for SyntaxError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.message)
    }
}

impl std::error::Error for SyntaxError {}

/// Warning of a construct that is legal but probably unintended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Line number.
    pub line: usize,
    /// Column number, in characters.
    pub column: usize,
    /// Description of the construct, and of an unambiguous form of it.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.line, self.column, self.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters() {
        let s = Source::new("\u{feff}a\té b\r\n  c");
        assert_eq!(s.position(0), (1, 1));
        assert_eq!(s.position(5), (1, 5));
        let c = s.text().find('c').expect("there is one") as u32;
        assert_eq!(s.position(c), (2, 3));
        assert_eq!(s.position(c + 9), (2, 4));
        assert_eq!(s.line(1), "a\té b");
        assert_eq!(s.line(2), "  c");
        assert_eq!(s.line(3), "");
    }
}
