//! Random numbers of the tests.

use std::f64::consts::TAU;

/// Returns a normal deviate of standard deviation 1 (Box and Muller).
pub(crate) fn normal(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (TAU * random.f64()).cos()
}
