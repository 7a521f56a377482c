//! Tokens. Letters fold to lower case; two minus signs start a comment that runs to the end of the
//! line.

use super::source::Source;

/// Reserved words that are not function names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Word {
    X,
    A,
    S,
    Array,
    If,
    Then,
    Else,
    Endif,
    While,
    Loop,
    Endloop,
    And,
    Or,
    Not,
    Xor,
}

impl Word {
    /// Returns a description of the word's meaning, for messages about its use as a name.
    pub(crate) fn meaning(self) -> &'static str {
        match self {
            Self::X => "the array of coordinates",
            Self::A => "the array of parameters",
            Self::S => "the array of attributes",
            _ => "a word of the language",
        }
    }
}

/// Reserved words in lower case; upper case is accepted.
const WORDS: [(&str, Word); 15] = [
    ("x", Word::X),
    ("a", Word::A),
    ("s", Word::S),
    ("array", Word::Array),
    ("if", Word::If),
    ("then", Word::Then),
    ("else", Word::Else),
    ("endif", Word::Endif),
    ("while", Word::While),
    ("loop", Word::Loop),
    ("endloop", Word::Endloop),
    ("and", Word::And),
    ("or", Word::Or),
    ("not", Word::Not),
    ("xor", Word::Xor),
];

/// Symbols; a symbol precedes its own prefixes.
const SYMBOLS: [&str; 24] = [
    "<=", ">=", "/=", "^", "+", "-", "~", "/", "*", "&", "|", "\\", "@", ",", ";", "=", "(", ")",
    "[", "]", "{", "}", "<", ">",
];

/// Length in bytes from which names are rejected, as by the reference implementation.
const MAX_NAME_LENGTH: usize = 256;

/// The kind of a token, with its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TokenKind {
    Word(Word),
    Name,
    Number(f64),
    Symbol(&'static str),
    /// A string "…"; no function takes one.
    Text,
    /// A character that cannot start a token, or an invalid token.
    Unknown,
    End,
}

/// A token and its byte range in the text.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Token {
    pub(crate) kind: TokenKind,
    pub(crate) start: u32,
    pub(crate) end: u32,
}

/// Splits a program into tokens, closed by `End`; returns them and the byte ranges of the comments,
/// without the two dashes.
pub(crate) fn tokens(source: &Source) -> (Vec<Token>, Vec<(u32, u32)>) {
    let text = source.text();
    let bytes = text.as_bytes();
    let (mut found, mut comments) = (Vec::new(), Vec::new());
    let mut i = 0;
    while i < bytes.len() {
        if matches!(bytes[i], b' ' | b'\t' | b'\n' | b'\r' | 0x0C) {
            i += 1;
            continue;
        }
        let start = i as u32;
        if bytes[i..].starts_with(b"--") {
            let line = bytes[i..].iter().position(|&b| b == b'\n');
            i = line.map_or(bytes.len(), |length| i + length);
            comments.push((start + 2, i as u32));
            continue;
        }
        let (kind, length) = token(&text[i..]);
        i += length;
        found.push(Token {
            kind,
            start,
            end: i as u32,
        });
    }
    let end = bytes.len() as u32;
    found.push(Token {
        kind: TokenKind::End,
        start: end,
        end,
    });
    (found, comments)
}

/// Reads the first token of a text; returns its kind and its length in bytes.
fn token(text: &str) -> (TokenKind, usize) {
    let bytes = text.as_bytes();
    match bytes[0] {
        b'a'..=b'z' | b'A'..=b'Z' => word(text),
        b'0'..=b'9' => number_token(text),
        b'.' if bytes.get(1).is_some_and(u8::is_ascii_digit) => number_token(text),
        b'"' => {
            let end = bytes[1..].iter().position(|&b| b == b'"' || b == b'\n');
            match end {
                Some(n) if bytes[1 + n] == b'"' => (TokenKind::Text, n + 2),
                _ => (TokenKind::Unknown, 1),
            }
        }
        _ => match SYMBOLS.iter().find(|s| text.starts_with(**s)) {
            Some(symbol) => (TokenKind::Symbol(symbol), symbol.len()),
            None => {
                let length = text.chars().next().map_or(1, char::len_utf8);
                (TokenKind::Unknown, length)
            }
        },
    }
}

/// Reads a reserved word or a name; returns its kind and its length in bytes.
fn word(text: &str) -> (TokenKind, usize) {
    let is_part = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
    let length = text.bytes().take_while(is_part).count();
    let name = &text[..length];
    let kind = match WORDS.iter().find(|(w, _)| name.eq_ignore_ascii_case(w)) {
        Some((_, word)) => TokenKind::Word(*word),
        None if length >= MAX_NAME_LENGTH => TokenKind::Unknown,
        None => TokenKind::Name,
    };
    (kind, length)
}

/// Reads a number; returns its kind and its length in bytes.
fn number_token(text: &str) -> (TokenKind, usize) {
    let length = number_end(text.as_bytes(), 0);
    (number(&text[..length]), length)
}

/// Returns the end of a number of the form digits \[. digits\] \[e \[+-\] digits\] or . digits …
fn number_end(bytes: &[u8], start: usize) -> usize {
    let digits = |mut i: usize| {
        while bytes.get(i).is_some_and(u8::is_ascii_digit) {
            i += 1;
        }
        i
    };
    let mut i = digits(start);
    if bytes.get(i) == Some(&b'.') {
        i = digits(i + 1);
    }
    if matches!(bytes.get(i), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(i + 1), Some(b'+' | b'-')));
        if bytes.get(i + 1 + sign).is_some_and(u8::is_ascii_digit) {
            i = digits(i + 1 + sign);
        }
    }
    i
}

/// Converts a number with correct rounding; `Unknown` if it exceeds the range of f64.
fn number(text: &str) -> TokenKind {
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() => TokenKind::Number(v),
        _ => TokenKind::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(text: &str) -> Vec<TokenKind> {
        tokens(&Source::new(text))
            .0
            .into_iter()
            .map(|t| t.kind)
            .collect()
    }

    #[test]
    fn numbers_in_all_forms() {
        for (text, value) in [
            ("5.", 5.0),
            (".5", 0.5),
            ("05", 5.0),
            ("1e0", 1.0),
            ("1e-05", 1e-5),
            ("2E+3", 2000.0),
            ("1.5e2", 150.0),
        ] {
            assert_eq!(
                kinds(text),
                [TokenKind::Number(value), TokenKind::End],
                "{text}"
            );
        }
        assert_eq!(kinds("2e")[0], TokenKind::Number(2.0));
        assert_eq!(kinds("1e999")[0], TokenKind::Unknown);
        assert_eq!(kinds("1e999999999999999999999")[0], TokenKind::Unknown);
    }

    #[test]
    fn two_dashes_comment_to_the_end_of_the_line() {
        assert_eq!(
            kinds("a--b\n;"),
            [
                TokenKind::Word(Word::A),
                TokenKind::Symbol(";"),
                TokenKind::End
            ]
        );
        assert_eq!(
            kinds("- -"),
            [
                TokenKind::Symbol("-"),
                TokenKind::Symbol("-"),
                TokenKind::End
            ]
        );
    }

    #[test]
    fn strange_characters_are_unknown_tokens() {
        assert_eq!(
            kinds("é?_\"x"),
            [
                TokenKind::Unknown,
                TokenKind::Unknown,
                TokenKind::Unknown,
                TokenKind::Unknown,
                TokenKind::Word(Word::X),
                TokenKind::End
            ]
        );
    }
}
