//! The squared Sampson distance F²/|∇F|² as a graph over the domain of the patch, seen from a
//! corner.

use super::PlotFrame;
use isoform::geom::{Field, RationalPatch, dot};
use std::fmt::Write;

/// The place of the graph in the picture.
const FRAME: PlotFrame = PlotFrame {
    left: 540.0,
    right: 1020.0,
    top: 40.0,
    bottom: 370.0,
};
/// Quadrangles of the graph in each direction.
const GRID: usize = 40;
/// The sides of the domain in the picture, in pixels. They lie askew, so that no corner hides
/// another.
const ALONG: [[f64; 2]; 2] = [[225.0, 52.0], [105.0, -88.0]];
/// The height of the largest value above the domain, in pixels.
const RISE: f64 = 170.0;
/// The middle of the domain in the picture.
const MIDDLE: [f64; 2] = [720.0, 285.0];
/// Colours from zero to the largest value (viridis).
const SHADES: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];

/// Draws the graph with its domain, its names and the bar of its colours.
pub(super) fn draw(svg: &mut String, field: &dyn Field, patch: &RationalPatch) {
    let left = FRAME.left;
    let graph = Graph::new(field, patch);
    let _ = writeln!(
        svg,
        "<text class=\"title\" x=\"{left}\" y=\"22\">Squared Sampson distance over the domain</text>"
    );
    draw_domain(svg);
    graph.draw(svg);
    name_corners(svg);
    draw_colors(svg);
    name_colors(svg, graph.most);
}

/// The parameter of a node of the grid.
fn parameter(i: usize) -> f64 {
    i as f64 / GRID as f64
}

/// The coordinate `k` in the picture of the point (u, v) of the domain.
fn along(k: usize, u: f64, v: f64) -> f64 {
    MIDDLE[k] + ALONG[0][k] * (u - 0.5) + ALONG[1][k] * (v - 0.5)
}

/// The place in the picture of a point above the domain; the largest value has the height 1.
fn place(u: f64, v: f64, height: f64) -> [f64; 2] {
    [along(0, u, v), along(1, u, v) - RISE * height]
}

/// `x y` to a tenth of a pixel.
fn pair(p: [f64; 2]) -> String {
    format!("{:.1} {:.1}", p[0], p[1])
}

/// The squared Sampson distance of the point of the patch at (u, v).
fn squared_distance(field: &dyn Field, patch: &RationalPatch, [u, v]: [f64; 2]) -> f64 {
    let jet = field.jet(patch.point(u, v));
    if jet.v == 0.0 {
        0.0
    } else {
        jet.v * jet.v / dot(jet.g, jet.g)
    }
}

/// The values at the nodes of the grid.
struct Graph {
    /// Row by row of equal u.
    values: Vec<f64>,
    /// The largest finite value.
    most: f64,
}

impl Graph {
    fn new(field: &dyn Field, patch: &RationalPatch) -> Self {
        let nodes = (0..=GRID).flat_map(|i| (0..=GRID).map(move |j| [i, j]));
        let values: Vec<f64> = nodes
            .map(|node| squared_distance(field, patch, node.map(parameter)))
            .collect();
        let finite = values.iter().copied().filter(|v| v.is_finite());
        let most = finite.fold(0.0, f64::max);
        Self { values, most }
    }

    /// The value at a node, as a share of the largest one.
    fn share(&self, i: usize, j: usize) -> f64 {
        let scale = if self.most > 0.0 { self.most } else { 1.0 };
        (self.values[i * (GRID + 1) + j] / scale).clamp(0.0, 1.0)
    }

    /// Draws all cells; nearer ones cover those behind.
    fn draw(&self, svg: &mut String) {
        for cell in back_to_front() {
            self.draw_cell(svg, cell);
        }
    }

    /// Draws a cell in the colour of the mean of its corners.
    fn draw_cell(&self, svg: &mut String, [i, j]: [usize; 2]) {
        let around = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
        let path = around.map(|[a, b]| pair(place(parameter(a), parameter(b), self.share(a, b))));
        let mean = around.iter().map(|&[a, b]| self.share(a, b)).sum::<f64>() / 4.0;
        let _ = writeln!(
            svg,
            "<path class=\"sheet\" fill=\"{}\" d=\"M{}z\"/>",
            color(mean),
            path.join("L")
        );
    }
}

/// The cells of the grid in the order in which later ones cover earlier ones.
fn back_to_front() -> Vec<[usize; 2]> {
    let mut cells: Vec<[usize; 2]> = (0..GRID)
        .flat_map(|i| (0..GRID).map(move |j| [i, j]))
        .collect();
    let depth = |[i, j]: [usize; 2]| along(1, parameter(i), parameter(j));
    cells.sort_by(|a, b| depth(*a).total_cmp(&depth(*b)));
    cells
}

/// Draws the square of the domain.
fn draw_domain(svg: &mut String) {
    let corners =
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(u, v)| pair(place(u, v, 0.0)));
    let _ = writeln!(svg, "<path class=\"axis\" d=\"M{}z\"/>", corners.join("L"));
}

/// Writes the names of the parameters and their ends.
fn name_corners(svg: &mut String) {
    for (u, v, text) in [
        (0.5, -0.12, "u"),
        (1.08, 0.5, "v"),
        (-0.04, -0.06, "0"),
        (1.0, -0.12, "1"),
        (1.08, 1.0, "1"),
    ] {
        let [x, y] = place(u, v, 0.0);
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>",
            y + 5.0
        );
    }
}

/// The left end of the bar of colours, and its height.
fn bar() -> (f64, f64) {
    (FRAME.right - 80.0, FRAME.bottom - FRAME.top - 60.0)
}

/// Draws the bar of colours.
fn draw_colors(svg: &mut String) {
    let (left, height) = bar();
    for k in 0..GRID {
        let y = FRAME.top + 30.0 + height * (1.0 - parameter(k + 1));
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{y:.1}\" width=\"16\" height=\"{:.1}\" fill=\"{}\"/>",
            height * parameter(1) + 0.4,
            color(parameter(k))
        );
    }
}

/// Writes the values that the colours stand for.
fn name_colors(svg: &mut String, most: f64) {
    let (left, height) = bar();
    for share in [0.0, 0.5, 1.0] {
        let text = if most * share == 0.0 {
            "0".to_owned()
        } else {
            format!("{:.1e}", most * share)
        };
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\">{text}</text>",
            left + 22.0,
            FRAME.top + 34.0 + height * (1.0 - share)
        );
    }
}

/// The colour of a share of the largest value.
fn color(share: f64) -> String {
    let t = share.clamp(0.0, 1.0) * (SHADES.len() - 1) as f64;
    let k = (t as usize).min(SHADES.len() - 2);
    let c: [u8; 3] = std::array::from_fn(|i| {
        (SHADES[k][i] + (t - k as f64) * (SHADES[k + 1][i] - SHADES[k][i])).round() as u8
    });
    format!("#{:02x}{:02x}{:02x}", c[0], c[1], c[2])
}
