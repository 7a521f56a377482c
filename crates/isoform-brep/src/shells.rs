//! Shells, and the voids of each.

use crate::BrepError;
use crate::topology::{TriangleSide, components};
use isoform_geom::brep::Body;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Returns the solids that the shells of a closed mesh bound; `face_of` are the faces of its
/// triangles.
pub(crate) fn solids(
    points: &[Point3],
    triangles: &[[u32; 3]],
    across: &[[TriangleSide; 3]],
    face_of: &[u32],
) -> Result<Vec<Body>, BrepError> {
    let (shell_of, count) = components(across, |_, _| true);
    let mut shells = vec![Shell::default(); count];
    for (t, &s) in shell_of.iter().enumerate() {
        shells[s as usize].triangles.push(triangles[t]);
        shells[s as usize].faces.push(face_of[t]);
    }
    for shell in &mut shells {
        shell.faces.sort_unstable();
        shell.faces.dedup();
        shell.volume = volume(points, &shell.triangles);
    }
    let (outer, voids): (Vec<Shell>, Vec<Shell>) = shells.into_iter().partition(|s| s.volume > 0.0);
    let mut solids: Vec<Body> = outer
        .iter()
        .map(|s| Body {
            outer: s.faces.clone(),
            voids: Vec::new(),
        })
        .collect();
    for void in voids {
        let inside = points[void.triangles[0][0] as usize];
        // The smallest shell around it.
        let around =
            (0..outer.len()).filter(|&k| winding(points, &outer[k].triangles, inside) > 0.5);
        let host = around.min_by(|a, b| outer[*a].volume.total_cmp(&outer[*b].volume));
        let host = host.ok_or(BrepError::LooseVoid)?;
        solids[host].voids.push(void.faces);
    }
    Ok(solids)
}

#[derive(Clone, Debug, Default)]
struct Shell {
    triangles: Vec<[u32; 3]>,
    faces: Vec<u32>,
    volume: f64,
}

/// Returns the volume enclosed by triangles.
pub(crate) fn volume(points: &[Point3], triangles: &[[u32; 3]]) -> f64 {
    let origin = triangles
        .first()
        .map_or([0.0; 3], |t| points[t[0] as usize]);
    let each = triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| sub(points[v as usize], origin));
        dot(a, cross(b, c)) / 6.0
    });
    each.sum()
}

/// Returns the winding number of triangles around a point: the sum of their solid angles (Van
/// Oosterom and Strackee 1983) over that of the sphere.
fn winding(points: &[Point3], triangles: &[[u32; 3]], p: Point3) -> f64 {
    let each = triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| sub(points[v as usize], p));
        let [la, lb, lc] = [norm(a), norm(b), norm(c)];
        let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross(b, c)).atan2(below)
    });
    each.sum::<f64>() / (4.0 * std::f64::consts::PI)
}
