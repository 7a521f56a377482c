//! Names of the pieces of an expression whose parameters have no values.
//!
//! A fit names its parts before the parameters are known, a mesh afterwards. Both split the
//! expression by one algorithm, here on a copy of the graph and with parameters assumed to be
//! positive. Pieces that coincide for some values only (two planes at one height by chance) are one
//! piece of the mesh and two here.

use super::name::PieceNumbering;
use super::nodes::negative;
use super::splitter::Splitter;
use super::tree::{PieceTree, without_constants};
use crate::graph::{Graph, NodeId};
use std::collections::HashMap;
use std::rc::Rc;

/// Pieces and names of an expression whose parameters have no values: those of the solid for
/// positive values in general position.
pub(crate) struct PieceNaming {
    graph: Graph,
    signs: HashMap<NodeId, PieceTree>,
    sides: HashMap<NodeId, Vec<PieceTree>>,
    names: HashMap<NodeId, Rc<str>>,
}

/// Surface of a node as a tree of named pieces, which are nodes of the naming's own graph.
pub(crate) enum NamedTree {
    Piece { value: NodeId, name: Rc<str> },
    Join { is_min: bool, children: Vec<Self> },
}

impl NamedTree {
    pub(crate) fn pieces(&self) -> Vec<NodeId> {
        match self {
            Self::Piece { value, .. } => vec![*value],
            Self::Join { children, .. } => children.iter().flat_map(Self::pieces).collect(),
        }
    }
}

impl NamedTree {
    /// Evaluates the tree from the values of the pieces, in order.
    pub(crate) fn value(&self, pieces: &mut impl Iterator<Item = f64>) -> f64 {
        match self {
            Self::Piece { .. } => pieces.next().expect("one for each piece"),
            Self::Join { is_min, children } => {
                let join = if *is_min { f64::min } else { f64::max };
                let values: Vec<f64> = children.iter().map(|child| child.value(pieces)).collect();
                values
                    .into_iter()
                    .reduce(join)
                    .expect("a join has children")
            }
        }
    }
}

impl PieceNaming {
    /// Names the pieces of an expression; `None` if it has too many pieces or is nested too deeply.
    pub(crate) fn new(graph: &Graph, root: NodeId) -> Option<Self> {
        let mut graph = graph.clone();
        let mut splitter = Splitter::new(&mut graph, root);
        let tree = splitter.whole()?;
        let (signs, sides) = (
            std::mem::take(&mut splitter.signs),
            std::mem::take(&mut splitter.sides),
        );
        let tree = without_constants(&graph, &tree).unwrap_or(tree);
        let mut numbering = PieceNumbering::new(&graph);
        numbering.tree(&tree);
        let names = numbering.pieces.into_iter().zip(numbering.names);
        Some(Self {
            names: names.map(|(value, name)| (value, name.into())).collect(),
            graph,
            signs,
            sides,
        })
    }

    pub(crate) fn graph(&self) -> &Graph {
        &self.graph
    }

    /// Returns the pieces of a node u that was split by sign, or of −u if `negative`; `None` if it
    /// was not split by sign, or has a constant sign.
    pub(crate) fn name_node(&mut self, id: NodeId, negative: bool) -> Option<NamedTree> {
        let tree = self.signs.get(&id)?.clone();
        self.named(&tree, negative)
    }

    /// Returns the pieces of a side of a primitive.
    pub(crate) fn name_side(
        &mut self,
        id: NodeId,
        side: usize,
        negative: bool,
    ) -> Option<NamedTree> {
        let tree = self.sides.get(&id)?.get(side)?.clone();
        self.named(&tree, negative)
    }

    fn named(&mut self, tree: &PieceTree, is_negative: bool) -> Option<NamedTree> {
        let tree = without_constants(&self.graph, tree).ok()?;
        self.named_as(&tree, is_negative)
    }

    fn named_as(&mut self, tree: &PieceTree, is_negative: bool) -> Option<NamedTree> {
        Some(match tree {
            PieceTree::Leaf(leaf) => {
                let value = if is_negative {
                    negative(&mut self.graph, leaf.value)
                } else {
                    leaf.value
                };
                NamedTree::Piece {
                    value,
                    name: self.names.get(&value)?.clone(),
                }
            }
            PieceTree::Join(join) => NamedTree::Join {
                is_min: join.is_min != is_negative,
                children: join
                    .children
                    .iter()
                    .map(|child| self.named_as(child, is_negative))
                    .collect::<Option<_>>()?,
            },
        })
    }
}
