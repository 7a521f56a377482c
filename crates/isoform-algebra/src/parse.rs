//! Parsing and formatting of polynomials.
//!
//! ```text
//! sum     = term { ("+" | "-") term }
//! term    = factor { ("*" | "/") factor }         a divisor must be a constant
//! factor  = { "+" | "-" } atom [ ("^" | "**") integer ]
//! atom    = number | name | "(" sum ")"
//! number  = 12 | 0.25 | .5 | 1e-3                  exact: 0.1 is one tenth
//! ```
//!
//! A product needs its `*`. Texts may come from anywhere: nesting, degrees, numbers of terms,
//! lengths of numbers and the work of multiplying out are bounded, and a text that exceeds a bound
//! is an error, not a wait.

use crate::poly::{Exponents, MAX_VARS, Poly};
use dashu_base::Signed;
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;
use std::fmt;

/// Maximum nesting of parentheses: far more than in written texts, far less than the stack can
/// hold.
const MAX_DEPTH: usize = 200;
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

impl Poly {
    /// Parses a polynomial; variable i has the name `names[i]`.
    ///
    /// # Errors
    /// [`ParseError`] with the column and what was expected there.
    ///
    /// # Panics
    /// If there are more than four names.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, ParseError> {
        assert!(names.len() <= MAX_VARS, "at most four variables");
        let mut parser = Parser {
            text: text.chars().collect(),
            at: 0,
            names,
            work: 0,
        };
        let poly = parser.sum(0)?;
        match parser.peek() {
            None => Ok(poly),
            Some(_) => Err(parser.unexpected("an operator or the end")),
        }
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

/// Parser by recursive descent: each rule of the grammar is a method.
struct Parser<'a> {
    text: Vec<char>,
    /// Index of the next character.
    at: usize,
    names: &'a [&'a str],
    /// Work of expansion so far.
    work: usize,
}

impl Parser<'_> {
    /// Returns the error for a problem at a position.
    fn error(&self, at: usize, problem: ParseProblem) -> ParseError {
        ParseError {
            column: at + 1,
            problem,
        }
    }
    /// Returns the error about an unexpected next character.
    fn unexpected(&mut self, expected: &'static str) -> ParseError {
        let found = self.peek();
        self.error(self.at, ParseProblem::Unexpected { expected, found })
    }
    /// Returns the error about a quantity above its bound.
    fn too_large(&self, at: usize, what: &'static str, limit: usize) -> ParseError {
        self.error(at, ParseProblem::TooLarge { what, limit })
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

    /// Parses a sum of terms, at a depth of parentheses.
    fn sum(&mut self, depth: usize) -> Result<Poly, ParseError> {
        // Partial sums of 1, 2, 4, … terms as in merge sort: adding up one by one is quadratic in
        // the length of the text.
        let mut parts: Vec<(u32, Poly)> = Vec::new();
        let mut negative = false;
        loop {
            let term = self.term(depth)?;
            parts.push((0, if negative { -term } else { term }));
            while let [.., (m, _), (n, _)] = &parts[..]
                && m == n
            {
                self.merge(&mut parts)?;
            }
            negative = match self.peek() {
                Some('+') => false,
                Some('-') => true,
                _ => break,
            };
            self.at += 1;
        }
        while parts.len() > 1 {
            self.merge(&mut parts)?;
        }
        Ok(parts.pop().map_or(Poly::zero(), |(_, p)| p))
    }
    /// Adds the last two partial sums.
    fn merge(&mut self, parts: &mut Vec<(u32, Poly)>) -> Result<(), ParseError> {
        if let (Some((_, b)), Some((level, a))) = (parts.pop(), parts.pop()) {
            // A sum may bring both to a new denominator.
            self.charge(
                self.at,
                (a.terms().len() + b.terms().len() + 1) * (words(&a) + words(&b)),
            )?;
            let sum = self.bounded(self.at, a + b)?;
            parts.push((level + 1, sum));
        }
        Ok(())
    }

    /// Parses a product of factors, or a quotient by constants.
    fn term(&mut self, depth: usize) -> Result<Poly, ParseError> {
        let mut product = self.factor(depth)?;
        loop {
            let at = self.at;
            match self.peek() {
                Some('*') => {
                    self.at += 1;
                    let factor = self.factor(depth)?;
                    product = self.product(at, &product, &factor)?;
                }
                Some('/') => {
                    self.at += 1;
                    let start = self.at;
                    let divisor = self.factor(depth)?;
                    let c = divisor
                        .as_constant()
                        .ok_or_else(|| self.error(start, ParseProblem::NotAPolynomial))?;
                    if c.is_zero() {
                        return Err(self.error(start, ParseProblem::DivisionByZero));
                    }
                    product = self.product(at, &product, &Poly::constant(RBig::ONE / c))?;
                }
                _ => return Ok(product),
            }
        }
    }

    /// Parses a power of an atom, preceded by signs.
    fn factor(&mut self, depth: usize) -> Result<Poly, ParseError> {
        let mut negative = false;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            negative ^= sign == '-';
            self.at += 1;
        }
        let start = self.at;
        let mut base = self.atom(depth)?;
        let stars = self.peek() == Some('*') && self.text.get(self.at + 1) == Some(&'*');
        if stars || self.peek() == Some('^') {
            self.at += if stars { 2 } else { 1 };
            let n = self.exponent()?;
            base = self.power(start, &base, n)?;
        }
        Ok(if negative { -base } else { base })
    }

    /// Parses the exponent of a power.
    fn exponent(&mut self) -> Result<usize, ParseError> {
        self.peek();
        let start = self.at;
        let n = self.integer(MAX_DEGREE, "an exponent")?;
        n.ok_or_else(|| {
            self.at = start;
            self.unexpected("a whole number as exponent")
        })
    }
    /// Parses the following digits as a number; `None` if there are none.
    fn integer(&mut self, limit: usize, what: &'static str) -> Result<Option<usize>, ParseError> {
        let start = self.at;
        let mut n = 0;
        while let Some(digit) = self.text.get(self.at).and_then(|c| c.to_digit(10)) {
            n = n * 10 + digit as usize;
            if n > limit {
                return Err(self.too_large(start, what, limit));
            }
            self.at += 1;
        }
        Ok((self.at > start).then_some(n))
    }

    /// Parses a number, a variable, or a sum in parentheses.
    fn atom(&mut self, depth: usize) -> Result<Poly, ParseError> {
        match self.peek() {
            Some('(') => {
                if depth == MAX_DEPTH {
                    return Err(self.too_large(self.at, "nesting of parentheses", MAX_DEPTH));
                }
                self.at += 1;
                let inner = self.sum(depth + 1)?;
                if self.take(')') {
                    Ok(inner)
                } else {
                    Err(self.unexpected("an operator or ')'"))
                }
            }
            Some('0'..='9' | '.') => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.variable(),
            _ => Err(self.unexpected("a number, a variable or '('")),
        }
    }

    /// Parses the name of a variable, of letters, digits and underscores.
    fn variable(&mut self) -> Result<Poly, ParseError> {
        let start = self.at;
        while self
            .text
            .get(self.at)
            .is_some_and(|c| c.is_alphanumeric() || *c == '_')
        {
            self.at += 1;
        }
        let name: String = self.text[start..self.at].iter().collect();
        match self.names.iter().position(|n| *n == name) {
            Some(v) => Ok(Poly::var(v)),
            None => {
                let known = self.names.iter().map(|&n| n.to_owned()).collect();
                Err(self.error(start, ParseProblem::UnknownName { name, known }))
            }
        }
    }

    /// Parses a number exactly: its digits as an integer, times a power of ten.
    fn number(&mut self) -> Result<Poly, ParseError> {
        let start = self.at;
        let (digits, decimals) = self.digits();
        if digits.is_empty() {
            return Err(self.unexpected("a digit"));
        }
        // log2 of 10 is below 4.
        if digits.len() > MAX_BITS / 4 {
            return Err(self.too_large(start, "digits of a number", MAX_BITS / 4));
        }
        let [up, down] = self.decimal_exponent()?;
        let ten = UBig::from(10u8);
        let mantissa: IBig = digits.parse().expect("digits only");
        let value = RBig::from_parts(mantissa * ten.pow(up), ten.pow(decimals + down));
        self.bounded(start, Poly::constant(value))
    }
    /// Parses the following digits with an optional decimal point; returns them and the number of
    /// digits after the point.
    fn digits(&mut self) -> (String, usize) {
        let mut digits = String::new();
        let mut decimals = 0usize;
        let mut point = false;
        while let Some(&c) = self.text.get(self.at) {
            match c {
                '0'..='9' => {
                    digits.push(c);
                    decimals += usize::from(point);
                }
                '.' if !point => point = true,
                _ => break,
            }
            self.at += 1;
        }
        (digits, decimals)
    }
    /// Parses a decimal exponent; returns the exponents of the powers of ten by which to multiply
    /// and to divide, both 0 without an exponent.
    fn decimal_exponent(&mut self) -> Result<[usize; 2], ParseError> {
        let Some('e' | 'E') = self.text.get(self.at) else {
            return Ok([0, 0]);
        };
        self.at += 1;
        let negative = self.text.get(self.at) == Some(&'-');
        self.at += usize::from(matches!(self.text.get(self.at), Some('+' | '-')));
        let n = self.integer(MAX_DECIMAL_EXPONENT, "a decimal exponent")?;
        let n = n.ok_or_else(|| self.unexpected("a digit of the decimal exponent"))?;
        Ok(if negative { [0, n] } else { [n, 0] })
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
            error("2 s"),
            "column 3: expected an operator or the end, found 's'"
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
            "column 3: expected a whole number as exponent, found '-'"
        );
        assert_eq!(error("s^1001"), "column 3: an exponent above 1000");
        assert_eq!(
            error("1e"),
            "column 3: expected a digit of the decimal exponent, found the end"
        );
        assert_eq!(error("é"), "column 1: 'é' is not one of the variables s, t");
        assert_eq!(
            error("s § t"),
            "column 3: expected an operator or the end, found '§'"
        );
        assert_eq!(error("."), "column 2: expected a digit, found the end");
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
        let long = vec!["(s+t)^30"; 20_000].join("-");
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
        fn any_text_is_answered(text in "[-+*/^().0-9est ]{0,40}") {
            let _ = Poly::parse(&text, &ST);
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
