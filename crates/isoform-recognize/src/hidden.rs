//! Faces hidden in the noise of others: a face that lies within some deviations of another entity's
//! surface loses its points to it, although these are off that surface together.

use crate::chart::{Primitive, frame};
use crate::cloud::{Cloud, thinned};
use crate::description::MIN_SHORTENING;
use crate::labels::UNLABELLED;
use crate::segment::{DistanceTolerance, Limits, NOISE_SLACK, Segmentation};
use crate::start::{quadratic_row, squares_left};
use isoform_control::{Control, Stopped};
use isoform_geom::{KdTree, Point3, dot, sub};
use rayon::prelude::*;

/// Numbers of points of a window: of small faces, and of larger ones that are less far off.
const WINDOW_POINTS: [usize; 2] = [48, 192];
/// Number of windows in which each point lies on average.
const OVERLAP: usize = 8;

impl Segmentation {
    /// Grows surfaces from the points that are off their entities together, if that shortens the
    /// description; repeated while it does.
    pub(crate) fn uncover(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let is_shown = limits.allowed == DistanceTolerance::Shown;
        if self.is_form || !is_shown || cloud.is_exact(self.noise) {
            return Ok(());
        }
        loop {
            let off = self.off_together(cloud);
            // Most points are off their surfaces only if the object deviates from its form.
            if off.is_empty() || 2 * off.len() > cloud.points.len() {
                return Ok(());
            }
            let mut other = self.clone();
            off.iter()
                .for_each(|i| other.labels[*i as usize] = UNLABELLED);
            other.add_regions(cloud, NOISE_SLACK, limits, control)?;
            if other.surfaces.len() == self.surfaces.len() {
                return Ok(());
            }
            other.settle(cloud, limits);
            let [new, old] = [&other, &*self].map(|s| s.length(cloud, self.noise));
            if new + MIN_SHORTENING > old {
                return Ok(());
            }
            *self = other;
        }
    }

    /// Returns the points of all windows in which the distances from the entity are a function of
    /// the place.
    fn off_together(&self, cloud: &Cloud) -> Vec<u32> {
        let members = self.members();
        let noise = self.noise.max(cloud.grid);
        let mut off: Vec<u32> = (members.par_iter().zip(&self.surfaces))
            .flat_map_iter(|(of, surface)| windows_off(cloud, of, surface, noise))
            .collect();
        off.sort_unstable();
        off.dedup();
        off
    }
}

/// Returns the points of an entity's windows in which a quadratic height over the entity explains
/// more of the distances than it does of independent noise by chance in one of a thousand scans.
fn windows_off(cloud: &Cloud, of: &[u32], surface: &Primitive, noise: f64) -> Vec<u32> {
    let points = cloud.at(of);
    let distances: Vec<f64> = points.iter().map(|p| surface.distance(*p)).collect();
    let tree = KdTree::new(&points);
    let chance = (1e3 * (OVERLAP * cloud.points.len() / WINDOW_POINTS[0]).max(1) as f64).ln();
    let most = noise * noise * chi_square_bound(6.0, chance);
    let (mut off, mut window) = (Vec::new(), Vec::new());
    for size in WINDOW_POINTS {
        // The whole entity as one window tests its kind, which is done elsewhere.
        if of.len() < 2 * size {
            break;
        }
        for k in thinned(of.len(), (of.len() * OVERLAP).div_ceil(size)) {
            tree.nearest_k(points[k], size, &mut window);
            let explained = explained(&window, &points, &distances, surface.normal(points[k]));
            if explained > most {
                off.extend(window.iter().map(|w| of[w.1 as usize]));
            }
        }
    }
    off
}

/// Returns the bound that a χ² variable with `free` degrees of freedom exceeds with at most the
/// probability exp(−chance) (B. Laurent and P. Massart, Ann. Statist. 28, 2000, lemma 1).
fn chi_square_bound(free: f64, chance: f64) -> f64 {
    free + 2.0 * (free * chance).sqrt() + 2.0 * chance
}

/// Returns the decrease of the sum of squared distances in a window, whose first point is its
/// middle, by the quadratic height over the tangent plane that fits them best.
fn explained(window: &[(f64, u32)], points: &[Point3], distances: &[f64], normal: Point3) -> f64 {
    let [e, f] = frame(normal);
    let middle = points[window[0].1 as usize];
    let radius = window[window.len() - 1].0.sqrt().max(f64::MIN_POSITIVE);
    let row = |w: &(f64, u32)| {
        let d = sub(points[w.1 as usize], middle);
        let (u, v) = (dot(d, e) / radius, dot(d, f) / radius);
        (quadratic_row(u, v), distances[w.1 as usize])
    };
    let rows = window.iter().map(row);
    let all: f64 = rows.clone().map(|(_, r)| r * r).sum();
    squares_left(rows).map_or(0.0, |left| all - left)
}
