//! Low-discrepancy normal noise.

use isoform_geom::{Point3, cross, norm};
use std::f64::consts::TAU;

/// Low-discrepancy sequence of standard normal vectors: a Kronecker sequence with the steps of
/// Roberts (powers of the root of x⁶ = x + 1) from a seeded start.
pub(super) struct NormalSequence {
    at: [f64; 5],
}

impl NormalSequence {
    pub(super) fn new(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed ^ 0xB1A5);
        Self {
            at: std::array::from_fn(|_| random.f64()),
        }
    }

    /// Returns the next five numbers in [0, 1).
    fn step(&mut self) -> [f64; 5] {
        let mut step = 1.0;
        for v in &mut self.at {
            // The root of x⁶ = x + 1.
            step /= 1.134_724_138_401_519_5;
            *v = (*v + step).fract();
        }
        self.at
    }

    /// Returns three orthogonal vectors of equal length. Together with their opposites they
    /// integrate quadratics exactly up to the length, so that terms which cancel in the mean cancel
    /// in each set.
    pub(super) fn next(&mut self) -> [Point3; 3] {
        let [p, q, r, s, turn] = self.step();
        let ((x, y), (z, _)) = (normal_pair([p, q]), normal_pair([r, s]));
        let first = [x, y, z];
        let [u, v] = frame_of(first);
        let (sin, cos) = (TAU * turn).sin_cos();
        [
            first,
            std::array::from_fn(|i| cos * u[i] + sin * v[i]),
            std::array::from_fn(|i| cos * v[i] - sin * u[i]),
        ]
    }
}

/// Returns two vectors orthogonal to `first` and to each other, of its length.
fn frame_of(first: Point3) -> [Point3; 2] {
    let length = norm(first).max(f64::MIN_POSITIVE);
    // The axis with the smallest component.
    let is_less = |i: usize, b: usize| first[i].abs() < first[b].abs();
    let least = (0..3).fold(0, |b, i| if is_less(i, b) { i } else { b });
    let axis = std::array::from_fn(|i| f64::from(u8::from(i == least)));
    let u = cross(first, axis);
    let u = u.map(|v| v * length / norm(u));
    [u, cross(first, u).map(|v| v / length)]
}

/// Returns two independent standard normal numbers from two uniform ones in [0, 1) (Box and
/// Muller).
pub(super) fn normal_pair(even: [f64; 2]) -> (f64, f64) {
    let radius = (-2.0 * (1.0 - even[0]).ln()).sqrt();
    let angle = TAU * even[1];
    (radius * angle.cos(), radius * angle.sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::dot;

    #[test]
    fn moves_are_normal_and_at_right_angles() {
        let mut moves = NormalSequence::new(3);
        let (n, mut square) = (20_000, 0.0);
        for _ in 0..n {
            let [u, v, w] = moves.next();
            let length = dot(u, u);
            assert!(dot(u, v).abs() + dot(v, w).abs() + dot(w, u).abs() < 1e-12 * length);
            square += length / 3.0;
        }
        // The variance of each coordinate is 1.
        assert!((square / f64::from(n) - 1.0).abs() < 0.01);
    }
}
