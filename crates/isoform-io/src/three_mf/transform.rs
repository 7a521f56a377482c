//! Affine maps of objects: (x y z 1) M for row vectors, as 3MF writes them.

use crate::input::parse_number;
use isoform_geom::{Point3, cross, dot};

/// Affine map, stored as the images of the axes and of the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    pub(super) axes: [Point3; 3],
    pub(super) origin: Point3,
}

impl Transform {
    /// Parses twelve numbers, row by row.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut words = text.split_ascii_whitespace();
        let mut row = || -> Option<Point3> {
            let mut row = [0.0; 3];
            for v in &mut row {
                *v = parse_number(words.next()?)?;
            }
            Some(row)
        };
        let axes = [row()?, row()?, row()?];
        let origin = row()?;
        words.next().is_none().then_some(Self { axes, origin })
    }

    /// Returns the image of a direction.
    fn turn(&self, v: Point3) -> Point3 {
        std::array::from_fn(|k| (0..3).map(|i| v[i] * self.axes[i][k]).sum())
    }

    /// Returns the image of a point.
    pub(super) fn apply(&self, p: Point3) -> Point3 {
        let turned = self.turn(p);
        std::array::from_fn(|k| turned[k] + self.origin[k])
    }

    /// Returns the composition of this map, applied first, with the other one.
    pub(super) fn then(&self, other: &Self) -> Self {
        Self {
            axes: self.axes.map(|v| other.turn(v)),
            origin: other.apply(self.origin),
        }
    }

    /// Returns true if the map reverses orientation.
    pub(super) fn is_mirror(&self) -> bool {
        let [x, y, z] = self.axes;
        dot(x, cross(y, z)) < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_images() {
        let turn = Transform::parse("0 1 0 -1 0 0 0 0 1 10 20 30").expect("twelve");
        assert_eq!(turn.apply([1.0, 2.0, 3.0]), [8.0, 21.0, 33.0]);
        let scale = Transform::parse("2 0 0 0 2 0 0 0 -2 1 0 0").expect("twelve");
        let both = turn.then(&scale);
        let p = [0.5, -1.0, 4.0];
        assert_eq!(both.apply(p), scale.apply(turn.apply(p)));
        assert!(scale.is_mirror() && both.is_mirror() && !turn.is_mirror());
        for bad in [
            "",
            "1 0 0 0 1 0 0 0 1 0 0",
            "1 0 0 0 1 0 0 0 1 0 0 0 0",
            "a b c",
        ] {
            assert_eq!(Transform::parse(bad), None, "{bad}");
        }
    }
}
