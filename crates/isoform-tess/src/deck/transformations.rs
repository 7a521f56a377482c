//! The deck transformations of a map with rational coefficients.
//!
//! They are continued from the rational points of one fibre (`series`), and proved by φ∘σ = φ.

use super::series::{MAX_FORM_DEGREE, agreeing, continued, monomials};
use super::{Point, Transformation};
use crate::map::Map;
use crate::zeros::common_zeros;
use isoform_algebra::modular::{Crt, primes};
use isoform_algebra::{Poly, RBig};
use isoform_control::{Control, Stopped};

/// Returns the deck transformations with rational coefficients, without the identity.
pub(super) fn transformations(
    map: &Map,
    control: &Control<'_>,
) -> Result<Vec<Transformation>, Stopped> {
    /// Rational points in general position for typical maps. The first one that is neither a base
    /// point nor on a contracted curve is taken.
    const POINTS: [[i64; 2]; 6] = [[2, 3], [-3, 5], [5, -7], [7, 4], [-11, 6], [13, -9]];
    let mut found = Vec::new();
    for at in POINTS {
        let at = [at[0].into(), at[1].into(), RBig::ONE];
        if let Some(others) = rational_fibre(map, &at, control)? {
            for other in others {
                found.extend(transformation(map, &at, &other, control)?);
            }
            break;
        }
    }
    Ok(found)
}

/// Returns the forms that vanish where the image is a given point, whose coordinate `pivot` is not
/// zero.
fn planes_through(forms: &[Poly; 4], image: &[RBig; 4], pivot: usize) -> Vec<Poly> {
    let plane = |i: usize| forms[i].scale(&image[pivot]) - forms[pivot].scale(&image[i]);
    let planes = (0..4).filter(|&i| i != pivot).map(plane);
    planes.filter(|f| !f.is_zero()).collect()
}

/// Returns true if homogeneous coordinates are proportional.
fn are_one_point(p: &Point, q: &Point) -> bool {
    (0..3).all(|i| (0..i).all(|j| &p[i] * &q[j] == &p[j] * &q[i]))
}

/// Returns the other rational points with the image of a rational point; `None` if that is a base
/// point or on a contracted curve.
fn rational_fibre(
    map: &Map,
    at: &Point,
    control: &Control<'_>,
) -> Result<Option<Vec<Point>>, Stopped> {
    let forms = map.forms();
    let image = forms.each_ref().map(|f| f.eval(at));
    let Some(pivot) = image.iter().position(|x| !x.is_zero()) else {
        return Ok(None);
    };
    let planes = planes_through(forms, &image, pivot);
    let common = planes.iter().fold(Poly::zero(), |g, p| g.gcd(p));
    if !common.is_constant() {
        return Ok(None);
    }
    let mut points = Vec::new();
    for zero in common_zeros(&planes, true, control)? {
        let rational = zero.homogeneous().each_ref().map(|e| e.as_rational());
        let [Some(s), Some(t), Some(w)] = rational else {
            continue;
        };
        let p = [s, t, w];
        if !are_one_point(&p, at) && !forms[pivot].eval(&p).is_zero() {
            points.push(p);
        }
    }
    Ok(Some(points))
}

/// Returns the deck transformation that maps a point to another one of its fibre, if there is one.
fn transformation(
    map: &Map,
    from: &Point,
    to: &Point,
    control: &Control<'_>,
) -> Result<Option<Transformation>, Stopped> {
    let mut degree = 1;
    // Index of the coefficient normalised to 1, and the residues of all.
    let mut known: Option<(usize, Crt)> = None;
    // Twelve primes of 62 bits suffice for coefficients of about a hundred digits; those of typical
    // transformations have about ten.
    for field in primes().take(12) {
        control.check()?;
        let Some(lines) = continued(&field, map, from, to) else {
            continue;
        };
        let solution =
            (degree..=MAX_FORM_DEGREE).find_map(|n| Some((n, agreeing(&field, &lines, n)?)));
        let Some((n, (one, values))) = solution else {
            return Ok(None);
        };
        if n > degree {
            // The primes before were special.
            (degree, known) = (n, None);
        }
        let crt = match &mut known {
            Some((place, crt)) if *place == one => crt,
            Some(_) => continue,
            None => &mut known.insert((one, Crt::new(values.len()))).1,
        };
        crt.push(&field, &values);
        let candidate = reconstructed(crt, degree);
        if let Some(candidate) = candidate.filter(|t| is_deck(map, t)) {
            return Ok(Some(candidate));
        }
    }
    Ok(None)
}

/// Reconstructs the forms of a degree from the residues of their coefficients.
fn reconstructed(crt: &Crt, degree: usize) -> Option<Transformation> {
    let (numerators, denominator) = crt.rational()?;
    let number = |n| RBig::from_parts(n, denominator.clone());
    let coefficients: Vec<RBig> = numerators.into_iter().map(number).collect();
    let list = monomials(degree);
    let exponents = || list.iter().map(|e| [e[0], e[1], e[2], 0]);
    let form = |k: usize| {
        let part = &coefficients[k * list.len()..][..list.len()];
        Poly::from_terms(exponents().zip(part.iter().cloned()))
    };
    Some([0, 1, 2].map(form))
}

/// Returns true if φ∘σ = φ.
fn is_deck(map: &Map, t: &Transformation) -> bool {
    let [forms @ .., w] = map.forms();
    let moved = w.compose(t);
    !moved.is_zero() && forms.iter().all(|f| f.compose(t) * w == &moved * f)
}
