//! Fits an implicit spline to points, level by level.
//!
//! Each level is fitted to all points with the coefficients of the coarser levels fixed. Its
//! unknowns are the B-splines that touch cells with data; the others continue the coarser function
//! smoothly. The final level need not be known in advance: cells are refined until a number of
//! cells is reached, a tolerance holds, or the error at held-out points no longer falls.

use crate::components::{Components, components};
use crate::energy::{LevelProblem, Stencil, TermWeights};
use crate::feet::{Distances, distance};
use crate::keys::{LatticeIndex, MAX_AXIS_NODES, NO_INDEX, key, place};
use crate::level::SplineLevel;
use crate::outliers::{isolated_points, off_surface_points};
use crate::points::{PointsByCell, PointsWithNormals, cell_of, scattered};
use crate::sides::{NormalReport, Normals, oriented_normals};
use crate::solve::LevelSolver;
use crate::surface::ImplicitSpline;
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, Field, Point3, norm, sub};
use rayon::prelude::*;

/// Stopping criterion of the refinement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Fineness {
    /// Refines until the error at held-out points no longer falls.
    #[default]
    Data,
    /// Refines to at most this many cells with data, and at most half as many as there are points.
    Cells(usize),
    /// Refines until the root mean square distance of the points of every cell is at most this, but
    /// not beyond [`Fineness::Data`].
    Tolerance(f64),
}

/// Settings of the fit of an implicit spline.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Tri-degree, 2 to 5.
    pub degree: usize,
    /// Stopping criterion of the refinement.
    pub fineness: Fineness,
    /// Weight of smoothing, λ, positive. Larger values round edges and average noise over more
    /// cells; without smoothing, B-splines with hardly any data are undetermined.
    pub smoothing: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            degree: 3,
            fineness: Fineness::Data,
            smoothing: 1e-6,
        }
    }
}

/// Reason why no implicit function can be fitted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Fewer points than a surface needs.
    #[error("{found} points: at least {MIN_POINTS} are needed")]
    Few {
        /// Number of points given.
        found: usize,
    },
    /// All points coincide or lie on one line.
    #[error("all points lie {}", if *.is_point { "in one place" } else { "on one line" })]
    Degenerate {
        /// True if all points coincide.
        is_point: bool,
    },
    /// A coordinate is not finite.
    #[error("a coordinate is not finite")]
    NotFinite,
    /// An option is outside its range.
    #[error("{name}: {what}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Values that are possible.
        what: &'static str,
    },
    /// The points do not determine a polynomial of this degree.
    #[error("the points do not determine a polynomial of this degree")]
    Undetermined,
    /// The work was cancelled or ran out of time.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Minimum number of points. Fewer do not determine the normals of a surface.
const MIN_POINTS: usize = 10;

/// Result of fitting an implicit spline.
#[derive(Clone, Debug)]
pub struct SplineFit {
    /// The fitted function.
    pub spline: ImplicitSpline,
    /// Distances of the points from f = 0, without outliers.
    pub distances: Distances,
    /// Number of points excluded as outliers: isolated ones, and ones far from the surface on which
    /// their neighbours agree.
    pub outliers: usize,
    /// Source and orientation of the normals.
    pub sides: NormalReport,
    /// Connected components of the surface.
    pub components: Components,
}

/// Maximum number of cells of the coarsest level along the longest edge. More leave the function
/// far from the data to chance, as smoothness alone decides it there; fewer do not resolve the
/// shape of the whole.
const MAX_COARSEST_CELLS: f64 = 6.0;

/// Weights α of given and of estimated normals. Estimated normals add only orientation to what the
/// points say, and they round off edges.
const GIVEN_NORMAL_WEIGHT: f64 = 0.1;
const ESTIMATED_NORMAL_WEIGHT: f64 = 0.01;

/// Tolerance of the residual of a level's equations in the norm of the preconditioner, relative to
/// that of zero corrections. 3e-5 leaves about 2e-8 of the energy, which moves the surface by far
/// less than the level's own error. With 1e-4 a ball in one level of cells was fitted 5 % worse
/// than possible; with 1e-5 a fit takes a tenth more time.
const RESIDUAL_TOLERANCE: f64 = 3e-5;

/// Maximum number of steps of conjugate gradients in a level; 5 to 60 are usual.
const MAX_CG_STEPS: usize = 400;

/// Returns true if a point is held out to measure the error. The choice is aperiodic, as every
/// tenth point of a scan in rows may form a line.
fn is_left_out(i: usize) -> bool {
    scattered(i) * 10.0 < 1.0
}

/// Minimum number of points per cell of a level, with given and with estimated normals. A cell of a
/// surface has about three coefficients of its own; a point with a normal gives three equations.
const MIN_POINTS_PER_CELL: [usize; 2] = [2, 3];

/// Number of levels below a cell at which points must be distinct to count separately. Copies of a
/// point, exact or nearly so, say nothing about the surface between points, and held-out copies are
/// fitted at any level. With three, two or three points in a cell are distinct except for a few per
/// cent.
const DISTINCT_LEVELS: usize = 3;

/// Fits an implicit spline to points by values, normals and smoothness (Jüttler and Felis 2002).
///
/// ```
/// use isoform_control::Control;
/// use isoform_geom::Field;
/// use isoform_spline::{Normals, Options, implicitize};
/// // 500 points of a unit sphere.
/// let points: Vec<[f64; 3]> = (0..500)
///     .map(|i| {
///         let (z, u) = ((i as f64 + 0.5) / 250.0 - 1.0, 2.4 * i as f64);
///         let r = (1.0 - z * z).sqrt();
///         [r * u.cos(), r * u.sin(), z]
///     })
///     .collect();
/// let fit = implicitize(&points, Normals::Unknown, &Options::default(), &Control::default())?;
/// assert!(fit.spline.value([0.0, 0.0, 0.9]) > 0.0 && fit.spline.value([0.0, 0.0, 1.1]) < 0.0);
/// assert!(fit.distances.rms < 1e-3);
/// # Ok::<(), isoform_spline::Error>(())
/// ```
///
/// # Errors
/// [`Error`].
pub fn implicitize(
    points: &[Point3],
    normals: Normals<'_>,
    options: &Options,
    control: &Control<'_>,
) -> Result<SplineFit, Error> {
    check(points, options)?;
    control.begin("normals")?;
    let (directions, sides) = oriented_normals(points, normals, control)?;
    control.begin("fitting")?;
    let alpha = if sides.source.is_given() {
        GIVEN_NORMAL_WEIGHT
    } else {
        ESTIMATED_NORMAL_WEIGHT
    };
    let mut samples = PointsWithNormals {
        points: points.to_vec(),
        normals: directions,
    };
    let alone = isolated(&samples);
    leave_out(&mut samples, &alone);
    let mut fit = fit_spline(&samples, alpha, options, None, control)?;
    let mut off = surface_distances(&fit.spline, &samples.points);
    let apart = off_surface_points(&off, &fit.sorted(&samples), fit.spline.spacing());
    if leave_out(&mut samples, &apart) {
        fit = fit_spline(&samples, alpha, options, Some(&fit), control)?;
        off = surface_distances(&fit.spline, &samples.points);
    }
    control.begin("checking")?;
    Ok(SplineFit {
        distances: Distances::from_values(off),
        outliers: points.len() - samples.points.len(),
        components: components(&fit.spline),
        spline: fit.spline,
        sides,
    })
}

/// Excludes points, given by ascending indices, unless they are too many; returns true if any were
/// excluded.
fn leave_out(samples: &mut PointsWithNormals, numbers: &[u32]) -> bool {
    let n = samples.points.len();
    // If more than a fifth seem to be outliers, the rest cannot be trusted either.
    let is_some = !numbers.is_empty()
        && numbers.len() as f64 <= 0.2 * n as f64
        && n - numbers.len() >= MIN_POINTS;
    if is_some {
        samples.leave_out(numbers);
    }
    is_some
}

/// Returns the ascending indices of isolated points.
fn isolated(samples: &PointsWithNormals) -> Vec<u32> {
    let lattice = FirstLattice::seen(&samples.points);
    let sorted = PointsByCell::new(
        samples,
        lattice.corner,
        lattice.spacing,
        lattice.count,
        |_| true,
    );
    isolated_points(samples, &sorted)
}

/// Fitted spline with its lattice.
struct LatticeFit {
    spline: ImplicitSpline,
    lattice: FirstLattice,
    /// Cells in which f was kept away from 0, as sorted keys, by level.
    held: Vec<Vec<u64>>,
}

impl LatticeFit {
    /// Sorts points into the spline's finest cells.
    fn sorted<'a>(&self, samples: &'a PointsWithNormals) -> PointsByCell<'a> {
        let finest = self.spline.depth() - 1;
        let count = self.lattice.count.map(|c| c << finest);
        PointsByCell::new(
            samples,
            self.lattice.corner,
            self.spline.spacing(),
            count,
            |_| true,
        )
    }
}

/// Fits a spline to samples; `alpha` is the weight of their normals. An earlier fit to nearly the
/// same points provides lattice, depth and initial coefficients if the lattice of the samples
/// hardly differs.
fn fit_spline(
    samples: &PointsWithNormals,
    alpha: f64,
    options: &Options,
    before: Option<&LatticeFit>,
    control: &Control<'_>,
) -> Result<LatticeFit, Stopped> {
    let own = FirstLattice::new(&samples.points, options);
    let before = before.filter(|fit| fit.lattice.is_nearly(&own));
    let lattice = before.map_or(own, |fit| fit.lattice);
    let mut fitting = LevelFitter {
        samples,
        lattice,
        degree: options.degree,
        weights: TermWeights {
            normals: alpha,
            smoothing: options.smoothing,
        },
        levels: Vec::new(),
        data: Vec::new(),
        held: Vec::new(),
        before,
    };
    fitting.run(options.fineness, control)?;
    let LevelFitter {
        levels, data, held, ..
    } = fitting;
    let spline = ImplicitSpline::new(options.degree, lattice.corner, levels, &data);
    Ok(LatticeFit {
        spline,
        lattice,
        held,
    })
}

/// Returns the distances of points from f = 0.
fn surface_distances(spline: &ImplicitSpline, points: &[Point3]) -> Vec<f64> {
    let jet = |p: Point3| {
        let jet = spline.jet(p);
        (jet.v, jet.g)
    };
    let of = |p: &Point3| distance(jet, *p, spline.spacing());
    points.par_iter().map(of).collect()
}

fn check(points: &[Point3], options: &Options) -> Result<(), Error> {
    let wrong = |name, what| Err(Error::Option { name, what });
    if !(2..=crate::MAX_DEGREE).contains(&options.degree) {
        return wrong("degree", "from 2 to 5 are possible");
    }
    if !options.smoothing.is_finite() || options.smoothing <= 0.0 {
        return wrong("smoothing", "a positive number is expected");
    }
    // At 1 results are planes and spheres already; at 1e300 f vanishes.
    if options.smoothing > 1e6 {
        return wrong("smoothing", "at most 1e6 is possible");
    }
    match options.fineness {
        Fineness::Cells(0) => return wrong("cells", "at least one is needed"),
        Fineness::Tolerance(t) if !t.is_finite() || t <= 0.0 => {
            return wrong("tol", "a positive length is expected");
        }
        _ => {}
    }
    check_points(points)
}

/// Checks that the points can determine a surface.
pub(crate) fn check_points(points: &[Point3]) -> Result<(), Error> {
    if points.len() < MIN_POINTS {
        return Err(Error::Few {
            found: points.len(),
        });
    }
    if !points.iter().flatten().all(|v| v.is_finite()) {
        return Err(Error::NotFinite);
    }
    let bounds = Aabb::from_points(points);
    let size = bounds.diagonal();
    if size <= 0.0 || !size.is_finite() {
        return Err(Error::Degenerate { is_point: true });
    }
    if is_line(points, size) {
        return Err(Error::Degenerate { is_point: false });
    }
    Ok(())
}

/// Returns true if all points lie on a line, to 1e-9 of their extent.
fn is_line(points: &[Point3], size: f64) -> bool {
    let first = points[0];
    let far = points.iter().fold((0.0, first), |best: (f64, Point3), p| {
        let d = norm(sub(*p, first));
        if d > best.0 { (d, *p) } else { best }
    });
    let along = sub(far.1, first).map(|v| v / far.0);
    points
        .iter()
        .all(|p| norm(isoform_geom::cross(sub(*p, first), along)) <= 1e-9 * size)
}

/// Lattice of the first level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstLattice {
    pub(crate) corner: Point3,
    pub(crate) spacing: f64,
    pub(crate) count: LatticeIndex,
    /// Level at which the requested number of cells is reached; 0 if none was requested.
    depth: u32,
}

impl FirstLattice {
    /// Returns a lattice coarse enough that its cells with points cover the sampled surface without
    /// gaps.
    pub(crate) fn seen(points: &[Point3]) -> Self {
        let bounds = Aabb::from_points(points);
        let (size, longest) = Self::size(bounds);
        // Ten points per cell leave no gaps between cells with points; a sample of twenty per cell
        // suffices to choose the spacing.
        let cells = (points.len() / 10).clamp(50, 2000);
        let stride = points.len().div_ceil(40_000);
        let some: Vec<Point3> = points.iter().step_by(stride).copied().collect();
        let spacing = spacing_for(&some, bounds, cells).max(longest / 64.0);
        Self::around(bounds, size, spacing, 0)
    }

    /// Returns the edge lengths of a lattice around a box, and the longest of them.
    fn size(bounds: Aabb) -> (Point3, f64) {
        // Room for unseen parts of the surface, and for the box of a mesh around the data.
        let margin = 0.12 * bounds.diagonal();
        let size = bounds.size().map(|s| s + 2.0 * margin);
        (size, size[0].max(size[1]).max(size[2]))
    }

    fn new(points: &[Point3], options: &Options) -> Self {
        let bounds = Aabb::from_points(points);
        let (size, longest) = Self::size(bounds);
        let Fineness::Cells(cells) = options.fineness else {
            return Self::around(bounds, size, longest / MAX_COARSEST_CELLS, 0);
        };
        // If every point has a cell of its own, smaller cells add no cell with data, but far more
        // cells between them.
        let cells = cells.min(points.len() / MIN_POINTS_PER_CELL[0]);
        let mut finest = spacing_for(points, bounds, cells);
        loop {
            let depth = (longest / (MAX_COARSEST_CELLS * finest))
                .log2()
                .ceil()
                .max(0.0) as u32;
            let lattice = Self::around(bounds, size, finest * f64::from(1u32 << depth), depth);
            // The search counts cells from the corner of the points' box, not of the lattice.
            if held(points, lattice.corner, finest) <= cells || finest > bounds.diagonal() {
                return lattice;
            }
            finest *= 1.0 + 1.0 / 64.0;
        }
    }

    /// Returns true if the other lattice has equally many cells of nearly this size.
    fn is_nearly(&self, other: &Self) -> bool {
        let ratio = self.spacing / other.spacing;
        // A fifth of the change of the spacing by one more level of depth; outliers enlarge the box
        // of the points by less.
        self.count == other.count && self.depth == other.depth && (ratio - 1.0).abs() < 0.05
    }

    /// Returns the lattice centred on a box.
    fn around(bounds: Aabb, size: Point3, spacing: f64, depth: u32) -> Self {
        let count = size.map(|s| ((s / spacing).ceil() as i32).max(1));
        let middle = bounds.center();
        Self {
            corner: std::array::from_fn(|k| middle[k] - 0.5 * spacing * f64::from(count[k])),
            spacing,
            count,
            depth,
        }
    }
}

/// Returns the number of cells of a lattice that contain points.
fn held(points: &[Point3], corner: Point3, spacing: f64) -> usize {
    let mut keys: Vec<u64> = points
        .par_iter()
        .map(|p| key(cell_of(sub(*p, corner), spacing, [1 << 20; 3])))
        .collect();
    keys.par_sort_unstable();
    keys.dedup();
    keys.len()
}

/// Returns the smallest spacing, to 1/64, at which at most `cells` cells of a lattice contain
/// points.
fn spacing_for(points: &[Point3], bounds: Aabb, cells: usize) -> f64 {
    let held = |spacing: f64| held(points, bounds.lo, spacing);
    let mut high = bounds.diagonal();
    let mut low = high;
    while held(low) <= cells && low > 1e-5 * high {
        low *= 0.5;
    }
    while low < high * (1.0 - 1.0 / 64.0) {
        let middle = (low * high).sqrt();
        if held(middle) <= cells {
            high = middle
        } else {
            low = middle
        }
    }
    high
}

/// Levels fitted so far, and their input.
struct LevelFitter<'a> {
    samples: &'a PointsWithNormals,
    lattice: FirstLattice,
    degree: usize,
    weights: TermWeights,
    levels: Vec<SplineLevel>,
    /// Cells with data, by level.
    data: Vec<Vec<LatticeIndex>>,
    /// Like the field of [`LatticeFit`].
    held: Vec<Vec<u64>>,
    /// Earlier fit on this lattice.
    before: Option<&'a LatticeFit>,
}

impl<'a> LevelFitter<'a> {
    fn count(&self, l: usize) -> LatticeIndex {
        self.lattice.count.map(|c| c << l)
    }

    fn run(&mut self, fineness: Fineness, control: &Control<'_>) -> Result<(), Stopped> {
        match fineness {
            Fineness::Cells(_) => self.fit_to_depth(self.lattice.depth as usize, control),
            Fineness::Data => {
                let depth = match self.before {
                    None => self.depth_of_data(None, control)?,
                    Some(fit) => fit.spline.depth() - 1,
                };
                self.fit_to_depth(depth, control)
            }
            Fineness::Tolerance(tolerance) => {
                let depth = self.depth_of_data(Some(tolerance), control)?;
                self.fit_to_tolerance(depth, tolerance, control)
            }
        }
    }

    /// Fits all levels to a depth, only the last of them to all points.
    fn fit_to_depth(&mut self, depth: usize, control: &Control<'_>) -> Result<(), Stopped> {
        for l in 0..=depth {
            let sorted = self.sorted(l);
            self.begin_level(l, &sorted, |_| true);
            if l == depth {
                self.fit(l, &sorted, 1.0, control)?;
            } else {
                // 64 points of a cell average the noise of its three coefficients well enough for
                // an initial function. All points would take twice the time for a million in 30 000
                // cells; with 16, f = 0 has extra components. Coarse levels decide the function
                // away from the points: with a stiffness of 1 it oscillates there and f = 0 has
                // extra components; above 1000 the finest level has to repair too much.
                self.fit(l, &sorted.thinned(64), 1000.0, control)?;
            }
            control.report("fitting", (l + 1) as f64 / (depth + 1) as f64);
        }
        Ok(())
    }

    /// Fits levels, refining only cells whose error exceeds a tolerance, down to a depth.
    fn fit_to_tolerance(
        &mut self,
        depth: usize,
        tolerance: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let mut rough: Vec<u64> = Vec::new();
        for l in 0..=depth {
            let sorted = self.sorted(l);
            let is_rough =
                |cell: LatticeIndex| rough.binary_search(&key(cell.map(|v| v >> 1))).is_ok();
            self.begin_level(l, &sorted, |cell| l == 0 || is_rough(cell));
            self.fit(l, &sorted, 1.0, control)?;
            rough = self.rough_cells(l, &sorted, tolerance);
            if rough.is_empty() {
                break;
            }
        }
        Ok(())
    }

    /// Returns the cells of a level whose points deviate by more than a tolerance, as sorted keys.
    fn rough_cells(&self, l: usize, sorted: &PointsByCell<'_>, tolerance: f64) -> Vec<u64> {
        let (level, data) = (&self.levels[l], &self.data[l]);
        (0..sorted.count())
            .into_par_iter()
            .filter_map(|i| {
                let (key, range) = sorted.cell(i);
                data.binary_search_by_key(&key, |c| crate::keys::key(*c))
                    .ok()?;
                let count = range.len() as f64;
                let sum = self.squares(level, place(key), range, sorted);
                (sum > tolerance * tolerance * count).then_some(key)
            })
            .collect()
    }

    /// Returns the sum of squared distances of a cell's points.
    fn squares(
        &self,
        level: &SplineLevel,
        cell: LatticeIndex,
        range: std::ops::Range<usize>,
        sorted: &PointsByCell<'_>,
    ) -> f64 {
        let mut stencil = Stencil::new(self.degree);
        let c = level.cell_coefficients(cell, self.degree);
        let squares = range.map(|k| {
            let (t, _) = sorted.local(k, cell, level.spacing);
            stencil.fill(t);
            let [f, x, y, z] = stencil.times(&c);
            let slope = norm([x, y, z]) / level.spacing;
            if slope > 0.0 {
                (f / slope) * (f / slope)
            } else {
                level.spacing * level.spacing
            }
        });
        squares.sum()
    }

    /// Returns the depth down to which the error at held-out points falls, or reaches a tolerance.
    fn depth_of_data(
        &mut self,
        tolerance: Option<f64>,
        control: &Control<'_>,
    ) -> Result<usize, Stopped> {
        let mut before = f64::INFINITY;
        let mut depth = 0;
        loop {
            let l = self.levels.len();
            if self
                .count(l + DISTINCT_LEVELS)
                .iter()
                .any(|c| *c >= MAX_AXIS_NODES / 2)
            {
                break;
            }
            let all = self.sorted(l);
            let per_cell =
                MIN_POINTS_PER_CELL[usize::from(self.weights.normals < GIVEN_NORMAL_WEIGHT)];
            let finer = self.spacing(l + DISTINCT_LEVELS);
            let apart = || held(&self.samples.points, self.lattice.corner, finer);
            if l > 0 && all.count() * per_cell > apart() {
                break;
            }
            let kept = self.chosen(l, |i| !is_left_out(i));
            self.begin_level(l, &all, |_| true);
            self.fit(l, &kept, 1.0, control)?;
            let left = self.chosen(l, is_left_out);
            let squares: f64 = (0..left.count())
                .into_par_iter()
                .map(|i| {
                    let (key, range) = left.cell(i);
                    self.squares(&self.levels[l], place(key), range, &left)
                })
                .collect::<Vec<_>>()
                .iter()
                .sum();
            let error = (squares / left.len().max(1) as f64).sqrt();
            // Where noise dominates, the error falls no more, and rises later.
            if error > 0.9 * before {
                break;
            }
            depth = l;
            before = error;
            if tolerance.is_some_and(|t| error < 0.25 * t) {
                break;
            }
        }
        self.levels.clear();
        self.data.clear();
        self.held.clear();
        Ok(depth)
    }

    fn spacing(&self, l: usize) -> f64 {
        self.lattice.spacing / f64::from(1u32 << l)
    }

    /// Sorts all points into the cells of a level.
    fn sorted(&self, l: usize) -> PointsByCell<'a> {
        self.chosen(l, |_| true)
    }

    /// Sorts a selection of points, by index, into the cells of a level.
    fn chosen(&self, l: usize, which: impl Fn(usize) -> bool + Sync) -> PointsByCell<'a> {
        let corner = self.lattice.corner;
        PointsByCell::new(self.samples, corner, self.spacing(l), self.count(l), which)
    }

    /// Adds a level whose cells with data are those of `sorted` selected by `which`.
    fn begin_level(
        &mut self,
        l: usize,
        sorted: &PointsByCell<'_>,
        which: impl Fn(LatticeIndex) -> bool,
    ) {
        let cells = (0..sorted.count()).map(|i| place(sorted.cell(i).0));
        let data: Vec<LatticeIndex> = cells.filter(|cell| which(*cell)).collect();
        let count = self.count(l);
        let level = match self.levels.last_mut() {
            Some(coarse) => coarse.refined(&data, count, self.degree),
            None => SplineLevel::coarsest(count, self.lattice.spacing, self.degree),
        };
        self.levels.push(level);
        self.data.push(data);
    }

    /// Solves for the unknowns of the last level; `stiffness` multiplies the weight of smoothing.
    fn fit(
        &mut self,
        l: usize,
        sorted: &PointsByCell<'_>,
        stiffness: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let weights = TermWeights {
            smoothing: stiffness * self.weights.smoothing,
            ..self.weights
        };
        let problem = LevelProblem::new(&self.levels[l], self.degree, sorted, weights);
        let (x, held) = self.corrections(l, &problem, control)?;
        self.held.push(held);
        let unknown = problem.unknown;
        let level = &mut self.levels[l];
        for (c, i) in level.coefficients.iter_mut().zip(&unknown) {
            if *i != NO_INDEX {
                *c += level.spacing * x[*i as usize];
            }
        }
        Ok(())
    }

    /// Solves the problem of a level for its unknowns. Also returns the cells in which f was kept,
    /// as sorted keys.
    fn corrections(
        &self,
        l: usize,
        problem: &LevelProblem<'_>,
        control: &Control<'_>,
    ) -> Result<(Vec<f64>, Vec<u64>), Stopped> {
        let key = |i: usize| problem.points.cell(i).0;
        let of_level = |fit: &'a LatticeFit| Some((fit.spline.levels().get(l)?, fit.held.get(l)?));
        let (mut x, mut held) = match self.before.and_then(of_level) {
            None => (vec![0.0; problem.active.len()], Vec::new()),
            Some((level, keys)) => {
                let is_held = |i: &usize| keys.binary_search(&key(*i)).is_ok();
                let held = (0..problem.points.count()).filter(is_held).collect();
                (problem.corrections(level), held)
            }
        };
        let mut solver = LevelSolver::new(problem, &held, control)?;
        // The first level starts from f = 0, which has no inside to preserve.
        if l == 0 {
            x = solver.solve(x, RESIDUAL_TOLERANCE, MAX_CG_STEPS, control)?;
            return Ok((x, Vec::new()));
        }
        // A residual of a tenth costs 2 to 5 of some 40 steps and reveals half of the points where
        // f approaches 0; the rest of them show at the full tolerance.
        for tolerance in [0.1, RESIDUAL_TOLERANCE, RESIDUAL_TOLERANCE] {
            x = solver.solve(x, tolerance, MAX_CG_STEPS, control)?;
            let mut lost = problem.lost(&x);
            lost.retain(|i| held.binary_search(i).is_err());
            if lost.is_empty() && tolerance == RESIDUAL_TOLERANCE {
                break;
            }
            solver.hold(&lost, control)?;
            held.extend(lost);
            held.sort_unstable();
        }
        Ok((x, held.into_iter().map(key).collect()))
    }
}
