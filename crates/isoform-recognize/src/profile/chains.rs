//! Chains: plane points ordered along the curves on which they lie.

use super::curve::{PlanePoint, ProfileCurve, inner, minus, norm};
use super::moments::Moments;
use crate::noise::CHANCE_DEVIATIONS;
use isoform_geom::{KdTree, Point3, UnionFind, near_pairs};
use std::collections::BTreeMap;

/// Maximum distance between adjacent cells, in widths of a cell.
const MAX_LINK_WIDTHS: f64 = 2.5;

/// A point of a chain: its arc length, and its index.
pub(super) type ChainLink = (f64, u32);

/// A cell of points.
#[derive(Clone, Copy)]
struct CellNode {
    at: PlanePoint,
    count: f64,
    /// Unit direction of the curve.
    along: PlanePoint,
}

/// A node of a chain.
struct ChainStop {
    chain: usize,
    /// Arc length along the chain.
    at: f64,
    node: CellNode,
}

/// Returns the points ordered along the curves on which they lie.
pub(super) fn chains(points: &[PlanePoint], noise: f64) -> Vec<Vec<ChainLink>> {
    let Some((mut nodes, width)) = gathered(points, noise) else {
        return Vec::new();
    };
    for _ in 0..2 {
        // The direction of the curve is taken within two cells: noise is as wide as narrow faces,
        // and smoothing rounds edges.
        nodes = straightened(&nodes, 2.0 * width);
    }
    // Shorter chains are branches caused by noise.
    let paths = paths(&nodes, MAX_LINK_WIDTHS * width, 4.0 * width);
    let stops: Vec<ChainStop> = (0..)
        .zip(&paths)
        .flat_map(|(chain, path)| stops(&nodes, chain, path))
        .collect();
    let mut chains = vec![Vec::new(); paths.len()];
    let tree = KdTree::new(&stops.iter().map(|s| raised(s.node.at)).collect::<Vec<_>>());
    for (p, i) in points.iter().zip(0..) {
        let Some((k, _)) = tree.nearest(raised(*p)) else {
            continue;
        };
        let ChainStop { chain, at, node } = &stops[k];
        let d = minus(*p, node.at);
        let off = d[0] * node.along[1] - d[1] * node.along[0];
        let on = inner(d, node.along);
        if off.abs() <= CHANCE_DEVIATIONS * noise && on.abs() <= MAX_LINK_WIDTHS * width {
            chains[*chain].push((at + on, i));
        }
    }
    for chain in &mut chains {
        chain.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
    chains
}

/// Returns the nodes of a path, directed along it.
fn stops(nodes: &[CellNode], chain: usize, path: &[u32]) -> Vec<ChainStop> {
    let at = |k: usize| nodes[path[k] as usize].at;
    let (mut length, mut stops) = (0.0, Vec::with_capacity(path.len()));
    for k in 0..path.len() {
        let (last, next) = (at(k.saturating_sub(1)), at((k + 1).min(path.len() - 1)));
        length += norm(minus(at(k), last));
        let node = &nodes[path[k] as usize];
        let sense = inner(node.along, minus(next, last)).signum();
        stops.push(ChainStop {
            chain,
            at: length,
            node: CellNode {
                along: node.along.map(|x| x * sense),
                ..*node
            },
        });
    }
    stops
}

/// Returns the means of the points in the cells of a grid, and the width of the cells.
fn gathered(points: &[PlanePoint], noise: f64) -> Option<(Vec<CellNode>, f64)> {
    if points.is_empty() {
        return None;
    }
    // Cells have at least six points on average.
    let most = points.len() as f64 / 6.0;
    // A curve is at least as long as the diagonal of its box.
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for p in points {
        for (b, x) in bounds.iter_mut().zip(p) {
            *b = [b[0].min(*x), b[1].max(*x)];
        }
    }
    let diagonal = norm(bounds.map(|[lo, hi]| hi - lo));
    // Smaller cells are rarely occupied, larger ones hide the order at narrow faces.
    let mut width = (2.0 * noise).max(diagonal / most);
    loop {
        let mut cells: BTreeMap<[i64; 2], [f64; 3]> = BTreeMap::new();
        for p in points {
            let cell = p.map(|x| (x / width).floor() as i64);
            let sum = cells.entry(cell).or_default();
            *sum = [sum[0] + 1.0, sum[1] + p[0], sum[2] + p[1]];
        }
        if cells.len() as f64 <= most.max(1.0) || width > 1.0 {
            // Single points are outliers.
            let is_occupied = |sum: &&[f64; 3]| sum[0] >= 2.0;
            let node = |sum: &[f64; 3]| CellNode {
                at: [sum[1] / sum[0], sum[2] / sum[0]],
                count: sum[0],
                along: [1.0, 0.0],
            };
            return Some((
                cells.values().filter(is_occupied).map(node).collect(),
                width,
            ));
        }
        width *= 1.3;
    }
}

/// Returns the nodes projected onto local regression lines.
fn straightened(nodes: &[CellNode], reach: f64) -> Vec<CellNode> {
    let mut about: Vec<Moments> = nodes
        .iter()
        .map(|n| Moments::from_point(n.at, n.count))
        .collect();
    near_pairs(&raised_all(nodes), reach, |i, j, _| {
        about[i].add(nodes[j].at, nodes[j].count);
        about[j].add(nodes[i].at, nodes[i].count);
    });
    let moved = |(node, about): (&CellNode, &Moments)| {
        let Some((ProfileCurve::Line(place, along), _)) = about.line() else {
            return *node;
        };
        let on = inner(minus(node.at, place), along);
        CellNode {
            at: [place[0] + on * along[0], place[1] + on * along[1]],
            along,
            ..*node
        }
    };
    nodes.iter().zip(&about).map(moved).collect()
}

fn raised_all(nodes: &[CellNode]) -> Vec<Point3> {
    nodes.iter().map(|n| raised(n.at)).collect()
}

/// Returns the long paths in a minimum spanning tree of nodes.
fn paths(nodes: &[CellNode], reach: f64, least: f64) -> Vec<Vec<u32>> {
    let mut edges = Vec::new();
    near_pairs(&raised_all(nodes), reach, |i, j, squared| {
        edges.push((squared, i as u32, j as u32));
    });
    edges.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut sets = UnionFind::new(nodes.len());
    let mut beside = vec![Vec::new(); nodes.len()];
    for (squared, i, j) in edges {
        if sets.unite(i, j) {
            beside[i as usize].push((j, squared.sqrt()));
            beside[j as usize].push((i, squared.sqrt()));
        }
    }
    let mut is_used = vec![false; nodes.len()];
    let mut paths = Vec::new();
    let mut open: Vec<u32> = (0..nodes.len() as u32).rev().collect();
    while let Some(seed) = open.pop() {
        if is_used[seed as usize] {
            continue;
        }
        let (end, _) = farthest(&beside, &is_used, seed);
        let (other, back) = farthest(&beside, &is_used, end);
        let mut path = vec![other];
        let mut length = 0.0;
        while let Some(&(up, l)) = back.get(path.last().unwrap_or(&other)) {
            path.push(up);
            length += l;
        }
        path.iter().for_each(|i| is_used[*i as usize] = true);
        // Branches of the path are searched again, cut off from it.
        for i in &path {
            open.extend(beside[*i as usize].iter().map(|b| b.0));
        }
        if length >= least {
            paths.push(path);
        }
    }
    paths
}

/// Returns the node of a tree that is farthest from one, and the predecessor of each on the way to
/// it.
fn farthest(
    beside: &[Vec<(u32, f64)>],
    is_used: &[bool],
    from: u32,
) -> (u32, BTreeMap<u32, (u32, f64)>) {
    let (mut back, mut open, mut far) = (BTreeMap::new(), vec![(from, from, 0.0)], (from, 0.0));
    while let Some((i, up, at)) = open.pop() {
        if at > far.1 {
            far = (i, at);
        }
        for &(j, l) in &beside[i as usize] {
            if j != up && !is_used[j as usize] {
                back.insert(j, (i, l));
                open.push((j, i, at + l));
            }
        }
    }
    (far.0, back)
}

fn raised(p: PlanePoint) -> Point3 {
    [p[0], p[1], 0.0]
}
