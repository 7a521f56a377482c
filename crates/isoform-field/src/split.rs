//! Splitting an expression of space into smooth pieces, joined by minima and maxima.
//!
//! An L-shaped profile of two slabs has six pieces:
//!
//! ```text
//!    y_max                     max
//!    +----+ x_max            /     \
//!    |    |  y_max         min     min
//!    |    +------+        / | \   / | \
//!    |           | x_max   sides   sides
//!    +-----------+
//! ```
//!
//! - *piece*: a function whose zero set contains part of the surface, smooth near it, and
//!   nonnegative where it does not exclude points.
//! - *side*: one of the pieces of a primitive, or of |u|: u and −u.
//! - *kink*: a place where a function is not differentiable, made by minima, maxima, |u| and
//!   selections.
//! - *blend*: a function that is smooth although its formula has kinks.
//! - *product*: a blend of one piece of each of its arguments.
//! - *context*: the name of the variable whose value contains a node.
//!
//! An expression is split in two ways. By *sign*: the tree has the sign of the expression only, so
//! that R-functions are maxima and minima, primitives are the intersections of their closed-form
//! sides, and positive factors are dropped. By *value*: the tree has the expression's value
//! everywhere, and functions of it are distributed over its pieces: an increasing function of a
//! minimum is the minimum of the function's values. This applies to |u| = max(u, −u), sums, factors
//! and divisors of constant sign, monotone functions of one argument, R-functions, and blends.
//!
//! A smooth maximum is usually written with further minima, maxima and |u|: max(u, v) + max(k − |u
//! − v|, 0)²/(4k). If the kinks of such a formula cancel ([`crate::smooth`]), it is treated as one
//! function of the expressions that it uses more than once (here u and v) and distributed over
//! their pieces: smooth(min(a, b), c) = min(smooth(a, c), smooth(b, c)).

mod blend;
mod monotone;
mod name;
mod naming;
mod nodes;
mod sign;
mod splitter;
mod tree;
mod value;

pub(crate) use self::monotone::{MAX_BLEND_ARGUMENTS, MonotoneFunction};
use self::name::PieceNumbering;
pub(crate) use self::naming::{NamedTree, PieceNaming};
use self::splitter::Splitter;
use self::tree::without_constants;
use crate::graph::{Graph, NodeId};
use isoform_geom::Csg;
use std::collections::HashMap;

/// Error of splitting an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SplitError {
    /// The sign is constant.
    Constant { inside: bool },
    /// The expression is nested too deeply or has too many pieces.
    TooLarge,
}

/// Result of splitting an expression into smooth pieces.
pub(crate) struct Split {
    pub(crate) names: Vec<String>,
    pub(crate) pieces: Vec<NodeId>,
    pub(crate) tree: Csg,
    /// Expressions known to be monotone functions of other expressions.
    pub(crate) monotone: HashMap<NodeId, MonotoneFunction>,
}

/// Splits the expression `root`, of x alone; the pieces are added to the graph.
pub(crate) fn split(graph: &mut Graph, root: NodeId) -> Result<Split, SplitError> {
    let mut splitter = Splitter::new(graph, root);
    let tree = splitter.whole().ok_or(SplitError::TooLarge)?;
    let monotone = std::mem::take(&mut splitter.monotone);
    let tree = without_constants(graph, &tree).map_err(|inside| SplitError::Constant { inside })?;
    let mut numbering = PieceNumbering::new(graph);
    let tree = numbering.tree(&tree);
    Ok(Split {
        names: numbering.names,
        pieces: numbering.pieces,
        tree,
        monotone,
    })
}
