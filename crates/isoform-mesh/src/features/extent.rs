//! The box of a solid, proved by intervals.
//!
//! Boxes that are not proved empty are split; points of the solid met on the way span a hull, and
//! what lies within the hull, widened by the tolerance, need not be looked at. Boxes are cut where
//! the hull's faces pass through them, so that a flat face of the solid costs as much as a corner,
//! whatever the tolerance.

use crate::decide::{Local, Narrowed, Scratch};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};

/// Where the search ends, in model units.
const LIMIT: f64 = 1e6;
/// The box searched first where none is given: the default bounds of HyperFun programs.
pub const START: Aabb = Aabb {
    lo: [-10.0; 3],
    hi: [10.0; 3],
};
/// Boxes that one search may look at. A cube takes about a hundred, a gyroid some thousands; at the
/// end of the budget the boxes left are taken as if the solid filled them.
const BUDGET: usize = 400_000;
/// The same for each side of a shell farther out.
const SHELL_BUDGET: usize = 1000;
/// Outside of the start box the solid is searched to this part of the box's size first.
const COARSE: f64 = 1.0 / 64.0;

/// Boxes between two looks at the clock: one takes up to a tenth of a millisecond.
const LOOK: usize = 64;

/// How thin slabs over a face of the solid may get. Larger suits flat faces along the axes, smaller
/// suits oblique ones.
const OUTWARD: f64 = 16.0;

/// The box of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Holds the solid.
    pub bounds: Aabb,
    /// Whether intervals prove that the solid is empty everywhere else, as far out as 10⁶. Else
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
    /// The start box is empty or not finite, or the size not positive.
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
pub fn extent(solid: &dyn Solid, start: Aabb, size: f64) -> Result<Extent, ExtentError> {
    extent_within(solid, start, size, &Control::default())
}

/// The same, as long as `control` lets it.
pub fn extent_within(
    solid: &dyn Solid,
    start: Aabb,
    size: f64,
    control: &Control<'_>,
) -> Result<Extent, ExtentError> {
    let found = found(solid, start, size, control);
    if control.is_stopped() {
        // Boxes were left out.
        return Err(ExtentError::Stopped);
    }
    found
}

fn found(
    solid: &dyn Solid,
    start: Aabb,
    size: f64,
    control: &Control<'_>,
) -> Result<Extent, ExtentError> {
    let sane = |v: f64| v.is_finite() && v.abs() <= LIMIT;
    if start.is_empty()
        || !start.lo.into_iter().chain(start.hi).all(sane)
        || !(size > 0.0 && size.is_finite())
    {
        return Err(ExtentError::Start { start, size });
    }
    let mut search = Search {
        solid,
        scratch: Scratch::new(solid),
        everything: Local::everywhere(solid),
        inside: Aabb::EMPTY,
        control,
        not_a_number: None,
    };
    let mut region = start;
    let mut certified;
    // How often points of the solid were met at the border: a thin solid without an end is lost
    // sight of in the largest boxes.
    let mut reached = 0;
    let mut out = loop {
        let found = search.run(region, coarse(region, size), BUDGET, false);
        certified = found.complete;
        if let Some(at) = search.not_a_number.filter(|_| !certified) {
            return Err(ExtentError::NotANumber { at });
        }
        if !touches(found.bounds, region) {
            break found.bounds;
        }
        reached += usize::from(touches(
            widened(search.inside, coarse(region, size)),
            region,
        ));
        if at_limit(region) {
            if reached > 2 {
                return Err(ExtentError::Unbounded { limit: LIMIT });
            }
            // Nothing can be proved far out: the solid as it is in the start box and where it was
            // met.
            certified = false;
            region = union(start, search.inside);
            break region;
        }
        region = doubled(region);
    };
    let mut inner = region;
    while certified && !at_limit(inner) {
        let outer = doubled(inner);
        for slab in shell(inner, outer) {
            let mut tolerance = coarse(outer, size);
            let mut found = search.run(slab, tolerance, SHELL_BUDGET, true);
            // Something that no sample has met: nearer to it.
            while !found.met
                && found.complete
                && !found.bounds.is_empty()
                && tolerance > 0.25 * size
            {
                tolerance = (0.25 * tolerance).max(0.25 * size);
                found = search.run(found.bounds, tolerance, SHELL_BUDGET, true);
            }
            if found.met {
                out = union(out, found.bounds);
            }
            certified &= found.met || found.bounds.is_empty();
        }
        inner = outer;
    }
    if touches(out, inner) && !search.inside.is_empty() && at_limit(inner) {
        return Err(ExtentError::Unbounded { limit: LIMIT });
    }
    if out.is_empty() {
        return Err(ExtentError::Empty { certified });
    }
    let fine = 0.25 * size;
    let mut found = search.run(out, fine, BUDGET, false);
    if search.inside.is_empty() && !found.bounds.is_empty() {
        // Thinner than the tolerance, or nothing at all.
        found = search.run(found.bounds, fine / 8.0, BUDGET, false);
    }
    if search.inside.is_empty() {
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
fn coarse(region: Aabb, size: f64) -> f64 {
    (COARSE * region.size().into_iter().fold(0.0, f64::max)).max(0.25 * size)
}

fn touches(part: Aabb, region: Aabb) -> bool {
    !part.is_empty() && (0..3).any(|i| part.lo[i] <= region.lo[i] || part.hi[i] >= region.hi[i])
}

fn at_limit(region: Aabb) -> bool {
    region.lo.iter().all(|v| *v <= -LIMIT) && region.hi.iter().all(|v| *v >= LIMIT)
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

struct Search<'a> {
    solid: &'a dyn Solid,
    scratch: Scratch,
    everything: Local,
    /// Hull of the points known to be inside.
    inside: Aabb,
    control: &'a Control<'a>,
    /// Where the function was met not to be a number.
    not_a_number: Option<Point3>,
}

impl Search<'_> {
    /// The solid in a region, to a tolerance. With `separate`, the hull of what is known inside
    /// elsewhere does not count.
    fn run(&mut self, region: Aabb, tolerance: f64, budget: usize, separate: bool) -> Found {
        let mut unproved = Aabb::EMPTY;
        let mut hull = if separate {
            Aabb::EMPTY
        } else {
            clipped(self.inside, region)
        };
        let mut met = false;
        let mut left = budget;
        // Level by level: the hull has grown from large boxes before small ones are looked at.
        let (mut level, mut next) = (vec![(region, self.everything.clone())], Vec::new());
        while !level.is_empty() {
            for (cell, local) in level.drain(..) {
                // While no point of the solid is known, each box may hold the first.
                let known = if hull.is_empty() {
                    Aabb::EMPTY
                } else {
                    union(hull, unproved)
                };
                if within(cell, widened(known, tolerance)) {
                    continue;
                }
                if left == 0 {
                    unproved = union(unproved, cell);
                    continue;
                }
                left -= 1;
                if left.is_multiple_of(LOOK) && self.control.is_stopped() {
                    left = 0;
                }
                let local = match local.narrow(self.solid, cell, &mut self.scratch) {
                    Narrowed::Outside => continue,
                    Narrowed::Inside => {
                        hull = union(hull, cell);
                        met = true;
                        continue;
                    }
                    Narrowed::Mixed(local) => local,
                };
                let center = cell.center();
                let value = local.value(self.solid, center, &mut self.scratch);
                if value >= 0.0 {
                    hull.add(center);
                    met = true;
                }
                if value.is_nan() {
                    self.not_a_number.get_or_insert(center);
                }
                let sides = cell.size();
                if sides.iter().all(|s| *s <= tolerance) {
                    unproved = union(unproved, cell);
                    continue;
                }
                let (a, b) = split(cell, widened(union(hull, unproved), tolerance));
                next.push((a, local.clone()));
                next.push((b, local));
            }
            std::mem::swap(&mut level, &mut next);
        }
        if met {
            self.inside = union(self.inside, hull);
        }
        let bounds = if hull.is_empty() {
            unproved
        } else {
            clipped(widened(union(hull, unproved), tolerance), region)
        };
        Found {
            bounds,
            complete: left > 0,
            met,
        }
    }
}

/// Two parts of a cell, cut where a face of `known` passes well through it, else in the middle of
/// the longest side. Sides that stick out count [`OUTWARD`] times: thin slabs over a face of the
/// solid are halved outwards before they are cut up along it.
fn split(cell: Aabb, known: Aabb) -> (Aabb, Aabb) {
    let size = cell.size();
    let weight = |i: usize| {
        size[i]
            * if cell.lo[i] < known.lo[i] || cell.hi[i] > known.hi[i] {
                OUTWARD
            } else {
                1.0
            }
    };
    let longest = (0..3)
        .max_by(|a, b| weight(*a).total_cmp(&weight(*b)))
        .unwrap_or(0);
    let mut cut = (longest, cell.center()[longest]);
    if !known.is_empty() && (0..3).all(|i| known.lo[i] < cell.hi[i] && known.hi[i] > cell.lo[i]) {
        let mut best = 0.0;
        for i in 0..3 {
            for at in [known.lo[i], known.hi[i]] {
                let part = (at - cell.lo[i]).min(cell.hi[i] - at);
                if part > best && part > 1e-3 * size[longest] {
                    (best, cut) = (part, (i, at));
                }
            }
        }
    }
    let (mut a, mut b) = (cell, cell);
    a.hi[cut.0] = cut.1;
    b.lo[cut.0] = cut.1;
    (a, b)
}

fn union(a: Aabb, b: Aabb) -> Aabb {
    Aabb {
        lo: std::array::from_fn(|i| a.lo[i].min(b.lo[i])),
        hi: std::array::from_fn(|i| a.hi[i].max(b.hi[i])),
    }
}

fn clipped(a: Aabb, b: Aabb) -> Aabb {
    Aabb {
        lo: std::array::from_fn(|i| a.lo[i].max(b.lo[i])),
        hi: std::array::from_fn(|i| a.hi[i].min(b.hi[i])),
    }
}

fn widened(b: Aabb, by: f64) -> Aabb {
    Aabb {
        lo: b.lo.map(|v| v - by),
        hi: b.hi.map(|v| v + by),
    }
}

fn within(a: Aabb, b: Aabb) -> bool {
    (0..3).all(|i| b.lo[i] <= a.lo[i] && a.hi[i] <= b.hi[i])
}

/// Twice as large about the same centre, not beyond the limit.
fn doubled(b: Aabb) -> Aabb {
    let (c, s) = (b.center(), b.size());
    let half = s.into_iter().fold(0.0, f64::max).max(1e-3);
    Aabb {
        lo: std::array::from_fn(|i: usize| (c[i] - half).max(-LIMIT)),
        hi: std::array::from_fn(|i: usize| (c[i] + half).min(LIMIT)),
    }
}

/// What `outer` holds beyond `inner`, as six boxes.
fn shell(inner: Aabb, outer: Aabb) -> Vec<Aabb> {
    let mut rest = outer;
    let mut slabs = Vec::with_capacity(6);
    for i in 0..3 {
        let (mut below, mut above) = (rest, rest);
        below.hi[i] = inner.lo[i];
        above.lo[i] = inner.hi[i];
        slabs.extend(
            [below, above]
                .into_iter()
                .filter(|b| (0..3).all(|k| b.lo[k] < b.hi[k])),
        );
        rest.lo[i] = inner.lo[i];
        rest.hi[i] = inner.hi[i];
    }
    slabs
}
