//! Surfaces to parameterize: of programs, and of polynomials as text.

use isoform_algebra::{ParseError, Poly};
use isoform_field::hyperfun::Model;
use isoform_field::{Bound, Graph, Polynomial, Residual, RunField, SolidError, Tape};
use isoform_geom::Field;

/// The names of the coordinates in polynomials.
pub const COORDINATES: [&str; 3] = ["x", "y", "z"];

/// A model with the values `a` of its parameters as a function of space, as the program says it (the algebraic reading); and whether
/// its program must be run statement by statement for that, when nothing is proved of it.
pub fn field_of(model: &Model, a: &[f64]) -> Result<(Box<dyn Field>, bool), SolidError> {
    // Also finds what no evaluation could do with: another dimension than 3, another number of values.
    let run = RunField::new(model, a)?;
    let mut graph = Graph::new();
    match model.compile(&mut graph) {
        Ok(root) => {
            let tape = Tape::new(&graph, &[root], 3, model.n_params());
            Ok((Box::new(Bound::new(Residual::new(tape), a)), false))
        }
        Err(_) => Ok((Box::new(run), true)),
    }
}

/// A polynomial in x, y and z with rational coefficients, rounded to nearest; none where a coefficient is beyond the largest double or
/// the polynomial is constant.
///
/// ```
/// use isoform::geom::Field;
/// let sphere = isoform::polynomial("x^2 + y^2 + z^2 - 1/4")?.expect("a surface");
/// assert_eq!(sphere.value([0.5, 0.0, 0.0]), 0.0);
/// # Ok::<(), isoform::algebra::ParseError>(())
/// ```
pub fn polynomial(text: &str) -> Result<Option<Polynomial>, ParseError> {
    let exact = Poly::parse(text, &COORDINATES)?;
    let terms: Vec<([u16; 3], f64)> = exact.to_f64().into_iter().map(|(e, c)| ([e[0], e[1], e[2]], c)).collect();
    let usable = !exact.is_constant() && terms.iter().all(|t| t.1.is_finite());
    Ok(usable.then(|| Polynomial::new(terms)))
}
