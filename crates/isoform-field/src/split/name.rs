//! Names of pieces: the variable that a piece is part of, and which side of it.
//!
//! A piece has the name of its own variable (`hole`), or of the next one above it with its side
//! (`slab.z_max`, `wall+`); a product has the names of its arguments (`plate+boss`). The whole
//! solid's name says nothing of a piece. A piece without any name is `piece3`, and of pieces with one
//! name the second is `hole#2`.

use super::Reader;
use super::nodes::along_axis;
use super::tree::{Leaf, Tree};
use crate::graph::{Graph, Node, NodeId};
use crate::ops::{Binary, Unary};
use isoform_geom::Csg;
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// The name to be used below a node.
#[derive(Clone, Debug, Default)]
pub(super) struct Context {
    pub(super) name: Rc<str>,
    pub(super) is_own: bool,
}

impl Reader<'_> {
    /// The context of a node. A variable that the node is part of says more than a name that is
    /// only suggested for it.
    pub(super) fn context(&self, id: NodeId, above: &Context) -> Context {
        let is_better = !above.name.is_empty() && self.graph.has_suggested_name(id);
        match self.graph.name(id) {
            Some(name) if !is_better => Context {
                name: name.into(),
                is_own: true,
            },
            _ => above.clone(),
        }
    }

    /// The context of one part of several. The name of the whole solid says nothing of a part.
    pub(super) fn below(&self, context: &Context) -> Context {
        let is_root = self.graph.name(self.root) == Some(&*context.name);
        Context {
            name: if is_root {
                "".into()
            } else {
                context.name.clone()
            },
            is_own: false,
        }
    }
}

pub(super) fn axis_side(axis: usize, is_lower: bool) -> String {
    format!(
        "{}_{}",
        ["x", "y", "z"][axis],
        if is_lower { "min" } else { "max" }
    )
}

/// Which side of what it is named after a piece is; may be empty.
pub(super) fn side_of(graph: &Graph, leaf: &Leaf) -> Rc<str> {
    match along_axis(graph, leaf.value) {
        // Inside is where the function is positive: where it rises the face is the lower one.
        Some((axis, rises)) if leaf.side.is_empty() => axis_side(axis, rises).into(),
        _ => leaf.side.clone(),
    }
}

/// The name of a piece, empty where nothing is known.
pub(super) fn named(graph: &Graph, leaf: &Leaf) -> String {
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

/// The name of u in u + c and −u: of a level set; and of a choice.
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
            // The two values that an if-statement gives to a variable.
            Node::Select(_, u, v) => {
                return graph.name(*u).filter(|name| graph.name(*v) == Some(name));
            }
            _ => return None,
        };
    }
}

/// Gives the pieces their numbers, in the order of the tree, and different names.
pub(super) struct Numbering<'a> {
    pub(super) graph: &'a Graph,
    pub(super) names: Vec<String>,
    taken: HashSet<String>,
    /// By base of names, the first count that was not tried yet.
    tried: HashMap<String, usize>,
    pub(super) pieces: Vec<NodeId>,
    pub(super) known: HashMap<NodeId, u32>,
}

impl<'a> Numbering<'a> {
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

    pub(super) fn tree(&mut self, tree: &Tree) -> Csg {
        let join = match tree {
            Tree::Leaf(leaf) => return Csg::Piece(self.piece(leaf)),
            Tree::Join(join) => join,
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

    fn piece(&mut self, leaf: &Leaf) -> u32 {
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

    /// The base, or the first of base#2, base#3, … that is not taken yet; it is taken then.
    fn free_name(&mut self, base: String) -> String {
        // What was taken once stays taken: the search goes on where it last ended. From 2 on each
        // time, a hundred thousand pieces of one name would take minutes.
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
