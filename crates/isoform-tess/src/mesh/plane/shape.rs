//! Triangles and edges of the parameters as they are in space: their shapes, and how far they are
//! from the surface.

use super::{Measure, NONE, Plane, Shared};
use crate::mesh::geometry::{distance, middle};
use crate::mesh::names::{ImageId, Name};
use crate::surface::Point3;
use isoform_geom::{cross, dot, norm, sub};

/// Newton steps to the closest point of the surface.
const NEARER: usize = 3;
/// The distance of the parameters of that point from the ends of an edge, in shares; from the
/// corners of a triangle half as far.
const MARGIN: f64 = 0.25;
/// The least cosine between the normals of a triangle and of the surface.
pub(super) const FACING: f64 = 0.3;
/// The least share of the smaller of the areas of a triangle and of the surface over it in the
/// larger: points of the parameters that lie nearly on a line may be a fine triangle in space, but
/// one that stands for nothing.
const SHARE: f64 = 0.2;
/// The share of areas above which the parameters count as even on a triangle.
const EVEN: f64 = 0.5;
/// The share of areas below which a triangle covers none of the surface; flips never make one.
const EMPTY: f64 = 0.02;
/// The quality of such a triangle.
pub(super) const NOTHING: f64 = -2.0;
/// The most that contracted curves may bulge beyond their chords by, per height of the triangles
/// beside them.
const BULGE: f64 = 0.2;

/// The shape of a triangle in space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) corners: [u32; 3],
    /// The sine of its smallest angle; below zero if it does not face the way the surface does, or
    /// has another area.
    pub(super) quality: f64,
    /// Whether the parameters are even on it: what is in the middle there is about in the middle in
    /// space.
    is_even: bool,
    /// The cosine of the angle between the normals of the triangle and of the surface in its
    /// middle.
    pub(super) facing: f64,
}

/// The sine of the smallest angle of a triangle; negative if it has no area or no position.
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

/// The cosine of the angle between the normals of a triangle and of the surface in its middle, and
/// the share of the smaller of their areas in the larger; 1 where the surface has no normal.
fn facing([a, b, c]: [[f64; 2]; 3], [p, q, r]: [Point3; 3], measure: &dyn Measure) -> [f64; 2] {
    let [x, y] = measure.tangents([0, 1].map(|i| (a[i] + b[i] + c[i]) / 3.0));
    let normal = cross(x, y);
    let own = cross(sub(q, p), sub(r, p));
    let (n, m) = (norm(own), norm(normal));
    let area = m * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    let (cosine, share) = (dot(own, normal) / (n * m), (n / area).min(area / n));
    [cosine, share].map(|x| if x.is_nan() { 1.0 } else { x })
}

/// Whether a triangle does not face the way the surface does, or has another area.
pub(in crate::mesh) fn is_turned(
    at: [[f64; 2]; 3],
    images: [Point3; 3],
    measure: &dyn Measure,
) -> bool {
    let [facing, share] = facing(at, images, measure);
    facing < FACING || share < SHARE
}

/// The shares of the corners of a triangle, of either orientation, in a point: its barycentric
/// coordinates.
fn shares(z: [f64; 2], [a, b, c]: [[f64; 2]; 3]) -> [f64; 3] {
    let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let whole = area(a, b, c);
    [area(b, c, z), area(c, a, z), area(a, b, z)].map(|x| x / whole)
}

/// From given parameters, others in `within` with an image that is nearer to a point, if that is
/// farther than the tolerance; and the distance.
fn nearest(
    mut at: [f64; 2],
    to: Point3,
    within: &dyn Fn([f64; 2]) -> bool,
    measure: &dyn Measure,
) -> ([f64; 2], f64) {
    let mut error = distance(measure.at(at), to);
    for _ in 0..NEARER {
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
    /// The shape of a triangle that may be there or not.
    pub(super) fn shape_of(&self, t: [u32; 3], measure: &dyn Measure) -> Shape {
        let [facing, share] = facing(self.places(t), t.map(|v| self.images[v as usize]), measure);
        let worst = (facing - FACING).min(share - SHARE);
        let quality = match worst {
            _ if share < EMPTY => NOTHING,
            _ if worst < 0.0 => worst,
            _ => self.least_sine(t),
        };
        Shape {
            corners: t,
            quality,
            is_even: facing > FACING && share > EVEN,
            facing,
        }
    }
    /// The shape of a triangle that is there, computed once.
    pub(super) fn shape(&self, t: u32, measure: &dyn Measure) -> Shape {
        let known = self.shapes[t as usize].get();
        known.unwrap_or_else(|| {
            let shape = self.shape_of(self.triangles[t as usize], measure);
            self.shapes[t as usize].set(Some(shape));
            shape
        })
    }

    /// The excess of the edge between two vertices, beyond 1 if it is to be split, and the place of
    /// the split: in the middle of its parameters, or, if these are even, at parameters in the
    /// triangles beside it whose image is nearest to the middle of the edge.
    pub(super) fn excess(
        &self,
        [a, b]: [u32; 2],
        beside: [Shape; 2],
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
    /// Whether a place in a triangle is beside the middle of an edge, away from its ends and from
    /// the corner opposite.
    fn is_beside(&self, ends: [u32; 2], corners: [u32; 3], z: [f64; 2]) -> bool {
        let shares = shares(z, self.places(corners));
        (0..3).all(|k| match ends.contains(&corners[k]) {
            true => shares[k] >= MARGIN,
            false => (0.0..=MARGIN).contains(&shares[k]),
        })
    }
    /// The distance of the middle of a triangle from the surface, in tolerances.
    pub(super) fn off(&self, shape: &Shape, measure: &dyn Measure) -> f64 {
        let at = self.places(shape.corners);
        let [p, q, r] = shape.corners.map(|v| self.images[v as usize]);
        let from = [0, 1].map(|i| (at[0][i] + at[1][i] + at[2][i]) / 3.0);
        let center = std::array::from_fn(|i| (p[i] + q[i] + r[i]) / 3.0);
        let within =
            |z: [f64; 2]| shape.is_even && shares(z, at).iter().all(|&s| s >= 0.5 * MARGIN);
        nearest(from, center, &within, measure).1 / measure.tolerance(center)
    }

    pub(super) fn have_one_image(&self, [a, b]: [u32; 2]) -> bool {
        self.shared[a as usize].is_some() && self.shared[a as usize] == self.shared[b as usize]
    }
    /// Whether both ends are on the double curve, or one has a shared image and the other is on a
    /// side of the unit triangle: another sheet, or the unit triangle beyond the side, may have
    /// such an edge, too.
    pub(super) fn is_ambiguous(&self, [a, b]: [u32; 2]) -> bool {
        let is_double = |v: u32| matches!(self.shared[v as usize], Some(Shared::Double(_)));
        let is_side = |v: u32| {
            self.shared[v as usize].is_none() && self.nodes[v as usize].name != Name::Inner
        };
        let is_shared = |v: u32| self.shared[v as usize].is_some();
        is_double(a) && is_double(b) || is_side(a) && is_shared(b) || is_side(b) && is_shared(a)
    }
    /// Where the edge opposite to corner i is to be split, because it is a chord of a contracted
    /// curve that leaves the triangle too little room: what lies between the chord and the curve is
    /// turned over.
    pub(super) fn bulge(
        &self,
        t: u32,
        i: usize,
        measure: &dyn Measure,
    ) -> Option<([f64; 2], ImageId)> {
        let [a, b] = self.ends(t, i);
        let is_inner = self.fixed[t as usize][i] && self.adjacent[t as usize][i] != NONE;
        let Some(Shared::Contracted(image)) =
            self.shared[a as usize].filter(|_| is_inner && self.have_one_image([a, b]))
        else {
            return None;
        };
        let [x, y, z] = self.places([a, b, self.triangles[t as usize][i]]);
        let m = measure.beside_chord([x, y], image)?;
        let above = |z: [f64; 2]| twice_area([x, y, z]);
        (above(m) > BULGE * above(z)).then_some((m, image))
    }
}

/// Twice the area of a triangle of the parameters, without its sign.
#[inline]
pub(super) fn twice_area([x, y, z]: [[f64; 2]; 3]) -> f64 {
    ((y[0] - x[0]) * (z[1] - x[1]) - (y[1] - x[1]) * (z[0] - x[0])).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the triangle with sides 3, 4, 5 the smallest angle has the sine 3/5; of an equilateral
    /// one √3/2; what has no area or no number is negative or zero.
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
