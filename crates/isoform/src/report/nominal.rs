//! Round numbers that designers may have meant.

/// Distance within which a round number counts as near a value, in half widths of the value's 95 %
/// interval. Intervals express noise only, and parts are made less exactly than that.
const NEAR_HALF_WIDTHS: f64 = 3.0;
/// Largest probability that a random number lies as near to a number of that roundness. With half
/// of it, round numbers must be twice as far apart, in widths of the interval; with twice, twice as
/// many random numbers are called round.
const MAX_CHANCE_PROBABILITY: f64 = 0.1;
/// Mantissas of round numbers, rising.
const ROUND_MANTISSAS: [f64; 3] = [1.0, 2.0, 5.0];

/// Returns the roundest number near a value whose 95 % interval has this half width: 60 for 60.009
/// ± 0.005; `None` if a random number would often lie as near to one, as for 60.3 ± 0.5. The
/// roundness of a number is the largest 1, 2 or 5 times a power of ten of which it is a multiple.
pub(crate) fn nominal(value: f64, half_width: f64) -> Option<f64> {
    let within = NEAR_HALF_WIDTHS * half_width;
    if !(within > 0.0 && value.is_finite()) {
        return None;
    }
    if value.abs() <= within {
        return Some(0.0);
    }
    let least = 2.0 * within / MAX_CHANCE_PROBABILITY;
    let highest = value.abs().log10().floor() as i32 + 1;
    for power in (highest - 20..=highest).rev() {
        for multiple in ROUND_MANTISSAS.into_iter().rev() {
            let step = multiple * 10_f64.powi(power);
            if step < least {
                return None;
            }
            // Decimal digits, since negative powers of ten are not exact doubles.
            let count = (value / step).round() * multiple;
            let round: f64 = format!("{count}e{power}").parse().ok()?;
            if round != 0.0 && (round - value).abs() <= within {
                return Some(round);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers_are_told() {
        for (value, half, wanted) in [
            (60.009, 0.005, Some(60.0)),
            (6.0037, 0.0023, Some(6.0)),
            (25.3999, 0.0002, Some(25.4)),
            (-12.4998, 0.0004, Some(-12.5)),
            (0.059_998, 0.000_004, Some(0.06)),
            (3.175_000_01, 1e-8, Some(3.175)),
            (2_499.6, 0.3, Some(2500.0)),
            (0.001, 0.002, Some(0.0)),
            (60.3, 0.5, None),
            (17.318_27, 0.002, None),
            (5.0, 0.0, None),
            (5.0, f64::NAN, None),
            (f64::INFINITY, 1.0, None),
        ] {
            assert_eq!(nominal(value, half), wanted, "{value} ± {half}");
        }
    }

    /// Few random numbers are near a round one.
    #[test]
    fn chance_seldom_tells_one() {
        let mut random = isoform_num::Random::new(7);
        let told = (0..10_000).filter(|_| {
            let value = 10.0 + 90.0 * random.unit();
            nominal(value, 0.002).is_some()
        });
        assert!(told.count() < 2000);
    }
}
