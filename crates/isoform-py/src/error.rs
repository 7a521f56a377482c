//! What the library refuses, as exceptions with a code, a place and a hint.
//!
//! Codes are those of the command line. Hints name the arguments of Python.

use isoform::brep::BrepError;
use isoform::field::SolidError;
use isoform::field::hyperfun::SyntaxError;
use isoform::fit::FitError;
use isoform::io::{At, ReadError, WriteError};
use isoform::mesh::MeshError;
use isoform::mesh::features::ExtentError;
use isoform::{
    BrepModelError, CompareError, FitScanError, ImplicitizeError, MeshModelError,
    RationalSurfaceError, RecognizeError, Stopped, TemplateError,
};
use isoform::{patch, recognize, spline};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use std::fmt::Display;

/// Why there is no result.
#[derive(Debug)]
pub(crate) struct Trouble {
    /// Short and fixed, for programs.
    code: &'static str,
    /// What is wrong, with its place.
    message: String,
    /// What to try; may be empty.
    hint: String,
    /// Line and column in a text, from 1.
    place: Option<(usize, usize)>,
}

impl Trouble {
    pub(crate) fn new(code: &'static str, message: impl Display) -> Self {
        Self {
            code,
            message: message.to_string(),
            hint: String::new(),
            place: None,
        }
    }
    /// An argument that cannot be.
    pub(crate) fn usage(message: impl Display) -> Self {
        Self::new("usage", message)
    }
    /// A fault of ours.
    pub(crate) fn internal() -> Self {
        Self::new("internal", "isoform made an error of its own")
            .hint("please report it, with the call and its input")
    }
    /// The work was ended from outside.
    pub(crate) fn stopped(message: impl Display) -> Self {
        Self::new("time-limit", message).hint("a larger time_limit")
    }
    pub(crate) fn hint(mut self, hint: impl Display) -> Self {
        self.hint = hint.to_string();
        self
    }
    /// At a place of a text, both numbers from 1.
    pub(crate) fn at(mut self, line: usize, column: usize) -> Self {
        self.place = Some((line, column));
        self
    }
}

/// The class of exceptions, which lies in the Python half of the package.
static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();

impl From<Trouble> for PyErr {
    fn from(trouble: Trouble) -> Self {
        Python::attach(|py| {
            let class = match CLASS.import(py, "isoform._errors", "IsoformError") {
                Ok(class) => class,
                Err(error) => return error,
            };
            let hint = Some(trouble.hint).filter(|hint| !hint.is_empty());
            let (line, column) = trouble.place.unzip();
            let arguments = (trouble.message, trouble.code, hint, line, column);
            match class.call1(arguments) {
                Ok(raised) => Self::from_value(raised),
                Err(error) => error,
            }
        })
    }
}

impl From<Stopped> for Trouble {
    fn from(Stopped: Stopped) -> Self {
        Self::stopped("stopped before there was a result")
    }
}

impl From<&ReadError> for Trouble {
    fn from(e: &ReadError) -> Self {
        let trouble = Self::new(e.code(), e).hint(e.hint);
        match e.place.at {
            At::Line { line, column } => trouble.at(line as usize, (column as usize).max(1)),
            _ => trouble,
        }
    }
}

impl From<WriteError> for Trouble {
    fn from(e: WriteError) -> Self {
        Self::new(e.code, &e).hint(e.hint)
    }
}

impl From<SyntaxError> for Trouble {
    fn from(e: SyntaxError) -> Self {
        let trouble = Self::new("syntax", &e).at(e.line, e.column);
        match e.expected.as_str() {
            "" => trouble,
            expected => trouble.hint(format!("{expected} there")),
        }
    }
}

impl From<SolidError> for Trouble {
    fn from(e: SolidError) -> Self {
        let inside = "inside is where f >= 0: a sign, or other params";
        match e {
            SolidError::NoSurface { inside: true } => Self::new("unbounded", e).hint(inside),
            SolidError::NoSurface { inside: false } => Self::new("empty", e).hint(inside),
            SolidError::Dimension { .. } => Self::new("dimension", e),
            SolidError::Fails(ref at) => {
                let (line, column) = (at.line, at.column);
                Self::new("run", e).at(line, column)
            }
            SolidError::Parameters { .. } => Self::usage(e),
            SolidError::Missing { .. } => {
                Self::usage(e).hint("params={name: value}, or typical= in the program")
            }
            e => Self::new("model", e),
        }
    }
}

impl From<TemplateError> for Trouble {
    fn from(e: TemplateError) -> Self {
        Self::new("template", e)
    }
}

impl From<FitScanError> for Trouble {
    fn from(e: FitScanError) -> Self {
        match e {
            FitScanError::NoPoints => Self::new("no-points", e),
            FitScanError::Template(e) => e.into(),
            FitScanError::Fixed { .. } => Self::usage(e),
            FitScanError::Start(_) => Self::usage(format!("start has {e}")),
            FitScanError::Bounds { .. } => {
                Self::new("bounds", e).hint("{'radius': (1, 5)}: a name, then both bounds")
            }
            FitScanError::Method => Self::usage(e).hint("method='default'"),
            FitScanError::Fit(e) => e.into(),
            e => Self::new("fit", e),
        }
    }
}

impl From<FitError> for Trouble {
    fn from(e: FitError) -> Self {
        match e {
            FitError::Bounds { .. } => {
                Self::new("bounds", e).hint("bounds=, or min= and max= in the template")
            }
            FitError::Tie { .. } => {
                Self::new("tie", e).hint("the tie= annotations of the template")
            }
            FitError::NothingFree => Self::usage(e).hint("fewer parameters in fixed="),
            FitError::NotFinite { .. } | FitError::Length { .. } => Self::usage(e),
            FitError::TooFewPoints { .. } => {
                Self::new("few-points", e).hint("more points, or parameters held by fixed=")
            }
            FitError::NoFiniteStart { .. } => {
                Self::new("no-finite-value", e).hint("start= or bounds= in the template's domain")
            }
            FitError::Stopped => Self::stopped(e),
            e => Self::new("fit", e),
        }
    }
}

impl From<MeshModelError> for Trouble {
    fn from(e: MeshModelError) -> Self {
        match e {
            MeshModelError::Solid(e) => e.into(),
            MeshModelError::Mesh(e) => e.into(),
            MeshModelError::Jump(e) => Self::new("jump", e),
            e @ MeshModelError::InsideOut { .. } => {
                Self::new("unbounded", e).hint("write -f, or box= to mesh what lies outside")
            }
            e @ MeshModelError::Region { .. } => Self::new("region", e),
            e => Self::usage(e).hint("box=((-1, -1, -1), (1, 1, 1)) around it"),
        }
    }
}

impl From<MeshError> for Trouble {
    fn from(e: MeshError) -> Self {
        match e {
            MeshError::Extent(ExtentError::Stopped) | MeshError::Stopped => Self::stopped(e),
            MeshError::NotANumber { .. } | MeshError::Extent(ExtentError::NotANumber { .. }) => {
                Self::new("not-a-number", e).hint("box= around the part where it is one")
            }
            MeshError::Extent(ExtentError::Empty { .. }) => {
                Self::new("empty", e).hint("inside is where f >= 0: other params, another box")
            }
            MeshError::Extent(ExtentError::Unbounded { .. }) => {
                Self::new("unbounded", e).hint("box=((-1, -1, -1), (1, 1, 1)) to cut it off")
            }
            MeshError::Extent(_) => Self::usage(e).hint("a smaller box"),
            MeshError::Option { .. } | MeshError::RegionName { .. } => Self::usage(e),
            MeshError::NoBox => Self::usage(e).hint("box= around the cell"),
            MeshError::InSide { .. } => Self::new("in-side", e)
                .hint("a box that begins elsewhere: a cell may begin anywhere"),
            MeshError::NotPeriodic { .. } => Self::new("not-periodic", e)
                .hint("another box, or periodic= with the axes along which the model repeats"),
            MeshError::NoLayers { .. } => {
                Self::new("no-layers", e).hint("leave layers= or the other out")
            }
            MeshError::NoPart { .. } => {
                Self::new("no-part", e).hint("layers= with one of these, or a pattern, as 'wall*'")
            }
            MeshError::LayersEnd { ref other, .. } => {
                let hint = format!("layers= with {other} as well");
                Self::new("layers-end", e).hint(hint)
            }
            MeshError::NoRoom { .. } => Self::new("no-room", e)
                .hint("thinner or fewer layers: a smaller first, layer_count"),
            MeshError::NoSlopes { .. } => {
                Self::new("no-slopes", e).hint("layers= with other parts")
            }
            MeshError::Memory { .. } => Self::new("memory", e).hint("a larger size or memory"),
            MeshError::NoMemory { .. } => Self::new("memory", e).hint("a larger size"),
            MeshError::TooCoarse { size } => {
                Self::new("too-coarse", e).hint(format!("size={}", 0.5 * size))
            }
            MeshError::Blocks { .. } => Self::usage(e),
            MeshError::Apart { .. } => Self::new("apart", e).hint("fewer blocks, or another size"),
            MeshError::Input { .. } => Self::new("mesh", e),
            MeshError::Internal { .. } => Self::internal(),
        }
    }
}

impl From<BrepModelError> for Trouble {
    fn from(e: BrepModelError) -> Self {
        let BrepModelError::Brep(error) = e else {
            return match e {
                BrepModelError::Mesh(e) => e.into(),
                e => Self::new("brep", e),
            };
        };
        match error {
            BrepError::Stopped => Self::stopped(error),
            BrepError::NoSurface { .. } | BrepError::Spindle { .. } => {
                Self::new("not-exact", error).hint("parameterize(model, cover=True, tol=...)")
            }
            BrepError::OffSurface { .. } => Self::new("off-surface", error).hint("a smaller size"),
            BrepError::NoCurve { .. } => Self::new("tangent", error),
            BrepError::NoVertex { .. } => Self::new("corner", error).hint("a smaller size"),
            error => Self::new("not-closed", error).hint("a smaller size"),
        }
    }
}

impl From<patch::Error> for Trouble {
    fn from(e: patch::Error) -> Self {
        use patch::Error;
        match e {
            Error::Degree(..) => Self::usage(e).hint("degree=(3, 3)"),
            Error::Option { .. } | Error::Region | Error::Nodes(_) => Self::usage(e),
            Error::Stopped => Self::stopped("stopped before there was a patch"),
            Error::NoSurface => Self::new("empty", e).hint("another box, or seed_point"),
            Error::FarSeed { .. } => Self::new("far-seed", e).hint("another seed_point or seed"),
            Error::Singular { .. } => Self::new("singular", e).hint("another seed_point"),
            Error::NotFinite { .. } => Self::new("not-a-number", e).hint("another seed_point"),
            Error::NoThirdDerivatives => Self::new("derivatives", e).hint("method='gauss-newton'"),
            Error::Folded { .. } => Self::new("folded", e).hint("another seed_point, or tol"),
            Error::NoPatch { .. } => Self::new("no-patch", e).hint("another seed_point, or tol"),
        }
    }
}

impl From<RationalSurfaceError> for Trouble {
    fn from(e: RationalSurfaceError) -> Self {
        match e {
            RationalSurfaceError::Patches(e) => Self::new("not_patches", e),
            RationalSurfaceError::File(e) => Self::new(e.code(), &e).hint(e.hint()),
            RationalSurfaceError::Map(e) => Self::new(e.code(), &e).hint(e.hint()),
            e => Self::new("map", e),
        }
    }
}

impl From<CompareError> for Trouble {
    fn from(e: CompareError) -> Self {
        match e {
            CompareError::NoRegion => Self::usage(e).hint("box=((-1, -1, -1), (1, 1, 1))"),
            CompareError::Empty(_) => Self::new("empty", e).hint("for models, another box"),
            e => Self::new("compare", e),
        }
    }
}

impl From<ImplicitizeError> for Trouble {
    fn from(e: ImplicitizeError) -> Self {
        use spline::Error;
        match e {
            ImplicitizeError::NoNormals => Self::new("no-normals", e).hint("normals='estimate'"),
            ImplicitizeError::Spline(Error::Few { .. } | Error::NotFinite) => {
                Self::new("points", e)
            }
            ImplicitizeError::Spline(Error::Stopped(_)) => Self::stopped(e),
            e => Self::new("no-surface", e),
        }
    }
}

impl From<RecognizeError> for Trouble {
    fn from(e: RecognizeError) -> Self {
        use recognize::Error;
        match e {
            RecognizeError::Stage(Error::Line) => Self::new("no-surface", e),
            RecognizeError::Stage(Error::Stopped(_)) => Self::stopped(e),
            e => Self::new("points", e),
        }
    }
}
