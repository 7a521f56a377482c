//! The sides of the unit triangles, each of which two of them share, with places along them.

use super::opening::Openings;
use super::places::{on_side, sides_of};
use super::{TURNS, VERTICES};
use std::collections::BTreeMap;

/// Places along each side, by side and sign, and whether the stretch after each belongs to the
/// region.
pub(super) type Sides = BTreeMap<(usize, i64), Vec<(f64, bool)>>;

/// Adds a place to a side, but for its ends.
pub(super) fn add_place(sides: &mut Sides, side: (usize, i64), x: f64) {
    let places = sides.entry(side).or_default();
    let k = places.partition_point(|p| p.0 < x);
    if k > 0 && places.get(k).is_some_and(|p| p.0 != x) {
        places.insert(k, (x, places[k - 1].1));
    }
}

impl Openings<'_> {
    /// Places along the sides that both triangles use.
    pub(super) fn sides(&self) -> Sides {
        let mut sides: BTreeMap<(usize, i64), Vec<f64>> = BTreeMap::new();
        for q in 0..4 {
            let t = &self.atlas.region.triangles[q];
            let walls = &t.arrangement.walls;
            let keys = sides_of(q);
            for key in keys {
                sides.entry(key).or_default();
            }
            let left = (1..walls[0].points.len() - 1)
                .filter(|&p| t.is_real(0, p))
                .map(|p| self.atlas.place(q, 0, p)[1]);
            sides.entry(keys[0]).or_default().extend(left);
            for (k, wall) in walls.iter().enumerate().take(walls.len() - 1).skip(1) {
                for (key, p) in [(keys[1], 0), (keys[2], wall.points.len() - 1)] {
                    if t.is_real(k, p) {
                        sides.entry(key).or_default().push(wall.u.to_f64());
                    }
                }
            }
        }
        let mut out = Sides::new();
        for ((side, sign), mut places) in sides {
            places.extend([0.0, 1.0]);
            let both: Vec<usize> = (0..4)
                .filter(|&q| sides_of(q)[side] == (side, sign))
                .collect();
            let based = self.places_on(side, &both);
            places.extend(
                based
                    .iter()
                    .flat_map(|b| b.1)
                    .filter(|x| (0.0..=1.0).contains(x)),
            );
            places.sort_by(f64::total_cmp);
            places.dedup();
            let at = |x: f64| self.atlas.charts[both[0]].at(on_side(side, x));
            let mut list = Vec::new();
            for w in places.windows(2) {
                let inside = both
                    .iter()
                    .any(|&q| self.atlas.side_is_inside(q, side, 0.5 * (w[0] + w[1])));
                if based.iter().any(|b| b.0 == w[0] || b.0 == w[1]) {
                    list.push((w[0], inside));
                    continue;
                }
                let bit = if inside {
                    self.atlas.side_bit(both[0], side, w[0], w[1])
                } else {
                    0
                };
                if let Some(line) = self.atlas.border_line(
                    both[0],
                    bit,
                    [w[0], w[1]].map(|x| on_side(side, x)),
                    self.halvings,
                ) {
                    let place = |at: &[f64; 2]| if side == 0 { at[1] } else { at[0] };
                    list.extend(line[..line.len() - 1].iter().map(|at| (place(at), inside)));
                    continue;
                }
                let mut stack = vec![(w[0], w[1], 0)];
                while let Some((a, b, depth)) = stack.pop() {
                    // A contracted side has one image, but what leaves it there turns, the faster
                    // the nearer to base points.
                    let rough = || match self.curves.on_side[side] {
                        None => !self.atlas.is_fine(&at, a, b),
                        Some(_) if based.is_empty() => false,
                        Some(_) => {
                            let near = based
                                .iter()
                                .map(|p| (a - p.0).abs().min((b - p.0).abs()))
                                .fold(1.0 / 16.0, f64::min);
                            b - a > near
                                || depth < TURNS
                                    && self.atlas.charts[both[0]]
                                        .turns([a, 0.5 * (a + b), b].map(|x| on_side(side, x)))
                        }
                    };
                    let signed = || {
                        self.atlas.charts[both[0]]
                            .keeps_sign([a, b, a].map(|x| on_side(side, x)), 0)
                    };
                    if inside
                        && depth < self.halvings
                        && list.len() < VERTICES
                        && !self.atlas.control.is_stopped()
                        && (rough() || !signed())
                    {
                        let m = 0.5 * (a + b);
                        stack.extend([(m, b, depth + 1), (a, m, depth + 1)]);
                    } else {
                        list.push((a, inside));
                    }
                }
            }
            list.push((1.0, false));
            out.insert((side, sign), list);
        }
        out
    }
}
