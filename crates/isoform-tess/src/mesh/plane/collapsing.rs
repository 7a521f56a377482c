//! Coarsening: vertices are collapsed onto their neighbours.

use super::{Beyond, Measure, NO_TRIANGLE, Plane, SPLIT_EXCESS, Shared};
use crate::mesh::geometry::distance;
use crate::mesh::names::Name;
use std::collections::{BTreeMap, BTreeSet};

/// Maximum number of triangles around a vertex; vertices with more are left alone.
const MAX_STAR_TRIANGLES: usize = 64;

/// Triangles around a vertex, counterclockwise, and the vertices on the ring around it: triangle k
/// has the corners v, ring k and ring k + 1.
pub(super) struct Star {
    pub(super) triangles: Vec<u32>,
    pub(super) ring: Vec<u32>,
}

impl Star {
    /// Returns the triangles that remain when the vertex is collapsed onto vertex k of the ring,
    /// counterclockwise from k.
    fn pulled(&self, k: usize) -> impl Iterator<Item = [u32; 3]> + Clone {
        let (ring, n) = (&self.ring, self.ring.len());
        (1..n - 1).map(move |j| [ring[k], ring[(k + j) % n], ring[(k + j + 1) % n]])
    }
    /// Returns the vertices of the ring that gain an edge to vertex k by that, counterclockwise
    /// from k.
    fn joined(&self, k: usize) -> impl Iterator<Item = u32> {
        let (ring, n) = (&self.ring, self.ring.len());
        (2..n - 1).map(move |j| ring[(k + j) % n])
    }
}

/// State of a series of collapses: a triangle at each vertex, and true for each triangle that is
/// removed.
struct CollapseState {
    at: Vec<u32>,
    dead: Vec<bool>,
}

impl Plane {
    /// Collapses vertices of thin triangles onto their neighbours where no triangle gets worse.
    /// Returns the number of collapses.
    pub(super) fn coarsen(&mut self, measure: &dyn Measure) -> usize {
        let (at, free) = self.inner_vertices();
        let dead = vec![false; self.triangles.len()];
        let mut pulling = CollapseState { at, dead };
        let mut done = 0;
        for v in 0..self.nodes.len() as u32 {
            if free[v as usize]
                && let Some(star) = self.sound_star(pulling.at[v as usize], v)
                && let Some(k) = self.target(v, &star, &pulling.at, measure)
            {
                self.pull(v, &star, k, &mut pulling);
                done += 1;
            }
        }
        self.remove(&pulling.dead);
        done
    }

    /// Returns the index on the ring of the vertex onto which another one is to be collapsed.
    fn target(&self, v: u32, star: &Star, at: &[u32], measure: &dyn Measure) -> Option<usize> {
        // A triangle whose smallest angle has a sine above 0.4 is good enough.
        let least = self.least_quality(star, measure).min(0.4);
        let far = |k: &usize| {
            let to = self.images[star.ring[*k] as usize];
            distance(to, self.images[v as usize])
        };
        let mut order: Vec<usize> = (0..star.ring.len()).collect();
        order.sort_by(|a, b| far(a).total_cmp(&far(b)));
        order
            .into_iter()
            // The four nearest neighbours are tried.
            .take(4)
            .find(|&k| self.may_be_pulled(star, k, least, at, measure))
    }
    /// Returns the shapes of the triangles after a vertex is collapsed onto vertex k of its ring,
    /// if all are better than a quality.
    fn shapes_pulled(
        &self,
        star: &Star,
        k: usize,
        least: f64,
        measure: &dyn Measure,
    ) -> Option<Vec<super::TriangleShape>> {
        let mut shapes = Vec::new();
        for t in star.pulled(k) {
            if !self.has_room(t) || self.least_sine(t) <= least {
                return None;
            }
            let shape = self.shape_of(t, measure);
            if shape.quality <= least {
                return None;
            }
            shapes.push(shape);
        }
        Some(shapes)
    }
    /// Returns true if a vertex may be collapsed onto vertex k of its ring: all triangles become
    /// better than a quality, none is far from the surface, and no edge needs to be split.
    fn may_be_pulled(
        &self,
        star: &Star,
        k: usize,
        least: f64,
        at: &[u32],
        measure: &dyn Measure,
    ) -> bool {
        let w = star.ring[k];
        let Some(shapes) = self.shapes_pulled(star, k, least, measure) else {
            return false;
        };
        let is_fine = |(x, beside): (u32, &[super::TriangleShape])| {
            let is_free = !self.have_one_image([w, x]) && !self.is_ambiguous([w, x]);
            is_free && self.excess([w, x], [beside[0], beside[1]], measure).0 <= SPLIT_EXCESS
        };
        star.joined(k).zip(shapes.windows(2)).all(is_fine)
            // The edges from w to the ring are new.
            && !star.joined(k).any(|x| self.are_joined(at[w as usize], w, x))
            && shapes.iter().all(|shape| self.off(shape, measure) <= 1.0)
    }

    /// Removes vertices of contracted curves that are denser than the curves that leave them
    /// require: a triangle with two such vertices and a distant one has two sides that coincide in
    /// space.
    pub(super) fn thin_contracted(&mut self, measure: &dyn Measure) {
        let mut along = self.fixed_edges();
        let mut pulling = CollapseState {
            at: self.triangle_at(),
            dead: vec![false; self.triangles.len()],
        };
        for v in 0..self.nodes.len() as u32 {
            let Some([a, b]) = along.get(&v).and_then(two) else {
                continue;
            };
            if pulling.at[v as usize] == NO_TRIANGLE || !self.is_dispensable(v, [a, b], measure) {
                continue;
            }
            let Some(star) = self.sound_star(pulling.at[v as usize], v) else {
                continue;
            };
            let place = |w: u32| star.ring.iter().position(|&x| x == w);
            let mut places = [a, b].into_iter().filter_map(place);
            let Some(k) = places.find(|&k| self.has_room_pulled(&star, k, &pulling.at)) else {
                continue;
            };
            self.pull(v, &star, k, &mut pulling);
            for (x, y) in [(a, b), (b, a)] {
                if let Some(list) = along.get_mut(&x) {
                    list.remove(&v);
                    list.insert(y);
                }
            }
        }
        self.remove(&pulling.dead);
        self.queue_all();
    }
    /// Queues all triangles.
    fn queue_all(&mut self) {
        self.queued.fill(true);
        self.queue = (0..self.triangles.len() as u32).collect();
    }
    /// Returns true if collapsing a vertex onto vertex k of its ring leaves all triangles some
    /// area, and adds no edge that exists already.
    fn has_room_pulled(&self, star: &Star, k: usize, at: &[u32]) -> bool {
        let w = star.ring[k];
        let has_room = star.pulled(k).all(|t| self.has_room(t));
        has_room
            && !star
                .joined(k)
                .any(|x| self.are_joined(at[w as usize], w, x))
    }
    /// Returns true if a vertex between two others on a contracted curve is not needed there.
    fn is_dispensable(&self, v: u32, [a, b]: [u32; 2], measure: &dyn Measure) -> bool {
        let node = &self.nodes[v as usize];
        let Some(Shared::Contracted(image)) = self.shared[v as usize] else {
            return false;
        };
        if node.name != Name::Inner || node.faces != 0 {
            return false;
        }
        // Vertices next to the new chord have to stay on their side of the curve.
        let [x, y] = self.places([a, b]);
        let is_straight = measure.beside_chord([x, y], image).is_some_and(|m| {
            let off = (m[0] - 0.5 * (x[0] + y[0])).hypot(m[1] - 0.5 * (x[1] + y[1]));
            // Otherwise new vertices come to lie between the chord and the curve.
            off <= 1e-6 * (x[0] - y[0]).hypot(x[1] - y[1])
        });
        is_straight
            && [a, b].iter().all(|&w| self.have_one_image([v, w]))
            && !measure.turns(self.places([a, v, b]))
    }
    /// Returns the ends of fixed edges at each vertex.
    fn fixed_edges(&self) -> BTreeMap<u32, BTreeSet<u32>> {
        let mut along: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for t in 0..self.triangles.len() as u32 {
            for i in (0..3).filter(|&i| self.fixed[t as usize][i]) {
                let [a, b] = self.ends(t, i);
                along.entry(a).or_default().insert(b);
                along.entry(b).or_default().insert(a);
            }
        }
        along
    }

    /// Returns a triangle at each vertex.
    pub(super) fn triangle_at(&self) -> Vec<u32> {
        let mut at = vec![NO_TRIANGLE; self.nodes.len()];
        for (t, v) in self.triangles.iter().enumerate() {
            v.iter().for_each(|&v| at[v as usize] = t as u32);
        }
        at
    }
    /// Returns a triangle at each vertex, and true for each vertex off all curves, which may be
    /// moved.
    pub(super) fn inner_vertices(&self) -> (Vec<u32>, Vec<bool>) {
        let mut free: Vec<bool> = (0..self.nodes.len())
            .map(|v| {
                self.nodes[v].name == Name::Inner
                    && self.nodes[v].faces == 0
                    && self.shared[v].is_none()
            })
            .collect();
        for t in 0..self.triangles.len() as u32 {
            for i in (0..3).filter(|&i| self.fixed[t as usize][i]) {
                for v in self.ends(t, i) {
                    free[v as usize] = false;
                }
            }
        }
        (self.triangle_at(), free)
    }

    /// Returns the triangles around a vertex; `None` unless the pole curve provably misses all of
    /// them, at borders, and above [`MAX_STAR_TRIANGLES`].
    pub(super) fn sound_star(&self, from: u32, v: u32) -> Option<Star> {
        let star = self.star(from, v)?;
        let is_sound = star.triangles.iter().all(|&t| self.sound[t as usize]);
        is_sound.then_some(star)
    }
    fn star(&self, from: u32, v: u32) -> Option<Star> {
        let (mut triangles, mut ring) = (Vec::new(), Vec::new());
        let mut t = from;
        while triangles.first() != Some(&t) {
            if t == NO_TRIANGLE || triangles.len() == MAX_STAR_TRIANGLES {
                return None;
            }
            let i = self.triangles[t as usize].iter().position(|&x| x == v)?;
            triangles.push(t);
            ring.push(self.triangles[t as usize][(i + 1) % 3]);
            // The neighbour beyond the edge from v to the next corner.
            t = self.adjacent[t as usize][(i + 1) % 3];
        }
        Some(Star { triangles, ring })
    }
    /// Returns the minimum quality of the triangles around a vertex.
    pub(super) fn least_quality(&self, star: &Star, measure: &dyn Measure) -> f64 {
        let triangles = star.triangles.iter();
        triangles
            .map(|&t| self.shape(t, measure).quality)
            .fold(f64::INFINITY, f64::min)
    }

    /// Collapses a vertex onto vertex k of its ring.
    fn pull(&mut self, v: u32, star: &Star, k: usize, pulling: &mut CollapseState) {
        let Star { triangles, ring } = star;
        let n = triangles.len();
        let w = ring[k];
        // The two triangles between v and w are removed; w replaces v in the others.
        let gone = [triangles[k], triangles[(k + n - 1) % n]];
        let outer = gone.map(|t| self.beyond(t, self.corner_at(t, v)));
        for j in 1..n - 1 {
            let t = triangles[(k + j) % n];
            let i = self.corner_at(t, v);
            self.triangles[t as usize][i] = w;
            self.shapes[t as usize].set(None);
        }
        // The triangle after (v, w, next) becomes adjacent to the one beyond the edge from w to
        // next.
        let [next, last] = [(k + 1) % n, (k + n - 1) % n];
        self.join(triangles[next], [w, ring[next]], outer[0]);
        self.join(triangles[(k + n - 2) % n], [w, ring[last]], outer[1]);
        for t in gone {
            pulling.dead[t as usize] = true;
        }
        pulling.at[v as usize] = NO_TRIANGLE;
        for t in (1..n - 1).map(|j| triangles[(k + j) % n]) {
            for x in self.triangles[t as usize] {
                pulling.at[x as usize] = t;
            }
        }
    }
    /// Returns the index of a vertex among the corners of a triangle.
    fn corner_at(&self, t: u32, v: u32) -> usize {
        let mut corners = self.triangles[t as usize].iter();
        corners.position(|&x| x == v).expect("a triangle at v")
    }
    /// Makes a triangle and the one beyond its edge between two vertices neighbours.
    fn join(&mut self, t: u32, ends: [u32; 2], (n, fixed): Beyond) {
        for (a, b) in [(t, n), (n, t)] {
            if a != NO_TRIANGLE {
                let i = (0..3)
                    .find(|&i| !ends.contains(&self.triangles[a as usize][i]))
                    .expect("a corner opposite to the edge");
                self.adjacent[a as usize][i] = b;
                self.fixed[a as usize][i] = fixed || b == NO_TRIANGLE;
            }
        }
    }

    /// Returns true if two vertices have an edge, searched for around the first, in both directions
    /// from one of its triangles.
    fn are_joined(&self, from: u32, w: u32, x: u32) -> bool {
        for step in [1, 2] {
            let mut t = from;
            for _ in 0..MAX_STAR_TRIANGLES {
                let v = self.triangles[t as usize];
                if v.contains(&x) {
                    return true;
                }
                let i = v.iter().position(|&y| y == w).expect("a triangle at w");
                t = self.adjacent[t as usize][(i + step) % 3];
                if t == NO_TRIANGLE || t == from {
                    break;
                }
            }
        }
        false
    }

    /// Removes the marked triangles.
    fn remove(&mut self, dead: &[bool]) {
        let kept: Vec<usize> = (0..dead.len()).filter(|&t| !dead[t]).collect();
        let mut new = vec![NO_TRIANGLE; dead.len()];
        for (n, &t) in kept.iter().enumerate() {
            new[t] = n as u32;
        }
        let renumbered = |n: u32| {
            if n == NO_TRIANGLE {
                NO_TRIANGLE
            } else {
                new[n as usize]
            }
        };
        self.triangles = kept.iter().map(|&t| self.triangles[t]).collect();
        self.fixed = kept.iter().map(|&t| self.fixed[t]).collect();
        self.shapes = kept.iter().map(|&t| self.shapes[t].clone()).collect();
        self.sound = kept.iter().map(|&t| self.sound[t]).collect();
        let adjacent = kept.iter().map(|&t| self.adjacent[t].map(renumbered));
        self.adjacent = adjacent.collect();
        self.queued = vec![false; kept.len()];
        self.queue.clear();
    }
}

/// Returns the elements of a set of two.
fn two(set: &BTreeSet<u32>) -> Option<[u32; 2]> {
    let mut all = set.iter().copied();
    let two = [all.next()?, all.next()?];
    all.next().is_none().then_some(two)
}
