//! Planes that extend beyond the other points: tables and walls.

use crate::outliers::{best_plane, robust_deviation};
use isoform_geom::{KdTree, Point3, cross, dot, orthonormal_complement, sub};

/// Number of neighbours that determine a first normal, and fewest points that determine a plane.
const PLANE_NEIGHBOURS: usize = 12;

type Point2 = [f64; 2];

/// A plane with the outline of the points off it.
pub(super) struct Plane {
    pub(super) at: Point3,
    pub(super) normal: Point3,
    thick: f64,
    /// Orthogonal unit vectors in the plane.
    axes: [Point3; 2],
    /// Convex hull of the other points projected along the normal, counterclockwise.
    outline: Vec<Point2>,
    /// Distance beyond the outline from which points belong to the plane: 3 % of the outline's
    /// diagonal.
    beyond: f64,
    /// True if its points beyond the outline surround it. A face of the part that was seen from one
    /// side also extends beyond the other points, but does not surround them.
    pub(super) is_around: bool,
}

impl Plane {
    /// Finds the plane with the most points beyond the others; `None` if no plane has 0.5 % of the
    /// points there.
    pub(super) fn find(points: &[Point3]) -> Option<Self> {
        // Rough normals of a few points are off by about as much as 1.2 % of the size.
        let thick = 0.012 * radius(points);
        let tree = KdTree::new(points);
        let mut found = Vec::new();
        let mut most = (0.005 * points.len() as f64).max(1.0) as usize;
        let mut best = None;
        // With a twentieth of the points on a plane, 60 of 200 seeds would find it in 19 of 20
        // runs.
        for seed in points.iter().step_by(points.len().div_ceil(200)) {
            tree.nearest_k(*seed, PLANE_NEIGHBOURS, &mut found);
            let normal = rough_normal(*seed, points, &found);
            let Some(plane) = Self::about(points, *seed, normal, thick) else {
                continue;
            };
            let count = points.iter().filter(|p| plane.holds(**p)).count();
            if count > most {
                (most, best) = (count, Some(plane));
            }
        }
        best.map(|plane| Self {
            is_around: plane.goes_round(points),
            ..plane
        })
    }

    /// Fits a plane near a point and normal with the other points on one side: first with the rough
    /// half thickness, then with five robust deviations of the points beyond the outline. Noise
    /// stays within that; a flange that stands on the table does not.
    fn about(points: &[Point3], at: Point3, normal: Point3, thick: f64) -> Option<Self> {
        let length = dot(normal, normal).sqrt();
        if length <= 0.0 {
            return None;
        }
        let rough = refined(points, at, normal.map(|v| v / length), 2.0 * thick)?;
        let rough = Self::with_outline(points, rough, thick)?;
        let beyond: Vec<Point3> = points.iter().copied().filter(|p| rough.holds(*p)).collect();
        if beyond.len() < PLANE_NEIGHBOURS {
            return None;
        }
        let fine = best_plane(&beyond)?;
        let off = beyond.iter().map(|p| fine.height(*p).abs());
        let deviation = robust_deviation(&mut off.collect::<Vec<_>>());
        let thin = (5.0 * deviation).clamp(1e-6 * thick, thick);
        Self::with_outline(points, (fine.at, fine.normal), thin)
    }

    /// Adds the outline of the points off a plane; `None` if they lie on both sides of it.
    fn with_outline(points: &[Point3], plane: (Point3, Point3), thick: f64) -> Option<Self> {
        let (at, normal) = plane;
        let height = |p: &Point3| dot(sub(*p, at), normal);
        let side = side_of(points.iter().map(height), thick)?;
        let mut this = Self {
            at,
            normal,
            thick,
            axes: orthonormal_complement(normal),
            outline: Vec::new(),
            beyond: 0.0,
            is_around: false,
        };
        let off = points.iter().filter(|p| side * height(p) > thick);
        this.outline = hull(off.map(|p| this.flat(*p)).collect());
        this.beyond = 0.03 * diagonal(&this.outline);
        Some(this)
    }

    /// Returns true if the points of the plane beyond the outline surround it.
    fn goes_round(&self, points: &[Point3]) -> bool {
        let held = points.iter().filter(|p| self.holds(**p));
        let around = hull(held.map(|p| self.flat(*p)).collect());
        let n = around.len();
        let is_within =
            |q: &Point2| (0..n).all(|i| turn(around[i], around[(i + 1) % n], *q) >= 0.0);
        n > 2 && self.outline.iter().all(is_within)
    }

    /// Projects a point along the normal.
    fn flat(&self, p: Point3) -> Point2 {
        self.axes.map(|axis| dot(sub(p, self.at), axis))
    }

    /// Returns true if a point is within the half thickness of the plane.
    pub(super) fn is_level(&self, p: Point3) -> bool {
        dot(sub(p, self.at), self.normal).abs() <= self.thick
    }

    /// Returns true if a point is on the plane and beyond the outline.
    pub(super) fn holds(&self, p: Point3) -> bool {
        if !self.is_level(p) {
            return false;
        }
        let q = self.flat(p);
        let n = self.outline.len();
        (0..n).any(|i| {
            let (a, b) = (self.outline[i], self.outline[(i + 1) % n]);
            // The outward normal of a counterclockwise edge points to its right.
            -turn(a, b, q) > self.beyond * (b[0] - a[0]).hypot(b[1] - a[1])
        })
    }
}

/// Returns a normal of the triangle of a point and two of its neighbours, the second of them the
/// farthest one found.
fn rough_normal(seed: Point3, points: &[Point3], found: &[(f64, u32)]) -> Point3 {
    let at = |k: usize| points[found[k].1 as usize];
    let (u, v) = (at(PLANE_NEIGHBOURS / 3), at(PLANE_NEIGHBOURS - 1));
    cross(sub(u, seed), sub(v, seed))
}

/// Returns the side of a plane (±1) on which all but 2 % of the points off it lie; `None` if fewer
/// than a fifth of all points are off it (there would be no part), or if they lie on both sides.
fn side_of(heights: impl ExactSizeIterator<Item = f64>, thick: f64) -> Option<f64> {
    let all = heights.len() as f64;
    let (mut above, mut below) = (0.0, 0.0);
    for height in heights {
        above += f64::from(u8::from(height > thick));
        below += f64::from(u8::from(height < -thick));
    }
    let others = above + below;
    let is_one_sided = others >= 0.2 * all && f64::min(above, below) <= 0.02 * others;
    is_one_sided.then_some(if above > below { 1.0 } else { -1.0 })
}

/// Returns the largest distance of points from their mean.
fn radius(points: &[Point3]) -> f64 {
    let n = points.len().max(1) as f64;
    let centre: Point3 = std::array::from_fn(|i| points.iter().map(|p| p[i]).sum::<f64>() / n);
    let reach = |p: &Point3| dot(sub(*p, centre), sub(*p, centre)).sqrt();
    points.iter().map(reach).fold(0.0, f64::max)
}

/// Returns the diagonal of the bounding box of points.
fn diagonal(points: &[Point2]) -> f64 {
    let side = |i: usize| {
        let lo = points.iter().map(|p| p[i]).fold(f64::INFINITY, f64::min);
        let hi = points
            .iter()
            .map(|p| p[i])
            .fold(f64::NEG_INFINITY, f64::max);
        hi - lo
    };
    side(0).hypot(side(1))
}

/// Returns twice the area of a triangle, positive if it is counterclockwise.
fn turn(a: Point2, b: Point2, c: Point2) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Returns the convex hull, counterclockwise (Andrew's monotone chain).
fn hull(mut points: Vec<Point2>) -> Vec<Point2> {
    points.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let mut out = chain(points.iter());
    out.extend(chain(points.iter().rev()));
    out
}

/// Returns the lower hull of sorted points, without its last point.
fn chain<'a>(points: impl Iterator<Item = &'a Point2>) -> Vec<Point2> {
    let mut out: Vec<Point2> = Vec::new();
    for &p in points {
        while out.len() > 1 && turn(out[out.len() - 2], out[out.len() - 1], p) <= 0.0 {
            out.pop();
        }
        out.push(p);
    }
    out.pop();
    out
}

/// Fits a plane to the points within a distance of a plane; `None` if there are too few.
fn refined(points: &[Point3], at: Point3, normal: Point3, thick: f64) -> Option<(Point3, Point3)> {
    let is_near = |p: &Point3| dot(sub(*p, at), normal).abs() < thick;
    let near: Vec<Point3> = points.iter().copied().filter(is_near).collect();
    best_plane(&near).map(|plane| (plane.at, plane.normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_a_grid_is_its_corners() {
        let grid = (0..25).map(|k| [f64::from(k % 5), f64::from(k / 5)]);
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        assert_eq!(hull(grid.collect()), corners);
        assert_eq!(diagonal(&corners), 32f64.sqrt());
    }
}
