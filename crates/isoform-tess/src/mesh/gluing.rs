//! Where sheets that cross are joined: every vertex on the double curve gets vertices at all its
//! partners, the other parameters with the same image.
//!
//! The curve is walked through piece by piece: arcs over slabs, stretches of walls, sides of the
//! unit triangles. What is special there (points of walls, rectangles around base points, pinch
//! points) comes first, so that its partners are vertices, too; then the rest.

mod isolated;
mod partners;
mod pieces;
mod settling;

use super::closing::UPON;
use super::geometry::distance;
use super::names::{ClassId, Key, Name, Node, Ray};
use super::opening::Openings;
use super::sides::Sides;
use crate::double::Fibres;
use crate::finding::{Finding, Phase};
use crate::surface::{DoubleArc, Point3};
use pieces::{Piece, Pieces};
use std::collections::{BTreeMap, BTreeSet};

/// The curve in the drawing to which a piece of the double curve belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Track {
    /// Quadrant, slab, place in it.
    Arc(usize, usize, usize),
    /// Quadrant, wall, point of it.
    Wall(usize, usize, usize),
    /// Side and sign, number of the stretch on it.
    Side(usize, i64, usize),
    /// A seam that runs twice through its points: base point, number of the stretch.
    Seam(usize, usize),
}

/// The distance from its neighbours on a piece within which a vertex is left out, per distance at
/// which vertices lie upon each other.
pub(super) const CROWDED: f64 = 8.0;
/// The distance up to which two images are one, per half width of the box: Newton's method brings
/// partners closer by a digit, and sheets that are nearer than this are no two sheets.
const CLOSE: f64 = 1e-9;

/// A vertex between a rectangle and a seam: its class and parameters.
type SpokeVertex = (ClassId, [f64; 2]);

/// The gluing: classes of vertices that are one in space.
#[derive(Default)]
pub(super) struct Gluing {
    /// The class of each vertex on the double curve.
    classes: BTreeMap<Key, Name>,
    images: Vec<Point3>,
    /// A parameter (s : t : w) of each class.
    parameters: Vec<[f64; 3]>,
    /// The classes in which sheets meet: others join the border of a fundamental domain.
    meeting: BTreeSet<ClassId>,
    /// Vertices of arcs and walls between their ends, and of sides.
    lines: BTreeMap<Track, Vec<[f64; 2]>>,
    /// Vertices between rectangles and seams, from the rectangle on.
    spokes: BTreeMap<(usize, Ray, [u64; 2]), Vec<SpokeVertex>>,
    points: Vec<(usize, [f64; 2])>,
    /// Chords of a double curve that was traced, by unit triangles.
    pub(super) chords: Vec<(usize, [Node; 2])>,
    pub(super) arcs: Vec<DoubleArc>,
    /// Whether it was given up before there were arcs.
    pub(super) is_stopped: bool,
    pub(super) findings: Vec<Finding>,
}

impl Gluing {
    /// Whether any vertices have been given partners.
    pub(super) fn is_anything_joined(&self) -> bool {
        !self.classes.is_empty()
    }
    /// The name of a vertex that it shares with its partners.
    pub(super) fn name(&self, key: &Key) -> Option<Name> {
        self.classes.get(key).copied()
    }
    /// Isolated points of the double curve that are vertices, in a unit triangle.
    pub(super) fn points(&self, q: usize) -> impl Iterator<Item = [f64; 2]> {
        self.points.iter().filter(move |p| p.0 == q).map(|p| p.1)
    }
    pub(super) fn image(&self, class: ClassId) -> Point3 {
        self.images[class.0]
    }
    /// A new class of vertices: their image, and one of their parameters.
    fn new_class(&mut self, image: Point3, parameter: [f64; 3]) -> ClassId {
        self.images.push(image);
        self.parameters.push(parameter);
        ClassId(self.images.len() - 1)
    }
    /// A new class of vertices in which sheets meet.
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
    /// Whether sheets meet in a class.
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
    /// Gives up: what is joined so far is left as it is.
    pub(super) fn stop(&mut self) {
        self.is_stopped = true;
        self.findings.push(Finding::Stopped(Phase::Partners));
    }
}

impl Openings<'_> {
    /// Finds the vertices of the double curve and their partners. Sides of the unit triangles that
    /// are double get their places.
    pub(super) fn glue(
        &self,
        sides: &mut Sides,
        pinches: &[[f64; 3]],
        isolated: &[[f64; 3]],
        fibres: Option<&Fibres>,
    ) -> Gluing {
        let mut gluing = Gluing::default();
        let mut pieces = Pieces::new(self, sides);
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

impl Pieces<'_> {
    /// Gives classes to all vertices that have none, those that are fixed or the other ones. False
    /// if that is stopped.
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

    /// Whether a vertex lies upon one of those next to it, so that it is better left out.
    fn is_crowded(&self, piece: &Piece, j: usize) -> bool {
        let near = |k: usize| {
            piece.knots.get(k).is_some_and(|other| {
                distance(other.image, piece.knots[j].image)
                    < CROWDED * UPON * self.open.atlas.half_width
            })
        };
        near(j.wrapping_sub(1)) || near(j + 1)
    }
}
