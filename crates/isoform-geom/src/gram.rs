//! Gram matrices of two vectors: the 2 × 2 systems of Gauss–Newton steps.
//!
//! The least-squares solution of x u + y v = r, and the combination of two gradients u and v with
//! given products u·d = e and v·d = f, both lead to the symmetric system
//!
//! ```text
//! | u·u  u·v | |x|   |e|
//! | u·v  v·v | |y| = |f|
//! ```
//!
//! which Cramer's rule solves.

use crate::{Point3, dot};

/// Gram matrix ((uu, uv), (uv, vv)) of the inner products of two vectors.
///
/// ```
/// use isoform_geom::Gram;
///
/// // 2 u + 3 v = (2, 5, 0) for u = (1, 1, 0), v = (0, 1, 0); what is normal to both is left out.
/// let (u, v) = ([1.0, 1.0, 0.0], [0.0, 1.0, 0.0]);
/// assert_eq!(Gram::from_vectors(u, v).shares(u, v, [2.0, 5.0, 7.0]), [2.0, 3.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gram {
    /// Product u·u.
    pub uu: f64,
    /// Product u·v.
    pub uv: f64,
    /// Product v·v.
    pub vv: f64,
}

impl Gram {
    /// Returns the Gram matrix of two vectors.
    #[inline]
    #[must_use]
    pub fn from_vectors(u: Point3, v: Point3) -> Self {
        Self {
            uu: dot(u, u),
            uv: dot(u, v),
            vv: dot(v, v),
        }
    }

    /// Returns uu vv − uv² = |u × v|², up to rounding: it may be negative if u and v are nearly
    /// parallel.
    #[inline]
    #[must_use]
    pub fn determinant(&self) -> f64 {
        self.uu * self.vv - self.uv * self.uv
    }

    /// Returns true if sin² of the angle between u and v exceeds `share`; false if a product is
    /// NaN.
    #[inline]
    #[must_use]
    pub fn is_regular(&self, share: f64) -> bool {
        self.determinant() > share * self.uu * self.vv
    }

    /// Returns the solution (x, y) of the system with the right-hand side (e, f); it is not finite
    /// if the determinant is 0.
    #[inline]
    #[must_use]
    pub fn solve(&self, right: [f64; 2]) -> [f64; 2] {
        self.solve_over(self.determinant(), right)
    }

    /// Returns the solution with the determinant raised to at least the smallest normal number: if
    /// u and v are parallel, it is very long instead of infinite. Use it for steps whose length is
    /// limited afterwards.
    #[inline]
    #[must_use]
    pub fn solve_bounded(&self, right: [f64; 2]) -> [f64; 2] {
        self.solve_over(self.determinant().max(f64::MIN_POSITIVE), right)
    }

    #[inline]
    fn solve_over(&self, determinant: f64, [e, f]: [f64; 2]) -> [f64; 2] {
        [
            (self.vv * e - self.uv * f) / determinant,
            (self.uu * f - self.uv * e) / determinant,
        ]
    }

    /// Returns the (x, y) for which x u + y v is nearest to r, where u and v are the vectors of the
    /// matrix.
    #[inline]
    #[must_use]
    pub fn shares(&self, u: Point3, v: Point3, r: Point3) -> [f64; 2] {
        self.solve([dot(u, r), dot(v, r)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{cross, norm, sub};

    const U: Point3 = [1.0, -0.5, 2.0];
    const V: Point3 = [0.3, 1.5, -0.25];

    #[test]
    fn the_determinant_is_the_square_of_an_area() {
        let area = norm(cross(U, V));
        assert!((Gram::from_vectors(U, V).determinant() - area * area).abs() < 1e-13);
    }

    /// Checks that the residual of r is normal to both vectors.
    #[test]
    fn shares_leave_the_normal_part() {
        let r = [0.7, 0.1, -3.0];
        let [x, y] = Gram::from_vectors(U, V).shares(U, V, r);
        let rest = sub(r, std::array::from_fn(|k| x * U[k] + y * V[k]));
        assert!(dot(rest, U).abs() < 1e-14 && dot(rest, V).abs() < 1e-14);
    }

    /// Checks the combination of two gradients with given products.
    #[test]
    fn solutions_have_the_products_that_were_asked_for() {
        let [x, y] = Gram::from_vectors(U, V).solve([0.4, -0.9]);
        let d: Point3 = std::array::from_fn(|k| x * U[k] + y * V[k]);
        assert!((dot(U, d) - 0.4).abs() < 1e-14 && (dot(V, d) + 0.9).abs() < 1e-14);
    }

    #[test]
    fn parallel_vectors_are_not_regular() {
        let parallel = Gram::from_vectors(U, U.map(|x| -2.0 * x));
        assert!(!parallel.is_regular(1e-12) && Gram::from_vectors(U, V).is_regular(1e-12));
        assert!(!Gram::from_vectors([f64::NAN; 3], V).is_regular(0.0));
        let zero = Gram::from_vectors([0.0; 3], [0.0; 3]);
        assert_eq!(zero.solve_bounded([0.0; 2]), [0.0; 2]);
        assert!(zero.solve([0.0; 2])[0].is_nan());
    }
}
