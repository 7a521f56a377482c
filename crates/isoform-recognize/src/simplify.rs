//! Simplification: curved surfaces that reach over edges are replaced by simpler ones together with
//! what the remaining points show.
//!
//! In large noise a plane with a strip of the adjacent face is a sphere, and follows its points.
//! That is revealed only if the points beyond the plane have a surface of their own.

use crate::chart::{Primitive, PrimitiveKind};
use crate::choose::{KnownSurfaces, Noise, follows, least_points};
use crate::cloud::Cloud;
use crate::description::MIN_SHORTENING;
use crate::grow::trimmed;
use crate::kinds::{coaxial_cone, guess, zone};
use crate::labels::UNLABELLED;
use crate::segment::{Limits, NOISE_SLACK, Segmentation, directions};
use crate::share::shares;
use crate::start::Axis;
use isoform_control::{Control, Stopped};
use isoform_geom::dot;
use rayon::prelude::*;

/// Minimum cosine between the axis of a zone and one that others have: 8°.
pub(crate) const ZONE_COSINE: f64 = 0.99;

impl Segmentation {
    /// Replaces curved surfaces by simpler ones and by what is found next to these, if that
    /// shortens the description.
    pub(crate) fn simplify(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let noise = self.deviation(NOISE_SLACK);
        // Surfaces found next to bent ones that were given up may be bent, too.
        for _ in 0..3 {
            let members = self.members();
            let simpler: Vec<Option<(Primitive, Vec<u32>)>> = (members.par_iter())
                .zip(&self.surfaces)
                .map(|(of, surface)| simpler(cloud, of, &self.simpler_kinds(surface), noise))
                .collect();
            // If most could be simpler they are patches of a free form, and replacing them would
            // not end.
            let count = simpler.iter().flatten().count();
            if count == 0 || 2 * count > simpler.len() {
                break;
            }
            let found = (0..).zip(simpler).filter_map(|(label, found)| {
                let (surface, kept) = found?;
                Some((label, surface, kept))
            });
            let Some(other) = self.given_up(cloud, limits, found.collect(), control)? else {
                break;
            };
            *self = other;
        }
        Ok(())
    }

    /// Replaces some surfaces by simpler ones, each with its points, and adds what is found among
    /// the points that these give up; `None` if the description does not become shorter.
    fn given_up(
        &self,
        cloud: &Cloud,
        limits: Limits,
        simpler: Vec<(usize, Primitive, Vec<u32>)>,
        control: &Control<'_>,
    ) -> Result<Option<Self>, Stopped> {
        let mut other = self.clone();
        for (label, surface, kept) in simpler {
            let of = other.labels.iter_mut().filter(|l| **l == label as u32);
            of.for_each(|l| *l = UNLABELLED);
            kept.iter()
                .for_each(|i| other.labels[*i as usize] = label as u32);
            other.surfaces[label] = surface;
        }
        other.add_regions(cloud, NOISE_SLACK, limits, control)?;
        other.settle(cloud, limits);
        let is_shorter =
            other.length(cloud, self.noise) + MIN_SHORTENING < self.length(cloud, self.noise);
        Ok(is_shorter.then_some(other))
    }

    /// Turns spheres into cones about the axis of an adjacent entity, mostly chamfers, if that
    /// shortens the description: a cone about a known axis has two parameters of its own, a sphere
    /// four.
    pub(crate) fn turn_into_coaxial(&mut self, cloud: &Cloud, limits: Limits) {
        for label in 0..self.surfaces.len() {
            if self.surfaces[label].kind != PrimitiveKind::Sphere {
                continue;
            }
            let of = self.members_of(label);
            let points = cloud.at(&of);
            let Some(cone) = coaxial_cone(&points, &self.axes_beside(cloud, &of)) else {
                continue;
            };
            let mut other = self.clone();
            other.surfaces[label] = cone;
            other.relax(cloud, limits);
            // The direction and the place of an axis that is known.
            let saved = 4.0 * (points.len().max(1) as f64).ln() / 2.0;
            let is_whole = other.surfaces.len() == self.surfaces.len();
            let length = |s: &Self| s.length(cloud, self.noise);
            if is_whole && length(&other) - saved < length(self) {
                *self = other;
            }
        }
    }

    /// Turns spheres of which only a narrow zone is present, about an axis that others have, into
    /// cones or cylinders that fit as well: chamfers and short bores.
    pub(crate) fn turn_zones(&mut self, cloud: &Cloud) {
        let noise = self.deviation(NOISE_SLACK);
        let known = directions(&self.surfaces);
        let shares = shares(cloud, &self.surfaces, &self.labels, self.noise);
        for (surface, of) in self.surfaces.iter_mut().zip(&shares) {
            if surface.kind != PrimitiveKind::Sphere {
                continue;
            }
            let other = zone(cloud, of, surface, noise);
            let is_along =
                |s: &Primitive| known.iter().any(|d| dot(*d, s.axis).abs() > ZONE_COSINE);
            if let Some(other) = other.filter(is_along) {
                *surface = other;
            }
        }
    }

    /// Returns the axes of the entities adjacent to some points.
    fn axes_beside(&self, cloud: &Cloud, points: &[u32]) -> Vec<Axis> {
        let beside: Vec<u32> = points
            .iter()
            .flat_map(|i| cloud.near(*i))
            .copied()
            .collect();
        let known = KnownSurfaces {
            surfaces: &self.surfaces,
            labels: &self.labels,
        };
        known.axes(&beside)
    }
}

/// Returns a simpler surface through most of the points of an entity, and these points.
fn simpler(
    cloud: &Cloud,
    members: &[u32],
    kinds: &[PrimitiveKind],
    noise: Noise,
) -> Option<(Primitive, Vec<u32>)> {
    let of = |kind: &PrimitiveKind| {
        let start = guess(cloud, members, *kind)?;
        let (surface, kept) = trimmed(cloud, members, &start, noise.deviation);
        let is_most = kept.len() as f64 >= 0.6 * members.len() as f64;
        let is_enough = kept.len() >= least_points(*kind, noise.deviation);
        let is_good = is_most && is_enough && follows(cloud, [&kept; 2], &surface, noise);
        is_good.then_some((surface, kept))
    };
    kinds.iter().find_map(of)
}
