//! What a fit asks of a template: named parameters and three readings of one function.

use isoform_geom::{DistanceField, Frame, ParamField, Point3};

/// What a parameter measures. It sets the parameter's unit in the search and where starts and
/// bounds come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// A position along x.
    X,
    /// A position along y.
    Y,
    /// A position along z.
    Z,
    /// A length, positive unless bounds say otherwise.
    Length,
    /// An angle in radians.
    Angle,
    /// A number without dimension, of order one.
    Ratio,
    /// Unknown; searched as if it were a length or a position, within its bounds.
    #[default]
    Number,
}

/// A parameter that follows others: `constant + Σ factor · a[index]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tie {
    /// Added to the sum.
    pub constant: f64,
    /// Zero-based index of a parameter, and its factor.
    pub terms: Vec<(usize, f64)>,
}

/// One parameter of a template.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameter {
    /// Name in reports, for example `a[3]` or `radius`.
    pub name: String,
    /// What it measures.
    pub kind: Kind,
    /// Least value; none leaves it to the data.
    pub min: Option<f64>,
    /// Greatest value; none leaves it to the data.
    pub max: Option<f64>,
    /// Where the template's author would start.
    pub start: Option<f64>,
    /// Held at this value.
    pub fixed: Option<f64>,
    /// Follows other parameters (takes precedence over `fixed`).
    pub tie: Option<Tie>,
    /// Unit for people; the fit does not use it.
    pub unit: Option<String>,
    /// Whether it moves the whole template and is none of its dimensions.
    pub is_pose: bool,
}

impl Parameter {
    /// A free parameter without limits.
    pub fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self {
            name: name.into(),
            kind,
            ..Self::default()
        }
    }
}

/// The pieces that decide a template's function at some points.
pub(crate) fn parts_of(template: &dyn Template, points: &[Point3], a: &[f64]) -> Vec<u32> {
    let mut parts = vec![0; points.len()];
    template.parts(points, a, &mut parts);
    parts
}

/// A function of space with parameters, read three ways.
pub trait Template: Send + Sync {
    /// The parameters, in the order of the vectors `a`.
    fn parameters(&self) -> &[Parameter];
    /// The model's own function. Its wide basins are searched.
    fn algebraic(&self) -> &dyn ParamField;
    /// Close to a signed distance. It is measured with, and the result polished.
    fn metric(&self) -> &dyn ParamField;
    /// The signed distance to the surface, with foot points: what the fit ends with. None where the
    /// template knows no better than [`Template::metric`].
    fn distance(&self) -> Option<&dyn DistanceField> {
        None
    }
    /// The frame that the template's shape stands in: what is random is made there, so that it is
    /// alike in all poses.
    fn frame(&self, _a: &[f64]) -> Frame {
        Frame::SPACE
    }
    /// Names of the smooth pieces of the surface.
    fn part_names(&self) -> &[String];
    /// The piece (index into [`Template::part_names`]) that decides the function at each point.
    fn parts(&self, points: &[Point3], a: &[f64], out: &mut [u32]);
    /// Numbers from which, and from its program, the template can be made once more elsewhere, with
    /// equal readings: what answers for chunks of points on another machine needs them.
    fn recipe(&self) -> Vec<f64> {
        Vec::new()
    }
}
