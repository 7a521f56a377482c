//! Better triangles on a solid: splits, collapses, flips and moves that keep every vertex on what
//! holds it.
//!
//! First towards the edge lengths wanted, in rounds of splitting long edges, collapsing short ones,
//! flipping and moving (Botsch and Kobbelt, A remeshing approach to multiresolution modeling,
//! 2004); then only what makes the smallest angle it touches larger.

use super::skin::Skin;
use crate::measure::smallest_sine;
use crate::options::Options;
use crate::points::unique;
use crate::surface::{On, SKIN, Surface, meet_at_an_angle};
use isoform_control::Control;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Edges longer or shorter than these shares of the length wanted are split and collapsed: 4/3 and
/// 4/5 make as many long as short ones (Botsch and Kobbelt); a little apart, so that edges are not
/// split and collapsed in turn.
const BAND: [f64; 2] = [1.4, 0.7];
/// Rounds towards the lengths wanted.
const ROUNDS: usize = 12;
/// Rounds of mending.
const MENDING: usize = 25;
/// Angle below which triangles are mended, degrees.
const GOAL: f64 = 35.0;
/// Smallest sine that a collapse or a move towards the lengths wanted may leave; less where it was
/// less before.
const FAIR: f64 = 0.35;
/// Smallest sine at a vertex from which on it stays where it is.
const GOOD: f64 = 0.62;
/// Least cosine between a face and its piece; a face that was worse may stay but not get worse.
const FACING: f64 = 0.5;
/// Largest sagitta of an edge as a share of its length, and of one on a curve as a share of the
/// size: as in the optimiser of tetrahedra.
const TURN: f64 = 0.08;
/// Least gain of a step of mending, as a sine.
const GAIN: f64 = 1e-4;

/// What holds a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hold {
    Fixed,
    On(On),
}

pub(super) struct Remesher<'s> {
    pub(super) skin: Skin,
    hold: Vec<Hold>,
    surface: &'s Surface<'s>,
    options: &'s Options,
    control: &'s Control<'s>,
}

impl<'s> Remesher<'s> {
    pub(super) fn new(
        skin: Skin,
        surface: &'s Surface<'s>,
        options: &'s Options,
        control: &'s Control<'s>,
    ) -> Self {
        let hold = vec![Hold::Fixed; skin.points.len()];
        let mut this = Self {
            skin,
            hold,
            surface,
            options,
            control,
        };
        for v in 0..this.hold.len() as u32 {
            this.hold[v as usize] = this.holding(v);
        }
        this
    }

    /// What holds a vertex, from the faces around it: the two pieces of the curve that runs through
    /// it, or its piece.
    fn holding(&self, v: u32) -> Hold {
        let labels = unique(
            self.skin.around[v as usize]
                .iter()
                .map(|&f| self.skin.labels[f as usize])
                .collect(),
        );
        if let &[one] = labels.as_slice() {
            // Where the piece is not the surface there, another one that it touches is.
            let p = self.skin.at(v);
            let is_off =
                self.surface.distance(one, p) != 0.0 || self.surface.distance(SKIN, p) != 0.0;
            return Hold::On(On::of(&[if is_off { SKIN } else { one }]));
        }
        let sharp: Vec<[u32; 2]> = self
            .skin
            .neighbours(v)
            .into_iter()
            .filter_map(|w| self.sharp(v, w))
            .collect();
        match sharp.as_slice() {
            [] => Hold::On(On::of(&[SKIN])),
            [a, b] if a == b => Hold::On(On::of(a)),
            _ => Hold::Fixed,
        }
    }

    /// The pieces on both sides of an edge that is one of the solid.
    fn sharp(&self, a: u32, b: u32) -> Option<[u32; 2]> {
        let sides = self.skin.sides(a, b)?.map(|f| self.skin.labels[f as usize]);
        let pieces = [sides[0].min(sides[1]), sides[0].max(sides[1])];
        let (p, q) = (self.skin.at(a), self.skin.at(b));
        let middle = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        (pieces[0] != pieces[1] && meet_at_an_angle(self.surface.solid, pieces, middle))
            .then_some(pieces)
    }

    fn wanted(&self, p: Point3) -> f64 {
        self.options
            .sizes
            .as_ref()
            .map_or(f64::INFINITY, |s| s.at(p))
            .min(self.options.size)
    }

    /// Cosine between a triangle and its piece.
    fn facing(&self, p: [Point3; 3], label: u32) -> f64 {
        let n = cross(sub(p[1], p[0]), sub(p[2], p[0]));
        let g = self.surface.gradient(label, super::align::middle(p)).1;
        -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
    }

    /// Whether a triangle looks away from its piece, and more so than before.
    fn faces_away(&self, old: [Point3; 3], new: [Point3; 3], label: u32) -> bool {
        let facing = self.facing(new, label);
        facing.is_nan() || (facing < FACING && facing < self.facing(old, label))
    }

    /// The middle of an edge on the surface, what holds it, and its sagitta over the one allowed.
    fn middle(&self, a: u32, b: u32) -> Option<(Point3, On, f64)> {
        let sides = self.skin.sides(a, b)?.map(|f| self.skin.labels[f as usize]);
        let on = match self.sharp(a, b) {
            Some(pieces) => On::of(&pieces),
            None if sides[0] == sides[1] && ![a, b].iter().any(|&v| self.is_skin(v)) => {
                On::of(&sides[..1])
            }
            None => On::of(&[SKIN]),
        };
        let (p, q) = (self.skin.at(a), self.skin.at(b));
        let flat: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        let m = self.surface.project(on.slice(), flat)?;
        let (off, length) = (norm(sub(m, flat)), norm(sub(p, q)));
        let curve = if on.len() == 2 {
            TURN * self.wanted(flat)
        } else {
            f64::INFINITY
        };
        let most = (TURN * length)
            .min(self.options.grade.unwrap_or(f64::INFINITY))
            .min(curve);
        (off < 0.5 * length).then_some((m, on, off / most))
    }

    fn is_skin(&self, v: u32) -> bool {
        matches!(self.hold[v as usize], Hold::On(on) if on.contains(SKIN))
    }

    /// All of it: sizes first, then angles.
    pub(super) fn run(&mut self) {
        for round in 0..ROUNDS {
            if self.control.is_stopped() {
                return;
            }
            let mut done = self.split_long(false);
            done += self.collapse_short();
            done += self.flip_all();
            self.relax(round < 2);
            if done * 100 < self.skin.faces.len() {
                break;
            }
        }
        self.mend();
        for _ in 0..6 {
            // Mending may have made edges that leave the surface.
            if self.control.is_stopped() || self.split_long(true) == 0 {
                break;
            }
            self.flip_all();
            self.mend();
        }
    }

    /// Splits edges that are too long or leave the surface too far; only the latter if so asked.
    fn split_long(&mut self, only_far: bool) -> usize {
        let mut found: Vec<(f64, [u32; 2])> = self
            .skin
            .edges()
            .into_iter()
            .filter_map(|[a, b]| {
                let (p, q) = (self.skin.at(a), self.skin.at(b));
                let long = norm(sub(p, q))
                    / self.wanted(std::array::from_fn(|i| 0.5 * (p[i] + q[i])))
                    / BAND[0];
                let (_, _, off) = self.middle(a, b)?;
                let much = if only_far { off } else { off.max(long) };
                (much > 1.0).then_some((much, [a, b]))
            })
            .collect();
        if self.options.grade.is_some() {
            let error = self.options.grade.unwrap_or(f64::INFINITY);
            found.extend(self.skin.live().filter_map(|f| {
                // Faces whose edges are all right but whose middle is not.
                let m = self.skin.middle(f);
                let off = norm(sub(
                    self.surface.project(&[self.skin.labels[f as usize]], m)?,
                    m,
                ));
                let long = self.skin.edges_at(f).into_iter().max_by(|a, b| {
                    self.skin
                        .length(a[0], a[1])
                        .total_cmp(&self.skin.length(b[0], b[1]))
                })?;
                (off > error).then_some((off / error, long))
            }));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut done = 0;
        for (_, [a, b]) in found {
            done += usize::from(self.split(a, b));
        }
        done
    }

    fn split(&mut self, a: u32, b: u32) -> bool {
        let Some((m, on, _)) = self.middle(a, b) else {
            return false;
        };
        let Some(sides) = self.skin.sides(a, b) else {
            return false;
        };
        let is_fair = sides.iter().all(|&f| {
            let (label, before) = (
                self.skin.labels[f as usize],
                self.facing(self.skin.corners(f), self.skin.labels[f as usize]),
            );
            [a, b].iter().all(|&end| {
                let p =
                    self.skin.faces[f as usize].map(|v| if v == end { m } else { self.skin.at(v) });
                smallest_sine(p) > 1e-6 && self.facing(p, label) >= FACING.min(before)
            })
        });
        if is_fair && self.skin.split_at(a, b, m).is_some() {
            self.hold.push(Hold::On(on));
            return true;
        }
        false
    }

    fn collapse_short(&mut self) -> usize {
        let mut short: Vec<(f64, [u32; 2])> = self
            .skin
            .edges()
            .into_iter()
            .filter_map(|[a, b]| {
                let (p, q) = (self.skin.at(a), self.skin.at(b));
                let share =
                    norm(sub(p, q)) / self.wanted(std::array::from_fn(|i| 0.5 * (p[i] + q[i])));
                (share < BAND[1]).then_some((share, [a, b]))
            })
            .collect();
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut done = 0;
        for (_, [a, b]) in short {
            if self.skin.has_edge(a, b) {
                done += usize::from(
                    [(a, b), (b, a)]
                        .into_iter()
                        .any(|(u, w)| self.collapse(u, w, false)),
                );
            }
        }
        done
    }

    /// Moves all of vertex `u` into `w`, if what holds it and the shape of the faces allow it;
    /// where `better` only if the worst angle grows.
    fn collapse(&mut self, u: u32, w: u32, better: bool) -> bool {
        let Hold::On(on) = self.hold[u as usize] else {
            return false;
        };
        let Some(sides) = self.skin.sides(u, w) else {
            return false;
        };
        if on.len() == 2 && self.sharp(u, w).is_none_or(|pieces| On::of(&pieces) != on) {
            return false;
        }
        // Vertices that are neighbours of both must be those of the two faces, else the surface
        // would close upon itself.
        let others = self.skin.neighbours(w);
        let common = self
            .skin
            .neighbours(u)
            .into_iter()
            .filter(|v| others.contains(v))
            .count();
        if common != 2
            || self.skin.around[u as usize].len() < 3
            || sides
                .iter()
                .any(|&f| self.skin.around[self.skin.opposite(f, u, w) as usize].len() <= 3)
        {
            return false;
        }
        let target = self.skin.at(w);
        let before = self.skin.worst_at(u, self.skin.at(u));
        let least = if better {
            before + GAIN
        } else {
            FAIR.min(before)
        };
        let star: Vec<u32> = self.skin.around[u as usize].clone();
        for &f in star.iter().filter(|f| !sides.contains(f)) {
            let old = self.skin.corners(f);
            let new =
                self.skin.faces[f as usize].map(|v| if v == u { target } else { self.skin.at(v) });
            let label = self.skin.labels[f as usize];
            if smallest_sine(new) < least || self.faces_away(old, new, label) {
                return false;
            }
            for v in self.skin.faces[f as usize].into_iter().filter(|&v| v != u) {
                if self.is_too_long(w, v, label) {
                    return false;
                }
            }
        }
        // A curve of the solid must not lose its bend.
        if on.len() == 2 {
            let next = self
                .skin
                .neighbours(u)
                .into_iter()
                .find(|&v| v != w && self.sharp(u, v).is_some());
            if next.is_none_or(|next| self.leaves(w, next, on.slice())) {
                return false;
            }
        }
        let kept: Vec<([u32; 3], u32)> = star
            .iter()
            .filter(|f| !sides.contains(f))
            .map(|&f| {
                (
                    self.skin.faces[f as usize].map(|v| if v == u { w } else { v }),
                    self.skin.labels[f as usize],
                )
            })
            .collect();
        self.skin.replace(&star, &kept);
        true
    }

    /// Whether an edge to come would be split again.
    fn is_too_long(&self, a: u32, b: u32, label: u32) -> bool {
        let (p, q) = (self.skin.at(a), self.skin.at(b));
        let m = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        norm(sub(p, q)) > BAND[0] * self.wanted(m)
            || self.leaves(
                a,
                b,
                &[if [a, b].iter().any(|&v| self.is_skin(v)) {
                    SKIN
                } else {
                    label
                }],
            )
    }

    /// Whether an edge between the vertices would leave the pieces too far.
    fn leaves(&self, a: u32, b: u32, on: &[u32]) -> bool {
        let (p, q) = (self.skin.at(a), self.skin.at(b));
        let flat: Point3 = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        let length = norm(sub(p, q));
        let curve = if on.len() == 2 {
            TURN * self.wanted(flat)
        } else {
            f64::INFINITY
        };
        let most = (TURN * length)
            .min(self.options.grade.unwrap_or(f64::INFINITY))
            .min(curve);
        self.surface
            .project(on, flat)
            .is_none_or(|m| norm(sub(m, flat)) > most)
    }

    /// Flips edges wherever that makes the smallest angle of the two faces larger.
    fn flip_all(&mut self) -> usize {
        let mut total = 0;
        for _ in 0..6 {
            let done = self
                .skin
                .edges()
                .into_iter()
                .filter(|&[a, b]| self.flip(a, b))
                .count();
            total += done;
            if done == 0 {
                break;
            }
        }
        total
    }

    fn flip(&mut self, a: u32, b: u32) -> bool {
        let Some([l, r]) = self.skin.sides(a, b) else {
            return false;
        };
        let (c, d) = (self.skin.opposite(l, a, b), self.skin.opposite(r, a, b));
        let labels = [l, r].map(|f| self.skin.labels[f as usize]);
        // Within one part only: across the seam of two that touch it would be for neither.
        if labels[0] != labels[1]
            || c == d
            || self.skin.has_edge(c, d)
            || [a, b]
                .iter()
                .any(|&v| self.skin.around[v as usize].len() <= 3)
        {
            return false;
        }
        let old = [l, r].map(|f| self.skin.corners(f));
        let new = [[c, a, d], [d, b, c]];
        let at = new.map(|f| f.map(|v| self.skin.at(v)));
        let worst = |p: &[[Point3; 3]; 2]| {
            p.iter()
                .map(|&p| smallest_sine(p))
                .fold(f64::INFINITY, f64::min)
        };
        let facing = |p: &[[Point3; 3]; 2]| {
            p.iter()
                .map(|&p| self.facing(p, labels[0]))
                .fold(f64::INFINITY, f64::min)
        };
        let before = facing(&old);
        // Folded faces are unfolded whatever their angles.
        let is_better = worst(&at) > worst(&old) + GAIN || (before < 0.0 && facing(&at) > 0.0);
        if !is_better || facing(&at) < FACING.min(before) {
            return false;
        }
        let on = if [c, d].iter().any(|&v| self.is_skin(v)) {
            SKIN
        } else {
            labels[0]
        };
        if self.leaves(c, d, &[on]) && !self.leaves(a, b, &[on]) {
            return false;
        }
        self.skin.replace(&[l, r], &new.map(|f| (f, labels[0])));
        true
    }

    /// Moves every vertex towards the middle of its neighbours, within what holds it. `freely` also
    /// where angles suffer.
    fn relax(&mut self, freely: bool) {
        for _ in 0..if freely { 3 } else { 2 } {
            for v in 0..self.skin.points.len() as u32 {
                let Hold::On(on) = self.hold[v as usize] else {
                    continue;
                };
                if self.skin.around[v as usize].is_empty() {
                    continue;
                }
                let before = self.skin.worst_at(v, self.skin.at(v));
                if !freely && before > GOOD {
                    continue;
                }
                let neighbours = self.skin.neighbours(v);
                let along: Vec<u32> = match on.len() {
                    2 => neighbours
                        .into_iter()
                        .filter(|&w| self.sharp(v, w).is_some())
                        .collect(),
                    _ => neighbours,
                };
                if along.is_empty() {
                    continue;
                }
                let n = along.len() as f64;
                let mean: Point3 = std::array::from_fn(|i| {
                    along.iter().map(|&w| self.skin.at(w)[i]).sum::<f64>() / n
                });
                let p = self.skin.at(v);
                let target = std::array::from_fn(|i| p[i] + 0.7 * (mean[i] - p[i]));
                let least = if freely {
                    0.5 * before.min(FAIR)
                } else {
                    before.min(FAIR)
                };
                self.try_place(v, on, target, least);
            }
        }
    }

    /// Moves a vertex to the point of what holds it next to `target`, if all around stays right and
    /// no sine falls below `least`.
    fn try_place(&mut self, v: u32, on: On, target: Point3, least: f64) -> bool {
        let Some(q) = self.surface.project(on.slice(), target) else {
            return false;
        };
        let p = self.skin.at(v);
        let reach = self.skin.around[v as usize]
            .iter()
            .flat_map(|&f| self.skin.faces[f as usize])
            .map(|w| self.skin.length(v, w))
            .fold(0.0, f64::max);
        if self.skin.worst_at(v, q) < least || norm(sub(p, q)) > reach {
            return false;
        }
        let is_right = on
            .slice()
            .iter()
            .all(|&i| self.surface.distance(i, q) == 0.0)
            && self.surface.distance(SKIN, q) == 0.0;
        let faces = || {
            self.skin
                .star_with(v, q)
                .map(|(f, new)| (self.skin.corners(f), new, self.skin.labels[f as usize]))
        };
        if !is_right || faces().any(|(old, new, label)| self.faces_away(old, new, label)) {
            return false;
        }
        self.skin.points[v as usize] = q;
        true
    }

    /// Makes the worst triangles better until there is none below the goal or nothing helps.
    fn mend(&mut self) {
        let goal = GOAL.to_radians().sin();
        for round in 0..MENDING {
            if self.control.is_stopped() {
                return;
            }
            let mut bad: Vec<(f64, u32)> = self
                .skin
                .live()
                .map(|f| (smallest_sine(self.skin.corners(f)), f))
                .filter(|b| b.0 < goal)
                .collect();
            bad.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut done = 0;
            for (_, f) in bad {
                if self.skin.is_there(f) && smallest_sine(self.skin.corners(f)) < goal {
                    done += usize::from(self.mend_one(f, round >= 3));
                }
            }
            if done == 0 && round >= 3 {
                return;
            }
        }
    }

    fn mend_one(&mut self, f: u32, insertions: bool) -> bool {
        let mut edges = self.skin.edges_at(f);
        edges.sort_by(|a, b| {
            self.skin
                .length(b[0], b[1])
                .total_cmp(&self.skin.length(a[0], a[1]))
        });
        if edges.into_iter().any(|[a, b]| self.flip(a, b)) {
            return true;
        }
        if edges
            .into_iter()
            .rev()
            .any(|[a, b]| self.collapse(a, b, true) || self.collapse(b, a, true))
        {
            return true;
        }
        let vertices = self.skin.faces[f as usize];
        if vertices.map(|v| self.nudge(v)).contains(&true) {
            return true;
        }
        insertions && self.insert(edges[0])
    }

    /// Looks around a vertex for a better place: along its curve, or in eight directions, in ever
    /// shorter steps.
    fn nudge(&mut self, v: u32) -> bool {
        let Hold::On(on) = self.hold[v as usize] else {
            return false;
        };
        let p = self.skin.at(v);
        let shortest = self
            .skin
            .neighbours(v)
            .into_iter()
            .map(|w| self.skin.length(v, w))
            .fold(f64::INFINITY, f64::min);
        let g: Vec<Point3> = on
            .slice()
            .iter()
            .map(|&i| self.surface.gradient(i, p).1)
            .collect();
        let unit = |v: Point3| v.map(|x| x / norm(v).max(1e-300));
        let (a, b) = match g.as_slice() {
            [n] => {
                let axis = (0..3)
                    .min_by(|&i, &j| n[i].abs().total_cmp(&n[j].abs()))
                    .unwrap_or(0);
                let a = unit(cross(
                    *n,
                    std::array::from_fn(|i| f64::from(u8::from(i == axis))),
                ));
                (a, unit(cross(*n, a)))
            }
            [m, n] => (unit(cross(*m, *n)), [0.0; 3]),
            _ => return false,
        };
        let (mut step, mut moved) = (0.4 * shortest.max(0.2 * self.wanted(p)), false);
        while step > 0.01 * shortest {
            let p = self.skin.at(v);
            let before = self.skin.worst_at(v, p);
            let better = (0..8).any(|k| {
                let (s, c) = (0.25 * std::f64::consts::PI * f64::from(k)).sin_cos();
                let target = std::array::from_fn(|i| p[i] + step * (c * a[i] + s * b[i]));
                self.try_place(v, on, target, before + GAIN)
            });
            moved |= better;
            if !better {
                step *= 0.5;
            }
        }
        moved
    }

    /// Splits an edge and flips around the new vertex; kept if the worst angle grows.
    fn insert(&mut self, [a, b]: [u32; 2]) -> bool {
        let Some(sides) = self.skin.sides(a, b) else {
            return false;
        };
        let before = sides
            .iter()
            .map(|&f| smallest_sine(self.skin.corners(f)))
            .fold(f64::INFINITY, f64::min);
        let m = self.skin.points.len() as u32;
        if !self.split(a, b) {
            return false;
        }
        self.nudge(m);
        if self.skin.worst_at(m, self.skin.at(m)) > before + GAIN {
            return true;
        }
        // Back again: the two faces on each side become one.
        let star = self.skin.around[m as usize].clone();
        let faces: Vec<([u32; 3], u32)> = star
            .iter()
            .filter(|&&f| self.skin.faces[f as usize].contains(&a))
            .map(|&f| {
                (
                    self.skin.faces[f as usize].map(|v| if v == m { b } else { v }),
                    self.skin.labels[f as usize],
                )
            })
            .collect();
        self.skin.replace(&star, &faces);
        false
    }

    /// Vertices that are not where they belong.
    pub(super) fn off(&self) -> Vec<Point3> {
        (0..self.skin.points.len() as u32)
            .filter(|&v| {
                !self.skin.around[v as usize].is_empty()
                    && self.surface.distance(SKIN, self.skin.at(v)).abs() > 2.0 * self.surface.zero
            })
            .map(|v| self.skin.at(v))
            .collect()
    }
}
