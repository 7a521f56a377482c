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

/// Removes superfluous points of a line (Douglas and Peucker 1973), without recursion: those
/// removed lie within the tolerance of the line.
///
/// ```
/// use isoform_geom::plane::simplified;
/// let line = [[0.0, 0.0], [1.0, 0.01], [2.0, 0.0], [2.0, 3.0]];
/// assert_eq!(simplified(&line, 0.1), [[0.0, 0.0], [2.0, 0.0], [2.0, 3.0]]);
/// ```
pub fn simplified(points: &[Point2], tolerance: f64) -> Vec<Point2> {
    let n = points.len();
    if n < 3 {
        return points.to_vec();
    }
    let mut keep = vec![false; n];
    keep[0] = true;
    keep[n - 1] = true;
    // A closed line has no chord; it is split in the middle.
    let mut open = if distance_squared(points[0], points[n - 1]).sqrt() < tolerance {
        keep[n / 2] = true;
        vec![(0, n / 2), (n / 2, n - 1)]
    } else {
        vec![(0, n - 1)]
    };
    while let Some((i, j)) = open.pop() {
        let off = |k: usize| from_chord(points[k], [points[i], points[j]]);
        let far = (i + 1..j).max_by(|a, b| off(*a).total_cmp(&off(*b)));
        if let Some(k) = far.filter(|k| off(*k) > tolerance) {
            keep[k] = true;
            open.extend([(i, k), (k, j)]);
        }
    }
    (0..n).filter(|i| keep[*i]).map(|i| points[i]).collect()
}

/// Returns the distance of a point from a chord.
fn from_chord(p: Point2, chord: [Point2; 2]) -> f64 {
    let lifted = |[x, y]: [f64; 2]| [x, y, 0.0];
    crate::distance_to_segment(lifted(p), chord.map(lifted))
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

    #[test]
    fn a_closed_line_stays_closed() {
        let ring: Vec<[f64; 2]> = (0..=40)
            .map(|i| f64::from(i % 40) * std::f64::consts::TAU / 40.0)
            .map(|t| [t.cos(), t.sin()])
            .collect();
        let few = simplified(&ring, 0.02);
        assert!(
            few.len() > 8 && few.len() < 40 && few[0] == few[few.len() - 1],
            "{few:?}"
        );
    }
}
