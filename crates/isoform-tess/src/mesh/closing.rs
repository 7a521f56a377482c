//! Final checks and repairs of the triangles, by their indices and positions alone.

use super::contraction::contract_flat;
use super::geometry::distance;
use super::triangles::{COINCIDENCE_DISTANCE, corners, is_flat, keep, leave_out};
use crate::finding::Finding;
use crate::surface::{Point3, Surface};
use std::collections::{BTreeMap, BTreeSet};

/// Checks that the surface stays in the box and ends on its faces only, that no edge outside of the
/// double curve has more than two triangles, and that the winding is consistent.
fn check(s: &mut Surface, half_width: f64, glued: bool) {
    let uses = s.edges(&s.borders);
    let open = s.open_edges(&uses);
    let is_crowded = |e: &[u32; 2], n: usize| n > 2 && !(s.is_double(e) && n.is_multiple_of(2));
    let crowded = uses.iter().filter(|(e, (n, _))| is_crowded(e, *n)).count();
    let has_no_area = |t: &&[u32; 3]| is_flat(corners(s, t), half_width);
    let flat = s.triangles.iter().filter(has_no_area).count();
    if glued {
        let twice = count_coincident(
            s,
            uses.keys().flatten().copied(),
            COINCIDENCE_DISTANCE * half_width,
        );
        if twice > 0 {
            s.findings.push(Finding::CoincidentVertices(twice));
        }
    }
    // Vertices may lie outside by 1e-9 half widths for rounding.
    let is_outside = |p: &&Point3| p.iter().any(|x| x.abs() > (1.0 + 1e-9) * half_width);
    let outside = s.points.iter().filter(is_outside).count();
    let counts = [
        (outside, Finding::OutsideBox(outside)),
        (flat, Finding::NoArea(flat)),
        (open, Finding::OpenEdges(open)),
        (crowded, Finding::CrowdedEdges(crowded)),
    ];
    let found = counts.into_iter().filter(|c| c.0 > 0);
    s.findings.extend(found.map(|c| c.1));
    s.check_winding();
}

/// Returns the number of pairs of vertices that are nearer to each other than a distance.
fn count_coincident(s: &Surface, vertices: impl Iterator<Item = u32>, close: f64) -> usize {
    // In the order along one axis, points that are near to each other are near, too.
    let used: BTreeSet<u32> = vertices.collect();
    let mut points: Vec<Point3> = used.iter().map(|&v| s.points[v as usize]).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let near = |i: usize| {
        let after = points[i + 1..]
            .iter()
            .take_while(|q| q[0] - points[i][0] < close)
            // A plane across the axis may contain all vertices; the number of comparisons is
            // bounded.
            .take(1000);
        after.filter(|q| distance(points[i], **q) < close).count()
    };
    (0..points.len()).map(near).sum()
}

/// Returns the number of vertices whose triangles are not connected by edges there: they join
/// sheets that do not meet in the parameters.
pub(super) fn pinched(s: &Surface) -> usize {
    let mut around: Vec<Vec<[u32; 2]>> = vec![Vec::new(); s.points.len()];
    for t in &s.triangles {
        (0..3).for_each(|i| around[t[i] as usize].push([t[(i + 1) % 3], t[(i + 2) % 3]]));
    }
    let is_pinched = |link: &&Vec<[u32; 2]>| {
        let mut left = (*link).clone();
        let mut reached: Vec<u32> = left.pop().into_iter().flatten().collect();
        while let Some(v) = reached.pop() {
            left.retain(|e| match e.iter().position(|&x| x == v) {
                Some(k) => {
                    reached.push(e[1 - k]);
                    false
                }
                None => true,
            });
        }
        !left.is_empty()
    };
    around.iter().filter(is_pinched).count()
}

/// Removes vertices without a position and the triangles at them, and adds a finding.
fn leave_out_lost(s: &mut Surface) {
    let is_lost = |s: &Surface, v: u32| !s.points[v as usize].iter().all(|x| x.is_finite());
    let lost: Vec<bool> = (0..s.points.len() as u32).map(|v| is_lost(s, v)).collect();
    let count = lost.iter().filter(|l| **l).count();
    if count == 0 {
        return;
    }
    s.findings.push(Finding::NoPosition(count));
    keep(s, |s, t| !t.iter().any(|&v| is_lost(s, v)));
    leave_out(s, &lost);
}

/// Returns true if two corners of a triangle are one vertex.
fn is_closed_up(t: &[u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

/// Edges of a triangle, as pairs of corners.
const EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// Returns the vertices of an edge, the smaller index first.
fn edge(t: &[u32; 3], [i, j]: [usize; 2]) -> [u32; 2] {
    [t[i].min(t[j]), t[i].max(t[j])]
}

/// Returns the sides of the domain on which edges of collapsed triangles lie. A triangle collapses
/// if two of its corners are on one contracted curve.
fn borders_closed_up(s: &Surface) -> BTreeMap<[u32; 2], u64> {
    let mut borders: BTreeMap<[u32; 2], u64> = BTreeMap::new();
    let triangles = s.triangles.iter().zip(&s.borders);
    for (t, bits) in triangles.filter(|(t, _)| is_closed_up(t)) {
        for [i, j] in EDGES {
            if t[i] != t[j] && bits[i] & bits[j] != 0 {
                *borders.entry(edge(t, [i, j])).or_default() |= bits[i] & bits[j];
            }
        }
    }
    borders
}

/// Passes the sides of the domain on which edges of collapsed triangles lie to the adjacent
/// triangles.
fn hand_on_borders(s: &mut Surface) {
    let borders = borders_closed_up(s);
    if borders.is_empty() {
        return;
    }
    for (t, bits) in s.triangles.iter().zip(&mut s.borders) {
        for [i, j] in EDGES {
            let side = borders.get(&edge(t, [i, j])).copied().unwrap_or(0);
            bits[i] |= side;
            bits[j] |= side;
        }
    }
}

/// Removes collapsed triangles, and triangles without area as far as their short edges can be
/// contracted; `tolerance` is that of the surface at a point.
pub(super) fn finish(
    mut s: Surface,
    half_width: f64,
    glued: bool,
    tolerance: &dyn Fn(Point3) -> f64,
) -> Surface {
    hand_on_borders(&mut s);
    keep(&mut s, |_, t| !is_closed_up(t));
    leave_out_lost(&mut s);
    contract_flat(&mut s, half_width, tolerance);
    s.count_pieces();
    check(&mut s, half_width, glued);
    // A finding of several places is reported once, in an order that does not depend on places.
    s.findings.sort_by_cached_key(ToString::to_string);
    s.findings.dedup();
    s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two fans at a vertex without a common edge are a pinch; one more triangle joins them to one
    /// fan.
    #[test]
    fn pinched_vertices_are_counted() {
        let mut s = Surface {
            points: vec![[0.0; 3]; 7],
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 0], [0, 5, 6]],
            ..Surface::default()
        };
        assert_eq!(pinched(&s), 1);
        s.triangles.push([0, 3, 4]);
        assert_eq!(pinched(&s), 0);
    }
}
