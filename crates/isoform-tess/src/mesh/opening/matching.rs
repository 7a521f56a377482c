//! The arcs that end in a base point, matched with the rays that are their tangents.

use super::Openings;
use super::site::SiteArc;
use crate::fan::Fan;
use crate::finding::Finding;
use crate::mesh::names::Ray;
use std::collections::BTreeMap;

impl Openings<'_> {
    /// The rays to which the drawn arcs at base points are tangent. Both are known in their order
    /// around the base point, on either side of its wall: there is one way to match them.
    pub(super) fn match_arcs(&mut self, problems: &mut Vec<Finding>) {
        let mut count: BTreeMap<(usize, Ray), usize> = BTreeMap::new();
        let keys: Vec<(usize, usize, usize)> = self.sites.keys().copied().collect();
        for (q, k, p) in keys {
            let a = &self.atlas.region.triangles[q].arrangement;
            let site = &self.sites[&(q, k, p)];
            let fan = &self.fans[site.fan];
            // Rays in the triangle, counterclockwise there.
            let mut rays: Vec<((usize, bool), [f64; 2])> = Vec::new();
            for sector in &fan.sectors {
                let (d, backward) = sector.rays[0];
                rays.extend(
                    fan.beginning(q, &fan.directions[d], backward)
                        .map(|x| (sector.rays[0], x)),
                );
            }
            if !fan.keeps_turn(q) {
                rays.reverse();
            }
            let beside = |x: [f64; 2]| {
                if x[0].abs() < 1e-13 * x[1].abs() {
                    0.0
                } else {
                    x[0].signum()
                }
            };
            let mut arcs = Vec::new();
            for (slab, right) in [(k.wrapping_sub(1), false), (k, true)] {
                if slab >= a.slabs.len() {
                    continue;
                }
                let mut ends_here: Vec<usize> = self
                    .curves
                    .drawn(q, slab)
                    .into_iter()
                    .filter(|&i| {
                        if right {
                            a.slabs[slab].arcs[i].left == p
                        } else {
                            a.slabs[slab].arcs[i].right == p
                        }
                    })
                    .collect();
                if !right {
                    ends_here.reverse();
                }
                // The rays on that side, after and before those along the wall.
                let mine = if right { 1.0 } else { -1.0 };
                let n = rays.len();
                let first = (0..n)
                    .find(|&i| beside(rays[i].1) == mine && beside(rays[(i + n - 1) % n].1) != mine)
                    .unwrap_or(0);
                let mut run: Vec<usize> = (0..n)
                    .map(|i| (first + i) % n)
                    .filter(|&i| beside(rays[i].1) == mine)
                    .collect();
                let vertical = |up: bool| {
                    (0..n).find(|&i| beside(rays[i].1) == 0.0 && (rays[i].1[1] > 0.0) == up)
                };
                if let Some(i) = vertical(!right) {
                    run.insert(0, i);
                }
                run.extend(vertical(right));
                let wanted: Vec<(bool, usize, &[usize])> = run
                    .iter()
                    .map(|&i| {
                        let d = &fan.directions[rays[i].0.0];
                        let expected = self.arcs_along(fan, rays[i].0);
                        let optional = fan.is_side(d) || beside(rays[i].1) == 0.0;
                        (
                            optional,
                            if fan.is_side(d) { 2 } else { expected },
                            &d.factors[..],
                        )
                    })
                    .collect();
                let curves: Vec<usize> = ends_here
                    .iter()
                    .map(|&i| a.slabs[slab].arcs[i].curve)
                    .collect();
                let Some(matched) = in_turn(&curves, &wanted) else {
                    problems.push(Finding::TangentsDisagree);
                    continue;
                };
                for (i, place) in ends_here.into_iter().zip(matched) {
                    let (d, backward) = rays[run[place]].0;
                    let ray = (fan.directions[d].key(), backward);
                    *count.entry((site.fan, ray)).or_insert(0) += 1;
                    let curve = a.slabs[slab].arcs[i].curve;
                    arcs.push(SiteArc {
                        ray,
                        right,
                        curve,
                        chain: vec![(slab, i)],
                        end: [0.0; 2],
                        middle: [0.0; 2],
                    });
                }
            }
            for (up, from) in [(true, Some(p)), (false, p.checked_sub(1))] {
                let Some(curve) = from.and_then(|from| self.curves.drawn_on(q, k, from)) else {
                    continue;
                };
                let mine = |x: [f64; 2]| x[0].abs() < 1e-9 * x[1].abs() && (x[1] > 0.0) == up;
                let Some(((d, backward), _)) = rays
                    .iter()
                    .find(|(r, x)| mine(*x) && fan.directions[r.0].factors.contains(&curve))
                else {
                    problems.push(Finding::TangentLost);
                    continue;
                };
                let ray = (fan.directions[*d].key(), *backward);
                *count.entry((site.fan, ray)).or_insert(0usize) += 1;
                arcs.push(SiteArc {
                    ray,
                    right: up,
                    curve,
                    chain: Vec::new(),
                    end: [0.0; 2],
                    middle: [0.0; 2],
                });
            }
            self.sites.get_mut(&(q, k, p)).expect("a site").arcs = arcs;
        }
        for site in self.sites.values() {
            let fan = &self.fans[site.fan];
            for sector in &fan.sectors {
                let (d, backward) = sector.rays[0];
                let d = &fan.directions[d];
                let found = count
                    .get(&(site.fan, (d.key(), backward)))
                    .copied()
                    .unwrap_or(0);
                if !fan.is_side(d) && found != self.arcs_along(fan, sector.rays[0]) {
                    problems.push(Finding::TangentsDisagree);
                }
            }
        }
    }

    /// How many drawn arcs have a ray as their tangent.
    pub(super) fn arcs_along(&self, fan: &Fan, ray: (usize, bool)) -> usize {
        let at = |i: usize| {
            fan.sectors
                .iter()
                .find(|s| s.rays[i] == ray)
                .is_some_and(|s| s.inside)
        };
        match (at(1), at(0)) {
            (true, true) => fan.directions[ray.0]
                .factors
                .iter()
                .filter(|f| self.curves.is_drawn_inside(**f))
                .count(),
            (false, false) => 0,
            _ => 1,
        }
    }
}

/// The rays, in their order, of arcs in theirs: each ray says whether it may have fewer arcs than
/// so many, and which curves they may belong to.
fn in_turn(curves: &[usize], rays: &[(bool, usize, &[usize])]) -> Option<Vec<usize>> {
    let Some((&(optional, most, factors), rest)) = rays.split_first() else {
        return curves.is_empty().then(Vec::new);
    };
    let fits = curves
        .iter()
        .take(most)
        .take_while(|c| factors.contains(c))
        .count();
    let least = if optional { 0 } else { most };
    (least..=fits).rev().find_map(|n| {
        let others = in_turn(&curves[n..], rest)?;
        Some(
            std::iter::repeat_n(0, n)
                .chain(others.into_iter().map(|k| k + 1))
                .collect(),
        )
    })
}
