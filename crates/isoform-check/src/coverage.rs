//! Coverage of the solid's feature curves by edges of the mesh, and of its corners by nodes.

use super::boxes::BoxTree;
use super::{Defects, Options, Place};
use isoform_control::Control;
use isoform_geom::{Aabb, KdTree, Mesh, Point3, distance_squared, dot, norm, sub};
use rayon::prelude::*;

/// Distance from a curve, in element sizes, within which an edge counts as lying along it. It must
/// exceed the chord error of edges on the curve, and be less than the distance of the neighbouring
/// edges.
const NEAR_CURVE_SIZES: f64 = 0.15;

/// Coverage of the feature curves and corners by a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Coverage {
    /// Total length of the curves, in model units.
    pub length: f64,
    /// Share of that length with a feature edge of the mesh within [`Self::tolerance`]; 1 without
    /// curves.
    pub covered: f64,
    /// Distance within which edges count as covering a curve, in model units.
    pub tolerance: f64,
    /// Stretches of curves without an edge: place is the middle, value the length.
    pub uncovered: Defects,
    /// Number of corners.
    pub corners: usize,
    /// Largest distance of a corner from the nearest corner node of the mesh, or from the nearest
    /// surface node if the mesh lists no corners.
    pub corner_max: f64,
    /// Corners without a node within the limit; the value is the distance.
    pub missed_corners: Defects,
}

/// Compares the feature edges and corner nodes of the mesh with the curves and corners of the
/// options. After a stop by `control` some are left out.
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
        tolerance: NEAR_CURVE_SIZES * size,
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

/// Returns the nodes that may cover corners: the corners of the mesh, or all surface nodes if it
/// lists none.
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
    /// Measures the distance of each corner from the nearest node.
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

/// Feature edges of a mesh, halved at their mid nodes.
struct Edges {
    /// Ends of each half.
    segments: Vec<[Point3; 2]>,
    /// Tree of the boxes around the segments.
    tree: BoxTree,
}

/// Covered and uncovered parts of one curve.
#[derive(Default)]
struct Stretches {
    /// Length of the curve.
    length: f64,
    /// Length of the part with edges.
    found: f64,
    /// Stretches without an edge.
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
        let boxes: Vec<Aabb> = segments.iter().map(Aabb::from_points).collect();
        Self {
            tree: BoxTree::new(&boxes),
            segments,
        }
    }

    /// Returns true if a segment lies within the tolerance of the point.
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

    /// Walks along a curve in steps no longer than the tolerance; each end of a step decides for
    /// half of it.
    fn compare(&self, curve: &[Point3], tolerance: f64, room: usize) -> Stretches {
        let mut out = Stretches::default();
        let mut bare = UncoveredStretch::default();
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

/// Returns the share of a step that counts: one half per end that counts.
fn half_by_each(a: bool, b: bool) -> f64 {
    0.5 * (f64::from(u8::from(a)) + f64::from(u8::from(b)))
}

/// Returns the number of steps, none longer than the tolerance, into which a segment is split; at
/// most 10⁶, since a finer tolerance is meaningless for the curve.
fn parts(length: f64, tolerance: f64) -> usize {
    if tolerance > 0.0 {
        (length / tolerance).ceil().clamp(1.0, 1e6) as usize
    } else {
        1
    }
}

/// Current stretch without edges.
#[derive(Default)]
struct UncoveredStretch {
    points: Vec<Point3>,
    /// Total length of the half steps in it.
    length: f64,
}

impl UncoveredStretch {
    /// Records the stretch if it has a point, and starts a new one.
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

/// Returns the distance of a point from a segment.
fn distance_to_segment(p: Point3, [a, b]: [Point3; 2]) -> f64 {
    let e = sub(b, a);
    let s = (dot(sub(p, a), e) / dot(e, e).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    distance_squared(p, std::array::from_fn(|i| a[i] + s * e[i])).sqrt()
}
