//! Double, cuspidal and contracted curves: the curves of the parameter plane along which a rational
//! surface is not smoothly embedded.
//!
//! With the implicit equation F of degree m, D(s, t, w) is the greatest common divisor of the four
//! partial derivatives of F pulled back through the map: its zeros are the parameters of singular
//! points of the surface, apart from finitely many. The pulled back gradient and the vector M of
//! signed 3 × 3 minors of the forms' Jacobian both give the tangent plane, so they are
//! proportional: with J the greatest common divisor of the minors, ∇F∘φ = D·M/J, and D comes from
//! one derivative by exact division.
//!
//! An irreducible factor of D or J is *contracted* if the map is constant on it (then it divides J,
//! not always D), otherwise *ramified* if it divides J (the surface has a cuspidal edge there),
//! otherwise *double*: smooth sheets cross, or touch, in its image.

use crate::field::{Algebraic, Element, NumberField, monic};
use crate::map::Map;
use crate::zeros::common_zeros;
use isoform_algebra::{
    FactorError, IBig, Implicit, Poly, RBig, ResultantError, UBig, UPoly, discriminant, real_roots,
};
use isoform_control::{Control, Stopped};
use std::sync::Arc;

/// A curve of the parameter plane, irreducible over Q, whose images are singular points of the
/// surface, or along which the map is singular.
#[derive(Clone, Debug)]
pub struct SingularCurve {
    /// Primitive form in (s, t, w), irreducible over Q.
    pub curve: Poly,
    /// Multiplicity in D; `None` if D is not known.
    pub in_double: Option<usize>,
    /// Multiplicity in J.
    pub in_minors: usize,
    /// Effect of the map on the curve.
    pub kind: CurveKind,
    /// Real points of the curve.
    pub real: RealPart,
}

impl SingularCurve {
    /// Returns true if the curve is double, and has a real arc.
    pub(crate) fn is_double_arc(&self) -> bool {
        matches!(self.kind, CurveKind::Double) && matches!(self.real, RealPart::Curve)
    }
}

/// Effect of the map on a curve of its parameter plane.
#[derive(Clone, Debug)]
pub enum CurveKind {
    /// Each component is mapped to a point.
    Contracted(Contraction),
    /// The image is a curve along which the rank of the Jacobian drops: a cuspidal edge.
    Ramified,
    /// The image is a curve in which sheets cross or touch.
    Double,
}

/// Points to which the components of a curve are contracted; they are conjugate over Q.
#[derive(Clone, Debug)]
pub struct Contraction {
    /// Field of their coordinates.
    pub field: Arc<NumberField>,
    /// Image (X : Y : Z : W) with W = 1; at infinity, the last non-zero coordinate is 1.
    pub image: [Element; 4],
}

impl Contraction {
    /// Returns the real ones of the points.
    pub fn points(&self) -> Vec<[Algebraic; 4]> {
        let roots = 0..self.field.real_roots().len();
        roots
            .map(|root| {
                self.image
                    .each_ref()
                    .map(|e| Algebraic::new(&self.field, root, e.clone()))
            })
            .collect()
    }
    /// Returns true if the points are at infinity: all of them or none.
    pub fn at_infinity(&self) -> bool {
        self.image[3].is_zero()
    }
}

/// Real points of a curve that is irreducible over Q.
#[derive(Clone, Debug)]
pub enum RealPart {
    /// A real arc, possibly with isolated points in addition.
    Curve,
    /// Only isolated points (s : t : w), possibly none.
    Points(Vec<[Algebraic; 3]>),
    /// Only isolated points, possibly none; they are not computed, as the degree is above
    /// [`POINTS_DEGREE`].
    NoArc,
}

/// Maximum degree of a curve whose isolated points are computed: up to 49 conjugates, about a
/// second.
pub const POINTS_DEGREE: usize = 8;

/// The singular curves of a map.
#[derive(Clone, Debug)]
pub struct Singular {
    /// D up to a constant, a form in (s, t, w); `None` if the implicit equation is not known.
    pub double: Option<Poly>,
    /// J up to a constant, a form in (s, t, w).
    pub minors: Poly,
    /// Irreducible factors of D and J, ordered by degree and then by terms.
    pub curves: Vec<SingularCurve>,
}

/// Finds the singular curves of a map; without an implicit equation only those that divide J.
///
/// # Errors
/// [`Stopped`].
pub fn singular(
    map: &Map,
    implicit: Option<&Implicit>,
    control: &Control<'_>,
) -> Result<Singular, Stopped> {
    let minors = signed_minors(map, control)?;
    let mut common = Poly::zero();
    for m in &minors {
        control.check()?;
        common = common.gcd(m);
    }
    let double = implicit
        .map(|i| double_locus(map, &i.equation, &minors, &common, control))
        .transpose()?;
    let mut curves = Vec::new();
    for factor in factors(&common, double.as_ref(), control)? {
        let Factor {
            curve,
            in_double,
            in_minors,
        } = factor;
        let kind = if in_minors > 0 {
            kind_of_critical(map, &curve, control)?
        } else {
            CurveKind::Double
        };
        let real = real_part(&curve, control)?;
        curves.push(SingularCurve {
            curve,
            in_double,
            in_minors,
            kind,
            real,
        });
    }
    Ok(Singular {
        double,
        minors: common,
        curves,
    })
}

/// An irreducible factor of D or J.
struct Factor {
    curve: Poly,
    /// Multiplicity in D; `None` if D is not known.
    in_double: Option<usize>,
    /// Multiplicity in J.
    in_minors: usize,
}

/// Returns the factors of J and D, ordered by degree and then by terms.
fn factors(
    minors: &Poly,
    double: Option<&Poly>,
    control: &Control<'_>,
) -> Result<Vec<Factor>, Stopped> {
    let of = |p: &Poly| p.factor(control).map_err(FactorError::only_stopped);
    let mut factors: Vec<Factor> = Vec::new();
    for (curve, in_minors) in of(minors)? {
        factors.push(Factor {
            curve,
            in_double: double.map(|_| 0),
            in_minors,
        });
    }
    for (curve, n) in double.map(of).transpose()?.unwrap_or_default() {
        match factors.iter_mut().find(|known| known.curve == curve) {
            Some(known) => known.in_double = Some(n),
            None => factors.push(Factor {
                curve,
                in_double: Some(n),
                in_minors: 0,
            }),
        }
    }
    factors.sort_by(|a, b| {
        let key = |f: &'_ Factor| f.curve.total_degree();
        (key(a), a.curve.terms()).cmp(&(key(b), b.curve.terms()))
    });
    Ok(factors)
}

/// Returns the determinant of three rows, expanded along the first one.
fn determinant(r: &[&[Poly; 3]]) -> Poly {
    let two = |a: usize, b: usize| &r[1][a] * &r[2][b] - &r[1][b] * &r[2][a];
    &r[0][0] * two(1, 2) - &r[0][1] * two(0, 2) + &r[0][2] * two(0, 1)
}

/// Returns (M₀, −M₁, M₂, −M₃), where Mᵢ is the determinant of the Jacobian's rows without row i.
pub(crate) fn signed_minors(map: &Map, control: &Control<'_>) -> Result<[Poly; 4], Stopped> {
    let rows = map
        .forms()
        .each_ref()
        .map(|f| [0, 1, 2].map(|v| f.derivative(v)));
    let mut minors: [Poly; 4] = Default::default();
    for (i, minor) in minors.iter_mut().enumerate() {
        control.check()?;
        let r: Vec<&[Poly; 3]> = (0..4).filter(|&k| k != i).map(|k| &rows[k]).collect();
        let determinant = determinant(&r);
        *minor = if i % 2 == 1 {
            -determinant
        } else {
            determinant
        };
    }
    Ok(minors)
}

/// Computes D from the derivative with the fewest terms.
fn double_locus(
    map: &Map,
    equation: &Poly,
    minors: &[Poly; 4],
    common: &Poly,
    control: &Control<'_>,
) -> Result<Poly, Stopped> {
    control.check()?;
    let candidates = (0..4)
        .filter(|&i| !minors[i].is_zero())
        .map(|i| (equation.derivative(i), i));
    let (derivative, i) = candidates
        .min_by_key(|(d, _)| d.terms().len())
        .expect("the image is a surface");
    let pulled = derivative.compose(map.forms());
    control.check()?;
    let cofactor = minors[i]
        .div_exact(common)
        .expect("a common divisor divides");
    Ok(pulled
        .div_exact(&cofactor)
        .expect("the gradient of the equation is normal to the surface")
        .primitive())
}

/// Classifies a factor of the minors as contracted or ramified.
fn kind_of_critical(map: &Map, curve: &Poly, control: &Control<'_>) -> Result<CurveKind, Stopped> {
    let forms = map.forms();
    let pivot = (0..4)
        .rev()
        .find(|&i| !forms[i].is_multiple_of(curve))
        .expect("no common factor");
    // The tangent vector ∇C × e is not a multiple of the point itself unless e·(s, t, w) is a
    // multiple of C.
    let tangent = if curve.is_associate(&Poly::var(2)) {
        [Poly::zero(), Poly::one(), Poly::zero()]
    } else {
        [curve.derivative(1), -curve.derivative(0), Poly::zero()]
    };
    let along = |f: &Poly| (0..3).fold(Poly::zero(), |sum, v| sum + &tangent[v] * f.derivative(v));
    let pivot_along = along(&forms[pivot]);
    for i in (0..4).filter(|&i| i != pivot) {
        control.check()?;
        let wronskian = &forms[pivot] * along(&forms[i]) - &forms[i] * &pivot_along;
        if !wronskian.is_multiple_of(curve) {
            return Ok(CurveKind::Ramified);
        }
    }
    Ok(CurveKind::Contracted(contraction(
        map, curve, pivot, control,
    )?))
}

/// Returns line number k as (s, t, w) = A + x·B, with A and B on different conics, so that no curve
/// contains all lines.
fn rational_line(k: i64) -> [Poly; 3] {
    let linear = |a: i64, b: i64| Poly::constant(a) + Poly::var(0).scale(&RBig::from(b));
    [
        linear(k, 1),
        linear(1 - k * k, k + 2),
        linear(1 + k, k * k - 3),
    ]
}

/// Returns the image of a contracted curve, computed at an intersection with a rational line.
fn contraction(
    map: &Map,
    curve: &Poly,
    pivot: usize,
    control: &Control<'_>,
) -> Result<Contraction, Stopped> {
    for line in 0i64.. {
        control.check()?;
        let parts = rational_line(line);
        let section = curve.compose(&parts).to_upoly(0).expect("one variable");
        if section.degree() < curve.total_degree()
            || section.squarefree_part().degree() < section.degree()
        {
            continue;
        }
        let factors = section.factor(control).map_err(FactorError::only_stopped)?;
        let Some((h, _)) = factors.first() else {
            continue;
        };
        let (field, x) = NumberField::new(h);
        let value = |f: &Poly| field.eval(&f.compose(&parts), 0, &x);
        let values = map.forms().each_ref().map(value);
        // The intersection is a base point.
        if values[pivot].is_zero() {
            continue;
        }
        let ratios = values.each_ref().map(|v| field.div(v, &values[pivot]));
        return Ok(least_field(&field, &ratios));
    }
    unreachable!("all but finitely many lines meet the curve in simple points")
}

/// Returns a combination of four numbers, a different one in each trial.
fn mixed(numbers: &[Element; 4], trial: i64) -> Element {
    let weights = [
        1,
        trial - 1,
        (trial - 1) * (trial - 2) / 2,
        trial * trial - 2,
    ];
    let terms = numbers.iter().zip(weights.map(RBig::from));
    terms.fold(Element::zero(), |sum, (e, c)| sum.add(&e.scaled(&c)))
}

/// Represents numbers in the field that they generate.
fn least_field(field: &NumberField, numbers: &[Element; 4]) -> Contraction {
    if let [Some(_), Some(_), Some(_), Some(_)] = numbers.each_ref().map(Element::as_rational) {
        return Contraction {
            field: NumberField::rationals(),
            image: numbers.clone(),
        };
    }
    for trial in 1i64.. {
        let (powers, relation) = field.powers(&mixed(numbers, trial));
        let coordinates = numbers.iter().map(|e| field.combination(&powers, e));
        let Some(coordinates) = coordinates.collect::<Option<Vec<_>>>() else {
            // The combination lies in a smaller field.
            continue;
        };
        let (small, root) = NumberField::new(&monic(&relation));
        let image = coordinates.iter().map(|c| {
            c.iter().rev().fold(Element::zero(), |value, c| {
                small.mul(&value, &root).add(&Element::rational(c))
            })
        });
        return Contraction {
            field: small.clone(),
            image: image.collect::<Vec<_>>().try_into().expect("four numbers"),
        };
    }
    unreachable!("all but finitely many combinations generate the field")
}

/// Finds the real points of a form in (s, t, w) that is irreducible over Q.
///
/// It has a real arc if and only if it takes both signs; otherwise its real points are singular.
///
/// # Errors
/// [`Stopped`].
pub fn real_part(curve: &Poly, control: &Control<'_>) -> Result<RealPart, Stopped> {
    if curve.total_degree() % 2 == 1 || changes_sign(&curve.dehomogenise(2), control)? {
        return Ok(RealPart::Curve);
    }
    if curve.total_degree() > POINTS_DEGREE {
        return Ok(RealPart::NoArc);
    }
    let gradient = [0, 1, 2].map(|v| curve.derivative(v));
    Ok(RealPart::Points(
        common_zeros(&gradient, true, control)?
            .iter()
            .flat_map(|z| z.real())
            .collect(),
    ))
}

/// Parameter values, as fractions, over which most curves have points: they are tried before
/// critical values are computed.
const SIMPLE: [(i32, u8); 9] = [
    (0, 1),
    (1, 1),
    (-1, 1),
    (3, 1),
    (-3, 1),
    (1, 3),
    (-1, 3),
    (10, 1),
    (-10, 1),
];

/// Returns true if an irreducible polynomial in s and t takes both signs.
fn changes_sign(f: &Poly, control: &Control<'_>) -> Result<bool, Stopped> {
    let var = usize::from(f.degree(1) > 0);
    let changes_in = |places: &mut dyn Iterator<Item = RBig>| {
        for at in places {
            control.check()?;
            if changes_sign_over(f, var, &at) {
                return Ok(true);
            }
        }
        Ok(false)
    };
    let simple = SIMPLE.map(|(n, d)| RBig::from_parts(IBig::from(n), UBig::from(d)));
    if changes_in(&mut simple.into_iter())? {
        return Ok(true);
    }
    if f.degree(1 - var) == 0 {
        return Ok(false);
    }
    changes_in(&mut between_critical_values(f, var, control)?.into_iter())
}

/// Returns a number between each two successive critical values of a curve, and one on either side
/// of all of them: between critical values, the number of real zeros in the variable `var` is
/// constant.
fn between_critical_values(
    f: &Poly,
    var: usize,
    control: &Control<'_>,
) -> Result<Vec<RBig>, Stopped> {
    let lead = f.coefficients_in(var).swap_remove(f.degree(var));
    let discriminant = discriminant(f, var, control).map_err(ResultantError::only_stopped)?;
    let critical = (discriminant * lead).to_upoly(1 - var);
    let walls = real_roots(&critical.expect("one variable is left"));
    let between = walls.windows(2).map(|w| w[0].rational_below(&w[1]));
    let mut between: Vec<RBig> = between.collect();
    if let (Some(first), Some(last)) = (walls.first(), walls.last()) {
        between.push(first.interval().0 - RBig::ONE);
        between.push(last.interval().1 + RBig::ONE);
    }
    Ok(between)
}

/// Returns true if a polynomial in s and t changes its sign along a line on which the variable
/// other than `var` has a given value.
fn changes_sign_over(f: &Poly, var: usize, at: &RBig) -> bool {
    let u = f.set(1 - var, at).to_upoly(var).expect("one variable");
    let is_odd_root = |(p, n): &(UPoly, usize)| n % 2 == 1 && !real_roots(p).is_empty();
    !u.is_zero() && u.squarefree().iter().any(is_odd_root)
}
