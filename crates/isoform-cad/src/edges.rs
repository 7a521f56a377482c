//! Division of edges, once for all faces that share them.

use isoform_geom::cad::{CadCurve, Edge, Shape};
use isoform_geom::{Point3, distance_to_segment, dot, norm, sub};
use std::collections::BTreeMap;

/// Number of points of a piece of an edge that are compared with its chord.
const PROBES_PER_PIECE: usize = 7;
/// Maximum number of nodes on edges.
const MAX_EDGE_NODES: usize = 1 << 22;
/// Maximum number of halvings of a piece.
const MAX_HALVINGS: usize = 14;
/// Cosine of the maximum turn of a piece of an edge: 30°.
const MIN_TURN_COSINE: f64 = 0.866;

/// Size of triangles.
#[derive(Clone, Copy, Debug)]
pub struct FacetOptions {
    /// Maximum distance of edges from their chords, in model units; that of faces is about equal.
    pub chord: f64,
    /// Approximate length of the longest edge of a triangle along an edge of the shape; infinite
    /// for no limit.
    pub longest: f64,
}

/// Shares of each edge from 0 to 1, with the indices of the nodes there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Divided {
    /// Nodes: the vertices, then those on edges.
    pub(crate) points: Vec<Point3>,
    pub(crate) along: Vec<Vec<(f64, u32)>>,
}

/// Divides all edges; `None` if they need more than [`MAX_EDGE_NODES`].
pub(crate) fn divide(shape: &Shape, options: &FacetOptions) -> Option<Divided> {
    let node_of = merged(shape);
    let mut made = Divided {
        points: shape.vertices.clone(),
        along: Vec::with_capacity(shape.edges.len()),
    };
    for edge in &shape.edges {
        let mut all = vec![0.0];
        for piece in coarse(edge).windows(2) {
            halve(edge, [piece[0], piece[1]], MAX_HALVINGS, options, &mut all);
        }
        let end = all.len() - 1;
        let mut nodes = vec![(0.0, node_of[edge.ends[0] as usize])];
        for s in &all[1..end] {
            nodes.push((*s, made.points.len() as u32));
            made.points.push(edge.at(*s)[0]);
        }
        nodes.push((1.0, node_of[edge.ends[1] as usize]));
        made.along.push(nodes);
        if made.points.len() > MAX_EDGE_NODES {
            return None;
        }
    }
    Some(made)
}

/// Returns the node of each vertex: that of its solid's first vertex at that place. Where
/// two loops touch, files may have a vertex for each.
fn merged(shape: &Shape) -> Vec<u32> {
    let mut first: BTreeMap<(Option<u32>, [u64; 3]), u32> = BTreeMap::new();
    let mut node_of: Vec<u32> = (0..shape.vertices.len() as u32).collect();
    for (face, solid) in shape.faces.iter().zip(shape.solids_of_faces()) {
        for coedge in face.loops.iter().flatten() {
            for v in shape.edges[coedge.edge as usize].ends {
                // Zeros of either sign are one place.
                let place = shape.vertices[v as usize].map(|c| (c + 0.0).to_bits());
                node_of[v as usize] = *first.entry((solid, place)).or_insert(v);
            }
        }
    }
    node_of
}

/// Returns the shares with which the division of an edge begins.
fn coarse(edge: &Edge) -> Vec<f64> {
    let [from, to] = edge.range;
    let share = |t: f64| (t - from) / (to - from);
    let inner: Vec<f64> = match &edge.curve {
        CadCurve::Line(..) => Vec::new(),
        CadCurve::Nurbs(spline) => {
            // Corners are nodes; other knots are not, as they are where the curve was fitted and
            // not where it turns.
            let mut all = spline.kinks();
            if let Some(period) = spline.period() {
                let shifted = all.iter().flat_map(|t| [t - period, *t, t + period]);
                all = shifted.collect();
            }
            let mut shares: Vec<f64> = all.into_iter().map(share).collect();
            // Eighths of a degree-one curve would divide its sides in vain.
            if spline.degree() > 1 {
                shares.extend((1..4).map(|k| f64::from(k) / 4.0));
            }
            shares
        }
        curve => {
            let breaks = curve.breaks(edge.range);
            breaks.into_iter().map(share).collect()
        }
    };
    let mut all = vec![0.0, 1.0];
    let within = |s: &f64| *s > 1e-9 && *s < 1.0 - 1e-9;
    all.extend(inner.into_iter().filter(within));
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| *a - *b < 1e-9);
    // A closed edge is a polygon of three nodes at least.
    if edge.ends[0] == edge.ends[1] && all.len() < 4 {
        all = (0..=3).map(|k| f64::from(k) / 3.0).collect();
    }
    all
}

/// Adds shares up to the end of a piece of an edge, so that it is near its chords.
fn halve(edge: &Edge, [a, b]: [f64; 2], depth: usize, options: &FacetOptions, all: &mut Vec<f64>) {
    let (p, q) = (edge.at(a)[0], edge.at(b)[0]);
    // Tangents within the piece, since its ends may be corners.
    let inset = 1e-6 * (b - a);
    let (v, w) = (edge.at(a + inset)[1], edge.at(b - inset)[1]);
    let is_line = matches!(edge.curve, CadCurve::Line(..));
    let is_far = |k: usize| {
        let s = a + (b - a) * k as f64 / (PROBES_PER_PIECE + 1) as f64;
        distance_to_segment(edge.at(s)[0], [p, q]) > options.chord
    };
    let turns = dot(v, w) < MIN_TURN_COSINE * norm(v) * norm(w);
    let bends = !is_line && (turns || (1..=PROBES_PER_PIECE).any(is_far));
    if depth > 0 && (bends || norm(sub(p, q)) > options.longest) {
        let half = 0.5 * (a + b);
        halve(edge, [a, half], depth - 1, options, all);
        halve(edge, [half, b], depth - 1, options, all);
    } else {
        all.push(b);
    }
}

impl Divided {
    /// Adds nodes at shares of edges.
    pub(crate) fn split(&mut self, shape: &Shape, splits: Vec<(u32, f64)>) {
        for (edge, share) in splits {
            let along = &mut self.along[edge as usize];
            let place = along.partition_point(|n| n.0 < share);
            let near = |n: &(f64, u32)| (n.0 - share).abs() < 1e-12;
            if along.get(place).is_some_and(near) || place == 0 || near(&along[place - 1]) {
                continue;
            }
            along.insert(place, (share, self.points.len() as u32));
            self.points.push(shape.edges[edge as usize].at(share)[0]);
        }
    }
}
