//! Fewer triangles: vertices that are pulled onto their neighbours.

use super::{Beyond, Measure, NONE, Plane, SPLIT, Shared};
use crate::mesh::geometry::distance;
use crate::mesh::names::Name;
use std::collections::{BTreeMap, BTreeSet};

/// The sine of the smallest angle below which a triangle is too thin.
const COARSE: f64 = 0.4;
/// Nearest neighbours that a vertex is tried to be pulled onto.
const TARGETS: usize = 4;
/// The most that contracted curves may bulge beyond their chords by, per length of these, for
/// vertices to be taken off them: new vertices come to lie between the chord and the curve
/// otherwise.
const STRAIGHT: f64 = 1e-6;
/// Triangles around a vertex at most that are looked at.
const MOST_AROUND: usize = 64;

/// The triangles around a vertex, counterclockwise from one of them on, and the vertices on the
/// ring: triangle k has the corners v, ring k and ring k + 1.
pub(super) struct Star {
    pub(super) triangles: Vec<u32>,
    pub(super) ring: Vec<u32>,
}

impl Star {
    /// The triangles that are left when the vertex is pulled onto number k of the ring, from k on
    /// counterclockwise.
    fn pulled(&self, k: usize) -> impl Iterator<Item = [u32; 3]> + Clone {
        let (ring, n) = (&self.ring, self.ring.len());
        (1..n - 1).map(move |j| [ring[k], ring[(k + j) % n], ring[(k + j + 1) % n]])
    }
    /// The vertices of the ring that get an edge to number k then, from k on counterclockwise.
    fn joined(&self, k: usize) -> impl Iterator<Item = u32> {
        let (ring, n) = (&self.ring, self.ring.len());
        (2..n - 1).map(move |j| ring[(k + j) % n])
    }
}

/// While vertices are pulled onto others: a triangle at each vertex, and which triangles are gone.
struct Pulling {
    at: Vec<u32>,
    dead: Vec<bool>,
}

impl Plane {
    /// Pulls vertices of thin triangles onto their neighbours where nothing gets worse. Returns how
    /// many.
    pub(super) fn coarsen(&mut self, measure: &dyn Measure) -> usize {
        let (at, free) = self.inner_vertices();
        let dead = vec![false; self.triangles.len()];
        let mut pulling = Pulling { at, dead };
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

    /// The number on the ring of the vertex that another one is to be pulled onto.
    fn target(&self, v: u32, star: &Star, at: &[u32], measure: &dyn Measure) -> Option<usize> {
        let least = self.least_quality(star, measure).min(COARSE);
        let far = |k: &usize| {
            let to = self.images[star.ring[*k] as usize];
            distance(to, self.images[v as usize])
        };
        let mut order: Vec<usize> = (0..star.ring.len()).collect();
        order.sort_by(|a, b| far(a).total_cmp(&far(b)));
        order
            .into_iter()
            .take(TARGETS)
            .find(|&k| self.may_be_pulled(star, k, least, at, measure))
    }
    /// The shapes of the triangles after a vertex is pulled onto number k of its ring, if all are
    /// better than a quality.
    fn shapes_pulled(
        &self,
        star: &Star,
        k: usize,
        least: f64,
        measure: &dyn Measure,
    ) -> Option<Vec<super::Shape>> {
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
    /// Whether a vertex may be pulled onto number k of its ring: all triangles get better than a
    /// quality, none is far from the surface, and no edge wants to be split.
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
        let is_fine = |(x, beside): (u32, &[super::Shape])| {
            let is_free = !self.have_one_image([w, x]) && !self.is_ambiguous([w, x]);
            is_free && self.excess([w, x], [beside[0], beside[1]], measure).0 <= SPLIT
        };
        star.joined(k).zip(shapes.windows(2)).all(is_fine)
            // w has no other way to a vertex of the ring.
            && !star.joined(k).any(|x| self.are_joined(at[w as usize], w, x))
            && shapes.iter().all(|shape| self.off(shape, measure) <= 1.0)
    }

    /// Takes vertices off contracted curves that are nearer to each other than what leaves the
    /// curve there needs: triangles between such vertices and a far one have two sides that are the
    /// same in space.
    pub(super) fn thin_contracted(&mut self, measure: &dyn Measure) {
        let mut along = self.fixed_edges();
        let mut pulling = Pulling {
            at: self.triangle_at(),
            dead: vec![false; self.triangles.len()],
        };
        for v in 0..self.nodes.len() as u32 {
            let Some([a, b]) = along.get(&v).and_then(two) else {
                continue;
            };
            if pulling.at[v as usize] == NONE || !self.is_dispensable(v, [a, b], measure) {
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
    /// Whether pulling a vertex onto number k of its ring leaves all triangles some room, and joins
    /// no two vertices that are joined already.
    fn has_room_pulled(&self, star: &Star, k: usize, at: &[u32]) -> bool {
        let w = star.ring[k];
        let has_room = star.pulled(k).all(|t| self.has_room(t));
        has_room
            && !star
                .joined(k)
                .any(|x| self.are_joined(at[w as usize], w, x))
    }
    /// Whether a vertex between two others on a contracted curve is not needed there.
    fn is_dispensable(&self, v: u32, [a, b]: [u32; 2], measure: &dyn Measure) -> bool {
        let node = &self.nodes[v as usize];
        let Some(Shared::Contracted(image)) = self.shared[v as usize] else {
            return false;
        };
        if node.name != Name::Inner || node.faces != 0 {
            return false;
        }
        // Vertices beside the new chord have to stay on their side of the curve.
        let [x, y] = self.places([a, b]);
        let is_straight = measure.beside_chord([x, y], image).is_some_and(|m| {
            let off = (m[0] - 0.5 * (x[0] + y[0])).hypot(m[1] - 0.5 * (x[1] + y[1]));
            off <= STRAIGHT * (x[0] - y[0]).hypot(x[1] - y[1])
        });
        is_straight
            && [a, b].iter().all(|&w| self.have_one_image([v, w]))
            && !measure.turns(self.places([a, v, b]))
    }
    /// The ends of fixed edges at each vertex.
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

    /// A triangle at every vertex.
    pub(super) fn triangle_at(&self) -> Vec<u32> {
        let mut at = vec![NONE; self.nodes.len()];
        for (t, v) in self.triangles.iter().enumerate() {
            v.iter().for_each(|&v| at[v as usize] = t as u32);
        }
        at
    }
    /// A triangle at every vertex, and whether the vertex may be moved: what is on no curve.
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

    /// The triangles around a vertex, if the pole curve is proved to miss all of them. None at
    /// borders, and where they are too many.
    pub(super) fn sound_star(&self, from: u32, v: u32) -> Option<Star> {
        let star = self.star(from, v)?;
        let is_sound = star.triangles.iter().all(|&t| self.sound[t as usize]);
        is_sound.then_some(star)
    }
    fn star(&self, from: u32, v: u32) -> Option<Star> {
        let (mut triangles, mut ring) = (Vec::new(), Vec::new());
        let mut t = from;
        while triangles.first() != Some(&t) {
            if t == NONE || triangles.len() == MOST_AROUND {
                return None;
            }
            let i = self.triangles[t as usize].iter().position(|&x| x == v)?;
            triangles.push(t);
            ring.push(self.triangles[t as usize][(i + 1) % 3]);
            // The neighbour beyond the edge from v to the corner after.
            t = self.adjacent[t as usize][(i + 1) % 3];
        }
        Some(Star { triangles, ring })
    }
    /// The least quality of the triangles around a vertex.
    pub(super) fn least_quality(&self, star: &Star, measure: &dyn Measure) -> f64 {
        let triangles = star.triangles.iter();
        triangles
            .map(|&t| self.shape(t, measure).quality)
            .fold(f64::INFINITY, f64::min)
    }

    /// Pulls a vertex onto number k of its ring.
    fn pull(&mut self, v: u32, star: &Star, k: usize, pulling: &mut Pulling) {
        let Star { triangles, ring } = star;
        let n = triangles.len();
        let w = ring[k];
        // The two triangles between v and w go; the others get w for v.
        let gone = [triangles[k], triangles[(k + n - 1) % n]];
        let outer = gone.map(|t| self.beyond(t, self.corner_at(t, v)));
        for j in 1..n - 1 {
            let t = triangles[(k + j) % n];
            let i = self.corner_at(t, v);
            self.triangles[t as usize][i] = w;
            self.shapes[t as usize].set(None);
        }
        // The triangle after (v, w, next) meets what was beyond the edge from w to next.
        let [next, last] = [(k + 1) % n, (k + n - 1) % n];
        self.join(triangles[next], [w, ring[next]], outer[0]);
        self.join(triangles[(k + n - 2) % n], [w, ring[last]], outer[1]);
        for t in gone {
            pulling.dead[t as usize] = true;
        }
        pulling.at[v as usize] = NONE;
        for t in (1..n - 1).map(|j| triangles[(k + j) % n]) {
            for x in self.triangles[t as usize] {
                pulling.at[x as usize] = t;
            }
        }
    }
    /// The number of the corner of a triangle that a vertex is.
    fn corner_at(&self, t: u32, v: u32) -> usize {
        let mut corners = self.triangles[t as usize].iter();
        corners.position(|&x| x == v).expect("a triangle at v")
    }
    /// Makes neighbours of a triangle and what is beyond its edge between two vertices.
    fn join(&mut self, t: u32, ends: [u32; 2], (n, fixed): Beyond) {
        for (a, b) in [(t, n), (n, t)] {
            if a != NONE {
                let i = (0..3)
                    .find(|&i| !ends.contains(&self.triangles[a as usize][i]))
                    .expect("a corner opposite to the edge");
                self.adjacent[a as usize][i] = b;
                self.fixed[a as usize][i] = fixed || b == NONE;
            }
        }
    }

    /// Whether two vertices have an edge, looked for around the first from one of its triangles on,
    /// both ways.
    fn are_joined(&self, from: u32, w: u32, x: u32) -> bool {
        for step in [1, 2] {
            let mut t = from;
            for _ in 0..MOST_AROUND {
                let v = self.triangles[t as usize];
                if v.contains(&x) {
                    return true;
                }
                let i = v.iter().position(|&y| y == w).expect("a triangle at w");
                t = self.adjacent[t as usize][(i + step) % 3];
                if t == NONE || t == from {
                    break;
                }
            }
        }
        false
    }

    /// Without the triangles that are marked.
    fn remove(&mut self, dead: &[bool]) {
        let kept: Vec<usize> = (0..dead.len()).filter(|&t| !dead[t]).collect();
        let mut new = vec![NONE; dead.len()];
        for (n, &t) in kept.iter().enumerate() {
            new[t] = n as u32;
        }
        let renumbered = |n: u32| if n == NONE { NONE } else { new[n as usize] };
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

/// The elements of a set of two.
fn two(set: &BTreeSet<u32>) -> Option<[u32; 2]> {
    let mut all = set.iter().copied();
    let two = [all.next()?, all.next()?];
    all.next().is_none().then_some(two)
}
