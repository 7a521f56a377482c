//! Detection of field separators: blanks, tabs, commas or semicolons. Commas are decimal between
//! semicolons, and in three or more fields between blanks.

use crate::input::parse_number;

/// Separator of the fields of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Separator {
    /// One or more blanks or tabs.
    Blank,
    /// One character; two of them in a row enclose an empty field.
    Char(char),
}

/// Masks separators within quoted fields. Quotes count only at the start of a field: `1.5" 2.5"`
/// are inches.
fn masked(line: &str) -> std::borrow::Cow<'_, str> {
    if !line.contains('"') {
        return line.into();
    }
    let (mut is_in, mut is_start) = (false, true);
    let mask = |c: char| {
        if is_in {
            is_in = c != '"';
            return '_';
        }
        is_in = is_start && c == '"';
        is_start = c == ';' || c == ',' || c.is_whitespace();
        if is_in { '_' } else { c }
    };
    line.chars().map(mask).collect::<String>().into()
}

/// Returns the length of a quoted field at the start of a text, including its quotes; a doubled
/// quote is a quote.
fn quoted(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    if bytes.first() != Some(&b'"') {
        return None;
    }
    let mut at = 1;
    loop {
        at += bytes[at..].iter().position(|&b| b == b'"')? + 1;
        if bytes.get(at) != Some(&b'"') {
            return Some(at);
        }
        at += 1;
    }
}

/// Returns true if a field is a number with a decimal comma or without one.
pub(super) fn is_decimal(field: &str) -> bool {
    parse_number(&field.replace(',', ".")).is_some()
}

impl Separator {
    /// Detects the separator of a line, and returns true with it if commas are decimal.
    pub(super) fn detect(line: &str) -> (Self, bool) {
        let bare = masked(line);
        if bare.contains(';') {
            return (Self::Char(';'), true);
        }
        // Blanks that do not separate numbers are part of a field.
        let is_field = |f: &str| {
            let mut words = f.split_whitespace();
            words.clone().count() < 2 || !words.all(is_decimal)
        };
        let mut tabs = bare.split('\t').map(str::trim);
        let by_tab = tabs.clone().count() >= 3 && tabs.all(is_field);
        if bare.contains(',') {
            let blanks: Vec<&str> = bare.split_ascii_whitespace().collect();
            let fits =
                |f: &&str| f.matches(',').count() <= 1 && !f.ends_with(',') && !f.starts_with(',');
            let numbers = blanks.iter().filter(|f| is_decimal(f)).count();
            let decimal = numbers >= 3 && blanks.iter().all(fits);
            return match decimal {
                true if by_tab => (Self::Char('\t'), true),
                true => (Self::Blank, true),
                false if by_tab => (Self::Char('\t'), false),
                // Between quotes commas are decimal: "1,5","2,5".
                false => (Self::Char(','), bare != line),
            };
        }
        let separator = if by_tab {
            Self::Char('\t')
        } else {
            Self::Blank
        };
        (separator, line.contains(','))
    }
    /// Splits a line into fields with their byte offsets, without enclosing quotes; an empty last
    /// field is omitted.
    pub(super) fn split(self, line: &str) -> impl Iterator<Item = (usize, &str)> {
        let mut at = 0;
        let may_be_quoted = line.contains('"');
        std::iter::from_fn(move || {
            if at > line.len() {
                return None;
            }
            if self == Self::Blank {
                let mut bytes = line.as_bytes()[at..].iter();
                at += bytes.position(|b| !b.is_ascii_whitespace())?;
            }
            let rest = &line[at..];
            let lead = rest.len() - rest.trim_start_matches(' ').len();
            let quotes = may_be_quoted.then(|| quoted(&rest[lead..])).flatten();
            let behind = quotes.map_or(0, |n| lead + n);
            let end = match self {
                Self::Blank => rest
                    .bytes()
                    .skip(behind)
                    .position(|b| b.is_ascii_whitespace()),
                Self::Char(c) => rest[behind..].find(c),
            };
            let end = end.map(|e| behind + e);
            let field = &rest[..end.unwrap_or(rest.len())];
            let start = at;
            at = end.map_or(line.len() + 1, |e| start + e + 1);
            let lead = field.len() - field.trim_start().len();
            let field = field.trim();
            if end.is_none() && field.is_empty() {
                return None;
            }
            // Text after the closing quote belongs to the field, which is then not a number.
            match quotes.filter(|&n| n == field.len()) {
                Some(n) => Some((start + lead + 1, field[1..n - 1].trim())),
                None => Some((start + lead, field)),
            }
        })
    }
}
