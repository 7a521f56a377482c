//! Scans of one surface: it is tried first, by all points at once.

use crate::chart::Kind;
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
/// Maximum noise, in diagonals, of a surface whose points fill the neighbourhoods: those of a ball
/// are 0.06 off a sphere.
const THICKEST: f64 = 0.03;

impl Segmentation {
    /// Returns the one surface that all points follow up to independent noise, which is no more
    /// than neighbourhoods show; `None` for other scans.
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
        let is_whole =
            one.noise <= most && follows(cloud, [&all; 2], &one.surfaces[0], one.deviation(SLACK));
        is_whole.then_some(one)
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
        Some(Self::of_one(surface, all.len(), noise.deviation, is_form))
    }
}
