//! Distances of a patch from the surface, sampled and proved.
//!
//! The proof subdivides the patch into cells. Around a point c near a cell, F = F(c) + ∇F·δ +
//! δᵀHδ/2 + Tδδδ/6 up to a remainder bounded by the deviation of the third derivatives from T; with
//! the homogeneous patch substituted for δ and multiplied by w³, the polynomial part is in Bézier
//! form, and the quotients of its coefficients by those of w³ bound it. Where n·∇F ≥ G > 0 for a
//! unit vector n in a neighbourhood that extends M/G beyond the cell, and |F| ≤ M on the cell, the
//! surface is at most M/G away along ±n. Where no such n exists (at self-intersections), cells are
//! divided until they are small compared with the bound; then a change of sign of F between c and a
//! nearby point suffices.
//!
//! ```text
//!      n ↑    ·  ·  ·  ·  ·    F > 0: at most M/G above the cell
//!        |   _______________
//!        |  (____ cell ·c __)  |F| ≤ M
//!        |   ~~~~~~~~~~~~~~~   F = 0
//! ```
//!
//! On patches that lie on the surface to rounding, M is the bound on F∘p if F is a polynomial. At a
//! self-intersection there are unit vectors e and f with eᵀHe ≥ λ and fᵀHf ≤ −λ around the cell:
//! along ±e, in the direction in which F does not decrease to first order, F grows by at least
//! λt²/2 within t, and along ±f it falls by as much, so the surface is at most √(2M/λ) away.
//!
//! Minima and maxima of parts keep all arguments that matter: n·∇F is at least the least value over
//! those parts, and the tree combines bounds of the parts into one of F. As only signs matter, each
//! piece is first divided by the length of its gradient at c. Where a piece changes from one part
//! to another, as at the beginning of a blend, each part is bounded only where none of its limits
//! is negative: there λ + ρ ≥ 0 for the linear part λ of a limit with error at most ρ, and for b ≥
//! 0 the function F ± b (max λ − λ)(λ + ρ) bounds F.
//!
//! Terms: a *cell* is a part of the patch, made by halving; a *part* of the surface is a smooth
//! function that is valid where its *limits* are not negative; a *piece* is a leaf of the tree of
//! minima and maxima and consists of parts; the *bound* of a cell is a proved distance, the
//! *target* a distance to be proved.

mod bound;
mod bounded;
mod cell;
mod crossing;
mod products;
mod proof;
mod prover;
mod sampling;
mod smooth;
mod taylor;

pub use proof::prove;
pub(crate) use proof::{Effort, MAX_PROOF_CELLS, proof};
pub(crate) use sampling::sampled_on;
pub use sampling::{foot_distances, sampled};

use crate::whole::Whole;
use bounded::refined;
use isoform_control::Control;
use isoform_geom::{Field, RationalPatch};
use proof::prove_on;
use sampling::largest_coordinate;

/// Target bounds, as multiples of the sampled distance: the second is tried if the first cannot be
/// proved.
const TARGET_RATIOS: [f64; 2] = [1.8, 2.7];
/// Smallest target bound, as a fraction of the largest coordinate: smaller ones are lost in
/// rounding.
const MIN_PROVABLE_BOUND: f64 = 1e-13;
/// Smallest bound that is refined at edges, as a fraction of the largest coordinate: on flat faces
/// a few cells reach smaller ones.
const MIN_REFINED_BOUND: f64 = 3e-14;
/// Target bounds for a patch that lies on the surface to rounding, as fractions of the largest
/// coordinate, each with its maximum number of cells; they are tried in turn. The first is near
/// rounding, the second suits self-intersections, the third is what expansions alone can prove.
const EXACT_TARGETS: [(f64, usize); 3] = [(1e-13, 2000), (1e-12, 2000), (1e-6, MAX_PROOF_CELLS)];

/// Distances of a patch from the surface, in model units.
///
/// ```
/// use isoform_geom::{Aabb, Field, Point3, RationalPatch};
/// use isoform_num::{Interval, Jet2};
/// use isoform_patch::sampled;
///
/// /// z = 0.
/// struct Plane;
/// impl Field for Plane {
///     fn value(&self, p: Point3) -> f64 {
///         p[2]
///     }
///     fn jet(&self, p: Point3) -> Jet2 {
///         Jet2 { v: p[2], g: [0.0, 0.0, 1.0], h: [0.0; 6] }
///     }
/// }
/// // A square that rises from the plane to the height 0.3 along u.
/// let patch = RationalPatch::planar((1, 1), [0.0; 3], [1.0, 0.0, 0.3], [0.0, 1.0, 0.0]);
/// let (largest, rms) = sampled(&Plane, &patch, 201);
/// assert!((largest - 0.3).abs() < 1e-12);
/// assert!((rms - 0.3 / 3f64.sqrt()).abs() < 1e-4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// Proved upper bound on the distance of any point of the patch from the surface; `None` if
    /// none could be proved.
    pub bound: Option<f64>,
    /// Largest distance among the samples.
    pub sampled: f64,
    /// Root mean square of the distance over the area, from samples.
    pub rms: f64,
}

/// Distances, and, if the bound is loose, the parameters of a point from which it comes.
pub(crate) type MeasuredDistances = (Distances, Option<(f64, f64)>);

/// Measures and proves the distances of a patch. The bound is at least the sampled distance. It
/// aims at 1.8 times that (at 2.7 times if the first cannot be proved), and at no more than the
/// tolerance if the sampled distance keeps it.
pub fn distances(field: &dyn Field, patch: &RationalPatch, tolerance: Option<f64>) -> Distances {
    let whole = Whole::of_field(field);
    distances_on(&whole, patch, tolerance, None, Control::default()).0
}

/// Does what [`distances`] does, for a surface of parts. A bound that is already `proved` is
/// refined only if it is loose. Once the control stops the work, nothing more is proved.
pub(crate) fn distances_on(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    tolerance: Option<f64>,
    proved: Option<f64>,
    control: Control<'_>,
) -> MeasuredDistances {
    let (sampled, rms) = sampled_on(whole, patch, 41);
    let search = BoundSearch {
        whole,
        patch,
        sampled,
        size: largest_coordinate(patch),
        tolerance: tolerance.filter(|t| *t >= sampled),
        control,
    };
    let (bound, place) = search.bound(proved.map(|b| b.max(sampled))).unzip();
    let distances = Distances {
        bound: bound.map(|b: f64| b.max(sampled)),
        sampled,
        rms,
    };
    (distances, place.flatten())
}

/// Proved bound, and, if it is loose, the parameters of a point from which it comes.
type BoundWithPlace = (f64, Option<(f64, f64)>);

/// Search for a bound that is not much larger than the sampled distance.
struct BoundSearch<'a> {
    whole: &'a Whole<'a>,
    patch: &'a RationalPatch,
    sampled: f64,
    /// Largest coordinate of the patch.
    size: f64,
    /// Tolerance; `None` if the sampled distance exceeds it.
    tolerance: Option<f64>,
    control: Control<'a>,
}

impl BoundSearch<'_> {
    fn bound(&self, proved: Option<f64>) -> Option<BoundWithPlace> {
        // Such a patch lies on the surface to rounding.
        if self.whole.is_single() && self.sampled <= 1e-12 * self.size {
            return self.exact_bound().map(|b| (b, None));
        }
        // The target may be proved already.
        if let Some(bound) = proved.filter(|b| self.is_enough(*b)) {
            return Some((bound, None));
        }
        if self.whole.is_single() {
            let at_once = |slack: &f64| {
                let goal = self.goal(*slack);
                let target = self.tolerance.map_or(goal, |t| goal.min(t));
                self.prove(target, MAX_PROOF_CELLS)
            };
            if let Some(bound) = TARGET_RATIOS.iter().find_map(at_once) {
                return Some((bound, None));
            }
        }
        self.refined_bound(proved)
    }

    /// Returns the bound of a patch that lies on the surface to rounding.
    fn exact_bound(&self) -> Option<f64> {
        let proved = |(target, cells): &(f64, usize)| {
            self.prove((target * self.size).max(2.0 * self.sampled), *cells)
        };
        EXACT_TARGETS.iter().find_map(proved)
    }

    /// Returns a bound refined from the worst cell on: at edges a few cells take most of the work.
    fn refined_bound(&self, proved: Option<f64>) -> Option<BoundWithPlace> {
        let to_tolerance = || self.prove(self.tolerance?, 6000);
        let start = proved.or_else(to_tolerance)?;
        let goal = (2.5 * self.sampled).max(MIN_REFINED_BOUND * self.size);
        let effort = self.effort(16_000);
        Some(refined(self.whole, self.patch, start, goal, effort))
    }

    fn goal(&self, slack: f64) -> f64 {
        (slack * self.sampled).max(MIN_PROVABLE_BOUND * self.size)
    }

    fn is_enough(&self, bound: f64) -> bool {
        if self.whole.is_single() {
            bound <= self.goal(TARGET_RATIOS[0])
        } else {
            bound <= (TARGET_RATIOS[1] * self.sampled).max(MIN_REFINED_BOUND * self.size)
        }
    }

    fn prove(&self, target: f64, cells: usize) -> Option<f64> {
        prove_on(self.whole, self.patch, target, self.effort(cells))
    }

    fn effort(&self, cells: usize) -> Effort<'_> {
        Effort {
            cells,
            control: self.control,
        }
    }
}
