//! Test whether images of points are near points.

use super::motion::Motion;
use crate::cloud::thinned;
use isoform_geom::{KdTree, Point3};
use rayon::prelude::*;

/// Maximum number of points kept of an entity, among which neighbours are sought.
const MAX_KEPT_POINTS: usize = 4000;

/// Points of each entity.
pub(super) struct Cover {
    places: Vec<Vec<Point3>>,
    trees: Vec<KdTree>,
    /// Squared distance within which points are near, by entity.
    near: Vec<f64>,
}

impl Cover {
    pub(super) fn new(points: &[Vec<Point3>]) -> Self {
        let some = |p: &Vec<Point3>| thinned(p.len(), MAX_KEPT_POINTS).map(|k| p[k]).collect();
        let kept: Vec<Vec<Point3>> = points.iter().map(some).collect();
        let trees: Vec<KdTree> = kept.par_iter().map(|p| KdTree::new(p)).collect();
        let near = kept.iter().zip(&trees);
        // Places within four spacings of a point are covered.
        let near = near.map(|(p, t)| 4.0 * 4.0 * spacing(p, t)).collect();
        let few = |p: &Vec<Point3>| thinned(p.len(), 64).map(|k| p[k]).collect();
        Self {
            places: kept.iter().map(few).collect(),
            trees,
            near,
        }
    }

    /// Returns true if the images of one entity's points are near points of the other.
    pub(super) fn holds(&self, motion: &Motion, from: usize, to: usize) -> bool {
        let is_near = |p: &&Point3| {
            let nearest = self.trees[to].nearest(motion.point(**p));
            nearest.is_some_and(|n| n.1 <= self.near[to].max(self.near[from]))
        };
        let all = &self.places[from];
        // At corners some places may have no points.
        all.iter().filter(is_near).count() as f64 >= 0.85 * all.len() as f64
    }
}

/// Returns the median of the squared distance from a point to the nearest other.
fn spacing(points: &[Point3], tree: &KdTree) -> f64 {
    let mut found = Vec::new();
    let mut squares: Vec<f64> = thinned(points.len(), MAX_KEPT_POINTS / 4)
        .map(|k| {
            tree.nearest_k(points[k], 2, &mut found);
            found.last().map_or(0.0, |f| f.0)
        })
        .collect();
    if squares.is_empty() {
        return 0.0;
    }
    let half = squares.len() / 2;
    *squares.select_nth_unstable_by(half, f64::total_cmp).1
}
