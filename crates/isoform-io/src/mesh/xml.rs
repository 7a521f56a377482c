//! As much XML as mesh files need: tags with attributes, comments, and what lies between them, in
//! bytes that need not all be text.

/// Text with the characters replaced that XML keeps for itself.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// The text again; what is no known entity stays.
pub(super) fn unescape(text: &str) -> String {
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
            number => number
                .strip_prefix("&#")
                .and_then(|n| n.parse().ok())
                .and_then(char::from_u32),
        };
        out.push(c.unwrap_or('&'));
        rest = &rest[if c.is_some() { end + 1 } else { 1 }..];
    }
    out + rest
}

/// Something in angle brackets.
#[derive(Debug)]
pub(super) enum Item<'b> {
    /// `<name attributes>`, also `<name attributes/>`.
    Open {
        name: &'b str,
        /// What stands behind the name.
        attributes: &'b str,
    },
    /// `</name>`.
    Close(&'b str),
    /// What a comment says.
    Comment(&'b str),
}

/// Walks over the tags of a file.
pub(super) struct Items<'b> {
    bytes: &'b [u8],
    /// Behind the item given last.
    pub(super) at: usize,
}

impl<'b> Items<'b> {
    pub(super) fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, at: 0 }
    }
    /// The bytes up to the next tag.
    pub(super) fn content(&self) -> &'b [u8] {
        let rest = &self.bytes[self.at..];
        &rest[..rest.iter().position(|&b| b == b'<').unwrap_or(rest.len())]
    }
    /// The next item; `None` at the end, or where a tag does not end.
    pub(super) fn next(&mut self) -> Option<Item<'b>> {
        loop {
            let start = self.at + self.content().len();
            let rest = self.bytes.get(start..).filter(|r| !r.is_empty())?;
            let close: &[u8] = if rest.starts_with(b"<!--") {
                b"-->"
            } else {
                b">"
            };
            let length = rest.windows(close.len()).position(|w| w == close)?;
            self.at = start + length + close.len();
            // What is not text is damage, and no item.
            let Ok(text) = std::str::from_utf8(&rest[..length]) else {
                continue;
            };
            if let Some(comment) = text.strip_prefix("<!--") {
                return Some(Item::Comment(comment));
            }
            let text = text[1..].trim();
            if let Some(name) = text.strip_prefix('/') {
                return Some(Item::Close(name.trim()));
            }
            if text.starts_with(['?', '!']) {
                continue;
            }
            let text = text.trim_end_matches('/');
            let end = text
                .find(|c: char| c.is_ascii_whitespace())
                .unwrap_or(text.len());
            return Some(Item::Open {
                name: &text[..end],
                attributes: &text[end..],
            });
        }
    }
}

/// The value of an attribute, as it stands in the file.
pub(super) fn attribute<'b>(attributes: &'b str, name: &str) -> Option<&'b str> {
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
            Items::new(b"<?xml?>\n<a b = 'x=1' c=\"&lt;\"> 1 2 <!-- <no> --><d/></a><cut");
        let Some(Item::Open {
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
        assert!(matches!(items.next(), Some(Item::Comment(" <no> "))));
        assert!(matches!(
            items.next(),
            Some(Item::Open {
                name: "d",
                attributes: ""
            })
        ));
        assert!(matches!(items.next(), Some(Item::Close("a"))));
        assert!(items.next().is_none());
    }

    #[test]
    fn entities() {
        let text = "a<b & \"c\" > &amp; &; &x";
        assert_eq!(unescape(&escape(text)), text);
        assert_eq!(unescape("&#45;&#x;&"), "-&#x;&");
    }
}
