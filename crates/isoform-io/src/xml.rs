//! Minimal XML reader for mesh files: tags with attributes, comments, and the content between them,
//! in bytes of which some may not be text.
//!
//! CDATA sections count as content, and declarations are skipped. Entities other than the five
//! predefined ones and character references are left unchanged.

/// Escapes text for XML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Reverses [`escape`]; unknown entities are left unchanged.
pub(crate) fn unescape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find('&') {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        let end = rest.find(';').unwrap_or(0);
        let c = match &rest[..end] {
            "&amp" => Some('&'),
            "&lt" => Some('<'),
            "&gt" => Some('>'),
            "&quot" => Some('"'),
            "&apos" => Some('\''),
            number => number.strip_prefix("&#").and_then(character),
        };
        out.push(c.unwrap_or('&'));
        rest = &rest[if c.is_some() { end + 1 } else { 1 }..];
    }
    out + rest
}

/// Returns the character of a decimal or, after an x, hexadecimal reference.
fn character(number: &str) -> Option<char> {
    let code = match number.strip_prefix('x') {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => number.parse(),
    };
    code.ok().and_then(char::from_u32)
}

/// Tag or comment.
#[derive(Debug)]
pub(crate) enum XmlItem<'b> {
    /// `<name attributes>`, also `<name attributes/>`.
    Open {
        name: &'b str,
        /// Text after the name.
        attributes: &'b str,
    },
    /// `</name>`.
    Close(&'b str),
    /// Text of a comment.
    Comment(&'b str),
}

/// Start of a section whose characters all stand for themselves.
const CDATA: &[u8] = b"<![CDATA[";

/// Returns the position of a mark in bytes.
fn find(bytes: &[u8], mark: &[u8]) -> Option<usize> {
    bytes.windows(mark.len()).position(|w| w == mark)
}

/// Returns the length of an item without its end mark, and the length of the mark.
fn end_of_item(rest: &[u8]) -> Option<(usize, usize)> {
    if rest.starts_with(b"<!--") {
        Some((find(rest, b"-->")?, 3))
    } else if rest.starts_with(CDATA) {
        Some((find(rest, b"]]>")?, 3))
    } else {
        let end = end_of_tag(rest).or_else(|| find(rest, b">"))?;
        Some((end, 1))
    }
}

/// Returns the position of the first `>` outside quotes.
fn end_of_tag(rest: &[u8]) -> Option<usize> {
    let mut quote = None;
    rest.iter().position(|&b| {
        match quote {
            Some(open) if open == b => quote = None,
            None if b == b'"' || b == b'\'' => quote = Some(b),
            _ => {}
        }
        quote.is_none() && b == b'>'
    })
}

/// Iterator over the tags of a file.
pub(crate) struct XmlItems<'b> {
    bytes: &'b [u8],
    /// Position after the last item.
    pub(crate) at: usize,
}

impl<'b> XmlItems<'b> {
    pub(crate) fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, at: 0 }
    }
    /// Returns the bytes up to the next tag, or those of a CDATA section at this position.
    pub(crate) fn content(&self) -> &'b [u8] {
        let (text, rest) = self.bytes[self.at..].split_at(self.until_tag());
        match rest.strip_prefix(CDATA) {
            Some(section) if text.trim_ascii().is_empty() => {
                &section[..find(section, b"]]>").unwrap_or(section.len())]
            }
            _ => text,
        }
    }
    /// Returns the number of bytes up to the next tag or the end.
    fn until_tag(&self) -> usize {
        let rest = &self.bytes[self.at..];
        find(rest, b"<").unwrap_or(rest.len())
    }
    /// Returns the next item; `None` at the end and at an unterminated tag.
    pub(crate) fn next(&mut self) -> Option<XmlItem<'b>> {
        loop {
            let start = self.at + self.until_tag();
            let rest = self.bytes.get(start..).filter(|r| !r.is_empty())?;
            let (length, mark) = end_of_item(rest)?;
            self.at = start + length + mark;
            // A tag that is not UTF-8 is damaged and skipped.
            let Ok(text) = std::str::from_utf8(&rest[..length]) else {
                continue;
            };
            if let Some(comment) = text.strip_prefix("<!--") {
                return Some(XmlItem::Comment(comment));
            }
            let text = text[1..].trim();
            if let Some(name) = text.strip_prefix('/') {
                return Some(XmlItem::Close(name.trim()));
            }
            if text.starts_with(['?', '!']) {
                continue;
            }
            let text = text.trim_end_matches('/');
            let end = text
                .find(|c: char| c.is_ascii_whitespace())
                .unwrap_or(text.len());
            return Some(XmlItem::Open {
                name: &text[..end],
                attributes: &text[end..],
            });
        }
    }
}

/// Returns the value of an attribute without unescaping it.
pub(crate) fn attribute<'b>(attributes: &'b str, name: &str) -> Option<&'b str> {
    let mut rest = attributes;
    loop {
        let (key, behind) = rest.split_once('=')?;
        let behind = behind.trim_start();
        let quote = behind.chars().next().filter(|q| "\"'".contains(*q))?;
        let (value, next) = behind[1..].split_once(quote)?;
        if key.trim() == name {
            return Some(value);
        }
        rest = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walks() {
        let mut items =
            XmlItems::new(b"<?xml?>\n<a b = 'x=1' c=\"&lt;\"> 1 2 <!-- <no> --><d/></a><cut");
        let Some(XmlItem::Open {
            name: "a",
            attributes,
        }) = items.next()
        else {
            panic!("no a")
        };
        assert_eq!(
            (
                attribute(attributes, "b"),
                attribute(attributes, "c"),
                attribute(attributes, "x")
            ),
            (Some("x=1"), Some("&lt;"), None)
        );
        assert_eq!(items.content(), b" 1 2 ");
        assert!(matches!(items.next(), Some(XmlItem::Comment(" <no> "))));
        assert!(matches!(
            items.next(),
            Some(XmlItem::Open {
                name: "d",
                attributes: ""
            })
        ));
        assert!(matches!(items.next(), Some(XmlItem::Close("a"))));
        assert!(items.next().is_none());
    }

    #[test]
    fn quotes_and_sections_hide_marks() {
        let mut items =
            XmlItems::new(b"<a n=\"x>y\" m='\">'> <![CDATA[1 <b> 2]]> </a><c d=\"open>");
        let Some(XmlItem::Open {
            name: "a",
            attributes,
        }) = items.next()
        else {
            panic!("no a")
        };
        assert_eq!(attribute(attributes, "n"), Some("x>y"));
        assert_eq!(attribute(attributes, "m"), Some("\">"));
        assert_eq!(items.content(), b"1 <b> 2");
        assert!(matches!(items.next(), Some(XmlItem::Close("a"))));
        // An unclosed quote hides nothing.
        assert!(matches!(
            items.next(),
            Some(XmlItem::Open { name: "c", .. })
        ));
        assert!(items.next().is_none());
        assert!(XmlItems::new(b"<![CDATA[<a>").next().is_none());
    }

    #[test]
    fn entities() {
        let text = "a<b & \"c\" > &amp; &; &x";
        assert_eq!(unescape(&escape(text)), text);
        assert_eq!(unescape("&#45;&#x;&"), "-&#x;&");
        assert_eq!(unescape("&#x41;&#x1F600;&#xD800;"), "A😀&#xD800;");
    }
}
