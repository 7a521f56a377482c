//! Vertices at the tips of cones.
//!
//! Cutting follows curves, and a tip is on none: by itself a mesh cuts it off, about half a size
//! below. The vertex of the surface there that leaves the best tetrahedra is moved onto the tip,
//! and stays.

use super::Optimiser;
use super::holds::Hold;
use crate::complex::{NONE, STRAY};
use crate::features::Corner;
use crate::points::{lerp, unique};
use isoform_check::triangles_meet;
use isoform_geom::{Point3, norm, sub};
use std::collections::HashMap;

/// Shares of the way to a tip that are tried: the whole of it if possible.
const TIP_STEP_SHARES: [f64; 3] = [1.0, 0.5, 0.25];

impl Optimiser<'_> {
    /// Fixes vertices that stand at tips.
    pub(super) fn hold_apexes(&mut self) {
        if self.surface.apexes.is_empty() {
            return;
        }
        for near in self.near_apexes(&self.surface.apexes) {
            if let Some(&(_, v)) = near.first().filter(|n| n.0 == 0.0) {
                self.hold[v as usize] = Hold::Fixed;
            }
        }
    }

    /// Moves vertices onto the tips of cones, and onto points of contact that have none yet.
    pub(super) fn take_apexes(&mut self, goal: f64) {
        let corners = self.surface.apexes.iter();
        self.take(corners.map(|c| (c.clone(), None)).collect(), goal);
        let across = self.contract_across();
        self.take(across, goal);
    }

    /// Moves vertices onto corners (those given with them, or any suitable one), step by step where
    /// the whole way is not possible yet, and mends their surroundings.
    pub(super) fn take(&mut self, corners: Vec<(Corner, Option<u32>)>, goal: f64) {
        let (apexes, mut on_the_way): (Vec<Corner>, Vec<Option<u32>>) = corners.into_iter().unzip();
        for _ in 0..6 {
            if apexes.is_empty() || self.control.is_stopped() {
                break;
            }
            let near = self.near_apexes(&apexes);
            let mut moved = Vec::new();
            for ((apex, near), v) in apexes.iter().zip(near).zip(&mut on_the_way) {
                if let Some(next) = self.approach(apex, &near, *v) {
                    *v = Some(next);
                    moved.push(next);
                }
            }
            if moved.is_empty() {
                break;
            }
            self.make_room(&moved);
            self.mend_all(goal, 8);
        }
        for (apex, v) in apexes.iter().zip(on_the_way) {
            if let Some(v) = v.filter(|&v| self.point(v) != apex.point) {
                self.hold[v as usize] = Hold::On(self.labels[v as usize]);
                self.bring(v, 0.0);
            }
        }
    }

    /// Returns the vertices of the surface around each tip with their distances, nearest first.
    pub(super) fn near_apexes(&self, apexes: &[Corner]) -> Vec<Vec<(f64, u32)>> {
        // Of a cone with an angle of 10 degrees the mesh cuts off a size and a half.
        let reach = 2.0 * self.size;
        let bin = |p: Point3| p.map(|v| (v / reach).floor() as i64);
        let mut bins: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        for (k, apex) in apexes.iter().enumerate() {
            let [x, y, z] = bin(apex.point);
            for n in 0..27 {
                let at = [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1];
                bins.entry(at).or_default().push(k);
            }
        }
        let mut near = vec![Vec::new(); apexes.len()];
        for v in 0..self.complex.points.len() as u32 {
            if self.complex.tet_of[v as usize] == NONE || self.labels[v as usize].is_empty() {
                continue;
            }
            for &k in bins.get(&bin(self.point(v))).into_iter().flatten() {
                let distance = norm(sub(self.point(v), apexes[k].point));
                if distance <= reach {
                    near[k].push((distance, v));
                }
            }
        }
        for list in &mut near {
            let rank = |v: u32| self.surface.rank(self.point(v));
            list.sort_by(|a, b| {
                let by_distance = a.0.total_cmp(&b.0);
                let by_rank = || rank(a.1).cmp(&rank(b.1));
                by_distance.then_with(by_rank).then(a.1.cmp(&b.1))
            });
        }
        near
    }

    /// Moves a vertex towards a tip: the one already on the way, or else the one that leaves the
    /// best tetrahedra and a surface without self-intersection. `None` if one is there, or none can
    /// move.
    fn approach(
        &mut self,
        apex: &Corner,
        near: &[(f64, u32)],
        on_the_way: Option<u32>,
    ) -> Option<u32> {
        if near.first().is_some_and(|n| n.0 == 0.0) {
            return None;
        }
        let around: Vec<u32> = near.iter().map(|n| n.1).collect();
        let tried: Vec<u32> = match on_the_way {
            Some(v) => vec![v],
            None => {
                let may = around.iter().copied().filter(|v| self.may_take(apex, *v));
                // Only the nearest vertices are tried.
                may.take(24).collect()
            }
        };
        let faces = self.faces_around(&around);
        TIP_STEP_SHARES.into_iter().find_map(|share| {
            let (v, p, star) = self.best_move(apex, &tried, share, &faces)?;
            self.suspects.extend_from_slice(&star);
            self.touched[v as usize] = self.clock + 1;
            self.complex.points[v as usize] = p;
            self.hold[v as usize] = Hold::Fixed;
            Some(v)
        })
    }

    /// Returns the vertex that leaves the best tetrahedra, and a surface without self-intersection,
    /// if it moves a share of the way to a tip; with its position there, and its star.
    fn best_move(
        &mut self,
        apex: &Corner,
        tried: &[u32],
        share: f64,
        faces: &[[u32; 3]],
    ) -> Option<(u32, Point3, Vec<u32>)> {
        let mut fit = Vec::new();
        for &v in tried {
            let p = self.point(v);
            let q = if share == 1.0 {
                apex.point
            } else {
                lerp(p, apex.point, share)
            };
            let mut star = Vec::new();
            self.complex.star(v, &mut star);
            let worst = self.worst_at(v, q, &star, &self.faces_at(&star, v));
            // The surroundings improve afterwards.
            if worst > 0.02 {
                fit.push((worst, (v, q, star)));
            }
        }
        fit.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut fit = fit.into_iter().map(|f| f.1);
        fit.find(|(v, q, _)| !self.crosses(*v, *q, faces))
    }

    /// Returns the faces of the surface at some vertices.
    fn faces_around(&mut self, vertices: &[u32]) -> Vec<[u32; 3]> {
        let mut all = Vec::new();
        let mut star = Vec::new();
        for &v in vertices {
            self.complex.star(v, &mut star);
            all.extend(self.faces_at(&star, v).into_iter().map(|f| f.0));
        }
        // Faces of one tetrahedron have a fixed order of vertices.
        let order = |f: &[u32; 3]| {
            let first = (0..3).min_by_key(|k| f[*k]).unwrap_or(0);
            [f[first], f[(first + 1) % 3], f[(first + 2) % 3]]
        };
        unique(all.iter().map(order).collect())
    }

    /// Returns true if the faces at a vertex would intersect others with the vertex at `p`.
    fn crosses(&mut self, v: u32, p: Point3, faces: &[[u32; 3]]) -> bool {
        let before = std::mem::replace(&mut self.complex.points[v as usize], p);
        let points = &self.complex.points;
        let (own, others): (Vec<[u32; 3]>, Vec<[u32; 3]>) =
            faces.iter().partition(|f| f.contains(&v));
        let meets = |a: &[u32; 3]| others.iter().any(|b| triangles_meet(points, *a, *b));
        let found = own.iter().any(meets);
        self.complex.points[v as usize] = before;
        found
    }

    /// Returns true if all pieces on which a vertex lies pass through a tip.
    fn may_take(&self, apex: &Corner, v: u32) -> bool {
        let is_there = |l: &u32| *l < STRAY && apex.pieces.contains(l);
        self.hold[v as usize] != Hold::Fixed && self.labels[v as usize].slice().iter().all(is_there)
    }
}
