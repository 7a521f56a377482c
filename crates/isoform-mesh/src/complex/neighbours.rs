//! Face neighbours of tetrahedra.

use super::{MAX_SCANNED_ITEMS, OPEN, sorted};
use isoform_control::Control;
use isoform_geom::TET_FACES;

/// A face without its lowest vertex: the two others in ascending order, and the face encoded as
/// four times its tetrahedron plus the opposite vertex.
type HalfFace = ([u32; 2], u32);

/// Computes the neighbour opposite to each vertex of each tetrahedron, [`OPEN`] on the boundary.
/// After a stop by `control` neighbours are missing.
pub(super) fn adjacency(
    vertices: usize,
    tets: &[[u32; 4]],
    control: &Control<'_>,
) -> Vec<[u32; 4]> {
    let mut adjacent = vec![[OPEN; 4]; tets.len()];
    let (from, mut faces) = by_lowest_vertex(vertices, tets);
    for (lowest, w) in from.windows(2).enumerate() {
        // Some milliseconds pass between two checks.
        if lowest.is_multiple_of(1 << 12) && control.is_stopped() {
            break;
        }
        pair_up(&mut faces[w[0] as usize..w[1] as usize], &mut adjacent);
    }
    adjacent
}

/// Sorts all faces by their lowest vertices (a counting sort). Returns the start of each vertex's
/// faces in the list, and the list. Few faces share a lowest vertex, so that partners are found by
/// comparing all of those.
fn by_lowest_vertex(vertices: usize, tets: &[[u32; 4]]) -> (Vec<u32>, Vec<HalfFace>) {
    let mut from = vec![0u32; vertices + 1];
    for v in tets {
        for f in TET_FACES {
            from[f.iter().map(|&k| v[k]).min().expect("three") as usize] += 1;
        }
    }
    let mut sum = 0;
    for n in &mut from {
        sum += *n;
        *n = sum;
    }
    let mut faces = vec![([0u32; 2], 0u32); tets.len() * 4];
    for t in 0..tets.len() {
        for i in 0..4 {
            let [a, b, c] = sorted(TET_FACES[i].map(|k| tets[t][k]));
            from[a as usize] -= 1;
            faces[from[a as usize] as usize] = ([b, c], (t * 4 + i) as u32);
        }
    }
    (from, faces)
}

/// Makes the tetrahedra of equal faces neighbours; all faces must have one lowest vertex.
fn pair_up(same: &mut [HalfFace], adjacent: &mut [[u32; 4]]) {
    let many = same.len() > MAX_SCANNED_ITEMS;
    if many {
        same.sort_unstable();
    }
    for (k, a) in same.iter().enumerate() {
        if adjacent[a.1 as usize / 4][a.1 as usize % 4] != OPEN {
            continue;
        }
        let after = &same[k + 1..];
        let near = if many {
            &after[..after.len().min(1)]
        } else {
            after
        };
        if let Some(b) = near.iter().find(|b| b.0 == a.0) {
            adjacent[a.1 as usize / 4][a.1 as usize % 4] = b.1 / 4;
            adjacent[b.1 as usize / 4][b.1 as usize % 4] = a.1 / 4;
        }
    }
}
