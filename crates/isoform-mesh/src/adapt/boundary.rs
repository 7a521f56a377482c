//! Boundary of tetrahedra, which are cut along with it.

use super::align::Cuttable;
use crate::complex::{BOUNDARY, Complex, Face, Ring, STRAY};
use crate::measure::biased_sine;
use crate::points::{lerp, midpoint, unique};
use isoform_control::Control;
use isoform_geom::{Mesh, Point3, norm, sub};
use std::collections::HashMap;

/// Fractions of the way to its target that are tried for a vertex in each round.
const TRIED_STEP_FRACTIONS: [f64; 4] = [1.0, 0.6, 0.3, 0.1];

/// Boundary of tetrahedra, which are cut along with it.
pub(super) struct Boundary {
    complex: Complex,
}

impl Boundary {
    /// Creates the boundary of a mesh's tetrahedra; every boundary face gets the label 0.
    pub(super) fn from_mesh(mesh: Mesh) -> Self {
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

    /// Returns the triangles of the boundary, outward.
    pub(super) fn faces(&self) -> Vec<[u32; 3]> {
        let live = self.complex.live();
        let sides = live.flat_map(|t| (0..4).map(move |i| (t, i)));
        sides
            .filter(|&(t, i)| self.complex.adjacent[t as usize][i] >= BOUNDARY)
            .map(|(t, i)| self.complex.face(t, i))
            .collect()
    }

    /// Labels the boundary faces and returns the tetrahedra; a face without a given label gets
    /// [`STRAY`].
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

    /// Moves boundary vertices step by step to their targets, while inner vertices give way.
    pub(super) fn approach(&mut self, places: &[Point3], control: &Control<'_>) {
        let on_boundary = unique(self.faces().into_iter().flatten().collect());
        let mut left: Vec<u32> = on_boundary
            .iter()
            .copied()
            .filter(|&v| self.complex.point(v) != places[v as usize])
            .collect();
        // In each round inner vertices give way to those that approach their targets.
        for _ in 0..40 {
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

    /// Moves a vertex towards its target as far as its tetrahedra allow. Returns true if it
    /// arrives.
    fn step(&mut self, v: u32, goal: Point3) -> bool {
        let old = self.complex.point(v);
        // Worst biased sine that a step may leave; the optimiser improves it afterwards.
        let least = 0.02f64.min(self.worst_at(v, old));
        for share in TRIED_STEP_FRACTIONS {
            let p = if share == 1.0 {
                goal
            } else {
                lerp(old, goal, share)
            };
            if self.worst_at(v, p) >= least {
                self.complex.points[v as usize] = p;
                return share == 1.0;
            }
        }
        false
    }

    /// Moves an inner vertex to the best of a few positions around it.
    fn give_way(&mut self, v: u32) {
        let p = self.complex.point(v);
        let others = self.others(v);
        let mean = self.mean(&others);
        let step = norm(sub(self.complex.point(others[0]), p));
        let mut best = (self.worst_at(v, p), p);
        let aside = (0..6).map(|k| {
            // Sideways steps tried for an inner vertex in the way, in lengths of one of its edges.
            let move_by = |i: usize| {
                if k / 2 == i {
                    [0.1, -0.1][k % 2] * step
                } else {
                    0.0
                }
            };
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

    /// Returns the other vertices of the tetrahedra at a vertex, once per occurrence.
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

    /// Returns the worst biased sine of the tetrahedra at a vertex if it is moved to `p`.
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
        // Worst biased sine that a vertex moved onto a curve may leave to a tetrahedron, unless it
        // was worse before.
        let may = self.worst_at(v, p) > 0.04f64.min(0.5 * before);
        if may {
            self.complex.points[v as usize] = p;
        }
        may
    }
    fn settle(&mut self, v: u32, p: Point3) {
        let old = self.complex.point(v);
        // Fractions of the way to the surface; the optimiser makes room before it moves the vertex
        // farther.
        for share in [1.0, 0.5, 0.25] {
            if self.move_to(v, lerp(old, p, share)) {
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
