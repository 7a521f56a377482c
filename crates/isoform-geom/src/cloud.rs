//! Point clouds.

use crate::{Aabb, Point3};

/// Distance of the centre of a cloud from the origin, in diagonals of the cloud, above which the
/// cloud is recentred. At this distance squared distances in f64 still resolve 2⁵³/1000² ≈ 10¹⁰
/// steps per diagonal. A smaller value would move scans that are merely next to their origin, which
/// users do not expect; a larger one would leave a fit fewer digits of geographic coordinates.
const FAR_IN_DIAGONALS: f64 = 1000.0;
/// Distance of the centre from the origin along an axis, in diagonals, above which that axis is
/// recentred. Below it, the subtraction would not be exact (see [`PointCloud::recentred`]).
const AXIS_FAR_IN_DIAGONALS: f64 = 10.0;

/// Returns the origin for points in this box: its rounded centre along the axes on which that is
/// far from zero, else zero.
pub fn recentering_origin(bounds: &Aabb) -> Point3 {
    let (center, diagonal) = (bounds.center(), bounds.diagonal());
    let far = center.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if bounds.is_empty()
        || diagonal <= 0.0
        || !diagonal.is_finite()
        || far <= FAR_IN_DIAGONALS * diagonal
    {
        return [0.0; 3];
    }
    let step = 10.0_f64.powf(diagonal.log10().floor());
    center.map(|c| {
        let rounded = (c / step).round() * step;
        if c.abs() > AXIS_FAR_IN_DIAGONALS * diagonal && rounded.is_finite() {
            rounded
        } else {
            0.0
        }
    })
}

/// Named value per point.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name in the file.
    pub name: String,
    /// One value per point.
    pub values: Vec<f64>,
}

/// Points relative to an origin, with the normals, colours and values of their file.
///
/// The coordinates in the file are `origin + points[i]`: so geographic coordinates keep all digits,
/// and algorithms use the small numbers `points`. Every array of values per point is empty or as
/// long as `points`.
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
    /// Offset that was subtracted from the coordinates of the file; zero for clouds near the
    /// origin.
    pub origin: Point3,
    /// Unit normals, as in the file.
    pub normals: Vec<Point3>,
    /// Colours: red, green, blue.
    pub colors: Vec<[u8; 3]>,
    /// Triangles between the points if the file is a mesh, as indices into `points`.
    pub triangles: Vec<[u32; 3]>,
    /// Other values per point, by name.
    pub columns: Vec<Column>,
}

impl PointCloud {
    /// Returns a cloud of points about the origin, without normals or other values.
    pub fn from_points(points: Vec<Point3>) -> Self {
        Self {
            points,
            ..Self::default()
        }
    }
    /// Returns the points with these indices, in this order, with their normals, colours and
    /// values, but without triangles.
    #[must_use]
    pub fn select(&self, which: &[u32]) -> Self {
        fn selected<T: Clone>(values: &[T], which: &[u32]) -> Vec<T> {
            match values.is_empty() {
                true => Vec::new(),
                false => which.iter().map(|i| values[*i as usize].clone()).collect(),
            }
        }
        let column = |c: &Column| Column {
            name: c.name.clone(),
            values: selected(&c.values, which),
        };
        Self {
            points: selected(&self.points, which),
            origin: self.origin,
            normals: selected(&self.normals, which),
            colors: selected(&self.colors, which),
            triangles: Vec::new(),
            columns: self.columns.iter().map(column).collect(),
        }
    }
    /// Returns the smallest box around the points, relative to `origin`.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(&self.points)
    }
    /// Moves the origin of a cloud that lies far from it to [`recentering_origin`], as readers of
    /// files do. Absolute positions do not change.
    ///
    /// The subtraction is exact by Sterbenz's lemma: on an axis that is moved, |p − center| is at
    /// most 1.5 diagonals and |center| above 9, so that p lies between center/2 and 2·center.
    ///
    /// ```
    /// use isoform_geom::PointCloud;
    ///
    /// let far = PointCloud::from_points(vec![[1e6, 0.0, 0.5], [1e6 + 3.0, 4.0, 0.5]]);
    /// let near = far.clone().recentred();
    /// assert_eq!((near.origin, near.points[1]), ([1_000_002.0, 0.0, 0.0], [1.0, 4.0, 0.5]));
    /// assert_eq!(near.absolute(1), far.points[1]);
    /// assert_eq!(near.clone().recentred(), near);
    /// ```
    #[must_use]
    pub fn recentred(self) -> Self {
        let center = recentering_origin(&self.bounds());
        self.about(center)
    }
    /// Moves the origin by `center` and subtracts it from the points. Absolute positions do not
    /// change.
    #[must_use]
    pub fn about(mut self, center: Point3) -> Self {
        if center != [0.0; 3] {
            for p in &mut self.points {
                *p = std::array::from_fn(|k| p[k] - center[k]);
            }
            self.origin = std::array::from_fn(|k| self.origin[k] + center[k]);
        }
        self
    }
    /// Returns the position of a point in the coordinates of the file.
    pub fn absolute(&self, i: usize) -> Point3 {
        std::array::from_fn(|k| self.points[i][k] + self.origin[k])
    }
}
