//! The box of a solid, proved by intervals.
//!
//! Boxes that are not proved empty are split; points of the solid met on the way span a hull, and
//! what lies within the hull, widened by the tolerance, need not be looked at. Boxes are cut where
//! the hull's faces pass through them, so that a flat face of the solid costs as much as a corner,
//! whatever the tolerance.
//!
//! First the region searched grows until the solid lies within it; then shells farther out are
//! searched for other parts of the solid, each twice as large as the one before. Where a part is
//! met there but the proof fails beside it, the part may go on behind, and the region grows again.
//! Last, the box is made as tight as asked for.

mod boxes;

use crate::decide::{Local, Narrowed, Scratch};
use boxes::{clipped, doubled, shell, split, touches, union, within};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};

/// Where the search ends, in model units, unless the box to begin with reaches farther: then twice as
/// far out as it does.
const LIMIT: f64 = 1e6;
/// The largest coordinate of a box to begin with: squares of larger ones, of distances say, are no
/// numbers.
const LARGEST: f64 = 1e150;
/// The box searched first where none is given: the default bounds of HyperFun programs.
pub const START: Aabb = Aabb {
    lo: [-10.0; 3],
    hi: [10.0; 3],
};
/// Boxes that one search may look at. A cube takes about a hundred, a gyroid some thousands; at the
/// end of the budget the boxes left are taken as if the solid filled them.
const BUDGET: usize = 400_000;
/// Boxes that the search in one side of a shell farther out may look at.
const SHELL_BUDGET: usize = 1000;
/// Outside of the start box the solid is searched to this part of the box's size first.
const COARSE: f64 = 1.0 / 64.0;
/// Part of the size asked for to which the box is found.
const FINE: f64 = 0.25;
/// Parts of that for a solid which no sample has met: it is thinner, or nothing at all.
const THIN: f64 = 8.0;
/// Times that points of the solid are met at the border, up to the largest box, from which on it is
/// taken to have no end. Once or twice may be a solid that just fills the boxes.
const ENDLESS: usize = 2;
/// Boxes between two looks at the clock: one takes up to a tenth of a millisecond.
const LOOK: usize = 64;

/// The box of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Holds the solid.
    pub bounds: Aabb,
    /// Whether intervals prove that the solid is empty everywhere else, as far out as 10⁶, or twice
    /// as far as the start box reaches where that is more. Else
    /// they do for the start box (or the one it was enlarged to), and nothing was found beyond.
    pub certified: bool,
}

/// Why a solid has no box.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ExtentError {
    /// There is no inside.
    #[error("the solid is empty{}", if *.certified { "" } else { ", as far as samples can tell" })]
    Empty {
        /// Whether intervals prove it.
        certified: bool,
    },
    /// The solid goes on to the end of the search.
    #[error("the solid has no end within {limit}")]
    Unbounded {
        /// How far out the search went.
        limit: f64,
    },
    /// The function is not a number where the box was sought, and intervals prove nothing there.
    #[error("the function is not a number at ({}, {}, {})", .at[0], .at[1], .at[2])]
    NotANumber {
        /// A place where it is none.
        at: Point3,
    },
    /// Stopped from outside or by time.
    #[error("stopped")]
    Stopped,
    /// The start box is empty, not finite or beyond 10¹⁵⁰, or the size not positive.
    #[error("cannot search the box {start:?} at size {size}")]
    Start {
        /// As given.
        start: Aabb,
        /// As given.
        size: f64,
    },
}

/// The smallest box outside of which intervals prove the solid empty, to about size/2.
///
/// The search begins in `start` ([`START`] where nothing better is known) and goes on in boxes
/// twice as large while the solid touches their border, then looks for parts of the solid farther
/// out.
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

/// The box of a solid like [`extent`], as long as `control` lets it.
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
    let sane = |v: f64| v.abs() <= LARGEST;
    if control.is_stopped() {
        return Err(ExtentError::Stopped);
    }
    if start.is_empty()
        || !start.lo.into_iter().chain(start.hi).all(sane)
        || !(size > 0.0 && size.is_finite())
    {
        return Err(ExtentError::Start { start, size });
    }
    let found = Search::new(solid, size, limit_of(start), control).find(start);
    if control.is_stopped() {
        // Boxes were left out.
        return Err(ExtentError::Stopped);
    }
    found
}

/// Where the search from a box ends.
fn limit_of(start: Aabb) -> f64 {
    let reach = start.lo.into_iter().chain(start.hi);
    let farthest = reach.fold(0.0, |far: f64, v| far.max(v.abs()));
    if farthest <= LIMIT {
        LIMIT
    } else {
        2.0 * farthest
    }
}

/// What a search came to.
struct Found {
    /// Holds the solid's part in the region.
    bounds: Aabb,
    /// Whether all was looked at to the tolerance.
    complete: bool,
    /// Whether points of the solid were met in this region.
    met: bool,
}

/// What looking farther out came to.
enum Beyond {
    /// Nothing else is there, or nothing more is to be found out.
    Done,
    /// In a slab the proof failed where no sample met anything. A part met beside it may go on
    /// there and beyond; or nothing at all is known yet, and the solid is thin. The region is to be
    /// searched as a whole.
    Unproved(Aabb),
}

/// The part of the solid that is known so far.
#[derive(Clone, Copy)]
struct Known {
    bounds: Aabb,
    /// Whether intervals prove that there is nothing else.
    certified: bool,
}

struct Search<'a> {
    solid: &'a dyn Solid,
    size: f64,
    /// How far out it goes.
    limit: f64,
    scratch: Scratch,
    everything: Local,
    /// Hull of the points known to be inside.
    inside: Aabb,
    control: &'a Control<'a>,
    /// A place at which the function gave no number, if one was met.
    not_a_number: Option<Point3>,
}

/// How one region is searched.
#[derive(Clone, Copy)]
struct Task {
    region: Aabb,
    tolerance: f64,
    /// Boxes that may be looked at.
    budget: usize,
    /// Whether the hull of what is known inside elsewhere does not count.
    separate: bool,
}

/// What is known of a region while it is searched.
struct Looked {
    /// Hull of what is inside.
    hull: Aabb,
    /// Hull of what is not proved empty.
    unproved: Aabb,
    met: bool,
    /// Boxes that may still be looked at.
    left: usize,
}

impl<'a> Search<'a> {
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

impl Search<'_> {
    /// Whether a region is all that is searched.
    fn is_all(&self, region: Aabb) -> bool {
        let limit = self.limit;
        region.lo.iter().all(|v| *v <= -limit) && region.hi.iter().all(|v| *v >= limit)
    }

    fn find(&mut self, start: Aabb) -> Result<Extent, ExtentError> {
        let (mut region, mut known) = self.grow(start)?;
        // Each time around the region is at least twice as large: the limit ends it.
        while let Beyond::Unproved(outer) = self.look_beyond(&mut region, &mut known) {
            (region, known) = self.grow(outer)?;
        }
        if touches(known.bounds, region) && !self.inside.is_empty() && self.is_all(region) {
            return Err(ExtentError::Unbounded { limit: self.limit });
        }
        self.tighten(known)
    }

    /// The region, twice as large each time, that the solid does not reach the border of, and the
    /// solid's part in it.
    fn grow(&mut self, start: Aabb) -> Result<(Aabb, Known), ExtentError> {
        let mut region = start;
        // How often points of the solid were met at the border: a thin solid without an end is lost
        // sight of in the largest boxes.
        let mut reached = 0;
        loop {
            let coarse = self.coarse(region);
            let found = self.look_at(region, coarse);
            let certified = found.complete;
            if let Some(at) = self.not_a_number.filter(|_| !certified) {
                return Err(ExtentError::NotANumber { at });
            }
            let bounds = found.bounds;
            if !touches(bounds, region) {
                return Ok((region, Known { bounds, certified }));
            }
            reached += usize::from(touches(self.inside.widened(coarse), region));
            if !self.is_all(region) {
                region = doubled(region, self.limit);
                continue;
            }
            if reached > ENDLESS {
                return Err(ExtentError::Unbounded { limit: self.limit });
            }
            // Nothing can be proved far out: the solid as it is in the start box and where it was
            // met.
            let bounds = union(start, self.inside);
            let certified = false;
            return Ok((bounds, Known { bounds, certified }));
        }
    }

    /// Looks for other parts of the solid farther out, as long as the proof holds, and enlarges the
    /// region searched and what is known.
    fn look_beyond(&mut self, region: &mut Aabb, known: &mut Known) -> Beyond {
        let mut met = false;
        while known.certified && !self.is_all(*region) {
            let outer = doubled(*region, self.limit);
            for slab in shell(*region, outer) {
                let found = self.look_into(slab, self.coarse(outer));
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
            Beyond::Unproved(*region)
        } else {
            Beyond::Done
        }
    }

    /// Searches a slab of a shell. If no sample meets what is there, searches again, with a smaller
    /// tolerance and a smaller slab.
    fn look_into(&mut self, slab: Aabb, tolerance: f64) -> Found {
        let fine = FINE * self.size;
        let mut task = Task {
            region: slab,
            tolerance,
            budget: SHELL_BUDGET,
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

    /// The box to the tolerance asked for.
    fn tighten(&mut self, known: Known) -> Result<Extent, ExtentError> {
        let certified = known.certified;
        if known.bounds.is_empty() {
            return Err(ExtentError::Empty { certified });
        }
        let fine = FINE * self.size;
        let mut found = self.look_at(known.bounds, fine);
        if self.inside.is_empty() && !found.bounds.is_empty() {
            found = self.look_at(found.bounds, fine / THIN);
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

    /// The tolerance of the first search of a region.
    fn coarse(&self, region: Aabb) -> f64 {
        let longest = region.size().into_iter().fold(0.0, f64::max);
        (COARSE * longest).max(FINE * self.size)
    }

    /// The solid in a region, to a tolerance.
    fn look_at(&mut self, region: Aabb, tolerance: f64) -> Found {
        self.run(Task {
            region,
            tolerance,
            budget: BUDGET,
            separate: false,
        })
    }

    fn run(&mut self, task: Task) -> Found {
        let region = task.region;
        let mut looked = Looked {
            hull: if task.separate {
                Aabb::EMPTY
            } else {
                clipped(self.inside, region)
            },
            unproved: Aabb::EMPTY,
            met: false,
            left: task.budget,
        };
        // Level by level: the hull has grown from large boxes before small ones are looked at.
        let (mut level, mut next) = (vec![(region, self.everything.clone())], Vec::new());
        while !level.is_empty() {
            for (cell, local) in level.drain(..) {
                if let Some(parts) = self.look(cell, &local, task.tolerance, &mut looked) {
                    next.extend(parts);
                }
            }
            std::mem::swap(&mut level, &mut next);
        }
        if looked.met {
            self.inside = union(self.inside, looked.hull);
        }
        let bounds = if looked.hull.is_empty() {
            looked.unproved
        } else {
            let all = union(looked.hull, looked.unproved);
            clipped(all.widened(task.tolerance), region)
        };
        Found {
            bounds,
            complete: looked.left > 0,
            met: looked.met,
        }
    }

    /// Looks at one box. Returns its parts, if they are to be looked at next.
    fn look(
        &mut self,
        cell: Aabb,
        local: &Local,
        tolerance: f64,
        looked: &mut Looked,
    ) -> Option<[(Aabb, Local); 2]> {
        // While no point of the solid is known, each box may hold the first.
        let known = if looked.hull.is_empty() {
            Aabb::EMPTY
        } else {
            union(looked.hull, looked.unproved)
        };
        if within(cell, known.widened(tolerance)) {
            return None;
        }
        if looked.left == 0 {
            looked.unproved = union(looked.unproved, cell);
            return None;
        }
        looked.left -= 1;
        if looked.left.is_multiple_of(LOOK) && self.control.is_stopped() {
            looked.left = 0;
        }
        let local = match local.narrow(self.solid, cell, &mut self.scratch) {
            Narrowed::Outside => return None,
            Narrowed::Inside => {
                looked.hull = union(looked.hull, cell);
                looked.met = true;
                return None;
            }
            Narrowed::Mixed(local) => local,
        };
        self.sample(cell.center(), &local, looked);
        if cell.size().iter().all(|s| *s <= tolerance) {
            looked.unproved = union(looked.unproved, cell);
            return None;
        }
        let known = union(looked.hull, looked.unproved).widened(tolerance);
        let (a, b) = split(cell, known);
        Some([(a, local.clone()), (b, local)])
    }

    /// Takes note of the sign at a point.
    fn sample(&mut self, p: Point3, local: &Local, looked: &mut Looked) {
        let value = local.value(self.solid, p, &mut self.scratch);
        if value >= 0.0 {
            looked.hull.add(p);
            looked.met = true;
        }
        if value.is_nan() {
            self.not_a_number.get_or_insert(p);
        }
    }
}
