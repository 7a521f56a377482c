//! Folds at base points of an improper map: seams and rays in which the surface ends.

use super::geometry::distance;
use super::names::Ray;
use super::opening::{Openings, SeamId};
use crate::surface::Point3;
use std::collections::BTreeSet;

impl Openings<'_> {
    /// Returns the seams along which a transformation of even order folds the surface.
    ///
    /// A transformation maps a seam on the border of the fundamental domain to a seam on the
    /// border: to another one, to itself with two directions for each point, or pointwise to
    /// itself. A seam that coincides with a curve of parameters lacks a partner, which is noticed
    /// when they are joined.
    pub(super) fn folded_seams(&self) -> BTreeSet<SeamId> {
        let Some(deck) = self
            .atlas
            .region
            .deck
            .as_ref()
            .filter(|d| d.order().is_power_of_two())
        else {
            return BTreeSet::new();
        };
        let borders: Vec<SeamId> = (0..self.fans.len())
            .flat_map(|f| {
                self.fans[f]
                    .border_nodes(self.atlas.region)
                    .into_iter()
                    .map(move |node| SeamId { fan: f, node })
            })
            .collect();
        let points = |s: SeamId, count| self.fans[s.fan].seam_points(s.node, count);
        let is_apart = |a, b| {
            // Dense enough for a point of the other curve to be near one of them.
            let all = points(b, 700);
            let far = |p: &Point3| {
                all.iter()
                    // Seams farther apart than rounding and the spacing of the points of the other
                    // seam are different curves.
                    .all(|q| distance(*p, *q) > 1e-2 * self.atlas.half_width)
            };
            a == b || points(a, 7).iter().any(far)
        };
        // Exactly known for base points without infinitely near ones.
        let is_known = |a: SeamId| a.node == 0 && deck.folded.contains(&a.fan);
        let is_folded = |&a: &SeamId| {
            let is_double = || self.fans[a.fan].is_double_seam(a.node);
            is_known(a) || !is_double() && borders.iter().all(|&b| is_apart(a, b))
        };
        borders.iter().copied().filter(is_folded).collect()
    }
    /// Returns true if a fold leaves a base point along a ray.
    pub(super) fn is_fold_ray(&self, fan: usize, ray: Ray) -> bool {
        let f = &self.fans[fan];
        let mut directions = f.directions.iter().filter(|d| d.key() == ray.0);
        directions.any(|d| {
            f.sides_along(d)
                .any(|side| self.atlas.region.is_fold_side(side))
                || d.factors.iter().any(|f| self.atlas.region.is_fold(*f))
        })
    }
}
