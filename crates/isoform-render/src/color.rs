//! Colours and scales, equal to those of the page: of parts, of deviations, of values from 0 to 1.

/// Red, green and blue of sRGB.
pub type Color = [u8; 3];

/// Okabe and Ito's palette without black.
const PART_COLORS: [Color; 8] = [
    [86, 180, 233],
    [230, 159, 0],
    [0, 158, 115],
    [204, 121, 167],
    [240, 228, 66],
    [0, 114, 178],
    [213, 94, 0],
    [148, 148, 158],
];
/// Colours from blue through the light grey of the neutral band to red (after ColorBrewer's RdBu).
const DIVERGING: [Color; 7] = [
    [20, 80, 160],
    [67, 147, 195],
    [146, 197, 222],
    [198, 198, 192],
    [244, 165, 130],
    [214, 96, 77],
    [165, 15, 30],
];
/// Viridis at seven evenly spaced values.
const SEQUENTIAL: [Color; 7] = [
    [68, 1, 84],
    [70, 50, 126],
    [54, 92, 141],
    [39, 127, 142],
    [31, 161, 135],
    [74, 193, 109],
    [253, 231, 37],
];
/// Fraction of a diverging scale on either side of zero that is neutral.
pub const NEUTRAL_SHARE: f64 = 0.1;
/// Colour of values that are not finite.
const UNKNOWN: Color = [110, 110, 110];

/// Returns the colour of part number i: eight hues, then darker ones, then lighter ones.
pub fn part_color(i: usize) -> Color {
    let turn = i / PART_COLORS.len() % 3;
    PART_COLORS[i % PART_COLORS.len()].map(|v| {
        let v = f64::from(v);
        let mixed = match turn {
            0 => v,
            1 => 0.62 * v,
            _ => 255.0 - 0.55 * (255.0 - v),
        };
        mixed.round() as u8
    })
}

/// Colour scale of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Title of the coloured quantity.
    pub title: String,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// True if the scale is symmetric about zero with a neutral band.
    pub is_diverging: bool,
    /// Number of values, without outliers.
    pub count: usize,
    /// Number of outliers, which are left out of all statistics.
    pub outliers: usize,
    /// Root mean square and maximum of the absolute values; `None` unless the values are
    /// deviations.
    pub rms_and_max: Option<[f64; 2]>,
}

impl Scale {
    /// Returns a scale of deviations, whose ends are the smallest round number that 95 % of them do
    /// not exceed.
    ///
    /// ```
    /// let values: Vec<f64> = (0..100).map(|i| f64::from(i) / 100.0).collect();
    /// let scale = isoform_render::Scale::of_deviations(&values, None);
    /// assert_eq!((scale.lower, scale.upper, scale.count), (-1.0, 1.0, 100));
    /// ```
    pub fn of_deviations(values: &[f64], limit: Option<f64>) -> Self {
        let finite = values.iter().filter(|v| v.is_finite());
        let mut sizes: Vec<f64> = finite.map(|v| v.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let last = sizes.len().saturating_sub(1);
        let most = sizes.get((0.95 * last as f64).floor() as usize);
        let end = limit.unwrap_or_else(|| round_up(most.copied().unwrap_or(1.0)));
        let squares: f64 = sizes.iter().map(|v| v * v).sum();
        let rms = (squares / sizes.len().max(1) as f64).sqrt();
        Self {
            title: "deviation, positive outside".to_owned(),
            lower: -end,
            upper: end,
            is_diverging: true,
            count: sizes.len(),
            outliers: 0,
            rms_and_max: Some([rms, sizes.last().copied().unwrap_or(0.0)]),
        }
    }

    /// Returns a scale of values from 0 to `upper`.
    pub(crate) fn sequential(title: &str, upper: f64, count: usize) -> Self {
        Self {
            title: title.to_owned(),
            lower: 0.0,
            upper,
            is_diverging: false,
            count,
            outliers: 0,
            rms_and_max: None,
        }
    }

    /// Returns the colour of a value; grey if it is not finite.
    pub fn color(&self, value: f64) -> Color {
        if !value.is_finite() {
            return UNKNOWN;
        }
        let share = if self.upper > self.lower {
            (value - self.lower) / (self.upper - self.lower)
        } else {
            0.5
        };
        if !self.is_diverging {
            return mixed(&SEQUENTIAL, share);
        }
        let signed = 2.0 * share - 1.0;
        if signed.abs() <= NEUTRAL_SHARE {
            return DIVERGING[3];
        }
        let rest = (signed.abs() - NEUTRAL_SHARE) / (1.0 - NEUTRAL_SHARE);
        // Colours next to the neutral band start with some saturation, to differ from it.
        let first = 0.12;
        mixed(
            &DIVERGING,
            0.5 + 0.5 * signed.signum() * (first + (1.0 - first) * rest),
        )
    }
}

impl Scale {
    /// Returns the step of the scale that contains a value; one beyond the last for values that are
    /// not finite.
    pub(crate) fn step(&self, value: f64) -> u16 {
        if !value.is_finite() {
            return SCALE_STEPS;
        }
        let share = (value - self.lower) / (self.upper - self.lower);
        (share * f64::from(SCALE_STEPS))
            .floor()
            .clamp(0.0, f64::from(SCALE_STEPS - 1)) as u16
    }

    /// Returns the colour of the middle of a step.
    pub(crate) fn step_color(&self, step: u16) -> Color {
        let share = (f64::from(step) + 0.5) / f64::from(SCALE_STEPS);
        if step >= SCALE_STEPS {
            UNKNOWN
        } else {
            self.color(self.lower + share * (self.upper - self.lower))
        }
    }
}

/// Number of steps of a scale in drawings, whose areas have one colour each: the two central ones
/// are the neutral band.
const SCALE_STEPS: u16 = 20;

/// Interpolates a colour at a position from 0 to 1 between evenly spaced stops.
fn mixed(stops: &[Color; 7], at: f64) -> Color {
    let place = at.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
    let k = (place.floor() as usize).min(stops.len() - 2);
    let f = place - k as f64;
    std::array::from_fn(|c| {
        let (a, b) = (f64::from(stops[k][c]), f64::from(stops[k + 1][c]));
        (a + f * (b - a)).round() as u8
    })
}

/// Returns the smallest 1, 2 or 5 times a power of ten that is not below v; 1 if v is not positive
/// and finite.
fn round_up(v: f64) -> f64 {
    if !(v > 0.0 && v.is_finite()) {
        return 1.0;
    }
    let power = 10_f64.powi(v.log10().floor() as i32);
    let steps = [1.0, 2.0, 5.0, 10.0].map(|m| m * power);
    let above = steps.into_iter().find(|c| *c >= v * (1.0 - 1e-12));
    above.unwrap_or(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pages have the colours of pictures.
    #[test]
    fn pages_have_these_colors() {
        let page = include_str!("../../../web/src/colors.ts");
        let list = |name: &str| -> Vec<u8> {
            let start = page.find(&format!("const {name}")).expect("the list");
            let text = &page[start..];
            let text =
                &text[text.find("= [").expect("its start")..text.find("];").expect("its end")];
            let words = text.split(|c: char| !c.is_ascii_digit());
            words.filter_map(|word| word.parse().ok()).collect()
        };
        assert_eq!(list("PARTS"), PART_COLORS.as_flattened());
        assert_eq!(list("DIVERGING"), DIVERGING.as_flattened());
        assert_eq!(list("SEQUENTIAL"), SEQUENTIAL.as_flattened());
        assert!(page.contains(&format!("NEUTRAL = {NEUTRAL_SHARE};")));
    }

    #[test]
    fn zero_is_neutral_and_signs_are_told_apart() {
        let scale = Scale::of_deviations(&[-1.0, 1.0], None);
        assert_eq!(scale.color(0.09), scale.color(-0.1));
        let (up, down) = (scale.color(0.5), scale.color(-0.5));
        assert!(up[0] > 200 && up[2] < 150 && down[2] > 200 && down[0] < 150);
        assert_eq!(scale.color(7.0), DIVERGING[6]);
        assert_eq!(scale.color(f64::NAN), UNKNOWN);
    }

    #[test]
    fn ends_are_round() {
        for (v, want) in [(0.0031, 0.005), (0.002, 0.002), (6e5, 1e6), (0.0, 1.0)] {
            assert!((round_up(v) / want - 1.0).abs() < 1e-12, "{v}");
        }
    }

    #[test]
    fn parts_are_told_apart() {
        let all: std::collections::BTreeSet<Color> = (0..24).map(part_color).collect();
        assert_eq!(all.len(), 24);
    }
}
