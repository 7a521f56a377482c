//! The boundary of tetrahedra, cut with them.

use super::align::Cuttable;
use crate::complex::{BOUNDARY, Complex, Face, Ring, STRAY};
use crate::measure::biased_sine;
use crate::points::{along, midpoint, unique};
use isoform_control::Control;
use isoform_geom::{Mesh, Point3, norm, sub};
use std::collections::HashMap;

/// Worst biased sine that a vertex of the surface moved onto a curve may leave to a tetrahedron;
/// less where it was less before.
const LEAST: f64 = 0.04;
/// Rounds in which vertices approach their places on the surface, and what is around gives way.
const APPROACH: usize = 40;
/// Shares of the way that are tried in each round.
const SHARES: [f64; 4] = [1.0, 0.6, 0.3, 0.1];
/// Worst biased sine that a step of it may leave; the optimiser mends from there.
const TIGHT: f64 = 0.02;
/// Sideways steps that are tried for an inner vertex in the way, in units of the length of one of
/// its edges.
const ASIDE: [f64; 2] = [0.1, -0.1];
/// Shares of the way onto the surface that are tried for a new vertex. What is left of the way is
/// the optimiser's, which makes room first.
const SETTLING: [f64; 3] = [1.0, 0.5, 0.25];

/// The boundary of tetrahedra, cut with them.
pub(super) struct Boundary {
    complex: Complex,
}

impl Boundary {
    /// Of the tetrahedra of a mesh; every face on the boundary has the label 0.
    pub(super) fn of(mesh: Mesh) -> Self {
        let mut complex = Complex::new(mesh.points, mesh.tets);
        let live: Vec<u32> = complex.live().collect();
        for t in live {
            for n in &mut complex.adjacent[t as usize] {
                if *n >= BOUNDARY {
                    *n = BOUNDARY;
                }
            }
        }
        Self { complex }
    }

    /// The triangles of the boundary, outward.
    pub(super) fn faces(&self) -> Vec<[u32; 3]> {
        let live = self.complex.live();
        let sides = live.flat_map(|t| (0..4).map(move |i| (t, i)));
        sides
            .filter(|&(t, i)| self.complex.adjacent[t as usize][i] >= BOUNDARY)
            .map(|(t, i)| self.complex.face(t, i))
            .collect()
    }

    /// The tetrahedra, with labelled faces; a face without a label lies on no single piece.
    pub(super) fn labelled(self, labels: Vec<Face>) -> Complex {
        let labels: HashMap<[u32; 3], u32> = labels.into_iter().collect();
        let mut complex = self.complex;
        let live: Vec<u32> = complex.live().collect();
        for t in live {
            for i in 0..4 {
                if complex.adjacent[t as usize][i] >= BOUNDARY {
                    let label = labels.get(&complex.face(t, i)).copied();
                    complex.adjacent[t as usize][i] = BOUNDARY | label.unwrap_or(STRAY);
                }
            }
        }
        complex
    }

    /// Brings vertices of the boundary to their places step by step, inner vertices giving way.
    pub(super) fn approach(&mut self, places: &[Point3], control: &Control<'_>) {
        let on_boundary = unique(self.faces().into_iter().flatten().collect());
        let mut left: Vec<u32> = on_boundary
            .iter()
            .copied()
            .filter(|&v| self.complex.point(v) != places[v as usize])
            .collect();
        for _ in 0..APPROACH {
            if left.is_empty() || control.is_stopped() {
                return;
            }
            left.retain(|&v| !self.step(v, places[v as usize]));
            for v in self.complex.vertices_around(&left) {
                if on_boundary.binary_search(&v).is_err() {
                    self.give_way(v);
                }
            }
        }
    }

    /// Moves a vertex towards its goal as far as its tetrahedra allow; true if it gets there.
    fn step(&mut self, v: u32, goal: Point3) -> bool {
        let old = self.complex.point(v);
        let least = TIGHT.min(self.worst_at(v, old));
        for share in SHARES {
            let p = if share == 1.0 {
                goal
            } else {
                along(old, goal, share)
            };
            if self.worst_at(v, p) >= least {
                self.complex.points[v as usize] = p;
                return share == 1.0;
            }
        }
        false
    }

    /// Moves an inner vertex to the best of a few places around it.
    fn give_way(&mut self, v: u32) {
        let p = self.complex.point(v);
        let others = self.others(v);
        let mean = self.mean(&others);
        let step = norm(sub(self.complex.point(others[0]), p));
        let mut best = (self.worst_at(v, p), p);
        let aside = (0..6).map(|k| {
            let move_by = |i: usize| if k / 2 == i { ASIDE[k % 2] * step } else { 0.0 };
            std::array::from_fn(|i| p[i] + move_by(i))
        });
        for q in aside.chain([mean, midpoint(p, mean)]) {
            let worst = self.worst_at(v, q);
            if worst > best.0 {
                best = (worst, q);
            }
        }
        self.complex.points[v as usize] = best.1;
    }

    /// The other vertices of the tetrahedra at a vertex, as often as they occur there.
    fn others(&mut self, v: u32) -> Vec<u32> {
        let mut star = Vec::new();
        self.complex.star(v, &mut star);
        star.iter()
            .flat_map(|&t| self.complex.tets[t as usize])
            .filter(|&k| k != v)
            .collect()
    }

    fn mean(&self, vertices: &[u32]) -> Point3 {
        let n = vertices.len() as f64;
        std::array::from_fn(|i| {
            let coordinates = vertices.iter().map(|&k| self.complex.points[k as usize][i]);
            coordinates.sum::<f64>() / n
        })
    }

    /// The worst tetrahedron at a vertex, were it at `p`.
    fn worst_at(&mut self, v: u32, p: Point3) -> f64 {
        let mut star = Vec::new();
        self.complex.star(v, &mut star);
        let at = |k: u32| {
            if k == v {
                p
            } else {
                self.complex.points[k as usize]
            }
        };
        star.iter()
            .map(|&t| biased_sine(self.complex.tets[t as usize].map(at)))
            .fold(f64::INFINITY, f64::min)
    }
}

impl Cuttable for Boundary {
    fn points(&self) -> &[Point3] {
        &self.complex.points
    }
    fn faces(&self) -> Vec<[u32; 3]> {
        self.faces()
    }
    fn move_to(&mut self, v: u32, p: Point3) -> bool {
        let before = self.worst_at(v, self.complex.point(v));
        let may = self.worst_at(v, p) > LEAST.min(0.5 * before);
        if may {
            self.complex.points[v as usize] = p;
        }
        may
    }
    fn settle(&mut self, v: u32, p: Point3) {
        let old = self.complex.point(v);
        for share in SETTLING {
            if self.move_to(v, along(old, p, share)) {
                return;
            }
        }
    }
    fn split(&mut self, [a, b]: [u32; 2], at: Point3, p: Point3) -> Option<u32> {
        let mut ring = Ring::default();
        if !self.complex.ring_of(a, b, &mut ring) || ring.closed {
            return None;
        }
        let m = self.complex.add_point(at);
        let mut made = Vec::new();
        self.complex.split(&ring, a, b, m, &mut made);
        self.settle(m, p);
        Some(m)
    }
}
