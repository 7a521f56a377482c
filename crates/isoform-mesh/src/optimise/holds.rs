//! What holds the vertices: pieces of the solid, or the lattice beyond the band.

use super::Optimiser;
use crate::complex::{NONE, Ring, STRAY, labelled_edges};
use crate::points::{midpoint, pairs, unique};
use crate::surface::{On, SKIN, is_skin, meet_at_an_angle};
use isoform_geom::Point3;

/// What holds a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    /// Corners, and vertices shared with the lattice beyond the band.
    Fixed,
    /// On one piece (or [`SKIN`]), on two (a curve), or on none.
    On(On),
}

/// What is around a vertex of the surface.
#[derive(Clone, Default)]
struct Surroundings {
    /// Labels of its faces.
    labels: Vec<u32>,
    /// The pairs of pieces that meet in its sharp edges.
    curves: Vec<[u32; 2]>,
}

impl Optimiser<'_> {
    /// Settles what holds each vertex, from the labels of the faces around it.
    pub(super) fn hold_vertices(&mut self, frozen: &[bool]) {
        for (v, around) in self.surroundings().into_iter().enumerate() {
            let labels = unique(around.labels);
            self.hold[v] = if frozen[v] {
                Hold::Fixed
            } else {
                self.hold_of(&labels, &around.curves)
            };
            let pieces: Vec<u32> = labels.into_iter().filter(|&l| l < STRAY).collect();
            self.labels[v] = On::of(&pieces);
        }
    }

    /// What holds a vertex between faces with these labels, where sharp edges between these pieces
    /// end; nothing moves where surfaces of several layers touch.
    fn hold_of(&self, labels: &[u32], curves: &[[u32; 2]]) -> Hold {
        let may_touch = curves.is_empty() && labels.iter().all(|&l| l < STRAY);
        if may_touch && !labels.is_empty() && self.surface.common_layer(labels).is_none() {
            return Hold::Fixed;
        }
        match hold(labels, curves) {
            Hold::On(on) if on.contains(SKIN) => Hold::On(On::of(&[self.surface.skin(labels[0])])),
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
                    // Not a manifold there: nothing moves.
                    around[v].curves.extend([[NONE; 2]; 3]);
                } else {
                    let curve = |pair| self.curve_of(ends, pair);
                    around[v].curves.extend(pairs(&several).find_map(curve));
                }
            }
        }
        around
    }

    /// The labels of the two faces of a surface at the edge of a ring, or of two surfaces that meet
    /// there; of more than two those that make a curve, as some of them coincide.
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

    /// Labels with those of a unit cell's sides in front: where the surface goes on as another
    /// piece behind a side, both pieces meet the side in one curve.
    fn sides_first(&self, mut labels: Vec<u32>) -> Vec<u32> {
        if self.surface.torus.is_some() {
            labels.sort_by_key(|&label| !self.surface.is_side(label));
        }
        labels
    }

    /// The curve that an edge between faces of two pieces lies on: of both where they meet at an
    /// angle, else of one and what separates them, if anything does.
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

    /// The pieces that a vertex belongs on.
    pub(super) fn holding(&self, v: u32) -> On {
        match self.hold[v as usize] {
            Hold::On(on) if !on.is_empty() => on,
            _ => self.labels[v as usize],
        }
    }

    /// Whether a vertex is off the surface at `p`: off what holds it, or off the solid where more
    /// pieces meet there.
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

    /// Whether a vertex on one piece has slipped past where that is the surface, over a seam with a
    /// piece that it touches tangentially.
    pub(super) fn is_hidden(&self, v: u32) -> bool {
        let p = self.point(v);
        let may_slip = match self.hold[v as usize] {
            Hold::On(on) if on.len() == 1 => !self.surface.is_alone(on.slice()[0], p),
            _ => false,
        };
        may_slip && self.is_off_skin(self.holding(v), p) && !self.is_off(v, p)
    }

    /// Whether a place is off one of the solids that pieces belong to.
    fn is_off_skin(&self, pieces: On, p: Point3) -> bool {
        let mut pieces = pieces.slice().iter();
        pieces.any(|&l| self.surface.distance(self.surface.skin(l), p) != 0.0)
    }

    /// What stands for the solids that a vertex is on the surface of.
    pub(super) fn skin_at(&self, v: u32) -> On {
        let labels = self.labels[v as usize];
        let skins: Vec<u32> = labels
            .slice()
            .iter()
            .map(|&l| self.surface.skin(l))
            .collect();
        if skins.is_empty() {
            On::of(&[SKIN])
        } else {
            On::of(&skins)
        }
    }

    /// Whether a vertex is held on the solid itself, at a seam between pieces that touch.
    pub(super) fn is_skin(&self, v: u32) -> bool {
        let holds_skin = |on: On| on.slice().iter().any(|&i| is_skin(i));
        matches!(self.hold[v as usize], Hold::On(on) if holds_skin(on))
    }

    /// The piece to project a point of a face on: its label, or the solid next to a seam between
    /// pieces that touch tangentially.
    pub(super) fn piece_at(&self, vertices: &[u32], label: u32) -> u32 {
        if vertices.iter().any(|&v| self.is_skin(v)) {
            self.surface.skin(label)
        } else {
            label
        }
    }

    /// The pieces to project the middle of an edge on that has faces with these labels beside it:
    /// both where they meet at an angle; across a seam the solid itself.
    pub(super) fn pieces_of_edge(&self, ends: [u32; 2], labels: [u32; 2]) -> On {
        if labels[0] == labels[1] {
            On::of(&[self.piece_at(&ends, labels[0])])
        } else {
            let curve = self.curve_of(ends, labels);
            let skins = labels.map(|l| self.surface.skin(l));
            curve.map_or(On::of(&skins), |pieces| On::of(&pieces))
        }
    }
}

/// What holds a vertex between faces with these labels, where sharp edges between these pieces end.
fn hold(labels: &[u32], curves: &[[u32; 2]]) -> Hold {
    if labels.len() > 3 || labels.iter().any(|&l| l >= STRAY) {
        return Hold::Fixed;
    }
    match *curves {
        // Pieces that touch tangentially make one smooth surface.
        [] if labels.len() > 1 => Hold::On(On::of(&[SKIN])),
        [] => Hold::On(On::of(labels)),
        [a, b] if a == b => Hold::On(On::of(&a)),
        _ => Hold::Fixed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_edges_corners_and_seams() {
        assert_eq!(hold(&[], &[]), Hold::On(On::default()));
        assert_eq!(hold(&[4], &[]), Hold::On(On::of(&[4])));
        assert_eq!(hold(&[4, 7], &[[4, 7]; 2]), Hold::On(On::of(&[4, 7])));
        // An edge that ends, three edges that meet, four pieces, a face on no single piece.
        assert_eq!(hold(&[4, 7], &[[4, 7]]), Hold::Fixed);
        assert_eq!(hold(&[1, 2, 3], &[[1, 2], [1, 3], [2, 3]]), Hold::Fixed);
        assert_eq!(hold(&[1, 2, 3, 4], &[]), Hold::Fixed);
        assert_eq!(hold(&[STRAY], &[]), Hold::Fixed);
        assert_eq!(hold(&[4, 7], &[]), Hold::On(On::of(&[SKIN])));
    }
}
