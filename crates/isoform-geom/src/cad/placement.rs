//! Places of parts in an assembly.

use crate::brep::Axes;
use crate::{Point3, dot, sub};

/// Similarity that preserves orientation: p ↦ scale · R p + shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Rows of the rotation R.
    pub rotation: [Point3; 3],
    /// Factor of lengths, positive.
    pub scale: f64,
    /// Image of the origin.
    pub shift: Point3,
}

impl Placement {
    /// The identity.
    pub const IDENTITY: Self = Self {
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        scale: 1.0,
        shift: [0.0; 3],
    };

    /// Returns the motion that takes one frame to another.
    pub fn between(from: &Axes, to: &Axes) -> Self {
        let columns = |a: &Axes| [a.x, a.y(), a.z];
        let (source, target) = (columns(from), columns(to));
        let rotation = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| target[k][i] * source[k][j]).sum())
        });
        let turned = Self {
            rotation,
            ..Self::IDENTITY
        };
        Self {
            shift: sub(to.origin, turned.point(from.origin)),
            ..turned
        }
    }
    /// Returns the placement that scales about the origin.
    pub fn scaling(scale: f64) -> Self {
        Self {
            scale,
            ..Self::IDENTITY
        }
    }
    /// Returns the placement that applies `first` and then this one.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    (0..3)
                        .map(|k| self.rotation[i][k] * first.rotation[k][j])
                        .sum()
                })
            }),
            scale: self.scale * first.scale,
            shift: self.point(first.shift),
        }
    }
    /// Returns a rotated direction.
    pub fn direction(&self, d: Point3) -> Point3 {
        self.rotation.map(|row| dot(row, d))
    }
    /// Returns a rotated and scaled vector.
    pub fn vector(&self, d: Point3) -> Point3 {
        self.direction(d).map(|v| self.scale * v)
    }
    /// Returns the image of a point.
    pub fn point(&self, p: Point3) -> Point3 {
        let moved = self.vector(p);
        std::array::from_fn(|k| moved[k] + self.shift[k])
    }
    /// Returns the image of a frame, whose directions keep their lengths.
    pub fn axes(&self, axes: &Axes) -> Axes {
        Axes {
            origin: self.point(axes.origin),
            z: self.direction(axes.z),
            x: self.direction(axes.x),
        }
    }
}
