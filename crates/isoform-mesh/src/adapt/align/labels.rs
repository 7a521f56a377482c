//! Labels of the faces of an aligned surface.

use super::{Aligner, Cuttable, common};
use crate::complex::Face;
use crate::points::centroid;
use crate::surface::SKIN;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Cosine between the normals of a face and the piece that decides at its centroid, above which the
/// face takes that piece without comparing others.
const CLEARLY_FACING_COSINE: f64 = 0.7;

impl<M: Cuttable> Aligner<'_, M> {
    /// Returns the piece of each face: one that all its vertices lie on; among several the one that
    /// bounds the solid at its centroid.
    pub(super) fn labels(&mut self) -> Vec<Face> {
        let faces = self.mesh.faces().into_iter();
        faces.map(|f| (f, self.label(f))).collect()
    }

    fn label(&mut self, f: [u32; 3]) -> u32 {
        let p = f.map(|v| self.at(v));
        let middle = centroid(p);
        let on = f.map(|v| self.on[v as usize].as_slice());
        let all = common(on);
        if let [one] = all[..] {
            return one;
        }
        let nearest = self.surface.project(&[SKIN], middle);
        let decides = nearest.map(|q| self.surface.value(q).1);
        if let (true, Some(piece)) = (all.is_empty(), decides) {
            if !self.has_smooth_edge(f) && on.iter().all(|on| !on.is_empty()) {
                self.lost.push(middle);
            }
            return piece;
        }
        if let Some(piece) = decides
            && all.contains(&piece)
            && self.facing(p, piece) > CLEARLY_FACING_COSINE
        {
            return piece;
        }
        let by_facing = |a: &u32, b: &u32| self.facing(p, *a).total_cmp(&self.facing(p, *b));
        if let Some(piece) = all.into_iter().max_by(by_facing) {
            return piece;
        }
        self.lost.push(middle);
        self.surface.solid.tree().pieces()[0]
    }

    /// Returns the cosine between the normals of a triangle and a piece.
    fn facing(&self, p: [Point3; 3], piece: u32) -> f64 {
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let g = self.surface.solid.gradient(piece, centroid(p)).1;
        -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
    }
}
