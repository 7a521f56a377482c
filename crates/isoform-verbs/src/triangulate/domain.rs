//! A picture of the parameters: the projective plane as a square whose opposite sides are one line,
//! that at infinity.

use super::MadeSurface;
use crate::report::svg::escaped;
use isoform::algebra::QUADRANTS;
use isoform::tess::Surface;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Pixels from the centre to a corner of the square.
const RADIUS: f64 = 480.0;
/// Half the width of the picture, and of what is above and below the square.
const HALF: f64 = 530.0;
/// Room for the legend.
const LEGEND: f64 = 60.0;
/// Fill of the triangles of each unit triangle.
const TINTS: [&str; 4] = ["#dcebfa", "#fdeacd", "#dff2df", "#f3e3f3"];

/// The classes of texts, triangles and edges.
const STYLE: &str = "\
text { font: 16px sans-serif; fill: #444 } .small { font-size: 13px }
.plane { fill: #f4f4f2; stroke: #8a8a86; stroke-width: 1.5 } .axis { stroke: #8a8a86; stroke-width: 1; stroke-dasharray: 6 5 }
.mesh { stroke: #7b93ab; stroke-width: 0.35; stroke-linejoin: round }
.edge { stroke: #1f4e79; stroke-width: 1.6; stroke-linecap: round; fill: none } .double { stroke: #d1495b; stroke-width: 1.8; stroke-linecap: round; fill: none }
.base { fill: #fff; stroke: #b8251b; stroke-width: 2 }
";

/// Returns the position of a point of a unit triangle in the picture.
fn place(chart: usize, [u, v]: [f64; 2]) -> [f64; 2] {
    let [s, t] = QUADRANTS[chart];
    [RADIUS * u * s as f64, -RADIUS * v * t as f64]
}

/// `x y` to a hundredth of a pixel.
fn pair([x, y]: [f64; 2]) -> String {
    // No minus before zero.
    let round = |v: f64| (v * 1e2).round() / 1e2 + 0.0;
    format!("{} {}", round(x), round(y))
}

/// The triangles in the plane of parameters, with the edges that have one triangle or more than
/// two, and the real base points.
pub(super) fn svg(made: &MadeSurface) -> String {
    let triangles = triangles(&made.drawn.surface);
    let edges = edges(&made.drawn.surface);
    let base_points: Vec<[f64; 2]> = made
        .drawn
        .analyses
        .iter()
        .filter_map(|a| a.base_points.as_ref())
        .flatten()
        .flat_map(|b| spots(b.to_f64()))
        .collect();

    let mut svg = opening(&made.name);
    for (path, tint) in triangles.iter().zip(TINTS) {
        if !path.is_empty() {
            let _ = writeln!(svg, "<path class=\"mesh\" fill=\"{tint}\" d=\"{path}\"/>");
        }
    }
    let _ = writeln!(
        svg,
        "<path class=\"axis\" d=\"M-{RADIUS} 0L{RADIUS} 0M0 -{RADIUS}L0 {RADIUS}\"/>"
    );
    for (class, path) in [("edge", &edges.open), ("double", &edges.double)] {
        if !path.is_empty() {
            let _ = writeln!(svg, "<path class=\"{class}\" d=\"{path}\"/>");
        }
    }
    for [x, y] in &base_points {
        let _ = writeln!(
            svg,
            "<circle class=\"base\" cx=\"{x}\" cy=\"{y}\" r=\"4.5\"/>"
        );
    }
    labels(&mut svg);
    legend(&mut svg, &edges, !base_points.is_empty());
    svg += "</svg>\n";
    svg
}

/// The head of the file, and the square.
fn opening(name: &str) -> String {
    let (width, height) = (2.0 * HALF, 2.0 * HALF + LEGEND);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{} {} {width} {height}\" width=\"{width}\" height=\"{height}\">\n",
        -HALF, -HALF
    );
    let _ = writeln!(
        svg,
        "<title>Parameters of {}</title>\n<style>{STYLE}</style>",
        escaped(name)
    );
    let _ = writeln!(
        svg,
        "<rect x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>",
        -HALF, -HALF
    );
    let _ = writeln!(
        svg,
        "<path class=\"plane\" d=\"M{RADIUS} 0L0 {RADIUS}L-{RADIUS} 0L0 -{RADIUS}z\"/>"
    );
    svg
}

/// The paths of the triangles of each unit triangle.
fn triangles(surface: &Surface) -> [String; 4] {
    let mut paths = [const { String::new() }; 4];
    for (&chart, corners) in surface.charts.iter().zip(&surface.corners) {
        let [a, b, c] = corners.map(|p| pair(place(chart.into(), p)));
        let _ = writeln!(paths[usize::from(chart)], "M{a}L{b}L{c}z");
    }
    paths
}

/// A side of a triangle.
struct ChartSide {
    /// The vertices, the lesser number first.
    edge: [u32; 2],
    /// The places of both ends among the corners of the triangle.
    ends: [usize; 2],
}

/// The three sides of a triangle.
fn sides(triangle: [u32; 3]) -> [ChartSide; 3] {
    [[0, 1], [1, 2], [2, 0]].map(|ends| {
        let [a, b] = ends.map(|k| triangle[k]);
        ChartSide {
            edge: [a.min(b), a.max(b)],
            ends,
        }
    })
}

/// The paths of the edges that do not have two triangles.
#[derive(Default)]
struct Edges {
    /// Edges of one triangle.
    open: String,
    /// Edges of more than two.
    double: String,
}

/// The paths of the edges that have one triangle or more than two.
fn edges(surface: &Surface) -> Edges {
    let mut uses: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for side in surface.triangles.iter().flat_map(|t| sides(*t)) {
        *uses.entry(side.edge).or_default() += 1;
    }
    let mut edges = Edges::default();
    let places = surface.charts.iter().zip(&surface.corners);
    for (triangle, (&chart, corners)) in surface.triangles.iter().zip(places) {
        for ChartSide { edge, ends } in sides(*triangle) {
            let path = match uses[&edge] {
                1 => &mut edges.open,
                2 => continue,
                _ => &mut edges.double,
            };
            let [a, b] = ends.map(|k| pair(place(chart.into(), corners[k])));
            let _ = writeln!(path, "M{a}L{b}");
        }
    }
    edges
}

/// Returns the positions of a point (s : t : w) in the picture: two on the line at infinity.
fn spots(point: [f64; 3]) -> Vec<[f64; 2]> {
    let sum: f64 = point.iter().map(|x| x.abs()).sum();
    let [s, t, w] = point.map(|x| x / sum);
    let at =
        |sign: f64| [sign * s * RADIUS, -sign * t * RADIUS].map(|v| (v * 1e3).round() / 1e3 + 0.0);
    if w == 0.0 {
        vec![at(1.0), at(-1.0)]
    } else {
        vec![at(w.signum())]
    }
}

/// Names of the corners, and of the sides.
fn labels(svg: &mut String) {
    let far = RADIUS + 12.0;
    let _ = writeln!(
        svg,
        "<text x=\"{far}\" y=\"5\">s</text><text x=\"0\" y=\"-{far}\" text-anchor=\"middle\">t</text>"
    );
    let (shift, turned) = (0.5 * RADIUS + 14.0, "text-anchor=\"middle\" transform");
    for (x, y, angle) in [(shift, -shift, 45), (-shift, shift, 45)] {
        let _ = writeln!(
            svg,
            "<text class=\"small\" {turned}=\"translate({x} {y}) rotate({angle})\">line at infinity</text>"
        );
    }
}

/// The signs that occur, with their meaning.
fn legend(svg: &mut String, edges: &Edges, has_base_points: bool) {
    let mut entries = vec![(
        "<path class=\"plane\" d=\"M-9 -7h18v14h-18z\"/>",
        "outside of the box",
    )];
    if !edges.open.is_empty() {
        entries.push((
            "<path class=\"edge\" d=\"M-9 0h18\"/>",
            "boundary of the mesh",
        ));
    }
    if !edges.double.is_empty() {
        entries.push(("<path class=\"double\" d=\"M-9 0h18\"/>", "double curve"));
    }
    if has_base_points {
        entries.push(("<circle class=\"base\" r=\"4.5\"/>", "base point"));
    }
    for (i, (sign, name)) in entries.iter().enumerate() {
        let (x, y) = (-HALF + 40.0 + 230.0 * i as f64, HALF + 0.4 * LEGEND);
        let _ = writeln!(
            svg,
            "<g transform=\"translate({x} {y})\">{sign}<text x=\"18\" y=\"5\">{name}</text></g>"
        );
    }
}
