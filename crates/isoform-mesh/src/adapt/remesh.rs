//! Optimisation of bare triangles on a solid: splits, collapses, flips and moves that keep every
//! vertex on its pieces.
//!
//! Rounds of splitting long edges, collapsing short ones, flipping and moving first approach the
//! target edge lengths (`lengths`; Botsch and Kobbelt, A remeshing approach to multiresolution
//! modeling, 2004); later only operations that increase the smallest angle they affect are allowed
//! (`angles`).

mod angles;
mod lengths;

use super::skin::EditableSurface;
use crate::options::Options;
use crate::points::{centroid, midpoint, unique};
use crate::surface::{On, SKIN, Surface, meet_at_an_angle};
use isoform_control::Control;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Smallest sine of an angle that a collapse or move towards the target lengths may leave, unless
/// it was smaller before.
const MIN_COLLAPSE_SINE: f64 = 0.35;
/// Smallest cosine between the normals of a face and its piece; a face that was worse may stay but
/// not get worse.
const MIN_FACING_COSINE: f64 = 0.5;
/// Largest sagitta of an edge, as a fraction of its length, and of an edge along a curve, as a
/// fraction of the target size: equal to that of the optimiser of tetrahedra.
const MAX_RELATIVE_SAGITTA: f64 = 0.08;
/// Smallest gain of a mending operation, as a sine.
const MIN_SINE_GAIN: f64 = 1e-4;

/// Constraint on a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hold {
    Fixed,
    On(On),
}

/// Triangles being optimised, with the constraints on their vertices.
pub(super) struct Remesher<'s> {
    pub(super) skin: EditableSurface,
    hold: Vec<Hold>,
    surface: &'s Surface<'s>,
    options: &'s Options,
    control: &'s Control<'s>,
}

/// Midpoint of an edge, projected onto the surface.
struct Middle {
    at: Point3,
    /// Pieces that it lies on.
    on: On,
    /// Sagitta divided by the allowed one.
    excess: f64,
}

impl<'s> Remesher<'s> {
    pub(super) fn new(
        skin: EditableSurface,
        surface: &'s Surface<'s>,
        options: &'s Options,
        control: &'s Control<'s>,
    ) -> Self {
        let hold = vec![Hold::Fixed; skin.points.len()];
        let mut this = Self {
            skin,
            hold,
            surface,
            options,
            control,
        };
        for v in 0..this.hold.len() as u32 {
            this.hold[v as usize] = this.holding(v);
        }
        this
    }
}

impl Remesher<'_> {
    /// Runs the optimisation: sizes first, then angles.
    pub(super) fn run(&mut self) {
        // Rounds towards the target edge lengths.
        for round in 0..12 {
            if self.control.is_stopped() {
                return;
            }
            let mut done = self.split_long(false);
            done += self.collapse_short();
            done += self.flip_all();
            // Vertices move freely in the first two rounds, even where angles get worse.
            self.relax(round < 2);
            // The rounds end with fewer than one operation per hundred faces.
            if done * 100 < self.skin.faces.len() {
                break;
            }
        }
        self.mend();
        // Mending and splitting alternate.
        for _ in 0..6 {
            // Mending may have made edges that leave the surface.
            if self.control.is_stopped() || self.split_long(true) == 0 {
                break;
            }
            self.flip_all();
            self.mend();
        }
    }

    /// Determines the constraint on a vertex from the faces around it: its piece, the two pieces of
    /// the curve that runs through it, or fixed.
    fn holding(&self, v: u32) -> Hold {
        let faces = self.skin.around[v as usize].iter();
        let labels = unique(faces.map(|&f| self.skin.label_of(f)).collect());
        if let &[one] = labels.as_slice() {
            // Next to a tangential seam, the surface may be the adjacent piece instead.
            let p = self.skin.at(v);
            let is_off =
                self.surface.distance(one, p) != 0.0 || self.surface.distance(SKIN, p) != 0.0;
            return Hold::On(On::from_pieces(&[if is_off { SKIN } else { one }]));
        }
        let neighbours = self.skin.neighbours(v).into_iter();
        let sharp: Vec<[u32; 2]> = neighbours.filter_map(|w| self.sharp(v, w)).collect();
        match sharp.as_slice() {
            [] => Hold::On(On::from_pieces(&[SKIN])),
            [a, b] if a == b => Hold::On(On::from_pieces(a)),
            _ => Hold::Fixed,
        }
    }

    /// Returns the pieces on both sides of an edge that lies on an edge of the solid; `None` for
    /// other edges.
    fn sharp(&self, a: u32, b: u32) -> Option<[u32; 2]> {
        let sides = self.skin.sides(a, b)?.map(|f| self.skin.label_of(f));
        let pieces = [sides[0].min(sides[1]), sides[0].max(sides[1])];
        let middle = midpoint(self.skin.at(a), self.skin.at(b));
        (pieces[0] != pieces[1] && meet_at_an_angle(self.surface.solid, pieces, middle))
            .then_some(pieces)
    }

    /// Returns the target edge length at a point.
    fn wanted(&self, p: Point3) -> f64 {
        let sizes = self.options.sizes.as_ref();
        sizes
            .map_or(f64::INFINITY, |s| s.at(p))
            .min(self.options.size)
    }

    /// Returns the length of an edge divided by the target.
    fn share_of_wanted(&self, [a, b]: [u32; 2]) -> f64 {
        let middle = midpoint(self.skin.at(a), self.skin.at(b));
        self.skin.length([a, b]) / self.wanted(middle)
    }

    /// Returns the cosine between the normals of a triangle and its piece.
    fn facing(&self, p: [Point3; 3], label: u32) -> f64 {
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let g = self.surface.gradient(label, centroid(p)).1;
        -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
    }

    /// Returns true if a triangle is turned away from its piece, and more so than before.
    fn faces_away(&self, old: [Point3; 3], new: [Point3; 3], label: u32) -> bool {
        let facing = self.facing(new, label);
        facing.is_nan() || (facing < MIN_FACING_COSINE && facing < self.facing(old, label))
    }

    /// Projects the midpoint of an edge onto the surface; `None` if that is far away.
    fn middle(&self, a: u32, b: u32) -> Option<Middle> {
        let sides = self.skin.sides(a, b)?.map(|f| self.skin.label_of(f));
        let on = match self.sharp(a, b) {
            Some(pieces) => On::from_pieces(&pieces),
            None if sides[0] == sides[1] => On::from_pieces(&[self.piece_at([a, b], sides[0])]),
            None => On::from_pieces(&[SKIN]),
        };
        let flat = midpoint(self.skin.at(a), self.skin.at(b));
        let at = self.surface.project(on.slice(), flat)?;
        let (off, length) = (norm(sub(at, flat)), self.skin.length([a, b]));
        let excess = off / self.most_sagitta(flat, length, on.slice());
        // Beyond half of the edge's length the projection belongs to another part of the surface.
        (off < 0.5 * length).then_some(Middle { at, on, excess })
    }

    /// Returns the largest allowed distance of an edge's midpoint from these pieces.
    fn most_sagitta(&self, middle: Point3, length: f64, on: &[u32]) -> f64 {
        let curve = if on.len() == 2 {
            MAX_RELATIVE_SAGITTA * self.wanted(middle)
        } else {
            f64::INFINITY
        };
        (MAX_RELATIVE_SAGITTA * length)
            .min(self.options.grade.unwrap_or(f64::INFINITY))
            .min(curve)
    }

    /// Returns true if the midpoint of an edge between the vertices would be too far from the
    /// pieces.
    fn leaves(&self, a: u32, b: u32, on: &[u32]) -> bool {
        let flat = midpoint(self.skin.at(a), self.skin.at(b));
        let most = self.most_sagitta(flat, self.skin.length([a, b]), on);
        self.surface
            .project(on, flat)
            .is_none_or(|m| norm(sub(m, flat)) > most)
    }

    fn is_skin(&self, v: u32) -> bool {
        matches!(self.hold[v as usize], Hold::On(on) if on.contains(SKIN))
    }

    /// Returns the piece onto which points of an edge within a part are projected: its label, or
    /// the whole solid next to a seam between pieces that touch tangentially.
    fn piece_at(&self, ends: [u32; 2], label: u32) -> u32 {
        if ends.iter().any(|&v| self.is_skin(v)) {
            SKIN
        } else {
            label
        }
    }

    /// Returns the vertices that are not on the surface.
    pub(super) fn off(&self) -> Vec<Point3> {
        // Within two roundings a vertex lies on the surface.
        let is_off = |p: &Point3| self.surface.distance(SKIN, *p).abs() > 2.0 * self.surface.zero;
        (0..self.skin.points.len() as u32)
            .filter(|&v| !self.skin.around[v as usize].is_empty())
            .map(|v| self.skin.at(v))
            .filter(is_off)
            .collect()
    }
}
