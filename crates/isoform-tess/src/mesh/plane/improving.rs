//! Fewer and rounder triangles: vertices that are pulled onto others or moved.

use super::*;
use std::collections::BTreeSet;

/// The sine of the smallest angle below which a triangle is too thin.
const COARSE: f64 = 0.4;
/// That below which vertices are moved: more of this makes triangles rounder, but also more of
/// them.
const THIN_IN_SPACE: f64 = 0.03;
/// How much rounder the thinnest triangle has to get for a vertex to be moved, and the shares of
/// the way that are tried.
const BETTER: f64 = 1.1;
const SHARES: [f64; 3] = [1.0, 0.5, 0.2];
/// How far contracted curves may bulge beyond their chords, per length of these, for vertices to be
/// taken off them: new vertices come to lie between the chord and the curve otherwise.
const STRAIGHT: f64 = 1e-6;

impl Plane {
    /// Pulls vertices of thin triangles onto their neighbours where nothing gets worse. Returns how
    /// many.
    pub(super) fn coarsen(&mut self, measure: &dyn Measure) -> usize {
        let (mut at, free) = self.inner_vertices();
        let mut dead = vec![false; self.triangles.len()];
        let mut done = 0;
        for v in 0..self.nodes.len() as u32 {
            if !free[v as usize] || at[v as usize] == NONE {
                continue;
            }
            let Some((star, ring)) = self.star(at[v as usize], v) else {
                continue;
            };
            let n = star.len();
            let before = star
                .iter()
                .map(|&t| self.look(t, measure).worth)
                .fold(f64::INFINITY, f64::min);
            if !star.iter().all(|&t| self.sound[t as usize]) {
                continue;
            }
            let before = before.min(COARSE);
            let mut order: Vec<usize> = (0..n).collect();
            let far = |k: &usize| distance(self.images[ring[*k] as usize], self.images[v as usize]);
            order.sort_by(|a, b| far(a).total_cmp(&far(b)));
            let target = order.into_iter().take(4).find(|&k| {
                let w = ring[k];
                let corners = |j: usize| [w, ring[(k + j) % n], ring[(k + j + 1) % n]];
                let made: Vec<[u32; 3]> = (1..n - 1).map(corners).collect();
                let mut looks = Vec::new();
                let is_better = made.iter().all(|&t| {
                    let may = self.is_counterclockwise(t)
                        && self.is_thick(t, THIN)
                        && self.least_sine(t) > before;
                    may && {
                        looks.push(self.look_at(t, measure));
                        looks.last().is_some_and(|look| look.worth > before)
                    }
                });
                is_better
                    && (2..n - 1).all(|j| {
                        let x = ring[(k + j) % n];
                        let is_free = !self.have_one_image([w, x]) && !self.is_ambiguous([w, x]);
                        let looks = [looks[j - 2], looks[j - 1]];
                        is_free && self.excess([w, x], looks, measure).0 <= SPLIT
                    })
                    // w has no other way to a vertex of the ring.
                    && !(2..n - 1).any(|j| self.are_joined(at[w as usize], w, ring[(k + j) % n]))
                    && looks.iter().all(|look| self.off(look, measure) <= 1.0)
            });
            let Some(k) = target else { continue };
            self.pull((v, k), (&star, &ring), &mut at, &mut dead);
            done += 1;
        }
        self.remove(&dead);
        done
    }

    /// Moves vertices of thin triangles to where the thinnest around them gets better: towards the
    /// middle of their neighbours, in space or in the parameters. Points that lie nearly on one
    /// line leave no room for flips otherwise. Returns how many.
    pub(super) fn smooth(&mut self, measure: &dyn Measure) -> usize {
        let (at, free) = self.inner_vertices();
        let mut done = 0;
        for v in
            (0..self.nodes.len() as u32).filter(|&v| free[v as usize] && at[v as usize] != NONE)
        {
            let Some((star, ring)) = self.star(at[v as usize], v) else {
                continue;
            };
            let before = star
                .iter()
                .map(|&t| self.look(t, measure).worth)
                .fold(f64::INFINITY, f64::min);
            if before >= THIN_IN_SPACE || !star.iter().all(|&t| self.sound[t as usize]) {
                continue;
            }
            let old = self.nodes[v as usize].at;
            let steps = self.smoothing(v, &ring, measure);
            let mut best: Option<(f64, [f64; 2])> = None;
            for step in steps {
                for share in SHARES {
                    let to = [0, 1].map(|i| old[i] + share * step[i]);
                    self.put(v, to, measure);
                    let least = best.map_or(
                        if before > 0.0 {
                            BETTER * before
                        } else {
                            before + 1e-3
                        },
                        |b| b.0,
                    );
                    let worth = self.least_worth(&star, least, measure);
                    if worth > least {
                        best = Some((worth, to));
                    }
                }
            }
            // How much edges and triangles want to be split.
            let wants = |this: &Self| -> Vec<f64> {
                let n = ring.len();
                let looks: Vec<Look> = star
                    .iter()
                    .map(|&t| this.look_at(this.triangles[t as usize], measure))
                    .collect();
                let spoke = |k: usize| {
                    this.excess([v, ring[k]], [looks[k], looks[(k + n - 1) % n]], measure)
                        .0
                };
                (0..n)
                    .map(spoke)
                    .chain(looks.iter().map(|look| this.off(look, measure)))
                    .collect()
            };
            self.put(v, old, measure);
            let Some((_, to)) = best else { continue };
            let wanted = wants(self);
            self.put(v, to, measure);
            let is_fine = wants(self)
                .iter()
                .zip(&wanted)
                .all(|(new, old)| *new <= old.max(SPLIT))
                && star.iter().all(|&t| measure.is_sound(self.corners(t)));
            if !is_fine {
                self.put(v, old, measure);
                continue;
            }
            for t in star {
                self.looks[t as usize].set(None);
                self.push(t);
            }
            done += 1;
        }
        done
    }
    fn put(&mut self, v: u32, at: [f64; 2], measure: &dyn Measure) {
        self.nodes[v as usize].at = at;
        self.images[v as usize] = measure.image(&self.nodes[v as usize]);
    }
    /// The least worth of triangles; some number up to `enough` if it is no more than that.
    fn least_worth(&self, star: &[u32], enough: f64, measure: &dyn Measure) -> f64 {
        let mut least = f64::INFINITY;
        for &t in star {
            let t = self.triangles[t as usize];
            if !self.is_counterclockwise(t) || !self.is_thick(t, THIN) {
                return f64::NEG_INFINITY;
            }
            least = least.min(self.least_sine(t));
            if least > enough {
                least = least.min(self.look_at(t, measure).worth);
            }
            if least <= enough {
                return least;
            }
        }
        least
    }
    /// Where a vertex might go.
    fn smoothing(&self, v: u32, ring: &[u32], measure: &dyn Measure) -> Vec<[f64; 2]> {
        let from = self.nodes[v as usize].at;
        let share = 1.0 / ring.len() as f64;
        let at = |w: &u32| self.nodes[*w as usize].at;
        let image = |w: &u32| self.images[*w as usize];
        let mean: Point3 = std::array::from_fn(|i| ring.iter().map(|w| share * image(w)[i]).sum());
        let center = [0, 1].map(|i| ring.iter().map(|w| share * at(w)[i]).sum::<f64>() - from[i]);
        measure
            .step(from, mean)
            .into_iter()
            .chain([center])
            .collect()
    }
    /// A triangle at every vertex, and whether it may be moved: what is on no curve.
    fn inner_vertices(&self) -> (Vec<u32>, Vec<bool>) {
        let mut at: Vec<u32> = vec![NONE; self.nodes.len()];
        let mut free: Vec<bool> = (0..self.nodes.len())
            .map(|v| {
                self.nodes[v].name == Name::Inner
                    && self.nodes[v].faces == 0
                    && self.shared[v].is_none()
            })
            .collect();
        for (t, v) in self.triangles.iter().enumerate() {
            for i in 0..3 {
                at[v[i] as usize] = t as u32;
                if self.fixed[t][i] {
                    free[v[(i + 1) % 3] as usize] = false;
                    free[v[(i + 2) % 3] as usize] = false;
                }
            }
        }
        (at, free)
    }

    /// The triangles around a vertex, counterclockwise from one of them on, and the vertices on the
    /// ring: triangle k has the corners v, ring k and ring k + 1. None at borders, and where they
    /// are too many.
    fn star(&self, from: u32, v: u32) -> Option<(Vec<u32>, Vec<u32>)> {
        let (mut star, mut ring) = (Vec::new(), Vec::new());
        let mut t = from;
        while star.first() != Some(&t) {
            if t == NONE || star.len() == 64 {
                return None;
            }
            let i = self.triangles[t as usize].iter().position(|&x| x == v)?;
            star.push(t);
            ring.push(self.triangles[t as usize][(i + 1) % 3]);
            // The neighbour beyond the edge from v to the corner after.
            t = self.adjacent[t as usize][(i + 1) % 3];
        }
        Some((star, ring))
    }

    /// Pulls a vertex onto number k of its ring. `at` holds a triangle at every vertex; triangles
    /// that are gone are marked in `dead`.
    fn pull(
        &mut self,
        (v, k): (u32, usize),
        (star, ring): (&[u32], &[u32]),
        at: &mut [u32],
        dead: &mut [bool],
    ) {
        let n = star.len();
        let w = ring[k];
        // The two triangles between v and w go; the others get w for v.
        let (gone, last) = (star[k], star[(k + n - 1) % n]);
        let outer = |t: u32| {
            let i = self.triangles[t as usize]
                .iter()
                .position(|&x| x == v)
                .expect("a triangle at v");
            (self.adjacent[t as usize][i], self.fixed[t as usize][i])
        };
        let (beyond, beyond_last) = (outer(gone), outer(last));
        for j in 1..n - 1 {
            let t = star[(k + j) % n] as usize;
            let i = self.triangles[t]
                .iter()
                .position(|&x| x == v)
                .expect("a triangle at v");
            self.triangles[t][i] = w;
            self.looks[t].set(None);
        }
        // (v, w, next): the triangle after it meets what was beyond the edge from w to next.
        let join = |this: &mut Self, t: u32, ends: [u32; 2], (n, fixed): (u32, bool)| {
            for (a, b) in [(t, n), (n, t)] {
                if a != NONE {
                    let x = this.triangles[a as usize];
                    let i = (0..3)
                        .find(|&i| !ends.contains(&x[i]))
                        .expect("a corner opposite to the edge");
                    this.adjacent[a as usize][i] = b;
                    this.fixed[a as usize][i] = fixed || b == NONE;
                }
            }
        };
        join(self, star[(k + 1) % n], [w, ring[(k + 1) % n]], beyond);
        join(
            self,
            star[(k + n - 2) % n],
            [w, ring[(k + n - 1) % n]],
            beyond_last,
        );
        for t in [gone, last] {
            dead[t as usize] = true;
        }
        at[v as usize] = NONE;
        for j in 1..n - 1 {
            let t = star[(k + j) % n];
            self.triangles[t as usize]
                .iter()
                .for_each(|&x| at[x as usize] = t);
        }
    }

    /// Takes vertices off contracted curves that are nearer to each other than what leaves the
    /// curve there needs: triangles between such vertices and a far one have two sides that are the
    /// same in space.
    pub(super) fn thin_contracted(&mut self, measure: &dyn Measure) {
        let mut at: Vec<u32> = vec![NONE; self.nodes.len()];
        let mut along: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        for (t, v) in self.triangles.iter().enumerate() {
            for i in 0..3 {
                at[v[i] as usize] = t as u32;
                if self.fixed[t][i] {
                    let (a, b) = (v[(i + 1) % 3], v[(i + 2) % 3]);
                    along.entry(a).or_default().insert(b);
                    along.entry(b).or_default().insert(a);
                }
            }
        }
        let mut dead = vec![false; self.triangles.len()];
        for v in 0..self.nodes.len() as u32 {
            let is_inner =
                self.nodes[v as usize].name == Name::Inner && self.nodes[v as usize].faces == 0;
            let Some(Shared::Contracted(image)) =
                self.shared[v as usize].filter(|_| is_inner && at[v as usize] != NONE)
            else {
                continue;
            };
            let ends: Vec<u32> = along.get(&v).into_iter().flatten().copied().collect();
            let [a, b] = ends[..] else { continue };
            // Vertices beside the new chord have to stay on their side of the curve.
            let [x, y] = [a, b].map(|w| self.nodes[w as usize].at);
            let is_straight = measure.beside_chord([x, y], image).is_some_and(|m| {
                let off = (m[0] - 0.5 * (x[0] + y[0])).hypot(m[1] - 0.5 * (x[1] + y[1]));
                off <= STRAIGHT * (x[0] - y[0]).hypot(x[1] - y[1])
            });
            if !is_straight
                || ![a, b].iter().all(|&w| self.have_one_image([v, w]))
                || measure.turns([a, v, b].map(|w| self.nodes[w as usize].at))
            {
                continue;
            }
            let Some((star, ring)) = self.star(at[v as usize], v) else {
                continue;
            };
            if !star.iter().all(|&t| self.sound[t as usize]) {
                continue;
            }
            let n = ring.len();
            let place = |w: u32| ring.iter().position(|&x| x == w);
            let fits = |k: usize| {
                let made = (1..n - 1).map(|j| [ring[k], ring[(k + j) % n], ring[(k + j + 1) % n]]);
                let is_joined =
                    |j: usize| self.are_joined(at[ring[k] as usize], ring[k], ring[(k + j) % n]);
                made.clone()
                    .all(|t| self.is_counterclockwise(t) && self.is_thick(t, THIN))
                    && !(2..n - 1).any(is_joined)
            };
            let Some(k) = [a, b].into_iter().filter_map(place).find(|&k| fits(k)) else {
                continue;
            };
            let (w, other) = if ring[k] == a { (a, b) } else { (b, a) };
            self.pull((v, k), (&star, &ring), &mut at, &mut dead);
            for (x, y) in [(w, other), (other, w)] {
                if let Some(list) = along.get_mut(&x) {
                    list.remove(&v);
                    list.insert(y);
                }
            }
        }
        self.remove(&dead);
        self.queued.fill(true);
        self.queue = (0..self.triangles.len() as u32).collect();
    }

    /// Whether two vertices have an edge, looked for around the first from one of its triangles on,
    /// both ways.
    fn are_joined(&self, from: u32, w: u32, x: u32) -> bool {
        for step in [1, 2] {
            let mut t = from;
            for _ in 0..64 {
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
        let mut new = vec![NONE; dead.len()];
        let mut n = 0;
        for (t, _) in dead.iter().enumerate().filter(|d| !d.1) {
            new[t] = n;
            n += 1;
        }
        let kept = |t: &usize| !dead[*t];
        self.triangles = (0..dead.len())
            .filter(kept)
            .map(|t| self.triangles[t])
            .collect();
        self.fixed = (0..dead.len())
            .filter(kept)
            .map(|t| self.fixed[t])
            .collect();
        self.looks = (0..dead.len())
            .filter(kept)
            .map(|t| self.looks[t].clone())
            .collect();
        self.sound = (0..dead.len())
            .filter(kept)
            .map(|t| self.sound[t])
            .collect();
        let renumbered =
            |t: usize| self.adjacent[t].map(|n| if n == NONE { NONE } else { new[n as usize] });
        self.adjacent = (0..dead.len()).filter(kept).map(renumbered).collect();
        self.queued = vec![false; n as usize];
        self.queue.clear();
    }
}
