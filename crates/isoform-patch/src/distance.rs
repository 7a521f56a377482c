//! Distances of a patch from the surface, sampled and proved.
//!
//! The proof goes cell by cell. About a point c near a cell, F = F(c) + ∇F·δ + δᵀHδ/2 + Tδδδ/6 up
//! to a remainder by which third derivatives differ from T there; with the homogeneous patch put in
//! for δ, times w³, the first part is a Bézier polynomial, and the quotients of its coefficients by
//! those of w³ bound it. Where n·∇F ≥ G > 0 for a unit vector n in a neighbourhood of the cell that
//! is wider by M/G than the cell itself, and |F| ≤ M on the cell, the surface is at most M/G away
//! along ±n. Where no such n exists (at self-intersections) cells are divided until they are small
//! against the bound; then it suffices that F changes its sign between c and a point nearby.
//!
//! ```text
//!      n ↑    ·  ·  ·  ·  ·    F > 0: at most M/G above the cell
//!        |   _______________
//!        |  (____ cell ·c __)  |F| ≤ M
//!        |   ~~~~~~~~~~~~~~~   F = 0
//! ```
//!
//! On patches that lie on the surface to rounding, M is that of F∘p where F is a polynomial. At a
//! self-intersection there are unit vectors e and f with eᵀHe ≥ λ and fᵀHf ≤ −λ about the cell:
//! along ±e, whichever way F does not fall, it has grown by λt²/2 after t, along f fallen by as
//! much, so that the surface is at most √(2M/λ) away.
//!
//! Minima and maxima of parts keep both arguments: n·∇F is at least the least of the parts' that
//! matter, and the tree carries bounds of the parts over to one of F. As only signs count, each
//! piece is first divided by its gradient's length at c. Where a piece changes from one part to
//! another, as where a blend begins, each is bounded where none of its limits is negative: there
//! λ + ρ ≥ 0 for the linear part λ of a limit that is off by up to ρ, and with b ≥ 0 the function
//! F ± b (max λ − λ)(λ + ρ) bounds F.
//!
//! Words: a *cell* is a part of the patch, by halving; a *part* of the surface is a smooth function
//! that counts where its *limits* are not negative; a *piece* is a leaf of the tree of minima and
//! maxima, and consists of parts; the *bound* of a cell is a proved distance, the *target* one that
//! is to be proved.

mod bounded;
mod cell;
mod crossing;
mod products;
mod proof;
mod sampling;
mod smooth;
mod taylor;

pub use proof::prove;
pub(crate) use proof::{Effort, proof};
pub(crate) use sampling::sampled_on;
pub use sampling::{foot_distances, sampled};

use crate::whole::Whole;
use bounded::refined;
use isoform_control::Control;
use isoform_geom::{Field, RationalPatch};
use proof::prove_on;
use sampling::largest_coordinate;

/// Samples in each direction.
const SAMPLES: usize = 41;
/// Bounds that are aimed at, in sampled distances: the second where the first cannot be proved.
const SLACK: [f64; 2] = [1.8, 2.7];
/// At edges, a bound below this multiple of the sampled distance is not made better.
const ENOUGH: f64 = 2.5;
/// Bounds below this share of the largest coordinate are lost in rounding.
const ROUNDING: f64 = 1e-13;
/// At edges, a bound of this share of the largest coordinate is good enough: flat faces come to
/// less, with few cells.
const LEAST_REFINED: f64 = 3e-14;
/// A patch this near to the surface, in units of the largest coordinate, lies on it to rounding.
const EXACT: f64 = 1e-12;
/// Bounds, in units of the largest coordinate, that are tried in turn for a patch that lies on the
/// surface to rounding, with the most cells for each: what is left of rounding; its root, at
/// self-intersections; and what expansions come to.
const EXACT_TARGETS: [(f64, usize); 3] = [(1e-13, 2000), (1e-12, 2000), (1e-6, 60_000)];
/// The most cells of a proof.
const MOST_CELLS: usize = 60_000;
/// The most cells of a first proof at edges.
const MOST_CELLS_AT_EDGES: usize = 6000;
/// The most cells where a bound at edges is made better cell by cell.
const MOST_REFINED: usize = 16_000;

/// Distances from the surface, in model units.
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
    /// No point of the patch is farther from the surface; none where that could not be proved.
    pub bound: Option<f64>,
    /// The largest distance among samples.
    pub sampled: f64,
    /// The root mean square over the area, by samples.
    pub rms: f64,
}

/// Distances with the parameters of a place from which a loose bound comes, if it is loose.
pub(crate) type Found = (Distances, Option<(f64, f64)>);

/// Measures and proves: the bound is at least what is sampled, and aims at no more than 1.8 times
/// that (2.7 times where that cannot be proved) and, if that is not less than what is sampled, at
/// no more than the tolerance.
pub fn distances(field: &dyn Field, patch: &RationalPatch, tolerance: Option<f64>) -> Distances {
    let whole = Whole::of_field(field);
    distances_on(&whole, patch, tolerance, None, Control::default()).0
}

/// [`distances`] from a whole surface. A bound that is `proved` already is made better only where
/// it is loose. Once the control ends the work nothing more is proved.
pub(crate) fn distances_on(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    tolerance: Option<f64>,
    proved: Option<f64>,
    control: Control<'_>,
) -> Found {
    let (sampled, rms) = sampled_on(whole, patch, SAMPLES);
    let search = Search {
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

/// A bound with the parameters of a place from which it comes, if it is loose.
type Bound = (f64, Option<(f64, f64)>);

/// The search for a bound that is not much larger than the sampled distance.
struct Search<'a> {
    whole: &'a Whole<'a>,
    patch: &'a RationalPatch,
    sampled: f64,
    /// The largest coordinate.
    size: f64,
    /// The tolerance, if the sampled distance keeps it.
    tolerance: Option<f64>,
    control: Control<'a>,
}

impl Search<'_> {
    fn bound(&self, proved: Option<f64>) -> Option<Bound> {
        if self.whole.is_single() && self.sampled <= EXACT * self.size {
            return self.exact_bound().map(|b| (b, None));
        }
        // What would be aimed at may be proved already.
        if let Some(bound) = proved.filter(|b| self.is_enough(*b)) {
            return Some((bound, None));
        }
        if self.whole.is_single() {
            let at_once = |slack: &f64| {
                let goal = self.goal(*slack);
                let target = self.tolerance.map_or(goal, |t| goal.min(t));
                self.prove(target, MOST_CELLS)
            };
            if let Some(bound) = SLACK.iter().find_map(at_once) {
                return Some((bound, None));
            }
        }
        self.refined_bound(proved)
    }

    /// The bound of a patch that lies on the surface to rounding.
    fn exact_bound(&self) -> Option<f64> {
        let proved = |(target, cells): &(f64, usize)| {
            self.prove((target * self.size).max(2.0 * self.sampled), *cells)
        };
        EXACT_TARGETS.iter().find_map(proved)
    }

    /// A bound made better from the worst cell on: at edges few cells take most of the work.
    fn refined_bound(&self, proved: Option<f64>) -> Option<Bound> {
        let to_tolerance = || self.prove(self.tolerance?, MOST_CELLS_AT_EDGES);
        let start = proved.or_else(to_tolerance)?;
        let goal = (ENOUGH * self.sampled).max(LEAST_REFINED * self.size);
        let effort = self.effort(MOST_REFINED);
        Some(refined(self.whole, self.patch, start, goal, effort))
    }

    fn goal(&self, slack: f64) -> f64 {
        (slack * self.sampled).max(ROUNDING * self.size)
    }

    fn is_enough(&self, bound: f64) -> bool {
        if self.whole.is_single() {
            bound <= self.goal(SLACK[0])
        } else {
            bound <= (SLACK[1] * self.sampled).max(LEAST_REFINED * self.size)
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
