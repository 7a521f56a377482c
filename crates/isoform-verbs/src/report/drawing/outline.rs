//! The lines of a picture: where neighbouring rays meet different faces, found by halving between
//! them, and joined across the cells of the pixels (marching squares with labels).

use super::picture::{Hit, Picture, Tracer};
use isoform::geom::dot;
use isoform::geom::plane::simplified;
use isoform_render::polyline::{Node, chains, sharpened};
use std::collections::BTreeMap;

/// Meaning of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum LineKind {
    /// The model against the background, or a part before another one.
    Outline,
    /// An edge of two faces that are both seen.
    Edge,
    /// Two pieces of the model that meet without an edge.
    Border,
}

/// A line on the paper.
#[derive(Clone, Debug)]
pub(super) struct OutlineLine {
    pub(super) kind: LineKind,
    pub(super) points: Vec<[f64; 2]>,
}

/// Cosine of 14°: neighbouring rays are compared further if their normals differ by more. Small
/// smooth faces turn as much from pixel to pixel, which bisection detects.
const TURN: f64 = 0.97;
/// Rays 1/32 of a pixel apart lie on both sides of an edge if their normals differ by more than
/// this: the cosine of 10°. Larger angles lose flat edges, smaller ones draw small rounds as edges.
const EDGE: f64 = 0.985;
/// Halvings between neighbouring rays: lines lie within 1/32 of a pixel.
const HALVINGS: usize = 5;
/// Maximum slope towards the viewer in comparisons: steeper faces are hardly visible, and steps in
/// depth near them are compared further.
const STEEPEST: f64 = 8.0;
/// Points nearer to a straight line than this share of a pixel are left out of it.
const STRAIGHT: f64 = 0.06;

/// Between two pixels: to the right (0) or down (1) of one.
type Between = (usize, usize, u8);

/// The slope of a face against the viewer, at most [`STEEPEST`].
fn slope(h: &Hit) -> f64 {
    steepness(h).min(STEEPEST)
}

/// The tangent of the angle between a face and the paper.
fn steepness(h: &Hit) -> f64 {
    let across = (1.0 - h.normal[2] * h.normal[2]).max(0.0).sqrt();
    across / h.normal[2].abs().max(1e-9)
}

/// Returns true if the faces that two rays met at this distance may be different ones.
fn differ(a: Option<Hit>, b: Option<Hit>, apart: f64) -> bool {
    match (a, b) {
        (None, None) => false,
        (Some(a), Some(b)) => {
            a.part != b.part || dot(a.normal, b.normal) < TURN || is_jump(&a, &b, apart)
        }
        _ => true,
    }
}

/// Returns true if the depths differ by more than a face of these slopes explains.
fn is_jump(a: &Hit, b: &Hit, apart: f64) -> bool {
    (a.depth - b.depth).abs() > apart * (1.5 + 2.0 * slope(a).max(slope(b)))
}

/// Returns the dissimilarity of the faces that two rays hit; for comparison only.
fn unlike(a: Option<Hit>, b: Option<Hit>, pixel: f64) -> f64 {
    match (a, b) {
        (None, None) => 0.0,
        (Some(a), Some(b)) => {
            let turn = (1.0 - dot(a.normal, b.normal)).max(0.0).sqrt();
            let part = if a.part == b.part { 0.0 } else { 0.5 };
            turn + part + 0.1 * ((a.depth - b.depth).abs() / pixel).min(20.0)
        }
        _ => 10.0,
    }
}

/// Returns the index of the ray that hits the face of the ray between the two. If that ray
/// hits a third face, the border of the face nearest to the viewer is kept, so that two lines
/// within a pixel do not alternate.
fn side([a, b]: [Option<Hit>; 2], hit: Option<Hit>, pixel: f64) -> usize {
    let part = |h: Option<Hit>| h.map(|h| h.part);
    if part(hit) != part(a) && part(hit) != part(b) {
        let depth = |h: Option<Hit>| h.map_or(f64::NEG_INFINITY, |h| h.depth);
        return usize::from(depth(a) > depth(b));
    }
    usize::from(unlike(a, hit, pixel) > unlike(b, hit, pixel))
}

/// The lines of a picture.
pub(super) fn lines(picture: &Picture, tracer: &Tracer<'_>) -> Vec<OutlineLine> {
    let nodes = crossings(picture, tracer);
    let mut lines = Vec::new();
    for kinds in [
        &[LineKind::Border][..],
        &[LineKind::Edge, LineKind::Outline],
    ] {
        for chain in chains(&segments(picture, &nodes, kinds)) {
            for (kind, run) in runs(&chain, &nodes) {
                let points = run.iter().map(|n| position(*n, &nodes, picture));
                let points = sharpened(points.collect(), picture.pixel);
                lines.push(OutlineLine {
                    kind,
                    points: simplified(&points, STRAIGHT * picture.pixel),
                });
            }
        }
    }
    lines
}

/// Number of nodes to either side that vote on the kind of a line: along walls that are hardly
/// visible, single pixels take an edge for an outline.
const NEIGHBOURS: usize = 8;

/// The stretches of a chain that are of one kind.
fn runs(
    chain: &[Node],
    nodes: &BTreeMap<Between, (LineKind, [f64; 2])>,
) -> Vec<(LineKind, Vec<Node>)> {
    let own: Vec<Option<LineKind>> = chain.iter().map(|n| nodes.get(n).map(|n| n.0)).collect();
    let mut runs: Vec<(LineKind, Vec<Node>)> = Vec::new();
    for (i, node) in chain.iter().enumerate() {
        let kind = prevalent(&own, i);
        match runs.last_mut() {
            Some((last, run)) if *last == kind => run.push(*node),
            last => {
                let joint = last.and_then(|(_, run)| run.last().copied());
                runs.push((kind, joint.into_iter().chain([*node]).collect()));
            }
        }
    }
    runs
}

/// The kind of a chain about its node `i`: an outline if most nodes near it are of one, else what
/// else occurs.
fn prevalent(kinds: &[Option<LineKind>], i: usize) -> LineKind {
    let near = &kinds[i.saturating_sub(NEIGHBOURS)..(i + NEIGHBOURS + 1).min(kinds.len())];
    let known = || near.iter().flatten();
    let outlines = known().filter(|k| **k == LineKind::Outline).count();
    if 2 * outlines > known().count() {
        return LineKind::Outline;
    }
    let thin_first = known().min_by_key(|k| **k == LineKind::Outline);
    thin_first.copied().unwrap_or(LineKind::Edge)
}

/// Finds the crossings of lines between pixels.
fn crossings(picture: &Picture, tracer: &Tracer<'_>) -> BTreeMap<Between, (LineKind, [f64; 2])> {
    let mut found = differing(picture);
    for _ in 0..HALVINGS {
        let middles: Vec<[f64; 2]> = found.iter().map(|f| middle(f.ends)).collect();
        for (f, hit) in found.iter_mut().zip(tracer.trace(&middles)) {
            let m = middle(f.ends);
            let k = side(f.hits, hit, picture.pixel);
            (f.ends[k], f.hits[k]) = (m, hit);
        }
    }
    let apart = picture.pixel / f64::from(1 << HALVINGS);
    found
        .into_iter()
        .filter_map(|f| Some((f.between, (kind(&f, apart)?, middle(f.ends)))))
        .collect()
}

/// The neighbouring pixels between which a line passes.
fn differing(picture: &Picture) -> Vec<LineCrossing> {
    let (w, h) = (picture.width, picture.height);
    let mut found = Vec::new();
    for row in 0..h {
        for column in 0..w {
            let a = picture.hits[row * w + column];
            for (side, c, r) in [(0, column + 1, row), (1, column, row + 1)] {
                if c >= w || r >= h {
                    continue;
                }
                let b = picture.hits[r * w + c];
                if differ(a, b, picture.pixel) {
                    found.push(LineCrossing {
                        between: (column, row, side),
                        is_step: is_step(a, b, picture.pixel),
                        ends: [picture.place(column, row), picture.place(c, r)],
                        hits: [a, b],
                    });
                }
            }
        }
    }
    found
}

/// A place where a line passes between two pixels, between two rays that come nearer and nearer.
struct LineCrossing {
    /// The pixels that it lies between.
    between: Between,
    /// True if the pixels see faces at different depths, or one sees none. The rays at the end may
    /// meet a face edge-on between the two, which says nothing.
    is_step: bool,
    /// Places of the two rays on the paper.
    ends: [[f64; 2]; 2],
    /// Hits of the two rays.
    hits: [Option<Hit>; 2],
}

/// Returns true if two pixels see faces at different depths, or one of them sees none.
fn is_step(a: Option<Hit>, b: Option<Hit>, pixel: f64) -> bool {
    match (a, b) {
        // A steep wall that is seen makes no step to the floor at its foot.
        (Some(a), Some(b)) => {
            let wall = steepness(&a).max(steepness(&b));
            (a.depth - b.depth).abs() > pixel * (1.5 + 2.0 * wall)
        }
        (None, None) => false,
        _ => true,
    }
}

/// The point half way.
fn middle([a, b]: [[f64; 2]; 2]) -> [f64; 2] {
    [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
}

/// Determines the kind of line between two rays that are very near to each other.
fn kind(crossing: &LineCrossing, apart: f64) -> Option<LineKind> {
    let found = match crossing.hits {
        [None, None] => None,
        [Some(a), Some(b)] => {
            // A step of twenty such distances is more than a steep face makes.
            let step = 20.0 * apart * (1.0 + slope(&a).min(slope(&b)));
            if (a.depth - b.depth).abs() > step {
                Some(LineKind::Outline)
            } else if dot(a.normal, b.normal) < EDGE {
                Some(LineKind::Edge)
            } else {
                (a.part != b.part).then_some(LineKind::Border)
            }
        }
        _ => Some(LineKind::Outline),
    };
    match found {
        Some(LineKind::Edge) if crossing.is_step => Some(LineKind::Outline),
        found => found,
    }
}

/// Joins the points of each cell between four pixels.
fn segments(
    picture: &Picture,
    nodes: &BTreeMap<Between, (LineKind, [f64; 2])>,
    kinds: &[LineKind],
) -> Vec<[Node; 2]> {
    let mut segments = Vec::new();
    for row in 0..picture.height.saturating_sub(1) {
        for column in 0..picture.width.saturating_sub(1) {
            let around = [
                (column, row, 0),
                (column + 1, row, 1),
                (column, row + 1, 0),
                (column, row, 1),
            ];
            let all: Vec<Node> = around
                .into_iter()
                .filter(|k| nodes.contains_key(k))
                .collect();
            let own: Vec<Node> = all
                .iter()
                .copied()
                .filter(|k| kinds.contains(&nodes[k].0))
                .collect();
            match (own.as_slice(), all.len()) {
                ([a, b], 2) => segments.push([*a, *b]),
                // Lines that end or meet here meet amid the points.
                (own, 2..) => segments.extend(own.iter().map(|n| [*n, (column, row, 2)])),
                _ => {}
            }
        }
    }
    segments
}

/// Returns the position of a node: a point of its line, the mean of the nodes around it, or the
/// corner that they make.
fn position(
    node: Node,
    nodes: &BTreeMap<Between, (LineKind, [f64; 2])>,
    picture: &Picture,
) -> [f64; 2] {
    if let Some((_, at)) = nodes.get(&node) {
        return *at;
    }
    let (column, row, _) = node;
    let around = [
        (column, row, 0),
        (column + 1, row, 1),
        (column, row + 1, 0),
        (column, row, 1),
    ];
    let points: Vec<[f64; 2]> = around
        .iter()
        .filter_map(|k| nodes.get(k).map(|n| n.1))
        .collect();
    if let Some(corner) = corner(&points, picture.pixel) {
        return corner;
    }
    let n = points.len().max(1) as f64;
    [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n)
}

/// Three lines that meet: two of the points mostly lie on one straight line, along a side of the
/// paper, and the third line meets it.
fn corner(points: &[[f64; 2]], pixel: f64) -> Option<[f64; 2]> {
    let [a, b, c] = points else { return None };
    for (p, q, r) in [(a, b, c), (a, c, b), (b, c, a)] {
        for k in 0..2 {
            if (p[k] - q[k]).abs() < 0.05 * pixel {
                let mut at = *r;
                at[k] = 0.5 * (p[k] + q[k]);
                return Some(at);
            }
        }
    }
    None
}
