//! The page: one document that fetches nothing and runs nothing but the viewer.

use crate::blob::Blobs;
use crate::{ShownPatch, ShownPoints, map, mesh, model, patches, points};
use isoform::LiveModel;
use isoform::geom::Mesh;
use isoform::tess::{Analysis, Map, Surface};
use serde_json::{Value, json};

/// The viewer, built from the folder web of the repository.
const SCRIPT: &str = include_str!("../assets/viewer.js");
/// Its style.
const STYLE: &str = include_str!("../assets/viewer.css");
/// The SHA-256 of both as a Content-Security-Policy names them, a line each.
const HASHES: &str = include_str!("../assets/hashes.txt");

/// A page under construction: layers, in the order in which they are shown.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    layers: Vec<Value>,
    blobs: Blobs,
}

impl Page {
    /// A page without layers.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            layers: Vec::new(),
            blobs: Blobs::default(),
        }
    }

    /// Adds points.
    pub fn points(&mut self, name: &str, points: &ShownPoints<'_>) {
        let layer = points::layer(name, points, &mut self.blobs);
        self.layers.push(layer);
    }

    /// Adds a mesh.
    pub fn mesh(&mut self, name: &str, mesh: &Mesh) {
        let layer = mesh::layer(name, mesh, &mut self.blobs);
        self.layers.push(layer);
    }

    /// Whether a page can draw a model by itself: its function is not too long for a shader, and
    /// has no iterations that shaders lack.
    pub fn can_draw(model: &LiveModel) -> bool {
        model::can_be_drawn(model)
    }

    /// Adds a model whose parameters can be moved.
    pub fn model(&mut self, name: &str, title: Option<&str>, model: &LiveModel) {
        self.layers.push(model::layer(name, title, model));
    }

    /// Adds a mesh in the place of a model that the page cannot compute by itself.
    pub fn meshed_model(&mut self, name: &str, mesh: &Mesh) {
        let mut layer = mesh::layer(name, mesh, &mut self.blobs);
        layer["kind"] = json!("model");
        self.layers.push(layer);
    }

    /// Adds rational patches.
    pub fn patches(&mut self, name: &str, patches: &[ShownPatch]) {
        let layer = patches::layer(name, patches, &mut self.blobs);
        self.layers.push(layer);
    }

    /// Adds a rational surface in the box of this half width about the origin.
    pub fn map(
        &mut self,
        name: &str,
        map: &Map,
        surface: &Surface,
        analysis: &Analysis,
        half_width: f64,
    ) {
        let layer = map::layer(name, map, surface, analysis, half_width, &mut self.blobs);
        self.layers.push(layer);
    }

    /// Whether there is nothing to be shown.
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// The whole page.
    pub fn html(&self) -> String {
        let title = escaped(&self.title);
        let policy = policy();
        let (scene, blobs) = (self.scene(), self.blobs.elements());
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
             <main data-isoform-view=\"page\"></main>\n\
             <noscript><p>This page shows shapes by a script of its own, \
             which the browser does not run.</p></noscript>\n\
             {scene}{blobs}<script>{SCRIPT}</script>\n</body>\n</html>\n"
        )
    }

    /// The viewer as a part of another page: an element for the viewer, its data, its style and its
    /// script. The other page's policy must allow the [`hashes`].
    pub fn embedded(&self) -> String {
        let (scene, blobs) = (self.scene(), self.blobs.elements());
        format!(
            "<style>{STYLE}</style>\n<div data-isoform-view=\"embedded\"></div>\n\
             {scene}{blobs}<script>{SCRIPT}</script>\n"
        )
    }

    /// The document of the scene, in an element that is not run. `<` is written as an escape: no
    /// name of a file can end the element, or begin a comment in it.
    fn scene(&self) -> String {
        let document = json!({"version": 1, "title": self.title, "layers": self.layers});
        let text = document.to_string().replace('<', "\\u003c");
        format!("<script type=\"application/json\" data-isoform-scene>{text}</script>\n")
    }
}

/// The hashes of the viewer's script and style, as a Content-Security-Policy names them.
///
/// ```
/// let [script, style] = isoform_view::hashes();
/// assert!(script.starts_with("'sha256-") && style.ends_with("='"));
/// ```
pub fn hashes() -> [&'static str; 2] {
    let mut lines = HASHES.lines();
    [(); 2].map(|()| lines.next().unwrap_or("'none'"))
}

/// What the page may do: run its one script, use its one style, show pictures that it made itself.
fn policy() -> String {
    let [script, style] = hashes();
    format!(
        "default-src 'none'; script-src {script}; style-src {style}; img-src data: blob:; \
         base-uri 'none'; form-action 'none'"
    )
}

/// A text within HTML.
fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\'' => html += "&#39;",
            letter => html.push(letter),
        }
    }
    html
}
