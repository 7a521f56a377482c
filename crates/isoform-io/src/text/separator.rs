//! What stands between the fields of a line: blanks, tabs, commas or semicolons; and whether commas
//! are decimal, as they are beside semicolons and in three fields or more between blanks.

/// What stands between fields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Separator {
    /// One or more blanks or tabs.
    Blank,
    /// One character; two of them in a row have an empty field between.
    Char(char),
}

impl Separator {
    /// The separator of a line, and whether its commas are decimal.
    pub(super) fn of(line: &str) -> (Self, bool) {
        if line.contains(';') {
            return (Self::Char(';'), line.contains(','));
        }
        let tabs: Vec<&str> = line.split('\t').map(str::trim).collect();
        let by_tab = tabs.len() >= 3 && tabs.iter().all(|f| !f.contains(char::is_whitespace));
        if line.contains(',') {
            let blanks: Vec<&str> = line.split_ascii_whitespace().collect();
            let decimal = blanks.len() >= 3
                && blanks.iter().all(|f| {
                    f.matches(',').count() <= 1 && !f.ends_with(',') && !f.starts_with(',')
                });
            return match decimal {
                true if by_tab => (Self::Char('\t'), true),
                true => (Self::Blank, true),
                false => (Self::Char(','), false),
            };
        }
        (
            if by_tab {
                Self::Char('\t')
            } else {
                Self::Blank
            },
            false,
        )
    }
    /// Fields with their byte offsets; an empty one at the end is a mere end mark.
    pub(super) fn split(self, line: &str) -> impl Iterator<Item = (usize, &str)> {
        let mut at = 0;
        std::iter::from_fn(move || {
            if at > line.len() {
                return None;
            }
            if self == Self::Blank {
                let mut bytes = line.as_bytes()[at..].iter();
                at += bytes.position(|b| !b.is_ascii_whitespace())?;
            }
            let rest = &line[at..];
            let end = match self {
                Self::Blank => rest.bytes().position(|b| b.is_ascii_whitespace()),
                Self::Char(c) => rest.find(c),
            };
            let field = &rest[..end.unwrap_or(rest.len())];
            let start = at;
            at = end.map_or(line.len() + 1, |e| start + e + 1);
            let lead = field.len() - field.trim_start().len();
            let field = field.trim();
            if end.is_none() && field.is_empty() {
                return None;
            }
            Some((start + lead, field))
        })
    }
}
