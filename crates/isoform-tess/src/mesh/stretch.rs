//! Pieces of arcs between two walls.

use super::geometry::{distance, middle};
use super::names::Ray;
use super::opening::Openings;
use super::{TURNS, VERTICES};
use crate::field::exact;
use isoform_algebra::Arrangement;
use std::collections::BTreeMap;

/// The arcs over a slab at places that are asked for more than once.
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
    /// The height of an arc, if the place is between the walls.
    pub(super) fn at(&mut self, u: f64, arc: usize) -> Option<f64> {
        let (a, slab) = (self.arrangement, self.slab);
        // None beyond the walls.
        let over = || a.arcs_over(slab, &exact(u)).unwrap_or_default();
        let over = self.known.entry(u.to_bits()).or_insert_with(over);
        over.get(arc).copied()
    }
}

/// A piece of an arc between two walls, from rectangle to rectangle around base points.
pub(super) struct Stretch {
    /// What comes before `from` and after `to`: chords in rectangles.
    pub(super) before: Vec<[f64; 2]>,
    pub(super) from: [f64; 2],
    pub(super) to: [f64; 2],
    pub(super) after: Vec<[f64; 2]>,
    /// Whether the ends are on rectangles.
    pub(super) based: [bool; 2],
    /// The base points that the ends lead to: which, in which direction, where.
    pub(super) rays: [Option<(usize, Ray, [f64; 2])>; 2],
}

impl Stretch {
    /// Whether anything is left outside of the rectangles.
    pub(super) fn is_open(&self) -> bool {
        self.from[0] < self.to[0]
    }
    /// The whole polyline from wall to wall.
    pub(super) fn whole(&self, line: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
        let before = self.before.iter().copied().filter(|_| self.based[0]);
        let after = self.after.iter().copied().filter(|_| self.based[1]);
        before.chain(line).chain(after).collect()
    }
}

/// The height of a polyline over a place.
pub(super) fn height(line: &[[f64; 2]], u: f64) -> f64 {
    let k = line.partition_point(|p| p[0] < u).clamp(1, line.len() - 1);
    let ([a, p], [b, q]) = (line[k - 1], line[k]);
    p + (q - p) * ((u - a) / (b - a)).clamp(0.0, 1.0)
}

impl Openings<'_> {
    /// What of an arc over a slab is to be drawn: without the pieces in rectangles around base
    /// points.
    pub(super) fn stretch(&self, q: usize, slab: usize, i: usize) -> Stretch {
        let a = &self.atlas.region.triangles[q].arrangement;
        let arc = a.slabs[slab].arcs[i];
        let [left, right] = [(slab, arc.left), (slab + 1, arc.right)]
            .map(|(k, p)| [a.walls[k].u.to_f64(), self.atlas.place(q, k, p)[1]]);
        let mut s = Stretch {
            before: vec![left],
            from: left,
            to: right,
            after: vec![right],
            based: [false; 2],
            rays: [None; 2],
        };
        for (site, x) in self
            .sites
            .range((q, 0, 0)..(q + 1, 0, 0))
            .flat_map(|s| s.1.arcs.iter().map(move |x| (s.1, x)))
        {
            let Some(place) = x.chain.iter().position(|&c| c == (slab, i)) else {
                continue;
            };
            // On the chord from the base point to the side of the rectangle.
            let chord = |u: f64| {
                let t = (u - site.at[0]) / (x.end[0] - site.at[0]);
                [u, site.at[1] + t * (x.end[1] - site.at[1])]
            };
            let is_last = place + 1 == x.chain.len();
            if x.right {
                s.before = vec![chord(left[0])];
                (s.from, s.based[0]) = (if is_last { x.end } else { chord(right[0]) }, true);
                s.rays[0] = is_last.then_some((site.fan, x.ray, site.at));
            } else {
                s.after = vec![chord(right[0])];
                (s.to, s.based[1]) = (if is_last { x.end } else { chord(left[0]) }, true);
                s.rays[1] = is_last.then_some((site.fan, x.ray, site.at));
            }
        }
        s
    }

    /// A polyline for an arc; `in_order` is cleared where rounding does not keep it in the
    /// triangle.
    pub(super) fn polyline(
        &self,
        q: usize,
        stretch: &Stretch,
        i: usize,
        over: &mut Columns<'_>,
        in_order: &mut bool,
    ) -> Vec<[f64; 2]> {
        let mut line = vec![stretch.from];
        if !stretch.is_open() {
            return line;
        }
        let is_drawn_in = |line: &[[f64; 2]]| {
            line[1..line.len() - 1]
                .iter()
                .all(|[u, v]| *v > 0.0 && *v < 1.0 - u)
        };
        if let Some(line) = self.atlas.border_line(
            q,
            self.atlas.region.side_of_arc(q, over.slab, i),
            [stretch.from, stretch.to],
            self.halvings,
        ) {
            *in_order &= line.len() <= VERTICES
                && is_drawn_in(&line)
                && line.windows(2).all(|w| w[0][0] < w[1][0]);
            return line;
        }
        let at = |[u, v]: [f64; 2]| self.atlas.charts[q].at([u, v]);
        let is_contracted = self
            .curves
            .on_curve
            .contains_key(&over.arrangement.slabs[over.slab].arcs[i].curve);
        let mut stack = vec![(stretch.from, stretch.to, 0)];
        while let Some((left, right, depth)) = stack.pop() {
            let u = 0.5 * (left[0] + right[0]);
            let is_full = line.len() > VERTICES || self.atlas.control.is_stopped();
            *in_order &= !is_full;
            let room = left[0] < u && u < right[0] && depth < self.halvings && !is_full;
            let Some(v) = room.then(|| over.at(u, i)).flatten() else {
                line.push(right);
                continue;
            };
            let mid = [u, v];
            let (p, m, r) = (at(left), at(mid), at(right));
            let chord = [u, 0.5 * (left[1] + right[1])];
            let tolerance = self.atlas.tolerance_at(m);
            let fine = distance(p, r) <= self.atlas.options.longest
                && distance(m, middle(p, r)) <= 0.3 * tolerance
                // The triangles beside it meet the chord in the parameters, not the arc.
                && distance(at(chord), middle(p, r)) <= 0.3 * tolerance
                && !(is_contracted && depth < TURNS && self.atlas.charts[q].turns([left, mid, right]))
                && self.atlas.charts[q].keeps_sign([left, right, left], 0);
            // One halving at least: a chord may meet the middle by chance.
            if fine && depth > 1 {
                line.push(right);
            } else {
                stack.push((mid, right, depth + 1));
                stack.push((left, mid, depth + 1));
            }
        }
        *in_order &= is_drawn_in(&line);
        line
    }

    /// A drawn stretch of a wall after a point, from rectangle to rectangle around base points, and
    /// its vertices.
    pub(super) fn upright(&self, q: usize, wall: usize, point: usize) -> (Stretch, Vec<[f64; 2]>) {
        let mut ends = [point, point + 1].map(|p| self.atlas.place(q, wall, p));
        let mut rays = [None; 2];
        for (k, end) in ends.iter_mut().enumerate() {
            if let Some(site) = self.sites.get(&(q, wall, point + k)) {
                let arc = site
                    .arcs
                    .iter()
                    .find(|x| x.chain.is_empty() && x.right == (k == 0));
                rays[k] = arc.map(|x| (site.fan, x.ray, site.at));
                *end = arc.map_or(*end, |x| x.end);
            }
        }
        let [a, b] = ends;
        let is_contracted = self
            .curves
            .drawn_on(q, wall, point)
            .is_some_and(|f| self.curves.on_curve.contains_key(&f));
        let based = rays.map(|r| r.is_some());
        let stretch = Stretch {
            before: vec![],
            from: a,
            to: b,
            after: vec![],
            based,
            rays,
        };
        if let Some(line) = self.atlas.border_line(
            q,
            self.atlas.region.side_of_wall(q, wall, point),
            [a, b],
            self.halvings,
        ) {
            return (stretch, line.into_iter().map(|at| [a[0], at[1]]).collect());
        }
        let mut line = vec![a];
        let mut stack = vec![(a[1], b[1], 0)];
        while let Some((x, y, depth)) = stack.pop() {
            let at = |v: f64| self.atlas.charts[q].at([a[0], v]);
            let m = 0.5 * (x + y);
            let turns = || {
                is_contracted
                    && depth < TURNS
                    && self.atlas.charts[q].turns([x, m, y].map(|v| [a[0], v]))
            };
            if depth < self.halvings
                && line.len() < VERTICES
                && !self.atlas.control.is_stopped()
                && (!self.atlas.is_fine(&at, x, y) || turns())
            {
                stack.extend([(m, y, depth + 1), (x, m, depth + 1)]);
            } else {
                line.push([a[0], y]);
            }
        }
        (stretch, line)
    }
}
