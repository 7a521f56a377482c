//! First-order distances from pieces and solids, and their rounding.

use isoform_geom::{Aabb, Point3, Solid, norm};

/// Returns the first-order distance g/|∇g|.
pub(crate) fn first_order(g: f64, gradient: Point3) -> f64 {
    let n = norm(gradient);
    if n > 0.0 {
        g / n
    } else if g == 0.0 {
        0.0
    } else {
        g.signum() * f64::MAX
    }
}

/// Returns the distance below which values in a region are rounding errors.
pub(crate) fn zero_in(region: Aabb) -> f64 {
    let reach = region.lo.into_iter().chain(region.hi);
    let far = reach.fold(0.0, |far: f64, v| far.max(v.abs()));
    // A few roundings of the three coordinates count where the box is far from the origin.
    (1e-13 * region.diagonal()).max((8.0 * f64::EPSILON) * far)
}

/// Returns the first-order distance of a point from a piece.
pub(crate) fn first_order_at(solid: &dyn Solid, piece: u32, p: Point3) -> f64 {
    let (g, d) = solid.gradient(piece, p);
    first_order(g, d)
}

/// Returns the first-order distance of a point from a solid's surface, negative outside.
pub(crate) fn distance_at(solid: &dyn Solid, p: Point3) -> f64 {
    solid.tree().value(&|piece| first_order_at(solid, piece, p))
}
