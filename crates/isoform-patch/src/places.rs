//! Small geometric functions shared by several modules: widened boxes, grids of parameters, points
//! on lines.

use isoform_geom::{Aabb, Point3, norm};

/// Returns true if a point lies in a box, boundary included.
pub(crate) fn contains(region: &Aabb, p: Point3) -> bool {
    (0..3).all(|k| region.lo[k] <= p[k] && p[k] <= region.hi[k])
}

/// Returns a box widened by a length on each side.
pub(crate) fn wider(region: &Aabb, by: f64) -> Aabb {
    Aabb {
        lo: region.lo.map(|v| v - by),
        hi: region.hi.map(|v| v + by),
    }
}

/// Returns a box widened by a fraction of its edges on each side.
pub(crate) fn wider_by_share(region: &Aabb, share: f64) -> Aabb {
    let more = region.size().map(|s| share * s);
    Aabb {
        lo: std::array::from_fn(|k| region.lo[k] - more[k]),
        hi: std::array::from_fn(|k| region.hi[k] + more[k]),
    }
}

/// Returns the parameters of a grid of `count` × `count` points of the unit square, borders
/// included; points with equal u are consecutive.
pub(crate) fn grid(count: usize) -> impl Iterator<Item = (f64, f64)> {
    let at = move |i: usize| i as f64 / (count - 1) as f64;
    (0..count * count).map(move |k| (at(k / count), at(k % count)))
}

/// Returns the centres of `count` × `count` cells of the unit square; those with equal u are
/// consecutive.
pub(crate) fn middles(count: usize) -> impl Iterator<Item = (f64, f64)> {
    let at = move |i: usize| (i as f64 + 0.5) / count as f64;
    (0..count * count).map(move |k| (at(k / count), at(k % count)))
}

/// Returns the unit vector in a direction.
#[inline]
pub(crate) fn normalized(v: Point3) -> Point3 {
    let length = norm(v);
    v.map(|v| v / length)
}

/// Returns p + t d.
#[inline]
pub(crate) fn moved(p: Point3, t: f64, d: Point3) -> Point3 {
    std::array::from_fn(|k| p[k] + t * d[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grids_reach_the_borders_and_middles_do_not() {
        let all: Vec<(f64, f64)> = grid(3).collect();
        assert_eq!(
            (all[0], all[1], all[8]),
            ((0.0, 0.0), (0.0, 0.5), (1.0, 1.0))
        );
        let all: Vec<(f64, f64)> = middles(2).collect();
        assert_eq!((all.len(), all[1]), (4, (0.25, 0.75)));
    }

    #[test]
    fn boxes_grow_on_all_sides() {
        let region = Aabb {
            lo: [0.0; 3],
            hi: [1.0, 2.0, 4.0],
        };
        assert_eq!(wider(&region, 0.5).hi, [1.5, 2.5, 4.5]);
        assert_eq!(wider_by_share(&region, 0.5).lo, [-0.5, -1.0, -2.0]);
        assert!(contains(&region, region.hi) && !contains(&region, [0.5, 0.5, -1e-9]));
    }
}
