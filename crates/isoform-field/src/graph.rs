//! Expressions as hash-consed graphs, in which set operations and library functions are nodes of
//! their own.
//!
//! A [`Graph`] is built through [`Ops`] (by the HyperFun executor, or by hand), interpreted
//! geometrically by [`crate::Shape`] and evaluated by a [`crate::Tape`]. [`Graph::eval`] evaluates
//! it node by node in any [`Real`] type: slow, simple, and the reference for all faster evaluators.

use crate::direct::Direct;
use crate::library::{Library, Native};
use crate::ops::{Binary, Ops, SetOp, Unary};
use isoform_num::Real;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashMap};

/// Index of a node of a [`Graph`]. Nodes are numbered in the order of creation, so that arguments
/// precede their users.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub(crate) u32);

impl NodeId {
    /// Returns the index of the node in the graph's list.
    pub(crate) fn at(self) -> usize {
        self.0 as usize
    }
}

/// Operation of a node with its arguments.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// A constant, represented by its bits.
    Constant(u64),
    /// Coordinate i of space, from 0.
    X(u32),
    /// Parameter i, from 0.
    Param(u32),
    /// A function of one argument.
    Unary(Unary, NodeId),
    /// A function of two arguments.
    Binary(Binary, NodeId, NodeId),
    /// An integer power.
    PowI(NodeId, i32),
    /// A set operation.
    Set(SetOp, NodeId, NodeId),
    /// The second argument where the first is not 0, else the third.
    Select(NodeId, NodeId, NodeId),
    /// A library function.
    Library(Library, Box<[NodeId]>),
    /// A function computed by iteration.
    Native(Native, Box<[NodeId]>),
}

/// Name of a node, for display.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// Name of the variable to which the node is assigned, or a suggested name.
    pub text: String,
    /// True if the name is derived from an argument of the node (the centre of a ball); the name of
    /// a variable whose value contains the node takes precedence.
    pub is_suggestion: bool,
}

/// An expression in coordinates x and parameters a, with shared subexpressions stored once.
///
/// ```
/// use isoform_field::{Graph, Ops};
/// let mut graph = Graph::new();
/// let (x, y, a) = (graph.x(0), graph.x(1), graph.param(0));
/// let (sum, same) = (graph.add(&x, &y), graph.add(&y, &x));
/// assert_eq!(sum, same);
/// let f = graph.mul(&a, &sum);
/// assert_eq!(graph.eval(f, &[1.0, 2.0], &[10.0]), 30.0);
/// // ∂f/∂x = a
/// assert_eq!(graph.derivative(f, 0, &mut Default::default()), Some(a));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// The nodes in the order of creation.
    nodes: Vec<Node>,
    /// True for nodes that depend on the coordinates.
    in_space: Vec<bool>,
    /// Index of each node: equal nodes are created once.
    known: HashMap<Node, NodeId>,
    /// Names of the nodes that have one.
    names: BTreeMap<NodeId, Name>,
}

impl Graph {
    /// Creates an empty graph.
    pub fn new() -> Self {
        Self::default()
    }
    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }
    /// Returns true if the graph has no nodes.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }
    /// Returns the operation of a node.
    pub fn node(&self, id: NodeId) -> &Node {
        &self.nodes[id.at()]
    }
    /// Returns the node of coordinate `i`, from 0.
    pub fn x(&mut self, i: usize) -> NodeId {
        self.insert(Node::X(i as u32))
    }
    /// Returns the node of parameter `i`, from 0.
    pub fn param(&mut self, i: usize) -> NodeId {
        self.insert(Node::Param(i as u32))
    }
    /// Names a node after the variable to which it is assigned. The first name is kept, unless it
    /// was only suggested.
    pub fn set_name(&mut self, id: NodeId, name: &str) {
        self.name_as(
            id,
            &Name {
                text: name.to_owned(),
                is_suggestion: false,
            },
        );
    }
    /// Suggests a name for a node that has none.
    pub fn suggest_name(&mut self, id: NodeId, name: &str) {
        self.name_as(
            id,
            &Name {
                text: name.to_owned(),
                is_suggestion: true,
            },
        );
    }
    /// Names a node as [`Graph::set_name`] or [`Graph::suggest_name`] does.
    pub fn name_as(&mut self, id: NodeId, name: &Name) {
        match self.names.entry(id) {
            Entry::Vacant(entry) => {
                entry.insert(name.clone());
            }
            Entry::Occupied(mut entry) => {
                if entry.get().is_suggestion && !name.is_suggestion {
                    entry.insert(name.clone());
                }
            }
        }
    }
    /// Returns the node's name, assigned or suggested; `None` if it has no name.
    pub fn name(&self, id: NodeId) -> Option<&str> {
        self.names.get(&id).map(|name| name.text.as_str())
    }
    /// Returns true if the node's name is only a suggestion.
    pub fn has_suggested_name(&self, id: NodeId) -> bool {
        self.names.get(&id).is_some_and(|name| name.is_suggestion)
    }

    /// Returns true if the node depends on the coordinates.
    pub(crate) fn is_in_space(&self, id: NodeId) -> bool {
        self.in_space[id.at()]
    }

    /// Returns the index of an equal node, which is created if necessary.
    fn insert(&mut self, node: Node) -> NodeId {
        if let Some(&id) = self.known.get(&node) {
            return id;
        }
        let id = NodeId(u32::try_from(self.nodes.len()).expect("fewer than 2^32 nodes"));
        let of = |u: &NodeId| self.in_space[u.at()];
        self.in_space.push(match &node {
            Node::X(_) => true,
            Node::Constant(_) | Node::Param(_) => false,
            Node::Unary(_, u) | Node::PowI(u, _) => of(u),
            Node::Binary(_, u, v) | Node::Set(_, u, v) => of(u) || of(v),
            Node::Select(c, u, v) => of(c) || of(u) || of(v),
            Node::Library(_, args) | Node::Native(_, args) => args.iter().any(of),
        });
        self.nodes.push(node.clone());
        self.known.insert(node, id);
        id
    }

    /// Returns the value of a constant; `None` for other nodes.
    pub fn constant_value(&self, id: NodeId) -> Option<f64> {
        match self.nodes[id.at()] {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Returns the node of the constant 0, if it exists.
    pub(crate) fn zero(&self) -> Option<NodeId> {
        self.known.get(&Node::Constant(0.0f64.to_bits())).copied()
    }

    /// Returns the arguments of a node, in order.
    pub fn arguments(&self, id: NodeId) -> Vec<NodeId> {
        match &self.nodes[id.at()] {
            Node::Constant(_) | Node::X(_) | Node::Param(_) => Vec::new(),
            Node::Unary(_, a) | Node::PowI(a, _) => vec![*a],
            Node::Binary(_, a, b) | Node::Set(_, a, b) => vec![*a, *b],
            Node::Select(c, a, b) => vec![*c, *a, *b],
            Node::Library(_, args) | Node::Native(_, args) => args.to_vec(),
        }
    }

    /// Returns, by node, true for the nodes on which the roots depend, including the roots.
    pub fn reachable(&self, roots: &[NodeId]) -> Vec<bool> {
        let mut need = vec![false; self.nodes.len()];
        for r in roots {
            need[r.at()] = true;
        }
        for i in (0..self.nodes.len()).rev() {
            if need[i] {
                for a in self.arguments(NodeId(i as u32)) {
                    need[a.at()] = true;
                }
            }
        }
        need
    }

    /// Rebuilds the nodes on which `root` depends in `target`, with the inputs replaced: coordinate
    /// i by `x[i]`, parameter i by `a[i]`. `named` is called for each node with a name.
    pub fn rewrite<O: Ops>(
        &self,
        root: NodeId,
        target: &mut O,
        x: &[O::V],
        a: &[O::V],
        named: impl FnMut(&mut O, &O::V, &Name),
    ) -> O::V {
        self.rewrite_all(&[root], target, x, a, named).remove(0)
    }

    /// Rebuilds several roots as [`Graph::rewrite`] does; shared nodes are rebuilt once.
    pub fn rewrite_all<O: Ops>(
        &self,
        roots: &[NodeId],
        target: &mut O,
        x: &[O::V],
        a: &[O::V],
        mut named: impl FnMut(&mut O, &O::V, &Name),
    ) -> Vec<O::V> {
        let need = self.reachable(roots);
        let mut value: Vec<Option<O::V>> = vec![None; self.nodes.len()];
        for (i, _) in need.iter().enumerate().filter(|(_, need)| **need) {
            let v = match &self.nodes[i] {
                Node::X(k) => x[*k as usize].clone(),
                Node::Param(k) => a[*k as usize].clone(),
                node => rebuilt(node, target, &value),
            };
            if let Some(name) = self.names.get(&NodeId(i as u32)) {
                named(target, &v, name);
            }
            value[i] = Some(v);
        }
        roots
            .iter()
            .map(|root| value[root.at()].clone().expect("the roots are needed"))
            .collect()
    }

    /// Rebuilds the nodes on which `root` depends, with `node` replaced `by` another. Returns the
    /// new nodes by the index of the old ones.
    pub(crate) fn replaced(
        &mut self,
        root: NodeId,
        node: NodeId,
        by: NodeId,
    ) -> Vec<Option<NodeId>> {
        let need = self.reachable(&[root]);
        let mut value: Vec<Option<NodeId>> = vec![None; need.len()];
        for i in (0..=root.at()).filter(|i| need[*i]) {
            let id = NodeId(i as u32);
            let is_same = |a: &NodeId| value[a.at()] == Some(*a);
            let new = if id == node {
                by
            } else if self.arguments(id).iter().all(is_same) {
                id
            } else {
                let old = self.nodes[i].clone();
                let new = rebuilt(&old, self, &value);
                if let Some(name) = self.names.get(&id).cloned() {
                    self.name_as(new, &name);
                }
                new
            };
            value[i] = Some(new);
        }
        value
    }

    /// Evaluates f at a point, in any number type, as defined by HyperFun (the algebraic
    /// interpretation).
    ///
    /// # Panics
    /// If `x` or `a` is shorter than the inputs that the expression uses.
    pub fn eval<R: Real>(&self, root: NodeId, x: &[R], a: &[R]) -> R {
        self.rewrite(root, &mut Direct::<R>::new(), x, a, |_, _, _| {})
    }

    /// Returns the numbers of coordinates and parameters that `root` uses (highest index plus one).
    pub fn inputs(&self, root: NodeId) -> (usize, usize) {
        self.inputs_of(&[root])
    }

    /// Returns the numbers of coordinates and parameters that any of several roots uses.
    pub(crate) fn inputs_of(&self, roots: &[NodeId]) -> (usize, usize) {
        let need = self.reachable(roots);
        let mut n = (0, 0);
        for (node, _) in self.nodes.iter().zip(&need).filter(|(_, need)| **need) {
            match node {
                Node::X(i) => n.0 = n.0.max(*i as usize + 1),
                Node::Param(i) => n.1 = n.1.max(*i as usize + 1),
                _ => {}
            }
        }
        n
    }

    /// Expands library nodes into their formulas: arithmetic, set operations and native functions.
    pub fn lowered(&mut self, root: NodeId) -> NodeId {
        self.lowered_all(&[root]).remove(0)
    }

    /// Returns the nodes of the first nx coordinates and the first na parameters.
    pub(crate) fn input_nodes(&mut self, (nx, na): (usize, usize)) -> (Vec<NodeId>, Vec<NodeId>) {
        let x = (0..nx).map(|i| self.x(i)).collect();
        let a = (0..na).map(|i| self.param(i)).collect();
        (x, a)
    }

    /// Expands the library nodes of several roots as [`Graph::lowered`] does.
    pub(crate) fn lowered_all(&mut self, roots: &[NodeId]) -> Vec<NodeId> {
        let source = self.clone();
        let (x, a) = self.input_nodes(source.inputs_of(roots));
        source.rewrite_all(roots, &mut Lowering(self), &x, &a, |_, _, _| {})
    }

    /// Returns ∂root/∂xᵢ as an expression, for a lowered graph; `None` if a native function depends
    /// on xᵢ. `memo` keeps the derivatives of one `axis` between calls.
    pub fn derivative(
        &mut self,
        root: NodeId,
        axis: usize,
        memo: &mut HashMap<NodeId, NodeId>,
    ) -> Option<NodeId> {
        if let Some(&d) = memo.get(&root) {
            return Some(d);
        }
        let need = self.reachable(&[root]);
        let zero = self.constant(0.0);
        for (i, needed) in need.iter().enumerate().take(root.at() + 1) {
            let id = NodeId(i as u32);
            if !needed || memo.contains_key(&id) {
                continue;
            }
            let arguments: Vec<NodeId> = self.arguments(id);
            let d = if arguments.iter().all(|a| memo[a] == zero) {
                if self.nodes[i] == Node::X(axis as u32) {
                    self.constant(1.0)
                } else {
                    zero
                }
            } else {
                self.chain_rule(id, &arguments, memo)?
            };
            memo.insert(id, d);
        }
        memo.get(&root).copied()
    }

    /// Returns ∂/∂xᵢ of a node from the derivatives `d` of its arguments; `None` for a native
    /// function.
    fn chain_rule(
        &mut self,
        id: NodeId,
        arguments: &[NodeId],
        d: &HashMap<NodeId, NodeId>,
    ) -> Option<NodeId> {
        let node = self.nodes[id.at()].clone();
        let du: Vec<NodeId> = arguments.iter().map(|a| d[a]).collect();
        let zero = self.constant(0.0);
        Some(match node {
            Node::Constant(_) | Node::X(_) | Node::Param(_) => zero,
            Node::Unary(op, u) => match op {
                Unary::Floor | Unary::Ceil | Unary::Trunc | Unary::Sign => zero,
                _ => {
                    let slope = self.unary_slope(op, u, id);
                    self.product(slope, du[0])
                }
            },
            Node::PowI(u, n) => {
                let p = self.powi(&u, n - 1);
                let s = self.scale(f64::from(n), &p);
                self.product(s, du[0])
            }
            Node::Binary(op, u, v) => self.binary_derivative(op, id, [u, v], [du[0], du[1]]),
            Node::Set(op, u, v) => self.set_derivative(op, id, [u, v], [du[0], du[1]]),
            Node::Select(c, _, _) => self.select(&c, &du[1], &du[2]),
            Node::Library(..) | Node::Native(..) => return None,
        })
    }

    /// Returns the derivative of the node `id`, a function of u and v, from their derivatives.
    fn binary_derivative(
        &mut self,
        op: Binary,
        id: NodeId,
        [u, v]: [NodeId; 2],
        [du, dv]: [NodeId; 2],
    ) -> NodeId {
        match op {
            Binary::Add => self.sum(du, dv),
            Binary::Sub => self.difference(du, dv),
            Binary::Mul => {
                let (p, q) = (self.product(du, v), self.product(u, dv));
                self.sum(p, q)
            }
            Binary::Div => {
                let q = self.product(id, dv);
                let n = self.difference(du, q);
                self.div(&n, &v)
            }
            Binary::Pow => self.power_derivative(id, [u, v], [du, dv]),
            Binary::Atan2 => self.angle_derivative([u, v], [du, dv]),
            Binary::Less | Binary::LessEq => self.constant(0.0),
        }
    }

    /// Returns (v u'/u + v' ln u) u^v, the derivative of the node `id` = u^v.
    fn power_derivative(
        &mut self,
        id: NodeId,
        [u, v]: [NodeId; 2],
        [du, dv]: [NodeId; 2],
    ) -> NodeId {
        let (q, l) = (self.div(&v, &u), self.unary(Unary::Ln, &u));
        let (p, q) = (self.product(q, du), self.product(l, dv));
        let s = self.sum(p, q);
        self.product(s, id)
    }

    /// Returns (v u' − u v')/(u² + v²), the derivative of the angle of the point (x = v, y = u).
    fn angle_derivative(&mut self, [u, v]: [NodeId; 2], [du, dv]: [NodeId; 2]) -> NodeId {
        let (p, q) = (self.product(v, du), self.product(u, dv));
        let n = self.difference(p, q);
        let (u2, v2) = (self.square(&u), self.square(&v));
        let r = self.add(&u2, &v2);
        self.div(&n, &r)
    }

    /// Returns the derivative of the node `id`, a set operation on u and v, from their derivatives.
    fn set_derivative(
        &mut self,
        op: SetOp,
        id: NodeId,
        [u, v]: [NodeId; 2],
        [du, dv]: [NodeId; 2],
    ) -> NodeId {
        match op {
            SetOp::Max => {
                let c = self.less(&u, &v);
                self.select(&c, &dv, &du)
            }
            SetOp::Min => {
                let c = self.less(&v, &u);
                self.select(&c, &dv, &du)
            }
            SetOp::RUnion => self.r_derivative(true, id, [u, v], [du, dv]),
            SetOp::RIntersection => self.r_derivative(false, id, [u, v], [du, dv]),
        }
    }

    /// Returns u' + v' ± (u u' + v v')/h, the derivative of the R-function w = `id`; h = √(u² + v²)
    /// is |w − (u + v)|, and its derivative is set to 0 where h = 0.
    fn r_derivative(
        &mut self,
        is_union: bool,
        id: NodeId,
        [u, v]: [NodeId; 2],
        [du, dv]: [NodeId; 2],
    ) -> NodeId {
        let s = self.add(&u, &v);
        let h = if is_union {
            self.sub(&id, &s)
        } else {
            self.sub(&s, &id)
        };
        let (p, q) = (self.product(u, du), self.product(v, dv));
        let n = self.sum(p, q);
        let (zero, one) = (self.constant(0.0), self.constant(1.0));
        let positive = self.less(&zero, &h);
        let safe = self.select(&positive, &h, &one);
        let r = self.div(&n, &safe);
        let d = self.sum(du, dv);
        if is_union {
            self.sum(d, r)
        } else {
            self.difference(d, r)
        }
    }

    /// Returns the derivative of `id` = op(u) by u.
    fn unary_slope(&mut self, op: Unary, u: NodeId, id: NodeId) -> NodeId {
        let one = self.constant(1.0);
        match op {
            Unary::Neg => self.constant(-1.0),
            Unary::Abs => self.unary(Unary::Sign, &u),
            Unary::Square => self.scale(2.0, &u),
            Unary::Sqrt => self.root_slope(id),
            Unary::Exp => id,
            Unary::Ln => self.div(&one, &u),
            Unary::Sin => self.unary(Unary::Cos, &u),
            Unary::Cos => {
                let s = self.unary(Unary::Sin, &u);
                self.neg(&s)
            }
            Unary::Tan | Unary::Tanh => {
                let t2 = self.square(&id);
                if op == Unary::Tan {
                    self.add(&one, &t2)
                } else {
                    self.sub(&one, &t2)
                }
            }
            Unary::Asin => self.arcsine_slope(u),
            Unary::Acos => {
                let r = self.arcsine_slope(u);
                self.neg(&r)
            }
            Unary::Atan => {
                let u2 = self.square(&u);
                let q = self.add(&one, &u2);
                self.div(&one, &q)
            }
            Unary::Sinh => self.unary(Unary::Cosh, &u),
            Unary::Cosh => self.unary(Unary::Sinh, &u),
            Unary::Floor | Unary::Ceil | Unary::Trunc | Unary::Sign => self.constant(0.0),
        }
    }

    /// Returns 1/(2w), the derivative of the root w = `id`; 0 at its singularity, as in the jets.
    fn root_slope(&mut self, id: NodeId) -> NodeId {
        let one = self.constant(1.0);
        let (zero, half) = (self.constant(0.0), self.constant(0.5));
        let positive = self.less(&zero, &id);
        let safe = self.select(&positive, &id, &one);
        let d = self.div(&half, &safe);
        self.select(&positive, &d, &zero)
    }

    /// Returns 1/√(1 − u²).
    fn arcsine_slope(&mut self, u: NodeId) -> NodeId {
        let one = self.constant(1.0);
        let u2 = self.square(&u);
        let q = self.sub(&one, &u2);
        let q = self.sqrt(&q);
        self.div(&one, &q)
    }

    /// Returns u·v in a derivative: a factor that is the constant 0 denotes independence, so that
    /// the product vanishes even if the other factor is infinite, which constant folding in general
    /// must not assume.
    fn product(&mut self, u: NodeId, v: NodeId) -> NodeId {
        let zero = self.constant(0.0);
        if u == zero || v == zero {
            zero
        } else {
            self.mul(&u, &v)
        }
    }
    /// Returns u + v in a derivative, see [`Self::product`].
    fn sum(&mut self, u: NodeId, v: NodeId) -> NodeId {
        let zero = self.constant(0.0);
        if u == zero {
            v
        } else if v == zero {
            u
        } else {
            self.add(&u, &v)
        }
    }
    /// Returns u − v in a derivative, see [`Self::product`].
    fn difference(&mut self, u: NodeId, v: NodeId) -> NodeId {
        let zero = self.constant(0.0);
        if v == zero {
            u
        } else if u == zero {
            self.neg(&v)
        } else {
            self.sub(&u, &v)
        }
    }

    /// Returns the values of the arguments if all of them are constants.
    fn folded(&self, args: &[NodeId]) -> Option<Vec<f64>> {
        args.iter().map(|a| self.constant_value(*a)).collect()
    }
}

/// Rebuilds a node other than an input in `target`, with the values of its arguments.
#[inline]
fn rebuilt<O: Ops>(node: &Node, target: &mut O, value: &[Option<O::V>]) -> O::V {
    let get = |id: &NodeId| {
        let value = value[id.at()].as_ref();
        value.expect("arguments precede their users")
    };
    let all = |args: &[NodeId]| -> Vec<O::V> { args.iter().map(|id| get(id).clone()).collect() };
    match node {
        Node::Constant(bits) => target.constant(f64::from_bits(*bits)),
        Node::X(_) | Node::Param(_) => unreachable!("inputs are replaced by the caller"),
        Node::Unary(op, u) => target.unary(*op, get(u)),
        Node::Binary(op, u, v) => target.binary(*op, get(u), get(v)),
        Node::PowI(u, n) => target.powi(get(u), *n),
        Node::Set(op, u, v) => target.set(*op, get(u), get(v)),
        Node::Select(c, u, v) => target.select(get(c), get(u), get(v)),
        Node::Library(f, args) => target.library(*f, &all(args)),
        Node::Native(f, args) => target.native(f.clone(), &all(args)),
    }
}

/// Builder of a graph that expands library functions.
struct Lowering<'a>(&'a mut Graph);

impl Ops for Lowering<'_> {
    type V = NodeId;
    fn constant(&mut self, c: f64) -> NodeId {
        self.0.constant(c)
    }
    fn unary(&mut self, op: Unary, a: &NodeId) -> NodeId {
        self.0.unary(op, a)
    }
    fn binary(&mut self, op: Binary, a: &NodeId, b: &NodeId) -> NodeId {
        self.0.binary(op, a, b)
    }
    fn powi(&mut self, a: &NodeId, n: i32) -> NodeId {
        self.0.powi(a, n)
    }
    fn set(&mut self, op: SetOp, a: &NodeId, b: &NodeId) -> NodeId {
        self.0.set(op, a, b)
    }
    fn select(&mut self, condition: &NodeId, a: &NodeId, b: &NodeId) -> NodeId {
        self.0.select(condition, a, b)
    }
    fn library(&mut self, f: Library, args: &[NodeId]) -> NodeId {
        f.algebraic(self.0, args)
    }
    fn native(&mut self, f: Native, args: &[NodeId]) -> NodeId {
        self.0.native(f, args)
    }
    fn known(&self, v: &NodeId) -> Option<f64> {
        self.0.known(v)
    }
}

impl Ops for Graph {
    type V = NodeId;

    fn constant(&mut self, c: f64) -> NodeId {
        self.insert(Node::Constant(if c == 0.0 {
            0.0f64.to_bits()
        } else {
            c.to_bits()
        }))
    }
    fn unary(&mut self, op: Unary, a: &NodeId) -> NodeId {
        if let Some(c) = self.constant_value(*a) {
            return self.constant(op.apply(&c));
        }
        match (op, &self.nodes[a.at()]) {
            (Unary::Neg, Node::Unary(Unary::Neg, u)) => *u,
            (Unary::Square | Unary::Abs, Node::Unary(Unary::Neg | Unary::Abs, u)) => {
                let u = *u;
                self.insert(Node::Unary(op, u))
            }
            _ => self.insert(Node::Unary(op, *a)),
        }
    }
    fn binary(&mut self, op: Binary, a: &NodeId, b: &NodeId) -> NodeId {
        let (ca, cb) = (self.constant_value(*a), self.constant_value(*b));
        if let (Some(u), Some(v)) = (ca, cb) {
            return self.constant(op.apply(&u, &v));
        }
        match (op, ca, cb) {
            (Binary::Add, Some(0.0), _) | (Binary::Mul, Some(1.0), _) => *b,
            (Binary::Add | Binary::Sub, _, Some(0.0))
            | (Binary::Mul | Binary::Div, _, Some(1.0)) => *a,
            (Binary::Sub, Some(0.0), _) | (Binary::Mul, Some(-1.0), _) => self.neg(b),
            (Binary::Mul, _, Some(-1.0)) => self.neg(a),
            (Binary::Mul, ..) if a == b => self.square(a),
            // Arguments of commutative operations are sorted, so that equal subexpressions
            // coincide.
            (Binary::Add | Binary::Mul, ..) if b < a => self.insert(Node::Binary(op, *b, *a)),
            _ => self.insert(Node::Binary(op, *a, *b)),
        }
    }
    fn powi(&mut self, a: &NodeId, n: i32) -> NodeId {
        match n {
            0 => self.constant(1.0),
            1 => *a,
            2 => self.square(a),
            _ => match self.constant_value(*a) {
                Some(c) => self.constant(Real::powi(&c, n)),
                None => self.insert(Node::PowI(*a, n)),
            },
        }
    }
    fn set(&mut self, op: SetOp, a: &NodeId, b: &NodeId) -> NodeId {
        match self.folded(&[*a, *b]) {
            Some(c) => self.constant(op.apply(&c[0], &c[1])),
            None if a == b && matches!(op, SetOp::Max | SetOp::Min) => *a,
            None => self.insert(Node::Set(op, *a, *b)),
        }
    }
    fn select(&mut self, condition: &NodeId, a: &NodeId, b: &NodeId) -> NodeId {
        match self.constant_value(*condition) {
            Some(c) => {
                if c != 0.0 {
                    *a
                } else {
                    *b
                }
            }
            None if a == b => *a,
            None => self.insert(Node::Select(*condition, *a, *b)),
        }
    }
    fn library(&mut self, f: Library, args: &[NodeId]) -> NodeId {
        match self.folded(args) {
            Some(c) => {
                let v = f.algebraic(&mut Direct::<f64>::new(), &c);
                self.constant(v)
            }
            None => self.insert(Node::Library(f, args.into())),
        }
    }
    fn native(&mut self, f: Native, args: &[NodeId]) -> NodeId {
        match self.folded(args) {
            Some(c) => self.constant(f.eval(&c)),
            None => self.insert(Node::Native(f, args.into())),
        }
    }
    fn known(&self, v: &NodeId) -> Option<f64> {
        self.constant_value(*v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::Jet1;

    #[test]
    fn equal_subexpressions_are_one_node() {
        let mut g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let a = g.add(&x, &y);
        let b = g.add(&y, &x);
        assert_eq!(a, b);
        let m = g.mul(&a, &b);
        assert_eq!(g.node(m), &Node::Unary(Unary::Square, a));
    }

    #[test]
    fn symbolic_derivative_agrees_with_jets() {
        let mut g = Graph::new();
        let (x, y, z, a) = (g.x(0), g.x(1), g.x(2), g.param(0));
        let s = g.library(Library::Sphere, &[x, y, z, a, y, a, a]);
        let t = g.unary(Unary::Sin, &x);
        let t = g.div(&t, &z);
        let u = g.set(SetOp::RUnion, &s, &t);
        let e = g.unary(Unary::Exp, &y);
        let v = g.set(SetOp::Min, &u, &e);
        let p = g.powi(&v, 3);
        let q = g.binary(Binary::Atan2, &p, &z);
        let root = g.lowered(q);
        let at = [0.3, -0.2, 0.8];
        let jets: [Jet1<3>; 3] = std::array::from_fn(|i| Jet1::variable(at[i], i));
        let want = g.eval(q, &jets, &[Jet1::constant(0.4)]);
        for axis in 0..3 {
            let d = g
                .derivative(root, axis, &mut HashMap::new())
                .expect("no native function");
            let got = g.eval(d, &at, &[0.4]);
            assert!(
                (got - want.g[axis]).abs() < 1e-12 * (1.0 + got.abs()),
                "{axis}: {got} against {}",
                want.g[axis]
            );
        }
    }
}
