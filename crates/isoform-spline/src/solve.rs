//! Conjugate gradients for the corrections of a level.

use crate::energy::{FIXED, Problem, System};
use crate::smoothing::DIAGONAL;
use isoform_control::{Control, Stopped};

/// The weight that holds a coefficient which data hardly touches at the level before: without it
/// some of them swing. Ten times more of it costs a tenth at edges.
const HELD: f64 = 1e-3;

/// The part of the median weight of data below which data hardly touches a coefficient.
const HARDLY: f64 = 1e-2;

/// Weights of the corrections themselves, from the diagonal of the data's matrix.
fn ridge(diagonal: &[f64]) -> Vec<f64> {
    let mut sorted = diagonal.to_vec();
    if sorted.is_empty() {
        return sorted;
    }
    let half = sorted.len() / 2;
    let median = *sorted.select_nth_unstable_by(half, f64::total_cmp).1;
    let of = |d: &f64| {
        let lack = (HARDLY * median / d.max(f64::MIN_POSITIVE)).min(1.0);
        HELD * median * lack * lack
    };
    diagonal.iter().map(of).collect()
}

/// The operator of a level with its scratch.
struct Operator<'a> {
    problem: &'a Problem<'a>,
    system: &'a System,
    /// λ/M.
    weight: f64,
    /// Weights of the unknowns themselves.
    ridge: Vec<f64>,
    spread: Vec<f64>,
    gradient: Vec<f64>,
    scratch: Vec<[f64; 6]>,
}

impl Operator<'_> {
    fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        self.system.matrix.apply(x, y);
        for ((y, x), ridge) in y.iter_mut().zip(x).zip(&self.ridge) {
            *y += ridge * x;
        }
        for (s, i) in self.spread.iter_mut().zip(&self.problem.unknown) {
            *s = if *i == FIXED { 0.0 } else { x[*i as usize] };
        }
        self.gradient.fill(0.0);
        self.system.smoothing.add_gradient(
            self.weight,
            &self.spread,
            &mut self.scratch,
            &mut self.gradient,
        );
        for (g, i) in self.gradient.iter().zip(&self.problem.unknown) {
            if *i != FIXED {
                y[*i as usize] += g;
            }
        }
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// rᵀ D⁻¹ r.
fn size(r: &[f64], diagonal: &[f64]) -> f64 {
    r.iter().zip(diagonal).map(|(r, d)| r * (r / d)).sum()
}

/// The corrections of the active coefficients, in units of the spacing, found from others, `x`. The
/// tolerance is relative to the right side.
pub(crate) fn solve(
    problem: &Problem<'_>,
    system: &System,
    mut x: Vec<f64>,
    tolerance: f64,
    most: usize,
    control: &Control<'_>,
) -> Result<Vec<f64>, Stopped> {
    let n = problem.level.nodes.len();
    let weight = problem.weights.smoothing / problem.points.count().max(1) as f64;
    let mut diagonal = system.matrix.diagonal();
    let ridge = ridge(&diagonal);
    let mut operator = Operator {
        problem,
        system,
        weight,
        ridge,
        spread: vec![0.0; n],
        gradient: vec![0.0; n],
        scratch: Vec::new(),
    };
    // The smoothing term at the coefficients as they are.
    let scaled: Vec<f64> = problem
        .level
        .coefficients
        .iter()
        .map(|c| c / problem.level.spacing)
        .collect();
    let mut gradient = vec![0.0; n];
    system
        .smoothing
        .add_gradient(weight, &scaled, &mut operator.scratch, &mut gradient);
    let mut r = system.right.clone();
    for (g, i) in gradient.iter().zip(&problem.unknown) {
        if *i != FIXED {
            r[*i as usize] -= g;
            diagonal[*i as usize] += weight * DIAGONAL + operator.ridge[*i as usize];
        }
    }
    let mut y = vec![0.0; r.len()];
    let first = size(&r, &diagonal);
    operator.apply(&x, &mut y);
    r.iter_mut().zip(&y).for_each(|(r, y)| *r -= y);
    let mut z: Vec<f64> = r.iter().zip(&diagonal).map(|(r, d)| r / d).collect();
    let mut p = z.clone();
    let mut rz = product(&r, &z);
    let mut steps = 0;
    while steps < most && rz > tolerance * tolerance * first {
        control.check()?;
        operator.apply(&p, &mut y);
        let step = rz / product(&p, &y);
        for k in 0..x.len() {
            x[k] += step * p[k];
            r[k] -= step * y[k];
            z[k] = r[k] / diagonal[k];
        }
        let next = product(&r, &z);
        let ratio = next / rz;
        for (p, z) in p.iter_mut().zip(&z) {
            *p = z + ratio * *p;
        }
        rz = next;
        steps += 1;
    }
    Ok(x)
}
