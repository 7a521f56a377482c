//! Drawings as SVG (W3C, Scalable Vector Graphics 1.1): areas of one colour, outlines and edges.
//!
//! Widths and colours are in a style sheet, by classes: `outline`, `edge`, `hidden`, `cap`, and one
//! for each colour. Coordinates are in pixels with two digits.

use crate::camera::Sight;
use crate::color::{Color, Scale};
use crate::hidden;
use crate::layer::{Body, Key, Layer, Scene};
use crate::legend::{MAX_LISTED_PARTS, figures, ticks};
use crate::marks::Marks;
use crate::model::Scratch;
use crate::network::{LineKind, Network, network};
use crate::picture::Style;
use crate::shade;
use crate::sheet::Pane;
use crate::trace::{AreaClass, CAP_PART, Tracer};
use crate::visibility::{runs, visible};
use isoform::{Control, Stopped};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Share of white mixed into the colours of areas, so that lines and letters stand out.
const COLOR_TINT: f64 = 0.25;
/// Size of the font, in pixels.
const FONT_SIZE: f64 = 12.0;
/// Height of a line of text, in pixels.
const TEXT_LINE_HEIGHT: f64 = 17.0;
/// Width and height of the bar of a scale, in pixels.
const SCALE_BAR: [f64; 2] = [16.0, 150.0];
/// Width of the margin at the border of a drawing, in pixels.
const DRAWING_MARGIN: f64 = 14.0;

/// Options of drawings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Options shared with pictures.
    pub style: Style,
    /// True if hidden edges are drawn, dashed.
    pub hidden: bool,
    /// True if scales and lists of parts are drawn.
    pub legend: bool,
    /// True if room was left for them at the right side.
    pub has_room: bool,
    /// Title of the drawing.
    pub title: String,
}

/// Draws a scene in several views.
///
/// # Errors
/// [`Stopped`].
pub fn draw_svg(
    scene: &Scene,
    panes: &[Pane],
    size: [u32; 2],
    drawing: &Drawing,
    control: &Control<'_>,
) -> Result<String, Stopped> {
    let [width, height] = size;
    let mut sheet = DrawingSheet {
        scene,
        drawing,
        body: String::new(),
        classes: BTreeMap::new(),
    };
    let mut taken = [[0; 4]; 4];
    for pane in panes {
        let found = sheet.pane(pane, control)?;
        for (sum, row) in taken.iter_mut().flatten().zip(found.iter().flatten()) {
            *sum += row;
        }
    }
    if drawing.legend {
        sheet.legend(size, taken);
    }
    let title = escaped(&drawing.title);
    let names = scene
        .layers
        .iter()
        .map(|l| format!("{} ({})", l.name, l.kind));
    let about = escaped(&names.collect::<Vec<_>>().join(", "));
    let (style, body) = (sheet.style_sheet(), sheet.body);
    let background = hex(drawing.style.background);
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" role=\"img\" aria-labelledby=\"title about\">\n\
         <title id=\"title\">{title}</title>\n<desc id=\"about\">{about}</desc>\n\
         <style>\n{style}</style>\n\
         <defs><pattern id=\"hatch\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" \
         patternTransform=\"rotate(45)\"><rect class=\"cap-ground\" width=\"7\" height=\"7\"/>\
         <line class=\"cap-line\" x1=\"0.5\" x2=\"0.5\" y2=\"7\"/></pattern></defs>\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"{background}\"/>\n\
         {body}</svg>\n"
    ))
}

/// Drawing under construction.
struct DrawingSheet<'a> {
    scene: &'a Scene,
    drawing: &'a Drawing,
    body: String,
    /// Names of the classes of colours.
    classes: BTreeMap<Color, String>,
}

impl DrawingSheet<'_> {
    /// Returns the name of the class of a colour.
    fn class(&mut self, color: Color) -> String {
        let number = self.classes.len() + 1;
        let name = self.classes.entry(color);
        name.or_insert_with(|| format!("c{number}")).clone()
    }

    fn style_sheet(&self) -> String {
        let (line, light) = (hex(shade::LINE), hex(tinted(shade::CAP, 0.55)));
        let (cap, ground) = (hex(shade::CAP), hex(self.drawing.style.background));
        let mut style = format!(
            ".outline,.edge,.hidden,.curve{{fill:none;stroke:{line};stroke-width:1.5;\
             stroke-linecap:round;stroke-linejoin:round}}\n\
             .edge{{stroke-width:0.9}}\n.hidden{{stroke-width:0.8;stroke-dasharray:5 3.5}}\n\
             .area{{fill-rule:evenodd;stroke-width:0.5;stroke-linejoin:round}}\n\
             .cap{{fill:url(#hatch);fill-rule:evenodd;stroke:none}}\n\
             .cap-ground{{fill:{light}}}\n.cap-line{{stroke:{cap};stroke-width:1.4}}\n\
             .points{{fill:none;stroke-linecap:round}}\n\
             .ground{{fill:{ground};fill-opacity:0.85}}\n\
             text{{font:{FONT_SIZE}px sans-serif;fill:{line}}}\n"
        );
        for (color, name) in &self.classes {
            let color = hex(*color);
            let _ = writeln!(style, ".{name}{{fill:{color};stroke:{color}}}");
        }
        style.push_str(".curve,.points{fill:none}\n");
        style
    }

    /// Draws one view; returns the occupied cells by quarters of its height and width.
    fn pane(&mut self, pane: &Pane, control: &Control<'_>) -> Result<[[usize; 4]; 4], Stopped> {
        let sight = Sight::new(pane.camera, pane.size);
        let marks = Marks::default();
        let tracer = Tracer {
            scene: self.scene,
            sight: &sight,
            marks: &marks,
            background: self.drawing.style.background,
            has_caps: self.drawing.style.caps,
            is_hatched: false,
        };
        let net = network(&tracer, pane.size, control)?;
        let ([x, y], [width, height]) = (pane.at, pane.size);
        let _ = writeln!(
            self.body,
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" overflow=\"hidden\">"
        );
        self.areas(&net);
        if self.drawing.style.lines {
            self.lines(&net);
        }
        if self.drawing.hidden {
            for line in hidden::edges(&tracer, control)? {
                let _ = writeln!(self.body, "<path class=\"hidden\" d=\"{}\"/>", path(&line));
            }
        }
        self.curves(&tracer);
        self.points(&tracer);
        if !pane.name.is_empty() {
            let name = escaped(&pane.name);
            let base = DRAWING_MARGIN + FONT_SIZE;
            let _ = writeln!(
                self.body,
                "<text x=\"{DRAWING_MARGIN}\" y=\"{base}\">{name}</text>"
            );
        }
        self.body.push_str("</svg>\n");
        Ok(net.taken)
    }

    /// Returns the colour of an area.
    fn fill(&self, class: AreaClass) -> Color {
        let layer = &self.scene.layers[class.layer as usize];
        // Bands of brightness show shape by their differences, which white would take.
        let tint = |color, has_own: bool| {
            let is_full = has_own || class.band > 0;
            let share = if is_full { COLOR_TINT } else { 0.62 };
            tinted(shade::banded(color, class.band), share)
        };
        match &layer.body {
            Body::Model { colors, .. } => {
                let own = colors.as_ref().and_then(|c| c.get(class.part as usize));
                let usual = if class.tone > 0 {
                    shade::BACK
                } else {
                    shade::MODEL
                };
                tint(own.copied().unwrap_or(usual), own.is_some())
            }
            Body::Surface(surface) => {
                tint(surface.fill(class.part, class.tone), layer.key.is_some())
            }
            Body::Points { .. } => shade::POINT,
        }
    }

    fn areas(&mut self, net: &Network) {
        // Areas of one colour are one path: no seam appears between them.
        let mut by_color: BTreeMap<Color, String> = BTreeMap::new();
        let mut caps = String::new();
        for (class, rings) in &net.areas {
            let d: String = rings.iter().map(|r| path(r)).collect();
            if class.part == CAP_PART {
                caps += &d;
            } else {
                by_color.entry(self.fill(*class)).or_default().push_str(&d);
            }
        }
        for (color, d) in by_color {
            let name = self.class(color);
            let _ = writeln!(self.body, "<path class=\"area {name}\" d=\"{d}\"/>");
        }
        if !caps.is_empty() {
            let _ = writeln!(self.body, "<path class=\"cap\" d=\"{caps}\"/>");
        }
    }

    fn lines(&mut self, net: &Network) {
        for (kind, name) in [(LineKind::Edge, "edge"), (LineKind::Outline, "outline")] {
            for line in net.lines.iter().filter(|l| l.kind == kind) {
                let _ = writeln!(
                    self.body,
                    "<path class=\"{name}\" d=\"{}\"/>",
                    path(&line.points)
                );
            }
        }
    }

    /// Draws the visible parts of the double curves of maps.
    fn curves(&mut self, tracer: &Tracer<'_>) {
        for layer in self.scene.layers.iter().filter(|l| l.kind == "map") {
            let mut by_color: BTreeMap<Color, String> = BTreeMap::new();
            for curve in &layer.curves {
                for run in runs(tracer, &curve.points, true) {
                    by_color
                        .entry(curve.color)
                        .or_default()
                        .push_str(&path(&run));
                }
            }
            for (color, d) in by_color {
                let color = hex(color);
                let style = format!("stroke:{color}");
                let _ = writeln!(
                    self.body,
                    "<path class=\"curve\" style=\"{style}\" d=\"{d}\"/>"
                );
            }
        }
    }

    /// Draws the visible points as dots, one path for each colour.
    fn points(&mut self, tracer: &Tracer<'_>) {
        for layer in &self.scene.layers {
            let Body::Points {
                points,
                colors,
                lift,
            } = &layer.body
            else {
                continue;
            };
            let scale = match &layer.key {
                Some(Key::Scale(scale)) => Some(scale),
                _ => None,
            };
            let seen: Vec<Option<[f64; 2]>> = points
                .par_iter()
                .map_init(Scratch::default, |scratch, p| {
                    visible(tracer, *p, *lift, scratch)
                })
                .collect();
            let mut by_color: BTreeMap<Color, String> = BTreeMap::new();
            for (i, at) in seen.into_iter().enumerate() {
                let Some([x, y]) = at else { continue };
                let color = colors[i.min(colors.len() - 1)];
                let color = scale.map_or(color, |s| nearest_step(s, color));
                let _ = write!(by_color.entry(color).or_default(), "M{x:.1} {y:.1}h0");
            }
            let width = if points.len() > 30_000 { 2.0 } else { 3.2 };
            for (color, d) in by_color {
                let style = format!("stroke:{};stroke-width:{width}", hex(color));
                let _ = writeln!(
                    self.body,
                    "<path class=\"points\" style=\"{style}\" d=\"{d}\"/>"
                );
            }
        }
    }

    /// Draws scales and lists of parts, in the corner with the least drawing.
    fn legend(&mut self, size: [u32; 2], taken: [[usize; 4]; 4]) {
        let [width, height] = size.map(f64::from);
        let all: Vec<&Layer> = self
            .scene
            .layers
            .iter()
            .filter(|l| l.key.is_some())
            .collect();
        let mut rows = LegendRows::default();
        for layer in all {
            let (ground, layer_key) = (&layer.name, layer.key.as_ref());
            match layer_key {
                Some(Key::Parts(parts)) if parts.len() > 1 => {
                    rows.text(0.0, ground);
                    for (name, color) in parts.iter().take(MAX_LISTED_PARTS) {
                        let class = self.class(tinted(*color, COLOR_TINT));
                        rows.square(&class);
                        rows.text(18.0, name);
                    }
                    if parts.len() > MAX_LISTED_PARTS {
                        rows.text(0.0, &format!("and {} more", parts.len() - MAX_LISTED_PARTS));
                    }
                }
                Some(Key::Scale(scale)) => {
                    rows.text(0.0, ground);
                    rows.text(0.0, &scale.title);
                    self.bar(scale, &mut rows);
                    for line in figures(scale) {
                        rows.text(0.0, &line);
                    }
                }
                _ => {}
            }
        }
        if rows.svg.is_empty() {
            return;
        }
        let corners = [(0, 3), (3, 3), (0, 0), (3, 0)].into_iter();
        let corner = corners.min_by_key(|(y, x)| taken[*y][*x]);
        let usual = (0, 3);
        let (low, right) = corner.filter(|_| !self.drawing.has_room).unwrap_or(usual);
        let x = if right == 3 {
            width - rows.width - DRAWING_MARGIN
        } else {
            DRAWING_MARGIN
        };
        let y = if low == 3 {
            height - rows.y - DRAWING_MARGIN
        } else {
            DRAWING_MARGIN
        };
        let (x, y) = (x.max(0.0), y.max(0.0));
        let _ = writeln!(
            self.body,
            "<g transform=\"translate({x:.1} {y:.1})\">\n\
             <rect class=\"ground\" x=\"-5\" width=\"{:.1}\" height=\"{:.1}\"/>\n{}</g>",
            rows.width + 10.0,
            rows.y + 5.0,
            rows.svg
        );
    }

    /// Draws the bar of a scale: a rectangle for each of its steps, with labels at the ends and the
    /// middle.
    fn bar(&mut self, scale: &Scale, rows: &mut LegendRows) {
        let steps = 2 * SCALE_BAR[1] as usize / 3;
        let top = rows.y + 0.5 * TEXT_LINE_HEIGHT;
        let each = SCALE_BAR[1] / steps as f64;
        for k in 0..steps {
            let share = 1.0 - (k as f64 + 0.5) / steps as f64;
            let color = scale.color(scale.lower + share * (scale.upper - scale.lower));
            let fill = hex(color);
            let y = top + k as f64 * each;
            let _ = writeln!(
                rows.svg,
                "<rect y=\"{y:.2}\" width=\"{}\" height=\"{:.2}\" fill=\"{fill}\"/>",
                SCALE_BAR[0],
                each + 0.3
            );
        }
        for (share, name) in ticks(scale) {
            rows.y = top + (1.0 - share) * SCALE_BAR[1] - 0.6 * TEXT_LINE_HEIGHT;
            rows.text(SCALE_BAR[0] + 7.0, &name);
        }
        rows.y = top + SCALE_BAR[1] + 0.5 * TEXT_LINE_HEIGHT;
    }
}

/// Lines of a legend.
#[derive(Default)]
struct LegendRows {
    svg: String,
    width: f64,
    y: f64,
}

impl LegendRows {
    fn text(&mut self, x: f64, text: &str) {
        let text: String = text.chars().take(60).collect();
        self.y += TEXT_LINE_HEIGHT;
        let base = self.y - 4.0;
        // Letters of a sans-serif font are about 0.56 of its size wide.
        self.width = self
            .width
            .max(x + 0.56 * FONT_SIZE * text.chars().count() as f64);
        let _ = writeln!(
            self.svg,
            "<text x=\"{x}\" y=\"{base:.1}\">{}</text>",
            escaped(&text)
        );
    }

    fn square(&mut self, class: &str) {
        let y = self.y + 4.0;
        let _ = writeln!(
            self.svg,
            "<rect class=\"{class}\" y=\"{y:.1}\" width=\"11\" height=\"11\"/>"
        );
    }
}

/// Returns the colour of a scale's step that is nearest to a colour.
fn nearest_step(scale: &Scale, color: Color) -> Color {
    let away = |c: Color| -> i32 {
        (0..3)
            .map(|k| (i32::from(c[k]) - i32::from(color[k])).pow(2))
            .sum()
    };
    let steps = (0..=20)
        .map(|k| scale.step_color(k))
        .chain([shade::OUTLIER]);
    steps.min_by_key(|c| away(*c)).unwrap_or(color)
}

/// Returns the data of a path; closed if its ends coincide.
fn path(points: &[[f64; 2]]) -> String {
    let is_closed = points.len() > 3 && points.first() == points.last();
    let shown = if is_closed {
        &points[..points.len() - 1]
    } else {
        points
    };
    let mut d = String::new();
    for (k, [x, y]) in shown.iter().enumerate() {
        let _ = write!(
            d,
            "{}{} {}",
            if k == 0 { 'M' } else { 'L' },
            short(*x),
            short(*y)
        );
    }
    if is_closed {
        d.push('Z');
    }
    d
}

/// Formats a coordinate with at most two decimals.
fn short(v: f64) -> String {
    let text = format!("{v:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// Mixes a colour with white.
fn tinted(color: Color, white: f64) -> Color {
    color.map(|v| (f64::from(v) + white * (255.0 - f64::from(v))).round() as u8)
}

fn hex([r, g, b]: Color) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Escapes text for XML and removes characters that XML cannot represent.
fn escaped(text: &str) -> String {
    let mut xml = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => xml += "&amp;",
            '<' => xml += "&lt;",
            '>' => xml += "&gt;",
            '"' => xml += "&quot;",
            '\'' => xml += "&#39;",
            '\u{fffe}' | '\u{ffff}' => {}
            letter if letter.is_control() => xml.push(' '),
            letter => xml.push(letter),
        }
    }
    xml
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_out() {
        assert_eq!(
            escaped("<a>&\"'\u{0}\u{ffff}b"),
            "&lt;a&gt;&amp;&quot;&#39; b"
        );
    }

    #[test]
    fn paths_are_short() {
        let d = path(&[[0.0, -0.001], [10.5, 2.25], [3.0, 4.0], [0.0, -0.001]]);
        assert_eq!(d, "M0 0L10.5 2.25L3 4Z");
    }
}
