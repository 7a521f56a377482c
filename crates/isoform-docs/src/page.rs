//! Conversion of a page from Markdown to HTML, with its links and anchors.

use pulldown_cmark::{CowStr, Event, HeadingLevel, Options, Parser, Tag, TagEnd, html};
use std::collections::HashMap;

/// Heading with its anchor.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Heading {
    /// Fragment of an address that leads to the heading, without `#`.
    pub(crate) anchor: String,
    /// Text of the heading.
    pub(crate) text: String,
    /// True if the heading starts a section, directly below the title.
    pub(crate) is_section: bool,
}

/// Page without header and navigation.
#[derive(Debug)]
pub(crate) struct Page {
    /// Title of the page.
    pub(crate) title: String,
    /// All headings, in order.
    pub(crate) headings: Vec<Heading>,
    /// Targets of links and images, as written.
    pub(crate) links: Vec<String>,
    /// Number of images without alternative text.
    pub(crate) mute: usize,
    /// Text as HTML.
    pub(crate) body: String,
}

impl Page {
    /// Converts Markdown. `place` returns the address of a link in the site; without an address
    /// only the text of the link remains.
    pub(crate) fn from_markdown(markdown: &str, place: impl Fn(&str) -> Option<String>) -> Self {
        let options = Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES;
        let mut events: Vec<Event<'_>> = Parser::new_ext(markdown, options).collect();
        let headings = anchored(&mut events);
        let links = events.iter().filter_map(target).map(str::to_owned);
        let links = links.collect();
        let mute = mute(&events);
        let events = placed(events, place);
        let mut body = String::new();
        html::push_html(&mut body, events.into_iter().flat_map(reachable));
        // An empty cell cannot be a header.
        let body = body.replace("<th></th>", "<td></td>");
        let title = headings.first().map_or(String::new(), |h| h.text.clone());
        Self {
            title,
            headings,
            links,
            mute,
            body,
        }
    }

    /// Returns true if the page has this anchor.
    pub(crate) fn has(&self, anchor: &str) -> bool {
        self.headings.iter().any(|h| h.anchor == anchor)
    }
}

/// Assigns anchors to the headings and returns the headings.
fn anchored(events: &mut [Event<'_>]) -> Vec<Heading> {
    let mut found = Vec::new();
    let mut seen: HashMap<String, usize> = HashMap::new();
    for at in 0..events.len() {
        let Event::Start(Tag::Heading { level, .. }) = &events[at] else {
            continue;
        };
        let level = *level;
        let inner = events[at + 1..].iter();
        let text: String = inner
            .take_while(|e| !matches!(e, Event::End(TagEnd::Heading(_))))
            .filter_map(|e| match e {
                Event::Text(text) | Event::Code(text) => Some(text.as_ref()),
                _ => None,
            })
            .collect();
        let plain = anchor(&text);
        let count = seen.entry(plain.clone()).or_default();
        let anchor = match *count {
            0 => plain,
            n => format!("{plain}-{n}"),
        };
        *count += 1;
        if let Event::Start(Tag::Heading { id, .. }) = &mut events[at] {
            *id = Some(CowStr::from(anchor.clone()));
        }
        found.push(Heading {
            anchor,
            text,
            is_section: level == HeadingLevel::H2,
        });
    }
    found
}

/// Returns the anchor of a heading by GitHub's rule: letters, digits, and hyphens for spaces.
fn anchor(text: &str) -> String {
    let kept = text.chars().filter_map(|c| match c {
        ' ' => Some('-'),
        '-' | '_' => Some(c),
        c if c.is_alphanumeric() => Some(c),
        _ => None,
    });
    kept.collect::<String>().to_lowercase()
}

/// Returns the target of a link or an image.
fn target<'a>(event: &'a Event<'_>) -> Option<&'a str> {
    match event {
        Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => Some(dest_url),
        _ => None,
    }
}

/// Counts images without alternative text.
fn mute(events: &[Event<'_>]) -> usize {
    let pairs = events.iter().zip(events.iter().skip(1));
    pairs
        .filter(|(event, next)| {
            matches!(event, Event::Start(Tag::Image { .. }))
                && matches!(next, Event::End(TagEnd::Image))
        })
        .count()
}

/// Replaces the targets of links by their addresses in the site; links without an address become
/// text.
fn placed<'a>(events: Vec<Event<'a>>, place: impl Fn(&str) -> Option<String>) -> Vec<Event<'a>> {
    let mut is_open = Vec::new();
    let mut out = Vec::with_capacity(events.len());
    for mut event in events {
        match &mut event {
            Event::Start(Tag::Link { dest_url, .. }) => {
                let address = place(dest_url);
                is_open.push(address.is_some());
                let Some(address) = address else { continue };
                *dest_url = address.into();
            }
            Event::End(TagEnd::Link) if is_open.pop() == Some(false) => continue,
            Event::Start(Tag::Image { dest_url, .. }) => {
                *dest_url = place(dest_url).unwrap_or_default().into();
            }
            _ => {}
        }
        out.push(event);
    }
    out
}

/// Wraps elements that may be wider than a small screen so that they can be scrolled by keyboard.
fn reachable(event: Event<'_>) -> Vec<Event<'_>> {
    let html = |text: &'static str| Event::Html(CowStr::Borrowed(text));
    match event {
        Event::Start(Tag::CodeBlock(_)) => vec![html("<pre tabindex=\"0\"><code>")],
        Event::End(TagEnd::CodeBlock) => vec![html("</code></pre>\n")],
        Event::Start(Tag::Table(_)) => vec![
            html("<div class=\"wide\" tabindex=\"0\" role=\"group\" aria-label=\"Table\">"),
            event,
        ],
        Event::End(TagEnd::Table) => vec![event, html("</div>\n")],
        event => vec![event],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_those_of_github() {
        let page =
            Page::from_markdown("# Looking at it: `isoform view`\n## A, b\n## A b\n", |_| {
                None
            });
        let anchors: Vec<&str> = page.headings.iter().map(|h| h.anchor.as_str()).collect();
        assert_eq!(anchors, ["looking-at-it-isoform-view", "a-b", "a-b-1"]);
        assert_eq!(page.title, "Looking at it: isoform view");
        assert!(page.has("a-b-1") && !page.has("a-b-2"));
    }

    #[test]
    fn links_lead_into_the_site_or_are_text() {
        let markdown = "[here](a.md#b) and [there](gone/) ![](x.png) ![all](y.png)";
        let page = Page::from_markdown(markdown, |to| {
            to.strip_suffix(".md#b").map(|s| s.to_owned() + ".html")
        });
        assert_eq!(page.links, ["a.md#b", "gone/", "x.png", "y.png"]);
        assert_eq!(page.mute, 1);
        assert!(
            page.body.contains("<a href=\"a.html\">here</a> and there"),
            "{}",
            page.body
        );
    }

    #[test]
    fn code_is_text_and_can_be_scrolled_to() {
        let page = Page::from_markdown("```\na <b> & c\n```\n", |_| None);
        let want = "<pre tabindex=\"0\"><code>a &lt;b&gt; &amp; c\n</code></pre>\n";
        assert_eq!(page.body, want);
    }
}
