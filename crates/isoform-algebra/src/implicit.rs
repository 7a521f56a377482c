//! Rational maps (s, t) ↦ (X : Y : Z : W) over Q: dimension and degree of the image, degree of the
//! map, implicit equation.
//!
//! A map of degree n whose base points have total multiplicity e satisfies (map degree)·(implicit
//! degree) = n² − e. Both sides are counted on pullbacks of planes modulo primes: two of them meet
//! in the base points and n² − e others; if both contain the image of a point, the common points of
//! two such pairs are the base points and the preimages. Resultants see the multiplicities.
//!
//! The equation of a low degree is the kernel of the matrix of all monomials at as many points,
//! modulo primes, put together by Chinese remainders and rational reconstruction. From degree 5 on
//! it is interpolated from its values on lines, which these resultants give: the matrix of
//! degree 16 has 969 columns and costs a hundred times more.

mod kernel;
mod lines;
mod pullback;

use crate::modular::{Echelon, primes, residues};
use crate::poly::Poly;
use isoform_control::Control;
use kernel::{Kernel, equation_of_degree};
use lines::equation_by_lines;
use pullback::{Residues, count_degrees, eval_at};

/// Reason why an implicit equation could not be computed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MapError {
    /// All four polynomials are zero.
    #[error("all four polynomials are zero")]
    Zero,
    /// A variable other than the first two occurs.
    #[error("the map has more than two parameters")]
    TooManyVariables,
    /// The four polynomials have a common factor.
    #[error("the four polynomials have the common factor {}", factor.display(&["s", "t"]))]
    CommonFactor {
        /// The greatest common divisor.
        factor: Poly,
    },
    /// The image is not a surface.
    #[error("the image has dimension {dimension}: not a surface")]
    NotASurface {
        /// 0 for a point, 1 for a curve.
        dimension: usize,
    },
    /// Counts at random points did not agree; maps that cause this are not known.
    #[error(
        "the degrees could not be counted: no two of {MAX_DEGREE_COUNTS} counts at random points \
         agree"
    )]
    Undecided,
    /// The work was cancelled, or its deadline is over.
    #[error("stopped")]
    Stopped,
}

/// Maximum number of counts of the degrees, each at a random point. Two successive counts that
/// agree suffice; the first two nearly always do.
const MAX_DEGREE_COUNTS: usize = 64;

/// Degrees of a rational map onto a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapDegrees {
    /// Degree n of the map: the largest total degree of the four polynomials.
    pub degree: usize,
    /// Number of preimages, complex ones included, of a general point of the image.
    pub map_degree: usize,
    /// Degree of the implicit equation.
    pub implicit_degree: usize,
    /// Sum of the multiplicities of the base points, points at infinity included: n² − map degree ·
    /// implicit degree.
    pub base_multiplicity: usize,
}

/// Implicit equation of a rational map onto a surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Implicit {
    /// Primitive form in x, y, z, w (variables 0 … 3) that is irreducible over Q.
    pub equation: Poly,
    /// Degrees of the map; the implicit degree is that of the equation.
    pub degrees: MapDegrees,
}

/// Recommended bound on the implicit degree of [`implicit`]: 969 monomials.
pub const DEFAULT_MAX_DEGREE: usize = 16;

/// Returns the dimension of the closure of the image of (s, t) ↦ (X : Y : Z : W): 0, 1 or 2.
/// Proven: a lower bound by the rank of the cone's Jacobian at points modulo a prime, an upper
/// bound by minors that vanish identically.
///
/// # Errors
/// [`MapError::Zero`], [`MapError::TooManyVariables`].
pub fn image_dimension(map: &[Poly; 4]) -> Result<usize, MapError> {
    validate(map)?;
    let cone = Cone::new(map);
    Ok(
        if cone.has_full_rank_somewhere() || cone.has_minor_of_three() {
            2
        } else {
            usize::from(cone.has_minor_of_two())
        },
    )
}

/// Cone over the image in four dimensions, by the columns of its Jacobian: the map and its
/// derivatives by s and t.
struct Cone([[Poly; 4]; 3]);

impl Cone {
    fn new(map: &[Poly; 4]) -> Self {
        let by = |v: usize| map.clone().map(|p| p.derivative(v));
        Self([map.clone(), by(0), by(1)])
    }

    /// Returns true if the rank is 3 at one of three random points modulo primes; that is a proof.
    fn has_full_rank_somewhere(&self) -> bool {
        let mut stream = Residues::new(1);
        primes().take(3).any(|field| {
            let at = [stream.next(&field), stream.next(&field), field.one()];
            let mut echelon = Echelon::new(4);
            for column in &self.0 {
                let value = |p: &Poly| eval_at(&field, &residues(&field, p), &at);
                echelon.insert(&field, column.iter().map(value).collect());
            }
            echelon.rank() == 3
        })
    }

    /// Returns the minor of two columns and two rows.
    fn minor(&self, c: [usize; 2], r: [usize; 2]) -> Poly {
        let [a, b] = c.map(|c| &self.0[c]);
        &a[r[0]] * &b[r[1]] - &a[r[1]] * &b[r[0]]
    }

    /// Returns true if the rank over Q(s, t) is 3: a minor of three rows does not vanish.
    fn has_minor_of_three(&self) -> bool {
        let without = |skip: usize| {
            let r: Vec<usize> = (0..4).filter(|&i| i != skip).collect();
            (0..3).fold(Poly::zero(), |sum, i| {
                let rest = [r[(i + 1) % 3], r[(i + 2) % 3]];
                sum + &self.0[0][r[i]] * self.minor([1, 2], rest)
            })
        };
        (0..4).any(|skip| !without(skip).is_zero())
    }

    /// Returns true if the rank over Q(s, t) is at least 2.
    fn has_minor_of_two(&self) -> bool {
        let rows = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
        let columns = [[0, 1], [0, 2], [1, 2]];
        columns
            .into_iter()
            .any(|c| rows.into_iter().any(|r| !self.minor(c, r).is_zero()))
    }
}

/// Returns the degrees of a map onto a surface, counted at random points modulo primes until two
/// counts agree. A count is wrong only if a point is not general, which has a probability of about
/// n⁴/2⁶² each time; [`implicit`] proves the implicit degree.
///
/// # Errors
/// [`MapError`].
pub fn map_degrees(map: &[Poly; 4], control: &Control<'_>) -> Result<MapDegrees, MapError> {
    let degree = validate(map)?;
    let factor = map.iter().fold(Poly::zero(), |g, p| g.gcd(p));
    if !factor.is_constant() {
        return Err(MapError::CommonFactor { factor });
    }
    let dimension = image_dimension(map)?;
    if dimension < 2 {
        return Err(MapError::NotASurface { dimension });
    }
    let mut last = None;
    let mut stream = Residues::new(2);
    for field in primes().take(MAX_DEGREE_COUNTS) {
        if control.is_stopped() {
            return Err(MapError::Stopped);
        }
        let count = count_degrees(&field, map, degree, &mut stream);
        if let (Some(degrees), true) = (count, count == last) {
            return Ok(degrees);
        }
        last = count;
    }
    Err(MapError::Undecided)
}

/// Returns the implicit equation of a map onto a surface; `None` if its degree exceeds the bound.
///
/// The result is proved: the equation vanishes on the map (modulo enough primes for a bound on the
/// coefficients), and it is irreducible over Q and of minimum degree: either the matrix modulo a
/// prime has a single form of that degree in its kernel, or a line meets the image in a number of
/// points equal to the degree.
///
/// ```
/// use isoform_algebra::{Poly, implicit};
/// use isoform_control::Control;
/// let map = ["2*s", "2*t", "1 - s^2 - t^2", "1 + s^2 + t^2"].map(|text| Poly::parse(text, &["s", "t"]).expect(text));
/// let found = implicit(&map, 16, &Control::default()).expect("a surface").expect("of low degree");
/// assert_eq!(found.equation.to_string(), "x^2 + y^2 + z^2 - w^2");
/// ```
///
/// # Errors
/// [`MapError`].
pub fn implicit(
    map: &[Poly; 4],
    max_degree: usize,
    control: &Control<'_>,
) -> Result<Option<Implicit>, MapError> {
    let mut degrees = map_degrees(map, control)?;
    let mut degree = degrees.implicit_degree;
    loop {
        if degree > max_degree {
            return Ok(None);
        }
        if degree >= MIN_LINES_DEGREE
            && degree == degrees.implicit_degree
            && let Some(equation) = equation_by_lines(map, &degrees, control)?
        {
            return Ok(Some(Implicit { equation, degrees }));
        }
        match equation_of_degree(map, degree, control)? {
            Kernel::One(equation) => {
                degrees.implicit_degree = degree;
                return Ok(Some(Implicit { equation, degrees }));
            }
            // This occurs only after a wrong count.
            Kernel::None => degree += 1,
            Kernel::More => degree -= 1,
        }
    }
}

/// Minimum implicit degree at which lines are faster than the matrix of all monomials (measured).
const MIN_LINES_DEGREE: usize = 5;

/// Returns the degree of the map, or an error if the map is invalid.
fn validate(map: &[Poly; 4]) -> Result<usize, MapError> {
    if map.iter().any(|p| p.degree(2) + p.degree(3) > 0) {
        return Err(MapError::TooManyVariables);
    }
    if map.iter().all(Poly::is_zero) {
        return Err(MapError::Zero);
    }
    Ok(map.iter().map(Poly::total_degree).max().unwrap_or(0))
}
