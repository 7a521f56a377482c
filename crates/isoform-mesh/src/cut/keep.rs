//! Extraction of the tetrahedra inside, with labelled faces on the surface.

use super::Cutter;
use crate::complex::{BOUNDARY, Complex, NONE, STRAY};
use crate::inside::Inside;
use crate::points::{centroid, unique};
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Kept vertices, renumbered contiguously.
struct KeptVertices {
    /// New index of each old vertex.
    number: Vec<u32>,
    points: Vec<Point3>,
    frozen: Vec<bool>,
}

impl Cutter<'_> {
    /// Marks the tetrahedra whose corners `admits` accepts.
    pub(crate) fn admitted(&self, admits: impl Fn([Point3; 4]) -> bool) -> Vec<bool> {
        let all = 0..self.complex.tets.len() as u32;
        all.map(|t| self.complex.is_there(t) && admits(self.complex.corners(t)))
            .collect()
    }

    /// Drops the tetrahedra outside, and those that are not `kept`: faces towards the latter are
    /// open.
    pub(crate) fn finish(mut self, inside: &[bool], kept: &[bool]) -> Inside {
        let live: Vec<u32> = self
            .complex
            .live()
            .filter(|&t| inside[t as usize] && kept[t as usize])
            .collect();
        let KeptVertices {
            number,
            points,
            mut frozen,
        } = self.kept(&live);
        let tets = live
            .iter()
            .map(|&t| self.complex.tets[t as usize].map(|v| number[v as usize]))
            .collect();
        let mut complex = Complex::new(points, tets);
        complex.torus = self.complex.torus;
        if !self.surface.layers.is_empty() {
            complex.divide(live.iter().map(|&t| self.region(t)).collect());
        }
        let stray = self.label(&live, inside, &mut complex);
        for v in complex.separate() {
            frozen.push(frozen[v as usize]);
        }
        Inside {
            complex,
            frozen,
            number,
            stray,
        }
    }

    /// Collects the vertices of the tetrahedra `live`, in their old order.
    fn kept(&self, live: &[u32]) -> KeptVertices {
        let mut used = vec![false; self.complex.points.len()];
        for &t in live {
            for v in self.complex.tets[t as usize] {
                used[v as usize] = true;
            }
        }
        let mut kept = KeptVertices {
            number: vec![NONE; used.len()],
            points: Vec::new(),
            frozen: Vec::new(),
        };
        for v in (0..used.len()).filter(|&v| used[v]) {
            kept.number[v] = kept.points.len() as u32;
            kept.points.push(self.complex.points[v]);
            kept.frozen.push(self.frozen[v]);
        }
        kept
    }

    /// Labels the faces between inside and outside, and those between regions, in the complex of
    /// the kept tetrahedra. Returns points on faces that do not lie on a single piece.
    fn label(&mut self, live: &[u32], inside: &[bool], kept: &mut Complex) -> Vec<Point3> {
        let mut stray = Vec::new();
        for (slot, &t) in live.iter().enumerate() {
            for i in 0..4 {
                let n = self.complex.adjacent[t as usize][i];
                let slot = slot as u32;
                if let Some(axis) = kept.side(slot, i) {
                    if kept.owns(slot, i) {
                        let label = self.surface.side_piece(axis).unwrap_or(STRAY);
                        kept.set_label(slot, i, label);
                    }
                    continue;
                }
                let layer = if kept.owns(slot, i) {
                    usize::from(kept.region(slot)) + 1
                } else if n < BOUNDARY && !inside[n as usize] {
                    0
                } else {
                    continue;
                };
                let face = self.complex.face(t, i);
                let within = self.complex.middle(t);
                let label = self.piece_of(face, layer, within).unwrap_or_else(|| {
                    stray.push(self.complex.point(face[0]));
                    STRAY
                });
                kept.set_label(slot, i, label);
            }
        }
        stray
    }

    /// Returns the piece of a layer on which a surface face lies: all three vertices lie on it, and
    /// its normal is closest to that of the face. `within` is a point in the tetrahedron that has
    /// the face.
    fn piece_of(&mut self, f: [u32; 3], layer: usize, within: Point3) -> Option<u32> {
        let p = self.complex.points_of(f);
        let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let middle = centroid(p);
        let mut best: Option<(f64, u32)> = None;
        let mut pieces = self.pieces_at(f, layer);
        self.surface.keep_beside(&mut pieces, p, within);
        for i in pieces {
            let g = self.surface.solid.gradient(i, middle).1;
            let exact = p.iter().all(|&q| self.surface.distance(i, q) == 0.0);
            let c = -dot(g, normal) / (norm(g) * norm(normal)).max(1e-300)
                // Pieces on which all vertices lie exactly precede, since cosines differ by at most
                // 2.
                + if exact { 2.0 } else { 0.0 };
            // Among equal cosines the first piece is taken.
            if best.is_none_or(|b| c > b.0 + 1e-9) {
                best = Some((c, i));
            }
        }
        best.map(|b| b.1)
    }

    /// Returns the pieces of a layer on which all three vertices of a face lie; if there are
    /// several, those that bound the solid at one of the vertices.
    fn pieces_at(&mut self, f: [u32; 3], layer: usize) -> Vec<u32> {
        let p = self.complex.points_of(f);
        let mut pieces: Vec<u32> = self.on[f[0] as usize].slice().to_vec();
        for c in [centroid(p), p[0], p[1], p[2]] {
            if let Some(reduced) = self.surface.reduced_in(layer, c) {
                pieces.extend(&reduced.pieces);
            }
        }
        pieces = unique(pieces);
        pieces.retain(|&i| self.surface.layer_of(i) == layer);
        pieces.retain(|&i| f.iter().all(|&v| self.distance(v, i) == 0.0));
        if pieces.len() > 1 {
            let faces: Vec<u32> = pieces
                .iter()
                .copied()
                .filter(|&i| p.iter().any(|&q| self.surface.is_face(i, q)))
                .collect();
            if !faces.is_empty() {
                pieces = faces;
            }
        }
        pieces
    }
}
