//! Profiles: plane points along curves, divided into straight pieces and arcs.
//!
//! The points of a body of revolution lie along curves when they are turned about its axis into one
//! half plane. Points are put in order along these curves; which pieces describe a whole order in
//! the least is found by dynamic programming, so that narrow faces are weighed against all others
//! at once instead of growing from seeds within noise.

use crate::chart::{Kind, TIGHTEST};
use crate::choose::least_points;
use crate::fillet::fill;
use crate::segment::{EVIDENCE, UNEXPLAINED};
use isoform_geom::{KdTree, Point3, UnionFind, near_pairs};
use std::collections::BTreeMap;
use std::ops::Range;

/// A point of a profile: for a body of revolution along its axis and away from it.
pub(crate) type Place = [f64; 2];

/// A piece of a profile: a straight line or a circle.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Curve {
    /// A point and the unit direction.
    Line(Place, Place),
    /// Centre and radius.
    Circle(Place, f64),
}

impl Curve {
    /// How far a point lies from it.
    pub(crate) fn distance(&self, p: Place) -> f64 {
        match self {
            Self::Line(place, [a, b]) => {
                let d = minus(p, *place);
                d[1] * a - d[0] * b
            }
            Self::Circle(center, radius) => norm(minus(p, *center)) - radius,
        }
    }
}

/// Which curves a piece may be.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// A line along the first axis.
    Along,
    /// A line along the second axis.
    Across,
    Line,
    Circle,
    /// A circle with its centre on the first axis.
    Centred,
}

impl Shape {
    /// How many numbers determine it.
    fn numbers(self) -> usize {
        match self {
            Self::Along | Self::Across => 1,
            Self::Line => 2,
            Self::Centred | Self::Circle => 3,
        }
    }
}

/// What pieces cost.
pub(crate) struct Price<'a> {
    noise: f64,
    /// Σ r² times this is what points cost.
    scale: f64,
    shapes: &'a [(Shape, Kind)],
    is_proper: &'a dyn Fn(Kind, &Curve) -> bool,
}

impl<'a> Price<'a> {
    /// Pieces of these shapes and kinds that are proper, through points with some noise.
    pub(crate) fn new(
        noise: f64,
        shapes: &'a [(Shape, Kind)],
        is_proper: &'a dyn Fn(Kind, &Curve) -> bool,
    ) -> Self {
        let scale = 1.0 / (2.0 * noise * noise);
        Self {
            noise,
            scale,
            shapes,
            is_proper,
        }
    }

    /// What a point costs at a distance from its piece.
    pub(crate) fn of_distance(&self, r: f64) -> f64 {
        (r * r * self.scale).min(UNEXPLAINED)
    }

    /// What each number of a piece through so many points costs.
    pub(crate) fn of_number(&self, count: usize) -> f64 {
        (count.max(1) as f64).ln() / 2.0 + CHOICE
    }

    /// The kind of surface that an arc may be the section of.
    pub(crate) fn kind_of_arc(&self, curve: &Curve) -> Option<Kind> {
        let is_arc = |(shape, kind): &&(Shape, Kind)| {
            matches!(shape, Shape::Circle) && (self.is_proper)(*kind, curve)
        };
        let (_, kind) = self.shapes.iter().find(is_arc)?;
        let is_wide = |r: f64| r >= TIGHTEST * self.noise;
        matches!(curve, Curve::Circle(_, r) if is_wide(*r)).then_some(*kind)
    }
}

/// A piece, with the kind of surface that it is the section of, and its points.
#[derive(Debug)]
pub(crate) struct Piece {
    pub(crate) kind: Kind,
    pub(crate) curve: Curve,
    pub(crate) points: Vec<u32>,
}

/// A cell counts with this many points: single ones are outliers.
const OCCUPIED: f64 = 2.0;
/// Points that a cell has on average at least.
const FILLED: f64 = 6.0;
/// By how much cells grow until they are filled.
const WIDEN: f64 = 1.3;
/// How points are put in order: noise is as wide as narrow faces, and what smooths it rounds edges.
#[derive(Debug)]
pub(crate) struct Chaining {
    /// The width of the cells into which points are gathered, in deviations. Smaller ones are rarely
    /// occupied, larger ones hide the order at narrow faces.
    cell: f64,
    /// How far, in cells, the direction of the curve is taken from.
    reach: f64,
    /// How often cells are moved onto the lines through what lies about them.
    passes: usize,
}

/// Each of these finds narrow faces that the other misses.
pub(crate) const CHAININGS: [Chaining; 2] = [
    Chaining {
        cell: 2.0,
        reach: 2.0,
        passes: 2,
    },
    Chaining {
        cell: 1.0,
        reach: 4.0,
        passes: 1,
    },
];
/// Cells this many widths apart are neighbours.
const LINKED: f64 = 2.5;
/// A chain of cells is at least this many widths long: shorter ones are twigs of noise.
const CHAIN: f64 = 4.0;
/// Points farther from their chain, in deviations, are left out.
const OFF: f64 = 4.0;
/// What each number of a piece costs beyond its digits: as many stretches are tried, some shape with
/// one more follows one of them better by chance.
const CHOICE: f64 = 3.0;
/// The variance of points along their piece, in those of the noise, at least: a face of about four
/// deviations. Short stretches of noise are wider than long, and lines across them follow it well:
/// their points have the variance 1 along these.
const LONG: f64 = 1.5;
/// The share of what shorter pieces left that longer ones leave at least: of circles Σ r² is known
/// nearly.
const LEFT: f64 = 0.5;
/// Steps along a chain at most: time grows with their square.
const STEPS: usize = 1000;

/// Divides plane points into pieces of these shapes and kinds, the shortest description of them;
/// and the length of that.
pub(crate) fn pieces(
    points: &[Place],
    chaining: &Chaining,
    price: &Price<'_>,
) -> (Vec<Piece>, f64) {
    let (mut pieces, mut length, mut left) = (Vec::new(), 0.0, points.len());
    for chain in chains(points, price.noise, chaining) {
        let (mut some, cost) = divided(points, &chain, price);
        fill(points, price, &mut some);
        pieces.extend(some);
        length += cost;
        left -= chain.len();
    }
    (pieces, length + UNEXPLAINED * left as f64)
}

/// A point of a chain: how far along it, and its number.
type Link = (f64, u32);

/// A cell of points.
#[derive(Clone, Copy)]
struct Node {
    at: Place,
    count: f64,
    /// The unit direction of the curve.
    along: Place,
}

/// A node of a chain.
struct Stop {
    chain: usize,
    /// How far along it.
    at: f64,
    node: Node,
}

/// The points in order along the curves on which they lie.
fn chains(points: &[Place], noise: f64, chaining: &Chaining) -> Vec<Vec<Link>> {
    let Some((mut nodes, width)) = gathered(points, chaining.cell * noise) else {
        return Vec::new();
    };
    for _ in 0..chaining.passes {
        nodes = straightened(&nodes, chaining.reach * width);
    }
    let paths = paths(&nodes, LINKED * width, CHAIN * width);
    let stops: Vec<Stop> = (0..)
        .zip(&paths)
        .flat_map(|(chain, path)| stops(&nodes, chain, path))
        .collect();
    let mut chains = vec![Vec::new(); paths.len()];
    let tree = KdTree::new(&stops.iter().map(|s| raised(s.node.at)).collect::<Vec<_>>());
    for (p, i) in points.iter().zip(0..) {
        let Some((k, _)) = tree.nearest(raised(*p)) else {
            continue;
        };
        let Stop { chain, at, node } = &stops[k];
        let d = minus(*p, node.at);
        let off = d[0] * node.along[1] - d[1] * node.along[0];
        let on = inner(d, node.along);
        if off.abs() <= OFF * noise && on.abs() <= LINKED * width {
            chains[*chain].push((at + on, i));
        }
    }
    for chain in &mut chains {
        chain.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    }
    chains
}

/// The nodes of a path, directed along it.
fn stops(nodes: &[Node], chain: usize, path: &[u32]) -> Vec<Stop> {
    let at = |k: usize| nodes[path[k] as usize].at;
    let (mut length, mut stops) = (0.0, Vec::with_capacity(path.len()));
    for k in 0..path.len() {
        let (last, next) = (at(k.saturating_sub(1)), at((k + 1).min(path.len() - 1)));
        length += norm(minus(at(k), last));
        let node = &nodes[path[k] as usize];
        let sense = inner(node.along, minus(next, last)).signum();
        stops.push(Stop {
            chain,
            at: length,
            node: Node {
                along: node.along.map(|x| x * sense),
                ..*node
            },
        });
    }
    stops
}

/// The means of the points in the cells of a grid, and the width of these.
fn gathered(points: &[Place], mut width: f64) -> Option<(Vec<Node>, f64)> {
    let most = points.len() as f64 / FILLED;
    loop {
        let mut cells: BTreeMap<[i64; 2], [f64; 3]> = BTreeMap::new();
        for p in points {
            let cell = p.map(|x| (x / width).floor() as i64);
            let sum = cells.entry(cell).or_default();
            *sum = [sum[0] + 1.0, sum[1] + p[0], sum[2] + p[1]];
        }
        if cells.is_empty() {
            return None;
        }
        if cells.len() as f64 <= most.max(1.0) || width > 1.0 {
            let is_occupied = |sum: &&[f64; 3]| sum[0] >= OCCUPIED;
            let node = |sum: &[f64; 3]| Node {
                at: [sum[1] / sum[0], sum[2] / sum[0]],
                count: sum[0],
                along: [1.0, 0.0],
            };
            return Some((cells.values().filter(is_occupied).map(node).collect(), width));
        }
        width *= WIDEN;
    }
}

/// The nodes moved onto the lines through what lies about them.
fn straightened(nodes: &[Node], reach: f64) -> Vec<Node> {
    let mut about: Vec<Moments> = nodes.iter().map(|n| Moments::of(n.at, n.count)).collect();
    near_pairs(&raised_all(nodes), reach, |i, j, _| {
        about[i].add(nodes[j].at, nodes[j].count);
        about[j].add(nodes[i].at, nodes[i].count);
    });
    let moved = |(node, about): (&Node, &Moments)| {
        let Some((Curve::Line(place, along), _)) = about.line() else {
            return *node;
        };
        let on = inner(minus(node.at, place), along);
        Node {
            at: [place[0] + on * along[0], place[1] + on * along[1]],
            along,
            ..*node
        }
    };
    nodes.iter().zip(&about).map(moved).collect()
}

fn raised_all(nodes: &[Node]) -> Vec<Point3> {
    nodes.iter().map(|n| raised(n.at)).collect()
}

/// The long paths in a least spanning tree of nodes.
fn paths(nodes: &[Node], reach: f64, least: f64) -> Vec<Vec<u32>> {
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
        // What hangs on the path is looked at again, cut off from it.
        for i in &path {
            open.extend(beside[*i as usize].iter().map(|b| b.0));
        }
        if length >= least {
            paths.push(path);
        }
    }
    paths
}

/// The node of a tree that is farthest from one, and the way back from each to it.
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

/// The pieces of one chain, and the length of their description.
fn divided(points: &[Place], chain: &[Link], price: &Price<'_>) -> (Vec<Piece>, f64) {
    let Some((first, last)) = chain.first().zip(chain.last()) else {
        return (Vec::new(), 0.0);
    };
    let step = price.noise.max((last.0 - first.0) / STEPS as f64);
    let (mut sums, mut firsts, mut sum) = (vec![Moments::default()], vec![0], Moments::default());
    let mut at = 0;
    while at < chain.len() {
        let end = chain[at].0 + step;
        while at < chain.len() && chain[at].0 < end {
            sum.add(points[chain[at].1 as usize], 1.0);
            at += 1;
        }
        sums.push(sum);
        firsts.push(at);
    }
    let mut division = Division {
        price,
        left: vec![0.0; sums.len()],
        sums,
        best: vec![Best::default()],
    };
    (1..firsts.len()).for_each(|to| division.advance(to));
    let pieces = division.pieces();
    let piece = |(steps, kind, curve): (Range<usize>, Kind, Curve)| Piece {
        kind,
        curve,
        points: (chain[firsts[steps.start]..firsts[steps.end]].iter())
            .map(|link| link.1)
            .collect(),
    };
    let length = division.best.last().map_or(0.0, |best| best.cost);
    (pieces.into_iter().map(piece).collect(), length)
}

/// The shortest description of the first steps of a chain: its last piece begins at `from`.
#[derive(Clone, Copy, Default)]
struct Best {
    cost: f64,
    from: usize,
    piece: Option<(Kind, Curve)>,
}

/// Shortest descriptions of the steps of a chain, by dynamic programming (R. Bellman 1961).
struct Division<'a> {
    price: &'a Price<'a>,
    /// Sums over the points before each step.
    sums: Vec<Moments>,
    /// The shortest description of what lies before each step.
    best: Vec<Best>,
    /// What pieces from each step on left of Σ r² at least when they were last looked at: longer
    /// ones leave no less.
    left: Vec<f64>,
}

impl Division<'_> {
    /// Finds the shortest description of what lies before the next step.
    fn advance(&mut self, to: usize) {
        let last = self.best[to - 1];
        let single = self.sums[to].less(&self.sums[to - 1]);
        let mut least = Best {
            cost: last.cost + UNEXPLAINED * single.count,
            from: to - 1,
            piece: None,
        };
        // The last piece mostly goes on; what it costs rules most others out.
        self.try_from(last.from, to, &mut least);
        for from in (0..to).filter(|from| *from != last.from) {
            self.try_from(from, to, &mut least);
        }
        self.best.push(least);
    }

    /// Tries pieces between two steps.
    fn try_from(&mut self, from: usize, to: usize, least: &mut Best) {
        let Price { noise, scale, .. } = *self.price;
        let before = self.best[from].cost + EVIDENCE;
        if before + LEFT * self.left[from] * scale >= least.cost {
            return;
        }
        let of = self.sums[to].less(&self.sums[from]);
        let (mut left, mut is_whole) = (f64::INFINITY, true);
        for (shape, kind) in self.price.shapes {
            let numbers = shape.numbers() as f64;
            let base = before + numbers * self.price.of_number(of.count as usize);
            let is_enough = of.count >= least_points(*kind, noise) as f64;
            if base >= least.cost || !is_enough {
                is_whole &= is_enough;
                continue;
            }
            let Some((curve, squares)) = of.fitted(*shape) else {
                is_whole = false;
                continue;
            };
            left = left.min(squares);
            let cost = base + squares * scale;
            if cost < least.cost
                && of.is_long(&curve, noise)
                && (self.price.is_proper)(*kind, &curve)
            {
                *least = Best {
                    cost,
                    from,
                    piece: Some((*kind, curve)),
                };
            }
        }
        if is_whole && left.is_finite() {
            self.left[from] = left;
        }
    }

    /// The pieces of the shortest description of all steps.
    fn pieces(&self) -> Vec<(Range<usize>, Kind, Curve)> {
        let (mut pieces, mut to) = (Vec::new(), self.best.len() - 1);
        while to > 0 {
            let Best { from, piece, .. } = self.best[to];
            pieces.extend(piece.map(|(kind, curve)| (from..to, kind, curve)));
            to = from;
        }
        pieces
    }
}

/// Sums over points: of 1, x, y, xx, xy, yy, and with z = xx + yy of zx, zy, zz.
#[derive(Clone, Copy, Default)]
struct Moments {
    count: f64,
    first: Place,
    second: [f64; 3],
    third: Place,
    fourth: f64,
}

impl Moments {
    fn of(p: Place, weight: f64) -> Self {
        let mut new = Self::default();
        new.add(p, weight);
        new
    }

    fn add(&mut self, p: Place, weight: f64) {
        let [x, y] = p;
        let z = x * x + y * y;
        self.count += weight;
        self.first = [self.first[0] + weight * x, self.first[1] + weight * y];
        let square = [x * x, x * y, y * y];
        (0..3).for_each(|k| self.second[k] += weight * square[k]);
        self.third = [self.third[0] + weight * z * x, self.third[1] + weight * z * y];
        self.fourth += weight * z * z;
    }

    /// The sums over what lies after another.
    fn less(&self, other: &Self) -> Self {
        Self {
            count: self.count - other.count,
            first: std::array::from_fn(|k| self.first[k] - other.first[k]),
            second: std::array::from_fn(|k| self.second[k] - other.second[k]),
            third: std::array::from_fn(|k| self.third[k] - other.third[k]),
            fourth: self.fourth - other.fourth,
        }
    }

    fn mean(&self) -> Place {
        self.first.map(|x| x / self.count)
    }

    /// Σ of the products of what deviates from the means: xx, xy, yy.
    fn spread(&self) -> [f64; 3] {
        let [x, y] = self.first;
        let [xx, xy, yy] = self.second;
        let n = self.count;
        [xx - x * x / n, xy - x * y / n, yy - y * y / n]
    }

    /// The curve of a shape through the points, and Σ of their squared distances.
    fn fitted(&self, shape: Shape) -> Option<(Curve, f64)> {
        let [xx, _, yy] = self.spread();
        match shape {
            Shape::Along => Some((Curve::Line(self.mean(), [1.0, 0.0]), yy.max(0.0))),
            Shape::Across => Some((Curve::Line(self.mean(), [0.0, 1.0]), xx.max(0.0))),
            Shape::Line => self.line(),
            Shape::Circle => self.circle(),
            Shape::Centred => self.centred_circle(),
        }
    }

    /// Whether a curve is wide enough for the noise, and the points reach along it farther than noise
    /// across it.
    fn is_long(&self, curve: &Curve, noise: f64) -> bool {
        let [a, b] = match curve {
            Curve::Line(_, along) => *along,
            Curve::Circle(_, radius) if *radius < TIGHTEST * noise => return false,
            Curve::Circle(center, _) => {
                let away = minus(self.mean(), *center);
                let size = norm(away);
                [-away[1] / size, away[0] / size]
            }
        };
        let [xx, xy, yy] = self.spread();
        let squares = a * a * xx + 2.0 * a * b * xy + b * b * yy;
        squares >= LONG * noise * noise * self.count
    }

    fn line(&self) -> Option<(Curve, f64)> {
        let [xx, xy, yy] = self.spread();
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let squares = (xx + yy) / 2.0 - ((xx - yy) / 2.0).hypot(xy);
        let (sin, cos) = angle.sin_cos();
        (self.count > 1.0).then(|| (Curve::Line(self.mean(), [cos, sin]), squares.max(0.0)))
    }

    /// Σ of the products of the deviations of z with those of x, y and z.
    fn spread_of_z(&self) -> [f64; 3] {
        let z = self.second[0] + self.second[2];
        let n = self.count;
        [
            self.third[0] - z * self.first[0] / n,
            self.third[1] - z * self.first[1] / n,
            self.fourth - z * z / n,
        ]
    }

    /// The circle of least algebraic distance (Kåsa 1976): z = 2ax + 2by + c is linear in a, b, c.
    fn circle(&self) -> Option<(Curve, f64)> {
        let ([xx, xy, yy], [zx, zy, zz]) = (self.spread(), self.spread_of_z());
        let d = xx * yy - xy * xy;
        let (a, b) = ((zx * yy - zy * xy) / d, (zy * xx - zx * xy) / d);
        self.circle_about([a / 2.0, b / 2.0], zz - a * zx - b * zy)
    }

    fn centred_circle(&self) -> Option<(Curve, f64)> {
        let ([xx, ..], [zx, _, zz]) = (self.spread(), self.spread_of_z());
        let a = zx / xx;
        self.circle_about([a / 2.0, 0.0], zz - a * zx)
    }

    /// The circle about a centre; `rest` is Σ of the squares of what its equation leaves.
    fn circle_about(&self, center: Place, rest: f64) -> Option<(Curve, f64)> {
        let [x, y] = self.mean();
        let z = (self.second[0] + self.second[2]) / self.count;
        let squared = z - 2.0 * (center[0] * x + center[1] * y) + inner(center, center);
        let is_proper = squared > 0.0 && squared.is_finite() && rest.is_finite();
        is_proper.then(|| {
            let squares = rest.max(0.0) / (4.0 * squared);
            (Curve::Circle(center, squared.sqrt()), squares)
        })
    }
}

fn raised(p: Place) -> Point3 {
    [p[0], p[1], 0.0]
}

pub(crate) fn minus(a: Place, b: Place) -> Place {
    [a[0] - b[0], a[1] - b[1]]
}

pub(crate) fn inner(a: Place, b: Place) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(crate) fn norm(a: Place) -> f64 {
    a[0].hypot(a[1])
}
