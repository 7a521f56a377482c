//! Conjugate gradients for the corrections of a level.

use crate::energy::{LevelEquations, LevelProblem};
use crate::keys::NO_INDEX;
use crate::schwarz::Schwarz;
use isoform_control::{Control, Stopped};

/// Weight, as a share of the median weight of data, that ties a coefficient with hardly any data to
/// the coarser level. Without it some of these coefficients oscillate; with ten times more, errors
/// at edges grow by a tenth.
const RIDGE_WEIGHT: f64 = 1e-3;

/// Share of the median weight of data below which a coefficient counts as having hardly any data.
const SPARSE_DATA_SHARE: f64 = 1e-2;

/// Returns the weights of the corrections themselves, from the diagonal of the data's matrix.
fn ridge(diagonal: &[f64]) -> Vec<f64> {
    let mut sorted = diagonal.to_vec();
    if sorted.is_empty() {
        return sorted;
    }
    let half = sorted.len() / 2;
    let median = *sorted.select_nth_unstable_by(half, f64::total_cmp).1;
    let of = |d: &f64| {
        let lack = (SPARSE_DATA_SHARE * median / d.max(f64::MIN_POSITIVE)).min(1.0);
        RIDGE_WEIGHT * median * lack * lack
    };
    diagonal.iter().map(of).collect()
}

/// Equations of a level with the work space of their solution.
pub(crate) struct LevelSolver<'a> {
    problem: &'a LevelProblem<'a>,
    system: LevelEquations,
    /// Weights of the unknowns themselves.
    ridge: Vec<f64>,
    /// Preconditioner; `None` after the equations have changed.
    preconditioner: Option<Schwarz>,
    /// Coefficients, gradient and differences of the smoothing term.
    spread: Vec<f64>,
    gradient: Vec<f64>,
    scratch: Vec<[f64; 6]>,
}

impl<'a> LevelSolver<'a> {
    /// Assembles the equations, with f kept in some cells.
    pub(crate) fn new(
        problem: &'a LevelProblem<'a>,
        held: &[usize],
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut system = problem.system(control)?;
        problem.hold(&mut system, held, control)?;
        let n = problem.level.nodes.len();
        let ridge = ridge(&system.matrix.diagonal());
        Ok(Self {
            preconditioner: None,
            problem,
            system,
            ridge,
            spread: vec![0.0; n],
            gradient: vec![0.0; n],
            scratch: Vec::new(),
        })
    }

    /// Adds equations that keep f in more cells.
    pub(crate) fn hold(&mut self, cells: &[usize], control: &Control<'_>) -> Result<(), Stopped> {
        if cells.is_empty() {
            return Ok(());
        }
        self.problem.hold(&mut self.system, cells, control)?;
        self.ridge = ridge(&self.system.matrix.diagonal());
        self.preconditioner = None;
        Ok(())
    }

    /// Adds half the gradient of the smoothing term at the coefficients in `spread`.
    fn add_smoothing(&mut self, y: &mut [f64]) {
        let weight = self.problem.smoothing_weight();
        self.gradient.fill(0.0);
        self.system.smoothing.add_gradient(
            weight,
            &self.spread,
            &mut self.scratch,
            &mut self.gradient,
        );
        for (g, i) in self.gradient.iter().zip(&self.problem.unknown) {
            if *i != NO_INDEX {
                y[*i as usize] += g;
            }
        }
    }

    /// Computes y = A x.
    pub(crate) fn apply(&mut self, x: &[f64], y: &mut [f64]) {
        self.system.matrix.apply(x, y);
        for ((y, x), ridge) in y.iter_mut().zip(x).zip(&self.ridge) {
            *y += ridge * x;
        }
        for (s, i) in self.spread.iter_mut().zip(&self.problem.unknown) {
            *s = if *i == NO_INDEX { 0.0 } else { x[*i as usize] };
        }
        self.add_smoothing(y);
    }

    /// Returns the right side: that of the data and of the smoothing term at the present
    /// coefficients.
    pub(crate) fn right(&mut self) -> Vec<f64> {
        let level = self.problem.level;
        for (s, c) in self.spread.iter_mut().zip(&level.coefficients) {
            *s = -c / level.spacing;
        }
        let mut right = self.system.right.clone();
        self.add_smoothing(&mut right);
        right
    }

    /// Solves for the corrections of the active coefficients, in units of the spacing, from the
    /// initial values `x`, by preconditioned conjugate gradients. The tolerance bounds the residual
    /// in the norm of the preconditioner, relative to that of zero corrections; it is about a fifth
    /// of the error in the energy norm.
    pub(crate) fn solve(
        &mut self,
        mut x: Vec<f64>,
        tolerance: f64,
        most: usize,
        control: &Control<'_>,
    ) -> Result<Vec<f64>, Stopped> {
        let mut preconditioner = match self.preconditioner.take() {
            Some(kept) => kept,
            None => Schwarz::new(self.problem, &self.system, &self.ridge, control)?,
        };
        let mut r = self.right();
        let (mut y, mut z) = (vec![0.0; r.len()], vec![0.0; r.len()]);
        preconditioner.apply(&r, &mut z);
        let enough = tolerance * tolerance * product(&r, &z);
        self.apply(&x, &mut y);
        r.iter_mut().zip(&y).for_each(|(r, y)| *r -= y);
        preconditioner.apply(&r, &mut z);
        let mut p = z.clone();
        let mut rz = product(&r, &z);
        let mut steps = 0;
        while steps < most && rz > enough {
            control.check()?;
            self.apply(&p, &mut y);
            let step = rz / product(&p, &y);
            for k in 0..x.len() {
                x[k] += step * p[k];
                r[k] -= step * y[k];
            }
            preconditioner.apply(&r, &mut z);
            let next = product(&r, &z);
            let ratio = next / rz;
            for (p, z) in p.iter_mut().zip(&z) {
                *p = z + ratio * *p;
            }
            rz = next;
            steps += 1;
        }
        self.preconditioner = Some(preconditioner);
        Ok(x)
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
