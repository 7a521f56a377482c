//! Points and vectors of the plane; the functions have the names of those of space: `plane::dot`,
//! `plane::cross`, …
//!
//! Results are rounded. Decisions on topology use the exact predicates of the crate `robust`
//! instead.

/// Point or vector of the plane: x, y, or parameters u, v.
pub type Point2 = [f64; 2];

/// Returns a · b.
#[inline]
pub fn dot(a: Point2, b: Point2) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Returns a₀ b₁ − a₁ b₀, the signed area of the parallelogram: positive if b is to the left of a.
#[inline]
pub fn cross(a: Point2, b: Point2) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Returns a − b.
#[inline]
pub fn sub(a: Point2, b: Point2) -> Point2 {
    [a[0] - b[0], a[1] - b[1]]
}

/// Returns |a − b|².
#[inline]
pub fn distance_squared(a: Point2, b: Point2) -> f64 {
    let d = sub(a, b);
    dot(d, d)
}

/// Returns the vector rotated to the left by a right angle.
#[inline]
pub fn left(a: Point2) -> Point2 {
    [-a[1], a[0]]
}

/// Returns twice the signed area of a triangle, rounded: positive if it is counterclockwise.
///
/// ```
/// use isoform_geom::plane;
///
/// assert_eq!(plane::orient([0.0, 0.0], [2.0, 0.0], [0.0, 3.0]), 6.0);
/// assert_eq!(plane::orient([0.0, 0.0], [0.0, 3.0], [2.0, 0.0]), -6.0);
/// ```
#[inline]
pub fn orient(a: Point2, b: Point2, c: Point2) -> f64 {
    cross(sub(b, a), sub(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks Lagrange's identity (a·b)² + (a × b)² = |a|² |b|².
    #[test]
    fn products_of_two_vectors() {
        let (a, b) = ([3.0, -1.5], [0.25, 2.0]);
        let squares = dot(a, b).powi(2) + cross(a, b).powi(2);
        assert_eq!(squares, dot(a, a) * dot(b, b));
        assert_eq!(cross(a, b), dot(left(a), b));
        assert_eq!(distance_squared(a, b), dot(sub(a, b), sub(a, b)));
    }
}
