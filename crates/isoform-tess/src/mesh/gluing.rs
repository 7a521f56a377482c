//! Gluing of sheets that cross: every vertex on the double curve gets vertices at all its partners,
//! the other parameters with its image.
//!
//! The curve is traversed piece by piece: arcs over slabs, segments of walls, sides of the unit
//! triangles. Special vertices (points of walls, rectangles around base points, pinch points) come
//! first, so that their partners are vertices, too; then the others.

mod isolated;
mod partners;
mod pieces;
mod settling;

use super::geometry::distance;
use super::names::{ClassId, Key, Name, Node, Ray};
use super::opening::Openings;
use super::sides::Sides;
use super::triangles::COINCIDENCE_DISTANCE;
use crate::double::Fibres;
use crate::finding::{Finding, Phase};
use crate::surface::{DoubleArc, Point3};
use pieces::{CurvePiece, CurvePieces};
use std::collections::{BTreeMap, BTreeSet};

/// Curve in the drawing to which a piece of the double curve belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Track {
    /// An arc, by quadrant, slab, and place in it.
    Arc(usize, usize, usize),
    /// A wall, by quadrant, index, and point of it.
    Wall(usize, usize, usize),
    /// A side, by line and sign, and number of the interval on it.
    Side(usize, i64, usize),
    /// A seam that covers its image twice: base point, number of the interval.
    Seam(usize, usize),
}

/// Ratio of the distance from its neighbours on a piece within which a vertex is left out to the
/// distance of coincident vertices.
pub(super) const CROWDING_FACTOR: f64 = 8.0;
/// Distance up to which two images are identified, in half widths of the box. Newton's method
/// brings partners ten times closer, and sheets nearer than this cannot be distinguished.
const SAME_IMAGE_DISTANCE: f64 = 1e-9;

/// A vertex between a rectangle and a seam: its class and parameters.
type SpokeVertex = (ClassId, [f64; 2]);

/// Classes of vertices that are one in space, and the pieces along which they were found.
#[derive(Default)]
pub(super) struct Gluing {
    /// Class of each vertex on the double curve.
    classes: BTreeMap<Key, Name>,
    images: Vec<Point3>,
    /// A parameter (s : t : w) of each class.
    parameters: Vec<[f64; 3]>,
    /// Classes in which sheets meet; the others join the border of a fundamental domain.
    meeting: BTreeSet<ClassId>,
    /// Vertices of arcs and walls between their ends, and of sides.
    lines: BTreeMap<Track, Vec<[f64; 2]>>,
    /// Vertices between rectangles and seams, starting at the rectangle.
    spokes: BTreeMap<(usize, Ray, [u64; 2]), Vec<SpokeVertex>>,
    points: Vec<(usize, [f64; 2])>,
    /// Chords of a traced double curve, with their unit triangles.
    pub(super) chords: Vec<(usize, [Node; 2])>,
    pub(super) arcs: Vec<DoubleArc>,
    /// True if the gluing was stopped before it had arcs.
    pub(super) is_stopped: bool,
    pub(super) findings: Vec<Finding>,
}

impl Gluing {
    /// Returns true if any vertices have been given partners.
    pub(super) fn is_anything_joined(&self) -> bool {
        !self.classes.is_empty()
    }
    /// Returns the name that a vertex shares with its partners.
    pub(super) fn name(&self, key: &Key) -> Option<Name> {
        self.classes.get(key).copied()
    }
    /// Returns the isolated points of the double curve in a unit triangle; they become vertices.
    pub(super) fn points(&self, q: usize) -> impl Iterator<Item = [f64; 2]> {
        self.points.iter().filter(move |p| p.0 == q).map(|p| p.1)
    }
    pub(super) fn image(&self, class: ClassId) -> Point3 {
        self.images[class.0]
    }
    /// Creates a class of vertices, from their image and one of their parameters.
    fn new_class(&mut self, image: Point3, parameter: [f64; 3]) -> ClassId {
        self.images.push(image);
        self.parameters.push(parameter);
        ClassId(self.images.len() - 1)
    }
    /// Creates a class of vertices in which sheets meet.
    pub(super) fn add_class(&mut self, image: Point3, parameter: [f64; 3]) -> ClassId {
        let class = self.new_class(image, parameter);
        self.meeting.insert(class);
        class
    }
    pub(super) fn name_class(&mut self, key: Key, class: ClassId) {
        self.classes.insert(key, Name::Double(class));
    }
    pub(super) fn set_line(&mut self, track: Track, line: Vec<[f64; 2]>) {
        self.lines.insert(track, line);
    }
    /// Returns true if sheets meet in a class.
    pub(super) fn is_double(&self, class: ClassId) -> bool {
        self.meeting.contains(&class)
    }
    pub(super) fn line(&self, track: Track) -> Option<&Vec<[f64; 2]>> {
        self.lines.get(&track)
    }
    pub(super) fn spoke(&self, fan: usize, ray: Ray, ring: [f64; 2]) -> &[SpokeVertex] {
        self.spokes
            .get(&(fan, ray, ring.map(f64::to_bits)))
            .map_or(&[], Vec::as_slice)
    }
    /// Stops the gluing; existing classes are kept.
    pub(super) fn stop(&mut self) {
        self.is_stopped = true;
        self.findings.push(Finding::Stopped(Phase::Partners));
    }
}

impl Openings<'_> {
    /// Finds the vertices of the double curve and their partners, and adds places to double sides
    /// of the unit triangles.
    pub(super) fn glue(
        &self,
        sides: &mut Sides,
        pinches: &[[f64; 3]],
        isolated: &[[f64; 3]],
        fibres: Option<&Fibres>,
    ) -> Gluing {
        let mut gluing = Gluing::default();
        let mut pieces = CurvePieces::new(self, sides);
        pieces.add_pinches(pinches);
        for fixed in [true, false] {
            if !pieces.join_all(fixed, &mut gluing) {
                gluing.stop();
                return gluing;
            }
        }
        pieces.settle(&mut gluing, sides, fibres);
        self.join_isolated(&mut gluing, isolated, sides);
        gluing
    }
}

impl CurvePieces<'_> {
    /// Gives classes to all vertices without one, either to the fixed or to the other ones. Returns
    /// false if stopped.
    fn join_all(&mut self, fixed: bool, gluing: &mut Gluing) -> bool {
        for k in 0..self.pieces.len() {
            let mut j = 0;
            while j < self.pieces[k].knots.len() {
                let knot = &self.pieces[k].knots[j];
                if knot.class.is_none() && knot.fixed == fixed {
                    if !fixed && self.is_crowded(&self.pieces[k], j) {
                        self.pieces[k].knots.remove(j);
                        continue;
                    }
                    let class = gluing.new_class(knot.image, knot.parameter);
                    self.join(k, j, class);
                }
                j += 1;
                if self.open.atlas.control.is_stopped() {
                    return false;
                }
            }
        }
        true
    }

    /// Returns true if a vertex nearly coincides with one next to it, so that it is better left
    /// out.
    fn is_crowded(&self, piece: &CurvePiece, j: usize) -> bool {
        let near = |k: usize| {
            piece.knots.get(k).is_some_and(|other| {
                distance(other.image, piece.knots[j].image)
                    < CROWDING_FACTOR * COINCIDENCE_DISTANCE * self.open.atlas.half_width
            })
        };
        near(j.wrapping_sub(1)) || near(j + 1)
    }
}
