//! Points, vectors and boxes.

use isoform_num::Interval;

/// Point or vector in space: x, y, z.
pub type Point3 = [f64; 3];

/// Returns a · b.
pub fn dot(a: Point3, b: Point3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns a × b.
pub fn cross(a: Point3, b: Point3) -> Point3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Returns two unit vectors u, v such that u, v and the unit vector n are a right-handed
/// orthonormal basis.
///
/// ```
/// use isoform_geom::{cross, orthonormal_complement};
///
/// let n = [0.6, 0.0, 0.8];
/// let [u, v] = orthonormal_complement(n);
/// assert!((0..3).all(|k| (cross(u, v)[k] - n[k]).abs() < 1e-15));
/// ```
pub fn orthonormal_complement(n: Point3) -> [Point3; 2] {
    let axis = (0..3)
        .min_by(|a, b| n[*a].abs().total_cmp(&n[*b].abs()))
        .unwrap_or(0);
    let mut e = [0.0; 3];
    e[axis] = 1.0;
    let e1 = cross(n, e);
    let e1 = e1.map(|v| v / norm(e1));
    [e1, cross(n, e1)]
}

/// Returns a − b.
pub fn sub(a: Point3, b: Point3) -> Point3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns |a|.
pub fn norm(a: Point3) -> f64 {
    dot(a, a).sqrt()
}

/// Returns the distance of a point from a segment, whose ends may coincide.
pub fn distance_to_segment(p: Point3, [a, b]: [Point3; 2]) -> f64 {
    let (d, e) = (sub(b, a), sub(p, a));
    let d2 = dot(d, d);
    let t = if d2 > 0.0 {
        (dot(d, e) / d2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    norm(std::array::from_fn(|i| e[i] - t * d[i]))
}

/// Returns |a − b|².
pub fn distance_squared(a: Point3, b: Point3) -> f64 {
    dot(sub(a, b), sub(a, b))
}

/// Returns point k of a low-discrepancy sequence on a triangle: Roberts' sequence in the square (of
/// the plastic number), mapped by the square-root map.
pub fn on_triangle(k: u32, corners: [Point3; 3]) -> Point3 {
    let (r, s) = (
        (0.5 + 0.754_877_666_246_693 * f64::from(k)).fract().sqrt(),
        (0.5 + 0.569_840_290_998_053 * f64::from(k)).fract(),
    );
    let weights = [1.0 - r, r * (1.0 - s), r * s];
    std::array::from_fn(|i| {
        weights[0] * corners[0][i] + weights[1] * corners[1][i] + weights[2] * corners[2][i]
    })
}

/// Returns the mean of N points: their sum, in order, divided by N.
///
/// ```
/// use isoform_geom::middle;
///
/// assert_eq!(middle([[0.0, 0.0, 0.0], [1.0, 2.0, 4.0]]), [0.5, 1.0, 2.0]);
/// ```
#[inline]
pub fn middle<const N: usize>(points: [Point3; N]) -> Point3 {
    std::array::from_fn(|i| points.iter().map(|p| p[i]).sum::<f64>() / N as f64)
}

/// Axis-aligned box; empty if a lower bound exceeds the upper one.
///
/// ```
/// use isoform_geom::Aabb;
///
/// let b = Aabb::from_points(&[[0.0, 0.0, 0.0], [1.0, 2.0, 2.0]]);
/// assert_eq!((b.center(), b.diagonal()), ([0.5, 1.0, 1.0], 3.0));
/// assert!(Aabb::EMPTY.is_empty() && !b.is_empty());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub lo: Point3,
    /// Upper corner.
    pub hi: Point3,
}

impl Aabb {
    /// Empty box: lower bounds ∞, upper bounds −∞.
    pub const EMPTY: Self = Self {
        lo: [f64::INFINITY; 3],
        hi: [f64::NEG_INFINITY; 3],
    };

    /// Returns the smallest box around the points.
    pub fn from_points<'a>(points: impl IntoIterator<Item = &'a Point3>) -> Self {
        let mut b = Self::EMPTY;
        for p in points {
            b.add(*p);
        }
        b
    }
    /// Returns the product of three intervals.
    pub fn spanned(sides: [Interval; 3]) -> Self {
        Self {
            lo: sides.map(|s| s.lo()),
            hi: sides.map(|s| s.hi()),
        }
    }
    /// Returns the intervals of x, y and z.
    pub fn sides(&self) -> [Interval; 3] {
        std::array::from_fn(|k| Interval::new(self.lo[k], self.hi[k]))
    }
    /// Extends the box to contain `p`.
    pub fn add(&mut self, p: Point3) {
        for (i, v) in p.into_iter().enumerate() {
            self.lo[i] = self.lo[i].min(v);
            self.hi[i] = self.hi[i].max(v);
        }
    }
    /// Returns true if the box is empty.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|i| self.lo[i] > self.hi[i])
    }
    /// Returns the edge lengths; 0 for the empty box.
    pub fn size(&self) -> Point3 {
        std::array::from_fn(|i| (self.hi[i] - self.lo[i]).max(0.0))
    }
    /// Returns the centre.
    pub fn center(&self) -> Point3 {
        std::array::from_fn(|i| 0.5 * self.lo[i] + 0.5 * self.hi[i])
    }
    /// Returns the box extended by a length on each side.
    #[must_use]
    pub fn widened(&self, by: f64) -> Self {
        Self {
            lo: self.lo.map(|v| v - by),
            hi: self.hi.map(|v| v + by),
        }
    }
    /// Returns the parameters at which a ray enters and leaves the box; the ray misses the box, or
    /// lies in a face, if the second is less. `inverse` is the [`inverse_direction`] of the ray.
    ///
    /// ```
    /// use isoform_geom::{Aabb, inverse_direction};
    /// let unit = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
    /// let along_x = inverse_direction([1.0, 0.0, -0.0]);
    /// assert_eq!(unit.crossing([-2.0, 0.5, 0.5], along_x), [2.0, 3.0]);
    /// let [enter, leave] = unit.crossing([-2.0, 1.5, 0.5], along_x);
    /// assert!(leave < enter);
    /// ```
    pub fn crossing(&self, from: Point3, inverse: Point3) -> [f64; 2] {
        let mut range = [f64::NEG_INFINITY, f64::INFINITY];
        for k in 0..3 {
            let (p, q) = (
                (self.lo[k] - from[k]) * inverse[k],
                (self.hi[k] - from[k]) * inverse[k],
            );
            range = [range[0].max(p.min(q)), range[1].min(p.max(q))];
        }
        range
    }
    /// Returns the length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        norm(self.size())
    }
}

/// Returns the inverses of the components of a direction, kept finite: a direction along an axis
/// never leaves the slabs of the others.
pub fn inverse_direction(d: Point3) -> Point3 {
    let away_from_zero = |v: f64| match v.abs() < 1e-200 {
        true => 1e-200_f64.copysign(v),
        false => v,
    };
    d.map(|v| 1.0 / away_from_zero(v))
}

/// Checks the points of a search structure.
///
/// # Panics
/// If there are 2³² points or more, or a coordinate is not finite.
pub(crate) fn check_points(points: &[Point3]) {
    assert!(
        u32::try_from(points.len()).is_ok(),
        "too many points for 32-bit indices"
    );
    assert!(
        points.iter().flatten().all(|v| v.is_finite()),
        "coordinates must be finite"
    );
}
