//! Point clouds.

use crate::{Aabb, Point3};

/// A cloud whose centre is further from the origin than this many of its diagonals is moved there.
/// Squared distances in f64 then still have 2⁵³/1000² ≈ 10¹⁰ steps per diagonal. Smaller would move
/// scans that merely stand beside their origin, and surprise; larger would let geographic
/// coordinates eat the digits of a fit.
const FAR_IN_DIAGONALS: f64 = 1000.0;
/// An axis is moved only if its centre is this far out; below, the subtraction would not be exact
/// (see [`PointCloud::recentred`]).
const AXIS_FAR_IN_DIAGONALS: f64 = 10.0;

/// Where the origin of points in this box belongs: its rounded centre where that is far from the
/// origin, else zero.
pub fn far_center(bounds: &Aabb) -> Point3 {
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
    /// Returns some of the points, in this order, with all that belongs to them but triangles.
    #[must_use]
    pub fn select(&self, which: &[u32]) -> Self {
        fn of<T: Clone>(values: &[T], which: &[u32]) -> Vec<T> {
            match values.is_empty() {
                true => Vec::new(),
                false => which.iter().map(|i| values[*i as usize].clone()).collect(),
            }
        }
        let column = |c: &Column| Column {
            name: c.name.clone(),
            values: of(&c.values, which),
        };
        Self {
            points: of(&self.points, which),
            origin: self.origin,
            normals: of(&self.normals, which),
            colors: of(&self.colors, which),
            triangles: Vec::new(),
            columns: self.columns.iter().map(column).collect(),
        }
    }
    /// Smallest box around the points (relative to `origin`).
    pub fn bounds(&self) -> Aabb {
        Aabb::of(&self.points)
    }
    /// The cloud about [`far_center`], where its points lie far from the origin: what reading a
    /// file does. Absolute positions stay.
    ///
    /// Subtraction is exact by Sterbenz's lemma: on an axis that is moved |p − center| is at most
    /// 1.5 diagonals and |center| over 9, so that p lies between center/2 and 2·center.
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
        let center = far_center(&self.bounds());
        self.about(center)
    }
    /// The cloud with its points moved so that this place is where they are relative to, and its
    /// origin with it: absolute positions stay.
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
    /// Position in the file's coordinates.
    pub fn absolute(&self, i: usize) -> Point3 {
        std::array::from_fn(|k| self.points[i][k] + self.origin[k])
    }
}
