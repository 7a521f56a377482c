//! Samples of a faceted CAD model on the surface that it approximates.
//!
//! Vertices of such a mesh lie on the true surface, but large faces have few of them, and points
//! inside the facets of a curved face are off it by the sagitta. Faces are therefore recognised and
//! sampled by area, on their surfaces. A scanned mesh has no such faces and gets no points.

use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, PointCloud};
use isoform_recognize::points_on_facets;

/// Maximum number of points that are added on faces; it bounds memory and time.
const MAX_ADDED_POINTS: usize = 2_000_000;

/// Corner of a triangle that is not the index of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("triangle {triangle} has the corner {corner}, but there are {points} points (from 0)")]
pub struct CornerError {
    /// Index of the triangle, from 0.
    pub triangle: usize,
    /// The corner's index.
    pub corner: u32,
    /// Number of points.
    pub points: usize,
}

/// Reason why no points can be added on faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FacesError {
    /// A triangle has a corner that is not the index of a point.
    #[error(transparent)]
    Corner(#[from] CornerError),
    /// The work was cancelled, or its deadline passed.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Checks that the corners of all triangles are indices of points.
pub(crate) fn check_corners(mesh: &PointCloud) -> Result<(), CornerError> {
    let points = mesh.points.len();
    let corners = mesh.triangles.as_flattened().iter().enumerate();
    let mut missing = corners.filter(|(_, v)| **v as usize >= points);
    missing.next().map_or(Ok(()), |(i, &corner)| {
        Err(CornerError {
            triangle: i / 3,
            corner,
            points,
        })
    })
}

/// Points of a CAD mesh, with further ones on its faces.
#[derive(Clone, Debug)]
pub struct PointsOnFaces {
    /// Points of the mesh and, after them, those inside faces.
    pub cloud: PointCloud,
    /// Number of points added.
    pub added: usize,
    /// Distance of the points from the model that is due to rounding.
    pub exactness: f64,
}

/// Adds about `wanted` points (two million at most) on the faces of a CAD mesh. Returns `None` for
/// other meshes and for clouds without triangles.
///
/// # Errors
/// [`FacesError`] if a triangle has no such point as corner, or on a stop.
pub fn points_on_faces(
    mesh: &PointCloud,
    wanted: usize,
    control: &Control<'_>,
) -> Result<Option<PointsOnFaces>, FacesError> {
    check_corners(mesh)?;
    let found = points_on_facets(mesh, wanted.min(MAX_ADDED_POINTS), control)?;
    Ok(found.map(|(more, exactness)| PointsOnFaces {
        cloud: with_points(mesh, &more),
        added: more.len(),
        exactness,
    }))
}

/// Returns a mesh with further points after its own.
pub(crate) fn with_points(mesh: &PointCloud, more: &[Point3]) -> PointCloud {
    PointCloud {
        points: [&mesh.points, more].concat(),
        origin: mesh.origin,
        triangles: mesh.triangles.clone(),
        ..PointCloud::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a closed prism over a regular polygon of radius 1, of height 4.
    fn prism(sides: u32) -> PointCloud {
        let ring = |z: f64| {
            (0..sides)
                .map(move |k| (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos())
                .map(move |(s, c)| [c, s, z])
        };
        let mut points: Vec<Point3> = ring(0.0).chain(ring(4.0)).collect();
        points.extend([[0.0; 3], [0.0, 0.0, 4.0]]);
        let mut triangles = Vec::new();
        for k in 0..sides {
            let (next, top) = ((k + 1) % sides, sides);
            triangles.extend([
                [k, next, top + next],
                [k, top + next, top + k],
                [2 * sides, next, k],
                [2 * sides + 1, top + k, top + next],
            ]);
        }
        PointCloud {
            points,
            triangles,
            ..PointCloud::default()
        }
    }

    fn on_faces(mesh: &PointCloud, wanted: usize) -> Option<PointsOnFaces> {
        points_on_faces(mesh, wanted, &Control::default()).expect("corners are points")
    }

    #[test]
    fn added_points_lie_on_the_cylinder() {
        let mesh = prism(36);
        let PointsOnFaces { cloud, added, .. } = on_faces(&mesh, 500).expect("faces");
        assert_eq!(cloud.points.len(), mesh.points.len() + added);
        let (mut caps, mut lines) = (0, 0);
        for p in &cloud.points[mesh.points.len()..] {
            let r = p[0].hypot(p[1]);
            if p[2].abs().min((p[2] - 4.0).abs()) < 1e-12 {
                caps += 1;
                assert!(r < 1.0 + 1e-12, "{p:?}");
            } else {
                lines += 1;
                assert!((r - 1.0).abs() < 1e-12, "{p:?}");
            }
        }
        assert!(caps > 50 && lines > 300, "{caps} {lines}");
    }

    #[test]
    fn all_faces_of_a_box_are_flat() {
        let added = on_faces(&prism(4), 1000).expect("faces").added;
        assert!((990..=1010).contains(&added), "{added}");
    }

    #[test]
    fn a_bumpy_mesh_stays_as_it_is() {
        let mut mesh = prism(36);
        for (k, p) in mesh.points.iter_mut().enumerate() {
            *p = p.map(|v| {
                v * (1.0 + 0.05 * (7.0 * k as f64).sin()) + 0.01 * (11.0 * k as f64).cos()
            });
        }
        assert!(on_faces(&mesh, 500).is_none());
    }

    #[test]
    fn corners_are_points() {
        let mut mesh = prism(5);
        let points = mesh.points.len();
        mesh.triangles[2][1] = 99;
        let error = points_on_faces(&mesh, 100, &Control::default()).expect_err("no such point");
        let expected = CornerError {
            triangle: 2,
            corner: 99,
            points,
        };
        assert_eq!(error, FacesError::Corner(expected));
    }
}
