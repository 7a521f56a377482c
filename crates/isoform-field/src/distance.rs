//! The signed distance to the surface of a solid, by foot points.
//!
//! A solid is a tree of minima and maxima over smooth pieces g ≥ 0 ([`Shape`]). The point q of its
//! surface nearest to a point p lies on one piece, on an edge (two pieces) or at a corner (three):
//! q is the limit of an iteration to the point nearest to p on the intersection of the tangent
//! planes,
//!
//! q ← p + Gᵀ (G Gᵀ)⁻¹ (G (q − p) − g(q)),  G = rows ∇gᵢ(q),
//!
//! which converges linearly with the factor distance × curvature. q lies on the surface if the tree
//! over the pieces' first-order distances takes both signs at a small distance from q, in the
//! sectors between the pieces. The derivative by the parameters follows from the envelope theorem
//! (to first order the foot point moves along the surface): ∂d/∂a = Σ λᵢ (∂gᵢ/∂a)(q)/|∇gᵢ(q)|,
//! where the unit vector (p − q)/d is Σ λᵢ ∇gᵢ/|∇gᵢ|.
//!
//! After Ahn, Rauh, Cho, Warnecke (2002), *Orthogonal distance fitting of implicit curves and
//! surfaces*, IEEE PAMI 24:620–638, who treat smooth surfaces; edges and corners are an extension
//! of Isoform.

mod blocks;
mod feet;
mod finder;
mod nearby;
mod search;
mod solid;

use self::finder::FootFinder;
use self::solid::{CompiledPiece, CompiledSolid};
use crate::block::{GradientInputs, Plan};
use crate::graph::Graph;
use crate::shape::Shape;
use crate::tape::Tape;
use isoform_geom::{
    Aabb, DistanceField, Foot, Frame, Nearby, ParamField, Point3, add_normal_equations,
    normal_equations_of,
};
use rayon::prelude::*;

/// Maximum number of pieces of a solid with foot points.
const MAX_DISTANCE_PIECES: usize = 256;
/// Half thickness of the shell about a piece whose random points are projected to the piece, in
/// diagonals of the region. A thicker shell gives more samples per round, a thinner one makes them
/// more uniform on curved pieces.
const SHELL_HALF_THICKNESS: f64 = 0.02;
/// Root of x⁴ = x + 1. Its negative powers are the steps of a low-discrepancy sequence in a box
/// (Roberts).
const SEQUENCE_ROOT: f64 = 1.220_744_084_605_759_5;
/// Maximum number of rounds of random points, which bounds the search on a very small surface.
const MAX_SAMPLING_ROUNDS: usize = 200;

/// Signed distance from a compiled solid, positive inside. It is exact up to rounding near the
/// surface, at distances well below the radii of curvature; farther away, if no foot point is
/// found, it is the first-order distance of [`Shape::distance`].
///
/// ```
/// use isoform_field::{Distance, Graph, Shape, hyperfun::{Mode, Model}};
/// use isoform_geom::ParamField;
///
/// // A cube of side 2a about the origin.
/// let text = "my_model(x[3], a[1]) {
///   my_model = min(a[1] - abs(x[1]), min(a[1] - abs(x[2]), a[1] - abs(x[3])));
/// }";
/// let mut graph = Graph::new();
/// let root = Model::parse(text, Mode::Default)?.compile(&mut graph).expect("an expression");
/// let shape = Shape::new(&mut graph, root);
/// let mut same = graph.clone();
/// let distance = Distance::new(&shape, &mut same, 1, |_, id| id).expect("few pieces");
/// let mut out = [0.0; 2];
/// // Beyond a face by 1, and beyond a corner by 1 along each axis.
/// distance.values(&[[3.0, 0.0, 0.0], [3.0, 3.0, 3.0]], &[2.0], &mut out);
/// assert!((out[0] + 1.0).abs() < 1e-12 && (out[1] + 3_f64.sqrt()).abs() < 1e-12);
/// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Distance {
    solid: CompiledSolid,
}

impl Distance {
    /// Returns the distance from the solid of `shape`, moved by `place`, which maps each piece's
    /// expression into the graph `posed`, with `n_params` parameters. `None` for solids of more
    /// than 256 pieces, since every piece is evaluated at every point.
    pub fn new(
        shape: &Shape,
        posed: &mut Graph,
        n_params: usize,
        mut place: impl FnMut(&mut Graph, crate::NodeId) -> crate::NodeId,
    ) -> Option<Self> {
        if shape.pieces.len() > MAX_DISTANCE_PIECES {
            return None;
        }
        let pieces = shape
            .pieces
            .iter()
            .map(|&piece| {
                let root = place(posed, piece);
                let tape = Tape::new(posed, &[root], 3, n_params);
                CompiledPiece {
                    by_space: Plan::new(&tape, GradientInputs::Space),
                    by_all: Plan::new(&tape, GradientInputs::All),
                    tape,
                }
            })
            .collect();
        Some(Self {
            solid: CompiledSolid {
                pieces,
                tree: shape.tree.clone(),
                n_params,
            },
        })
    }
}

impl DistanceField for Distance {
    fn feet(&self, points: &[Point3], a: &[f64], out: &mut [Foot]) {
        let piece = self.solid.batch_points();
        let out = &mut out[..points.len()];
        let work = |(points, out): (&[Point3], &mut [Foot])| {
            FootFinder::new(&self.solid, a).feet(points, out);
        };
        if points.len() <= piece {
            work((points, out));
        } else {
            points
                .par_chunks(piece)
                .zip(out.par_chunks_mut(piece))
                .for_each(work);
        }
    }

    fn jacobian_of(&self, feet: &[Foot], a: &[f64], jac: &mut [f64]) {
        let (piece, m) = (self.solid.batch_points(), self.solid.n_params);
        let jac = &mut jac[..feet.len() * m];
        if m == 0 {
            return;
        }
        feet.par_chunks(piece)
            .zip(jac.par_chunks_mut(piece * m))
            .for_each(|(feet, jac)| FootFinder::new(&self.solid, a).by_params(feet, jac));
    }

    fn normal_equations_at(
        &self,
        feet: &[Foot],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let (piece, m) = (self.solid.batch_points(), self.solid.n_params);
        let sums = |(k, feet): (usize, &[Foot])| {
            let mut jac = vec![0.0; feet.len() * m];
            FootFinder::new(&self.solid, a).by_params(feet, &mut jac);
            let f: Vec<f64> = feet.iter().map(|foot| foot.distance).collect();
            let weights = weights.get(k * piece..).unwrap_or_default();
            let (mut g, mut h) = (vec![0.0; m], vec![0.0; m * m]);
            let sum = normal_equations_of(&f, &jac, weights, &mut g, &mut h);
            (sum, g, h)
        };
        let pieces: Vec<_> = feet.par_chunks(piece).enumerate().map(sums).collect();
        add_normal_equations(pieces, &mut gradient[..m], &mut hessian[..m * m])
    }

    fn nearby(&self, places: &[Foot], a: &[f64], reach: f64, strip: f64) -> Vec<Nearby> {
        let mut out = vec![Nearby::Much; places.len()];
        let piece = self.solid.batch_points();
        places
            .par_chunks(piece)
            .zip(out.par_chunks_mut(piece))
            .for_each(|(places, out)| {
                FootFinder::new(&self.solid, a).nearby(places, reach, strip, out)
            });
        out
    }

    fn bends(&self, places: &[Foot], a: &[f64], step: f64) -> Vec<f64> {
        let mut out = vec![0.0; places.len()];
        let piece = self.solid.batch_points();
        places
            .par_chunks(piece)
            .zip(out.par_chunks_mut(piece))
            .for_each(|(places, out)| FootFinder::new(&self.solid, a).bends(places, step, out));
        out
    }

    /// Projects random points near each piece to it, and keeps those on the surface. On a smooth
    /// piece they are uniform up to its edges, with an error of the square of shell thickness times
    /// curvature.
    fn area_samples(
        &self,
        a: &[f64],
        frame: &Frame,
        region: Aabb,
        wanted: usize,
        seed: u64,
    ) -> Vec<Foot> {
        let mut random = fastrand::Rng::with_seed(seed);
        // A Kronecker sequence is as independent of the faces as random points, and more uniform.
        let mut even: Point3 = std::array::from_fn(|_| random.f64());
        let mut finder = FootFinder::new(&self.solid, a);
        let shell = SHELL_HALF_THICKNESS * region.diagonal();
        let size = region.size();
        let mut found = Vec::with_capacity(wanted);
        if !(shell > 0.0 && shell.is_finite()) {
            return found;
        }
        let mut points = vec![[0.0; 3]; self.solid.batch_points()];
        for _ in 0..MAX_SAMPLING_ROUNDS {
            for p in &mut points {
                spread(&mut even);
                let at = std::array::from_fn(|i| region.lo[i] + even[i] * size[i]);
                *p = frame.out(at);
            }
            finder.area_samples(&points, shell, &mut found);
            if found.len() >= wanted {
                break;
            }
        }
        found
    }
}

impl ParamField for Distance {
    fn dim(&self) -> usize {
        self.solid.n_params
    }

    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
        let piece = self.solid.batch_points();
        let work = |(points, out): (&[Point3], &mut [f64])| {
            FootFinder::new(&self.solid, a).distances(points, out);
        };
        points
            .par_chunks(piece)
            .zip(out[..points.len()].par_chunks_mut(piece))
            .for_each(work);
    }

    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
        let (piece, m) = (self.solid.batch_points(), self.solid.n_params);
        if points.is_empty() {
            return;
        }
        let (out, jac) = (&mut out[..points.len()], &mut jac[..points.len() * m]);
        let work = |((points, out), jac): ((&[Point3], &mut [f64]), &mut [f64])| {
            let mut finder = FootFinder::new(&self.solid, a);
            let feet = finder.distances(points, out);
            finder.by_params(&feet, jac);
        };
        if points.len() <= piece || m == 0 {
            work(((points, out), jac));
        } else {
            points
                .par_chunks(piece)
                .zip(out.par_chunks_mut(piece))
                .zip(jac.par_chunks_mut(piece * m))
                .for_each(work);
        }
    }

    fn normal_equations(
        &self,
        points: &[Point3],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let mut feet = vec![Foot::NONE; points.len()];
        self.feet(points, a, &mut feet);
        self.normal_equations_at(&feet, weights, a, gradient, hessian)
    }

    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        let mut feet = vec![Foot::NONE; points.len()];
        self.feet(points, a, &mut feet);
        for ((o, g), f) in out.iter_mut().zip(gradients).zip(&feet) {
            (*o, *g) = (f.distance, f.inward);
        }
    }
}

/// Advances a low-discrepancy sequence in the unit cube.
fn spread(even: &mut Point3) {
    let mut step = 1.0;
    for v in even {
        step /= SEQUENCE_ROOT;
        *v = (*v + step).fract();
    }
}
