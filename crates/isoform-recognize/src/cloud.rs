//! The point cloud prepared for recognition: normalised, sorted, with neighbours, normals and an
//! estimate of its noise.

use crate::chart::{PrimitiveKind, unit};
use crate::fit::{Precision, fit};
use crate::local::{LocalEstimates, local};
use crate::noise::{MAX_EXACT_NOISE, MIN_NOISE};
use crate::pose::Pose;
use crate::start::starts;
use isoform_geom::{Aabb, KdTree, Point3, cross, dot, orient_normals, sub};
use rayon::prelude::*;

/// Number of neighbours along which regions grow and labels compete. Fewer tear regions apart where
/// points lie unevenly; more carry labels over narrow gaps.
pub(crate) const MAX_NEIGHBOURS: usize = 12;
/// Number of points in a neighbourhood, the centre included, that give its normal and its noise: a
/// quadratic height has 6 coefficients, which leaves 19 degrees of freedom.
const NEIGHBOURHOOD_POINTS: usize = 25;
/// Minimum distance of a neighbour on another sheet, across a wall, from the tangent planes of both
/// points, in deviations of the noise; the minimum tangent of its direction against them, and the
/// minimum cosine between the normals. Two points of one smooth surface lie off both planes to
/// opposite sides, and the mean is of third order; across a wall it is the thickness. Fewer
/// deviations tear noisy sheets apart, more let seeds and labels through thin walls.
const ACROSS_WALL_LIMITS: (f64, f64, f64) = (4.0, 0.5, 0.8);
/// Maximum number of places at which the noise of exact points is estimated, and the number of
/// points at each.
const NOISE_TRIALS: (usize, usize) = (400, 14);
/// Minimum share of the trials that show exact points, and the maximum ratio of their deviation
/// from some kind of surface to that from smooth heights.
const EXACTNESS_LIMITS: (f64, f64) = (0.15, 0.1);
/// Minimum cosine between the normal of a neighbourhood and that of a layer of its points.
const MIN_LAYER_COSINE: f64 = 0.7;
/// Maximum noise of points on surfaces, as a share of the radius of their neighbourhoods. Of points
/// in a cube, a ball or a normal cloud it is 0.32 to 0.4, of most scans below 0.3. A smaller bound
/// doubts dense noisy scans, a larger one takes volumes for surfaces.
const MAX_SHEET_NOISE: f64 = 0.3;
/// Number of points in a large neighbourhood, and the minimum ratio of its deviation to that of a
/// small one if points fill a volume: 1.57 to 1.69 was measured there, about 1.25 on surfaces.
const VOLUME_LIMITS: (usize, f64) = (75, 1.45);

/// The point cloud, scaled to a diagonal of 1 about the middle of its box, without duplicates and
/// sorted by coordinates: results do not depend on unit, position and order.
pub(crate) struct Cloud {
    pub(crate) points: Vec<Point3>,
    /// Unit normals that point outwards.
    pub(crate) normals: Vec<Point3>,
    /// Nearest neighbours of each point on its own sheet, at most [`MAX_NEIGHBOURS`] each.
    neighbours: Vec<u32>,
    /// Index of the first neighbour of each point in `neighbours`.
    first: Vec<u32>,
    /// Points that have each point among their neighbours, and the index of the first of them.
    beside: (Vec<u32>, Vec<u32>),
    /// Standard deviation of the neighbours of each point from a quadratic height.
    pub(crate) roughness: Vec<f64>,
    /// Noise estimated from the smoothest places.
    pub(crate) noise: f64,
    /// Standard deviation that rounding of the coordinates alone causes, a lower bound of all
    /// noise.
    pub(crate) floor: f64,
    /// Standard deviation of rounding if all decimals of the coordinates are rounded, however
    /// coarse.
    pub(crate) grid: f64,
    /// True if the points fill a volume.
    pub(crate) is_volume: bool,
}

/// Map from the scan's points to those of a [`Cloud`].
pub(crate) struct Scaling {
    /// Middle of the scan's box.
    pub(crate) origin: Point3,
    /// Diagonal of the scan's box.
    pub(crate) unit: f64,
}

impl Scaling {
    /// Returns the scaling of some points; `None` if they have no extent.
    pub(crate) fn from_points(points: &[Point3]) -> Option<Self> {
        let bounds = Aabb::from_points(points);
        let unit = bounds.diagonal();
        let is_usable = !bounds.is_empty() && unit.is_normal() && (1.0 / unit).is_normal();
        is_usable.then(|| Self {
            origin: bounds.center(),
            unit,
        })
    }

    pub(crate) fn apply(&self, p: Point3) -> Point3 {
        std::array::from_fn(|k| (p[k] - self.origin[k]) / self.unit)
    }
    /// Returns the point of the scan that was scaled to this one.
    pub(crate) fn back(&self, p: Point3) -> Point3 {
        std::array::from_fn(|k| self.origin[k] + self.unit * p[k])
    }
}

/// Returns points sorted by their coordinates without duplicates, and for each given point its
/// index there.
pub(crate) fn sorted(points: &[Point3]) -> (Vec<Point3>, Vec<u32>) {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let key = |i: u32| points[i as usize];
    let compare = |a: &Point3, b: &Point3| {
        (0..3).fold(std::cmp::Ordering::Equal, |o, k| {
            o.then(a[k].total_cmp(&b[k]))
        })
    };
    order.par_sort_unstable_by(|&i, &j| compare(&key(i), &key(j)).then(i.cmp(&j)));
    let (mut places, mut index): (Vec<Point3>, Vec<u32>) = (vec![], vec![0; points.len()]);
    for i in order {
        if places.last() != Some(&key(i)) {
            places.push(key(i));
        }
        index[i as usize] = places.len() as u32 - 1;
    }
    (places, index)
}

impl Cloud {
    /// Prepares sorted points of a diagonal of 1. Their coordinates have errors of at most
    /// `rounding`, and of at most `grid` if all decimals are rounding: errors of rounded numbers
    /// are uniform over ± this bound, with the standard deviation bound / √3.
    pub(crate) fn new(points: Vec<Point3>, rounding: f64, grid: f64) -> Self {
        let [floor, grid] = [rounding, grid].map(|most| MIN_NOISE.max(most / 3.0_f64.sqrt()));
        let tree = KdTree::new(&points);
        let found: Vec<(Vec<u32>, LocalEstimates)> = (0..points.len())
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |found, i| {
                tree.nearest_k(points[i], NEIGHBOURHOOD_POINTS, found);
                let near = found.iter().map(|f| f.1).filter(|j| *j != i as u32);
                (near.collect(), local(&points, i, found))
            })
            .collect();
        let mut normals: Vec<Point3> = found.iter().map(|f| f.1.normal).collect();
        let roughness: Vec<f64> = found.iter().map(|f| f.1.roughness).collect();
        let noise = exact_noise(&points, &normals, &found).unwrap_or(smooth_noise(&roughness));
        let noise = noise.max(exact(floor) / 2.0);
        let (mut neighbours, mut first) = (Vec::new(), vec![0]);
        for (i, (near, _)) in found.iter().enumerate() {
            let is_across = |j: &u32| is_across(&points, &normals, [i, *j as usize], noise);
            neighbours.extend(
                near.iter()
                    .copied()
                    .filter(|j| !is_across(j))
                    .take(MAX_NEIGHBOURS),
            );
            first.push(neighbours.len() as u32);
        }
        orient_normals(&points, &mut normals, &tree);
        Self {
            is_volume: fill_a_volume(&points, &roughness, &tree),
            beside: reversed(&neighbours, &first),
            neighbours,
            first,
            noise,
            floor,
            grid,
            roughness,
            points,
            normals,
        }
    }

    /// Returns the noise below which points lie on their surfaces as exactly as their coordinates
    /// are rounded.
    pub(crate) fn exact(&self) -> f64 {
        exact(self.floor)
    }

    /// Returns true if points with this noise are exact.
    pub(crate) fn is_exact(&self, noise: f64) -> bool {
        noise <= self.exact()
    }

    /// Turns points and normals back into the frame that a pose was taken from.
    pub(crate) fn turn_back(&mut self, pose: &Pose) {
        for v in self.points.iter_mut().chain(&mut self.normals) {
            *v = pose.back(*v);
        }
    }

    /// Returns the nearest neighbours of a point.
    pub(crate) fn near(&self, i: u32) -> &[u32] {
        let [from, to] = [i as usize, i as usize + 1].map(|k| self.first[k] as usize);
        &self.neighbours[from..to]
    }

    /// Returns each point paired with each of its neighbours.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = (u32, u32)> {
        let all = 0..self.points.len() as u32;
        all.flat_map(|i| self.near(i).iter().map(move |j| (i, *j)))
    }

    /// Returns the points that have this one among their neighbours.
    pub(crate) fn adjacent(&self, i: u32) -> &[u32] {
        let [from, to] = [i as usize, i as usize + 1].map(|k| self.beside.1[k] as usize);
        &self.beside.0[from..to]
    }

    /// Returns the points nearest to a seed among those reached along neighbours, nearest first. It
    /// visits twice as many as `count`, so that the result is nearly ordered by distance and not by
    /// ring.
    pub(crate) fn around(&self, seed: u32, count: usize) -> Vec<u32> {
        let mut is_seen = vec![false; self.points.len()];
        is_seen[seed as usize] = true;
        let (mut ring, mut all) = (vec![seed], vec![seed]);
        while !ring.is_empty() && all.len() < 2 * count {
            let mut next = Vec::new();
            for j in ring.iter().flat_map(|i| self.near(*i)) {
                if !std::mem::replace(&mut is_seen[*j as usize], true) {
                    next.push(*j);
                }
            }
            all.extend(&next);
            ring = next;
        }
        let from = self.points[seed as usize];
        let squared = |i: u32| {
            let d = sub(self.points[i as usize], from);
            dot(d, d)
        };
        all.sort_by(|&i, &j| squared(i).total_cmp(&squared(j)).then(i.cmp(&j)));
        all.truncate(count);
        all
    }

    /// Splits points into parts that are connected along neighbours.
    pub(crate) fn connected(&self, points: &[u32]) -> Vec<Vec<u32>> {
        let mut is_open = vec![false; self.points.len()];
        points.iter().for_each(|i| is_open[*i as usize] = true);
        let mut parts = Vec::new();
        for seed in points {
            if !std::mem::take(&mut is_open[*seed as usize]) {
                continue;
            }
            let (mut part, mut at) = (vec![*seed], 0);
            while let Some(i) = part.get(at).copied() {
                at += 1;
                let near = self.near(i).iter().copied();
                part.extend(near.filter(|j| std::mem::take(&mut is_open[*j as usize])));
            }
            parts.push(part);
        }
        parts
    }

    /// Returns the positions of some points.
    pub(crate) fn at(&self, which: &[u32]) -> Vec<Point3> {
        which.iter().map(|i| self.points[*i as usize]).collect()
    }

    /// Returns the normals of some points.
    pub(crate) fn normals_at(&self, which: &[u32]) -> Vec<Point3> {
        which.iter().map(|i| self.normals[*i as usize]).collect()
    }
}

/// Returns the noise below which points are exact, given the deviation that rounding alone causes.
fn exact(floor: f64) -> f64 {
    // At first exact points may be off by eight times what rounding alone explains: the modeller
    // has rounded before. Entities show how far they are.
    MAX_EXACT_NOISE.max(8.0 * floor)
}

/// Transposes a relation given as concatenated lists and the index of the first item of each:
/// returns for each point the lists that name it, in this layout, too.
fn reversed(lists: &[u32], first: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut begin = vec![0; first.len()];
    lists.iter().for_each(|j| begin[*j as usize + 1] += 1);
    for k in 1..begin.len() {
        begin[k] += begin[k - 1];
    }
    let (mut all, mut at) = (vec![0; lists.len()], begin.clone());
    for (i, ends) in first.windows(2).enumerate() {
        for j in &lists[ends[0] as usize..ends[1] as usize] {
            all[at[*j as usize] as usize] = i as u32;
            at[*j as usize] += 1;
        }
    }
    (all, begin)
}

/// Returns true if the points fill a volume: a deviation that grows with the neighbourhood is not
/// noise.
fn fill_a_volume(points: &[Point3], roughness: &[f64], tree: &KdTree) -> bool {
    let step = points.len().div_ceil(NOISE_TRIALS.0).max(1);
    let tried = (0..points.len()).into_par_iter().step_by(step);
    // The radius of each neighbourhood, and the deviations in the small and in the large one.
    let of = |found: &mut Vec<(f64, u32)>, i: usize| {
        tree.nearest_k(points[i], VOLUME_LIMITS.0.min(points.len()), found);
        let at = found.get(NEIGHBOURHOOD_POINTS.min(found.len()).saturating_sub(1));
        let d = at.map_or([0.0; 3], |f| sub(points[f.1 as usize], points[i]));
        let wide = local(points, i, found).roughness;
        (dot(d, d).sqrt(), roughness[i], wide)
    };
    let found: Vec<(f64, f64, f64)> = tried.map_init(Vec::new, of).collect();
    let radii: Vec<f64> = found.iter().map(|f| f.0).collect();
    let [small, large] = [
        smooth_noise(&found.iter().map(|f| f.1).collect::<Vec<_>>()),
        smooth_noise(&found.iter().map(|f| f.2).collect::<Vec<_>>()),
    ];
    let mean = radii.iter().sum::<f64>() / radii.len().max(1) as f64;
    small > MAX_SHEET_NOISE * mean && large > VOLUME_LIMITS.1 * small
}

/// Returns every m-th number below `n`, with m such that at most `most` remain.
pub(crate) fn thinned(n: usize, most: usize) -> impl Iterator<Item = usize> {
    (0..n).step_by(n.div_ceil(most).max(1))
}

/// Returns the noise of the smoothest places.
fn smooth_noise(roughness: &[f64]) -> f64 {
    let mut values: Vec<f64> = roughness
        .iter()
        .copied()
        .filter(|s| s.is_finite())
        .collect();
    if values.is_empty() {
        return MIN_NOISE;
    }
    // At least a fifth of the points lie on smooth places, whose quadratic heights show the noise:
    // 0.72 is this quantile of χ²/f for f = 19.
    let at = (values.len() as f64 * 0.2) as usize;
    let low = *values.select_nth_unstable_by(at, f64::total_cmp).1;
    (low / 0.72_f64.sqrt()).max(MIN_NOISE)
}

/// Returns the noise of points that lie on surfaces of the supported kinds more exactly than
/// quadratic heights show, which miss the curvature within a neighbourhood; `None` if the points
/// are noisy.
fn exact_noise(
    points: &[Point3],
    normals: &[Point3],
    found: &[(Vec<u32>, LocalEstimates)],
) -> Option<f64> {
    let (trials, size) = NOISE_TRIALS;
    let step = points.len().div_ceil(trials).max(1);
    let smooth = smooth_noise(&found.iter().map(|f| f.1.roughness).collect::<Vec<_>>());
    let mut least: Vec<f64> = (0..points.len())
        .into_par_iter()
        .step_by(step)
        .map(|i| {
            let near = found[i].0.iter().take(size - 1).map(|j| *j as usize);
            let near: Vec<usize> = near.chain([i]).collect();
            let at: Vec<Point3> = near.iter().map(|j| points[*j]).collect();
            let n: Vec<Point3> = near.iter().map(|j| normals[*j]).collect();
            let layer = deviation_of_layer(&at, normals[i]);
            PrimitiveKind::ALL
                .iter()
                .copied()
                .fold(layer, |best, kind| {
                    let free = (at.len() as f64 - kind.parameters() as f64).max(1.0);
                    let fits = starts(kind, &at, &n).into_iter();
                    let fits = fits.filter_map(|s| fit(&s, &at, Precision::Full));
                    fits.fold(best, |best, f| best.min((f.1 / free).sqrt()))
                })
        })
        .collect();
    let at = (least.len() as f64 * EXACTNESS_LIMITS.0) as usize;
    let low = *least.select_nth_unstable_by(at, f64::total_cmp).1;
    (low < EXACTNESS_LIMITS.1 * smooth).then_some(low.max(MIN_NOISE))
}

/// Returns the least root mean square distance of half of the points from a plane through the last
/// of them and two others: a plate thinner than the spacing has points of both faces, or of several
/// levels, in each neighbourhood.
fn deviation_of_layer(at: &[Point3], normal: Point3) -> f64 {
    let half = at.len() / 2;
    let Some((last, others)) = at.split_last() else {
        return f64::INFINITY;
    };
    let mut least = f64::INFINITY;
    for (k, a) in others.iter().enumerate() {
        for b in &others[k + 1..] {
            let plane = unit(cross(sub(*a, *last), sub(*b, *last)));
            // Rows of a regular sample lie in planes across the surface.
            if dot(plane, normal).abs() < MIN_LAYER_COSINE {
                continue;
            }
            let squared = |p: &Point3| dot(sub(*p, *last), plane).powi(2);
            let mut off: Vec<f64> = at.iter().map(squared).collect();
            off.select_nth_unstable_by(half, f64::total_cmp);
            let free = half.saturating_sub(2).max(1) as f64;
            least = least.min((off[..=half].iter().sum::<f64>() / free).sqrt());
        }
    }
    least
}

/// Returns true if two neighbours lie on opposite sides of a wall.
fn is_across(points: &[Point3], normals: &[Point3], [i, j]: [usize; 2], noise: f64) -> bool {
    let (deviations, tangent, cosine) = ACROSS_WALL_LIMITS;
    let (m, n) = (normals[i], normals[j]);
    let turned = dot(m, n);
    let d = sub(points[j], points[i]);
    let off = ((dot(d, m) + turned.signum() * dot(d, n)) / 2.0).abs();
    let along = (dot(d, d) - off * off).max(0.0).sqrt();
    off > deviations * noise && off > tangent * along && turned.abs() > cosine
}
