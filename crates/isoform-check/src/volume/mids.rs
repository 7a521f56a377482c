//! Mid nodes that several edges share, or that are corners as well.
//!
//! A mesh of second order is conforming only if each edge has a mid node of its own.

use super::faces::NodeRun;
use crate::{Defects, Place};
use isoform_geom::Mesh;

/// Maximum number of nodes listed per defect: a node that very many edges share would fill the
/// report.
const MAX_LISTED_NODES: usize = 16;

/// Reports edges that share a mid node, and edges whose mid node is a corner.
pub(super) fn examine(mesh: &Mesh, runs: &[NodeRun], room: usize, defects: &mut Defects) {
    if !mesh.tet_mids.is_empty() && is_any_shared(mesh, runs) {
        list_shared(mesh, runs, room, defects);
    }
}

/// Returns true if a mid node belongs to several edges or is a corner.
fn is_any_shared(mesh: &Mesh, runs: &[NodeRun]) -> bool {
    let mut used = vec![false; mesh.points.len()];
    for (mid, _) in runs.iter().flat_map(|run| &run.mids) {
        if std::mem::replace(&mut used[*mid as usize], true) {
            return true;
        }
    }
    mesh.tets.iter().flatten().any(|&i| used[i as usize])
}

/// Lists the shared mid nodes, each with the ends of its edges.
fn list_shared(mesh: &Mesh, runs: &[NodeRun], room: usize, defects: &mut Defects) {
    let mids = runs.iter().flat_map(|run| run.mids.iter().copied());
    let mut mids: Vec<(u32, [u32; 2])> = mids.collect();
    mids.sort_unstable();
    let mut is_corner = vec![false; mesh.points.len()];
    for &i in mesh.tets.iter().flatten() {
        is_corner[i as usize] = true;
    }
    let is_wrong = |group: &&[(u32, [u32; 2])]| group.len() > 1 || is_corner[group[0].0 as usize];
    for group in mids.chunk_by(|a, b| a.0 == b.0).filter(is_wrong) {
        let mid = group[0].0;
        let ends = group.iter().flat_map(|m| m.1);
        defects.add(room, || Place {
            at: mesh.points[mid as usize],
            nodes: std::iter::once(mid)
                .chain(ends)
                .take(MAX_LISTED_NODES)
                .collect(),
            elements: Vec::new(),
            value: group.len() as f64,
        });
    }
}
