//! The complement of a solid, as a solid.

use crate::divided::negated;
use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::{Interval, Jet2};

/// Complement of a solid: all points where its function is negative or 0.
pub struct Complement<'a> {
    of: &'a dyn Solid,
    tree: Csg,
}

impl<'a> Complement<'a> {
    /// Creates the complement of a solid. Its pieces keep their names.
    pub fn new(of: &'a dyn Solid) -> Self {
        let tree = negated(of.tree(), 0);
        Self { of, tree }
    }
}

impl Solid for Complement<'_> {
    fn names(&self) -> &[String] {
        self.of.names()
    }
    fn tree(&self) -> &Csg {
        &self.tree
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        self.of.values(which, points, out);
        negate(out);
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        let (v, g) = self.of.gradient(piece, p);
        (-v, g.map(|x| -x))
    }
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        -self.of.jet(piece, p)
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        self.of.bounds(which, region, out);
        negate(out);
    }
    fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        self.of.value_bounds(which, region, out);
        negate(out);
    }
    fn slopes(&self, piece: u32, region: Aabb) -> Option<[Interval; 3]> {
        Some(self.of.slopes(piece, region)?.map(|slope| -slope))
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        self.of.sign_values(points, out);
        negate(out);
    }
}

fn negate<T: Copy + std::ops::Neg<Output = T>>(values: &mut [T]) {
    for value in values {
        *value = -*value;
    }
}
