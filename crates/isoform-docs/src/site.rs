//! All pages with their navigation, and the check of their links.

use crate::notebook;
use crate::page::Page;
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// Pages in the order of reading, in groups: path in the repository, and label in the navigation.
const PAGES: [(&str, &[(&str, &str)]); 8] = [
    (
        "Begin",
        &[
            ("README.md", "Isoform"),
            ("docs/README.md", "All pages"),
            ("docs/tour.md", "A tour"),
        ],
    ),
    (
        "From points",
        &[
            ("docs/fitting.md", "Fitting a template"),
            ("docs/templates.md", "Templates"),
            ("docs/recognize.md", "Recognising faces"),
            ("docs/implicitize.md", "A function through points"),
        ],
    ),
    (
        "From functions and maps",
        &[
            ("docs/hyperfun.md", "HyperFun"),
            ("docs/functions.md", "Functions of HyperFun"),
            ("docs/meshing.md", "Meshing"),
            ("docs/formulas.md", "Formulas"),
            ("docs/fe.md", "Stresses"),
            ("docs/brep.md", "Solids for CAD"),
            ("docs/parameterize.md", "Rational patches"),
            ("docs/rational.md", "Rational surfaces"),
            (
                "docs/rational-certificate.md",
                "Rational surfaces: certificate",
            ),
        ],
    ),
    (
        "Looking at it",
        &[
            ("docs/studio.md", "The studio, a window"),
            ("docs/view.md", "Pages in a browser"),
            ("docs/render.md", "Pictures"),
            ("docs/gallery.md", "Gallery"),
            ("docs/figures.md", "Figures of the papers"),
        ],
    ),
    (
        "As a library",
        &[
            ("docs/options.md", "All options"),
            ("docs/python.md", "The Python package"),
            ("docs/clusters.md", "On a cluster"),
        ],
    ),
    (
        "Notebooks",
        &[
            (
                "examples/notebooks/scan_to_stress.ipynb",
                "From a scan to stress",
            ),
            ("examples/notebooks/paper_table.ipynb", "A paper's table"),
            (
                "examples/notebooks/rational_surface.ipynb",
                "A rational surface, whole",
            ),
            ("examples/notebooks/patches.ipynb", "Patches with bounds"),
            ("examples/notebooks/fleet.ipynb", "A fleet of scans"),
        ],
    ),
    (
        "How good it is, and why",
        &[
            ("docs/meshing-speed.md", "Speed of meshing"),
            ("docs/parameterize-measured.md", "Patches, measured"),
            ("docs/paper-tables.md", "Tables of the papers"),
            ("docs/background.md", "Background"),
            ("docs/architecture.md", "Architecture"),
            ("docs/decisions.md", "Decisions"),
            ("CONTRIBUTING.md", "Contributing"),
            ("SECURITY.md", "Security"),
            ("docs/releasing.md", "Releases"),
            ("CHANGELOG.md", "Changes"),
        ],
    ),
    (
        "Examples",
        &[
            ("examples/scans/README.md", "Scans"),
            ("examples/surfaces/README.md", "Surfaces"),
        ],
    ),
];

/// Extension of notebooks.
const NOTEBOOK_EXTENSION: &str = ".ipynb";

/// Style sheet of all pages.
const STYLE: &str = include_str!("../assets/site.css");

/// Documentation site.
pub(crate) struct Site {
    root: PathBuf,
    /// Pages by their path in the repository.
    pub(crate) pages: BTreeMap<String, Page>,
}

impl Site {
    /// Reads all pages of the repository.
    pub(crate) fn read(root: &Path) -> Result<Self, Box<dyn Error>> {
        let mut pages = BTreeMap::new();
        for (file, _) in listed() {
            let mut text =
                fs::read_to_string(root.join(file)).map_err(|e| format!("{file}: {e}"))?;
            if file.ends_with(NOTEBOOK_EXTENSION) {
                text = notebook::markdown(&text).map_err(|e| format!("{file}: {e}"))?;
            }
            let page = Page::from_markdown(&text, |link| address(root, file, link));
            pages.insert(file.to_owned(), page);
        }
        Ok(Self {
            root: root.to_owned(),
            pages,
        })
    }

    /// Returns the number of links within the site.
    pub(crate) fn links(&self) -> usize {
        let links = self.pages.values().flat_map(|page| &page.links);
        links.filter(|link| !is_outside(link)).count()
    }

    /// Writes the pages and the files that they link to.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), Box<dyn Error>> {
        fs::create_dir_all(folder)?;
        fs::write(folder.join("site.css"), STYLE)?;
        for (file, page) in &self.pages {
            fs::write(folder.join(name(file)), self.document(file, page))?;
            for link in page.links.iter().filter(|link| !is_outside(link)) {
                let (target, _) = resolved(file, link);
                let source = self.root.join(&target);
                if !self.pages.contains_key(&target) && source.is_file() {
                    let copy = folder.join("files").join(&target);
                    fs::create_dir_all(copy.parent().unwrap_or(folder))?;
                    fs::copy(source, copy)?;
                }
            }
        }
        Ok(())
    }

    /// Returns the defects: pages that are not in the navigation, broken links, images without
    /// alternative text.
    pub(crate) fn wrong(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        let mut files = self.files("docs", ".md");
        files.extend(self.files("examples/notebooks", NOTEBOOK_EXTENSION));
        let unlisted = files.iter().filter(|file| !self.pages.contains_key(*file));
        wrong.extend(unlisted.map(|file| format!("{file}: not in the navigation (site.rs)")));
        for (file, page) in &self.pages {
            let bad = page
                .links
                .iter()
                .filter_map(|link| self.why_bad(file, link));
            wrong.extend(bad.map(|why| format!("{file}: {why}")));
            if page.mute > 0 {
                wrong.push(format!("{file}: {} images without a text", page.mute));
            }
        }
        wrong
    }

    /// Returns the files of a folder with an ending, sorted by name.
    fn files(&self, folder: &str, ending: &str) -> Vec<String> {
        let entries = fs::read_dir(self.root.join(folder)).into_iter().flatten();
        let mut files: Vec<String> = entries
            .flatten()
            .map(|entry| format!("{folder}/{}", entry.file_name().to_string_lossy()))
            .filter(|file| file.ends_with(ending))
            .collect();
        files.sort();
        files
    }

    /// Returns the reason why a link is broken; `None` if it is valid.
    fn why_bad(&self, file: &str, link: &str) -> Option<String> {
        if is_outside(link) {
            let is_known = ["https://", "http://", PICTURE_PREFIX]
                .iter()
                .any(|k| link.starts_with(k));
            return (!is_known).then(|| format!("{link}: what kind of address is that?"));
        }
        let (target, anchor) = resolved(file, link);
        let Some(page) = self.pages.get(&target) else {
            let is_there = self.root.join(&target).exists() && anchor.is_none();
            return (!is_there).then(|| format!("{link}: there is no such file"));
        };
        let anchor = anchor.filter(|anchor| !page.has(anchor))?;
        Some(format!("{link}: there is no heading #{anchor}"))
    }

    /// Returns the complete HTML document of a page.
    fn document(&self, file: &str, page: &Page) -> String {
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{}</title>\n<link rel=\"stylesheet\" href=\"site.css\">\n</head>\n<body>\n\
             <a class=\"skip\" href=\"#text\">To the text</a>\n\
             <header><a href=\"index.html\">Isoform</a>\
             <a class=\"to-pages\" href=\"#pages\">Pages</a></header>\n\
             <main id=\"text\" tabindex=\"-1\">\n{}</main>\n{}</body>\n</html>\n",
            title(page),
            page.body,
            self.navigation(file),
        )
    }

    /// Returns the list of pages, with the sections of the present page.
    fn navigation(&self, present: &str) -> String {
        let mut html = String::from("<nav id=\"pages\" aria-label=\"Pages\">\n");
        for (group, files) in PAGES {
            let _ = write!(html, "<h2>{group}</h2>\n<ul>\n");
            for (file, label) in files {
                let is_present = *file == present;
                let mark = if is_present {
                    " aria-current=\"page\""
                } else {
                    ""
                };
                let _ = write!(html, "<li><a href=\"{}\"{mark}>{label}</a>", name(file));
                if is_present {
                    html += &self.sections(file);
                }
                html += "</li>\n";
            }
            html += "</ul>\n";
        }
        html + "</nav>\n"
    }

    /// Returns the list of a page's sections.
    fn sections(&self, file: &str) -> String {
        let sections = self.pages[file].headings.iter().filter(|h| h.is_section);
        let rows: String = sections
            .map(|h| {
                format!(
                    "<li><a href=\"#{}\">{}</a></li>\n",
                    h.anchor,
                    escaped(&h.text)
                )
            })
            .collect();
        if rows.is_empty() {
            rows
        } else {
            format!("\n<ul>\n{rows}</ul>\n")
        }
    }
}

/// Returns the title of a page's document.
fn title(page: &Page) -> String {
    if page.title == "Isoform" {
        "Isoform".to_owned()
    } else {
        format!("{} – Isoform", escaped(&page.title))
    }
}

/// Returns the pages with their labels.
fn listed() -> impl Iterator<Item = (&'static str, &'static str)> {
    PAGES.iter().flat_map(|(_, files)| files.iter().copied())
}

/// Returns the file name of a page in the site.
fn name(file: &str) -> String {
    match file {
        "README.md" => "index.html".to_owned(),
        "docs/README.md" => "pages.html".to_owned(),
        file => {
            let plain = file.trim_start_matches("docs/").trim_end_matches(".md");
            let plain = plain.trim_end_matches(NOTEBOOK_EXTENSION);
            let plain = plain.trim_end_matches("/README").replace('/', "-");
            plain.to_lowercase() + ".html"
        }
    }
}

/// Prefix of the addresses of embedded pictures, such as those of notebooks.
const PICTURE_PREFIX: &str = "data:image/png;base64,";

/// Returns true if a link leads out of the repository.
fn is_outside(link: &str) -> bool {
    link.contains("://") || link.starts_with("mailto:") || link.starts_with(PICTURE_PREFIX)
}

/// Resolves a link of a page to a path in the repository and an anchor.
pub(crate) fn resolved<'a>(file: &str, link: &'a str) -> (String, Option<&'a str>) {
    let (path, anchor) = match link.split_once('#') {
        Some((path, anchor)) => (path, Some(anchor)),
        None => (link, None),
    };
    if path.is_empty() {
        return (file.to_owned(), anchor);
    }
    let beside = Path::new(file).parent().unwrap_or(Path::new(""));
    let mut parts: Vec<String> = Vec::new();
    for part in beside.join(path).components() {
        match part {
            Component::Normal(name) => parts.push(name.to_string_lossy().into_owned()),
            Component::ParentDir => {
                parts.pop();
            }
            _ => {}
        }
    }
    (parts.join("/"), anchor)
}

/// Returns the address of a link's target in the site; `None` for folders.
fn address(root: &Path, file: &str, link: &str) -> Option<String> {
    if is_outside(link) {
        return Some(link.to_owned());
    }
    let (target, anchor) = resolved(file, link);
    let pages: BTreeSet<&str> = listed().map(|(file, _)| file).collect();
    let page = if pages.contains(target.as_str()) {
        name(&target)
    } else if root.join(&target).is_file() {
        format!("files/{target}")
    } else {
        return None;
    };
    Some(match anchor {
        Some(anchor) => format!("{page}#{anchor}"),
        None => page,
    })
}

/// Escapes text for HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
    }

    #[test]
    fn names_of_pages() {
        assert_eq!(name("README.md"), "index.html");
        assert_eq!(name("docs/meshing-speed.md"), "meshing-speed.html");
        assert_eq!(name("examples/scans/README.md"), "examples-scans.html");
        assert_eq!(name("CHANGELOG.md"), "changelog.html");
        assert_eq!(
            name("examples/notebooks/fleet.ipynb"),
            "examples-notebooks-fleet.html"
        );
        let names: BTreeSet<String> = listed().map(|(file, _)| name(file)).collect();
        assert_eq!(names.len(), listed().count(), "each of its own");
    }

    #[test]
    fn links_of_the_repository_and_of_the_site() {
        let at = |link| address(&root(), "docs/view.md", link);
        assert_eq!(at("brep.md#limits").as_deref(), Some("brep.html#limits"));
        assert_eq!(at("#layers").as_deref(), Some("view.html#layers"));
        assert_eq!(at("../README.md").as_deref(), Some("index.html"));
        assert_eq!(at("../test.sh").as_deref(), Some("files/test.sh"));
        assert_eq!(at("../examples/fe"), None, "folders are no pages");
    }

    #[test]
    fn what_is_wrong_is_told() {
        let mut site = Site::read(&root()).expect("pages");
        assert_eq!(site.wrong(), Vec::<String>::new());
        let markdown = "# A\n[a](#b) [c](gone.md) [d](view.md#gone) [e](ftp://x) ![](x.png)";
        let page = Page::from_markdown(markdown, |_| None);
        site.pages.insert("docs/view.md".to_owned(), page);
        let wrong = site.wrong().join("\n");
        for word in [
            "#b",
            "gone.md",
            "#gone",
            "ftp://x",
            "x.png",
            "1 images without",
        ] {
            assert!(wrong.contains(word), "{word} in {wrong}");
        }
        site.pages.remove("docs/tour.md");
        assert!(
            site.wrong()
                .join("\n")
                .contains("docs/tour.md: not in the navigation")
        );
    }
}
