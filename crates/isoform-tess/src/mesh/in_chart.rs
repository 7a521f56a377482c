//! The map on a unit triangle, in the form needed by refinement.

use super::glued::Glued;
use super::names::{ImageId, Name, Node};
use super::plane::{Measure, Shared};
use crate::surface::Point3;

/// Implementation of [`Measure`] for the triangles of one unit triangle.
pub(super) struct InChart<'a, 'b> {
    pub(super) glued: &'a Glued<'b>,
    pub(super) q: usize,
}

impl Measure for InChart<'_, '_> {
    fn image(&self, node: &Node) -> Point3 {
        match self.glued.names(self.q, node)[1] {
            Name::Image(k) => self.glued.curves.image(k),
            Name::Double(k) => self.glued.gluing.image(k),
            _ => self.glued.atlas.image(self.q, node.at, node.faces),
        }
    }
    fn shared(&self, node: &Node) -> Option<Shared> {
        match self.glued.names(self.q, node)[1] {
            Name::Image(k) => Some(Shared::Contracted(k)),
            Name::Double(k) => Some(Shared::Double(k)),
            _ => None,
        }
    }
    fn at(&self, at: [f64; 2]) -> Point3 {
        self.glued.atlas.charts[self.q].at(at)
    }
    fn beside_chord(&self, chord: [[f64; 2]; 2], image: ImageId) -> Option<[f64; 2]> {
        self.glued.atlas.charts[self.q].beside_chord(chord, self.glued.curves.image(image))
    }
    fn turns(&self, at: [[f64; 2]; 3]) -> bool {
        self.glued.atlas.charts[self.q].turns(at)
    }
    fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]> {
        self.glued.atlas.charts[self.q].step(at, to)
    }
    fn tangents(&self, at: [f64; 2]) -> [Point3; 2] {
        let [_, by_u, by_v] = self.glued.atlas.charts[self.q].tangents(at);
        [by_u, by_v]
    }
    fn is_sound(&self, at: [[f64; 2]; 3]) -> bool {
        self.glued.atlas.charts[self.q].keeps_sign(at, 0)
    }
    fn tolerance(&self, near: Point3) -> f64 {
        self.glued.atlas.tolerance_at(near)
    }
    fn longest(&self) -> f64 {
        self.glued.atlas.options.longest
    }
}
