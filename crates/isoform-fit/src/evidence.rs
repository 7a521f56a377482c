//! Quantities on which a verdict is based.
//!
//! The distances of neighbouring points are compared ([`Task::shared`]): noise is independent from
//! point to point, the misfit of a wrong shape is shared. Local misfit is searched for in
//! [`places`], and the thickness of the model is measured in [`thickness`].

mod neighbours;
mod places;
mod thickness;

pub(crate) use self::places::Clusters;

use self::neighbours::{with_far, without};

use crate::by_point::ByPoint;
use crate::deviation::SampledSurface;
use crate::report::evidence::Evidence;
use crate::task::Task;
use isoform_geom::dot;

impl Task<'_> {
    /// Computes the evidence from the residuals of all points and the surface of the model;
    /// [`Task::clusters`] supplies the share of clustered outliers.
    pub(crate) fn evidence(
        &self,
        a: &[f64],
        points: &ByPoint,
        surface: &SampledSurface,
        open_parts: &[bool],
    ) -> Evidence {
        let off = with_far(&points.residuals, self.size());
        let square = off.iter().map(|r| r * r).sum::<f64>() / off.len().max(1) as f64;
        let shared = self.shared(&without(&off, &points.outliers), &points.at);
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
}

/// Returns the share of the samples without data among those of parts that are not open.
fn bare(surface: &SampledSurface, open_parts: &[bool]) -> f64 {
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
fn overlooked(surface: &SampledSurface) -> f64 {
    let bare = (0..surface.inward.len()).filter(|i| surface.bare[*i]);
    let overlooked = bare.filter(|i| is_overlooked(surface, *i)).count();
    overlooked as f64 / surface.inward.len().max(1) as f64
}

/// Returns true if most samples with similar normals have data. Normals within 37° are similar: a
/// view that shows one shows the other.
fn is_overlooked(surface: &SampledSurface, i: usize) -> bool {
    // A subset of some 400 samples is enough to compare with.
    let step = surface.inward.len().div_ceil(400).max(1);
    let faces_alike = |j: &usize| dot(surface.inward[i], surface.inward[*j]) > 0.8;
    let (mut alike, mut bare) = (0, 0);
    for j in (0..surface.inward.len()).step_by(step).filter(faces_alike) {
        alike += 1;
        bare += usize::from(surface.bare[j]);
    }
    2 * bare < alike
}
