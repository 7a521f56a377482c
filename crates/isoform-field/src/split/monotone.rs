//! Monotone functions of expressions, from whose arguments ranges are computed.

use crate::graph::{Graph, Node, NodeId};
use crate::library::Family;
use crate::ops::Ops;
use std::rc::Rc;

/// Maximum number of arguments of a blend; functions of more arguments are not tested for blends.
pub(crate) const MAX_BLEND_ARGUMENTS: usize = 5;

/// Representation of an expression as a monotone function of others.
#[derive(Clone, Debug)]
pub(crate) struct MonotoneFunction {
    pub(crate) function: Rc<BlendFunction>,
    pub(crate) inputs: Vec<NodeId>,
}

impl MonotoneFunction {
    /// Represents a circular blend as a monotone function of its two arguments; `None` for other
    /// nodes.
    pub(crate) fn of_blend(graph: &Graph, id: NodeId) -> Option<Self> {
        let Node::Library(f, args) = graph.node(id) else {
            return None;
        };
        if !matches!(f.family(), Family::Circular { .. }) {
            return None;
        }
        let radius = graph.constant_value(args[2])?;
        let mut alone = Graph::new();
        let arguments = [alone.x(3), alone.x(4), alone.constant(radius)];
        let root = alone.library(*f, &arguments);
        let function = Rc::new(BlendFunction {
            graph: alone,
            root,
            rises: vec![true; 2],
        });
        Some(Self {
            function,
            inputs: args[..2].to_vec(),
        })
    }
}

/// Function of X(3), X(4), …, and for each of these true if the function is increasing in it.
#[derive(Debug)]
pub(crate) struct BlendFunction {
    pub(crate) graph: Graph,
    pub(crate) root: NodeId,
    pub(crate) rises: Vec<bool>,
}
