//! A triangulation of a part of the parameter plane, refined and flipped by what its triangles are
//! in space.
//!
//! A Delaunay triangulation of the parameters is of no use where the map stretches directions
//! differently, as it does around base points without bound: triangles have to be long in the
//! parameters to be round in space.

use super::geometry::{distance, longest, middle};
use super::names::{Name, Node};
use crate::surface::Point3;
use isoform_control::Control;
use isoform_geom::{cross, dot, norm, sub};
use robust::{Coord, orient2d};
use std::cell::Cell;
use std::collections::{BTreeMap, VecDeque};

mod flipping;
mod improving;
mod inserting;

pub(super) const NONE: u32 = u32::MAX;

/// What edges and triangles have to be like.
pub(super) trait Measure {
    /// The image of a node.
    fn image(&self, node: &Node) -> Point3;
    /// What it shares with other nodes.
    fn shared(&self, node: &Node) -> Option<Shared>;
    /// The value of the map.
    fn at(&self, at: [f64; 2]) -> Point3;
    /// The point of a contracted curve beside the middle of a chord of it, with this image.
    fn beside_chord(&self, chord: [[f64; 2]; 2], image: usize) -> Option<[f64; 2]>;
    /// Whether the surface leaves a contracted curve in directions that are far from each other at
    /// three places of it.
    fn turns(&self, at: [[f64; 2]; 3]) -> bool;
    /// The step in the parameters that brings the image nearest to a point, to first order.
    fn step(&self, at: [f64; 2], to: Point3) -> Option<[f64; 2]>;
    /// The derivatives by the parameters.
    fn tangents(&self, at: [f64; 2]) -> [Point3; 2];
    /// Whether the pole curve is proved to miss a triangle.
    fn is_sound(&self, at: [[f64; 2]; 3]) -> bool;
    /// The largest distance from the surface, near to a point.
    fn tolerance(&self, near: Point3) -> f64;
    fn longest(&self) -> f64;
}

/// An image that several parameters have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shared {
    /// Of a contracted curve.
    Contracted(usize),
    /// A point of the double curve.
    Double(usize),
}

/// How refinement ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ended {
    /// Triangles on which the sign of W is not proved.
    pub(super) unsound: usize,
    /// Triangles that are not near enough to the surface.
    pub(super) coarse: usize,
    /// Edges that fall together in space.
    pub(super) clashes: usize,
}

#[derive(Default)]
pub(super) struct Plane {
    pub(super) nodes: Vec<Node>,
    images: Vec<Point3>,
    shared: Vec<Option<Shared>>,
    /// Counterclockwise.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Neighbours opposite to the corners.
    adjacent: Vec<[u32; 3]>,
    /// Whether the edges opposite to the corners stay.
    fixed: Vec<[bool; 3]>,
    /// What [`Self::look_at`] says of them, once it is asked.
    looks: Vec<Cell<Option<Look>>>,
    /// Whether the pole curve is proved to miss them.
    sound: Vec<bool>,
    /// Edges beyond which triangles are made at the end, from the lesser vertex to the greater, and
    /// the vertices that they were split in.
    rim: BTreeMap<[u32; 2], Option<u32>>,
    queued: Vec<bool>,
    queue: VecDeque<u32>,
    ended: Ended,
}

/// A triangle seen in space.
#[derive(Clone, Copy, Debug)]
struct Look {
    corners: [u32; 3],
    /// The sine of its smallest angle; below zero if it does not face the way the surface does, or
    /// has another area.
    worth: f64,
    /// Whether the parameters are even on it: what is in the middle there is about in the middle in
    /// space.
    is_even: bool,
    /// The cosine of the angle between the normals of the triangle and of the surface in its
    /// middle.
    facing: f64,
}

/// Two triangles (c, a, b) and (d, b, a).
struct Quad {
    /// c, a, d, b: counterclockwise.
    corners: [u32; 4],
    /// The second triangle.
    n: u32,
    /// Beyond the edges c a, a d, d b, b c: the triangle, and whether the edge is fixed.
    outer: [(u32, bool); 4],
}

/// The sine of the smallest angle of a triangle; negative if it has no area or no position.
fn least_sine([p, q, r]: [Point3; 3]) -> f64 {
    let (x, y, z) = (sub(q, p), sub(r, q), sub(p, r));
    let [mut a, mut b, c] = [x, y, z].map(|e| dot(e, e));
    // The smallest angle is between the two longer edges.
    let shortest = a.min(b).min(c);
    if shortest == a {
        a = c;
    } else if shortest == b {
        b = c;
    }
    let twice = cross(x, y);
    let sine = (dot(twice, twice) / (a * b)).sqrt();
    if sine.is_nan() || shortest == 0.0 {
        -1.0
    } else {
        sine
    }
}

/// The cosine of the angle between the normals of a triangle and of the surface in its middle, and
/// the share of the smaller of their areas in the larger; 1 where the surface has no normal.
fn facing([a, b, c]: [[f64; 2]; 3], [p, q, r]: [Point3; 3], measure: &dyn Measure) -> [f64; 2] {
    let [x, y] = measure.tangents([0, 1].map(|i| (a[i] + b[i] + c[i]) / 3.0));
    let normal = cross(x, y);
    let own = cross(sub(q, p), sub(r, p));
    let (n, m) = (norm(own), norm(normal));
    let area = m * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    let (cosine, share) = (dot(own, normal) / (n * m), (n / area).min(area / n));
    [cosine, share].map(|x| if x.is_nan() { 1.0 } else { x })
}

/// Whether a triangle does not face the way the surface does, or has another area.
pub(super) fn is_turned(at: [[f64; 2]; 3], images: [Point3; 3], measure: &dyn Measure) -> bool {
    let [facing, share] = facing(at, images, measure);
    facing < FACING || share < SHARE
}

/// The shares of the corners of a triangle, of either orientation, in a point.
fn shares(z: [f64; 2], [a, b, c]: [[f64; 2]; 3]) -> [f64; 3] {
    let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let whole = area(a, b, c);
    [area(b, c, z), area(c, a, z), area(a, b, z)].map(|x| x / whole)
}

/// From given parameters, others in `within` with an image that is nearer to a point, if that is
/// farther than the tolerance; and the distance.
fn nearest(
    mut at: [f64; 2],
    to: Point3,
    within: &dyn Fn([f64; 2]) -> bool,
    measure: &dyn Measure,
) -> ([f64; 2], f64) {
    let mut error = distance(measure.at(at), to);
    for _ in 0..NEARER {
        if error <= measure.tolerance(to) {
            break;
        }
        let Some(step) = measure.step(at, to) else {
            break;
        };
        let better = [1.0, 0.5, 0.25].into_iter().find_map(|share| {
            let next = [0, 1].map(|i| at[i] + share * step[i]);
            let off = distance(measure.at(next), to);
            (within(next) && off < error).then_some((next, off))
        });
        let Some(better) = better else { break };
        let is_enough = better.1 > 0.7 * error;
        (at, error) = better;
        if is_enough {
            break;
        }
    }
    (at, error)
}

/// Steps towards the nearest parameters, and how far they stay from the ends of an edge or the
/// corners of a triangle, in shares.
const NEARER: usize = 3;
const MARGIN: f64 = 0.25;
/// How near to the corners beside it an edge is not split, per length.
const CROWDED: f64 = 0.25;
/// Rounds of improvement.
const IMPROVEMENTS: usize = 4;
/// Rounds in which edges are split that fall together in space.
const CLASHES: usize = 12;
/// How much an edge wants to be split whose ends, or the corners opposite to it, have one image:
/// the surface would be closed up there.
const PINCHED: f64 = 1.5;
/// Least area of flipped triangles in the parameters, per square of their longest edge.
const THIN: f64 = 1e-11;
/// Least cosine between the normals of a triangle and of the surface, and the shortest edges, per
/// longest allowed, of triangles that are split for it: where the surface has a cusp no size is
/// small enough.
const FACING: f64 = 0.3;
/// Least share of the smaller of the areas of a triangle and of what it stands for in the larger:
/// points of the parameters that lie nearly on a line may be a fine triangle in space, but one that
/// stands for nothing.
const SHARE: f64 = 0.2;
/// That above which the parameters are even on it.
const EVEN: f64 = 0.5;
/// That below which it stands for nothing, and is made by no flip, and what it is worth.
const EMPTY: f64 = 0.02;
const NOTHING: f64 = -2.0;
const LEAST: f64 = 0.01;
/// Least area in the parameters, per square of the longest edge, of triangles that are split
/// because they face a wrong way.
const TURNED: f64 = 1e-6;
/// How far from an edge towards the larger triangle beside it it is split: points on one line would
/// leave no room for flips.
const ASIDE: [f64; 2] = [0.1, 0.02];
/// How far contracted curves may bulge beyond their chords, per height of the triangles beside
/// them.
const BULGE: f64 = 0.2;
/// An edge wants to be split when its number is above 1.
const SPLIT: f64 = 1.0;

impl Plane {
    /// From counterclockwise triangles; edges that only one of them has, and those in `fixed`,
    /// stay, but those of the rim may be split.
    pub(super) fn new(
        nodes: Vec<Node>,
        triangles: Vec<[u32; 3]>,
        fixed: &dyn Fn(u32, u32) -> bool,
        rim: &[[u32; 2]],
        measure: &dyn Measure,
    ) -> Self {
        let mut sides: BTreeMap<(u32, u32), (u32, usize)> = BTreeMap::new();
        for (k, t) in triangles.iter().enumerate() {
            for i in 0..3 {
                sides.insert((t[(i + 1) % 3], t[(i + 2) % 3]), (k as u32, i));
            }
        }
        let neighbour = |t: &[u32; 3], i: usize| {
            sides
                .get(&(t[(i + 2) % 3], t[(i + 1) % 3]))
                .map_or(NONE, |s| s.0)
        };
        let adjacent: Vec<[u32; 3]> = triangles
            .iter()
            .map(|t| [0, 1, 2].map(|i| neighbour(t, i)))
            .collect();
        let stays = |(t, n): (&[u32; 3], &[u32; 3])| {
            [0, 1, 2].map(|i| n[i] == NONE || fixed(t[(i + 1) % 3], t[(i + 2) % 3]))
        };
        let fixed = triangles.iter().zip(&adjacent).map(stays).collect();
        let images = nodes.iter().map(|n| measure.image(n)).collect();
        let shared = nodes.iter().map(|n| measure.shared(n)).collect();
        let looks = vec![Cell::new(None); triangles.len()];
        let sound = triangles
            .iter()
            .map(|t| measure.is_sound(t.map(|v| nodes[v as usize].at)))
            .collect();
        let rim = rim
            .iter()
            .map(|&[a, b]| ([a.min(b), a.max(b)], None))
            .collect();
        let queued = vec![true; triangles.len()];
        let queue = (0..triangles.len() as u32).collect();
        Self {
            nodes,
            images,
            shared,
            triangles,
            adjacent,
            fixed,
            looks,
            sound,
            rim,
            queued,
            queue,
            ended: Ended::default(),
        }
    }

    fn corners(&self, t: u32) -> [[f64; 2]; 3] {
        self.triangles[t as usize].map(|v| self.nodes[v as usize].at)
    }
    fn images_of(&self, t: u32) -> [Point3; 3] {
        self.triangles[t as usize].map(|v| self.images[v as usize])
    }
    fn least_sine(&self, t: [u32; 3]) -> f64 {
        least_sine(t.map(|v| self.images[v as usize]))
    }
    fn look_at(&self, t: [u32; 3], measure: &dyn Measure) -> Look {
        let [facing, share] = facing(
            t.map(|v| self.nodes[v as usize].at),
            t.map(|v| self.images[v as usize]),
            measure,
        );
        let worst = (facing - FACING).min(share - SHARE);
        let worth = match worst {
            _ if share < EMPTY => NOTHING,
            _ if worst < 0.0 => worst,
            _ => self.least_sine(t),
        };
        Look {
            corners: t,
            worth,
            is_even: facing > FACING && share > EVEN,
            facing,
        }
    }
    /// That of a triangle that is there, computed once.
    fn look(&self, t: u32, measure: &dyn Measure) -> Look {
        let known = self.looks[t as usize].get();
        known.unwrap_or_else(|| {
            let look = self.look_at(self.triangles[t as usize], measure);
            self.looks[t as usize].set(Some(look));
            look
        })
    }
    fn is_counterclockwise(&self, t: [u32; 3]) -> bool {
        let [a, b, c] = t.map(|v| {
            let [x, y] = self.nodes[v as usize].at;
            Coord { x, y }
        });
        orient2d(a, b, c) > 0.0
    }
    fn is_thick(&self, t: [u32; 3], least: f64) -> bool {
        let [a, b, c] = t.map(|v| self.nodes[v as usize].at);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        let long = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
        area > least * long(a, b).max(long(b, c)).max(long(c, a))
    }
    fn push(&mut self, t: u32) {
        if !self.queued[t as usize] {
            self.queued[t as usize] = true;
            self.queue.push_back(t);
        }
    }
    /// How much the edge between two vertices wants to be split, and where: in the middle of its
    /// parameters, or, if they are even, at those of the triangles beside it whose image is nearest
    /// to the middle of the edge.
    fn excess(
        &self,
        [a, b]: [u32; 2],
        beside: [Look; 2],
        measure: &dyn Measure,
    ) -> (f64, [f64; 2]) {
        let [x, y] = [a, b].map(|v| self.nodes[v as usize].at);
        let [p, q] = [a, b].map(|v| self.images[v as usize]);
        let from = [0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])];
        let is_even = beside.iter().all(|look| look.is_even);
        let within = |z: [f64; 2]| {
            is_even
                && beside.iter().any(|look| {
                    let shares = shares(z, look.corners.map(|v| self.nodes[v as usize].at));
                    let is_end = |k: usize| [a, b].contains(&look.corners[k]);
                    (0..3).all(|k| {
                        if is_end(k) {
                            shares[k] >= MARGIN
                        } else {
                            (0.0..=MARGIN).contains(&shares[k])
                        }
                    })
                })
        };
        let chord = middle(p, q);
        let (at, error) = nearest(from, chord, &within, measure);
        let excess = (error / measure.tolerance(chord)).max(distance(p, q) / measure.longest());
        (
            if error.is_nan() {
                f64::INFINITY
            } else {
                excess
            },
            at,
        )
    }
    /// How far the middle of a triangle is from the surface, in tolerances.
    fn off(&self, look: &Look, measure: &dyn Measure) -> f64 {
        let at = look.corners.map(|v| self.nodes[v as usize].at);
        let [p, q, r] = look.corners.map(|v| self.images[v as usize]);
        let from = [0, 1].map(|i| (at[0][i] + at[1][i] + at[2][i]) / 3.0);
        let center = std::array::from_fn(|i| (p[i] + q[i] + r[i]) / 3.0);
        let within = |z: [f64; 2]| look.is_even && shares(z, at).iter().all(|&s| s >= 0.5 * MARGIN);
        nearest(from, center, &within, measure).1 / measure.tolerance(center)
    }
    fn have_one_image(&self, [a, b]: [u32; 2]) -> bool {
        self.shared[a as usize].is_some() && self.shared[a as usize] == self.shared[b as usize]
    }
    /// Whether both ends are on the double curve, or one has a shared image and the other is on a
    /// side of the unit triangle: another sheet, or the unit triangle beyond the side, may have
    /// such an edge, too.
    fn is_ambiguous(&self, [a, b]: [u32; 2]) -> bool {
        let is_double = |v: u32| matches!(self.shared[v as usize], Some(Shared::Double(_)));
        let is_side = |v: u32| {
            self.shared[v as usize].is_none() && self.nodes[v as usize].name != Name::Inner
        };
        let is_shared = |v: u32| self.shared[v as usize].is_some();
        is_double(a) && is_double(b) || is_side(a) && is_shared(b) || is_side(b) && is_shared(a)
    }
    /// Where the edge opposite to corner i is to be split, because it is a chord of a contracted
    /// curve that leaves the triangle too little room: what lies between the chord and the curve is
    /// turned over.
    fn bulge(&self, t: u32, i: usize, measure: &dyn Measure) -> Option<([f64; 2], usize)> {
        let v = self.triangles[t as usize];
        let (a, b) = (v[(i + 1) % 3], v[(i + 2) % 3]);
        let is_inner = self.fixed[t as usize][i] && self.adjacent[t as usize][i] != NONE;
        let Some(Shared::Contracted(image)) =
            self.shared[a as usize].filter(|_| is_inner && self.have_one_image([a, b]))
        else {
            return None;
        };
        let [x, y, z] = [a, b, v[i]].map(|v| self.nodes[v as usize].at);
        let m = measure.beside_chord([x, y], image)?;
        let above =
            |z: [f64; 2]| ((y[0] - x[0]) * (z[1] - x[1]) - (y[1] - x[1]) * (z[0] - x[0])).abs();
        (above(m) > BULGE * above(z)).then_some((m, image))
    }
    /// The length in the parameters of the edge opposite to corner i.
    fn length(&self, t: u32, i: usize) -> f64 {
        let at = self.corners(t);
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        (at[j][0] - at[k][0]).hypot(at[j][1] - at[k][1])
    }
    fn place(&self, t: u32, neighbour: u32) -> usize {
        self.adjacent[t as usize]
            .iter()
            .position(|&n| n == neighbour)
            .expect("neighbours know each other")
    }

    /// Splits edges until all triangles are near the surface and W keeps its sign on them, or there
    /// are too many: then some are left waiting.
    pub(super) fn begin(&mut self, most: usize, measure: &dyn Measure, control: &Control<'_>) {
        self.thin_contracted(measure);
        self.legalise_all(measure);
        self.work_off(most, true, measure, control);
    }
    /// Whether triangles are left to be split.
    pub(super) fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }
    /// Goes on with what was begun, with more triangles, makes them rounder, and tells edges apart
    /// that fall together.
    pub(super) fn refine(
        &mut self,
        most: usize,
        measure: &dyn Measure,
        control: &Control<'_>,
    ) -> Ended {
        self.work_off(most, false, measure, control);
        for _ in 0..IMPROVEMENTS {
            if self.ended != Ended::default() || self.coarsen(measure) + self.smooth(measure) == 0 {
                break;
            }
            self.legalise_all(measure);
            self.work_off(most, false, measure, control);
        }
        self.tell_apart(most, measure, control)
    }
    /// Splits edges that fall together in space.
    fn tell_apart(&mut self, most: usize, measure: &dyn Measure, control: &Control<'_>) -> Ended {
        for _ in 0..CLASHES {
            let clashes = self.clashes();
            if clashes.is_empty() || self.ended != Ended::default() {
                break;
            }
            self.split_all(clashes, measure);
            self.work_off(most, false, measure, control);
        }
        Ended {
            clashes: self.clashes().len(),
            ..self.ended
        }
    }
    /// Splits edges by their ends, in the order of a triangle that has them.
    fn split_all(&mut self, edges: Vec<[u32; 2]>, measure: &dyn Measure) {
        for [a, b] in edges {
            let edge = (0..self.triangles.len() as u32).find_map(|t| {
                let v = self.triangles[t as usize];
                (0..3)
                    .find(|&i| [v[(i + 1) % 3], v[(i + 2) % 3]] == [a, b])
                    .map(|i| (t, i))
            });
            if let Some((t, i)) = edge.filter(|&(t, i)| !self.fixed[t as usize][i]) {
                self.split_edge(t, i, measure);
            }
        }
    }
    /// The vertices that were put between the ends of an edge of the rim.
    pub(super) fn way(&self, [a, b]: [u32; 2]) -> Vec<u32> {
        let Some(&Some(m)) = self.rim.get(&[a.min(b), a.max(b)]) else {
            return Vec::new();
        };
        let mut way = self.way([a, m]);
        way.push(m);
        way.extend(self.way([m, b]));
        way
    }
    fn is_rim(&self, t: u32, i: usize) -> bool {
        let v = self.triangles[t as usize];
        let (a, b) = (v[(i + 1) % 3], v[(i + 2) % 3]);
        self.rim.get(&[a.min(b), a.max(b)]) == Some(&None)
    }
    /// Splits an edge of the rim opposite to corner i. False if rounding leaves no room.
    fn split_rim(&mut self, t: u32, i: usize, measure: &dyn Measure) -> bool {
        let v = self.triangles[t as usize];
        let [a, b] = [v[(i + 1) % 3], v[(i + 2) % 3]];
        let [x, y] = [a, b].map(|v| self.nodes[v as usize].at);
        let middle = Node::inner([0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])], 0);
        let Some(m) = self.split_border(t, i, middle, measure) else {
            return false;
        };
        self.rim.insert([a.min(b), a.max(b)], Some(m));
        self.rim.extend([[a, m], [b, m]].map(|e| (e, None)));
        true
    }
    /// Splits an edge that only one triangle has, opposite to corner i, in a new vertex, which is
    /// returned. None if that leaves no room.
    fn split_border(&mut self, t: u32, i: usize, node: Node, measure: &dyn Measure) -> Option<u32> {
        let v = self.triangles[t as usize];
        let [c, a, b] = [v[i], v[(i + 1) % 3], v[(i + 2) % 3]];
        let m = self.add_node(node, measure);
        if ![[c, a, m], [c, m, b]]
            .iter()
            .all(|&t| self.is_counterclockwise(t))
        {
            self.drop_last();
            return None;
        }
        let beyond = |k: usize| {
            (
                self.adjacent[t as usize][(i + k) % 3],
                self.fixed[t as usize][(i + k) % 3],
            )
        };
        let (ca, bc) = (beyond(2), beyond(1));
        let t2 = self.new_triangle();
        self.set(t, [c, a, m], [NONE, t2, ca.0], [true, false, ca.1]);
        self.set(t2, [c, m, b], [NONE, bc.0, t], [true, bc.1, false]);
        self.prove([t], [t, t2], measure);
        for k in [t, t2] {
            self.push(k);
        }
        self.legalise([t, t2].map(|k| (k, m)).to_vec(), measure);
        Some(m)
    }

    /// Edges from a vertex to two others that have one image, which would be one edge with four
    /// triangles in space.
    fn clashes(&self) -> Vec<[u32; 2]> {
        // The neighbours of each vertex with a shared image, and those that the edge between them
        // and the next around the vertex joins.
        let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let mut beside: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
        for t in &self.triangles {
            for i in 0..3 {
                let (c, a, b) = (t[i], t[(i + 1) % 3], t[(i + 2) % 3]);
                // Between points of the double curve, edges of it may do so, and others are split
                // anyway.
                if matches!(self.shared[c as usize], Some(Shared::Double(_))) {
                    continue;
                }
                for v in [a, b] {
                    if self.shared[v as usize].is_some() {
                        let list = around.entry(c).or_default();
                        if !list.contains(&v) {
                            list.push(v);
                        }
                    }
                }
                if self.have_one_image([a, b]) {
                    beside.entry(c).or_default().push([a, b]);
                }
            }
        }
        let mut found = Vec::new();
        for (c, list) in around {
            for (k, &v) in list.iter().enumerate() {
                let same = |u: u32| self.have_one_image([u, v]);
                let joined = |u: u32, v: u32| {
                    beside
                        .get(&c)
                        .is_some_and(|b| b.contains(&[u, v]) || b.contains(&[v, u]))
                };
                if list[..k].iter().any(|&u| same(u) && !joined(u, v))
                    && !self.have_one_image([c, v])
                {
                    let others: Vec<u32> = list[..k]
                        .iter()
                        .copied()
                        .filter(|&u| same(u))
                        .chain([v])
                        .collect();
                    // Through a chain of joined ones the surface is closed up as it should be.
                    let mut reached = vec![others[0]];
                    let next = |reached: &[u32]| {
                        let near =
                            |u: u32| !reached.contains(&u) && reached.iter().any(|&r| joined(u, r));
                        others.iter().copied().find(|&u| near(u))
                    };
                    while let Some(next) = next(&reached) {
                        reached.push(next);
                    }
                    if !reached.contains(&v) {
                        found.extend(others.iter().flat_map(|&u| [[c, u], [u, c]]));
                    }
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Splits what is queued. Where there are too many triangles already, it waits, or is given up.
    fn work_off(&mut self, most: usize, waits: bool, measure: &dyn Measure, control: &Control<'_>) {
        let mut steps = 0usize;
        let mut late = false;
        while let Some(t) = self.queue.pop_front() {
            self.queued[t as usize] = false;
            steps += 1;
            late |= steps.is_multiple_of(256) && control.is_stopped();
            let v = self.triangles[t as usize];
            if self.triangles.len() + 4 <= most
                && let Some((i, (at, image))) =
                    (0..3).find_map(|i| Some((i, self.bulge(t, i, measure)?)))
                && self.split_at(
                    t,
                    i,
                    Node {
                        image: Some(image),
                        ..Node::inner(at, 0)
                    },
                    measure,
                )
            {
                continue;
            }
            let mut worst: Option<(f64, usize)> = None;
            for i in (0..3).filter(|&i| !self.fixed[t as usize][i]) {
                let (a, b) = (v[(i + 1) % 3], v[(i + 2) % 3]);
                let n = self.adjacent[t as usize][i];
                let far = self.triangles[n as usize][self.place(n, t)];
                let mut excess = self
                    .excess([a, b], [t, n].map(|t| self.look(t, measure)), measure)
                    .0;
                if self.have_one_image([a, b]) || self.is_ambiguous([a, b]) {
                    excess = excess.max(PINCHED);
                }
                if worst.is_none_or(|w| excess > w.0) {
                    worst = Some((excess, i));
                }
                // Splitting that edge would leave two that are as bad: one that leads to the
                // corner.
                let beside = [(i + 1) % 3, (i + 2) % 3]
                    .into_iter()
                    .filter(|&k| !self.fixed[t as usize][k]);
                if self.have_one_image([v[i], far])
                    && worst.is_none_or(|w| w.0 < PINCHED)
                    && let Some(k) =
                        beside.max_by(|&j, &k| self.length(t, j).total_cmp(&self.length(t, k)))
                {
                    worst = Some((PINCHED, k));
                }
            }
            let sound = self.sound[t as usize];
            let mut only_turned = false;
            let mut split = worst.filter(|w| w.0 > SPLIT).map(|w| Some(w.1));
            if split.is_none() {
                let p = self.images_of(t);
                let look = self.look(t, measure);
                let off = self.off(&look, measure);
                let is_far = off > 1.0 || off.is_nan();
                let is_turned = || {
                    longest(p) > LEAST * measure.longest()
                        && self.is_thick(v, TURNED)
                        && look.facing < FACING
                };
                only_turned = sound && !is_far;
                if !sound || is_far || is_turned() {
                    // The longest edge: of the parameters for the sign, in space for the distance.
                    let length = |i: usize| {
                        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                        if sound {
                            distance(p[j], p[k])
                        } else {
                            self.length(t, i)
                        }
                    };
                    let free = (0..3).filter(|&i| !self.fixed[t as usize][i] || self.is_rim(t, i));
                    split = Some(free.max_by(|&i, &j| length(i).total_cmp(&length(j))));
                }
            }
            let Some(edge) = split else { continue };
            let is_full = self.triangles.len() + 4 > most || steps > 20 * most || late;
            if is_full && waits {
                self.queue.push_front(t);
                self.queued[t as usize] = true;
                return;
            }
            let done = !is_full
                && match edge {
                    Some(i) if self.fixed[t as usize][i] => self.split_rim(t, i, measure),
                    Some(i) => self.split_edge(t, i, measure),
                    None => self.split_triangle(t, measure),
                };
            if !done {
                // One that only faces a wrong way is as near to the surface as asked for.
                self.ended.unsound += usize::from(!sound);
                self.ended.coarse += usize::from(sound && (is_full || !only_turned));
            }
        }
    }

    fn add(&mut self, at: [f64; 2], measure: &dyn Measure) -> u32 {
        self.add_node(Node::inner(at, 0), measure)
    }
    fn add_node(&mut self, node: Node, measure: &dyn Measure) -> u32 {
        self.images.push(measure.image(&node));
        self.shared.push(measure.shared(&node));
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }
    fn drop_last(&mut self) {
        self.nodes.pop();
        self.images.pop();
        self.shared.pop();
    }
    /// Sets a triangle anew: corners, neighbours, fixed edges; the neighbours learn of it.
    fn set(&mut self, t: u32, v: [u32; 3], n: [u32; 3], fixed: [bool; 3]) {
        self.triangles[t as usize] = v;
        self.adjacent[t as usize] = n;
        self.fixed[t as usize] = fixed;
        self.looks[t as usize].set(None);
        for (i, &n) in n.iter().enumerate() {
            if n != NONE {
                // The edge from the other side.
                let (a, b) = (v[(i + 1) % 3], v[(i + 2) % 3]);
                let other = self.triangles[n as usize];
                if let Some(j) =
                    (0..3).find(|&j| other[(j + 1) % 3] == b && other[(j + 2) % 3] == a)
                {
                    self.adjacent[n as usize][j] = t;
                }
            }
        }
    }
    fn new_triangle(&mut self) -> u32 {
        self.triangles.push([0; 3]);
        self.adjacent.push([NONE; 3]);
        self.fixed.push([false; 3]);
        self.looks.push(Cell::new(None));
        self.sound.push(false);
        self.queued.push(false);
        self.triangles.len() as u32 - 1
    }

    /// The two triangles at the edge opposite to corner i of one of them.
    fn quad(&self, t: u32, i: usize) -> Quad {
        let n = self.adjacent[t as usize][i];
        let j = self.place(n, t);
        let corner = |t: u32, k: usize| self.triangles[t as usize][k % 3];
        let beyond = |t: u32, k: usize| {
            (
                self.adjacent[t as usize][k % 3],
                self.fixed[t as usize][k % 3],
            )
        };
        Quad {
            corners: [
                corner(t, i),
                corner(t, i + 1),
                corner(n, j),
                corner(t, i + 2),
            ],
            n,
            outer: [
                beyond(t, i + 2),
                beyond(n, j + 1),
                beyond(n, j + 2),
                beyond(t, i + 1),
            ],
        }
    }

    /// Proves that the pole curve misses new triangles: they lie where old ones were, and the first
    /// of either have the same numbers.
    fn prove<const N: usize, const M: usize>(
        &mut self,
        old: [u32; N],
        new: [u32; M],
        measure: &dyn Measure,
    ) {
        if old.iter().all(|&t| self.sound[t as usize]) {
            new.iter().for_each(|&t| self.sound[t as usize] = true);
        } else {
            new.iter()
                .for_each(|&t| self.sound[t as usize] = measure.is_sound(self.corners(t)));
        }
    }

    /// Splits the edge opposite to corner i, in the middle if there is room. False if rounding
    /// leaves no room.
    fn split_edge(&mut self, t: u32, i: usize, measure: &dyn Measure) -> bool {
        let Quad {
            corners: [c, a, d, b],
            n,
            ..
        } = self.quad(t, i);
        let [x, y] = [a, b].map(|v| self.nodes[v as usize].at);
        let [p, q] = [c, d].map(|v| self.nodes[v as usize].at);
        let area =
            |z: [f64; 2]| ((y[0] - x[0]) * (z[1] - x[1]) - (y[1] - x[1]) * (z[0] - x[0])).abs();
        let toward = if area(p) > area(q) { p } else { q };
        let made = |m: u32| [[c, a, m], [c, m, b], [d, b, m], [d, m, a]];
        let halfway = [0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])];
        let mut best = self
            .excess([a, b], [t, n].map(|t| self.look(t, measure)), measure)
            .1;
        // Not where a corner beside the edge is already.
        let [c_image, d_image, a_image, b_image] = [c, d, a, b].map(|v| self.images[v as usize]);
        let there = measure.at(best);
        if distance(there, c_image).min(distance(there, d_image))
            < CROWDED * distance(a_image, b_image)
        {
            best = halfway;
        }
        let places = [
            (best, ASIDE[0]),
            (halfway, ASIDE[0]),
            (halfway, ASIDE[1]),
            (halfway, 0.0),
        ]
        .map(|(from, aside)| [0, 1].map(|i| from[i] * (1.0 - aside) + aside * toward[i]));
        // The first where there is room, if one is where no triangle stands for nothing, that.
        let mut fitting = None;
        for at in places {
            let m = self.add(at, measure);
            let fits = made(m).iter().all(|&t| self.is_counterclockwise(t));
            let is_good = fits
                && made(m)
                    .iter()
                    .all(|&t| self.look_at(t, measure).worth > NOTHING);
            self.drop_last();
            if is_good || fits && fitting.is_none() {
                fitting = Some(at);
            }
            if is_good {
                break;
            }
        }
        fitting.is_some_and(|at| self.split_at(t, i, Node::inner(at, 0), measure))
    }

    /// Splits the edge opposite to corner i in a new vertex; what was fixed stays so. False if that
    /// leaves no room.
    fn split_at(&mut self, t: u32, i: usize, node: Node, measure: &dyn Measure) -> bool {
        let along = self.fixed[t as usize][i];
        let Quad {
            corners: [c, a, d, b],
            n,
            outer: [ca, ad, db, bc],
        } = self.quad(t, i);
        let m = self.add_node(node, measure);
        let made = [[c, a, m], [c, m, b], [d, b, m], [d, m, a]];
        if !made.iter().all(|&t| self.is_counterclockwise(t)) {
            self.drop_last();
            return false;
        }
        let (t2, n2) = (self.new_triangle(), self.new_triangle());
        // (c, a, m): opposite c: n2 (a m); opposite a: t2 (m c); opposite m: the edge c a.
        self.set(t, made[0], [n2, t2, ca.0], [along, false, ca.1]);
        self.set(t2, made[1], [n, bc.0, t], [along, bc.1, false]);
        self.set(n, made[2], [t2, n2, db.0], [along, false, db.1]);
        self.set(n2, made[3], [t, ad.0, n], [along, ad.1, false]);
        self.prove([t, n], [t, t2, n, n2], measure);
        for k in [t, t2, n, n2] {
            self.push(k);
        }
        self.legalise([t, t2, n, n2].map(|k| (k, m)).to_vec(), measure);
        true
    }

    /// Puts a vertex into the middle of a triangle.
    fn split_triangle(&mut self, t: u32, measure: &dyn Measure) -> bool {
        let at = self.corners(t);
        let middle = [0, 1].map(|i| (at[0][i] + at[1][i] + at[2][i]) / 3.0);
        self.put_into(t, middle, measure)
    }

    /// Puts a vertex into a triangle. False if rounding leaves no room.
    fn put_into(&mut self, t: u32, at: [f64; 2], measure: &dyn Measure) -> bool {
        let [a, b, c] = self.triangles[t as usize];
        let m = self.add(at, measure);
        let made = [[m, b, c], [m, c, a], [m, a, b]];
        if !made.iter().all(|&t| self.is_counterclockwise(t)) {
            self.drop_last();
            return false;
        }
        let (n, f) = (self.adjacent[t as usize], self.fixed[t as usize]);
        let (t2, t3) = (self.new_triangle(), self.new_triangle());
        self.set(t, made[0], [n[0], t2, t3], [f[0], false, false]);
        self.set(t2, made[1], [n[1], t3, t], [f[1], false, false]);
        self.set(t3, made[2], [n[2], t, t2], [f[2], false, false]);
        self.prove([t], [t, t2, t3], measure);
        for k in [t, t2, t3] {
            self.push(k);
        }
        self.legalise([t, t2, t3].map(|k| (k, m)).to_vec(), measure);
        true
    }
}
