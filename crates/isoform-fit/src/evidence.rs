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
use crate::vector::add;
use isoform_geom::{Point3, dot, sub};

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
/// not, except for those that no view of the others shows.
fn overlooked(surface: &SampledSurface) -> f64 {
    let all = 0..surface.inward.len();
    let is_seen = |i: &usize| !surface.bare[*i];
    let seen: Vec<Point3> = all
        .clone()
        .filter(is_seen)
        .map(|i| surface.inward[i])
        .collect();
    let mut view = [0.0; 3];
    seen.iter().for_each(|n| add(&mut view, n));
    let mean = dot(view, view) / seen.len().max(1) as f64;
    let is_averted =
        |i: usize| dot(surface.inward[i], view) < mean && is_beyond(surface.inward[i], &seen);
    let bare = all.filter(|i| surface.bare[*i]);
    let overlooked = bare.filter(|i| is_overlooked(surface, *i) && !is_averted(*i));
    overlooked.count() as f64 / surface.inward.len().max(1) as f64
}

/// Returns true if a plane separates a normal from all others: a view from beyond it shows none of
/// them. By Gilbert's algorithm (1966, SIAM J. Control 4:61–80): x approaches the point of their
/// convex hull that is nearest to the normal.
fn is_beyond(normal: Point3, others: &[Point3]) -> bool {
    let Some(first) = others.first() else {
        return true;
    };
    let mut x = sub(*first, normal);
    for _ in 0..32 {
        let off = others.iter().map(|p| dot(x, sub(*p, normal)));
        let (nearest, least) =
            off.enumerate().fold(
                (0, f64::INFINITY),
                |best, k| if k.1 < best.1 { k } else { best },
            );
        if least > 0.0 {
            return true;
        }
        let way = sub(sub(others[nearest], normal), x);
        let share = (-dot(x, way) / dot(way, way)).clamp(0.0, 1.0);
        x = std::array::from_fn(|k| x[k] + share * way[k]);
    }
    false
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deviation::{ModelToData, SampledSurface};

    /// A scan of a ball from above has no holes but those within what was seen.
    #[test]
    fn what_faces_away_from_all_views_is_not_overlooked() {
        let normals: Vec<[f64; 3]> = (0..4000)
            .map(|k| {
                let z = 1.0 - (f64::from(k) + 0.5) / 2000.0;
                let (r, turn) = ((1.0 - z * z).sqrt(), 2.4 * f64::from(k));
                [r * turn.cos(), r * turn.sin(), z]
            })
            // Samples lie in a box slightly larger than that of the data.
            .filter(|n| n[2] > -0.15)
            .collect();
        let share = |is_bare: &dyn Fn(&[f64; 3]) -> bool| {
            overlooked(&SampledSurface {
                points: normals.clone(),
                parts: vec![0; normals.len()],
                inward: normals.iter().map(|n| n.map(|v| -v)).collect(),
                bare: normals.iter().map(is_bare).collect(),
                summary: ModelToData::default(),
            })
        };
        assert_eq!(share(&|n| n[2] < 0.0), 0.0);
        // The cap is 0.03 of the 1.15 that the samples have in z.
        let hole = share(&|n| n[2] < 0.0 || n[2] > 0.97);
        assert!((hole - 0.03 / 1.15).abs() < 1e-3, "{hole}");
    }
}
