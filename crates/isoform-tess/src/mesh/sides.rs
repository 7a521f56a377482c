//! The sides of the unit triangles, each shared by two of them, with places along them.

use super::opening::Openings;
use super::places::{on_side, sides_of};
use super::{MAX_INTERVAL_VERTICES, MAX_TURN_BISECTIONS};
use std::collections::BTreeMap;

/// A side of unit triangles: s = 0, t = 0 or w = 0, by the sign of t, s or s t.
pub(super) type SideId = (usize, i64);

/// Places along each side, each with true if the interval after it belongs to the region.
pub(super) type Sides = BTreeMap<SideId, Vec<(f64, bool)>>;

/// Adds a place to a side, unless it is there already or is an end.
pub(super) fn add_place(sides: &mut Sides, side: SideId, x: f64) {
    let places = sides.entry(side).or_default();
    let k = places.partition_point(|p| p.0 < x);
    if k > 0 && places.get(k).is_some_and(|p| p.0 != x) {
        places.insert(k, (x, places[k - 1].1));
    }
}

/// Returns the two unit triangles that share a side.
pub(super) fn quadrants_at((side, sign): SideId) -> Vec<usize> {
    (0..4)
        .filter(|&q| sides_of(q)[side] == (side, sign))
        .collect()
}

/// Returns the place along a side of a point of a unit triangle on it.
fn along(side: usize, at: [f64; 2]) -> f64 {
    if side == 0 { at[1] } else { at[0] }
}

/// A side of unit triangles during its division.
struct Division<'a> {
    open: &'a Openings<'a>,
    side: usize,
    quadrants: Vec<usize>,
    /// Places of base points on the side.
    bases: Vec<f64>,
    places: Vec<(f64, bool)>,
}

impl<'a> Division<'a> {
    /// Divides a side at given places, at the vertices of rectangles, and in between.
    fn new(open: &'a Openings<'a>, id: SideId, mut given: Vec<f64>) -> Self {
        let (side, quadrants) = (id.0, quadrants_at(id));
        let rectangles = open.places_on(side, &quadrants);
        given.extend([0.0, 1.0]);
        let corners = rectangles.iter().flat_map(|b| b.1);
        given.extend(corners.filter(|x| (0.0..=1.0).contains(x)));
        given.sort_by(f64::total_cmp);
        given.dedup();
        let mut division = Self {
            open,
            side,
            quadrants,
            bases: rectangles.iter().map(|b| b.0).collect(),
            places: Vec::new(),
        };
        for w in given.windows(2) {
            division.divide([w[0], w[1]]);
        }
        division.places.push((1.0, false));
        division
    }
    fn on(&self, x: f64) -> [f64; 2] {
        on_side(self.side, x)
    }
    /// Returns true if a place of the side is on the border of the region in one of the unit
    /// triangles.
    fn is_inside(&self, x: f64) -> bool {
        let mut quadrants = self.quadrants.iter();
        quadrants.any(|&q| self.open.atlas.side_is_inside(q, self.side, x))
    }
    /// Adds the places of an interval, except its end.
    fn divide(&mut self, [from, to]: [f64; 2]) {
        let (open, side, q) = (self.open, self.side, self.quadrants[0]);
        let inside = self.is_inside(0.5 * (from + to));
        if self.bases.contains(&from) || self.bases.contains(&to) {
            self.places.push((from, inside));
            return;
        }
        let bit = match inside {
            true => open.atlas.side_bit(q, side, from, to),
            false => 0,
        };
        let ends = [from, to].map(|x| self.on(x));
        if let Some(line) = open.atlas.border_line(q, bit, ends, open.halvings) {
            let inner = line[..line.len() - 1].iter();
            self.places
                .extend(inner.map(|&at| (along(side, at), inside)));
            return;
        }
        self.halve([from, to], inside);
    }
    /// Adds the places of an interval, except its end, by bisection.
    fn halve(&mut self, [from, to]: [f64; 2], inside: bool) {
        let mut stack = vec![(from, to, 0)];
        while let Some((a, b, depth)) = stack.pop() {
            if inside && self.has_room(depth) && !self.is_fine([a, b], depth) {
                let m = 0.5 * (a + b);
                stack.extend([(m, b, depth + 1), (a, m, depth + 1)]);
            } else {
                self.places.push((a, inside));
            }
        }
    }
    fn has_room(&self, depth: usize) -> bool {
        depth < self.open.halvings
            && self.places.len() < MAX_INTERVAL_VERTICES
            && !self.open.atlas.control.is_stopped()
    }
    /// Returns true if an interval needs no more places.
    fn is_fine(&self, [a, b]: [f64; 2], depth: usize) -> bool {
        let (atlas, chart) = (self.open.atlas, &self.open.atlas.charts[self.quadrants[0]]);
        let is_rough = if self.open.curves.on_side[self.side].is_none() {
            !atlas.is_fine(&|x| chart.at(self.on(x)), a, b)
        } else {
            self.is_contracted_rough([a, b], depth)
        };
        !is_rough && chart.keeps_sign([a, b, a].map(|x| self.on(x)), 0)
    }
    /// Returns true if an interval of a contracted side is too long. It has a single image, but the
    /// curves that leave it there turn, the faster the nearer they are to base points.
    fn is_contracted_rough(&self, [a, b]: [f64; 2], depth: usize) -> bool {
        if self.bases.is_empty() {
            return false;
        }
        let to_base = |x: &f64| (a - x).abs().min((b - x).abs());
        // A contracted side with a base point has intervals of at most this length.
        let near = self.bases.iter().map(to_base).fold(1.0 / 16.0, f64::min);
        let chart = &self.open.atlas.charts[self.quadrants[0]];
        b - a > near
            || depth < MAX_TURN_BISECTIONS && chart.turns([a, 0.5 * (a + b), b].map(|x| self.on(x)))
    }
}

impl Openings<'_> {
    /// Computes the places along the sides, for both of their triangles.
    pub(super) fn sides(&self) -> Sides {
        let divided = |(id, places)| (id, Division::new(self, id, places).places);
        self.curves_on_sides().into_iter().map(divided).collect()
    }
    /// Returns the places at which curves pass through the sides.
    fn curves_on_sides(&self) -> BTreeMap<SideId, Vec<f64>> {
        let mut sides: BTreeMap<SideId, Vec<f64>> = BTreeMap::new();
        for (q, t) in self.atlas.region.triangles.iter().enumerate() {
            let walls = &t.arrangement.walls;
            let keys = sides_of(q);
            for key in keys {
                sides.entry(key).or_default();
            }
            let left = (1..walls[0].points.len() - 1).filter(|&p| t.is_real(0, p));
            let left = left.map(|p| self.atlas.place(q, 0, p)[1]);
            sides.entry(keys[0]).or_default().extend(left);
            for (k, wall) in walls.iter().enumerate().take(walls.len() - 1).skip(1) {
                for (key, p) in [(keys[1], 0), (keys[2], wall.points.len() - 1)] {
                    if t.is_real(k, p) {
                        sides.entry(key).or_default().push(wall.u.to_f64());
                    }
                }
            }
        }
        sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each side has two unit triangles, and each unit triangle three sides.
    #[test]
    fn sides_are_shared_by_two() {
        let mut uses: BTreeMap<SideId, usize> = BTreeMap::new();
        for q in 0..4 {
            for id in sides_of(q) {
                *uses.entry(id).or_default() += 1;
                assert!(quadrants_at(id).contains(&q));
            }
        }
        assert_eq!(uses.into_values().collect::<Vec<_>>(), [2; 6]);
    }

    #[test]
    fn places_are_added_in_their_order_and_not_twice() {
        let id = (0, 1);
        let mut sides = Sides::from([(id, vec![(0.0, true), (0.5, false), (1.0, false)])]);
        for x in [0.25, 0.75, 0.5, 0.0, 1.0, 2.0] {
            add_place(&mut sides, id, x);
        }
        let expected = [
            (0.0, true),
            (0.25, true),
            (0.5, false),
            (0.75, false),
            (1.0, false),
        ];
        assert_eq!(sides[&id], expected);
    }
}
