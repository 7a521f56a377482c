//! Signed distances from meshes as functions of space.

use crate::compare::{Sides, TriangleTree, volume};
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3};
use isoform_spline::{ImplicitSpline, SampleAccuracy, SampleError, sample_function};
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};

/// Reason why a mesh has no signed distance.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshDistanceError {
    /// The triangles have no volume within.
    #[error("the mesh has no triangles that enclose a volume")]
    Empty,
    /// An edge has other than two triangles, one in each direction.
    #[error("the triangles are not closed, or turn to different sides")]
    Open,
    /// The distance changes its sign by a jump.
    #[error(
        "the triangles cross, overlap, or are turned to different sides, so that in and out are not told"
    )]
    Crossing,
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
    let bounds = Aabb::from_points(triangles.as_flattened());
    let diagonal = bounds.diagonal();
    if triangles.is_empty() || !diagonal.is_finite() || diagonal == 0.0 {
        return Err(MeshDistanceError::Empty);
    }
    if volume(&triangles).abs() <= 1e-12 * diagonal.powi(3) {
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
    let is_torn = AtomicBool::new(false);
    let values = |points: &[Point3], out: &mut [f64]| {
        sides.signed_distances(points, out);
        // Distances of neighbours differ by less than their own, unless the sign jumps.
        let jumps = points.windows(2).zip(out.windows(2)).any(|(p, d)| {
            let apart = isoform_geom::norm(isoform_geom::sub(p[1], p[0]));
            (d[1] - d[0]).abs() > apart + 1e-9 * diagonal
        });
        if jumps {
            is_torn.store(true, Ordering::Relaxed);
            out.fill(f64::NAN);
        }
    };
    let probes = probes(mesh, diagonal);
    let sampled = sample_function(region, accuracy, &probes, control, values);
    if is_torn.into_inner() {
        return Err(MeshDistanceError::Crossing);
    }
    Ok(sampled?)
}

/// Returns points of the surface that show small features: the vertices, and points on long edges
/// that are closer together than the coarsest cells are wide.
fn probes(mesh: &Mesh, diagonal: f64) -> Vec<Point3> {
    let point = |v: u32| mesh.points[v as usize];
    let sides = mesh
        .triangles
        .iter()
        .flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
    let sides: BTreeSet<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    let mut found: Vec<Point3> = mesh.triangles.iter().flatten().map(|v| point(*v)).collect();
    for [a, b] in sides {
        let (a, b) = (point(a), point(b));
        let length = isoform_geom::norm(isoform_geom::sub(b, a));
        let n = (32.0 * length / diagonal).ceil() as usize;
        found.extend((1..n).map(|i| {
            let t = i as f64 / n as f64;
            std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
        }));
    }
    found.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    found.dedup();
    found
}
