//! The effect of noise near a straight edge between two planes.
//!
//! In units of the noise and in the plane normal to the edge, points that come from the half line
//! of positive x of the first face have the density φ(z) Φ(x), where z is the depth below that
//! face. The integrals are taken in polar coordinates about the edge, sector by sector: within one
//! the distance is smooth. The contribution of the unbounded plane of the first face is subtracted,
//! so that only the effect of the edge remains.

use isoform_num::gauss_legendre;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Distance, in standard deviations, beyond which noise is neglected: normal noise exceeds it twice
/// in 10⁹.
pub(super) const REACH_DEVIATIONS: f64 = 6.0;
/// Resolution of the tabulated angles in radians; rounding to it changes the sums by less than one
/// per cent.
const ANGLE_STEP_RADIANS: f64 = 0.01;

/// Integrals over the noisy points of one face of an edge, per length of the edge and density of
/// the points, in units of the noise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct EdgeIntegrals {
    /// Weighted distance times the component of its direction along the points' own face normal.
    pub(super) own: f64,
    /// Weighted distance times the component along the normal of the other face.
    pub(super) other: f64,
    /// Square of the distance.
    pub(super) squares: f64,
}

/// Integrals by angle, computed on demand: a part has few distinct angles.
pub(super) struct EdgeIntegralTable<'w> {
    /// Weight of a distance.
    weight: &'w dyn Fn(f64) -> f64,
    known: Vec<(i32, EdgeIntegrals)>,
    angles: (Vec<f64>, Vec<f64>),
    radii: (Vec<f64>, Vec<f64>),
}

/// The feature nearest to a point near an edge, apart from the first face.
#[derive(Clone, Copy)]
enum NearestFeature {
    Other,
    /// The edge itself, from inside (1) or outside (−1).
    Edge(f64),
}

impl<'w> EdgeIntegralTable<'w> {
    pub(super) fn new(weight: &'w dyn Fn(f64) -> f64) -> Self {
        Self {
            weight,
            known: Vec::new(),
            // With 16 nodes along the angle of each sector and 24 along the radius, errors are
            // about 1e-6.
            angles: gauss_legendre(16),
            radii: gauss_legendre(24),
        }
    }

    /// Returns true if the integrals apply to an edge of this angle: faces at less than 45° are
    /// near each other far from the edge and are left to simulation.
    pub(super) fn has(angle: f64) -> bool {
        (PI / 4.0..=TAU - PI / 4.0).contains(&angle)
    }

    /// Returns the integrals for an edge with this angle through the material.
    pub(super) fn at(&mut self, angle: f64) -> EdgeIntegrals {
        let key = (angle / ANGLE_STEP_RADIANS).round() as i32;
        if let Some((_, wedge)) = self.known.iter().find(|(k, _)| *k == key) {
            return *wedge;
        }
        let wedge = self.integrate(f64::from(key) * ANGLE_STEP_RADIANS);
        self.known.push((key, wedge));
        wedge
    }

    fn integrate(&self, angle: f64) -> EdgeIntegrals {
        let mut sum = EdgeIntegrals::default();
        for (from, to, nearest) in sectors(angle) {
            for (t, share) in self.angles.0.iter().zip(&self.angles.1) {
                let ray = Ray::new(angle, from + t * (to - from), nearest);
                self.add(&ray, share * (to - from), &mut sum);
            }
        }
        sum
    }

    /// Adds the points in one direction from the edge.
    fn add(&self, ray: &Ray, share: f64, sum: &mut EdgeIntegrals) {
        for (t, weight) in self.radii.0.iter().zip(&self.radii.1) {
            let radius = t * ray.far;
            let (x, z) = (radius * ray.cos, radius * ray.sin);
            let points = share * weight * ray.far * radius * density(z) * below(x);
            let r = radius * ray.sine;
            let pull = (self.weight)(r) * r;
            sum.own += points * (ray.slope[0] * pull - (self.weight)(z) * z);
            sum.other += points * ray.slope[1] * pull;
            sum.squares += points * (r * r - z * z);
        }
    }
}

/// Returns the sectors about an edge with the feature nearest to their points. The remaining
/// sector, in which the first face itself is nearest, contributes nothing.
fn sectors(angle: f64) -> [(f64, f64, NearestFeature); 3] {
    let half = 0.5 * angle;
    if angle < PI {
        [
            (half, angle, NearestFeature::Other),
            (angle, angle + FRAC_PI_2, NearestFeature::Other),
            (angle + FRAC_PI_2, 1.5 * PI, NearestFeature::Edge(-1.0)),
        ]
    } else {
        [
            (FRAC_PI_2, angle - FRAC_PI_2, NearestFeature::Edge(1.0)),
            (angle - FRAC_PI_2, angle, NearestFeature::Other),
            (angle, PI + half, NearestFeature::Other),
        ]
    }
}

/// A direction from the edge.
struct Ray {
    sin: f64,
    cos: f64,
    /// Radius at which the ray leaves the noise of the first face.
    far: f64,
    /// Signed distance from the surface per radius, positive inside.
    sine: f64,
    /// Components of the direction to the nearest point along the normals of the first and of the
    /// other face.
    slope: [f64; 2],
}

impl Ray {
    /// Makes the ray at the angle `at` from the first face into the material.
    fn new(angle: f64, at: f64, nearest: NearestFeature) -> Self {
        let (sin, cos) = at.sin_cos();
        let (sine, slope) = match nearest {
            NearestFeature::Other => ((angle - at).sin(), [0.0, 1.0]),
            NearestFeature::Edge(side) => {
                let other = side * cos / angle.sin();
                (side, [side * sin + other * angle.cos(), other])
            }
        };
        Self {
            sin,
            cos,
            far: REACH_DEVIATIONS / if cos > 0.0 { sin.abs() } else { 1.0 },
            sine,
            slope,
        }
    }
}

/// φ, the density of the standard normal distribution.
pub(super) fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / TAU.sqrt()
}

/// Φ, the standard normal distribution function, to 1e-7 (Abramowitz and Stegun 26.2.17).
fn below(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let series = [
        0.319_381_530,
        -0.356_563_782,
        1.781_477_937,
        -1.821_255_978,
        1.330_274_429,
    ];
    let tail = density(x) * t * series.iter().rev().fold(0.0, |sum, c| sum * t + c);
    if x > 0.0 { 1.0 - tail } else { tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Estimates the integrals from random points by the distances to the two half lines. Returns
    /// them with their standard deviation.
    fn simulated(angle: f64, weight: fn(f64) -> f64, draws: usize) -> (EdgeIntegrals, f64) {
        let mut random = fastrand::Rng::with_seed(7);
        let (mut sum, mut variance, length) = (EdgeIntegrals::default(), 0.0, 12.0);
        let (sin, cos) = angle.sin_cos();
        for _ in 0..draws {
            let (u, v) = super::super::moves::normal_pair([random.f64(), random.f64()]);
            let (x, z) = (length * random.f64() + u, v);
            // Coordinates along and below the other face.
            let (along, below) = (x * cos + z * sin, x * sin - z * cos);
            let turned = z.atan2(x).rem_euclid(TAU);
            let first = if x > 0.0 { z.abs() } else { x.hypot(z) };
            let second = if along > 0.0 { below.abs() } else { x.hypot(z) };
            let r = first.min(second) * if turned < angle { 1.0 } else { -1.0 };
            let (own, other) = if x > 0.0 && first <= second {
                (1.0, 0.0)
            } else if along > 0.0 && second < first {
                (0.0, 1.0)
            } else {
                // Components along (0, 1) and (sin, −cos) of the direction from the edge.
                let other = x / r / sin;
                (z / r + other * cos, other)
            };
            let pull = weight(r) * r;
            sum.own += own * pull - weight(z) * z;
            sum.other += other * pull;
            sum.squares += r * r - z * z;
            variance += (other * pull).powi(2) + (own * pull - weight(z) * z).powi(2);
        }
        let share = length / draws as f64;
        (
            EdgeIntegrals {
                own: share * sum.own,
                other: share * sum.other,
                squares: share * sum.squares,
            },
            share * variance.sqrt(),
        )
    }

    #[test]
    fn wedges_are_what_random_points_say() {
        let cauchy = |z: f64| 1.0 / (1.0 + (z / 2.0).powi(2));
        for weight in [|_| 1.0, cauchy as fn(f64) -> f64] {
            let mut wedges = EdgeIntegralTable::new(&weight);
            for degrees in [50, 90, 150, 200, 270, 300] {
                let angle = ANGLE_STEP_RADIANS
                    * (f64::from(degrees).to_radians() / ANGLE_STEP_RADIANS).round();
                let found = wedges.at(angle);
                let (drawn, deviation) = simulated(angle, weight, 400_000);
                for (f, d) in [
                    (found.own, drawn.own),
                    (found.other, drawn.other),
                    (found.squares, drawn.squares),
                ] {
                    let off = (f - d).abs();
                    assert!(off < 4.0 * deviation, "{degrees}: {found:?} {drawn:?}");
                }
            }
        }
    }

    #[test]
    fn flat_edges_do_nothing_and_hollow_ones_the_opposite() {
        let weight = |_: f64| 1.0;
        let mut wedges = EdgeIntegralTable::new(&weight);
        let flat = wedges.at(PI - 1e-3);
        assert!(flat.own.abs() + flat.other.abs() < 1e-2, "{flat:?}");
        let (full, hollow) = (
            wedges.at(1.2),
            wedges.at((TAU - 1.2) / ANGLE_STEP_RADIANS * ANGLE_STEP_RADIANS),
        );
        assert!((full.own + hollow.own).abs() < 0.02 * full.own.abs());
        assert!((full.other + hollow.other).abs() < 0.02 * full.other.abs());
    }
}
