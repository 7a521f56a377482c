//! Faces that one motion sweeps, found together in their section: bodies of revolution, extrusions.

use crate::chart::{Kind, Surface, frame};
use crate::choose::EXACT;
use crate::cloud::Cloud;
use crate::grow::WITHIN;
use crate::profile::{Curve, Place, Shape, pieces};
use crate::segment::{Limits, NONE, SLACK, Segmentation, directions};
use crate::start::Line;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, cross, dot, norm, sub};

/// The sections of surfaces about an axis, by a half plane through it.
const ROUND: [(Shape, Kind); 5] = [
    (Shape::Across, Kind::Plane),
    (Shape::Along, Kind::Cylinder),
    (Shape::Line, Kind::Cone),
    (Shape::Centred, Kind::Sphere),
    (Shape::Circle, Kind::Torus),
];
/// The sections of surfaces along a direction, by a plane across it.
const STRAIGHT: [(Shape, Kind); 2] = [(Shape::Line, Kind::Plane), (Shape::Circle, Kind::Cylinder)];
/// Axes and directions at most that are tried, those with most points first.
const MOST: usize = 4;
/// Axes are one up to this cosine, and this many deviations apart.
const PARALLEL: f64 = 0.999;
const APART: f64 = 6.0;
/// The cosine between a normal and the motion at most; more lets normals of others in, less keeps
/// those near edges out.
const ACROSS: f64 = 0.35;
/// The share of the points of an entity that have such normals.
const MOSTLY: f64 = 0.8;
/// By how much a description has to be shorter to take the place of another.
const GAIN: f64 = 1.0;

/// A motion that leaves surfaces as they are.
#[derive(Clone, Copy, Debug)]
enum Sweep {
    /// Turns about an axis.
    About(Line),
    /// Moves along a unit direction.
    Along(Point3),
}

impl Sweep {
    fn shapes(&self) -> &'static [(Shape, Kind)] {
        match self {
            Self::About(_) => &ROUND,
            Self::Along(_) => &STRAIGHT,
        }
    }

    /// Where the motion takes a point through its section.
    fn section(&self, p: Point3) -> Place {
        match self {
            Self::About((place, axis)) => {
                let d = sub(p, *place);
                [dot(d, *axis), norm(cross(d, *axis))]
            }
            Self::Along(direction) => frame(*direction).map(|e| dot(p, e)),
        }
    }

    /// Whether a surface through a point with this normal may stay where it is.
    fn keeps(&self, p: Point3, normal: Point3) -> bool {
        let motion = match self {
            Self::About((place, axis)) => cross(*axis, sub(p, *place)),
            Self::Along(direction) => *direction,
        };
        dot(motion, normal).abs() <= ACROSS * norm(motion)
    }

    /// The surface of which a piece is the section.
    fn surface(&self, kind: Kind, curve: &Curve) -> Option<Surface> {
        let (place, axis, size, other) = match self {
            Self::About((place, axis)) => {
                let at = |h: f64| std::array::from_fn(|k| place[k] + h * axis[k]);
                match *curve {
                    Curve::Line([h, r], [along, away]) => match kind {
                        Kind::Plane => (at(h), *axis, 0.0, 0.0),
                        Kind::Cone => (at(h), *axis, r, (away / along).atan()),
                        _ => (at(h), *axis, r, 0.0),
                    },
                    Curve::Circle([h, r], radius) => match kind {
                        Kind::Torus => (at(h), *axis, r, radius),
                        _ => (at(h), *axis, radius, 0.0),
                    },
                }
            }
            Self::Along(direction) => {
                let [e, f] = frame(*direction);
                let at = |[u, v]: Place| std::array::from_fn(|k| u * e[k] + v * f[k]);
                match *curve {
                    Curve::Line(place, [a, b]) => (at(place), at([-b, a]), 0.0, 0.0),
                    Curve::Circle(center, radius) => (at(center), *direction, radius, 0.0),
                }
            }
        };
        let surface = Surface {
            kind,
            place,
            axis,
            size,
            other,
        };
        surface.is_proper().then_some(surface)
    }
}

impl Segmentation {
    /// Finds the surfaces about each axis and along each direction anew from their section, where
    /// that describes the points in less.
    pub(crate) fn sweep(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        if self.is_form || self.noise < EXACT {
            return Ok(());
        }
        for sweep in self.sweeps() {
            control.check()?;
            let other = self.swept(cloud, limits, sweep, control)?;
            let [one, two] = [&*self, &other].map(|s| s.length(cloud, self.noise));
            if std::env::var("DBG").is_ok() {
                eprintln!("{sweep:.2?}: {one} -> {two}");
            }
            if two + GAIN < one {
                *self = other;
            }
        }
        Ok(())
    }

    /// The axes of round surfaces and the directions of all, each once, those with most points
    /// first.
    fn sweeps(&self) -> Vec<Sweep> {
        let members = self.members();
        let mut sorted: Vec<(usize, &Surface)> =
            members.iter().map(Vec::len).zip(&self.surfaces).collect();
        sorted.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        let sorted: Vec<Surface> = sorted.into_iter().map(|(_, s)| *s).collect();
        let mut axes: Vec<Line> = Vec::new();
        for surface in sorted.iter().filter(|s| s.is_round()) {
            let is_one = |(place, axis): &Line| {
                let off = norm(cross(sub(surface.place, *place), *axis));
                dot(surface.axis, *axis).abs() > PARALLEL && off < APART * self.noise
            };
            if !axes.iter().any(is_one) {
                axes.push((surface.place, surface.axis));
            }
        }
        let along = directions(&sorted);
        let along = along.into_iter().take(MOST).map(Sweep::Along);
        axes.into_iter().take(MOST).map(Sweep::About).chain(along).collect()
    }

    /// With the surfaces of a section in the place of those that a motion may leave as they are.
    fn swept(
        &self,
        cloud: &Cloud,
        limits: Limits,
        sweep: Sweep,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut other = self.clone();
        other.is_free = false;
        let of = self.kept_by(cloud, &sweep);
        of.iter().for_each(|i| other.labels[*i as usize] = NONE);
        let section: Vec<Place> = of
            .iter()
            .map(|i| sweep.section(cloud.points[*i as usize]))
            .collect();
        let is_proper = |kind: Kind, curve: &Curve| sweep.surface(kind, curve).is_some();
        for piece in pieces(&section, self.noise, sweep.shapes(), &is_proper) {
            let Some(surface) = sweep.surface(piece.kind, &piece.curve) else {
                continue;
            };
            if std::env::var("DBG").is_ok_and(|x| x == "2") {
                eprintln!("  {:?} {:?} {}", piece.kind, piece.curve, piece.points.len());
            }
            let label = other.surfaces.len() as u32;
            let distances = surface.distances();
            for k in piece.points {
                let i = of[k as usize] as usize;
                if distances.at(cloud.points[i]).abs() <= WITHIN * self.noise {
                    other.labels[i] = label;
                }
            }
            other.surfaces.push(surface);
        }
        other.drop_empty();
        other.relax(cloud, limits);
        let length = |s: &Self| s.length(cloud, self.noise);
        if std::env::var("DBG").is_ok() {
            for (s, of) in other.surfaces.iter().zip(other.members()) { eprint!("[{:?} {}] ", s.kind, of.len()); }
            eprintln!("relaxed {}", length(&other));
        }
        if length(&other) + GAIN >= length(self) {
            return Ok(other);
        }
        let mut settled = other.clone();
        settled.add_regions(cloud, SLACK, limits, control)?;
        settled.settle(cloud, limits);
        if std::env::var("DBG").is_ok() {
            for (s, of) in settled.surfaces.iter().zip(settled.members()) { eprint!("[{:?} {}] ", s.kind, of.len()); }
            eprintln!("settled {}", length(&settled));
        }
        Ok(if length(&settled) < length(&other) { settled } else { other })
    }

    /// The points on entities that a motion may leave as they are, and those without an entity.
    fn kept_by(&self, cloud: &Cloud, sweep: &Sweep) -> Vec<u32> {
        let keeps = |i: &u32| sweep.keeps(cloud.points[*i as usize], cloud.normals[*i as usize]);
        let is_kept = |of: &Vec<u32>| {
            of.iter().filter(|i| keeps(i)).count() as f64 >= MOSTLY * of.len() as f64
        };
        let are_kept: Vec<bool> = self.members().iter().map(is_kept).collect();
        let all = 0..self.labels.len() as u32;
        all.filter(|i| {
            let label = self.labels[*i as usize];
            let is_open = || label == NONE && keeps(i);
            are_kept.get(label as usize).copied().unwrap_or_else(is_open)
        })
        .collect()
    }

    /// Drops surfaces without points.
    fn drop_empty(&mut self) {
        let kept: Vec<Option<Surface>> = (self.members().iter())
            .zip(&self.surfaces)
            .map(|(of, surface)| (!of.is_empty()).then_some(*surface))
            .collect();
        self.keep(&kept);
    }
}
