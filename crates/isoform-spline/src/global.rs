//! One polynomial through points.
//!
//! With q the points' places in a cube of edge 2 and n their normals, the polynomial F of total
//! degree K is sought for which
//!
//! ```text
//! 1/N Σ ( F² + α |∇F − (∇F·n) n|² )  +  τ/N Σ ( (∇F·n + 1)² + (nᵀ H n)² )
//! ```
//!
//! is least, where the mean of ∇F·n is −1. The length of ∇F is left open but for its mean: asking for
//! length 1 everywhere, as Jüttler and Felis (2002) do with splines, moves the surface of a
//! polynomial of low degree. The trace τ decides only between polynomials that fit alike: through a
//! sphere pass (1 − r²) times anything, and (1 − r²)² times anything changes neither F nor ∇F there.
//! It is taken away again from what points decide, by solving for corrections (iterated
//! regularisation), which also makes up for the rounding of the normal equations.

use crate::basis::{Basis, Rows};
use crate::components::{Components, of_lattice};
use crate::feet::{Distances, distance};
use crate::implicitize::{Error, Lattice, check_points};
use crate::keys::{Place, place};
use crate::points::cell_of;
use crate::sides::{Normals, Sides, sided};
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, Point3, PolynomialData, sub};
use isoform_num::linalg::{cholesky, cholesky_solve};
use rayon::prelude::*;

/// The highest total degree: 455 coefficients. Beyond, coefficients of monomials lose their digits.
pub const MAX_GLOBAL: usize = 12;

/// The trace τ: large against the rounding of normal equations, 1e-16, small against what points
/// tell, of which a thousandth part of the variance would be 1e-6 at noise of 0.1 %.
const TRACE: f64 = 1e-8;

/// The weight of the coefficients themselves, a share of the equations' mean diagonal. It holds what
/// nothing else does: (1 − r²)³ times anything through a sphere. Smaller than [`TRACE`], larger
/// than rounding.
const RIDGE: f64 = 1e-12;

/// Corrections of a solution. The first is the solution; each of the others takes away most of what
/// is left of the trace.
const CORRECTIONS: usize = 3;

/// The least weight α of tangential gradients: as much as the trace has. Where points are exact and
/// normals are not, errors of the normals would move the surface by α times as much.
const LEAST: f64 = 1e-8;

/// Times that α is found anew: with noise it stands after one, with exact points and wrong normals
/// it falls by some hundredths each time.
const ROUNDS: usize = 4;

/// Residuals below which nothing is known of the noise: rounding and the trace leave 1e-9.
const EXACT: f64 = 1e-7;

/// Points whose rows one task takes: their sums are added in order.
const CHUNK: usize = 512;

/// Tasks whose sums are held at a time.
const HELD: usize = 16;

/// A polynomial that was fitted.
#[derive(Clone, Debug)]
pub struct Global {
    /// The polynomial.
    pub polynomial: PolynomialData,
    /// The points' distances from F = 0.
    pub distances: Distances,
    /// Where normals came from.
    pub sides: Sides,
    /// Pieces of the surface within the box of the points.
    pub components: Components,
}

/// Fits one polynomial of a total degree to points; inside is F ≥ 0.
///
/// ```
/// use isoform_control::Control;
/// use isoform_spline::{Normals, implicitize_globally};
/// // A unit sphere, seen at 500 places.
/// let points: Vec<[f64; 3]> = (0..500)
///     .map(|i| {
///         let (z, u) = ((i as f64 + 0.5) / 250.0 - 1.0, 2.4 * i as f64);
///         let r = (1.0 - z * z).sqrt();
///         [r * u.cos(), r * u.sin(), z]
///     })
///     .collect();
/// let made = implicitize_globally(&points, Normals::Given(&points), 2, &Control::default())?;
/// assert_eq!(made.polynomial.coefficients.len(), 10);
/// assert!(made.distances.max < 1e-9);
/// # Ok::<(), isoform_spline::Error>(())
/// ```
///
/// # Errors
/// [`Error`]; also where the degree is not from 1 to [`MAX_GLOBAL`].
pub fn implicitize_globally(
    points: &[Point3],
    normals: Normals<'_>,
    degree: usize,
    control: &Control<'_>,
) -> Result<Global, Error> {
    if !(1..=MAX_GLOBAL).contains(&degree) {
        return Err(Error::Option {
            name: "global",
            what: "from 1 to 12 are possible",
        });
    }
    check_points(points)?;
    control.begin("normals")?;
    let (normals, sides) = sided(points, normals, control)?;
    control.begin("fitting")?;
    let frame = Frame::of(Aabb::of(points));
    let problem = Problem {
        basis: Basis::new(degree),
        frame,
        points,
        normals: &normals,
    };
    let c = problem.solve(control)?;
    let lattice = Lattice::seen(points);
    let polynomial = PolynomialData {
        degree,
        origin: frame.origin,
        unit: frame.unit,
        // F is in units of q: its gradient in space is as steep as that of a distance.
        coefficients: problem
            .basis
            .monomials(&c)
            .iter()
            .map(|c| c * frame.unit)
            .collect(),
        corner: lattice.corner,
        spacing: lattice.spacing,
        count: lattice.count,
        cells: seen_cells(points, &lattice),
    };
    control.begin("checking")?;
    let jet = Evaluation::new(&polynomial);
    let off = points
        .par_iter()
        .map(|p| distance(|p| jet.at(p), *p, frame.unit));
    Ok(Global {
        distances: Distances::of(off.collect()),
        components: of_lattice(&polynomial, |p| jet.at(p).0),
        polynomial,
        sides,
    })
}

/// Cells of a lattice that hold points.
fn seen_cells(points: &[Point3], lattice: &Lattice) -> Vec<Place> {
    let of = |p: &Point3| cell_of(sub(*p, lattice.corner), lattice.spacing, lattice.count);
    let mut keys: Vec<u64> = points.par_iter().map(|p| crate::keys::key(of(p))).collect();
    keys.par_sort_unstable();
    keys.dedup();
    keys.into_iter().map(place).collect()
}

/// Where the cube is: q = (p − origin)/unit.
#[derive(Clone, Copy, Debug)]
struct Frame {
    origin: Point3,
    unit: f64,
}

impl Frame {
    /// The cube about a box: its half edge is a power of two, by which quotients are exact.
    fn of(bounds: Aabb) -> Self {
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

/// See the module.
struct Problem<'a> {
    basis: Basis,
    frame: Frame,
    points: &'a [Point3],
    normals: &'a [Point3],
}

/// Sums over points: the normal equations' matrix (its lower triangle, row by row) and the mean of
/// the derivatives along normals.
struct Equations {
    matrix: Vec<f64>,
    mean: Vec<f64>,
}

/// Sums over points at a solution: the right side, and the squares of F and of the tangential
/// gradients.
struct Residual {
    right: Vec<f64>,
    value: f64,
    tangential: f64,
}

impl Problem<'_> {
    /// The coefficients.
    fn solve(&self, control: &Control<'_>) -> Result<Vec<f64>, Error> {
        let mut alpha = 1.0;
        let (mut c, mut left) = self.solution(alpha, control)?;
        for _ in 0..ROUNDS {
            // Each kind of equation by the inverse of its variance.
            let next = (left.value / left.tangential).clamp(LEAST, 1.0);
            if left.tangential < EXACT * EXACT || next > 0.5 * alpha {
                break;
            }
            alpha = next;
            (c, left) = self.solution(alpha, control)?;
        }
        Ok(c)
    }

    /// The coefficients for a weight of tangential gradients, and what is left.
    fn solution(&self, alpha: f64, control: &Control<'_>) -> Result<(Vec<f64>, Residual), Error> {
        let n = self.basis.len();
        let mut equations = self.equations(alpha, control)?;
        let diagonal: f64 = (0..n).map(|i| equations.matrix[i * n + i]).sum();
        for i in 0..n {
            equations.matrix[i * n + i] += RIDGE * diagonal / n as f64;
        }
        let mut factor = symmetric(&equations.matrix, n);
        if !cholesky(&mut factor, n) {
            return Err(Error::Undetermined);
        }
        let mut along = equations.mean.clone();
        cholesky_solve(&factor, n, &mut along);
        let mut c = vec![0.0; n];
        for round in 0..CORRECTIONS {
            let trace = if round == 0 { TRACE } else { 0.0 };
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

    /// Sums what `of_chunk` makes of chunks of points, by the same order whatever the threads.
    fn sum<S: Send>(
        &self,
        control: &Control<'_>,
        of_chunk: impl Fn(&[Point3], &[Point3]) -> S + Sync,
        mut add: impl FnMut(S),
    ) -> Result<(), Stopped> {
        let chunks: Vec<_> = self
            .points
            .chunks(CHUNK)
            .zip(self.normals.chunks(CHUNK))
            .collect();
        for some in chunks.chunks(HELD) {
            control.check()?;
            let sums: Vec<S> = some.par_iter().map(|(p, n)| of_chunk(p, n)).collect();
            sums.into_iter().for_each(&mut add);
        }
        Ok(())
    }

    fn equations(&self, alpha: f64, control: &Control<'_>) -> Result<Equations, Stopped> {
        let n = self.basis.len();
        let share = 1.0 / self.points.len() as f64;
        let mut all = Equations {
            matrix: vec![0.0; n * n],
            mean: vec![0.0; n],
        };
        let of_chunk = |points: &[Point3], normals: &[Point3]| {
            let mut sums = Equations {
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
        self.sum(control, of_chunk, |sums: Equations| {
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
    ) -> Result<Residual, Stopped> {
        let empty = || Residual {
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
        self.sum(control, of_chunk, |sums: Residual| {
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

impl Equations {
    fn add(&mut self, rows: &Rows, alpha: f64) {
        let n = self.mean.len();
        let [s, t] = &rows.tangents;
        for i in 0..n {
            self.mean[i] += rows.normal[i];
            let (v, s_i, t_i) = (rows.value[i], alpha * s[i], alpha * t[i]);
            let (m, b) = (TRACE * rows.normal[i], TRACE * rows.bend[i]);
            let row = &mut self.matrix[i * n..i * n + i + 1];
            let others = rows.value.iter().zip(s).zip(t);
            let others = others.zip(&rows.normal).zip(&rows.bend);
            for (sum, ((((value, s), t), normal), bend)) in row.iter_mut().zip(others) {
                *sum += v * value + s_i * s + t_i * t + m * normal + b * bend;
            }
        }
    }
}

impl Residual {
    fn add(&mut self, rows: &Rows, c: &[f64], alpha: f64, trace: f64) {
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

/// The whole of a matrix whose lower triangle is given.
fn symmetric(lower: &[f64], n: usize) -> Vec<f64> {
    let at = |i: usize, j: usize| lower[i.max(j) * n + i.min(j)];
    (0..n * n).map(|k| at(k / n, k % n)).collect()
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A polynomial at many places.
struct Evaluation<'a> {
    data: &'a PolynomialData,
    exponents: Vec<[u16; 3]>,
}

impl<'a> Evaluation<'a> {
    fn new(data: &'a PolynomialData) -> Self {
        Self {
            data,
            exponents: PolynomialData::exponents(data.degree),
        }
    }

    /// F and its gradient.
    fn at(&self, p: Point3) -> (f64, Point3) {
        let powers: [[[f64; 2]; MAX_GLOBAL + 1]; 3] = std::array::from_fn(|k| {
            let q = (p[k] - self.data.origin[k]) / self.data.unit;
            let mut powers = [[1.0, 0.0]; MAX_GLOBAL + 1];
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
