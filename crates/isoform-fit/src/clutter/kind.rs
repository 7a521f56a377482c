//! Kinds of clutter.

/// Reason why a point does not belong to the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClutterKind {
    /// Points on a plane that has the other points on one side and extends beyond them.
    Plane,
    /// Points in a connected component other than the largest one.
    Apart,
    /// Outliers: points in a component of a few points; or, in scans with many such, isolated or
    /// off the plane of their neighbours.
    Stray,
}
