//! Parsing and formatting of polynomials.
//!
//! Formulas ([`crate::formula`]) are expanded exactly: 0.1 is one tenth, a divisor must be a
//! constant, an exponent a whole number. Degrees, numbers of terms, lengths of numbers and the work
//! of multiplying out are bounded, and a text that exceeds a bound is an error, not a wait.

use crate::formula::{Expression, Formula, Term};
use crate::poly::{Exponents, MAX_VARS, Poly};
use dashu_base::Signed;
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use std::fmt;

/// Maximum total degree at any stage of parsing.
pub const MAX_DEGREE: usize = 1000;
/// Maximum number of terms at any stage of parsing: a dense polynomial of degree 400 in two
/// variables has fewer.
const MAX_TERMS: usize = 100_000;
/// Maximum number of bits of a coefficient at any stage of parsing.
const MAX_BITS: usize = 200_000;
/// Maximum absolute decimal exponent, beyond the exponent of any `f64`.
const MAX_DECIMAL_EXPONENT: usize = 5000;
/// Maximum work of expanding a text, in products of machine words: about a second.
const MAX_WORK: usize = 200_000_000;

/// Error of a text that is not a polynomial.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column {column}: {problem}")]
pub struct ParseError {
    /// Position, in characters counted from 1.
    pub column: usize,
    /// Problem at that position.
    pub problem: ParseProblem,
}

/// Problem of a text that is not a polynomial.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParseProblem {
    /// An unexpected character.
    #[error("expected {expected}, found {}", found.map_or("the end".to_owned(), |c| format!("'{}'", c.escape_debug())))]
    Unexpected {
        /// Characters that are allowed there.
        expected: &'static str,
        /// Character found; `None` at the end of the text.
        found: Option<char>,
    },
    /// A name that is not a variable.
    #[error("'{name}' is not one of the variables {}", known.join(", "))]
    UnknownName {
        /// Name found.
        name: String,
        /// Names of the variables.
        known: Vec<String>,
    },
    /// The divisor contains a variable.
    #[error("division by something other than a number: not a polynomial")]
    NotAPolynomial,
    /// A function that is not a polynomial.
    #[error("{name}: not a polynomial")]
    Transcendental {
        /// Name of the function.
        name: &'static str,
    },
    /// An exponent is not a whole number.
    #[error("expected a whole number as exponent")]
    Exponent,
    /// The divisor is zero.
    #[error("division by zero")]
    DivisionByZero,
    /// A bound on the size of polynomials is exceeded.
    #[error("{what} above {limit}")]
    TooLarge {
        /// Quantity that is too large.
        what: &'static str,
        /// Bound of the quantity.
        limit: usize,
    },
}

impl ParseProblem {
    /// Returns the remedy for a polynomial of a rational map, in one sentence.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::UnknownName { .. } => {
                "the parameters are s and t, or u and v; a product of letters needs its * or a \
                 space"
            }
            Self::NotAPolynomial | Self::DivisionByZero => {
                "bring all coordinates to the common denominator W"
            }
            Self::Transcendental {
                name: "sin" | "cos" | "tan",
            } => {
                "on a circle, cos is (1 - t^2)/(1 + t^2) and sin is 2*t/(1 + t^2): write these, \
                 with the common denominator as W"
            }
            Self::TooLarge { .. } => "the polynomial is too large to be written out",
            Self::Unexpected { .. } | Self::Exponent | Self::Transcendental { .. } => {
                "write polynomials in s and t such as 3*s^2 - s*t/2 + 1"
            }
        }
    }
}

impl Poly {
    /// Parses a polynomial; variable i has the name `names[i]`.
    ///
    /// # Errors
    /// [`ParseError`] with the column and what was expected there.
    ///
    /// # Panics
    /// If there are more than four names.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, ParseError> {
        Self::from_expression(&Expression::parse(text)?, names)
    }

    /// Parses a polynomial F, or an equation or inequality, for which F is the left side minus the
    /// right one; variable i has the name `names[i]`.
    ///
    /// # Errors
    /// As [`Poly::parse`].
    ///
    /// # Panics
    /// If there are more than four names.
    pub fn parse_equation(text: &str, names: &[&str]) -> Result<Self, ParseError> {
        Self::from_expression(&Formula::parse(text)?.expression, names)
    }

    /// Expands an expression; variable i has the name `names[i]`.
    ///
    /// # Errors
    /// [`ParseError`] if it is not a polynomial, or too large.
    ///
    /// # Panics
    /// If there are more than four names.
    pub fn from_expression(e: &Expression, names: &[&str]) -> Result<Self, ParseError> {
        assert!(names.len() <= MAX_VARS, "at most four variables");
        Expander { names, work: 0 }.expand(e)
    }

    /// Formats this polynomial, variable i under the name `names[i]`, as text that [`Poly::parse`]
    /// can read.
    ///
    /// # Panics
    /// When written, if a variable without name occurs.
    pub fn display<'a>(&'a self, names: &'a [&'a str]) -> impl fmt::Display + 'a {
        fmt::from_fn(move |f| {
            if self.is_zero() {
                return f.write_str("0");
            }
            for (i, (exponents, c)) in self.terms().iter().enumerate() {
                let magnitude =
                    RBig::from_parts(dashu_base::Abs::abs(c.clone()), self.denominator().clone());
                f.write_str(match (i, c.is_negative()) {
                    (0, false) => "",
                    (0, true) => "-",
                    (_, false) => " + ",
                    (_, true) => " - ",
                })?;
                write_term(f, &magnitude, exponents, names)?;
            }
            Ok(())
        })
    }
}

/// Writes a term with a positive coefficient, which is omitted if it is 1.
fn write_term(
    f: &mut fmt::Formatter<'_>,
    coefficient: &RBig,
    exponents: &Exponents,
    names: &[&str],
) -> fmt::Result {
    let mut first = true;
    if !coefficient.is_one() || *exponents == [0; MAX_VARS] {
        write!(f, "{coefficient}")?;
        first = false;
    }
    for (v, &n) in exponents.iter().enumerate().filter(|(_, n)| **n > 0) {
        f.write_str(if first { "" } else { "*" })?;
        f.write_str(names[v])?;
        if n > 1 {
            write!(f, "^{n}")?;
        }
        first = false;
    }
    Ok(())
}

impl fmt::Display for Poly {
    /// Formats the polynomial in the variables x, y, z, w.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.display(&["x", "y", "z", "w"]))
    }
}

/// Expansion of expressions to polynomials, with bounds on its work.
struct Expander<'a> {
    names: &'a [&'a str],
    /// Work of expansion so far.
    work: usize,
}

impl Expander<'_> {
    /// Returns the error for a problem at a position.
    fn error(&self, at: usize, problem: ParseProblem) -> ParseError {
        ParseError {
            column: at + 1,
            problem,
        }
    }
    /// Returns the error about a quantity above its bound.
    fn too_large(&self, at: usize, what: &'static str, limit: usize) -> ParseError {
        self.error(at, ParseProblem::TooLarge { what, limit })
    }

    /// Expands an expression.
    fn expand(&mut self, e: &Expression) -> Result<Poly, ParseError> {
        match &e.term {
            Term::Number(digits) => self.number(e.at, digits),
            Term::Name(name) => self.variable(e.at, name),
            Term::Sum(terms) => self.sum(e.at, terms),
            Term::Negative(inner) => Ok(-self.expand(inner)?),
            Term::Product(factors) => {
                let mut product = Poly::one();
                for (divides, factor) in factors {
                    let value = self.expand(factor)?;
                    let value = match divides {
                        true => self.reciprocal(factor.at, &value)?,
                        false => value,
                    };
                    product = self.product(factor.at, &product, &value)?;
                }
                Ok(product)
            }
            Term::Power(power) => {
                let [base, exponent] = &**power;
                let n = self.exponent(exponent)?;
                let base_value = self.expand(base)?;
                self.power(e.at, &base_value, n)
            }
            Term::Call(name, _) => Err(self.error(e.at, ParseProblem::Transcendental { name })),
        }
    }

    /// Returns the sum of terms.
    fn sum(&mut self, at: usize, terms: &[(bool, Expression)]) -> Result<Poly, ParseError> {
        // Partial sums of 1, 2, 4, … terms as in merge sort: adding up one by one is quadratic in
        // the length of the text.
        let mut parts: Vec<(u32, Poly)> = Vec::new();
        for (negative, term) in terms {
            let value = self.expand(term)?;
            parts.push((0, if *negative { -value } else { value }));
            while let [.., (m, _), (n, _)] = &parts[..]
                && m == n
            {
                self.merge(at, &mut parts)?;
            }
        }
        while parts.len() > 1 {
            self.merge(at, &mut parts)?;
        }
        Ok(parts.pop().map_or(Poly::zero(), |(_, p)| p))
    }
    /// Adds the last two partial sums.
    fn merge(&mut self, at: usize, parts: &mut Vec<(u32, Poly)>) -> Result<(), ParseError> {
        if let (Some((_, b)), Some((level, a))) = (parts.pop(), parts.pop()) {
            // A sum may bring both to a new denominator.
            self.charge(
                at,
                (a.terms().len() + b.terms().len() + 1) * (words(&a) + words(&b)),
            )?;
            let sum = self.bounded(at, a + b)?;
            parts.push((level + 1, sum));
        }
        Ok(())
    }

    /// Returns the reciprocal of a divisor, which must be a constant.
    fn reciprocal(&self, at: usize, divisor: &Poly) -> Result<Poly, ParseError> {
        match divisor.as_constant() {
            None => Err(self.error(at, ParseProblem::NotAPolynomial)),
            Some(c) if c.is_zero() => Err(self.error(at, ParseProblem::DivisionByZero)),
            Some(c) => Ok(Poly::constant(RBig::ONE / c)),
        }
    }

    /// Returns the exponent of a power.
    fn exponent(&self, e: &Expression) -> Result<usize, ParseError> {
        let digits = match &e.term {
            Term::Number(digits) if digits.bytes().all(|b| b.is_ascii_digit()) => digits,
            _ => {
                return Err(self.error(e.at, ParseProblem::Exponent));
            }
        };
        let small = digits.parse().ok().filter(|n| *n <= MAX_DEGREE);
        small.ok_or_else(|| self.too_large(e.at, "an exponent", MAX_DEGREE))
    }

    /// Returns the variable of a name.
    fn variable(&self, at: usize, name: &str) -> Result<Poly, ParseError> {
        let found = self.names.iter().position(|n| *n == name);
        found.map(Poly::var).ok_or_else(|| {
            let known = self.names.iter().map(|&n| n.to_owned()).collect();
            let name = name.to_owned();
            self.error(at, ParseProblem::UnknownName { name, known })
        })
    }

    /// Returns the exact value of a decimal number: its digits as an integer, times a power of ten.
    fn number(&self, at: usize, text: &str) -> Result<Poly, ParseError> {
        let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let digits = format!("{whole}{fraction}");
        // log2 of 10 is below 4.
        if digits.len() > MAX_BITS / 4 {
            return Err(self.too_large(at, "digits of a number", MAX_BITS / 4));
        }
        let exponent = exponent.parse::<i64>().ok();
        let exponent = exponent.filter(|n| n.unsigned_abs() <= MAX_DECIMAL_EXPONENT as u64);
        let exponent = exponent
            .ok_or_else(|| self.too_large(at, "a decimal exponent", MAX_DECIMAL_EXPONENT))?;
        let power = UBig::from(10u8).pow(exponent.unsigned_abs() as usize);
        let decimals = UBig::from(10u8).pow(fraction.len());
        let mantissa: IBig = digits.parse().expect("digits only");
        let value = match exponent < 0 {
            true => RBig::from_parts(mantissa, decimals * power),
            false => RBig::from_parts(mantissa * power, decimals),
        };
        self.bounded(at, Poly::constant(value))
    }

    /// Returns a power, by repeated squaring, unless its degree or its coefficients would be too
    /// large.
    fn power(&mut self, at: usize, base: &Poly, n: usize) -> Result<Poly, ParseError> {
        if n * base.total_degree() > MAX_DEGREE {
            return Err(self.too_large(at, "a degree", MAX_DEGREE));
        }
        if let Some(top) = base
            .terms()
            .iter()
            .map(|(_, c)| crate::modular::bits(c))
            .max()
            && (top.max(crate::modular::bit_len(base.denominator())) - 1) * n > MAX_BITS
        {
            return Err(self.too_large(at, "bits of a coefficient", MAX_BITS));
        }
        let mut power = Poly::one();
        for bit in (0..usize::BITS - n.leading_zeros()).rev() {
            power = self.product(at, &power, &power.clone())?;
            if n >> bit & 1 == 1 {
                power = self.product(at, &power, base)?;
            }
        }
        Ok(power)
    }
    /// Returns a product, unless it would be too large or too much work.
    fn product(&mut self, at: usize, a: &Poly, b: &Poly) -> Result<Poly, ParseError> {
        if a.total_degree() + b.total_degree() > MAX_DEGREE {
            return Err(self.too_large(at, "a degree", MAX_DEGREE));
        }
        let pairs = a
            .terms()
            .len()
            .saturating_mul(b.terms().len())
            .saturating_add(1);
        self.charge(at, pairs.saturating_mul(words(a) * words(b) + 4))?;
        self.bounded(at, a * b)
    }
    /// Adds to the work; returns an error above its bound.
    fn charge(&mut self, at: usize, work: usize) -> Result<(), ParseError> {
        self.work = self.work.saturating_add(work);
        if self.work > MAX_WORK {
            Err(self.too_large(at, "the work of multiplying out", MAX_WORK))
        } else {
            Ok(())
        }
    }
    /// Returns a polynomial, or an error if it has too many terms or too long coefficients.
    fn bounded(&self, at: usize, p: Poly) -> Result<Poly, ParseError> {
        if p.terms().len() > MAX_TERMS {
            return Err(self.too_large(at, "a number of terms", MAX_TERMS));
        }
        if words(&p) * 64 > MAX_BITS + 64 {
            return Err(self.too_large(at, "bits of a coefficient", MAX_BITS));
        }
        Ok(p)
    }
}

/// Returns the number of machine words, at least one, of the longest coefficient or of the
/// denominator.
fn words(p: &Poly) -> usize {
    let longest = p
        .terms()
        .iter()
        .map(|(_, c)| crate::modular::bits(c))
        .max()
        .unwrap_or(0);
    longest.max(crate::modular::bit_len(p.denominator())) / 64 + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ST: [&str; 2] = ["s", "t"];

    fn error(text: &str) -> String {
        Poly::parse(text, &ST).expect_err(text).to_string()
    }

    #[test]
    fn texts_and_what_they_mean() {
        let same = [
            ("(s+t)**2", "s^2 + 2*s*t + t^2"),
            ("-s^2", "0 - s*s"),
            ("--s - -t", "s + t"),
            ("(2/5)*s^2*t", "2/5*s^2*t"),
            ("s/3/2*4", "2/3*s"),
            ("0.25 + .5 + 1. + 1e-3", "1751/1000"),
            ("1.5E+2*s", "150*s"),
            ("2*-3", "-6"),
            ("s^0 + 0^0", "2"),
            ("s - s", "0"),
            ("\ts\n+ t ", "t + s"),
            ("(((s)))*((t))", "s*t"),
            ("2s t", "2*s*t"),
            ("3(s + 1)(t-1)s²", "3*(s + 1)*(t - 1)*s^2"),
            ("1/2s", "1/2*s"),
            ("s¹²−2·t×t", "s^12 - 2*t*t"),
            ("2t^2 3s", "6*t^2*s"),
        ];
        for (a, b) in same {
            assert_eq!(Poly::parse(a, &ST), Poly::parse(b, &ST), "{a}");
        }
        let p = Poly::parse("-1/2*t + 3*s^2*t - s + 5", &ST).expect("a polynomial");
        assert_eq!(p.display(&ST).to_string(), "3*s^2*t - s - 1/2*t + 5");
        assert_eq!(p.to_string(), "3*x^2*y - x - 1/2*y + 5");
    }

    #[test]
    fn errors_name_the_place() {
        assert_eq!(
            error("s + "),
            "column 5: expected a number, a variable or '(', found the end"
        );
        assert_eq!(
            error("2 s = 1"),
            "column 5: expected an operator or the end, found '='"
        );
        assert_eq!(
            error("s*u"),
            "column 3: 'u' is not one of the variables s, t"
        );
        assert_eq!(
            error("1/(s+1)"),
            "column 3: division by something other than a number: not a polynomial"
        );
        assert_eq!(error("1/(s-s)"), "column 3: division by zero");
        assert_eq!(
            error("(s+t"),
            "column 5: expected an operator or ')', found the end"
        );
        assert_eq!(
            error("s^-1"),
            "column 3: expected a whole number as exponent"
        );
        assert_eq!(error("s^1001"), "column 3: an exponent above 1000");
        assert_eq!(
            error("1e"),
            "column 2: 'e' is not one of the variables s, t"
        );
        assert_eq!(error("2cos(s)"), "column 2: cos: not a polynomial");
        assert_eq!(
            error("s^2.5"),
            "column 3: expected a whole number as exponent"
        );
        assert_eq!(error("é"), "column 1: 'é' is not one of the variables s, t");
        assert_eq!(
            error("s § t"),
            "column 3: expected an operator or the end, found '§'"
        );
        assert_eq!(error("."), "column 2: expected a digit, found the end");
    }

    #[test]
    fn equations_are_differences_of_their_sides() {
        for (equation, difference) in [
            ("s^2 + t^2 = 1", "s^2 + t^2 - 1"),
            ("s == 2t", "s - 2*t"),
            ("s² ≤ 1 + t", "s^2 - 1 - t"),
            ("s >= t", "s - t"),
            ("s*t", "s*t"),
        ] {
            let expected = Poly::parse(difference, &ST);
            assert_eq!(Poly::parse_equation(equation, &ST), expected, "{equation}");
        }
        for wrong in ["s = t = 1", "= s", "s =", "s =< t", "(s = t)"] {
            assert!(Poly::parse_equation(wrong, &ST).is_err(), "{wrong}");
        }
    }

    #[test]
    fn hostile_texts_end_soon() {
        let deep = format!("{}s{}", "(".repeat(100_000), ")".repeat(100_000));
        assert_eq!(error(&deep), "column 201: nesting of parentheses above 200");
        assert!(error("((((9^1000)^1000)^1000)^1000)").contains("bits of a coefficient above"));
        assert!(error("(1+s+t)^900*(s-t)^90").contains("multiplying out"));
        assert!(error("1e6000").contains("decimal exponent"));
        assert!(error("(((s^1000)))*s").contains("a degree above 1000"));
        assert!(error(&"9".repeat(60_000)).contains("digits of a number"));
        let long = vec!["(s+t)^30"; isoform_testdata::cases(20_000, 2_000)].join("-");
        assert!(Poly::parse(&long, &ST).is_ok_and(|p| p.terms().len() == 31));
        assert!(Poly::parse(&"-".repeat(100_000), &ST).is_err());
        // Denominators that have nothing in common: their product grows until a bound stops it.
        let fractions: Vec<String> = (0..40_000)
            .map(|i| format!("1/{}", 1_000_003 + 2 * i))
            .collect();
        assert!(error(&fractions.join("+")).contains("above"));
    }

    proptest! {
        #[test]
        fn any_text_is_answered(text in "[-+*/^()=<.,0-9estcosin²³ ]{0,40}") {
            let _ = Poly::parse_equation(&text, &ST);
        }

        #[test]
        fn printing_and_reading(terms in prop::collection::vec((any::<[u8; 3]>(), any::<i32>(), 1u16..), 0..12)) {
            let names = ["x", "y_1", "zeta"];
            let p = Poly::from_terms(terms.into_iter().map(|(e, n, d)| {
                let exponents = [e[0], e[1], e[2], 0].map(u16::from);
                (exponents, RBig::from_parts(IBig::from(n), UBig::from(d)))
            }));
            prop_assert_eq!(Poly::parse(&p.display(&names).to_string(), &names), Ok(p));
        }
    }
}
