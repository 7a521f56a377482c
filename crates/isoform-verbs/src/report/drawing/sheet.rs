//! The sheets of views on paper: one with dimensions, one with the points of the scan.

mod offers;
mod panel;
mod placed;
mod points;

pub(super) use self::points::with_points;

use self::offers::offer;
use self::panel::{AIR, Label, Panel};
use self::placed::{PAPER, PlacedView};
use super::Drawing;
use super::dimensions::DimensionForm;
use crate::fit::table;
use crate::report::svg::escaped;
use std::fmt::Write;

/// Longest side of a view on paper.
const SIZE: f64 = 250.0;
/// Least width of a sheet.
const NARROWEST: f64 = 860.0;
/// The sheet with views and dimensions.
pub(super) fn dimensioned(drawing: &Drawing<'_>, forms: &[DimensionForm]) -> String {
    let scale = scale_of(drawing);
    let mut panels: Vec<Panel<'_>> = [
        Some(&drawing.front),
        drawing.side.as_ref(),
        Some(&drawing.top),
        drawing.section.as_ref(),
    ]
    .into_iter()
    .flatten()
    .map(|d| Panel::new(d, scale))
    .collect();
    let rest = distribute(drawing, forms, &mut panels);
    panels.extend(isometric(drawing, scale));
    let (width, height) = arrange(drawing, &mut panels);
    let all = || panels.iter();
    let bodies = all().map(|p| p.placed.shades(PAPER) + &p.placed.lines());
    let body: String = bodies.chain(all().map(Panel::marks)).collect();
    let (legend, more) = legend(drawing, forms, &rest, height);
    let total = height + more;
    format!(
        "<svg class=\"sheet\" viewBox=\"0 0 {width:.0} {total:.0}\" role=\"img\" aria-label=\"the fitted model in its own frame, with its dimensions\">\
         <rect class=\"paper\" width=\"{width:.0}\" height=\"{total:.0}\"/>{body}{legend}</svg>"
    )
}

/// Returns the isometric views, scaled to the room of the others: from above, and also from below
/// if there are enough other views.
fn isometric<'d>(drawing: &'d Drawing<'_>, scale: f64) -> Vec<Panel<'d>> {
    let [l, r, t, b] = PlacedView {
        drawn: &drawing.above,
        scale: 1.0,
        origin: [0.0; 2],
    }
    .bounds();
    let own = SIZE / (r - l).max(b - t).max(f64::MIN_POSITIVE);
    let mut panels = vec![Panel::new(&drawing.above, own.min(scale))];
    if drawing.section.is_some() && drawing.side.is_some() {
        panels.push(Panel::new(&drawing.below, own.min(scale)));
    }
    panels
}

/// Paper units per unit of the model: the longest side of the views along the axes gets [`SIZE`].
fn scale_of(drawing: &Drawing<'_>) -> f64 {
    let views = [
        Some(&drawing.front),
        drawing.side.as_ref(),
        Some(&drawing.top),
    ];
    let longest = views
        .into_iter()
        .flatten()
        .filter_map(|d| d.picture.bounds())
        .flat_map(|[a, b, c, d]| [b - a, d - c])
        .fold(f64::MIN_POSITIVE, f64::max);
    SIZE / longest
}

/// Gives each dimension to the view that shows it best; the indices of those that none shows.
fn distribute<'a>(
    drawing: &Drawing<'_>,
    forms: &[DimensionForm],
    panels: &mut [Panel<'a>],
) -> Vec<usize> {
    let mut rest = Vec::new();
    for (i, form) in forms.iter().enumerate() {
        let best = panels
            .iter()
            .enumerate()
            .filter_map(|(k, panel)| {
                let turn = panel.leaders().count();
                let offer = offer(&panel.placed, form, &drawing.samples, turn)?;
                // Views in their order, and those with room before the full ones.
                let full = 0.05 * (k + panel.shown.len()) as f64;
                Some((offer.merit - full, k, offer.shown))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((_, k, shown)) => panels[k].shown.push((shown, label(drawing, form, i))),
            None => rest.push(i),
        }
    }
    rest
}

/// The name and value of a parameter, with a sign for radius or diameter, and the number of rounds.
fn label(drawing: &Drawing<'_>, form: &DimensionForm, i: usize) -> Label {
    let job = drawing.job;
    let mark = match form {
        DimensionForm::Round {
            is_diameter, count, ..
        } => {
            let sign = if *is_diameter { "⌀ " } else { "R " };
            if *count > 1 {
                format!("{count}× {sign}")
            } else {
                sign.to_owned()
            }
        }
        _ => String::new(),
    };
    Label {
        name: job.found.fit.parameters[i].name.clone(),
        value: mark + &table::reading(job, i).text(),
    }
}

/// The place of a view in the table of views.
#[derive(Clone, Copy)]
struct SheetCell {
    row: usize,
    column: usize,
}

/// Returns the cells of the views in their order: top above front, side on its right (third-angle
/// projection), the section below or in place of the side, isometric views in the remaining room.
fn cells(drawing: &Drawing<'_>) -> Vec<SheetCell> {
    let cell = |row, column| SheetCell { row, column };
    let has_side = drawing.side.is_some();
    let section = if has_side { cell(2, 0) } else { cell(1, 1) };
    let cells = [
        Some(cell(1, 0)),
        has_side.then_some(cell(1, 1)),
        Some(cell(0, 0)),
        drawing.section.is_some().then_some(section),
        Some(cell(0, 1)),
        Some(cell(2, 1)),
    ];
    cells.into_iter().flatten().collect()
}

/// The middles of columns or rows that need this room before and after their middles, and where the
/// last one ends.
fn middles(spans: &[[f64; 2]]) -> (Vec<f64>, f64) {
    let mut at = AIR;
    let middles = spans
        .iter()
        .map(|[a, b]| {
            at += a + b;
            at - b
        })
        .collect();
    (middles, at + AIR)
}

/// Puts the views into their cells; width and height of it all.
fn arrange(drawing: &Drawing<'_>, panels: &mut [Panel<'_>]) -> (f64, f64) {
    let cells = cells(drawing);
    let (mut columns, mut rows) = ([[0.0_f64; 2]; 2], [[0.0_f64; 2]; 3]);
    for (panel, cell) in panels.iter().zip(&cells) {
        let [l, r, t, b] = panel.needs();
        let c = &mut columns[cell.column];
        *c = [c[0].max(l), c[1].max(r)];
        let w = &mut rows[cell.row];
        *w = [w[0].max(t), w[1].max(b)];
    }
    let ((mut x, mut width), (y, height)) = (middles(&columns), middles(&rows));
    // A narrow sheet would be blown up to the width of the page.
    let more = (NARROWEST - width).max(0.0);
    (x[0], x[1], width) = (x[0] + 0.25 * more, x[1] + 0.75 * more, width + more);
    for (panel, cell) in panels.iter_mut().zip(cells) {
        panel.put(x[cell.column], y[cell.row]);
    }
    (width, height)
}

/// Below the views: what could not be drawn, and how to read the sheet; and its height.
fn legend(
    drawing: &Drawing<'_>,
    forms: &[DimensionForm],
    rest: &[usize],
    from: f64,
) -> (String, f64) {
    let mut lines = Vec::new();
    for i in rest {
        let label = label(drawing, &forms[*i], *i);
        let why = match forms[*i] {
            DimensionForm::Tied => continue,
            DimensionForm::Nothing => "does not move the surface",
            _ => "not seen in these views",
        };
        lines.push(format!("{} {} ({why})", label.name, label.value));
    }
    lines.push(
        "Third-angle projection, in the model's own frame. ± is half of the 95 % interval."
            .to_owned(),
    );
    let mut svg = String::new();
    for (i, line) in lines.iter().enumerate() {
        let _ = write!(
            svg,
            "<text class=\"soft\" x=\"{AIR}\" y=\"{:.1}\">{}</text>",
            from + 4.0 + 16.0 * i as f64,
            escaped(line)
        );
    }
    (svg, 16.0 * lines.len() as f64)
}
