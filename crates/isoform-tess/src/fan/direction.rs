//! Directions at a node, up to sign, and their rays.

use isoform_geom::plane::{cross, dot};

/// Name of a point of a seam: the index of its node, and the bits of its direction.
pub(crate) type Key = (usize, [u64; 2]);

/// A unit vector (a, b) in the local coordinates of a node, with b > 0 or b = 0 < a.
#[derive(Clone, Debug)]
pub(crate) struct Direction {
    pub(crate) node: usize,
    pub(crate) at: [f64; 2],
    /// Faces of the box that the seam crosses there, as bits.
    pub(crate) faces: u8,
    /// Indices of the factors of the region with this tangent.
    pub(crate) factors: Vec<usize>,
    /// Curvature of the ray: its point at a distance r is `bend` r² to the left of the direction.
    pub(super) bend: f64,
}

impl Direction {
    pub(super) fn new(node: usize, at: [f64; 2]) -> Self {
        let length = at[0].hypot(at[1]);
        let is_opposite = at[1] < 0.0 || (at[1] == 0.0 && at[0] < 0.0);
        let sign = if is_opposite { -1.0 } else { 1.0 };
        // Negative zeros would give one vertex two names.
        Self {
            node,
            at: at.map(|x| sign * x / length + 0.0),
            faces: 0,
            factors: Vec::new(),
            bend: 0.0,
        }
    }
    /// Returns the direction of a vector, with true if the vector is opposite to it.
    pub(super) fn of_vector(node: usize, x: [f64; 2]) -> (Self, bool) {
        let d = Self::new(node, x);
        let backward = dot(d.at, x) < 0.0;
        (d, backward)
    }
    /// Returns true if both directions are equal up to rounding.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        // The bound is well above the rounding of a direction. If it were larger, two tangents
        // would coincide; if it were smaller, one tangent found in two ways would become two.
        cross(self.at, other.at).abs() < 1e-12
    }
    pub(super) fn angle(&self) -> f64 {
        self.at[1].atan2(self.at[0])
    }
    /// Returns the name of the point of the seam.
    pub(crate) fn key(&self) -> Key {
        (self.node, self.at.map(f64::to_bits))
    }
    /// Returns the point of the ray at a distance, displaced to the left by `left`.
    pub(super) fn at_distance(&self, backward: bool, distance: f64, left: f64) -> [f64; 2] {
        let along = if backward { -distance } else { distance };
        let left = left + self.bend * distance * distance;
        self.beside(along, left)
    }
    /// Returns the point at a distance along the direction and another one to its left.
    pub(super) fn beside(&self, along: f64, left: f64) -> [f64; 2] {
        let [a, b] = self.at;
        [along * a - left * b, along * b + left * a]
    }
    /// Returns ± (a, b).
    pub(crate) fn signed(&self, backward: bool) -> [f64; 2] {
        if backward {
            self.at.map(|x| -x)
        } else {
            self.at
        }
    }
    /// Adds factors that have this tangent.
    pub(super) fn touch(&mut self, factors: &[usize]) {
        for f in factors {
            if !self.factors.contains(f) {
                self.factors.push(*f);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opposite_vectors_are_one_direction() {
        let [(d, forward), (e, backward)] =
            [[3.0, 4.0], [-3.0, -4.0]].map(|x| Direction::of_vector(0, x));
        assert_eq!((d.at, forward, backward), ([0.6, 0.8], false, true));
        assert_eq!(d.key(), e.key());
        assert_eq!(e.signed(true), [-0.6, -0.8]);
        let (west, backward) = Direction::of_vector(0, [-2.0, 0.0]);
        assert_eq!(
            west.key().1,
            [1f64, 0.0].map(f64::to_bits),
            "no negative zeros"
        );
        assert!(backward);
    }

    /// A `bend` of 1/2 along the x axis gives the parabola y = x²/2.
    #[test]
    fn rays_bend_to_the_left() {
        let mut d = Direction::new(0, [1.0, 0.0]);
        d.bend = 0.5;
        assert_eq!(d.at_distance(false, 2.0, 0.0), [2.0, 2.0]);
        assert_eq!(d.at_distance(true, 2.0, 1.0), [-2.0, 3.0]);
    }
}
