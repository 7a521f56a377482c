//! Borders of the mesh that represent a single point.
//!
//! If a boss is flush with the side of its block, the face between them runs out in two cusps at
//! the point of contact. A mesh does not resolve them: boss and side have a short common border
//! there, both ends of which represent the point of contact. The border is contracted.

use crate::cut::{LabelledMesh, replace};
use crate::locus::{Distance, Locus};
use crate::newton::{POINT_TOLERANCE, meet};
use crate::topology::{BorderChain, TriangleSide, ends_of};
use crate::vertices::vertex;
use isoform_geom::{Point3, cross, norm, sub};
use std::collections::{BTreeMap, BTreeSet};

/// A border that represents a point.
pub(crate) struct PointBorder {
    nodes: Vec<u32>,
    at: Point3,
}

impl PointBorder {
    /// Returns the point, and the largest distance of the nodes of the border from it.
    pub(crate) fn extent(&self, mesh: &LabelledMesh) -> (Point3, f64) {
        let nodes = self.nodes.iter().map(|v| mesh.points[*v as usize]);
        let reach = nodes.map(|p| norm(sub(p, self.at))).fold(0.0, f64::max);
        (self.at, reach)
    }
}

/// Finds a chain that represents a point; `loci` are those of the sheets.
pub(crate) fn find(
    mesh: &LabelledMesh,
    across: &[[TriangleSide; 3]],
    chains: &[BorderChain],
    loci: &[Locus],
    size: f64,
) -> Option<PointBorder> {
    let mut around: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for chain in chains {
        for v in [chain.nodes[0], chain.nodes[chain.nodes.len() - 1]] {
            around.entry(v).or_default();
        }
    }
    for (corners, sheet) in mesh.triangles.iter().zip(&mesh.sheets) {
        for v in corners {
            if let Some(sheets) = around.get_mut(v) {
                sheets.insert(*sheet);
            }
        }
    }
    chains.iter().find_map(|chain| {
        let (t, k) = chain.sides[0];
        let sheets = [t, across[t as usize][k as usize].0].map(|t| mesh.sheets[t as usize]);
        let [a, b] = sheets.map(|s| &loci[s as usize]);
        let ends = [chain.nodes[0], chain.nodes[chain.nodes.len() - 1]];
        if sheets[0] == sheets[1] || ends[0] == ends[1] {
            return None;
        }
        let contact = |v: u32| {
            let of: Vec<Locus> = around[&v]
                .iter()
                .map(|s| loci[*s as usize].clone())
                .collect();
            let (p, is_contact) = vertex(&of, mesh.points[v as usize], size);
            is_contact.then_some(p)
        };
        let [at, other] = [contact(ends[0])?, contact(ends[1])?];
        let sine = norm(cross(a.distance(at).1, b.distance(at).1));
        // Surfaces at a sine below 1e-6 touch in the point.
        let is_point = norm(sub(at, other)) <= POINT_TOLERANCE * size && sine <= 1e-6;
        let nodes = chain.nodes.clone();
        is_point.then_some(PointBorder { nodes, at })
    })
}

/// Contracts the border to a node. The edges that lead to it are divided first, so that no two of
/// them become one.
pub(crate) fn contract(
    mesh: &mut LabelledMesh,
    across: &[[TriangleSide; 3]],
    border: &PointBorder,
    loci: &[Locus],
) {
    let own: BTreeSet<u32> = border.nodes.iter().copied().collect();
    let node = border.nodes[0];
    let star = |corners: &[u32; 3]| corners.iter().any(|v| own.contains(v));
    let star: Vec<usize> = (0..mesh.triangles.len())
        .filter(|t| star(&mesh.triangles[*t]))
        .collect();
    mesh.points[node as usize] = border.at;
    let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for &t in &star {
        for k in 0..3u8 {
            let [a, b] = ends_of(&mesh.triangles[t], k);
            let key = [a.min(b), a.max(b)];
            if own.contains(&a) == own.contains(&b) || middles.contains_key(&key) {
                continue;
            }
            let from = |v: u32| {
                if own.contains(&v) {
                    border.at
                } else {
                    mesh.points[v as usize]
                }
            };
            let [p, q] = [from(a), from(b)];
            let half: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
            let other = across[t][k as usize].0 as usize;
            let both = [t, other].map(|t| &loci[mesh.sheets[t] as usize]);
            let on = meet(both, half);
            let is_near = norm(sub(on, half)) <= 0.5 * norm(sub(p, q));
            middles.insert(key, mesh.points.len() as u32);
            mesh.points.push(if is_near { on } else { half });
        }
    }
    for t in star {
        let corners = mesh.triangles[t];
        let mut inner = vec![node];
        let mut outer = Vec::new();
        // Counterclockwise from the first of the corners on the border.
        let first =
            (0..3).find(|k| own.contains(&corners[*k]) && !own.contains(&corners[(*k + 2) % 3]));
        let Some(first) = first else { continue };
        for n in 0..3 {
            let [a, b] = ends_of(&corners, ((first + n) % 3) as u8);
            let middle = middles.get(&[a.min(b), a.max(b)]);
            if !own.contains(&a) {
                outer.push(a);
            }
            if let Some(middle) = middle {
                inner.push(*middle);
                outer.push(*middle);
            }
        }
        let chart = mesh.charts[t];
        replace(mesh, t, &[(inner, chart), (outer, chart)]);
    }
}
