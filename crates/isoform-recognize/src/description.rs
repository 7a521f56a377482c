//! Description length of a cloud by surfaces: that of the distances of its points, and that of the
//! parameters of the surfaces. Of two segmentations the one with the shorter description is kept
//! (J. Rissanen 1978).
//!
//! A surface about an axis, or along a direction, that a larger one has already given has fewer
//! parameters of its own.

use crate::chart::{Primitive, PrimitiveDistances, PrimitiveKind};
use crate::cloud::Cloud;
use crate::cost::Cost;
use crate::fit::{mean, squares};
use crate::noise::MAX_EXACT_NOISE;
use crate::segment::{MIN_EVIDENCE, Segmentation};
use crate::share::MembershipWeights;
use crate::start::{Axis, centred_sphere, cylinder, start_about};
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::cmp::Reverse;

/// Minimum decrease of its length for which a description replaces another, in nats.
pub(crate) const MIN_SHORTENING: f64 = 1.0;
/// Maximum number of axes, and of directions, of larger entities that are tried.
const MAX_TRIED_AXES: usize = 6;

/// Minimum cosine between axes that may be one, and their maximum distance, in radii: small cones
/// determine theirs to some degrees.
const COAXIAL_LIMITS: (f64, f64) = (0.99, 0.05);

impl Segmentation {
    /// Returns the description length of the points: their distances, the parameters, and the cost
    /// of each entity.
    pub(crate) fn length(&self, cloud: &Cloud, noise: f64) -> f64 {
        let mut members: Vec<(&Primitive, Vec<u32>)> =
            self.surfaces.iter().zip(self.members()).collect();
        members.sort_by_key(|(_, of)| Reverse(of.len()));
        let mut given = KnownAxes::default();
        let entities = members.into_iter().map(|(surface, of)| {
            let (length, _) = given.shortest(surface, &cloud.at(&of), noise);
            given.add(surface);
            length + MIN_EVIDENCE
        });
        self.length_of(cloud, 0..cloud.points.len() as u32, noise) + entities.sum::<f64>()
    }

    /// Returns the description length of some points.
    pub(crate) fn length_of(
        &self,
        cloud: &Cloud,
        points: impl Iterator<Item = u32>,
        noise: f64,
    ) -> f64 {
        let cost = Cost::with_noise(noise);
        let distances: Vec<PrimitiveDistances<'_>> =
            self.surfaces.iter().map(Primitive::distances).collect();
        let length = |i: u32| self.length_at(cloud, &distances, i as usize, cost);
        points.map(length).sum()
    }

    /// Returns the description length of a point. It lies on the surface of one of its neighbours,
    /// and the description does not say which. Overlapping surfaces would otherwise follow noise
    /// better than one does, if each point took the nearer of them.
    fn length_at(
        &self,
        cloud: &Cloud,
        distances: &[PrimitiveDistances<'_>],
        i: usize,
        cost: Cost,
    ) -> f64 {
        let near = cloud.near(i as u32);
        let own = self.labels[i];
        let likelihood = |label: u32| match distances.get(label as usize) {
            None => (-cost.most).exp(),
            Some(of) => (-cost.of_distance(of.at(cloud.points[i]))).exp(),
        };
        let (mut sum, mut last) = (likelihood(own), (own, likelihood(own)));
        for j in near {
            let label = self.labels[*j as usize];
            if label != last.0 {
                last = (label, likelihood(label));
            }
            sum += last.1;
        }
        let mean = sum / (near.len() + 1) as f64;
        cost.most.min(-mean.ln())
    }

    /// Replaces surfaces by ones with the axes and directions of larger entities if that shortens
    /// the description: free surfaces of small faces turn into the noise.
    pub(crate) fn tied(
        &self,
        cloud: &Cloud,
        mut surfaces: Vec<Option<Primitive>>,
        shares: &[MembershipWeights],
    ) -> Vec<Option<Primitive>> {
        if self.is_form || self.noise < MAX_EXACT_NOISE || self.is_free {
            return surfaces;
        }
        let mut order: Vec<usize> = (0..surfaces.len()).collect();
        order.sort_by_key(|k| (Reverse(shares[*k].len()), *k));
        let mut given = KnownAxes::default();
        for k in order {
            let own = shares[k].iter().filter(|s| s.1 > 0.5);
            let points: Vec<Point3> = own.map(|s| cloud.points[s.0 as usize]).collect();
            if let Some(surface) = &mut surfaces[k] {
                *surface = given.shortest(surface, &points, self.noise).1;
                given.add(surface);
            }
        }
        surfaces
    }

    /// Returns the kinds with fewer parameters of their own: a cone about a known axis has two, a
    /// torus three, a sphere four.
    pub(crate) fn simpler_kinds(&self, surface: &Primitive) -> Vec<PrimitiveKind> {
        let mut kinds = surface.kind.simpler().to_vec();
        if self.is_coaxial(surface) {
            kinds.retain(|kind| *kind != PrimitiveKind::Sphere);
        }
        kinds
    }

    /// Returns true if a surface nearly shares its axis with another one.
    fn is_coaxial(&self, surface: &Primitive) -> bool {
        let is_about = |other: &Primitive| {
            let d = sub(surface.place, other.place);
            let off = norm(cross(d, other.axis));
            let is_along = dot(surface.axis, other.axis).abs() > COAXIAL_LIMITS.0;
            other != surface && is_along && off < COAXIAL_LIMITS.1 * surface.size.abs()
        };
        let mut round = self.surfaces.iter().filter(|s| s.is_round());
        surface.is_round() && round.any(is_about)
    }
}

/// Axes and directions of the entities that were described so far.
#[derive(Default)]
struct KnownAxes {
    axes: Vec<Axis>,
    directions: Vec<Point3>,
}

impl KnownAxes {
    /// Returns the minimum cost of describing a surface through points with the standard deviation
    /// `noise`, and the surface that attains it. Each parameter of its own costs half the logarithm
    /// of the number of points; a surface that keeps to a given axis or direction also pays for the
    /// increase of its distances.
    fn shortest(&self, surface: &Primitive, points: &[Point3], noise: f64) -> (f64, Primitive) {
        let each = (points.len().max(1) as f64).ln() / 2.0;
        let free = squares(surface, points);
        let cost = |numbers: usize, squares: f64| {
            numbers as f64 * each + (squares - free) / (2.0 * noise * noise)
        };
        let alone = (cost(surface.kind.parameters(), free), *surface);
        let of =
            |(numbers, tied): (usize, Primitive)| (cost(numbers, squares(&tied, points)), tied);
        let shorter = |a: (f64, Primitive), b: (f64, Primitive)| if b.0 < a.0 { b } else { a };
        self.tied(surface, points).map(of).fold(alone, shorter)
    }

    /// Returns the surfaces of this kind through points about the given axes and along the given
    /// directions, each with its number of own parameters.
    fn tied<'a>(
        &'a self,
        surface: &'a Primitive,
        points: &'a [Point3],
    ) -> impl Iterator<Item = (usize, Primitive)> + 'a {
        // Directions within 11° may be one: short faces in noise determine theirs to some degrees.
        let is_along = |d: &Point3| dot(*d, surface.axis).abs() > 0.98;
        let about = move |axis: &Axis| match surface.kind {
            PrimitiveKind::Plane => None,
            PrimitiveKind::Sphere => centred_sphere(points, *axis).map(|s| (2, s)),
            kind => start_about(kind, points, *axis).map(|s| (kind.parameters() - 4, s)),
        };
        let along = move |direction: &Point3| match surface.kind {
            PrimitiveKind::Plane => Some((
                1,
                Primitive {
                    place: mean(points),
                    axis: *direction,
                    ..*surface
                },
            )),
            PrimitiveKind::Cylinder => cylinder(points, *direction).map(|s| (3, s)),
            _ => None,
        };
        let is_sphere = surface.kind == PrimitiveKind::Sphere;
        let axes = self
            .axes
            .iter()
            .filter(move |a| is_sphere || is_along(&a.1));
        let directions = self.directions.iter().filter(move |d| is_along(d));
        axes.filter_map(about).chain(directions.filter_map(along))
    }

    /// Adds the axis and the direction of a surface, up to the maximum number.
    fn add(&mut self, surface: &Primitive) {
        if surface.kind == PrimitiveKind::Sphere {
            return;
        }
        if self.directions.len() < MAX_TRIED_AXES {
            self.directions.push(surface.axis);
        }
        if surface.is_round() && self.axes.len() < MAX_TRIED_AXES {
            self.axes.push((surface.place, surface.axis));
        }
    }
}
