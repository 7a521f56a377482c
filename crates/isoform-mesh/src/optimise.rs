//! Better tetrahedra: constrained moves, flips, collapses and insertions, each kept only where the
//! worst of what it touches improves.
//!
//! After Freitag and Ollivier-Gooch (Tetrahedral mesh improvement using swapping and smoothing,
//! 1997) and Klingner and Shewchuk (Aggressive tetrahedral mesh improvement, 2007). What is ours:
//! vertices on the surface and on curves move too, by projection onto their pieces, so that they
//! stay exact; and the measure looks at the angles of the surface triangles as well.
//!
//! - `holds`: what holds each vertex, and whether it is there;
//! - `moves`: vertices go to better places;
//! - `flips`: edges and faces are removed, the vertices stay;
//! - `collapses`: a vertex is pulled onto its neighbour (`link` says where that is allowed);
//! - `insertions`: edges are split, because tetrahedra are bad or because they leave the surface;
//! - `mending`: all of these on the worst tetrahedra, in rounds;
//! - `settling`: vertices that are off the surface are brought onto it;
//! - `apexes`: the tips of cones get vertices.
//! - `contacts`: borders that stand for a point of contact are contracted.

mod apexes;
mod collapses;
mod contacts;
mod flips;
mod holds;
mod insertions;
mod link;
mod mending;
mod moves;
mod settling;

use crate::complex::{Complex, Face, Ring};
use crate::error::{Warning, WarningKind};
use crate::inside::Inside;
use crate::measure::{biased_sine, smallest_sine};
use crate::options::Options;
use crate::points::centroid;
use crate::surface::{On, Surface};
use holds::Hold;
use insertions::TURN;
use isoform_control::Control;
use isoform_geom::{Point3, TET_FACES, cross, dot, norm, sub};
use moves::Move;

/// Least share of an improvement that counts.
const GAIN: f64 = 1e-4;
/// Least cosine between a face of the surface and its piece; a face that was worse may stay but not
/// get worse.
const FACING: f64 = 0.5;
/// Operations on single tetrahedra between two looks at the clock: each takes up to a millisecond.
const LOOK: usize = 16;
/// Faces whose corners lie on one curve are split where this share of the goal is kept.
const EARS: f64 = 0.5;

/// Tetrahedra under work, with what holds their vertices.
pub(crate) struct Optimiser<'s> {
    surface: &'s Surface<'s>,
    control: &'s Control<'s>,
    pub(crate) complex: Complex,
    hold: Vec<Hold>,
    /// Labels of the faces at each vertex of the surface; there may be more labels than pieces that
    /// hold the vertex.
    labels: Vec<On>,
    /// Edge length wanted.
    size: f64,
    /// Chordal error wanted.
    error: f64,
    /// Largest sagitta of an edge of the surface, as a share of its length.
    turn: f64,
    /// When each vertex was last moved or given other tetrahedra, by the `clock`.
    touched: Vec<u32>,
    /// When each tetrahedron was last tried in vain: where no vertex was touched since it need not
    /// be tried again.
    tried: Vec<u32>,
    clock: u32,
    /// A measure from which nothing is moved any more.
    enough: f64,
    /// Tetrahedra that may be below the goal, together with those that the complex has logged
    /// since.
    suspects: Vec<u32>,
    /// Vertices that were off the surface in the beginning.
    first_off: Vec<u32>,
    scratch: Scratch,
}

/// Memory that operations use again.
#[derive(Default)]
struct Scratch {
    star: Vec<u32>,
    made: Vec<u32>,
    ring: Ring,
    moving: Move,
}

impl<'s> Optimiser<'s> {
    pub(crate) fn new(
        surface: &'s Surface<'s>,
        inside: Inside,
        size: f64,
        control: &'s Control<'s>,
    ) -> Self {
        let Inside {
            complex, frozen, ..
        } = inside;
        let n = complex.points.len();
        let mut this = Self {
            surface,
            control,
            complex,
            hold: vec![Hold::On(On::default()); n],
            labels: vec![On::default(); n],
            size,
            error: f64::INFINITY,
            turn: TURN[0],
            touched: vec![0; n],
            tried: Vec::new(),
            clock: 0,
            enough: f64::INFINITY,
            suspects: Vec::new(),
            first_off: Vec::new(),
            scratch: Scratch::default(),
        };
        this.hold_vertices(&frozen);
        this.hold_apexes();
        this
    }
}

impl Optimiser<'_> {
    /// Optimises, brings every vertex onto the surface, and splits what leaves it too far. Returns
    /// a warning for each vertex that is still off the surface.
    pub(crate) fn improve(&mut self, options: &Options) -> Vec<Warning> {
        let goal = options.goal();
        self.turn = TURN[usize::from(options.order > 1)];
        self.run(goal);
        self.take_contacts(goal);
        let off = self.settle(goal);
        self.take_apexes(goal);
        self.refine_surface(options.grade.unwrap_or(f64::INFINITY), goal);
        self.split_ears(EARS * goal);
        // Where a model does not fit to itself on the sides of a unit cell bodies touch in points.
        #[cfg(debug_assertions)]
        if self.complex.is_divided() && self.complex.torus.is_none() {
            assert_eq!(self.complex.fault(), None);
        }
        Warning::each(WarningKind::VertexOff, off)
    }

    #[inline]
    fn point(&self, v: u32) -> Point3 {
        self.complex.point(v)
    }

    #[inline]
    fn points_of<const N: usize>(&self, vertices: [u32; N]) -> [Point3; N] {
        self.complex.points_of(vertices)
    }

    /// The measure of a tetrahedron: its angles, and those of its faces on the surface.
    fn measure(&self, t: u32) -> f64 {
        let p = self.complex.corners(t);
        let mut q = biased_sine(p);
        for i in 0..4 {
            if self.complex.label(t, i).is_some() {
                q = q.min(smallest_sine(TET_FACES[i].map(|k| p[k])));
            }
        }
        q
    }

    fn worst(&self, tets: &[u32]) -> f64 {
        tets.iter()
            .map(|&t| self.measure(t))
            .fold(f64::INFINITY, f64::min)
    }

    /// Cosine between the normals of a face of the surface and of its piece; 1 if the face lies on
    /// no single piece.
    fn facing(&self, p: [Point3; 3], label: u32) -> f64 {
        if label >= crate::complex::STRAY {
            return 1.0;
        }
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let g = self.surface.gradient(label, centroid(p)).1;
        -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
    }

    /// Whether a face of the surface that goes over into another one on the same piece would no
    /// longer look outward, and less so than before.
    fn turns_away(&self, old: [Point3; 3], new: [Point3; 3], label: u32) -> bool {
        let c = self.facing(new, label);
        c < FACING && c < self.facing(old, label)
    }

    fn faces_at(&self, star: &[u32], v: u32) -> Vec<Face> {
        let mut faces = Vec::new();
        self.add_faces_at(star, v, &mut faces);
        faces
    }

    /// Adds the faces of the surface at a vertex to a list.
    fn add_faces_at(&self, star: &[u32], v: u32, faces: &mut Vec<Face>) {
        for &t in star {
            for i in 0..4 {
                if let Some(label) = self.complex.label(t, i)
                    && self.complex.tets[t as usize][i] != v
                {
                    faces.push((self.complex.face(t, i), label));
                }
            }
        }
    }

    /// Replaces the tetrahedra `old` by `new`. `label` gives the label of each new face on the
    /// boundary, from its vertices.
    fn replace(&mut self, old: &[u32], new: &[[u32; 4]], label: impl FnMut([u32; 3]) -> u32) {
        let mut made = std::mem::take(&mut self.scratch.made);
        self.complex.replace(old, new, label, &mut made);
        self.scratch.made = made;
    }
}
