//! Constraints of the vertices: pieces of the solid, or the lattice beyond the band.

use super::Optimiser;
use crate::complex::{NONE, Ring, STRAY, labelled_edges};
use crate::points::{midpoint, pairs, unique};
use crate::surface::{On, SKIN, is_skin, meet_at_an_angle};
use isoform_geom::Point3;

/// Constraint of a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    /// The vertex does not move: corners, and vertices shared with the lattice beyond the band.
    Fixed,
    /// Pieces on which the vertex must stay: one (or [`SKIN`]), two (a curve), or none.
    On(On),
}

/// Labels and curves around a vertex of the surface.
#[derive(Clone, Default)]
struct Surroundings {
    /// Labels of its faces.
    labels: Vec<u32>,
    /// Pairs of pieces that meet in its sharp edges.
    curves: Vec<[u32; 2]>,
}

impl Optimiser<'_> {
    /// Sets the constraint of each vertex, from the labels of the faces around it.
    pub(super) fn hold_vertices(&mut self, frozen: &[bool]) {
        for (v, around) in self.surroundings().into_iter().enumerate() {
            let labels = unique(around.labels);
            self.hold[v] = if frozen[v] {
                Hold::Fixed
            } else {
                self.hold_of(&labels, &around.curves)
            };
            let pieces: Vec<u32> = labels.into_iter().filter(|&l| l < STRAY).collect();
            self.labels[v] = On::from_pieces(&pieces);
        }
    }

    /// Returns the constraint of a vertex between faces with these labels, where sharp edges
    /// between these pieces end; vertices where surfaces of several layers touch are fixed.
    fn hold_of(&self, labels: &[u32], curves: &[[u32; 2]]) -> Hold {
        let may_touch = curves.is_empty() && labels.iter().all(|&l| l < STRAY);
        if may_touch && !labels.is_empty() && self.surface.common_layer(labels).is_none() {
            return Hold::Fixed;
        }
        match hold(labels, curves) {
            Hold::On(on) if on.contains(SKIN) => {
                Hold::On(On::from_pieces(&[self.surface.skin(labels[0])]))
            }
            held => held,
        }
    }

    fn surroundings(&self) -> Vec<Surroundings> {
        let mut around = vec![Surroundings::default(); self.complex.points.len()];
        let faces = self.complex.faces();
        for &(f, label) in &faces {
            for v in f {
                around[v as usize].labels.push(label);
            }
        }
        let edges = labelled_edges(faces.into_iter());
        for same in edges.chunk_by(|a, b| a.0 == b.0) {
            let ends = same[0].0;
            let several = self.sides_first(unique(same.iter().map(|p| p.1).collect()));
            for v in ends.map(|v| v as usize) {
                let is_wall = self.complex.is_divided() && several.len() > 1;
                if same.len() != 2 && !is_wall {
                    // Not a manifold there: the vertices are fixed.
                    around[v].curves.extend([[NONE; 2]; 3]);
                } else {
                    let curve = |pair| self.curve_of(ends, pair);
                    around[v].curves.extend(pairs(&several).find_map(curve));
                }
            }
        }
        around
    }

    /// Returns the labels of the two faces of a surface at the edge of a ring, or of two surfaces
    /// that meet there; of more than two those that make a curve, as some of them coincide.
    pub(super) fn labels_beside(&self, ring: &Ring, ends: [u32; 2]) -> Option<[u32; 2]> {
        if !self.complex.is_divided() {
            return self.complex.labels_beside(ring);
        }
        match *self.complex.labels_at(ring) {
            [a, b] => Some([a, b]),
            ref more => {
                let more = self.sides_first(unique(more.to_vec()));
                pairs(&more).find(|pair| self.curve_of(ends, *pair).is_some())
            }
        }
    }

    /// Sorts labels with those of a unit cell's sides in front: where another piece continues the
    /// surface behind a side, both pieces meet the side in one curve.
    fn sides_first(&self, mut labels: Vec<u32>) -> Vec<u32> {
        if self.surface.torus.is_some() {
            labels.sort_by_key(|&label| !self.surface.is_side(label));
        }
        labels
    }

    /// Returns the curve on which an edge between faces of two pieces lies: of both pieces where
    /// they meet at an angle, else of one and the piece that separates them, if there is any.
    fn curve_of(&self, ends: [u32; 2], pieces: [u32; 2]) -> Option<[u32; 2]> {
        if pieces.iter().any(|&p| p >= STRAY) {
            return Some(pieces);
        }
        let [p, q] = self.points_of(ends);
        let middle = midpoint(p, q);
        if meet_at_an_angle(self.surface.solid, pieces, middle) {
            Some(pieces)
        } else {
            self.surface.seam_of(pieces, middle)
        }
    }

    /// Returns the pieces on which a vertex must lie.
    pub(super) fn holding(&self, v: u32) -> On {
        match self.hold[v as usize] {
            Hold::On(on) if !on.is_empty() => on,
            _ => self.labels[v as usize],
        }
    }

    /// Returns true if a vertex is off the surface at `p`: off the pieces that hold it, or off the
    /// solid where more pieces meet there.
    pub(super) fn is_off(&self, v: u32, p: Point3) -> bool {
        let labels = self.labels[v as usize];
        match self.hold[v as usize] {
            Hold::On(on) if !on.is_empty() => {
                on.slice()
                    .iter()
                    .any(|&l| self.surface.distance(l, p) != 0.0)
                    || (labels.len() > on.len() && self.is_off_skin(labels, p))
            }
            _ => labels
                .slice()
                .iter()
                .any(|&l| self.surface.distance(l, p) != 0.0),
        }
    }

    /// Returns true if a vertex on one piece has slipped off the part of the piece that is surface,
    /// over a seam with a piece that it touches tangentially.
    pub(super) fn is_hidden(&self, v: u32) -> bool {
        let p = self.point(v);
        let may_slip = match self.hold[v as usize] {
            Hold::On(on) if on.len() == 1 => !self.surface.is_alone(on.slice()[0], p),
            _ => false,
        };
        may_slip && self.is_off_skin(self.holding(v), p) && !self.is_off(v, p)
    }

    /// Returns true if a point is off one of the solids to which pieces belong.
    fn is_off_skin(&self, pieces: On, p: Point3) -> bool {
        let mut pieces = pieces.slice().iter();
        pieces.any(|&l| self.surface.distance(self.surface.skin(l), p) != 0.0)
    }

    /// Returns the skins of the solids on whose surface a vertex lies.
    pub(super) fn skin_at(&self, v: u32) -> On {
        let labels = self.labels[v as usize];
        let skins: Vec<u32> = labels
            .slice()
            .iter()
            .map(|&l| self.surface.skin(l))
            .collect();
        if skins.is_empty() {
            On::from_pieces(&[SKIN])
        } else {
            On::from_pieces(&skins)
        }
    }

    /// Returns true if a vertex is held on the solid itself, at a seam between pieces that touch.
    pub(super) fn is_skin(&self, v: u32) -> bool {
        let holds_skin = |on: On| on.slice().iter().any(|&i| is_skin(i));
        matches!(self.hold[v as usize], Hold::On(on) if holds_skin(on))
    }

    /// Returns the piece onto which a point of a face is projected: its label, or the solid next to
    /// a seam between pieces that touch tangentially.
    pub(super) fn piece_at(&self, vertices: &[u32], label: u32) -> u32 {
        if vertices.iter().any(|&v| self.is_skin(v)) {
            self.surface.skin(label)
        } else {
            label
        }
    }

    /// Returns the pieces onto which the midpoint of an edge is projected, given the labels of its
    /// two faces: both where they meet at an angle; across a seam the solid itself.
    pub(super) fn pieces_of_edge(&self, ends: [u32; 2], labels: [u32; 2]) -> On {
        if labels[0] == labels[1] {
            On::from_pieces(&[self.piece_at(&ends, labels[0])])
        } else {
            let curve = self.curve_of(ends, labels);
            let skins = labels.map(|l| self.surface.skin(l));
            curve.map_or(On::from_pieces(&skins), |pieces| On::from_pieces(&pieces))
        }
    }
}

/// Returns the constraint of a vertex between faces with these labels, where sharp edges between
/// these pieces end.
fn hold(labels: &[u32], curves: &[[u32; 2]]) -> Hold {
    if labels.len() > 3 || labels.iter().any(|&l| l >= STRAY) {
        return Hold::Fixed;
    }
    match *curves {
        // Pieces that touch tangentially make one smooth surface.
        [] if labels.len() > 1 => Hold::On(On::from_pieces(&[SKIN])),
        [] => Hold::On(On::from_pieces(labels)),
        [a, b] if a == b => Hold::On(On::from_pieces(&a)),
        _ => Hold::Fixed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_edges_corners_and_seams() {
        assert_eq!(hold(&[], &[]), Hold::On(On::default()));
        assert_eq!(hold(&[4], &[]), Hold::On(On::from_pieces(&[4])));
        assert_eq!(
            hold(&[4, 7], &[[4, 7]; 2]),
            Hold::On(On::from_pieces(&[4, 7]))
        );
        // An edge that ends, three edges that meet, four pieces, a face on no single piece.
        assert_eq!(hold(&[4, 7], &[[4, 7]]), Hold::Fixed);
        assert_eq!(hold(&[1, 2, 3], &[[1, 2], [1, 3], [2, 3]]), Hold::Fixed);
        assert_eq!(hold(&[1, 2, 3, 4], &[]), Hold::Fixed);
        assert_eq!(hold(&[STRAY], &[]), Hold::Fixed);
        assert_eq!(hold(&[4, 7], &[]), Hold::On(On::from_pieces(&[SKIN])));
    }
}
