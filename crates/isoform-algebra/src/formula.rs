//! Formulas as people write them: expressions and equations, parsed into a tree.
//!
//! ```text
//! formula = sum [ ("=" | "<=" | "<" | ">=" | ">") sum ]
//! sum     = product { ("+" | "-") product }
//! product = factor { ("*" | "/") factor | power }    2x, x y and 3(x + 1) are products
//! factor  = { "+" | "-" } power
//! power   = atom [ ("^" | "**") factor | superscript ]
//! atom    = number | name | function "(" sum { "," sum } ")" | "(" sum ")"
//! number  = 12 | 0.25 | .5 | 1e-3
//! ```
//!
//! A product without its sign binds as one with it: `1/2x` is `(1/2)*x`. Texts may come from
//! anywhere: nesting is bounded, and a tree is at most as large as its text.

use crate::parse::{ParseError, ParseProblem};

/// Maximum nesting of parentheses and exponents: far more than in written texts, far less than the
/// stack can hold.
const MAX_DEPTH: usize = 200;

/// Names of the functions of formulas.
pub const FUNCTIONS: [&str; 21] = [
    "abs", "acos", "asin", "atan", "atan2", "ceil", "cos", "cosh", "exp", "floor", "ln", "log",
    "max", "min", "mod", "sign", "sin", "sinh", "sqrt", "tan", "tanh",
];

/// Expression at a position of a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// Position of the first character, from 0.
    pub at: usize,
    /// Operation and operands.
    pub term: Term,
}

/// Operation of an expression, with its operands.
#[derive(Clone, Debug, PartialEq)]
pub enum Term {
    /// Decimal number as written.
    Number(String),
    /// Name of a variable, parameter or constant.
    Name(String),
    /// Sum; the flag is true for operands that are subtracted.
    Sum(Vec<(bool, Expression)>),
    /// Product; the flag is true for divisors.
    Product(Vec<(bool, Expression)>),
    /// Negated operand.
    Negative(Box<Expression>),
    /// Base and exponent.
    Power(Box<[Expression; 2]>),
    /// Function of [`FUNCTIONS`] with its arguments.
    Call(&'static str, Vec<Expression>),
}

/// Relation between the two sides of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// `=`.
    Equal,
    /// `<` or `<=`.
    Below,
    /// `>` or `>=`.
    Above,
}

/// Formula F, with F = left − right if it is an equation or inequality.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    /// Expression F.
    pub expression: Expression,
    /// Relation of F to 0; `None` if the text is an expression only.
    pub relation: Option<Relation>,
}

impl Formula {
    /// Parses an expression, equation or inequality.
    ///
    /// ```
    /// use isoform_algebra::formula::{Formula, Relation};
    /// let sphere = Formula::parse("x² + y² + z² = 1")?;
    /// assert_eq!(sphere.relation, Some(Relation::Equal));
    /// # Ok::<(), isoform_algebra::ParseError>(())
    /// ```
    ///
    /// # Errors
    /// [`ParseError`] with the column and what was expected there.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        let mut parser = Parser::new(text);
        let left = parser.sum(0)?;
        let relation = match parser.peek() {
            None => None,
            Some('=') => Some(Relation::Equal),
            Some('<' | '≤') => Some(Relation::Below),
            Some('>' | '≥') => Some(Relation::Above),
            Some(_) => return Err(parser.unexpected("an operator or the end")),
        };
        if relation.is_none() {
            return Ok(Self {
                expression: left,
                relation,
            });
        }
        let sign = parser.text[parser.at];
        parser.at += 1;
        // ==, <=, >=.
        parser.at += usize::from("=<>".contains(sign) && parser.text.get(parser.at) == Some(&'='));
        let right = parser.sum(0)?;
        parser.end()?;
        let expression = Expression {
            at: 0,
            term: Term::Sum(vec![(false, left), (true, right)]),
        };
        Ok(Self {
            expression,
            relation,
        })
    }
}

impl Expression {
    /// Parses an expression.
    ///
    /// # Errors
    /// [`ParseError`] with the column and what was expected there.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        let mut parser = Parser::new(text);
        let sum = parser.sum(0)?;
        parser.end()?;
        Ok(sum)
    }
}

/// Parser by recursive descent: each rule of the grammar is a method.
struct Parser {
    text: Vec<char>,
    /// Index of the next character.
    at: usize,
}

/// Value of a superscript digit.
fn superscript(c: char) -> Option<char> {
    let digits = "⁰¹²³⁴⁵⁶⁷⁸⁹".chars();
    let found = digits.zip('0'..='9').find(|(s, _)| *s == c);
    found.map(|(_, digit)| digit)
}

impl Parser {
    fn new(text: &str) -> Self {
        let plain = |c| match c {
            '−' => '-',
            '·' | '×' | '∙' | '⋅' => '*',
            '÷' => '/',
            c => c,
        };
        Self {
            text: text.chars().map(plain).collect(),
            at: 0,
        }
    }

    /// Returns the error about an unexpected next character.
    fn unexpected(&mut self, expected: &'static str) -> ParseError {
        let found = self.peek();
        ParseError {
            column: self.at + 1,
            problem: ParseProblem::Unexpected { expected, found },
        }
    }
    /// Returns the next depth, or an error if there are too many.
    fn deeper(&self, depth: usize) -> Result<usize, ParseError> {
        if depth < MAX_DEPTH {
            return Ok(depth + 1);
        }
        Err(ParseError {
            column: self.at + 1,
            problem: ParseProblem::TooLarge {
                what: "nesting of parentheses",
                limit: MAX_DEPTH,
            },
        })
    }
    /// Skips spaces and returns the next character.
    fn peek(&mut self) -> Option<char> {
        while self.text.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.text.get(self.at).copied()
    }
    /// Consumes the next character if it is a given one; returns true if it is.
    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }
    /// Returns an error unless the text is over.
    fn end(&mut self) -> Result<(), ParseError> {
        match self.peek() {
            None => Ok(()),
            Some(_) => Err(self.unexpected("an operator or the end")),
        }
    }

    /// Parses a sum of products, at a depth of nesting.
    fn sum(&mut self, depth: usize) -> Result<Expression, ParseError> {
        self.peek();
        let at = self.at;
        let mut terms = vec![(false, self.product(depth)?)];
        while let Some(sign @ ('+' | '-')) = self.peek() {
            self.at += 1;
            terms.push((sign == '-', self.product(depth)?));
        }
        Ok(chain(at, terms, Term::Sum))
    }

    /// Parses a product of factors.
    fn product(&mut self, depth: usize) -> Result<Expression, ParseError> {
        self.peek();
        let at = self.at;
        let mut factors = vec![(false, self.factor(depth)?)];
        loop {
            match self.peek() {
                Some(sign @ ('*' | '/')) => {
                    self.at += 1;
                    factors.push((sign == '/', self.factor(depth)?));
                }
                Some(c) if begins_atom(c) => factors.push((false, self.power(depth)?)),
                _ => return Ok(chain(at, factors, Term::Product)),
            }
        }
    }

    /// Parses a power, preceded by signs.
    fn factor(&mut self, depth: usize) -> Result<Expression, ParseError> {
        let mut negative = false;
        self.peek();
        let at = self.at;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            negative ^= sign == '-';
            self.at += 1;
        }
        let power = self.power(depth)?;
        let term = match negative {
            true => Term::Negative(Box::new(power)),
            false => return Ok(power),
        };
        Ok(Expression { at, term })
    }

    /// Parses an atom with its exponent, if it has one.
    fn power(&mut self, depth: usize) -> Result<Expression, ParseError> {
        self.peek();
        let at = self.at;
        let base = self.atom(depth)?;
        let is_stars = self.peek() == Some('*') && self.text.get(self.at + 1) == Some(&'*');
        let exponent = match self.peek() {
            Some('^' | '*') if is_stars || self.peek() == Some('^') => {
                self.at += if is_stars { 2 } else { 1 };
                self.peek();
                let depth = self.deeper(depth)?;
                self.factor(depth)?
            }
            Some(c) if superscript(c).is_some() => {
                let at = self.at;
                let digits = self.text[at..].iter().map_while(|c| superscript(*c));
                let digits: String = digits.collect();
                self.at += digits.len();
                let term = Term::Number(digits);
                Expression { at, term }
            }
            _ => return Ok(base),
        };
        let term = Term::Power(Box::new([base, exponent]));
        Ok(Expression { at, term })
    }

    /// Parses a number, a name, a call, or a sum in parentheses.
    fn atom(&mut self, depth: usize) -> Result<Expression, ParseError> {
        let at = self.at;
        let term = match self.peek() {
            Some('(') => {
                let depth = self.deeper(depth)?;
                self.at += 1;
                let mut inner = self.sum(depth)?;
                if self.take(')') {
                    // Errors of a sum in parentheses point to these.
                    if let Term::Sum(_) | Term::Product(_) = inner.term {
                        inner.at = at;
                    }
                    return Ok(inner);
                }
                return Err(self.unexpected("an operator or ')'"));
            }
            Some('0'..='9' | '.') => Term::Number(self.number()?),
            Some(c) if c.is_alphabetic() || c == '_' => return self.name(depth),
            _ => return Err(self.unexpected("a number, a variable or '('")),
        };
        Ok(Expression { at, term })
    }

    /// Parses a name of letters, digits and underscores, or the call of a function.
    fn name(&mut self, depth: usize) -> Result<Expression, ParseError> {
        let at = self.at;
        let is_part = |c: &&char| c.is_alphanumeric() && superscript(**c).is_none() || **c == '_';
        let name: String = self.text[at..].iter().take_while(is_part).collect();
        self.at += name.chars().count();
        let function = FUNCTIONS.iter().find(|f| **f == name);
        let (Some(function), Some('(')) = (function, self.peek()) else {
            let term = Term::Name(name);
            return Ok(Expression { at, term });
        };
        let depth = self.deeper(depth)?;
        self.at += 1;
        let mut arguments = vec![self.sum(depth)?];
        while self.take(',') {
            arguments.push(self.sum(depth)?);
        }
        if !self.take(')') {
            return Err(self.unexpected("an operator or ')'"));
        }
        let term = Term::Call(function, arguments);
        Ok(Expression { at, term })
    }

    /// Parses a decimal number.
    fn number(&mut self) -> Result<String, ParseError> {
        let start = self.at;
        let digits = |at: usize| {
            let found = self.text[at..].iter().take_while(|c| c.is_ascii_digit());
            at + found.count()
        };
        let whole = digits(start);
        let mut end = whole;
        if self.text.get(end) == Some(&'.') {
            end = digits(end + 1);
            if end == start + 1 {
                self.at = end;
                return Err(self.unexpected("a digit"));
            }
        }
        // In `2e` and `2e*x`, e is a factor.
        if let Some('e' | 'E') = self.text.get(end) {
            let sign = usize::from(matches!(self.text.get(end + 1), Some('+' | '-')));
            let exponent = digits((end + 1 + sign).min(self.text.len()));
            if exponent > end + 1 + sign {
                end = exponent;
            }
        }
        self.at = end;
        Ok(self.text[start..end].iter().collect())
    }
}

/// Returns true if a factor that follows another without a sign may begin with this character.
fn begins_atom(c: char) -> bool {
    c == '(' || c == '.' || c == '_' || c.is_ascii_digit() || c.is_alphabetic()
}

/// Returns a sum or product, or its only operand.
fn chain(
    at: usize,
    mut operands: Vec<(bool, Expression)>,
    of: impl FnOnce(Vec<(bool, Expression)>) -> Term,
) -> Expression {
    match operands.len() {
        1 => operands.remove(0).1,
        _ => Expression {
            at,
            term: of(operands),
        },
    }
}
