//! Smoothing term: second differences of coefficients.
//!
//! Σ (cᵢ₋ₑ − 2 cᵢ + cᵢ₊ₑ)² over the axes and 2 Σ (cᵢ − cᵢ₊ₑ − cᵢ₊ₑ' + cᵢ₊ₑ₊ₑ')² over pairs of axes:
//! the sum of squares of the second derivatives, on the lattice of the coefficients (Eilers and
//! Marx 1996). Sums with a coefficient that the level lacks are omitted.

use crate::keys::{IndexSet, LatticeIndex, NO_INDEX};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;

/// Neighbours of the B-splines of a level along the axes: before and after.
#[derive(Debug)]
pub(crate) struct Smoothing {
    neighbours: Vec<[[u32; 2]; 3]>,
}

/// Second differences at a B-spline: xx, yy, zz, then xy, xz, yz towards higher indices. The mixed
/// ones are multiplied by √2, as each occurs twice in a Hessian.
type Differences = [f64; 6];

/// Pairs of axes of mixed differences.
const MIXED_AXES: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// Returns the entry of the term's matrix for two B-splines at this offset on the lattice, provided
/// that no difference is omitted.
pub(crate) fn entry(away: LatticeIndex) -> f64 {
    let away = away.map(|v| v.unsigned_abs() as usize);
    let (along, across) = ([6.0, -4.0, 1.0], [2.0, -1.0]);
    let of = |table: &[f64], axis: usize| table.get(away[axis]).copied().unwrap_or(0.0);
    let pure = (0..3).filter(|a| away[(a + 1) % 3] == 0 && away[(a + 2) % 3] == 0);
    let mixed = MIXED_AXES.iter().filter(|[a, b]| away[3 - a - b] == 0);
    pure.map(|a| of(&along, a)).sum::<f64>()
        + mixed
            .map(|[a, b]| 2.0 * of(&across, *a) * of(&across, *b))
            .sum::<f64>()
}

impl Smoothing {
    pub(crate) fn new(nodes: &IndexSet) -> Self {
        let neighbours = (0..nodes.len())
            .into_par_iter()
            .map(|i| {
                let at = nodes.at(i);
                std::array::from_fn(|axis| {
                    [-1, 1].map(|step| {
                        let mut to = at;
                        to[axis] += step;
                        nodes.find(to).map_or(NO_INDEX, |j| j as u32)
                    })
                })
            })
            .collect();
        Self { neighbours }
    }

    /// Returns the differences of `c` at B-spline `i`; 0 for omitted ones.
    fn differences(&self, i: usize, c: &[f64]) -> Differences {
        let mut out = [0.0; 6];
        let near = &self.neighbours[i];
        for (axis, [before, after]) in near.iter().enumerate() {
            if *before != NO_INDEX && *after != NO_INDEX {
                out[axis] = c[*before as usize] - 2.0 * c[i] + c[*after as usize];
            }
        }
        for (k, [a, b]) in MIXED_AXES.iter().enumerate() {
            let (p, q) = (near[*a][1], near[*b][1]);
            if p != NO_INDEX && q != NO_INDEX {
                let r = self.neighbours[p as usize][*b][1];
                if r != NO_INDEX {
                    out[3 + k] = SQRT_2 * (c[i] - c[p as usize] - c[q as usize] + c[r as usize]);
                }
            }
        }
        out
    }

    /// Adds `weight` times half the gradient of the term at `c` to `out`; `scratch` is overwritten.
    pub(crate) fn add_gradient(
        &self,
        weight: f64,
        c: &[f64],
        scratch: &mut Vec<Differences>,
        out: &mut [f64],
    ) {
        scratch.resize(self.neighbours.len(), [0.0; 6]);
        scratch
            .par_iter_mut()
            .with_min_len(1 << 10)
            .enumerate()
            .for_each(|(i, d)| *d = self.differences(i, c));
        let scratch = &*scratch;
        out.par_iter_mut()
            .with_min_len(1 << 10)
            .enumerate()
            .for_each(|(i, out)| {
                let near = &self.neighbours[i];
                let mut sum = 0.0;
                for (axis, pair) in near.iter().enumerate() {
                    sum -= 2.0 * scratch[i][axis];
                    for j in pair.iter().filter(|j| **j != NO_INDEX) {
                        sum += scratch[*j as usize][axis];
                    }
                }
                for (k, [a, b]) in MIXED_AXES.iter().enumerate() {
                    let (p, q) = (near[*a][0], near[*b][0]);
                    let mut mixed = scratch[i][3 + k];
                    if p != NO_INDEX {
                        mixed -= scratch[p as usize][3 + k];
                        let r = self.neighbours[p as usize][*b][0];
                        if r != NO_INDEX {
                            mixed += scratch[r as usize][3 + k];
                        }
                    }
                    if q != NO_INDEX {
                        mixed -= scratch[q as usize][3 + k];
                    }
                    sum += SQRT_2 * mixed;
                }
                *out += weight * sum;
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::key;
    use crate::level::block;

    #[test]
    fn entries_are_those_of_the_gradient() {
        let (low, high) = ([0; 3], [8; 3]);
        let nodes = IndexSet::new(block(low, high).map(key).collect());
        let middle = [4; 3];
        let mut c = vec![0.0; nodes.len()];
        c[nodes.find(middle).unwrap()] = 1.0;
        let mut column = vec![0.0; nodes.len()];
        Smoothing::new(&nodes).add_gradient(1.0, &c, &mut Vec::new(), &mut column);
        for (place, value) in nodes.places().zip(&column) {
            let away = std::array::from_fn(|k| place[k] - middle[k]);
            assert!((entry(away) - value).abs() < 1e-12, "{away:?}");
        }
        assert_eq!(entry([0; 3]), 42.0);
    }

    #[test]
    fn the_gradient_is_that_of_the_sum_of_squares() {
        let nodes = IndexSet::new(
            block([0; 3], [3, 2, 2])
                .filter(|p| *p != [1, 1, 1])
                .map(key)
                .collect(),
        );
        let s = Smoothing::new(&nodes);
        let n = nodes.len();
        let c: Vec<f64> = (0..n).map(|i| ((i * i * 7 + 3 * i) % 11) as f64).collect();
        let energy = |c: &[f64]| -> f64 {
            (0..n)
                .map(|i| s.differences(i, c).iter().map(|d| d * d).sum::<f64>())
                .sum()
        };
        let mut gradient = vec![0.0; n];
        s.add_gradient(2.0, &c, &mut Vec::new(), &mut gradient);
        for i in 0..n {
            let (mut lo, mut hi) = (c.clone(), c.clone());
            lo[i] -= 0.5;
            hi[i] += 0.5;
            assert!(
                (energy(&hi) - energy(&lo) - gradient[i]).abs() < 1e-9,
                "{i}"
            );
        }
    }
}
