//! The metric and parts readings of a tree.
//!
//! A [`Shape`] is the tree with set operations resolved to minima and maxima over smooth pieces: u | v and max(u, v) become a
//! maximum, u & v and min(u, v) a minimum, negation swaps them (a subtraction is an intersection with the negated function).
//! Each piece g carries its unit-gradient form: the closed one of a primitive ([`Library::metric`]; a block has six sides), else
//! g/|∇g|, the first-order distance (Taubin 1991), with a second Newton step where R-functions are blended inside. The min/max
//! tree over these is close to a signed distance: at the minimum of a fit it is at the statistical limit, where the R-functions'
//! own value is 4 to 15 standard deviations off.

use crate::graph::{Graph, Node, NodeId};
use crate::library::Library;
use crate::ops::{Binary, Ops, SetOp, Unary};
use isoform_num::Jet1;
use std::collections::HashMap;

/// A smooth piece of the surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Name from the program: the variable that the piece is assigned to, and the side of it.
    pub name: String,
}

/// The tree as minima and maxima over smooth pieces.
#[derive(Clone, Debug, PartialEq)]
enum Tree {
    Leaf { part: u32, distance: NodeId },
    Min(Box<[Self; 2]>),
    Max(Box<[Self; 2]>),
}

/// The metric and parts readings of an expression.
#[derive(Clone, Debug)]
pub struct Shape {
    /// The smooth pieces.
    pub parts: Vec<Part>,
    /// Near signed distance, positive inside, as an expression of the graph.
    pub distance: NodeId,
    /// Index of the active piece as an expression of the graph.
    pub part: NodeId,
}

impl Shape {
    /// Reads the expression `root` of the graph, which grows by the new expressions.
    pub fn new(graph: &mut Graph, root: NodeId) -> Self {
        let mut reader = Reader {
            graph,
            parts: Vec::new(),
            taken: HashMap::new(),
            memo: Default::default(),
        };
        let tree = reader.read(root, false);
        let parts = reader.parts;
        let (distance, part) = join(graph, &tree);
        Self {
            parts,
            distance,
            part,
        }
    }
}

/// The tree's value and the index of the piece that decides it.
fn join(g: &mut Graph, tree: &Tree) -> (NodeId, NodeId) {
    let (is_min, pair) = match tree {
        Tree::Leaf { part, distance } => return (*distance, g.constant(f64::from(*part))),
        Tree::Min(pair) => (true, pair),
        Tree::Max(pair) => (false, pair),
    };
    let (u, pu) = join(g, &pair[0]);
    let (v, pv) = join(g, &pair[1]);
    let second = if is_min {
        g.less(&v, &u)
    } else {
        g.less(&u, &v)
    };
    let value = if is_min { g.min(&u, &v) } else { g.max(&u, &v) };
    (value, g.select(&second, &pv, &pu))
}

struct Reader<'a> {
    graph: &'a mut Graph,
    parts: Vec<Part>,
    taken: HashMap<String, u32>,
    /// Derivatives by axis, shared between pieces.
    memo: [HashMap<NodeId, NodeId>; 3],
}

impl Reader<'_> {
    fn read(&mut self, id: NodeId, negative: bool) -> Tree {
        match self.graph.node(id).clone() {
            Node::Unary(Unary::Neg, u) => {
                self.inherit(id, u);
                self.read(u, !negative)
            }
            Node::Set(op, u, v) => {
                let pair = Box::new([self.read(u, negative), self.read(v, negative)]);
                let maximum = matches!(op, SetOp::Max | SetOp::RUnion);
                if maximum != negative {
                    Tree::Max(pair)
                } else {
                    Tree::Min(pair)
                }
            }
            // A positive factor does not move the surface.
            Node::Binary(Binary::Mul, u, v) => {
                match (self.graph.constant_value(u), self.graph.constant_value(v)) {
                    (Some(c), _) if c != 0.0 && self.has_sets(v) => {
                        self.inherit(id, v);
                        self.read(v, negative != (c < 0.0))
                    }
                    (_, Some(c)) if c != 0.0 && self.has_sets(u) => {
                        self.inherit(id, u);
                        self.read(u, negative != (c < 0.0))
                    }
                    _ => self.leaf(id, negative),
                }
            }
            Node::Library(Library::SardfUnion | Library::DistanceBlendUnion, args)
                if self.is_sharp(id) =>
            {
                self.pair(args[0], args[1], negative, true)
            }
            Node::Library(
                Library::SardfIntersection | Library::DistanceBlendIntersection,
                args,
            ) if self.is_sharp(id) => self.pair(args[0], args[1], negative, false),
            Node::Library(f, args) if f.is_primitive() => self.primitive(id, f, &args, negative),
            _ => self.leaf(id, negative),
        }
    }

    fn pair(&mut self, u: NodeId, v: NodeId, negative: bool, maximum: bool) -> Tree {
        let pair = Box::new([self.read(u, negative), self.read(v, negative)]);
        if maximum != negative {
            Tree::Max(pair)
        } else {
            Tree::Min(pair)
        }
    }

    /// A signed-distance set operation has the sharp zero set of max or min; the circular blends are their own smooth piece.
    fn is_sharp(&self, id: NodeId) -> bool {
        matches!(
            self.graph.node(id),
            Node::Library(Library::SardfUnion | Library::SardfIntersection, _)
        )
    }

    fn has_sets(&self, id: NodeId) -> bool {
        match self.graph.node(id) {
            Node::Set(..) => true,
            Node::Library(f, _) => f.is_primitive(),
            Node::Unary(Unary::Neg, u) => self.has_sets(*u),
            _ => false,
        }
    }

    /// A name given to −u or c·u serves u as well.
    fn inherit(&mut self, from: NodeId, to: NodeId) {
        if let Some(name) = self.graph.name(from).map(str::to_owned) {
            self.graph.set_name(to, &name);
        }
    }

    fn part(&mut self, id: NodeId, side: &str) -> u32 {
        let base = self
            .graph
            .name(id)
            .map_or_else(|| format!("piece{}", self.parts.len() + 1), str::to_owned);
        let mut name = if side.is_empty() {
            base
        } else {
            format!("{base}.{side}")
        };
        let n = self.taken.entry(name.clone()).or_insert(0);
        *n += 1;
        if *n > 1 {
            name = format!("{name}#{n}");
        }
        self.parts.push(Part { name });
        self.parts.len() as u32 - 1
    }

    fn primitive(&mut self, id: NodeId, f: Library, args: &[NodeId], negative: bool) -> Tree {
        let rigid = self.is_rigid([args[0], args[1], args[2]]);
        let mut sides = f.metric(self.graph, args);
        if !rigid {
            // Twisted, tapered or scaled: the sides are still smooth pieces, each with a gradient of its own.
            for (_, side) in &mut sides {
                let g = self.graph.lowered(*side);
                *side = self.first_order(g).unwrap_or(*side);
            }
        }
        let leaves: Vec<Tree> = sides
            .into_iter()
            .map(|(side, d)| {
                let distance = if negative { self.graph.neg(&d) } else { d };
                Tree::Leaf {
                    part: self.part(id, side),
                    distance,
                }
            })
            .collect();
        let mut leaves = leaves.into_iter();
        let Some(first) = leaves.next() else {
            return self.leaf(id, negative);
        };
        leaves.fold(first, |tree, leaf| {
            let pair = Box::new([tree, leaf]);
            if negative {
                Tree::Max(pair)
            } else {
                Tree::Min(pair)
            }
        })
    }

    /// g/|∇g| as a piece; g itself where a native function stands in the way of the derivative.
    fn leaf(&mut self, id: NodeId, negative: bool) -> Tree {
        let part = self.part(id, "");
        let g = self.graph.lowered(id);
        let mut distance = self.first_order(g).unwrap_or(g);
        if self.has_r_functions(g) {
            distance = self.second_step(g, distance).unwrap_or(distance);
        }
        let distance = if negative {
            self.graph.neg(&distance)
        } else {
            distance
        };
        Tree::Leaf { part, distance }
    }

    /// ∇g and |∇g|² as expressions; none where a native function stands in the way or g is constant.
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

    fn first_order(&mut self, g: NodeId) -> Option<NodeId> {
        let (_, squares) = self.gradient(g)?;
        let norm = self.graph.sqrt(&squares);
        // Where the gradient vanishes (a centre, an axis) the value itself is far from zero: any finite result will do.
        let tiny = self.graph.constant(1e-30);
        let norm = self.graph.max(&norm, &tiny);
        Some(self.graph.div(&g, &norm))
    }

    /// Whether R-functions are blended within the piece: its edges are then rounded with a small radius, and the first-order distance is
    /// off by its own size within a few noise deviations of them.
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

    /// One Newton step to the surface along the gradient, and the first-order distance again from there; kept where it is the smaller
    /// of the two, which it is wherever the step is of use.
    fn second_step(&mut self, g: NodeId, distance: NodeId) -> Option<NodeId> {
        let (_, na) = self.graph.inputs(g);
        let a: Vec<NodeId> = (0..na).map(|i| self.graph.param(i)).collect();
        let (gradient, squares) = self.gradient(g)?;
        let tiny = self.graph.constant(1e-60);
        let squares = self.graph.max(&squares, &tiny);
        let step = self.graph.div(&g, &squares);
        let q: [NodeId; 3] = std::array::from_fn(|axis| {
            let x = self.graph.x(axis);
            let by = self.graph.mul(&step, &gradient[axis]);
            self.graph.sub(&x, &by)
        });
        let source = self.graph.clone();
        let rest = source.rewrite(distance, self.graph, &q, &a, |_, _, _| {});
        let (far, near) = (self.graph.abs(&distance), self.graph.abs(&rest));
        let helps = self.graph.less(&near, &far);
        let sum = self.graph.add(&distance, &rest);
        Some(self.graph.select(&helps, &sum, &distance))
    }

    /// Whether the point (p, q, r) is a rigid image of space for all parameters: its Jacobian J must satisfy JᵀJ = 1. Tested at
    /// pseudo-random places; a wrong answer would take probability zero and only cost the piece its closed form.
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
        let mut state = 0x2545_F491_4F6C_DD1Du64;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        for _ in 0..4 {
            let x: [Jet1<3>; 3] = std::array::from_fn(|i| Jet1::variable(random(), i));
            let a: Vec<Jet1<3>> = (0..na)
                .map(|_| isoform_num::Real::constant(random()))
                .collect();
            let rows = point.map(|p| self.graph.eval(p, &x, &a).g);
            for i in 0..3 {
                for j in 0..=i {
                    let s: f64 = (0..3).map(|k| rows[i][k] * rows[j][k]).sum();
                    // 1e-9: rounding of a few rotations stays below 1e-14; scales of real models are never that close to 1.
                    let off = (s - f64::from(u8::from(i == j))).abs();
                    if off.is_nan() || off >= 1e-9 {
                        return false;
                    }
                }
            }
        }
        true
    }
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
