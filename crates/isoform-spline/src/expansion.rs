//! What is proved of an implicit spline near a point.
//!
//! A derivative of a sum Σ c B of uniform B-splines is such a sum again, with the differences of c
//! for coefficients (over h) and a degree less; as B-splines are positive and sum to 1, the least
//! and the largest of these differences bound it (de Boor 1978, ch. X). So third derivatives in a
//! cell are bounded by third differences of its (d + 1)³ coefficients.
//!
//! Rounding. The coefficients of B-splines without an unknown are averages of those before, rounded
//! once per term and level; values at points are sums of products of such with B-splines. Each is
//! bounded by roundings of the largest coefficient, which grow by 2/h with each derivative.

use crate::keys::Place;
use crate::level::{CELL, Level, block};
use crate::surface::ImplicitSpline;
use isoform_geom::{Aabb, Expansion, Point3};
use isoform_num::{Interval, ORDERS};

/// Roundings of a coefficient per level: 64 products of two weights and a coefficient, and their
/// sum.
const PER_LEVEL: f64 = 70.0;

/// Roundings of a value: three B-splines of at most five steps with four roundings each, and a sum
/// of 216 products of them.
const PER_VALUE: f64 = 400.0;

/// The most cells that third derivatives are bounded in: far more than a small part of a surface
/// lies in. In regions of more cells nothing is said, as it would take long and prove little.
const MOST: usize = 4096;

/// The range of third derivatives, in the order of [`Expansion::third`].
type Thirds = [[f64; 2]; 10];

impl ImplicitSpline {
    /// See [`isoform_geom::Field::expansion`]. Nothing is said beyond the domain, and of splines of
    /// degree 2, whose second derivatives jump, only within a cell.
    pub(crate) fn expansion_about(&self, at: Point3, region: Aabb) -> Option<Expansion> {
        let is_inside = |p: Point3| self.is_in_domain(p);
        if !is_inside(at) || !is_inside(region.lo) || !is_inside(region.hi) {
            return None;
        }
        let (jet, h) = (self.jet_inside(at), self.leaf_spacing(at));
        let third = self.thirds(region)?;
        let rounded = self.rounding(at, h);
        let about = |v: f64, order: i32| {
            let by = rounded * (2.0 / h).powi(order);
            Interval::new((v - by).next_down(), (v + by).next_up())
        };
        Some(Expansion {
            value: about(jet.v, 0),
            gradient: jet.g.map(|g| about(g, 1)),
            hessian: jet.h.map(|h| about(h, 2)),
            third: third.map(|[lo, hi]| Interval::new(lo, hi)),
        })
    }

    /// A bound on the rounding of f at a place in a cell of edge h. The place in the cell is off by
    /// some roundings of its distance from the corner, each of which moves f by at most twice the
    /// largest coefficient along each axis.
    fn rounding(&self, at: Point3, h: f64) -> f64 {
        let corner = self.domain().lo;
        let far = (0..3).fold(1.0, |far: f64, k| far.max((at[k] - corner[k]).abs() / h));
        let place = 6.0 * 4.0 * (1.0 + far);
        let count = PER_LEVEL * self.depth() as f64 + PER_VALUE + place;
        count * f64::EPSILON * self.largest()
    }

    /// Third derivatives in a region of the domain.
    fn thirds(&self, region: Aabb) -> Option<Thirds> {
        let cells = self.leaves_in(region, MOST)?;
        if self.degree() < 3 && cells.len() > 1 {
            return None;
        }
        let mut all = [[f64::INFINITY, f64::NEG_INFINITY]; 10];
        for (l, cell) in cells {
            let level = &self.levels()[l];
            let c = level.of_cell(cell, self.degree());
            // A third difference is a sum of eight coefficients, each as rounded as a value.
            let slack = 8.0 * self.rounding(region.hi, level.spacing);
            let scale = level.spacing.powi(3);
            for (all, order) in all.iter_mut().zip(&ORDERS[10..]) {
                let [lo, hi] = differences(&c, self.degree() + 1, *order);
                let (lo, hi) = ((lo - slack) / scale, (hi + slack) / scale);
                *all = [all[0].min(lo.next_down()), all[1].max(hi.next_up())];
            }
        }
        Some(all)
    }

    /// The cells of the finest levels that a region of the domain touches, each with its level, if
    /// they are at most so many.
    fn leaves_in(&self, region: Aabb, most: usize) -> Option<Vec<(usize, Place)>> {
        let mut found = Vec::new();
        let mut rest: Vec<(usize, Place)> = Vec::new();
        let (lo, hi) = self.first_cells(region);
        let count: i64 = (0..3).map(|k| i64::from(hi[k] - lo[k]) + 1).product();
        if count > most as i64 {
            return None;
        }
        rest.extend(block(lo, hi).map(|cell| (0, cell)));
        while let Some((l, cell)) = rest.pop() {
            let level: &Level = &self.levels()[l];
            if self.part_of(l, cell, region).is_none() {
                continue;
            }
            let i = level.cells.find(cell)?;
            if level.is_refined[i] {
                let lo = cell.map(|v| 2 * v);
                rest.extend(block(lo, lo.map(|v| v + 1)).map(|child| (l + 1, child)));
            } else {
                found.push((l, cell));
            }
            if found.len() + rest.len() > 8 * most {
                return None;
            }
        }
        Some(found)
    }
}

/// The least and the largest of the differences of n³ numbers, x fastest, of some orders along the
/// axes; 0 where an order is as large as n.
fn differences(c: &[f64; CELL], n: usize, order: [usize; 3]) -> [f64; 2] {
    if order.iter().any(|o| *o >= n) {
        return [0.0; 2];
    }
    let mut c = *c;
    for (axis, times) in order.into_iter().enumerate() {
        let step = n.pow(axis as u32);
        for _ in 0..times {
            for i in 0..n * n * n - step {
                c[i] = c[i + step] - c[i];
            }
        }
    }
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for at in block([0; 3], order.map(|o| (n - 1 - o) as i32)) {
        let [x, y, z] = at.map(|v| v as usize);
        let v = c[(z * n + y) * n + x];
        range = [range[0].min(v), range[1].max(v)];
    }
    range
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::{Field, LevelData, SplineData};
    use isoform_num::{Random, Real};

    /// A spline with coefficients by chance, refined about one cell.
    fn by_chance(degree: usize) -> ImplicitSpline {
        let mut random = Random::new(7);
        let mut numbers = |n: usize| (0..n).map(|_| random.unit() - 0.5).collect::<Vec<f64>>();
        let n = degree + 4;
        let first = LevelData {
            cells: vec![[1, 2, 1]],
            coefficients: numbers(n * n * n),
        };
        let second = LevelData {
            cells: vec![[2, 4, 2]],
            coefficients: numbers((degree + 1).pow(3)),
        };
        let data = SplineData {
            degree,
            corner: [0.3, -1.0, 2.0],
            spacing: 0.5,
            count: [4; 3],
            levels: vec![first, second],
        };
        ImplicitSpline::from_data(&data).expect("a spline")
    }

    #[test]
    fn expansions_enclose_the_function_across_cells() {
        let mut random = Random::new(11);
        for degree in 3..=crate::MAX_DEGREE {
            let f = by_chance(degree);
            for _ in 0..50 {
                let mut place =
                    || std::array::from_fn(|k| [0.4, -0.9, 2.1][k] + 1.6 * random.unit());
                let (at, near): (Point3, Point3) = (place(), place());
                let size = 0.3 * random.unit();
                let off: Point3 = std::array::from_fn(|k| size * (near[k] - at[k]));
                let to: Point3 = std::array::from_fn(|k| at[k] + off[k]);
                let mut region = Aabb { lo: at, hi: at };
                region.add(to);
                let e = f.expansion(at, region).expect("within the domain");
                let moved = e.moved(off.map(Interval::constant));
                let jet = f.jet(to);
                assert!(wider(moved.value, 1e-12).contains(jet.v), "degree {degree}");
                for k in 0..3 {
                    assert!(wider(moved.gradient[k], 1e-11).contains(jet.g[k]));
                }
                for k in 0..6 {
                    assert!(wider(moved.hessian[k], 1e-10).contains(jet.h[k]));
                }
            }
        }
    }

    /// An interval that also allows for the rounding of what is compared with it.
    fn wider(i: Interval, by: f64) -> Interval {
        i + Interval::new(-by, by)
    }

    #[test]
    fn nothing_is_said_where_second_derivatives_jump() {
        let f = by_chance(2);
        let at = [1.3, 0.0, 3.0];
        let around = |by: f64| Aabb {
            lo: at.map(|v| v - by),
            hi: at.map(|v| v + by),
        };
        assert!(f.expansion([1.4, 0.1, 3.1], around(0.2)).is_none());
        let small = Aabb {
            lo: at.map(|v| v + 0.05),
            hi: at.map(|v| v + 0.06),
        };
        assert!(f.expansion(small.lo, small).is_some());
        assert!(by_chance(3).expansion(at, around(5.0)).is_none(), "beyond");
    }
}
