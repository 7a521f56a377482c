//! Matching of the arcs that end in a base point with the rays that are their tangents.
//!
//! Both are known in their order around the base point, on either side of its wall: there is one
//! way to match them.

use super::site::{Site, SiteArc};
use super::{Openings, WallPoint};
use crate::fan::Fan;
use crate::finding::Finding;

/// Ray that leads into a unit triangle.
#[derive(Clone, Copy, Debug)]
struct LocalRay {
    /// Index of its direction in the fan, with true if it is backward.
    ray: (usize, bool),
    /// Direction in the unit triangle.
    toward: [f64; 2],
}

impl LocalRay {
    /// Returns −1 for a ray to the left of the wall, 1 to the right, 0 along it.
    fn beside(&self) -> f64 {
        let [x, y] = self.toward;
        // Directions are known to rounding.
        if x.abs() < 1e-13 * y.abs() {
            0.0
        } else {
            x.signum()
        }
    }
    fn is_upward(&self) -> bool {
        self.toward[1] > 0.0
    }
    /// Returns true if the ray may be the tangent of a curve on the wall, upward or downward.
    fn is_along_wall(&self, up: bool) -> bool {
        let [x, y] = self.toward;
        // The factor is known to be that of the ray, so that other rays as steep do no harm.
        x.abs() < 1e-9 * y.abs() && self.is_upward() == up
    }
}

/// Returns the rays of a fan that lead into a unit triangle, counterclockwise there.
fn rays_in(fan: &Fan, q: usize) -> Vec<LocalRay> {
    let local = |ray: (usize, bool)| {
        let toward = fan.beginning(q, &fan.directions[ray.0], ray.1)?;
        Some(LocalRay { ray, toward })
    };
    let all = fan.sectors.iter().map(|sector| sector.rays[0]);
    let mut rays: Vec<LocalRay> = all.filter_map(local).collect();
    if !fan.keeps_turn(q) {
        rays.reverse();
    }
    rays
}

/// Returns the rays on one side of the wall, from a list in counterclockwise order, with those
/// along the wall at both ends.
fn rays_beside(rays: &[LocalRay], right: bool) -> Vec<LocalRay> {
    let n = rays.len();
    let side = if right { 1.0 } else { -1.0 };
    let is_mine = |i: usize| rays[i % n].beside() == side;
    let first = (0..n)
        .find(|&i| is_mine(i) && !is_mine(i + n - 1))
        .unwrap_or(0);
    let vertical = |up: bool| {
        let mut rays = rays.iter();
        rays.find(|r| r.beside() == 0.0 && r.is_upward() == up)
    };
    let mine = (first..first + n)
        .filter(|&i| is_mine(i))
        .map(|i| &rays[i % n]);
    vertical(!right)
        .into_iter()
        .chain(mine)
        .chain(vertical(right))
        .copied()
        .collect()
}

/// Arcs to which a ray may be tangent.
#[derive(Clone, Copy, Debug)]
struct Tangent<'a> {
    /// True if the ray may have fewer arcs than `most`.
    optional: bool,
    most: usize,
    /// Curves to which the arcs may belong.
    factors: &'a [usize],
}

/// Returns the index of the tangent of each arc, where arcs, given by their curves, and tangents
/// are in order; `None` if they do not match.
fn in_turn(curves: &[usize], tangents: &[Tangent<'_>]) -> Option<Vec<usize>> {
    let Some((first, rest)) = tangents.split_first() else {
        return curves.is_empty().then(Vec::new);
    };
    let fits = curves
        .iter()
        .take(first.most)
        .take_while(|c| first.factors.contains(c))
        .count();
    let least = if first.optional { 0 } else { first.most };
    (least..=fits).rev().find_map(|n| {
        let others = in_turn(&curves[n..], rest)?.into_iter().map(|k| k + 1);
        Some(std::iter::repeat_n(0, n).chain(others).collect())
    })
}

impl Openings<'_> {
    /// Finds the rays to which the drawn arcs at base points are tangent. Returns a finding for
    /// each mismatch.
    pub(super) fn match_arcs(&mut self) -> Vec<Finding> {
        let mut problems = Vec::new();
        let keys: Vec<WallPoint> = self.sites.keys().copied().collect();
        for key in keys {
            let arcs = self.matched_arcs(key, &mut problems);
            self.sites.get_mut(&key).expect("a site").arcs = arcs;
        }
        for site in self.sites.values() {
            problems.extend(self.tangents_without_arcs(site));
        }
        problems
    }

    /// Returns the drawn arcs at a base point, with their tangents.
    fn matched_arcs(&self, key: WallPoint, problems: &mut Vec<Finding>) -> Vec<SiteArc> {
        let (q, k, p) = key;
        let fan = &self.fans[self.sites[&key].fan];
        let rays = rays_in(fan, q);
        let slabs = self.atlas.region.triangles[q].arrangement.slabs.len();
        let mut arcs = Vec::new();
        for (slab, right) in [(k.wrapping_sub(1), false), (k, true)] {
            if slab < slabs {
                match self.arcs_beside(key, slab, &rays_beside(&rays, right)) {
                    Some(found) => arcs.extend(found),
                    None => problems.push(Finding::TangentsDisagree),
                }
            }
        }
        for (up, from) in [(true, Some(p)), (false, p.checked_sub(1))] {
            let curve = from.and_then(|from| self.curves.drawn_on(q, k, from));
            if let Some(curve) = curve {
                match arc_along_wall(fan, &rays, up, curve) {
                    Some(found) => arcs.push(found),
                    None => problems.push(Finding::TangentLost),
                }
            }
        }
        arcs
    }

    /// Returns the drawn arcs over a slab that end in a base point next to it, with their tangents
    /// among the rays on that side; `None` if they do not match.
    fn arcs_beside(&self, key: WallPoint, slab: usize, rays: &[LocalRay]) -> Option<Vec<SiteArc>> {
        let (q, wall, point) = key;
        let right = slab == wall;
        let fan = &self.fans[self.sites[&key].fan];
        let arcs = &self.atlas.region.triangles[q].arrangement.slabs[slab].arcs;
        let ends_here = |i: &usize| {
            let arc = &arcs[*i];
            point == if right { arc.left } else { arc.right }
        };
        let drawn = self.curves.drawn(q, slab).into_iter();
        let mut places: Vec<usize> = drawn.filter(ends_here).collect();
        if !right {
            places.reverse();
        }
        let curves: Vec<usize> = places.iter().map(|&i| arcs[i].curve).collect();
        let tangents: Vec<Tangent<'_>> = rays.iter().map(|r| self.tangent(fan, r)).collect();
        let matched = in_turn(&curves, &tangents)?;
        let arc = |(i, tangent): (usize, usize)| {
            let (d, backward) = rays[tangent].ray;
            let ray = (fan.directions[d].key(), backward);
            SiteArc::new(ray, right, arcs[i].curve, vec![(slab, i)])
        };
        Some(places.into_iter().zip(matched).map(arc).collect())
    }

    /// Returns the conditions on arcs next to the wall to which a ray may be tangent.
    fn tangent<'a>(&self, fan: &'a Fan, ray: &LocalRay) -> Tangent<'a> {
        let d = &fan.directions[ray.ray.0];
        let is_side = fan.is_side(d);
        Tangent {
            optional: is_side || ray.beside() == 0.0,
            most: if is_side {
                2
            } else {
                self.arcs_along(fan, ray.ray)
            },
            factors: &d.factors,
        }
    }

    /// Returns findings for the rays of a base point that lack arcs, in all its unit triangles.
    fn tangents_without_arcs(&self, site: &Site) -> impl Iterator<Item = Finding> {
        let fan = &self.fans[site.fan];
        let is_wrong = |ray: &(usize, bool)| {
            let d = &fan.directions[ray.0];
            let name = (d.key(), ray.1);
            let sites = self.sites.values().filter(|s| s.fan == site.fan);
            let found = sites
                .flat_map(|s| &s.arcs)
                .filter(|x| x.ray == name)
                .count();
            !fan.is_side(d) && found != self.arcs_along(fan, *ray)
        };
        let rays = fan.sectors.iter().map(|sector| sector.rays[0]);
        rays.filter(is_wrong).map(|_| Finding::TangentsDisagree)
    }

    /// Returns the number of drawn arcs whose tangent is a ray.
    fn arcs_along(&self, fan: &Fan, ray: (usize, bool)) -> usize {
        let is_inside = |end: usize| {
            let mut sectors = fan.sectors.iter();
            sectors
                .find(|s| s.rays[end] == ray)
                .is_some_and(|s| s.inside)
        };
        match [is_inside(1), is_inside(0)] {
            [true, true] => fan.directions[ray.0]
                .factors
                .iter()
                .filter(|f| self.curves.is_drawn_inside(**f))
                .count(),
            [false, false] => 0,
            _ => 1,
        }
    }
}

/// Returns the arc of a curve on the wall of a base point, upward or downward from it, with its
/// tangent.
fn arc_along_wall(fan: &Fan, rays: &[LocalRay], up: bool, curve: usize) -> Option<SiteArc> {
    let is_tangent =
        |r: &&LocalRay| r.is_along_wall(up) && fan.directions[r.ray.0].factors.contains(&curve);
    let (d, backward) = rays.iter().find(is_tangent)?.ray;
    let ray = (fan.directions[d].key(), backward);
    Some(SiteArc::new(ray, up, curve, Vec::new()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    /// Returns rays at integer degrees, with their indices in the list.
    fn rays(degrees: &[i32]) -> Vec<LocalRay> {
        let ray = |(k, &d): (usize, &i32)| LocalRay {
            ray: (k, false),
            toward: match d.rem_euclid(360) {
                90 => [0.0, 1.0],
                270 => [0.0, -1.0],
                d => [
                    (f64::from(d) * PI / 180.0).cos(),
                    (f64::from(d) * PI / 180.0).sin(),
                ],
            },
        };
        degrees.iter().enumerate().map(ray).collect()
    }
    fn numbers(rays: &[LocalRay]) -> Vec<usize> {
        rays.iter().map(|r| r.ray.0).collect()
    }

    /// The order is counterclockwise from straight down to straight up on the right of the wall,
    /// and on from there on the left, wherever the list begins.
    #[test]
    fn rays_on_one_side_of_the_wall_come_in_their_order() {
        let all = [-90, -60, 10, 80, 90, 100, 180, 250];
        for first in 0..all.len() {
            let mut turned = all;
            turned.rotate_left(first);
            let number = |k: usize| (k + all.len() - first) % all.len();
            let rays = rays(&turned);
            let expected = [[0, 1, 2, 3, 4].map(number), [4, 5, 6, 7, 0].map(number)];
            assert_eq!(numbers(&rays_beside(&rays, true)), expected[0]);
            assert_eq!(numbers(&rays_beside(&rays, false)), expected[1]);
        }
    }

    /// All rays in a corner of the unit triangle are on one side.
    #[test]
    fn rays_in_a_corner_are_on_one_side() {
        let rays = rays(&[0, 45, 80]);
        assert_eq!(numbers(&rays_beside(&rays, true)), [0, 1, 2]);
        assert!(rays_beside(&rays, false).is_empty() && rays_beside(&[], true).is_empty());
        assert!(
            rays.iter()
                .all(|r| r.toward[0].hypot(r.toward[1]) < 1.0 + TAU * f64::EPSILON)
        );
    }

    fn tangent(optional: bool, most: usize, factors: &[usize]) -> Tangent<'_> {
        Tangent {
            optional,
            most,
            factors,
        }
    }

    /// Two branches of curve 7, each on either side of the wall, and one of curve 3 between them.
    #[test]
    fn arcs_have_their_tangents_in_turn() {
        let (seven, three) = (tangent(false, 1, &[7]), tangent(false, 1, &[3]));
        let all = [seven, three, seven];
        assert_eq!(in_turn(&[7, 3, 7], &all), Some(vec![0, 1, 2]));
        assert_eq!(in_turn(&[3, 7, 7], &all), None);
        assert_eq!(in_turn(&[7, 3], &all), None);
        assert_eq!(in_turn(&[7, 3, 7, 7], &all), None);
    }

    /// A cusp has two arcs with one tangent; a side of the unit triangle takes the remaining arcs.
    #[test]
    fn several_arcs_may_have_one_tangent() {
        let (cusp, side) = (tangent(false, 2, &[5]), tangent(true, 2, &[5, 6]));
        assert_eq!(in_turn(&[5, 5], &[cusp]), Some(vec![0, 0]));
        assert_eq!(in_turn(&[5, 5, 6], &[cusp, side]), Some(vec![0, 0, 1]));
        // The optional tangent takes as many as possible, but leaves the others their arcs.
        assert_eq!(in_turn(&[5, 5, 5], &[side, cusp]), Some(vec![0, 1, 1]));
        assert_eq!(in_turn(&[5, 5], &[side, cusp]), Some(vec![1, 1]));
        assert_eq!(in_turn(&[], &[side]), Some(vec![]));
        assert_eq!(in_turn(&[], &[]), Some(vec![]));
    }
}
