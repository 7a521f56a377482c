//! Entities that are refitted, with their points.

use crate::chart::{MAX_PARAMETERS, ParameterRow, Primitive};
use crate::cloud::Scaling;
use crate::entity::Recognition;
use crate::fit::{mean, squares};
use crate::relations::UncertainSurface;
use isoform_geom::Point3;

/// An entity with its points, in diagonals of the scan about its middle.
pub(super) struct SnapEntity {
    pub(super) known: UncertainSurface,
    pub(super) points: Vec<Point3>,
    /// Standard deviation of the points along their normals.
    pub(super) sigma: f64,
}

impl SnapEntity {
    /// Returns the gradient of half the sum of squares, less that at the start, in variances.
    pub(super) fn gradient(&self, now: &Primitive) -> ParameterRow {
        let start = &self.known.surface;
        let rows = start.rows();
        let mut sum = [0.0; MAX_PARAMETERS];
        for p in &self.points {
            let (r, row) = rows.at(start.kind, *p);
            let change = now.distance(*p) - r;
            sum.iter_mut().zip(row).for_each(|(s, j)| *s += change * j);
        }
        sum.map(|s| s / (self.sigma * self.sigma))
    }
}

/// Returns an entity about the centroid of its points, with its covariance: infinite if it is
/// undetermined.
pub(super) fn snap_entity(
    found: &Recognition,
    i: usize,
    points: Vec<Point3>,
    scaling: &Scaling,
) -> SnapEntity {
    let surface = Primitive::from_quadric(&found.entities[i].surface, scaling.origin);
    let surface = surface.scaled(1.0 / scaling.unit).about(mean(&points));
    let n = surface.kind.parameters();
    let free = points.len().saturating_sub(n).max(1) as f64;
    let least = match found.is_form {
        // A tolerance of form is not the noise of those objects that follow their surfaces.
        true => 0.0,
        // Few points may lie on a surface by chance more exactly than they were rounded.
        false => found.noise / scaling.unit / 3.0_f64.sqrt(),
    };
    let sigma = (squares(&surface, &points) / free)
        .sqrt()
        .max(least)
        .max(f64::EPSILON);
    SnapEntity {
        known: UncertainSurface::from_points(surface, &points, sigma * sigma),
        points,
        sigma,
    }
}
