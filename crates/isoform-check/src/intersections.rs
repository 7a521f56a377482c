//! Self-intersections of the surface, found exactly.
//!
//! Bounding boxes of the triangles give the candidate pairs ([`BoxTree`]); each pair is decided by
//! exact signs ([`exact`](super::exact)).

use super::boxes::BoxTree;
use super::exact::triangles_meet;
use super::surface::Triangles;
use super::{Defects, Options, Place};
use isoform_control::Control;
use isoform_geom::Aabb;
use rayon::prelude::*;
use std::ops::Range;

/// Number of leaves between two checks of `control` and of the number of pairs found. Larger rounds
/// stop later after a cancellation, smaller ones synchronize the threads more often.
const LEAVES_PER_ROUND: usize = 1 << 12;
/// Number of leaves in a task, about ten microseconds of work; smaller tasks cost more to schedule
/// than to run.
const LEAVES_PER_TASK: usize = 64;
/// Number of pairs that a task decides between two checks of `control`.
const PAIRS_PER_STOP_CHECK: usize = 256;

/// Self-intersections of the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intersections {
    /// Pairs of triangles that meet outside of the nodes and edges they share, with a point between
    /// them.
    pub pairs: Defects,
    /// Number of triangles in such pairs.
    pub triangles: usize,
    /// True if all candidate pairs were tested. The search ends early when more than
    /// [`Options::pairs`] were found; the counts are then lower bounds.
    pub complete: bool,
}

/// Indices of two triangles, the lower one first.
type Pair = (u32, u32);

/// Finds all pairs of triangles of the surface that meet wrongly. Triangles with `skip` are left
/// out.
pub(super) fn find(
    of: Triangles<'_>,
    skip: &[bool],
    tree: &BoxTree,
    options: &Options<'_>,
    control: &Control<'_>,
) -> Intersections {
    let search = PairSearch {
        of,
        skip,
        tree,
        most: options.pairs,
        control,
    };
    let (mut pairs, complete) = search.pairs();
    pairs.par_sort_unstable();
    let mut hit = vec![false; of.triangles.len()];
    for &(a, b) in &pairs {
        (hit[a as usize], hit[b as usize]) = (true, true);
    }
    let places = pairs.iter().take(options.places);
    Intersections {
        pairs: Defects {
            count: pairs.len(),
            places: places.map(|&pair| place(of, pair)).collect(),
        },
        triangles: hit.into_iter().filter(|&h| h).count(),
        complete,
    }
}

/// Returns a point between two triangles: the centre of the intersection of their boxes.
fn place(of: Triangles<'_>, (a, b): Pair) -> Place {
    let [x, y] = [a, b].map(|t| Aabb::from_points(&of.corners(of.triangles[t as usize])));
    let common = Aabb {
        lo: std::array::from_fn(|i| x.lo[i].max(y.lo[i])),
        hi: std::array::from_fn(|i| x.hi[i].min(y.hi[i])),
    };
    Place {
        at: common.center(),
        elements: vec![a, b],
        ..Place::default()
    }
}

/// Search for pairs of triangles that meet.
struct PairSearch<'m> {
    of: Triangles<'m>,
    /// True for triangles that are left out because they have no area.
    skip: &'m [bool],
    tree: &'m BoxTree,
    /// Maximum number of pairs; the search ends when more were found.
    most: usize,
    control: &'m Control<'m>,
}

impl PairSearch<'_> {
    /// Returns the pairs that meet, and true if all candidates were tested.
    fn pairs(&self) -> (Vec<Pair>, bool) {
        let leaves = self.tree.leaves();
        let mut pairs = Vec::new();
        let mut complete = true;
        for round in (0..leaves).step_by(LEAVES_PER_ROUND) {
            if pairs.len() > self.most || self.control.is_stopped() {
                return (pairs, false);
            }
            let to = (round + LEAVES_PER_ROUND).min(leaves);
            let starts: Vec<usize> = (round..to).step_by(LEAVES_PER_TASK).collect();
            let found: Vec<(Vec<Pair>, bool)> = starts
                .into_par_iter()
                .map(|from| self.pairs_of_leaves(from..(from + LEAVES_PER_TASK).min(to)))
                .collect();
            for (found, is_whole) in found {
                pairs.extend(found);
                complete &= is_whole;
            }
        }
        (pairs, complete)
    }

    /// Returns the pairs with a triangle in these leaves, and true if all candidates were tested.
    /// Where everything meets everything, a task has very many pairs and checks `control` in
    /// between.
    fn pairs_of_leaves(&self, leaves: Range<usize>) -> (Vec<Pair>, bool) {
        let (mut found, mut looked, mut over) = (Vec::new(), 0usize, self.control.is_stopped());
        for leaf in leaves {
            if over {
                break;
            }
            self.tree.pairs_of_leaf(leaf, |a, b| {
                looked += 1;
                over |= found.len() > self.most
                    || looked.is_multiple_of(PAIRS_PER_STOP_CHECK) && self.control.is_stopped();
                let pair = (a.min(b), a.max(b));
                if !over && self.meet(pair) {
                    found.push(pair);
                }
            });
        }
        (found, !over)
    }

    /// Returns true if a pair meets and neither triangle is left out.
    fn meet(&self, (a, b): Pair) -> bool {
        let (i, j) = (a as usize, b as usize);
        let triangles = self.of.triangles;
        !self.skip[i] && !self.skip[j] && triangles_meet(self.of.points, triangles[i], triangles[j])
    }
}

/// Builds the tree of the triangles' boxes.
pub(super) fn tree(of: Triangles<'_>) -> BoxTree {
    let boxes: Vec<Aabb> = of
        .triangles
        .par_iter()
        .map(|t| Aabb::from_points(&of.corners(*t)))
        .collect();
    BoxTree::new(&boxes)
}
