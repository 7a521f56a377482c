//! Edges of a given mesh brought onto those of a solid.
//!
//! Every vertex of the surface is given the pieces that it lies on: those of a corner or curve of
//! the solid if one is near enough to move it there, else those at its nearest point. An edge
//! between vertices without a common piece crosses a curve of the solid and is split there, until
//! there is none; then the vertices of every face have a piece in common, which is its label (the
//! idea of Kobbelt, Botsch, Schwanecke and Seidel, Feature sensitive surface extraction from volume
//! data, 2001, on a mesh that is already there).

use crate::features::{CornerKind, Features};
use crate::points::unique;
use crate::surface::{SKIN, Surface, meet_at_an_angle};
use isoform_geom::{KdTree, Point3, TRIANGLE_EDGES, cross, distance_squared, dot, norm, sub};
use std::collections::HashSet;

/// A surface that can be cut: bare triangles, or the boundary of tetrahedra.
pub(super) trait Cuttable {
    fn points(&self) -> &[Point3];
    /// The triangles, outward.
    fn faces(&self) -> Vec<[u32; 3]>;
    /// Moves a vertex, unless what is around it would turn over or become much worse.
    fn move_to(&mut self, v: u32, p: Point3) -> bool;
    /// Brings a vertex onto the surface, as near as what is around it allows.
    fn settle(&mut self, v: u32, p: Point3);
    /// Splits an edge at a point of it; the new vertex is moved on to `p` if it may be.
    fn split(&mut self, edge: [u32; 2], at: Point3, p: Point3) -> Option<u32>;
}

/// What was found out about a mesh.
pub(super) struct Aligned {
    /// The piece of each face.
    pub(super) labels: Vec<([u32; 3], u32)>,
    /// Where each vertex belongs; inner ones where they are.
    pub(super) places: Vec<Point3>,
    /// Vertices nowhere near the solid's surface.
    pub(super) far: Vec<Point3>,
    /// Places where edges could not be made to follow the solid's.
    pub(super) lost: Vec<Point3>,
    /// Corners of the solid without a vertex.
    pub(super) missed_corners: Vec<Point3>,
    /// The number of corners of the solid.
    pub(super) corners: usize,
}

/// Farthest that a vertex is moved to a corner or a curve of the solid, as a share of the shortest
/// edge of the surface at it. More makes poor triangles, less leaves short edges beside the curve.
const REACH: [f64; 2] = [0.45, 0.3];
/// Farthest that a vertex is moved to the surface, in lengths of the longest edge at it.
const FAR: f64 = 3.0;
/// Share of an edge next to a vertex within which the vertex is moved rather than the edge split.
const WARP: f64 = 0.25;
/// Rounds of splitting: an edge is split once in each, and crosses few curves.
const ROUNDS: usize = 16;
/// Bisections towards the place where an edge crosses a curve: Newton's method does the rest.
const HALVINGS: usize = 30;

pub(super) fn key(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// The edges of triangles, lower vertex first, sorted, each once.
pub(super) fn edges_of(faces: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = faces
        .iter()
        .flat_map(|f| TRIANGLE_EDGES.map(|[i, j]| key(f[i], f[j])))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

pub(super) fn middle(p: [Point3; 3]) -> Point3 {
    std::array::from_fn(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0)
}

fn between(p: Point3, q: Point3, t: f64) -> Point3 {
    std::array::from_fn(|i| p[i] + t * (q[i] - p[i]))
}

fn shared(a: &[u32], b: &[u32]) -> Option<u32> {
    a.iter().copied().find(|i| b.contains(i))
}

/// What an edge between vertices without a common piece crosses.
enum Crossing {
    /// A curve of the solid: the share of the way, and the point of the curve.
    Curve(f64, Point3),
    /// A seam between pieces that touch tangentially.
    Smooth,
    /// Neither was found.
    Unknown,
}

struct Aligner<'a, M> {
    mesh: &'a mut M,
    surface: &'a Surface<'a>,
    /// The pieces that each vertex lies on; none of inner ones.
    on: Vec<Vec<u32>>,
    /// Where each vertex belongs: tetrahedra may not let it go the whole way yet.
    places: Vec<Point3>,
    /// Corners of the solid, with their pieces and whether a vertex is there.
    corners: Vec<(Point3, Vec<u32>, bool)>,
    /// Edges that cross a seam between pieces that touch tangentially.
    smooth: HashSet<[u32; 2]>,
    /// Edges whose crossing was not found.
    given_up: HashSet<[u32; 2]>,
    lost: Vec<Point3>,
}

/// Gives every face the piece that it lies on, with edges along those of the solid.
pub(super) fn align<M: Cuttable>(
    mesh: &mut M,
    surface: &Surface<'_>,
    features: &Features,
) -> Aligned {
    let corners = features
        .corners
        .iter()
        .filter(|c| !matches!(c.kind, CornerKind::Fading | CornerKind::Seam));
    let corners = corners
        .map(|c| (c.point, c.pieces.clone(), false))
        .collect();
    let on = vec![Vec::new(); mesh.points().len()];
    let places = mesh.points().to_vec();
    let mut aligner = Aligner {
        mesh,
        surface,
        on,
        places,
        corners,
        smooth: HashSet::new(),
        given_up: HashSet::new(),
        lost: Vec::new(),
    };
    let far = aligner.place_vertices();
    if far.len() * 4 > aligner.on.len() {
        return Aligned {
            labels: Vec::new(),
            places: Vec::new(),
            far,
            lost: Vec::new(),
            missed_corners: Vec::new(),
            corners: 0,
        };
    }
    for _ in 0..ROUNDS {
        if aligner.split_edges() + aligner.split_faces() == 0 {
            break;
        }
    }
    let labels = aligner.labels();
    let missed = aligner
        .corners
        .iter()
        .filter(|c| !c.2)
        .map(|c| c.0)
        .collect();
    Aligned {
        labels,
        places: aligner.places,
        far,
        lost: aligner.lost,
        missed_corners: missed,
        corners: aligner.corners.len(),
    }
}

impl<M: Cuttable> Aligner<'_, M> {
    fn at(&self, v: u32) -> Point3 {
        self.places[v as usize]
    }

    /// Moves a vertex to a point on the pieces given, if it may go there.
    fn hold(&mut self, v: u32, p: Point3, on: Vec<u32>) -> bool {
        let is_moved = self.mesh.move_to(v, p);
        if is_moved {
            self.places[v as usize] = p;
            self.on[v as usize] = on;
        }
        is_moved
    }

    /// Splits an edge at a share of its length, for a vertex that belongs at `p`.
    fn split(&mut self, [u, v]: [u32; 2], share: f64, p: Point3, on: Vec<u32>) -> bool {
        let [a, b] = [u, v].map(|k| self.mesh.points()[k as usize]);
        let is_split = self.mesh.split([u, v], between(a, b, share), p).is_some();
        if is_split {
            self.places.push(p);
            self.on.push(on);
        }
        is_split
    }

    /// The pieces that bound the solid at a point of its surface.
    fn vanishing(&self, p: Point3) -> Vec<u32> {
        let Some(reduced) = self.surface.lattice.reduced_at(p) else {
            return Vec::new();
        };
        let zero: Vec<u32> = reduced
            .pieces
            .iter()
            .copied()
            .filter(|&i| self.surface.distance(i, p) == 0.0)
            .collect();
        if zero.len() < 2 {
            return zero;
        }
        zero.into_iter()
            .filter(|&i| self.surface.is_face(i, p))
            .collect()
    }

    /// The next point of the surface with its pieces.
    fn nearest(&self, p: Point3) -> Option<(Point3, Vec<u32>)> {
        let q = self.surface.project(&[SKIN], p)?;
        let on = self.vanishing(q);
        (!on.is_empty()).then_some((q, on))
    }

    /// Moves vertices to corners, curves and the surface. Returns those that are near none.
    fn place_vertices(&mut self) -> Vec<Point3> {
        let faces = self.mesh.faces();
        let mut shortest = vec![f64::INFINITY; self.on.len()];
        let mut longest = vec![0.0f64; self.on.len()];
        for e in edges_of(&faces) {
            let l = norm(sub(self.at(e[0]), self.at(e[1])));
            for v in e {
                shortest[v as usize] = shortest[v as usize].min(l);
                longest[v as usize] = longest[v as usize].max(l);
            }
        }
        let vertices = unique(faces.into_iter().flatten().collect());
        let tree = KdTree::new(&vertices.iter().map(|&v| self.at(v)).collect::<Vec<_>>());
        let mut pairs: Vec<(f64, usize, u32)> = self
            .corners
            .iter()
            .enumerate()
            .filter_map(|(k, c)| tree.nearest(c.0).map(|(i, d)| (d.sqrt(), k, vertices[i])))
            .filter(|&(d, _, v)| d < REACH[0] * shortest[v as usize])
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, k, v) in pairs {
            if self.on[v as usize].is_empty()
                && self.hold(v, self.corners[k].0, self.corners[k].1.clone())
            {
                self.corners[k].2 = true;
            }
        }
        // Curves: the nearest vertices first, so that of two on both sides of one the better takes
        // it.
        let mut onto: Vec<(f64, u32, Point3)> = vertices
            .iter()
            .filter(|&&v| self.on[v as usize].is_empty())
            .filter_map(|&v| {
                let p = self.at(v);
                let q = self.curve_near(p, REACH[1] * shortest[v as usize])?;
                Some((norm(sub(p, q)) / shortest[v as usize], v, q))
            })
            .collect();
        onto.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, v, q) in onto {
            let on = self.vanishing(q);
            self.hold(v, q, on);
        }
        let mut far = Vec::new();
        for v in vertices {
            if self.on[v as usize].is_empty() {
                let p = self.at(v);
                match self.nearest(p) {
                    Some((q, on)) if norm(sub(p, q)) <= FAR * longest[v as usize] => {
                        self.mesh.settle(v, q);
                        self.places[v as usize] = q;
                        self.on[v as usize] = on;
                    }
                    _ => far.push(p),
                }
            }
        }
        far
    }

    /// The nearest point of a curve of the solid within reach.
    fn curve_near(&self, p: Point3, reach: f64) -> Option<Point3> {
        let pieces = &self.surface.lattice.reduced_at(p)?.pieces;
        let near: Vec<u32> = pieces
            .iter()
            .copied()
            .filter(|&i| self.surface.distance(i, p).abs() < reach)
            .collect();
        let mut best: Option<(f64, Point3)> = None;
        for (i, &a) in near.iter().enumerate() {
            for &b in &near[..i] {
                let Some(q) = self.surface.project(&[a, b], p) else {
                    continue;
                };
                let d = norm(sub(p, q));
                if d < reach && best.is_none_or(|best| d < best.0) && self.is_on_curve([a, b], q) {
                    best = Some((d, q));
                }
            }
        }
        best.map(|b| b.1)
    }

    fn is_on_curve(&self, pair: [u32; 2], q: Point3) -> bool {
        self.surface.value(q).0.abs() <= 2.0 * self.surface.zero && self.surface.is_edge(pair, q)
    }

    /// Splits edges between vertices without a common piece; returns how many.
    fn split_edges(&mut self) -> usize {
        let mut done = 0;
        for [u, v] in edges_of(&self.mesh.faces()) {
            let apart = shared(&self.on[u as usize], &self.on[v as usize]).is_none();
            if !apart
                || self.on[u as usize].is_empty()
                || self.on[v as usize].is_empty()
                || self.smooth.contains(&[u, v])
                || self.given_up.contains(&[u, v])
            {
                continue;
            }
            let (t, q) = match self.crossing(u, v) {
                Crossing::Curve(t, q) => (t, q),
                Crossing::Smooth => {
                    self.smooth.insert([u, v]);
                    continue;
                }
                Crossing::Unknown => {
                    self.give_up([u, v]);
                    continue;
                }
            };
            let on = self.vanishing(q);
            // A vertex next to the curve is moved there: a split would leave a short edge.
            let close = [(u, t), (v, 1.0 - t)]
                .into_iter()
                .find(|&(k, share)| share < WARP && self.is_free(k));
            if let Some((k, _)) = close
                && shared(&on, &self.on[k as usize]).is_some()
                && self.hold(k, q, on.clone())
            {
                done += 1;
            } else if self.split([u, v], t.clamp(0.02, 0.98), q, on) {
                done += 1;
            } else {
                self.give_up([u, v]);
            }
        }
        done
    }

    fn give_up(&mut self, edge: [u32; 2]) {
        if self.given_up.insert(edge) {
            self.lost
                .push(between(self.at(edge[0]), self.at(edge[1]), 0.5));
        }
    }

    /// Whether a vertex lies on one piece alone.
    fn is_free(&self, v: u32) -> bool {
        let p = self.at(v);
        self.surface.solid.tree().pieces().len() > 1
            && self.on[v as usize].iter().all(|&a| {
                self.on[v as usize]
                    .iter()
                    .all(|&b| a == b || !self.surface.is_edge([a, b], p))
            })
    }

    /// Where an edge crosses a curve of the solid.
    fn crossing(&self, u: u32, v: u32) -> Crossing {
        let (p, q) = (self.at(u), self.at(v));
        let here = &self.on[u as usize];
        let (mut lo, mut hi) = (0.0, 1.0);
        let mut there = self.on[v as usize].clone();
        for _ in 0..HALVINGS {
            let m = 0.5 * (lo + hi);
            let Some((_, on)) = self.nearest(between(p, q, m)) else {
                return Crossing::Unknown;
            };
            if shared(&on, here).is_some() {
                lo = m;
            } else {
                (hi, there) = (m, on);
            }
        }
        let x = between(p, q, 0.5 * (lo + hi));
        let (mut best, mut is_smooth): (Option<(f64, Point3)>, bool) = (None, true);
        for &a in here {
            for &b in &there {
                is_smooth &= !meet_at_an_angle(self.surface.solid, [a, b], x);
                let Some(y) = self.surface.project(&[a, b], x) else {
                    continue;
                };
                let d = norm(sub(x, y));
                if d < norm(sub(p, q))
                    && best.is_none_or(|best| d < best.0)
                    && self.is_on_curve([a, b], y)
                {
                    best = Some((d, y));
                }
            }
        }
        match best {
            Some((_, y)) => {
                let e = sub(q, p);
                Crossing::Curve((dot(sub(y, p), e) / dot(e, e)).clamp(0.0, 1.0), y)
            }
            None if is_smooth => Crossing::Smooth,
            None => Crossing::Unknown,
        }
    }

    /// Splits faces that hold a corner of the solid: their vertices have a piece in common two by
    /// two, but not all three.
    fn split_faces(&mut self) -> usize {
        let mut done = 0;
        for f in self.mesh.faces() {
            let on = f.map(|v| self.on[v as usize].clone());
            let is_split = TRIANGLE_EDGES
                .iter()
                .any(|&[i, j]| self.smooth.contains(&key(f[i], f[j])));
            if is_split
                || on.iter().any(Vec::is_empty)
                || on[0].iter().any(|i| on[1].contains(i) && on[2].contains(i))
            {
                continue;
            }
            if TRIANGLE_EDGES
                .iter()
                .any(|&[i, j]| shared(&on[i], &on[j]).is_none())
            {
                // Split edges around it changed it: it comes again.
                continue;
            }
            let p = f.map(|v| self.at(v));
            let m = middle(p);
            let size = (0..3)
                .map(|i| norm(sub(p[i], p[(i + 1) % 3])))
                .fold(0.0, f64::max);
            let free = self
                .corners
                .iter()
                .enumerate()
                .filter(|(_, c)| !c.2 && distance_squared(c.0, m) < size * size);
            let Some((k, _)) = free
                .min_by(|a, b| distance_squared(a.1.0, m).total_cmp(&distance_squared(b.1.0, m)))
            else {
                continue;
            };
            let c = self.corners[k].0;
            // The edge whose nearest point is nearest to the corner.
            let split = TRIANGLE_EDGES
                .map(|[i, j]| {
                    let e = sub(p[j], p[i]);
                    let t = (dot(sub(c, p[i]), e) / dot(e, e)).clamp(0.1, 0.9);
                    (distance_squared(between(p[i], p[j], t), c), [f[i], f[j]], t)
                })
                .into_iter()
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, edge, share)) = split
                && self.mesh.faces().contains(&f)
                && self.split(edge, share, c, self.corners[k].1.clone())
            {
                self.corners[k].2 = true;
                done += 1;
            }
        }
        done
    }

    /// The piece of each face: one that all its vertices lie on, where several do the one that
    /// bounds the solid at its middle.
    fn labels(&mut self) -> Vec<([u32; 3], u32)> {
        let mut labels = Vec::new();
        for f in self.mesh.faces() {
            let p = f.map(|v| self.at(v));
            let m = middle(p);
            let on = f.map(|v| &self.on[v as usize]);
            let all: Vec<u32> = on[0]
                .iter()
                .copied()
                .filter(|i| on[1].contains(i) && on[2].contains(i))
                .collect();
            let decides = self
                .surface
                .project(&[SKIN], m)
                .map(|q| self.surface.value(q).1);
            let facing = |&i: &u32| {
                let (n, g) = (
                    cross(sub(p[1], p[0]), sub(p[2], p[0])),
                    self.surface.solid.gradient(i, m).1,
                );
                -dot(n, g) / (norm(n) * norm(g)).max(1e-300)
            };
            let label = match (all.as_slice(), decides) {
                (&[one], _) => one,
                (&[], Some(piece)) => {
                    let is_smooth = TRIANGLE_EDGES
                        .iter()
                        .any(|&[i, j]| self.smooth.contains(&key(f[i], f[j])));
                    if !is_smooth && on.iter().all(|on| !on.is_empty()) {
                        self.lost.push(m);
                    }
                    piece
                }
                (all, Some(piece)) if all.contains(&piece) && facing(&piece) > 0.7 => piece,
                (all, decides) => match all
                    .iter()
                    .copied()
                    .max_by(|a, b| facing(a).total_cmp(&facing(b)))
                    .or(decides)
                {
                    Some(piece) => piece,
                    None => {
                        self.lost.push(m);
                        self.surface.solid.tree().pieces()[0]
                    }
                },
            };
            labels.push((f, label));
        }
        labels
    }
}
