//! Rectangles around base points that contain only the arcs that end there.
//!
//! ```text
//!     +-----------/---+   A rectangle of half width h has the height that arcs need to leave it
//!     |        __/    |   at its sides; steeper ones leave it at the top or the bottom.
//!     |     __/       |
//!     |    B----------|   B is the base point, on a wall of the arrangement.
//!     |     \__       |
//!     +--------\------+
//! ```

use super::site::{Site, SiteArc};
use super::{Openings, WallPoint};
use isoform_algebra::{Arc, Arrangement, RBig};
use std::collections::BTreeSet;

/// Ratio of the height of a rectangle to the rise of the highest arc that leaves it at a side.
const HEIGHT_FACTOR: f64 = 1.25;
/// Maximum number of steps of the secant method to the place where a steep arc leaves its
/// rectangle.
const MAX_SECANT_STEPS: usize = 12;
/// Distance from the centre of a rectangle, in half widths or heights, within which other curves
/// and points are in its way.
const CLEARANCE_FACTOR: f64 = 1.2;

impl SiteArc {
    /// Returns true for an arc over slabs, false for a vertical line.
    fn is_over_slabs(&self) -> bool {
        !self.chain.is_empty()
    }
    /// Returns the continuation of the arc in the next slab, beyond a point of a wall; `None` if
    /// another curve passes through the point or several arcs begin there.
    fn goes_on(&self, a: &Arrangement, (slab, i): (usize, usize)) -> Option<(usize, usize)> {
        let arc = a.slabs[slab].arcs[i];
        let (wall, point, next) = if self.right {
            (slab + 1, arc.right, slab + 1)
        } else {
            (slab, arc.left, slab.wrapping_sub(1))
        };
        if next >= a.slabs.len() || a.walls[wall].points[point].curves != [self.curve] {
            return None;
        }
        let begins = |x: &Arc| if self.right { x.left } else { x.right };
        let arcs = &a.slabs[next].arcs;
        let mut on =
            (0..arcs.len()).filter(|&j| arcs[j].curve == self.curve && begins(&arcs[j]) == point);
        match (on.next(), on.next()) {
            (Some(j), None) => Some((next, j)),
            _ => None,
        }
    }
    /// Extends the arc over walls that it crosses alone, up to a place. Returns false if it ends
    /// before.
    fn reach(&mut self, a: &Arrangement, to: f64) -> bool {
        self.chain.truncate(1);
        loop {
            let &(slab, i) = self.chain.last().expect("the first slab");
            let is_there = if self.right {
                to < a.walls[slab + 1].u.to_f64()
            } else {
                to > a.walls[slab].u.to_f64()
            };
            if is_there {
                return true;
            }
            match self.goes_on(a, (slab, i)) {
                Some(next) => self.chain.push(next),
                None => return false,
            }
        }
    }
    /// Returns the point of the arc over a place between walls, as far as it has been extended.
    fn over(&self, a: &Arrangement, u: f64) -> Option<[f64; 2]> {
        let is_over =
            |slab: usize| u > a.walls[slab].u.to_f64() && u < a.walls[slab + 1].u.to_f64();
        let &(slab, i) = self.chain.iter().find(|c| is_over(c.0))?;
        let heights = a.arcs_over(slab, &RBig::try_from(u).ok()?)?;
        Some([u, *heights.get(i)?])
    }
    /// Follows the arc from its base point to a horizontal distance. Returns false if it ends
    /// before.
    fn follow(&mut self, a: &Arrangement, base: [f64; 2], distance: f64) -> bool {
        let to = if self.right {
            base[0] + distance
        } else {
            base[0] - distance
        };
        if !self.reach(a, to) {
            return false;
        }
        // The middle may lie on a wall by chance; a place next to it will do.
        let halfway = self
            .over(a, 0.5 * (base[0] + to))
            .or_else(|| self.over(a, base[0] + 0.51 * (to - base[0])));
        let (Some(end), Some(middle)) = (self.over(a, to), halfway) else {
            return false;
        };
        (self.end, self.middle) = (end, middle);
        true
    }
    /// Follows an arc towards the side of its rectangle up to the top or the bottom, if it rises as
    /// far. Returns false if it reaches neither.
    fn follow_to_border(
        &mut self,
        a: &Arrangement,
        base: [f64; 2],
        [width, height]: [f64; 2],
    ) -> bool {
        for step in 0..=MAX_SECANT_STEPS {
            let reach = (self.end[0] - base[0]).abs();
            let rise = self.rise(base);
            let is_at_side = reach >= 0.99 * width && rise <= height;
            let is_at_top = (1.0..=1.01).contains(&(rise / height));
            if is_at_side || is_at_top {
                return true;
            }
            let to = reach * (1.005 * height / rise);
            if step == MAX_SECANT_STEPS || to > width || !self.follow(a, base, to) {
                return false;
            }
        }
        false
    }
}

/// Returns the height of a rectangle of a given width, from the rises of its arcs over that width.
fn height(width: f64, mut rises: Vec<f64>) -> f64 {
    let mut height = width;
    rises.sort_by(f64::total_cmp);
    for rise in rises {
        // Steeper arcs leave the rectangle at the top or the bottom, and do not make it higher.
        if HEIGHT_FACTOR * rise > height && (rise < 4.0 * width || rise < 1.3 * height) {
            height = HEIGHT_FACTOR * rise;
        }
    }
    height
}

impl Openings<'_> {
    /// Sets the heights of the rectangles for their widths, and follows the arcs to their sides.
    /// Returns the base points whose rectangles contain more than the arcs that end in them.
    pub(super) fn fit_rectangles(&mut self) -> Vec<usize> {
        let mut too_large = BTreeSet::new();
        let mut sites = std::mem::take(&mut self.sites);
        let heights = self.follow_arcs(&mut sites.iter_mut(), &mut too_large);
        for (key, site) in &mut sites {
            site.height = heights[site.fan];
            if !too_large.contains(&site.fan) && !self.follow_steep_arcs(key.0, site) {
                too_large.insert(site.fan);
            }
            site.end_vertical_arcs();
        }
        self.sites = sites;
        for (&key, site) in &self.sites {
            let is_alone = too_large.contains(&site.fan) || self.is_alone(key, site);
            if !is_alone || self.is_too_near(key.0, site) {
                too_large.insert(site.fan);
            }
        }
        too_large.into_iter().collect()
    }

    /// Follows arcs over the widths of their rectangles. Returns the heights that they need.
    fn follow_arcs(
        &self,
        sites: &mut dyn Iterator<Item = (&WallPoint, &mut Site)>,
        too_large: &mut BTreeSet<usize>,
    ) -> Vec<f64> {
        // Rises of arcs over half the width, extrapolated where they end before.
        let mut rises: Vec<Vec<f64>> = vec![Vec::new(); self.fans.len()];
        for (key, site) in sites {
            let a = &self.atlas.region.triangles[key.0].arrangement;
            let (h, at) = (self.widths[site.fan], site.at);
            for arc in site.arcs.iter_mut().filter(|x| x.is_over_slabs()) {
                // An arc that does not reach the side of its rectangle is tried six times, each
                // time four times nearer to the base point, before the rectangle counts as too
                // large.
                let mut reaches = (0..6).map(|k| h * 0.25f64.powi(k));
                match reaches.find(|&reach| arc.follow(a, at, reach)) {
                    Some(reach) => rises[site.fan].push(arc.rise(at) * (h / reach)),
                    None => {
                        too_large.insert(site.fan);
                    }
                }
            }
        }
        let rises = self.widths.iter().zip(rises);
        rises.map(|(&w, rises)| height(w, rises)).collect()
    }

    /// Follows steep arcs to the top or the bottom of their rectangle. Returns false if one reaches
    /// neither.
    fn follow_steep_arcs(&self, q: usize, site: &mut Site) -> bool {
        let a = &self.atlas.region.triangles[q].arrangement;
        let (at, size) = (site.at, [self.widths[site.fan], site.height]);
        let mut arcs = site.arcs.iter_mut().filter(|x| x.is_over_slabs());
        arcs.all(|arc| arc.follow_to_border(a, at, size))
    }

    /// Returns true if another base point is so near that their rectangles may touch, and this one
    /// has the wider rectangle.
    fn is_too_near(&self, q: usize, site: &Site) -> bool {
        self.sites_in(q).map(|s| s.1).any(|other| {
            let (h, other_h) = (self.widths[site.fan], self.widths[other.fan]);
            let apart = (other.at[0] - site.at[0]).abs() > 2.0 * (h + other_h)
                || (other.at[1] - site.at[1]).abs() > 1.1 * (site.height + other.height);
            other.fan != site.fan && !apart && h >= other_h
        })
    }

    /// Returns true if the rectangle around a base point contains only the arcs that end in it.
    fn is_alone(&self, key: WallPoint, site: &Site) -> bool {
        let h = self.widths[site.fan];
        !self.holds_other_points(key, site)
            && self.is_free_at(key.0, site, false, site.at[0] - h)
            && self.is_free_at(key.0, site, true, site.at[0] + h)
    }

    /// Returns true if a rectangle contains, or nearly contains, points of walls that its arcs do
    /// not pass.
    fn holds_other_points(&self, (q, k, p): WallPoint, site: &Site) -> bool {
        let t = &self.atlas.region.triangles[q];
        let a = &t.arrangement;
        let passed: Vec<(usize, usize)> = site.arcs.iter().flat_map(|x| x.passed(a)).collect();
        let is_other = |w: usize, j: usize| {
            let points = &a.walls[w].points;
            let is_side = j == 0 || j + 1 == points.len();
            let v = match j {
                0 => 0.0,
                _ if is_side => 1.0 - a.walls[w].u.to_f64(),
                _ => points[j].lo.to_f64().value(),
            };
            let is_mine = (w, j) == (k, p) || passed.contains(&(w, j));
            // The sides themselves may pass through the rectangle if the base point is on them.
            let is_along_side = is_side
                && !t.is_real(w, j)
                && (site.at[1] == 0.0 && j == 0 || site.at[0] + site.at[1] == 1.0 && j > 0);
            !is_mine && !is_along_side && site.is_beside(v) && (is_side || t.holds_point(w, j))
        };
        a.walls.iter().enumerate().any(|(w, wall)| {
            (wall.u.to_f64() - site.at[0]).abs() <= CLEARANCE_FACTOR * self.widths[site.fan]
                && (0..wall.points.len()).any(|j| is_other(w, j))
        })
    }

    /// Returns true if only arcs of the base point cross the left or the right side of its
    /// rectangle, or pass nearby.
    fn is_free_at(&self, q: usize, site: &Site, right: bool, u: f64) -> bool {
        if !(0.0..=1.0).contains(&u) {
            // Beyond the triangle: the base point has to be on that side of it.
            return if right {
                site.at[0] >= 1.0 || site.at[0] + site.at[1] == 1.0
            } else {
                site.at[0] <= 0.0
            };
        }
        let a = &self.atlas.region.triangles[q].arrangement;
        let slab = a.walls[1..a.walls.len() - 1].partition_point(|w| w.u.to_f64() < u);
        // Walls may be closer together than rounding.
        let Some(over) = RBig::try_from(u).ok().and_then(|u| a.arcs_over(slab, &u)) else {
            return false;
        };
        let last = over.len().saturating_sub(1);
        let drawn = self.curves.drawn(q, slab);
        let is_mine = |i: usize| {
            let ends = |x: &SiteArc| x.right == right && x.chain.last() == Some(&(slab, i));
            site.arcs.iter().any(ends)
                || i == 0 && site.at[1] == 0.0
                || i == last && site.at[0] + site.at[1] == 1.0
        };
        !over.iter().enumerate().any(|(i, &v)| {
            (i == 0 || i == last || drawn.contains(&i)) && !is_mine(i) && site.is_beside(v)
        })
    }
}

impl Site {
    /// Returns true if a height is in the rectangle or near it.
    fn is_beside(&self, v: f64) -> bool {
        (v - self.at[1]).abs() < CLEARANCE_FACTOR * self.height
    }
    /// Ends the curves on the wall of the base point at the top or the bottom of the rectangle.
    fn end_vertical_arcs(&mut self) {
        let [u, v] = self.at;
        for x in self.arcs.iter_mut().filter(|x| !x.is_over_slabs()) {
            let height = if x.right { self.height } else { -self.height };
            (x.end, x.middle) = ([u, v + height], [u, v + 0.5 * height]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::height;

    /// A rectangle is as high as wide where arcs are flat, and has a margin above steeper arcs;
    /// arcs with a slope above 4 count only if they are hardly higher than others.
    #[test]
    fn rectangles_are_as_high_as_their_arcs_need() {
        assert_eq!(height(1.0, vec![0.5, 0.1]), 1.0);
        assert_eq!(height(1.0, vec![2.0, 0.1]), 2.5);
        assert_eq!(height(1.0, vec![100.0]), 1.0);
        assert_eq!(height(1.0, vec![100.0, 3.9]), 4.875);
        assert_eq!(height(0.5, vec![4.5, 3.9, 1.9]), 0.5 * 4.75);
        // 4.2 is less than 1.3 times the height that 3.9 needs.
        assert_eq!(height(1.0, vec![4.2, 3.9]), 1.25 * 4.2);
    }
}
