//! Trees of minima and maxima over pieces, during the splitting of an expression.
//!
//! Trees of expressions that are used more than once are shared. A minimum within a minimum is
//! merged with it.

use crate::graph::{Graph, NodeId};
use std::rc::Rc;

/// Smooth piece with the components of its name.
#[derive(Clone, Debug)]
pub(super) struct PieceLeaf {
    pub(super) value: NodeId,
    /// Name of the expression itself, or of the innermost named one that contains it; may be empty.
    pub(super) name: Rc<str>,
    /// True if the name identifies the piece; false if its owner has other pieces, too.
    pub(super) is_own: bool,
    /// Side of an absolute value; may be empty.
    pub(super) side: Rc<str>,
}

#[derive(Clone, Debug)]
pub(super) enum PieceTree {
    Leaf(PieceLeaf),
    Join(Rc<PieceJoin>),
}

#[derive(Debug)]
pub(super) struct PieceJoin {
    pub(super) is_min: bool,
    pub(super) children: Vec<PieceTree>,
    pub(super) leaves: usize,
}

impl PieceTree {
    pub(super) fn join(is_min: bool, parts: impl IntoIterator<Item = Self>) -> Self {
        let mut children = Vec::new();
        for part in parts {
            match part {
                Self::Join(join) if join.is_min == is_min => {
                    children.extend(join.children.iter().cloned())
                }
                part => children.push(part),
            }
        }
        if children.len() == 1 {
            return children.remove(0);
        }
        let leaves = children
            .iter()
            .fold(0usize, |n, c| n.saturating_add(c.leaves()));
        Self::Join(Rc::new(PieceJoin {
            is_min,
            children,
            leaves,
        }))
    }

    pub(super) fn leaves(&self) -> usize {
        match self {
            Self::Leaf(_) => 1,
            Self::Join(join) => join.leaves,
        }
    }

    /// Maps the tree by a function of its value that increases, or decreases if `falls`.
    pub(super) fn map(&self, falls: bool, f: &mut impl FnMut(&PieceLeaf) -> PieceLeaf) -> Self {
        match self {
            Self::Leaf(leaf) => Self::Leaf(f(leaf)),
            Self::Join(join) => Self::join(
                join.is_min != falls,
                join.children
                    .iter()
                    .map(|c| c.map(falls, f))
                    .collect::<Vec<_>>(),
            ),
        }
    }
}

/// Removes constants from a tree; the error, for a tree of constants, is true if all of space is
/// inside.
pub(super) fn without_constants(graph: &Graph, tree: &PieceTree) -> Result<PieceTree, bool> {
    let join = match tree {
        PieceTree::Leaf(leaf) => {
            return graph
                .constant_value(leaf.value)
                .map_or_else(|| Ok(tree.clone()), |c| Err(c >= 0.0));
        }
        PieceTree::Join(join) => join,
    };
    let mut children = Vec::with_capacity(join.children.len());
    for child in &join.children {
        match without_constants(graph, child) {
            Ok(child) => children.push(child),
            // A child that contains all of space determines a union and is neutral in an
            // intersection.
            Err(inside) if inside != join.is_min => return Err(inside),
            Err(_) => {}
        }
    }
    if children.is_empty() {
        Err(join.is_min)
    } else {
        Ok(PieceTree::join(join.is_min, children))
    }
}
