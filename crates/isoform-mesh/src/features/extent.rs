//! Bounding box of a solid, proved by intervals.
//!
//! Boxes that are not proved empty are split; points of the solid met on the way span a hull, and
//! boxes within the hull, widened by the tolerance, are skipped. Boxes are cut along the planes of
//! the hull's faces, so that a flat face of the solid costs as much as a corner, whatever the
//! tolerance.
//!
//! First the region searched grows until the solid lies within it. Then shells around it, each
//! twice as large as the last, are searched for other parts of the solid. If a part is met there
//! but the proof fails next to it, the part may extend farther, and the region grows again. Finally
//! the box is tightened to the requested tolerance.

mod boxes;

use crate::decide::{Local, NarrowedTree, Scratch};
use boxes::{clipped, doubled, is_within, shell, split, touches, union};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};

/// Distance from the origin at which the search ends, in model units. If the start box reaches
/// farther, the search ends at twice its distance.
const MIN_SEARCH_LIMIT: f64 = 1e6;
/// Default start box: the default bounds of HyperFun programs.
pub const START: Aabb = Aabb {
    lo: [-10.0; 3],
    hi: [10.0; 3],
};
/// Maximum number of boxes per search of a region. A cube takes about a hundred, a gyroid some
/// thousands; when the budget is spent, the remaining boxes count as filled.
const MAX_REGION_BOXES: usize = 400_000;
/// Maximum number of boxes per search of one side of a shell farther out.
const MAX_SLAB_BOXES: usize = 1000;
/// Tolerance of the box, as a fraction of the requested size.
const EXTENT_TOLERANCE_FACTOR: f64 = 0.25;

/// Bounding box of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Box that holds the solid.
    pub bounds: Aabb,
    /// True if intervals prove the solid empty everywhere else, up to a distance of 10⁶ or, if that
    /// is more, twice the distance that the start box reaches. Otherwise the proof covers the start
    /// box only (or the box to which it was enlarged), and no other part was found beyond.
    pub certified: bool,
}

/// Reason why a solid has no box.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ExtentError {
    /// The solid has no inside.
    #[error("the solid is empty{}", if *.certified { "" } else { ", as far as samples can tell" })]
    Empty {
        /// True if intervals prove it.
        certified: bool,
    },
    /// The solid extends to the end of the search.
    #[error("the solid has no end within {limit}")]
    Unbounded {
        /// Distance from the origin at which the search ended.
        limit: f64,
    },
    /// The function is not a number where the box was sought, and intervals prove nothing there.
    #[error("the function is not a number at ({}, {}, {})", .at[0], .at[1], .at[2])]
    NotANumber {
        /// Point at which it is not a number.
        at: Point3,
    },
    /// Stopped from outside or by time.
    #[error("stopped")]
    Stopped,
    /// The start box is empty, not finite or beyond 10¹⁵⁰, or the size not positive.
    #[error("cannot search the box {start:?} at size {size}")]
    Start {
        /// Start box, as given.
        start: Aabb,
        /// Size, as given.
        size: f64,
    },
}

/// Returns the smallest box outside of which intervals prove the solid empty, to about size/2.
///
/// The search begins in `start` ([`START`] if nothing better is known), continues in boxes twice as
/// large while the solid touches their border, and then covers shells farther out.
///
/// ```
/// use isoform_field::Pieces;
/// use isoform_field::hyperfun::{Mode, Model};
/// use isoform_mesh::features::{START, extent};
///
/// // A ball of radius 3 about (20, 0, 0), outside of the start box.
/// let program = "ball(x[3], a[1]) { ball = 9 - (x[1] - 20)^2 - x[2]^2 - x[3]^2; }";
/// let model = Model::parse(program, Mode::Default)?;
/// let solid = Pieces::of_model(&model, &vec![0.0; model.n_params()])?;
/// let found = extent(&solid, START, 0.1)?;
/// assert!(found.certified);
/// assert!((found.bounds.lo[0] - 17.0).abs() < 0.1 && (found.bounds.hi[2] - 3.0).abs() < 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the solid is empty, has no end, or is not a number, or if the start box or the size has no
/// meaning.
pub fn extent(solid: &dyn Solid, start: Aabb, size: f64) -> Result<Extent, ExtentError> {
    extent_within(solid, start, size, &Control::default())
}

/// Returns the box of a solid like [`extent`], unless stopped by `control`.
///
/// # Errors
/// If the solid is empty, has no end, or is not a number, if the start box or the size has no
/// meaning, or on a stop.
pub fn extent_within(
    solid: &dyn Solid,
    start: Aabb,
    size: f64,
    control: &Control<'_>,
) -> Result<Extent, ExtentError> {
    // Squares of larger coordinates, as in distances, overflow.
    let sane = |v: f64| v.abs() <= 1e150;
    if control.is_stopped() {
        return Err(ExtentError::Stopped);
    }
    if start.is_empty()
        || !start.lo.into_iter().chain(start.hi).all(sane)
        || !(size > 0.0 && size.is_finite())
    {
        return Err(ExtentError::Start { start, size });
    }
    let found = ExtentSearch::new(solid, size, limit_of(start), control).find(start);
    if control.is_stopped() {
        // Boxes were left out.
        return Err(ExtentError::Stopped);
    }
    found
}

/// Returns the distance from the origin at which the search from a box ends.
fn limit_of(start: Aabb) -> f64 {
    let reach = start.lo.into_iter().chain(start.hi);
    let farthest = reach.fold(0.0, |far: f64, v| far.max(v.abs()));
    if farthest <= MIN_SEARCH_LIMIT {
        MIN_SEARCH_LIMIT
    } else {
        2.0 * farthest
    }
}

/// Result of the search of a region.
struct RegionHull {
    /// Box that holds the solid's part in the region.
    bounds: Aabb,
    /// True if the region was searched completely, to the tolerance.
    complete: bool,
    /// True if points of the solid were met in this region.
    met: bool,
}

/// Result of the search beyond the region.
enum OuterSearch {
    /// No other part exists, or none can be decided.
    Done,
    /// Region to be searched as a whole: the proof failed in a slab where no sample met the solid.
    /// A part met next to it may extend there and beyond; or no part is known yet, and the solid is
    /// thin.
    Unproved(Aabb),
}

/// Part of the solid that is known so far.
#[derive(Clone, Copy)]
struct KnownPart {
    bounds: Aabb,
    /// True if intervals prove that no other part exists.
    certified: bool,
}

struct ExtentSearch<'a> {
    solid: &'a dyn Solid,
    size: f64,
    /// Distance from the origin at which the search ends.
    limit: f64,
    scratch: Scratch,
    everything: Local,
    /// Hull of the points known to be inside.
    inside: Aabb,
    control: &'a Control<'a>,
    /// A point at which the function was not a number; `None` if none was met.
    not_a_number: Option<Point3>,
}

/// Parameters of the search of one region.
#[derive(Clone, Copy)]
struct RegionTask {
    region: Aabb,
    tolerance: f64,
    /// Maximum number of boxes examined.
    budget: usize,
    /// True if the hull of points known inside from other searches is not used.
    separate: bool,
}

/// State of the search of a region.
struct RegionState {
    /// Hull of the points known to be inside.
    hull: Aabb,
    /// Hull of the boxes not proved empty.
    unproved: Aabb,
    met: bool,
    /// Number of boxes that may still be examined.
    left: usize,
}

impl<'a> ExtentSearch<'a> {
    fn new(solid: &'a dyn Solid, size: f64, limit: f64, control: &'a Control<'a>) -> Self {
        Self {
            solid,
            size,
            limit,
            scratch: Scratch::new(solid),
            everything: Local::everywhere(solid),
            inside: Aabb::EMPTY,
            control,
            not_a_number: None,
        }
    }
}

impl ExtentSearch<'_> {
    /// Returns true if a region reaches the limit in all directions.
    fn is_all(&self, region: Aabb) -> bool {
        let limit = self.limit;
        region.lo.iter().all(|v| *v <= -limit) && region.hi.iter().all(|v| *v >= limit)
    }

    fn find(&mut self, start: Aabb) -> Result<Extent, ExtentError> {
        let (mut region, mut known) = self.grow(start)?;
        // Each iteration at least doubles the region: the limit ends the loop.
        while let OuterSearch::Unproved(outer) = self.search_beyond(&mut region, &mut known) {
            (region, known) = self.grow(outer)?;
        }
        if touches(known.bounds, region) && !self.inside.is_empty() && self.is_all(region) {
            return Err(ExtentError::Unbounded { limit: self.limit });
        }
        self.tighten(known)
    }

    /// Doubles the region until the solid no longer reaches its border. Returns the region and the
    /// solid's part in it.
    fn grow(&mut self, start: Aabb) -> Result<(Aabb, KnownPart), ExtentError> {
        let mut region = start;
        // Number of times that points of the solid were met at the border: in the largest boxes
        // samples miss a thin unbounded solid.
        let mut reached = 0;
        loop {
            let coarse = self.coarse(region);
            let found = self.search_region(region, coarse);
            let certified = found.complete;
            if let Some(at) = self.not_a_number.filter(|_| !certified) {
                return Err(ExtentError::NotANumber { at });
            }
            let bounds = found.bounds;
            if !touches(bounds, region) {
                return Ok((region, KnownPart { bounds, certified }));
            }
            reached += usize::from(touches(self.inside.widened(coarse), region));
            if !self.is_all(region) {
                region = doubled(region, self.limit);
                continue;
            }
            // Once or twice may be a solid that just fills the boxes.
            if reached > 2 {
                return Err(ExtentError::Unbounded { limit: self.limit });
            }
            // The proof fails far out: the result is the start box and the points met.
            let bounds = union(start, self.inside);
            let certified = false;
            return Ok((bounds, KnownPart { bounds, certified }));
        }
    }

    /// Searches for other parts of the solid farther out, while the proof holds; enlarges the
    /// searched region and the known part.
    fn search_beyond(&mut self, region: &mut Aabb, known: &mut KnownPart) -> OuterSearch {
        let mut met = false;
        while known.certified && !self.is_all(*region) {
            let outer = doubled(*region, self.limit);
            for slab in shell(*region, outer) {
                let found = self.search_slab(slab, self.coarse(outer));
                if found.met {
                    known.bounds = union(known.bounds, found.bounds);
                }
                met |= found.met;
                known.certified &= found.met || found.bounds.is_empty();
            }
            *region = outer;
        }
        let may_go_on = met || self.inside.is_empty();
        if may_go_on && !known.certified && !self.is_all(*region) && !self.control.is_stopped() {
            OuterSearch::Unproved(*region)
        } else {
            OuterSearch::Done
        }
    }

    /// Searches a slab of a shell. If no sample meets its content, searches again with a smaller
    /// tolerance and a smaller slab.
    fn search_slab(&mut self, slab: Aabb, tolerance: f64) -> RegionHull {
        let fine = EXTENT_TOLERANCE_FACTOR * self.size;
        let mut task = RegionTask {
            region: slab,
            tolerance,
            budget: MAX_SLAB_BOXES,
            separate: true,
        };
        let mut found = self.run(task);
        while !found.met && found.complete && !found.bounds.is_empty() && task.tolerance > fine {
            task.tolerance = (0.25 * task.tolerance).max(fine);
            task.region = found.bounds;
            found = self.run(task);
        }
        found
    }

    /// Tightens the box to the requested tolerance.
    fn tighten(&mut self, known: KnownPart) -> Result<Extent, ExtentError> {
        let certified = known.certified;
        if known.bounds.is_empty() {
            return Err(ExtentError::Empty { certified });
        }
        let fine = EXTENT_TOLERANCE_FACTOR * self.size;
        let mut found = self.search_region(known.bounds, fine);
        if self.inside.is_empty() && !found.bounds.is_empty() {
            // No sample has met the solid: it is thinner than the tolerance, or empty.
            found = self.search_region(found.bounds, fine / 8.0);
        }
        if self.inside.is_empty() {
            return Err(ExtentError::Empty {
                certified: certified && found.bounds.is_empty(),
            });
        }
        Ok(Extent {
            bounds: found.bounds,
            certified: certified && found.complete,
        })
    }

    /// Returns the tolerance of the first search of a region.
    fn coarse(&self, region: Aabb) -> f64 {
        let longest = region.size().into_iter().fold(0.0, f64::max);
        // The first search of a region resolves 1/64 of its size.
        (1.0 / 64.0 * longest).max(EXTENT_TOLERANCE_FACTOR * self.size)
    }

    /// Returns the part of the solid in a region, to a tolerance.
    fn search_region(&mut self, region: Aabb, tolerance: f64) -> RegionHull {
        self.run(RegionTask {
            region,
            tolerance,
            budget: MAX_REGION_BOXES,
            separate: false,
        })
    }

    fn run(&mut self, task: RegionTask) -> RegionHull {
        let region = task.region;
        let mut state = RegionState {
            hull: if task.separate {
                Aabb::EMPTY
            } else {
                clipped(self.inside, region)
            },
            unproved: Aabb::EMPTY,
            met: false,
            left: task.budget,
        };
        // Level by level: the hull has grown from large boxes before small ones are examined.
        let (mut level, mut next) = (vec![(region, self.everything.clone())], Vec::new());
        while !level.is_empty() {
            for (cell, local) in level.drain(..) {
                if let Some(parts) = self.examine(cell, &local, task.tolerance, &mut state) {
                    next.extend(parts);
                }
            }
            std::mem::swap(&mut level, &mut next);
        }
        if state.met {
            self.inside = union(self.inside, state.hull);
        }
        let bounds = if state.hull.is_empty() {
            state.unproved
        } else {
            let all = union(state.hull, state.unproved);
            clipped(all.widened(task.tolerance), region)
        };
        RegionHull {
            bounds,
            complete: state.left > 0,
            met: state.met,
        }
    }

    /// Examines one box. Returns its parts if they are to be examined next.
    fn examine(
        &mut self,
        cell: Aabb,
        local: &Local,
        tolerance: f64,
        state: &mut RegionState,
    ) -> Option<[(Aabb, Local); 2]> {
        // While no point of the solid is known, each box may hold the first.
        let known = if state.hull.is_empty() {
            Aabb::EMPTY
        } else {
            union(state.hull, state.unproved)
        };
        if is_within(cell, known.widened(tolerance)) {
            return None;
        }
        if state.left == 0 {
            state.unproved = union(state.unproved, cell);
            return None;
        }
        state.left -= 1;
        // A box takes up to 0.1 ms.
        if state.left.is_multiple_of(64) && self.control.is_stopped() {
            state.left = 0;
        }
        let local = match local.narrow(self.solid, cell, &mut self.scratch) {
            NarrowedTree::Outside => return None,
            NarrowedTree::Inside => {
                state.hull = union(state.hull, cell);
                state.met = true;
                return None;
            }
            NarrowedTree::Mixed(local) => local,
        };
        self.sample(cell.center(), &local, state);
        if cell.size().iter().all(|s| *s <= tolerance) {
            state.unproved = union(state.unproved, cell);
            return None;
        }
        let known = union(state.hull, state.unproved).widened(tolerance);
        let (a, b) = split(cell, known);
        Some([(a, local.clone()), (b, local)])
    }

    /// Records the sign at a point.
    fn sample(&mut self, p: Point3, local: &Local, state: &mut RegionState) {
        let value = local.value(self.solid, p, &mut self.scratch);
        if value >= 0.0 {
            state.hull.add(p);
            state.met = true;
        }
        if value.is_nan() {
            self.not_a_number.get_or_insert(p);
        }
    }
}
