//! The checked program, with names resolved to slots of the object's memory.

/// A binary operator. A chain of operators of one precedence is one node, so that long sums are not
/// nested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Add,
    Subtract,
    Union,
    Intersection,
    Cartesian,
    Difference,
    Multiply,
    Divide,
    Power,
    Less,
    LessEq,
    Greater,
    GreaterEq,
    Equal,
    NotEqual,
    And,
    Or,
}

/// Precedence levels, loosest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    Logic,
    Comparison,
    Sum,
    Product,
    Power,
}

impl Operator {
    /// All operators, each with its spelling.
    const ALL: [(&'static str, Self); 17] = [
        ("+", Self::Add),
        ("-", Self::Subtract),
        ("|", Self::Union),
        ("&", Self::Intersection),
        ("@", Self::Cartesian),
        ("\\", Self::Difference),
        ("*", Self::Multiply),
        ("/", Self::Divide),
        ("^", Self::Power),
        ("<", Self::Less),
        ("<=", Self::LessEq),
        (">", Self::Greater),
        (">=", Self::GreaterEq),
        ("=", Self::Equal),
        ("/=", Self::NotEqual),
        ("and", Self::And),
        ("or", Self::Or),
    ];
    /// Returns the operator with a given spelling.
    pub(crate) fn from_text(text: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .find(|(t, _)| *t == text)
            .map(|(_, op)| *op)
    }
    /// Returns the spelling of the operator.
    pub(crate) fn text(self) -> &'static str {
        Self::ALL
            .iter()
            .find(|(_, op)| *op == self)
            .map_or("", |(t, _)| t)
    }
    /// Returns the precedence of the operator.
    pub(crate) fn level(self) -> Level {
        match self {
            Self::And | Self::Or => Level::Logic,
            Self::Less
            | Self::LessEq
            | Self::Greater
            | Self::GreaterEq
            | Self::Equal
            | Self::NotEqual => Level::Comparison,
            Self::Add
            | Self::Subtract
            | Self::Union
            | Self::Intersection
            | Self::Cartesian
            | Self::Difference => Level::Sum,
            Self::Multiply | Self::Divide => Level::Product,
            Self::Power => Level::Power,
        }
    }
    /// Returns true for set operators.
    pub(crate) fn is_set_operator(self) -> bool {
        matches!(
            self,
            Self::Union | Self::Intersection | Self::Cartesian | Self::Difference
        )
    }
}

/// Array in the object's memory: items `start .. start + len`; `id` is its index in
/// [`Object::arrays`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ArrayRef {
    pub(crate) id: u32,
    pub(crate) start: u32,
    pub(crate) len: u32,
}

/// An expression. `at` is the byte offset at which errors of the node are reported.
#[derive(Clone, Debug)]
pub(crate) enum Expr {
    Number {
        at: u32,
        value: f64,
    },
    Variable {
        at: u32,
        slot: u32,
    },
    Item {
        at: u32,
        array: ArrayRef,
        index: Box<Self>,
    },
    Sign {
        at: u32,
        sign: &'static str,
        operand: Box<Self>,
    },
    Not {
        at: u32,
        operand: Box<Self>,
    },
    Group {
        at: u32,
        inner: Box<Self>,
    },
    Chain {
        first: Box<Self>,
        rest: Vec<Link>,
    },
    Function {
        at: u32,
        function: u16,
        arguments: Vec<Argument>,
    },
    Call {
        at: u32,
        object: u32,
        arguments: Vec<(u32, ArrayRef)>,
    },
}

/// An operator with its right operand.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) at: u32,
    pub(crate) operator: Operator,
    pub(crate) operand: Expr,
}

/// An argument of a library function.
#[derive(Clone, Debug)]
pub(crate) enum Argument {
    Number(Expr),
    Array(u32, ArrayRef),
}

impl Expr {
    /// Returns true for a number literal, with or without signs and parentheses.
    pub(crate) fn is_literal(&self) -> bool {
        match self {
            Self::Number { .. } => true,
            Self::Sign { operand: inner, .. } | Self::Group { inner, .. } => inner.is_literal(),
            _ => false,
        }
    }
    /// Returns the byte offset of the expression.
    pub(crate) fn at(&self) -> u32 {
        match self {
            Self::Number { at, .. }
            | Self::Variable { at, .. }
            | Self::Item { at, .. }
            | Self::Sign { at, .. }
            | Self::Not { at, .. }
            | Self::Group { at, .. }
            | Self::Function { at, .. }
            | Self::Call { at, .. } => *at,
            Self::Chain { first, .. } => first.at(),
        }
    }
}

/// A statement.
#[derive(Clone, Debug)]
pub(crate) enum Statement {
    Assign {
        slot: u32,
        value: Expr,
    },
    AssignItem {
        array: ArrayRef,
        index: Expr,
        value: Expr,
    },
    AssignArray {
        /// Byte range without the semicolon.
        span: (u32, u32),
        array: ArrayRef,
        values: Vec<f64>,
    },
    If {
        at: u32,
        condition: Expr,
        then: Vec<Self>,
        otherwise: Option<Vec<Self>>,
    },
    While {
        at: u32,
        condition: Expr,
        body: Vec<Self>,
    },
}

/// An array of an object.
#[derive(Clone, Debug)]
pub(crate) struct Array {
    pub(crate) name: String,
    pub(crate) len: u32,
}

/// Defaults of the parameters of an object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Defaults {
    /// Local array of the constants.
    pub(crate) array: ArrayRef,
    /// Byte range of the assignment.
    pub(crate) assigned: (u32, u32),
    /// Byte offset of the annotation.
    pub(crate) annotation: u32,
    /// Index of the object whose parameters are annotated.
    pub(crate) of: usize,
}

/// Number of the arrays x, a and s, which come first in every object.
pub(crate) const HEAD_ARRAYS: usize = 3;

/// One object. Its memory holds x, a, s, the local arrays and the variables, in this order.
#[derive(Clone, Debug)]
pub(crate) struct Object {
    pub(crate) name: String,
    /// Byte range of the text from the name to the closing brace.
    pub(crate) span: (u32, u32),
    /// True if the head declares s.
    pub(crate) has_s: bool,
    /// x, a and s, followed by the local arrays.
    pub(crate) arrays: Vec<Array>,
    /// Slot of the first variable.
    pub(crate) first_variable: u32,
    pub(crate) variables: Vec<String>,
    pub(crate) body: Vec<Statement>,
    /// Byte offset of the result's assignment.
    pub(crate) result_at: u32,
    pub(crate) result: Expr,
    /// Nesting depth of its evaluation, calls included.
    pub(crate) depth: u32,
    /// Defaults of the parameters (`@values`).
    pub(crate) defaults: Option<Defaults>,
}

impl Object {
    /// Returns the number of coordinates.
    pub(crate) fn dimension(&self) -> usize {
        self.arrays[0].len as usize
    }
    /// Returns the number of parameters.
    pub(crate) fn n_params(&self) -> usize {
        self.arrays[1].len as usize
    }
    /// Returns the length of s; 1 if the head declares none.
    pub(crate) fn n_s(&self) -> usize {
        self.arrays[2].len as usize
    }
    /// Returns the number of items in memory.
    pub(crate) fn memory(&self) -> usize {
        self.first_variable as usize + self.variables.len()
    }
    /// Returns the name of the variable in a slot of the memory.
    pub(crate) fn variable(&self, slot: u32) -> &str {
        &self.variables[(slot - self.first_variable) as usize]
    }
}
