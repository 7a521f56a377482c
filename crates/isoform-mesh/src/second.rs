//! Meshes of second order: mid-edge nodes on the exact surface and on the feature curves.
//!
//! A ten-node tetrahedron has a node at each corner and one per edge; its map is x(λ) = Σ λᵢ(2λᵢ −
//! 1) xᵢ + Σ 4 λᵢλⱼ xᵢⱼ in barycentric coordinates λ. If all edges are straight, its Jacobian
//!    determinant is the constant 6 V.

use crate::assemble::LabelledMesh;
use crate::error::{MeshError, Warning, WarningKind};
use crate::options::Options;
use crate::points::midpoint;
use crate::surface::Surface;
use isoform_geom::{Mesh, Point3, TET_EDGES, TRIANGLE_EDGES, cross, dot, norm, sub};
use rayon::prelude::*;

/// Scaled Jacobian below which the inner mid nodes of a tetrahedron are moved.
const TARGET_SCALED_JACOBIAN: f64 = 0.35;
/// First and smallest step of the search for a better position, in lengths of the edge.
const SEARCH_STEP_RANGE: [f64; 2] = [0.1, 0.004];

/// Adds mid-edge nodes, if requested. Returns a warning for each that could not be projected onto
/// the surface.
pub(crate) fn raise_order(
    labelled: &mut LabelledMesh,
    surface: &Surface<'_>,
    options: &Options,
) -> Result<Vec<Warning>, MeshError> {
    if options.order != 2 {
        return Ok(Vec::new());
    }
    surface.control.begin("second order")?;
    let off = add_middles(&mut labelled.mesh, surface, &labelled.pieces);
    Ok(Warning::each(WarningKind::MiddleOff, off))
}

/// Returns the centroids of the second-order tetrahedra that are inverted by their mid nodes: edges
/// there are too long for the curvature of the surface.
pub(crate) fn turned(mesh: &Mesh) -> Vec<Point3> {
    let is_turned = |t: &usize| {
        let (corners, mids) = (mesh.tets[*t], mesh.tet_mids[*t]);
        let node = |k: usize| if k < 4 { corners[k] } else { mids[k - 4] };
        scaled_jacobian(&std::array::from_fn(|k| mesh.points[node(k) as usize])) <= 0.0
    };
    let all = (0..mesh.tet_mids.len()).into_par_iter();
    let middle = |t: usize| {
        let [a, b, c, d] = mesh.tets[t].map(|v| mesh.points[v as usize]);
        midpoint(midpoint(a, b), midpoint(c, d))
    };
    all.filter(is_turned).map(middle).collect()
}

/// Encodes an edge as one number, its lower vertex in the upper half.
fn key(a: u32, b: u32) -> u64 {
    u64::from(a.min(b)) << 32 | u64::from(a.max(b))
}

/// Returns the vertices of an encoded edge.
fn ends(edge: u64) -> [u32; 2] {
    [(edge >> 32) as u32, edge as u32]
}

/// All edges of a mesh, sorted: the position of an edge is the index of its mid node.
struct Edges(Vec<u64>);

impl Edges {
    fn from_mesh(mesh: &Mesh) -> Self {
        let mut edges = Vec::with_capacity(6 * mesh.tets.len() + 3 * mesh.triangles.len());
        for t in &mesh.tets {
            edges.extend(TET_EDGES.map(|[i, j]| key(t[i], t[j])));
        }
        for t in &mesh.triangles {
            edges.extend(TRIANGLE_EDGES.map(|[i, j]| key(t[i], t[j])));
        }
        edges.par_sort_unstable();
        edges.dedup();
        Self(edges)
    }

    fn at(&self, a: u32, b: u32) -> usize {
        self.0
            .binary_search(&key(a, b))
            .expect("all edges are listed")
    }

    /// Returns the midpoints of all edges.
    fn middles(&self, mesh: &Mesh) -> Vec<Point3> {
        let middle = |&e: &u64| {
            let [p, q] = ends(e).map(|v| mesh.points[v as usize]);
            midpoint(p, q)
        };
        self.0.par_iter().map(middle).collect()
    }
}

/// Adds a node at the middle of every edge. `pieces` are the pieces of the mesh's parts. Returns
/// the midpoints of edges that could not be projected onto the surface.
fn add_middles(mesh: &mut Mesh, surface: &Surface<'_>, pieces: &[u32]) -> Vec<Point3> {
    let edges = Edges::from_mesh(mesh);
    let mut middles = edges.middles(mesh);
    let mut fixed = vec![false; middles.len()];
    let mut off = Vec::new();
    for (e, target) in curved_middles(mesh, surface, pieces) {
        let [a, b] = ends(e);
        let k = edges.at(a, b);
        fixed[k] = true;
        match target {
            Some(p) => middles[k] = p,
            None => off.push(middles[k]),
        }
    }
    let mut mids: Vec<[u32; 6]> = mesh
        .tets
        .par_iter()
        .map(|t| TET_EDGES.map(|[i, j]| edges.at(t[i], t[j]) as u32))
        .collect();
    let curved = CurvedTets {
        mesh,
        mids: &mids,
        fixed: &fixed,
    };
    curved.relax(&mut middles);
    let first = mesh.points.len() as u32;
    let number = |a: u32, b: u32| edges.at(a, b) as u32 + first;
    mesh.triangle_mids = mesh
        .triangles
        .par_iter()
        .map(|t| TRIANGLE_EDGES.map(|[i, j]| number(t[i], t[j])))
        .collect();
    mesh.edge_mids = mesh.edges.iter().map(|e| number(e[0], e[1])).collect();
    mids.par_iter_mut().for_each(|m| *m = m.map(|k| k + first));
    mesh.tet_mids = mids;
    mesh.points.extend(middles);
    off
}

/// Returns the edges of the surface, each with its midpoint projected onto the surface; `None` if
/// that is too far away.
fn curved_middles(
    mesh: &Mesh,
    surface: &Surface<'_>,
    pieces: &[u32],
) -> Vec<(u64, Option<Point3>)> {
    // Edges of the surface with the parts on both sides.
    let mut rim: Vec<(u64, u32)> = mesh
        .triangles
        .iter()
        .zip(&mesh.triangle_parts)
        .flat_map(|(t, &part)| TRIANGLE_EDGES.map(|[i, j]| (key(t[i], t[j]), part)))
        .collect();
    rim.par_sort_unstable();
    let edges = mesh.edges.iter().zip(&mesh.edge_curves);
    let mut sharp: Vec<(u64, u32)> = edges.map(|(e, &c)| (key(e[0], e[1]), c)).collect();
    sharp.sort_unstable();
    rim.par_chunk_by(|a, b| a.0 == b.0)
        .map(|same| {
            let e = same[0].0;
            let [p, q] = ends(e).map(|v| mesh.points[v as usize]);
            let middle = midpoint(p, q);
            let piece = |part: u32| pieces[part as usize];
            let on = match sharp.binary_search_by_key(&e, |s| s.0) {
                Ok(at) => mesh.curves[sharp[at].1 as usize].parts.map(piece).to_vec(),
                Err(_) => {
                    let mut on: Vec<u32> = same.iter().map(|s| piece(s.1)).collect();
                    on.dedup();
                    smooth_pieces(surface, &on, [p, q])
                }
            };
            let target = surface
                .project(&on, middle)
                // Points farther away lie on another sheet, or the iteration failed.
                .filter(|m| norm(sub(*m, middle)) <= 0.3 * norm(sub(p, q)));
            (e, target)
        })
        .collect()
}

/// Returns the pieces for the mid node of an edge that is not an edge of the solid: its piece; on a
/// seam of two pieces what defines the seam; next to a seam, where either piece may be the surface,
/// the whole solid.
fn smooth_pieces(surface: &Surface<'_>, pieces: &[u32], ends: [Point3; 2]) -> Vec<u32> {
    let are_on = |on: &[u32]| {
        let is_on = |p: &Point3| on.iter().all(|&i| surface.distance(i, *p) == 0.0);
        ends.iter().all(is_on)
    };
    let skin = || vec![surface.skin(pieces[0])];
    match *pieces {
        [piece] if are_on(&[piece]) => vec![piece],
        [a, b] if are_on(&[a, b]) => {
            let seam = surface.seam_of([a, b], midpoint(ends[0], ends[1]));
            seam.filter(|seam| are_on(seam))
                .map_or_else(skin, |seam| seam.to_vec())
        }
        _ => skin(),
    }
}

/// Tetrahedra with curved edges.
struct CurvedTets<'m> {
    mesh: &'m Mesh,
    /// Indices of the mid nodes of each tetrahedron.
    mids: &'m [[u32; 6]],
    /// True for mid nodes on the surface.
    fixed: &'m [bool],
}

impl CurvedTets<'_> {
    fn quality(&self, t: usize, middles: &[Point3]) -> f64 {
        scaled_jacobian(&std::array::from_fn(|k| {
            if k < 4 {
                self.mesh.points[self.mesh.tets[t][k] as usize]
            } else {
                middles[self.mids[t][k - 4] as usize]
            }
        }))
    }

    /// Moves inner mid nodes of tetrahedra that curved faces distort.
    fn relax(&self, middles: &mut [Point3]) {
        let bad: Vec<usize> = (0..self.mids.len())
            .into_par_iter()
            .filter(|&t| {
                let mut mids = self.mids[t].iter();
                mids.any(|&m| self.fixed[m as usize])
                    && self.quality(t, middles) < TARGET_SCALED_JACOBIAN
            })
            .collect();
        if bad.is_empty() {
            return;
        }
        let around = self.around_free_middles(&bad);
        // Passes over all mid nodes around bad tetrahedra.
        for _ in 0..6 {
            for star in around.chunk_by(|a, b| a.0 == b.0) {
                self.move_middle(star, middles);
            }
        }
    }

    /// Returns the movable mid nodes of bad tetrahedra, each with every tetrahedron that has it:
    /// (mid node, tetrahedron).
    fn around_free_middles(&self, bad: &[usize]) -> Vec<(u32, u32)> {
        let free = bad
            .iter()
            .flat_map(|&t| self.mids[t])
            .filter(|&m| !self.fixed[m as usize]);
        let free = crate::points::unique(free.collect());
        let mut around: Vec<(u32, u32)> = Vec::new();
        for (t, m) in self.mids.iter().enumerate() {
            let free = m.iter().filter(|m| free.binary_search(m).is_ok());
            around.extend(free.map(|&m| (m, t as u32)));
        }
        around.sort_unstable();
        around
    }

    /// Moves a mid node to a position that improves the worst tetrahedron around it, by a compass
    /// search: six directions, decreasing steps.
    fn move_middle(&self, star: &[(u32, u32)], middles: &mut [Point3]) {
        let m = star[0].0 as usize;
        let worst = |middles: &[Point3]| {
            star.iter()
                .map(|s| self.quality(s.1 as usize, middles))
                .fold(f64::INFINITY, f64::min)
        };
        let mut best = worst(middles);
        if best >= TARGET_SCALED_JACOBIAN {
            return;
        }
        let length = self.edge_length(star[0].1 as usize, star[0].0);
        let mut step = SEARCH_STEP_RANGE[0] * length;
        while step > SEARCH_STEP_RANGE[1] * length {
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

    /// Returns the length of the edge of a tetrahedron with this mid node.
    fn edge_length(&self, t: usize, middle: u32) -> f64 {
        let k = self.mids[t].iter().position(|&o| o == middle).unwrap_or(0);
        let [p, q] = TET_EDGES[k].map(|i| self.mesh.points[self.mesh.tets[t][i] as usize]);
        norm(sub(p, q))
    }
}

/// Returns the smallest over the largest Jacobian determinant of a ten-node tetrahedron, at its
/// nodes and centroid; −1 if all vanish.
fn scaled_jacobian(x: &[Point3; 10]) -> f64 {
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    for p in JACOBIAN_SAMPLES {
        let j = jacobian(x, p);
        least = least.min(j);
        most = most.max(j.abs());
    }
    if most > 0.0 { least / most } else { -1.0 }
}

/// Barycentric coordinates of the nodes and the centroid.
const JACOBIAN_SAMPLES: [[f64; 4]; 11] = [
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

/// Returns the Jacobian determinant at a point in barycentric coordinates.
fn jacobian(x: &[Point3; 10], l: [f64; 4]) -> f64 {
    // Derivatives of the position by the barycentric coordinates; the Jacobian has the differences
    // of the last three from the first.
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
    dot(u, cross(v, w))
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
        assert!((jacobian(&x, JACOBIAN_SAMPLES[0]) - 4.0 * 2.4).abs() < 1e-12);
        assert!((jacobian(&x, JACOBIAN_SAMPLES[1]) - 4.0 * 1.6).abs() < 1e-12);
    }
}
