//! Tree of boxes over the triangles and the pieces of edges of a shape.

use isoform_geom::{Aabb, Point3};

/// Maximum number of items in a leaf.
const MAX_LEAF_ITEMS: usize = 4;

/// Triangle or piece of an edge, with a box that holds the part of the shape that it stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) kind: ItemKind,
    pub(crate) bounds: Aabb,
    /// Maximum distance of the exact face or edge from it.
    pub(crate) reach: f64,
}

/// Kind of an item.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ItemKind {
    /// Index of a triangle.
    Triangle(u32),
    /// Index of an edge, and that of its node at which the piece begins.
    Piece(u32, u32),
}

#[derive(Clone, Copy, Debug)]
struct BoxNode {
    bounds: Aabb,
    /// Index of the second child (the first one is next in the list), or of the first item.
    at: u32,
    /// Number of items of a leaf; 0 for a node with children.
    count: u32,
}

/// Tree of boxes.
#[derive(Debug)]
pub(crate) struct ItemTree {
    nodes: Vec<BoxNode>,
    pub(crate) items: Vec<Item>,
}

impl ItemTree {
    pub(crate) fn new(mut items: Vec<Item>) -> Self {
        let mut nodes = Vec::new();
        if !items.is_empty() {
            build(&mut items, 0, &mut nodes);
        }
        Self { nodes, items }
    }

    /// Visits the items that may be nearer than a distance, near ones first; `visit` takes an item
    /// and returns the distance from then on.
    pub(crate) fn search(&self, p: Point3, mut best: f64, mut visit: impl FnMut(&Item) -> f64) {
        let mut stack = vec![(0.0, 0)];
        if self.nodes.is_empty() {
            stack.clear();
        }
        while let Some((squared, k)) = stack.pop() {
            if !is_nearer(squared, best) {
                continue;
            }
            let node = &self.nodes[k];
            if node.count > 0 {
                let first = node.at as usize;
                for item in &self.items[first..first + node.count as usize] {
                    if is_nearer(to_box(p, &item.bounds), best) {
                        best = visit(item);
                    }
                }
                continue;
            }
            let children = [k + 1, node.at as usize];
            let mut pair = children.map(|c| (to_box(p, &self.nodes[c].bounds), c));
            // The nearer child is pushed last, and visited first.
            if pair[0].0 < pair[1].0 {
                pair.swap(0, 1);
            }
            stack.extend(pair.into_iter().filter(|w| is_nearer(w.0, best)));
        }
    }
}

/// Returns true if an object of at least this squared distance can be nearer than a known one.
fn is_nearer(squared: f64, known: f64) -> bool {
    // A margin of some hundred rounding errors prunes no nearest item.
    squared.is_finite() && squared * (1.0 - 1e-13) <= known * known
}

fn build(items: &mut [Item], first: usize, nodes: &mut Vec<BoxNode>) {
    let mut bounds = Aabb::EMPTY;
    let mut centres = Aabb::EMPTY;
    for item in items.iter() {
        bounds.add(item.bounds.lo);
        bounds.add(item.bounds.hi);
        centres.add(item.bounds.center());
    }
    let own = nodes.len();
    nodes.push(BoxNode {
        bounds,
        at: first as u32,
        count: 0,
    });
    if items.len() <= MAX_LEAF_ITEMS {
        nodes[own].count = items.len() as u32;
        return;
    }
    let size = centres.size();
    let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
    let half = items.len() / 2;
    let key = |item: &Item| item.bounds.center()[axis];
    items.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)));
    let (lower, upper) = items.split_at_mut(half);
    build(lower, first, nodes);
    nodes[own].at = nodes.len() as u32;
    build(upper, first + half, nodes);
}

/// Returns the squared distance of a point from a box.
fn to_box(p: Point3, b: &Aabb) -> f64 {
    let off = |i: usize| (b.lo[i] - p[i]).max(p[i] - b.hi[i]).max(0.0);
    (0..3).map(|i| off(i) * off(i)).sum()
}
