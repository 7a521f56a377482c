//! Cells: sub-rectangles of a patch, made by repeated halving, to which proofs are applied.
//!
//! A *net* is the list of control points of a patch, row by row: point (i, j) has index i (n + 1) +
//! j.

use isoform_geom::{Point3, RationalPatch, norm, sub};

/// Ranges of the parameters u and v.
pub(crate) type ParameterBox = [(f64, f64); 2];

/// Returns the parameters at the centre of a rectangle.
pub(crate) fn middle_of(place: ParameterBox) -> (f64, f64) {
    let [u, v] = place.map(|(a, b)| 0.5 * (a + b));
    (u, v)
}

/// Splits a patch into halves across its longer direction, or into quarters if neither direction is
/// much longer; returns each part with its parameter rectangle.
pub(crate) fn divided(
    patch: &RationalPatch,
    place: ParameterBox,
) -> Vec<(RationalPatch, ParameterBox)> {
    let (along_u, along_v) = lengths(patch);
    // Keeps cells nearly square.
    let max_ratio = 1.6;
    parts(
        patch,
        place,
        along_v <= max_ratio * along_u,
        along_u <= max_ratio * along_v,
    )
}

/// Returns the lengths of a patch along u and v, measured between its corners.
pub(crate) fn lengths(patch: &RationalPatch) -> (f64, f64) {
    let corners = corners_of(patch.control(), patch.degree());
    lengths_between(corners.map(|c| [c[0] / c[3], c[1] / c[3], c[2] / c[3]]))
}

/// Returns the corners (0, 0), (0, 1), (1, 0), (1, 1) of a net of degree (m, n).
pub(crate) fn corners_of<T: Copy>(net: &[T], (m, n): (usize, usize)) -> [T; 4] {
    [0, n, m * (n + 1), m * (n + 1) + n].map(|i| net[i])
}

/// Returns the longer of the two sides along u, and of the two along v, of a quadrilateral with
/// these corners.
pub(crate) fn lengths_between(corners: [Point3; 4]) -> (f64, f64) {
    let length = |a: usize, b: usize| norm(sub(corners[a], corners[b]));
    (
        length(0, 2).max(length(1, 3)),
        length(0, 1).max(length(2, 3)),
    )
}

/// Splits a patch at 1/2 in u, in v or in both by de Casteljau's algorithm.
pub(crate) fn parts(
    patch: &RationalPatch,
    place: ParameterBox,
    in_u: bool,
    in_v: bool,
) -> Vec<(RationalPatch, ParameterBox)> {
    let all = [(false, false), (false, true), (true, false), (true, true)];
    all.into_iter()
        .filter(|(u, v)| (in_u || !u) && (in_v || !v))
        .map(|(u, v)| {
            let (mut part, mut place) = (patch.clone(), place);
            if in_v {
                halve(&mut part, &mut place, false, v);
            }
            if in_u {
                halve(&mut part, &mut place, true, u);
            }
            (part, place)
        })
        .collect()
}

/// Replaces a patch by its lower or upper half in u or v.
fn halve(patch: &mut RationalPatch, place: &mut ParameterBox, in_u: bool, upper: bool) {
    let degree = patch.degree();
    let mean = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|d| 0.5 * (a[d] + b[d]));
    halve_net(patch.control_mut(), degree, in_u, upper, mean);
    let range = &mut place[usize::from(!in_u)];
    *range = half_of(*range, upper);
}

/// Returns the lower or upper half of a range.
pub(crate) fn half_of((a, b): (f64, f64), upper: bool) -> (f64, f64) {
    let middle = 0.5 * (a + b);
    if upper { (middle, b) } else { (a, middle) }
}

/// Replaces a net of degree (m, n) by the net of its lower or upper half in u or v; `mean` averages
/// two control points.
pub(crate) fn halve_net<T: Copy>(
    net: &mut [T],
    (m, n): (usize, usize),
    in_u: bool,
    upper: bool,
    mean: impl Fn(T, T) -> T,
) {
    if in_u {
        for j in 0..=n {
            halve_row(net, j, (n + 1, m), upper, &mean);
        }
    } else {
        for i in 0..=m {
            halve_row(net, i * (n + 1), (1, n), upper, &mean);
        }
    }
}

/// Replaces the Bézier points at `first`, `first + step`, … of degree n by those of the lower or
/// upper half; `mean` averages two points.
fn halve_row<T: Copy>(
    net: &mut [T],
    first: usize,
    (step, n): (usize, usize),
    upper: bool,
    mean: impl Fn(T, T) -> T,
) {
    for level in 1..=n {
        // Done in place, from the far end for the lower half, so that point k keeps its value of
        // level k.
        for i in level..=n {
            let k = if upper { i - level } else { n - (i - level) };
            let next = if upper { k + 1 } else { k - 1 };
            net[first + k * step] = mean(net[first + k * step], net[first + next * step]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_are_parts() {
        let control = (0..12)
            .map(f64::from)
            .map(|i| [i.sin(), i.cos(), 0.3 * i, 1.0 + 0.1 * (3.0 * i).sin()])
            .collect();
        let patch = RationalPatch::new((2, 3), control).expect("a patch");
        let (lower, upper) = ((0.0, 0.5), (0.5, 1.0));
        let quarters = [
            (lower, lower),
            (lower, upper),
            (upper, lower),
            (upper, upper),
        ]
        .map(|(u, v)| patch.part(u, v));
        for ((a, [u, v]), b) in parts(&patch, [(0.0, 1.0); 2], true, true)
            .iter()
            .zip(&quarters)
        {
            assert_eq!(*b, patch.part(*u, *v));
            for (a, b) in a
                .control()
                .as_flattened()
                .iter()
                .zip(b.control().as_flattened())
            {
                assert!((a - b).abs() < 1e-15);
            }
        }
    }
}
