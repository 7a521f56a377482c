//! The sheet of deviations: the views with the points of the scan.

use super::super::picture::{CUT, Picture};
use super::super::{Drawing, Drawn};
use super::panel::AIR;
use super::placed::{GREY, PlacedView};
use isoform::geom::Point3;
use isoform::io::deviation_colors;
use std::fmt::Write;

/// Side of the squares on paper in which one point is drawn, the nearest to the viewer.
const DOT: f64 = 3.0;
/// Colours of the map; more cannot be told apart.
const SHADES: usize = 21;

/// The sheet with the points that can be seen, coloured by their deviation.
pub(in super::super) fn with_points(drawing: &Drawing<'_>, limit: f64) -> String {
    let views = views(drawing);
    let points = points(drawing);
    let columns = if views.len() > 4 { 3 } else { 2 };
    let side = if columns == 3 { 250.0 } else { 300.0 };
    let (mut svg, mut y, mut width) = (String::new(), AIR, 0.0_f64);
    for row in views.chunks(columns) {
        let scaled: Vec<PlacedView<'_>> = row.iter().map(|d| fitted(d, side)).collect();
        let height = scaled.iter().map(|p| extent(p)[1]).fold(0.0, f64::max);
        for (i, mut placed) in scaled.into_iter().enumerate() {
            let x = AIR + (side + 2.0 * AIR) * (i as f64 + 0.5);
            let middle = y + 22.0 + 0.5 * height;
            center(&mut placed, [x, middle]);
            svg += &placed.shades(GREY);
            svg += &dots(&placed, &points, limit);
            svg += &placed.lines();
            svg += &placed.caption(x - 0.5 * side, y + 8.0);
            width = width.max(x + 0.5 * side + 2.0 * AIR);
        }
        y += height + 22.0 + 2.0 * AIR;
    }
    format!(
        "<svg class=\"sheet\" viewBox=\"0 0 {width:.0} {y:.0}\" role=\"img\" aria-label=\"the points of the scan on the fitted model, coloured by their deviation\">\
         <rect class=\"paper\" width=\"{width:.0}\" height=\"{y:.0}\"/>{svg}</svg>"
    )
}

/// Moves a view, which stands at the origin, to have its middle at a place on paper.
fn center(placed: &mut PlacedView<'_>, [x, y]: [f64; 2]) {
    let [l, r, t, b] = placed.bounds();
    placed.origin = [x - 0.5 * (l + r), y - 0.5 * (t + b)];
}

/// The views in which points are shown.
fn views<'d>(drawing: &'d Drawing<'_>) -> Vec<&'d Drawn> {
    let section = drawing.section.as_ref();
    let views = [
        Some(&drawing.front),
        drawing.side.as_ref(),
        Some(&drawing.top),
        section.filter(|s| shows_inside(&s.picture)),
        Some(&drawing.above),
        Some(&drawing.below),
    ];
    views.into_iter().flatten().collect()
}

/// Returns true if a good part of a section is faces behind the cut, where points can lie.
fn shows_inside(section: &Picture) -> bool {
    let hits = section.hits.iter().flatten();
    let behind = hits.clone().filter(|h| h.part != CUT).count();
    behind as f64 > 0.15 * hits.count() as f64
}

/// Width and height on the paper.
fn extent(placed: &PlacedView<'_>) -> [f64; 2] {
    let [l, r, t, b] = placed.bounds();
    [r - l, b - t]
}

/// A view scaled to a longest side.
fn fitted(drawn: &Drawn, side: f64) -> PlacedView<'_> {
    let mut placed = PlacedView {
        drawn,
        scale: 1.0,
        origin: [0.0; 2],
    };
    let [w, h] = extent(&placed);
    placed.scale = side / w.max(h).max(f64::MIN_POSITIVE);
    placed
}

/// A point in the model's frame with its deviation, NaN for an outlier.
type Point = (Point3, f64);

/// All points of the scan in the model's frame.
fn points(drawing: &Drawing<'_>) -> Vec<Point> {
    let job = drawing.job;
    let all = job.found.cloud.points.iter().zip(job.found.deviation());
    all.zip(&job.found.fit.outliers)
        .map(|((p, d), out)| (drawing.subject.framed(*p), if *out { f64::NAN } else { d }))
        .collect()
}

/// The points that no part of the model and no nearer point hides.
fn dots(placed: &PlacedView<'_>, points: &[Point], limit: f64) -> String {
    let picture = placed.picture();
    let mut shades = vec![String::new(); SHADES + 1];
    for dot in nearest(placed, points) {
        // Noise puts half of the points below the surface, and slopes turn it into depth.
        let off = if dot.deviation.is_nan() {
            0.0
        } else {
            dot.deviation.abs()
        };
        let slack = 4.0 * picture.pixel + 2.0 * off;
        let seen = picture.seen(dot.place);
        if seen.is_some_and(|h| h.depth > dot.depth + slack) {
            continue;
        }
        let [x, y] = placed.flat(dot.place);
        let _ = write!(shades[shade(dot.deviation, limit)], "M{x:.1} {y:.1}h0");
    }
    let mut svg = String::new();
    for (path, [r, g, b]) in shades.iter().zip(colors(limit)) {
        if !path.is_empty() {
            let _ = write!(
                svg,
                "<path class=\"dot\" stroke=\"#{r:02x}{g:02x}{b:02x}\" stroke-width=\"{DOT}\" d=\"{path}\"/>"
            );
        }
    }
    svg
}

/// A point as a view shows it.
#[derive(Clone, Copy)]
struct Dot {
    /// Coordinate toward the viewer.
    depth: f64,
    /// Distance from the model, NaN for an outlier.
    deviation: f64,
    /// The coordinates u and v in the view.
    place: [f64; 2],
}

/// The nearest point to the viewer in each square of the paper.
fn nearest(placed: &PlacedView<'_>, points: &[Point]) -> impl Iterator<Item = Dot> {
    let picture = placed.picture();
    let cell = DOT / placed.scale;
    let columns = (picture.width as f64 * picture.pixel / cell).ceil() as usize + 1;
    let rows = (picture.height as f64 * picture.pixel / cell).ceil() as usize + 1;
    let mut nearest: Vec<Option<Dot>> = vec![None; columns * rows];
    for (p, deviation) in points {
        let [u, v, depth] = picture.view.project(*p);
        let (c, r) = ((u - picture.first[0]) / cell, (picture.first[1] - v) / cell);
        let is_within = (0.0..columns as f64).contains(&c) && (0.0..rows as f64).contains(&r);
        let is_cut_off = |cut: f64| depth > cut + picture.pixel;
        if !is_within || picture.view.cut.is_some_and(is_cut_off) {
            continue;
        }
        let slot = &mut nearest[r as usize * columns + c as usize];
        if slot.is_none_or(|dot| dot.depth < depth) {
            *slot = Some(Dot {
                depth,
                deviation: *deviation,
                place: [u, v],
            });
        }
    }
    nearest.into_iter().flatten()
}

/// The number of the colour of a deviation; outliers have the last one.
fn shade(deviation: f64, limit: f64) -> usize {
    if deviation.is_nan() {
        return SHADES;
    }
    let share = (deviation / limit).clamp(-1.0, 1.0) * 0.5 + 0.5;
    (share * (SHADES - 1) as f64).round() as usize
}

/// The colours from −limit to +limit, and the colour of outliers behind them.
fn colors(limit: f64) -> Vec<[u8; 3]> {
    let middles: Vec<f64> = (0..SHADES)
        .map(|k| limit * (2.0 * k as f64 / (SHADES - 1) as f64 - 1.0))
        .collect();
    let mut colors = deviation_colors(&middles, limit);
    colors.push([40, 44, 50]);
    colors
}
