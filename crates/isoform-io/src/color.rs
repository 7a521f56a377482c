//! Colour map for deviations.

/// ColorBrewer's RdBu in eleven classes, reversed (Brewer, colorbrewer2.org, marked there as safe
/// for colour-blind readers).
const BLUE_TO_RED: [[u8; 3]; 11] = [
    [5, 48, 97],
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
    [103, 0, 31],
];
/// Colour of a missing value.
const GREY: [u8; 3] = [128, 128, 128];

/// Maps deviations to colours: blue for −limit, white for 0, red for +limit, linear between and
/// constant beyond; grey for NaN.
///
/// A limit that is not positive colours by sign alone.
///
/// ```
/// let colors = isoform_io::deviation_colors(&[-1.0, 0.0, 0.5, 9.0, f64::NAN], 1.0);
/// assert_eq!(colors, [[5, 48, 97], [247, 247, 247], [229, 131, 104], [103, 0, 31], [128, 128, 128]]);
/// ```
pub fn deviation_colors(values: &[f64], limit: f64) -> Vec<[u8; 3]> {
    let color = |&v: &f64| {
        if v.is_nan() {
            return GREY;
        }
        let t = if limit > 0.0 && v != 0.0 {
            (v / limit).clamp(-1.0, 1.0)
        } else {
            f64::from(i8::from(v > 0.0) - i8::from(v < 0.0))
        };
        let at = (t + 1.0) * 0.5 * (BLUE_TO_RED.len() - 1) as f64;
        let low = (at as usize).min(BLUE_TO_RED.len() - 2);
        let part = at - low as f64;
        let mix = |k: usize| {
            f64::from(BLUE_TO_RED[low][k]) * (1.0 - part)
                + f64::from(BLUE_TO_RED[low + 1][k]) * part
        };
        std::array::from_fn(|k| mix(k).round() as u8)
    };
    values.iter().map(color).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_limits() {
        for limit in [0.0, -1.0, f64::NAN] {
            assert_eq!(
                deviation_colors(&[-2.0, 0.0, 3.0], limit),
                [[5, 48, 97], [247, 247, 247], [103, 0, 31]]
            );
        }
        assert_eq!(
            deviation_colors(&[f64::INFINITY, 0.0], f64::INFINITY)[1],
            [247, 247, 247]
        );
        assert_eq!(
            deviation_colors(&[f64::MIN_POSITIVE, -0.0], 1.0),
            [[247, 247, 247]; 2]
        );
    }
}
