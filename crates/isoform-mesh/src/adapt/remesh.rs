//! Better triangles on a solid: splits, collapses, flips and moves that keep every vertex on what
//! holds it.
//!
//! First towards the edge lengths wanted (`lengths`), in rounds of splitting long edges, collapsing
//! short ones, flipping and moving (Botsch and Kobbelt, A remeshing approach to multiresolution
//! modeling, 2004); then only what makes the smallest angle it touches larger (`angles`).

mod angles;
mod lengths;

use super::skin::Skin;
use crate::options::Options;
use crate::points::{centroid, midpoint, unique};
use crate::surface::{On, SKIN, Surface, meet_at_an_angle};
use isoform_control::Control;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Rounds towards the lengths wanted.
const ROUNDS: usize = 12;
/// Rounds in the beginning in which vertices move freely, also where angles suffer.
const FREE_ROUNDS: usize = 2;
/// Faces per operation of a round: with fewer operations the rounds end.
const SETTLED: usize = 100;
/// Times that edges are split which leave the surface after mending.
const REPAIRS: usize = 6;
/// Smallest sine that a collapse or a move towards the lengths wanted may leave; less where it was
/// less before.
const FAIR: f64 = 0.35;
/// Least cosine between a face and its piece; a face that was worse may stay but not get worse.
const FACING: f64 = 0.5;
/// Largest sagitta of an edge as a share of its length, and of one on a curve as a share of the
/// size: as in the optimiser of tetrahedra.
const TURN: f64 = 0.08;
/// Share of an edge's length beyond which its middle is not near the surface at all.
const LOST: f64 = 0.5;
/// Least gain of a step of mending, as a sine.
const GAIN: f64 = 1e-4;
/// Distance from the surface, in roundings, within which a vertex is on it.
const ON: f64 = 2.0;

/// What holds a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hold {
    Fixed,
    On(On),
}

/// Triangles under work, with what holds their vertices.
pub(super) struct Remesher<'s> {
    pub(super) skin: Skin,
    hold: Vec<Hold>,
    surface: &'s Surface<'s>,
    options: &'s Options,
    control: &'s Control<'s>,
}

/// The middle of an edge, moved onto the surface.
struct Middle {
    at: Point3,
    /// What holds it.
    on: On,
    /// Its sagitta over the one allowed.
    excess: f64,
}

impl<'s> Remesher<'s> {
    pub(super) fn new(
        skin: Skin,
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
    /// All of it: sizes first, then angles.
    pub(super) fn run(&mut self) {
        for round in 0..ROUNDS {
            if self.control.is_stopped() {
                return;
            }
            let mut done = self.split_long(false);
            done += self.collapse_short();
            done += self.flip_all();
            self.relax(round < FREE_ROUNDS);
            if done * SETTLED < self.skin.faces.len() {
                break;
            }
        }
        self.mend();
        for _ in 0..REPAIRS {
            // Mending may have made edges that leave the surface.
            if self.control.is_stopped() || self.split_long(true) == 0 {
                break;
            }
            self.flip_all();
            self.mend();
        }
    }

    /// What holds a vertex, from the faces around it: the two pieces of the curve that runs through
    /// it, or its piece.
    fn holding(&self, v: u32) -> Hold {
        let faces = self.skin.around[v as usize].iter();
        let labels = unique(faces.map(|&f| self.skin.label_of(f)).collect());
        if let &[one] = labels.as_slice() {
            // Where the piece is not the surface there, another one that it touches is.
            let p = self.skin.at(v);
            let is_off =
                self.surface.distance(one, p) != 0.0 || self.surface.distance(SKIN, p) != 0.0;
            return Hold::On(On::of(&[if is_off { SKIN } else { one }]));
        }
        let neighbours = self.skin.neighbours(v).into_iter();
        let sharp: Vec<[u32; 2]> = neighbours.filter_map(|w| self.sharp(v, w)).collect();
        match sharp.as_slice() {
            [] => Hold::On(On::of(&[SKIN])),
            [a, b] if a == b => Hold::On(On::of(a)),
            _ => Hold::Fixed,
        }
    }

    /// The pieces on both sides of an edge that is one of the solid.
    fn sharp(&self, a: u32, b: u32) -> Option<[u32; 2]> {
        let sides = self.skin.sides(a, b)?.map(|f| self.skin.label_of(f));
        let pieces = [sides[0].min(sides[1]), sides[0].max(sides[1])];
        let middle = midpoint(self.skin.at(a), self.skin.at(b));
        (pieces[0] != pieces[1] && meet_at_an_angle(self.surface.solid, pieces, middle))
            .then_some(pieces)
    }

    /// The edge length wanted at a point.
    fn wanted(&self, p: Point3) -> f64 {
        let sizes = self.options.sizes.as_ref();
        sizes
            .map_or(f64::INFINITY, |s| s.at(p))
            .min(self.options.size)
    }

    /// The length of an edge over the one wanted.
    fn share_of_wanted(&self, [a, b]: [u32; 2]) -> f64 {
        let middle = midpoint(self.skin.at(a), self.skin.at(b));
        self.skin.length([a, b]) / self.wanted(middle)
    }

    /// Cosine between a triangle and its piece.
    fn facing(&self, p: [Point3; 3], label: u32) -> f64 {
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let g = self.surface.gradient(label, centroid(p)).1;
        -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
    }

    /// Whether a triangle looks away from its piece, and more so than before.
    fn faces_away(&self, old: [Point3; 3], new: [Point3; 3], label: u32) -> bool {
        let facing = self.facing(new, label);
        facing.is_nan() || (facing < FACING && facing < self.facing(old, label))
    }

    /// The middle of an edge, moved onto the surface; none where that is far off.
    fn middle(&self, a: u32, b: u32) -> Option<Middle> {
        let sides = self.skin.sides(a, b)?.map(|f| self.skin.label_of(f));
        let on = match self.sharp(a, b) {
            Some(pieces) => On::of(&pieces),
            None if sides[0] == sides[1] => On::of(&[self.piece_at([a, b], sides[0])]),
            None => On::of(&[SKIN]),
        };
        let flat = midpoint(self.skin.at(a), self.skin.at(b));
        let at = self.surface.project(on.slice(), flat)?;
        let (off, length) = (norm(sub(at, flat)), self.skin.length([a, b]));
        let excess = off / self.most_sagitta(flat, length, on.slice());
        (off < LOST * length).then_some(Middle { at, on, excess })
    }

    /// The largest sagitta of an edge on these pieces: its middle may be as far from them.
    fn most_sagitta(&self, middle: Point3, length: f64, on: &[u32]) -> f64 {
        let curve = if on.len() == 2 {
            TURN * self.wanted(middle)
        } else {
            f64::INFINITY
        };
        (TURN * length)
            .min(self.options.grade.unwrap_or(f64::INFINITY))
            .min(curve)
    }

    /// Whether an edge between the vertices would leave the pieces too far.
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

    /// The piece to project a point of an edge within a part on: its label, or the solid itself
    /// next to a seam between pieces that touch tangentially.
    fn piece_at(&self, ends: [u32; 2], label: u32) -> u32 {
        if ends.iter().any(|&v| self.is_skin(v)) {
            SKIN
        } else {
            label
        }
    }

    /// Vertices that are not where they belong.
    pub(super) fn off(&self) -> Vec<Point3> {
        let is_off = |p: &Point3| self.surface.distance(SKIN, *p).abs() > ON * self.surface.zero;
        (0..self.skin.points.len() as u32)
            .filter(|&v| !self.skin.around[v as usize].is_empty())
            .map(|v| self.skin.at(v))
            .filter(is_off)
            .collect()
    }
}
