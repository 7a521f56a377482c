//! Conversion of a unit cell to a complex with ordinary boundaries.

use super::{Complex, NONE};
use crate::torus::Torus;
use isoform_geom::Point3;
use std::collections::HashMap;

impl Complex {
    /// Cuts the complex open along the sides of its box: vertices on sides get an image on each,
    /// and both faces of a side become boundary, labelled with the wall's label on the upper side
    /// and the next label on the lower side. Empty slots and unused vertices are dropped.
    pub(crate) fn opened(&self, torus: &Torus) -> Self {
        let on_side = self.on_sides();
        let live: Vec<u32> = self.live().collect();
        let mut number: HashMap<(u32, [bool; 3]), u32> = HashMap::new();
        let mut points: Vec<Point3> = Vec::new();
        let mut tets = Vec::with_capacity(live.len());
        for &t in &live {
            let (vertices, corners) = (self.tets[t as usize], self.corners(t));
            let middle = torus.wrapped(self.middle(t));
            tets.push(std::array::from_fn(|k| {
                let (v, p) = (vertices[k], torus.nearest(corners[k], middle));
                let side = on_side[v as usize];
                let (lo, hi) = (torus.region.lo, torus.region.hi);
                let is_upper = std::array::from_fn(|i| side[i] && hi[i] - p[i] < p[i] - lo[i]);
                *number.entry((v, is_upper)).or_insert_with(|| {
                    points.push(std::array::from_fn(|i| match (side[i], is_upper[i]) {
                        (false, _) => p[i],
                        (true, false) => lo[i],
                        (true, true) => hi[i],
                    }));
                    points.len() as u32 - 1
                })
            }));
        }
        let mut opened = Self::new(points, tets);
        opened.divide(live.iter().map(|&t| self.region(t)).collect());
        for (slot, &t) in live.iter().enumerate() {
            for i in 0..4 {
                let label = if self.side(t, i).is_some() {
                    let label = self.walls[t as usize][i];
                    Some(if self.owns(t, i) { label } else { label + 1 })
                } else {
                    self.label(t, i)
                };
                if let Some(label) = label.filter(|&l| l != NONE) {
                    opened.set_label(slot as u32, i, label);
                }
            }
        }
        opened
    }

    /// Marks the vertices that have a face on a side of the box, by axis.
    fn on_sides(&self) -> Vec<[bool; 3]> {
        let mut on_side = vec![[false; 3]; self.points.len()];
        for t in self.live() {
            for i in 0..4 {
                if let Some(axis) = self.side(t, i) {
                    for v in self.face(t, i) {
                        on_side[v as usize][axis] = true;
                    }
                }
            }
        }
        on_side
    }
}
