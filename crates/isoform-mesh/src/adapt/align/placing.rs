//! Placement of vertices on corners, curves and the surface of the solid, in this order.

use super::{Aligner, Cuttable, edges_of};
use crate::points::unique;
use isoform_geom::{KdTree, Point3, norm, sub};

/// Largest distance by which a vertex is moved to a corner and to a curve of the solid, in lengths
/// of the shortest edge at the vertex. More makes poor triangles, less leaves short edges next to
/// the curve.
const MAX_SNAP_DISTANCES: [f64; 2] = [0.45, 0.3];

/// Shortest and longest edge at each vertex.
struct Lengths {
    shortest: Vec<f64>,
    longest: Vec<f64>,
}

impl<M: Cuttable> Aligner<'_, M> {
    /// Moves vertices to corners, curves and the surface. Returns the vertices that are near none
    /// of these.
    pub(super) fn place_vertices(&mut self) -> Vec<Point3> {
        let faces = self.mesh.faces();
        let lengths = self.lengths(&faces);
        let vertices = unique(faces.into_iter().flatten().collect());
        self.place_on_corners(&vertices, &lengths);
        self.place_on_curves(&vertices, &lengths);
        self.place_on_surface(&vertices, &lengths)
    }

    fn lengths(&self, faces: &[[u32; 3]]) -> Lengths {
        let mut lengths = Lengths {
            shortest: vec![f64::INFINITY; self.on.len()],
            longest: vec![0.0f64; self.on.len()],
        };
        for e in edges_of(faces) {
            let l = norm(sub(self.at(e[0]), self.at(e[1])));
            for v in e.map(|v| v as usize) {
                lengths.shortest[v] = lengths.shortest[v].min(l);
                lengths.longest[v] = lengths.longest[v].max(l);
            }
        }
        lengths
    }

    /// Moves the nearest vertex to each corner, the closest pairs first.
    fn place_on_corners(&mut self, vertices: &[u32], lengths: &Lengths) {
        let places: Vec<Point3> = vertices.iter().map(|&v| self.at(v)).collect();
        let tree = KdTree::new(&places);
        let mut pairs: Vec<(f64, usize, u32)> = self
            .corners
            .iter()
            .enumerate()
            .filter_map(|(k, c)| tree.nearest(c.at).map(|(i, d)| (d.sqrt(), k, vertices[i])))
            .filter(|&(d, _, v)| d < MAX_SNAP_DISTANCES[0] * lengths.shortest[v as usize])
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, k, v) in pairs {
            let (at, pieces) = (self.corners[k].at, self.corners[k].pieces.clone());
            if self.on[v as usize].is_empty() && self.hold(v, at, pieces) {
                self.corners[k].is_taken = true;
            }
        }
    }

    /// Moves vertices to curves, the closest ones first, so that of two on opposite sides of a
    /// curve the better one is moved.
    fn place_on_curves(&mut self, vertices: &[u32], lengths: &Lengths) {
        let mut onto: Vec<(f64, u32, Point3)> = vertices
            .iter()
            .filter(|&&v| self.on[v as usize].is_empty())
            .filter_map(|&v| {
                let (p, shortest) = (self.at(v), lengths.shortest[v as usize]);
                let q = self.curve_near(p, MAX_SNAP_DISTANCES[1] * shortest)?;
                Some((norm(sub(p, q)) / shortest, v, q))
            })
            .collect();
        onto.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, v, q) in onto {
            let on = self.vanishing(q);
            self.hold(v, q, on);
        }
    }

    /// Moves all other vertices to the nearest point of the surface. Returns those that are too far
    /// from it.
    fn place_on_surface(&mut self, vertices: &[u32], lengths: &Lengths) -> Vec<Point3> {
        let mut far = Vec::new();
        for &v in vertices {
            if !self.on[v as usize].is_empty() {
                continue;
            }
            let p = self.at(v);
            match self.nearest(p) {
                // A vertex farther away than three of its longest edges does not belong to the
                // solid.
                Some((q, on)) if norm(sub(p, q)) <= 3.0 * lengths.longest[v as usize] => {
                    self.mesh.settle(v, q);
                    self.places[v as usize] = q;
                    self.on[v as usize] = on;
                }
                _ => far.push(p),
            }
        }
        far
    }

    /// Returns the nearest point of a curve of the solid within reach.
    fn curve_near(&self, p: Point3, reach: f64) -> Option<Point3> {
        let mut near = self.surface.lattice.reduced_at(p)?.pieces.clone();
        near.retain(|&i| self.surface.distance(i, p).abs() < reach);
        let mut best: Option<(f64, Point3)> = None;
        for (i, &a) in near.iter().enumerate() {
            for &b in &near[..i] {
                let Some(q) = self.surface.project(&[a, b], p) else {
                    continue;
                };
                let d = norm(sub(p, q));
                if d < reach && best.is_none_or(|best| d < best.0) && self.is_on_curve([a, b], q) {
                    best = Some((d, q));
                }
            }
        }
        best.map(|b| b.1)
    }
}
