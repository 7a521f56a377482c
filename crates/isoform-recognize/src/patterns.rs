//! Patterns: equal entities in a row at equal distances, and on a circle at equal angles.
//!
//! Chains grow from two or three neighbours by the next entity where the pattern expects it, as long
//! as a common fit of all (one surface, moved on by the pitch) holds for all and each of them.

mod chain;
mod circles;
mod rows;
mod sites;

use crate::chart::Surface;
use crate::entity::{Layout, Pattern};
use crate::symmetry::Set;
use chain::Chain;
pub(crate) use chain::turned;
use isoform_geom::{Point3, cross, norm, sub};
use sites::{Sites, classes};

/// The step of a diagonal is made of at most this many of each of two rows, but for this share of it.
const STEPS: i32 = 3;
const OFF: f64 = 0.05;
/// Circles of this many members and less come from grids.
const SQUARE: usize = 4;
/// An arc that has this many members with another circle in common is a worse guess of that.
const ARC: usize = 3;

/// The patterns among entities; lengths are in units of `unit` about `origin`.
pub(crate) fn patterns(set: &Set<'_>, (unit, origin): (f64, Point3)) -> Vec<Pattern> {
    let mut found = Vec::new();
    for class in classes(set.known, set.outward, set.noise) {
        let sites = Sites::of(set.known, &class);
        let rows = accepted(rows::rows(&sites), &sites, Vec::new());
        let all = accepted(circles::circles(&sites, &rows), &sites, rows);
        found.extend(all.iter().map(|c| pattern(c, &sites, unit, origin)));
    }
    found.sort_by(|a, b| (b.members.len(), &a.members).cmp(&(a.members.len(), &b.members)));
    found
}

/// Adds chains, longest first, that do not follow from others.
fn accepted(mut new: Vec<Chain>, sites: &Sites<'_>, mut all: Vec<Chain>) -> Vec<Chain> {
    new.sort_by(|a, b| {
        let length = b.members.len().cmp(&a.members.len());
        let has_axis = |c: &Chain| c.circle.is_some_and(|c| c.coaxial.is_some());
        length
            .then(has_axis(b).cmp(&has_axis(a)))
            .then(a.pitch(sites).total_cmp(&b.pitch(sites)))
            .then(a.members.cmp(&b.members))
    });
    for chain in new {
        let is_part = all.iter().any(|c| chain.is_part_of(c));
        if !is_part && !is_implied(&chain, &all) {
            all.push(chain);
        }
    }
    all
}

/// Whether a chain is what a grid or a circle has anyway: a row of members of others whose step is
/// made of theirs; a square, or three about an axis, in rows; a circle each of which is in a row with its
/// neighbour; an arc that leaves another circle.
fn is_implied(chain: &Chain, all: &[Chain]) -> bool {
    let of = |m: usize| {
        let holds = move |r: &&Chain| r.circle.is_none() && r.members.contains(&m);
        all.iter().filter(holds)
    };
    let Some(circle) = chain.circle else {
        return chain.members.iter().all(|m| of(*m).count() > 0) && is_made(chain.step, all);
    };
    let n = chain.members.len();
    let is_beside = |k: usize| {
        let beside = [(k + 1) % n, (k + n - 1) % n].map(|b| chain.members[b]);
        of(chain.members[k]).any(|r| beside.iter().any(|b| r.members.contains(b)))
    };
    let is_square = n <= SQUARE && chain.members.iter().all(|m| of(*m).count() > 0);
    let leaves = |c: &Chain| {
        let shared = chain.members.iter().filter(|m| c.members.contains(m));
        c.circle.is_some() && shared.count() >= ARC
    };
    let is_branch = !circle.is_closed && all.iter().any(leaves);
    is_square || (0..n).all(is_beside) || is_branch
}

/// Whether a step is made of those of two rows that are not parallel.
fn is_made(step: Point3, all: &[Chain]) -> bool {
    let steps: Vec<Point3> = all
        .iter()
        .filter(|r| r.circle.is_none())
        .map(|r| r.step)
        .collect();
    let multiples = || (-STEPS..=STEPS).filter(|k| *k != 0).map(f64::from);
    let is_sum = |p: &Point3, q: &Point3| {
        multiples().any(|a| {
            multiples().any(|b| {
                let off = |k: usize| step[k] - a * p[k] - b * q[k];
                norm(std::array::from_fn(off)) <= OFF * norm(step)
            })
        })
    };
    let are_across = |p: &Point3, q: &Point3| norm(cross(*p, *q)) > OFF * norm(*p) * norm(*q);
    let mut pairs = steps.iter().flat_map(|p| steps.iter().map(move |q| (p, q)));
    pairs.any(|(p, q)| are_across(p, q) && is_sum(p, q))
}

/// A chain in the scan's unit.
fn pattern(chain: &Chain, sites: &Sites<'_>, unit: f64, origin: Point3) -> Pattern {
    let layout = match chain.circle {
        None => Layout::Row {
            direction: crate::chart::unit(chain.step),
            spacing: norm(chain.step) * unit,
            spacing_deviation: chain.deviations[0] * unit,
        },
        Some(circle) => {
            let foot = Surface::about(&circle.line, chain.first.place).place;
            let radius = norm(sub(chain.first.place, foot));
            Layout::Circle {
                center: std::array::from_fn(|k| foot[k] * unit + origin[k]),
                axis: circle.line.axis,
                radius: radius * unit,
                radius_deviation: chain.deviations[0] * unit,
                angle: circle.angle,
                angle_deviation: chain.deviations[1],
                is_closed: circle.is_closed,
                coaxial: circle.coaxial,
            }
        }
    };
    Pattern {
        members: chain.members.iter().map(|m| sites.entities(*m)).collect(),
        layout,
        deviation: chain.off * unit,
    }
}
