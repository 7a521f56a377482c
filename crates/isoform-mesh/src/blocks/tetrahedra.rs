//! Tetrahedra exchanged between blocks.

use crate::complex::{BOUNDARY, Complex, NONE, OPEN};
use isoform_control::Control;
use isoform_geom::{Aabb, Point3};
use std::collections::HashMap;

/// Label of a face that is not known to lie on the solid's surface.
pub const INNER: u32 = NONE;

/// Tetrahedra with labelled faces. Nodes are identified by their coordinates: equal bits denote one
/// node, whichever block it comes from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tetrahedra {
    /// Nodes.
    pub points: Vec<Point3>,
    /// Positive tetrahedra.
    pub tets: Vec<[u32; 4]>,
    /// Piece of the solid on which the face opposite to each node lies, or [`INNER`].
    pub labels: Vec<[u32; 4]>,
}

impl Tetrahedra {
    /// Extracts the tetrahedra of a complex.
    pub(super) fn from_complex(complex: &Complex) -> Self {
        let mut out = Self {
            points: complex.points.clone(),
            ..Self::default()
        };
        for t in complex.live() {
            out.tets.push(complex.tets[t as usize]);
            let label = |i| complex.label(t, i).unwrap_or(INNER);
            out.labels.push([0, 1, 2, 3].map(label));
        }
        out
    }

    /// Builds the complex; `None` if a face on the surface has tetrahedra on both sides.
    pub(super) fn complex(self, control: &Control<'_>) -> Option<Complex> {
        let mut complex = Complex::within(self.points, self.tets, control);
        for (adjacent, labels) in complex.adjacent.iter_mut().zip(&self.labels) {
            for (n, &label) in adjacent.iter_mut().zip(labels) {
                if label != INNER {
                    if *n != OPEN {
                        return None;
                    }
                    *n = BOUNDARY | label;
                }
            }
        }
        Some(complex)
    }

    /// Returns the centroid of a tetrahedron.
    pub fn centroid(&self, t: usize) -> Point3 {
        centroid(self.tets[t].map(|v| self.points[v as usize]))
    }

    /// Returns the smallest box around the centroids.
    pub fn bounds(&self) -> Aabb {
        let centroids: Vec<Point3> = (0..self.tets.len()).map(|t| self.centroid(t)).collect();
        Aabb::from_points(&centroids)
    }

    /// Splits the tetrahedra into those whose centroids `first` admits, and the others.
    pub(super) fn parted(&self, first: impl Fn(Point3) -> bool) -> [Self; 2] {
        [true, false].map(|side| {
            let mut part = MergedTetrahedra::default();
            part.add(self, |c| first(c) == side);
            part.all
        })
    }
}

/// Returns the centroid of four points, bit for bit independent of their order.
pub(super) fn centroid(p: [Point3; 4]) -> Point3 {
    std::array::from_fn(|i| {
        let mut x = p.map(|p| p[i]);
        x.sort_unstable_by(f64::total_cmp);
        0.25 * (x[0] + x[1] + x[2] + x[3])
    })
}

/// Tetrahedra of several origins, with merged nodes.
#[derive(Clone, Debug, Default)]
pub struct MergedTetrahedra {
    all: Tetrahedra,
    /// Nodes by the bits of their coordinates.
    node: HashMap<[u64; 3], u32>,
}

impl MergedTetrahedra {
    /// Adds the tetrahedra whose centroids are admitted. Returns their number.
    pub fn add(&mut self, more: &Tetrahedra, admits: impl Fn(Point3) -> bool) -> usize {
        let Self { all, node } = self;
        let mut number = vec![NONE; more.points.len()];
        let before = all.tets.len();
        for t in (0..more.tets.len()).filter(|&t| admits(more.centroid(t))) {
            all.tets.push(more.tets[t].map(|v| {
                let number = &mut number[v as usize];
                if *number == NONE {
                    let p = more.points[v as usize];
                    *number = *node.entry(p.map(f64::to_bits)).or_insert_with(|| {
                        all.points.push(p);
                        all.points.len() as u32 - 1
                    });
                }
                *number
            }));
            all.labels.push(more.labels[t]);
        }
        all.tets.len() - before
    }

    /// Returns all tetrahedra added.
    pub fn tetrahedra(self) -> Tetrahedra {
        self.all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> [Tetrahedra; 2] {
        let face: [Point3; 3] = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let with = |x: f64, tet: [u32; 4]| Tetrahedra {
            points: [&face[..], &[[x, 0.0, 0.0]]].concat(),
            tets: vec![tet],
            labels: vec![[5, 5, 5, INNER]],
        };
        [with(1.0, [1, 2, 0, 3]), with(-1.0, [2, 1, 0, 3])]
    }

    #[test]
    fn equal_bits_are_one_node() {
        let mut both = MergedTetrahedra::default();
        for one in two() {
            assert_eq!(both.add(&one, |_| true), 1);
        }
        let both = both.tetrahedra();
        assert_eq!((both.points.len(), both.tets.len()), (5, 2));
        let complex = both.clone().complex(&Control::default()).expect("two");
        assert_eq!(complex.faces().len(), 6);
        assert_eq!(Tetrahedra::from_complex(&complex), both);
        let [right, left] = both.parted(|c| c[0] > 0.0);
        assert_eq!((right.centroid(0)[0], left.centroid(0)[0]), (0.25, -0.25));
        assert_eq!((right.points.len(), left.points.len()), (4, 4));
    }

    #[test]
    fn a_label_between_two_tetrahedra_is_a_fault() {
        let [a, mut b] = two();
        b.labels[0][3] = 5;
        let mut both = MergedTetrahedra::default();
        both.add(&a, |_| true);
        both.add(&b, |_| true);
        assert!(both.tetrahedra().complex(&Control::default()).is_none());
    }
}
