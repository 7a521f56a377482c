//! Points, segments and triangles in space.

use crate::surface::Point3;
use isoform_geom::{norm, sub};

pub(super) fn middle(a: Point3, b: Point3) -> Point3 {
    std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
}
pub(super) fn distance(a: Point3, b: Point3) -> f64 {
    norm(sub(a, b))
}
/// Returns the length of the longest edge of a triangle.
pub(super) fn longest([p, q, r]: [Point3; 3]) -> f64 {
    distance(p, q).max(distance(q, r)).max(distance(r, p))
}
