//! Models as level sets of 3MF: the expression of a program as an implicit function.

use crate::live::bounds_of;
use crate::meshing::solid_of;
use crate::{MeshModelError, parameter_values};
use isoform_control::Control;
use isoform_field::hyperfun::{Model, NotCompilable};
use isoform_field::{Binary, Graph, Library, Name, Native, Ops, SetOp, SolidError, Unary};
use isoform_geom::Aabb;
use isoform_io::{
    ImplicitModel, ScalarFunction as F, ScalarGraph, ScalarId, ScalarOperation as O, write_implicit,
};

/// Reason why a model cannot be written as a level set.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LevelSetFileError {
    /// The model lacks values, or its number of coordinates is not three.
    #[error(transparent)]
    Model(#[from] SolidError),
    /// The program is run statement by statement.
    #[error("{}:{}: the program is no expression: {}", .0.line, .0.column, .0.why)]
    Expression(NotCompilable),
    /// A function has no counterpart in 3MF.
    #[error("{0} is computed by iteration, which no nodes of 3MF express")]
    Function(&'static str),
    /// The expression is too large.
    #[error("the expression has more than 1000000 operations")]
    TooLarge,
    /// The box of the model is unknown.
    #[error(transparent)]
    Bounds(#[from] MeshModelError),
    /// A constant is not finite.
    #[error("{0}")]
    Constant(std::io::Error),
}

/// Returns a model with the values `a` of its parameters as a 3MF package: an implicit function and
/// a level set of it in a box. `region` is that box; without one it is searched for. Missing values
/// are those of [`parameter_values`]. Where the function is undefined is outside.
///
/// ```
/// use isoform::{Control, level_set_file, template};
/// use isoform::io::{Source, read_implicit};
/// let ball = template("sphere").expect("a template of the gallery").model();
/// let bytes = level_set_file(&ball, &[0.0, 0.0, 0.0, 2.0], None, "ball", &Control::default())?;
/// let source = Source::Bytes { name: "ball.3mf", bytes: &bytes };
/// let program = read_implicit(source)?.expect("a level set");
/// assert!(program.text.contains("-- @title ball"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`LevelSetFileError`] if the model is not an expression, or needs functions that 3MF does not have;
/// if its box is not found; or on a stop.
pub fn level_set_file(
    model: &Model,
    a: &[f64],
    region: Option<Aabb>,
    name: &str,
    control: &Control<'_>,
) -> Result<Vec<u8>, LevelSetFileError> {
    let values = parameter_values(model, a)?;
    let (solid, _) = solid_of(model, &values)?;
    let (graph, root) = scalar_graph(model, &values)?;
    let bounds = bounds_of(solid.as_ref(), region, control)?;
    let implicit = ImplicitModel {
        graph: &graph,
        root,
        bounds,
        name,
        units: model.info().unit.as_deref(),
    };
    let mut bytes = Vec::new();
    write_implicit(&implicit, &mut bytes).map_err(LevelSetFileError::Constant)?;
    Ok(bytes)
}

/// Returns the expression of a model with values of its parameters.
fn scalar_graph(
    model: &Model,
    values: &[f64],
) -> Result<(ScalarGraph, ScalarId), LevelSetFileError> {
    let mut graph = Graph::new();
    let root = model
        .compile(&mut graph)
        .map_err(LevelSetFileError::Expression)?;
    let mut target = ScalarTarget {
        graph: ScalarGraph::new(),
        missing: None,
    };
    let x: Vec<ScalarId> = (0..3).map(|i| target.graph.coordinate(i)).collect();
    let a: Vec<ScalarId> = values.iter().map(|v| target.graph.constant(*v)).collect();
    let root = graph.rewrite(root, &mut target, &x, &a, |_, _, _: &Name| {});
    match target.missing {
        Some(function) => Err(LevelSetFileError::Function(function)),
        None if target.graph.is_full() => Err(LevelSetFileError::TooLarge),
        None => Ok((target.graph, root)),
    }
}

/// Builder of a scalar graph from the operations of an expression.
struct ScalarTarget {
    graph: ScalarGraph,
    /// First function that has no counterpart.
    missing: Option<&'static str>,
}

impl Ops for ScalarTarget {
    type V = ScalarId;

    fn constant(&mut self, c: f64) -> ScalarId {
        self.graph.constant(c)
    }

    fn unary(&mut self, op: Unary, u: &ScalarId) -> ScalarId {
        let function = match op {
            Unary::Neg => {
                let zero = self.graph.constant(0.0);
                return self.graph.binary(O::Sub, zero, *u);
            }
            Unary::Square => return self.graph.binary(O::Mul, *u, *u),
            Unary::Abs => F::Abs,
            Unary::Sqrt => F::Sqrt,
            Unary::Exp => F::Exp,
            Unary::Ln => F::Ln,
            Unary::Sin => F::Sin,
            Unary::Cos => F::Cos,
            Unary::Tan => F::Tan,
            Unary::Asin => F::Asin,
            Unary::Acos => F::Acos,
            Unary::Atan => F::Atan,
            Unary::Sinh => F::Sinh,
            Unary::Cosh => F::Cosh,
            Unary::Tanh => F::Tanh,
            Unary::Floor => F::Floor,
            Unary::Ceil => F::Ceil,
            Unary::Trunc => F::Trunc,
            Unary::Sign => F::Sign,
        };
        self.graph.unary(function, *u)
    }

    fn binary(&mut self, op: Binary, u: &ScalarId, v: &ScalarId) -> ScalarId {
        let operation = match op {
            Binary::Add => O::Add,
            Binary::Sub => O::Sub,
            Binary::Mul => O::Mul,
            Binary::Div => O::Div,
            Binary::Pow => O::Pow,
            Binary::Atan2 => O::Atan2,
            Binary::Less | Binary::LessEq => {
                let (zero, one) = (self.graph.constant(0.0), self.graph.constant(1.0));
                return match op {
                    Binary::Less => self.graph.choice([*u, *v], one, zero),
                    _ => self.graph.choice([*v, *u], zero, one),
                };
            }
        };
        self.graph.binary(operation, *u, *v)
    }

    /// Multiplies powers of two of the base, since `pow` of 3MF is open for bases below 0.
    fn powi(&mut self, u: &ScalarId, n: i32) -> ScalarId {
        let one = self.graph.constant(1.0);
        let (mut power, mut product, mut left) = (*u, one, n.unsigned_abs());
        while left > 0 {
            if left & 1 == 1 {
                product = self.graph.binary(O::Mul, product, power);
            }
            left >>= 1;
            if left > 0 {
                power = self.graph.binary(O::Mul, power, power);
            }
        }
        match n < 0 {
            true => self.graph.binary(O::Div, one, product),
            false => product,
        }
    }

    fn set(&mut self, op: SetOp, u: &ScalarId, v: &ScalarId) -> ScalarId {
        let graph = &mut self.graph;
        let operation = match op {
            SetOp::Max => return graph.binary(O::Max, *u, *v),
            SetOp::Min => return graph.binary(O::Min, *u, *v),
            SetOp::RUnion => O::Add,
            SetOp::RIntersection => O::Sub,
        };
        let sum = graph.binary(O::Add, *u, *v);
        let squares = [*u, *v].map(|w| graph.binary(O::Mul, w, w));
        let squares = graph.binary(O::Add, squares[0], squares[1]);
        let root = graph.unary(F::Sqrt, squares);
        graph.binary(operation, sum, root)
    }

    fn select(&mut self, condition: &ScalarId, u: &ScalarId, v: &ScalarId) -> ScalarId {
        // A condition that is a comparison is asked again; others are true beyond 0.
        if let Some((sides, is_true_below)) = self.graph.comparison(*condition) {
            return match is_true_below {
                true => self.graph.choice(sides, *u, *v),
                false => self.graph.choice(sides, *v, *u),
            };
        }
        let (zero, size) = (
            self.graph.constant(0.0),
            self.graph.unary(F::Abs, *condition),
        );
        self.graph.choice([zero, size], *u, *v)
    }

    fn library(&mut self, f: Library, args: &[ScalarId]) -> ScalarId {
        f.algebraic(self, args)
    }

    fn native(&mut self, f: Native, args: &[ScalarId]) -> ScalarId {
        let missing = match f {
            Native::Fmod => {
                let quotient = self.graph.binary(O::Div, args[0], args[1]);
                let whole = self.graph.unary(F::Trunc, quotient);
                let product = self.graph.binary(O::Mul, args[1], whole);
                return self.graph.binary(O::Sub, args[0], product);
            }
            Native::EllipsoidDistance => "hfDEllipsoid",
            Native::SardfRoot => "a SARDF operation",
            Native::PerlinNoise => "a noise",
            Native::Imported(_) => "the function of a file",
        };
        self.missing.get_or_insert(missing);
        self.graph.constant(0.0)
    }

    fn known(&self, u: &ScalarId) -> Option<f64> {
        self.graph.value(*u)
    }
}
