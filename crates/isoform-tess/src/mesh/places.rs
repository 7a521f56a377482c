//! Conversion of points of the projective parameter plane to places in the four unit triangles: the
//! point (s : t : w) is (u, v) with (s : t : w) = (±u : ±v : 1 − u − v), with the signs of the
//! quadrant.

use isoform_algebra::QUADRANTS;

/// Returns the place of a point (s : t : w) in the plane of the unit triangle of a quadrant, also
/// outside of the triangle.
pub(super) fn place_beside(quadrant: usize, p: [f64; 3]) -> [f64; 2] {
    let y = folded(quadrant, p);
    let sum: f64 = y.iter().sum();
    [y[0] / sum, y[1] / sum]
}
/// Returns the place of a point in the unit triangle, if it is in it.
pub(super) fn place_in(quadrant: usize, p: [f64; 3]) -> Option<[f64; 2]> {
    let y = folded(quadrant, p);
    let is_in = y.iter().all(|y| *y >= 0.0) || y.iter().all(|y| *y <= 0.0);
    is_in.then(|| place_beside(quadrant, p))
}
/// Returns the place of a point in the unit triangle, exactly on its side if a coordinate is 0.
pub(super) fn place_on(quadrant: usize, p: [f64; 3]) -> Option<[f64; 2]> {
    let at = place_in(quadrant, p)?;
    Some(side_of(p, at).map_or(at, |(side, x)| on_side(side, x)))
}
/// Returns the side of the unit triangles on which a point lies, and its place along it, given its
/// place in a triangle.
pub(super) fn side_of(p: [f64; 3], at: [f64; 2]) -> Option<(usize, f64)> {
    let side = p.iter().position(|&x| x == 0.0)?;
    Some((side, if side == 0 { at[1] } else { at[0] }))
}
/// Multiplies the coordinates by the signs of a quadrant.
pub(super) fn folded(quadrant: usize, p: [f64; 3]) -> [f64; 3] {
    let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
    [s * p[0], t * p[1], p[2]]
}

/// Returns (s : t : w) of a point of a unit triangle.
pub(super) fn in_plane(quadrant: usize, [u, v]: [f64; 2]) -> [f64; 3] {
    let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
    [s * u, t * v, 1.0 - u - v]
}

/// Returns the line and sign of the three sides u = 0, v = 0, u + v = 1 of a unit triangle.
pub(super) fn sides_of(quadrant: usize) -> [(usize, i64); 3] {
    let [s, t] = QUADRANTS[quadrant];
    [(0, t), (1, s), (2, s * t)]
}
/// Returns the point of the triangle at a place on a side.
pub(super) fn on_side(side: usize, x: f64) -> [f64; 2] {
    match side {
        0 => [0.0, x],
        1 => [x, 0.0],
        _ => [x, 1.0 - x],
    }
}

/// Returns the distance between two places.
pub(super) fn distance2(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
