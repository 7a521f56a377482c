//! Regions in which level sets are evaluated: the box of a mesh, or a convex mesh itself, as
//! functions that are positive inside.

use super::Obstacle;
use super::graph::{ScalarGraph, ScalarId, ScalarOperation as O};
use crate::three_mf::model::ModelObject;
use isoform_geom::{Aabb, Point3, cross, dot, norm, sub};
use std::collections::HashSet;

/// Relative rounding of coordinates, which 3MF keeps in single precision: the unit in the last
/// place, 2⁻²³.
const COORDINATE_ROUNDING: f64 = f32::EPSILON as f64;
/// Multiple of the rounding of coordinates within which points of a plane lie on it: the three
/// corners that define the plane and the point itself are each rounded, by half a unit along each
/// of three axes.
const PLANE_ROUNDING: f64 = 8.0;
/// Maximum number of faces of a convex mesh. Each becomes a piece of the model.
const MAX_FACES: usize = 256;

/// Half space n · y ≤ d with a unit normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    normal: Point3,
    distance: f64,
}

impl HalfSpace {
    /// Returns the distance by which a point is outside; negative inside.
    fn excess(&self, p: Point3) -> f64 {
        dot(self.normal, p) - self.distance
    }

    /// Returns d − n · y.
    pub(super) fn level(&self, graph: &mut ScalarGraph, y: [ScalarId; 3]) -> ScalarId {
        let mut level = graph.constant(self.distance);
        for (c, y) in self.normal.into_iter().zip(y) {
            let (size, operation) = if c < 0.0 { (-c, O::Add) } else { (c, O::Sub) };
            if size > 0.0 {
                let factor = graph.constant(size);
                let term = graph.binary(O::Mul, factor, y);
                level = graph.binary(operation, level, term);
            }
        }
        level
    }
}

/// Returns the half spaces of the box of a mesh.
pub(super) fn of_box(mesh: &ModelObject) -> Result<Vec<HalfSpace>, Obstacle> {
    let bounds = bounds(mesh)?;
    let mut found = Vec::with_capacity(6);
    for k in 0..3 {
        for (sign, value) in [(-1.0, -bounds.lo[k]), (1.0, bounds.hi[k])] {
            let mut normal = [0.0; 3];
            normal[k] = sign;
            found.push(HalfSpace {
                normal,
                distance: value,
            });
        }
    }
    Ok(found)
}

/// Returns the box of a mesh with a volume.
fn bounds(mesh: &ModelObject) -> Result<Aabb, Obstacle> {
    if mesh.vertices.as_flattened().iter().any(|v| !v.is_finite()) {
        let why = "the mesh around a level set has vertices that are no finite numbers";
        return Err(Obstacle::corrupt(why.to_owned()));
    }
    let bounds = Aabb::from_points(&mesh.vertices);
    if (0..3).any(|k| bounds.lo[k] >= bounds.hi[k]) {
        let why = "the mesh around a level set has no volume";
        return Err(Obstacle::corrupt(why.to_owned()));
    }
    Ok(bounds)
}

/// Returns the half spaces of the faces of a convex mesh.
pub(super) fn of_convex(mesh: &ModelObject) -> Result<Vec<HalfSpace>, Obstacle> {
    let bounds = bounds(mesh)?;
    check_closed(mesh)?;
    let largest = bounds.lo.iter().chain(&bounds.hi);
    let largest = largest.fold(0.0_f64, |most, v| most.max(v.abs()));
    let near = PLANE_ROUNDING * COORDINATE_ROUNDING * largest;
    // Large triangles first: the normals of slivers are inaccurate.
    let mut faces: Vec<([Point3; 3], Point3)> = mesh
        .triangles
        .iter()
        .map(|t| {
            let corners = t.map(|v| mesh.vertices[v as usize]);
            let [a, b, c] = corners;
            (corners, cross(sub(b, a), sub(c, a)))
        })
        .collect();
    faces.sort_by(|a, b| norm(b.1).total_cmp(&norm(a.1)));
    let mut found: Vec<HalfSpace> = Vec::new();
    for (corners, across) in faces {
        let is_on = |plane: &HalfSpace| corners.iter().all(|p| plane.excess(*p).abs() <= near);
        let area = norm(across);
        if area == 0.0 || found.iter().any(is_on) {
            continue;
        }
        let normal = across.map(|c| c / area);
        let plane = HalfSpace {
            normal,
            distance: dot(normal, corners[0]),
        };
        if mesh.vertices.iter().any(|p| plane.excess(*p) > near) {
            let why = "the mesh around a level set is not convex, and meshbboxonly is not set";
            return Err(Obstacle::region(why));
        }
        found.push(plane);
        if found.len() > MAX_FACES {
            let why = "the mesh around a level set has more than 256 faces, and meshbboxonly is \
                not set";
            return Err(Obstacle::region(why));
        }
    }
    Ok(found)
}

/// Returns an error if an edge belongs to more or fewer than two triangles.
fn check_closed(mesh: &ModelObject) -> Result<(), Obstacle> {
    let mut edges = HashSet::new();
    let directed = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let mut sides = mesh.triangles.iter().flat_map(directed);
    let is_simple = sides.all(|edge| edges.insert(edge));
    let is_closed = edges.iter().all(|(a, b)| edges.contains(&(*b, *a)));
    if is_simple && is_closed && !edges.is_empty() {
        return Ok(());
    }
    let why = "the mesh around a level set is not closed, and meshbboxonly is not set";
    Err(Obstacle::region(why))
}
