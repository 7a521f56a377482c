//! Polynomials in local coordinates.

use crate::Polynomial;
use isoform_geom::{Aabb, Expansion, Field, Point3, Terms};
use isoform_num::{Interval, Jet2, Jet3, Real};

/// Polynomial in local coordinates q of the points p = origin + unit q. Far from the origin, or in
/// a large or small unit, it preserves the digits that terms in p would lose.
///
/// ```
/// use isoform_field::{Placed, Polynomial};
/// use isoform_geom::Field;
/// // A ball of radius 2 about (10⁶, 0, 0): 1 − q².
/// let ball = Polynomial::new([([0, 0, 0], 1.0), ([2, 0, 0], -1.0), ([0, 2, 0], -1.0), ([0, 0, 2], -1.0)]);
/// let ball = Placed::new(ball, [1e6, 0.0, 0.0], 2.0);
/// assert_eq!(ball.value([1e6, 2.0, 0.0]), 0.0);
/// assert_eq!(ball.jet([1e6, 2.0, 0.0]).g, [0.0, -1.0, 0.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    polynomial: Polynomial,
    origin: Point3,
    unit: f64,
}

impl Placed {
    /// Creates a polynomial in (p − `origin`)/`unit`.
    pub fn new(polynomial: Polynomial, origin: Point3, unit: f64) -> Self {
        Self {
            polynomial,
            origin,
            unit,
        }
    }

    /// Returns the polynomial in local coordinates.
    pub fn polynomial(&self) -> &Polynomial {
        &self.polynomial
    }

    fn within(&self, p: Point3) -> Point3 {
        std::array::from_fn(|k| (p[k] - self.origin[k]) / self.unit)
    }

    /// Returns intervals that contain a box in local coordinates.
    fn all_within(&self, region: Aabb) -> [Interval; 3] {
        std::array::from_fn(|k| {
            let at = Interval::new(region.lo[k], region.hi[k]);
            (at - Interval::constant(self.origin[k])) / Interval::constant(self.unit)
        })
    }

    fn jet_of(&self, j: Jet2) -> Jet2 {
        j.in_units(1.0 / self.unit)
    }
}

impl Field for Placed {
    fn value(&self, p: Point3) -> f64 {
        self.polynomial.value(self.within(p))
    }
    fn jet(&self, p: Point3) -> Jet2 {
        self.jet_of(self.polynomial.jet(self.within(p)))
    }
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        let points: Vec<Point3> = points.iter().map(|p| self.within(*p)).collect();
        self.polynomial.jets(&points, out);
        out.iter_mut().for_each(|j| *j = self.jet_of(*j));
    }
    fn bounds(&self, region: Aabb) -> Interval {
        self.polynomial
            .bounds(Aabb::spanned(self.all_within(region)))
    }
    fn jet3(&self, p: Point3) -> Option<Jet3> {
        let jet = self.polynomial.jet3(self.within(p))?;
        Some(jet.in_units(1.0 / self.unit))
    }
    fn expansion(&self, at: Point3, region: Aabb) -> Option<Expansion> {
        // The local coordinates of the point are intervals: the expansion about a point nearby is
        // moved to them.
        let place = self.all_within(Aabb { lo: at, hi: at });
        let near = place.map(|i| 0.5 * i.lo() + 0.5 * i.hi());
        let off = std::array::from_fn(|k| place[k] - Interval::constant(near[k]));
        let e = self
            .polynomial
            .expansion(near, Aabb::spanned(self.all_within(region)))?;
        let unit = Interval::constant(1.0) / Interval::constant(self.unit);
        Some(e.moved(off).in_units(unit))
    }
    fn terms(&self) -> Option<Terms<'_>> {
        Some(Terms {
            origin: self.origin,
            unit: self.unit,
            ..Field::terms(&self.polynomial)?
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a cubic about (10, −20, 5) in units of 3, and its formula in space.
    fn both() -> (Placed, impl Fn(Point3) -> f64) {
        let terms = [
            ([3, 0, 0], 1.0),
            ([1, 1, 0], -2.0),
            ([0, 0, 2], 0.5),
            ([0, 0, 0], -0.25),
        ];
        let placed = Placed::new(Polynomial::new(terms), [10.0, -20.0, 5.0], 3.0);
        let formula = |p: Point3| {
            let [x, y, z] = [(p[0] - 10.0) / 3.0, (p[1] + 20.0) / 3.0, (p[2] - 5.0) / 3.0];
            x * x * x - 2.0 * x * y + 0.5 * z * z - 0.25
        };
        (placed, formula)
    }

    #[test]
    fn derivatives_are_those_in_space() {
        let (f, formula) = both();
        let (p, h) = ([11.0, -18.5, 4.0], 1e-4);
        let jet = f.jet(p);
        assert!((jet.v - formula(p)).abs() < 1e-14);
        for k in 0..3 {
            let moved = |s: f64| {
                let mut q = p;
                q[k] += s * h;
                formula(q)
            };
            assert!(((moved(1.0) - moved(-1.0)) / (2.0 * h) - jet.g[k]).abs() < 1e-8);
        }
    }

    #[test]
    fn what_is_proved_holds() {
        let (f, formula) = both();
        let at = [11.0, -18.5, 4.0];
        let region = Aabb {
            lo: at.map(|v| v - 0.2),
            hi: at.map(|v| v + 0.2),
        };
        let e = f.expansion(at, region).expect("an expansion");
        for corner in 0..8 {
            let off: Point3 = std::array::from_fn(|k| 0.2 * [-1.0, 1.0][corner >> k & 1]);
            let q: Point3 = std::array::from_fn(|k| at[k] + off[k]);
            let moved = e.moved(off.map(Interval::constant));
            assert!((moved.value + Interval::new(-1e-13, 1e-13)).contains(formula(q)));
            assert!(moved.value.hi() - moved.value.lo() < 1e-6);
            assert!(f.bounds(region).contains(formula(q)));
        }
    }
}
