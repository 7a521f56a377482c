//! Text on pictures.

use crate::color::Color;
use crate::picture::Picture;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

const WEIGHT: FontWeight = FontWeight::Regular;
const HEIGHT: RasterHeight = RasterHeight::Size16;
/// Height of a line of text, in pixels.
pub(crate) const LINE_HEIGHT: u32 = 18;
/// Letter drawn in place of letters that the font lacks.
const REPLACEMENT: char = '?';

/// Replaces letters that the font lacks.
fn spelled(text: &str) -> String {
    text.replace('≥', ">=").replace('≤', "<=").replace('−', "-")
}

/// Returns the width of a text in pixels.
pub(crate) fn width(text: &str) -> u32 {
    (get_raster_width(WEIGHT, HEIGHT) * spelled(text).chars().count()) as u32
}

/// Shortens a name to its beginning and its end. Control characters are removed, as they have no
/// glyphs.
pub(crate) fn shortened(name: &str) -> String {
    let letters: Vec<char> = name.chars().filter(|c| !c.is_control()).collect();
    let max_length = 32;
    if letters.len() <= max_length {
        return letters.into_iter().collect();
    }
    let (head, tail) = (max_length / 2, max_length - max_length / 2 - 1);
    let mut short: String = letters[..head].iter().collect();
    short.push('~');
    short.extend(&letters[letters.len() - tail..]);
    short
}

/// Writes a text with its upper left corner at a point.
pub(crate) fn write(picture: &mut Picture, [x, y]: [u32; 2], text: &str, color: Color) {
    let step = get_raster_width(WEIGHT, HEIGHT) as i64;
    for (k, letter) in spelled(text).chars().enumerate() {
        let found = get_raster(letter, WEIGHT, HEIGHT);
        let Some(raster) = found.or_else(|| get_raster(REPLACEMENT, WEIGHT, HEIGHT)) else {
            continue;
        };
        for (dy, row) in raster.rows().enumerate() {
            for (dx, share) in row.iter().enumerate().filter(|(_, s)| **s > 0) {
                let at = [
                    i64::from(x) + k as i64 * step + dx as i64,
                    i64::from(y) + dy as i64,
                ];
                picture.mix(at, color, f64::from(*share) / 255.0);
            }
        }
    }
}
