//! Meshes of second order: nodes in the middles of edges, on the true surface and on the feature
//! curves.

use crate::surface::{SKIN, Surface};
use isoform_geom::{Mesh, Point3, TET_EDGES, TRIANGLE_EDGES, norm, sub};
use rayon::prelude::*;

/// Share of an edge's length that its middle may move to reach the surface. Farther points are
/// another sheet or a failed iteration.
const REACH: f64 = 0.3;
/// Scaled Jacobian below which a tetrahedron's curved edges are drawn back or its inner ones
/// follow.
const JACOBIAN: f64 = 0.35;

fn key(a: u32, b: u32) -> u64 {
    u64::from(a.min(b)) << 32 | u64::from(a.max(b))
}

/// Puts a node into the middle of every edge. `pieces` are the pieces of the mesh's parts. Returns
/// the middles of edges that could not be brought onto the surface.
pub(crate) fn add_middles(mesh: &mut Mesh, surface: &Surface<'_>, pieces: &[u32]) -> Vec<Point3> {
    let mut edges: Vec<u64> = Vec::with_capacity(6 * mesh.tets.len() + 3 * mesh.triangles.len());
    for t in &mesh.tets {
        edges.extend(TET_EDGES.map(|[i, j]| key(t[i], t[j])));
    }
    for t in &mesh.triangles {
        edges.extend(TRIANGLE_EDGES.map(|[i, j]| key(t[i], t[j])));
    }
    edges.par_sort_unstable();
    edges.dedup();
    // Edges of the surface with the parts on both sides.
    let mut rim: Vec<(u64, u32)> = mesh
        .triangles
        .iter()
        .zip(&mesh.triangle_parts)
        .flat_map(|(t, &part)| TRIANGLE_EDGES.map(|[i, j]| (key(t[i], t[j]), part)))
        .collect();
    rim.par_sort_unstable();
    let mut sharp: Vec<u64> = mesh.edges.iter().map(|e| key(e[0], e[1])).collect();
    sharp.sort_unstable();
    let ends = |e: u64| [(e >> 32) as usize, (e & 0xFFFF_FFFF) as usize].map(|v| mesh.points[v]);
    let curved: Vec<(u64, Option<Point3>)> = rim
        .par_chunk_by(|a, b| a.0 == b.0)
        .map(|same| {
            let e = same[0].0;
            let [p, q] = ends(e);
            let middle: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
            let mut on: Vec<u32> = same.iter().map(|s| pieces[s.1 as usize]).collect();
            on.dedup();
            if sharp.binary_search(&e).is_err() {
                // Across a seam between parts that touch tangentially either may be the surface.
                let one = on.len() == 1
                    && [p, q]
                        .iter()
                        .all(|&end| surface.distance(on[0], end) == 0.0);
                on = vec![if one { on[0] } else { SKIN }];
            }
            let target = surface
                .project(&on, middle)
                .filter(|m| norm(sub(*m, middle)) <= REACH * norm(sub(p, q)));
            (e, target)
        })
        .collect();
    let first = mesh.points.len() as u32;
    let mut middles: Vec<Point3> = edges
        .par_iter()
        .map(|&e| {
            let [p, q] = ends(e);
            std::array::from_fn(|i| 0.5 * (p[i] + q[i]))
        })
        .collect();
    let mut off = Vec::new();
    let at = |a: u32, b: u32| {
        edges
            .binary_search(&key(a, b))
            .expect("all edges are listed")
    };
    for (e, target) in curved {
        let k = at((e >> 32) as u32, e as u32);
        match target {
            Some(p) => middles[k] = p,
            None => off.push(middles[k]),
        }
    }
    let of_tet = |t: &[u32; 4]| TET_EDGES.map(|[i, j]| at(t[i], t[j]) as u32);
    mesh.tet_mids = mesh.tets.par_iter().map(of_tet).collect();
    mesh.triangle_mids = mesh
        .triangles
        .par_iter()
        .map(|t| TRIANGLE_EDGES.map(|[i, j]| at(t[i], t[j]) as u32 + first))
        .collect();
    mesh.edge_mids = mesh
        .edges
        .iter()
        .map(|e| at(e[0], e[1]) as u32 + first)
        .collect();
    let fixed: Vec<bool> = {
        let mut fixed = vec![false; edges.len()];
        for (e, _) in &rim {
            fixed[at((e >> 32) as u32, *e as u32)] = true;
        }
        fixed
    };
    let mut mids = std::mem::take(&mut mesh.tet_mids);
    relax(mesh, &mids, &mut middles, &fixed);
    mids.par_iter_mut().for_each(|m| *m = m.map(|k| k + first));
    mesh.tet_mids = mids;
    mesh.points.extend(middles);
    off
}

/// Where a curved face presses on a tetrahedron, the inner middles around give way.
fn relax(mesh: &Mesh, mids: &[[u32; 6]], middles: &mut [Point3], fixed: &[bool]) {
    let nodes = |t: usize, middles: &[Point3]| -> [Point3; 10] {
        std::array::from_fn(|k| {
            if k < 4 {
                mesh.points[mesh.tets[t][k] as usize]
            } else {
                middles[mids[t][k - 4] as usize]
            }
        })
    };
    let bad: Vec<usize> = (0..mids.len())
        .into_par_iter()
        .filter(|&t| {
            mids[t].iter().any(|&m| fixed[m as usize])
                && scaled_jacobian(&nodes(t, middles)) < JACOBIAN
        })
        .collect();
    if bad.is_empty() {
        return;
    }
    // Tetrahedra at each middle that may move.
    let mut free: Vec<u32> = bad
        .iter()
        .flat_map(|&t| mids[t])
        .filter(|&m| !fixed[m as usize])
        .collect();
    free.sort_unstable();
    free.dedup();
    let mut around: Vec<(u32, u32)> = Vec::new();
    for (t, m) in mids.iter().enumerate() {
        around.extend(
            m.iter()
                .filter(|m| free.binary_search(m).is_ok())
                .map(|&m| (m, t as u32)),
        );
    }
    around.sort_unstable();
    for _ in 0..6 {
        for star in around.chunk_by(|a, b| a.0 == b.0) {
            let m = star[0].0 as usize;
            let worst = |middles: &[Point3]| {
                star.iter()
                    .map(|s| scaled_jacobian(&nodes(s.1 as usize, middles)))
                    .fold(f64::INFINITY, f64::min)
            };
            let mut best = worst(middles);
            if best >= JACOBIAN {
                continue;
            }
            let t = star[0].1 as usize;
            let k = mids[t].iter().position(|&o| o as usize == m).unwrap_or(0);
            let [i, j] = TET_EDGES[k];
            let length = norm(sub(
                mesh.points[mesh.tets[t][i] as usize],
                mesh.points[mesh.tets[t][j] as usize],
            ));
            // Compass search: six directions, ever shorter steps.
            let mut step = 0.1 * length;
            while step > 0.004 * length {
                let before = middles[m];
                let mut found = None;
                for axis in 0..3 {
                    for sign in [-1.0, 1.0] {
                        middles[m] = before;
                        middles[m][axis] += sign * step;
                        let w = worst(middles);
                        if w > best {
                            (best, found) = (w, Some(middles[m]));
                        }
                    }
                }
                middles[m] = found.unwrap_or(before);
                if found.is_none() {
                    step *= 0.5;
                }
            }
        }
    }
}

/// Least over largest Jacobian determinant of a ten-node tetrahedron, over its nodes and centre.
pub(crate) fn scaled_jacobian(x: &[Point3; 10]) -> f64 {
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for p in SAMPLES {
        let j = jacobian(x, p);
        least = least.min(j);
        most = most.max(j.abs());
    }
    if most > 0.0 { least / most } else { -1.0 }
}

/// Barycentric coordinates of the nodes and the centre.
const SAMPLES: [[f64; 4]; 11] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
    [0.5, 0.5, 0.0, 0.0],
    [0.0, 0.5, 0.5, 0.0],
    [0.5, 0.0, 0.5, 0.0],
    [0.5, 0.0, 0.0, 0.5],
    [0.0, 0.5, 0.0, 0.5],
    [0.0, 0.0, 0.5, 0.5],
    [0.25, 0.25, 0.25, 0.25],
];

fn jacobian(x: &[Point3; 10], l: [f64; 4]) -> f64 {
    // Derivative of the position by each barycentric coordinate; the Jacobian is that by the last
    // three against the first.
    let mut d = [[0.0; 3]; 4];
    for i in 0..4 {
        for c in 0..3 {
            d[i][c] = (4.0 * l[i] - 1.0) * x[i][c];
        }
    }
    for (k, [i, j]) in TET_EDGES.into_iter().enumerate() {
        for c in 0..3 {
            d[i][c] += 4.0 * l[j] * x[4 + k][c];
            d[j][c] += 4.0 * l[i] * x[4 + k][c];
        }
    }
    let [u, v, w] = [1, 2, 3].map(|i| sub(d[i], d[0]));
    isoform_geom::dot(u, isoform_geom::cross(v, w))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jacobian_of_straight_and_of_curved_edges() {
        let p: [Point3; 4] = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
        let mut x: [Point3; 10] = std::array::from_fn(|k| {
            if k < 4 {
                p[k]
            } else {
                std::array::from_fn(|c| {
                    0.5 * (p[TET_EDGES[k - 4][0]][c] + p[TET_EDGES[k - 4][1]][c])
                })
            }
        });
        assert!((jacobian(&x, [0.25; 4]) - 8.0).abs() < 1e-12);
        assert!((scaled_jacobian(&x) - 1.0).abs() < 1e-12);
        // The middle of the edge along x moved along it by d: dx/dr at its ends is 2 ± 4 d, and J
        // is 4 times that.
        x[4][0] += 0.1;
        assert!((jacobian(&x, SAMPLES[0]) - 4.0 * 2.4).abs() < 1e-12);
        assert!((jacobian(&x, SAMPLES[1]) - 4.0 * 1.6).abs() < 1e-12);
    }
}
