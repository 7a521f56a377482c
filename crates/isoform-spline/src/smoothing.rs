//! The smoothing term: second differences of coefficients.
//!
//! Σ (cᵢ₋ₑ − 2 cᵢ + cᵢ₊ₑ)² over the axes and 2 Σ (cᵢ − cᵢ₊ₑ − cᵢ₊ₑ' + cᵢ₊ₑ₊ₑ')² over pairs of axes: the
//! sum of squares of the second derivatives, on the lattice of the coefficients (Eilers and Marx
//! 1996). Sums with a coefficient that the level lacks are left out.

use crate::keys::Keys;
use rayon::prelude::*;

/// No neighbour.
const NONE: u32 = u32::MAX;

/// Neighbours of the B-splines of a level along the axes: before and after.
#[derive(Debug)]
pub(crate) struct Smoothing {
    neighbours: Vec<[[u32; 2]; 3]>,
}

/// Second differences at a B-spline: xx, yy, zz, then xy, xz, yz towards higher numbers.
type Differences = [f64; 6];

/// The pairs of axes of mixed differences.
const MIXED: [[usize; 2]; 3] = [[0, 1], [0, 2], [1, 2]];

/// √2, the weight of a mixed difference: the sum of squares of a Hessian holds it twice.
const TWICE: f64 = std::f64::consts::SQRT_2;

/// The diagonal of the term's matrix where no difference is left out: 1 + 4 + 1 from each axis and
/// twice 4 from each pair of axes.
pub(crate) const DIAGONAL: f64 = 3.0 * 6.0 + 3.0 * 8.0;

impl Smoothing {
    pub(crate) fn new(nodes: &Keys) -> Self {
        let neighbours = (0..nodes.len())
            .into_par_iter()
            .map(|i| {
                let at = nodes.at(i);
                std::array::from_fn(|axis| {
                    [-1, 1].map(|step| {
                        let mut to = at;
                        to[axis] += step;
                        nodes.find(to).map_or(NONE, |j| j as u32)
                    })
                })
            })
            .collect();
        Self { neighbours }
    }

    /// The differences of `c` at B-spline `i`, 0 where one is left out.
    fn differences(&self, i: usize, c: &[f64]) -> Differences {
        let mut out = [0.0; 6];
        let near = &self.neighbours[i];
        for (axis, [before, after]) in near.iter().enumerate() {
            if *before != NONE && *after != NONE {
                out[axis] = c[*before as usize] - 2.0 * c[i] + c[*after as usize];
            }
        }
        for (k, [a, b]) in MIXED.iter().enumerate() {
            let (p, q) = (near[*a][1], near[*b][1]);
            if p != NONE && q != NONE {
                let r = self.neighbours[p as usize][*b][1];
                if r != NONE {
                    out[3 + k] = TWICE * (c[i] - c[p as usize] - c[q as usize] + c[r as usize]);
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
                    for j in pair.iter().filter(|j| **j != NONE) {
                        sum += scratch[*j as usize][axis];
                    }
                }
                for (k, [a, b]) in MIXED.iter().enumerate() {
                    let (p, q) = (near[*a][0], near[*b][0]);
                    let mut mixed = scratch[i][3 + k];
                    if p != NONE {
                        mixed -= scratch[p as usize][3 + k];
                        let r = self.neighbours[p as usize][*b][0];
                        if r != NONE {
                            mixed += scratch[r as usize][3 + k];
                        }
                    }
                    if q != NONE {
                        mixed -= scratch[q as usize][3 + k];
                    }
                    sum += TWICE * mixed;
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
    fn the_gradient_is_that_of_the_sum_of_squares() {
        let nodes = Keys::new(
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
