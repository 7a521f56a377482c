//! Section planes.

use crate::camera::{Ray, unit};
use isoform::geom::{Point3, dot, norm};

/// Plane that cuts away the half-space normal · x > offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    normal: Point3,
    offset: f64,
}

impl Section {
    /// Returns the plane normal · x = offset; `None` if the normal is zero or a number is not
    /// finite.
    pub fn new(normal: Point3, offset: f64) -> Option<Self> {
        let size = norm(normal);
        let is_plane = size > 0.0 && size.is_finite() && offset.is_finite();
        is_plane.then(|| Self {
            normal: unit(normal),
            offset: offset / size,
        })
    }

    /// Returns the signed distance of a point beyond the plane.
    pub(crate) fn height(&self, p: Point3) -> f64 {
        dot(self.normal, p) - self.offset
    }

    /// Returns true if a point is not cut away.
    pub(crate) fn keeps(&self, p: Point3) -> bool {
        self.height(p) <= 0.0
    }

    /// Returns the outward direction of caps.
    pub(crate) fn normal(&self) -> Point3 {
        self.normal
    }

    /// Returns the stretch of a ray that is not cut away, and true if it begins at the plane;
    /// `None` if all of it is cut away.
    pub(crate) fn clip(&self, ray: &Ray) -> Option<([f64; 2], bool)> {
        let slope = dot(self.normal, ray.d);
        let room = -self.height(ray.o);
        let (from, to) = (ray.from, f64::INFINITY);
        if slope > 0.0 {
            let to = room / slope;
            return (to > from).then_some(([from, to], false));
        }
        if slope == 0.0 {
            return (room >= 0.0).then_some(([from, to], false));
        }
        let at = room / slope;
        Some(if at > from {
            ([at, to], true)
        } else {
            ([from, to], false)
        })
    }
}
