//! Flat faces, with their outward normals.

use super::surface;
use crate::entity::Recognition;
use crate::fit::mean;
use isoform_geom::{Point3, Quadric, dot};

/// A flat face.
pub(super) struct Plane {
    pub(super) face: usize,
    /// Unit normal, outwards.
    pub(super) normal: Point3,
    /// Mean of its points, moved into the plane.
    pub(super) middle: Point3,
}

/// Returns the flat faces whose outer side is known.
pub(super) fn planes(members: &[Vec<Point3>], found: &Recognition) -> Vec<Plane> {
    let plane = |(face, points): (usize, &Vec<Point3>)| {
        let Quadric::Plane { normal, offset } = *surface(found, face) else {
            return None;
        };
        let sign = f64::from(found.entities[found.faces[face].entity].outward);
        if sign == 0.0 || points.is_empty() {
            return None;
        }
        let center = mean(points);
        let off = dot(normal, center) - offset;
        Some(Plane {
            face,
            normal: normal.map(|v| sign * v),
            middle: std::array::from_fn(|k| center[k] - off * normal[k]),
        })
    };
    members.iter().enumerate().filter_map(plane).collect()
}
