//! Linear equations of a step.

use super::conditions::Condition;
use super::entity::SnapEntity;
use crate::chart::{MAX_PARAMETERS, ParameterRow, ROUNDING_DEVIATION};
use crate::relations::CHI_SQUARED;
use isoform_num::linalg::{cholesky, cholesky_solve};

/// Minimum share of its variance that is not explained by other equations; with less an equation
/// follows from them. A smaller bound would divide by what curvature leaves of it, a larger one
/// would drop independent equations.
const MIN_OWN_VARIANCE: f64 = 1e-7;

/// One equation: the entities, the derivatives by the parameters of both, and its value.
struct Equation {
    condition: usize,
    entities: [usize; 2],
    rows: [ParameterRow; 2],
    value: f64,
}

/// The independent equations, scaled to unit variance, with the Cholesky factor of their
/// correlations.
pub(super) struct EquationSystem {
    equations: Vec<Equation>,
    correlations: Vec<f64>,
    factor: Vec<f64>,
}

/// Returns the product of a vector with W, to which the rounding that relations allow for is added.
fn weighted(own: &SnapEntity, row: &ParameterRow) -> ParameterRow {
    let n = own.known.surface.kind.parameters();
    std::array::from_fn(|i| {
        let of = |j: usize| own.known.covariance[i][j] * row[j];
        let rounding = ROUNDING_DEVIATION * ROUNDING_DEVIATION / 2.0 * row[i];
        if i < n {
            (0..n).map(of).sum::<f64>() + rounding
        } else {
            0.0
        }
    })
}

fn product(a: &ParameterRow, b: &ParameterRow) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl EquationSystem {
    pub(super) fn new(
        owns: &[SnapEntity],
        steps: &[ParameterRow],
        conditions: &[Condition],
    ) -> Self {
        let mut equations = Vec::new();
        for (condition, c) in conditions.iter().enumerate() {
            let [i, j] = c.entities;
            let starts = [&owns[i].known, &owns[j].known];
            let (values, rows) = c.linearised(starts, [&steps[i], &steps[j]]);
            for (value, rows) in values.into_iter().zip(rows) {
                let variance: f64 = (0..2)
                    .map(|w| product(&rows[w], &weighted(&owns[c.entities[w]], &rows[w])))
                    .sum();
                let scale = variance.sqrt().recip();
                equations.push(Equation {
                    condition,
                    entities: c.entities,
                    rows: rows.map(|row| row.map(|x| x * scale)),
                    value: value * scale,
                });
            }
        }
        let correlations = correlations(owns, &equations);
        let kept = independent(&correlations, equations.len());
        let n = equations.len();
        let of = kept
            .iter()
            .flat_map(|i| kept.iter().map(move |j| i * n + j));
        let correlations: Vec<f64> = of.map(|k| correlations[k]).collect();
        let mut number = 0..n;
        equations.retain(|_| {
            number
                .next()
                .is_some_and(|k| kept.binary_search(&k).is_ok())
        });
        let mut factor = correlations.clone();
        let is_regular = cholesky(&mut factor, equations.len());
        debug_assert!(is_regular, "dependent equations were left out");
        Self {
            equations,
            correlations,
            factor,
        }
    }

    pub(super) fn rank(&self) -> usize {
        self.equations.len()
    }

    /// Returns λ and the step of each entity, for the gradients of the sums of squares.
    pub(super) fn step(
        &self,
        owns: &[SnapEntity],
        gradients: &[ParameterRow],
    ) -> (Vec<f64>, Vec<ParameterRow>) {
        let free: Vec<ParameterRow> = owns
            .iter()
            .zip(gradients)
            .map(|(o, b)| match o.known.covariance[0][0].is_finite() {
                true => weighted(o, b),
                false => [0.0; MAX_PARAMETERS],
            })
            .collect();
        let side = self.equations.iter().map(|e| {
            let of = |w: usize| product(&e.rows[w], &free[e.entities[w]]);
            e.value - of(0) - of(1)
        });
        let mut lambda: Vec<f64> = side.collect();
        cholesky_solve(&self.factor, self.rank(), &mut lambda);
        let mut steps: Vec<ParameterRow> = free.iter().map(|f| f.map(|x| -x)).collect();
        for (e, l) in self.equations.iter().zip(&lambda) {
            for (i, row) in e.entities.iter().zip(&e.rows) {
                let by = weighted(&owns[*i], row);
                steps[*i].iter_mut().zip(by).for_each(|(s, x)| *s -= l * x);
            }
        }
        (lambda, steps)
    }

    /// Returns the condition that raises the sum of squares the most beyond what χ² allows.
    pub(super) fn contradiction(&self, lambda: &[f64]) -> Option<usize> {
        let (mut worst, mut first) = (None, 0);
        while first < self.rank() {
            let condition = self.equations[first].condition;
            let of = self.equations[first..].iter();
            let count = of.take_while(|e| e.condition == condition).count();
            let excess = self.gain(lambda, first, count) / CHI_SQUARED[count - 1];
            if excess > 1.0 && worst.is_none_or(|(most, _)| excess > most) {
                worst = Some((excess, condition));
            }
            first += count;
        }
        worst.map(|w| w.1)
    }

    /// Returns the decrease of the sum of squares without some equations: λᵀ (A⁻¹)⁻¹ λ over them.
    fn gain(&self, lambda: &[f64], first: usize, count: usize) -> f64 {
        let n = self.rank();
        let l = &lambda[first..first + count];
        let square = |a: &dyn Fn(usize, usize) -> f64| -> f64 {
            (0..count * count)
                .map(|k| l[k / count] * a(k / count, k % count) * l[k % count])
                .sum()
        };
        // This is an upper bound: for most conditions the inverse is not needed.
        let bound = square(&|i, j| self.correlations[(first + i) * n + first + j]);
        if bound <= CHI_SQUARED[count - 1] {
            return bound;
        }
        let mut inverse = Vec::new();
        for k in first..first + count {
            let mut column = vec![0.0; n];
            column[k] = 1.0;
            cholesky_solve(&self.factor, n, &mut column);
            inverse.extend_from_slice(&column[first..first + count]);
        }
        let mut x = l.to_vec();
        if !cholesky(&mut inverse, count) {
            return bound;
        }
        cholesky_solve(&inverse, count, &mut x);
        x.iter().zip(l).map(|(a, b)| a * b).sum()
    }

    /// Returns the covariances of the entities under the equations: P W Pᵀ.
    pub(super) fn covariances(&self, owns: &[SnapEntity]) -> Vec<[ParameterRow; MAX_PARAMETERS]> {
        let mut touching = vec![Vec::new(); owns.len()];
        for (k, e) in self.equations.iter().enumerate() {
            (0..2).for_each(|w| touching[e.entities[w]].push((k, w)));
        }
        owns.iter()
            .zip(&touching)
            .map(|(own, of)| self.covariance(own, of))
            .collect()
    }

    /// Returns W − (G W)ᵀ (G W Gᵀ)⁻¹ G W of one entity; `touching` lists the equations, and their
    /// sides, that involve it.
    fn covariance(
        &self,
        own: &SnapEntity,
        touching: &[(usize, usize)],
    ) -> [ParameterRow; MAX_PARAMETERS] {
        let mut covariance = own.known.covariance;
        let n = own.known.surface.kind.parameters();
        let mut columns = vec![vec![0.0; self.rank()]; n];
        for (k, w) in touching {
            let row = weighted(own, &self.equations[*k].rows[*w]);
            (0..n).for_each(|i| columns[i][*k] += row[i]);
        }
        if touching.is_empty() {
            return covariance;
        }
        let before: ParameterRow = std::array::from_fn(|i| covariance[i][i]);
        for j in 0..n {
            let mut solved = columns[j].clone();
            cholesky_solve(&self.factor, self.rank(), &mut solved);
            for i in 0..n {
                let taken: f64 = columns[i].iter().zip(&solved).map(|(a, b)| a * b).sum();
                covariance[i][j] -= taken;
            }
        }
        // The allowance for rounding may take more than there was.
        for i in 0..n {
            covariance[i][i] = covariance[i][i].clamp(0.0, before[i]);
        }
        covariance
    }
}

/// Returns G W Gᵀ of scaled equations.
fn correlations(owns: &[SnapEntity], equations: &[Equation]) -> Vec<f64> {
    let n = equations.len();
    let mut touching = vec![Vec::new(); owns.len()];
    for (k, e) in equations.iter().enumerate() {
        (0..2).for_each(|w| touching[e.entities[w]].push((k, w)));
    }
    let mut matrix = vec![0.0; n * n];
    for (own, of) in owns.iter().zip(&touching) {
        for (k, w) in of {
            let row = weighted(own, &equations[*k].rows[*w]);
            for (j, v) in of {
                matrix[k * n + j] += product(&row, &equations[*j].rows[*v]);
            }
        }
    }
    matrix
}

/// Returns the equations that are independent of those before them.
fn independent(correlations: &[f64], n: usize) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    let mut factor: Vec<Vec<f64>> = Vec::new();
    for i in 0..n {
        let mut row: Vec<f64> = Vec::with_capacity(kept.len() + 1);
        for (j, above) in kept.iter().zip(&factor) {
            let m = row.len();
            let done: f64 = row.iter().zip(above).map(|(a, b)| a * b).sum();
            row.push((correlations[i * n + j] - done) / above[m]);
        }
        let left = correlations[i * n + i] - row.iter().map(|x| x * x).sum::<f64>();
        if left > MIN_OWN_VARIANCE {
            row.push(left.sqrt());
            factor.push(row);
            kept.push(i);
        }
    }
    kept
}
