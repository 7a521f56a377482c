//! Names of vertices: a vertex on a side, a seam, a contracted or a double curve belongs to several
//! unit triangles, or to several parameters of one, and has one name in all of them.

use super::places::{side_of, sides_of};
use crate::fan::Key as DirectionKey;

/// Image of contracted curves: an index into the images of `SpecialCurves`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ImageId(pub(super) usize);

/// Class of vertices that are one in space: an index into the classes of `Gluing`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ClassId(pub(super) usize);

/// A direction of a fan, by its key, with true if it is backward.
pub(super) type Ray = (DirectionKey, bool);

/// A name of a vertex on which both triangles at a side agree. The sides s = 0, t = 0, w = 0 are
/// named by the sign of t, s, s t, and a place along them by its bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Name {
    Inner,
    /// A vertex on a side, by line, sign, and the bits of its place along it.
    Side(usize, i64, u64),
    /// The origin, (1 : 0 : 0) or (0 : 1 : 0).
    Corner(usize),
    /// The image of a contracted curve.
    Image(ImageId),
    /// A vertex on the seam of a base point, in a direction.
    Seam(usize, DirectionKey),
    /// A vertex on a ray of a base point, counted from the rectangle.
    Ray(usize, Ray, usize),
    /// A vertex in which sheets meet.
    Double(ClassId),
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) at: [f64; 2],
    pub(super) name: Name,
    /// Faces of the box on which it lies, as bits.
    pub(super) faces: u8,
    /// Image of the contracted curve on which it lies, if any.
    pub(super) image: Option<ImageId>,
    /// True for a base point, at which the map has no value.
    pub(super) apex: bool,
    /// Sides of the domain on which it lies, as bits.
    pub(super) borders: u64,
}

impl Node {
    pub(super) fn inner(at: [f64; 2], faces: u8) -> Self {
        Self {
            at,
            name: Name::Inner,
            faces,
            image: None,
            apex: false,
            borders: 0,
        }
    }
}

/// A name of a vertex, with the unit triangle and the place in it for vertices that have no other
/// name.
pub(super) type Key = (Name, usize, [u64; 2]);

pub(super) fn key(name: Name, q: usize, at: [f64; 2]) -> Key {
    match name {
        Name::Inner => (name, q, at.map(f64::to_bits)),
        name => (name, 0, [0; 2]),
    }
}

/// Returns the name of a place on a side.
pub(super) fn name_on(q: usize, side: usize, x: f64) -> Name {
    match (side, x) {
        (0 | 1, 0.0) => Name::Corner(0),
        (1 | 2, 1.0) => Name::Corner(1),
        (0, 1.0) | (2, 0.0) => Name::Corner(2),
        _ => Name::Side(side, sides_of(q)[side].1, x.to_bits()),
    }
}

/// Returns the name of a vertex with a parameter (s : t : w).
pub(super) fn name_of(q: usize, p: [f64; 3], at: [f64; 2]) -> Name {
    side_of(p, at).map_or(Name::Inner, |(side, x)| name_on(q, side, x))
}
