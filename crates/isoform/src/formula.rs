//! Models of formulas: surfaces F(x, y, z) = 0 as people write them.

use crate::live::bounds_of;
use crate::patches::rounded_polynomial;
use crate::{COORDINATES, ImplicitSurface, MeshModelError, field_of, solid_of};
use isoform_algebra::formula::{Expression, Formula, Relation, Term};
use isoform_algebra::{ParseError, Poly};
use isoform_control::Control;
use isoform_field::hyperfun::{Mode, Model};
use isoform_field::suggestion;
use isoform_geom::{Aabb, Point3, Solid};
use isoform_mesh::MeshError;
use isoform_mesh::features::ExtentError;
use std::fmt::Write;

/// Error of a text that is not the formula of a surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FormulaError {
    /// The text is not a formula.
    #[error("{0}")]
    Syntax(#[from] ParseError),
    /// A name is neither a coordinate, a constant, a parameter nor a product of coordinates.
    #[error("column {column}: `{name}` is not known")]
    Name {
        /// Position, in characters counted from 1.
        column: usize,
        /// Name found.
        name: String,
    },
    /// A function has the wrong number of arguments.
    #[error("column {column}: {function} takes {expected}, found {found}")]
    Arguments {
        /// Position, in characters counted from 1.
        column: usize,
        /// Name of the function.
        function: &'static str,
        /// Number of arguments in words.
        expected: &'static str,
        /// Number of arguments found.
        found: usize,
    },
    /// The formula contains no coordinate.
    #[error("the formula does not depend on x, y or z")]
    Constant,
    /// The program of the formula is refused, as for numbers beyond the range of doubles.
    #[error("{0}")]
    Program(String),
}

impl FormulaError {
    /// Returns the position of the error, in characters counted from 1; `None` for errors of the
    /// whole formula.
    pub fn column(&self) -> Option<usize> {
        match self {
            Self::Syntax(e) => Some(e.column),
            Self::Name { column, .. } | Self::Arguments { column, .. } => Some(*column),
            Self::Constant | Self::Program(_) => None,
        }
    }

    /// Returns the suggested remedy, one sentence.
    pub fn hint(&self) -> String {
        let names = isoform_algebra::formula::FUNCTIONS;
        match self {
            Self::Name { name, .. } => {
                let lower = name.to_lowercase();
                if names.contains(&lower.as_str()) {
                    return format!("the argument of {lower} needs parentheses: {lower}(x)");
                }
                let near = suggestion(name, names).map(|near| format!("{near} "));
                format!(
                    "{}coordinates are x, y, z; parameters are single letters, as a or r1; \
                     functions are {}",
                    near.unwrap_or_default(),
                    names.join(", ")
                )
            }
            _ => "write F(x, y, z) = 0, as x^2 + y^2 = 1 + z^2".to_owned(),
        }
    }
}

/// Surface F(x, y, z) = 0 of a formula, with parameters.
///
/// ```
/// use isoform::{Control, FormulaSurface};
/// let cylinder = FormulaSurface::parse("x² + y² = r²")?;
/// assert_eq!(cylinder.parameters, ["r"]);
/// let tube = FormulaSurface::parse("x^2 + y^2 + z^4 = 1")?;
/// let solid = tube.solid(&[], &[], None, &Control::default())?;
/// assert_eq!(solid.region, None);
/// assert_eq!(solid.model.source().matches("x[1]").count(), 1);
/// # Ok::<(), isoform::FormulaError>(())
/// ```
#[derive(Clone, Debug)]
pub struct FormulaSurface {
    formula: Formula,
    /// Names of the parameters, in the order of their first occurrence.
    pub parameters: Vec<String>,
    /// Expression of F in HyperFun.
    expression: String,
}

/// Solid that is bounded by the surface of a formula.
#[derive(Clone, Debug)]
pub struct FormulaSolid {
    /// Program with the function F or −F, which is positive inside.
    pub model: Model,
    /// Region that cuts the solid: the given one, or one that shows an unbounded solid. `None` if
    /// the solid is bounded.
    pub region: Option<Aabb>,
}

impl FormulaSurface {
    /// Parses an expression F, an equation or an inequality.
    ///
    /// # Errors
    /// [`FormulaError`] if the text is not a formula in x, y and z.
    pub fn parse(text: &str) -> Result<Self, FormulaError> {
        let formula = Formula::parse(text)?;
        let mut writer = ProgramWriter::default();
        writer.write(&formula.expression)?;
        if !writer.has_coordinate {
            return Err(FormulaError::Constant);
        }
        let ProgramWriter {
            text: expression,
            parameters,
            ..
        } = writer;
        let surface = Self {
            formula,
            parameters,
            expression,
        };
        surface.model(&[], false)?;
        // Coordinates may cancel, as in x - x.
        let polynomial = surface.polynomial(&[], &[]);
        if polynomial.is_some_and(|f| f.is_constant()) {
            return Err(FormulaError::Constant);
        }
        Ok(surface)
    }

    /// Returns the program of F, or of −F; parameters have the given default values, or 1.
    ///
    /// # Errors
    /// [`FormulaError::Program`] if the program is refused.
    pub fn model(&self, defaults: &[(String, f64)], negative: bool) -> Result<Model, FormulaError> {
        let mut program = String::new();
        for (i, name) in self.parameters.iter().enumerate() {
            let given = defaults.iter().find(|(given, _)| given == name);
            let value = given.map_or(1.0, |(_, value)| *value);
            let _ = writeln!(
                program,
                "-- @param a[{}] {name} number start={value:?} typical={value:?}",
                i + 1
            );
        }
        let n = self.parameters.len();
        let f = &self.expression;
        let f = if negative {
            format!("-({f})")
        } else {
            f.clone()
        };
        let _ = writeln!(program, "F(x[3], a[{n}]) {{\n  F = {f};\n}}");
        Model::parse(&program, Mode::Default).map_err(|e| FormulaError::Program(e.to_string()))
    }

    /// Returns true if the text states no inside: it is an equation or an expression.
    pub fn is_equation(&self) -> bool {
        matches!(self.formula.relation, None | Some(Relation::Equal))
    }

    /// Returns the function as written, with the inside that the relation states: −F for `<`, `=`
    /// and expressions, which are negative inside as x² + y² + z² − 1 is.
    ///
    /// # Errors
    /// As [`FormulaSurface::model`].
    pub fn stated_model(&self, defaults: &[(String, f64)]) -> Result<Model, FormulaError> {
        self.model(defaults, self.formula.relation != Some(Relation::Above))
    }

    /// Returns the solid that the surface bounds, for the values `a` of the parameters.
    ///
    /// An inequality states its inside. Of an equation, the inside is the bounded side; in a
    /// region, the side with at most four of the region's corners. If both sides are unbounded and
    /// no region is given, one is chosen by the size of the coefficients.
    ///
    /// # Errors
    /// As [`FormulaSurface::model`].
    pub fn solid(
        &self,
        a: &[f64],
        defaults: &[(String, f64)],
        region: Option<Aabb>,
        control: &Control<'_>,
    ) -> Result<FormulaSolid, FormulaError> {
        let wrong = |e: isoform_field::SolidError| FormulaError::Program(e.to_string());
        let stated = self.stated_model(defaults)?;
        let (solid, _) = solid_of(&stated, a).map_err(wrong)?;
        let is_unbounded = |solid: &dyn Solid| {
            let found = bounds_of(solid, None, control);
            matches!(
                found,
                Err(MeshModelError::InsideOut { .. }
                    | MeshModelError::Mesh(MeshError::Extent(ExtentError::Unbounded { .. })))
            )
        };
        let region = match region {
            None if !is_unbounded(solid.as_ref()) => {
                let model = stated;
                return Ok(FormulaSolid { model, region });
            }
            None if self.is_equation() => {
                let model = self.model(defaults, false)?;
                let (other, _) = solid_of(&model, a).map_err(wrong)?;
                if !is_unbounded(other.as_ref()) {
                    return Ok(FormulaSolid { model, region });
                }
                self.region(a, defaults)?
            }
            None => self.region(a, defaults)?,
            Some(region) => region,
        };
        let is_stated = !self.is_equation() || is_majority_outside(&stated, a, region);
        let model = match is_stated {
            true => stated,
            false => self.model(defaults, false)?,
        };
        let region = Some(region);
        Ok(FormulaSolid { model, region })
    }

    /// Returns the box of the surface for the values `a` of the parameters: that of the bounded
    /// solid, or the region that [`FormulaSurface::solid`] chooses.
    ///
    /// # Errors
    /// [`FormulaError::Program`] if the solid has no box, or as [`FormulaSurface::model`].
    pub fn bounds(
        &self,
        a: &[f64],
        defaults: &[(String, f64)],
        control: &Control<'_>,
    ) -> Result<Aabb, FormulaError> {
        let FormulaSolid { model, region } = self.solid(a, defaults, None, control)?;
        let (solid, _) = solid_of(&model, a).map_err(|e| FormulaError::Program(e.to_string()))?;
        bounds_of(solid.as_ref(), region, control).map_err(|e| FormulaError::Program(e.to_string()))
    }

    /// Returns the surface F = 0 for the values `a` of the parameters: of the exact polynomial where
    /// F is one.
    ///
    /// # Errors
    /// [`FormulaError::Constant`] if F is constant for these values, or as
    /// [`FormulaSurface::model`].
    pub fn surface(
        &self,
        a: &[f64],
        defaults: &[(String, f64)],
    ) -> Result<ImplicitSurface, FormulaError> {
        let Some(exact) = self.polynomial(a, defaults) else {
            let model = self.stated_model(defaults)?;
            return ImplicitSurface::of_model(&model, a)
                .map_err(|e| FormulaError::Program(e.to_string()));
        };
        let field = rounded_polynomial(&exact).ok_or(FormulaError::Constant)?;
        Ok(ImplicitSurface {
            field: Box::new(field),
            parts: None,
            is_run: false,
        })
    }

    /// Returns F as a polynomial in x, y and z; `None` if it is not one.
    fn polynomial(&self, a: &[f64], defaults: &[(String, f64)]) -> Option<Poly> {
        let value = |(k, name): (usize, &String)| {
            let default = defaults.iter().find(|(given, _)| given == name);
            let default = default.map_or(1.0, |(_, value)| *value);
            (name.clone(), a.get(k).copied().unwrap_or(default))
        };
        let values: Vec<_> = self.parameters.iter().enumerate().map(value).collect();
        let closed = substituted(&self.formula.expression, &values);
        Poly::from_expression(&closed, &COORDINATES).ok()
    }

    /// Returns a cube about the origin that shows an unbounded surface: twice as wide as the median
    /// distance at which rays from the origin first cross it; of half width 1 if none does, as for
    /// cones.
    fn region(&self, a: &[f64], defaults: &[(String, f64)]) -> Result<Aabb, FormulaError> {
        let model = self.stated_model(defaults)?;
        let (field, _) = field_of(&model, a).map_err(|e| FormulaError::Program(e.to_string()))?;
        let crossing = |i: usize| {
            let direction = direction(i);
            let value = |step: i32| {
                let r = 2f64.powf(f64::from(step) / RAY_STEPS_PER_DOUBLING);
                field.value(direction.map(|d| r * d))
            };
            let mut steps =
                (-RAY_STEPS..RAY_STEPS).map(|step| (step, value(step), value(step + 1)));
            let change = steps.find(|(_, near, far)| near * far < 0.0);
            change.map(|(step, ..)| 2f64.powf((f64::from(step) + 0.5) / RAY_STEPS_PER_DOUBLING))
        };
        let mut radii: Vec<f64> = (0..RAYS).filter_map(crossing).collect();
        radii.sort_by(f64::total_cmp);
        let half = radii
            .get(radii.len() / 2)
            .map_or(1.0, |r| two_digits_up(2.0 * r));
        Ok(Aabb {
            lo: [-half; 3],
            hi: [half; 3],
        })
    }
}

/// Number of rays on which a surface is sought.
const RAYS: usize = 256;
/// Number of steps on a ray in each direction from radius 1: up to 10⁶ and down to 10⁻⁶.
const RAY_STEPS: i32 = 80;
const RAY_STEPS_PER_DOUBLING: f64 = 4.0;

/// Returns one of the directions of the rays, which are spread evenly on a spiral.
fn direction(i: usize) -> Point3 {
    let z = (2 * i + 1) as f64 / RAYS as f64 - 1.0;
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let (r, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
    [r * angle.cos(), r * angle.sin(), z]
}

/// Returns a positive number rounded up to two digits.
fn two_digits_up(value: f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor() - 1.0);
    // A number of digits that is exact in decimals.
    format!("{:.1e}", (value / unit).ceil() * unit)
        .parse()
        .unwrap_or(value)
}

/// Returns true if at most four corners of a region lie inside of a model.
fn is_majority_outside(model: &Model, a: &[f64], region: Aabb) -> bool {
    let Ok((field, _)) = field_of(model, a) else {
        return true;
    };
    let corner = |i: usize| std::array::from_fn(|k| [region.lo, region.hi][i >> k & 1][k]);
    (0..8).filter(|i| field.value(corner(*i)) >= 0.0).count() <= 4
}

/// Returns an expression with numbers in place of parameters.
fn substituted(e: &Expression, values: &[(String, f64)]) -> Expression {
    let all = |list: &[(bool, Expression)]| {
        list.iter()
            .map(|(flag, inner)| (*flag, substituted(inner, values)))
            .collect()
    };
    let term = match &e.term {
        Term::Name(name) => {
            let given = values.iter().find(|(given, _)| given == name);
            match given {
                Some((_, value)) if *value < 0.0 => Term::Negative(Box::new(Expression {
                    at: e.at,
                    term: Term::Number(format!("{:?}", -value)),
                })),
                Some((_, value)) => Term::Number(format!("{value:?}")),
                None => return product_of_coordinates(e.at, name),
            }
        }
        Term::Number(text) => Term::Number(text.clone()),
        Term::Sum(list) => Term::Sum(all(list)),
        Term::Product(list) => Term::Product(all(list)),
        Term::Negative(inner) => Term::Negative(Box::new(substituted(inner, values))),
        Term::Power(power) => {
            let [base, exponent] = &**power;
            Term::Power(Box::new([substituted(base, values), exponent.clone()]))
        }
        Term::Call(name, arguments) => {
            let arguments = arguments.iter().map(|inner| substituted(inner, values));
            Term::Call(name, arguments.collect())
        }
    };
    Expression { at: e.at, term }
}

/// Returns a name of several coordinates as their product: xy is x*y.
fn product_of_coordinates(at: usize, name: &str) -> Expression {
    let letter = |c: char| {
        let term = Term::Name(c.to_lowercase().to_string());
        (false, Expression { at, term })
    };
    let is_product = name.chars().all(|c| "xyzXYZ".contains(c));
    let term = match is_product {
        true => Term::Product(name.chars().map(letter).collect()),
        false => Term::Name(name.to_owned()),
    };
    Expression { at, term }
}

/// Writer of a formula as an expression of HyperFun.
#[derive(Default)]
struct ProgramWriter {
    text: String,
    parameters: Vec<String>,
    has_coordinate: bool,
}

impl ProgramWriter {
    /// Writes an expression, in parentheses where it has operators.
    fn write(&mut self, e: &Expression) -> Result<(), FormulaError> {
        match &e.term {
            Term::Number(digits) => {
                // HyperFun needs digits on both sides of the point.
                let value: f64 = digits.parse().unwrap_or(f64::INFINITY);
                if !value.is_finite() {
                    let problem = format!("column {}: the number is too large", e.at + 1);
                    return Err(FormulaError::Program(problem));
                }
                let _ = write!(self.text, "{value:?}");
            }
            Term::Name(name) => self.name(e.at, name)?,
            Term::Sum(terms) => self.chain(terms, [" + ", " - "])?,
            Term::Product(factors) => self.chain(factors, ["*", "/"])?,
            Term::Negative(inner) => {
                self.text += "(-";
                self.write(inner)?;
                self.text += ")";
            }
            Term::Power(power) => {
                let [base, exponent] = &**power;
                self.text += "(";
                self.write(base)?;
                self.text += "^";
                match &exponent.term {
                    // A whole exponent stays one: negative bases have such powers only.
                    Term::Number(digits) if digits.bytes().all(|b| b.is_ascii_digit()) => {
                        self.text += digits;
                    }
                    _ => self.write(exponent)?,
                }
                self.text += ")";
            }
            Term::Call(function, arguments) => self.call(e.at, function, arguments)?,
        }
        Ok(())
    }

    /// Writes operands with operators between them; the second operator stands before those with
    /// the flag.
    fn chain(
        &mut self,
        operands: &[(bool, Expression)],
        operators: [&str; 2],
    ) -> Result<(), FormulaError> {
        self.text += "(";
        for (i, (flag, operand)) in operands.iter().enumerate() {
            if i > 0 {
                self.text += operators[usize::from(*flag)];
            }
            self.write(operand)?;
        }
        self.text += ")";
        Ok(())
    }

    /// Writes a coordinate, a product of coordinates, a constant or a parameter.
    fn name(&mut self, at: usize, name: &str) -> Result<(), FormulaError> {
        let coordinate = |c: char| "xyz".find(c.to_ascii_lowercase()).map(|k| k + 1);
        let product: Option<Vec<String>> = name
            .chars()
            .map(|c| coordinate(c).map(|k| format!("x[{k}]")))
            .collect();
        if let Some(product) = product {
            self.has_coordinate = true;
            let _ = write!(self.text, "({})", product.join("*"));
            return Ok(());
        }
        let constant = match name {
            "pi" | "π" => Some(std::f64::consts::PI),
            "e" => Some(std::f64::consts::E),
            _ => None,
        };
        if let Some(value) = constant {
            let _ = write!(self.text, "{value:?}");
            return Ok(());
        }
        let mut letters = name.chars();
        let is_parameter = letters.next().is_some_and(|c| c.is_ascii_alphabetic())
            && letters.all(|c| c.is_ascii_digit() || c == '_');
        if !is_parameter {
            let (column, name) = (at + 1, name.to_owned());
            return Err(FormulaError::Name { column, name });
        }
        let known = self.parameters.iter().position(|p| p == name);
        let i = known.unwrap_or_else(|| {
            self.parameters.push(name.to_owned());
            self.parameters.len() - 1
        });
        let _ = write!(self.text, "a[{}]", i + 1);
        Ok(())
    }

    /// Writes the call of a function.
    fn call(
        &mut self,
        at: usize,
        function: &'static str,
        arguments: &[Expression],
    ) -> Result<(), FormulaError> {
        if let ("mod", [u, v]) = (function, arguments) {
            // HyperFun's mod rounds to whole numbers.
            self.text += "(";
            self.write(u)?;
            self.text += " - ";
            self.write(v)?;
            self.text += "*floor(";
            self.write(u)?;
            self.text += "/";
            self.write(v)?;
            self.text += "))";
            return Ok(());
        }
        let (expected, is_right) = match (function, arguments.len()) {
            ("atan2" | "mod", n) => ("2 arguments", n == 2),
            ("min" | "max", n) => ("2 or more arguments", n >= 2),
            (_, n) => ("1 argument", n == 1),
        };
        if !is_right {
            return Err(FormulaError::Arguments {
                column: at + 1,
                function,
                expected,
                found: arguments.len(),
            });
        }
        let name = if function == "ln" { "log" } else { function };
        // HyperFun's min and max take two.
        for _ in 2..arguments.len() {
            let _ = write!(self.text, "{name}(");
        }
        let _ = write!(self.text, "{name}(");
        for (i, argument) in arguments.iter().enumerate() {
            match i {
                0 => {}
                1 => self.text += ", ",
                _ => self.text += "), ",
            }
            self.write(argument)?;
        }
        self.text += ")";
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_num::Random;

    /// The program and the exact polynomial, which are made in different ways, have equal values.
    #[test]
    fn programs_and_polynomials_agree() {
        let mut rng = Random::new(7);
        for text in [
            "2x y - 3(x + 1)(y - z)^2 / 4",
            "x²y³ − 1.5e-1·z = 2 - -x",
            "-x^2 - (-y)^3 + 2^3 z",
            "xy + yz + zx >= a x^2 + r1",
            "((x))^0 + 1/2/4y = .5z",
        ] {
            let surface = FormulaSurface::parse(text).expect(text);
            let a: Vec<f64> = surface
                .parameters
                .iter()
                .map(|_| rng.unit() - 0.5)
                .collect();
            let exact = surface.polynomial(&a, &[]).expect("a polynomial").to_f64();
            let model = surface.model(&[], false).expect("a program");
            let (field, _) = field_of(&model, &a).expect("a field");
            for _ in 0..100 {
                let p: [f64; 3] = std::array::from_fn(|_| 4.0 * rng.unit() - 2.0);
                let powers = |e: [u16; 4]| (0..3).map(move |k| p[k].powi(i32::from(e[k])));
                let terms = exact.iter().map(|(e, c)| c * powers(*e).product::<f64>());
                let (expected, found) = (terms.sum::<f64>(), field.value(p));
                assert!(
                    (found - expected).abs() < 1e-12 * 100.0,
                    "{text}: {found}, {expected}"
                );
            }
        }
    }

    /// Default regions show what there is: their half width is that of the surface's own size.
    #[test]
    fn regions_fit_the_surface() {
        for (text, size) in [
            ("x^2 + y^2 - 9z^2 = 1", 1.0),
            ("x^2 + y^2 - z^2 = 1e-6", 1e-3),
            ("x y = 400", 20.0),
            ("sin(x)cos(y) + sin(y)cos(z) + sin(z)cos(x)", 1.5),
            ("x^2 + y^2 - z^2", 0.5),
        ] {
            let surface = FormulaSurface::parse(text).expect(text);
            let solid = surface
                .solid(&[], &[], None, &Control::default())
                .expect(text);
            let half = solid.region.expect("no end").hi[0];
            assert!((1.5 * size..8.0 * size).contains(&half), "{text}: {half}");
        }
        assert_eq!([0.123, 4.0, 99.5].map(two_digits_up), [0.13, 4.0, 100.0]);
    }

    #[test]
    fn functions_have_the_values_of_their_names() {
        let value = |text: &str, p: [f64; 3]| {
            let surface = FormulaSurface::parse(text).expect(text);
            let model = surface.model(&[], false).expect(text);
            field_of(&model, &[]).expect(text).0.value(p)
        };
        let p = [0.3, -0.7, 1.2];
        let [x, y, z]: [f64; 3] = p;
        for (text, expected) in [
            ("sin(x)cos(y)", x.sin() * y.cos()),
            (
                "exp(-x^2) - ln(z)/log(e*z)",
                (-x * x).exp() - z.ln() / (1.0 + z.ln()),
            ),
            ("max(x, y, z) - min(x, y, z)", z - y),
            ("mod(x, 0.25) + mod(y, 2)", 0.05 + 1.3),
            ("2^x + atan2(y, x) + abs(y)", 2f64.powf(x) + y.atan2(x) - y),
            ("pi*x/π + e^y", x + y.exp()),
        ] {
            let found = value(text, p);
            assert!(
                (found - expected).abs() < 1e-12,
                "{text}: {found}, {expected}"
            );
        }
        for constant in ["x - x = 1", "0x", "a = 1", "(x + y)^2 - x^2 - y^2 - 2x y"] {
            let refused = FormulaSurface::parse(constant).expect_err(constant);
            assert_eq!(refused, FormulaError::Constant);
        }
        // A function needs its parentheses.
        let wrong = FormulaSurface::parse("x + tan z").expect_err("no argument");
        assert!(
            matches!(wrong, FormulaError::Name { column: 5, .. }),
            "{wrong}"
        );
    }
}
