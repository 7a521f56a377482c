//! From the lattice to tetrahedra that conform to the solid: vertices are snapped to corners,
//! curves and the surface, then what still crosses is cut.
//!
//! Cutting splits one edge at a time where a piece vanishes, which keeps the complex conforming
//! whatever the order. It goes on until in every tetrahedron the signs of the pieces at the
//! vertices decide whether it is inside: faces between inside and outside then lie on one piece
//! each, edges of the solid on two, corners on three. Snapping (the warp of Labelle and Shewchuk,
//! 2007, extended to curves and corners) only saves cuts that would leave short edges; it is
//! refused where a tetrahedron would suffer.

mod edges;
mod keep;
mod sign;
mod snap;

use crate::complex::{Complex, EDGES};
use crate::measure::biased_sine;
use crate::points::unique;
use crate::surface::{On, Surface};
use isoform_control::Control;
use isoform_geom::Point3;
use rayon::prelude::*;

/// Vertices snapped, or tetrahedra looked at for edges to cut, between two looks at the clock: a
/// millisecond or less. More let a stop wait; fewer cost time, each look about a microsecond.
const LOOK: usize = 64;
/// Passes over the layers of a divided solid: what one layer moves, another may have decided. The
/// second pass seldom finds anything.
const PASSES: usize = 4;

/// The complex while it is cut.
pub(crate) struct Cutter<'s> {
    surface: &'s Surface<'s>,
    control: &'s Control<'s>,
    complex: Complex,
    /// Pieces that each vertex is held on.
    on: Vec<On>,
    /// Vertices shared with the lattice beyond the band.
    frozen: Vec<bool>,
    /// The solid's value at each vertex, 0 on its surface.
    value: Vec<f64>,
    /// Distances to pieces, as far as they were asked for.
    known: Vec<Vec<(u32, f64)>>,
    /// Edge of the lattice's cells around each vertex.
    cell: Vec<f64>,
    star: Vec<u32>,
    made: Vec<u32>,
    /// How often edges at each vertex were cut.
    cuts: Vec<u16>,
    /// Tetrahedra left undecided, because edges at one of their vertices were cut too often or the
    /// budget of cuts ran out.
    pub(crate) undecided: Vec<Point3>,
}

impl<'s> Cutter<'s> {
    pub(crate) fn new(
        surface: &'s Surface<'s>,
        complex: Complex,
        frozen: Vec<bool>,
        control: &'s Control<'s>,
    ) -> Self {
        let value: Vec<f64> = complex
            .points
            .par_iter()
            .map(|&p| surface.value(p).0)
            .collect();
        let n = complex.points.len();
        let cell = local_cells(&complex);
        Self {
            surface,
            control,
            cell,
            on: complex
                .points
                .iter()
                .map(|&p| surface.sides_at(p))
                .collect(),
            complex,
            frozen,
            value,
            known: vec![Vec::new(); n],
            star: Vec::new(),
            made: Vec::new(),
            cuts: vec![0; n],
            undecided: Vec::new(),
        }
    }
}

impl<'s> Cutter<'s> {
    /// A vertex where the function is not a number.
    pub(crate) fn not_a_number(&self) -> Option<Point3> {
        self.value
            .iter()
            .position(|v| v.is_nan())
            .map(|v| self.complex.points[v])
    }

    /// Snaps and cuts; then every tetrahedron is inside or outside, and in one of the regions that
    /// the `dividers` part the solid into: these are its surface with one layer after the other in
    /// focus.
    pub(crate) fn run(&mut self, dividers: &'s [Surface<'s>]) {
        self.snap_features();
        self.snap_surface();
        let whole = self.surface;
        for divider in dividers {
            self.turn_to(divider);
            self.snap_surface();
        }
        for _ in 0..PASSES {
            self.turn_to(whole);
            let mut done = self.cut();
            if dividers.is_empty() {
                return;
            }
            for divider in dividers {
                self.turn_to(divider);
                done += self.cut();
            }
            if done == 0 {
                break;
            }
        }
        self.turn_to(whole);
    }

    /// Puts another layer in focus.
    fn turn_to(&mut self, surface: &'s Surface<'s>) {
        if surface.focus == self.surface.focus {
            return;
        }
        self.surface = surface;
        let value = |&p: &Point3| surface.value(p).0;
        self.value = self.complex.points.par_iter().map(value).collect();
        for (v, on) in self.on.iter().enumerate() {
            let is_of_layer = |&i: &u32| surface.layer_of(i) == surface.focus;
            if self.value[v].abs() <= surface.zero || on.slice().iter().any(is_of_layer) {
                self.value[v] = 0.0;
            }
        }
    }

    /// The distance of a vertex to a piece; 0 for pieces that hold it.
    fn distance(&mut self, v: u32, piece: u32) -> f64 {
        if self.on[v as usize].contains(piece) {
            return 0.0;
        }
        let known = &self.known[v as usize];
        if let Some(k) = known.iter().find(|k| k.0 == piece) {
            return k.1;
        }
        // On a side the nearest image tells whether the vertex may count as lying on the piece.
        let p = self.complex.point(v);
        let d = match self.is_on_side(v) {
            true => self.surface.nearest_distance(piece, p),
            false => self.surface.distance(piece, p),
        };
        // On a side only what is settled is kept: the distance is another one on each side.
        if !self.is_on_side(v) {
            self.known[v as usize].push((piece, d));
        }
        d
    }

    /// Whether a vertex is on a side of a unit cell.
    #[inline]
    fn is_on_side(&self, v: u32) -> bool {
        let is_side = |&piece: &u32| self.surface.is_side(piece);
        self.surface.torus.is_some() && self.on[v as usize].slice().iter().any(is_side)
    }

    /// The distance of a vertex to a piece as seen from a tetrahedron: on a side of a unit cell
    /// that of the image there.
    #[inline]
    fn distance_in(&mut self, t: u32, v: u32, piece: u32) -> f64 {
        if self.is_on_side(v) {
            self.distance_beside(t, v, piece)
        } else {
            self.distance(v, piece)
        }
    }

    /// As [`Self::distance_in`], for a vertex on a side of a unit cell.
    #[inline(never)]
    fn distance_beside(&mut self, t: u32, v: u32, piece: u32) -> f64 {
        let is_settled = self.known[v as usize].iter().any(|k| k.0 == piece);
        if is_settled || self.on[v as usize].contains(piece) || self.surface.is_side(piece) {
            return self.distance(v, piece);
        }
        let p = self.complex.corners(t)[self.complex.place(t, v)];
        self.surface.distance_from(piece, p, self.complex.middle(t))
    }

    /// Worst measure of the tetrahedra at `v` if it stood at `p`.
    fn worst_if(&mut self, v: u32, p: Point3) -> f64 {
        let mut star = std::mem::take(&mut self.star);
        self.complex.star(v, &mut star);
        let before = std::mem::replace(&mut self.complex.points[v as usize], p);
        let worst = star
            .iter()
            .map(|&t| biased_sine(self.complex.corners(t)))
            .fold(f64::INFINITY, f64::min);
        self.complex.points[v as usize] = before;
        self.star = star;
        worst
    }

    fn neighbours(&mut self, v: u32) -> Vec<u32> {
        let mut star = std::mem::take(&mut self.star);
        self.complex.star(v, &mut star);
        let out = star
            .iter()
            .flat_map(|&t| self.complex.tets[t as usize])
            .filter(|&w| w != v)
            .collect();
        self.star = star;
        unique(out)
    }

    /// Puts a vertex at a place on pieces.
    fn place(&mut self, v: u32, p: Point3, on: On) {
        let p = self.surface.on_lower_sides(p, &on);
        self.complex.points[v as usize] = p;
        self.on[v as usize] = on;
        self.known[v as usize].clear();
        self.value[v as usize] = self.surface.value(p).0;
        if self.value[v as usize].abs() <= self.surface.zero {
            self.value[v as usize] = 0.0;
        }
    }
}

/// Edge of the cells of a body-centred lattice with the mean edge length at each vertex.
fn local_cells(complex: &Complex) -> Vec<f64> {
    let mut sum = vec![(0.0, 0.0); complex.points.len()];
    for t in complex.live() {
        let v = complex.tets[t as usize];
        for (i, j) in EDGES {
            let l = complex.edge_length(v[i], v[j]);
            for k in [v[i], v[j]] {
                let s: &mut (f64, f64) = &mut sum[k as usize];
                *s = (s.0 + l, s.1 + 1.0);
            }
        }
    }
    // Counted by tetrahedra: four of six edges are short ones (√3/2), two long ones. In the lattice
    // each vertex sees its short edges six times and its long ones four times.
    let mean = (8.0 * 6.0 * 0.75f64.sqrt() + 6.0 * 4.0) / (8.0 * 6.0 + 6.0 * 4.0);
    sum.into_iter()
        .map(|(s, n)| if n > 0.0 { s / n / mean } else { 0.0 })
        .collect()
}
