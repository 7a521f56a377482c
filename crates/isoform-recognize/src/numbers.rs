//! How many numbers an entity has of its own: about an axis, or along a direction, that larger ones
//! have already, it has fewer.

use crate::chart::{Kind, Surface};
use crate::fit::{mean, squares};
use crate::start::{Line, centred_sphere, cylinder, start_about};
use isoform_geom::{Point3, dot};

/// Axes and directions of larger entities that are looked at, at most.
const MOST: usize = 6;
/// The least cosine between directions that may be one: 11°. Short faces in noise know theirs to
/// some degrees.
const ALONG: f64 = 0.98;

/// What entities so far have given.
#[derive(Default)]
pub(crate) struct Given {
    axes: Vec<Line>,
    directions: Vec<Point3>,
}

impl Given {
    /// What it costs to describe a surface through points of a deviation of `noise`: half the
    /// logarithm of their count for each number of its own, and how much more their distances cost
    /// where it keeps to an axis or a direction; and the surface with which it costs least.
    pub(crate) fn shortest(
        &self,
        surface: &Surface,
        points: &[Point3],
        noise: f64,
    ) -> (f64, Surface) {
        let each = (points.len().max(1) as f64).ln() / 2.0;
        let free = squares(surface, points);
        let cost = |numbers: usize, squares: f64| {
            numbers as f64 * each + (squares - free) / (2.0 * noise * noise)
        };
        let alone = (cost(surface.kind.parameters(), free), *surface);
        let of = |(numbers, tied): (usize, Surface)| (cost(numbers, squares(&tied, points)), tied);
        let shorter = |a: (f64, Surface), b: (f64, Surface)| if b.0 < a.0 { b } else { a };
        self.tied(surface, points).map(of).fold(alone, shorter)
    }

    /// Surfaces of this kind through points about the axes and along the directions given, with the
    /// count of their own numbers.
    fn tied<'a>(
        &'a self,
        surface: &'a Surface,
        points: &'a [Point3],
    ) -> impl Iterator<Item = (usize, Surface)> + 'a {
        let is_along = |d: &Point3| dot(*d, surface.axis).abs() > ALONG;
        let about = move |axis: &Line| match surface.kind {
            Kind::Plane => None,
            Kind::Sphere => centred_sphere(points, *axis).map(|s| (2, s)),
            kind => start_about(kind, points, *axis).map(|s| (kind.parameters() - 4, s)),
        };
        let along = move |direction: &Point3| match surface.kind {
            Kind::Plane => Some((
                1,
                Surface {
                    place: mean(points),
                    axis: *direction,
                    ..*surface
                },
            )),
            Kind::Cylinder => cylinder(points, *direction).map(|s| (3, s)),
            _ => None,
        };
        let is_sphere = surface.kind == Kind::Sphere;
        let axes = self.axes.iter().filter(move |a| is_sphere || is_along(&a.1));
        let directions = self.directions.iter().filter(move |d| is_along(d));
        axes.filter_map(about).chain(directions.filter_map(along))
    }

    /// Adds the axis and the direction of a surface, where there is none like them.
    pub(crate) fn add(&mut self, surface: &Surface) {
        if surface.kind == Kind::Sphere {
            return;
        }
        if self.directions.len() < MOST {
            self.directions.push(surface.axis);
        }
        if surface.is_round() && self.axes.len() < MOST {
            self.axes.push((surface.place, surface.axis));
        }
    }
}
