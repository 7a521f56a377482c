//! Least-squares problem of a level.
//!
//! The unknowns are the corrections δ of the active coefficients. In units of the level's spacing
//! h, with N points and M cells with data, they minimise
//!
//! ```text
//! 1/N Σ ( (f/h)² + α |∇f + n|² )  +  λ/M |second differences of c/h|²
//! ```
//!
//! (Jüttler and Felis 2002, section 3: values, normals, tension). `solve` adds a small
//! weight on the corrections themselves where data hardly touches a coefficient.

use crate::bspline;
use crate::keys::{IndexSet, LatticeIndex, NO_INDEX, place};
use crate::level::{MAX_CELL_SPLINES, SplineLevel, block};
use crate::matrix::{MatrixBlock, RunMatrix, split};
use crate::points::PointsByCell;
use crate::smoothing::Smoothing;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, dot};
use isoform_num::dispatch;
use rayon::prelude::*;

/// Minimum |f| at which a point counts as far from the surface, in cells. Below it features of the
/// size of a cell legitimately move the surface.
const FAR_DISTANCE_CELLS: f64 = 0.4;

/// Weights of the terms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TermWeights {
    /// α, the weight of normals.
    pub(crate) normals: f64,
    /// λ, the weight of smoothing.
    pub(crate) smoothing: f64,
}

/// Equations of a level.
pub(crate) struct LevelEquations {
    /// Normal equations of the data.
    pub(crate) matrix: RunMatrix,
    pub(crate) right: Vec<f64>,
    pub(crate) smoothing: Smoothing,
}

/// Basis functions of a cell and their gradients at a point: the four rows of the point's
/// residuals.
pub(crate) struct Stencil {
    degree: usize,
    /// Values and derivatives by x, y, z of the (d + 1)³ B-splines, x fastest.
    pub(crate) rows: [[f64; MAX_CELL_SPLINES]; 4],
}

impl Stencil {
    pub(crate) fn new(degree: usize) -> Self {
        Self {
            degree,
            rows: [[0.0; MAX_CELL_SPLINES]; 4],
        }
    }
    /// Evaluates the rows at the point `t` of \[0, 1\]³ in a cell.
    pub(crate) fn fill(&mut self, t: Point3) {
        let n = self.degree + 1;
        let [x, y, z] = t.map(|t| bspline::jets(self.degree, t));
        let mut at = 0;
        for c in 0..n {
            for b in 0..n {
                let (v, vy, vz) = (y[0][b] * z[0][c], y[1][b] * z[0][c], y[0][b] * z[1][c]);
                for a in 0..n {
                    self.rows[0][at] = x[0][a] * v;
                    self.rows[1][at] = x[1][a] * v;
                    self.rows[2][at] = x[0][a] * vy;
                    self.rows[3][at] = x[0][a] * vz;
                    at += 1;
                }
            }
        }
    }
    /// Returns the value of the function with these coefficients of a cell.
    fn value(&self, c: &[f64; MAX_CELL_SPLINES]) -> f64 {
        self.rows[0].iter().zip(c).map(|(a, b)| a * b).sum()
    }
    /// Returns the products of the rows with the coefficients of a cell.
    pub(crate) fn times(&self, c: &[f64]) -> [f64; 4] {
        self.rows
            .map(|row| row.iter().zip(c).map(|(a, b)| a * b).sum())
    }
}

/// Returns the centre of an octant of a cell.
fn octant_centre(eighth: LatticeIndex) -> Point3 {
    eighth.map(|v| 0.25 + 0.5 * f64::from(v))
}

/// Contribution of one cell to the equations.
struct CellEquations {
    size: usize,
    /// Unknowns of the cell, x fastest.
    local: [u32; MAX_CELL_SPLINES],
    /// Lower triangle, row by row. Entries above the diagonal are undefined.
    gram: Vec<f64>,
    right: [f64; MAX_CELL_SPLINES],
}

impl CellEquations {
    fn new(size: usize, local: [u32; MAX_CELL_SPLINES]) -> Self {
        Self {
            size,
            local,
            gram: vec![0.0; size * size],
            right: [0.0; MAX_CELL_SPLINES],
        }
    }
    /// Adds an equation that keeps the value at a point.
    fn hold(&mut self, stencil: &Stencil, weight: f64) {
        let n = self.size;
        let v = &stencil.rows[0];
        for i in 0..n {
            let a = weight * v[i];
            let row = &mut self.gram[i * n..i * n + i + 1];
            for (g, v) in row.iter_mut().zip(v) {
                *g += a * v;
            }
        }
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        if i >= j {
            self.gram[i * self.size + j]
        } else {
            self.gram[j * self.size + i]
        }
    }

    /// Adds the contribution to the rows of one block.
    fn scatter(&self, n: usize, inverse: f64, rows: &mut MatrixBlock<'_>, right: &mut [f64]) {
        let mut columns = Vec::with_capacity(n);
        for (i, unknown) in self.local[..n * n * n].iter().enumerate() {
            let row = *unknown as usize;
            if *unknown == NO_INDEX || !(rows.first..rows.end).contains(&row) {
                continue;
            }
            right[row - rows.first] += inverse * self.right[i];
            let (b, c) = (i / n % n, i / (n * n));
            for line in 0..n * n {
                let places = (line * n..(line + 1) * n).filter(|j| self.local[*j] != NO_INDEX);
                columns.clear();
                columns.extend(places.map(|j| (self.local[j], inverse * self.at(i, j))));
                if !columns.is_empty() {
                    let away = [(line % n) as i32 - b as i32, (line / n) as i32 - c as i32];
                    rows.add(row, away, &columns);
                }
            }
        }
    }
}

dispatch! {
    /// Adds a point's residuals and their squares to the contribution of its cell; `alpha` is the
    /// weight of the normal.
    fn add_point(share: &mut CellEquations, stencil: &Stencil, residual: [f64; 4], alpha: f64)
        = add_point_body
}

#[inline(always)]
fn add_point_body(share: &mut CellEquations, stencil: &Stencil, residual: [f64; 4], alpha: f64) {
    let n = share.size;
    let [v, x, y, z] = &stencil.rows;
    let weighted = [
        residual[0],
        alpha * residual[1],
        alpha * residual[2],
        alpha * residual[3],
    ];
    for i in 0..n {
        share.right[i] +=
            v[i] * weighted[0] + x[i] * weighted[1] + y[i] * weighted[2] + z[i] * weighted[3];
        let (a, b, c, d) = (v[i], alpha * x[i], alpha * y[i], alpha * z[i]);
        // Extends past the diagonal to the end of the vector register.
        let row = &mut share.gram[i * n..i * n + n.min((i | 7) + 1)];
        for ((((g, v), x), y), z) in row.iter_mut().zip(v).zip(x).zip(y).zip(z) {
            *g += a * v + b * x + c * y + d * z;
        }
    }
}

/// Input of a level's least-squares problem.
pub(crate) struct LevelProblem<'a> {
    pub(crate) level: &'a SplineLevel,
    pub(crate) degree: usize,
    pub(crate) points: &'a PointsByCell<'a>,
    pub(crate) weights: TermWeights,
    /// Active B-splines, and for each B-spline of the level its index among them.
    pub(crate) active: IndexSet,
    pub(crate) unknown: Vec<u32>,
}

impl<'a> LevelProblem<'a> {
    pub(crate) fn new(
        level: &'a SplineLevel,
        degree: usize,
        points: &'a PointsByCell<'a>,
        weights: TermWeights,
    ) -> Self {
        let mut unknown = vec![NO_INDEX; level.nodes.len()];
        let mut list = Vec::new();
        for (i, node) in level
            .nodes
            .places()
            .enumerate()
            .filter(|(i, _)| level.is_active[*i])
        {
            unknown[i] = list.len() as u32;
            list.push(crate::keys::key(node));
        }
        Self {
            level,
            degree,
            points,
            weights,
            active: IndexSet::new(list),
            unknown,
        }
    }

    /// Returns λ/M.
    pub(crate) fn smoothing_weight(&self) -> f64 {
        self.weights.smoothing / self.points.count().max(1) as f64
    }

    /// Assembles the equations of the level; those of the data are divided by the number of points.
    pub(crate) fn system(&self, control: &Control<'_>) -> Result<LevelEquations, Stopped> {
        let matrix = RunMatrix::new(&self.active, self.degree);
        let right = vec![0.0; matrix.len()];
        let mut system = LevelEquations {
            matrix,
            right,
            smoothing: Smoothing::new(&self.level.nodes),
        };
        let all: Vec<usize> = (0..self.points.count()).collect();
        self.add(&mut system, &all, |i| self.share(i), control)?;
        Ok(system)
    }

    /// Adds the contributions of cells to the equations.
    fn add(
        &self,
        system: &mut LevelEquations,
        cells: &[usize],
        share: impl Fn(usize) -> Option<CellEquations> + Sync,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let inverse = 1.0 / self.points.len() as f64;
        // Every block visits all cells: enough blocks for the cores of present machines, not more.
        let mut parts = system.matrix.parts(16);
        let borders: Vec<usize> = std::iter::once(0)
            .chain(parts.iter().map(|part| part.end))
            .collect();
        let mut rights = split(&mut system.right, &borders);
        // The contributions of 512 cells take some 10 MB.
        for chunk in cells.chunks(512) {
            control.check()?;
            let shares: Vec<CellEquations> = chunk.par_iter().filter_map(|i| share(*i)).collect();
            let filled = parts.par_iter_mut().zip(&mut rights);
            filled.for_each(|(rows, right)| {
                for share in &shares {
                    share.scatter(self.degree + 1, inverse, rows, right);
                }
            });
        }
        Ok(())
    }

    /// Returns the contribution of the i-th cell with points; `None` if none of its B-splines is
    /// unknown.
    fn share(&self, i: usize) -> Option<CellEquations> {
        let (key, range) = self.points.cell(i);
        let cell = place(key);
        let local = self.local(cell)?;
        if local.iter().all(|i| *i == NO_INDEX) {
            return None;
        }
        let n = self.degree + 1;
        let mut share = CellEquations::new(n * n * n, local);
        let mut stencil = Stencil::new(self.degree);
        let coefficients = self.level.cell_coefficients(cell, self.degree);
        for k in range {
            let (t, normal) = self.points.local(k, cell, self.level.spacing);
            stencil.fill(t);
            let f = stencil.times(&coefficients).map(|v| v / self.level.spacing);
            let residual = [
                -f[0],
                -normal[0] - f[1],
                -normal[1] - f[2],
                -normal[2] - f[3],
            ];
            // Points without a normal do not constrain the gradient.
            add_point(
                &mut share,
                &stencil,
                residual,
                self.weights.normals * dot(normal, normal),
            );
        }
        Some(share)
    }

    /// Adds equations that keep f in cells, at octant centres that the present function places far
    /// from the surface.
    pub(crate) fn hold(
        &self,
        system: &mut LevelEquations,
        cells: &[usize],
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        self.add(system, cells, |i| self.held(i), control)
    }

    /// Returns the equations that keep f in the i-th cell with points.
    fn held(&self, i: usize) -> Option<CellEquations> {
        let cell = place(self.points.cell(i).0);
        let local = self.local(cell)?;
        let c = self.level.cell_coefficients(cell, self.degree);
        let n = self.degree + 1;
        let mut share = CellEquations::new(n * n * n, local);
        let per_cell = self.points.len() as f64 / self.points.count() as f64;
        let mut stencil = Stencil::new(self.degree);
        for place in block([0; 3], [1; 3]) {
            stencil.fill(octant_centre(place));
            if stencil.value(&c).abs() > FAR_DISTANCE_CELLS * self.level.spacing {
                // A tenth of the weight of the cell's points. With a hundredth extra components of
                // f = 0 remain.
                share.hold(&stencil, 0.1 * per_cell / 8.0);
            }
        }
        Some(share)
    }

    /// Returns the corrections that lead to the coefficients of a level of another function, in
    /// units of the spacing; 0 for coefficients that are not unknowns there.
    pub(crate) fn corrections(&self, other: &SplineLevel) -> Vec<f64> {
        let level = self.level;
        let correction = |place: LatticeIndex| {
            let (own, i) = (level.nodes.find(place)?, other.nodes.find(place)?);
            let change = other.coefficients[i] - level.coefficients[own];
            other.is_active[i].then_some(change / level.spacing)
        };
        let places = self.active.places();
        places
            .map(|place| correction(place).unwrap_or(0.0))
            .collect()
    }

    /// Returns the cells in which the corrections bring f close to 0 at points that were far from
    /// the surface. Two functions with one zero set may differ by extra components; the present
    /// function has learnt from many points where the inside is.
    pub(crate) fn lost(&self, x: &[f64]) -> Vec<usize> {
        let cells = (0..self.points.count()).into_par_iter();
        cells.filter(|i| self.is_lost(*i, x)).collect()
    }

    /// Returns true if the corrections bring f much closer to 0, or change its sign, at an octant
    /// centre that was far from the surface.
    fn is_lost(&self, i: usize, x: &[f64]) -> bool {
        let cell = place(self.points.cell(i).0);
        let Some(local) = self.local(cell) else {
            return false;
        };
        let before = self.level.cell_coefficients(cell, self.degree);
        let mut by = [0.0; MAX_CELL_SPLINES];
        for (by, unknown) in by.iter_mut().zip(&local) {
            if *unknown != NO_INDEX {
                *by = self.level.spacing * x[*unknown as usize];
            }
        }
        let mut stencil = Stencil::new(self.degree);
        block([0; 3], [1; 3]).any(|place| {
            stencil.fill(octant_centre(place));
            let (f, change) = (stencil.value(&before), stencil.value(&by));
            // f = 0 has an extra component near points that keep less than half of |f|; features of
            // the size of a cell change f by less.
            f.abs() > FAR_DISTANCE_CELLS * self.level.spacing
                && (f + change) * f.signum() < 0.5 * f.abs()
        })
    }

    /// Returns the unknowns of a cell, x fastest; `None` if the level lacks the cell.
    fn local(&self, cell: LatticeIndex) -> Option<[u32; MAX_CELL_SPLINES]> {
        self.level.cells.find(cell)?;
        let n = self.degree + 1;
        let mut local = [NO_INDEX; MAX_CELL_SPLINES];
        for (line, first) in self.level.runs(cell, self.degree)[..n * n]
            .iter()
            .enumerate()
        {
            for a in 0..n {
                local[line * n + a] = self.unknown[*first as usize + a];
            }
        }
        Some(local)
    }
}
