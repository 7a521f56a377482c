//! The fitted model in its own frame: values, normals, motion under its parameters, and its extent.
//!
//! The template may be moved by its pose: world = t + scale · R · p. Drawings show the model in its
//! own frame, so that points of the scan are moved back ([`DrawnModel::framed`]) and points of the
//! model moved forth before its function is asked.

use crate::fit::job::Job;
use isoform::field::Graph;
use isoform::field::hyperfun::Placement;
use isoform::fit::Template;
use isoform::geom::{Aabb, Point3, dot, norm};

/// The model with its fitted values.
pub(super) struct DrawnModel<'a> {
    /// The fit.
    job: &'a Job,
    /// Fitted values of all parameters.
    values: Vec<f64>,
    /// Pose of the model in the scan.
    place: Placement,
    /// True if the program runs line by line for each point, some hundred times slower.
    pub(super) is_slow: bool,
}

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) at: Point3,
    /// Outward, of length 1.
    pub(super) normal: Point3,
}

/// The cells that the surface may pass.
pub(super) struct Shell {
    /// Box that is drawn.
    pub(super) region: Aabb,
    /// Side of a cell.
    pub(super) cell: f64,
    /// Cells along each axis.
    dims: [usize; 3],
    /// True for each cell that the surface may pass.
    is_near: Vec<bool>,
    /// Blocks of cells that hold such a cell, so that rays cross empty space fast.
    blocks: Vec<bool>,
    /// Middles of the cells that lie at the surface, with the function there.
    near: Vec<(Point3, f64)>,
}

/// Cells of the shell along the longest side: walls thinner than 1/4 of a cell may be missed. More
/// cells cost their square.
const CELLS: f64 = 64.0;
/// Cells along the side of a block.
const BLOCK: usize = 8;
/// Cells of the look around for how far the model reaches.
const FEW_CELLS: f64 = 24.0;
/// The model is looked for this far about the data, as a share of their longest side. What reaches
/// farther is cut off near the data.
const AROUND: f64 = 0.7;
/// Number of surface points whose motion is computed; fewer miss small features.
const SAMPLES: usize = 8000;

impl<'a> DrawnModel<'a> {
    /// The fitted model of a job, in the place that its pose gives it.
    pub(super) fn new(job: &'a Job) -> Self {
        let values = job.found.fit.values();
        let identity = Placement {
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            translation: [0.0; 3],
            scale: 1.0,
        };
        let frep = &job.found.template.frep;
        Self {
            job,
            place: frep.placement(&values).unwrap_or(identity),
            is_slow: frep.model().compile(&mut Graph::new()).is_err(),
            values,
        }
    }

    /// A point of the model's frame where the scan has it.
    fn world(&self, p: Point3) -> Point3 {
        let Placement {
            rotation: r,
            translation: t,
            scale,
        } = &self.place;
        std::array::from_fn(|i| t[i] + scale * dot(r[i], p))
    }

    /// A point of the scan in the model's frame.
    pub(super) fn framed(&self, x: Point3) -> Point3 {
        self.place.framed(x)
    }

    /// The distance from inside, in the model's lengths; what is not a number lies just outside.
    pub(super) fn distances(&self, points: &[Point3]) -> Vec<f64> {
        let x: Vec<Point3> = points.iter().map(|p| self.world(*p)).collect();
        let mut out = vec![0.0; x.len()];
        let field = self.job.found.template.metric();
        field.values(&x, &self.values, &mut out);
        for v in &mut out {
            *v = if v.is_nan() {
                -f64::MIN_POSITIVE
            } else {
                *v / self.place.scale
            };
        }
        out
    }

    /// Distances with their gradients, which point inwards.
    pub(super) fn gradients(&self, points: &[Point3]) -> (Vec<f64>, Vec<Point3>) {
        let x: Vec<Point3> = points.iter().map(|p| self.world(*p)).collect();
        let (mut out, mut rows) = (vec![0.0; x.len()], vec![[0.0; 3]; x.len()]);
        let field = self.job.found.template.metric();
        field.gradients(&x, &self.values, &mut out, &mut rows);
        for (v, g) in out.iter_mut().zip(&mut rows) {
            *v /= self.place.scale;
            *g = self.place.turned_back(*g);
        }
        (out, rows)
    }

    /// The part of the model that is nearest to each point.
    pub(super) fn parts(&self, points: &[Point3]) -> Vec<u32> {
        let x: Vec<Point3> = points.iter().map(|p| self.world(*p)).collect();
        let mut out = vec![0; x.len()];
        self.job.found.template.parts(&x, &self.values, &mut out);
        out
    }

    /// Returns the outward speed of the surface, by sample and parameter. On the surface d(x, a) =
    /// 0 it is ∂d/∂a / |∇d|.
    pub(super) fn motions(&self, samples: &[Sample]) -> Vec<Vec<f64>> {
        let field = self.job.found.template.metric();
        let dim = field.dim();
        let x: Vec<Point3> = samples.iter().map(|s| self.world(s.at)).collect();
        let (mut out, mut rows) = (vec![0.0; x.len()], vec![[0.0; 3]; x.len()]);
        field.gradients(&x, &self.values, &mut out, &mut rows);
        let mut jac = vec![0.0; x.len() * dim];
        field.jacobian(&x, &self.values, &mut out, &mut jac);
        let speed = |i: usize, g: &Point3, k: usize| {
            let v = jac[i * dim + k] / (norm(*g).max(1e-12) * self.place.scale);
            if v.is_finite() { v } else { 0.0 }
        };
        rows.iter()
            .enumerate()
            .map(|(i, g)| (0..dim).map(|k| speed(i, g, k)).collect())
            .collect()
    }

    /// Returns the box to draw, in the model's frame, and the cells of it that the surface may
    /// pass; `None` without a surface near the data.
    pub(super) fn shell(&self) -> Option<Shell> {
        let data = self.data();
        let longest = longest(&data);
        if !(longest > 0.0 && longest.is_finite()) {
            return None;
        }
        let region = data.widened(AROUND * longest);
        let coarse = self.cells(region, longest * (1.0 + 2.0 * AROUND) / FEW_CELLS);
        let surface: Vec<Point3> = self.project(&coarse).iter().map(|s| s.at).collect();
        let seen = Aabb::from_points(&surface);
        if seen.is_empty() {
            return None;
        }
        // What goes on to the end of the region is cut off a little beyond the data.
        let mut tight = seen.widened(0.5 * coarse.cell);
        for k in 0..3 {
            if seen.lo[k] < region.lo[k] + 1.5 * coarse.cell {
                tight.lo[k] = data.lo[k] - 0.05 * longest;
            }
            if seen.hi[k] > region.hi[k] - 1.5 * coarse.cell {
                tight.hi[k] = data.hi[k] + 0.05 * longest;
            }
        }
        let cells = if self.is_slow { FEW_CELLS } else { CELLS };
        let size = self::longest(&tight);
        (size > 0.0).then(|| self.cells(tight, size / cells))
    }

    /// Returns the box of the points of the scan without outliers, in the model's frame.
    fn data(&self) -> Aabb {
        let found = &self.job.found;
        let used = found.cloud.points.iter().zip(&found.fit.outliers);
        let points: Vec<Point3> = used
            .filter(|(_, out)| !**out)
            .map(|(p, _)| self.framed(*p))
            .collect();
        Aabb::from_points(&points)
    }

    /// The cells that the surface may pass. The distance is first order only, so that eight cells at
    /// once are dropped when they are three half diagonals of theirs away, and a single one when it
    /// is two of its own.
    fn cells(&self, region: Aabb, cell: f64) -> Shell {
        let mut shell = Shell::new(region, cell);
        let half = 0.5 * 3_f64.sqrt() * cell;
        let small = self.small_cells(&shell, 6.0 * half);
        let points: Vec<Point3> = small
            .iter()
            .map(|c| shell.at(c.map(|i| i as f64 + 0.5)))
            .collect();
        for ((c, p), v) in small.iter().zip(&points).zip(self.distances(&points)) {
            if v.abs() < 2.0 * half {
                shell.mark(*c);
            }
            if v.abs() < 0.6 * cell {
                shell.near.push((*p, v));
            }
        }
        shell
    }

    /// The cells whose group of two by two by two has its middle within this distance of the
    /// surface.
    fn small_cells(&self, shell: &Shell, within: f64) -> Vec<[usize; 3]> {
        let dims = shell.dims;
        let groups: Vec<[usize; 3]> = indices(dims.map(|n| n.div_ceil(2))).collect();
        let middles: Vec<Point3> = groups
            .iter()
            .map(|g| shell.at(g.map(|i| 2.0 * i as f64 + 1.0)))
            .collect();
        let near = groups
            .iter()
            .zip(self.distances(&middles))
            .filter(|(_, v)| v.abs() < within);
        near.flat_map(|(g, _)| {
            let first = g.map(|i| 2 * i);
            indices([2; 3]).map(move |c| std::array::from_fn(|k| first[k] + c[k]))
        })
        .filter(|c: &[usize; 3]| (0..3).all(|k| c[k] < dims[k]))
        .collect()
    }

    /// Points of the surface, spread evenly.
    pub(super) fn project(&self, shell: &Shell) -> Vec<Sample> {
        let stride = shell.near.len().div_ceil(SAMPLES).max(1);
        let from: Vec<Point3> = shell.near.iter().step_by(stride).map(|n| n.0).collect();
        let mut points = from.clone();
        for _ in 0..3 {
            let (values, rows) = self.gradients(&points);
            for ((p, v), g) in points.iter_mut().zip(values).zip(rows) {
                let by = v / dot(g, g).max(1e-12);
                *p = std::array::from_fn(|k| p[k] - by * g[k]);
            }
        }
        let (values, rows) = self.gradients(&points);
        let near = |i: &usize| {
            let moved = isoform::geom::distance_squared(points[*i], from[*i]).sqrt();
            values[*i].abs() < 0.02 * shell.cell && moved < 1.5 * shell.cell
        };
        (0..points.len())
            .filter(near)
            .map(|i| Sample {
                at: points[i],
                normal: outward(rows[i]),
            })
            .collect()
    }
}

/// The unit normal that leads out, from a gradient that leads in.
pub(super) fn outward(gradient: Point3) -> Point3 {
    let length = norm(gradient);
    if length > 0.0 && length.is_finite() {
        gradient.map(|v| -v / length)
    } else {
        [0.0, 0.0, 1.0]
    }
}

/// The longest side of a box.
fn longest(region: &Aabb) -> f64 {
    region.size().into_iter().fold(0.0, f64::max)
}

/// All indices of a grid, the first one fastest.
fn indices(dims: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let [nx, ny, nz] = dims;
    (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
}

impl Shell {
    /// A shell without cells.
    fn new(region: Aabb, cell: f64) -> Self {
        let dims = region.size().map(|v| ((v / cell).ceil() as usize).max(1));
        Self {
            region,
            cell,
            dims,
            is_near: vec![false; dims.iter().product()],
            blocks: vec![false; dims.map(|n| n.div_ceil(BLOCK)).iter().product()],
            near: Vec::new(),
        }
    }
    /// The surface may pass this cell.
    fn mark(&mut self, c: [usize; 3]) {
        let (i, block) = (self.index(c), self.block(c));
        self.is_near[i] = true;
        self.blocks[block] = true;
    }
    /// A point by its coordinates in cells.
    fn at(&self, c: [f64; 3]) -> Point3 {
        std::array::from_fn(|k| self.region.lo[k] + self.cell * c[k])
    }
    /// The number of a cell.
    fn index(&self, c: [usize; 3]) -> usize {
        (c[2] * self.dims[1] + c[1]) * self.dims[0] + c[0]
    }
    /// The number of the block of a cell.
    fn block(&self, c: [usize; 3]) -> usize {
        let [nx, ny, _] = self.dims.map(|n| n.div_ceil(BLOCK));
        (c[2] / BLOCK * ny + c[1] / BLOCK) * nx + c[0] / BLOCK
    }
    /// Returns the size of the block of cells around a point that the surface misses: 0, 1 cell, or
    /// its block. The point is given in cells.
    fn empty(&self, p: [f64; 3]) -> f64 {
        let is_within = |k: usize| (0.0..self.dims[k] as f64).contains(&p[k]);
        if !(0..3).all(is_within) {
            return 1.0;
        }
        let c = p.map(|v| v as usize);
        if !self.blocks[self.block(c)] {
            BLOCK as f64
        } else if !self.is_near[self.index(c)] {
            1.0
        } else {
            0.0
        }
    }
    /// Returns the parameter at which the ray from `p` along `d` next meets a cell that the surface
    /// may pass, from `t` on and before `end`.
    pub(super) fn next(&self, p: Point3, d: Point3, mut t: f64, end: f64) -> Option<f64> {
        // On a border between cells the one ahead counts.
        let ahead = 1e-6 * self.cell;
        // A ray passes at most three cells per cell of its way.
        for _ in 0..4 * self.dims.iter().sum::<usize>() {
            if t >= end {
                return None;
            }
            let at: [f64; 3] = std::array::from_fn(|k| {
                (p[k] + (t + ahead) * d[k] - self.region.lo[k]) / self.cell
            });
            let size = self.empty(at);
            if size == 0.0 {
                return Some(t);
            }
            let leave = (0..3).map(|k| {
                let c = at[k] / size;
                // As `floor` and `ceil` within the box, without calls.
                let cell = (c as usize) as f64;
                match d[k] {
                    v if v > 0.0 => (cell + 1.0 - c) / v,
                    v if v < 0.0 && c == cell => -1.0 / v,
                    v if v < 0.0 => (cell - c) / v,
                    _ => f64::INFINITY,
                }
            });
            t += size * self.cell * leave.fold(f64::INFINITY, f64::min).max(0.0) + ahead;
        }
        None
    }
}
