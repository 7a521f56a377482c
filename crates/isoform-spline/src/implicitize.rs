//! From points to an implicit spline, level by level.
//!
//! Each level is fitted to all points with the coefficients of the levels before as they are: its
//! unknowns are the B-splines that touch cells with data, and what lies beyond them continues the
//! coarser function smoothly. So no level has to be guessed: cells are refined until a number of
//! cells is used up, a tolerance holds, or points that were left out are met no better.

use crate::components::{Components, components};
use crate::energy::{FIXED, Problem, Stencil, Weights};
use crate::feet::{Distances, distance};
use crate::keys::{MOST, Place, key, place};
use crate::level::Level;
use crate::outliers::{beside, strays};
use crate::points::{Samples, Sorted, cell_of, scattered};
use crate::sides::{Normals, Sides, sided};
use crate::solve::Solver;
use crate::surface::ImplicitSpline;
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, Field, Point3, norm, sub};
use rayon::prelude::*;

/// How fine an implicit spline becomes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Fineness {
    /// Until points that are left out are met no better: as fine as the data can tell.
    #[default]
    Data,
    /// At most this many cells hold data, and no more than half as many as there are points.
    Cells(usize),
    /// Until the points of every cell lie this close to the surface, as a root mean square, but no
    /// finer than the data can tell.
    Tolerance(f64),
}

/// How an implicit spline is fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The tri-degree, 2 to 5.
    pub degree: usize,
    /// How fine it becomes.
    pub fineness: Fineness,
    /// The weight of smoothing, λ. Larger values round edges and average noise over more cells;
    /// without any, B-splines that data hardly touches are not determined.
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

/// Why points have no implicit spline.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There are fewer points than a surface needs.
    #[error("{found} points: at least {FEWEST} are needed")]
    Few {
        /// Points given.
        found: usize,
    },
    /// All points are in one place or on one line.
    #[error("all points lie {}", if *.is_point { "in one place" } else { "on one line" })]
    Degenerate {
        /// Whether it is one place.
        is_point: bool,
    },
    /// A coordinate is not finite.
    #[error("a coordinate is not finite")]
    NotFinite,
    /// An option is out of its range.
    #[error("{name}: {what}")]
    Option {
        /// Its name.
        name: &'static str,
        /// What is wrong with it.
        what: &'static str,
    },
    /// Points leave a polynomial of that degree open.
    #[error("the points do not determine a polynomial of this degree")]
    Undetermined,
    /// The control ended the work.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// The largest weight of smoothing: with 1 surfaces are planes and balls, with 1e300 f is 0
/// everywhere.
const SMOOTHEST: f64 = 1e6;

/// The fewest points that are fitted: fewer do not determine the normals of a surface.
const FEWEST: usize = 10;

/// What was fitted.
#[derive(Clone, Debug)]
pub struct Implicitized {
    /// The function.
    pub spline: ImplicitSpline,
    /// The distances of points from f = 0, outliers left out: root mean square, 95th percentile and
    /// maximum.
    pub distances: Distances,
    /// Points that belong to no surface, and were left out: where there are few others, or far from
    /// the surface that those around agree on.
    pub outliers: usize,
    /// Where normals came from.
    pub sides: Sides,
    /// Pieces of the surface.
    pub components: Components,
}

/// The share of the data's diagonal by which the lattice is larger than their box on each side:
/// what is not seen of a surface lies within it, and a box about the data for a mesh too.
const MARGIN: f64 = 0.12;

/// Cells of the coarsest level along the longest edge, at most: few enough to tell the function far
/// away from the data by smoothness alone, enough to begin with the shape of the whole.
const COARSEST: f64 = 6.0;

/// Weights of normals, α. Estimated ones hold nothing that their points do not hold, but for their
/// side, and round edges.
const GIVEN: f64 = 0.1;
const ESTIMATED: f64 = 0.01;

/// The residual of a level's equations in the norm of the preconditioner, relative to that without
/// corrections: 3e-5 leaves some 2e-8 of the energy, which moves the surface by far less than the
/// level's own error. With 1e-4 a ball in one level of cells was met 5 % worse than it can be, with
/// 1e-5 a fit takes a tenth more time.
const RESIDUAL: f64 = 3e-5;

/// The residual at which a level is first asked where it takes away the distance of f from 0: a
/// tenth costs 2 to 5 of some 40 steps, and half of these places show. The rest of them show at
/// [`RESIDUAL`].
const ROUGH: f64 = 0.1;

/// Most steps of conjugate gradients in a level; usual are 5 to 60.
const STEPS: usize = 400;

/// How much more smoothing weighs on levels that are refined further. They tell the function where
/// there are no points: with 1 it swings there and f = 0 has extra pieces, with more the finest
/// level has to repair too much.
const COARSE: f64 = 1000.0;

/// One in so many points is left out where points decide on the fineness.
const LEFT_OUT: f64 = 10.0;

/// Whether a point is left out there: in no rhythm, as every tenth point of a scan in rows may be a
/// line of them.
fn is_left_out(i: usize) -> bool {
    scattered(i) * LEFT_OUT < 1.0
}

/// A level is worth its cells if it brings the error of the points left out below this part of the
/// level before. Where noise rules, errors fall no more, and rise later.
const WORTH: f64 = 0.9;

/// Points of a cell, at most, to which a level is fitted that is refined everywhere: enough to
/// average noise for the level's three coefficients of a cell, as a start for the next. All points
/// would cost twice the time where a million lie in 30 000 cells; with 16 f = 0 has extra pieces.
const SOME_OF_CELL: usize = 64;

/// Points per cell below which a level is not tried, with given normals and without: a cell of a
/// surface has some three coefficients of its own, a point with a normal gives three equations.
const PER_CELL: [usize; 2] = [2, 3];

/// Points count once in a cell of so many levels more: copies of a point, exact or nearly so, tell
/// nothing of the surface between points, and those of points left out are met by any level. With
/// three, two or three points in a cell are apart but for a few per cent.
const APART_BY: usize = 3;

/// Fits an implicit spline to points: values, normals and smoothness (Jüttler and Felis 2002).
///
/// ```
/// use isoform_control::Control;
/// use isoform_geom::Field;
/// use isoform_spline::{Normals, Options, implicitize};
/// // A unit sphere, seen at 500 places.
/// let points: Vec<[f64; 3]> = (0..500)
///     .map(|i| {
///         let (z, u) = ((i as f64 + 0.5) / 250.0 - 1.0, 2.4 * i as f64);
///         let r = (1.0 - z * z).sqrt();
///         [r * u.cos(), r * u.sin(), z]
///     })
///     .collect();
/// let made = implicitize(&points, Normals::Unknown, &Options::default(), &Control::default())?;
/// assert!(made.spline.value([0.0, 0.0, 0.9]) > 0.0 && made.spline.value([0.0, 0.0, 1.1]) < 0.0);
/// assert!(made.distances.rms < 1e-3);
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
) -> Result<Implicitized, Error> {
    check(points, options)?;
    control.begin("normals")?;
    let (directions, sides) = sided(points, normals, control)?;
    control.begin("fitting")?;
    let alpha = if sides.source.is_given() {
        GIVEN
    } else {
        ESTIMATED
    };
    let mut samples = Samples {
        points: points.to_vec(),
        normals: directions,
    };
    let alone = strays_of(&samples);
    leave_out(&mut samples, &alone);
    let mut fit = fitted(&samples, alpha, options, None, control)?;
    let mut off = distances_of(&fit.spline, &samples.points);
    let apart = beside(&off, &fit.sorted(&samples), fit.spline.spacing());
    if leave_out(&mut samples, &apart) {
        fit = fitted(&samples, alpha, options, Some(&fit), control)?;
        off = distances_of(&fit.spline, &samples.points);
    }
    control.begin("checking")?;
    Ok(Implicitized {
        distances: Distances::of(off),
        outliers: points.len() - samples.points.len(),
        components: components(&fit.spline),
        spline: fit.spline,
        sides,
    })
}

/// The largest share of points that are left out as outliers. Where more seem to be some, it is
/// unknown what the others are.
const MOST_OUT: f64 = 0.2;

/// Leaves points out, by their numbers in order, unless they are too many; says whether some were.
fn leave_out(samples: &mut Samples, numbers: &[u32]) -> bool {
    let n = samples.points.len();
    let is_some = !numbers.is_empty()
        && numbers.len() as f64 <= MOST_OUT * n as f64
        && n - numbers.len() >= FEWEST;
    if is_some {
        samples.leave_out(numbers);
    }
    is_some
}

/// Points where there are few others.
fn strays_of(samples: &Samples) -> Vec<u32> {
    let lattice = Lattice::seen(&samples.points);
    let sorted = Sorted::new(
        samples,
        lattice.corner,
        lattice.spacing,
        lattice.count,
        |_| true,
    );
    strays(samples, &sorted)
}

/// A spline and what it was made on.
struct Fit {
    spline: ImplicitSpline,
    lattice: Lattice,
    /// Per level, the cells in which f was held where the surface is not near, as keys in order.
    held: Vec<Vec<u64>>,
}

impl Fit {
    /// Points by the spline's finest cells.
    fn sorted<'a>(&self, samples: &'a Samples) -> Sorted<'a> {
        let finest = self.spline.depth() - 1;
        let count = self.lattice.count.map(|c| c << finest);
        Sorted::new(
            samples,
            self.lattice.corner,
            self.spline.spacing(),
            count,
            |_| true,
        )
    }
}

/// Fits a spline to samples; `alpha` is the weight of their normals. A fit of nearly all of them
/// lends its lattice, its depth and its coefficients as a start, where the lattice of the samples
/// would hardly be another.
fn fitted(
    samples: &Samples,
    alpha: f64,
    options: &Options,
    before: Option<&Fit>,
    control: &Control<'_>,
) -> Result<Fit, Stopped> {
    let own = Lattice::new(&samples.points, options);
    let before = before.filter(|fit| fit.lattice.is_nearly(&own));
    let lattice = before.map_or(own, |fit| fit.lattice);
    let mut fitting = Fitting {
        samples,
        lattice,
        degree: options.degree,
        weights: Weights {
            normals: alpha,
            smoothing: options.smoothing,
        },
        levels: Vec::new(),
        data: Vec::new(),
        held: Vec::new(),
        before,
    };
    fitting.run(options.fineness, control)?;
    let Fitting {
        levels, data, held, ..
    } = fitting;
    let spline = ImplicitSpline::new(options.degree, lattice.corner, levels, &data);
    Ok(Fit {
        spline,
        lattice,
        held,
    })
}

/// Distances of points from f = 0.
fn distances_of(spline: &ImplicitSpline, points: &[Point3]) -> Vec<f64> {
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
    if options.smoothing > SMOOTHEST {
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

/// Whether points have a surface.
pub(crate) fn check_points(points: &[Point3]) -> Result<(), Error> {
    if points.len() < FEWEST {
        return Err(Error::Few {
            found: points.len(),
        });
    }
    if !points.iter().flatten().all(|v| v.is_finite()) {
        return Err(Error::NotFinite);
    }
    let bounds = Aabb::of(points);
    let size = bounds.diagonal();
    if size <= 0.0 || !size.is_finite() {
        return Err(Error::Degenerate { is_point: true });
    }
    if is_line(points, size) {
        return Err(Error::Degenerate { is_point: false });
    }
    Ok(())
}

/// Whether all points lie on a line, to 1e-9 of their size.
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

/// The first level's lattice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    pub(crate) corner: Point3,
    pub(crate) spacing: f64,
    pub(crate) count: Place,
    /// The level at which a number of cells that was asked for is reached.
    depth: u32,
}

/// Points per cell where a lattice says where points are, about: enough for cells between them to
/// hold one.
const PER_SEEN: usize = 10;

/// Cells that hold points, about, where a lattice says where they are: the least and the most.
const SEEN: [usize; 2] = [50, 2000];

/// Points that such a lattice is chosen by: twenty in each of its cells.
const SOME: usize = 40_000;

/// Spacings that differ by less than this share are alike: a fifth of what another depth brings in
/// cells, and wide enough for boxes that outliers had made a little larger.
const ALIKE: f64 = 0.05;

/// Cells along the longest edge of such a lattice, at most.
const FINEST: f64 = 64.0;

impl Lattice {
    /// A lattice that says where points are.
    pub(crate) fn seen(points: &[Point3]) -> Self {
        let bounds = Aabb::of(points);
        let (size, longest) = Self::size(bounds);
        let cells = (points.len() / PER_SEEN).clamp(SEEN[0], SEEN[1]);
        let stride = points.len().div_ceil(SOME);
        let some: Vec<Point3> = points.iter().step_by(stride).copied().collect();
        let spacing = spacing_for(&some, bounds, cells).max(longest / FINEST);
        Self::around(bounds, size, spacing, 0)
    }

    /// The edges of a lattice about a box, and the longest of them.
    fn size(bounds: Aabb) -> (Point3, f64) {
        let margin = MARGIN * bounds.diagonal();
        let size = bounds.size().map(|s| s + 2.0 * margin);
        (size, size[0].max(size[1]).max(size[2]))
    }

    fn new(points: &[Point3], options: &Options) -> Self {
        let bounds = Aabb::of(points);
        let (size, longest) = Self::size(bounds);
        let Fineness::Cells(cells) = options.fineness else {
            return Self::around(bounds, size, longest / COARSEST, 0);
        };
        // Where every point has a cell of its own, smaller cells are no more of them, but far
        // more lie between.
        let cells = cells.min(points.len() / PER_CELL[0]);
        let mut finest = spacing_for(points, bounds, cells);
        loop {
            let depth = (longest / (COARSEST * finest)).log2().ceil().max(0.0) as u32;
            let lattice = Self::around(bounds, size, finest * f64::from(1u32 << depth), depth);
            // The search counts cells from the corner of the points' box, not of the lattice.
            if held(points, lattice.corner, finest) <= cells || finest > bounds.diagonal() {
                return lattice;
            }
            finest *= 1.0 + 1.0 / 64.0;
        }
    }

    /// Whether another lattice has its cells of nearly this size, as many of them.
    fn is_nearly(&self, other: &Self) -> bool {
        let ratio = self.spacing / other.spacing;
        self.count == other.count && self.depth == other.depth && (ratio - 1.0).abs() < ALIKE
    }

    /// The lattice about the middle of a box.
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

/// How many cells of a lattice hold points.
fn held(points: &[Point3], corner: Point3, spacing: f64) -> usize {
    let mut keys: Vec<u64> = points
        .par_iter()
        .map(|p| key(cell_of(sub(*p, corner), spacing, [1 << 20; 3])))
        .collect();
    keys.par_sort_unstable();
    keys.dedup();
    keys.len()
}

/// The least spacing at which at most `cells` cells of a lattice hold points, to a part in 64.
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

/// The levels as they grow.
struct Fitting<'a> {
    samples: &'a Samples,
    lattice: Lattice,
    degree: usize,
    weights: Weights,
    levels: Vec<Level>,
    /// Cells with data of each level.
    data: Vec<Vec<Place>>,
    /// See [`Fit`].
    held: Vec<Vec<u64>>,
    /// Another fit on this lattice.
    before: Option<&'a Fit>,
}

impl<'a> Fitting<'a> {
    fn count(&self, l: usize) -> Place {
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

    /// Fits all levels to a depth, the last one by all points.
    fn fit_to_depth(&mut self, depth: usize, control: &Control<'_>) -> Result<(), Stopped> {
        for l in 0..=depth {
            let sorted = self.sorted(l);
            self.begin_level(l, &sorted, |_| true);
            if l == depth {
                self.fit(l, &sorted, 1.0, control)?;
            } else {
                self.fit(l, &sorted.thinned(SOME_OF_CELL), COARSE, control)?;
            }
            control.report("fitting", (l + 1) as f64 / (depth + 1) as f64);
        }
        Ok(())
    }

    /// Fits levels where cells are off by more than a tolerance, down to a depth.
    fn fit_to_tolerance(
        &mut self,
        depth: usize,
        tolerance: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let mut rough: Vec<u64> = Vec::new();
        for l in 0..=depth {
            let sorted = self.sorted(l);
            let is_rough = |cell: Place| rough.binary_search(&key(cell.map(|v| v >> 1))).is_ok();
            self.begin_level(l, &sorted, |cell| l == 0 || is_rough(cell));
            self.fit(l, &sorted, 1.0, control)?;
            rough = self.rough_cells(l, &sorted, tolerance);
            if rough.is_empty() {
                break;
            }
        }
        Ok(())
    }

    /// Cells of a level whose points are off by more than a tolerance, as keys in order.
    fn rough_cells(&self, l: usize, sorted: &Sorted<'_>, tolerance: f64) -> Vec<u64> {
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

    /// The sum of squared distances of a cell's points.
    fn squares(
        &self,
        level: &Level,
        cell: Place,
        range: std::ops::Range<usize>,
        sorted: &Sorted<'_>,
    ) -> f64 {
        let mut stencil = Stencil::new(self.degree);
        let c = level.of_cell(cell, self.degree);
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

    /// The depth down to which points that were left out are met better, or a tolerance.
    fn depth_of_data(
        &mut self,
        tolerance: Option<f64>,
        control: &Control<'_>,
    ) -> Result<usize, Stopped> {
        let mut before = f64::INFINITY;
        let mut depth = 0;
        loop {
            let l = self.levels.len();
            if self.count(l + APART_BY).iter().any(|c| *c >= MOST / 2) {
                break;
            }
            let all = self.sorted(l);
            let per_cell = PER_CELL[usize::from(self.weights.normals < GIVEN)];
            let finer = self.spacing(l + APART_BY);
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
            if error > WORTH * before {
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

    /// The points by cells of a level.
    fn sorted(&self, l: usize) -> Sorted<'a> {
        self.chosen(l, |_| true)
    }

    /// Points that are chosen by number, by cells of a level.
    fn chosen(&self, l: usize, which: impl Fn(usize) -> bool + Sync) -> Sorted<'a> {
        let corner = self.lattice.corner;
        Sorted::new(self.samples, corner, self.spacing(l), self.count(l), which)
    }

    /// Adds a level whose cells with data are those of `sorted` that `which` chooses.
    fn begin_level(&mut self, l: usize, sorted: &Sorted<'_>, which: impl Fn(Place) -> bool) {
        let cells = (0..sorted.count()).map(|i| place(sorted.cell(i).0));
        let data: Vec<Place> = cells.filter(|cell| which(*cell)).collect();
        let count = self.count(l);
        let level = match self.levels.last_mut() {
            Some(coarse) => coarse.refined(&data, count, self.degree),
            None => Level::coarsest(count, self.lattice.spacing, self.degree),
        };
        self.levels.push(level);
        self.data.push(data);
    }

    /// Solves for the unknowns of the last level; `stiffness` multiplies the weight of smoothing.
    fn fit(
        &mut self,
        l: usize,
        sorted: &Sorted<'_>,
        stiffness: f64,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let weights = Weights {
            smoothing: stiffness * self.weights.smoothing,
            ..self.weights
        };
        let problem = Problem::new(&self.levels[l], self.degree, sorted, weights);
        let (x, held) = self.corrections(l, &problem, control)?;
        self.held.push(held);
        let unknown = problem.unknown;
        let level = &mut self.levels[l];
        for (c, i) in level.coefficients.iter_mut().zip(&unknown) {
            if *i != FIXED {
                *c += level.spacing * x[*i as usize];
            }
        }
        Ok(())
    }

    /// Solves the problem of a level for its unknowns; also gives the cells in which f was held, as
    /// keys in order.
    fn corrections(
        &self,
        l: usize,
        problem: &Problem<'_>,
        control: &Control<'_>,
    ) -> Result<(Vec<f64>, Vec<u64>), Stopped> {
        let key = |i: usize| problem.points.cell(i).0;
        let of_level = |fit: &'a Fit| Some((fit.spline.levels().get(l)?, fit.held.get(l)?));
        let (mut x, mut held) = match self.before.and_then(of_level) {
            None => (vec![0.0; problem.active.len()], Vec::new()),
            Some((level, keys)) => {
                let is_held = |i: &usize| keys.binary_search(&key(*i)).is_ok();
                let held = (0..problem.points.count()).filter(is_held).collect();
                (problem.corrections(level), held)
            }
        };
        let mut solver = Solver::new(problem, &held, control)?;
        // The first level begins with f = 0 and knows of no inside.
        if l == 0 {
            x = solver.solve(x, RESIDUAL, STEPS, control)?;
            return Ok((x, Vec::new()));
        }
        for tolerance in [ROUGH, RESIDUAL, RESIDUAL] {
            x = solver.solve(x, tolerance, STEPS, control)?;
            let mut lost = problem.lost(&x);
            lost.retain(|i| held.binary_search(i).is_err());
            if lost.is_empty() && tolerance == RESIDUAL {
                break;
            }
            solver.hold(&lost, control)?;
            held.extend(lost);
            held.sort_unstable();
        }
        Ok((x, held.into_iter().map(key).collect()))
    }
}
