//! The least-squares problem of a level.
//!
//! Unknown are the corrections δ of the active coefficients. In units of the level's spacing h,
//! with N the number of points and M the number of cells with data,
//!
//! ```text
//! 1/N Σ ( (f/h)² + α |∇f + n|² )  +  λ/M |second differences of c/h|²
//! ```
//!
//! is least (Jüttler and Felis 2002, section 3: values, normals, tension). `solve` adds a small
//! weight on the corrections themselves where data hardly touches a coefficient.

use crate::bspline;
use crate::keys::{Keys, Place, place};
use crate::level::{CELL as MOST, Level, block};
use crate::matrix::{Matrix, Rows, split};
use crate::points::Sorted;
use crate::smoothing::Smoothing;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, dot};
use isoform_num::dispatch;
use rayon::prelude::*;

/// Parts of the rows that are filled side by side: enough for the processors of today; each looks
/// at all cells.
const PARTS: usize = 16;

/// Cells whose shares are held at a time: some 10 MB of them.
const CHUNK: usize = 512;

/// The weight with which f is held where it lost its distance from 0, as a share of that of all
/// points: as much as a tenth of them. With a hundredth extra pieces of f = 0 stay.
const HOLD: f64 = 0.1;

/// How far f was from 0 at such a place, in cells: nearer ones may become surface.
const APART: f64 = 0.4;

/// The share of that distance that is left at least where f is believed. f = 0 has an extra piece
/// near places at which less is left; features of the size of a cell change f by less.
const LEFT: f64 = 0.5;

/// Weights of the terms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    /// α, of normals.
    pub(crate) normals: f64,
    /// λ, of smoothing.
    pub(crate) smoothing: f64,
}

/// Number of no unknown.
pub(crate) const FIXED: u32 = u32::MAX;

/// The equations of a level.
pub(crate) struct System {
    /// The normal equations of the data.
    pub(crate) matrix: Matrix,
    pub(crate) right: Vec<f64>,
    pub(crate) smoothing: Smoothing,
}

/// What a point gives to its cell: the four rows of the residuals.
pub(crate) struct Stencil {
    degree: usize,
    /// Values and derivatives by x, y, z of the (d + 1)³ B-splines, x fastest.
    pub(crate) rows: [[f64; MOST]; 4],
}

impl Stencil {
    pub(crate) fn new(degree: usize) -> Self {
        Self {
            degree,
            rows: [[0.0; MOST]; 4],
        }
    }
    /// The rows at the place `t` of \[0, 1\]³ in a cell.
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
    /// The value that coefficients of a cell give.
    fn value(&self, c: &[f64; MOST]) -> f64 {
        self.rows[0].iter().zip(c).map(|(a, b)| a * b).sum()
    }
    /// The products of the rows with the coefficients of a cell.
    pub(crate) fn times(&self, c: &[f64]) -> [f64; 4] {
        self.rows
            .map(|row| row.iter().zip(c).map(|(a, b)| a * b).sum())
    }
}

/// The middle of an eighth of a cell.
fn place_of(eighth: Place) -> Point3 {
    eighth.map(|v| 0.25 + 0.5 * f64::from(v))
}

/// One cell's share of the equations.
struct Share {
    size: usize,
    /// Its unknowns, x fastest.
    local: [u32; MOST],
    /// The lower triangle, row by row; what lies beyond it in a row is of no use.
    gram: Vec<f64>,
    right: [f64; MOST],
}

impl Share {
    fn new(size: usize, local: [u32; MOST]) -> Self {
        Self {
            size,
            local,
            gram: vec![0.0; size * size],
            right: [0.0; MOST],
        }
    }
    /// Holds the value at a place as it is.
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

    /// Adds it to the rows of a part.
    fn scatter(&self, n: usize, inverse: f64, rows: &mut Rows<'_>, right: &mut [f64]) {
        let mut columns = Vec::with_capacity(n);
        for (i, unknown) in self.local[..n * n * n].iter().enumerate() {
            let row = *unknown as usize;
            if *unknown == FIXED || !(rows.first..rows.end).contains(&row) {
                continue;
            }
            right[row - rows.first] += inverse * self.right[i];
            let (b, c) = (i / n % n, i / (n * n));
            for line in 0..n * n {
                let places = (line * n..(line + 1) * n).filter(|j| self.local[*j] != FIXED);
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
    /// Adds a point's residuals and their squares to a share; `alpha` is the weight of the normal.
    fn add_point(share: &mut Share, stencil: &Stencil, residual: [f64; 4], alpha: f64)
        = add_point_body
}

#[inline(always)]
fn add_point_body(share: &mut Share, stencil: &Stencil, residual: [f64; 4], alpha: f64) {
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
        // Beyond the diagonal to a whole vector register.
        let row = &mut share.gram[i * n..i * n + n.min((i | 7) + 1)];
        for ((((g, v), x), y), z) in row.iter_mut().zip(v).zip(x).zip(y).zip(z) {
            *g += a * v + b * x + c * y + d * z;
        }
    }
}

/// What the equations are made of.
pub(crate) struct Problem<'a> {
    pub(crate) level: &'a Level,
    pub(crate) degree: usize,
    pub(crate) points: &'a Sorted<'a>,
    pub(crate) weights: Weights,
    /// The active B-splines, and per B-spline of the level its number among them.
    pub(crate) active: Keys,
    pub(crate) unknown: Vec<u32>,
}

impl<'a> Problem<'a> {
    pub(crate) fn new(
        level: &'a Level,
        degree: usize,
        points: &'a Sorted<'a>,
        weights: Weights,
    ) -> Self {
        let mut unknown = vec![FIXED; level.nodes.len()];
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
            active: Keys::new(list),
            unknown,
        }
    }

    /// λ/M.
    pub(crate) fn smoothing_weight(&self) -> f64 {
        self.weights.smoothing / self.points.count().max(1) as f64
    }

    /// The equations of the level; those of the data are divided by the number of points.
    pub(crate) fn system(&self, control: &Control<'_>) -> Result<System, Stopped> {
        let matrix = Matrix::new(&self.active, self.degree);
        let right = vec![0.0; matrix.len()];
        let mut system = System {
            matrix,
            right,
            smoothing: Smoothing::new(&self.level.nodes),
        };
        let all: Vec<usize> = (0..self.points.count()).collect();
        self.add(&mut system, &all, |i| self.share(i), control)?;
        Ok(system)
    }

    /// Adds the shares of cells to the equations.
    fn add(
        &self,
        system: &mut System,
        cells: &[usize],
        share: impl Fn(usize) -> Option<Share> + Sync,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let inverse = 1.0 / self.points.len() as f64;
        let mut parts = system.matrix.parts(PARTS);
        let borders: Vec<usize> = std::iter::once(0)
            .chain(parts.iter().map(|part| part.end))
            .collect();
        let mut rights = split(&mut system.right, &borders);
        for chunk in cells.chunks(CHUNK) {
            control.check()?;
            let shares: Vec<Share> = chunk.par_iter().filter_map(|i| share(*i)).collect();
            let filled = parts.par_iter_mut().zip(&mut rights);
            filled.for_each(|(rows, right)| {
                for share in &shares {
                    share.scatter(self.degree + 1, inverse, rows, right);
                }
            });
        }
        Ok(())
    }

    /// The share of the i-th cell with points; none if no unknown touches it.
    fn share(&self, i: usize) -> Option<Share> {
        let (key, range) = self.points.cell(i);
        let cell = place(key);
        let local = self.local(cell)?;
        if local.iter().all(|i| *i == FIXED) {
            return None;
        }
        let n = self.degree + 1;
        let mut share = Share::new(n * n * n, local);
        let mut stencil = Stencil::new(self.degree);
        let coefficients = self.level.of_cell(cell, self.degree);
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
            // Points without a normal say nothing of the gradient.
            add_point(
                &mut share,
                &stencil,
                residual,
                self.weights.normals * dot(normal, normal),
            );
        }
        Some(share)
    }

    /// Holds f in cells at places where the function as it is says that the surface is not near.
    pub(crate) fn hold(
        &self,
        system: &mut System,
        cells: &[usize],
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        self.add(system, cells, |i| self.held(i), control)
    }

    /// The share that holds f in the i-th cell with points.
    fn held(&self, i: usize) -> Option<Share> {
        let cell = place(self.points.cell(i).0);
        let local = self.local(cell)?;
        let c = self.level.of_cell(cell, self.degree);
        let n = self.degree + 1;
        let mut share = Share::new(n * n * n, local);
        let per_cell = self.points.len() as f64 / self.points.count() as f64;
        let mut stencil = Stencil::new(self.degree);
        for place in block([0; 3], [1; 3]) {
            stencil.fill(place_of(place));
            if stencil.value(&c).abs() > APART * self.level.spacing {
                share.hold(&stencil, HOLD * per_cell / 8.0);
            }
        }
        Some(share)
    }

    /// The corrections that lead to the coefficients of a level of another function, in units of
    /// the spacing; 0 where it has none of its own.
    pub(crate) fn corrections(&self, other: &Level) -> Vec<f64> {
        let level = self.level;
        let correction = |place: Place| {
            let (own, i) = (level.nodes.find(place)?, other.nodes.find(place)?);
            let change = other.coefficients[i] - level.coefficients[own];
            other.is_active[i].then_some(change / level.spacing)
        };
        let places = self.active.places();
        places
            .map(|place| correction(place).unwrap_or(0.0))
            .collect()
    }

    /// The cells where corrections take away the distance of f from 0. Two functions of one surface
    /// may differ by extra pieces of it; the one at hand was told by many points where it is
    /// inside.
    pub(crate) fn lost(&self, x: &[f64]) -> Vec<usize> {
        let cells = (0..self.points.count()).into_par_iter();
        cells.filter(|i| self.is_lost(*i, x)).collect()
    }

    /// Whether corrections take f much nearer to 0, or beyond, at a place of a cell that was far
    /// from the surface.
    fn is_lost(&self, i: usize, x: &[f64]) -> bool {
        let cell = place(self.points.cell(i).0);
        let Some(local) = self.local(cell) else {
            return false;
        };
        let before = self.level.of_cell(cell, self.degree);
        let mut by = [0.0; MOST];
        for (by, unknown) in by.iter_mut().zip(&local) {
            if *unknown != FIXED {
                *by = self.level.spacing * x[*unknown as usize];
            }
        }
        let mut stencil = Stencil::new(self.degree);
        block([0; 3], [1; 3]).any(|place| {
            stencil.fill(place_of(place));
            let (f, change) = (stencil.value(&before), stencil.value(&by));
            f.abs() > APART * self.level.spacing && (f + change) * f.signum() < LEFT * f.abs()
        })
    }

    /// The unknowns of a cell, x fastest; none if the level lacks the cell.
    fn local(&self, cell: Place) -> Option<[u32; MOST]> {
        self.level.cells.find(cell)?;
        let n = self.degree + 1;
        let mut local = [FIXED; MOST];
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
