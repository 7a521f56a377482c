//! Models as programs for CAD: build123d, CadQuery and OpenSCAD.
//!
//! A model of half spaces, blocks, cylinders, cones, balls and tori, joined by set operations, is
//! converted to a program with these operations and with its parameters as named variables, in the
//! model's own frame.

#[cfg(test)]
mod tests;
mod text;
mod tree;

use isoform_field::hyperfun::Model;
use isoform_field::{Graph, SolidError, parameter_values};
use text::ProgramWriter;
use tree::SolidTranslator;

/// Language of CAD programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CadDialect {
    /// Python with build123d.
    Build123d,
    /// Python with CadQuery.
    CadQuery,
    /// OpenSCAD; it approximates round faces by polygons.
    OpenScad,
}

impl CadDialect {
    /// Python dialects, each with its name.
    pub const PYTHON: [(&str, Self); 2] =
        [("build123d", Self::Build123d), ("cadquery", Self::CadQuery)];
}

/// Content of a CAD program in addition to the model.
#[derive(Clone, Debug, Default)]
pub struct CadOptions {
    /// Title, in a comment.
    pub title: String,
    /// Unit of lengths, in a comment; `None` if unknown. CAD programs mostly assume millimetres.
    pub unit: Option<String>,
    /// Diagonal of the part, in model units: half spaces become boxes ten times as large.
    pub diagonal: f64,
    /// Bounds of the 95 % interval of each parameter, in a comment; `None` for a parameter without
    /// one.
    pub intervals: Vec<Option<(f64, f64)>>,
}

/// Reason why a model cannot be converted to a CAD program.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CadProgramError {
    /// The program is not an expression, or lacks values.
    #[error(transparent)]
    Model(#[from] SolidError),
    /// A part is not made of supported operations.
    #[error(
        "{part} is made of no half spaces, blocks, cylinders, cones, balls or tori, joined by set \
         operations"
    )]
    Kind {
        /// Name of the part.
        part: String,
    },
    /// The solid is unbounded: all of space except another solid.
    #[error("the model is all space but a solid")]
    Unbounded,
}

/// Returns a model with the values `a` of its parameters as a CAD program, in which the parameters
/// keep their names. Missing values are those of [`parameter_values`].
///
/// ```
/// use isoform::{CadDialect, CadOptions, cad_program};
/// use isoform::field::hyperfun::{Mode, Model};
/// let text = "-- @param a[1] radius length\nrod(x[3], a[1]) {
///     array c[3]; c[1] = 0; c[2] = 0; c[3] = 0;
///     rod = hfCylinderZ(x, c, a[1]) & x[3] & (5 - x[3]); }";
/// let options = CadOptions { diagonal: 10.0, ..CadOptions::default() };
/// let model = Model::parse(text, Mode::Default).expect("a program");
/// let program = cad_program(&model, &[2.0], &options, CadDialect::OpenScad)?;
/// assert!(program.contains("radius = 2.0;") && program.contains("rod([0, 0, 0], [0, 0, 1], radius)"));
/// # Ok::<(), isoform::CadProgramError>(())
/// ```
///
/// # Errors
/// [`CadProgramError`] if the model uses operations that CAD programs lack, or is unbounded.
pub fn cad_program(
    model: &Model,
    a: &[f64],
    options: &CadOptions,
    dialect: CadDialect,
) -> Result<String, CadProgramError> {
    let values = parameter_values(model, a)?;
    let mut graph = Graph::new();
    let root = model.compile(&mut graph).map_err(SolidError::from)?;
    let mut translator = SolidTranslator::new(graph, &values);
    let region = translator.region(root)?;
    if region.is_outside {
        return Err(CadProgramError::Unbounded);
    }
    let writer = ProgramWriter::new(&translator, model, &values, dialect);
    Ok(writer.program(&region.solid, options))
}
