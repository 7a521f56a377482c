//! A picture of one patch: S, I and E over the steps, and the squared Sampson distance over the
//! domain (figures 2 and 3 of Wurm, Jüttler and Kim 2003).

use crate::report::svg::escaped;
use isoform::geom::{Field, RationalPatch, dot};
use isoform::patch::{Grown, Phase, Row};
use std::fmt::Write;

const WIDTH: f64 = 1040.0;
const HEIGHT: f64 = 430.0;
/// The frame of the steps: left, right, top, bottom.
const STEPS: [f64; 4] = [72.0, 500.0, 40.0, 370.0];
/// The frame of the distances.
const DOMAIN: [f64; 4] = [540.0, 1020.0, 40.0, 370.0];
/// Decades below the largest value that are drawn: what is below is nothing.
const DECADES: f64 = 10.0;
/// Quadrangles in each direction.
const GRID: usize = 40;
/// Where the sides of the domain run to in the picture, and the height of the graph above it:
/// askew, so that no corner hides another.
const ALONG: [[f64; 2]; 2] = [[225.0, 52.0], [105.0, -88.0]];
const RISE: f64 = 170.0;
/// Where the middle of the domain is drawn.
const MIDDLE: [f64; 2] = [720.0, 285.0];
/// Colours from nothing to the most (viridis).
const SHADES: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];

const STYLE: &str = "\
text { font: 13px sans-serif; fill: #444 } .title { font-size: 15px; fill: #222 } .axis { stroke: #b8b8b4; stroke-width: 1; fill: none }
.line { fill: none; stroke-width: 1.8; stroke-linejoin: round } .S { stroke: #1f4e79 } .I { stroke: #d1495b } .E { stroke: #4d8f3a }
.grow { stroke: #555; stroke-width: 1.2 } .sheet { stroke: #000; stroke-opacity: 0.3; stroke-width: 0.4; stroke-linejoin: round }
";

/// The picture as SVG.
pub(super) fn svg(field: &dyn Field, grown: &Grown, name: &str) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\">\n\
         <title>A patch on {}</title>\n<style>{STYLE}</style>\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n",
        escaped(name)
    );
    steps(&mut svg, &grown.trace);
    sheet(&mut svg, field, &grown.patch);
    svg += "</svg>\n";
    svg
}

/// One line each for S, I and E, logarithmic; a plus above each extrapolation.
fn steps(svg: &mut String, trace: &[Row]) {
    let [left, right, top, bottom] = STEPS;
    let lines: [(&str, Vec<f64>); 3] = [
        ("S", trace.iter().map(|r| r.sum).collect()),
        ("I", trace.iter().map(|r| r.terms.i).collect()),
        ("E", trace.iter().map(|r| r.terms.e).collect()),
    ];
    let _ = writeln!(
        svg,
        "<text class=\"title\" x=\"{left}\" y=\"22\">Terms of the objective over the steps</text>"
    );
    let most = lines.iter().flat_map(|l| &l.1).copied().fold(0.0, f64::max);
    if most <= 0.0 || trace.len() < 2 {
        let _ = writeln!(
            svg,
            "<text x=\"{left}\" y=\"{}\">no steps were made</text>",
            top + 20.0
        );
        return;
    }
    let hi = most.log10().ceil();
    let least = lines
        .iter()
        .flat_map(|l| &l.1)
        .copied()
        .filter(|v| *v > 0.0)
        .fold(most, f64::min);
    let lo = least.log10().floor().max(hi - DECADES).min(hi - 1.0);
    let x = |k: usize| left + (right - left) * k as f64 / (trace.len() - 1) as f64;
    let y = |v: f64| {
        bottom - (bottom - top) * ((v.max(f64::MIN_POSITIVE).log10() - lo) / (hi - lo)).max(0.0)
    };
    let every = if hi - lo > 6.0 { 2 } else { 1 };
    for decade in (lo as i32..=hi as i32).rev().step_by(every) {
        let at = y(10f64.powi(decade));
        let _ = writeln!(svg, "<path class=\"axis\" d=\"M{left} {at:.1}H{right}\"/>");
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">1e{decade}</text>",
            left - 7.0,
            at + 4.0
        );
    }
    let rough = (trace.len() as f64 / 6.0).max(1.0);
    let unit = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .iter()
        .map(|f| f * unit)
        .find(|s| *s >= rough)
        .unwrap_or(rough) as usize;
    for k in (0..trace.len()).step_by(step.max(1)) {
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{k}</text>",
            x(k),
            bottom + 18.0
        );
    }
    for (k, _) in trace
        .iter()
        .enumerate()
        .filter(|(_, r)| r.phase == Phase::Grow)
    {
        let _ = writeln!(
            svg,
            "<path class=\"grow\" d=\"M{:.1} {}h7m-3.5 -3.5v7\"/>",
            x(k) - 3.5,
            top - 6.0
        );
    }
    for (k, (name, values)) in lines.iter().enumerate() {
        let points: Vec<String> = values
            .iter()
            .enumerate()
            .map(|(k, v)| format!("{:.1},{:.1}", x(k), y(*v)))
            .collect();
        let _ = writeln!(
            svg,
            "<polyline class=\"line {name}\" points=\"{}\"/>",
            points.join(" ")
        );
        let at = left + 40.0 * k as f64;
        let _ = writeln!(
            svg,
            "<path class=\"line {name}\" d=\"M{at} {}h16\"/>",
            bottom + 40.0
        );
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\">{name}</text>",
            at + 20.0,
            bottom + 44.0
        );
    }
    let at = left + 140.0;
    let _ = writeln!(
        svg,
        "<path class=\"grow\" d=\"M{at} {}h7m-3.5 -3.5v7\"/>",
        bottom + 40.0
    );
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\">extrapolation</text>",
        at + 13.0,
        bottom + 44.0
    );
    let _ = writeln!(
        svg,
        "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">step</text>",
        bottom + 44.0
    );
}

/// F²/|∇F|² as a graph over the domain, seen from a corner.
fn sheet(svg: &mut String, field: &dyn Field, patch: &RationalPatch) {
    let [left, right, top, bottom] = DOMAIN;
    let at = |i: usize| i as f64 / GRID as f64;
    let squared = |i: usize, j: usize| {
        let jet = field.jet(patch.point(at(i), at(j)));
        if jet.v == 0.0 {
            0.0
        } else {
            jet.v * jet.v / dot(jet.g, jet.g)
        }
    };
    let values: Vec<f64> = (0..=GRID)
        .flat_map(|i| (0..=GRID).map(move |j| (i, j)))
        .map(|(i, j)| squared(i, j))
        .collect();
    let most = values
        .iter()
        .copied()
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    let scale = if most > 0.0 { most } else { 1.0 };
    let value = |i: usize, j: usize| (values[i * (GRID + 1) + j] / scale).clamp(0.0, 1.0);
    let along =
        |k: usize, u: f64, v: f64| MIDDLE[k] + ALONG[0][k] * (u - 0.5) + ALONG[1][k] * (v - 0.5);
    let place = |u: f64, v: f64, h: f64| [along(0, u, v), along(1, u, v) - RISE * h];
    let pair = |p: [f64; 2]| format!("{:.1} {:.1}", p[0], p[1]);
    let _ = writeln!(
        svg,
        "<text class=\"title\" x=\"{left}\" y=\"22\">Squared Sampson distance over the domain</text>"
    );
    let corners =
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(u, v)| pair(place(u, v, 0.0)));
    let _ = writeln!(svg, "<path class=\"axis\" d=\"M{}z\"/>", corners.join("L"));
    // From the back to the front.
    let mut order: Vec<(usize, usize)> = (0..GRID)
        .flat_map(|i| (0..GRID).map(move |j| (i, j)))
        .collect();
    order.sort_by(|a, b| along(1, at(a.0), at(a.1)).total_cmp(&along(1, at(b.0), at(b.1))));
    for (i, j) in order {
        let around = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        let path: Vec<String> = around
            .iter()
            .map(|&(a, b)| pair(place(at(a), at(b), value(a, b))))
            .collect();
        let mean = around.iter().map(|&(a, b)| value(a, b)).sum::<f64>() / 4.0;
        let _ = writeln!(
            svg,
            "<path class=\"sheet\" fill=\"{}\" d=\"M{}z\"/>",
            color(mean),
            path.join("L")
        );
    }
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
    let (bar, height) = (right - 80.0, bottom - top - 60.0);
    for k in 0..GRID {
        let y = top + 30.0 + height * (1.0 - at(k + 1));
        let _ = writeln!(
            svg,
            "<rect x=\"{bar}\" y=\"{y:.1}\" width=\"16\" height=\"{:.1}\" fill=\"{}\"/>",
            height * at(1) + 0.4,
            color(at(k))
        );
    }
    for share in [0.0, 0.5, 1.0] {
        let text = if most * share == 0.0 {
            "0".to_owned()
        } else {
            format!("{:.1e}", most * share)
        };
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\">{text}</text>",
            bar + 22.0,
            top + 34.0 + height * (1.0 - share)
        );
    }
}

/// The colour of a share of the most.
fn color(share: f64) -> String {
    let t = share.clamp(0.0, 1.0) * (SHADES.len() - 1) as f64;
    let k = (t as usize).min(SHADES.len() - 2);
    let c: [u8; 3] = std::array::from_fn(|i| {
        (SHADES[k][i] + (t - k as f64) * (SHADES[k + 1][i] - SHADES[k][i])).round() as u8
    });
    format!("#{:02x}{:02x}{:02x}", c[0], c[1], c[2])
}
