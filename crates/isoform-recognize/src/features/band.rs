//! Bands: faces on cylinders and cones, as far as they reach along their axes.

use super::planes::Plane;
use super::surface;
use crate::chart::frame;
use crate::entity::Recognition;
use isoform_geom::{Point3, Quadric, cross, dot, norm, sub};
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};

/// A face on a cylinder or a cone.
pub(super) struct Band {
    pub(super) face: usize,
    /// Point of the axis: the apex of a cone.
    origin: Point3,
    /// Unit vector along the axis.
    pub(super) axis: Point3,
    /// Radius at the origin, and half angle (radians).
    radius: f64,
    pub(super) half_angle: f64,
    /// True if the outside is towards the axis.
    pub(super) is_hollow: bool,
    /// Share of the circle that its points are on.
    share: f64,
    /// Lower and upper end.
    pub(super) ends: [BandEnd; 2],
    /// Area for each of its points.
    area: f64,
    /// Distance by which its points may fall short of its ends, or be off its surface.
    pub(super) slack: f64,
}

/// An end of a band.
#[derive(Clone, Copy, Default)]
pub(super) struct BandEnd {
    /// Height along the axis, from the origin.
    pub(super) height: f64,
    /// Face of the plane that ends the band.
    pub(super) plane: Option<usize>,
    /// True if the plane is a floor or a cap; otherwise it is a mouth or a base.
    pub(super) is_closed: bool,
}

/// Returns the faces on cylinders and cones whose outer side is known.
pub(super) fn bands(members: &[Vec<Point3>], found: &Recognition) -> Vec<Band> {
    let band = |(face, points): (usize, &Vec<Point3>)| {
        let entity = &found.entities[found.faces[face].entity];
        let (origin, axis, radius, half_angle) = match *surface(found, face) {
            Quadric::Cylinder {
                point,
                axis,
                radius,
            } => (point, axis, radius, 0.0),
            Quadric::Cone {
                apex,
                axis,
                half_angle,
            } => (apex, axis, 0.0, half_angle),
            _ => return None,
        };
        if entity.outward == 0 || points.is_empty() {
            return None;
        }
        let heights = points.iter().map(|p| dot(sub(*p, origin), axis));
        let low = heights.clone().fold(f64::INFINITY, f64::min);
        let high = heights.fold(f64::NEG_INFINITY, f64::max);
        let share = share_of_circle(points, origin, axis);
        let mean_radius = radius + (low + high) / 2.0 * half_angle.tan();
        let area = TAU * mean_radius * share * (high - low);
        // Points are about this far apart.
        let spacing = (area / points.len() as f64).sqrt();
        let slack = (2.0 * spacing + 3.0 * found.noise).min(0.5 * (high - low));
        let end = |height: f64| BandEnd {
            height,
            ..BandEnd::default()
        };
        Some(Band {
            face,
            origin,
            axis,
            radius,
            half_angle,
            is_hollow: entity.outward < 0,
            share,
            ends: [end(low), end(high)],
            area: area / points.len() as f64,
            slack,
        })
    };
    members.iter().enumerate().filter_map(band).collect()
}

/// Returns the share of the circle about an axis that points are on: all but its largest gap.
fn share_of_circle(points: &[Point3], origin: Point3, axis: Point3) -> f64 {
    let [e, f] = frame(axis);
    let angle = |p: &Point3| {
        let d = sub(*p, origin);
        dot(d, f).atan2(dot(d, e)).rem_euclid(TAU)
    };
    let mut angles: Vec<f64> = points.iter().map(angle).collect();
    angles.sort_by(f64::total_cmp);
    let last = angles[angles.len() - 1] - TAU;
    let before = std::iter::once(last).chain(angles.iter().copied());
    let gaps = before.zip(&angles).map(|(a, b)| b - a);
    let largest = gaps.fold(0.0, f64::max);
    // Gaps of 20°, as between the vertices of a coarse circle, do not count.
    let fair = 2.0 * TAU / points.len().min(36) as f64;
    1.0 - (largest - fair).max(0.0) / TAU
}

impl Band {
    /// Returns the point of the axis at a height.
    pub(super) fn at(&self, height: f64) -> Point3 {
        std::array::from_fn(|k| self.origin[k] + height * self.axis[k])
    }

    /// Returns true if it goes round: a slot or a flat may cut off the rest.
    pub(super) fn is_round(&self) -> bool {
        self.share >= 0.7
    }

    /// Returns true if it is about half a circle.
    pub(super) fn is_half(&self) -> bool {
        (self.share - 0.5).abs() <= 0.2
    }

    pub(super) fn middle(&self) -> f64 {
        (self.ends[0].height + self.ends[1].height) / 2.0
    }

    pub(super) fn length(&self) -> f64 {
        self.ends[1].height - self.ends[0].height
    }

    /// Returns the radius at a height.
    pub(super) fn radius_at(&self, height: f64) -> f64 {
        self.radius + height * self.half_angle.tan()
    }

    /// Returns the direction along the axis from an end to the other one.
    pub(super) fn inward(&self, end: usize) -> Point3 {
        let sign = if end == 0 { 1.0 } else { -1.0 };
        self.axis.map(|v| sign * v)
    }

    /// Returns true if a plane around an end faces the other one.
    pub(super) fn has_base(&self, end: usize) -> bool {
        !self.ends[end].is_closed && self.ends[end].plane.is_some()
    }

    /// Returns true if it becomes narrower towards an end: the tip of a drill.
    pub(super) fn narrows(&self, end: usize) -> bool {
        let [here, other] = [end, 1 - end].map(|k| self.radius_at(self.ends[k].height));
        here < other - self.slack.min(0.5 * other)
    }

    /// Returns true if another band follows about its axis.
    pub(super) fn continues(&self, other: &Self) -> bool {
        let slack = self.slack.max(other.slack);
        let way = sub(other.at(other.middle()), self.at(self.middle()));
        let off = norm(cross(way, self.axis));
        let is_coaxial = norm(cross(self.axis, other.axis)) < 0.1 && off < slack;
        let heights = other
            .ends
            .map(|e| dot(sub(other.at(e.height), self.origin), self.axis));
        let [low, high] = [heights[0].min(heights[1]), heights[0].max(heights[1])];
        let touches =
            (low - self.ends[1].height).abs() < slack || (high - self.ends[0].height).abs() < slack;
        is_coaxial && touches
    }

    /// Moves the ends into adjacent planes across the axis.
    pub(super) fn end_in(&mut self, planes: &[Plane], beside: &BTreeSet<usize>) {
        let mut nearest = [self.slack; 2];
        let free = self.ends.map(|e| e.height);
        for p in planes.iter().filter(|p| beside.contains(&p.face)) {
            let slope = dot(p.normal, self.axis);
            if slope.abs() < 0.99 {
                continue;
            }
            let height = dot(sub(p.middle, self.origin), p.normal) / slope;
            let off = free.map(|h| (h - height).abs());
            let end = usize::from(off[1] < off[0]);
            if off[end] > nearest[end] {
                continue;
            }
            nearest[end] = off[end];
            // Outwards of the end, or towards the other one.
            let faces_out = slope * (2.0 * end as f64 - 1.0) > 0.0;
            self.ends[end] = BandEnd {
                height,
                plane: Some(p.face),
                is_closed: faces_out != self.is_hollow,
            };
        }
    }

    /// Closes ends without a plane across which points lie as densely as on the band.
    pub(super) fn end_in_points(&mut self, points: &[Point3]) {
        for k in 0..2 {
            let end = self.ends[k];
            if end.plane.is_some() {
                continue;
            }
            // Points near the edge may belong to the band or to its surroundings.
            let radius = 0.8 * self.radius_at(end.height);
            let is_across = |p: &&Point3| {
                let d = sub(**p, self.origin);
                (dot(d, self.axis) - end.height).abs() < self.slack
                    && norm(cross(d, self.axis)) < radius
            };
            let expected = PI * radius * radius / self.area;
            let found = points.iter().filter(is_across).count() as f64;
            self.ends[k].is_closed = found > 0.5 * expected;
        }
    }
}
