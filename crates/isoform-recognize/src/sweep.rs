//! Bodies of revolution, whose surfaces are found together in their profile.

use crate::chart::{Kind, Surface};
use crate::choose::EXACT;
use crate::cloud::Cloud;
use crate::grow::WITHIN;
use crate::profile::{Curve, Piece, Place, Shape, pieces};
use crate::segment::{Limits, NONE, SLACK, Segmentation};
use crate::start::Line;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, cross, dot, norm, sub};

/// The sections of surfaces about an axis.
const SHAPES: [(Shape, Kind); 5] = [
    (Shape::Across, Kind::Plane),
    (Shape::Along, Kind::Cylinder),
    (Shape::Centred, Kind::Sphere),
    (Shape::Line, Kind::Cone),
    (Shape::Circle, Kind::Torus),
];
/// Axes at most that are tried, those with most points first.
const AXES: usize = 4;
/// Axes are one up to this angle, and this many deviations apart.
const PARALLEL: f64 = 0.999;
const APART: f64 = 6.0;
/// The sine of the angle between a normal and the half plane of the axis at most; more normals of
/// others come in, fewer of edges.
const ACROSS: f64 = 0.35;
/// The share of the points of an entity that have such normals.
const MOSTLY: f64 = 0.8;
/// By how much a description has to be shorter to take the place of another.
const GAIN: f64 = 1.0;

impl Segmentation {
    /// Finds the surfaces about each axis anew from the profile, where that describes the points in
    /// less.
    pub(crate) fn revolve(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        if self.is_form || self.noise < EXACT {
            return Ok(());
        }
        for axis in self.axes() {
            control.check()?;
            let other = self.revolved(cloud, limits, axis, control)?;
            let [one, two] = [&*self, &other].map(|s| s.length(cloud, self.noise));
            if std::env::var("DBG").is_ok() {
                eprintln!("axis {axis:?}: {one} -> {two}");
            }
            if two + GAIN < one {
                *self = other;
            }
        }
        Ok(())
    }

    /// The axes of round surfaces, each once, those with most points first.
    fn axes(&self) -> Vec<Line> {
        let is_round = |s: &Surface| !matches!(s.kind, Kind::Plane | Kind::Sphere);
        let members = self.members();
        let mut round: Vec<(usize, &Surface)> = (members.iter().map(Vec::len))
            .zip(&self.surfaces)
            .filter(|(_, s)| is_round(s))
            .collect();
        round.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        let mut axes: Vec<Line> = Vec::new();
        for (_, surface) in round {
            let is_one = |(place, axis): &Line| {
                let off = norm(cross(sub(surface.place, *place), *axis));
                dot(surface.axis, *axis).abs() > PARALLEL && off < APART * self.noise
            };
            if !axes.iter().any(is_one) {
                axes.push((surface.place, surface.axis));
            }
        }
        axes.truncate(AXES);
        axes
    }

    /// With the surfaces of the profile about an axis in the place of those that may be about it.
    fn revolved(
        &self,
        cloud: &Cloud,
        limits: Limits,
        axis: Line,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut other = self.clone();
        let of = self.about(cloud, axis);
        of.iter().for_each(|i| other.labels[*i as usize] = NONE);
        let profile: Vec<Place> = of
            .iter()
            .map(|i| turned(cloud.points[*i as usize], axis))
            .collect();
        for piece in pieces(&profile, self.noise, &SHAPES) {
            let Some(surface) = surface(&piece, axis) else {
                continue;
            };
            if std::env::var("DBG").is_ok() {
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
        if std::env::var("DBG").is_ok() {
            eprintln!("  relaxed: {} of {}", other.length(cloud, self.noise), other.surfaces.len());
        }
        other.add_regions(cloud, SLACK, limits, control)?;
        other.settle(cloud, limits);
        Ok(other)
    }

    /// The points that may lie on surfaces about an axis: their normals meet it.
    fn about(&self, cloud: &Cloud, (place, axis): Line) -> Vec<u32> {
        let meets = |i: &u32| {
            let around = cross(axis, sub(cloud.points[*i as usize], place));
            dot(around, cloud.normals[*i as usize]).abs() <= ACROSS * norm(around)
        };
        let is_about = |of: &Vec<u32>| {
            of.iter().filter(|i| meets(i)).count() as f64 >= MOSTLY * of.len() as f64
        };
        let are_about: Vec<bool> = self.members().iter().map(is_about).collect();
        let all = 0..self.labels.len() as u32;
        all.filter(|i| {
            let label = self.labels[*i as usize];
            let is_open = || label == NONE && meets(i);
            are_about.get(label as usize).copied().unwrap_or_else(is_open)
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

/// A point turned about an axis into a half plane: along the axis, and away from it.
fn turned(p: Point3, (place, axis): Line) -> Place {
    let d = sub(p, place);
    [dot(d, axis), norm(cross(d, axis))]
}

/// The surface of which a piece is the section.
fn surface(piece: &Piece, (place, axis): Line) -> Option<Surface> {
    let at = |h: f64| -> Point3 { std::array::from_fn(|k| place[k] + h * axis[k]) };
    let surface = |h: f64, size: f64, other: f64| Surface {
        kind: piece.kind,
        place: at(h),
        axis,
        size,
        other,
    };
    let surface = match piece.curve {
        Curve::Line([h, r], [along, away]) => match piece.kind {
            Kind::Plane => surface(h, 0.0, 0.0),
            Kind::Cone => surface(h, r, (away / along).atan()),
            _ => surface(h, r, 0.0),
        },
        Curve::Circle([h, r], radius) => match piece.kind {
            Kind::Torus => surface(h, r, radius),
            _ => surface(h, radius, 0.0),
        },
    };
    surface.is_proper().then_some(surface)
}
