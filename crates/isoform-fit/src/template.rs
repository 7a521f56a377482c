//! Interface of templates: named parameters and three readings of one function.

use isoform_geom::{DistanceField, Frame, ParamField, Point3};

/// Quantity that a parameter measures. It determines the parameter's unit in the search, and
/// defaults for starts and bounds.
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
    /// Constant term.
    pub constant: f64,
    /// Zero-based index of a parameter, and its factor.
    pub terms: Vec<(usize, f64)>,
}

/// One parameter of a template.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameter {
    /// Name in reports, for example `a[3]` or `radius`.
    pub name: String,
    /// Quantity that it measures.
    pub kind: Kind,
    /// Least value; `None` leaves it to the data.
    pub min: Option<f64>,
    /// Greatest value; `None` leaves it to the data.
    pub max: Option<f64>,
    /// Start that the template's author suggests.
    pub start: Option<f64>,
    /// Value at which it is held; `None` if it is free.
    pub fixed: Option<f64>,
    /// Dependence on other parameters (takes precedence over `fixed`).
    pub tie: Option<Tie>,
    /// Unit for people; the fit does not use it.
    pub unit: Option<String>,
    /// True if it moves the whole template and is not one of its dimensions.
    pub is_pose: bool,
}

impl Parameter {
    /// Makes a free parameter without limits.
    pub fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self {
            name: name.into(),
            kind,
            ..Self::default()
        }
    }
    /// Returns true if a value lies within the bounds.
    pub fn allows(&self, value: f64) -> bool {
        self.min.is_none_or(|min| value >= min) && self.max.is_none_or(|max| value <= max)
    }
}

/// Returns the pieces that determine a template's function at points.
pub(crate) fn parts_of(template: &dyn Template, points: &[Point3], a: &[f64]) -> Vec<u32> {
    let mut parts = vec![0; points.len()];
    template.parts(points, a, &mut parts);
    parts
}

/// A function of space with parameters, in three readings.
pub trait Template: Send + Sync {
    /// Returns the parameters, in the order of the vectors `a`.
    fn parameters(&self) -> &[Parameter];
    /// Returns the model's own function, whose wide basins suit the search.
    fn algebraic(&self) -> &dyn ParamField;
    /// Returns an approximation of the signed distance, by which results are polished and measured.
    fn metric(&self) -> &dyn ParamField;
    /// Returns the signed distance to the surface, with foot points, by which the final fit is
    /// made; `None` if the template knows no better than [`Template::metric`].
    fn distance(&self) -> Option<&dyn DistanceField> {
        None
    }
    /// Returns the frame of the template's shape, in which random points are drawn so that they are
    /// equal in all poses.
    fn frame(&self, _a: &[f64]) -> Frame {
        Frame::SPACE
    }
    /// Returns the names of the smooth pieces of the surface.
    fn part_names(&self) -> &[String];
    /// Computes the piece (index into [`Template::part_names`]) that determines the function at
    /// each point.
    fn parts(&self, points: &[Point3], a: &[f64], out: &mut [u32]);
    /// Returns numbers from which, with its program, the template can be reconstructed with equal
    /// readings: another machine needs them to answer for chunks of points.
    fn recipe(&self) -> Vec<f64> {
        Vec::new()
    }
}
