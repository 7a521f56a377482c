//! Whether the mesh has edges along the feature curves and nodes at the corners of the solid.

use super::boxes::BoxTree;
use super::{Defects, Options, Place};
use isoform_control::Control;
use isoform_geom::{Aabb, KdTree, Mesh, Point3, distance_squared, dot, norm, sub};
use rayon::prelude::*;

/// The distance from a curve, as a share of the size of the elements, within which an edge counts
/// as along it. It has to be larger than the chord error of edges on the curve and smaller than the
/// distance of the next edges beside it.
const NEAR: f64 = 0.15;

/// How much of the features a mesh has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Length of the curves.
    pub length: f64,
    /// The share of it that has a feature edge of the mesh within [`Self::tolerance`]; 1 if there
    /// is no curve.
    pub covered: f64,
    /// How near edges must be.
    pub tolerance: f64,
    /// Stretches of curves without an edge: their middles, the value is the length.
    pub uncovered: Defects,
    /// Number of corners.
    pub corners: usize,
    /// The largest distance of a corner to the next corner node of the mesh, or node of the surface
    /// if the mesh lists no corners.
    pub corner_max: f64,
    /// Corners without a node as near as the limit; the value is the distance.
    pub missed_corners: Defects,
}

/// Compares the feature edges and corner nodes of the mesh with the curves and corners of the
/// options. On a stop by `control` some are left out.
pub(super) fn measure(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    size: f64,
    options: &Options<'_>,
    control: &Control<'_>,
) -> Coverage {
    let room = options.places;
    let mut out = Coverage {
        covered: 1.0,
        tolerance: NEAR * size,
        corners: options.corners.len(),
        ..Coverage::default()
    };
    let edges = Edges::new(mesh);
    let stretches: Vec<Stretches> = options
        .curves
        .par_iter()
        .filter(|_| !control.is_stopped())
        .map(|curve| edges.compare(curve, out.tolerance, room))
        .collect();
    let mut found = 0.0;
    for s in stretches {
        out.length += s.length;
        found += s.found;
        out.uncovered.append(room, s.uncovered);
    }
    if out.length > 0.0 {
        out.covered = found / out.length;
    }
    out.look_for_corners(mesh, triangles, options);
    out
}

/// The nodes at which corners are looked for: the corners of the mesh, or all nodes of the surface
/// if it lists none.
fn corner_nodes(mesh: &Mesh, triangles: &[[u32; 3]]) -> Vec<u32> {
    if !mesh.corners.is_empty() {
        return mesh.corners.clone();
    }
    let mut nodes = triangles.as_flattened().to_vec();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

impl Coverage {
    /// Looks for a node at each corner.
    fn look_for_corners(&mut self, mesh: &Mesh, triangles: &[[u32; 3]], options: &Options<'_>) {
        if options.corners.is_empty() {
            return;
        }
        let nodes = corner_nodes(mesh, triangles);
        let at_nodes: Vec<Point3> = nodes.iter().map(|&i| mesh.points[i as usize]).collect();
        let tree = KdTree::new(&at_nodes);
        let limit = options.limits.corner_distance * mesh.bounds().diagonal();
        for &at in options.corners {
            let is_place = at.iter().all(|v| v.is_finite());
            let nearest = is_place.then(|| tree.nearest(at)).flatten();
            let value = nearest.map_or(f64::INFINITY, |(_, squared)| squared.sqrt());
            let far = if value.is_nan() { f64::INFINITY } else { value };
            self.corner_max = self.corner_max.max(far);
            if value.is_nan() || value > limit {
                let nodes = nearest.map(|(k, _)| nodes[k]).into_iter().collect();
                self.missed_corners.add(options.places, || Place {
                    at,
                    nodes,
                    elements: Vec::new(),
                    value,
                });
            }
        }
    }
}

/// The feature edges of a mesh, halved at their mid nodes.
struct Edges {
    /// The ends of each half.
    segments: Vec<[Point3; 2]>,
    /// The tree of the boxes around the segments.
    tree: BoxTree,
}

/// The part of one curve that has edges.
#[derive(Default)]
struct Stretches {
    /// Length of the curve.
    length: f64,
    /// Length of the part with edges.
    found: f64,
    /// The stretches without an edge.
    uncovered: Defects,
}

impl Edges {
    /// Collects the segments of the mesh's feature edges.
    fn new(mesh: &Mesh) -> Self {
        let mut segments = Vec::with_capacity(mesh.edges.len() + mesh.edge_mids.len());
        for (k, e) in mesh.edges.iter().enumerate() {
            let [a, b] = e.map(|i| mesh.points[i as usize]);
            match mesh.edge_mids.get(k).map(|&m| mesh.points[m as usize]) {
                Some(m) => segments.extend([[a, m], [m, b]]),
                None => segments.push([a, b]),
            }
        }
        let boxes: Vec<Aabb> = segments.iter().map(Aabb::of).collect();
        Self {
            tree: BoxTree::new(&boxes),
            segments,
        }
    }

    /// Whether a segment is no farther from the point than the tolerance.
    fn is_near(&self, p: Point3, tolerance: f64) -> bool {
        let around = Aabb {
            lo: p.map(|v| v - tolerance),
            hi: p.map(|v| v + tolerance),
        };
        let mut near = false;
        self.tree.query(&around, |k| {
            near |= distance_to_segment(p, self.segments[k as usize]) <= tolerance
        });
        near
    }

    /// Walks along a curve in steps no longer than the tolerance; each step counts for half by each
    /// of its ends.
    fn compare(&self, curve: &[Point3], tolerance: f64, room: usize) -> Stretches {
        let mut out = Stretches::default();
        let mut bare = Bare::default();
        let mut last: Option<bool> = None;
        for step in curve.windows(2) {
            let length = norm(sub(step[1], step[0]));
            if !length.is_finite() {
                continue;
            }
            let n = parts(length, tolerance);
            for k in usize::from(last.is_some())..=n {
                let s = k as f64 / n as f64;
                let p: Point3 = std::array::from_fn(|i| step[0][i] * (1.0 - s) + step[1][i] * s);
                let near = self.is_near(p, tolerance);
                if let Some(last) = last {
                    let part = length / n as f64;
                    out.length += part;
                    out.found += part * half_by_each(last, near);
                    bare.length += part * half_by_each(!last, !near);
                }
                if near {
                    bare.end(&mut out.uncovered, room);
                } else {
                    bare.points.push(p);
                }
                last = Some(near);
            }
        }
        bare.end(&mut out.uncovered, room);
        out
    }
}

/// The share of a step that counts, half for each end that does.
fn half_by_each(a: bool, b: bool) -> f64 {
    0.5 * (f64::from(u8::from(a)) + f64::from(u8::from(b)))
}

/// Number of parts of a step that are no longer than the tolerance, a million at most: a finer
/// tolerance has no meaning for the curve.
fn parts(length: f64, tolerance: f64) -> usize {
    if tolerance > 0.0 {
        (length / tolerance).ceil().clamp(1.0, 1e6) as usize
    } else {
        1
    }
}

/// The present stretch without edges.
#[derive(Default)]
struct Bare {
    points: Vec<Point3>,
    /// The length of the steps with an end in it.
    length: f64,
}

impl Bare {
    /// Adds the stretch, if it has a point, and begins anew.
    fn end(&mut self, uncovered: &mut Defects, room: usize) {
        if let Some(&at) = self.points.get(self.points.len() / 2) {
            let value = self.length;
            uncovered.add(room, || Place {
                at,
                value,
                ..Place::default()
            });
        }
        self.points.clear();
        self.length = 0.0;
    }
}

/// The distance of a point from a segment.
fn distance_to_segment(p: Point3, [a, b]: [Point3; 2]) -> f64 {
    let e = sub(b, a);
    let s = (dot(sub(p, a), e) / dot(e, e).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    distance_squared(p, std::array::from_fn(|i| a[i] + s * e[i])).sqrt()
}
