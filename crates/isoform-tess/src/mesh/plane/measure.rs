//! Queries about the surface by which a triangulation of parameters is refined.

use crate::mesh::names::{ClassId, ImageId, Node};
use crate::surface::Point3;

/// Conditions on edges and triangles, and queries about the surface.
pub(in crate::mesh) trait Measure {
    /// Returns the image of a node.
    fn image(&self, node: &Node) -> Point3;
    /// Returns the image that a node shares with other nodes, if any.
    fn shared(&self, node: &Node) -> Option<Shared>;
    /// Returns the value of the map.
    fn at(&self, at: [f64; 2]) -> Point3;
    /// Returns the point of a contracted curve with a given image on the perpendicular bisector of
    /// a chord.
    fn beside_chord(&self, chord: [[f64; 2]; 2], image: ImageId) -> Option<[f64; 2]>;
    /// Returns true if the surface leaves a contracted curve in directions that differ much between
    /// three places of it.
    fn turns(&self, at: [[f64; 2]; 3]) -> bool;
    /// Returns the step in the parameters that brings the image nearest to a point, to first order.
    fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]>;
    /// Returns the derivatives by the parameters.
    fn tangents(&self, at: [f64; 2]) -> [Point3; 2];
    /// Returns true if the pole curve provably misses a triangle.
    fn is_sound(&self, at: [[f64; 2]; 3]) -> bool;
    /// Returns the maximum distance from the surface near a point.
    fn tolerance(&self, near: Point3) -> f64;
    /// Returns the maximum length of edges.
    fn longest(&self) -> f64;
}

/// Image that several parameters have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mesh) enum Shared {
    /// The image of a contracted curve.
    Contracted(ImageId),
    /// A point of the double curve.
    Double(ClassId),
}
