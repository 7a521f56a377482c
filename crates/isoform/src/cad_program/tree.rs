//! Conversion of an expression to operations on half spaces and primitives.

use super::CadProgramError;
use isoform_field::{Axis, Binary, Graph, Library, Node, NodeId, Ops, SetOp, Unary};
use std::collections::HashMap;

/// Three numbers of the program, as expressions of its parameters.
pub(super) type Vector = [NodeId; 3];

/// Solid, or the complement of one.
#[derive(Clone, Debug)]
pub(super) struct SignedSolid {
    pub(super) solid: CadSolid,
    /// True for the complement of the solid.
    pub(super) is_outside: bool,
}

/// Solid whose numbers are expressions of the parameters.
#[derive(Clone, Debug)]
pub(super) enum CadSolid {
    /// Half space n·p + d ≥ 0.
    Half(Vector, NodeId),
    /// Box along the axes, given by its lowest and its highest corner.
    Block(Vector, Vector),
    /// Infinite cylinder: a point of its axis, the direction of the axis, and the radius.
    Rod(Vector, Vector, NodeId),
    /// Ball: the centre and the radius.
    Ball(Vector, NodeId),
    /// Torus: the centre, the direction of the axis, and the radii of circle and tube.
    Ring(Vector, Vector, NodeId, NodeId),
    /// Infinite double cone: the apex, the direction of the axis, and the radius at the distance 1
    /// from the apex.
    Cones(Vector, Vector, NodeId),
    /// Union.
    Union(Vec<Self>),
    /// Intersection.
    Common(Vec<Self>),
    /// First solid without the others.
    Cut(Box<Self>, Vec<Self>),
    /// Solid of a statement, by its index.
    Named(usize),
}

/// Affine function c·p + d of the point p.
struct Affine {
    linear: Vector,
    offset: NodeId,
}

/// Translator of expressions into solids.
pub(super) struct SolidTranslator<'a> {
    pub(super) graph: Graph,
    /// Values of the parameters, which determine signs.
    values: &'a [f64],
    /// Solids with names, in the order in which they are needed.
    pub(super) statements: Vec<(String, CadSolid)>,
    known: HashMap<NodeId, SignedSolid>,
}

impl<'a> SolidTranslator<'a> {
    pub(super) fn new(graph: Graph, values: &'a [f64]) -> Self {
        Self {
            graph,
            values,
            statements: Vec::new(),
            known: HashMap::new(),
        }
    }

    /// Returns the region in which an expression is not negative. Operations with names, and
    /// primitives with names, become statements.
    pub(super) fn region(&mut self, id: NodeId) -> Result<SignedSolid, CadProgramError> {
        if let Some(known) = self.known.get(&id) {
            return Ok(known.clone());
        }
        let mut region = self.unnamed(id)?;
        let is_plain = matches!(region.solid, CadSolid::Half(..) | CadSolid::Named(_));
        if let Some(name) = self.name(id).map(str::to_owned)
            && !is_plain
        {
            self.statements.push((name, region.solid));
            region.solid = CadSolid::Named(self.statements.len() - 1);
        }
        self.known.insert(id, region.clone());
        Ok(region)
    }

    fn unnamed(&mut self, id: NodeId) -> Result<SignedSolid, CadProgramError> {
        let inside = |solid| SignedSolid {
            solid,
            is_outside: false,
        };
        if let Some(form) = self.affine(id) {
            let is_plane = form.linear.iter().any(|c| self.value(*c) != 0.0);
            if is_plane {
                return Ok(inside(CadSolid::Half(form.linear, form.offset)));
            }
        }
        match self.graph.node(id).clone() {
            Node::Set(op, ..) => self.joined(id, op),
            Node::Unary(Unary::Neg, a) => {
                let region = self.region(a)?;
                Ok(SignedSolid {
                    is_outside: !region.is_outside,
                    ..region
                })
            }
            Node::Binary(Binary::Div | Binary::Mul, a, factor) if self.is_number(factor) => {
                self.scaled(a, factor)
            }
            Node::Binary(Binary::Mul, factor, a) if self.is_number(factor) => {
                self.scaled(a, factor)
            }
            Node::Library(function, arguments) => match self.primitive(function, &arguments) {
                Some(solid) => Ok(inside(solid)),
                None => Err(self.unsupported(id)),
            },
            _ => Err(self.unsupported(id)),
        }
    }

    /// Returns the name of the variable to which an expression was assigned.
    fn name(&self, id: NodeId) -> Option<&str> {
        let name = self.graph.name(id)?;
        (!self.graph.has_suggested_name(id)).then_some(name)
    }

    fn unsupported(&self, id: NodeId) -> CadProgramError {
        CadProgramError::Kind {
            part: self.graph.name(id).unwrap_or("a part").to_owned(),
        }
    }

    /// Returns the region of a function multiplied by a number.
    fn scaled(&mut self, of: NodeId, factor: NodeId) -> Result<SignedSolid, CadProgramError> {
        let mut region = self.region(of)?;
        region.is_outside ^= self.value(factor) < 0.0;
        Ok(region)
    }

    /// Returns the union or intersection of regions; nested operations of one kind become one list.
    fn joined(&mut self, id: NodeId, op: SetOp) -> Result<SignedSolid, CadProgramError> {
        let is_union = matches!(op, SetOp::Max | SetOp::RUnion);
        let mut operands = Vec::new();
        self.collect(id, id, is_union, &mut operands);
        let (mut within, mut without) = (Vec::new(), Vec::new());
        for operand in operands {
            let region = self.region(operand)?;
            // A union is the complement of the intersection of the complements.
            match region.is_outside == is_union {
                true => within.push(region.solid),
                false => without.push(region.solid),
            }
        }
        let mut region = match within.is_empty() {
            true => SignedSolid {
                solid: union(without),
                is_outside: true,
            },
            false => SignedSolid {
                solid: cut(self.common(within), without),
                is_outside: false,
            },
        };
        region.is_outside ^= is_union;
        Ok(region)
    }

    /// Collects the operands of nested operations of one kind; operations with names are operands.
    fn collect(&self, id: NodeId, root: NodeId, is_union: bool, operands: &mut Vec<NodeId>) {
        let is_open = id == root || self.name(id).is_none();
        match self.graph.node(id) {
            Node::Set(op, a, b)
                if is_open && is_union == matches!(op, SetOp::Max | SetOp::RUnion) =>
            {
                self.collect(*a, root, is_union, operands);
                self.collect(*b, root, is_union, operands);
            }
            _ => operands.push(id),
        }
    }

    /// Returns the intersection of solids; six half spaces along the axes become a block.
    fn common(&mut self, mut solids: Vec<CadSolid>) -> CadSolid {
        let mut sides = [[None; 2]; 3];
        for (k, solid) in solids.iter().enumerate() {
            let CadSolid::Half(linear, _) = solid else {
                continue;
            };
            let values = linear.map(|c| self.graph.constant_value(c));
            for axis in 0..3 {
                let other = [values[(axis + 1) % 3], values[(axis + 2) % 3]];
                let side = match values[axis] {
                    Some(1.0) => 0,
                    Some(-1.0) => 1,
                    _ => continue,
                };
                if other == [Some(0.0); 2] {
                    sides[axis][side].get_or_insert(k);
                }
            }
        }
        if let [[Some(a), Some(b)], [Some(c), Some(d)], [Some(e), Some(f)]] = sides {
            let offset = |k: usize| match solids[k] {
                CadSolid::Half(_, offset) => offset,
                _ => unreachable!("sides are half spaces"),
            };
            let lowest = [a, c, e].map(|k| self.graph.neg(&offset(k)));
            let highest = [b, d, f].map(offset);
            let used = [a, b, c, d, e, f];
            let rest = solids.drain(..).enumerate();
            let mut rest: Vec<CadSolid> = rest
                .filter(|(k, _)| !used.contains(k))
                .map(|(_, solid)| solid)
                .collect();
            rest.insert(0, CadSolid::Block(lowest, highest));
            solids = rest;
        }
        match solids.len() {
            1 => solids.remove(0),
            _ => CadSolid::Common(solids),
        }
    }

    /// Returns the solid of a library function of the point; `None` if CAD programs lack it.
    fn primitive(&mut self, function: Library, arguments: &[NodeId]) -> Option<CadSolid> {
        let forms: Vec<Affine> = arguments[..3]
            .iter()
            .map(|id| self.affine(*id))
            .collect::<Option<_>>()?;
        let numbers = &arguments[3..];
        if numbers.iter().any(|id| !self.is_number(*id)) {
            return None;
        }
        let rows: [Vector; 3] = std::array::from_fn(|k| forms[k].linear);
        if !self.are_orthonormal(&rows) {
            return None;
        }
        let center: Vector = std::array::from_fn(|k| numbers[k]);
        let offsets: Vector = std::array::from_fn(|k| forms[k].offset);
        let at = self.place(&rows, &center, &offsets);
        let way = |axis: Axis| rows[axis as usize];
        match function {
            Library::Sphere => Some(CadSolid::Ball(at, numbers[3])),
            Library::Cylinder(axis) => Some(CadSolid::Rod(at, way(axis), numbers[3])),
            Library::Torus(axis) | Library::DistanceTorus(axis) => {
                Some(CadSolid::Ring(at, way(axis), numbers[3], numbers[4]))
            }
            Library::Cone(axis) | Library::DistanceCone(axis) => {
                Some(CadSolid::Cones(at, way(axis), numbers[3]))
            }
            Library::Block => {
                let one =
                    |k: usize, j: usize| self.value(rows[k][j]) == f64::from(u8::from(k == j));
                let is_along = (0..9).all(|i| one(i / 3, i % 3));
                let ends = std::array::from_fn(|k| self.plus(at[k], numbers[3 + k]));
                is_along.then_some(CadSolid::Block(at, ends))
            }
            _ => None,
        }
    }

    /// Returns the point of space whose coordinates in a system are those of the centre: p = Rᵀ(c −
    /// o).
    fn place(&mut self, rows: &[Vector; 3], center: &Vector, offsets: &Vector) -> Vector {
        let own: Vector = std::array::from_fn(|k| self.minus(center[k], offsets[k]));
        std::array::from_fn(|j| {
            let terms = [0, 1, 2].map(|i| self.times(rows[i][j], own[i]));
            let sum = self.plus(terms[0], terms[1]);
            self.plus(sum, terms[2])
        })
    }

    fn are_orthonormal(&self, rows: &[Vector; 3]) -> bool {
        let rows = rows.map(|row| row.map(|c| self.value(c)));
        (0..9).all(|k| {
            let (i, j) = (k / 3, k % 3);
            let dot: f64 = (0..3).map(|n| rows[i][n] * rows[j][n]).sum();
            (dot - f64::from(u8::from(i == j))).abs() < 1e-9
        })
    }

    /// Returns an expression as an affine function of the point; `None` if it is not affine.
    fn affine(&mut self, id: NodeId) -> Option<Affine> {
        let zero = self.graph.constant(0.0);
        if self.is_number(id) {
            return Some(Affine {
                linear: [zero; 3],
                offset: id,
            });
        }
        match self.graph.node(id).clone() {
            Node::X(i) if i < 3 => {
                let mut linear = [zero; 3];
                linear[i as usize] = self.graph.constant(1.0);
                Some(Affine {
                    linear,
                    offset: zero,
                })
            }
            Node::Unary(Unary::Neg, a) => {
                let form = self.affine(a)?;
                Some(self.map_numbers(form, |g, v| if v == zero { zero } else { g.neg(&v) }))
            }
            Node::Binary(Binary::Add, a, b) => {
                let (p, q) = (self.affine(a)?, self.affine(b)?);
                Some(Affine {
                    linear: std::array::from_fn(|k| self.plus(p.linear[k], q.linear[k])),
                    offset: self.plus(p.offset, q.offset),
                })
            }
            Node::Binary(Binary::Sub, a, b) => {
                let (p, q) = (self.affine(a)?, self.affine(b)?);
                Some(Affine {
                    linear: std::array::from_fn(|k| self.minus(p.linear[k], q.linear[k])),
                    offset: self.minus(p.offset, q.offset),
                })
            }
            Node::Binary(Binary::Mul, a, b) => {
                let (factor, of) = match (self.is_number(a), self.is_number(b)) {
                    (true, _) => (a, b),
                    (_, true) => (b, a),
                    _ => return None,
                };
                let form = self.affine(of)?;
                Some(Affine {
                    linear: form.linear.map(|v| self.times(v, factor)),
                    offset: self.times(form.offset, factor),
                })
            }
            Node::Binary(Binary::Div, a, by) if self.is_number(by) => {
                let form = self.affine(a)?;
                Some(self.map_numbers(form, |g, v| if v == zero { zero } else { g.div(&v, &by) }))
            }
            _ => None,
        }
    }

    fn map_numbers(&mut self, form: Affine, f: impl Fn(&mut Graph, NodeId) -> NodeId) -> Affine {
        Affine {
            linear: form.linear.map(|v| f(&mut self.graph, v)),
            offset: f(&mut self.graph, form.offset),
        }
    }

    fn is_zero(&self, v: NodeId) -> bool {
        self.graph.constant_value(v) == Some(0.0)
    }
    fn plus(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.graph.add(&a, &b)
    }
    fn minus(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.graph.sub(&a, &b)
    }
    fn times(&mut self, a: NodeId, b: NodeId) -> NodeId {
        match self.is_zero(a) || self.is_zero(b) {
            true => self.graph.constant(0.0),
            false => self.graph.mul(&a, &b),
        }
    }

    /// Returns true if an expression does not depend on the point.
    fn is_number(&self, id: NodeId) -> bool {
        self.graph.inputs(id).0 == 0
    }

    /// Returns the value of an expression that does not depend on the point.
    fn value(&self, id: NodeId) -> f64 {
        self.graph.eval(id, &[], self.values)
    }
}

/// Returns the union of solids.
fn union(mut solids: Vec<CadSolid>) -> CadSolid {
    match solids.len() {
        1 => solids.remove(0),
        _ => CadSolid::Union(solids),
    }
}

/// Returns a solid without others.
fn cut(solid: CadSolid, others: Vec<CadSolid>) -> CadSolid {
    match others.is_empty() {
        true => solid,
        false => CadSolid::Cut(Box::new(solid), others),
    }
}
