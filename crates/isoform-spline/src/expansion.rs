//! Proved Taylor expansions of an implicit spline.
//!
//! A derivative of a sum Σ c B of uniform B-splines is again such a sum, one degree lower, with the
//! differences of c divided by h as coefficients. B-splines are non-negative and sum to 1, so the
//! smallest and the largest of these differences bound it (de Boor 1978, ch. X). Third derivatives
//! in a cell are therefore bounded by third differences of its (d + 1)³ coefficients.
//!
//! Rounding. The coefficients of inactive B-splines are averages of coarser coefficients, rounded
//! once per term and level; values at points are sums of products of these with B-splines. Both
//! errors are bounded by a number of roundings of the largest coefficient, and each derivative
//! multiplies the bound by 2/h.

use crate::keys::LatticeIndex;
use crate::level::{MAX_CELL_SPLINES, SplineLevel, block};
use crate::surface::ImplicitSpline;
use isoform_geom::{Aabb, Expansion, Point3};
use isoform_num::{Interval, ORDERS};

/// Ranges of the third derivatives, in the order of [`Expansion::third`].
type Thirds = [[f64; 2]; 10];

impl ImplicitSpline {
    /// Implements [`isoform_geom::Field::expansion`]. Returns `None` outside the domain, and for
    /// degree 2, whose second derivatives jump, unless the region lies in one cell.
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

    /// Returns a bound on the rounding error of f at a point in a cell of edge h. The local
    /// coordinate is off by a few roundings of its distance from the corner, each of which changes
    /// f by at most twice the largest coefficient along each axis.
    fn rounding(&self, at: Point3, h: f64) -> f64 {
        let corner = self.domain().lo;
        let far = (0..3).fold(1.0, |far: f64, k| far.max((at[k] - corner[k]).abs() / h));
        let place = 6.0 * 4.0 * (1.0 + far);
        // Per level of a coefficient, 64 products of two weights and a coefficient, and their sum.
        let coefficient = 70.0 * self.depth() as f64;
        // Three B-splines of at most five steps with four roundings each, and a sum of 216
        // products.
        let value = 400.0;
        let count = coefficient + value + place;
        count * f64::EPSILON * self.largest()
    }

    /// Bounds the third derivatives in a region of the domain.
    fn thirds(&self, region: Aabb) -> Option<Thirds> {
        // Far more cells than a small part of a surface touches. Larger regions would take long and
        // prove little.
        let cells = self.leaves_in(region, 4096)?;
        if self.degree() < 3 && cells.len() > 1 {
            return None;
        }
        let mut all = [[f64::INFINITY, f64::NEG_INFINITY]; 10];
        for (l, cell) in cells {
            let level = &self.levels()[l];
            let c = level.cell_coefficients(cell, self.degree());
            // A third difference is a sum of eight coefficients, each with the rounding error of a
            // value.
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

    /// Returns the leaf cells that intersect a region of the domain, each with its level; `None` if
    /// they are more than `most`.
    fn leaves_in(&self, region: Aabb, most: usize) -> Option<Vec<(usize, LatticeIndex)>> {
        let mut found = Vec::new();
        let mut rest: Vec<(usize, LatticeIndex)> = Vec::new();
        let (lo, hi) = self.first_cells(region);
        let count: i64 = (0..3).map(|k| i64::from(hi[k] - lo[k]) + 1).product();
        if count > most as i64 {
            return None;
        }
        rest.extend(block(lo, hi).map(|cell| (0, cell)));
        while let Some((l, cell)) = rest.pop() {
            let level: &SplineLevel = &self.levels()[l];
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

/// Returns the smallest and the largest difference of n³ numbers, x fastest, of the given orders
/// along the axes; 0 if an order is at least n.
fn differences(c: &[f64; MAX_CELL_SPLINES], n: usize, order: [usize; 3]) -> [f64; 2] {
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

    /// Returns a spline with random coefficients, refined around one cell.
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

    /// Widens an interval to allow for the rounding of the value compared with it.
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
