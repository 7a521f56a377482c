//! Optimisation of tetrahedra: constrained moves, flips, collapses and insertions, each kept only
//! if the worst element that it touches improves.
//!
//! After Freitag and Ollivier-Gooch (Tetrahedral mesh improvement using swapping and smoothing,
//! 1997) and Klingner and Shewchuk (Aggressive tetrahedral mesh improvement, 2007). New here:
//! vertices on the surface and on curves move too, by projection onto their pieces, so that they
//! stay exact; and the measure includes the angles of the surface triangles.
//!
//! - `holds`: the pieces that hold each vertex, and if it lies on them;
//! - `moves`: vertices move to better positions;
//! - `flips`: edges and faces are removed, the vertices stay;
//! - `collapses`: a vertex is pulled onto its neighbour (`link` decides where that is allowed);
//! - `insertions`: edges are split, because tetrahedra are bad or because they leave the surface;
//! - `mending`: all of these on the worst tetrahedra, in rounds;
//! - `settling`: vertices that are off the surface are moved onto it;
//! - `apexes`: vertices are moved onto the tips of cones;
//! - `contacts`: borders that represent a point of contact are contracted.

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
use insertions::MAX_SAGITTA_RATIOS;
use isoform_control::Control;
use isoform_geom::{Point3, TET_FACES, cross, dot, norm, sub};
use moves::MoveBuffers;

/// Minimum increase of the worst measure that counts as an improvement.
const MIN_GAIN: f64 = 1e-4;
/// Minimum cosine between the normals of a face of the surface and of its piece; a face with a
/// smaller one may stay but not get worse.
const MIN_FACING_COSINE: f64 = 0.5;
/// Number of operations on single tetrahedra between two stop checks; each takes up to a
/// millisecond.
const OPERATIONS_PER_STOP_CHECK: usize = 16;

/// The tetrahedra being optimised, with the pieces that hold their vertices.
pub(crate) struct Optimiser<'s> {
    surface: &'s Surface<'s>,
    control: &'s Control<'s>,
    pub(crate) complex: Complex,
    hold: Vec<Hold>,
    /// Labels of the faces at each vertex of the surface; there may be more labels than pieces that
    /// hold the vertex.
    labels: Vec<On>,
    /// Target edge length.
    size: f64,
    /// Maximum chordal error.
    error: f64,
    /// Maximum sagitta of an edge of the surface, as a fraction of its length.
    turn: f64,
    /// Value of `clock` when each vertex was last moved or its tetrahedra changed.
    touched: Vec<u32>,
    /// Value of `clock` when each tetrahedron was last tried in vain; it is skipped until a vertex
    /// of it is touched.
    tried: Vec<u32>,
    clock: u32,
    /// Measure at which vertices are good enough and do not move.
    enough: f64,
    /// Tetrahedra that may be below the goal, in addition to those that the complex has logged
    /// since.
    suspects: Vec<u32>,
    /// Vertices that were off the surface initially.
    first_off: Vec<u32>,
    scratch: OptimiserBuffers,
}

/// Buffers that operations reuse.
#[derive(Default)]
struct OptimiserBuffers {
    star: Vec<u32>,
    made: Vec<u32>,
    ring: Ring,
    moving: MoveBuffers,
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
            turn: MAX_SAGITTA_RATIOS[0],
            touched: vec![0; n],
            tried: Vec::new(),
            clock: 0,
            enough: f64::INFINITY,
            suspects: Vec::new(),
            first_off: Vec::new(),
            scratch: OptimiserBuffers::default(),
        };
        this.hold_vertices(&frozen);
        this.hold_apexes();
        this
    }
}

impl Optimiser<'_> {
    /// Optimises, moves every vertex onto the surface, and splits edges that leave it too far.
    /// Returns a warning for each vertex that is still off the surface.
    pub(crate) fn improve(&mut self, options: &Options) -> Vec<Warning> {
        let goal = options.goal();
        self.turn = MAX_SAGITTA_RATIOS[usize::from(options.order > 1)];
        self.run(goal);
        self.take_contacts(goal);
        let off = self.settle(goal);
        self.take_apexes(goal);
        self.refine_surface(options.grade.unwrap_or(f64::INFINITY), goal);
        // Splits must keep half of the goal.
        self.split_ears(0.5 * goal);
        // If a model does not match itself on the sides of a unit cell, bodies touch in points.
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

    /// Returns the measure of a tetrahedron: its angles, and those of its faces on the surface.
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

    /// Returns the cosine between the normals of a face of the surface and of its piece; 1 if the
    /// face does not lie on a single piece.
    fn facing(&self, p: [Point3; 3], label: u32) -> f64 {
        if label >= crate::complex::STRAY {
            return 1.0;
        }
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let g = self.surface.gradient(label, centroid(p)).1;
        -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
    }

    /// Returns true if the new position of a face of the surface faces away from its piece, and
    /// more so than the old one.
    fn turns_away(&self, old: [Point3; 3], new: [Point3; 3], label: u32) -> bool {
        let c = self.facing(new, label);
        c < MIN_FACING_COSINE && c < self.facing(old, label)
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
