//! Exact predicates of points, and the exact intersection test of two triangles.
//!
//! Signs are those of exact arithmetic (crate `robust`, after Shewchuk 1997, "Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates"), provided that no product of
//! three differences leaves the range of doubles.

use isoform_geom::{Point3, cross, dot, sub};
use robust::{Coord, Coord3D};

/// Returns the sign of the volume of a tetrahedron: (b − a) · ((c − a) × (d − a)).
pub(super) fn volume_sign(a: Point3, b: Point3, c: Point3, d: Point3) -> i8 {
    let of = |p: Point3| Coord3D {
        x: p[0],
        y: p[1],
        z: p[2],
    };
    // Shewchuk's convention is the opposite one: positive where d lies below the plane.
    sign(-robust::orient3d(of(a), of(b), of(c), of(d)))
}

/// Returns the sign of the area of a triangle projected along an axis.
fn area_sign(axis: usize, a: Point3, b: Point3, c: Point3) -> i8 {
    let of = |p: Point3| Coord {
        x: p[(axis + 1) % 3],
        y: p[(axis + 2) % 3],
    };
    sign(robust::orient2d(of(a), of(b), of(c)))
}

/// Returns −1, 0 or +1.
fn sign(v: f64) -> i8 {
    i8::from(v > 0.0) - i8::from(v < 0.0)
}

/// Returns the axis of the largest component of a vector.
fn largest(v: Point3) -> usize {
    let n = v.map(f64::abs);
    if n[0] >= n[1] && n[0] >= n[2] {
        0
    } else if n[1] >= n[2] {
        1
    } else {
        2
    }
}

/// Returns an axis along which the projected triangle has an area; `None` if its corners are
/// collinear.
fn seen_along([a, b, c]: [Point3; 3]) -> Option<usize> {
    // The axis nearest to the normal is tried first; it nearly always succeeds.
    let first = largest(cross(sub(b, a), sub(c, a)));
    (first..first + 3)
        .map(|k| k % 3)
        .find(|&axis| area_sign(axis, a, b, c) != 0)
}

/// Returns true if the corners are collinear.
pub(super) fn is_flat(t: [Point3; 3]) -> bool {
    seen_along(t).is_none()
}

/// Returns true if two triangles meet outside of the corners and edges that they share by index.
///
/// This is the definition of CGAL's and libigl's `remesh_self_intersections`, except for coincident
/// nodes with different indices, which count as contact here. (libigl's `detect_only` misses folds,
/// i.e. coplanar pairs with a common edge, unless the plane is parallel to two axes; rational
/// arithmetic confirms the folds found here.) Two triangles with equal sets of corners are another
/// kind of defect and give `false`. Triangles must have an area.
///
/// # Panics
/// If a triangle has an index beyond the points.
pub fn triangles_meet(points: &[Point3], a: [u32; 3], b: [u32; 3]) -> bool {
    let turned = |t: [u32; 3], k: usize| [t[k], t[(k + 1) % 3], t[(k + 2) % 3]];
    let at = |t: [u32; 3]| t.map(|i| points[i as usize]);
    let shared = |i: &u32| b.contains(i);
    match a.iter().filter(|i| shared(i)).count() {
        0 => disjoint_meet(at(a), at(b)),
        1 => {
            let k = a.iter().position(shared).unwrap_or(0);
            let l = b.iter().position(|i| *i == a[k]).unwrap_or(0);
            corner_meet(at(turned(a, k)), at(turned(b, l)))
        }
        2 => {
            let k = a.iter().position(|i| !shared(i)).unwrap_or(0);
            let l = b.iter().position(|i| !a.contains(i)).unwrap_or(0);
            edge_meet(at(turned(a, k)), at(b)[l])
        }
        _ => false,
    }
}

/// Decides whether two triangles with a common edge meet elsewhere: `a`, whose first corner is the
/// one not shared, and the triangle with the free corner `q`.
///
/// Beyond the edge they meet only if they are coplanar and on one side of the edge. In
/// different planes, all common points lie on the line of intersection of the planes, which
/// contains the edge; in one plane, each triangle fills its side of the edge next to the edge.
/// Projected along an axis, points of a plane on one side of the edge stay on one side (or all fall
/// on a line), so that opposite sides along any axis decide already.
fn edge_meet([p, e, f]: [Point3; 3], q: Point3) -> bool {
    let first = largest(cross(sub(e, p), sub(f, p)));
    if area_sign(first, e, f, p) * area_sign(first, e, f, q) < 0 || volume_sign(p, e, f, q) != 0 {
        return false;
    }
    seen_along([p, e, f]).is_some_and(|axis| area_sign(axis, e, f, p) == area_sign(axis, e, f, q))
}

/// Decides whether two triangles with one common corner, the first of each, meet elsewhere.
///
/// If they have another point x in common, the ray from the corner through x leaves one of the
/// triangles first, through the side opposite to the corner, and is still in the other: that side
/// meets the other triangle. Two tests therefore suffice: the side of `a` against `b`, and that of
/// `b` against `a`. A side strictly on one side of the other's plane does not meet it; then the
/// triangles have only the corner in common, since the rest of the first lies on that side, too. A
/// side within the plane of the other triangle makes the two coplanar.
fn corner_meet(a: [Point3; 3], b: [Point3; 3]) -> bool {
    if corner_apart(a, b) {
        return false;
    }
    let sides =
        |t: [Point3; 3], of: [Point3; 3]| [1, 2].map(|k| volume_sign(t[0], t[1], t[2], of[k]));
    let (sa, sb) = (sides(b, a), sides(a, b));
    if sa[0] * sa[1] > 0 || sb[0] * sb[1] > 0 {
        return false;
    }
    if sa == [0, 0] {
        return seen_along(a).is_some_and(|axis| {
            flat_segment_meets(axis, [a[1], a[2]], b) || flat_segment_meets(axis, [b[1], b[2]], a)
        });
    }
    pierces([a[1], a[2]], b) || pierces([b[1], b[2]], a)
}

/// Decides whether two triangles without a common corner meet.
///
/// If all corners of one lie strictly on one side of the other's plane, they do not. If all six are
/// coplanar, an edge of `a` meets `b`, or else `b` lies within `a` if they meet at all, and then so
/// does its first corner. Otherwise the planes meet in a line, each triangle has a segment (or a
/// point) of it, and if these two meet, one of them has an end in the other. Such an end lies on an
/// edge that is not within the other's plane: it is inside an edge that crosses the line, or it is
/// a corner, and of the two edges at a corner on the line at least one leaves it. Hence only edges
/// not within the other's plane need a test.
fn disjoint_meet(a: [Point3; 3], b: [Point3; 3]) -> bool {
    if apart(a, b) {
        return false;
    }
    let sides = |t: [Point3; 3], of: [Point3; 3]| of.map(|p| volume_sign(t[0], t[1], t[2], p));
    let one_side = |s: [i8; 3]| s == [1; 3] || s == [-1; 3];
    let sa = sides(b, a);
    if one_side(sa) {
        return false;
    }
    if sa == [0; 3] {
        return seen_along(a).is_some_and(|axis| {
            (0..3).any(|k| flat_segment_meets(axis, [a[k], a[(k + 1) % 3]], b))
                || flat_inside(axis, b[0], a)
        });
    }
    let sb = sides(a, b);
    !one_side(sb) && (crossing_edge_pierces(sa, a, b) || crossing_edge_pierces(sb, b, a))
}

/// Returns true if an edge of `of` that is not within the plane of `t` meets `t`; `sides` are the
/// sides of that plane on which the corners lie.
fn crossing_edge_pierces(sides: [i8; 3], of: [Point3; 3], t: [Point3; 3]) -> bool {
    (0..3).map(|k| (k, (k + 1) % 3)).any(|(k, l)| {
        sides[k] * sides[l] <= 0 && (sides[k] != 0 || sides[l] != 0) && pierces([of[k], of[l]], t)
    })
}

/// Returns true if a segment meets the triangle `t`. It must not lie within the plane of `t`, and
/// its ends must lie on different sides of that plane or one of them on it.
///
/// The signs of the volumes over the edges tell on which sides, seen along the segment, the edges
/// pass the point where it meets the plane; that point is in the closed triangle if no two signs
/// are opposite.
fn pierces([p, q]: [Point3; 2], t: [Point3; 3]) -> bool {
    let s = [0, 1, 2].map(|k| volume_sign(p, q, t[k], t[(k + 1) % 3]));
    !(s.contains(&1) && s.contains(&-1))
}

/// Returns true if a point of the triangle's plane is in the closed triangle, whose projection
/// along the axis must have an area.
fn flat_inside(axis: usize, p: Point3, t: [Point3; 3]) -> bool {
    let s = [0, 1, 2].map(|k| area_sign(axis, t[k], t[(k + 1) % 3], p));
    !(s.contains(&1) && s.contains(&-1))
}

/// Returns true if a segment of the triangle's plane meets the closed triangle: its first end is
/// inside, or it meets an edge.
fn flat_segment_meets(axis: usize, s: [Point3; 2], t: [Point3; 3]) -> bool {
    flat_inside(axis, s[0], t)
        || (0..3).any(|k| flat_segments_meet(axis, s, [t[k], t[(k + 1) % 3]]))
}

/// Returns true if two closed coplanar segments meet, projected along an axis.
///
/// They do not if both ends of one lie strictly on one side of the other's line. Collinear segments
/// meet if their ranges of both coordinates meet. Otherwise the lines cross in one point (parallel
/// ones failed the first test), which lies in both segments.
fn flat_segments_meet(axis: usize, [p, q]: [Point3; 2], [r, s]: [Point3; 2]) -> bool {
    let (r_side, s_side) = (area_sign(axis, p, q, r), area_sign(axis, p, q, s));
    let (p_side, q_side) = (area_sign(axis, r, s, p), area_sign(axis, r, s, q));
    if r_side * s_side > 0 || p_side * q_side > 0 {
        return false;
    }
    if [r_side, s_side, p_side, q_side] != [0; 4] {
        return true;
    }
    [(axis + 1) % 3, (axis + 2) % 3]
        .into_iter()
        .all(|i| p[i].min(q[i]) <= r[i].max(s[i]) && r[i].min(s[i]) <= p[i].max(q[i]))
}

/// Error bound of a sum of three products, relative to the sum of their absolute values. The
/// roundings of a difference, its product and two additions make 4 ε/2; the bound is twice that,
/// because it is rounded itself.
const DOT_ERROR: f64 = 4.0 * f64::EPSILON;

/// Returns a lower and an upper bound of d · x, where the components of x are rounded differences
/// of doubles.
fn dot_bounds(d: Point3, x: Point3) -> (f64, f64) {
    let v = dot(d, x);
    let error = DOT_ERROR * ((d[0] * x[0]).abs() + (d[1] * x[1]).abs() + (d[2] * x[2]).abs())
        + f64::MIN_POSITIVE;
    (v - error, v + error)
}

/// Returns a vector divided by its length, rounded.
#[inline]
fn unit(v: Point3) -> Point3 {
    let s = 1.0 / dot(v, v).sqrt();
    v.map(|c| c * s)
}

/// Returns the two edges of a triangle at its first corner.
#[inline]
fn edges_at_corner(t: [Point3; 3]) -> [Point3; 2] {
    [sub(t[1], t[0]), sub(t[2], t[0])]
}

/// Returns true if the plane through the common corner with the normal `d` provably has the vectors
/// `a` above it and the vectors `b` below.
#[inline]
fn is_between(d: Point3, a: [Point3; 2], b: [Point3; 2]) -> bool {
    a.iter().all(|&x| dot_bounds(d, x).0 > 0.0) && b.iter().all(|&x| dot_bounds(d, x).1 < 0.0)
}

/// Returns true if one of a few candidate planes separates two triangles with a common first
/// corner. Candidates may be rounded in any way: only the signs must be certain.
fn corner_apart(a: [Point3; 3], b: [Point3; 3]) -> bool {
    let (a, b) = (edges_at_corner(a), edges_at_corner(b));
    let ([u1, u2], [v1, v2]) = (a.map(unit), b.map(unit));
    // Direction from one bisector to the other.
    let d = std::array::from_fn(|i| (u1[i] + u2[i]) - (v1[i] + v2[i]));
    if is_between(d, a, b) {
        return true;
    }
    let (na, nb) = (cross(a[0], a[1]), cross(b[0], b[1]));
    // Planes through the middle of a gap between the triangles, where x and y are the edges at the
    // gap.
    [(na, u2, v1), (na, u1, v2), (nb, u2, v1), (nb, u1, v2)]
        .into_iter()
        .any(|(n, x, y)| {
            let middle = [x[0] + y[0], x[1] + y[1], x[2] + y[2]];
            let d = cross(n, middle);
            is_between(d, a, b) || is_between(d, b, a)
        })
}

/// Returns a lower bound of the minimum and an upper bound of the maximum of d · x over the
/// corners.
#[inline]
fn range_along(d: Point3, corners: [Point3; 3]) -> (f64, f64) {
    let s = corners.map(|x| dot_bounds(d, x));
    (
        s[0].0.min(s[1].0).min(s[2].0),
        s[0].1.max(s[1].1).max(s[2].1),
    )
}

/// Returns true if a plane normal to one of a few candidate directions separates two triangles: the
/// normals, and the in-plane normals of the edges.
fn apart(a: [Point3; 3], b: [Point3; 3]) -> bool {
    let o = a[0];
    let (ra, rb) = (a.map(|p| sub(p, o)), b.map(|p| sub(p, o)));
    let edges = |r: [Point3; 3]| [sub(r[1], r[0]), sub(r[2], r[1]), sub(r[0], r[2])];
    let (ea, eb) = (edges(ra), edges(rb));
    let (na, nb) = (cross(ea[0], ea[1]), cross(eb[0], eb[1]));
    let separates = |d: Point3| {
        let (x, y) = (range_along(d, ra), range_along(d, rb));
        x.1 < y.0 || y.1 < x.0
    };
    separates(na)
        || separates(nb)
        || ea.iter().any(|&e| separates(cross(na, e)))
        || eb.iter().any(|&e| separates(cross(nb, e)))
}

#[cfg(test)]
#[path = "exact_tests.rs"]
mod tests;
