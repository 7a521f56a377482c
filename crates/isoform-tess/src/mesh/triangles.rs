//! Triangles of a surface: corners, degeneracy, and removal of triangles and vertices.

use crate::surface::{Point3, Surface};
use isoform_geom::{cross, norm, sub};

/// Distance below which two vertices coincide, in half widths of the box.
pub(super) const COINCIDENCE_DISTANCE: f64 = 4e-9;

pub(super) fn corners(s: &Surface, t: &[u32; 3]) -> [Point3; 3] {
    t.map(|v| s.points[v as usize])
}
pub(super) fn normal([p, q, r]: [Point3; 3]) -> Point3 {
    cross(sub(q, p), sub(r, p))
}
pub(super) fn is_flat(at: [Point3; 3], half_width: f64) -> bool {
    // Rounding of the corners gives a degenerate triangle up to this area.
    norm(normal(at)) < 2e-14 * half_width * half_width
}

/// Removes all triangles except some, with their data.
pub(super) fn keep(s: &mut Surface, is_kept: impl Fn(&Surface, &[u32; 3]) -> bool) {
    let kept: Vec<usize> = (0..s.triangles.len())
        .filter(|&k| is_kept(s, &s.triangles[k]))
        .collect();
    s.triangles = kept.iter().map(|&k| s.triangles[k]).collect();
    s.charts = kept.iter().map(|&k| s.charts[k]).collect();
    s.corners = kept.iter().map(|&k| s.corners[k]).collect();
    s.borders = kept.iter().map(|&k| s.borders[k]).collect();
    s.pieces = kept.iter().map(|&k| s.pieces[k]).collect();
}

/// Removes vertices that no triangle uses.
pub(super) fn leave_out(s: &mut Surface, left_out: &[bool]) {
    let kept = |v: &usize| !left_out[*v];
    let vertices: Vec<usize> = (0..s.points.len()).filter(kept).collect();
    let mut new = vec![0; s.points.len()];
    for (n, &v) in vertices.iter().enumerate() {
        new[v] = n as u32;
    }
    let corners = s.triangles.iter_mut().flatten();
    corners.for_each(|v| *v = new[*v as usize]);
    s.winding
        .renumber(|v| (!left_out[v as usize]).then(|| new[v as usize]));
    s.points = vertices.iter().map(|&v| s.points[v]).collect();
    s.kinds = vertices.iter().map(|&v| s.kinds[v]).collect();
    s.faces = vertices.iter().map(|&v| s.faces[v]).collect();
    s.double = vertices.iter().map(|&v| s.double[v]).collect();
}
