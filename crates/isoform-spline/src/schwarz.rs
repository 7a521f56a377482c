//! Additive Schwarz preconditioner (Toselli and Widlund 2005, chapter 2): the equations of a level
//! are solved exactly in small boxes of B-splines, and the solutions are added.
//!
//! Boxes tile the lattice twice, the second time shifted by half a box, so that B-splines at the
//! border of one box are interior to another. Across the surface, data determine two of the d + 1
//! B-splines of a cell, and smoothing the others. This coupling makes the diagonal alone a poor
//! preconditioner; it lies within a box.

use crate::energy::{LevelEquations, LevelProblem};
use crate::keys::{LatticeIndex, key};
use crate::matrix::split;
use crate::smoothing;
use isoform_control::{Control, Stopped};
use isoform_num::linalg::cholesky;
use rayon::prelude::*;

/// Number of shifted tilings by boxes. One alone takes three times the steps; four cost more than
/// they save.
const BOX_TILINGS: i32 = 2;

/// Boxes of one tiling.
struct BoxTiling {
    /// Unknowns, box by box, and the start of each box.
    unknowns: Vec<u32>,
    starts: Vec<usize>,
    /// Position in that order, by unknown.
    places: Vec<u32>,
    /// Inverses of Cholesky factors, as lower triangles row by row, box by box, and the start of
    /// each.
    inverses: Vec<f64>,
    offsets: Vec<usize>,
    /// Solution in the boxes, in their order.
    solution: Vec<f64>,
}

/// Additive Schwarz preconditioner; see the module documentation.
pub(crate) struct Schwarz {
    lattices: Vec<BoxTiling>,
}

impl Schwarz {
    /// Factors the boxes of equations with the diagonal `ridge` added.
    pub(crate) fn new(
        problem: &LevelProblem<'_>,
        system: &LevelEquations,
        ridge: &[f64],
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        // As many B-splines as touch a cell. Boxes twice as long halve the steps, but each of them
        // takes four times as long.
        let size = problem.degree as i32 + 1;
        let shifts = (0..BOX_TILINGS).map(|k| k * size / BOX_TILINGS);
        let lattice = |shift| BoxTiling::new(problem, system, ridge, [size, shift], control);
        let lattices: Result<_, _> = shifts.map(lattice).collect();
        Ok(Self {
            lattices: lattices?,
        })
    }

    /// Computes z = M⁻¹ r.
    pub(crate) fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        for boxes in &mut self.lattices {
            boxes.solve(r);
        }
        let lattices = &self.lattices;
        let parts = z.par_iter_mut().with_min_len(1 << 10).enumerate();
        parts.for_each(|(i, z)| {
            let of = |boxes: &BoxTiling| boxes.solution[boxes.places[i] as usize];
            *z = lattices.iter().map(of).sum();
        });
    }
}

impl BoxTiling {
    /// Factors boxes of `size` B-splines along each axis, shifted down by `shift`.
    fn new(
        problem: &LevelProblem<'_>,
        system: &LevelEquations,
        ridge: &[f64],
        [size, shift]: [i32; 2],
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let of = |place: LatticeIndex| key(place.map(|v| (v + shift) / size));
        let places = problem.active.places();
        let mut order: Vec<(u64, u32)> = places.map(of).zip(0..).collect();
        order.sort_unstable();
        let (mut starts, mut offsets) = (vec![0], vec![0]);
        for unknowns in order.chunk_by(|a, b| a.0 == b.0) {
            let n = unknowns.len();
            starts.push(starts[starts.len() - 1] + n);
            offsets.push(offsets[offsets.len() - 1] + n * (n + 1) / 2);
        }
        let mut places = vec![0; order.len()];
        for ((_, unknown), at) in order.iter().zip(0..) {
            places[*unknown as usize] = at;
        }
        let mut boxes = Self {
            unknowns: order.into_iter().map(|(_, unknown)| unknown).collect(),
            solution: vec![0.0; places.len()],
            inverses: Vec::new(),
            places,
            starts,
            offsets,
        };
        let mut inverses = vec![0.0; boxes.offsets[boxes.offsets.len() - 1]];
        let parts = split(&mut inverses, &boxes.offsets)
            .into_par_iter()
            .enumerate();
        parts.try_for_each(|(k, out)| {
            control.check()?;
            let matrix = boxes.matrix(k, problem, system, ridge);
            invert(matrix, out);
            Ok(())
        })?;
        boxes.inverses = inverses;
        Ok(boxes)
    }

    /// Returns the equations of a box.
    fn matrix(
        &self,
        k: usize,
        problem: &LevelProblem<'_>,
        system: &LevelEquations,
        ridge: &[f64],
    ) -> Vec<f64> {
        let (start, end) = (self.starts[k], self.starts[k + 1]);
        let unknowns = &self.unknowns[start..end];
        let n = unknowns.len();
        let places: Vec<LatticeIndex> = unknowns
            .iter()
            .map(|i| problem.active.at(*i as usize))
            .collect();
        let mut matrix = vec![0.0; n * n];
        for (i, unknown) in unknowns.iter().enumerate() {
            let row = &mut matrix[i * n..(i + 1) * n];
            for (value, place) in row[..=i].iter_mut().zip(&places) {
                let away = std::array::from_fn(|a| places[i][a] - place[a]);
                *value = problem.smoothing_weight() * smoothing::entry(away);
            }
            let entries = system
                .matrix
                .left_of_diagonal(*unknown as usize, unknowns[0] as usize);
            for (j, value) in entries {
                let at = self.places[j] as usize;
                if (start..end).contains(&at) {
                    row[at - start] += value;
                }
            }
            // Several times the rounding error of a pivot among a hundred unknowns: otherwise
            // pivots that are pure rounding error lead to large solutions.
            row[i] = (row[i] + ridge[*unknown as usize]) * (1.0 + 1e-12);
        }
        matrix
    }

    /// Solves the equations in all boxes.
    fn solve(&mut self, r: &[f64]) {
        let Self {
            unknowns,
            starts,
            inverses,
            offsets,
            solution,
            ..
        } = self;
        let parts = split(solution, starts).into_par_iter().enumerate();
        parts.with_min_len(8).for_each(|(k, z)| {
            let unknowns = &unknowns[starts[k]..starts[k + 1]];
            let inverse = &inverses[offsets[k]..offsets[k + 1]];
            solve(inverse, unknowns, r, z);
        });
    }
}

/// Computes the inverse of the Cholesky factor of a matrix, as its lower triangle row by row. Falls
/// back to the diagonal if the matrix is not positive definite to working precision.
fn invert(mut matrix: Vec<f64>, out: &mut [f64]) {
    let n = matrix.len().isqrt();
    let diagonal: Vec<f64> = matrix.iter().step_by(n + 1).copied().collect();
    let is_definite = cholesky(&mut matrix, n);
    let mut start = 0;
    for i in 0..n {
        let (above, rest) = out.split_at_mut(start);
        let row = &mut rest[..=i];
        if is_definite {
            let factors = &matrix[i * n..];
            let mut at = 0;
            for (j, factor) in factors[..i].iter().enumerate() {
                for (v, a) in row.iter_mut().zip(&above[at..=at + j]) {
                    *v -= factor * a;
                }
                at += j + 1;
            }
            row[i] = 1.0;
            row.iter_mut().for_each(|v| *v /= factors[i]);
        } else {
            row[i] = 1.0 / diagonal[i].sqrt();
        }
        start += i + 1;
    }
}

/// Computes z = WᵀW r for the inverse factor W of a box.
fn solve(inverse: &[f64], unknowns: &[u32], r: &[f64], z: &mut [f64]) {
    z.fill(0.0);
    let r: Vec<f64> = unknowns.iter().map(|i| r[*i as usize]).collect();
    let mut start = 0;
    for i in 0..r.len() {
        let row = &inverse[start..=start + i];
        let y: f64 = row.iter().zip(&r).map(|(a, r)| a * r).sum();
        for (z, a) in z.iter_mut().zip(row) {
            *z += a * y;
        }
        start += i + 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::TermWeights;
    use crate::level::SplineLevel;
    use crate::points::{PointsByCell, PointsWithNormals};
    use crate::solve::LevelSolver;
    use isoform_control::Control;
    use isoform_num::linalg::cholesky_solve;

    /// Returns points of a quarter of a cylinder of radius 1.5 in three by two by two cells of unit
    /// size, with normals.
    fn quarter() -> PointsWithNormals {
        let of = |i: u32| {
            let (u, v) = (
                1.5 * f64::from(i % 37) / 36.0,
                f64::from(i * 7 % 41) / 41.0 * 1.8,
            );
            let normal = [u.cos(), u.sin(), 0.0];
            ([1.5 * normal[0], 1.5 * normal[1], v], normal)
        };
        let (points, normals) = (0..600).map(of).unzip();
        PointsWithNormals { points, normals }
    }

    /// Runs a test on the equations of one level.
    fn with(
        samples: &PointsWithNormals,
        count: LatticeIndex,
        smoothing: f64,
        test: impl Fn(&LevelProblem<'_>),
    ) {
        let level = SplineLevel::coarsest(count, 1.0, 3);
        let sorted = PointsByCell::new(samples, [0.0; 3], 1.0, count, |_| true);
        let weights = TermWeights {
            normals: 0.1,
            smoothing,
        };
        test(&LevelProblem::new(&level, 3, &sorted, weights));
    }

    #[test]
    fn one_box_is_solved_exactly() {
        // Points spread over a single cell.
        let at = |i: u32, by: f64| (f64::from(i) * by).fract();
        let points = (0..500).map(|i| [at(i, 0.618), at(i, 0.755), at(i, 0.57)]);
        let samples = PointsWithNormals {
            points: points.collect(),
            normals: vec![[0.0, 0.0, 1.0]; 500],
        };
        with(&samples, [1; 3], 1e-30, |problem| {
            let control = Control::default();
            let system = problem.system(&control).expect("nothing stops it");
            let ridge = vec![1e-3; problem.active.len()];
            let boxes = BoxTiling::new(problem, &system, &ridge, [4, 0], &control);
            let mut boxes = boxes.expect("nothing stops it");
            assert_eq!(boxes.starts, [0, 64]);
            boxes.solve(&system.right);
            let mut x = vec![0.0; 64];
            for (place, i) in boxes.places.iter().zip(0..) {
                x[i] = boxes.solution[*place as usize];
            }
            let mut back = vec![0.0; 64];
            system.matrix.apply(&x, &mut back);
            for (i, back) in back.iter().enumerate() {
                assert!((back + 1e-3 * x[i] - system.right[i]).abs() < 1e-9, "{i}");
            }
        });
    }

    #[test]
    fn a_few_steps_solve_what_the_whole_matrix_solves() {
        let samples = quarter();
        with(&samples, [3, 2, 2], 1e-6, |problem| {
            let n = problem.active.len();
            let control = Control::default();
            let solver = || LevelSolver::new(problem, &[], &control).expect("nothing stops it");
            let mut all = solver();
            let mut matrix = vec![0.0; n * n];
            for i in 0..n {
                let mut unit = vec![0.0; n];
                unit[i] = 1.0;
                all.apply(&unit, &mut matrix[i * n..(i + 1) * n]);
            }
            let mut exact = all.right();
            let mut factor = matrix.clone();
            assert!(cholesky(&mut factor, n));
            cholesky_solve(&factor, n, &mut exact);
            let energy = |x: &[f64]| -> f64 {
                let row = |i: usize| matrix[i * n..(i + 1) * n].iter().zip(x);
                let product = |i: usize| row(i).map(|(a, b)| a * b).sum::<f64>();
                (0..n).map(|i| x[i] * product(i)).sum()
            };
            let off = |most: usize| {
                let x = solver().solve(vec![0.0; n], 0.0, most, &control);
                let x = x.expect("nothing stops it");
                let off: Vec<f64> = x.iter().zip(&exact).map(|(a, b)| a - b).collect();
                (energy(&off) / energy(&exact)).sqrt()
            };
            assert!(off(40) < 1e-4, "{}", off(40));
            assert!(off(100) < 1e-9, "{}", off(100));
        });
    }
}
