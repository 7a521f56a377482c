//! Cutting: converts the lattice to tetrahedra that conform to the solid. Vertices are snapped to
//! corners, curves and the surface, then edges that still cross are cut.
//!
//! Cutting splits one edge at a time where a piece vanishes, which keeps the complex conforming in
//! any order. It ends when the signs of the pieces at the vertices decide for every tetrahedron if
//! it is inside: faces between inside and outside then lie on one piece each, edges of the solid on
//! two, corners on three. Snapping (the warp of Labelle and Shewchuk, 2007, extended to curves and
//! corners) only saves cuts that would leave short edges; it is refused if a tetrahedron would
//! become poor.

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

/// Number of snapped vertices, or of tetrahedra searched for edges to cut, between two checks of
/// `control`: a millisecond or less. More make a stop wait; fewer cost time, about a microsecond
/// per check.
const ITEMS_PER_STOP_CHECK: usize = 64;

/// A complex being cut.
pub(crate) struct Cutter<'s> {
    surface: &'s Surface<'s>,
    control: &'s Control<'s>,
    complex: Complex,
    /// Pieces that each vertex is held on.
    on: Vec<On>,
    /// True for vertices shared with the lattice beyond the band.
    frozen: Vec<bool>,
    /// Value of the solid at each vertex, 0 on its surface.
    value: Vec<f64>,
    /// Cached distances of each vertex from pieces.
    known: Vec<Vec<(u32, f64)>>,
    /// Edge length of the lattice cells around each vertex.
    cell: Vec<f64>,
    star: Vec<u32>,
    made: Vec<u32>,
    /// Number of cut edges at each vertex.
    cuts: Vec<u16>,
    /// Centroids of tetrahedra left undecided, because edges at one of their vertices were cut too
    /// often or the budget of cuts ran out.
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
    /// Returns a vertex where the function is not a number.
    pub(crate) fn not_a_number(&self) -> Option<Point3> {
        self.value
            .iter()
            .position(|v| v.is_nan())
            .map(|v| self.complex.points[v])
    }

    /// Snaps and cuts; then every tetrahedron is inside or outside, and in one of the regions into
    /// which the `dividers` split the solid. A divider is the surface with another layer in focus.
    pub(crate) fn run(&mut self, dividers: &'s [Surface<'s>]) {
        self.snap_features();
        self.snap_surface();
        let whole = self.surface;
        for divider in dividers {
            self.turn_to(divider);
            self.snap_surface();
        }
        // Moving vertices of one layer may change decisions of another. The second pass seldom
        // finds anything.
        for _ in 0..4 {
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

    /// Returns the distance of a vertex from a piece; 0 for pieces that hold it.
    fn distance(&mut self, v: u32, piece: u32) -> f64 {
        if self.on[v as usize].contains(piece) {
            return 0.0;
        }
        let known = &self.known[v as usize];
        if let Some(k) = known.iter().find(|k| k.0 == piece) {
            return k.1;
        }
        // On a side the nearest image decides if the vertex may count as lying on the piece.
        let p = self.complex.point(v);
        let d = match self.is_on_side(v) {
            true => self.surface.nearest_distance(piece, p),
            false => self.surface.distance(piece, p),
        };
        // On a side only explicit entries are cached: the distance differs between the sides.
        if !self.is_on_side(v) {
            self.known[v as usize].push((piece, d));
        }
        d
    }

    /// Returns true if a vertex lies on a side of a unit cell.
    #[inline]
    fn is_on_side(&self, v: u32) -> bool {
        let is_side = |&piece: &u32| self.surface.is_side(piece);
        self.surface.torus.is_some() && self.on[v as usize].slice().iter().any(is_side)
    }

    /// Returns the distance of a vertex from a piece, evaluated in a tetrahedron: on a side of a
    /// unit cell that of the image there.
    #[inline]
    fn distance_in(&mut self, t: u32, v: u32, piece: u32) -> f64 {
        if self.is_on_side(v) {
            self.distance_beside(t, v, piece)
        } else {
            self.distance(v, piece)
        }
    }

    /// Returns the distance like [`Self::distance_in`], for a vertex on a side of a unit cell.
    #[inline(never)]
    fn distance_beside(&mut self, t: u32, v: u32, piece: u32) -> f64 {
        let is_settled = self.known[v as usize].iter().any(|k| k.0 == piece);
        if is_settled || self.on[v as usize].contains(piece) || self.surface.is_side(piece) {
            return self.distance(v, piece);
        }
        let p = self.complex.corners(t)[self.complex.place(t, v)];
        self.surface.distance_from(piece, p, self.complex.middle(t))
    }

    /// Returns the worst biased sine of the tetrahedra at `v` if it is moved to `p`.
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

    /// Moves a vertex to a point on pieces, which then hold it.
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

/// Returns, for each vertex, the edge length of the cells of a body-centred cubic lattice that has
/// the mean edge length there.
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
    // Tetrahedra have four short edges (√3/2) and two long ones. Counted by tetrahedra, each
    // lattice vertex has eight short edges six times and six long ones four times.
    let mean = (8.0 * 6.0 * 0.75f64.sqrt() + 6.0 * 4.0) / (8.0 * 6.0 + 6.0 * 4.0);
    sum.into_iter()
        .map(|(s, n)| if n > 0.0 { s / n / mean } else { 0.0 })
        .collect()
}
