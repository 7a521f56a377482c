//! Splines that interpolate a given function by sampling, refined where it is far from them.
//!
//! The coefficients are those of quasi-interpolants: at each level the local functional that
//! reproduces quadratic polynomials, applied to the B-splines of the level that are active in the
//! truncated hierarchical basis (Speleers and Manni, Effortless quasi-interpolation in hierarchical
//! spaces, Numer. Math. 132, 2016).

use crate::bspline::{self, SplineRow};
use crate::global::POINTS_PER_CHUNK;
use crate::keys::{IndexSet, LatticeIndex, MAX_AXIS_NODES, key, place};
use crate::level::{MAX_CELL_SPLINES, SplineLevel, block};
use crate::surface::ImplicitSpline;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Tri-degree of sampled splines: the lowest with continuous gradients.
const DEGREE: usize = 2;

/// Number of cells of the first level along the longest edge of the box. Without refinement a cell
/// must find out by eight values that the function is far from the spline.
const FIRST_CELLS: f64 = 16.0;

/// Maximum number of coefficients, some 100 bytes each.
const MAX_COEFFICIENTS: usize = 4_000_000;

/// Default accuracy of a distance, in diagonals of the shape.
const DEFAULT_ACCURACY: f64 = 1e-3;

/// Default addition to the accuracy as a share of |f|. Kinks of a distance lie on the medial axis,
/// whose cells so get larger with the distance from the surface.
const DEFAULT_SHARE: f64 = 0.05;

/// Accuracy of a sampled spline, for values f of the given function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleAccuracy {
    /// Maximum error where f is 0, in units of f.
    pub absolute: f64,
    /// Addition to the maximum error, as a share of |f|.
    pub relative: f64,
}

impl SampleAccuracy {
    /// Returns the accuracy of a distance with this maximum error on the surface, by default a
    /// thousandth of the diagonal of the shape. A twentieth of the distance is added.
    pub fn of_distance(absolute: Option<f64>, diagonal: f64) -> Self {
        Self {
            absolute: absolute.unwrap_or(DEFAULT_ACCURACY * diagonal),
            relative: DEFAULT_SHARE,
        }
    }
}

/// Reason why a function is not sampled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SampleError {
    /// The box is empty or unbounded, or an accuracy is not positive.
    #[error("a finite box and a positive accuracy are needed")]
    Options,
    /// The function is not a finite number at a point.
    #[error("the function is not a number at {0:?}")]
    NotFinite(Point3),
    /// The accuracy needs too many coefficients.
    #[error("the accuracy needs more than {MAX_COEFFICIENTS} coefficients")]
    TooFine,
    /// The computation was stopped.
    #[error("stopped")]
    Stopped,
}

/// Samples a function of space in a box: returns a spline of degree 2 whose error at the tested
/// points, eight of each cell and the given probes, is within half the accuracy: the rest is for the
/// points between. Probes show what is small. `values` computes the function at some points, some of
/// them outside of the box by up to an eighth of its longest edge.
///
/// # Errors
/// [`SampleError`].
pub fn sample_function(
    region: Aabb,
    accuracy: SampleAccuracy,
    probes: &[Point3],
    control: &Control,
    values: impl Fn(&[Point3], &mut [f64]) + Sync,
) -> Result<ImplicitSpline, SampleError> {
    sample_within(
        region,
        (accuracy, MAX_COEFFICIENTS),
        probes,
        control,
        values,
    )
}

/// Samples a function as [`sample_function`] does, with at most `limit` coefficients.
fn sample_within(
    region: Aabb,
    (accuracy, limit): (SampleAccuracy, usize),
    probes: &[Point3],
    control: &Control,
    values: impl Fn(&[Point3], &mut [f64]) + Sync,
) -> Result<ImplicitSpline, SampleError> {
    let size: Point3 = std::array::from_fn(|k| region.hi[k] - region.lo[k]);
    let longest = size.iter().copied().fold(0.0, f64::max);
    let is_positive = |v: f64| v > 0.0 && v.is_finite();
    let is_sound = size.iter().all(|v| is_positive(*v))
        && region.lo.iter().all(|v| v.is_finite())
        && is_positive(accuracy.absolute)
        && accuracy.relative >= 0.0;
    if !is_sound {
        return Err(SampleError::Options);
    }
    let spacing = longest / FIRST_CELLS;
    let count = size.map(|v| ((v / spacing).ceil() as i32).max(1));
    let sampling = Sampling {
        corner: region.lo,
        accuracy,
        control,
        values,
    };
    control
        .begin("sampling")
        .map_err(|_| SampleError::Stopped)?;
    let mut probes = sampling.known(probes)?;
    let mut levels = vec![SplineLevel::coarsest(count, spacing, DEGREE)];
    let mut data: Vec<Vec<LatticeIndex>> = vec![levels[0].cells.places().collect()];
    let mut coefficients = 0;
    loop {
        let l = levels.len() - 1;
        coefficients += levels[l].nodes.len();
        if coefficients > limit {
            return Err(SampleError::TooFine);
        }
        sampling.set_coefficients(&mut levels[l])?;
        let next = sampling.too_coarse(&levels[l], &data[l], &mut probes)?;
        if next.is_empty() {
            return Ok(ImplicitSpline::new(DEGREE, region.lo, levels, &data));
        }
        let finer = count.map(|c| c << (l + 1));
        // Each cell has a coefficient at least.
        let is_long = finer.iter().any(|c| *c >= MAX_AXIS_NODES / 2);
        if is_long || coefficients + next.len() > limit {
            return Err(SampleError::TooFine);
        }
        let level = levels[l].refined(&next, finer, DEGREE);
        levels.push(level);
        data.push(next);
    }
}

/// Sampling of a function.
struct Sampling<'a, F> {
    corner: Point3,
    accuracy: SampleAccuracy,
    control: &'a Control<'a>,
    values: F,
}

impl<F: Fn(&[Point3], &mut [f64]) + Sync> Sampling<'_, F> {
    /// Returns the function at the middles of cells, whose indices are those of the keys minus
    /// `offset`.
    fn at_middles(&self, keys: &[u64], spacing: f64, offset: i32) -> Result<Vec<f64>, SampleError> {
        let middle = |k: &u64| -> Point3 {
            let cell = place(*k);
            std::array::from_fn(|a| self.corner[a] + spacing * (f64::from(cell[a] - offset) + 0.5))
        };
        self.at(&keys.iter().map(middle).collect::<Vec<_>>())
    }

    /// Returns the function at points.
    fn at(&self, points: &[Point3]) -> Result<Vec<f64>, SampleError> {
        let mut found = vec![0.0; points.len()];
        let runs = found
            .par_chunks_mut(POINTS_PER_CHUNK)
            .zip(points.par_chunks(POINTS_PER_CHUNK));
        let done = AtomicUsize::new(0);
        runs.try_for_each(|(out, some)| {
            if self.control.is_stopped() {
                return Err(SampleError::Stopped);
            }
            (self.values)(some, out);
            let done = done.fetch_add(some.len(), Ordering::Relaxed);
            self.control
                .report("sampling", done as f64 / points.len() as f64);
            Ok(())
        })?;
        match found.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(SampleError::NotFinite(points[i])),
            None => Ok(found),
        }
    }

    /// Returns probes with the function there.
    fn known(&self, probes: &[Point3]) -> Result<Vec<(Point3, f64)>, SampleError> {
        let values = self.at(probes)?;
        Ok(probes.iter().copied().zip(values).collect())
    }

    /// Sets the active coefficients of a level.
    fn set_coefficients(&self, level: &mut SplineLevel) -> Result<(), SampleError> {
        // B-spline m has its middle in cell m − 1, and needs the cells next to it.
        let active = || {
            let nodes = level.nodes.places().zip(&level.is_active);
            nodes.filter(|(_, active)| **active).map(|(node, _)| node)
        };
        let mut keys = Vec::new();
        for node in active() {
            keys.extend(block(node, node.map(|v| v + 2)).map(key));
        }
        let places = IndexSet::new(keys);
        let keys: Vec<u64> = places.places().map(key).collect();
        let values = self.at_middles(&keys, level.spacing, 2)?;
        let coefficient = |node: LatticeIndex| {
            let cells = block(node, node.map(|v| v + 2));
            let terms = cells.map(|cell| {
                let weight: f64 = (0..3).map(|k| weight(cell[k] - node[k])).product();
                weight * values[places.find(cell).expect("a cell of an active B-spline")]
            });
            terms.sum::<f64>()
        };
        let found: Vec<f64> = active().map(coefficient).collect();
        let unknown = level.coefficients.iter_mut().zip(&level.is_active);
        for ((c, _), found) in unknown.filter(|(_, active)| **active).zip(found) {
            *c = found;
        }
        Ok(())
    }

    /// Returns the children, sorted, of the cells with data in which the spline is too far from the
    /// function. Only the probes in these cells are kept.
    fn too_coarse(
        &self,
        level: &SplineLevel,
        data: &[LatticeIndex],
        probes: &mut Vec<(Point3, f64)>,
    ) -> Result<Vec<LatticeIndex>, SampleError> {
        let children = |cell: LatticeIndex| {
            let lo = cell.map(|v| 2 * v);
            block(lo, lo.map(|v| v + 1))
        };
        let all: Vec<LatticeIndex> = data.iter().flat_map(|cell| children(*cell)).collect();
        let keys: Vec<u64> = all.iter().map(|cell| key(*cell)).collect();
        let values = self.at_middles(&keys, 0.5 * level.spacing, 0)?;
        let rows = [0.25, 0.75].map(|t| bspline::values(DEGREE, t));
        let is_far = |(cell, values): (&LatticeIndex, &[f64])| {
            let of_cell = CellSpline::new(level, *cell, &self.accuracy);
            block([0; 3], [1; 3])
                .zip(values)
                .any(|(at, value)| of_cell.is_far(at.map(|v| rows[v as usize]), *value))
        };
        let far = data.par_iter().zip(values.par_chunks(8));
        let far = far.filter(|of| is_far(*of)).map(|(cell, _)| key(*cell));
        let mut far: BTreeSet<u64> = far.collect::<Vec<u64>>().into_iter().collect();
        let cell_of = |p: &Point3| self.cell_of(*p, level);
        for (p, value) in probes.iter() {
            let (cell, at) = cell_of(p);
            // Cells beside those with data are not refined for what is in them.
            if !far.contains(&key(cell))
                && data.binary_search_by_key(&key(cell), |c| key(*c)).is_ok()
            {
                let rows = at.map(|t| bspline::values(DEGREE, t));
                if CellSpline::new(level, cell, &self.accuracy).is_far(rows, *value) {
                    far.insert(key(cell));
                }
            }
        }
        probes.retain(|(p, _)| far.contains(&key(cell_of(p).0)));
        let mut next: Vec<u64> = far
            .into_iter()
            .map(place)
            .flat_map(children)
            .map(key)
            .collect();
        next.sort_unstable();
        Ok(next.into_iter().map(place).collect())
    }

    /// Returns the cell of a point, and its coordinates there.
    fn cell_of(&self, p: Point3, level: &SplineLevel) -> (LatticeIndex, Point3) {
        let s: Point3 = std::array::from_fn(|k| (p[k] - self.corner[k]) / level.spacing);
        let cell = s.map(|v| (v.floor() as i32).clamp(0, MAX_AXIS_NODES / 2));
        (cell, std::array::from_fn(|k| s[k] - f64::from(cell[k])))
    }
}

/// Spline on a cell, with the error that is allowed there.
struct CellSpline {
    coefficients: [f64; MAX_CELL_SPLINES],
    allowed: f64,
}

impl CellSpline {
    /// The values on a cell lie between its coefficients, the least of which tells the addition to
    /// the accuracy. The surface may pass where they change their sign.
    fn new(level: &SplineLevel, cell: LatticeIndex, accuracy: &SampleAccuracy) -> Self {
        let coefficients = level.cell_coefficients(cell, DEGREE);
        let own = &coefficients[..(DEGREE + 1).pow(3)];
        let lo = own.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = lo.max(-hi).max(0.0);
        Self {
            coefficients,
            allowed: 0.5 * (accuracy.absolute + accuracy.relative * least),
        }
    }

    /// Returns true if the spline differs too much from a value, given the B-splines there.
    fn is_far(&self, [x, y, z]: [SplineRow; 3], value: f64) -> bool {
        let n = DEGREE + 1;
        let terms = self.coefficients[..n * n * n].iter().enumerate();
        let terms = terms.map(|(i, c)| c * x[i % n] * y[i / n % n] * z[i / (n * n)]);
        (terms.sum::<f64>() - value).abs() > self.allowed
    }
}

/// Returns the weight of a value in a coefficient along an axis: of the middle of the B-spline's
/// support, which is cell 1, or of a neighbour. The sum is exact for quadratic polynomials.
fn weight(cell: i32) -> f64 {
    if cell == 1 { 1.25 } else { -0.125 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::{Field, norm};

    fn sampled(accuracy: SampleAccuracy, f: impl Fn(Point3) -> f64 + Sync) -> ImplicitSpline {
        let region = Aabb {
            lo: [-2.0, -1.5, -1.0],
            hi: [2.0, 1.5, 1.0],
        };
        let values = |points: &[Point3], out: &mut [f64]| {
            for (p, out) in points.iter().zip(out) {
                *out = f(*p);
            }
        };
        sample_function(region, accuracy, &[], &Control::default(), values).expect("a spline")
    }

    fn points(n: usize) -> impl Iterator<Item = Point3> {
        let mut random = fastrand::Rng::with_seed(1);
        (0..n).map(move |_| [2.0, 1.5, 1.0].map(|half| half * (2.0 * random.f64() - 1.0)))
    }

    fn fine() -> SampleAccuracy {
        SampleAccuracy::of_distance(Some(0.01), 1.0)
    }

    /// Quasi-interpolation reproduces quadratic polynomials, on one level.
    #[test]
    fn quadratic_functions_are_exact() {
        let f = |[x, y, z]: Point3| 1.0 - x * x + 2.0 * x * y - 0.5 * z * z * y * y + x - z;
        let spline = sampled(fine(), f);
        assert_eq!(spline.depth(), 1);
        for p in points(200) {
            assert!((spline.value(p) - f(p)).abs() < 1e-13, "{p:?}");
        }
    }

    /// The distance from a box has kinks; the error stays near the accuracy at points that were not
    /// tested, and falls with it. Gradients have no jump.
    #[test]
    fn distances_with_kinks_are_as_accurate_as_asked() {
        let half = [0.8, 0.5, 0.3];
        let distance = |p: Point3| {
            let q: Point3 = std::array::from_fn(|k| p[k].abs() - half[k]);
            let outside = norm(q.map(|v| v.max(0.0)));
            -(outside + q[0].max(q[1]).max(q[2]).min(0.0))
        };
        let mut unknowns = 0;
        for absolute in [0.02, 0.005] {
            let accuracy = SampleAccuracy::of_distance(Some(absolute), 1.0);
            let spline = sampled(accuracy, distance);
            let worst = points(20_000)
                .map(|p| {
                    let value = distance(p);
                    ((spline.value(p) - value).abs() - 0.05 * value.abs()) / absolute
                })
                .fold(0.0, f64::max);
            assert!((0.2..1.0).contains(&worst), "{worst} at {absolute}");
            assert!(spline.unknowns() > 2 * unknowns, "no finer than before");
            unknowns = spline.unknowns();
            for p in points(100) {
                let h = 1e-7;
                let [before, after] = [-h, h].map(|d| spline.jet([p[0] + d, p[1], p[2]]).g);
                let jump = norm(std::array::from_fn(|k| after[k] - before[k]));
                assert!(jump < 1e-3, "{jump} at {p:?}");
            }
        }
    }

    /// Errors on smooth surfaces are within the accuracy, however small it is.
    #[test]
    fn smooth_surfaces_are_as_accurate_as_asked() {
        for absolute in [1e-2, 1e-3, 1e-4] {
            let accuracy = SampleAccuracy::of_distance(Some(absolute), 1.0);
            let spline = sampled(accuracy, |p| 0.9 - norm(p));
            let on_ball = points(2000).map(|p| p.map(|v| 0.9 * v / norm(p)));
            let worst = on_ball.map(|p| spline.value(p).abs()).fold(0.0, f64::max);
            assert!(worst < absolute, "{worst} for {absolute}");
        }
    }

    /// A cell that looks flat at its tested points is refined where a probe says otherwise.
    #[test]
    fn probes_find_what_is_small() {
        let half = Aabb {
            lo: [-1.0; 3],
            hi: [1.0; 3],
        };
        let top = [0.0; 3];
        let spike = |p: Point3| (0.02 - norm(p)).max(-p[2]);
        let values = |points: &[Point3], out: &mut [f64]| {
            for (p, out) in points.iter().zip(out) {
                *out = spike(*p);
            }
        };
        let error = |probes: &[Point3]| {
            let control = Control::default();
            let made = sample_function(half, fine(), probes, &control, values).expect("a spline");
            (made.value(top) - spike(top)).abs()
        };
        assert!(
            error(&[]) > 0.01 && error(&[top]) < 0.005,
            "{} {}",
            error(&[]),
            error(&[top])
        );
    }

    #[test]
    fn nonsense_is_refused() {
        let one = |_: &[Point3], out: &mut [f64]| out.fill(1.0);
        let nan = |_: &[Point3], out: &mut [f64]| out.fill(f64::NAN);
        let step = |points: &[Point3], out: &mut [f64]| {
            for (p, out) in points.iter().zip(out) {
                *out = (p[0] + p[1]).signum();
            }
        };
        let region = Aabb {
            lo: [0.0; 3],
            hi: [1.0; 3],
        };
        let empty = Aabb {
            lo: [0.0; 3],
            hi: [1.0, 1.0, 0.0],
        };
        let control = Control::default();
        let error = |region, f: &(dyn Fn(&[Point3], &mut [f64]) + Sync)| {
            sample_within(region, (fine(), 100_000), &[], &control, f).err()
        };
        assert_eq!(error(empty, &one), Some(SampleError::Options));
        assert!(matches!(
            error(region, &nan),
            Some(SampleError::NotFinite(_))
        ));
        assert_eq!(error(region, &step), Some(SampleError::TooFine));
    }
}
