//! Better tetrahedra: constrained moves, flips, collapses and insertions, each kept only where the
//! worst of what it touches improves.
//!
//! After Freitag and Ollivier-Gooch (Tetrahedral mesh improvement using swapping and smoothing,
//! 1997) and Klingner and Shewchuk (Aggressive tetrahedral mesh improvement, 2007). What is ours:
//! vertices on the surface and on curves move too, by projection onto their pieces, so that they
//! stay exact; and the measure looks at the angles of the surface triangles as well.

use crate::complex::{BOUNDARY, Complex, EDGES, NONE, OPEN, Ring, STRAY, labelled_edges};
use crate::cut::Inside;
use crate::measure::{Around, biased_sine, smallest_sine};
use crate::quality::six_volume;
use crate::surface::{On, SKIN, Surface, meet_at_an_angle};
use isoform_control::Control;
use isoform_geom::{Point3, TET_FACES, cross, dot, norm, sub};
use rayon::prelude::*;

/// What holds a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    /// Corners, and vertices shared with the lattice beyond the band.
    Fixed,
    /// On one piece (or [`SKIN`]), on two (a curve), or on none.
    On(On),
}

/// Least share of an improvement that counts.
const GAIN: f64 = 1e-4;
/// Vertices around which no tetrahedron is worse than this factor times the goal are left where
/// they are, and moves that get there end: the worst tetrahedra count, and most of the others are
/// good from the start.
const ENOUGH: f64 = 1.25;
/// Least cosine between a face of the surface and its piece; a face that was worse may stay but not
/// get worse.
const FACING: f64 = 0.5;
/// Largest sagitta of an edge of the surface, as a share of its length: an arc of 37 degrees.
/// Coarser ones make poor curved elements.
const TURN: f64 = 0.08;
/// Largest sagitta of an edge on a feature curve, as a share of the size asked for.
const CURVE: f64 = 0.08;
/// Bad tetrahedra up to which vertices are inserted in meshes of any size.
const MANY: usize = 200;
/// Vertices off the surface that are tried in every round.
const FEW: usize = 16;
/// Operations on single tetrahedra between two looks at the clock: each takes up to a millisecond.
const LOOK: usize = 16;
/// Steps of a move.
const ROUNDS: usize = 4;
/// Round from which vertices are inserted: flips and collapses come first.
const INSERT_FROM: usize = 3;
/// Edges shorter than this share of the size asked for are collapsed without asking for better
/// angles.
const MICRO: f64 = 0.004;
/// Longest ring whose edge is removed; longer ones never improved a mesh in our trials.
const RING: usize = 9;

pub(crate) struct Optimiser<'s> {
    pub(crate) surface: &'s Surface<'s>,
    control: &'s Control<'s>,
    pub(crate) complex: Complex,
    pub(crate) hold: Vec<Hold>,
    /// Labels of the faces at each vertex of the surface, where they are more than the pieces that
    /// hold it.
    labels: Vec<On>,
    /// Edge length wanted.
    size: f64,
    /// Chordal error wanted.
    error: f64,
    /// When each vertex was last moved or given other tetrahedra, and when each tetrahedron was
    /// last tried in vain: what has not changed since need not be tried again.
    touched: Vec<u32>,
    tried: Vec<u32>,
    clock: u32,
    /// A measure from which nothing is moved any more, see [`ENOUGH`].
    enough: f64,
    /// Tetrahedra that may be below the goal, together with those that the complex has logged
    /// since.
    suspects: Vec<u32>,
    /// Vertices that were off the surface in the beginning.
    first_off: Vec<u32>,
    scratch: Scratch,
}

#[derive(Default)]
struct Scratch {
    star: Vec<u32>,
    made: Vec<u32>,
    ring: Ring,
    moving: Move,
}

/// What the move of a vertex works with.
#[derive(Default)]
struct Move {
    star: Vec<u32>,
    faces: Vec<Face>,
    around: Around,
}

/// A face of the surface: its vertices and label.
type Face = ([u32; 3], u32);

impl<'s> Optimiser<'s> {
    pub(crate) fn new(
        surface: &'s Surface<'s>,
        inside: Inside,
        size: f64,
        control: &'s Control<'s>,
    ) -> Self {
        let Inside {
            complex, frozen, ..
        } = inside;
        let n = complex.points.len();
        let mut this = Self {
            surface,
            control,
            complex,
            hold: vec![Hold::On(On::default()); n],
            labels: vec![On::default(); n],
            size,
            error: f64::INFINITY,
            touched: vec![0; n],
            tried: Vec::new(),
            clock: 0,
            enough: f64::INFINITY,
            suspects: Vec::new(),
            first_off: Vec::new(),
            scratch: Scratch::default(),
        };
        this.hold_vertices(&frozen);
        this
    }

    /// Settles what holds each vertex, from the labels of the faces around it.
    fn hold_vertices(&mut self, frozen: &[bool]) {
        let mut labels: Vec<Vec<u32>> = vec![Vec::new(); self.complex.points.len()];
        let faces = self.faces();
        for &(f, label) in &faces {
            for v in f {
                labels[v as usize].push(label);
            }
        }
        let edges = labelled_edges(faces.into_iter());
        let mut curves: Vec<Vec<[u32; 2]>> = vec![Vec::new(); self.complex.points.len()];
        for pair in edges.chunk_by(|a, b| a.0 == b.0) {
            let ends = pair[0].0;
            let several: Vec<u32> = crate::lattice::unique(pair.iter().map(|p| p.1).collect());
            if pair.len() != 2 {
                // Not a manifold there: nothing moves.
                let _ = ends.map(|v| curves[v as usize].extend([[NONE; 2]; 3]));
            } else if several.len() == 2 && self.is_sharp(ends, [several[0], several[1]]) {
                let _ = ends.map(|v| curves[v as usize].push([several[0], several[1]]));
            }
        }
        for v in 0..labels.len() {
            let all = crate::lattice::unique(std::mem::take(&mut labels[v]));
            let at = &curves[v];
            self.hold[v] = if frozen[v] || all.len() > 3 || all.iter().any(|&l| l >= STRAY) {
                Hold::Fixed
            } else {
                match at.len() {
                    // Pieces that touch tangentially make one smooth surface.
                    0 if all.len() > 1 => Hold::On(On::of(&[SKIN])),
                    0 => Hold::On(On::of(&all)),
                    2 if at[0] == at[1] => Hold::On(On::of(&at[0])),
                    _ => Hold::Fixed,
                }
            };
            self.labels[v] = On::of(&all.into_iter().filter(|&l| l < STRAY).collect::<Vec<_>>());
        }
    }

    fn is_sharp(&self, ends: [u32; 2], pieces: [u32; 2]) -> bool {
        if pieces.iter().any(|&p| p >= STRAY) {
            return true;
        }
        let [p, q] = ends.map(|v| self.complex.points[v as usize]);
        let middle = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        meet_at_an_angle(self.surface.solid, pieces, middle)
    }

    /// The labelled faces of the surface, outward.
    pub(crate) fn faces(&self) -> Vec<Face> {
        let mut faces = Vec::new();
        for t in self.complex.live() {
            for i in 0..4 {
                let n = self.complex.adjacent[t as usize][i];
                if n >= BOUNDARY && n != OPEN {
                    faces.push((self.complex.face(t, i), n & !BOUNDARY));
                }
            }
        }
        faces
    }

    /// The measure of a tetrahedron: its angles, and those of its faces on the surface.
    pub(crate) fn measure(&self, t: u32) -> f64 {
        let p = self.complex.corners(t);
        let mut q = biased_sine(p);
        for i in 0..4 {
            let n = self.complex.adjacent[t as usize][i];
            if n >= BOUNDARY && n != OPEN {
                q = q.min(smallest_sine(TET_FACES[i].map(|k| p[k])));
            }
        }
        q
    }

    fn worst(&self, tets: &[u32]) -> f64 {
        tets.iter()
            .map(|&t| self.measure(t))
            .fold(f64::INFINITY, f64::min)
    }

    /// Cosine between a face of the surface and its piece.
    fn facing(&self, p: [Point3; 3], label: u32) -> f64 {
        if label >= STRAY {
            return 1.0;
        }
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let middle = std::array::from_fn(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0);
        let g = self.surface.gradient(label, middle).1;
        -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
    }

    fn faces_at(&self, star: &[u32], v: u32) -> Vec<Face> {
        let mut faces = Vec::new();
        self.add_faces_at(star, v, &mut faces);
        faces
    }

    fn add_faces_at(&self, star: &[u32], v: u32, faces: &mut Vec<Face>) {
        for &t in star {
            for i in 0..4 {
                let n = self.complex.adjacent[t as usize][i];
                if n >= BOUNDARY && n != OPEN && self.complex.tets[t as usize][i] != v {
                    faces.push((self.complex.face(t, i), n & !BOUNDARY));
                }
            }
        }
    }

    // ---- moves

    /// A better place for a vertex, if there is one.
    fn better_place(&self, v: u32, moving: &mut Move) -> Option<Point3> {
        let Hold::On(on) = self.hold[v as usize] else {
            return None;
        };
        if on.len() > 2 {
            return None;
        }
        let Move {
            star,
            faces,
            around,
        } = moving;
        self.complex.star_shared(v, star);
        faces.clear();
        if !on.is_empty() {
            self.add_faces_at(star, v, faces);
        }
        around.clear();
        for &t in star.iter() {
            around.push(self.complex.corners(t), self.complex.place(t, v));
        }
        for (f, _) in faces.iter() {
            let x = f.iter().position(|&k| k == v)?;
            around.push_face([1, 2].map(|k| self.complex.points[f[(x + k) % 3] as usize]));
        }
        let start = self.complex.points[v as usize];
        let first = around.worst(start, f64::NEG_INFINITY);
        let (mut at, mut worst) = (start, first);
        if on.is_empty() && worst < self.enough {
            // As good as a search by gradients in most cases, and far cheaper.
            let p = around.centre(at);
            let w = around.worst(p, worst + GAIN);
            if w > worst + GAIN {
                (at, worst) = (p, w);
            }
        }
        // Places on the way, each better than the one before.
        let mut places = [at; ROUNDS];
        let mut n = 0;
        while n < ROUNDS && worst < self.enough {
            let Some((direction, step)) = around.direction(at, worst, self.tangent(&on, at)) else {
                break;
            };
            let mut found = None;
            let (mut s, mut bound) = (step, worst + GAIN);
            for _ in 0..6 {
                let raw = std::array::from_fn(|i| at[i] + s * direction[i]);
                // One step of Newton's method does to judge a place by; the one that is taken is
                // brought to the surface to rounding.
                let place = if on.is_empty() {
                    Some(raw)
                } else {
                    self.surface.nearer(on.slice(), raw)
                };
                if let Some(p) = place {
                    let w = around.worst(p, bound);
                    if w > bound {
                        (found, bound) = (Some(p), w);
                    } else if found.is_some() {
                        break;
                    }
                }
                s *= 0.5;
            }
            let Some(p) = found else { break };
            (at, worst) = (p, bound);
            places[n] = at;
            n += 1;
        }
        if on.is_empty() {
            return (worst > first + GAIN).then_some(at);
        }
        places[..n].iter().rev().find_map(|&p| {
            let p = self.surface.project(on.slice(), p)?;
            (around.worst(p, first + GAIN) > first + GAIN && self.may_stand(v, p, faces))
                .then_some(p)
        })
    }

    /// Whether a vertex is off the surface at `p`: off what holds it, or off the solid where more
    /// pieces meet there.
    fn is_off(&self, v: u32, p: Point3) -> bool {
        let labels = self.labels[v as usize];
        match self.hold[v as usize] {
            Hold::On(on) if !on.is_empty() => {
                on.slice()
                    .iter()
                    .any(|&l| self.surface.distance(l, p) != 0.0)
                    || (labels.len() > on.len() && self.surface.distance(SKIN, p) != 0.0)
            }
            _ => labels
                .slice()
                .iter()
                .any(|&l| self.surface.distance(l, p) != 0.0),
        }
    }

    /// Whether a vertex on one piece has slipped past where that is the surface, over a seam with a
    /// piece that it touches tangentially.
    fn is_hidden(&self, v: u32) -> bool {
        matches!(self.hold[v as usize], Hold::On(on) if on.len() == 1 && !self.surface.is_alone(on.slice()[0], self.complex.points[v as usize]))
            && self.surface.distance(SKIN, self.complex.points[v as usize]) != 0.0
            && !self.is_off(v, self.complex.points[v as usize])
    }

    fn is_skin(&self, v: u32) -> bool {
        matches!(self.hold[v as usize], Hold::On(on) if on.contains(SKIN))
    }

    /// The piece to project a point of a face on: its label, or the solid next to a seam between
    /// pieces that touch tangentially.
    fn piece_at(&self, vertices: &[u32], label: u32) -> u32 {
        if vertices.iter().any(|&v| self.is_skin(v)) {
            SKIN
        } else {
            label
        }
    }

    /// Whether a vertex of the surface may stand at `p`: all that holds it vanishes there and its
    /// faces look outward.
    fn may_stand(&self, v: u32, p: Point3, faces: &[Face]) -> bool {
        if self.is_off(v, p) {
            return false;
        }
        faces.iter().all(|&(f, label)| {
            let old = f.map(|k| self.complex.points[k as usize]);
            let new = f.map(|k| {
                if k == v {
                    p
                } else {
                    self.complex.points[k as usize]
                }
            });
            let c = self.facing(new, label);
            c >= FACING || c >= self.facing(old, label)
        })
    }

    fn worst_at(&self, v: u32, p: Point3, star: &[u32], faces: &[Face]) -> f64 {
        let at = |k: u32| {
            if k == v {
                p
            } else {
                self.complex.points[k as usize]
            }
        };
        let mut worst = f64::INFINITY;
        for &t in star {
            worst = worst.min(biased_sine(self.complex.tets[t as usize].map(at)));
        }
        for (f, _) in faces {
            worst = worst.min(smallest_sine(f.map(at)));
        }
        worst
    }

    /// The projection of vectors onto the directions in which a vertex may move.
    fn tangent(&self, on: &On, p: Point3) -> impl Fn(Point3) -> Point3 + use<> {
        let unit = |v: Point3| {
            let n = norm(v).max(1e-300);
            v.map(|x| x / n)
        };
        let normal = |k: usize| unit(self.surface.gradient(on.slice()[k], p).1);
        let n = on.len();
        // The normal of a piece, or the tangent of a curve.
        let axis = match n {
            0 => [0.0; 3],
            1 => normal(0),
            _ => unit(cross(normal(0), normal(1))),
        };
        move |g| {
            let c = dot(g, axis);
            match n {
                0 => g,
                1 => std::array::from_fn(|i| g[i] - c * axis[i]),
                _ => axis.map(|x| c * x),
            }
        }
    }

    /// Moves the vertices given, each where that improves the worst tetrahedron at it. Returns how
    /// many moved.
    pub(crate) fn smooth(&mut self, vertices: &[u32]) -> usize {
        /// Batches: proposals are made together within a batch, so that the result does not depend
        /// on threads. Neighbours seldom share a batch of eight, and where they do the second one
        /// is looked at again.
        const BATCHES: u32 = 8;
        let mut moved = 0;
        for batch in 0..BATCHES {
            let these: Vec<u32> = vertices
                .iter()
                .copied()
                .filter(|&v| v.wrapping_mul(0x9E37_79B9) >> 29 == batch)
                .collect();
            let places: Vec<Option<Point3>> = these
                .par_iter()
                .with_min_len(64)
                .map_init(Move::default, |moving, &v| {
                    match self.control.is_stopped() {
                        true => None,
                        false => self.better_place(v, moving),
                    }
                })
                .collect();
            let mut star = std::mem::take(&mut self.scratch.star);
            for (&v, place) in these.iter().zip(&places) {
                let Some(p) = *place else { continue };
                self.complex.star(v, &mut star);
                let faces = self.faces_at(&star, v);
                let before = self.worst_at(v, self.complex.points[v as usize], &star, &faces);
                if self.worst_at(v, p, &star, &faces) > before {
                    self.complex.points[v as usize] = p;
                    self.touched[v as usize] = self.clock;
                    self.suspects.extend_from_slice(&star);
                    moved += 1;
                }
            }
            self.scratch.star = star;
        }
        moved
    }

    // ---- flips

    /// Removes the edge from `a` to `b` of tetrahedron `t` if that improves the worst of its ring
    /// by more than `least`.
    fn remove_edge(&mut self, t: u32, a: u32, b: u32, apply: bool) -> Option<f64> {
        let mut ring = std::mem::take(&mut self.scratch.ring);
        self.complex.ring(t, a, b, &mut ring);
        let result = self.remove_ring(&mut ring, a, b, apply);
        self.scratch.ring = ring;
        result
    }

    fn remove_ring(&mut self, ring: &mut Ring, a: u32, b: u32, apply: bool) -> Option<f64> {
        if ring.tets.len() > RING {
            return None;
        }
        let before = self.worst(&ring.tets);
        let mut label = None;
        if !ring.closed {
            let l = self.surface_edge(ring, a, b)?;
            label = Some(l);
        } else if ring.link.len() < 3 {
            return None;
        }
        let p = |k: u32| self.complex.points[k as usize];
        if six_volume([p(a), p(b), p(ring.link[0]), p(ring.link[1])]) < 0.0 {
            ring.link.reverse();
        }
        let link = &ring.link;
        let n = link.len();
        if let Some(label) = label {
            // The edge is flipped on the surface: its faces become those across it.
            let (c, d) = (link[0], link[n - 1]);
            for f in [[a, c, d], [b, d, c]] {
                // Counterclockwise link seen from b: the solid lies between c and d.
                if self.facing(f.map(p), label) < FACING {
                    return None;
                }
            }
            if n > 2 && self.are_neighbours(c, d) {
                return None;
            }
            if n == 2 {
                return self.remove_flat(ring, a, b, label, before, apply);
            }
        }
        // Klincsek's table: best[i][j] is the best worst of the polygon from i to j.
        let mut best = [[f64::INFINITY; RING + 1]; RING + 1];
        let mut cut = [[0u8; RING + 1]; RING + 1];
        for span in 2..n {
            for i in 0..n - span {
                let j = i + span;
                best[i][j] = f64::NEG_INFINITY;
                for k in i + 1..j {
                    let mut w = best[i][k].min(best[k][j]);
                    if w <= before {
                        continue;
                    }
                    let (u, v, x) = (p(link[i]), p(link[k]), p(link[j]));
                    w = w
                        .min(biased_sine([u, v, x, p(b)]))
                        .min(biased_sine([v, u, x, p(a)]));
                    if label.is_some() && span == n - 1 {
                        w = w
                            .min(smallest_sine([u, x, p(a)]))
                            .min(smallest_sine([u, x, p(b)]));
                    }
                    if w > best[i][j] {
                        (best[i][j], cut[i][j]) = (w, k as u8);
                    }
                }
            }
        }
        let after = self.with_faces(best[0][n - 1], ring, before);
        if after <= before + GAIN {
            return None;
        }
        if apply {
            let mut new = Vec::with_capacity(2 * n);
            let mut todo = vec![(0, n - 1)];
            while let Some((i, j)) = todo.pop() {
                if j < i + 2 {
                    continue;
                }
                let k = usize::from(cut[i][j]);
                let (u, v, x) = (link[i], link[k], link[j]);
                new.push([u, v, x, b]);
                new.push([v, u, x, a]);
                todo.extend([(i, k), (k, j)]);
            }
            let mut made = std::mem::take(&mut self.scratch.made);
            self.complex
                .replace(&ring.tets, &new, |_| label.unwrap_or(OPEN), &mut made);
            self.scratch.made = made;
        }
        Some(after)
    }

    /// The value after a flip, with the faces of the surface around the cavity that stay as they
    /// are (they cannot improve).
    fn with_faces(&self, after: f64, ring: &Ring, before: f64) -> f64 {
        let mut worst = after;
        for &t in &ring.tets {
            for i in 0..4 {
                let n = self.complex.adjacent[t as usize][i];
                if n >= BOUNDARY && n != OPEN {
                    let f = self.complex.face(t, i);
                    let s = smallest_sine(f.map(|k| self.complex.points[k as usize]));
                    // Faces at the edge itself go away; of the others only those that hold back the
                    // gain matter.
                    if s <= before + GAIN && !self.goes_away(ring, f) {
                        worst = worst.min(s);
                    }
                }
            }
        }
        worst
    }

    fn goes_away(&self, ring: &Ring, f: [u32; 3]) -> bool {
        !ring.closed && f.iter().filter(|k| !ring.link.contains(k)).count() == 2
    }

    /// The label on both sides of an edge of the surface that may be flipped.
    fn surface_edge(&self, ring: &Ring, a: u32, b: u32) -> Option<u32> {
        let label = |t: u32, link: u32| {
            // The face (a, b, link) of t.
            let i = (0..4).find(|&i| ![a, b, link].contains(&self.complex.tets[t as usize][i]))?;
            let n = self.complex.adjacent[t as usize][i];
            (n >= BOUNDARY && n != OPEN).then_some(n & !BOUNDARY)
        };
        let first = label(ring.tets[0], ring.link[0])?;
        let last = label(
            ring.tets[ring.tets.len() - 1],
            ring.link[ring.link.len() - 1],
        )?;
        (first == last && first < STRAY).then_some(first)
    }

    /// A single tetrahedron with two faces on the same piece is taken off.
    fn remove_flat(
        &mut self,
        ring: &Ring,
        a: u32,
        b: u32,
        label: u32,
        before: f64,
        apply: bool,
    ) -> Option<f64> {
        let t = ring.tets[0];
        let (c, d) = (ring.link[0], ring.link[1]);
        for v in [a, b] {
            if self.complex.adjacent[t as usize][self.complex.place(t, v)] >= BOUNDARY {
                return None;
            }
        }
        let mut inner = Ring::default();
        self.complex.ring(t, c, d, &mut inner);
        if !inner.closed
            || self.complex.tets[t as usize].iter().any(|&v| {
                self.hold[v as usize] == Hold::Fixed && self.labels[v as usize].is_empty()
            })
        {
            return None;
        }
        // What the neighbours lose by new faces on the surface.
        let p = |k: u32| self.complex.points[k as usize];
        let after = [[a, c, d], [b, c, d]]
            .iter()
            .map(|f| smallest_sine(f.map(p)))
            .fold(f64::INFINITY, f64::min);
        // Dropping a good tetrahedron would change the solid; a flat one lies within the chordal
        // error anyway.
        if after <= before + GAIN || biased_sine(self.complex.corners(t)) > 0.3 {
            return None;
        }
        if apply {
            let mut made = std::mem::take(&mut self.scratch.made);
            self.complex.replace(&[t], &[], |_| label, &mut made);
            self.scratch.made = made;
        }
        Some(after)
    }

    fn are_neighbours(&self, a: u32, b: u32) -> bool {
        let mut star = Vec::with_capacity(64);
        self.complex.star_shared(a, &mut star);
        star.iter()
            .any(|&t| self.complex.tets[t as usize].contains(&b))
    }

    /// Puts an edge in the place of the face opposite to vertex `i`, if that improves the worst of
    /// the two.
    fn remove_face(&mut self, t: u32, i: usize, apply: bool) -> Option<f64> {
        let n = self.complex.adjacent[t as usize][i];
        if n >= BOUNDARY {
            return None;
        }
        let before = self.measure(t).min(self.measure(n));
        let a = self.complex.tets[t as usize][i];
        let f = self.complex.face(t, i);
        let b = self.complex.tets[n as usize]
            .iter()
            .copied()
            .find(|k| !f.contains(k))?;
        let p = |k: u32| self.complex.points[k as usize];
        // f is outward of t: a lies below, b above.
        let new = [[f[0], f[1], a, b], [f[1], f[2], a, b], [f[2], f[0], a, b]];
        let new = new.map(|v| [v[0], v[1], v[3], v[2]]);
        let mut after = f64::INFINITY;
        for v in &new {
            after = after.min(biased_sine(v.map(p)));
            if after <= before + GAIN {
                return None;
            }
        }
        for u in [t, n] {
            for k in 0..4 {
                let m = self.complex.adjacent[u as usize][k];
                if m >= BOUNDARY && m != OPEN {
                    after = after.min(smallest_sine(self.complex.face(u, k).map(p)));
                }
            }
        }
        if after <= before + GAIN {
            return None;
        }
        if apply {
            let mut made = std::mem::take(&mut self.scratch.made);
            self.complex.replace(&[t, n], &new, |_| OPEN, &mut made);
            self.scratch.made = made;
        }
        Some(after)
    }

    // ---- collapses and insertions

    /// Whether vertex `u` may be pulled onto its neighbour `w`.
    fn may_collapse(&self, u: u32, w: u32, ring: &Ring) -> bool {
        let Hold::On(on) = self.hold[u as usize] else {
            return false;
        };
        let labels = self.labels[u as usize];
        if labels.is_empty() {
            // A free vertex: onto anything, but not across the solid from one side of the surface
            // to the other.
            return true;
        }
        if ring.closed {
            return false;
        }
        // On the surface: along it, and a vertex of a curve along the curve.
        let a = self.outer_label(ring.tets[0], u, w, ring.link[0]);
        let b = self.outer_label(
            ring.tets[ring.tets.len() - 1],
            u,
            w,
            ring.link[ring.link.len() - 1],
        );
        let (Some(a), Some(b)) = (a, b) else {
            return false;
        };
        let other = self.labels[w as usize];
        let within = |a: On, b: On| a.slice().iter().all(|&l| b.contains(l));
        if self.is_skin(u) {
            // Seams between pieces that touch tangentially may go where they like.
            return within(labels, other)
                || matches!(self.hold[w as usize], Hold::On(held) if held.len() == 1);
        }
        if !within(labels, other) {
            return false;
        }
        if on.len() == 2 {
            a != b && on.contains(a) && on.contains(b)
        } else {
            labels.len() == 1 || a != b
        }
    }

    fn outer_label(&self, t: u32, a: u32, b: u32, link: u32) -> Option<u32> {
        let i = (0..4).find(|&i| ![a, b, link].contains(&self.complex.tets[t as usize][i]))?;
        let n = self.complex.adjacent[t as usize][i];
        (n >= BOUNDARY && n != OPEN).then_some(n & !BOUNDARY)
    }

    /// Pulls `u` onto `w` if the worst around `u` improves, or at least stays above `least` where
    /// that is given.
    fn collapse(&mut self, t: u32, u: u32, w: u32, least: Option<f64>, apply: bool) -> Option<f64> {
        let mut ring = std::mem::take(&mut self.scratch.ring);
        self.complex.ring(t, u, w, &mut ring);
        let allowed = self.may_collapse(u, w, &ring);
        self.scratch.ring = ring;
        if !allowed {
            return None;
        }
        let mut star = Vec::new();
        self.complex.star(u, &mut star);
        let bound = least.unwrap_or_else(|| self.worst(&star) + GAIN);
        let p = |k: u32| self.complex.points[k as usize];
        let mut new = Vec::with_capacity(star.len());
        let mut after = f64::INFINITY;
        for &t in &star {
            let v = self.complex.tets[t as usize];
            if v.contains(&w) {
                continue;
            }
            let v = v.map(|k| if k == u { w } else { k });
            after = after.min(biased_sine(v.map(p)));
            if after <= bound {
                return None;
            }
            new.push(v);
        }
        let faces = self.faces_at(&star, u);
        let mut labels: Vec<([u32; 3], u32)> = Vec::with_capacity(faces.len());
        for (f, label) in &faces {
            if f.contains(&w) {
                continue;
            }
            let g = f.map(|k| if k == u { w } else { k });
            after = after.min(smallest_sine(g.map(p)));
            let c = self.facing(g.map(p), *label);
            if after <= bound || (c < FACING && c < self.facing(f.map(p), *label)) {
                return None;
            }
            let mut key = g;
            key.sort_unstable();
            labels.push((key, *label));
        }
        let mut other = Vec::new();
        self.complex.star(w, &mut other);
        if !keeps_topology(&self.complex, [(u, &star), (w, &other)], &self.scratch.ring) {
            return None;
        }
        // A free vertex between two sheets: pulled onto one it must not join them in an edge or
        // face of the surface.
        if self.labels[u as usize].is_empty()
            && !self.labels[w as usize].is_empty()
            && new
                .iter()
                .any(|v| v.iter().all(|&k| !self.labels[k as usize].is_empty()))
        {
            return None;
        }
        // Edges that would leave the surface too far were split before, and would be again.
        let pair = match self.hold[u as usize] {
            Hold::On(on) if on.len() == 2 => Some([on.slice()[0], on.slice()[1]]),
            _ => None,
        };
        let leaves = faces
            .iter()
            .filter(|(f, _)| !f.contains(&w))
            .any(|(f, label)| {
                f.iter().filter(|&&x| x != u).any(|&x| {
                    let along = pair.filter(|p| {
                        p.iter().all(|&i| {
                            self.labels[x as usize].contains(i)
                                && self.labels[w as usize].contains(i)
                        })
                    });
                    self.excess([w, x], along.unwrap_or([*label; 2]), self.error)
                        .is_some()
                })
            });
        if leaves && least.is_none() {
            return None;
        }
        // Open faces of the band (towards the lattice beyond) stay: their vertices are fixed, so u
        // is on none.
        if apply {
            let mut made = std::mem::take(&mut self.scratch.made);
            self.complex.replace(
                &star,
                &new,
                |key| labels.iter().find(|l| l.0 == key).map_or(OPEN, |l| l.1),
                &mut made,
            );
            self.complex.tet_of[u as usize] = NONE;
            self.scratch.made = made;
            let both = self.labels[u as usize]
                .slice()
                .iter()
                .fold(self.labels[w as usize], |all, &l| {
                    all.with(l).unwrap_or(all)
                });
            if self.is_skin(u) && both != self.labels[w as usize] {
                (self.labels[w as usize], self.hold[w as usize]) = (both, self.hold[u as usize]);
            }
        }
        Some(after)
    }

    /// Splits the edge from `a` to `b` in the middle and moves the new vertex to its best place;
    /// undone if the worst does not improve.
    fn insert(&mut self, a: u32, b: u32) -> bool {
        let mut ring = Ring::default();
        if !self.complex.ring_of(a, b, &mut ring) {
            return false;
        }
        let before = self.worst(&ring.tets);
        self.insert_in(&ring, a, b, before + 0.01)
    }

    /// The same, kept if the worst is better than `least`.
    fn insert_in(&mut self, ring: &Ring, a: u32, b: u32, least: f64) -> bool {
        let [p, q] = [a, b].map(|v| self.complex.points[v as usize]);
        let mut at: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        let (mut hold, mut labels) = (On::default(), On::default());
        if !ring.closed {
            let first = self.outer_label(ring.tets[0], a, b, ring.link[0]);
            let last = self.outer_label(
                ring.tets[ring.tets.len() - 1],
                a,
                b,
                ring.link[ring.link.len() - 1],
            );
            let (Some(first), Some(last)) = (first, last) else {
                return false;
            };
            if first >= STRAY || last >= STRAY {
                return false;
            }
            labels = On::of(&[first, last]);
            hold = match first == last {
                true => On::of(&[self.piece_at(&[a, b], first)]),
                false if self.is_sharp([a, b], [first, last]) => labels,
                false => On::of(&[SKIN]),
            };
            let Some(on) = self.surface.project(hold.slice(), at) else {
                return false;
            };
            if norm(sub(on, at)) > 0.3 * norm(sub(p, q)) {
                return false;
            }
            at = on;
        }
        let old: Vec<[u32; 4]> = ring
            .tets
            .iter()
            .map(|&t| self.complex.tets[t as usize])
            .collect();
        let mut faces: Vec<([u32; 3], u32)> = Vec::new();
        for &t in &ring.tets {
            for i in 0..4 {
                let n = self.complex.adjacent[t as usize][i];
                if n >= BOUNDARY {
                    let mut f = self.complex.face(t, i);
                    f.sort_unstable();
                    faces.push((f, n));
                }
            }
        }
        let m = self.complex.add_point(at);
        self.hold.push(Hold::On(hold));
        self.labels.push(labels);
        self.touched.push(self.clock);
        let mut made = Vec::new();
        self.complex.split(ring, a, b, m, &mut made);
        let mut moving = std::mem::take(&mut self.scratch.moving);
        if let Some(place) = self.better_place(m, &mut moving) {
            self.complex.points[m as usize] = place;
        }
        self.scratch.moving = moving;
        if self.worst(&made) > least {
            return true;
        }
        let mut back = Vec::new();
        self.complex.replace(
            &made,
            &old,
            |key| faces.iter().find(|f| f.0 == key).map_or(OPEN, |f| f.1),
            &mut back,
        );
        self.complex.tet_of[m as usize] = NONE;
        self.complex.points.pop();
        self.complex.tet_of.pop();
        self.hold.pop();
        self.labels.pop();
        self.touched.pop();
        false
    }

    /// Tries everything on a bad tetrahedron; returns whether something was done.
    fn mend(&mut self, t: u32, insertions: bool) -> bool {
        enum Op {
            Edge(u32, u32),
            Face(usize),
            Collapse(u32, u32),
        }
        let v = self.complex.tets[t as usize];
        let mut best: Option<(f64, Op)> = None;
        let mut consider = |q: Option<f64>, op: Op| {
            if let Some(q) = q
                && best.as_ref().is_none_or(|b| q > b.0)
            {
                best = Some((q, op));
            }
        };
        for (i, j) in EDGES {
            let q = self.remove_edge(t, v[i], v[j], false);
            consider(q, Op::Edge(v[i], v[j]));
        }
        for i in 0..4 {
            let q = self.remove_face(t, i, false);
            consider(q, Op::Face(i));
        }
        for (i, j) in EDGES {
            for (u, w) in [(v[i], v[j]), (v[j], v[i])] {
                let q = self.collapse(t, u, w, None, false);
                consider(q, Op::Collapse(u, w));
            }
        }
        match best {
            Some((_, Op::Edge(a, b))) => self.remove_edge(t, a, b, true).is_some(),
            Some((_, Op::Face(i))) => self.remove_face(t, i, true).is_some(),
            Some((_, Op::Collapse(u, w))) => self.collapse(t, u, w, None, true).is_some(),
            None if insertions => {
                let mut edges = EDGES.map(|(i, j)| {
                    let d = sub(
                        self.complex.points[v[i] as usize],
                        self.complex.points[v[j] as usize],
                    );
                    (dot(d, d), v[i], v[j])
                });
                edges.sort_by(|a, b| b.0.total_cmp(&a.0));
                edges.iter().take(4).any(|&(_, a, b)| self.insert(a, b))
            }
            None => false,
        }
    }

    /// The vertices off the surface among those that `may` says may be, in order.
    fn off(&self, may: impl Fn(u32) -> bool + Sync) -> Vec<u32> {
        let is_off = |&v: &u32| {
            let p = self.complex.points[v as usize];
            self.complex.tet_of[v as usize] != NONE
                && may(v)
                && (self.is_off(v, p) || self.is_hidden(v))
        };
        (0..self.complex.points.len() as u32)
            .into_par_iter()
            .filter(is_off)
            .collect()
    }

    /// Brings vertices that the cutting had to leave off their pieces onto them, making room by
    /// mending. Returns those left.
    pub(crate) fn settle(&mut self, goal: f64) -> Vec<Point3> {
        let (mut left, mut fewest): (Vec<u32>, usize) =
            (std::mem::take(&mut self.first_off), usize::MAX);
        let mut since = 0;
        for round in 0..6 {
            if self.control.is_stopped() {
                break;
            }
            let off =
                self.off(|v| self.touched[v as usize] > since || left.binary_search(&v).is_ok());
            since = self.clock;
            left.clear();
            let mut star = Vec::new();
            for (k, v) in off.into_iter().enumerate() {
                if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                    break;
                }
                let p = self.complex.points[v as usize];
                if self.is_hidden(v) {
                    self.hold[v as usize] = Hold::On(On::of(&[SKIN]));
                }
                let Some(q) = self
                    .surface
                    .project(self.holding(v).slice(), p)
                    .filter(|q| norm(sub(*q, p)) < self.size)
                else {
                    left.push(v);
                    continue;
                };
                self.complex.star(v, &mut star);
                let faces = self.faces_at(&star, v);
                // As far as the tetrahedra allow, the whole way if possible; less is asked of them
                // from round to round.
                let least = 0.05 * 0.5f64.powi(round);
                let way = [1.0, 0.5, 0.25].into_iter().find(|t| {
                    let at = std::array::from_fn(|i| p[i] + t * (q[i] - p[i]));
                    self.worst_at(v, at, &star, &faces) > least
                });
                if let Some(t) = way {
                    self.suspects.extend_from_slice(&star);
                    self.touched[v as usize] = self.clock + 1;
                    self.complex.points[v as usize] = if t == 1.0 {
                        q
                    } else {
                        std::array::from_fn(|i| p[i] + t * (q[i] - p[i]))
                    };
                }
                if way != Some(1.0) {
                    left.push(v);
                }
            }
            // Many that do not get fewer are a solid too fine for the size; a few are worth every
            // round.
            if (left.is_empty() && round > 0) || left.len() > FEW.max(fewest - fewest / 10) {
                break;
            }
            fewest = left.len();
            left.iter().for_each(|&v| self.free(v));
            self.collapse_micro();
            self.make_room(&left);
            self.mend_all(goal, 8);
        }
        left.into_iter()
            .filter(|&v| self.complex.tet_of[v as usize] != NONE)
            .map(|v| self.complex.points[v as usize])
            .collect()
    }

    /// Moves the vertices around those given as far as it helps, also where they are good enough
    /// otherwise.
    fn make_room(&mut self, vertices: &[u32]) {
        let (mut near, mut star) = (Vec::new(), Vec::new());
        for &v in vertices {
            self.complex.star(v, &mut star);
            near.extend(star.iter().flat_map(|&t| self.complex.tets[t as usize]));
        }
        near.sort_unstable();
        near.dedup();
        self.clock += 1;
        let enough = std::mem::replace(&mut self.enough, f64::INFINITY);
        self.smooth(&near);
        self.enough = enough;
    }

    /// Frees a vertex whose labels have no edge or corner of the solid in common near it, as where
    /// pieces touch tangentially: it is held on the solid alone, and the faces around it are
    /// labelled anew, as the solid is at their middles.
    fn free(&mut self, v: u32) {
        let p = self.complex.points[v as usize];
        let on = self.holding(v);
        let at = self
            .surface
            .project(on.slice(), p)
            .filter(|q| norm(sub(*q, p)) < self.size);
        let is_real = at.is_some_and(|q| match on.slice() {
            &[a, b] => self.surface.is_edge([a, b], q),
            [_, _, _] => self.surface.is_corner(on.slice(), q),
            _ => true,
        });
        if is_real || on.is_empty() {
            return;
        }
        let mut star = Vec::new();
        self.complex.star(v, &mut star);
        self.hold[v as usize] = Hold::On(On::of(&[SKIN]));
        self.touched[v as usize] = self.clock + 1;
        let mut labels = On::default();
        for &t in &star {
            for i in 0..4 {
                let n = self.complex.adjacent[t as usize][i];
                if n < BOUNDARY || n == OPEN || self.complex.tets[t as usize][i] == v {
                    continue;
                }
                let c = self
                    .complex
                    .face(t, i)
                    .map(|k| self.complex.points[k as usize]);
                let middle = std::array::from_fn(|k| (c[0][k] + c[1][k] + c[2][k]) / 3.0);
                let old = n & !BOUNDARY;
                let label = self.surface.project(&[SKIN], middle).map_or(old, |q| {
                    let candidates = self.labels[v as usize]
                        .with(self.surface.value(q).1)
                        .unwrap_or(self.labels[v as usize]);
                    let real = candidates.slice().iter().copied().filter(|&l| {
                        self.surface.distance(l, q) == 0.0 && self.surface.is_face(l, q)
                    });
                    real.max_by(|&a, &b| self.facing(c, a).total_cmp(&self.facing(c, b)))
                        .unwrap_or(old)
                });
                self.complex.adjacent[t as usize][i] = BOUNDARY | label;
                labels = labels.with(label).unwrap_or(labels);
            }
        }
        self.labels[v as usize] = labels;
    }

    /// The pieces that a vertex belongs on.
    fn holding(&self, v: u32) -> On {
        match self.hold[v as usize] {
            Hold::On(on) if !on.is_empty() => on,
            _ => self.labels[v as usize],
        }
    }

    /// Splits edges of the surface whose middles are farther from it than `error`, or that turn too
    /// far, until there are none.
    pub(crate) fn refine_surface(&mut self, error: f64, goal: f64) {
        self.error = error;
        let mut fewest = usize::MAX;
        for _ in 0..8 {
            if self.control.is_stopped() {
                return;
            }
            let faces = self.faces();
            let edges = labelled_edges(faces.iter().copied());
            let mut wanted: Vec<(f64, [u32; 2])> = edges
                .par_chunk_by(|a, b| a.0 == b.0)
                .filter_map(|same| {
                    let labels = [same[0].1, same[same.len() - 1].1];
                    self.excess(same[0].0, labels, error)
                        .map(|s| (s, same[0].0))
                })
                .collect();
            if error.is_finite() {
                // Faces whose edges are all right but whose middle is not.
                wanted.par_extend(faces.par_iter().filter(|f| f.1 < STRAY).filter_map(
                    |(f, label)| {
                        let p = f.map(|v| self.complex.points[v as usize]);
                        let middle = std::array::from_fn(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0);
                        let off = norm(sub(
                            self.surface.project(&[self.piece_at(f, *label)], middle)?,
                            middle,
                        ));
                        let long = (0..3).max_by(|&i, &j| {
                            norm(sub(p[i], p[(i + 1) % 3]))
                                .total_cmp(&norm(sub(p[j], p[(j + 1) % 3])))
                        })?;
                        let (a, b) = (f[long], f[(long + 1) % 3]);
                        (off > error).then_some((off / error, [a.min(b), a.max(b)]))
                    },
                ));
            }
            if wanted.len() > fewest - fewest / 10 {
                return;
            }
            fewest = wanted.len();
            wanted.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let (mut ring, mut done) = (Ring::default(), 0);
            for (k, (_, [a, b])) in wanted.iter().enumerate() {
                if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                    return;
                }
                if self.complex.ring_of(*a, *b, &mut ring) && !ring.closed {
                    done += usize::from(self.insert_in(&ring, *a, *b, 0.02));
                }
            }
            if done == 0 {
                return;
            }
            self.mend_all(goal, 12);
        }
    }

    /// By how much an edge of the surface leaves it more than it may; none if it does not.
    fn excess(&self, ends: [u32; 2], labels: [u32; 2], error: f64) -> Option<f64> {
        if labels.iter().any(|&l| l >= STRAY) {
            return None;
        }
        let [p, q] = ends.map(|v| self.complex.points[v as usize]);
        let middle: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        let sharp = labels[0] != labels[1] && self.is_sharp(ends, labels);
        let on = match sharp {
            true => On::of(&labels),
            false if labels[0] != labels[1] => On::of(&[SKIN]),
            false => On::of(&[self.piece_at(&ends, labels[0])]),
        };
        let length = norm(sub(p, q));
        let most = (TURN * length).min(error).min(if sharp {
            CURVE * self.size
        } else {
            f64::INFINITY
        });
        // The first step of Newton's method tells of most edges that they are well within what they
        // may.
        if norm(sub(self.surface.nearer(on.slice(), middle)?, middle)) < 0.6 * most {
            return None;
        }
        let off = norm(sub(self.surface.project(on.slice(), middle)?, middle));
        (off > most && off < 0.4 * length).then_some(off / most)
    }

    /// Collapses edges that are far shorter than any wanted, as cuts leave them where pieces nearly
    /// touch.
    fn collapse_micro(&mut self) {
        let micro = MICRO * self.size;
        let mut short: Vec<(f64, u32, u32)> = Vec::new();
        for t in self.complex.live() {
            let (v, p) = (self.complex.tets[t as usize], self.complex.corners(t));
            for (i, j) in EDGES {
                let e = sub(p[i], p[j]);
                if dot(e, e) < micro * micro {
                    short.push((norm(e), v[i].min(v[j]), v[i].max(v[j])));
                }
            }
        }
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        short.dedup();
        let mut ring = Ring::default();
        for (k, (_, a, b)) in short.into_iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return;
            }
            for (u, w) in [(a, b), (b, a)] {
                if self.complex.tet_of[u as usize] == NONE
                    || self.complex.tet_of[w as usize] == NONE
                    || !self.complex.ring_of(u, w, &mut ring)
                {
                    break;
                }
                if !self.labels[u as usize].is_empty() {
                    self.free(u);
                }
                let before = self.worst(&ring.tets);
                if self
                    .collapse(ring.tets[0], u, w, Some((0.5 * before).min(0.05)), true)
                    .is_some()
                {
                    self.touched[w as usize] = self.clock + 1;
                    break;
                }
            }
        }
    }

    /// Optimises until no tetrahedron is below `goal` or nothing helps any more.
    pub(crate) fn run(&mut self, goal: f64) {
        self.enough = ENOUGH * goal;
        self.collapse_micro();
        let off = self.off(|_| true);
        let mut is_near = vec![false; self.complex.points.len()];
        let live: Vec<u32> = self.complex.live().collect();
        let poor: Vec<u32> = live
            .into_par_iter()
            .with_min_len(1024)
            .filter(|&t| self.measure(t) < self.enough)
            .collect();
        for &t in &poor {
            self.complex.tets[t as usize]
                .iter()
                .for_each(|&v| is_near[v as usize] = true);
        }
        self.suspects = poor;
        self.complex.log = Some(Vec::new());
        let near: Vec<u32> = (0..is_near.len() as u32)
            .filter(|&v| is_near[v as usize])
            .collect();
        // From here on, what is touched may have become off the surface or come onto it.
        self.clock = 1;
        self.smooth(&near);
        self.make_room(&off);
        self.first_off = off;
        self.mend_all(goal, 30);
    }

    /// Splits faces of the surface whose corners all lie on one curve, at their edge that is no
    /// piece of it: three points do not say on which side of the curve such a face is, and there is
    /// room for a better one.
    pub(crate) fn split_ears(&mut self, least: f64) {
        let mut ears = Vec::new();
        let mut ring = Ring::default();
        for t in self.complex.live() {
            for i in 0..4 {
                let label = self.complex.adjacent[t as usize][i];
                if label < BOUNDARY || label == OPEN {
                    continue;
                }
                let f = self.complex.face(t, i);
                let [a, b, c] = f.map(|v| self.labels[v as usize]);
                if a.common(&b).common(&c).len() < 2 {
                    continue;
                }
                for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
                    if self.complex.ring_of(a, b, &mut ring)
                        && self.surface_edge(&ring, a, b).is_some()
                    {
                        ears.push((a.min(b), a.max(b)));
                    }
                }
            }
        }
        ears.sort_unstable();
        ears.dedup();
        for (k, (a, b)) in ears.into_iter().enumerate() {
            if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                return;
            }
            if self.complex.ring_of(a, b, &mut ring) {
                let before = self.worst(&ring.tets);
                self.insert_in(&ring, a, b, least.min(0.9 * before));
            }
        }
    }

    /// Mends tetrahedra below `goal` in rounds, with moves of the vertices around them.
    fn mend_all(&mut self, goal: f64, rounds: usize) {
        let mut last = f64::NEG_INFINITY;
        let (mut idle, mut fewest) = (0, usize::MAX);
        for round in 0..rounds {
            let mut suspects = std::mem::take(&mut self.suspects);
            self.complex
                .log
                .iter_mut()
                .for_each(|log| suspects.append(log));
            suspects.par_sort_unstable();
            suspects.dedup();
            suspects.retain(|&t| self.complex.is_there(t));
            let mut bad: Vec<(f64, u32)> = suspects
                .par_iter()
                .with_min_len(1024)
                .map(|&t| (self.measure(t), t))
                .filter(|b| b.0 < goal)
                .collect();
            self.suspects.extend(bad.iter().map(|b| b.1));
            bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let Some(&(worst, _)) = bad.first() else {
                return;
            };
            if self.control.is_stopped() {
                return;
            }
            // Insertions are for what is left over; where much is bad they only make more of it.
            let insertions =
                round >= INSERT_FROM && bad.len() < MANY.max(self.complex.tets.len() / 200);
            let mut done = 0;
            self.clock += 1;
            self.tried.resize(self.complex.tets.len(), 0);
            if round == INSERT_FROM {
                self.tried.fill(0);
            }
            for (k, &(_, t)) in bad.iter().enumerate() {
                if k.is_multiple_of(LOOK) && self.control.is_stopped() {
                    return;
                }
                if !self.complex.is_there(t) || self.measure(t) >= goal {
                    continue;
                }
                let v = self.complex.tets[t as usize];
                let tried = self.tried[t as usize];
                if tried > 0 && v.iter().all(|&k| self.touched[k as usize] < tried) {
                    continue;
                }
                if self.mend(t, insertions) {
                    done += 1;
                    for k in v {
                        self.touched[k as usize] = self.clock;
                    }
                } else if self.complex.tets[t as usize] == v {
                    self.tried[t as usize] = self.clock;
                }
                if self.tried.len() < self.complex.tets.len() {
                    self.tried.resize(self.complex.tets.len(), 0);
                }
            }
            let mut near: Vec<u32> = bad
                .iter()
                .filter(|b| self.complex.is_there(b.1))
                .flat_map(|b| self.complex.tets[b.1 as usize])
                .collect();
            near.sort_unstable();
            near.dedup();
            let mut wider = near.clone();
            let mut star = Vec::new();
            for &v in &near {
                self.complex.star(v, &mut star);
                wider.extend(star.iter().flat_map(|&t| self.complex.tets[t as usize]));
            }
            wider.sort_unstable();
            wider.dedup();
            let moved = self.smooth(&wider);
            // Progress is a better worst tetrahedron or fewer bad ones.
            idle = if worst > last + 1e-4 || bad.len() < fewest - fewest / 50 {
                0
            } else {
                idle + 1
            };
            fewest = fewest.min(bad.len());
            last = last.max(worst);
            if idle >= 4 || (done == 0 && moved == 0) {
                return;
            }
        }
    }
}

/// Stands for all that lies beyond the boundary: a vertex joined to each of its faces.
const BEYOND: u32 = NONE;

/// Whether pulling one vertex onto the other leaves the complex a manifold: the link condition
/// (Dey, Edelsbrunner, Guha and Nekhayev, Topology preserving edge contraction, 1999). What the
/// links of both have in common must be the link of their edge.
///
/// Vertices alone do not tell: where the solid is thin, three vertices of the surface may have
/// edges on it and yet an inner face, and its collapse would leave two sheets that meet in an edge.
fn keeps_topology(complex: &Complex, ends: [(u32, &[u32]); 2], ring: &Ring) -> bool {
    let [mine, theirs] = ends.map(|(v, star)| Link::of(complex, v, star));
    let sorted = |a: u32, b: u32| [a.min(b), a.max(b)];
    let mut vertices = ring.link.clone();
    let mut edges: Vec<[u32; 2]> = ring.link.windows(2).map(|l| sorted(l[0], l[1])).collect();
    let (first, last) = (ring.link[0], ring.link[ring.link.len() - 1]);
    if ring.closed {
        edges.push(sorted(first, last));
    } else {
        vertices.push(BEYOND);
        edges.extend([[first, BEYOND], [last, BEYOND]]);
    }
    vertices.sort_unstable();
    edges.sort_unstable();
    common(&mine.vertices, &theirs.vertices).eq(vertices.iter())
        && common(&mine.edges, &theirs.edges).eq(edges.iter())
        && common(&mine.triangles, &theirs.triangles).next().is_none()
}

/// What two sorted lists have in common.
fn common<'l, T: Ord>(a: &'l [T], b: &'l [T]) -> impl Iterator<Item = &'l T> {
    a.iter().filter(|x| b.binary_search(x).is_ok())
}

/// What lies opposite to a vertex in the simplices at it, sorted.
#[derive(Default)]
struct Link {
    vertices: Vec<u32>,
    edges: Vec<[u32; 2]>,
    triangles: Vec<[u32; 3]>,
}

impl Link {
    fn of(complex: &Complex, v: u32, star: &[u32]) -> Self {
        let mut link = Self::default();
        for &t in star {
            let place = complex.place(t, v);
            link.triangles.push(complex.face(t, place));
            for i in (0..4).filter(|&i| i != place) {
                if complex.adjacent[t as usize][i] >= BOUNDARY {
                    link.triangles
                        .push(complex.face(t, i).map(|k| if k == v { BEYOND } else { k }));
                }
            }
        }
        for f in &mut link.triangles {
            f.sort_unstable();
            let [a, b, c] = *f;
            link.edges.extend([[a, b], [a, c], [b, c]]);
            link.vertices.extend([a, b, c]);
        }
        link.triangles.sort_unstable();
        link.edges.sort_unstable();
        link.edges.dedup();
        link.vertices.sort_unstable();
        link.vertices.dedup();
        link
    }
}
