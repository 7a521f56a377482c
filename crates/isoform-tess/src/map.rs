//! A rational map (s, t) ↦ (X/W, Y/W, Z/W), validated and stored as four forms of equal degree in
//! (s : t : w).

use dashu_base::{Gcd, UnsignedAbs};
use isoform_algebra::{Exponents, ParseError, ParseProblem, Poly, RBig, UBig, image_dimension};

/// Names of the four polynomials, in storage order.
pub const KEYS: [&str; 4] = ["X", "Y", "Z", "W"];

/// Names of the variables of the forms: variables 0, 1 and 2 of every [`Poly`] here.
pub const VARIABLES: [&str; 3] = ["s", "t", "w"];

/// Maximum degree of a map: beyond it the exact analysis is out of reach by orders of magnitude.
pub const MAX_MAP_DEGREE: usize = 64;

/// Reason why an input is not a rational map onto a surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError {
    /// A text is not a polynomial in s and t.
    #[error("{key}, {error}")]
    NotAPolynomial {
        /// One of [`KEYS`].
        key: &'static str,
        /// Position in the text, and what was expected there.
        error: ParseError,
    },
    /// A coefficient is infinite or NaN.
    #[error("{key} has a coefficient that is infinite or not a number")]
    NotFinite {
        /// One of [`KEYS`].
        key: &'static str,
    },
    /// The degree is above [`MAX_MAP_DEGREE`].
    #[error("the map has degree {degree}, above {MAX_MAP_DEGREE}")]
    DegreeTooLarge {
        /// Degree of the map.
        degree: usize,
    },
    /// All four polynomials are zero.
    #[error("X, Y, Z and W are all zero")]
    AllZero,
    /// The denominator is zero.
    #[error("the denominator W is zero: the map has no finite point")]
    ZeroDenominator,
    /// The four polynomials have a common factor.
    #[error("X, Y, Z and W have the common factor {}", factor.display(&VARIABLES))]
    CommonFactor {
        /// The greatest common divisor, in s and t.
        factor: Poly,
    },
    /// The image is not a surface.
    #[error("the image is a {}, not a surface", if *dimension == 0 { "point" } else { "curve" })]
    NotASurface {
        /// 0 for a point, 1 for a curve.
        dimension: usize,
    },
}

impl MapError {
    /// Returns an identifier of the error for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NotAPolynomial {
                error:
                    ParseError {
                        problem: ParseProblem::UnknownName { .. },
                        ..
                    },
                ..
            } => "unknown_variable",
            Self::NotAPolynomial { .. } => "not_a_polynomial",
            Self::NotFinite { .. } => "not_finite",
            Self::DegreeTooLarge { .. } => "degree_too_large",
            Self::AllZero => "all_zero",
            Self::ZeroDenominator => "zero_denominator",
            Self::CommonFactor { .. } => "common_factor",
            Self::NotASurface { .. } => "not_a_surface",
        }
    }
    /// Returns the polynomial concerned, if it is a single one: an element of [`KEYS`].
    pub fn key(&self) -> Option<&'static str> {
        match self {
            Self::NotAPolynomial { key, .. } | Self::NotFinite { key } => Some(key),
            Self::ZeroDenominator => Some("W"),
            _ => None,
        }
    }
    /// Returns the remedy, in one sentence.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NotAPolynomial { error, .. } => error.problem.hint(),
            Self::NotFinite { .. } => "all coefficients must be finite numbers",
            Self::DegreeTooLarge { .. } => {
                "approximate the surface by one of lower degree, or by several patches"
            }
            Self::AllZero => "at least W and two of the others must differ from zero",
            Self::ZeroDenominator => "use W = 1 for a polynomial surface",
            Self::CommonFactor { .. } => "divide all four by it, or let it be removed (reduce)",
            Self::NotASurface { .. } => {
                "the coordinates must depend on both parameters independently"
            }
        }
    }
}

/// Options for the repair of maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MapOptions {
    /// True to remove a common factor instead of refusing the map; [`Map::removed`] then returns
    /// the factor.
    pub reduce: bool,
}

/// A rational map onto a surface: four forms of degree n in (s : t : w) with integer coefficients,
/// without a common factor.
///
/// ```
/// use isoform_tess::{Map, MapError, MapOptions, VARIABLES};
///
/// let sphere = ["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"];
/// let sphere = Map::parse(sphere, MapOptions::default())?;
/// assert_eq!(sphere.degree(), 2);
/// assert_eq!(sphere.forms()[0].display(&VARIABLES).to_string(), "2*s*w");
/// // A cone over a circle is a surface, but the circle itself is not.
/// let circle = Map::parse(["2*s", "1 - s^2", "0", "1 + s^2"], MapOptions::default());
/// assert_eq!(circle, Err(MapError::NotASurface { dimension: 1 }));
/// # Ok::<(), MapError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Map {
    affine: [Poly; 4],
    forms: [Poly; 4],
    degree: usize,
    removed: Option<Poly>,
}

impl Map {
    /// Creates the map of four polynomials in s and t (variables 0 and 1).
    ///
    /// # Errors
    /// [`MapError`]: too high a degree, all zero, zero denominator, image not a surface, common
    /// factor, in this order.
    ///
    /// # Panics
    /// If another variable occurs.
    pub fn new(polynomials: [Poly; 4], options: MapOptions) -> Result<Self, MapError> {
        assert!(
            polynomials.iter().all(|p| p.degree(2) + p.degree(3) == 0),
            "polynomials in s and t"
        );
        if polynomials.iter().all(Poly::is_zero) {
            return Err(MapError::AllZero);
        }
        if polynomials[3].is_zero() {
            return Err(MapError::ZeroDenominator);
        }
        let degree = degree_of(&polynomials);
        if degree > MAX_MAP_DEGREE {
            return Err(MapError::DegreeTooLarge { degree });
        }
        let dimension =
            image_dimension(&polynomials).expect("polynomials in s and t that are not all zero");
        if dimension < 2 {
            return Err(MapError::NotASurface { dimension });
        }
        let factor = polynomials.iter().fold(Poly::zero(), |g, p| g.gcd(p));
        if !factor.is_constant() && !options.reduce {
            return Err(MapError::CommonFactor { factor });
        }
        let (affine, removed) = without_factor(polynomials, factor);
        let factor = RBig::ONE / joint_content(&affine);
        let affine = affine.map(|p| p.scale(&factor));
        let degree = degree_of(&affine);
        Ok(Self {
            forms: affine.clone().map(|p| p.homogenise(2, degree)),
            affine,
            degree,
            removed,
        })
    }

    /// Parses a map from four texts, X, Y, Z and W.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn parse(texts: [&str; 4], options: MapOptions) -> Result<Self, MapError> {
        let mut polynomials: [Poly; 4] = Default::default();
        for ((p, text), key) in polynomials.iter_mut().zip(texts).zip(KEYS) {
            *p = Poly::parse(text, &VARIABLES[..2])
                .map_err(|error| MapError::NotAPolynomial { key, error })?;
        }
        Self::new(polynomials, options)
    }

    /// Creates the map of terms (exponents of s and t, coefficient). Each coefficient is taken as
    /// the exact value of its double.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn from_f64(terms: [&[([u16; 2], f64)]; 4], options: MapOptions) -> Result<Self, MapError> {
        let mut polynomials: [Poly; 4] = Default::default();
        for ((p, terms), key) in polynomials.iter_mut().zip(terms).zip(KEYS) {
            let widened = terms
                .iter()
                .map(|&([i, j], c)| ([i, j, 0, 0] as Exponents, c));
            *p = Poly::from_f64(widened).ok_or(MapError::NotFinite { key })?;
        }
        Self::new(polynomials, options)
    }

    /// Returns X, Y, Z and W in s and t, with integer coefficients without a common factor.
    pub fn affine(&self) -> &[Poly; 4] {
        &self.affine
    }
    /// Returns X, Y, Z and W as forms of degree [`Map::degree`] in s, t and w.
    pub fn forms(&self) -> &[Poly; 4] {
        &self.forms
    }
    /// Returns the largest degree of the four polynomials.
    pub fn degree(&self) -> usize {
        self.degree
    }
    /// Returns the common factor that was removed, in s and t.
    pub fn removed(&self) -> Option<&Poly> {
        self.removed.as_ref()
    }
}

/// Divides polynomials by a common factor, and returns the factor unless it is a constant.
fn without_factor(polynomials: [Poly; 4], factor: Poly) -> ([Poly; 4], Option<Poly>) {
    if factor.is_constant() {
        return (polynomials, None);
    }
    let quotient = |p: Poly| p.div_exact(&factor).expect("a common divisor divides");
    (polynomials.map(quotient), Some(factor))
}

/// Returns the largest total degree.
fn degree_of(polynomials: &[Poly; 4]) -> usize {
    let degrees = polynomials.iter().map(Poly::total_degree);
    degrees.max().unwrap_or(0)
}

/// Returns the number by which all four are divided to make their coefficients integers without a
/// common factor.
fn joint_content(polynomials: &[Poly; 4]) -> RBig {
    let (mut numerator, mut denominator) = (UBig::ZERO, UBig::ONE);
    for content in polynomials
        .iter()
        .filter(|p| !p.is_zero())
        .map(Poly::content)
    {
        let n = content.numerator().clone().unsigned_abs();
        numerator = if numerator == UBig::ZERO {
            n
        } else {
            numerator.gcd(n)
        };
        denominator =
            &denominator / (&denominator).gcd(content.denominator()) * content.denominator();
    }
    RBig::from_parts(numerator.into(), denominator)
}
