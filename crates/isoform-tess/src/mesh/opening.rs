//! Where base points are opened: rectangles around them whose vertices lie in the directions of
//! their fans.
//!
//! A triangle with a base point as corner becomes a quadrilateral, whose fourth side is a piece of
//! the seam curve.

use super::chart::keeps_sign_on;
use super::{Builder, Curves, Name, OPEN_HALVINGS, Ray, Site, SiteArc, distance, middle};
use crate::base::BasePoint;
use crate::fan::{Direction, Fan, Sector};
use crate::finding::{Finding, Phase};
use crate::map::Map;
use crate::surface::Point3;
use isoform_algebra::{Poly, RBig};
use isoform_control::Stopped;
use isoform_geom::distance_to_segment;
use std::collections::{BTreeMap, BTreeSet};

/// Largest half width of a rectangle, halvings of it, and directions of a base point.
const WIDTH: f64 = 1.0 / 16.0;
const ROUNDS: usize = 60;
const DIRECTIONS: usize = 2000;
/// Where base points are infinitely near, rays differ in high powers of the width: it has to be
/// large for them to be told apart.
const NEAR_WIDTH: f64 = 1.0 / 4.0;
const NEAR_ROUNDS: usize = 40;
/// How far from the middle of an edge of such a rectangle what is in the middle of its parameters
/// may be, per length.
const UNEVEN: f64 = 0.15;

/// How far a seam may bulge beyond its chord, per width of the strip, and the shortest chords, per
/// longest allowed, that are divided for it.
const ROOM: f64 = 1.0;
const SHORT: f64 = 0.003;

/// Arcs that rise more than this, per half width of a rectangle, leave it at the top or the bottom,
/// and steps to the place where. How often an arc that does not reach the side is looked at nearer
/// to the base point.
const STEEP: f64 = 4.0;
const SECANTS: usize = 12;
const SHORTENED: i32 = 6;

impl Builder<'_> {
    pub(super) fn find_contracted(&mut self, map: &Map, curves: &Curves) {
        for side in 0..3 {
            let on: [Poly; 4] = map.forms().each_ref().map(|f| f.set(side, &RBig::ZERO));
            let rest: Vec<&Poly> = on.iter().filter(|f| !f.is_zero()).collect();
            if rest.windows(2).all(|w| w[0].is_associate(w[1])) {
                let [x, y, z, w] = on
                    .each_ref()
                    .map(|f| f.leading_coefficient().to_f64().value());
                let image = self.image_of([x / w, y / w, z / w]);
                self.on_side[side] = Some(image);
            }
        }
        let mut extra = self.atlas.region.extra.iter();
        for (_, images) in &curves.contracted {
            let images: Vec<usize> = images.iter().map(|&p| self.image_of(p)).collect();
            for &f in extra.next().into_iter().flatten() {
                self.on_curve.entry(f).or_default().extend(&images);
            }
        }
        let mut factors = |n: usize| {
            extra
                .by_ref()
                .take(n)
                .flatten()
                .copied()
                .collect::<BTreeSet<usize>>()
        };
        self.double = factors(curves.double.len());
        self.creased = factors(curves.creased.len());
        self.seams = factors(curves.seams().len());
        self.double.extend(&self.seams);
        // Sheets may end in one curve.
        if curves.glued {
            self.double.extend(self.atlas.region.folds());
            (0..3).for_each(|k| self.double_sides[k] |= self.atlas.region.is_fold_side(k));
        }
    }
    /// The number of an image.
    fn image_of(&mut self, p: Point3) -> usize {
        let known = self
            .images
            .iter()
            .position(|&q| distance(p, q) <= 1e-12 * self.atlas.half_width);
        known.unwrap_or_else(|| {
            self.images.push(p);
            self.images.len() - 1
        })
    }

    /// Finds the base points in the region and the rectangles around them.
    pub(super) fn open_base_points(&mut self, points: &[BasePoint], w: &Poly) {
        let opened: Result<Vec<Fan>, Stopped> = points
            .iter()
            .map(|p| Fan::new(p, self.atlas.region, w, self.atlas.control))
            .collect();
        match opened {
            Ok(fans) => self.fans = fans,
            // They are left open.
            Err(Stopped) => {
                let stopped = Finding::Stopped(Phase::Tangents);
                self.surface.findings.push(stopped);
            }
        }
        let contracted: Vec<Point3> = self
            .fans
            .iter()
            .filter(|f| f.problem.is_none())
            .flat_map(|f| f.contracted().collect::<Vec<_>>())
            .collect();
        for p in contracted {
            self.image_of(p);
        }
        self.folded = self.folded_seams();
        let mut problems = Vec::new();
        for (q, t) in self.atlas.region.triangles.iter().enumerate() {
            for (k, wall) in t.arrangement.walls.iter().enumerate() {
                for p in 0..wall.points.len() {
                    if !t.holds_point(k, p) || self.atlas.faces_at(q, k, p) != 0b11_1111 {
                        continue;
                    }
                    let at = self.atlas.place(q, k, p);
                    let is_on_side = || self.atlas.region.sides_of_point(q, k, p) != 0;
                    if self.atlas.region.domain.is_some() && is_on_side() {
                        problems.push(Finding::BasePointOnSide);
                        continue;
                    }
                    let near = |f: &Fan| {
                        f.place(q)
                            .is_some_and(|x| (x[0] - at[0]).hypot(x[1] - at[1]) < 1e-9)
                    };
                    match self.fans.iter().position(near) {
                        Some(fan) => match &self.fans[fan].problem {
                            Some(problem) => problems.push(problem.clone()),
                            None => {
                                self.sites.insert(
                                    (q, k, p),
                                    Site {
                                        fan,
                                        at,
                                        height: 0.0,
                                        arcs: Vec::new(),
                                    },
                                );
                            }
                        },
                        None => problems.push(Finding::BasePointUnrecognised),
                    }
                }
            }
        }
        if !self.sites.is_empty() {
            self.match_arcs(&mut problems);
            self.widths = self
                .fans
                .iter()
                .map(|f| if f.is_tree() { NEAR_WIDTH } else { WIDTH })
                .collect();
            let mut done = false;
            let mut halved = vec![0; self.fans.len()];
            for _ in 0..ROUNDS {
                if self.atlas.control.is_stopped() {
                    break;
                }
                let mut too_large = self.fit_rectangles();
                if too_large.is_empty() {
                    too_large = self.refine_directions();
                }
                done = too_large.is_empty();
                if done {
                    break;
                }
                if too_large
                    .iter()
                    .any(|&f| self.fans[f].is_tree() && halved[f] == NEAR_ROUNDS)
                {
                    break;
                }
                for f in too_large {
                    self.widths[f] *= if self.fans[f].is_tree() { 0.75 } else { 0.5 };
                    halved[f] += 1;
                }
            }
            if !done {
                problems.push(Finding::BasePointRough);
            }
        }
        if !problems.is_empty() {
            self.halvings = OPEN_HALVINGS;
        }
        self.surface.findings.extend(problems);
    }

    /// The rays to which the drawn arcs at base points are tangent. Both are known in their order
    /// around the base point, on either side of its wall: there is one way to match them.
    fn match_arcs(&mut self, problems: &mut Vec<Finding>) {
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
                let Some(curve) = from.and_then(|from| self.drawn_on(q, k, from)) else {
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
    fn arcs_along(&self, fan: &Fan, ray: (usize, bool)) -> usize {
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
                .filter(|f| self.is_drawn_inside(**f))
                .count(),
            (false, false) => 0,
            _ => 1,
        }
    }

    /// Heights of the rectangles for their widths, and the arcs followed to their sides. Returns
    /// the base points whose rectangles hold more than what ends in them.
    fn fit_rectangles(&mut self) -> Vec<usize> {
        let mut too_large: Vec<usize> = Vec::new();
        let mut sites = std::mem::take(&mut self.sites);
        let mut heights = self.widths.clone();
        // How far arcs rise over half the width, as far as they go.
        let mut rises: Vec<Vec<f64>> = vec![Vec::new(); self.fans.len()];
        for (&(q, _, _), site) in &mut sites {
            let (h, at) = (self.widths[site.fan], site.at);
            for arc in site.arcs.iter_mut().filter(|x| !x.chain.is_empty()) {
                let reach = (0..SHORTENED)
                    .map(|k| h * 0.25f64.powi(k))
                    .find(|&reach| self.follow(q, at, reach, arc));
                match reach {
                    Some(reach) => rises[site.fan].push(arc.rise(at) * (h / reach)),
                    None => too_large.push(site.fan),
                }
            }
        }
        for (height, mut rises) in heights.iter_mut().zip(rises) {
            let width = *height;
            rises.sort_by(f64::total_cmp);
            for rise in rises {
                if 1.25 * rise > *height && (rise < STEEP * width || rise < 1.3 * *height) {
                    *height = 1.25 * rise;
                }
            }
        }
        // Steeper arcs leave it at the top or the bottom.
        for (&(q, _, _), site) in &mut sites {
            let (at, h, height) = (site.at, self.widths[site.fan], heights[site.fan]);
            for arc in site.arcs.iter_mut().filter(|x| !x.chain.is_empty()) {
                let reach = |arc: &SiteArc| (arc.end[0] - at[0]).abs();
                let is_at_side = |arc: &SiteArc| reach(arc) >= 0.99 * h && arc.rise(at) <= height;
                let is_at_top = |arc: &SiteArc| (1.0..=1.01).contains(&(arc.rise(at) / height));
                let mut steps = 0..SECANTS;
                while !too_large.contains(&site.fan) && !is_at_side(arc) && !is_at_top(arc) {
                    let to = reach(arc) * (1.005 * height / arc.rise(at));
                    if steps.next().is_none() || to > h || !self.follow(q, at, to, arc) {
                        too_large.push(site.fan);
                    }
                }
            }
        }
        for site in sites.values_mut() {
            site.height = heights[site.fan];
            let [u, v] = site.at;
            for x in site.arcs.iter_mut().filter(|x| x.chain.is_empty()) {
                let height = if x.right { site.height } else { -site.height };
                (x.end, x.middle) = ([u, v + height], [u, v + 0.5 * height]);
            }
        }
        for (&(q, k, p), site) in &sites {
            if !too_large.contains(&site.fan) && !self.is_alone(q, k, p, site) {
                too_large.push(site.fan);
            }
            // Rectangles of two base points do not touch.
            for (_, other) in sites
                .range((q, 0, 0)..(q + 1, 0, 0))
                .filter(|s| s.1.fan != site.fan)
            {
                let apart = (other.at[0] - site.at[0]).abs()
                    > 2.0 * (self.widths[site.fan] + self.widths[other.fan])
                    || (other.at[1] - site.at[1]).abs() > 1.1 * (site.height + other.height);
                if !apart && self.widths[site.fan] >= self.widths[other.fan] {
                    too_large.push(site.fan);
                }
            }
        }
        self.sites = sites;
        too_large.sort_unstable();
        too_large.dedup();
        too_large
    }

    /// Follows an arc from a base point to the side of its rectangle, over walls on which nothing
    /// happens to it. False if it does not get there.
    fn follow(&self, q: usize, at: [f64; 2], h: f64, arc: &mut SiteArc) -> bool {
        let a = &self.atlas.region.triangles[q].arrangement;
        let to = if arc.right { at[0] + h } else { at[0] - h };
        arc.chain.truncate(1);
        loop {
            let &(slab, i) = arc.chain.last().expect("the first slab");
            let (wall, end) = if arc.right {
                (slab + 1, a.slabs[slab].arcs[i].right)
            } else {
                (slab, a.slabs[slab].arcs[i].left)
            };
            let u = a.walls[wall].u.to_f64();
            if if arc.right { to < u } else { to > u } {
                break;
            }
            let next = if arc.right {
                slab + 1
            } else {
                slab.wrapping_sub(1)
            };
            if next >= a.slabs.len() || a.walls[wall].points[end].curves != [arc.curve] {
                return false;
            }
            let goes_on = |x: &isoform_algebra::Arc| {
                x.curve == arc.curve
                    && if arc.right {
                        x.left == end
                    } else {
                        x.right == end
                    }
            };
            let mut on = (0..a.slabs[next].arcs.len()).filter(|&j| goes_on(&a.slabs[next].arcs[j]));
            let (Some(j), None) = (on.next(), on.next()) else {
                return false;
            };
            arc.chain.push((next, j));
        }
        let over = |u: f64| {
            let &(slab, i) = arc.chain.iter().find(|(slab, _)| {
                u > a.walls[*slab].u.to_f64() && u < a.walls[slab + 1].u.to_f64()
            })?;
            Some([u, *a.arcs_over(slab, &RBig::try_from(u).ok()?)?.get(i)?])
        };
        // On a wall by chance: near enough to the middle.
        let halfway = over(0.5 * (at[0] + to)).or_else(|| over(at[0] + 0.51 * (to - at[0])));
        let (Some(end), Some(middle)) = (over(to), halfway) else {
            return false;
        };
        (arc.end, arc.middle) = (end, middle);
        true
    }

    /// Whether the rectangle around a base point holds nothing but the arcs that end in it.
    fn is_alone(&self, q: usize, k: usize, p: usize, site: &Site) -> bool {
        let t = &self.atlas.region.triangles[q];
        let a = &t.arrangement;
        let h = self.widths[site.fan];
        let near = |v: f64| (v - site.at[1]).abs() < 1.2 * site.height;
        let passed: Vec<(usize, usize)> = site.arcs.iter().flat_map(|x| x.passed(a)).collect();
        for (w, wall) in a.walls.iter().enumerate() {
            let u = wall.u.to_f64();
            if (u - site.at[0]).abs() > 1.2 * h {
                continue;
            }
            for (j, point) in wall.points.iter().enumerate() {
                let is_side = j == 0 || j + 1 == wall.points.len();
                let v = if j == 0 {
                    0.0
                } else if is_side {
                    1.0 - u
                } else {
                    point.lo.to_f64().value()
                };
                let mine = (w, j) == (k, p) || passed.contains(&(w, j));
                // The sides themselves may go through the rectangle if the base point is on them.
                let along_side = is_side
                    && !t.is_real(w, j)
                    && (site.at[1] == 0.0 && j == 0 || site.at[0] + site.at[1] == 1.0 && j > 0);
                if !mine && !along_side && near(v) && (is_side || t.holds_point(w, j)) {
                    return false;
                }
            }
        }
        for (right, u) in [(false, site.at[0] - h), (true, site.at[0] + h)] {
            if !(0.0..=1.0).contains(&u) {
                // Beyond the triangle: the base point has to be on that side of it.
                if if right {
                    site.at[0] < 1.0 && site.at[0] + site.at[1] != 1.0
                } else {
                    site.at[0] > 0.0
                } {
                    return false;
                }
                continue;
            }
            let slab = a.walls[1..a.walls.len() - 1].partition_point(|w| w.u.to_f64() < u);
            // Walls may be closer to each other than rounding.
            let Some(over) = RBig::try_from(u).ok().and_then(|u| a.arcs_over(slab, &u)) else {
                return false;
            };
            let last = over.len().saturating_sub(1);
            let drawn = self.drawn(q, slab);
            for (i, &v) in over
                .iter()
                .enumerate()
                .filter(|(i, _)| *i == 0 || *i == last || drawn.contains(i))
            {
                let mine = site
                    .arcs
                    .iter()
                    .any(|x| x.right == right && x.chain.last() == Some(&(slab, i)))
                    || i == 0 && site.at[1] == 0.0
                    || i == last && site.at[0] + site.at[1] == 1.0;
                if !mine && near(v) {
                    return false;
                }
            }
        }
        true
    }

    /// The vertices of the rectangle in a direction, if that leads into the unit triangle,
    /// counterclockwise: the ends of the arcs that have this tangent, what keeps double ones apart,
    /// and the place on a side along it.
    pub(super) fn ring(
        &self,
        q: usize,
        site: &Site,
        d: &Direction,
        backward: bool,
    ) -> Vec<[f64; 2]> {
        let mut found: Vec<[f64; 2]> = site
            .arcs
            .iter()
            .filter(|x| x.ray == (d.key(), backward))
            .map(|x| x.end)
            .collect();
        if found.is_empty() || self.fans[site.fan].is_side(d) {
            found.extend(self.straight(q, site, d, backward));
        }
        // They span less than half a turn.
        found.sort_by(|a, b| {
            let [x, y] = [a, b].map(|p| [p[0] - site.at[0], p[1] - site.at[1]]);
            0.0f64.total_cmp(&(x[0] * y[1] - x[1] * y[0]))
        });
        // Between two arcs of the double curve with one tangent no edge may lead from one to the
        // other: another sheet may have it, too.
        let is_double = |at: [f64; 2]| {
            site.arcs
                .iter()
                .any(|x| x.end == at && self.double.contains(&x.curve))
        };
        for k in (1..found.len())
            .rev()
            .filter(|&k| is_double(found[k - 1]) && is_double(found[k]))
            .collect::<Vec<_>>()
        {
            found.insert(k, [0, 1].map(|i| 0.5 * (found[k - 1][i] + found[k][i])));
        }
        found
    }

    /// Where a ray leaves the rectangle.
    fn straight(&self, q: usize, site: &Site, d: &Direction, backward: bool) -> Option<[f64; 2]> {
        let h = self.widths[site.fan];
        let fan = &self.fans[site.fan];
        if d.node > 0 && !fan.is_side(d) {
            return fan.on_ray(q, d, backward, self.reach(q, site, d, backward)?);
        }
        let [du, dv] = match d.node {
            0 => fan.direction_in(q, d, backward),
            // Along the side.
            _ => fan
                .on_ray(q, d, backward, 1e-3)
                .map(|x| [x[0] - site.at[0], x[1] - site.at[1]]),
        }?;
        let dv = if du != 0.0 && site.at[0] + site.at[1] == 1.0 && (du + dv).abs() < 1e-15 {
            -du
        } else {
            dv
        };
        let [u, v] = site.at;
        if du.abs() * site.height >= h * dv.abs() {
            let x = if du > 0.0 { u + h } else { u - h };
            let y = if dv == -du && u + v == 1.0 {
                1.0 - x
            } else {
                v + dv * (h / du.abs())
            };
            Some([x, y])
        } else {
            Some([
                u + du * (site.height / dv.abs()),
                if dv > 0.0 {
                    v + site.height
                } else {
                    v - site.height
                },
            ])
        }
    }

    /// How far a ray of an infinitely near point reaches in its rectangle.
    fn reach(&self, q: usize, site: &Site, d: &Direction, backward: bool) -> Option<f64> {
        let (fan, h) = (&self.fans[site.fan], self.widths[site.fan]);
        let is_out = |distance: f64| {
            fan.on_ray(q, d, backward, distance).is_none_or(|x| {
                (x[0] - site.at[0]).abs() > h || (x[1] - site.at[1]).abs() > site.height
            })
        };
        fan.beginning(q, d, backward)?;
        let mut hi = 1e-6;
        while !is_out(hi) && hi < 1e6 {
            hi *= 1.5;
        }
        let mut lo = hi / 1.5;
        for _ in 0..60 {
            let middle = 0.5 * (lo + hi);
            if is_out(middle) {
                hi = middle
            } else {
                lo = middle
            }
        }
        (hi > 1e-6).then_some(lo)
    }
    /// Halfway on a ray from the base point to a vertex of the rectangle.
    fn halfway(
        &self,
        q: usize,
        site: &Site,
        d: &Direction,
        backward: bool,
        end: [f64; 2],
    ) -> [f64; 2] {
        let fan = &self.fans[site.fan];
        let straight = [0.5 * (site.at[0] + end[0]), 0.5 * (site.at[1] + end[1])];
        if d.node == 0 || fan.is_side(d) {
            return straight;
        }
        self.reach(q, site, d, backward)
            .and_then(|r| fan.on_ray(q, d, backward, 0.5 * r))
            .unwrap_or(straight)
    }
    /// Points of the surface between a vertex of the rectangle and the seam, from the rectangle on,
    /// where base points are infinitely near: there is no room for rectangles that are small in
    /// space.
    pub(super) fn points_on_ray(
        &self,
        q: usize,
        site: &Site,
        fan: &Fan,
        d: &Direction,
        backward: bool,
        at: [f64; 2],
    ) -> Vec<Point3> {
        let key = (d.key(), backward);
        let arc = site.arcs.iter().find(|x| x.ray == key && x.end == at);
        let face = arc.and_then(|x| self.atlas.region.faces[x.curve].first().copied());
        let x = fan.lifted(q, at, d.node);
        let reach = (0..2).map(|i| x[i] * d.signed(backward)[i]).sum::<f64>();
        let drawn = site.arcs.iter().filter(|x| x.ray == key).count();
        if !fan.is_tree()
            || drawn > 1
            || (arc.is_some() && face.is_none())
            || !(reach > 0.0 && reach.is_finite())
        {
            return Vec::new();
        }
        let on = |t: f64| fan.image_on_ray(d, backward, t * reach, face);
        let first = self
            .atlas
            .image(q, at, arc.map_or(0, |x| self.atlas.bits(x.curve)));
        let mut found = Vec::new();
        let mut stack = vec![(1.0, first, 0.0, fan.seam(d), 0)];
        while let Some((a, p, b, r, depth)) = stack.pop() {
            let quarters = [0.75, 0.5, 0.25].map(|t| on(b + t * (a - b)));
            let off = quarters
                .iter()
                .map(|&x| distance_to_segment(x, [p, r]))
                .fold(0.0, f64::max);
            if depth < 12
                && (off > 0.3 * self.atlas.tolerance_at(p)
                    || distance(p, r) > self.atlas.options.longest)
            {
                let m = 0.5 * (a + b);
                stack.extend([
                    (m, quarters[1], b, r, depth + 1),
                    (a, p, m, quarters[1], depth + 1),
                ]);
            } else if b > 0.0 {
                found.push(r);
            }
        }
        found
    }

    /// The two vertices between which a sector lies in a unit triangle.
    pub(super) fn sector_ends(
        &self,
        q: usize,
        site: &Site,
        fan: &Fan,
        sector: &Sector,
    ) -> Option<[[f64; 2]; 2]> {
        let [first, second] = sector.rays.map(|(k, b)| {
            let d = &fan.directions[k];
            fan.beginning(q, d, b).map(|_| self.ring(q, site, d, b))
        });
        let (first, second) = (first?, second?);
        let ends = if fan.keeps_turn(q) {
            (first.last(), second.first())
        } else {
            (first.first(), second.last())
        };
        Some([*ends.0?, *ends.1?])
    }

    /// Vertices on larger and larger rectangles around base points, in all their directions: the
    /// map turns along the seam as fast as ever on small circles, and triangles that lead straight
    /// from there to far vertices would be too thin. With the places to which edges lead from them:
    /// those next to them on their own ring and on the one before, along the rays. Nearest ones are
    /// beside the rays on a long rectangle.
    pub(super) fn rings_around(&self, q: usize) -> Vec<([f64; 2], Vec<[f64; 2]>)> {
        let mut found = Vec::new();
        let here: Vec<&Site> = self
            .sites
            .range((q, 0, 0)..(q + 1, 0, 0))
            .map(|s| s.1)
            .collect();
        for site in &here {
            let fan = &self.fans[site.fan];
            let apart = |other: &&&Site| {
                (other.at[0] - site.at[0])
                    .abs()
                    .max((other.at[1] - site.at[1]).abs())
            };
            let nearest = here
                .iter()
                .filter(|s| s.at != site.at)
                .map(|s| apart(&s))
                .fold(1.0, f64::min);
            let mut last: BTreeMap<usize, Point3> = BTreeMap::new();
            // By sectors, those of the ring before; none on the rectangle itself.
            let mut inner: Option<BTreeMap<usize, [f64; 2]>> = None;
            let mut scale = 1.0;
            // Every other ring lies between the directions: vertices on one line would leave no
            // room for flips.
            let mut is_between = false;
            while scale * site.height < 0.4 * nearest {
                let mut ring = Vec::new();
                for (s, sector) in fan.sectors.iter().enumerate() {
                    let before = &fan.sectors[(s + fan.sectors.len() - 1) % fan.sectors.len()];
                    let (k, backward) = sector.rays[0];
                    let d = &fan.directions[k];
                    if !sector.inside
                        || !is_between
                            && (!before.inside || !d.factors.is_empty() || fan.is_side(d))
                    {
                        continue;
                    }
                    let (d, backward) = if is_between {
                        fan.between(sector, 0)
                    } else {
                        (d.clone(), backward)
                    };
                    let at = match d.node {
                        0 => self
                            .straight(q, site, &d, backward)
                            .map(|at| [0, 1].map(|i| site.at[i] + scale * (at[i] - site.at[i]))),
                        _ => self
                            .reach(q, site, &d, backward)
                            .and_then(|r| fan.on_ray(q, &d, backward, scale * r)),
                    };
                    let Some(at) = at else { continue };
                    if at[0] > 0.0 && at[1] > 0.0 && at[0] + at[1] < 1.0 {
                        ring.push((s, at, self.atlas.charts[q].at(at)));
                    }
                }
                // A ring as near to the last one as its vertices are to each other, in space, makes
                // triangles that are round; nearer ones do not.
                let median = |mut x: Vec<f64>| {
                    x.sort_by(f64::total_cmp);
                    x.get(x.len() / 2).copied()
                };
                let along = median(ring.windows(2).map(|w| distance(w[0].2, w[1].2)).collect());
                let across = median(
                    ring.iter()
                        .filter_map(|(ray, _, p)| Some(distance(*last.get(ray)?, *p)))
                        .collect(),
                );
                if scale == 1.0
                    || across
                        .zip(along)
                        .is_none_or(|(across, along)| across > along)
                {
                    last = ring.iter().map(|(ray, _, p)| (*ray, *p)).collect();
                    if scale > 1.0 {
                        let here: BTreeMap<usize, [f64; 2]> =
                            ring.iter().map(|x| (x.0, x.1)).collect();
                        let n = fan.sectors.len();
                        for (s, at, _) in ring {
                            // Rays of infinitely near points.
                            let is_bent = fan.sectors[s]
                                .rays
                                .iter()
                                .any(|r| fan.directions[r.0].node > 0);
                            // Between its rays, or from the sector before to its own.
                            let beside = if is_between {
                                [s, (s + 1) % n]
                            } else {
                                [(s + n - 1) % n, s]
                            };
                            let legs = match &inner {
                                _ if is_bent => Vec::new(),
                                Some(inner) => beside
                                    .iter()
                                    .filter_map(|s| inner.get(s))
                                    .copied()
                                    .collect(),
                                None => self
                                    .sector_ends(q, site, fan, &fan.sectors[s])
                                    .map_or_else(Vec::new, |ends| ends.to_vec()),
                            };
                            let along = here.get(&((s + n - 1) % n)).copied().filter(|_| !is_bent);
                            found.push((at, legs.into_iter().chain(along).collect()));
                        }
                        inner = Some(here);
                    }
                    is_between = !is_between;
                }
                scale *= 1.5;
            }
        }
        found
    }

    /// More directions, until seams and rectangles are near the surface and W keeps its sign.
    /// Returns the base points whose rectangles are too large for that.
    fn refine_directions(&mut self) -> Vec<usize> {
        let mut too_large = Vec::new();
        for f in 0..self.fans.len() {
            let mut fan = self.fans[f].clone();
            let sites: Vec<(usize, &Site)> = self
                .sites
                .iter()
                .filter(|s| s.1.fan == f)
                .map(|(key, s)| (key.0, s))
                .collect();
            if sites.is_empty() || self.refine_fan(&mut fan, &sites) {
                self.fans[f] = fan;
            } else {
                too_large.push(f);
            }
        }
        too_large
    }

    fn refine_fan(&self, fan: &mut Fan, sites: &[(usize, &Site)]) -> bool {
        // By their rays: splitting one leaves the others as they are.
        let mut done: BTreeSet<[Ray; 2]> = BTreeSet::new();
        'again: loop {
            for s in 0..fan.sectors.len() {
                let sector = &fan.sectors[s];
                let name = sector
                    .rays
                    .map(|(k, backward)| (fan.directions[k].key(), backward));
                if !sector.inside || done.contains(&name) {
                    continue;
                }
                if self.atlas.control.is_stopped() {
                    return false;
                }
                match self.look(fan, sector, sites) {
                    Look::Fine => drop(done.insert(name)),
                    Look::TooLarge => return false,
                    Look::Split(d) if fan.directions.len() < DIRECTIONS => {
                        fan.split(d);
                        continue 'again;
                    }
                    Look::Split(_) => return false,
                }
            }
            return true;
        }
    }

    /// What a sector needs.
    fn look(&self, fan: &Fan, sector: &Sector, sites: &[(usize, &Site)]) -> Look {
        let ends = sector.rays.map(|(k, _)| fan.seam(&fan.directions[k]));
        // The pieces of the seam: one, or one to the corner and one from there.
        let pieces: Vec<[Point3; 2]> = match &sector.corner {
            None => vec![ends],
            Some(corner) => ends.iter().map(|&p| [p, fan.seam(corner)]).collect(),
        };
        let mut rough: Vec<bool> = Vec::new();
        for (piece, ends) in pieces.iter().enumerate() {
            rough.push(!self.is_near_chord(fan.seam(&fan.between(sector, piece).0), *ends));
        }
        // Between two arcs of the double curve the strip needs vertices that are on none: another
        // sheet may have edges from one to the other, too.
        let is_end = |k: usize| {
            let d = &fan.directions[k];
            fan.is_fold(d) || d.factors.iter().any(|f| self.double.contains(f))
        };
        let crowded = sector.rays.iter().all(|r| is_end(r.0));
        let mut fine = !crowded && !rough.contains(&true);
        let mut longest = pieces
            .iter()
            .map(|[p, r]| distance(*p, *r))
            .fold(0.0, f64::max);
        let mut worse = usize::from(rough.len() > 1 && rough[1]);
        for &(q, site) in sites {
            let Some([a, b]) = self.sector_ends(q, site, fan, sector) else {
                continue;
            };
            let cross = |x: [f64; 2], y: [f64; 2]| x[0] * y[1] - x[1] * y[0];
            let from_base = |x: [f64; 2]| [x[0] - site.at[0], x[1] - site.at[1]];
            let turn = if fan.keeps_turn(q) { 1.0 } else { -1.0 };
            // An arc that bends away from its tangent may be beyond the next direction.
            if turn * cross(from_base(a), from_base(b)) <= 0.0 {
                return Look::TooLarge;
            }
            let image = |x: [f64; 2]| self.atlas.charts[q].at(x);
            let half = |a: [f64; 2], b: [f64; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            let mut points = vec![a, b];
            for ((end, at), (k, backward)) in ends.iter().zip([a, b]).zip(sector.rays) {
                let arc = site
                    .arcs
                    .iter()
                    .find(|x| x.ray == (fan.directions[k].key(), backward) && x.end == at);
                // Halfway on an arc, not on its chord: it is the arc that bounds the surface. In
                // trees strips have vertices in between.
                let halfway = arc.map_or_else(
                    || self.halfway(q, site, &fan.directions[k], backward, at),
                    |x| x.middle,
                );
                if !fan.is_tree() && !self.is_near_chord(image(halfway), [*end, image(at)]) {
                    return Look::TooLarge;
                }
                points.extend(arc.map(|x| x.middle));
                // Rays that are bent.
                let reach = if fan.is_tree() && arc.is_none() {
                    self.reach(q, site, &fan.directions[k], backward)
                } else {
                    None
                };
                points.extend(
                    [0.25, 0.5, 0.75]
                        .into_iter()
                        .filter_map(|t| fan.on_ray(q, &fan.directions[k], backward, t * reach?)),
                );
            }
            let chord = [image(a), image(b)];
            let on = image(half(a, b));
            // Beyond the chord of the seam, others at the rectangle would lie on the wrong side of
            // it.
            if let [[p, r]] = pieces[..] {
                let seam = fan.seam(&fan.between(sector, 0).0);
                let bulge = distance_to_segment(seam, [p, r]);
                let width = distance_to_segment(on, [p, r]).min(distance(on, seam));
                if longest > SHORT * self.atlas.options.longest && bulge > ROOM * width {
                    fine = false;
                }
            }
            if fan.is_tree() {
                longest = longest.max(distance(chord[0], chord[1]));
            }
            points
                .extend((1..8).map(|i| [0, 1].map(|k| a[k] + f64::from(i) / 8.0 * (b[k] - a[k]))));
            let is_signed = self.atlas.charts[q].keeps_sign([site.at, a, b], fan.multiplicity)
                // The parameters inside are in a cell of the region, in which W has no zero; what
                // is left are edges of the rectangle that leave it.
                || fan.is_tree()
                    && self.atlas.charts[q].keeps_sign([a, b, a], 0)
                    && fan.keeps_sign(q, sector, &points, &keeps_sign_on);
            // In trees, where the map is far from even, the point may slide along the chord, but
            // not so far that triangles beside it were uneven.
            let off = distance(on, middle(chord[0], chord[1]));
            let is_even = off <= UNEVEN * distance(chord[0], chord[1])
                || off <= 0.5 * self.atlas.tolerance_at(on);
            let is_near = if fan.is_tree() {
                is_even && self.is_near_chord(on, chord)
            } else {
                self.is_near(on, middle(chord[0], chord[1]), chord)
            };
            if !is_near || !is_signed {
                if fine && sector.corner.is_some() {
                    // Where the ray in the middle is farther away from the ends.
                    let apart = [0, 1].map(|piece| {
                        let (d, backward) = fan.between(sector, piece);
                        let found = self.straight(q, site, &d, backward).map(image);
                        found.map_or(0.0, |p| distance(p, chord[0]).min(distance(p, chord[1])))
                    });
                    worse = usize::from(apart[1] > apart[0]);
                }
                fine = false;
            }
            // Between arcs with one tangent.
            for (k, backward) in sector.rays {
                for w in self.ring(q, site, &fan.directions[k], backward).windows(2) {
                    if !self.atlas.charts[q].keeps_sign([site.at, w[0], w[1]], fan.multiplicity)
                        || cross(from_base(w[0]), from_base(w[1])) <= 0.0
                    {
                        return Look::TooLarge;
                    }
                }
            }
        }
        let least = if fan.is_tree() { 0.01 } else { 0.1 };
        match fine {
            true => Look::Fine,
            // What is not fine is not the seam then: an arc is too far from its tangent.
            false if longest < least * self.atlas.tolerance_at(ends[0]) => Look::TooLarge,
            false if !fan.is_tree() => Look::Split(fan.between(sector, 0).0),
            false => {
                // Rays of two nodes, and arcs, have their order next to the base point, but not
                // everywhere.
                let is_between = |(d, backward): &(Direction, bool)| {
                    sites.iter().all(|&(q, site)| {
                        let Some([a, b]) = self.sector_ends(q, site, fan, sector) else {
                            return true;
                        };
                        let Some(x) = self.straight(q, site, d, *backward) else {
                            return false;
                        };
                        let orient = |a: [f64; 2], b: [f64; 2]| {
                            let [a, b] = [a, b].map(|x| [x[0] - site.at[0], x[1] - site.at[1]]);
                            if fan.keeps_turn(q) {
                                a[0] * b[1] - a[1] * b[0]
                            } else {
                                a[1] * b[0] - a[0] * b[1]
                            }
                        };
                        orient(a, x) > 0.0 && orient(x, b) > 0.0
                    })
                };
                let pieces = if sector.corner.is_some() {
                    vec![worse, 1 - worse]
                } else {
                    vec![0]
                };
                let halfway = pieces.iter().flat_map(|&piece| {
                    sites.iter().filter_map(move |&(q, site)| {
                        let [a, b] = self.sector_ends(q, site, fan, sector)?;
                        fan.toward(q, [0, 1].map(|i| 0.5 * (a[i] + b[i])), sector, piece)
                    })
                });
                let mut candidates = pieces
                    .iter()
                    .map(|&piece| fan.between(sector, piece))
                    .chain(halfway);
                candidates
                    .find(is_between)
                    .map_or(Look::TooLarge, |(d, _)| Look::Split(d))
            }
        }
    }

    /// Whether a point of a curve is near to a straight piece that stands for it and that is not
    /// divided any more, and the piece short. It may be anywhere along it: where arcs touch faces
    /// of the box, a curve leaves its end like a square root.
    fn is_near_chord(&self, on: Point3, [p, q]: [Point3; 2]) -> bool {
        distance_to_segment(on, [p, q]) <= 0.5 * self.atlas.tolerance_at(on)
            && distance(p, q) <= self.atlas.options.longest
    }
    /// Whether the middle of a straight piece is near to the surface, and the piece short.
    fn is_near(&self, on: Point3, chord: Point3, ends: [Point3; 2]) -> bool {
        distance(on, chord) <= 0.5 * self.atlas.tolerance_at(chord)
            && distance(ends[0], ends[1]) <= self.atlas.options.longest
    }

    /// The vertex of a seam: its name, position and faces, and whether it is the image of a
    /// contracted curve.
    pub(super) fn seam_vertex(&self, fan: usize, d: &Direction) -> (Name, Point3, u8) {
        let f = &self.fans[fan];
        let p = f.seam(d);
        let mut images: Vec<usize> = d
            .factors
            .iter()
            .filter_map(|f| self.on_curve.get(f))
            .flatten()
            .copied()
            .collect();
        images.extend(f.sides_along(d).filter_map(|side| self.on_side[side]));
        if f.is_contracted(d) {
            images.extend(0..self.images.len());
        }
        let near = |k: &usize| distance(self.images[*k], p) <= 1e-6 * self.atlas.half_width;
        match images.into_iter().find(near) {
            Some(k) => (Name::Image(k), self.images[k], 0),
            None => (Name::Seam(fan, d.key()), p, d.faces),
        }
    }

    /// The places of rectangles on a side that base points are on: the place of the base point, and
    /// those of the vertices.
    pub(super) fn places_on(&self, side: usize, quadrants: &[usize]) -> Vec<(f64, [f64; 2])> {
        let mut places: Vec<(f64, [f64; 2])> = Vec::new();
        for (&(q, _, _), site) in &self.sites {
            let ([u, v], h) = (site.at, self.widths[site.fan]);
            let (on, x, step) = [
                (u == 0.0, v, site.height),
                (v == 0.0, u, h),
                (u + v == 1.0, u, h),
            ][side];
            if quadrants.contains(&q) && on {
                places.push((x, [x - step, x + step]));
            }
        }
        places
    }
}

/// What a sector needs: nothing, another direction, or a smaller rectangle.
enum Look {
    Fine,
    Split(Direction),
    TooLarge,
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
