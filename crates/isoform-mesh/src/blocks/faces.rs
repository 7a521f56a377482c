//! Matching of faces between blocks.

use super::tetrahedra::{INNER, Tetrahedra};
use crate::points::{centroid, hash_words};
use isoform_geom::{Point3, TET_FACES};
use rayon::prelude::*;
use std::collections::HashMap;

/// A boundary face of a block that does not lie on the solid's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenFace {
    /// Hash of 128 bits of the coordinates of its three nodes, independent of their order.
    pub key: u128,
    /// Orientation of the face; the matching face of the other block has the opposite value.
    pub is_turned: bool,
    /// Centroid.
    pub at: Point3,
}

/// Returns the boundary faces of tetrahedra, except those on the solid's surface.
pub fn open_faces(all: &Tetrahedra) -> Vec<OpenFace> {
    let mut faces: Vec<([u32; 3], u32)> = (0..all.tets.len() as u32)
        .into_par_iter()
        .flat_map_iter(|t| {
            let inner = (0..4).filter(move |&i| all.labels[t as usize][i] == INNER);
            inner.map(move |i| {
                let mut face = TET_FACES[i].map(|k| all.tets[t as usize][k]);
                face.sort_unstable();
                (face, 4 * t + i as u32)
            })
        })
        .collect();
    faces.par_sort_unstable();
    let alone = faces.chunk_by(|a, b| a.0 == b.0).filter(|f| f.len() == 1);
    let face = |place: u32| {
        let tet = all.tets[place as usize / 4];
        TET_FACES[place as usize % 4].map(|k| all.points[tet[k] as usize])
    };
    alone
        .map(|f| OpenFace::from_corners(face(f[0].1)))
        .collect()
}

impl OpenFace {
    /// Creates the face with these corners, outward.
    fn from_corners(corners: [Point3; 3]) -> Self {
        let mut bits = corners.map(|p| p.map(f64::to_bits));
        let mut is_turned = false;
        for (i, j) in [(0, 1), (1, 2), (0, 1)] {
            if bits[i] > bits[j] {
                bits.swap(i, j);
                is_turned = !is_turned;
            }
        }
        Self {
            key: key(bits.as_flattened()),
            is_turned,
            at: centroid(bits.map(|p| p.map(f64::from_bits))),
        }
    }
}

/// Combines two hashes of 64 bits: among a billion different faces two have equal ones with a
/// probability of 10⁻²¹.
fn key(words: &[u64]) -> u128 {
    let [high, low] = [0x6a09_e667_f3bc_c908, 0xbb67_ae85_84ca_a73b]
        .map(|start| u128::from(hash_words(words, start)));
    high << 64 | low
}

/// Open faces of blocks, matched with those of other blocks.
///
/// ```
/// use isoform_mesh::blocks::{INNER, Interfaces, Tetrahedra, open_faces};
///
/// // Two tetrahedra on both sides of a face; all other faces are the surface.
/// let face = [[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let with = |x: f64, tet| Tetrahedra {
///     points: [&face[..], &[[x, 0.0, 0.0]]].concat(),
///     tets: vec![tet],
///     labels: vec![[0, 0, 0, INNER]],
/// };
/// let mut between = Interfaces::default();
/// between.add(&open_faces(&with(1.0, [1, 2, 0, 3])));
/// assert_eq!(between.apart().len(), 1);
/// between.add(&open_faces(&with(-1.0, [2, 1, 0, 3])));
/// assert_eq!((between.apart().len(), between.pairs()), (0, 1));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Interfaces {
    waiting: HashMap<u128, OpenFace>,
    /// Faces that matched one of equal orientation.
    folded: Vec<OpenFace>,
    pairs: usize,
}

impl Interfaces {
    /// Adds the open faces of a block.
    pub fn add(&mut self, faces: &[OpenFace]) {
        for &face in faces {
            match self.waiting.remove(&face.key) {
                None => {
                    self.waiting.insert(face.key, face);
                }
                Some(other) if other.is_turned == face.is_turned => {
                    self.folded.extend([other, face]);
                }
                Some(_) => self.pairs += 1,
            }
        }
    }

    /// Returns the number of matched pairs of opposite orientation.
    pub fn pairs(&self) -> usize {
        self.pairs
    }

    /// Returns the centroids of all other faces, sorted.
    pub fn apart(&self) -> Vec<Point3> {
        let all = self.waiting.values().chain(&self.folded);
        let mut places: Vec<Point3> = all.map(|f| f.at).collect();
        places.sort_unstable_by(|p, q| {
            let axis = |i: usize| p[i].total_cmp(&q[i]);
            axis(0).then_with(|| axis(1)).then_with(|| axis(2))
        });
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Point3; 3] = [[0.0, 0.0, 1.0], [0.5, 1.0, 0.0], [1.0, -1.0, 2.0]];

    #[test]
    fn the_other_side_is_the_other_sense() {
        let [a, b, c] = CORNERS;
        let face = OpenFace::from_corners([a, b, c]);
        for (same, is_turned) in [([b, c, a], false), ([b, a, c], true), ([a, c, b], true)] {
            let other = OpenFace::from_corners(same);
            assert_eq!((other.key, other.at), (face.key, face.at));
            assert_eq!(other.is_turned != face.is_turned, is_turned);
        }
    }

    #[test]
    fn a_bit_is_enough_to_be_apart() {
        let [a, b, c] = CORNERS;
        let moved = [a[0], a[1], a[2].next_up()];
        let mut between = Interfaces::default();
        between.add(&[
            OpenFace::from_corners([a, b, c]),
            OpenFace::from_corners([b, moved, c]),
        ]);
        assert_eq!((between.apart().len(), between.pairs()), (2, 0));
        // A face three times: one remains.
        between.add(&[
            OpenFace::from_corners([b, a, c]),
            OpenFace::from_corners([a, b, c]),
        ]);
        assert_eq!((between.apart().len(), between.pairs()), (2, 1));
        // Twice with one orientation.
        between.add(&[OpenFace::from_corners([a, b, c])]);
        assert_eq!(between.apart().len(), 3);
    }
}
