//! Scans of one surface: it is tried first, by all points at once.

use crate::chart::{Kind, Surface};
use crate::choose::{Noise, follows};
use crate::cloud::{Cloud, thinned};
use crate::fit::{Precision, fit};
use crate::kinds::{best_kind, guess};
use crate::segment::{MOST_NOISE, SLACK, Segmentation};
use crate::share::Shares;
use isoform_geom::Point3;
use rayon::prelude::*;

/// Guesses come from all points, and from parts of them about these places in their order: one in
/// so many points. Of whole tori normals tell the axis, of strips of them these parts.
const PLACES: [f64; 4] = [0.125, 0.375, 0.625, 0.875];
const PART: usize = 16;
/// Points by which guesses are compared.
const SAMPLE: usize = 400;
/// The kurtosis of even noise, and the largest error of its estimate times the root of the number
/// of points: five deviations.
const EVEN: f64 = 1.8;
const CHANCE: f64 = 4.0;
/// Maximum noise, in diagonals, of a surface whose points fill the neighbourhoods: those of a ball
/// are 0.06 off a sphere.
const THICKEST: f64 = 0.03;

impl Segmentation {
    /// Returns the one surface that all points follow up to independent noise, which is no more
    /// than neighbourhoods show, or the two sides of a wall about it; `None` for other scans.
    ///
    /// Where noise is as large as the spacing of the points, or a strip of the surface is narrow,
    /// neighbourhoods tell little of what all points tell.
    pub(crate) fn whole(cloud: &Cloud) -> Option<Self> {
        let one = Self::one(cloud, false)?;
        // Neighbourhoods smaller than the noise tell a part of it.
        let most = match cloud.is_volume {
            true => THICKEST,
            false => MOST_NOISE * cloud.noise.max(cloud.grid),
        };
        let all: Vec<u32> = (0..cloud.points.len() as u32).collect();
        let surface = &one.surfaces[0];
        if one.noise > most || !follows(cloud, [&all; 2], surface, one.deviation(SLACK)) {
            return None;
        }
        match one.noise <= cloud.grid || has_one_sheet(cloud, surface) {
            true => Some(one),
            false => Self::wall(cloud, surface),
        }
    }

    /// Returns the two sides of a wall about a surface, which is thinner than the points are apart.
    fn wall(cloud: &Cloud, middle: &Surface) -> Option<Self> {
        let is_beyond = |p: &Point3| middle.distance(*p) > 0.0;
        let (beyond, within) = cloud.points.iter().partition(|p| is_beyond(p));
        let side = |points: Vec<Point3>| fit(middle, &points, Precision::Full);
        let (first, second) = (side(within)?, side(beyond)?);
        let count = cloud.points.len();
        let noise = ((first.1 + second.1) / count as f64)
            .sqrt()
            .max(cloud.floor);
        let label = |p: &Point3| u32::from(is_beyond(p));
        let labels = cloud.points.iter().map(label).collect();
        Some(Self::of(vec![first.0, second.0], labels, noise, false))
    }

    /// Returns the one surface from which all points are least off, of the simplest kind that is
    /// called for; by a tolerance of form or by noise.
    pub(crate) fn one(cloud: &Cloud, is_form: bool) -> Option<Self> {
        let points = &cloud.points;
        let all: Vec<u32> = (0..points.len() as u32).collect();
        let parts = PLACES.map(|at| {
            let seed = (at * points.len() as f64) as u32;
            cloud.around(seed, points.len() / PART)
        });
        let some: Vec<Point3> = thinned(points.len(), SAMPLE).map(|k| points[k]).collect();
        let fitted = |kind: &Kind| {
            let guesses = parts.iter().chain([&all]);
            let guesses = guesses.filter_map(|of| guess(cloud, of, *kind));
            let rough = guesses.filter_map(|start| fit(&start, &some, Precision::Full));
            let (start, squares) = rough.min_by(|a, b| a.1.total_cmp(&b.1))?;
            // Most scans are of several surfaces.
            if squares > THICKEST * THICKEST * some.len() as f64 {
                return None;
            }
            let (surface, squares) = fit(&start, points, Precision::Full)?;
            let free = points.len().saturating_sub(kind.parameters()).max(1) as f64;
            Some((surface, (squares / free).sqrt()))
        };
        let fits: Vec<_> = Kind::ALL.par_iter().filter_map(fitted).collect();
        let (surface, deviation) = fits.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let noise = Noise {
            deviation: deviation.max(cloud.floor),
            slack: SLACK,
            is_form,
        };
        let shares: Shares = all.iter().map(|i| (*i, 1.0)).collect();
        let surface = best_kind(cloud, &shares, &surface, noise);
        Some(Self::of(
            vec![surface],
            vec![0; all.len()],
            noise.deviation,
            is_form,
        ))
    }
}

/// True if the distances of all points from a surface are not those of points on both sides of a
/// wall: of these the kurtosis is 1, of even noise 9/5, of normal noise 3.
fn has_one_sheet(cloud: &Cloud, surface: &Surface) -> bool {
    let count = cloud.points.len() as f64;
    let moment = |power: i32| {
        let powers = cloud
            .points
            .iter()
            .map(|p| surface.distance(*p).powi(power));
        powers.sum::<f64>() / count
    };
    moment(4) >= (EVEN - CHANCE / count.sqrt()) * moment(2).powi(2)
}
