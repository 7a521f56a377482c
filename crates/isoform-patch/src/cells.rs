//! Cells: parts of a patch by halving, on which proofs go.

use isoform_geom::{RationalPatch, norm, sub};

/// A cell that is longer by this factor in one direction is divided there only.
const LONGER: f64 = 1.6;

/// Ranges of u and of v.
pub(crate) type Place = [(f64, f64); 2];

/// The parameters in the middle.
pub(crate) fn middle_of(place: Place) -> (f64, f64) {
    let [u, v] = place.map(|(a, b)| 0.5 * (a + b));
    (u, v)
}

/// The halves of a patch that is longer in one direction, the quarters of another one; each with
/// its place.
pub(crate) fn divided(patch: &RationalPatch, place: Place) -> Vec<(RationalPatch, Place)> {
    let (along_u, along_v) = lengths(patch);
    parts(
        patch,
        place,
        along_v <= LONGER * along_u,
        along_u <= LONGER * along_v,
    )
}

/// Lengths along u and v, by the corners.
pub(crate) fn lengths(patch: &RationalPatch) -> (f64, f64) {
    let c = patch.control();
    let (n, last) = (patch.degree().1, c.len() - 1);
    let length = |a: usize, b: usize| {
        let [p, q] = [c[a], c[b]].map(|c| [c[0] / c[3], c[1] / c[3], c[2] / c[3]]);
        norm(sub(p, q))
    };
    (
        length(0, last - n).max(length(n, last)),
        length(0, n).max(length(last - n, last)),
    )
}

/// The parts of a patch, by de Casteljau's algorithm at 1/2, in u, in v or both.
pub(crate) fn parts(
    patch: &RationalPatch,
    place: Place,
    in_u: bool,
    in_v: bool,
) -> Vec<(RationalPatch, Place)> {
    let (m, n) = patch.degree();
    let mean = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|d| 0.5 * (a[d] + b[d]));
    let of = |upper_u: bool, upper_v: bool| {
        let mut part = patch.clone();
        let control = part.control_mut();
        if in_v {
            (0..=m).for_each(|i| halve(control, i * (n + 1), (1, n), upper_v, mean));
        }
        if in_u {
            (0..=n).for_each(|j| halve(control, j, (n + 1, m), upper_u, mean));
        }
        let half = |(a, b): (f64, f64), divided: bool, upper: bool| match (divided, upper) {
            (false, _) => (a, b),
            (true, false) => (a, 0.5 * (a + b)),
            (true, true) => (0.5 * (a + b), b),
        };
        (
            part,
            [half(place[0], in_u, upper_u), half(place[1], in_v, upper_v)],
        )
    };
    let all = [(false, false), (false, true), (true, false), (true, true)];
    all.into_iter()
        .filter(|(u, v)| (in_u || !u) && (in_v || !v))
        .map(|(u, v)| of(u, v))
        .collect()
}

/// Replaces the Bézier points at `first`, `first + step`, … of degree n by those of the lower or
/// the upper half, by means of two.
pub(crate) fn halve<T: Copy>(
    net: &mut [T],
    first: usize,
    (step, n): (usize, usize),
    upper: bool,
    mean: impl Fn(T, T) -> T,
) {
    for level in 1..=n {
        // In place: from the far end for the lower half, so that point k keeps its value of level
        // k.
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
