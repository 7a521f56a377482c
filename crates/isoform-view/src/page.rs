//! Page: one document that fetches nothing and runs nothing but the viewer.

use crate::blob::Blobs;
use crate::{ShownPatch, ShownPoints, map, mesh, model, patches, points, solid};
use isoform::cad::PreparedShape;
use isoform::geom::Mesh;
use isoform::tess::{Analysis, Map, Surface};
use isoform::{ExactSolid, LiveModel};
use serde_json::{Value, json};

/// Script of the viewer, built from the folder web of the repository.
const SCRIPT: &str = include_str!("../assets/viewer.js");
/// Style sheet of the viewer.
const STYLE: &str = include_str!("../assets/viewer.css");
/// Script of a served page, which polls the server for news and reloads the page.
const SERVED_SCRIPT: &str = include_str!("../assets/served.js");
/// Style sheet of a served page.
const SERVED_STYLE: &str = include_str!("../assets/served.css");
/// Script of Isoform Studio, which holds the viewer.
const STUDIO_SCRIPT: &str = include_str!("../assets/studio.js");
/// Style sheet of Isoform Studio.
const STUDIO_STYLE: &str = include_str!("../assets/studio.css");
/// SHA-256 hashes of these six in the form of a Content-Security-Policy, one per line.
const HASHES: &str = include_str!("../assets/hashes.txt");

/// Page under construction: layers in the order in which they are shown.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    layers: Vec<Value>,
    blobs: Blobs,
}

impl Page {
    /// Returns a page without layers.
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

    /// Returns true if a page can draw a model by itself: its function is short enough for a
    /// shader, and has no iterations that shaders lack.
    pub fn can_draw(model: &LiveModel) -> bool {
        model::can_be_drawn(model)
    }

    /// Adds a model with adjustable parameters.
    pub fn model(&mut self, name: &str, title: Option<&str>, model: &LiveModel) {
        self.layers.push(model::layer(name, title, model));
    }

    /// Adds a solid with exact faces: triangles for drawing and faces for picking.
    pub fn solid(&mut self, name: &str, solid: &ExactSolid) {
        let layer = solid::layer(name, solid, &mut self.blobs);
        self.layers.push(layer);
    }

    /// Adds the shape of a CAD file.
    pub fn shape(&mut self, name: &str, shape: &PreparedShape) {
        let layer = solid::shape_layer(name, shape, &mut self.blobs);
        self.layers.push(layer);
    }

    /// Adds a mesh in place of a model that the page cannot compute by itself.
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

    /// Adds a rational surface in the cube of the given half width around the origin.
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

    /// Returns true if the page has no layers.
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// Returns the complete page.
    pub fn html(&self) -> String {
        self.document("", "", &policy(&hashes(), ""))
    }

    /// Returns the complete page as served by a server. It polls the server for the relative
    /// address `news`, and reloads when the version there differs from `version`.
    pub fn served(&self, version: u64) -> String {
        let head = format!(
            "<meta name=\"isoform-version\" content=\"{version}\">\n<style>{SERVED_STYLE}</style>\n"
        );
        let foot = format!("<script>{SERVED_SCRIPT}</script>\n");
        self.document(&head, &foot, &served_policy())
    }

    /// Returns the page with additions at the end of its head and its body.
    fn document(&self, head: &str, foot: &str, policy: &str) -> String {
        let title = escaped(&self.title);
        let (scene, blobs) = (self.scene(), self.blobs.elements());
        let head = format!("<style>{STYLE}</style>\n{head}");
        let body = format!(
            "<main data-isoform-view=\"page\"></main>\n{scene}{blobs}<script>{SCRIPT}</script>\n{foot}"
        );
        whole(&title, policy, &head, &body)
    }

    /// Returns the document of the scene with its arrays in bytes, for a page that is open: the
    /// length of the document as a little-endian 32-bit integer, the document with the lengths of
    /// the arrays as its key `arrays`, and the arrays.
    pub fn packed(&self) -> Vec<u8> {
        self.blobs.packed(self.scene_document())
    }

    /// Returns the viewer as a part of another page: an element for the viewer, its data, its style
    /// and its script. The other page's policy must allow the [`hashes`].
    pub fn embedded(&self) -> String {
        let (scene, blobs) = (self.scene(), self.blobs.elements());
        format!(
            "<style>{STYLE}</style>\n<div data-isoform-view=\"embedded\"></div>\n\
             {scene}{blobs}<script>{SCRIPT}</script>\n"
        )
    }

    /// Returns the document of the scene.
    fn scene_document(&self) -> Value {
        json!({"version": 1, "title": self.title, "layers": self.layers})
    }

    /// Returns the document of the scene, in an element that is not executed. `<` is escaped, so
    /// that no name of a file can end the element or begin a comment in it.
    fn scene(&self) -> String {
        let text = self.scene_document().to_string().replace('<', "\\u003c");
        format!("<script type=\"application/json\" data-isoform-scene>{text}</script>\n")
    }
}

/// Returns the hashes of the viewer's script and style in the form of a Content-Security-Policy.
///
/// ```
/// let [script, style] = isoform_view::hashes();
/// assert!(script.starts_with("'sha256-") && style.ends_with("='"));
/// ```
pub fn hashes() -> [&'static str; 2] {
    let [script, style, ..] = all_hashes();
    [script, style]
}

/// Returns the hashes of the scripts and styles of the viewer, of what served pages have in
/// addition, and of Isoform Studio.
fn all_hashes() -> [&'static str; 6] {
    let mut lines = HASHES.lines();
    [(); 6].map(|()| lines.next().unwrap_or("'none'"))
}

/// Returns the page of Isoform Studio, which gets all that it shows from its server.
pub fn studio() -> String {
    let head = format!("<style>{STUDIO_STYLE}</style>\n");
    let body = format!("<div data-isoform-studio></div>\n<script>{STUDIO_SCRIPT}</script>\n");
    whole("Isoform Studio", &studio_policy(), &head, &body)
}

/// Returns the policy of the page of Isoform Studio, which a server sends in a header, too.
pub fn studio_policy() -> String {
    let [.., script, style] = all_hashes();
    policy(&[script, style], " connect-src 'self';")
}

/// Returns a page with a title, which is escaped, a policy, and elements of its head and its body.
fn whole(title: &str, policy: &str, head: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{title}</title>\n{head}</head>\n<body>\n\
         <noscript><p>This page shows shapes by a script of its own, \
         which the browser does not run.</p></noscript>\n\
         {body}</body>\n</html>\n"
    )
}

/// Returns the policy of a served page: that of any page, and permission to poll its own server. A
/// server sends this policy in a header, too.
pub fn served_policy() -> String {
    let [script, style, served_script, served_style, ..] = all_hashes();
    let scripts = format!("{script} {served_script}");
    let styles = format!("{style} {served_style}");
    policy(&[&scripts, &styles], " connect-src 'self';")
}

/// Returns a policy that permits a page to run its script, use its style, show pictures that it
/// made itself, and `more`.
fn policy([script, style]: &[&str; 2], more: &str) -> String {
    format!(
        "default-src 'none'; script-src {script}; style-src {style}; img-src data: blob:;{more} \
         base-uri 'none'; form-action 'none'"
    )
}

/// Escapes text for HTML.
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
