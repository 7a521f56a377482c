//! Pieces of arcs between two walls.

use super::geometry::{distance, middle};
use super::names::Ray;
use super::opening::{Openings, Site, SiteArc};
use super::{MAX_INTERVAL_VERTICES, MAX_TURN_BISECTIONS};
use crate::field::exact;
use isoform_algebra::Arrangement;
use std::collections::BTreeMap;

/// Heights of the arcs over a slab, cached by place.
pub(super) struct Columns<'a> {
    pub(super) arrangement: &'a Arrangement,
    pub(super) slab: usize,
    known: BTreeMap<u64, Vec<f64>>,
}

impl<'a> Columns<'a> {
    pub(super) fn new(arrangement: &'a Arrangement, slab: usize) -> Self {
        Self {
            arrangement,
            slab,
            known: BTreeMap::new(),
        }
    }
    /// Returns the height of an arc; `None` if the place is not between the walls.
    pub(super) fn at(&mut self, u: f64, arc: usize) -> Option<f64> {
        let (a, slab) = (self.arrangement, self.slab);
        // Empty beyond the walls.
        let over = || a.arcs_over(slab, &exact(u)).unwrap_or_default();
        let over = self.known.entry(u.to_bits()).or_insert_with(over);
        over.get(arc).copied()
    }
}

/// A piece of an arc between two walls, outside of the rectangles around base points.
pub(super) struct Stretch {
    /// Points of the chords in rectangles, before `from` and after `to`.
    pub(super) before: Vec<[f64; 2]>,
    pub(super) from: [f64; 2],
    pub(super) to: [f64; 2],
    pub(super) after: Vec<[f64; 2]>,
    /// True for each end that is on a rectangle.
    pub(super) based: [bool; 2],
    /// Base points to which the ends lead: fan, direction, and place.
    pub(super) rays: [Option<(usize, Ray, [f64; 2])>; 2],
}

impl Stretch {
    /// Returns true if a part of the piece is outside of the rectangles.
    pub(super) fn is_open(&self) -> bool {
        self.from[0] < self.to[0]
    }
    /// Removes the part between the places of two walls that is in the rectangle of a site; `place`
    /// is the position of this slab among those that the arc passes through.
    fn leave_out(&mut self, site: &Site, arc: &SiteArc, place: usize, [left, right]: [f64; 2]) {
        // The point of the chord from the base point to the side of the rectangle.
        let chord = |u: f64| {
            let t = (u - site.at[0]) / (arc.end[0] - site.at[0]);
            [u, site.at[1] + t * (arc.end[1] - site.at[1])]
        };
        let is_last = place + 1 == arc.chain.len();
        let end = |wall: f64| if is_last { arc.end } else { chord(wall) };
        let ray = is_last.then_some((site.fan, arc.ray, site.at));
        if arc.right {
            self.before = vec![chord(left)];
            (self.from, self.based[0], self.rays[0]) = (end(right), true, ray);
        } else {
            self.after = vec![chord(right)];
            (self.to, self.based[1], self.rays[1]) = (end(left), true, ray);
        }
    }
    /// Returns the whole polyline from wall to wall.
    pub(super) fn whole(&self, line: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
        let before = self.before.iter().copied().filter(|_| self.based[0]);
        let after = self.after.iter().copied().filter(|_| self.based[1]);
        before.chain(line).chain(after).collect()
    }
}

/// Returns the height of a polyline at a place.
pub(super) fn height(line: &[[f64; 2]], u: f64) -> f64 {
    let k = line.partition_point(|p| p[0] < u).clamp(1, line.len() - 1);
    let ([a, p], [b, q]) = (line[k - 1], line[k]);
    p + (q - p) * ((u - a) / (b - a)).clamp(0.0, 1.0)
}

impl Openings<'_> {
    /// Returns the piece of an arc over a slab that is to be drawn, outside of the rectangles
    /// around base points.
    pub(super) fn stretch(&self, q: usize, slab: usize, i: usize) -> Stretch {
        let a = &self.atlas.region.triangles[q].arrangement;
        let arc = a.slabs[slab].arcs[i];
        let [left, right] = [(slab, arc.left), (slab + 1, arc.right)]
            .map(|(k, p)| [a.walls[k].u.to_f64(), self.atlas.place(q, k, p)[1]]);
        let mut stretch = Stretch {
            before: vec![left],
            from: left,
            to: right,
            after: vec![right],
            based: [false; 2],
            rays: [None; 2],
        };
        for (_, site) in self.sites_in(q) {
            for x in &site.arcs {
                if let Some(place) = x.chain.iter().position(|&c| c == (slab, i)) {
                    stretch.leave_out(site, x, place, [left[0], right[0]]);
                }
            }
        }
        stretch
    }

    /// Returns a polyline for an arc; `in_order` is cleared if rounding moves it out of the
    /// triangle.
    pub(super) fn polyline(
        &self,
        q: usize,
        stretch: &Stretch,
        i: usize,
        over: &mut Columns<'_>,
        in_order: &mut bool,
    ) -> Vec<[f64; 2]> {
        if !stretch.is_open() {
            return vec![stretch.from];
        }
        let bit = self.atlas.region.side_of_arc(q, over.slab, i);
        let ends = [stretch.from, stretch.to];
        if let Some(line) = self.atlas.border_line(q, bit, ends, self.halvings) {
            *in_order &= line.len() <= MAX_INTERVAL_VERTICES
                && is_drawn_in(&line)
                && line.windows(2).all(|w| w[0][0] < w[1][0]);
            return line;
        }
        let (line, is_whole) = self.halved_arc(q, ends, i, over);
        *in_order &= is_whole && is_drawn_in(&line);
        line
    }
    /// Bisects an arc until chords may replace it; returns false if it becomes too long.
    fn halved_arc(
        &self,
        q: usize,
        [from, to]: [[f64; 2]; 2],
        i: usize,
        over: &mut Columns<'_>,
    ) -> (Vec<[f64; 2]>, bool) {
        let curve = over.arrangement.slabs[over.slab].arcs[i].curve;
        let is_contracted = self.curves.on_curve.contains_key(&curve);
        let (mut line, mut is_whole) = (vec![from], true);
        let mut stack = vec![(from, to, 0)];
        while let Some((left, right, depth)) = stack.pop() {
            let u = 0.5 * (left[0] + right[0]);
            let is_full = line.len() > MAX_INTERVAL_VERTICES || self.atlas.control.is_stopped();
            is_whole &= !is_full;
            let room = left[0] < u && u < right[0] && depth < self.halvings && !is_full;
            let Some(v) = room.then(|| over.at(u, i)).flatten() else {
                line.push(right);
                continue;
            };
            let mid = [u, v];
            let turns = || {
                is_contracted
                    && depth < MAX_TURN_BISECTIONS
                    && self.atlas.charts[q].turns([left, mid, right])
            };
            // At least one bisection: a chord may meet the middle by chance.
            if depth > 1 && self.is_fine_arc(q, [left, mid, right]) && !turns() {
                line.push(right);
            } else {
                stack.push((mid, right, depth + 1));
                stack.push((left, mid, depth + 1));
            }
        }
        (line, is_whole)
    }
    /// Returns true if a chord may replace a piece of an arc, given with a place between its ends.
    fn is_fine_arc(&self, q: usize, [left, mid, right]: [[f64; 2]; 3]) -> bool {
        let chart = &self.atlas.charts[q];
        let (p, m, r) = (chart.at(left), chart.at(mid), chart.at(right));
        let chord = [mid[0], 0.5 * (left[1] + right[1])];
        // Triangles at a chord have to be within the tolerance, too.
        let sagitta = 0.3 * self.atlas.tolerance_at(m);
        distance(p, r) <= self.atlas.options.longest
            && distance(m, middle(p, r)) <= sagitta
            // Adjacent triangles meet the chord in the parameters, not the arc.
            && distance(chart.at(chord), middle(p, r)) <= sagitta
            && chart.keeps_sign([left, right, left], 0)
    }

    /// Returns a drawn segment of a wall after a point, outside of the rectangles around base
    /// points, and its vertices.
    pub(super) fn upright(&self, q: usize, wall: usize, point: usize) -> (Stretch, Vec<[f64; 2]>) {
        let stretch = self.upright_stretch(q, wall, point);
        let ([u, from], [_, to]) = (stretch.from, stretch.to);
        let bit = self.atlas.region.side_of_wall(q, wall, point);
        let ends = [stretch.from, stretch.to];
        if let Some(line) = self.atlas.border_line(q, bit, ends, self.halvings) {
            return (stretch, line.into_iter().map(|at| [u, at[1]]).collect());
        }
        let curve = self.curves.drawn_on(q, wall, point);
        let is_contracted = curve.is_some_and(|f| self.curves.on_curve.contains_key(&f));
        let line = self.halved_upright(q, u, [from, to], is_contracted);
        (stretch, line)
    }
    /// Bisects a line over one u until chords may replace it.
    fn halved_upright(
        &self,
        q: usize,
        u: f64,
        [from, to]: [f64; 2],
        is_contracted: bool,
    ) -> Vec<[f64; 2]> {
        let chart = &self.atlas.charts[q];
        let at = |v: f64| chart.at([u, v]);
        let mut line = vec![[u, from]];
        let mut stack = vec![(from, to, 0)];
        while let Some((x, y, depth)) = stack.pop() {
            let m = 0.5 * (x + y);
            let turns = || {
                is_contracted
                    && depth < MAX_TURN_BISECTIONS
                    && chart.turns([x, m, y].map(|v| [u, v]))
            };
            let is_full = line.len() >= MAX_INTERVAL_VERTICES || self.atlas.control.is_stopped();
            if depth < self.halvings && !is_full && (!self.atlas.is_fine(&at, x, y) || turns()) {
                stack.extend([(m, y, depth + 1), (x, m, depth + 1)]);
            } else {
                line.push([u, y]);
            }
        }
        line
    }
    /// Returns a segment of a wall after a point, outside of the rectangles.
    fn upright_stretch(&self, q: usize, wall: usize, point: usize) -> Stretch {
        let mut ends = [point, point + 1].map(|p| self.atlas.place(q, wall, p));
        let mut rays = [None; 2];
        for (k, end) in ends.iter_mut().enumerate() {
            if let Some(site) = self.sites.get(&(q, wall, point + k))
                && let Some(arc) = site.vertical_arc(k == 0)
            {
                rays[k] = Some((site.fan, arc.ray, site.at));
                *end = arc.end;
            }
        }
        Stretch {
            before: vec![],
            from: ends[0],
            to: ends[1],
            after: vec![],
            based: rays.map(|r| r.is_some()),
            rays,
        }
    }
}

/// Returns true if a polyline stays in the unit triangle between its ends.
fn is_drawn_in(line: &[[f64; 2]]) -> bool {
    let mut inner = line[1..line.len() - 1].iter();
    inner.all(|[u, v]| *v > 0.0 && *v < 1.0 - u)
}
