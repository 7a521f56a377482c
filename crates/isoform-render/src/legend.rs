//! Legends of pictures: bars of scales, and lists of parts.

use crate::color::{Color, Scale};
use crate::layer::{Key, Layer};
use crate::picture::Picture;
use crate::text;

/// Maximum number of parts in a legend; the others are only counted.
pub(crate) const MAX_LISTED_PARTS: usize = 12;
/// Width of the margin at the border of a picture, in pixels.
const PICTURE_MARGIN: u32 = 14;
/// Side of the coloured square of a part, in pixels.
const SQUARE_SIDE: u32 = 11;
/// Width and height of the bar of a scale, in pixels.
const BAR_SIZE: [u32; 2] = [18, 160];

/// Line of a legend.
#[derive(Clone, Debug)]
enum LegendRow {
    Text(String),
    Part(String, Color),
    Bar(Scale),
}

impl LegendRow {
    fn size(&self) -> [u32; 2] {
        match self {
            Self::Text(text) => [text::width(text), text::LINE_HEIGHT],
            Self::Part(name, _) => [SQUARE_SIDE + 7 + text::width(name), text::LINE_HEIGHT],
            Self::Bar(scale) => {
                let widest = ticks(scale).iter().map(|(_, t)| text::width(t)).max();
                [
                    BAR_SIZE[0] + 8 + widest.unwrap_or(0),
                    BAR_SIZE[1] + text::LINE_HEIGHT,
                ]
            }
        }
    }
}

/// Formats a number with about three significant digits.
pub(crate) fn number(v: f64) -> String {
    if v == 0.0 {
        return "0".to_owned();
    }
    if (1e-3..1e5).contains(&v.abs()) {
        let digits = (2 - v.abs().log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{v:.digits$}");
        return if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        };
    }
    let text = format!("{v:.2e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mantissa = if mantissa.contains('.') {
        mantissa.trim_end_matches('0').trim_end_matches('.')
    } else {
        mantissa
    };
    format!("{mantissa}e{exponent}")
}

/// Returns the labelled positions of a scale, from 0 to 1, with their labels.
pub(crate) fn ticks(scale: &Scale) -> Vec<(f64, String)> {
    let signed = |v: f64| {
        let sign = if scale.is_diverging && v > 0.0 {
            "+"
        } else {
            ""
        };
        format!("{sign}{}", number(v))
    };
    [0.0, 0.5, 1.0]
        .map(|s| (s, signed(scale.lower + s * (scale.upper - scale.lower))))
        .to_vec()
}

/// Returns the statistics that are written under a bar.
pub(crate) fn figures(scale: &Scale) -> Vec<String> {
    let mut lines = vec![format!("n {}", scale.count)];
    if let Some([rms, max]) = scale.rms_and_max {
        lines.push(format!("rms {}", number(rms)));
        lines.push(format!("max {}", number(max)));
    }
    if scale.outliers > 0 {
        lines.push(format!("without {} outliers", scale.outliers));
    }
    lines
}

/// Returns the lines of a layer's legend.
fn rows_of(layer: &Layer) -> Vec<LegendRow> {
    let mut rows = vec![LegendRow::Text(text::shortened(&layer.name))];
    match &layer.key {
        None => return Vec::new(),
        Some(Key::Scale(scale)) => {
            rows.push(LegendRow::Text(scale.title.clone()));
            rows.push(LegendRow::Bar(scale.clone()));
            rows.extend(figures(scale).into_iter().map(LegendRow::Text));
        }
        Some(Key::Parts(parts)) => {
            let part =
                |(name, color): &(String, Color)| LegendRow::Part(text::shortened(name), *color);
            if parts.len() < 2 {
                return Vec::new();
            }
            rows.extend(parts.iter().take(MAX_LISTED_PARTS).map(part));
            if parts.len() > MAX_LISTED_PARTS {
                rows.push(LegendRow::Text(format!(
                    "and {} more",
                    parts.len() - MAX_LISTED_PARTS
                )));
            }
        }
    }
    rows
}

/// Returns the width in pixels that the legend of layers takes, with its margins; 0 without a
/// legend.
pub fn legend_width(layers: &[Layer]) -> u32 {
    let rows = layers.iter().flat_map(rows_of);
    rows.map(|r| r.size()[0] + 2 * PICTURE_MARGIN)
        .max()
        .unwrap_or(0)
}

/// Draws the legends of layers into a picture: at its right side if room was left for them, else in
/// the emptiest corner. They are omitted if they would take more than half of its width or more
/// than its height.
pub fn draw(picture: &mut Picture, layers: &[Layer], background: Color, has_room: bool) {
    let rows: Vec<LegendRow> = layers.iter().flat_map(rows_of).collect();
    let width = rows.iter().map(|r| r.size()[0]).max().unwrap_or(0);
    let height: u32 = rows.iter().map(|r| r.size()[1]).sum();
    let share = f64::from(width + 2 * PICTURE_MARGIN) / f64::from(picture.size[0].max(1));
    if rows.is_empty() || share > 0.5 || height + 2 * PICTURE_MARGIN > picture.size[1] {
        return;
    }
    let ink = ink_on(background);
    let at = if has_room {
        [picture.size[0] - PICTURE_MARGIN - width, PICTURE_MARGIN]
    } else {
        emptiest(picture, [width, height], background)
    };
    veil(picture, at, [width, height], background);
    let mut y = at[1];
    for row in &rows {
        draw_row(picture, row, [at[0], y], ink);
        y += row.size()[1];
    }
}

/// Returns the colour of letters on a background.
fn ink_on(background: Color) -> Color {
    let light: u32 = background.iter().map(|v| u32::from(*v)).sum();
    if light > 382 {
        [40, 44, 52]
    } else {
        [225, 228, 232]
    }
}

impl Picture {
    /// Writes the name of a view into its upper left corner; an empty name writes nothing.
    pub fn title(&mut self, [x, y]: [u32; 2], name: &str, background: Color) {
        text::write(
            self,
            [x + PICTURE_MARGIN, y + PICTURE_MARGIN],
            name,
            ink_on(background),
        );
    }
}

/// Returns the corner with the fewest pixels that differ from the background; upper right, lower
/// right, upper left, lower left in case of ties.
fn emptiest(picture: &Picture, size: [u32; 2], background: Color) -> [u32; 2] {
    let far = |k: usize| picture.size[k] - PICTURE_MARGIN - size[k];
    let corners = [
        [far(0), PICTURE_MARGIN],
        [far(0), far(1)],
        [PICTURE_MARGIN, PICTURE_MARGIN],
        [PICTURE_MARGIN, far(1)],
    ];
    let taken = |[x, y]: &[u32; 2]| {
        let rows = *y..*y + size[1];
        let row = |y: u32| (*x..*x + size[0]).filter(move |x| picture.pixel(*x, y) != background);
        rows.map(|y| row(y).count()).sum::<usize>()
    };
    corners.into_iter().min_by_key(taken).unwrap_or(corners[0])
}

/// Dims the pixels beneath the legend: 15 % of their contrast remains.
fn veil(picture: &mut Picture, [x, y]: [u32; 2], size: [u32; 2], background: Color) {
    for dy in 0..size[1] {
        for dx in 0..size[0] {
            picture.mix([i64::from(x + dx), i64::from(y + dy)], background, 0.85);
        }
    }
}

/// Fills a rectangle.
fn fill(picture: &mut Picture, [x, y]: [u32; 2], size: [u32; 2], color: Color) {
    for dy in 0..size[1] {
        for dx in 0..size[0] {
            picture.mix([i64::from(x + dx), i64::from(y + dy)], color, 1.0);
        }
    }
}

fn draw_row(picture: &mut Picture, row: &LegendRow, [x, y]: [u32; 2], ink: Color) {
    match row {
        LegendRow::Text(line) => text::write(picture, [x, y], line, ink),
        LegendRow::Part(name, color) => {
            fill(picture, [x, y + 3], [SQUARE_SIDE, SQUARE_SIDE], *color);
            text::write(picture, [x + SQUARE_SIDE + 7, y], name, ink);
        }
        LegendRow::Bar(scale) => {
            let top = y + text::LINE_HEIGHT / 2;
            for k in 0..BAR_SIZE[1] {
                let share = 1.0 - (f64::from(k) + 0.5) / f64::from(BAR_SIZE[1]);
                let value = scale.lower + share * (scale.upper - scale.lower);
                fill(picture, [x, top + k], [BAR_SIZE[0], 1], scale.color(value));
            }
            for (share, name) in ticks(scale) {
                let down = ((1.0 - share) * f64::from(BAR_SIZE[1])).round() as u32;
                fill(
                    picture,
                    [x + BAR_SIZE[0], top + down.min(BAR_SIZE[1] - 1)],
                    [4, 1],
                    ink,
                );
                text::write(
                    picture,
                    [x + BAR_SIZE[0] + 8, top + down - text::LINE_HEIGHT / 2],
                    &name,
                    ink,
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (v, want) in [
            (0.05, "0.05"),
            (-0.002, "-0.002"),
            (1.0, "1"),
            (12345.0, "12345"),
            (2e-7, "2e-7"),
            (1e6, "1e6"),
            (0.12345, "0.123"),
            (200.0, "200"),
        ] {
            assert_eq!(number(v), want);
        }
    }
}
