//! Rounding errors of coordinates, estimated from their digits.

use crate::PointCloud;

/// Approximate number of coordinates that are sampled. Fewer may all be round numbers by chance.
const SAMPLED_COORDINATES: usize = 12_000;
/// Relative rounding error of single precision, 2⁻²⁴.
const SINGLE_PRECISION_ROUNDING: f64 = 1.0 / 16_777_216.0;
/// Largest distance of a number from the nearest single at which it counts as one, as a share of
/// the rounding error: decimal files give nine digits of singles. One in eight other numbers counts
/// by chance.
const SINGLE_TOLERANCE: f64 = 0.125;
/// Smallest share of singles among the coordinates of a mesh in single precision.
const MIN_SINGLE_FRACTION: f64 = 0.99;
/// Percentile of the magnitudes that counts as the largest; those above may be outliers.
const MAGNITUDE_PERCENTILE: usize = 98;
/// Number of decimal digits of a coordinate from which coordinates count as not rounded to
/// decimals.
const MIN_UNROUNDED_DIGITS: i32 = 13;
/// Largest decimal rounding error, in diagonals of the cloud, that counts as rounding: the round
/// numbers of a designer are coarser. A smaller value would look for exact surfaces in files with
/// four digits; a larger one would take a part with whole millimetres for a rounded one.
const MAX_DECIMAL_ROUNDING: f64 = 2e-5;

/// Returns the largest rounding error of a coordinate: that of single precision or of decimals if
/// the coordinates show either, else that of double precision.
pub fn rounding(scan: &PointCloud) -> f64 {
    rounding_with(scan, MAX_DECIMAL_ROUNDING * scan.bounds().diagonal())
}

/// Returns the largest rounding error like [`rounding`], but counts decimals of any coarseness as
/// rounding.
pub fn rounding_if_decimal(scan: &PointCloud) -> f64 {
    rounding_with(scan, f64::INFINITY)
}

/// Returns the largest rounding error, where errors of decimals count up to `coarsest`, in model
/// units.
fn rounding_with(scan: &PointCloud, coarsest: f64) -> f64 {
    let step = (3 * scan.points.len()).div_ceil(SAMPLED_COORDINATES).max(1);
    let absolute = |i: usize| scan.points[i / 3][i % 3] + scan.origin[i % 3];
    let numbers = (0..3 * scan.points.len()).step_by(step).map(absolute);
    let numbers: Vec<f64> = numbers.filter(|x| *x != 0.0 && x.is_finite()).collect();
    let largest = largest(&numbers);
    let singles = numbers.iter().filter(|x| is_single(**x)).count() as f64;
    let single = match singles >= MIN_SINGLE_FRACTION * numbers.len() as f64 {
        true => largest * SINGLE_PRECISION_ROUNDING,
        false => 0.0,
    };
    let decimal = decimal(&numbers, largest);
    let decimal = if decimal <= coarsest { decimal } else { 0.0 };
    single.max(decimal).max(largest * f64::EPSILON)
}

/// Returns a high percentile of the magnitudes: outliers say nothing about the rounding of the
/// others.
fn largest(numbers: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = numbers.iter().map(|x| x.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let rank = (sizes.len() - 1) * MAGNITUDE_PERCENTILE / 100;
    *sizes.select_nth_unstable_by(rank, f64::total_cmp).1
}

fn is_single(x: f64) -> bool {
    (x - f64::from(x as f32)).abs() <= SINGLE_TOLERANCE * SINGLE_PRECISION_ROUNDING * x.abs()
}

/// Returns half a unit of the last decimal of the numbers: for fixed decimals the finest of any
/// number, for a fixed number of digits that of the largest number.
fn decimal(numbers: &[f64], largest: f64) -> f64 {
    let (mut digits, mut finest) = (0, i32::MAX);
    for x in numbers {
        let (of, last) = decimals(*x);
        digits = digits.max(of);
        finest = finest.min(last);
    }
    if digits >= MIN_UNROUNDED_DIGITS || numbers.is_empty() {
        return 0.0;
    }
    let of_largest = largest.log10().floor() as i32 + 1 - digits;
    0.5 * 10.0_f64.powi(finest.max(of_largest))
}

/// Returns the number of decimal digits of a number, and the power of ten of the last one.
fn decimals(x: f64) -> (i32, i32) {
    let text = format!("{x:e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let digits = mantissa.bytes().filter(u8::is_ascii_digit).count() as i32;
    (digits, exponent.parse::<i32>().unwrap_or(0) + 1 - digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns points on a sphere of radius 20, rounded.
    fn sphere(round: impl Fn(f64) -> f64) -> PointCloud {
        let at = |i: u32| {
            let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 200.0 - 1.0);
            let r = (1.0 - z * z).sqrt();
            [t.cos() * r, t.sin() * r, z].map(|x| round(20.0 * x))
        };
        PointCloud::from_points((0..400).map(at).collect())
    }

    #[test]
    fn single_precision_is_told_also_from_decimals_of_it() {
        let exact = rounding(&sphere(|x| f64::from(x as f32)));
        assert!(
            (0.9..=1.0).contains(&(exact / (20.0 * SINGLE_PRECISION_ROUNDING))),
            "{exact}"
        );
        let nine = |x: f64| format!("{:.8e}", x as f32).parse().unwrap_or(x);
        assert!((rounding(&sphere(nine)) / exact - 1.0).abs() < 0.1);
    }

    #[test]
    fn decimals_are_told() {
        let fixed = rounding(&sphere(|x| (x * 1e4).round() / 1e4));
        assert!((fixed / 0.5e-4 - 1.0).abs() < 1e-9, "{fixed}");
        let seven = |x: f64| format!("{x:.6e}").parse().unwrap_or(x);
        let digits = rounding(&sphere(seven));
        assert!((digits / 0.5e-5 - 1.0).abs() < 1e-9, "{digits}");
    }

    #[test]
    fn a_stray_number_tells_nothing() {
        let mut scan = sphere(|x| f64::from(x as f32));
        let alone = rounding(&scan);
        scan.points.push([1e308, 0.0, 0.0]);
        assert!((rounding(&scan) / alone - 1.0).abs() < 0.1);
    }

    #[test]
    fn doubles_and_whole_numbers_are_not_rounded() {
        assert!(rounding(&sphere(|x| x)) < 1e-14);
        let cube = PointCloud::from_points(vec![[0.0; 3], [10.0, 20.0, 7.5]]);
        assert!(rounding(&cube) < 2e-6);
    }
}
