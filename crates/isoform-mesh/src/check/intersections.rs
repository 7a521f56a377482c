//! Self-intersections of the surface, found exactly.
//!
//! Boxes around the triangles give the pairs to ask about ([`BoxTree`]); each pair is decided by
//! exact signs ([`exact`](super::exact)).

use super::boxes::BoxTree;
use super::exact::triangles_meet;
use super::{Defects, Options, Place};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3};
use rayon::prelude::*;

/// Leaves that are worked on between two looks at the clock and at the number of pairs found.
const ROUND: usize = 1 << 12;
/// Leaves per task: enough work (some ten microseconds) to be worth a task.
const TASK: usize = 64;
/// Pairs that a task decides between two looks at the clock.
const LOOKS: usize = 256;

/// Where the surface meets itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intersections {
    /// Pairs of triangles that meet elsewhere than in the nodes and edges they share, with a point
    /// between them.
    pub pairs: Defects,
    /// How many triangles are in such a pair.
    pub triangles: usize,
    /// Whether all pairs were looked at: not if more than [`Options::pairs`] were found, then the
    /// counts are of those looked at.
    pub complete: bool,
}

/// All pairs of triangles of the surface that meet wrongly. Those with `skip` are left out.
pub(super) fn find(
    points: &[Point3],
    triangles: &[[u32; 3]],
    skip: &[bool],
    tree: &BoxTree,
    options: &Options<'_>,
    control: &Control<'_>,
) -> Intersections {
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    let mut complete = true;
    for round in (0..tree.leaves()).step_by(ROUND) {
        if pairs.len() > options.pairs || control.is_stopped() {
            complete = false;
            break;
        }
        let to = (round + ROUND).min(tree.leaves());
        let starts: Vec<usize> = (round..to).step_by(TASK).collect();
        let found: Vec<(Vec<(u32, u32)>, bool)> = starts
            .into_par_iter()
            .map(|from| {
                // Where everything meets everything, a task has a great many pairs.
                let (mut found, mut looked, mut over) = (Vec::new(), 0usize, control.is_stopped());
                for leaf in from..(from + TASK).min(to) {
                    if over {
                        break;
                    }
                    tree.pairs_of_leaf(leaf, |a, b| {
                        looked += 1;
                        over |= found.len() > options.pairs
                            || looked.is_multiple_of(LOOKS) && control.is_stopped();
                        let (i, j) = (a.min(b), a.max(b));
                        if !over
                            && !skip[i as usize]
                            && !skip[j as usize]
                            && triangles_meet(points, triangles[i as usize], triangles[j as usize])
                        {
                            found.push((i, j));
                        }
                    });
                }
                (found, over)
            })
            .collect();
        for (found, over) in found {
            pairs.extend(found);
            complete &= !over;
        }
    }
    pairs.par_sort_unstable();
    let mut hit = vec![false; triangles.len()];
    for &(a, b) in &pairs {
        (hit[a as usize], hit[b as usize]) = (true, true);
    }
    let place = |&(a, b): &(u32, u32)| {
        let corners = |t: u32| triangles[t as usize].map(|i| points[i as usize]);
        let (x, y) = (Aabb::of(&corners(a)), Aabb::of(&corners(b)));
        let common = Aabb {
            lo: std::array::from_fn(|i| x.lo[i].max(y.lo[i])),
            hi: std::array::from_fn(|i| x.hi[i].min(y.hi[i])),
        };
        Place {
            at: common.center(),
            elements: vec![a, b],
            ..Place::default()
        }
    };
    Intersections {
        pairs: Defects {
            count: pairs.len(),
            places: pairs.iter().take(options.places).map(place).collect(),
        },
        triangles: hit.into_iter().filter(|&h| h).count(),
        complete,
    }
}

/// The tree of the triangles' boxes.
pub(super) fn tree(points: &[Point3], triangles: &[[u32; 3]]) -> BoxTree {
    let boxes: Vec<Aabb> = triangles
        .par_iter()
        .map(|t| Aabb::of(t.map(|i| points[i as usize]).iter()))
        .collect();
    BoxTree::new(&boxes)
}
