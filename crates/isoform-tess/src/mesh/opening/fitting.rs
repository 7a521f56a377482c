//! Rectangles around base points that hold nothing but the arcs that end there.

use super::Openings;
use super::site::{Site, SiteArc};
use isoform_algebra::RBig;

/// Arcs that rise more than this, per half width of a rectangle, leave it at the top or the bottom,
/// and steps to the place where. How often an arc that does not reach the side is looked at nearer
/// to the base point.
const STEEP: f64 = 4.0;
const SECANTS: usize = 12;
const SHORTENED: i32 = 6;

impl Openings<'_> {
    /// Heights of the rectangles for their widths, and the arcs followed to their sides. Returns
    /// the base points whose rectangles hold more than what ends in them.
    pub(super) fn fit_rectangles(&mut self) -> Vec<usize> {
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
    pub(super) fn follow(&self, q: usize, at: [f64; 2], h: f64, arc: &mut SiteArc) -> bool {
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
    pub(super) fn is_alone(&self, q: usize, k: usize, p: usize, site: &Site) -> bool {
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
            let drawn = self.curves.drawn(q, slab);
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
}
