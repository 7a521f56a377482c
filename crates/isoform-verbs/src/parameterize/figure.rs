//! The picture of one patch as SVG: the terms S, I and E over the steps on the left, the squared
//! Sampson distance F²/|∇F|² over the domain on the right (figures 2 and 3 of Wurm, Jüttler and
//! Kim 2003).

mod sheet;
mod steps;

use crate::report::svg::escaped;
use isoform::geom::Field;
use isoform::patch::Grown;

/// Width of the picture in pixels.
const WIDTH: f64 = 1040.0;
/// Height of the picture in pixels.
const HEIGHT: f64 = 430.0;

/// The classes of texts and lines; S, I and E have a colour each.
const STYLE: &str = "\
text { font: 13px sans-serif; fill: #444 } .title { font-size: 15px; fill: #222 } .axis { stroke: #b8b8b4; stroke-width: 1; fill: none }
.line { fill: none; stroke-width: 1.8; stroke-linejoin: round } .S { stroke: #1f4e79 } .I { stroke: #d1495b } .E { stroke: #4d8f3a }
.grow { stroke: #555; stroke-width: 1.2 } .sheet { stroke: #000; stroke-opacity: 0.3; stroke-width: 0.4; stroke-linejoin: round }
";

/// Draws the picture of the patch `grown` on the surface `field` = 0.
pub(super) fn svg(field: &dyn Field, grown: &Grown, name: &str) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\">\n\
         <title>A patch on {}</title>\n<style>{STYLE}</style>\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n",
        escaped(name)
    );
    steps::draw(&mut svg, &grown.trace);
    sheet::draw(&mut svg, field, &grown.patch);
    svg += "</svg>\n";
    svg
}

/// The rectangle of the picture that one graph fills, in pixels.
struct PlotFrame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}
