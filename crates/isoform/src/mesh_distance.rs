//! Signed distances from meshes as functions of space.

use crate::compare::{Sides, TriangleTree};
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3};
use isoform_spline::{ImplicitSpline, SampleAccuracy, SampleError, sample_function};

/// Reason why a mesh has no signed distance.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshDistanceError {
    /// The mesh has no triangles, or no extent.
    #[error("the mesh has no triangles with an area")]
    Empty,
    /// An edge has other than two triangles, one in each direction.
    #[error("the triangles are not closed, or turn to different sides")]
    Open,
    /// The function is not sampled.
    #[error(transparent)]
    Sampled(#[from] SampleError),
}

/// Returns the signed distance from the surface of a closed mesh, positive inside: a spline with
/// continuous gradient. It differs from the distance d by up to `accuracy` (`None`: a thousandth
/// of the mesh's diagonal) and a twentieth of |d|, so that sharp edges become round.
///
/// ```
/// use isoform::geom::{Field, Mesh};
/// use isoform::{Control, mesh_distance};
///
/// let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let sides = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let mesh = Mesh::from_triangles(points, sides);
/// let distance = mesh_distance(&mesh, Some(0.01), &Control::default())?;
/// assert!((distance.value([0.2, 0.3, 0.1]) - 0.1).abs() < 0.02);
/// assert!((distance.value([0.2, 0.3, -0.5]) + 0.5).abs() < 0.03);
/// # Ok::<(), isoform::MeshDistanceError>(())
/// ```
///
/// # Errors
/// [`MeshDistanceError`].
pub fn mesh_distance(
    mesh: &Mesh,
    accuracy: Option<f64>,
    control: &Control,
) -> Result<ImplicitSpline, MeshDistanceError> {
    let corners = |t: &[u32; 3]| t.map(|v| mesh.points[v as usize]);
    let triangles: Vec<[Point3; 3]> = mesh.triangles.iter().map(corners).collect();
    let bounds = triangles.iter().flatten().fold(Aabb::EMPTY, |mut b, p| {
        b.add(*p);
        b
    });
    let diagonal = bounds.diagonal();
    if triangles.is_empty() || !diagonal.is_finite() || diagonal == 0.0 {
        return Err(MeshDistanceError::Empty);
    }
    let tree = TriangleTree::new(&triangles);
    let sides = Sides::new(&tree, &triangles).ok_or(MeshDistanceError::Open)?;
    // Offsets beyond this box are too small.
    let region = Aabb {
        lo: bounds.lo.map(|v| v - 0.5 * diagonal),
        hi: bounds.hi.map(|v| v + 0.5 * diagonal),
    };
    let accuracy = SampleAccuracy::of_distance(accuracy, diagonal);
    let values = |points: &[Point3], out: &mut [f64]| sides.signed_distances(points, out);
    Ok(sample_function(region, accuracy, control, values)?)
}
