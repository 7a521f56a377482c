//! Point clouds.

use crate::{Aabb, Point3};

/// A named value per point.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name, as the file gives it.
    pub name: String,
    /// One value per point.
    pub values: Vec<f64>,
}

/// Points about an origin, with the normals, colours and values that the file gave.
///
/// Coordinates of the file are `origin + points[i]`: geographic coordinates keep all their digits
/// that way, and algorithms on `points` compute near zero. Every per-point array is empty or as long
/// as `points`.
///
/// ```
/// use isoform_geom::PointCloud;
///
/// let cloud = PointCloud {
///     origin: [4_500_000.0, 0.0, 0.0],
///     ..PointCloud::from_points(vec![[0.25, 1.0, 2.0]])
/// };
/// assert_eq!(cloud.absolute(0), [4_500_000.25, 1.0, 2.0]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Point positions relative to `origin`, all finite.
    pub points: Vec<Point3>,
    /// What was subtracted from the file's coordinates; zero for clouds near the origin.
    pub origin: Point3,
    /// Unit normals, as given.
    pub normals: Vec<Point3>,
    /// Colours, red, green, blue.
    pub colors: Vec<[u8; 3]>,
    /// Triangles between the points where the file is a mesh (indices into `points`).
    pub triangles: Vec<[u32; 3]>,
    /// All other values per point, by name.
    pub columns: Vec<Column>,
}

impl PointCloud {
    /// A cloud of bare points about the origin.
    pub fn from_points(points: Vec<Point3>) -> Self {
        Self {
            points,
            ..Self::default()
        }
    }
    /// Smallest box around the points (relative to `origin`).
    pub fn bounds(&self) -> Aabb {
        Aabb::of(&self.points)
    }
    /// Position in the file's coordinates.
    pub fn absolute(&self, i: usize) -> Point3 {
        std::array::from_fn(|k| self.points[i][k] + self.origin[k])
    }
}
