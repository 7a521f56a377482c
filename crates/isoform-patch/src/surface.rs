//! Points of the surface: projections along gradients and lines, seeds, ridges.
//!
//! A *seed* is a point of the surface with a frame of its tangent plane; a *ridge* is a curve on
//! which the largest curvature is maximal along its own direction.

use crate::options::Error;
use crate::places::{contains, moved};
use isoform_control::Control;
use isoform_geom::{Aabb, Field, Point3, cross, dot, norm, orthonormal_complement};
use isoform_num::Jet2;

/// Maximum number of Newton steps towards the surface.
const MAX_PROJECTION_STEPS: usize = 60;
/// Distance from the surface that counts as 0, in diagonals of the box.
pub(crate) const SURFACE_DISTANCE_TOLERANCE: f64 = 1e-12;
/// Maximum number of random points that are projected in search of start points.
pub(crate) const MAX_RANDOM_POINTS: usize = 4000;
/// Number of points of the surface from which the best start point is chosen.
pub(crate) const SEED_CANDIDATES: usize = 8;

/// Point of the surface at which a patch starts, with a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seed {
    pub(crate) point: Point3,
    /// Two orthogonal unit vectors of the tangent plane.
    pub(crate) tangents: [Point3; 2],
    /// Upper bound on the curvatures, |H|/|∇F| with the Frobenius norm.
    pub(crate) curvature: f64,
}

/// Generator of pseudo-random numbers from 0 to 1 (SplitMix64).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(
            seed.wrapping_mul(0xD134_2543_DE82_EF95)
                .wrapping_add(0x9E37_79B9_7F4A_7C15),
        )
    }
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    pub(crate) fn place(&mut self, region: &Aabb) -> Point3 {
        std::array::from_fn(|k| region.lo[k] + self.next() * (region.hi[k] - region.lo[k]))
    }
}

/// Returns the point to which Newton's method along the gradient leads; `None` if it does not reach
/// the surface.
pub(crate) fn project(field: &dyn Field, from: Point3, scale: f64) -> Option<Point3> {
    let (mut p, mut last) = (from, f64::INFINITY);
    for _ in 0..MAX_PROJECTION_STEPS {
        let j = field.jet(p);
        let g2 = dot(j.g, j.g);
        if j.v == 0.0 {
            return Some(p);
        }
        let step = j.v / g2;
        let length = step.abs() * g2.sqrt();
        if !length.is_finite() {
            return None;
        }
        // The linear model is not trusted for longer steps.
        let damped = step * (0.1 * scale / length).min(1.0);
        for k in 0..3 {
            p[k] -= damped * j.g[k];
        }
        if length <= SURFACE_DISTANCE_TOLERANCE * scale || has_stalled(length, last, scale) {
            return Some(p);
        }
        last = length;
    }
    None
}

/// Returns true if a step is short and no shorter than 0.9 times the last one, as by rounding in
/// boxes far from the origin; at self-intersections steps halve. With a larger bound than 1e-8
/// iterations would end before the surface, with a smaller one they would miss it in boxes a
/// million times as far away as they are large.
fn has_stalled(step: f64, last: f64, scale: f64) -> bool {
    step <= 1e-8 * scale && step >= 0.9 * last
}

/// Returns the point where the line p + t d meets the surface near t = 0; `None` if Newton's method
/// leaves |t| ≤ `reach`.
pub(crate) fn project_along(field: &dyn Field, p: Point3, d: Point3, reach: f64) -> Option<Point3> {
    let at = |t: f64| moved(p, t, d);
    let (mut t, mut last) = (0.0, f64::INFINITY);
    for _ in 0..MAX_PROJECTION_STEPS {
        let j = field.jet(at(t));
        if j.v == 0.0 {
            return Some(at(t));
        }
        let slope = dot(j.g, d);
        let step = j.v / slope;
        // The foot point is ill-conditioned if the line is nearly tangent to the surface.
        if !step.is_finite() || slope.abs() < 0.05 * norm(j.g) * norm(d) {
            return None;
        }
        t -= step;
        if t.abs() > reach {
            return None;
        }
        if step.abs() <= SURFACE_DISTANCE_TOLERANCE * reach || has_stalled(step.abs(), last, reach)
        {
            return Some(at(t));
        }
        last = step.abs();
    }
    None
}

/// Returns the frame of the principal directions at a point of the surface, rotated by an angle; an
/// error if the surface is singular there. Lines of curvature stay orthogonal farther away, so that a
/// patch along them has a small R.
pub(crate) fn frame(
    field: &dyn Field,
    point: Point3,
    angle: f64,
    scale: f64,
) -> Result<Seed, Error> {
    let j = field.jet(point);
    let (g, h) = (norm(j.g), frobenius(&j));
    if !g.is_finite() || !h.is_finite() {
        return Err(Error::NotFinite { at: point });
    }
    if g <= 1e-7 * h * scale || g == 0.0 {
        return Err(Error::Singular { at: point });
    }
    let n = j.g.map(|v| v / g);
    let [a, b] = orthonormal_complement(n);
    let (twist, difference) = (2.0 * form(&j, a, b), form(&j, a, a) - form(&j, b, b));
    // At an umbilic point principal directions are undefined.
    let principal = if twist.hypot(difference) > 1e-3 * h {
        0.5 * twist.atan2(difference)
    } else {
        0.0
    };
    let (s, c) = (principal + angle).sin_cos();
    let first = std::array::from_fn(|k| c * a[k] + s * b[k]);
    Ok(Seed {
        point,
        tangents: [first, cross(n, first)],
        curvature: h / g,
    })
}

/// Returns the Frobenius norm of the Hessian H.
fn frobenius(j: &Jet2) -> f64 {
    let all = (0..3).flat_map(|a| (0..3).map(move |b| (a, b)));
    all.map(|(a, b)| j.second(a, b).powi(2)).sum::<f64>().sqrt()
}

/// Returns uᵀHv.
fn form(j: &Jet2, u: Point3, v: Point3) -> f64 {
    let all = (0..3).flat_map(|i| (0..3).map(move |k| (i, k)));
    all.map(|(i, k)| u[i] * j.second(i, k) * v[k]).sum::<f64>()
}

/// Returns the larger normal curvature along the tangents of a seed, and its direction.
fn most_curved(field: &dyn Field, seed: &Seed) -> (f64, Point3) {
    let j = field.jet(seed.point);
    let along = |t: Point3| {
        let second = |i: usize| (0..3).map(|k| j.second(i, k) * t[k]).sum::<f64>();
        (0..3).map(|i| t[i] * second(i)).sum::<f64>().abs() / norm(j.g)
    };
    let [a, b] = seed.tangents.map(|t| (along(t), t));
    if a.0 >= b.0 { a } else { b }
}

/// Returns the point of a ridge near a point of the surface, where the largest curvature is maximal
/// along its own direction; `None` if that curvature is not much larger than at the point, or is
/// far from it.
///
/// A patch on a ridge must extend to both sides of it equally: started at one side, it could not
/// bend around it.
pub(crate) fn ridge(field: &dyn Field, point: Point3, scale: f64) -> Option<Point3> {
    let start = CurvedPoint::at(field, point, scale)?;
    // Longer steps, in radii of curvature or diagonals of the box, could pass over the ridge.
    let max_step = 0.25;
    let (mut at, mut share) = (start, max_step);
    for _ in 0..60 {
        let step = (share / at.curvature).min(max_step * scale);
        match at.more_curved(field, step, scale) {
            Some(next) => at = next,
            None if share < 1e-4 => break,
            None => share *= 0.5,
        }
    }
    let far = norm([0, 1, 2].map(|k| at.point[k] - point[k]));
    // Slightly more curvature does not hinder a patch, unless the radius is below a hundredth of
    // the diagonal. A ridge farther than 20 of its radii does not matter.
    let is_sharp = at.curvature > 2.0 * start.curvature || at.curvature * scale > 100.0;
    (is_sharp && far > 0.0 && far * at.curvature < 20.0).then_some(at.point)
}

/// Point of the surface with the largest normal curvature along its tangents, and its direction.
#[derive(Clone, Copy)]
struct CurvedPoint {
    point: Point3,
    curvature: f64,
    along: Point3,
}

impl CurvedPoint {
    fn at(field: &dyn Field, point: Point3, scale: f64) -> Option<Self> {
        let seed = frame(field, point, 0.0, scale).ok()?;
        let (curvature, along) = most_curved(field, &seed);
        Some(Self {
            point,
            curvature,
            along,
        })
    }

    /// Returns the point a step away on either side if the curvature is larger there.
    fn more_curved(&self, field: &dyn Field, step: f64, scale: f64) -> Option<Self> {
        [-step, step].into_iter().find_map(|s| {
            let p = moved(self.point, s, self.along);
            let there = Self::at(field, project(field, p, scale)?, scale)?;
            (there.curvature > self.curvature).then_some(there)
        })
    }
}

/// Returns the seed at the projection of a given point to the surface.
pub(crate) fn given(field: &dyn Field, near: Point3, region: &Aabb) -> Result<Seed, Error> {
    let scale = region.diagonal();
    if !field.value(near).is_finite() {
        return Err(Error::NotFinite { at: near });
    }
    let point = project(field, near, scale).ok_or(Error::FarSeed { at: near })?;
    if !contains(region, point) {
        return Err(Error::FarSeed { at: near });
    }
    frame(field, point, 0.0, scale)
}

/// Returns the k-th seed: of several random points of the surface the one with the smallest
/// curvature, at a random angle. If the control stops the search, returns the best so far, or an
/// error if there is none.
pub(crate) fn chosen(
    field: &dyn Field,
    k: u64,
    region: &Aabb,
    control: &Control<'_>,
) -> Result<Seed, Error> {
    let (mut random, scale) = (Random::new(k), region.diagonal());
    let (mut best, mut found): (Option<Seed>, usize) = (None, 0);
    let mut singular = None;
    for _ in 0..MAX_RANDOM_POINTS {
        if control.is_stopped() {
            return best.ok_or(Error::Stopped);
        }
        let place = random.place(region);
        let Some(point) = project(field, place, scale).filter(|p| contains(region, *p)) else {
            continue;
        };
        match frame(field, point, std::f64::consts::TAU * random.next(), scale) {
            Ok(seed) => {
                found += 1;
                if best.is_none_or(|b| seed.curvature < b.curvature) {
                    best = Some(seed);
                }
            }
            Err(error) => singular = Some(error),
        }
        if found == SEED_CANDIDATES {
            break;
        }
    }
    best.ok_or(singular.unwrap_or(Error::NoSurface))
}
