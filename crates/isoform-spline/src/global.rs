//! Least-squares fit of one polynomial to points.
//!
//! With q the points' coordinates in a cube of edge 2 and n their normals, the polynomial F of
//! total degree K minimises
//!
//! ```text
//! 1/N Σ ( F² + α |∇F − (∇F·n) n|² )  +  τ/N Σ ( (∇F·n + 1)² + (nᵀ H n)² )
//! ```
//!
//! subject to a mean of −1 for ∇F·n. Only the mean length of ∇F is prescribed: length 1 everywhere,
//! as Jüttler and Felis (2002) ask of splines, moves the surface of a polynomial of low degree. The
//! trace term τ only decides between polynomials that fit equally well: (1 − r²) times any
//! polynomial vanishes on a sphere, and (1 − r²)² times any polynomial changes neither F nor ∇F
//! there. Solving for corrections (iterated regularisation) removes its influence on what the
//! points determine, and also the rounding of the normal equations.

use crate::basis::{BasisRows, LegendreBasis};
use crate::components::{Components, lattice_components};
use crate::feet::{Distances, distance};
use crate::implicitize::{Error, FirstLattice, check_points};
use crate::keys::{LatticeIndex, place};
use crate::points::cell_of;
use crate::sides::{NormalReport, Normals, oriented_normals};
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, Point3, PolynomialData, sub};
use isoform_num::linalg::{cholesky, cholesky_solve};
use rayon::prelude::*;

/// Maximum total degree: 455 coefficients. Beyond it monomial coefficients lose too many digits to
/// cancellation.
pub const MAX_GLOBAL_DEGREE: usize = 12;

/// Weight τ of the trace term. Large compared with the rounding of the normal equations, 1e-16, and
/// small compared with the information of the points: a thousandth of the variance is 1e-6 for
/// noise of 0.1 %.
const TRACE_WEIGHT: f64 = 1e-8;

/// Weight of the coefficients themselves, as a share of the mean diagonal. It fixes what no other
/// term does, such as (1 − r²)³ times any polynomial on a sphere. Smaller than [`TRACE_WEIGHT`],
/// larger than rounding.
const RIDGE_SHARE: f64 = 1e-12;

/// Root mean square of residuals below which they say nothing about noise: rounding and the trace
/// term leave 1e-9.
const MIN_NOISE_RMS: f64 = 1e-7;

/// Number of points whose rows one task sums. Sums are added in order, so this fixes the bits of
/// results.
pub(crate) const POINTS_PER_CHUNK: usize = 512;

/// Result of fitting one polynomial.
#[derive(Clone, Debug)]
pub struct PolynomialFit {
    /// The polynomial F.
    pub polynomial: PolynomialData,
    /// Distances of the points from F = 0.
    pub distances: Distances,
    /// Source and orientation of the normals.
    pub sides: NormalReport,
    /// Components of the surface within the box of the points.
    pub components: Components,
}

/// Fits one polynomial of a total degree to points; inside is F ≥ 0.
///
/// ```
/// use isoform_control::Control;
/// use isoform_spline::{Normals, implicitize_globally};
/// // 500 points of a unit sphere.
/// let points: Vec<[f64; 3]> = (0..500)
///     .map(|i| {
///         let (z, u) = ((i as f64 + 0.5) / 250.0 - 1.0, 2.4 * i as f64);
///         let r = (1.0 - z * z).sqrt();
///         [r * u.cos(), r * u.sin(), z]
///     })
///     .collect();
/// let fit = implicitize_globally(&points, Normals::Given(&points), 2, &Control::default())?;
/// assert_eq!(fit.polynomial.coefficients.len(), 10);
/// assert!(fit.distances.max < 1e-9);
/// # Ok::<(), isoform_spline::Error>(())
/// ```
///
/// # Errors
/// [`Error`]; also if the degree is not from 1 to [`MAX_GLOBAL_DEGREE`].
pub fn implicitize_globally(
    points: &[Point3],
    normals: Normals<'_>,
    degree: usize,
    control: &Control<'_>,
) -> Result<PolynomialFit, Error> {
    if !(1..=MAX_GLOBAL_DEGREE).contains(&degree) {
        return Err(Error::Option {
            name: "global",
            what: "from 1 to 12 are possible",
        });
    }
    check_points(points)?;
    control.begin("normals")?;
    let (normals, sides) = oriented_normals(points, normals, control)?;
    control.begin("fitting")?;
    let frame = UnitCube::around(Aabb::from_points(points));
    let problem = PolynomialProblem {
        basis: LegendreBasis::new(degree),
        frame,
        points,
        normals: &normals,
    };
    let c = problem.solve(control)?;
    let lattice = FirstLattice::seen(points);
    let polynomial = PolynomialData {
        degree,
        origin: frame.origin,
        unit: frame.unit,
        // F is in units of q; this makes its gradient in space as steep as that of a distance.
        coefficients: problem
            .basis
            .monomials(&c)
            .iter()
            .map(|c| c * frame.unit)
            .collect(),
        corner: lattice.corner,
        spacing: lattice.spacing,
        count: lattice.count,
        cells: cells_with_points(points, &lattice),
    };
    control.begin("checking")?;
    let jet = PolynomialEvaluator::new(&polynomial);
    let off = points
        .par_iter()
        .map(|p| distance(|p| jet.at(p), *p, frame.unit));
    Ok(PolynomialFit {
        distances: Distances::from_values(off.collect()),
        components: lattice_components(&polynomial, |p| jet.at(p).0),
        polynomial,
        sides,
    })
}

/// Returns the cells of a lattice that contain points.
fn cells_with_points(points: &[Point3], lattice: &FirstLattice) -> Vec<LatticeIndex> {
    let of = |p: &Point3| cell_of(sub(*p, lattice.corner), lattice.spacing, lattice.count);
    let mut keys: Vec<u64> = points.par_iter().map(|p| crate::keys::key(of(p))).collect();
    keys.par_sort_unstable();
    keys.dedup();
    keys.into_iter().map(place).collect()
}

/// Affine map to the cube \[−1, 1\]³: q = (p − origin)/unit.
#[derive(Clone, Copy, Debug)]
struct UnitCube {
    origin: Point3,
    unit: f64,
}

impl UnitCube {
    /// Returns the map for a box. Half the cube's edge is a power of two, so that quotients are
    /// exact.
    fn around(bounds: Aabb) -> Self {
        let longest = bounds.size().into_iter().fold(0.0, f64::max);
        Self {
            origin: bounds.center(),
            unit: (0.5 * longest).log2().ceil().exp2().max(f64::MIN_POSITIVE),
        }
    }
    fn within(&self, p: Point3) -> Point3 {
        std::array::from_fn(|k| (p[k] - self.origin[k]) / self.unit)
    }
}

/// Least-squares problem of the module's documentation.
struct PolynomialProblem<'a> {
    basis: LegendreBasis,
    frame: UnitCube,
    points: &'a [Point3],
    normals: &'a [Point3],
}

/// Sums over points: matrix of the normal equations (lower triangle, row by row) and mean of the
/// normal derivatives.
struct PolynomialEquations {
    matrix: Vec<f64>,
    mean: Vec<f64>,
}

/// Sums over points at a solution: right side, and squares of F and of the tangential gradients.
struct PolynomialResidual {
    right: Vec<f64>,
    value: f64,
    tangential: f64,
}

impl PolynomialProblem<'_> {
    /// Computes the coefficients, estimating the weight α of tangential gradients from the
    /// residuals.
    fn solve(&self, control: &Control<'_>) -> Result<Vec<f64>, Error> {
        let mut alpha = 1.0;
        let (mut c, mut left) = self.solution(alpha, control)?;
        // With noise α converges in one round; with exact points and inexact normals each round
        // lowers it by a factor of several hundred.
        for _ in 0..4 {
            // Weights each kind of equation by the inverse of its variance. Inexact normals move a
            // surface through exact points by α times their error: α may fall to the weight of the
            // trace term.
            let next = (left.value / left.tangential).clamp(1e-8, 1.0);
            if left.tangential < MIN_NOISE_RMS * MIN_NOISE_RMS || next > 0.5 * alpha {
                break;
            }
            alpha = next;
            (c, left) = self.solution(alpha, control)?;
        }
        Ok(c)
    }

    /// Returns the coefficients for a weight of tangential gradients, and the residual.
    fn solution(
        &self,
        alpha: f64,
        control: &Control<'_>,
    ) -> Result<(Vec<f64>, PolynomialResidual), Error> {
        let n = self.basis.len();
        let mut equations = self.equations(alpha, control)?;
        let diagonal: f64 = (0..n).map(|i| equations.matrix[i * n + i]).sum();
        for i in 0..n {
            equations.matrix[i * n + i] += RIDGE_SHARE * diagonal / n as f64;
        }
        let mut factor = symmetric(&equations.matrix, n);
        if !cholesky(&mut factor, n) {
            return Err(Error::Undetermined);
        }
        let mut along = equations.mean.clone();
        cholesky_solve(&factor, n, &mut along);
        let mut c = vec![0.0; n];
        // The first correction is the solution; each of the others removes most of the remaining
        // influence of the trace term.
        for round in 0..3 {
            let trace = if round == 0 { TRACE_WEIGHT } else { 0.0 };
            let mut step = self.residual(&c, alpha, trace, control)?.right;
            cholesky_solve(&factor, n, &mut step);
            let lack = -1.0 - product(&equations.mean, &c) - product(&equations.mean, &step);
            let share = lack / product(&equations.mean, &along);
            for i in 0..n {
                c[i] += step[i] + share * along[i];
            }
        }
        let left = self.residual(&c, alpha, 0.0, control)?;
        if !c.iter().all(|c| c.is_finite()) {
            return Err(Error::Undetermined);
        }
        Ok((c, left))
    }

    /// Sums `of_chunk` over chunks of points, in an order that does not depend on the number of
    /// threads.
    fn sum<S: Send>(
        &self,
        control: &Control<'_>,
        of_chunk: impl Fn(&[Point3], &[Point3]) -> S + Sync,
        mut add: impl FnMut(S),
    ) -> Result<(), Stopped> {
        let chunks: Vec<_> = self
            .points
            .chunks(POINTS_PER_CHUNK)
            .zip(self.normals.chunks(POINTS_PER_CHUNK))
            .collect();
        // Limits the sums in memory.
        for some in chunks.chunks(16) {
            control.check()?;
            let sums: Vec<S> = some.par_iter().map(|(p, n)| of_chunk(p, n)).collect();
            sums.into_iter().for_each(&mut add);
        }
        Ok(())
    }

    fn equations(&self, alpha: f64, control: &Control<'_>) -> Result<PolynomialEquations, Stopped> {
        let n = self.basis.len();
        let share = 1.0 / self.points.len() as f64;
        let mut all = PolynomialEquations {
            matrix: vec![0.0; n * n],
            mean: vec![0.0; n],
        };
        let of_chunk = |points: &[Point3], normals: &[Point3]| {
            let mut sums = PolynomialEquations {
                matrix: vec![0.0; n * n],
                mean: vec![0.0; n],
            };
            let mut rows = self.basis.rows();
            for (p, normal) in points.iter().zip(normals) {
                self.basis.fill(self.frame.within(*p), *normal, &mut rows);
                sums.add(&rows, alpha);
            }
            sums
        };
        self.sum(control, of_chunk, |sums: PolynomialEquations| {
            accumulate(&mut all.matrix, &sums.matrix, share);
            accumulate(&mut all.mean, &sums.mean, share);
        })?;
        Ok(all)
    }

    fn residual(
        &self,
        c: &[f64],
        alpha: f64,
        trace: f64,
        control: &Control<'_>,
    ) -> Result<PolynomialResidual, Stopped> {
        let empty = || PolynomialResidual {
            right: vec![0.0; c.len()],
            value: 0.0,
            tangential: 0.0,
        };
        let share = 1.0 / self.points.len() as f64;
        let mut all = empty();
        let of_chunk = |points: &[Point3], normals: &[Point3]| {
            let mut sums = empty();
            let mut rows = self.basis.rows();
            for (p, normal) in points.iter().zip(normals) {
                self.basis.fill(self.frame.within(*p), *normal, &mut rows);
                sums.add(&rows, c, alpha, trace);
            }
            sums
        };
        self.sum(control, of_chunk, |sums: PolynomialResidual| {
            accumulate(&mut all.right, &sums.right, share);
            all.value += share * sums.value;
            all.tangential += share * sums.tangential;
        })?;
        Ok(all)
    }
}

fn accumulate(sum: &mut [f64], by: &[f64], share: f64) {
    for (s, v) in sum.iter_mut().zip(by) {
        *s += share * v;
    }
}

impl PolynomialEquations {
    fn add(&mut self, rows: &BasisRows, alpha: f64) {
        let n = self.mean.len();
        let [s, t] = &rows.tangents;
        for i in 0..n {
            self.mean[i] += rows.normal[i];
            let (v, s_i, t_i) = (rows.value[i], alpha * s[i], alpha * t[i]);
            let (m, b) = (TRACE_WEIGHT * rows.normal[i], TRACE_WEIGHT * rows.bend[i]);
            let row = &mut self.matrix[i * n..i * n + i + 1];
            let others = rows.value.iter().zip(s).zip(t);
            let others = others.zip(&rows.normal).zip(&rows.bend);
            for (sum, ((((value, s), t), normal), bend)) in row.iter_mut().zip(others) {
                *sum += v * value + s_i * s + t_i * t + m * normal + b * bend;
            }
        }
    }
}

impl PolynomialResidual {
    fn add(&mut self, rows: &BasisRows, c: &[f64], alpha: f64, trace: f64) {
        let value = product(&rows.value, c);
        let [s, t] = [&rows.tangents[0], &rows.tangents[1]].map(|row| product(row, c));
        // Normals of 0 have rows of 0.
        let (normal, bend) = (product(&rows.normal, c), product(&rows.bend, c));
        self.value += value * value;
        self.tangential += s * s + t * t;
        for i in 0..c.len() {
            self.right[i] -= rows.value[i] * value
                + alpha * (rows.tangents[0][i] * s + rows.tangents[1][i] * t)
                + trace * (rows.normal[i] * (normal + 1.0) + rows.bend[i] * bend);
        }
    }
}

/// Fills in the upper triangle of a symmetric matrix.
fn symmetric(lower: &[f64], n: usize) -> Vec<f64> {
    let at = |i: usize, j: usize| lower[i.max(j) * n + i.min(j)];
    (0..n * n).map(|k| at(k / n, k % n)).collect()
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Evaluator of a polynomial at many points.
struct PolynomialEvaluator<'a> {
    data: &'a PolynomialData,
    exponents: Vec<[u16; 3]>,
}

impl<'a> PolynomialEvaluator<'a> {
    fn new(data: &'a PolynomialData) -> Self {
        Self {
            data,
            exponents: PolynomialData::exponents(data.degree),
        }
    }

    /// Returns F and its gradient.
    fn at(&self, p: Point3) -> (f64, Point3) {
        let powers: [[[f64; 2]; MAX_GLOBAL_DEGREE + 1]; 3] = std::array::from_fn(|k| {
            let q = (p[k] - self.data.origin[k]) / self.data.unit;
            let mut powers = [[1.0, 0.0]; MAX_GLOBAL_DEGREE + 1];
            for i in 1..=self.data.degree {
                powers[i] = [powers[i - 1][0] * q, i as f64 * powers[i - 1][0]];
            }
            powers
        });
        let (mut f, mut g) = (0.0, [0.0; 3]);
        for (c, e) in self.data.coefficients.iter().zip(&self.exponents) {
            let [x, y, z]: [[f64; 2]; 3] = std::array::from_fn(|k| powers[k][usize::from(e[k])]);
            f += c * x[0] * y[0] * z[0];
            g[0] += c * x[1] * y[0] * z[0];
            g[1] += c * x[0] * y[1] * z[0];
            g[2] += c * x[0] * y[0] * z[1];
        }
        (f, g.map(|g| g / self.data.unit))
    }
}
