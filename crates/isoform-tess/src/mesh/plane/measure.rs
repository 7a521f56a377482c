//! The measure by which a triangulation of parameters is told about the surface.

use crate::mesh::names::{ClassId, ImageId, Node};
use crate::surface::Point3;

/// The conditions on edges and triangles.
pub(in crate::mesh) trait Measure {
    /// The image of a node.
    fn image(&self, node: &Node) -> Point3;
    /// The image that it shares with other nodes.
    fn shared(&self, node: &Node) -> Option<Shared>;
    /// The value of the map.
    fn at(&self, at: [f64; 2]) -> Point3;
    /// The point of a contracted curve beside the middle of a chord of it, with this image.
    fn beside_chord(&self, chord: [[f64; 2]; 2], image: ImageId) -> Option<[f64; 2]>;
    /// Whether the surface leaves a contracted curve in directions that are far from each other at
    /// three places of it.
    fn turns(&self, at: [[f64; 2]; 3]) -> bool;
    /// The step in the parameters that brings the image nearest to a point, to first order.
    fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]>;
    /// The derivatives by the parameters.
    fn tangents(&self, at: [f64; 2]) -> [Point3; 2];
    /// Whether the pole curve is proved to miss a triangle.
    fn is_sound(&self, at: [[f64; 2]; 3]) -> bool;
    /// The largest distance from the surface, near to a point.
    fn tolerance(&self, near: Point3) -> f64;
    /// The largest length of edges.
    fn longest(&self) -> f64;
}

/// An image that several parameters have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mesh) enum Shared {
    /// Of a contracted curve.
    Contracted(ImageId),
    /// A point of the double curve.
    Double(ClassId),
}
