//! Factorisation over Q of polynomials in one or two variables and of forms in up to three.
//!
//! Every factor is proven by division, and irreducible because all smaller products were tried.

mod bivariate;
mod recombination;
mod residue;
mod univariate;

use crate::poly::Poly;
use crate::upoly::UPoly;
use bivariate::factor_bivariate;
use isoform_control::{Control, Stopped};
use univariate::factor_univariate;

/// Reason why a polynomial could not be factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FactorError {
    /// More than two variables, or three in a polynomial that is not a form.
    #[error(
        "factorisation of polynomials in more than two variables, or of forms in more than three"
    )]
    TooManyVariables,
    /// The work was cancelled, or its deadline is over.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for FactorError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

impl FactorError {
    /// Converts the error to [`Stopped`], the only one possible if the number of variables is
    /// right.
    ///
    /// # Panics
    /// If there were too many variables.
    pub fn only_stopped(self) -> Stopped {
        assert_eq!(self, Self::Stopped, "polynomials in few variables");
        Stopped
    }
}

impl Poly {
    /// Returns the irreducible factors with multiplicities: primitive, by ascending total degree,
    /// then in the order of terms. Their product is this polynomial up to a constant; constants
    /// have none.
    ///
    /// ```
    /// use isoform_algebra::Poly;
    /// use isoform_control::Control;
    /// let p = |text| Poly::parse(text, &["x", "y", "z"]).expect(text);
    /// let factors = p("x^4*z - y^4*z").factor(&Control::default());
    /// assert_eq!(factors, Ok(vec![(p("z"), 1), (p("x - y"), 1), (p("x + y"), 1), (p("x^2 + y^2"), 1)]));
    /// ```
    ///
    /// # Errors
    /// [`FactorError`].
    pub fn factor(&self, control: &Control<'_>) -> Result<Vec<(Self, usize)>, FactorError> {
        let mut factors = Vec::new();
        for (part, multiplicity) in self.squarefree() {
            let irreducible = factor_squarefree(&part, control)?;
            factors.extend(
                irreducible
                    .into_iter()
                    .map(|p| (p.primitive(), multiplicity)),
            );
        }
        factors.sort_by(|(a, _), (b, _)| {
            (a.total_degree(), a.terms()).cmp(&(b.total_degree(), b.terms()))
        });
        Ok(factors)
    }
}

impl UPoly {
    /// Returns the irreducible factors with multiplicities: primitive, by ascending degree, then by
    /// coefficients from below.
    ///
    /// # Errors
    /// [`FactorError::Stopped`].
    pub fn factor(&self, control: &Control<'_>) -> Result<Vec<(Self, usize)>, FactorError> {
        let mut factors = Vec::new();
        for (part, multiplicity) in self.squarefree() {
            factors.extend(
                factor_univariate(&part, control)?
                    .into_iter()
                    .map(|p| (p, multiplicity)),
            );
        }
        factors.sort_by(|(a, _), (b, _)| {
            (a.degree(), a.coefficients()).cmp(&(b.degree(), b.coefficients()))
        });
        Ok(factors)
    }
}

/// Returns the irreducible factors of a polynomial that is primitive, squarefree and not constant.
fn factor_squarefree(p: &Poly, control: &Control<'_>) -> Result<Vec<Poly>, FactorError> {
    let variables = p.variables();
    match variables[..] {
        [] => Ok(Vec::new()),
        [.., last] if variables.len() > 1 && p.is_homogeneous() => factor_form(p, last, control),
        [x] => factor_in(p, x, control),
        [x, y] => factor_in_two(p, [x, y], control),
        _ => Err(FactorError::TooManyVariables),
    }
}

/// Returns the factors of a form: the homogenised factors of its values at `var` = 1, and `var`
/// itself.
fn factor_form(p: &Poly, var: usize, control: &Control<'_>) -> Result<Vec<Poly>, FactorError> {
    let flat = p.dehomogenise(var);
    let power = p.total_degree() - flat.total_degree();
    let factors = factor_squarefree(&flat.primitive(), control)?.into_iter();
    let forms = factors.map(|q| q.homogenise(var, q.total_degree()));
    Ok(forms.chain((power > 0).then(|| Poly::var(var))).collect())
}

/// Returns the factors of a polynomial in one variable.
fn factor_in(p: &Poly, x: usize, control: &Control<'_>) -> Result<Vec<Poly>, FactorError> {
    let dense = p.to_upoly(x).expect("one variable");
    let factors = factor_univariate(&dense, control)?;
    Ok(factors.iter().map(|q| Poly::from_upoly(q, x)).collect())
}

/// Returns the factors of a polynomial in two variables, those in one of them alone first.
fn factor_in_two(
    p: &Poly,
    [x, y]: [usize; 2],
    control: &Control<'_>,
) -> Result<Vec<Poly>, FactorError> {
    let mut factors = Vec::new();
    let mut rest = p.clone();
    for (var, other) in [(x, y), (y, x)] {
        let content = rest.content_in(var);
        if content.degree(other) > 0 {
            factors.extend(factor_in(&content, other, control)?);
            rest = rest.div_exact(&content).expect("the content divides");
        }
    }
    if !rest.is_constant() {
        factors.extend(factor_bivariate(&rest, x, y, control)?);
    }
    Ok(factors)
}
