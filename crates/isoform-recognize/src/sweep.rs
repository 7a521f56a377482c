//! Swept faces, found together in their plane section: bodies of revolution and extrusions.

use crate::chart::{Primitive, PrimitiveKind, frame};
use crate::cloud::Cloud;
use crate::description::MIN_SHORTENING;
use crate::fit::{Precision, fit};
use crate::labels::UNLABELLED;
use crate::noise::{EXPLAINED_DEVIATIONS, MAX_EXACT_NOISE};
use crate::profile::{CurveFamily, PlanePoint, Price, ProfileCurve, pieces};
use crate::segment::{Limits, MIN_EVIDENCE, NOISE_SLACK, Segmentation, directions};
use crate::start::Axis;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, cross, dot, norm, sub};
use rayon::prelude::*;

/// Sections of surfaces about an axis, by a half plane through it.
const SECTIONS_ABOUT_AXIS: [(CurveFamily, PrimitiveKind); 5] = [
    (CurveFamily::Across, PrimitiveKind::Plane),
    (CurveFamily::Along, PrimitiveKind::Cylinder),
    (CurveFamily::Line, PrimitiveKind::Cone),
    (CurveFamily::Centred, PrimitiveKind::Sphere),
    (CurveFamily::Circle, PrimitiveKind::Torus),
];
/// Sections of surfaces along a direction, by a plane across it.
const SECTIONS_ALONG_DIRECTION: [(CurveFamily, PrimitiveKind); 2] = [
    (CurveFamily::Line, PrimitiveKind::Plane),
    (CurveFamily::Circle, PrimitiveKind::Cylinder),
];
/// Maximum number of axes, and of directions, that are tried, those with most points first.
const MAX_SWEEP_AXES: usize = 4;

/// A continuous motion that leaves surfaces invariant.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Sweep {
    /// Rotations about an axis.
    About(Axis),
    /// Translations along a unit direction.
    Along(Point3),
}

impl Sweep {
    fn shapes(&self) -> &'static [(CurveFamily, PrimitiveKind)] {
        match self {
            Self::About(_) => &SECTIONS_ABOUT_AXIS,
            Self::Along(_) => &SECTIONS_ALONG_DIRECTION,
        }
    }

    /// Returns the point of the section that the motion carries a point to.
    pub(crate) fn section(&self, p: Point3) -> PlanePoint {
        match self {
            Self::About((place, axis)) => {
                let d = sub(p, *place);
                [dot(d, *axis), norm(cross(d, *axis))]
            }
            Self::Along(direction) => frame(*direction).map(|e| dot(p, e)),
        }
    }

    /// Returns true if a surface through a point with this normal may be invariant.
    fn keeps(&self, p: Point3, normal: Point3) -> bool {
        let motion = match self {
            Self::About((place, axis)) => cross(*axis, sub(p, *place)),
            Self::Along(direction) => *direction,
        };
        // A larger bound lets normals of other entities in, a smaller one keeps those near edges
        // out.
        dot(motion, normal).abs() <= 0.35 * norm(motion)
    }

    /// Returns the surface of which a piece is the section.
    pub(crate) fn surface(&self, kind: PrimitiveKind, curve: &ProfileCurve) -> Option<Primitive> {
        let (place, axis, size, other) = match self {
            Self::About((place, axis)) => {
                let at = |h: f64| std::array::from_fn(|k| place[k] + h * axis[k]);
                match *curve {
                    ProfileCurve::Line([h, r], [along, away]) => match kind {
                        PrimitiveKind::Plane => (at(h), *axis, 0.0, 0.0),
                        PrimitiveKind::Cone => (at(h), *axis, r, (away / along).atan()),
                        _ => (at(h), *axis, r, 0.0),
                    },
                    ProfileCurve::Circle([h, r], radius) => match kind {
                        PrimitiveKind::Torus => (at(h), *axis, r, radius),
                        _ => (at(h), *axis, radius, 0.0),
                    },
                }
            }
            Self::Along(direction) => {
                let [e, f] = frame(*direction);
                let at = |[u, v]: PlanePoint| std::array::from_fn(|k| u * e[k] + v * f[k]);
                match *curve {
                    ProfileCurve::Line(place, [a, b]) => (at(place), at([-b, a]), 0.0, 0.0),
                    ProfileCurve::Circle(center, radius) => (at(center), *direction, radius, 0.0),
                }
            }
        };
        let surface = Primitive {
            kind,
            place,
            axis,
            size,
            other,
        };
        surface.is_proper().then_some(surface)
    }
}

/// Returns the direction or its opposite, by a rule that rounding does not affect: cells of a
/// section begin at its origin, and their contents depend on the sense.
fn upright(direction: Point3) -> Point3 {
    let sum = direction[0] + 0.7 * direction[1] + 0.4 * direction[2];
    match sum > 0.0 {
        true => direction.map(|x| -x),
        false => direction,
    }
}

impl Segmentation {
    /// Replaces the surfaces about each axis and along each direction by those found in their
    /// section, if that shortens the description; it acts once. Entities that do not follow their
    /// points are removed.
    pub(crate) fn sweep(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        if self.is_form || std::mem::replace(&mut self.is_swept, true) {
            return Ok(());
        }
        if self.noise >= MAX_EXACT_NOISE {
            self.try_sweeps(cloud, limits, control)?;
        }
        self.is_finished = !self.dissolve(cloud);
        Ok(())
    }

    fn try_sweeps(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let noise = self.noise;
        let length = |s: &Self| s.length(cloud, noise);
        let (mut least, mut is_new) = (length(self), false);
        let sweeps = self.sweeps();
        let mut next = 0;
        loop {
            // In parallel: the first that shortens the description is taken, and those after it are
            // tried again.
            let shorter = |k: usize| {
                if control.is_stopped() {
                    return None;
                }
                let other = self.cut(cloud, limits, &sweeps[k])?;
                let found = length(&other);
                (found + MIN_SHORTENING < least).then_some((k, other, found))
            };
            let first = (next..sweeps.len()).into_par_iter().find_map_first(shorter);
            control.check()?;
            let Some((k, other, found)) = first else {
                break;
            };
            (*self, least, is_new, next) = (other, found, true, k + 1);
        }
        if is_new {
            let mut settled = self.clone();
            settled.add_regions(cloud, NOISE_SLACK, limits, control)?;
            settled.settle(cloud, limits);
            if length(&settled) < least {
                *self = settled;
            }
        }
        Ok(())
    }

    /// Returns the distinct axes of round surfaces and directions of all, those with most points
    /// first.
    pub(crate) fn sweeps(&self) -> Vec<Sweep> {
        let members = self.members();
        let mut sorted: Vec<(usize, &Primitive)> =
            members.iter().map(Vec::len).zip(&self.surfaces).collect();
        sorted.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        let sorted: Vec<Primitive> = sorted.into_iter().map(|(_, s)| *s).collect();
        let mut axes: Vec<Axis> = Vec::new();
        for surface in sorted.iter().filter(|s| s.is_round()) {
            let is_one = |(place, axis): &Axis| {
                let off = norm(cross(sub(surface.place, *place), *axis));
                // Axes of this cosine and less than six deviations apart are one.
                dot(surface.axis, *axis).abs() > 0.999 && off < 6.0 * self.noise
            };
            if !axes.iter().any(is_one) {
                axes.push((surface.place, upright(surface.axis)));
            }
        }
        let along = directions(&sorted);
        let along = along
            .into_iter()
            .take(MAX_SWEEP_AXES)
            .map(|d| Sweep::Along(upright(d)));
        axes.into_iter()
            .take(MAX_SWEEP_AXES)
            .map(Sweep::About)
            .chain(along)
            .collect()
    }

    /// Replaces the surfaces that a motion may leave invariant by the pieces of a section; `None`
    /// if the section alone describes its points no shorter.
    fn cut(&self, cloud: &Cloud, limits: Limits, sweep: &Sweep) -> Option<Self> {
        let (of, entities) = self.kept_by(cloud, sweep);
        let section: Vec<PlanePoint> = of
            .iter()
            .map(|i| sweep.section(cloud.points[*i as usize]))
            .collect();
        let is_proper =
            |kind: PrimitiveKind, curve: &ProfileCurve| sweep.surface(kind, curve).is_some();
        let price = Price::new(self.noise, sweep.shapes(), &is_proper);
        let (pieces, length) = pieces(&section, &price);
        if length > entities + self.length_of(cloud, of.iter().copied(), self.noise) {
            return None;
        }
        let mut other = self.clone();
        other.is_free = false;
        of.iter()
            .for_each(|i| other.labels[*i as usize] = UNLABELLED);
        for piece in pieces {
            let Some(surface) = sweep.surface(piece.kind, &piece.curve) else {
                continue;
            };
            let distances = surface.distances();
            let is_near = |i: &u32| {
                distances.at(cloud.points[*i as usize]).abs() <= EXPLAINED_DEVIATIONS * self.noise
            };
            let own = piece.points.iter().map(|k| of[*k as usize]);
            let own: Vec<u32> = own.filter(is_near).collect();
            // Rounding in sums over a section is far above that of a fit in space.
            let fitted = fit(&surface, &cloud.at(&own), Precision::Full);
            let label = other.surfaces.len() as u32;
            own.iter().for_each(|i| other.labels[*i as usize] = label);
            other.surfaces.push(fitted.map_or(surface, |f| f.0));
        }
        other.drop_empty();
        other.relax(cloud, limits);
        Some(other)
    }

    /// Returns the points on entities that a motion may leave invariant and those without an
    /// entity, and the cost of describing these entities.
    fn kept_by(&self, cloud: &Cloud, sweep: &Sweep) -> (Vec<u32>, f64) {
        let keeps = |i: &u32| sweep.keeps(cloud.points[*i as usize], cloud.normals[*i as usize]);
        let is_kept =
            |of: &Vec<u32>| of.iter().filter(|i| keeps(i)).count() as f64 >= 0.8 * of.len() as f64;
        let members = self.members();
        let are_kept: Vec<bool> = members.iter().map(is_kept).collect();
        let cost = |(surface, of): (&Primitive, &Vec<u32>)| {
            MIN_EVIDENCE + surface.kind.parameters() as f64 * (of.len() as f64).ln() / 2.0
        };
        let costs = self.surfaces.iter().zip(&members).map(cost);
        let entities = costs.zip(&are_kept).filter(|(_, is_kept)| **is_kept);
        let entities = entities.map(|(cost, _)| cost).sum();
        let all = 0..self.labels.len() as u32;
        let kept = all.filter(|i| {
            let label = self.labels[*i as usize];
            let is_open = || label == UNLABELLED && keeps(i);
            are_kept
                .get(label as usize)
                .copied()
                .unwrap_or_else(is_open)
        });
        (kept.collect(), entities)
    }
}
