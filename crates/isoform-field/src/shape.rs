//! Metric and parts interpretations of an expression.
//!
//! In a [`Shape`] set operations are resolved to minima and maxima over faces: u | v and max(u, v)
//! become a maximum, u & v and min(u, v) a minimum, negation swaps them (a subtraction is an
//! intersection with the negated function). Each face g carries its unit-gradient form: the closed
//! one of a primitive ([`Library::metric`]; a block has six sides), else g/|∇g|, the first-order
//! distance (Taubin 1991), with a second Newton step where R-functions are blended inside. The
//! min/max tree over these approximates a signed distance: at the minimum of a fit it attains the
//! statistical limit, from which the values of R-functions deviate by 4 to 15 standard deviations.
//!
//! The smooth pieces of a face and their names are determined as those of a mesh ([`PieceNaming`]),
//! so that the parts of a fit, of a mesh and of patches have identical names. One piece may be
//! several parts, if two bodies share a plane, or for the two faces of a slab.

use crate::graph::{Graph, Node, NodeId};
use crate::library::{Family, Library};
use crate::ops::{Binary, Ops, SetOp, Unary};
use crate::smooth::Random;
use crate::split::{NamedTree, PieceNaming};
use crate::tape::Tape;
use isoform_geom::Point3;
use isoform_num::Jet1;
use std::collections::HashMap;

/// A smooth piece of the surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Name derived from the program: the variable to which the piece is assigned, and its side.
    /// Parts of one piece share it.
    pub name: String,
}

/// Maximum number of parts; further subtrees are one part each. Each part takes time proportional
/// to the size of the whole expression: with more, programs of many thousand bodies take minutes.
const MAX_PARTS: usize = 4096;

/// Maximum number of parts up to which products are split into slabs and faces into several pieces,
/// each of which costs a copy of the expression.
const MAX_SPLIT_PARTS: usize = 256;

/// Number of sample points at which the pieces of a face must have its sign. If the sign of a
/// parameter affects how they are joined, every second sample detects it.
const SIGN_SAMPLES: usize = 48;

/// Face of the solid: one distance, and one or several smooth parts.
#[derive(Clone, Debug, PartialEq)]
struct ShapeFace {
    /// Approximate signed distance.
    distance: NodeId,
    /// Index of the deciding part, as an expression.
    part: NodeId,
    /// Minima and maxima over the face's parts, in the order of computation.
    tree: Vec<Join>,
}

/// Step of the tree of minima and maxima over faces, in the order of computation. A program may
/// join thousands of bodies successively, and recursion over its tree would overflow the stack.
#[derive(Clone, Debug, PartialEq)]
enum FaceStep {
    /// The value of a face.
    Face(ShapeFace),
    /// The minimum or maximum of the last two unused results.
    Join {
        /// True for the minimum.
        is_min: bool,
    },
}

/// Step of the tree of minima and maxima over parts, in the order of computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Join {
    /// The value of the part with this index.
    Part(u32),
    /// The minimum of the last two unused results.
    Min,
    /// The maximum of the last two unused results.
    Max,
}

impl Join {
    /// Returns the minimum or the maximum.
    fn new(is_min: bool) -> Self {
        if is_min { Self::Min } else { Self::Max }
    }
}

impl FaceStep {
    /// Returns the equivalent steps over parts.
    fn joins(&self) -> Vec<Join> {
        match self {
            Self::Face(face) => face.tree.clone(),
            Self::Join { is_min } => vec![Join::new(*is_min)],
        }
    }
}

/// Pending task of the interpretation.
enum ReadTask {
    /// To interpret a node, or the negative of its function.
    Read { id: NodeId, negative: bool },
    /// To join the last two results.
    Join { is_min: bool },
}

/// Metric and parts interpretations of an expression.
///
/// ```
/// use isoform_field::{Graph, Shape, hyperfun::{Mode, Model}};
///
/// let text = "my_model(x[3], a[1]) {
///   ball = a[1]^2 - x[1]^2 - x[2]^2 - x[3]^2;
///   my_model = ball & x[3];
/// }";
/// let mut graph = Graph::new();
/// let root = Model::parse(text, Mode::Default)?.compile(&mut graph).expect("an expression");
/// let shape = Shape::new(&mut graph, root);
/// let names: Vec<&str> = shape.parts.iter().map(|part| part.name.as_str()).collect();
/// assert_eq!(names, ["ball", "z_min"]);
/// // At (0, 0, 1) the plane is one away, and at (0, 0, 1.99) the ball of radius 2 a hundredth.
/// assert_eq!(graph.eval(shape.distance, &[0.0, 0.0, 0.25], &[2.0]), 0.25);
/// let near = graph.eval(shape.distance, &[0.0, 0.0, 1.99], &[2.0]);
/// assert!((near - 0.01).abs() < 1e-4);
/// assert_eq!(graph.eval(shape.part, &[0.0, 0.0, 1.99], &[2.0]), 0.0);
/// # Ok::<(), isoform_field::hyperfun::SyntaxError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Shape {
    /// The smooth pieces.
    pub parts: Vec<Part>,
    /// Approximate signed distance, positive inside, as an expression of the graph.
    pub distance: NodeId,
    /// Index of the deciding part, as an expression of the graph.
    pub part: NodeId,
    /// Functions whose zero sets are the parts, positive inside, as expressions of the graph:
    /// smooth, and not divided by the norms of their gradients.
    pub pieces: Vec<NodeId>,
    /// Minima and maxima over the parts that define the solid, in the order of computation.
    pub tree: Vec<Join>,
}

impl Shape {
    /// Interprets the expression `root` of the graph, to which the new expressions are added.
    pub fn new(graph: &mut Graph, root: NodeId) -> Self {
        let mut reader = ShapeReader {
            graph,
            parts: Vec::new(),
            pieces: Vec::new(),
            naming: None,
            taken: HashMap::new(),
            memo: Default::default(),
        };
        // The naming works on a copy: node indices determine the order of sums in derivatives,
        // which must not depend on the names of parts.
        reader.naming = PieceNaming::new(reader.graph, root);
        let steps = reader.read(root);
        let (parts, pieces) = (reader.parts, reader.pieces);
        let (distance, part) = joined(graph, &steps);
        Self {
            parts,
            distance,
            part,
            pieces,
            tree: steps.iter().flat_map(FaceStep::joins).collect(),
        }
    }
}

/// Value of the tree and the index of the deciding part.
type ValueAndPart = (NodeId, NodeId);

/// Returns the minimum or maximum of two values; of equal ones the first decides.
fn decided(
    g: &mut Graph,
    is_min: bool,
    (u, pu): ValueAndPart,
    (v, pv): ValueAndPart,
) -> ValueAndPart {
    let second = if is_min {
        g.less(&v, &u)
    } else {
        g.less(&u, &v)
    };
    let value = if is_min { g.min(&u, &v) } else { g.max(&u, &v) };
    (value, g.select(&second, &pv, &pu))
}

/// Returns the tree's value and the index of the deciding part.
fn joined(g: &mut Graph, steps: &[FaceStep]) -> ValueAndPart {
    let mut results: Vec<ValueAndPart> = Vec::new();
    for step in steps {
        let result = match step {
            FaceStep::Face(face) => (face.distance, face.part),
            FaceStep::Join { is_min } => {
                let v = results.pop().expect("a join has two inputs");
                let u = results.pop().expect("a join has two inputs");
                decided(g, *is_min, u, v)
            }
        };
        results.push(result);
    }
    results.pop().expect("a tree has a root")
}

/// Origin of a face in the expression.
#[derive(Clone, Copy)]
struct FaceSource {
    /// The node.
    id: NodeId,
    /// Side of a primitive; `None` if the face is the whole node.
    side: Option<usize>,
    /// True if the node is subtracted.
    negative: bool,
}

impl FaceSource {
    /// Returns the origin of a face that is a whole node.
    fn whole(id: NodeId, negative: bool) -> Self {
        Self {
            id,
            side: None,
            negative,
        }
    }
}

/// Interpretation of an expression, face by face.
struct ShapeReader<'a> {
    graph: &'a mut Graph,
    /// The parts so far.
    parts: Vec<Part>,
    /// Functions of the parts.
    pieces: Vec<NodeId>,
    /// Names of pieces; `None` for programs with too many pieces, whose parts have the names of
    /// their nodes.
    naming: Option<PieceNaming>,
    /// Number of parts with the name of a node, by name.
    taken: HashMap<String, u32>,
    /// Derivatives by axis, shared between pieces.
    memo: [HashMap<NodeId, NodeId>; 3],
}

impl ShapeReader<'_> {
    /// Builds the tree of minima and maxima over faces.
    fn read(&mut self, root: NodeId) -> Vec<FaceStep> {
        let (mut steps, mut tasks) = (Vec::new(), Vec::new());
        tasks.push(ReadTask::Read {
            id: root,
            negative: false,
        });
        while let Some(task) = tasks.pop() {
            match task {
                ReadTask::Join { is_min } => steps.push(FaceStep::Join { is_min }),
                ReadTask::Read { id, negative } => self.open(id, negative, &mut tasks, &mut steps),
            }
        }
        steps
    }

    /// Expands one level of a node into further tasks, to be done from last to first, or into
    /// steps.
    fn open(
        &mut self,
        id: NodeId,
        negative: bool,
        tasks: &mut Vec<ReadTask>,
        steps: &mut Vec<FaceStep>,
    ) {
        let pair = |u: NodeId, v: NodeId, maximum: bool| {
            [
                ReadTask::Join {
                    is_min: maximum == negative,
                },
                ReadTask::Read { id: v, negative },
                ReadTask::Read { id: u, negative },
            ]
        };
        if self.parts.len() >= MAX_PARTS {
            return steps.push(FaceStep::Face(self.leaf(id, negative)));
        }
        match self.graph.node(id).clone() {
            Node::Unary(Unary::Neg, u) => {
                tasks.push(ReadTask::Read {
                    id: u,
                    negative: !negative,
                });
            }
            Node::Set(op, u, v) => {
                tasks.extend(pair(u, v, matches!(op, SetOp::Max | SetOp::RUnion)));
            }
            Node::Binary(Binary::Mul, u, v) => {
                if let Some((set, c)) = self.scaled_set(u, v) {
                    tasks.push(ReadTask::Read {
                        id: set,
                        negative: negative != (c < 0.0),
                    });
                } else if !self.slab(id, [u, v], negative, steps) {
                    steps.push(FaceStep::Face(self.leaf(id, negative)));
                }
            }
            // A signed-distance set operation has the sharp zero set of max or min; each blend is a
            // smooth piece.
            Node::Library(f, args) => match f.family() {
                Family::Sardf { is_union } => tasks.extend(pair(args[0], args[1], is_union)),
                Family::Primitive => self.primitive(id, f, &args, negative, steps),
                Family::Circular { .. } | Family::Displaced => {
                    steps.push(FaceStep::Face(self.leaf(id, negative)));
                }
            },
            _ => steps.push(FaceStep::Face(self.leaf(id, negative))),
        }
    }

    /// Returns the set operation or primitive that is multiplied by a constant in u·v, and the
    /// constant: a positive factor preserves the surface.
    fn scaled_set(&self, u: NodeId, v: NodeId) -> Option<(NodeId, f64)> {
        let factor = |c: NodeId| self.graph.constant_value(c).filter(|c| *c != 0.0);
        match (factor(u), factor(v)) {
            (Some(c), _) if self.has_sets(v) => Some((v, c)),
            (_, Some(c)) if self.has_sets(u) => Some((u, c)),
            _ => None,
        }
    }

    /// Returns true if the node is a set operation or a primitive, up to its sign.
    fn has_sets(&self, mut id: NodeId) -> bool {
        loop {
            match self.graph.node(id) {
                Node::Set(..) => return true,
                Node::Library(f, _) => return f.is_primitive(),
                Node::Unary(Unary::Neg, u) => id = *u,
                _ => return false,
            }
        }
    }

    /// Returns the named pieces of a face.
    fn named(&mut self, of: FaceSource) -> Option<NamedTree> {
        let naming = self.naming.as_mut()?;
        match of.side {
            Some(side) => naming.name_side(of.id, side, of.negative),
            None => naming.name_node(of.id, of.negative),
        }
    }

    /// Creates the face with this distance and the parts of its named pieces; the one part `piece`
    /// if the face is one piece or its pieces are unknown.
    fn face(&mut self, of: FaceSource, piece: NodeId, distance: NodeId) -> ShapeFace {
        let (part, tree) = match self.named(of) {
            Some(NamedTree::Piece { name, .. }) => self.single(name.to_string(), piece),
            Some(named) => match self.several(&named, piece) {
                Some(several) => several,
                None => self.single_of(of.id, piece),
            },
            None => self.single_of(of.id, piece),
        };
        ShapeFace {
            distance,
            part,
            tree,
        }
    }

    /// Adds a part; returns the index and the tree of a face of this part alone.
    fn single(&mut self, name: String, piece: NodeId) -> (NodeId, Vec<Join>) {
        let part = self.part(name, piece);
        (self.graph.constant(f64::from(part)), vec![Join::Part(part)])
    }

    /// Adds a part with the name of its node; returns the index and the tree of a face of this part
    /// alone.
    fn single_of(&mut self, id: NodeId, piece: NodeId) -> (NodeId, Vec<Join>) {
        let name = self.own_name(id);
        self.single(name, piece)
    }

    /// Adds several parts; returns the index of the deciding one and the tree of the face. `None`
    /// if there are too many parts, or if they form the face `whole` for some values of the
    /// parameters only.
    fn several(&mut self, named: &NamedTree, whole: NodeId) -> Option<(NodeId, Vec<Join>)> {
        let roots = named.pieces();
        if self.parts.len() + roots.len() > MAX_SPLIT_PARTS {
            return None;
        }
        let from = self.naming.as_ref()?.graph();
        let (x, a) = self.graph.input_nodes(from.inputs_of(&roots));
        let roots = from.rewrite_all(&roots, self.graph, &x, &a, |_, _, _| {});
        let pieces = self.graph.lowered_all(&roots);
        if !self.has_sign(named, &pieces, whole) {
            return None;
        }
        let mut tree = Vec::new();
        let (_, part) = self.chosen(named, &mut pieces.into_iter(), &mut tree);
        Some((part, tree))
    }

    /// Returns true if the pieces together have the sign of `whole` at pseudo-random points, for
    /// pseudo-random parameters of both signs.
    fn has_sign(&self, named: &NamedTree, pieces: &[NodeId], whole: NodeId) -> bool {
        let roots: Vec<NodeId> = pieces.iter().copied().chain([whole]).collect();
        let (nx, na) = self.graph.inputs_of(&roots);
        let tape = Tape::new(self.graph, &roots, nx, na);
        let (mut random, mut scratch) = (Random::new(), Vec::new());
        (0..SIGN_SAMPLES).all(|_| {
            let (x, a) = (random.place(nx), random.place(na));
            let mut values = tape.eval_all(&x, &a, &mut scratch);
            let whole = values.pop().expect("the whole is the last one");
            let together = named.value(&mut values.into_iter());
            // Undefined values, and values at rounding level, are inconclusive.
            !(together.abs() > 1e-9 && whole.abs() > 1e-9) || (together > 0.0) == (whole > 0.0)
        })
    }

    /// Adds the parts of named pieces and joins them; returns their value and the index of the
    /// deciding part.
    fn chosen(
        &mut self,
        named: &NamedTree,
        pieces: &mut impl Iterator<Item = NodeId>,
        tree: &mut Vec<Join>,
    ) -> ValueAndPart {
        match named {
            NamedTree::Piece { name, .. } => {
                let piece = pieces.next().expect("one for each name");
                let (part, join) = self.single(name.to_string(), piece);
                tree.extend(join);
                (piece, part)
            }
            NamedTree::Join { is_min, children } => {
                let (first, rest) = children.split_first().expect("a join has children");
                let mut result = self.chosen(first, pieces, tree);
                for child in rest {
                    let next = self.chosen(child, pieces, tree);
                    tree.push(Join::new(*is_min));
                    result = decided(self.graph, *is_min, result, next);
                }
                result
            }
        }
    }

    /// Returns a unique name derived from that of the node, for pieces without a name.
    fn own_name(&mut self, id: NodeId) -> String {
        let base = self
            .graph
            .name(id)
            .map_or_else(|| format!("piece{}", self.parts.len() + 1), str::to_owned);
        let n = self.taken.entry(base.clone()).or_insert(0);
        *n += 1;
        if *n > 1 { format!("{base}#{n}") } else { base }
    }

    /// Adds a part with the function `piece`; returns its index.
    fn part(&mut self, name: String, piece: NodeId) -> u32 {
        self.parts.push(Part { name });
        self.pieces.push(piece);
        self.parts.len() as u32 - 1
    }

    /// Adds a primitive: one face per side, joined by minima.
    fn primitive(
        &mut self,
        id: NodeId,
        f: Library,
        args: &[NodeId],
        negative: bool,
        steps: &mut Vec<FaceStep>,
    ) {
        let rigid = self.is_rigid([args[0], args[1], args[2]]);
        let sides = f.metric(self.graph, args);
        if sides.is_empty() {
            return steps.push(FaceStep::Face(self.leaf(id, negative)));
        }
        for (k, (_, d)) in sides.into_iter().enumerate() {
            let piece = self.graph.lowered(d);
            // The sides of a twisted, tapered or scaled primitive are still smooth pieces, whose
            // gradients are not of unit length.
            let distance = if rigid {
                d
            } else {
                self.first_order(piece).unwrap_or(d)
            };
            let (piece, distance) = self.signed(negative, piece, distance);
            let side = FaceSource {
                id,
                side: Some(k),
                negative,
            };
            steps.push(FaceStep::Face(self.face(side, piece, distance)));
            if k > 0 {
                steps.push(FaceStep::Join { is_min: !negative });
            }
        }
    }

    /// Adds the two faces of a slab, a product u·v of functions with opposite gradients as in x·(a
    /// − x): the minimum of u and v, or of −u and −v if the slab is inverted. f/|∇f| of the product
    /// approximates the distance only far from the other face. Returns true if the product is a
    /// slab.
    fn slab(
        &mut self,
        id: NodeId,
        [u, v]: [NodeId; 2],
        negative: bool,
        steps: &mut Vec<FaceStep>,
    ) -> bool {
        if self.parts.len() >= MAX_SPLIT_PARTS {
            return false;
        }
        let Some(factor) = self.opposite(u, v) else {
            return false;
        };
        let sign = self.slab_sign(u, v, factor);
        let name = match self.named(FaceSource::whole(id, negative)) {
            Some(NamedTree::Piece { name, .. }) => name.to_string(),
            _ => self.own_name(id),
        };
        for factor in [u, v] {
            let function = self.graph.mul(&sign, &factor);
            let face = self.slab_face(function, negative, name.clone());
            steps.push(FaceStep::Face(face));
        }
        steps.push(FaceStep::Join { is_min: !negative });
        true
    }

    /// Returns the face of a slab where `function` vanishes.
    fn slab_face(&mut self, function: NodeId, negative: bool, name: String) -> ShapeFace {
        let face = self.graph.lowered(function);
        let distance = self.first_order(face).unwrap_or(face);
        let (piece, distance) = self.signed(negative, face, distance);
        let (part, tree) = self.single(name, piece);
        ShapeFace {
            distance,
            part,
            tree,
        }
    }

    /// Returns −1 for parameters for which the slab u·v with ∇u = −c ∇v is inverted, else 1: u + c
    /// v does not depend on x, and both factors can be negative at one point only if it is
    /// negative.
    fn slab_sign(&mut self, u: NodeId, v: NodeId, c: f64) -> NodeId {
        let scaled = self.graph.scale(c, &v);
        let sum = self.graph.add(&u, &scaled);
        let (_, na) = self.graph.inputs(sum);
        let a: Vec<NodeId> = (0..na).map(|i| self.graph.param(i)).collect();
        let origin = [self.graph.constant(0.0); 3];
        let source = self.graph.clone();
        let sum = source.rewrite(sum, self.graph, &origin, &a, |_, _, _| {});
        let zero = self.graph.constant(0.0);
        let is_inside_out = self.graph.less(&sum, &zero);
        let (minus, plus) = (self.graph.constant(-1.0), self.graph.constant(1.0));
        self.graph.select(&is_inside_out, &minus, &plus)
    }

    /// Returns the c > 0 with ∇u = −c ∇v everywhere and for all parameters, as tested at
    /// pseudo-random points; `None` if it does not exist or the gradients vanish.
    fn opposite(&mut self, u: NodeId, v: NodeId) -> Option<f64> {
        let mut known: Option<f64> = None;
        let mut random = Random::new();
        for _ in 0..4 {
            let (gu, gv) = self.gradients_at([u, v], &mut random)?;
            let (uv, vv) = (isoform_geom::dot(gu, gv), isoform_geom::dot(gv, gv));
            let c = -uv / vv;
            let rest: f64 = (0..3).map(|i| (gu[i] + c * gv[i]).abs()).sum();
            // 1e-9 as for rigid images: above rounding, below intended differences.
            let is_like = known.is_none_or(|k| (c - k).abs() <= 1e-9 * k);
            if !(c > 0.0 && c.is_finite() && rest <= 1e-9 * vv.sqrt() * c.max(1.0) && is_like) {
                return None;
            }
            known = known.or(Some(c));
        }
        known
    }

    /// Computes the gradients of two expressions at a pseudo-random point, for pseudo-random
    /// parameters.
    fn gradients_at(&self, of: [NodeId; 2], random: &mut Random) -> Option<(Point3, Point3)> {
        let (nx, na) = of.iter().fold((3, 0), |n, &p| {
            let (x, a) = self.graph.inputs(p);
            (n.0.max(x), n.1.max(a))
        });
        if nx > 3 {
            return None;
        }
        let (x, a) = random_jets(na, random);
        let [gu, gv] = of.map(|id| self.graph.eval(id, &x, &a).g);
        let is_finite = gu.iter().chain(&gv).all(|v| v.is_finite());
        is_finite.then_some((gu, gv))
    }

    /// Returns the face of a node g with the distance g/|∇g|, or g if a native function prevents
    /// differentiation.
    fn leaf(&mut self, id: NodeId, negative: bool) -> ShapeFace {
        let g = self.graph.lowered(id);
        let mut distance = self.first_order(g).unwrap_or(g);
        if self.has_r_functions(g) {
            distance = self.second_step(g, distance).unwrap_or(distance);
        }
        let (piece, distance) = self.signed(negative, g, distance);
        self.face(FaceSource::whole(id, negative), piece, distance)
    }

    /// Returns a piece's function and distance, negated if the piece is subtracted.
    fn signed(&mut self, negative: bool, piece: NodeId, distance: NodeId) -> (NodeId, NodeId) {
        if negative {
            (self.graph.neg(&piece), self.graph.neg(&distance))
        } else {
            (piece, distance)
        }
    }

    /// Returns ∇g and |∇g|² as expressions; `None` if a native function prevents differentiation or
    /// g is constant.
    fn gradient(&mut self, g: NodeId) -> Option<([NodeId; 3], NodeId)> {
        let zero = self.graph.constant(0.0);
        let (mut gradient, mut squares) = ([zero; 3], zero);
        for (axis, d) in gradient.iter_mut().enumerate() {
            *d = self.graph.derivative(g, axis, &mut self.memo[axis])?;
            let d2 = self.graph.square(d);
            squares = self.graph.add(&squares, &d2);
        }
        (squares != zero).then_some((gradient, squares))
    }

    /// Returns g/|∇g|; `None` as [`Self::gradient`].
    fn first_order(&mut self, g: NodeId) -> Option<NodeId> {
        let (_, squares) = self.gradient(g)?;
        let norm = self.graph.sqrt(&squares);
        // Where the gradient vanishes (at a centre, on an axis) the value is far from zero; any
        // finite result is acceptable.
        let tiny = self.graph.constant(1e-30);
        let norm = self.graph.max(&norm, &tiny);
        Some(self.graph.div(&g, &norm))
    }

    /// Returns true if the piece contains R-functions: its edges are then rounded with a small
    /// radius, and near them, within a few standard deviations of the noise, the relative error of
    /// the first-order distance is of order 1.
    fn has_r_functions(&self, g: NodeId) -> bool {
        let need = self.graph.reachable(&[g]);
        need.iter().enumerate().any(|(i, need)| {
            *need
                && matches!(
                    self.graph.node(NodeId(i as u32)),
                    Node::Set(SetOp::RUnion | SetOp::RIntersection, ..)
                )
        })
    }

    /// Returns the distance after one Newton step to the surface along the gradient: the sum of the
    /// first-order distances before and after it where the second is smaller, else the first.
    fn second_step(&mut self, g: NodeId, distance: NodeId) -> Option<NodeId> {
        let (_, na) = self.graph.inputs(g);
        let a: Vec<NodeId> = (0..na).map(|i| self.graph.param(i)).collect();
        let q = self.newton_step(g)?;
        let source = self.graph.clone();
        let rest = source.rewrite(distance, self.graph, &q, &a, |_, _, _| {});
        let (far, near) = (self.graph.abs(&distance), self.graph.abs(&rest));
        let helps = self.graph.less(&near, &far);
        let sum = self.graph.add(&distance, &rest);
        Some(self.graph.select(&helps, &sum, &distance))
    }

    /// Returns x − g ∇g/|∇g|², the Newton step from x to the surface.
    fn newton_step(&mut self, g: NodeId) -> Option<[NodeId; 3]> {
        let (gradient, squares) = self.gradient(g)?;
        let tiny = self.graph.constant(1e-60);
        let squares = self.graph.max(&squares, &tiny);
        let step = self.graph.div(&g, &squares);
        Some(std::array::from_fn(|axis| {
            let x = self.graph.x(axis);
            let by = self.graph.mul(&step, &gradient[axis]);
            self.graph.sub(&x, &by)
        }))
    }

    /// Returns true if the point (p, q, r) is a rigid image of space for all parameters: its
    /// Jacobian J must satisfy JᵀJ = 1, which is tested at pseudo-random points. A false result
    /// only costs the piece its closed form.
    fn is_rigid(&mut self, point: [NodeId; 3]) -> bool {
        if (0..3).all(|i| self.graph.node(point[i]) == &Node::X(i as u32)) {
            return true;
        }
        let (nx, na) = point.iter().fold((3, 0), |n, &p| {
            let (x, a) = self.graph.inputs(p);
            (n.0.max(x), n.1.max(a))
        });
        if nx > 3 {
            return false;
        }
        let mut random = Random::new();
        for _ in 0..4 {
            let (x, a) = random_jets(na, &mut random);
            if !is_orthonormal(point.map(|p| self.graph.eval(p, &x, &a).g)) {
                return false;
            }
        }
        true
    }
}

/// Returns a pseudo-random point, as the variable of jets, and pseudo-random values of `na`
/// parameters, all between −1 and 1.
fn random_jets(na: usize, random: &mut Random) -> ([Jet1<3>; 3], Vec<Jet1<3>>) {
    let x = std::array::from_fn(|i| Jet1::variable(2.0 * random.next() - 1.0, i));
    let a = (0..na).map(|_| isoform_num::Real::constant(2.0 * random.next() - 1.0));
    (x, a.collect())
}

/// Tolerance on rᵢ·rⱼ = 0 or 1 for orthonormal rows: rounding of a few rotations stays below 1e-14,
/// and scales of real models are never this close to 1.
const ORTHONORMALITY_TOLERANCE: f64 = 1e-9;

/// Returns true if three rows are orthogonal and of unit length.
fn is_orthonormal(rows: [Point3; 3]) -> bool {
    (0..3).all(|i| {
        (0..=i).all(|j| {
            let s: f64 = (0..3).map(|k| rows[i][k] * rows[j][k]).sum();
            (s - f64::from(u8::from(i == j))).abs() < ORTHONORMALITY_TOLERANCE
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's part: a block minus two cylinders.
    fn part(g: &mut Graph) -> NodeId {
        let x: Vec<NodeId> = (0..3).map(|i| g.x(i)).collect();
        let c = |g: &mut Graph, v: &[f64]| -> Vec<NodeId> {
            v.iter().map(|&v| g.constant(v)).collect()
        };
        let block = [x.clone(), c(g, &[-5.0, -4.0, -2.0, 10.0, 5.0, 4.0])].concat();
        let block = g.library(Library::Block, &block);
        g.set_name(block, "box");
        let hole = [x, c(g, &[-2.0, -1.5, 0.0, 1.25])].concat();
        let hole = g.library(Library::Cylinder(crate::Axis::Z), &hole);
        g.set_name(hole, "hole");
        let minus = g.neg(&hole);
        g.set(SetOp::RIntersection, &block, &minus)
    }

    #[test]
    fn distance_and_part_of_the_test_part() {
        let mut g = Graph::new();
        let root = part(&mut g);
        let shape = Shape::new(&mut g, root);
        let names: Vec<&str> = shape.parts.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "box.x_min",
                "box.x_max",
                "box.y_min",
                "box.y_max",
                "box.z_min",
                "box.z_max",
                "hole"
            ]
        );
        // (point, signed distance, nearest piece)
        for (p, d, name) in [
            ([4.0, -1.5, 1.9], 0.1, "box.z_max"),
            ([-4.9, 0.0, 0.0], 0.1, "box.x_min"),
            ([-2.0 + 1.45, -1.5, 0.0], 0.2, "hole"),
            ([-2.0 + 1.0, -1.5, 0.0], -0.25, "hole"),
            ([3.0, 1.3, 0.0], -0.3, "box.y_max"),
        ] {
            assert!((g.eval(shape.distance, &p, &[]) - d).abs() < 1e-12, "{p:?}");
            assert_eq!(
                shape.parts[g.eval(shape.part, &p, &[]) as usize].name,
                name,
                "{p:?}"
            );
        }
    }

    #[test]
    fn arithmetic_pieces_are_divided_by_their_gradient() {
        let mut g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        // 4 − (x² + 4y²): distance to first order near (2, 0) along x.
        let (x2, y2) = (g.square(&x), g.square(&y));
        let y4 = g.scale(4.0, &y2);
        let s = g.add(&x2, &y4);
        let four = g.constant(4.0);
        let f = g.sub(&four, &s);
        let shape = Shape::new(&mut g, f);
        let d = g.eval(shape.distance, &[1.999, 0.0, 0.0], &[]);
        assert!((d - 0.001).abs() < 1e-6, "{d}");
    }

    #[test]
    fn scaled_space_is_not_rigid() {
        let mut g = Graph::new();
        let x: Vec<NodeId> = (0..3).map(|i| g.x(i)).collect();
        let two: Vec<NodeId> = x.iter().map(|x| g.scale(2.0, x)).collect();
        let zero = g.constant(0.0);
        let one = g.constant(1.0);
        let ball = g.library(
            Library::Sphere,
            &[two[0], two[1], two[2], zero, zero, zero, one],
        );
        let shape = Shape::new(&mut g, ball);
        // The ball of radius 1/2: at 0.6 the distance is 0.1, not 0.2.
        let d = g.eval(shape.distance, &[0.6, 0.0, 0.0], &[]);
        assert!((d + 0.1).abs() < 1e-12, "{d}");
    }
}
