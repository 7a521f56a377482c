//! From the lattice to tetrahedra that conform to the solid: vertices are snapped to corners,
//! curves and the surface, then what still crosses is cut.
//!
//! Cutting splits one edge at a time where a piece vanishes, which keeps the complex conforming
//! whatever the order. It goes on until in every tetrahedron the signs of the pieces at the
//! vertices decide whether it is inside: faces between inside and outside then lie on one piece
//! each, edges of the solid on two, corners on three. Snapping (the warp of Labelle and Shewchuk,
//! 2007, extended to curves and corners) only saves cuts that would leave short edges; it is
//! refused where a tetrahedron would suffer.

use crate::complex::{BOUNDARY, Complex, EDGES, NONE, Ring, STRAY};
use crate::lattice::{IN, Lattice, OUT};
use crate::measure::biased_sine;
use crate::surface::{On, Surface};
use isoform_control::Control;
use isoform_geom::{Csg, Point3, dot, norm, sub};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Worst measure that a snap to a corner, a curve, the surface may leave. Higher: more cuts and
/// short edges; lower: flat tetrahedra that only the optimiser can mend.
const SNAP_QUALITY: [f64; 3] = [0.01, 0.04, 0.1];
/// Farthest snap to a curve or corner, in cells. Voronoi cells of the lattice reach 0.559.
const SNAP_REACH: f64 = 0.56;
/// Share of an edge next to a vertex within which the vertex is moved instead of cutting: long and
/// short edges of the lattice (Labelle and Shewchuk, table 1).
const WARP: [f64; 2] = [0.25, 0.41];

/// Depth, in lengths of the edge to be cut, below which an end that cannot be moved counts as lying
/// on the surface all the same: cuts closer than that would go on for ever where pieces touch, and
/// where three meet along a curve.
const SHALLOW: f64 = 1e-2;
/// Pieces near a vertex beyond which corners are left to the cutting: their number grows with the
/// third power.
const CROWDED: usize = 6;
/// Tetrahedra of the lattice per cut allowed; ordinary solids need a cut for every ten or more.
const BUDGET: usize = 2;

/// Cuts of edges at one vertex after which the lattice is too coarse there; regular ones see a few
/// dozen.
const TIRED: u16 = 200;

/// Vertices snapped, or edges cut, between two looks at the clock: some milliseconds.
const LOOK: usize = 64;

/// The complex while it is cut.
pub(crate) struct Cutter<'s> {
    pub(crate) surface: &'s Surface<'s>,
    control: &'s Control<'s>,
    pub(crate) complex: Complex,
    /// Pieces that each vertex is held on.
    pub(crate) on: Vec<On>,
    /// Vertices shared with the lattice beyond the band.
    pub(crate) frozen: Vec<bool>,
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

/// What the signs at the vertices say of a tetrahedron.
enum Side {
    In,
    Out,
    /// All values that matter are 0: it lies flat in the surface.
    Flat,
    /// The pieces that must be cut.
    Cut(Vec<u32>),
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
            complex,
            on: vec![On::default(); n],
            frozen,
            value,
            known: vec![Vec::new(); n],
            star: Vec::new(),
            made: Vec::new(),
            cuts: vec![0; n],
            undecided: Vec::new(),
        }
    }

    /// A vertex where the function is not a number.
    pub(crate) fn not_a_number(&self) -> Option<Point3> {
        self.value
            .iter()
            .position(|v| v.is_nan())
            .map(|v| self.complex.points[v])
    }

    /// Snaps and cuts; then every tetrahedron is inside or outside.
    pub(crate) fn run(&mut self) {
        self.snap_features();
        self.snap_surface();
        self.cut();
    }

    fn distance(&mut self, v: u32, piece: u32) -> f64 {
        if self.on[v as usize].contains(piece) {
            return 0.0;
        }
        let known = &self.known[v as usize];
        if let Some(k) = known.iter().find(|k| k.0 == piece) {
            return k.1;
        }
        let d = self
            .surface
            .distance(piece, self.complex.points[v as usize]);
        self.known[v as usize].push((piece, d));
        d
    }

    fn edge_length(&self, a: u32, b: u32) -> f64 {
        norm(sub(
            self.complex.points[a as usize],
            self.complex.points[b as usize],
        ))
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
        let mut out: Vec<u32> = star
            .iter()
            .flat_map(|&t| self.complex.tets[t as usize])
            .filter(|&w| w != v)
            .collect();
        self.star = star;
        out.sort_unstable();
        out.dedup();
        out
    }

    fn place(&mut self, v: u32, p: Point3, on: On) {
        self.complex.points[v as usize] = p;
        self.on[v as usize] = on;
        self.known[v as usize].clear();
        self.value[v as usize] = self.surface.value(p).0;
        if self.value[v as usize].abs() <= self.surface.zero {
            self.value[v as usize] = 0.0;
        }
    }

    /// Corners first, then curves, nearest vertices first.
    fn snap_features(&mut self) {
        let candidates: Vec<Vec<(f64, u32, On, Point3)>> = (0..self.complex.points.len() as u32)
            .into_par_iter()
            .map(|v| {
                if self.frozen[v as usize] || self.control.is_stopped() {
                    Vec::new()
                } else {
                    self.features_near(v, SNAP_REACH * self.cell[v as usize])
                }
            })
            .collect();
        let mut candidates: Vec<_> = candidates.into_iter().flatten().collect();
        candidates.sort_by(|a, b| {
            b.2.len()
                .cmp(&a.2.len())
                .then(a.0.total_cmp(&b.0))
                .then(a.1.cmp(&b.1))
        });
        let mut corners: Vec<Point3> = Vec::new();
        for (k, (_, v, on, p)) in candidates.into_iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return;
            }
            if !self.on[v as usize].is_empty() {
                continue;
            }
            let near = |q: &Point3, d: f64| norm(sub(*q, p)) < d;
            if on.len() == 3 {
                if corners
                    .iter()
                    .any(|q| near(q, 1e-6 * self.cell[v as usize]))
                    || self.worst_if(v, p) < SNAP_QUALITY[0]
                {
                    continue;
                }
                corners.push(p);
            } else {
                // Neighbours on the same curve keep a distance.
                let close = 0.5 * self.cell[v as usize];
                let crowded = self.neighbours(v).iter().any(|&w| {
                    let other = self.on[w as usize];
                    on.slice().iter().all(|&i| other.contains(i))
                        && near(&self.complex.points[w as usize], close)
                });
                if crowded || self.worst_if(v, p) < SNAP_QUALITY[1] {
                    continue;
                }
            }
            self.place(v, p, on);
        }
    }

    /// Corners and curve points within reach of a vertex.
    fn features_near(&self, v: u32, reach: f64) -> Vec<(f64, u32, On, Point3)> {
        let p = self.complex.points[v as usize];
        let k = self.surface.lattice.state_at(p);
        let mut found = Vec::new();
        if k < 2 {
            return found;
        }
        let pieces: Vec<u32> = self.surface.lattice.trees[k as usize - 2]
            .1
            .iter()
            .copied()
            .filter(|&i| self.surface.distance(i, p).abs() < reach)
            .collect();
        let mut consider = |on: &[u32]| {
            let Some(q) = self.surface.project(on, p) else {
                return;
            };
            let d = norm(sub(p, q));
            if d > reach || self.surface.value(q).0.abs() > self.surface.zero {
                return;
            }
            let holds = if on.len() == 2 {
                self.surface.is_edge([on[0], on[1]], q)
            } else {
                self.surface.is_corner(on, q)
            };
            if holds {
                found.push((d, v, On::of(on), q));
            }
        };
        for (i, &a) in pieces.iter().enumerate() {
            for (j, &b) in pieces.iter().enumerate().take(i) {
                consider(&[b, a]);
                if pieces.len() <= CROWDED {
                    for &c in &pieces[..j] {
                        consider(&[c, b, a]);
                    }
                }
            }
        }
        found
    }

    /// Vertices next to the surface are moved onto it.
    fn snap_surface(&mut self) {
        let mut near: Vec<u32> = (0..self.complex.points.len() as u32)
            .filter(|&v| {
                let f = self.value[v as usize];
                f != 0.0
                    && f.abs() < 0.5 * self.cell[v as usize]
                    && !self.frozen[v as usize]
                    && self.on[v as usize].is_empty()
            })
            .collect();
        near.sort_by(|&u, &v| {
            self.value[u as usize]
                .abs()
                .total_cmp(&self.value[v as usize].abs())
                .then(u.cmp(&v))
        });
        for (k, v) in near.into_iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return;
            }
            let (f, a) = (self.value[v as usize], self.cell[v as usize]);
            let mut least: Option<(f64, u32)> = None;
            for w in self.neighbours(v) {
                let g = self.value[w as usize];
                if f * g < 0.0 {
                    let long = self.edge_length(v, w) > 0.94 * a;
                    // An infinite value is at least a cell away.
                    let share = f.abs() / (f.abs() + g.abs().min(2.0 * a));
                    let limit = if long { WARP[0] } else { WARP[1] };
                    if share < limit && least.is_none_or(|l| share < l.0) {
                        least = Some((share, w));
                    }
                }
            }
            let Some((_, w)) = least else { continue };
            let p = self.complex.points[v as usize];
            let (_, piece) = self.surface.value(p);
            let zero = self.surface.zero;
            let mut target = self
                .surface
                .project(&[piece], p)
                .filter(|&q| norm(sub(p, q)) < 0.6 * a && self.surface.value(q).0.abs() <= zero)
                .map(|q| (q, piece));
            if target.is_none() {
                let (q, g) = (self.complex.points[w as usize], self.value[w as usize]);
                target = self.surface.root(p, f, q, g).and_then(|(t, piece)| {
                    let at = std::array::from_fn(|i| p[i] + t * (q[i] - p[i]));
                    self.surface.project(&[piece], at).map(|q| (q, piece))
                });
            }
            if let Some((q, piece)) = target
                && self.worst_if(v, q) >= SNAP_QUALITY[2]
            {
                self.place(v, q, On::of(&[piece]));
            }
        }
    }

    /// What the vertices' signs say of a tetrahedron.
    fn side(&mut self, t: u32) -> Side {
        let v = self.complex.tets[t as usize];
        let k = match self.surface.lattice.state_at(self.complex.middle(t)) {
            IN => return Side::In,
            OUT => return Side::Out,
            k => k as usize - 2,
        };
        let surface = self.surface;
        let (tree, pieces) = &surface.lattice.trees[k];
        let mut ranges = Vec::with_capacity(pieces.len());
        for &i in pieces {
            let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
            for v in v {
                let d = self.distance(v, i);
                (lo, hi) = (lo.min(d), hi.max(d));
            }
            ranges.push((i, lo, hi));
        }
        side(tree, &ranges)
    }

    fn cut(&mut self) {
        let mut queue: VecDeque<u32> = self.complex.live().collect();
        let mut budget = queue.len() / BUDGET + 10_000;
        let mut ring = Ring::default();
        while let Some(t) = queue.pop_front() {
            if !self.complex.is_there(t) {
                continue;
            }
            if budget == 0 || (budget.is_multiple_of(LOOK) && self.control.is_stopped()) {
                queue.push_front(t);
                self.undecided.extend(
                    queue
                        .into_iter()
                        .filter(|&t| self.complex.is_there(t))
                        .map(|t| self.complex.middle(t)),
                );
                return;
            }
            let Some((u, w, piece)) = self.crossing(t) else {
                continue;
            };
            if self.cuts[u as usize].max(self.cuts[w as usize]) > TIRED {
                self.undecided.push(self.complex.middle(t));
                continue;
            }
            self.cuts[u as usize] += 1;
            self.cuts[w as usize] += 1;
            budget -= 1;
            let changed = self.cut_edge(t, u, w, piece, &mut ring);
            queue.extend(changed);
        }
    }

    /// The longest edge of a tetrahedron that the surface crosses, or that a piece crosses which
    /// leaves it undecided. Where an edge may run through a thin sheet from outside to outside both
    /// kinds compete: cutting only the shorter ones around it would go on for ever.
    fn crossing(&mut self, t: u32) -> Option<(u32, u32, Option<u32>)> {
        let v = self.complex.tets[t as usize];
        let edges = EDGES.map(|(i, j)| (v[i].min(v[j]), v[i].max(v[j])));
        let mut best: Option<(f64, u32, u32)> = None;
        let longest = |best: &mut Option<(f64, u32, u32)>, length: f64, a: u32, b: u32| {
            if best.is_none_or(|o| length > o.0 || (length == o.0 && (a, b) < (o.1, o.2))) {
                *best = Some((length, a, b));
            }
        };
        let mut through = false;
        for (a, b) in edges {
            let (f, g) = (self.value[a as usize], self.value[b as usize]);
            if f * g < 0.0 {
                longest(&mut best, self.edge_length(a, b), a, b);
            } else if f * g > 0.0 {
                through |= f.abs() + g.abs() < self.edge_length(a, b);
            }
        }
        if let Some((_, a, b)) = best
            && !through
        {
            return Some((a, b, None));
        }
        let mut which = None;
        if let Side::Cut(pieces) = self.side(t) {
            for piece in pieces {
                for (a, b) in edges {
                    let by_value = self.value[a as usize] * self.value[b as usize] < 0.0;
                    if !by_value && self.distance(a, piece) * self.distance(b, piece) < 0.0 {
                        let before = best;
                        longest(&mut best, self.edge_length(a, b), a, b);
                        if best != before {
                            which = Some(piece);
                        }
                    }
                }
            }
        }
        best.map(|(_, a, b)| (a, b, which))
    }

    /// Cuts the edge where the surface (or one piece) crosses it, or moves an end there. Returns
    /// the tetrahedra that changed.
    fn cut_edge(
        &mut self,
        t: u32,
        u: u32,
        w: u32,
        piece: Option<u32>,
        ring: &mut Ring,
    ) -> Vec<u32> {
        let (a, b) = (
            self.complex.points[u as usize],
            self.complex.points[w as usize],
        );
        let found = match piece {
            None => {
                let clamp = |v: f64| v.clamp(-f64::MAX, f64::MAX);
                self.surface.root(
                    a,
                    clamp(self.value[u as usize]),
                    b,
                    clamp(self.value[w as usize]),
                )
            }
            Some(i) => {
                let (da, db) = (self.distance(u, i), self.distance(w, i));
                self.surface.root_of(i, a, da, b, db).map(|t| (t, i))
            }
        };
        let asked = piece;
        let (share, piece) = found.unwrap_or((0.5, piece.unwrap_or(u32::MAX)));
        // The nearer end is moved if it can be.
        let (end, near) = if share < 0.5 {
            (u, share)
        } else {
            (w, 1.0 - share)
        };
        if near < 0.3
            && piece != u32::MAX
            && let Some(changed) = self.slide(end, piece)
        {
            return changed;
        }
        if let Some(changed) = self.touch(u, w, asked, piece) {
            return changed;
        }
        let at: Point3 = std::array::from_fn(|i| a[i] + share * (b[i] - a[i]));
        let mut on = self.on[u as usize].common(&self.on[w as usize]);
        if piece != u32::MAX && found.is_some() {
            on = on.with(piece).unwrap_or(on);
        }
        let m = self.complex.add_point(at);
        self.on.push(On::default());
        self.frozen.push(false);
        self.value.push(0.0);
        self.known.push(Vec::new());
        self.cuts.push(0);
        self.cell
            .push(self.cell[u as usize].min(self.cell[w as usize]));
        self.complex.ring(t, u, w, ring);
        let mut made = std::mem::take(&mut self.made);
        self.complex.split(ring, u, w, m, &mut made);
        let target = self
            .surface
            .project(on.slice(), at)
            .filter(|q| norm(sub(*q, at)) < 0.5 * norm(sub(a, b)));
        match target {
            Some(q) if on.len() < 2 || self.worst_if(m, q) > 1e-3 => self.place(m, q, on),
            _ => {
                // Left on the chord, a little off the pieces: the optimiser brings it there when
                // there is room.
                self.place(m, at, on);
                self.value[m as usize] = if on.is_empty() {
                    self.value[m as usize]
                } else {
                    0.0
                };
            }
        }
        let changed = made.clone();
        self.made = made;
        changed
    }

    /// Lets the end of an edge that is nearer to the surface (or to a piece alone) count as lying
    /// on it, if it is so near that a cut would only leave a short edge or a flat tetrahedron. The
    /// optimiser brings it there.
    fn touch(&mut self, u: u32, w: u32, asked: Option<u32>, found: u32) -> Option<Vec<u32>> {
        let depth = |s: &mut Self, v: u32| match asked {
            None => s.value[v as usize].abs(),
            Some(i) => s.distance(v, i).abs(),
        };
        let (du, dw) = (depth(self, u), depth(self, w));
        let (end, depth) = if du <= dw { (u, du) } else { (w, dw) };
        if depth >= SHALLOW * self.edge_length(u, w) {
            return None;
        }
        let deciding = match asked {
            Some(i) => i,
            None => self.surface.value(self.complex.points[end as usize]).1,
        };
        let k = self
            .surface
            .lattice
            .state_at(self.complex.points[end as usize]);
        let mut near = if k >= 2 {
            self.surface.lattice.trees[k as usize - 2].1.to_vec()
        } else {
            Vec::new()
        };
        near.retain(|&i| self.distance(end, i).abs() < SHALLOW * self.edge_length(u, w));
        near.extend([deciding, found]);
        for i in near {
            if i != u32::MAX && self.distance(end, i).abs() < SHALLOW * self.edge_length(u, w) {
                self.known[end as usize].retain(|k| k.0 != i);
                self.known[end as usize].push((i, 0.0));
            }
        }
        if asked.is_none() {
            self.value[end as usize] = 0.0;
        }
        self.complex.star(end, &mut self.star);
        Some(self.star.clone())
    }

    /// Moves a vertex along the pieces that it is held on to one more.
    fn slide(&mut self, v: u32, piece: u32) -> Option<Vec<u32>> {
        if self.frozen[v as usize] {
            return None;
        }
        let on = self.on[v as usize].with(piece)?;
        let p = self.complex.points[v as usize];
        let q = self.surface.project(on.slice(), p)?;
        let far = norm(sub(p, q));
        let zero = self.surface.zero;
        if far > 0.5 * self.cell[v as usize]
            || (!self.on[v as usize].is_empty() && self.surface.value(q).0.abs() > zero)
        {
            return None;
        }
        if self.worst_if(v, q) < 0.08 {
            return None;
        }
        self.place(v, q, on);
        self.complex.star(v, &mut self.star);
        Some(self.star.clone())
    }

    /// Whether each tetrahedron is inside.
    pub(crate) fn inside(&mut self) -> Vec<bool> {
        let mut inside = vec![false; self.complex.tets.len()];
        for t in 0..self.complex.tets.len() as u32 {
            if !self.complex.is_there(t) {
                continue;
            }
            inside[t as usize] = match self.side(t) {
                Side::In => true,
                Side::Out => false,
                Side::Flat | Side::Cut(_) => self.surface.value(self.complex.middle(t)).0 > 0.0,
            };
        }
        inside
    }

    /// The piece that a face on the surface lies on: all three vertices vanish on it, and its
    /// normal is the face's as nearly as possible.
    pub(crate) fn piece_of(&mut self, f: [u32; 3]) -> Option<u32> {
        let p = f.map(|v| self.complex.points[v as usize]);
        let normal = isoform_geom::cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let middle: Point3 = std::array::from_fn(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0);
        let mut pieces: Vec<u32> = self.on[f[0] as usize].slice().to_vec();
        for c in [middle, p[0], p[1], p[2]] {
            let k = self.surface.lattice.state_at(c);
            if k >= 2 {
                pieces.extend(&self.surface.lattice.trees[k as usize - 2].1);
            }
        }
        pieces = crate::lattice::unique(pieces);
        pieces.retain(|&i| f.iter().all(|&v| self.distance(v, i) == 0.0));
        if pieces.len() > 1 {
            // Several pieces hold all three vertices: those that are the surface at one of them.
            let faces: Vec<u32> = pieces
                .iter()
                .copied()
                .filter(|&i| p.iter().any(|&q| self.surface.is_face(i, q)))
                .collect();
            if !faces.is_empty() {
                pieces = faces;
            }
        }
        let mut best: Option<(f64, u32)> = None;
        for i in pieces {
            let g = self.surface.solid.gradient(i, middle).1;
            // Vertices that only count as lying on a piece stand behind those that do.
            let exact = f
                .iter()
                .all(|&v| self.surface.distance(i, self.complex.points[v as usize]) == 0.0);
            let c = -dot(g, normal) / (norm(g) * norm(normal)).max(1e-300)
                + if exact { 2.0 } else { 0.0 };
            if best.is_none_or(|b| c > b.0 + 1e-9) {
                best = Some((c, i));
            }
        }
        best.map(|b| b.1)
    }
}

/// Edge of the cells of a body-centred lattice with the mean edge length at each vertex.
fn local_cells(complex: &Complex) -> Vec<f64> {
    let mut sum = vec![(0.0, 0.0); complex.points.len()];
    for t in complex.live() {
        let v = complex.tets[t as usize];
        for (i, j) in EDGES {
            let l = norm(sub(
                complex.points[v[i] as usize],
                complex.points[v[j] as usize],
            ));
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

/// The sign of a tree from the ranges of its pieces over the vertices, where 0 is on either side.
fn side(tree: &Csg, ranges: &[(u32, f64, f64)]) -> Side {
    let many = |children: &[Csg], is_min: bool| {
        let (mut flat, mut cut) = (false, Vec::new());
        for child in children {
            match (side(child, ranges), is_min) {
                (Side::Out, true) => return Side::Out,
                (Side::In, false) => return Side::In,
                (Side::In, true) | (Side::Out, false) => {}
                (Side::Flat, _) => flat = true,
                (Side::Cut(pieces), _) => cut.extend(pieces),
            }
        }
        match (flat, cut.is_empty()) {
            (_, false) => Side::Cut(cut),
            (true, true) => Side::Flat,
            (false, true) => {
                if is_min {
                    Side::In
                } else {
                    Side::Out
                }
            }
        }
    };
    match tree {
        Csg::Piece(i) => {
            let (_, lo, hi) = ranges
                .iter()
                .find(|r| r.0 == *i)
                .copied()
                .unwrap_or((0, -1.0, 1.0));
            match (lo < 0.0, hi > 0.0) {
                (true, true) => Side::Cut(vec![*i]),
                (true, false) => Side::Out,
                (false, true) => Side::In,
                (false, false) => Side::Flat,
            }
        }
        Csg::Min(children) => many(children, true),
        Csg::Max(children) => many(children, false),
    }
}

/// The lattice around the surface as a complex, and what lies deeper as plain tetrahedra.
pub(crate) struct Band {
    pub(crate) complex: Complex,
    pub(crate) frozen: Vec<bool>,
    /// Tetrahedra of the lattice beyond the band; vertices below the number in the band are those
    /// of the band.
    pub(crate) core: Vec<[u32; 4]>,
    /// Vertices of the core that are not in the band; numbered after the band's own.
    pub(crate) core_points: Vec<Point3>,
}

/// Cells of the lattice around the surface that the optimiser may work in, beyond those that the
/// surface can meet.
const LAYERS: usize = 1;

impl Band {
    /// With `all` there is no core: everything may change. On a stop by `control` cells are left
    /// out.
    pub(crate) fn new(
        lattice: &Lattice,
        with_core: bool,
        all: bool,
        control: &Control<'_>,
    ) -> Self {
        let n = lattice.n;
        let deep = if all {
            vec![false; lattice.state.len()]
        } else {
            deep_cells(lattice)
        };
        let corners = (n[0] + 1) * (n[1] + 1) * (n[2] + 1);
        let mut number = vec![NONE; corners + n[0] * n[1] * n[2]];
        let slot = |h: [usize; 3]| {
            let [i, j, k] = h.map(|h| h / 2);
            if h[0].is_multiple_of(2) {
                (k * (n[1] + 1) + j) * (n[0] + 1) + i
            } else {
                corners + (k * n[1] + j) * n[0] + i
            }
        };
        let mut points: Vec<Point3> = Vec::new();
        let take = |number: &mut Vec<u32>,
                    tets: [[[usize; 3]; 4]; 4],
                    into: &mut Vec<[u32; 4]>,
                    points: &mut Vec<Point3>| {
            for t in tets {
                into.push(t.map(|h| {
                    let s = &mut number[slot(h)];
                    if *s == NONE {
                        *s = points.len() as u32;
                        points.push(lattice.point(h));
                    }
                    *s
                }));
            }
        };
        let faces = |wanted: &mut dyn FnMut([usize; 3], usize, bool)| {
            for k in 0..n[2] {
                if control.is_stopped() {
                    return;
                }
                for j in 0..n[1] {
                    for i in 0..n[0] {
                        for axis in 0..3 {
                            let c = [i, j, k];
                            let mut d = c;
                            d[axis] += 1;
                            if d[axis] == n[axis] {
                                continue;
                            }
                            let (s, t) = (lattice.at(c), lattice.at(d));
                            if lattice.state[s] == OUT && lattice.state[t] == OUT {
                                continue;
                            }
                            wanted(c, axis, deep[s] && deep[t]);
                        }
                    }
                }
            }
        };
        let mut tets = Vec::new();
        faces(&mut |c, axis, deep| {
            if !deep {
                take(&mut number, Lattice::tets(c, axis), &mut tets, &mut points);
            }
        });
        let band = points.len();
        let mut core = Vec::new();
        let mut frozen = vec![false; band];
        // Without the core only what it shares with the band is of interest.
        faces(&mut |c, axis, deep| {
            if deep
                && (with_core
                    || Lattice::tets(c, axis)
                        .iter()
                        .flatten()
                        .any(|&h| number[slot(h)] < band as u32))
            {
                take(&mut number, Lattice::tets(c, axis), &mut core, &mut points);
            }
        });
        for t in &core {
            for &v in t {
                if (v as usize) < band {
                    frozen[v as usize] = true;
                }
            }
        }
        if !with_core {
            core.clear();
        }
        let core_points = points.split_off(band);
        Self {
            complex: Complex::within(points, tets, control),
            frozen,
            core,
            core_points: if with_core { core_points } else { Vec::new() },
        }
    }
}

/// Cells inside with only such cells within [`LAYERS`].
fn deep_cells(lattice: &Lattice) -> Vec<bool> {
    let n = lattice.n;
    let mut deep: Vec<bool> = lattice.state.iter().map(|&s| s == IN).collect();
    let step = [1, n[0], n[0] * n[1]];
    for axis in 0..3 {
        for _ in 0..LAYERS {
            let before = deep.clone();
            deep.par_iter_mut().enumerate().for_each(|(c, d)| {
                let i = c / step[axis] % n[axis];
                *d = *d
                    && i > 0
                    && i + 1 < n[axis]
                    && before[c - step[axis]]
                    && before[c + step[axis]];
            });
        }
    }
    deep
}

/// The part of a complex inside the solid, with the faces on the surface labelled by piece.
pub(crate) struct Inside {
    pub(crate) complex: Complex,
    pub(crate) frozen: Vec<bool>,
    /// Old vertices to new ones.
    pub(crate) number: Vec<u32>,
    /// Vertices of faces on no single piece.
    pub(crate) stray: Vec<Point3>,
}

impl Cutter<'_> {
    /// Drops what is outside.
    pub(crate) fn finish(mut self, inside: &[bool]) -> Inside {
        let mut number = vec![NONE; self.complex.points.len()];
        let mut tets = Vec::new();
        let (mut points, mut frozen) = (Vec::new(), Vec::new());
        let live: Vec<u32> = self
            .complex
            .live()
            .filter(|&t| inside[t as usize])
            .collect();
        // Vertices keep their order: those shared with the core keep their places in the list of
        // the frozen.
        let mut used = vec![false; self.complex.points.len()];
        for &t in &live {
            for v in self.complex.tets[t as usize] {
                used[v as usize] = true;
            }
        }
        for v in 0..used.len() {
            if used[v] {
                number[v] = points.len() as u32;
                points.push(self.complex.points[v]);
                frozen.push(self.frozen[v]);
            }
        }
        let mut slot = vec![NONE; self.complex.tets.len()];
        for &t in &live {
            slot[t as usize] = tets.len() as u32;
            tets.push(self.complex.tets[t as usize].map(|v| number[v as usize]));
        }
        let mut complex = Complex::new(points, tets);
        let mut stray = Vec::new();
        for &t in &live {
            for i in 0..4 {
                let n = self.complex.adjacent[t as usize][i];
                if n < BOUNDARY && !inside[n as usize] {
                    let label = match self.piece_of(self.complex.face(t, i)) {
                        Some(piece) => piece,
                        None => {
                            stray.push(
                                complex.points
                                    [number[self.complex.face(t, i)[0] as usize] as usize],
                            );
                            STRAY
                        }
                    };
                    complex.adjacent[slot[t as usize] as usize][i] = BOUNDARY | label;
                }
            }
        }
        let copied = complex.separate();
        frozen.extend(
            copied
                .iter()
                .map(|&v| frozen[v as usize])
                .collect::<Vec<_>>(),
        );
        Inside {
            complex,
            frozen,
            number,
            stray,
        }
    }
}
