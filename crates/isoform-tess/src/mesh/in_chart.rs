//! What refinement is told about the map on a unit triangle.

use super::plane::{Measure, Shared};
use super::{Builder, Name, Node};
use crate::surface::Point3;

/// What the triangles of one unit triangle have to be like.
pub(super) struct InChart<'a, 'b> {
    pub(super) builder: &'a Builder<'b>,
    pub(super) q: usize,
}

impl Measure for InChart<'_, '_> {
    fn image(&self, node: &Node) -> Point3 {
        match self.builder.merged(self.q, node) {
            Name::Image(k) => self.builder.images[k],
            Name::Double(k) => self.builder.gluing.image(k),
            _ => self.builder.atlas.image(self.q, node.at, node.faces),
        }
    }
    fn shared(&self, node: &Node) -> Option<Shared> {
        match self.builder.merged(self.q, node) {
            Name::Image(k) => Some(Shared::Contracted(k)),
            Name::Double(k) => Some(Shared::Double(k)),
            _ => None,
        }
    }
    fn at(&self, at: [f64; 2]) -> Point3 {
        self.builder.atlas.charts[self.q].at(at)
    }
    fn beside_chord(&self, chord: [[f64; 2]; 2], image: usize) -> Option<[f64; 2]> {
        self.builder.atlas.charts[self.q].beside_chord(chord, self.builder.images[image])
    }
    fn turns(&self, at: [[f64; 2]; 3]) -> bool {
        self.builder.atlas.charts[self.q].turns(at)
    }
    fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]> {
        self.builder.atlas.charts[self.q].step(at, to)
    }
    fn tangents(&self, at: [f64; 2]) -> [Point3; 2] {
        let [_, by_u, by_v] = self.builder.atlas.charts[self.q].tangents(at);
        [by_u, by_v]
    }
    fn is_sound(&self, at: [[f64; 2]; 3]) -> bool {
        self.builder.atlas.charts[self.q].keeps_sign(at, 0)
    }
    fn tolerance(&self, near: Point3) -> f64 {
        self.builder.atlas.tolerance_at(near)
    }
    fn longest(&self) -> f64 {
        self.builder.atlas.options.longest
    }
}
