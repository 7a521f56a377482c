//! Surfaces of programs and polynomials, and rational patches on them.

use crate::{Implicit, field_of, parts_of, polynomial};
use isoform_algebra::ParseError;
use isoform_control::Control;
use isoform_field::SolidError;
use isoform_field::hyperfun::Model;
use isoform_geom::{Aabb, Field, Parts};
use isoform_patch::{
    Cover, Covering, Depth, Error, Options, Parameterized, cover, cover_parts, parameterize,
    parameterize_part,
};
use std::fmt;

/// Minimum share of samples on patches in a complete cover. Samples on the border of the region may
/// lie outside of a patch by rounding: 1 would call most covers of many patches incomplete, 0.99
/// would accept a hole of some patches.
const MIN_COVERED_SHARE: f64 = 0.999;

/// Zero set of a function of space, with its smooth parts.
pub struct ImplicitSurface {
    /// Function f; the solid is f ≥ 0.
    pub field: Box<dyn Field>,
    /// Smooth parts of the surface; `None` if there is only one.
    pub parts: Option<Parts>,
    /// True if the program is run statement by statement, so that nothing can be proved about it.
    pub is_run: bool,
}

impl ImplicitSurface {
    /// Returns the surface of a model with the values `a` of its parameters; missing values are
    /// those of [`parameter_values`](crate::parameter_values).
    ///
    /// # Errors
    /// [`SolidError`] if the model is not a function of space, or there are more values than
    /// parameters.
    pub fn of_model(model: &Model, a: &[f64]) -> Result<Self, SolidError> {
        let (field, is_run) = field_of(model, a)?;
        Ok(Self {
            field,
            parts: parts_of(model, a),
            is_run,
        })
    }

    /// Returns the surface F = 0 of a polynomial in x, y and z with rational coefficients; `None`
    /// if F is constant or has a coefficient beyond the range of doubles.
    ///
    /// # Errors
    /// [`ParseError`] if the text is not a polynomial.
    pub fn of_polynomial(text: &str) -> Result<Option<Self>, ParseError> {
        let field = polynomial(text)?;
        Ok(field.map(|field| Self {
            field: Box::new(field),
            parts: None,
            is_run: false,
        }))
    }
}

impl From<Implicit> for ImplicitSurface {
    fn from(fitted: Implicit) -> Self {
        Self {
            field: Box::new(fitted),
            parts: None,
            is_run: false,
        }
    }
}

impl fmt::Debug for ImplicitSurface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ImplicitSurface")
            .field("parts", &self.parts.as_ref().map(|p| p.parts.len()))
            .field("is_run", &self.is_run)
            .finish_non_exhaustive()
    }
}

/// Computes a rational patch on a surface, as large as possible, with a proved bound on its
/// distance.
///
/// Progress is reported in the phases `seed`, `grow` and `certify`. If time runs out while a patch
/// is growing, it is returned, marked as late.
///
/// ```
/// use isoform::geom::Aabb;
/// use isoform::patch::Options;
/// use isoform::{Control, ImplicitSurface, parameterize_surface, patch_findings};
/// let sphere = ImplicitSurface::of_polynomial("x^2 + y^2 + z^2 - 1/4")?.expect("a surface");
/// let region = Aabb { lo: [-0.5; 3], hi: [0.5; 3] };
/// let options = Options::new((2, 2), 1e-3, region);
/// let patch = parameterize_surface(&sphere, &options, &Control::default())?;
/// assert!(patch.distances.bound.is_some_and(|bound| bound <= 1e-3));
/// assert!(patch_findings(&[patch], None, &options).is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error`] if no patch can be found, or an option is out of range; [`Error::Stopped`] if the
/// control ends the search for a point to start from.
pub fn parameterize_surface(
    surface: &ImplicitSurface,
    options: &Options,
    control: &Control<'_>,
) -> Result<Parameterized, Error> {
    // The bound on S concerns the whole function; a distance is from the surface, whatever its
    // parts.
    let parts = surface.parts.as_ref();
    match parts.filter(|_| options.tolerance.is_some()) {
        Some(parts) => parameterize_part(parts, options, control),
        None => parameterize(surface.field.as_ref(), options, control),
    }
}

/// Covers a surface with patches until all of it in the region lies on one.
///
/// Progress is reported in the phases `samples`, `cover` and, with a margin, `margin`. If time runs
/// out, the patches computed so far are returned.
///
/// ```
/// use isoform::geom::Aabb;
/// use isoform::patch::{Covering, Options};
/// use isoform::{Control, ImplicitSurface, cover_surface};
/// let sphere = ImplicitSurface::of_polynomial("x^2 + y^2 + z^2 - 1/4")?.expect("a surface");
/// let region = Aabb { lo: [-0.6; 3], hi: [0.6; 3] };
/// let options = Options::new((2, 2), 1e-2, region);
/// let cover = cover_surface(&sphere, &options, &Covering::default(), &Control::default())?;
/// assert_eq!(cover.covered, cover.samples);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error`] if no patch can be found at all, or an option is out of range; [`Error::Stopped`] if
/// the control ends the work before there is a patch.
pub fn cover_surface(
    surface: &ImplicitSurface,
    options: &Options,
    covering: &Covering,
    control: &Control<'_>,
) -> Result<Cover, Error> {
    match &surface.parts {
        Some(parts) => cover_parts(parts, options, covering, control),
        None => cover(surface.field.as_ref(), options, covering, control),
    }
}

/// Requirement on patches that is not met. Patches are numbered from 1.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PatchFinding {
    /// Samples of the surface do not lie on a patch.
    Uncovered {
        /// Number of samples on a patch.
        covered: usize,
        /// Number of all samples.
        samples: usize,
    },
    /// A margin could not be proved.
    MarginNotProved {
        /// Number of boxes in which it could not be proved.
        open: usize,
        /// First of these boxes.
        first: Option<Aabb>,
    },
    /// No bound on the distance of a patch could be proved.
    NoBound {
        /// Number of the patch.
        patch: usize,
    },
    /// The proved bound on the distance of a patch exceeds the tolerance.
    TooFar {
        /// Number of the patch.
        patch: usize,
        /// Proved bound on the distance.
        bound: f64,
    },
    /// A patch could not be proved not to fold over.
    MayFold {
        /// Number of the patch.
        patch: usize,
    },
    /// The objective S of a patch exceeds its bound.
    AboveLimit {
        /// Number of the patch.
        patch: usize,
        /// Value of S.
        sum: f64,
    },
    /// Time ran out while the patch could still grow.
    Late {
        /// Number of the patch.
        patch: usize,
    },
    /// A patch could not be made exact.
    NotExact {
        /// Number of the patch.
        patch: usize,
    },
}

impl fmt::Display for PatchFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Uncovered { covered, samples } => {
                write!(
                    f,
                    "{covered} of {samples} samples of the surface lie on a patch"
                )
            }
            Self::MarginNotProved { first: None, .. } => {
                f.write_str("margin: it could not be proved")
            }
            Self::MarginNotProved {
                open,
                first: Some(first),
            } => {
                let [x, y, z] = first.center().map(crate::report::brief);
                let across = crate::report::brief(first.diagonal());
                write!(
                    f,
                    "margin: it could not be proved in {open} boxes, one of them about \
                     ({x}, {y}, {z}), {across} across"
                )
            }
            Self::NoBound { patch } => write!(
                f,
                "patch {patch}: no bound on its distance from the surface could be proved"
            ),
            Self::TooFar { patch, bound } => write!(
                f,
                "patch {patch}: its distance is proved to be at most {bound:e} only"
            ),
            Self::MayFold { patch } => write!(
                f,
                "patch {patch}: it could not be proved that it does not fold over"
            ),
            Self::AboveLimit { patch, sum } => {
                write!(f, "patch {patch}: S is {sum:e}, above the bound")
            }
            Self::Late { patch } => write!(
                f,
                "patch {patch}: the time was over before it was as large as it gets"
            ),
            Self::NotExact { patch } => write!(f, "patch {patch}: it could not be made exact"),
        }
    }
}

/// Returns the requirements that are not met: those of the cover, then those of each patch. Empty
/// if all are met.
pub fn patch_findings(
    patches: &[Parameterized],
    cover: Option<&Coverage>,
    options: &Options,
) -> Vec<PatchFinding> {
    let of_cover = cover.into_iter().flat_map(Coverage::findings);
    let of_patches = patches.iter().enumerate();
    of_cover
        .chain(of_patches.flat_map(|(i, p)| findings_of(p, i + 1, options)))
        .collect()
}

fn findings_of(p: &Parameterized, patch: usize, options: &Options) -> Vec<PatchFinding> {
    let mut found = Vec::new();
    match p.distances.bound {
        None => found.push(PatchFinding::NoBound { patch }),
        Some(bound) if options.tolerance.is_some_and(|t| bound > t) => {
            found.push(PatchFinding::TooFar { patch, bound });
        }
        Some(_) => {}
    }
    if !p.is_unfolded {
        found.push(PatchFinding::MayFold { patch });
    }
    if options.tolerance.is_none() && !p.is_within_limit {
        let sum = p.grown.sum();
        found.push(PatchFinding::AboveLimit { patch, sum });
    }
    if p.is_late {
        found.push(PatchFinding::Late { patch });
    }
    if options.exact && !p.is_exact {
        found.push(PatchFinding::NotExact { patch });
    }
    found
}

/// Coverage of a surface by the patches of a cover, measured by samples of the surface.
#[derive(Clone, Debug)]
pub struct Coverage {
    /// Number of samples that lie on a patch and, with a margin, deep enough.
    pub covered: usize,
    /// Number of samples, those near singular points left out.
    pub samples: usize,
    /// Number of samples left out near singular points.
    pub left_out: usize,
    /// Radius around singular points within which samples may be left out.
    pub apart: f64,
    /// Singular points; of singular curves, sample points.
    pub singular: Vec<isoform_geom::Point3>,
    /// Result of the proof of the margin; `None` if no margin was requested.
    pub depth: Option<Depth>,
}

impl Coverage {
    /// Splits a cover into its patches and its coverage.
    pub fn from_cover(cover: Cover) -> (Vec<Parameterized>, Self) {
        let coverage = Self {
            covered: cover.covered,
            samples: cover.samples,
            left_out: cover.left_out,
            apart: cover.apart,
            singular: cover.singular,
            depth: cover.depth,
        };
        (cover.patches, coverage)
    }

    fn findings(&self) -> Vec<PatchFinding> {
        let mut found = Vec::new();
        let (covered, samples) = (self.covered, self.samples);
        if (covered as f64) < MIN_COVERED_SHARE * samples as f64 {
            found.push(PatchFinding::Uncovered { covered, samples });
        }
        let depth = self.depth.as_ref();
        if let Some(depth) = depth.filter(|depth| depth.distance.is_none()) {
            found.push(PatchFinding::MarginNotProved {
                open: depth.open.len(),
                first: depth.open.first().copied(),
            });
        }
        found
    }
}
