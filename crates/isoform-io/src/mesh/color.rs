//! Colours that distinguish parts.

/// Returns red, green and blue from 0 to 1 for a part. Hues of successive parts differ by the
/// golden angle, so that neighbours in the list are distinct for any number of parts.
pub(super) fn part_color(part: usize) -> [f64; 3] {
    // Steps of 0.618… of the colour circle, starting from blue; pale enough to leave shading
    // visible.
    let hue = (0.58 + 0.618_033_988_75 * part as f64).fract();
    [0.0, 2.0 / 3.0, 1.0 / 3.0].map(|turn| {
        let x = ((hue + turn).fract() * 6.0 - 3.0).abs() - 1.0;
        0.9 * (1.0 - 0.55 * (1.0 - x.clamp(0.0, 1.0)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_differ() {
        for i in 0..200 {
            let (a, b) = (part_color(i), part_color(i + 1));
            assert!(a.iter().all(|v| (0.0..=1.0).contains(v)));
            assert!(
                (0..3).map(|k| (a[k] - b[k]).abs()).sum::<f64>() > 0.3,
                "{i}: {a:?} {b:?}"
            );
        }
    }
}
