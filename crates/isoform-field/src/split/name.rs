//! Names of pieces: the variable whose value contains the piece, and the side of it.
//!
//! A piece is named after its own variable (`hole`), or after the innermost variable that contains
//! it and its side (`slab.z_max`, `wall+`); a product has the names of its arguments
//! (`plate+boss`). The name of the whole solid is not used. A piece without a name is `piece3`, and
//! the second piece with one name is `hole#2`.

use super::nodes::along_axis;
use super::tree::{PieceLeaf, PieceTree};
use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Unary};
use isoform_geom::Csg;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// Name inherited by the nodes below a node.
#[derive(Clone, Debug, Default)]
pub(super) struct NameContext {
    pub(super) name: Rc<str>,
    pub(super) is_own: bool,
}

pub(super) fn axis_side(axis: usize, is_lower: bool) -> String {
    format!(
        "{}_{}",
        ["x", "y", "z"][axis],
        if is_lower { "min" } else { "max" }
    )
}

/// Returns the side of a piece relative to the object after which it is named; may be empty.
pub(super) fn side_of(graph: &Graph, leaf: &PieceLeaf) -> Rc<str> {
    match along_axis(graph, leaf.value) {
        // The inside is where the function is positive: if it increases along the axis, the face is
        // the lower one.
        Some((axis, rises)) if leaf.side.is_empty() => axis_side(axis, rises).into(),
        _ => leaf.side.clone(),
    }
}

/// Returns the name of a piece; empty if unknown.
pub(super) fn named(graph: &Graph, leaf: &PieceLeaf) -> String {
    if leaf.is_own {
        return leaf.name.to_string();
    }
    match (&*leaf.name, &*side_of(graph, leaf)) {
        ("", "") => argument_name(graph, leaf.value)
            .unwrap_or_default()
            .to_owned(),
        ("", side) => side.to_owned(),
        (name, side @ ("" | "+" | "-")) => format!("{name}{side}"),
        (name, side) => format!("{name}.{side}"),
    }
}

/// Returns the name of u in u + c, c u and −u (level sets), and of a selection between two values
/// with one name.
fn argument_name(graph: &Graph, mut id: NodeId) -> Option<&str> {
    loop {
        if let Some(name) = graph.name(id) {
            return Some(name);
        }
        let constant = |id: &NodeId| !graph.is_in_space(*id);
        id = match graph.node(id) {
            Node::Unary(Unary::Neg, u) => *u,
            Node::Binary(Binary::Add | Binary::Sub | Binary::Mul, c, u) if constant(c) => *u,
            Node::Binary(Binary::Add | Binary::Sub | Binary::Mul | Binary::Div, u, c)
                if constant(c) =>
            {
                *u
            }
            // The two values that an if-statement assigns to a variable.
            Node::Select(_, u, v) => {
                return graph.name(*u).filter(|name| graph.name(*v) == Some(name));
            }
            _ => return None,
        };
    }
}

/// Assigns indices to the pieces, in the order of the tree, and distinct names.
pub(super) struct PieceNumbering<'a> {
    pub(super) graph: &'a Graph,
    pub(super) names: Vec<String>,
    taken: HashSet<String>,
    /// First untested suffix number, by base of names.
    tried: HashMap<String, usize>,
    pub(super) pieces: Vec<NodeId>,
    pub(super) known: HashMap<NodeId, u32>,
}

impl<'a> PieceNumbering<'a> {
    pub(super) fn new(graph: &'a Graph) -> Self {
        Self {
            graph,
            names: Vec::new(),
            taken: HashSet::new(),
            tried: HashMap::new(),
            pieces: Vec::new(),
            known: HashMap::new(),
        }
    }

    pub(super) fn tree(&mut self, tree: &PieceTree) -> Csg {
        let join = match tree {
            PieceTree::Leaf(leaf) => return Csg::Piece(self.piece(leaf)),
            PieceTree::Join(join) => join,
        };
        let mut known = HashSet::new();
        let mut children: Vec<Csg> = join.children.iter().map(|child| self.tree(child)).collect();
        children.retain(|child| {
            if let Csg::Piece(piece) = child {
                known.insert(*piece)
            } else {
                true
            }
        });
        match children.len() {
            1 => children.remove(0),
            _ if join.is_min => Csg::Min(children),
            _ => Csg::Max(children),
        }
    }

    fn piece(&mut self, leaf: &PieceLeaf) -> u32 {
        if let Some(&known) = self.known.get(&leaf.value) {
            return known;
        }
        let number = self.pieces.len() as u32;
        let mut base = named(self.graph, leaf);
        if base.is_empty() {
            base = format!("piece{}", number + 1);
        }
        let name = self.free_name(base);
        self.known.insert(leaf.value, number);
        self.pieces.push(leaf.value);
        self.names.push(name);
        number
    }

    /// Reserves the first unused name among the base, base#2, base#3, …
    fn free_name(&mut self, base: String) -> String {
        // Names are never released, so the search continues where it last ended. If it started from
        // 2 each time, a hundred thousand pieces with one name would take minutes.
        let count = self.tried.entry(base.clone()).or_insert(1);
        let mut name = base.clone();
        loop {
            if *count > 1 {
                name = format!("{base}#{count}");
            }
            *count += 1;
            if self.taken.insert(name.clone()) {
                return name;
            }
        }
    }
}
