//! Lines and areas of a drawing: the places where neighbouring lines of sight meet different
//! objects, found by bisection between them and joined across the cells of the grid (marching
//! squares with labels).
//!
//! Only visible objects are drawn, so no hidden lines need to be removed. Lines are accurate to
//! 1/64 of a cell.

use crate::model::Scratch;
use crate::polyline::{Node, chains, sharpened};
use crate::trace::{AreaClass, Border, Tracer, VisiblePoint, border};
use isoform::geom::plane::simplified;
use isoform::geom::{dot, sub};
use isoform::{Control, Stopped};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Maximum distance, in pixels, of points of lines and areas from the straight line that replaces
/// them.
const MAX_LINE_DEVIATION: f64 = 0.05;
/// Indices, from a fork on, of the two nodes of a line that determine its direction there.
const DIRECTION_NODES: [usize; 2] = [2, 7];

/// Meaning of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum LineKind {
    /// Outline: a surface in front of another one, or of nothing.
    Outline,
    /// Edge between two visible faces, or border of a cap.
    Edge,
}

/// Line of a drawing, in pixels.
#[derive(Clone, Debug)]
pub(crate) struct DrawnLine {
    pub(crate) kind: LineKind,
    pub(crate) points: Vec<[f64; 2]>,
}

/// Lines and areas of a view.
#[derive(Clone, Debug, Default)]
pub(crate) struct Network {
    pub(crate) lines: Vec<DrawnLine>,
    /// Closed polygons, by class; holes are polygons, too.
    pub(crate) areas: BTreeMap<AreaClass, Vec<Vec<[f64; 2]>>>,
    /// Number of cells that see anything, by quarters of the height and width.
    pub(crate) taken: [[usize; 4]; 4],
}

/// Change between two neighbours of the grid.
struct GridCrossing {
    node: Node,
    ends: [[f64; 2]; 2],
    seen: [Option<VisiblePoint>; 2],
}

impl GridCrossing {
    fn middle(&self) -> [f64; 2] {
        let [a, b] = self.ends;
        [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
    }
}

/// Refined crossing.
struct RefinedCrossing {
    at: [f64; 2],
    kind: Option<LineKind>,
}

/// Grid of lines of sight over a picture and one cell around it, where nothing is seen, so that
/// areas are closed.
struct SightGrid {
    cell: f64,
    size: [usize; 2],
    seen: Vec<Option<VisiblePoint>>,
}

impl SightGrid {
    fn new(tracer: &Tracer<'_>, size: [u32; 2], control: &Control<'_>) -> Result<Self, Stopped> {
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        // At most 1.5 million lines of sight: more pixels have cells of several pixels.
        let cell = (pixels / 1.5e6).sqrt().max(1.0);
        // The outermost points see nothing; those next to them are just outside the picture.
        let count = size.map(|v| (f64::from(v) / cell).ceil() as usize + 4);
        let mut grid = Self {
            cell,
            size: count,
            seen: Vec::new(),
        };
        let row = |y: usize| -> Result<Vec<Option<VisiblePoint>>, Stopped> {
            control.check()?;
            let mut scratch = Scratch::default();
            let mut look = |x: usize| tracer.seen(grid.place(x, y), &mut scratch);
            let is_inner = |x: usize| x > 0 && x + 1 < count[0] && y > 0 && y + 1 < count[1];
            Ok((0..count[0])
                .map(|x| if is_inner(x) { look(x) } else { None })
                .collect())
        };
        let rows: Result<Vec<_>, Stopped> = (0..count[1]).into_par_iter().map(row).collect();
        grid.seen = rows?.concat();
        Ok(grid)
    }

    /// Returns the pixel coordinates of a grid point.
    fn place(&self, x: usize, y: usize) -> [f64; 2] {
        [x, y].map(|i| (i as f64 - 1.5) * self.cell)
    }

    fn at(&self, x: usize, y: usize) -> Option<&VisiblePoint> {
        self.seen[y * self.size[0] + x].as_ref()
    }

    /// Returns true if a grid point is one of the outermost ones, which see nothing by definition.
    fn is_outermost(&self, x: usize, y: usize) -> bool {
        x == 0 || y == 0 || x + 1 == self.size[0] || y + 1 == self.size[1]
    }

    /// Returns the pairs of neighbours between which something changes.
    fn crossings(&self) -> Vec<GridCrossing> {
        let mut found = Vec::new();
        for y in 0..self.size[1] {
            for x in 0..self.size[0] {
                for (side, [p, q]) in [(0, [x + 1, y]), (1, [x, y + 1])] {
                    if p >= self.size[0] || q >= self.size[1] {
                        continue;
                    }
                    let (a, b) = (self.at(x, y), self.at(p, q));
                    if class(a) != class(b) || border(a, b) != Border::None {
                        found.push(GridCrossing {
                            node: (x, y, side),
                            ends: [self.place(x, y), self.place(p, q)],
                            seen: [a.copied(), b.copied()],
                        });
                    }
                }
            }
        }
        found
    }
}

fn class(seen: Option<&VisiblePoint>) -> Option<AreaClass> {
    seen.map(VisiblePoint::class)
}

/// Returns a measure of dissimilarity of two samples, for comparison only.
fn unlike(a: Option<&VisiblePoint>, b: Option<&VisiblePoint>) -> f64 {
    let (Some(a), Some(b)) = (a, b) else {
        return if a.is_none() && b.is_none() { 0.0 } else { 1e3 };
    };
    let step = sub(b.point, a.point);
    let off = dot(a.normal, step).abs().max(dot(b.normal, step).abs());
    let turn = (1.0 - dot(a.normal, b.normal)).max(0.0).sqrt();
    turn + 0.1 * (off / a.pixel).min(20.0)
}

/// Returns the level on which two samples agree: emptiness only, layer, part, or colour of the
/// part.
fn alike(a: Option<&VisiblePoint>, b: Option<&VisiblePoint>) -> u8 {
    let (Some(a), Some(b)) = (class(a), class(b)) else {
        return if a.is_none() == b.is_none() { 4 } else { 0 };
    };
    let (is_layer, is_part) = (a.layer == b.layer, a.part == b.part);
    match (is_layer, is_part, (a.tone, a.band) == (b.tone, b.band)) {
        (true, true, true) => 4,
        (true, true, false) => 3,
        (true, false, _) => 2,
        (false, ..) => 1,
    }
}

/// Returns the end of a bisected pair that the sample in the middle replaces: the more similar one.
/// If the middle shows a third object, the border of the nearest object is kept.
fn side([a, b]: [Option<&VisiblePoint>; 2], middle: Option<&VisiblePoint>) -> usize {
    let (first, second) = (alike(a, middle), alike(b, middle));
    if first != second {
        return usize::from(second > first);
    }
    if first == 4 {
        return usize::from(unlike(a, middle) > unlike(b, middle));
    }
    let depth = |s: Option<&VisiblePoint>| s.map_or(f64::INFINITY, |s| s.depth);
    usize::from(depth(a) < depth(b))
}

/// Returns the network of a view.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn network(
    tracer: &Tracer<'_>,
    size: [u32; 2],
    control: &Control<'_>,
) -> Result<Network, Stopped> {
    control.begin("looking")?;
    let grid = SightGrid::new(tracer, size, control)?;
    control.begin("outlines")?;
    let crossings = grid.crossings().into_par_iter();
    let refined: Vec<(Node, RefinedCrossing)> = crossings
        .map_init(Scratch::default, |scratch, mut c| {
            let (x, y, side) = c.node;
            let next = if side == 0 { [x + 1, y] } else { [x, y + 1] };
            if grid.is_outermost(x, y) || grid.is_outermost(next[0], next[1]) {
                return (
                    c.node,
                    RefinedCrossing {
                        at: c.middle(),
                        kind: None,
                    },
                );
            }
            refine(&mut c, tracer, scratch);
            let [a, b] = c.seen.each_ref().map(Option::as_ref);
            let kind = match border(a, b) {
                Border::None => None,
                Border::Edge => Some(LineKind::Edge),
                Border::Before | Border::Behind => Some(LineKind::Outline),
            };
            (
                c.node,
                RefinedCrossing {
                    at: c.middle(),
                    kind,
                },
            )
        })
        .collect();
    control.check()?;
    let mut web = LineGraph {
        grid: &grid,
        found: refined.into_iter().collect(),
        forks: BTreeMap::new(),
    };
    let chains = chains(&web.segments());
    web.place_forks(&chains);
    Ok(Network {
        lines: chains.iter().map(|c| web.line(c)).collect(),
        areas: web.areas(),
        taken: taken(&grid),
    })
}

/// Bisects a pair of samples.
fn refine(c: &mut GridCrossing, tracer: &Tracer<'_>, scratch: &mut Scratch) {
    for _ in 0..6 {
        let at = c.middle();
        let seen = tracer.seen(at, scratch);
        let k = side(c.seen.each_ref().map(Option::as_ref), seen.as_ref());
        (c.ends[k], c.seen[k]) = (at, seen);
    }
}

/// Counts the cells that see anything, by quarters of the height and width.
fn taken(grid: &SightGrid) -> [[usize; 4]; 4] {
    let mut taken = [[0; 4]; 4];
    let quarter = |i: usize, k: usize| (4 * i / grid.size[k]).min(3);
    for y in 0..grid.size[1] {
        for x in 0..grid.size[0] {
            taken[quarter(y, 1)][quarter(x, 0)] += usize::from(grid.at(x, y).is_some());
        }
    }
    taken
}

/// Crossings, and the forks inside cells with more than two of them.
struct LineGraph<'g> {
    grid: &'g SightGrid,
    found: BTreeMap<Node, RefinedCrossing>,
    /// Positions of forks.
    forks: BTreeMap<Node, [f64; 2]>,
}

impl LineGraph<'_> {
    /// Returns the nodes on the four sides of a cell, in order.
    fn around(x: usize, y: usize) -> [Node; 4] {
        [(x, y, 0), (x + 1, y, 1), (x, y + 1, 0), (x, y, 1)]
    }

    fn position(&self, node: Node) -> [f64; 2] {
        let (x, y, side) = node;
        if side < 2 {
            return self.found[&node].at;
        }
        if let Some(at) = self.forks.get(&node) {
            return *at;
        }
        let around = Self::around(x, y);
        let points: Vec<[f64; 2]> = around
            .iter()
            .filter_map(|n| self.found.get(n))
            .map(|f| f.at)
            .collect();
        let n = points.len().max(1) as f64;
        [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n)
    }

    /// Returns the pieces of lines within cells.
    fn segments(&self) -> Vec<[Node; 2]> {
        let mut segments = Vec::new();
        for y in 0..self.grid.size[1].saturating_sub(1) {
            for x in 0..self.grid.size[0].saturating_sub(1) {
                let around = Self::around(x, y);
                let is_line = |n: &&Node| self.found.get(n).is_some_and(|f| f.kind.is_some());
                let own: Vec<Node> = around.iter().filter(is_line).copied().collect();
                match own.as_slice() {
                    [] | [_] => {}
                    [a, b] => segments.push([*a, *b]),
                    many => segments.extend(many.iter().map(|n| [*n, (x, y, 2)])),
                }
            }
        }
        segments
    }

    /// Moves forks to the intersection of the lines that end there, if it is within 1.5 cells.
    fn place_forks(&mut self, chains: &[Vec<Node>]) {
        let mut lines: BTreeMap<Node, Vec<[[f64; 2]; 2]>> = BTreeMap::new();
        for chain in chains {
            let ends = [(chain[0], 0), (chain[chain.len() - 1], chain.len() - 1)];
            for (fork, place) in ends.into_iter().filter(|(n, _)| n.2 == 2) {
                let from = |k: usize| {
                    if place == 0 {
                        k
                    } else {
                        place.saturating_sub(k)
                    }
                };
                if chain.len() > DIRECTION_NODES[0] + 1 {
                    let far = DIRECTION_NODES[1].min(chain.len() - 1);
                    let pair = [DIRECTION_NODES[0], far].map(|k| self.position(chain[from(k)]));
                    lines.entry(fork).or_default().push(pair);
                }
            }
        }
        for (fork, lines) in lines {
            let usual = self.position(fork);
            if let Some(at) = meeting(&lines) {
                let away = (at[0] - usual[0]).hypot(at[1] - usual[1]);
                if away < 1.5 * self.grid.cell {
                    self.forks.insert(fork, at);
                }
            }
        }
    }

    /// Converts a chain to a line.
    fn line(&self, chain: &[Node]) -> DrawnLine {
        let kinds = chain.iter().filter_map(|n| self.found.get(n)?.kind);
        let (outlines, edges): (Vec<LineKind>, Vec<LineKind>) =
            kinds.partition(|k| *k == LineKind::Outline);
        let kind = if outlines.len() > edges.len() {
            LineKind::Outline
        } else {
            LineKind::Edge
        };
        let points = chain.iter().map(|n| self.position(*n)).collect();
        let points = sharpened(points, self.grid.cell);
        DrawnLine {
            kind,
            points: simplified(&points, MAX_LINE_DEVIATION),
        }
    }

    /// Returns the borders of all classes. Within a cell each run of corners of one class is
    /// bounded by the crossing before it and the crossing after it; in the next cell these two
    /// exchange their roles, so that each border closes.
    fn areas(&self) -> BTreeMap<AreaClass, Vec<Vec<[f64; 2]>>> {
        let mut next: BTreeMap<(AreaClass, Node), (Node, Option<Node>)> = BTreeMap::new();
        for y in 0..self.grid.size[1].saturating_sub(1) {
            for x in 0..self.grid.size[0].saturating_sub(1) {
                self.within(x, y, &mut next);
            }
        }
        let mut areas: BTreeMap<AreaClass, Vec<Vec<[f64; 2]>>> = BTreeMap::new();
        while let Some((&(class, start), _)) = next.first_key_value() {
            let mut ring = Vec::new();
            let mut at = start;
            while let Some((to, fork)) = next.remove(&(class, at)) {
                ring.push(self.position(at));
                ring.extend(fork.map(|f| self.position(f)));
                at = to;
            }
            ring.push(self.position(start));
            let ring = simplified(&ring, MAX_LINE_DEVIATION);
            if ring.len() > 3 {
                areas.entry(class).or_default().push(ring);
            }
        }
        areas
    }

    /// Adds the borders of classes in a cell.
    fn within(
        &self,
        x: usize,
        y: usize,
        next: &mut BTreeMap<(AreaClass, Node), (Node, Option<Node>)>,
    ) {
        let corners = [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]];
        let classes = corners.map(|[x, y]| class(self.grid.at(x, y)));
        // Node k lies between corner k and the next one.
        let nodes = Self::around(x, y);
        let is_border = |k: usize| classes[k] != classes[(k + 1) % 4];
        let count = (0..4).filter(|k| is_border(*k)).count();
        let fork = (count > 2).then_some((x, y, 2));
        for k in (0..4).filter(|k| is_border(*k)) {
            // A run begins after border k and ends at the next one.
            let Some(class) = classes[(k + 1) % 4] else {
                continue;
            };
            let end = (1..=4).map(|j| (k + j) % 4).find(|j| is_border(*j));
            next.insert((class, nodes[end.unwrap_or(k)]), (nodes[k], fork));
        }
    }
}

/// Returns the point nearest to several lines in the least-squares sense; `None` if they are nearly
/// parallel.
fn meeting(lines: &[[[f64; 2]; 2]]) -> Option<[f64; 2]> {
    let (mut m, mut r) = ([0.0; 3], [0.0; 2]);
    for [a, b] in lines {
        let d = [b[0] - a[0], b[1] - a[1]];
        let size = d[0].hypot(d[1]);
        if size == 0.0 {
            continue;
        }
        let n = [-d[1] / size, d[0] / size];
        let offset = n[0] * a[0] + n[1] * a[1];
        m = [m[0] + n[0] * n[0], m[1] + n[0] * n[1], m[2] + n[1] * n[1]];
        r = [r[0] + n[0] * offset, r[1] + n[1] * offset];
    }
    let det = m[0] * m[2] - m[1] * m[1];
    (det > 0.05).then(|| {
        [
            (m[2] * r[0] - m[1] * r[1]) / det,
            (m[0] * r[1] - m[1] * r[0]) / det,
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_lines_meet() {
        let at = |t: f64| {
            [
                [t.cos() + 0.25, t.sin() + 0.5],
                [2.0 * t.cos() + 0.25, 2.0 * t.sin() + 0.5],
            ]
        };
        let found = meeting(&[at(0.3), at(2.0), at(4.5)]).expect("a place");
        assert!((found[0] - 0.25).abs() < 1e-12 && (found[1] - 0.5).abs() < 1e-12);
        assert_eq!(meeting(&[at(0.3), at(0.3)]), None);
    }
}
