//! Quantities on which a verdict is based.
//!
//! The distances of neighbouring points are compared ([`Task::shared`]): noise is independent from
//! point to point, the misfit of a wrong shape is shared. Local misfit is searched for in
//! [`places`], and the thickness of the model is measured in [`thickness`].

mod places;
mod thickness;

pub(crate) use self::places::{Clusters, FAR};

use crate::deviation::Surface;
use crate::report::ByPoint;
use crate::task::Task;
use isoform_geom::{KdTree, Point3, dot};

/// Points whose neighbours are asked whether they are off alike.
const PROBES: usize = 3000;
/// Points among which neighbours are looked for.
pub(crate) const DENSEST: usize = 20_000;
/// Neighbours of each: few, so that misfit of small extent shows.
const NEIGHBOURS: usize = 4;
/// Samples that each bare one is compared with.
const COMPARED: usize = 400;
/// Cosine of the angle within which normals face the same way: 37 degrees, so that a view that sees
/// one sees the other.
const SAME_WAY: f64 = 0.8;

/// Quantities on which a verdict is based; lengths in the units of the scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Diagonal of the data's box.
    pub size: f64,
    /// Root mean square distance of all points, outliers included.
    pub rms_of_all: f64,
    /// Root mean square of the misfit that neighbouring points share, outliers left out: misfit of
    /// shape rather than noise.
    pub systematic: f64,
    /// Significance of the shared misfit, in standard deviations of what independent residuals
    /// show.
    pub systematic_z: f64,
    /// Standard deviation of points from planes through their neighbours: noise, and curvature at
    /// the density of the points.
    pub local_noise: f64,
    /// Thickness of the model's thinnest wall.
    pub thickness: f64,
    /// The smallest thickness of walls and width of gaps.
    pub detail: f64,
    /// Share of the model's surface without data, open parts left out.
    pub bare: f64,
    /// Share of the model's surface, open parts included, without data although most of the surface
    /// with similar normals has data.
    pub overlooked: f64,
    /// Share of the outliers that lie on a surface of their own.
    pub clustered: f64,
}

/// Covariance of the residuals of neighbours.
struct Shared {
    /// Mean product of the residuals of neighbours.
    product: f64,
    /// The mean product in standard deviations of what independent residuals show.
    z: f64,
}

impl Task<'_> {
    /// Computes the evidence from the residuals of all points and the surface of the model;
    /// [`Task::clusters`] supplies the share of clustered outliers.
    pub(crate) fn evidence(
        &self,
        a: &[f64],
        points: &ByPoint,
        surface: &Surface,
        open_parts: &[bool],
    ) -> Evidence {
        let off = finite(&points.residuals, self.size());
        let square = off.iter().map(|r| r * r).sum::<f64>() / off.len().max(1) as f64;
        let shared = self.shared(&but(&off, &points.outliers), &points.at);
        let (thickness, gap) = match self.template.distance() {
            Some(distance) => self.thicknesses(distance, a, surface),
            None => (f64::INFINITY, f64::INFINITY),
        };
        Evidence {
            size: self.size(),
            rms_of_all: square.sqrt(),
            systematic: shared.product.max(0.0).sqrt(),
            systematic_z: shared.z,
            local_noise: self.scan.local_noise,
            thickness,
            detail: thickness.min(gap),
            bare: bare(surface, open_parts),
            overlooked: overlooked(surface),
            clustered: 0.0,
        }
    }

    /// Returns the covariance of the residuals of neighbouring foot points.
    fn shared(&self, r: &[f64], at: &[Point3]) -> Shared {
        let first = self.order.iter().take(DENSEST);
        let chosen: Vec<usize> = first.map(|&i| i as usize).collect();
        let places: Vec<Point3> = chosen.iter().map(|&i| at[i]).collect();
        let r: Vec<f64> = chosen.iter().map(|&i| r[i]).collect();
        let Products { sum, count } = products(&r, &places);
        let squares: f64 = r.iter().take(PROBES).fold(0.0, |sum, r| sum + r * r);
        let product = sum / count.max(1.0);
        let variance = squares / self.order.len().clamp(1, PROBES) as f64;
        // Neighbours are mostly mutual: pairs count half.
        let deviation = variance / (0.5 * count).max(1.0).sqrt();
        Shared {
            product,
            z: product / deviation.max(f64::MIN_POSITIVE),
        }
    }
}

/// Sum of products of residuals of neighbours, and the number of products.
struct Products {
    sum: f64,
    count: f64,
}

/// Sums the products of the first residuals with those of their neighbours among all points.
fn products(r: &[f64], places: &[Point3]) -> Products {
    let tree = KdTree::new(places);
    let mut found = Vec::new();
    let mut out = Products {
        sum: 0.0,
        count: 0.0,
    };
    for (k, place) in places.iter().enumerate().take(PROBES) {
        tree.nearest_k(*place, NEIGHBOURS + 1, &mut found);
        for j in found.iter().map(|f| f.1 as usize).filter(|j| *j != k) {
            out.sum += r[k] * r[j];
            out.count += 1.0;
        }
    }
    out
}

/// Replaces residuals that are not finite by `far`.
fn finite(residuals: &[f64], far: f64) -> Vec<f64> {
    let off = |r: &f64| if r.is_finite() { *r } else { far };
    residuals.iter().map(off).collect()
}

/// Replaces the residuals of points left out by zero.
fn but(residuals: &[f64], left_out: &[bool]) -> Vec<f64> {
    let all = residuals.iter().zip(left_out);
    all.map(|(r, out)| if *out { 0.0 } else { *r }).collect()
}

/// Returns the share of the samples without data among those of parts that are not open.
fn bare(surface: &Surface, open_parts: &[bool]) -> f64 {
    let is_kept = |part: &u32| open_parts.get(*part as usize) != Some(&true);
    let samples = surface.parts.iter().zip(&surface.bare);
    let kept: Vec<bool> = samples
        .filter(|(part, _)| is_kept(part))
        .map(|(_, bare)| *bare)
        .collect();
    kept.iter().filter(|bare| **bare).count() as f64 / kept.len().max(1) as f64
}

/// Returns the share of the samples that are bare although most samples with similar normals are
/// not.
fn overlooked(surface: &Surface) -> f64 {
    let bare = (0..surface.inward.len()).filter(|i| surface.bare[*i]);
    let overlooked = bare.filter(|i| is_overlooked(surface, *i)).count();
    overlooked as f64 / surface.inward.len().max(1) as f64
}

/// Returns true if most samples with similar normals have data. Normals within 37° are similar: a
/// view that shows one shows the other.
fn is_overlooked(surface: &Surface, i: usize) -> bool {
    let step = surface.inward.len().div_ceil(COMPARED).max(1);
    let faces_alike = |j: &usize| dot(surface.inward[i], surface.inward[*j]) > SAME_WAY;
    let (mut alike, mut bare) = (0, 0);
    for j in (0..surface.inward.len()).step_by(step).filter(faces_alike) {
        alike += 1;
        bare += usize::from(surface.bare[j]);
    }
    2 * bare < alike
}
