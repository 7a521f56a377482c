//! Scans of a single surface, which is tried first, from all points at once.

use crate::chart::{Primitive, PrimitiveKind};
use crate::choose::{Noise, follows};
use crate::cloud::{Cloud, thinned};
use crate::fit::{Precision, fit};
use crate::kinds::{best_kind, guess};
use crate::labels::UNLABELLED;
use crate::noise::NORMAL_MEDIAN;
use crate::segment::{MAX_NOISE_GROWTH, NOISE_SLACK, Segmentation};
use crate::share::MembershipWeights;
use isoform_geom::{Aabb, Point3};
use rayon::prelude::*;

/// Positions, in the order of the points, of the parts of a scan that guesses come from, in
/// addition to all points. Normals determine the axis of whole tori, these parts that of strips of
/// them.
const GUESS_POSITIONS: [f64; 4] = [0.125, 0.375, 0.625, 0.875];
/// Number of points of a block by whose mean a surface is judged: about as many as a small face
/// has.
const LEVEL_BLOCK_POINTS: usize = 48;
/// Maximum noise, in diagonals, of a surface whose points fill the neighbourhoods: those of a ball
/// are 0.06 off a sphere.
const MAX_VOLUME_NOISE: f64 = 0.03;

impl Segmentation {
    /// Returns the single surface that all points follow up to independent noise no larger than
    /// neighbourhoods show, or the two sides of a wall about it; `None` for other scans.
    ///
    /// If noise is as large as the spacing of the points, or a strip of the surface is narrow,
    /// neighbourhoods show little of what all points show together.
    pub(crate) fn whole(cloud: &Cloud) -> Option<Self> {
        let one = Self::one(cloud, false)?;
        // Neighbourhoods smaller than the noise show only a part of it.
        let most = match cloud.is_volume {
            true => MAX_VOLUME_NOISE,
            false => MAX_NOISE_GROWTH * cloud.noise.max(cloud.grid),
        };
        let all: Vec<u32> = (0..cloud.points.len() as u32).collect();
        let surface = one.surfaces[0];
        if one.noise > most {
            return None;
        }
        let is_one = one.noise <= cloud.grid || has_one_sheet(cloud, &surface);
        let found = match is_one {
            true if follows(cloud, [&all; 2], &surface, one.deviation(NOISE_SLACK)) => one,
            true => return None,
            // Neighbours on one side are off the middle surface in one direction.
            false => Self::wall(cloud, &surface)?,
        };
        found.is_level(cloud).then_some(found)
    }

    /// Returns true if no part of any surface is off it: the mean distance of points whose
    /// projections lie together is that of independent noise. This reveals small faces of another
    /// surface, such as the caps of a rod and the sides of a plate, in noise that hides them from
    /// the neighbours of a point.
    fn is_level(&self, cloud: &Cloud) -> bool {
        let noise = self.noise.max(cloud.grid);
        let count = self.labels.len() as f64 / LEVEL_BLOCK_POINTS as f64;
        // For a standard normal deviate, |z| > most has at most the probability exp(−most²/2).
        let most = (2.0 * (count.max(1.0) / 1e-3).ln()).sqrt();
        let members = self.members();
        let mut all = self.surfaces.iter().zip(&members);
        all.all(|(surface, points)| {
            blocks(&mut feet(surface, &cloud.at(points)), LEVEL_BLOCK_POINTS).all(|block| {
                let sum: f64 = block.iter().map(|f| f.1).sum();
                sum.abs() <= most * noise * (block.len() as f64).sqrt()
            })
        })
    }

    /// Returns the two sides of a wall about a surface, thinner than the spacing of the points;
    /// points between them, on its ends, have no label.
    fn wall(cloud: &Cloud, middle: &Primitive) -> Option<Self> {
        let points = &cloud.points;
        let side: Vec<usize> = (points.iter())
            .map(|p| usize::from(middle.distance(*p) > 0.0))
            .collect();
        let mut surfaces = [*middle; 2];
        let mut is_on = vec![true; points.len()];
        let mut noise = f64::INFINITY;
        for _ in 0..5 {
            let of = |k: usize| {
                let all = points.iter().zip(side.iter().zip(&is_on));
                all.filter(move |(_, (s, on))| **s == k && **on)
                    .map(|(p, _)| *p)
            };
            let fitted = |k: usize| fit(&surfaces[k], &of(k).collect::<Vec<_>>(), Precision::Full);
            surfaces = [fitted(0)?.0, fitted(1)?.0];
            let off: Vec<f64> = (points.iter().zip(&side))
                .map(|(p, k)| surfaces[*k].distance(*p).abs())
                .collect();
            let mut sorted = off.clone();
            let half = sorted.len() / 2;
            let median = *sorted.select_nth_unstable_by(half, f64::total_cmp).1;
            noise = (median / NORMAL_MEDIAN).max(cloud.floor);
            is_on = off.iter().map(|r| *r <= 3.5 * noise).collect();
        }
        let label = |(k, on): (&usize, &bool)| if *on { *k as u32 } else { UNLABELLED };
        let labels = side.iter().zip(&is_on).map(label).collect();
        // The two sides have to hold 80 % of the points.
        let is_most = is_on.iter().filter(|on| **on).count() as f64 >= 0.8 * points.len() as f64;
        is_most.then(|| Self::new(surfaces.to_vec(), labels, noise, false))
    }

    /// Returns the single surface with the least distances of all points, of the simplest justified
    /// kind; `is_form` tells whether they are a tolerance of form.
    pub(crate) fn one(cloud: &Cloud, is_form: bool) -> Option<Self> {
        let points = &cloud.points;
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let parts = GUESS_POSITIONS.map(|at| {
            let seed = (at * points.len() as f64) as u32;
            cloud.around(seed, points.len() / 16)
        });
        let some: Vec<Point3> = thinned(points.len(), 400).map(|k| points[k]).collect();
        let fitted = |kind: &PrimitiveKind| {
            let guesses = parts.iter().chain([&all]);
            let guesses = guesses.filter_map(|of| guess(cloud, of, *kind));
            let rough = guesses.filter_map(|start| fit(&start, &some, Precision::Full));
            let (start, squares) = rough.min_by(|a, b| a.1.total_cmp(&b.1))?;
            // Most scans consist of several surfaces.
            if squares > MAX_VOLUME_NOISE * MAX_VOLUME_NOISE * some.len() as f64 {
                return None;
            }
            let (surface, squares) = fit(&start, points, Precision::Full)?;
            let free = points.len().saturating_sub(kind.parameters()).max(1) as f64;
            Some((surface, (squares / free).sqrt()))
        };
        let fits: Vec<_> = PrimitiveKind::ALL.par_iter().filter_map(fitted).collect();
        let (surface, deviation) = fits.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let noise = Noise {
            deviation: deviation.max(cloud.floor),
            slack: NOISE_SLACK,
            is_form,
        };
        let shares: MembershipWeights = all.iter().map(|i| (*i, 1.0)).collect();
        let surface = best_kind(cloud, &shares, &surface, noise);
        Some(Self::new(
            vec![surface],
            vec![0; all.len()],
            noise.deviation,
            is_form,
        ))
    }
}

/// Returns the share of the squared distances of points from a surface that is a function of their
/// position on it: near 1 for a deviation of form, near 0 for noise and for the two sides of a
/// plate.
pub(crate) fn share_of_place(surface: &Primitive, points: &[Point3]) -> f64 {
    let mut feet = feet(surface, points);
    let all: f64 = feet.iter().map(|f| f.1 * f.1).sum();
    // Dents of a form may be small; of noise the mean of twelve shows 1/12.
    let means = blocks(&mut feet, 12).map(|block| {
        let sum: f64 = block.iter().map(|f| f.1).sum();
        sum * sum / block.len() as f64
    });
    let means: f64 = means.sum();
    if all > 0.0 { means / all } else { 1.0 }
}

/// Returns the projections of points onto a surface, with their distances.
fn feet(surface: &Primitive, points: &[Point3]) -> Vec<(Point3, f64)> {
    let foot = |p: &Point3| (surface.foot(*p), surface.distance(*p));
    points.iter().map(foot).collect()
}

/// Divides points recursively at the medians of their widest coordinates into blocks of between
/// `size` and 2 `size` points.
fn blocks(
    feet: &mut [(Point3, f64)],
    size: usize,
) -> Box<dyn Iterator<Item = &[(Point3, f64)]> + '_> {
    if feet.len() < 2 * size {
        return Box::new(std::iter::once(&*feet));
    }
    let places: Vec<Point3> = feet.iter().map(|f| f.0).collect();
    let extent = Aabb::from_points(&places).size();
    let widest = (0..3)
        .max_by(|&i, &j| extent[i].total_cmp(&extent[j]))
        .unwrap_or(0);
    let half = feet.len() / 2;
    feet.select_nth_unstable_by(half, |a, b| a.0[widest].total_cmp(&b.0[widest]));
    let (low, high) = feet.split_at_mut(half);
    Box::new(blocks(low, size).chain(blocks(high, size)))
}

/// Returns false if the distances of all points from a surface are those of points on both sides of
/// a wall: their kurtosis is 1, that of uniform noise 9/5, of normal noise 3.
fn has_one_sheet(cloud: &Cloud, surface: &Primitive) -> bool {
    let count = cloud.points.len() as f64;
    let moment = |power: i32| {
        let powers = cloud
            .points
            .iter()
            .map(|p| surface.distance(*p).powi(power));
        powers.sum::<f64>() / count
    };
    // Uniform noise has the kurtosis 1.8; the second term is five deviations of its estimate.
    moment(4) >= (1.8 - 4.0 / count.sqrt()) * moment(2).powi(2)
}
