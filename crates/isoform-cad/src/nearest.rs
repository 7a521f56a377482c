//! Nearest points of the exact faces and edges.
//!
//! The nearest point of a face is a foot on its surface within its loops, or a point of its edges.
//! Triangles and pieces of edges that may be nearer than what is known are starts of searches; on
//! surfaces with a formula all feet are known at once.

use crate::chart::Chart;
use crate::prepared::PreparedShape;
use crate::tree::{Item, ItemKind};
use isoform_geom::cad::{CadCurve, Edge};
use isoform_geom::{Point3, cross, distance_squared, distance_to_segment, dot, norm, sub};

/// Share of an edge from its end within which a point counts as the vertex.
const VERTEX_SHARE: f64 = 1e-9;

/// Nearest point of a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPoint {
    /// Point.
    pub point: Point3,
    /// Distance from it.
    pub distance: f64,
    /// Place of the point.
    pub place: Feature,
}

/// Place of a nearest point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feature {
    /// Interior of a face, with parameters of its surface.
    Face(u32, [f64; 2]),
    /// Point of an edge, with its share.
    Edge(u32, f64),
}

struct Search<'a> {
    shape: &'a PreparedShape,
    p: Point3,
    best: NearestPoint,
    /// Faces and edges whose feet are all known.
    faces: Vec<u32>,
    edges: Vec<u32>,
}

/// Ratio of the derivatives by the parameters below which a point is a pole: rounding errors of
/// splines are smaller.
const POLE_SHARE: f64 = 1e-9;

impl PreparedShape {
    /// Returns the nearest point of the faces; `None` if none is finite.
    pub fn nearest(&self, p: Point3) -> Option<NearestPoint> {
        self.nearest_within(p, f64::INFINITY)
    }

    /// Returns the nearest point of the faces within a distance from `p`.
    pub fn nearest_within(&self, p: Point3, limit: f64) -> Option<NearestPoint> {
        let mut search = Search {
            shape: self,
            p,
            best: NearestPoint {
                point: p,
                distance: limit,
                place: Feature::Edge(u32::MAX, 0.0),
            },
            faces: Vec::new(),
            edges: Vec::new(),
        };
        self.tree.search(p, limit, |item| search.visit(item));
        let found = search.best;
        (found.place != Feature::Edge(u32::MAX, 0.0)).then_some(found)
    }

    /// Returns the distance from the faces, negative within the solids; `None` if the shape has
    /// surfaces without an inside, or if no distance is finite.
    pub fn signed_distance(&self, p: Point3) -> Option<f64> {
        if self.solids.iter().any(Option::is_none) {
            return None;
        }
        let near = self.nearest(p)?;
        // Beyond the triangles' deviation they tell the side.
        let is_inside = if near.distance > self.reach {
            self.winding(p) > 0.5
        } else {
            dot(sub(p, near.point), self.normal(&near)) < 0.0
        };
        Some(if is_inside {
            -near.distance
        } else {
            near.distance
        })
    }

    /// Returns the outward normal at a nearest point: on an edge or at a vertex the sum over the
    /// faces there.
    fn normal(&self, near: &NearestPoint) -> Point3 {
        let of_face = |f: u32, at: [f64; 2]| {
            let n = self.faces[f as usize].face.chart.surface.at(at).normal();
            let sign = if self.shape.faces[f as usize].agrees {
                1.0
            } else {
                -1.0
            };
            let length = norm(n);
            n.map(|v| if length > 0.0 { sign * v / length } else { 0.0 })
        };
        let (edge, share) = match near.place {
            Feature::Face(f, at) => return of_face(f, at),
            Feature::Edge(edge, share) => (edge, share),
        };
        let ends = self.shape.edges[edge as usize].ends;
        let vertex = match share {
            s if s < VERTEX_SHARE => Some(ends[0]),
            s if s > 1.0 - VERTEX_SHARE => Some(ends[1]),
            _ => None,
        };
        let mut sum = [0.0; 3];
        for (f, face) in self.faces.iter().enumerate() {
            for piece in face.face.loops.iter().flat_map(|l| &l.pieces) {
                let n = match (piece.edge, vertex) {
                    (Some(_), Some(v)) if piece.nodes[0] == v => {
                        let n = of_face(f as u32, piece.at[0]);
                        let angle = self.angle_at(f, piece.nodes[0]);
                        n.map(|c| c * angle)
                    }
                    (Some(e), None) if e == edge => {
                        let [a, b] = piece.shares;
                        if share < a.min(b) || share > a.max(b) {
                            continue;
                        }
                        let at = crate::loops::blend(piece.at, (share - a) / (b - a));
                        let at = face.face.place_on(&self.shape.edges[e as usize], share, at);
                        of_face(f as u32, at)
                    }
                    _ => continue,
                };
                (0..3).for_each(|k| sum[k] += n[k]);
            }
        }
        sum
    }

    /// Returns the angle of a face at a vertex: that of its triangles.
    fn angle_at(&self, face: usize, vertex: u32) -> f64 {
        let mut sum = 0.0;
        let triangles = self.facets.triangles.iter().zip(&self.facets.face_of);
        for (t, _) in triangles.filter(|(_, f)| **f as usize == face) {
            for k in 0..3 {
                if t[k] == vertex {
                    let at = |i: usize| self.facets.points[t[i % 3] as usize];
                    let (a, b) = (sub(at(k + 1), at(k)), sub(at(k + 2), at(k)));
                    sum += norm(cross(a, b)).atan2(dot(a, b));
                }
            }
        }
        sum
    }

    /// Returns the winding number of the triangles around a point (A. van Oosterom and J. Strackee,
    /// IEEE Trans. Biomed. Eng. 30, 1983).
    pub fn winding(&self, p: Point3) -> f64 {
        let mut sum = 0.0;
        for t in &self.facets.triangles {
            let [a, b, c] = t.map(|v| sub(self.facets.points[v as usize], p));
            let [x, y, z] = [norm(a), norm(b), norm(c)];
            let below = x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y;
            sum += 2.0 * dot(a, cross(b, c)).atan2(below);
        }
        sum / (4.0 * std::f64::consts::PI)
    }
}

impl Search<'_> {
    fn visit(&mut self, item: &Item) -> f64 {
        match item.kind {
            ItemKind::Triangle(t) => self.visit_triangle(t, item.reach),
            ItemKind::Piece(edge, node) => self.visit_piece(edge, node as usize, item.reach),
        }
        self.best.distance
    }

    fn visit_triangle(&mut self, t: u32, reach: f64) {
        let facets = &self.shape.facets;
        let f = facets.face_of[t as usize];
        let face = &self.shape.faces[f as usize];
        let chart = &face.face.chart;
        if self.faces.contains(&f) {
            return;
        }
        let corners = facets.triangles[t as usize].map(|v| facets.points[v as usize]);
        let (near, weights) = nearest_on_triangle(self.p, corners);
        if norm(sub(self.p, near)) - reach > self.best.distance {
            return;
        }
        if let Some(feet) = chart.surface.feet(self.p) {
            self.faces.push(f);
            for at in feet {
                self.try_face(f, chart.clamped(at));
            }
            return;
        }
        let places = facets.places[t as usize];
        let start = [0, 1].map(|k| (0..3).map(|i| weights[i] * places[i][k]).sum());
        self.try_face(f, chart.newton(self.p, start));
        // At a pole one parameter has any value: the search begins at the other corners.
        if places.iter().any(|at| is_pole(chart, *at)) {
            for at in places.iter().filter(|at| !is_pole(chart, **at)) {
                self.try_face(f, chart.newton(self.p, *at));
            }
        }
    }

    fn try_face(&mut self, f: u32, at: [f64; 2]) {
        let face = &self.shape.faces[f as usize];
        let point = face.face.chart.surface.at(at).p;
        let distance = norm(sub(self.p, point));
        if distance < self.best.distance && face.holds(&self.shape.shape, at) {
            self.best = NearestPoint {
                point,
                distance,
                place: Feature::Face(f, at),
            };
        }
    }

    fn visit_piece(&mut self, e: u32, node: usize, reach: f64) {
        if self.edges.contains(&e) {
            return;
        }
        let along = &self.shape.divided.along[e as usize];
        let ends = [along[node], along[node + 1]];
        let points = ends.map(|n| self.shape.divided.points[n.1 as usize]);
        if distance_to_segment(self.p, points) - reach > self.best.distance {
            return;
        }
        let edge = &self.shape.shape.edges[e as usize];
        if let Some(shares) = feet(edge, self.p) {
            self.edges.push(e);
            for share in shares {
                self.try_edge(e, share);
            }
            return;
        }
        let start = (0..=4).map(|k| ends[0].0 + (ends[1].0 - ends[0].0) * f64::from(k) / 4.0);
        let far = |s: &f64| distance_squared(edge.at(*s)[0], self.p);
        let start = start.min_by(|a, b| far(a).total_cmp(&far(b)));
        let share = polished(edge, self.p, start.unwrap_or(0.0));
        self.try_edge(e, share);
    }

    fn try_edge(&mut self, e: u32, share: f64) {
        let point = self.shape.shape.edges[e as usize].at(share)[0];
        let distance = norm(sub(self.p, point));
        if distance < self.best.distance {
            self.best = NearestPoint {
                point,
                distance,
                place: Feature::Edge(e, share),
            };
        }
    }
}

/// Returns true if a parameter has no effect on the point of the surface.
fn is_pole(chart: &Chart, at: [f64; 2]) -> bool {
    let jet = chart.surface.at(at);
    let [u, v] = [norm(jet.u), norm(jet.v)];
    u.min(v) <= POLE_SHARE * u.max(v)
}

/// Returns the shares of an edge at which it may be nearest to a point, for curves with a formula.
fn feet(edge: &Edge, p: Point3) -> Option<Vec<f64>> {
    let [from, to] = edge.range;
    let share = |t: f64| ((t - from) / (to - from)).clamp(0.0, 1.0);
    match edge.curve {
        CadCurve::Line(..) if from == to => Some(vec![0.0]),
        CadCurve::Line(..) => Some(vec![share(edge.curve.parameter(p))]),
        CadCurve::Circle(..) => {
            let turn = std::f64::consts::TAU;
            let angle = edge.curve.parameter(p);
            let lo = from.min(to);
            let nearest = lo + (angle - lo).rem_euclid(turn);
            Some(vec![share(nearest), 0.0, 1.0])
        }
        _ => None,
    }
}

/// Returns the share at which an edge is locally nearest to a point.
fn polished(edge: &Edge, p: Point3, from: f64) -> f64 {
    let t = edge
        .curve
        .polished_within(p, edge.parameter(from), edge.range);
    ((t - edge.range[0]) / (edge.range[1] - edge.range[0])).clamp(0.0, 1.0)
}

/// Returns the point of a triangle that is nearest to `p`, with its barycentric coordinates.
pub fn nearest_on_triangle(p: Point3, t: [Point3; 3]) -> (Point3, [f64; 3]) {
    let (ab, ac, ap) = (sub(t[1], t[0]), sub(t[2], t[0]), sub(p, t[0]));
    let (a, b, c) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
    let (d, e) = (dot(ap, ab), dot(ap, ac));
    let det = a * c - b * b;
    let inner = [(c * d - b * e) / det, (a * e - b * d) / det];
    let is_inside = inner[0] >= 0.0 && inner[1] >= 0.0 && inner[0] + inner[1] <= 1.0;
    let weights = if is_inside {
        [1.0 - inner[0] - inner[1], inner[0], inner[1]]
    } else {
        nearest_side(p, t)
    };
    let point = std::array::from_fn(|k| (0..3).map(|i| weights[i] * t[i][k]).sum());
    (point, weights)
}

/// Returns the barycentric coordinates of the point of a triangle's sides nearest to `p`.
fn nearest_side(p: Point3, t: [Point3; 3]) -> [f64; 3] {
    let mut best = (f64::INFINITY, [1.0, 0.0, 0.0]);
    for k in 0..3 {
        let (a, b) = (t[k], t[(k + 1) % 3]);
        let (d, e) = (sub(b, a), sub(p, a));
        let length = dot(d, d);
        let s = if length > 0.0 {
            (dot(d, e) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let at: Point3 = std::array::from_fn(|i| a[i] + s * d[i]);
        let far = distance_squared(at, p);
        if far < best.0 {
            let mut weights = [0.0; 3];
            weights[k] = 1.0 - s;
            weights[(k + 1) % 3] = s;
            best = (far, weights);
        }
    }
    best.1
}
