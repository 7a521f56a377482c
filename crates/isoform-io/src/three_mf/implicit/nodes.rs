//! Native nodes of implicit functions ("3MF Volumetric and Implicit Extensions" 1.0.0, part II,
//! chapter 5), composed of scalars.

use super::graph::{ScalarFunction as F, ScalarGraph, ScalarId, ScalarOperation as O};
use crate::three_mf::functions::PortType;

/// Value of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum PortValue {
    Scalar(ScalarId),
    Vector([ScalarId; 3]),
    /// A matrix of four rows, row by row.
    Matrix([ScalarId; 16]),
    /// Number of a resource.
    Resource(u32),
}

impl PortValue {
    /// Returns the type.
    pub(super) fn type_of(&self) -> PortType {
        match self {
            Self::Scalar(_) => PortType::Scalar,
            Self::Vector(_) => PortType::Vector,
            Self::Matrix(_) => PortType::Matrix,
            Self::Resource(_) => PortType::Resource,
        }
    }

    /// Returns the scalars that it consists of.
    pub(super) fn components(&self) -> &[ScalarId] {
        match self {
            Self::Scalar(u) => std::slice::from_ref(u),
            Self::Vector(u) => u,
            Self::Matrix(u) => u,
            Self::Resource(_) => &[],
        }
    }

    /// Returns a value of this type with other components.
    fn like(&self, components: impl Fn(usize) -> ScalarId) -> Self {
        match self {
            Self::Scalar(_) => Self::Scalar(components(0)),
            Self::Vector(_) => Self::Vector(std::array::from_fn(components)),
            Self::Matrix(_) => Self::Matrix(std::array::from_fn(components)),
            Self::Resource(id) => Self::Resource(*id),
        }
    }
}

/// Operation on numbers that vectors and matrices undergo component by component.
#[derive(Clone, Copy, Debug)]
pub(super) enum ComponentOperation {
    Unary(F),
    Binary(O),
    /// Logarithm to another base than e.
    Logarithm(f64),
    /// Integer next to a number, of two the one farther from 0.
    Round,
    /// a − floor(a)
    Fraction,
    /// a − b trunc(a/b)
    Remainder,
    /// a − b floor(a/b)
    Modulo,
    /// max(b, min(a, c))
    Clamp,
    /// c where a < b, else d
    Select,
}

/// Operation of an element, with the names of its inputs.
type KindOfNode = (&'static str, ComponentOperation, &'static [&'static str]);

/// Elements of component-wise operations. The names of inverse trigonometric functions are those of
/// the specification and those that lib3mf writes.
const KINDS: [KindOfNode; 36] = [
    ("abs", ComponentOperation::Unary(F::Abs), &["A"]),
    ("sqrt", ComponentOperation::Unary(F::Sqrt), &["A"]),
    ("exp", ComponentOperation::Unary(F::Exp), &["A"]),
    ("log", ComponentOperation::Unary(F::Ln), &["A"]),
    ("sin", ComponentOperation::Unary(F::Sin), &["A"]),
    ("cos", ComponentOperation::Unary(F::Cos), &["A"]),
    ("tan", ComponentOperation::Unary(F::Tan), &["A"]),
    ("arcsin", ComponentOperation::Unary(F::Asin), &["A"]),
    ("asin", ComponentOperation::Unary(F::Asin), &["A"]),
    ("arccos", ComponentOperation::Unary(F::Acos), &["A"]),
    ("acos", ComponentOperation::Unary(F::Acos), &["A"]),
    ("arctan", ComponentOperation::Unary(F::Atan), &["A"]),
    ("atan", ComponentOperation::Unary(F::Atan), &["A"]),
    ("sinh", ComponentOperation::Unary(F::Sinh), &["A"]),
    ("cosh", ComponentOperation::Unary(F::Cosh), &["A"]),
    ("tanh", ComponentOperation::Unary(F::Tanh), &["A"]),
    ("floor", ComponentOperation::Unary(F::Floor), &["A"]),
    ("ceil", ComponentOperation::Unary(F::Ceil), &["A"]),
    ("sign", ComponentOperation::Unary(F::Sign), &["A"]),
    ("addition", ComponentOperation::Binary(O::Add), &["A", "B"]),
    (
        "subtraction",
        ComponentOperation::Binary(O::Sub),
        &["A", "B"],
    ),
    (
        "multiplication",
        ComponentOperation::Binary(O::Mul),
        &["A", "B"],
    ),
    ("division", ComponentOperation::Binary(O::Div), &["A", "B"]),
    ("pow", ComponentOperation::Binary(O::Pow), &["A", "B"]),
    ("min", ComponentOperation::Binary(O::Min), &["A", "B"]),
    ("max", ComponentOperation::Binary(O::Max), &["A", "B"]),
    ("arctan2", ComponentOperation::Binary(O::Atan2), &["A", "B"]),
    ("atan2", ComponentOperation::Binary(O::Atan2), &["A", "B"]),
    (
        "log2",
        ComponentOperation::Logarithm(std::f64::consts::LN_2),
        &["A"],
    ),
    (
        "log10",
        ComponentOperation::Logarithm(std::f64::consts::LN_10),
        &["A"],
    ),
    ("round", ComponentOperation::Round, &["A"]),
    ("fract", ComponentOperation::Fraction, &["A"]),
    ("fmod", ComponentOperation::Remainder, &["A", "B"]),
    ("mod", ComponentOperation::Modulo, &["A", "B"]),
    ("clamp", ComponentOperation::Clamp, &["A", "min", "max"]),
    ("select", ComponentOperation::Select, &["A", "B", "C", "D"]),
];

impl ComponentOperation {
    /// Returns the operation of an element, and the names of its inputs.
    pub(super) fn of_kind(kind: &str) -> Option<(Self, &'static [&'static str])> {
        let row = KINDS.iter().find(|row| row.0 == kind);
        row.map(|(_, operation, inputs)| (*operation, *inputs))
    }

    /// Applies the operation to the components at one place.
    fn apply(self, graph: &mut ScalarGraph, u: &[ScalarId]) -> ScalarId {
        match self {
            Self::Unary(f) => graph.unary(f, u[0]),
            Self::Binary(f) => graph.binary(f, u[0], u[1]),
            Self::Logarithm(base) => {
                let (log, base) = (graph.unary(F::Ln, u[0]), graph.constant(base));
                graph.binary(O::Div, log, base)
            }
            Self::Round => {
                // The remainder of truncation is exact, and so is the result.
                let (whole, two) = (graph.unary(F::Trunc, u[0]), graph.constant(2.0));
                let rest = graph.binary(O::Sub, u[0], whole);
                let rest = graph.binary(O::Mul, two, rest);
                let rest = graph.unary(F::Trunc, rest);
                graph.binary(O::Add, whole, rest)
            }
            Self::Fraction => {
                let floor = graph.unary(F::Floor, u[0]);
                graph.binary(O::Sub, u[0], floor)
            }
            Self::Remainder | Self::Modulo => {
                let quotient = graph.binary(O::Div, u[0], u[1]);
                let whole = match self {
                    Self::Modulo => graph.unary(F::Floor, quotient),
                    _ => graph.unary(F::Trunc, quotient),
                };
                let product = graph.binary(O::Mul, u[1], whole);
                graph.binary(O::Sub, u[0], product)
            }
            Self::Clamp => {
                let least = graph.binary(O::Min, u[0], u[2]);
                graph.binary(O::Max, u[1], least)
            }
            Self::Select => graph.choice([u[0], u[1]], u[2], u[3]),
        }
    }

    /// Applies the operation to values of one type.
    pub(super) fn of_values(self, graph: &mut ScalarGraph, values: &[PortValue]) -> PortValue {
        let count = values[0].components().len();
        let made: Vec<ScalarId> = (0..count)
            .map(|k| {
                let at: Vec<ScalarId> = values.iter().map(|v| v.components()[k]).collect();
                self.apply(graph, &at)
            })
            .collect();
        values[0].like(|k| made[k])
    }
}

/// Returns u × v.
pub(super) fn cross(graph: &mut ScalarGraph, u: [ScalarId; 3], v: [ScalarId; 3]) -> PortValue {
    PortValue::Vector([(1, 2), (2, 0), (0, 1)].map(|(i, k)| {
        let (p, q) = (
            graph.binary(O::Mul, u[i], v[k]),
            graph.binary(O::Mul, u[k], v[i]),
        );
        graph.binary(O::Sub, p, q)
    }))
}

/// Returns |u|.
pub(super) fn length(graph: &mut ScalarGraph, u: [ScalarId; 3]) -> PortValue {
    let square = graph.dot(&u, &u);
    PortValue::Scalar(graph.unary(F::Sqrt, square))
}

/// Returns the matrix with rows and columns exchanged.
pub(super) fn transposed(m: [ScalarId; 16]) -> PortValue {
    PortValue::Matrix(std::array::from_fn(|k| m[k % 4 * 4 + k / 4]))
}

/// Returns the first three components of (x y z 1) M: row vectors, as everywhere in 3MF. The
/// chapter of the extension leaves the side of the vector open.
pub(super) fn image(graph: &mut ScalarGraph, m: [ScalarId; 16], v: [ScalarId; 3]) -> PortValue {
    PortValue::Vector(std::array::from_fn(|k| {
        let turned = graph.dot(&v, &[m[k], m[4 + k], m[8 + k]]);
        graph.binary(O::Add, turned, m[12 + k])
    }))
}

/// Returns the matrix of four rows (`is_rows`) or columns of three numbers; the rest is that of the
/// identity.
pub(super) fn matrix_of(
    graph: &mut ScalarGraph,
    vectors: [[ScalarId; 3]; 4],
    is_rows: bool,
) -> PortValue {
    let (zero, one) = (graph.constant(0.0), graph.constant(1.0));
    PortValue::Matrix(std::array::from_fn(|k| {
        let (i, j) = if is_rows {
            (k / 4, k % 4)
        } else {
            (k % 4, k / 4)
        };
        match (i, j) {
            (3, 3) => one,
            (_, 3) => zero,
            (i, j) => vectors[i][j],
        }
    }))
}

/// Returns the determinant of the two rows `r` and two columns `c`.
fn minor(graph: &mut ScalarGraph, m: &[ScalarId; 16], r: [usize; 2], c: [usize; 2]) -> ScalarId {
    let of = |i: usize, j: usize| m[4 * r[i] + c[j]];
    let (p, q) = (
        graph.binary(O::Mul, of(0, 0), of(1, 1)),
        graph.binary(O::Mul, of(0, 1), of(1, 0)),
    );
    graph.binary(O::Sub, p, q)
}

/// Returns the inverse matrix: cofactors, expanded along the two other rows (Laplace), over the
/// determinant.
pub(super) fn inverse(graph: &mut ScalarGraph, m: [ScalarId; 16]) -> PortValue {
    let mut cofactors = Vec::with_capacity(16);
    for k in 0..16 {
        let rows: Vec<usize> = (0..4).filter(|&i| i != k / 4).collect();
        let columns: Vec<usize> = (0..4).filter(|&j| j != k % 4).collect();
        let mut sum = graph.constant(0.0);
        for (j, &column) in columns.iter().enumerate() {
            let others: Vec<usize> = columns.iter().copied().filter(|c| *c != column).collect();
            let inner = minor(graph, &m, [rows[1], rows[2]], [others[0], others[1]]);
            let product = graph.binary(O::Mul, m[4 * rows[0] + column], inner);
            let is_even = (j + k / 4 + k % 4) % 2 == 0;
            let operation = if is_even { O::Add } else { O::Sub };
            sum = graph.binary(operation, sum, product);
        }
        cofactors.push(sum);
    }
    let determinant = graph.dot(&m[..4], &cofactors[..4]);
    PortValue::Matrix(std::array::from_fn(|k| {
        graph.binary(O::Div, cofactors[k % 4 * 4 + k / 4], determinant)
    }))
}
