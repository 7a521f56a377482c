//! Shapes of triangles and edges of the parameters in space, and their distances from the surface.

use super::{Measure, NO_TRIANGLE, Plane, Shared};
use crate::mesh::geometry::{distance, middle};
use crate::mesh::names::{ImageId, Name};
use crate::surface::Point3;
use isoform_geom::{cross, dot, norm, sub};

/// Minimum distance of the foot of a perpendicular, in the parameters, from the ends of an edge,
/// relative to its length; half of it is the minimum distance from the corners of a triangle.
const END_MARGIN: f64 = 0.25;
/// Minimum cosine of the angle between the normals of a triangle and of the surface.
pub(super) const MIN_NORMAL_COSINE: f64 = 0.3;
/// Minimum ratio of the smaller to the larger of the areas of a triangle and of the surface over
/// it: parameters that are nearly collinear may give a good triangle in space that covers no part
/// of the surface.
const MIN_AREA_RATIO: f64 = 0.2;
/// Quality of a triangle that covers no part of the surface.
pub(super) const EMPTY_QUALITY: f64 = -2.0;

/// Shape of a triangle in space.
#[derive(Clone, Copy, Debug)]
pub(super) struct TriangleShape {
    pub(super) corners: [u32; 3],
    /// Sine of its smallest angle; negative if its normal or area differs too much from that of the
    /// surface.
    pub(super) quality: f64,
    /// True if the parameters are even on the triangle: the centre of the parameters is mapped to
    /// about the centre in space.
    is_even: bool,
    /// Cosine of the angle between the normals of the triangle and of the surface in its centre.
    pub(super) facing: f64,
}

/// Returns the sine of the smallest angle of a triangle; negative if it has no area or a corner
/// without a position.
pub(super) fn least_sine([p, q, r]: [Point3; 3]) -> f64 {
    let (x, y, z) = (sub(q, p), sub(r, q), sub(p, r));
    let [mut a, mut b, c] = [x, y, z].map(|e| dot(e, e));
    // The smallest angle is between the two longer edges.
    let shortest = a.min(b).min(c);
    if shortest == a {
        a = c;
    } else if shortest == b {
        b = c;
    }
    let twice = cross(x, y);
    let sine = (dot(twice, twice) / (a * b)).sqrt();
    if sine.is_nan() || shortest == 0.0 {
        -1.0
    } else {
        sine
    }
}

/// Returns the cosine of the angle between the normals of a triangle and of the surface in its
/// centre, and the ratio of the smaller to the larger of their areas; 1 where the surface has no
/// normal.
fn facing([a, b, c]: [[f64; 2]; 3], [p, q, r]: [Point3; 3], measure: &dyn Measure) -> [f64; 2] {
    let [x, y] = measure.tangents([0, 1].map(|i| (a[i] + b[i] + c[i]) / 3.0));
    let normal = cross(x, y);
    let own = cross(sub(q, p), sub(r, p));
    let (n, m) = (norm(own), norm(normal));
    let area = m * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    let (cosine, share) = (dot(own, normal) / (n * m), (n / area).min(area / n));
    [cosine, share].map(|x| if x.is_nan() { 1.0 } else { x })
}

/// Returns true if the normal or the area of a triangle differs too much from that of the surface.
pub(in crate::mesh) fn is_turned(
    at: [[f64; 2]; 3],
    images: [Point3; 3],
    measure: &dyn Measure,
) -> bool {
    let [facing, share] = facing(at, images, measure);
    facing < MIN_NORMAL_COSINE || share < MIN_AREA_RATIO
}

/// Returns the barycentric coordinates of a point in a triangle of either orientation.
fn shares(z: [f64; 2], [a, b, c]: [[f64; 2]; 3]) -> [f64; 3] {
    let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let whole = area(a, b, c);
    [area(b, c, z), area(c, a, z), area(a, b, z)].map(|x| x / whole)
}

/// Returns parameters in `within`, by Newton steps from given ones, whose image is nearer to a
/// point, unless that is within the tolerance already; and the distance.
fn nearest(
    mut at: [f64; 2],
    to: Point3,
    within: &dyn Fn([f64; 2]) -> bool,
    measure: &dyn Measure,
) -> ([f64; 2], f64) {
    let mut error = distance(measure.at(at), to);
    // Newton steps to the closest point of the surface.
    for _ in 0..3 {
        if error <= measure.tolerance(to) {
            break;
        }
        let Some(step) = measure.step(at, to) else {
            break;
        };
        let better = [1.0, 0.5, 0.25].into_iter().find_map(|share| {
            let next = [0, 1].map(|i| at[i] + share * step[i]);
            let off = distance(measure.at(next), to);
            (within(next) && off < error).then_some((next, off))
        });
        let Some(better) = better else { break };
        let is_enough = better.1 > 0.7 * error;
        (at, error) = better;
        if is_enough {
            break;
        }
    }
    (at, error)
}

impl Plane {
    pub(super) fn least_sine(&self, t: [u32; 3]) -> f64 {
        least_sine(t.map(|v| self.images[v as usize]))
    }
    /// Returns the shape of a triangle that may or may not exist.
    pub(super) fn shape_of(&self, t: [u32; 3], measure: &dyn Measure) -> TriangleShape {
        let [facing, share] = facing(self.places(t), t.map(|v| self.images[v as usize]), measure);
        let worst = (facing - MIN_NORMAL_COSINE).min(share - MIN_AREA_RATIO);
        let quality = match worst {
            // The triangle covers no part of the surface; flips never create one.
            _ if share < 0.02 => EMPTY_QUALITY,
            _ if worst < 0.0 => worst,
            _ => self.least_sine(t),
        };
        TriangleShape {
            corners: t,
            quality,
            // Ratio of areas above which the parameters count as even on a triangle.
            is_even: facing > MIN_NORMAL_COSINE && share > 0.5,
            facing,
        }
    }
    /// Returns the shape of an existing triangle, which is computed once.
    pub(super) fn shape(&self, t: u32, measure: &dyn Measure) -> TriangleShape {
        let known = self.shapes[t as usize].get();
        known.unwrap_or_else(|| {
            let shape = self.shape_of(self.triangles[t as usize], measure);
            self.shapes[t as usize].set(Some(shape));
            shape
        })
    }

    /// Returns the excess of the edge between two vertices, above 1 if it is to be split, and the
    /// place of the split: the middle of its parameters or, if these are even, the parameters in
    /// the adjacent triangles whose image is nearest to the middle of the edge.
    pub(super) fn excess(
        &self,
        [a, b]: [u32; 2],
        beside: [TriangleShape; 2],
        measure: &dyn Measure,
    ) -> (f64, [f64; 2]) {
        let [x, y] = [a, b].map(|v| self.nodes[v as usize].at);
        let [p, q] = [a, b].map(|v| self.images[v as usize]);
        let from = [0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])];
        let is_even = beside.iter().all(|shape| shape.is_even);
        let within = |z: [f64; 2]| {
            is_even
                && beside
                    .iter()
                    .any(|shape| self.is_beside([a, b], shape.corners, z))
        };
        let chord = middle(p, q);
        let (at, error) = nearest(from, chord, &within, measure);
        let excess = (error / measure.tolerance(chord)).max(distance(p, q) / measure.longest());
        match error.is_nan() {
            true => (f64::INFINITY, at),
            false => (excess, at),
        }
    }
    /// Returns true if a place in a triangle is next to the middle of an edge, away from its ends
    /// and from the opposite corner.
    fn is_beside(&self, ends: [u32; 2], corners: [u32; 3], z: [f64; 2]) -> bool {
        let shares = shares(z, self.places(corners));
        (0..3).all(|k| match ends.contains(&corners[k]) {
            true => shares[k] >= END_MARGIN,
            false => (0.0..=END_MARGIN).contains(&shares[k]),
        })
    }
    /// Returns the distance of the centre of a triangle from the surface, in tolerances.
    pub(super) fn off(&self, shape: &TriangleShape, measure: &dyn Measure) -> f64 {
        let at = self.places(shape.corners);
        let [p, q, r] = shape.corners.map(|v| self.images[v as usize]);
        let from = [0, 1].map(|i| (at[0][i] + at[1][i] + at[2][i]) / 3.0);
        let center = std::array::from_fn(|i| (p[i] + q[i] + r[i]) / 3.0);
        let within =
            |z: [f64; 2]| shape.is_even && shares(z, at).iter().all(|&s| s >= 0.5 * END_MARGIN);
        nearest(from, center, &within, measure).1 / measure.tolerance(center)
    }

    pub(super) fn have_one_image(&self, [a, b]: [u32; 2]) -> bool {
        self.shared[a as usize].is_some() && self.shared[a as usize] == self.shared[b as usize]
    }
    /// Returns true if both ends are on the double curve, or one has a shared image and the other
    /// is on a side of the unit triangle: another sheet, or the unit triangle beyond the side, may
    /// have an edge with these ends, too.
    pub(super) fn is_ambiguous(&self, [a, b]: [u32; 2]) -> bool {
        let is_double = |v: u32| matches!(self.shared[v as usize], Some(Shared::Double(_)));
        let is_side = |v: u32| {
            self.shared[v as usize].is_none() && self.nodes[v as usize].name != Name::Inner
        };
        let is_shared = |v: u32| self.shared[v as usize].is_some();
        is_double(a) && is_double(b) || is_side(a) && is_shared(b) || is_side(b) && is_shared(a)
    }
    /// Returns the place at which to split the edge opposite to corner i if it is a chord of a
    /// contracted curve that leaves the triangle too little room: the area between the chord and
    /// the curve is turned over.
    pub(super) fn bulge(
        &self,
        t: u32,
        i: usize,
        measure: &dyn Measure,
    ) -> Option<([f64; 2], ImageId)> {
        let [a, b] = self.ends(t, i);
        let is_inner = self.fixed[t as usize][i] && self.adjacent[t as usize][i] != NO_TRIANGLE;
        let Some(Shared::Contracted(image)) =
            self.shared[a as usize].filter(|_| is_inner && self.have_one_image([a, b]))
        else {
            return None;
        };
        let [x, y, z] = self.places([a, b, self.triangles[t as usize][i]]);
        let m = measure.beside_chord([x, y], image)?;
        let above = |z: [f64; 2]| twice_area([x, y, z]);
        // A contracted curve may bulge beyond its chord by a fifth of the height of the triangle.
        (above(m) > 0.2 * above(z)).then_some((m, image))
    }
}

/// Returns twice the area of a triangle of the parameters.
#[inline]
pub(super) fn twice_area([x, y, z]: [[f64; 2]; 3]) -> f64 {
    ((y[0] - x[0]) * (z[1] - x[1]) - (y[1] - x[1]) * (z[0] - x[0])).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The smallest angle of the triangle with sides 3, 4, 5 has the sine 3/5, that of an
    /// equilateral one √3/2; without area or with NaN, the value is not positive.
    #[test]
    fn smallest_angles() {
        let sine = |x: f64, y: f64| least_sine([[0.0; 3], [4.0, 0.0, 0.0], [x, y, 0.0]]);
        assert!((sine(4.0, 3.0) - 0.6).abs() < 1e-15);
        assert!((sine(2.0, 12f64.sqrt()) - 0.75f64.sqrt()).abs() < 1e-15);
        assert_eq!(sine(2.0, 0.0), 0.0);
        assert_eq!([sine(0.0, 0.0), sine(f64::NAN, 1.0)], [-1.0; 2]);
    }

    #[test]
    fn shares_are_barycentric() {
        let t = [[1.0, 0.0], [3.0, 1.0], [2.0, 4.0]];
        for (a, b) in [(0.25, 0.5), (1.0, 0.0), (-1.0, 1.5)] {
            let c = 1.0 - a - b;
            let z = [0, 1].map(|i| a * t[0][i] + b * t[1][i] + c * t[2][i]);
            let found = shares(z, t);
            for (x, y) in found.into_iter().zip([a, b, c]) {
                assert!((x - y).abs() < 1e-14, "{found:?}");
            }
        }
    }
}
