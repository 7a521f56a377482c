//! Subdivision of the sides of a domain, which are straight in the parameters, at places that do
//! not depend on the map.
//!
//! Patches with a common side are subdivided identically along it, so that their triangles match:
//! places are numbers with few binary digits along the side, and only the curve in space decides
//! where the subdivision ends.

use super::MAX_INTERVAL_VERTICES;
use super::atlas::Atlas;
use super::geometry::{distance, middle};
use super::places::on_side;
use crate::surface::Point3;
use isoform_algebra::QUADRANTS;

/// Returns the number with the fewest binary digits in the middle half of an interval.
fn simple_between(a: f64, b: f64) -> f64 {
    let quarter = 0.25 * (b - a);
    let (lo, hi) = (a + quarter, b - quarter);
    let mut unit = 1.0f64;
    for _ in 0..60 {
        let x = (lo / unit).ceil() * unit;
        if x <= hi {
            return x;
        }
        unit *= 0.5;
    }
    0.5 * (a + b)
}

impl Atlas<'_> {
    /// Returns the ends (s, t) of a side given by its bit.
    fn border(&self, bit: u64) -> Option<[[f64; 2]; 2]> {
        let domain = self.region.domain.as_ref().filter(|_| bit != 0)?;
        Some(
            domain
                .side(bit.trailing_zeros() as usize)
                .map(|p| p.each_ref().map(|x| x.to_f64().value())),
        )
    }
    /// Returns the place of a point of a unit triangle along a side, 0 and 1 at its ends.
    fn along_border(q: usize, [p0, p1]: [[f64; 2]; 2], [u, v]: [f64; 2]) -> f64 {
        let w = 1.0 - u - v;
        let [s, t] = QUADRANTS[q].map(|x| x as f64);
        let (at, d) = (
            [s * u / w - p0[0], t * v / w - p0[1]],
            [p1[0] - p0[0], p1[1] - p0[1]],
        );
        (at[0] * d[0] + at[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])
    }
    /// Returns the point of a unit triangle at a place along a side.
    fn on_border(q: usize, [p0, p1]: [[f64; 2]; 2], x: f64) -> [f64; 2] {
        let [s, t] = QUADRANTS[q].map(|x| x as f64);
        // Exact at the ends, and where both ends agree in a coordinate.
        let at = |k: usize| p0[k] * (1.0 - x) + p1[k] * x;
        let [a, b] = [s * at(0), t * at(1)].map(|x| x.max(0.0));
        [a / (a + b + 1.0), b / (a + b + 1.0)]
    }
    /// Returns the vertices of a piece of a side given by its bit, from end to end; `None` if the
    /// bit is 0 or the domain is the whole plane.
    pub(super) fn border_line(
        &self,
        q: usize,
        bit: u64,
        [from, to]: [[f64; 2]; 2],
        halvings: usize,
    ) -> Option<Vec<[f64; 2]>> {
        let ends = self.border(bit)?;
        let mut line = vec![from];
        let mut stack = vec![(
            [from, to],
            [from, to].map(|x| Self::along_border(q, ends, x)),
            0,
        )];
        while let Some(([a, b], [x, y], depth)) = stack.pop() {
            let m = if x < y {
                simple_between(x, y)
            } else {
                simple_between(y, x)
            };
            let mid = Self::on_border(q, ends, m);
            let is_full = depth >= halvings
                || line.len() > MAX_INTERVAL_VERTICES
                || self.control.is_stopped()
                || m == x
                || m == y;
            if is_full || self.is_fine_border(q, ends, [a, b], [x, y]) {
                line.push(b);
            } else {
                stack.extend([([mid, b], [m, y], depth + 1), ([a, mid], [x, m], depth + 1)]);
            }
        }
        Some(line)
    }
    fn is_fine_border(
        &self,
        q: usize,
        ends: [[f64; 2]; 2],
        [a, b]: [[f64; 2]; 2],
        [x, y]: [f64; 2],
    ) -> bool {
        let chart = &self.charts[q];
        let (p, r) = (chart.at(a), chart.at(b));
        let off = [0.25, 0.5, 0.75].map(|t| {
            let on: Point3 = std::array::from_fn(|i| p[i] + t * (r[i] - p[i]));
            distance(chart.at(Self::on_border(q, ends, x + t * (y - x))), on)
        });
        let tolerance = self.tolerance_at(middle(p, r));
        // NaN is never fine.
        distance(p, r) <= self.options.longest
            && off.iter().all(|&d| d <= 0.3 * tolerance)
            && chart.keeps_sign([a, b, a], 0)
    }
    /// Returns the bit of the side on which a piece of a side of a unit triangle lies, given by two
    /// places.
    pub(super) fn side_bit(&self, q: usize, side: usize, a: f64, b: f64) -> u64 {
        self.region.side_of_place(q, on_side(side, 0.5 * (a + b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_have_few_digits() {
        assert_eq!(
            [
                simple_between(0.0, 1.0),
                simple_between(0.5, 1.0),
                simple_between(-1e-17, 0.25 + 1e-17)
            ],
            [0.5, 0.75, 0.125]
        );
        let x = simple_between(0.3, 0.31);
        assert!(
            (0.3..0.31).contains(&x) && (x * 256.0).fract() == 0.0,
            "{x}"
        );
    }
}
