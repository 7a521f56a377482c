//! Cutting of edges that the surface crosses, or moving one of their ends there.

use super::sign::Side;
use super::{Cutter, ITEMS_PER_STOP_CHECK};
use crate::complex::Ring;
use crate::points::lerp;
use crate::surface::{NO_PIECE, On};
use isoform_geom::{Point3, norm, sub};
use std::collections::VecDeque;

/// Distance of an end from the surface, in lengths of the edge to be cut, below which it counts as
/// lying on the surface if it cannot be moved. Closer cuts would not terminate where pieces touch,
/// or three meet along a curve.
const SHALLOW_DEPTH: f64 = 1e-2;
/// Maximum number of cut edges at a vertex, above which the lattice counts as too coarse there;
/// ordinary vertices have a few dozen.
const MAX_CUTS_PER_VERTEX: u16 = 200;
/// Worst biased sine that moving an end may leave. Higher values cause more cuts and short edges;
/// lower ones flat tetrahedra that only the optimiser can repair.
const MIN_SLIDE_QUALITY: f64 = 0.08;

/// An edge to be cut, where the solid's value or that of a single piece changes sign.
#[derive(Clone, Copy)]
struct CrossedEdge {
    ends: [u32; 2],
    piece: Option<u32>,
}

/// Longest edge offered; among equally long ones that with the lowest vertices.
#[derive(Default)]
struct Longest(Option<(f64, [u32; 2])>);

impl Longest {
    /// Takes the edge if it is longer than the previous one. Returns true if it was taken.
    fn offer(&mut self, length: f64, ends: [u32; 2]) -> bool {
        let is_longer = self
            .0
            .is_none_or(|best| length > best.0 || (length == best.0 && ends < best.1));
        if is_longer {
            self.0 = Some((length, ends));
        }
        is_longer
    }
}

impl Cutter<'_> {
    /// Cuts until every tetrahedron is decided, or the budget is spent. Returns the number of edges
    /// that were cut or had an end moved.
    pub(super) fn cut(&mut self) -> usize {
        let mut queue: VecDeque<u32> = self.in_order().into();
        // Ordinary solids need one cut per ten or more tetrahedra of the lattice.
        let mut budget = queue.len() / 2 + 10_000;
        let all = budget;
        let mut ring = Ring::default();
        let mut looked = 0usize;
        while let Some(t) = queue.pop_front() {
            if !self.complex.is_there(t) {
                continue;
            }
            looked += 1;
            if budget == 0
                || (looked.is_multiple_of(ITEMS_PER_STOP_CHECK) && self.control.is_stopped())
            {
                queue.push_front(t);
                self.give_up(queue);
                return all - budget;
            }
            let Some(crossing) = self.crossing(t) else {
                continue;
            };
            let [u, w] = crossing.ends.map(|v| v as usize);
            if self.cuts[u].max(self.cuts[w]) > MAX_CUTS_PER_VERTEX {
                self.undecided.push(self.complex.middle(t));
                continue;
            }
            self.cuts[u] += 1;
            self.cuts[w] += 1;
            budget -= 1;
            queue.extend(self.cut_edge(t, crossing, &mut ring));
        }
        all - budget
    }

    /// Returns all tetrahedra in the order of processing.
    fn in_order(&self) -> Vec<u32> {
        let mut all: Vec<u32> = self.complex.live().collect();
        if self.surface.by_place {
            all.sort_by_cached_key(|&t| self.surface.rank(self.complex.middle(t)));
        }
        all
    }

    /// Records those tetrahedra of the queue as undecided that would have to be cut; of the others,
    /// usually the great majority, the vertices decide. Ends early after a stop.
    fn give_up(&mut self, queue: VecDeque<u32>) {
        for (k, t) in queue.into_iter().enumerate() {
            if k.is_multiple_of(ITEMS_PER_STOP_CHECK) && self.control.is_stopped() {
                return;
            }
            if self.complex.is_there(t) && self.crossing(t).is_some() {
                self.undecided.push(self.complex.middle(t));
            }
        }
    }

    /// Returns the longest edge of a tetrahedron that the surface crosses, or that a piece crosses
    /// which leaves it undecided. If an edge may cross a thin sheet from outside to outside, both
    /// kinds compete: cutting only the shorter ones around it would not terminate.
    fn crossing(&mut self, t: u32) -> Option<CrossedEdge> {
        if self.is_settled(t) {
            return None;
        }
        let edges = self.complex.edges(t);
        let mut best = Longest::default();
        let mut through = false;
        for [a, b] in edges {
            let (f, g) = (self.value[a as usize], self.value[b as usize]);
            if f * g < 0.0 {
                best.offer(self.complex.edge_length(a, b), [a, b]);
            } else if f * g > 0.0 {
                through |= f.abs() + g.abs() < self.complex.edge_length(a, b);
            }
        }
        if let (Some((_, ends)), false) = (best.0, through) {
            return Some(CrossedEdge { ends, piece: None });
        }
        let piece = self.offer_pieces(t, &mut best);
        best.0.map(|(_, ends)| CrossedEdge { ends, piece })
    }

    /// Offers the edges crossed by pieces that leave the tetrahedron undecided, but not by the
    /// surface. Returns the piece of the longest edge; `None` if an edge offered before is longer.
    fn offer_pieces(&mut self, t: u32, best: &mut Longest) -> Option<u32> {
        let mut which = None;
        let Side::Cut(pieces) = self.side(t) else {
            return which;
        };
        let edges = self.complex.edges(t);
        for piece in pieces {
            for [a, b] in edges {
                let by_value = self.value[a as usize] * self.value[b as usize] < 0.0;
                if !by_value
                    && self.distance_in(t, a, piece) * self.distance_in(t, b, piece) < 0.0
                    && best.offer(self.complex.edge_length(a, b), [a, b])
                {
                    which = Some(piece);
                }
            }
        }
        which
    }

    /// Cuts an edge where the surface (or one piece) crosses it, or moves an end of the edge to the
    /// crossing. Returns the tetrahedra that changed.
    fn cut_edge(&mut self, t: u32, crossing: CrossedEdge, ring: &mut Ring) -> Vec<u32> {
        let [u, w] = crossing.ends;
        let found = self.root(t, crossing);
        let (share, piece) = found.unwrap_or((0.5, crossing.piece.unwrap_or(NO_PIECE)));
        let (end, near) = if share < 0.5 {
            (u, share)
        } else {
            (w, 1.0 - share)
        };
        // Near an end of the edge, that end is moved instead of cutting, if possible.
        if near < 0.3
            && piece != NO_PIECE
            && let Some(changed) = self.slide(end, piece)
        {
            return changed;
        }
        if let Some(changed) = self.touch(t, crossing, piece) {
            return changed;
        }
        let [a, b] = self.complex.points_of(crossing.ends);
        let mut on = self.on[u as usize].common(&self.on[w as usize]);
        if piece != NO_PIECE && found.is_some() {
            on = on.with(piece).unwrap_or(on);
        }
        let m = self.add_vertex(lerp(a, b, share), crossing.ends);
        self.complex.ring(t, u, w, ring);
        let mut made = std::mem::take(&mut self.made);
        self.complex.split(ring, u, w, m, &mut made);
        self.bring(m, on, 0.5 * norm(sub(a, b)));
        let changed = made.clone();
        self.made = made;
        changed
    }

    /// Returns the crossing of an edge: the fraction of its length, and the piece that vanishes
    /// there.
    fn root(&mut self, t: u32, crossing: CrossedEdge) -> Option<(f64, u32)> {
        let [u, w] = crossing.ends;
        match crossing.piece {
            None => {
                let [a, b] = self.complex.points_of(crossing.ends);
                let [f, g] = [u, w].map(|v| self.value[v as usize].clamp(-f64::MAX, f64::MAX));
                self.surface.root((a, f), (b, g))
            }
            Some(i) => {
                let (f, g) = (self.distance_in(t, u, i), self.distance_in(t, w, i));
                let corners = self.complex.corners(t);
                let [a, b] = [u, w].map(|v| corners[self.complex.place(t, v)]);
                let from = self.complex.middle(t);
                let share = self.surface.root_of(i, (a, f), (b, g), from)?;
                Some((share, i))
            }
        }
    }

    /// Adds a vertex on the edge between two others, without pieces that hold it.
    fn add_vertex(&mut self, at: Point3, [u, w]: [u32; 2]) -> u32 {
        self.on.push(On::default());
        self.frozen.push(false);
        self.value.push(0.0);
        self.known.push(Vec::new());
        self.cuts.push(0);
        let cell = self.cell[u as usize].min(self.cell[w as usize]);
        self.cell.push(cell);
        self.complex.add_point(at)
    }

    /// Projects a new vertex onto its pieces. If that is too far, or would leave poor tetrahedra,
    /// it stays on the chord, slightly off the pieces: the optimiser moves it later.
    fn bring(&mut self, m: u32, on: On, reach: f64) {
        let at = self.complex.point(m);
        let target = self
            .surface
            .project(self.surface.parted(on, at).slice(), at)
            .filter(|q| norm(sub(*q, at)) < reach);
        match target {
            // Worst biased sine at a vertex on two pieces or more.
            Some(q) if on.len() < 2 || self.worst_if(m, q) > 1e-3 => self.place(m, q, on),
            _ => {
                self.place(m, at, on);
                if !self.surface.holds_only_sides(&on) {
                    self.value[m as usize] = 0.0;
                    if self.is_on_side(m) {
                        self.count_as_on_beyond(m);
                    }
                }
            }
        }
    }

    /// Marks the end of an edge that is nearer to the surface (or to a single piece) as lying on
    /// it, if a cut would only leave a short edge or a flat tetrahedron; the optimiser moves it
    /// there. Returns the tetrahedra to be examined again; `None` if the end is too far away.
    fn touch(&mut self, t: u32, crossing: CrossedEdge, found: u32) -> Option<Vec<u32>> {
        let [u, w] = crossing.ends;
        let [du, dw] = [u, w].map(|v| self.depth(t, v, crossing.piece));
        let (end, depth) = if du <= dw { (u, du) } else { (w, dw) };
        let shallow = SHALLOW_DEPTH * self.complex.edge_length(u, w);
        if depth >= shallow {
            return None;
        }
        let p = self.complex.point(end);
        let surface = self.surface;
        let deciding = crossing.piece.unwrap_or_else(|| surface.value(p).1);
        let mut near = surface.pieces_around(p);
        near.retain(|&i| self.distance(end, i).abs() < shallow);
        near.extend([deciding, found]);
        for i in near {
            if i != NO_PIECE && self.distance(end, i).abs() < shallow {
                self.count_as_on(end, i);
            }
        }
        if crossing.piece.is_none() {
            self.value[end as usize] = 0.0;
        }
        self.complex.star(end, &mut self.star);
        Some(self.star.clone())
    }

    /// Marks a vertex as lying on a piece.
    fn count_as_on(&mut self, v: u32, piece: u32) {
        self.known[v as usize].retain(|k| k.0 != piece);
        self.known[v as usize].push((piece, 0.0));
    }

    /// Marks a vertex on a side of a unit cell that is held on pieces, but left off them, as lying
    /// on their counterparts on the other side: the pieces at an equal distance.
    #[cold]
    fn count_as_on_beyond(&mut self, v: u32) {
        let (p, surface) = (self.complex.point(v), self.surface);
        let on = self.on[v as usize];
        let held = on.slice().iter().filter(|&&i| !surface.is_side(i));
        let off: Vec<f64> = held.map(|&i| surface.nearest_distance(i, p)).collect();
        for i in surface.pieces_around(p) {
            let d = surface.nearest_distance(i, p);
            // Rounding makes far smaller differences, and two pieces are seldom as near to each
            // other.
            let is_one = |off: &f64| (d - off).abs() <= 1e-6 * off.abs() + surface.zero;
            if off.iter().any(is_one) {
                self.count_as_on(v, i);
            }
        }
    }

    /// Returns the distance of a vertex from a piece, evaluated in a tetrahedron, or from the
    /// surface.
    fn depth(&mut self, t: u32, v: u32, piece: Option<u32>) -> f64 {
        match piece {
            None => self.value[v as usize].abs(),
            Some(i) => self.distance_in(t, v, i).abs(),
        }
    }

    /// Moves a vertex along the pieces that hold it onto one more. Returns the tetrahedra that
    /// changed; `None` if it cannot be moved.
    fn slide(&mut self, v: u32, piece: u32) -> Option<Vec<u32>> {
        if self.frozen[v as usize] {
            return None;
        }
        let held = self.on[v as usize];
        let on = held.with(piece)?;
        let p = self.complex.point(v);
        let q = self
            .surface
            .project(self.surface.parted(on, p).slice(), p)?;
        let zero = self.surface.zero;
        if norm(sub(p, q)) > 0.5 * self.cell[v as usize]
            || (!held.is_empty() && self.surface.value(q).0.abs() > zero)
            || self.worst_if(v, q) < MIN_SLIDE_QUALITY
        {
            return None;
        }
        self.place(v, q, on);
        self.complex.star(v, &mut self.star);
        Some(self.star.clone())
    }
}
