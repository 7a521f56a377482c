//! Exact common zeros of forms in (s : t : w) without a common factor.
//!
//! The plane is sheared until no zero at infinity lies in the direction of t, so that the resultant
//! in θ = s + k·t of two combinations of the forms vanishes at every common point. Its irreducible
//! factors define the fields that may contain a zero; over each of them, the greatest common
//! divisor of the forms on the line decides. A shear under which two zeros share a θ is abandoned.

use crate::coefficients::{self, Coefficients};
use crate::field::{Algebraic, Element, NumberField};
use crate::univariate;
use isoform_algebra::{FactorError, Poly, RBig, ResultantError, UPoly, resultant};
use isoform_control::{Control, Stopped};
use isoform_num::Random;
use std::cmp::Ordering;
use std::sync::Arc;

/// Affine chart of the projective plane in which a point is given: the first one that contains it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Chart {
    /// w = 1, coordinates (s, t).
    Affine,
    /// t = 1 on the line w = 0, coordinates (s, w).
    Infinite,
    /// The point (1 : 0 : 0), coordinates (t, w).
    Corner,
}

impl Chart {
    /// Returns the conditions that define the chart, as reports write them.
    pub fn name(self) -> &'static str {
        ["w=1", "t=1,w=0", "s=1,t=w=0"][self as usize]
    }
    /// Returns the variables (0 = s, 1 = t, 2 = w) that are the coordinates, and the one that is 1.
    pub fn variables(self) -> ([usize; 2], usize) {
        [([0, 1], 2), ([0, 2], 1), ([1, 2], 0)][self as usize]
    }
}

/// A class of zeros that are conjugate over Q.
#[derive(Clone, Debug)]
pub(crate) struct Zero {
    pub(crate) chart: Chart,
    pub(crate) field: Arc<NumberField>,
    /// Coordinates of the chart.
    pub(crate) at: [Element; 2],
}

impl Zero {
    /// Returns the homogeneous coordinates (s : t : w).
    pub(crate) fn homogeneous(&self) -> [Element; 3] {
        let ([u, v], one) = self.chart.variables();
        let mut point: [Element; 3] = Default::default();
        point[u] = self.at[0].clone();
        point[v] = self.at[1].clone();
        point[one] = Element::rational(&RBig::ONE);
        point
    }
    /// Returns the real points of the class.
    pub(crate) fn real(&self) -> Vec<[Algebraic; 3]> {
        let roots = 0..self.field.real_roots().len();
        roots
            .map(|root| {
                self.homogeneous()
                    .map(|e| Algebraic::new(&self.field, root, e))
            })
            .collect()
    }
}

/// Returns a linear combination of the forms, whose resultants are taken; any choice without common
/// factors serves.
fn combination(forms: &[Poly], index: u64) -> Poly {
    let mut random = Random::congruential(index);
    forms.iter().enumerate().fold(Poly::zero(), |sum, (i, f)| {
        // The first combinations are single forms, which are sparse if the map is.
        let c = if index < forms.len() as u64 {
            i64::from(i as u64 == index)
        } else {
            (random.bits() >> 60) as i64 - 8
        };
        sum + f.scale(&RBig::from(c))
    })
}

/// Finds the common zeros, one [`Zero`] for each class; if `real`, only classes with real points.
/// They are ordered by chart, then by field.
///
/// The forms are of equal degree and have no common factor.
pub(crate) fn common_zeros(
    forms: &[Poly],
    real: bool,
    control: &Control<'_>,
) -> Result<Vec<Zero>, Stopped> {
    let forms: Vec<Poly> = forms
        .iter()
        .filter(|f| !f.is_zero())
        .map(Poly::primitive)
        .collect();
    let degree = forms.iter().map(Poly::total_degree).max().unwrap_or(0);
    if degree == 0 {
        return Ok(Vec::new());
    }
    let mut zeros = affine_zeros(&forms, degree, real, control)?;
    let on_line = |f: &Poly| f.set(2, &RBig::ZERO).dehomogenise(1).to_upoly(0);
    let common = forms.iter().fold(UPoly::default(), |g, f| {
        g.gcd(&on_line(f).expect("one variable left"))
    });
    assert!(!common.is_zero(), "forms without common factor");
    for (h, _) in common.factor(control).map_err(FactorError::only_stopped)? {
        let (field, s) = NumberField::new(&h);
        if !real || !field.real_roots().is_empty() {
            zeros.push(Zero {
                chart: Chart::Infinite,
                field,
                at: [s, Element::zero()],
            });
        }
    }
    if forms.iter().all(|f| f.degree(0) < degree) {
        zeros.push(Zero {
            chart: Chart::Corner,
            field: NumberField::rationals(),
            at: [Element::zero(), Element::zero()],
        });
    }
    Ok(zeros)
}

/// Finds the common zeros with w = 1.
fn affine_zeros(
    forms: &[Poly],
    degree: usize,
    real: bool,
    control: &Control<'_>,
) -> Result<Vec<Zero>, Stopped> {
    let affine: Vec<Poly> = forms.iter().map(|f| f.dehomogenise(2)).collect();
    if affine.iter().any(Poly::is_constant) {
        return Ok(Vec::new());
    }
    for shift in univariate::shifts() {
        control.check()?;
        // (s, t) = (θ − shift·t, t); the coefficient of t^degree is the form at (−shift : 1 : 0).
        let at = [RBig::from(-shift), RBig::ONE, RBig::ZERO];
        if forms.iter().all(|f| f.eval(&at) == RBig::ZERO) {
            continue;
        }
        let by = Poly::var(0) - Poly::var(1).scale(&RBig::from(shift));
        let sheared: Vec<Poly> = affine.iter().map(|f| f.substitute(0, &by)).collect();
        if let Some(zeros) = zeros_in_shear(&sheared, shift, degree, real, control)? {
            return Ok(zeros);
        }
    }
    unreachable!("all but finitely many shears separate the zeros")
}

/// Finds the zeros under a shear; `None` if it does not separate them.
fn zeros_in_shear(
    forms: &[Poly],
    shift: i64,
    degree: usize,
    real: bool,
    control: &Control<'_>,
) -> Result<Option<Vec<Zero>>, Stopped> {
    // At least one form of each pair keeps its degree in t, so that a common point is a zero of the
    // resultant.
    let full = |f: &Poly| f.degree(1) == degree;
    let mut indices = 0..;
    let first = indices
        .by_ref()
        .map(|i| combination(forms, i))
        .find(full)
        .expect("a form of full degree in t");
    let mut common = UPoly::default();
    let mut used = 0;
    for index in 0.. {
        control.check()?;
        let second = combination(forms, index);
        if second.is_zero() || second.is_associate(&first) {
            continue;
        }
        let r = resultant(&first, &second, 1, control).map_err(ResultantError::only_stopped)?;
        // The resultant is zero if the two have a common factor; not all pairs have one.
        if !r.is_zero() {
            common = common.gcd(&r.to_upoly(0).expect("t was eliminated"));
            used += 1;
        }
        // Two resultants usually have only the zeros in common; further ones would just remove more
        // factors.
        if common.degree() == 0 && used > 0 || used >= 2 && index as usize + 1 >= forms.len() {
            break;
        }
        if index > 3 * forms.len() as u64 && used == 0 {
            // The first combination shares a factor with all the others that were tried: start with
            // another one.
            return zeros_with_first(forms, shift, degree, real, control);
        }
    }
    decide(forms, &common, shift, real, control)
}

/// Finds the zeros under a shear from general combinations only, for forms that share factors in
/// pairs.
fn zeros_with_first(
    forms: &[Poly],
    shift: i64,
    degree: usize,
    real: bool,
    control: &Control<'_>,
) -> Result<Option<Vec<Zero>>, Stopped> {
    let general = |from: u64| (from..).map(|i| combination(forms, i));
    let mut start = forms.len() as u64;
    loop {
        control.check()?;
        let pair: Vec<Poly> = general(start)
            .filter(|f| f.degree(1) == degree)
            .take(2)
            .collect();
        let r = resultant(&pair[0], &pair[1], 1, control).map_err(ResultantError::only_stopped)?;
        if !r.is_zero() {
            return decide(
                forms,
                &r.to_upoly(0).expect("t was eliminated"),
                shift,
                real,
                control,
            );
        }
        start += 2;
    }
}

/// Finds the zeros over the roots θ of a polynomial; `None` if there is more than one zero over
/// some root.
fn decide(
    forms: &[Poly],
    thetas: &UPoly,
    shift: i64,
    real: bool,
    control: &Control<'_>,
) -> Result<Option<Vec<Zero>>, Stopped> {
    let mut zeros = Vec::new();
    let factors = thetas.squarefree_part().factor(control);
    for (h, _) in factors.map_err(FactorError::only_stopped)? {
        let (field, theta) = NumberField::new(&h);
        if real && field.real_roots().is_empty() {
            continue;
        }
        let distinct = roots_over(forms, &field, &theta, control)?;
        match distinct.len() {
            1 => {}
            2 => {
                let t = distinct[0].negated();
                let s = theta.sub(&t.scaled(&RBig::from(shift)));
                zeros.push(Zero {
                    chart: Chart::Affine,
                    field,
                    at: [s, t],
                });
            }
            _ => return Ok(None),
        }
    }
    zeros.sort_by(order);
    Ok(Some(zeros))
}

/// Returns the squarefree polynomial in t whose roots are the common roots of forms over θ.
fn roots_over(
    forms: &[Poly],
    field: &Arc<NumberField>,
    theta: &Element,
    control: &Control<'_>,
) -> Result<Coefficients, Stopped> {
    let mut common: Option<Coefficients> = None;
    for form in forms {
        control.check()?;
        let coefficients = form.coefficients_in(1);
        let values = coefficients.iter().map(|c| field.eval(c, 0, theta));
        let mut column: Coefficients = values.collect();
        coefficients::trim(&mut column);
        let next = match common {
            None => column,
            Some(g) => univariate::gcd(field, &g, &column, control)?,
        };
        let is_one = next.len() == 1;
        common = Some(next);
        if is_one {
            break;
        }
    }
    let common = common.expect("there are forms");
    assert!(!common.is_empty(), "forms without common factor");
    univariate::squarefree_part(field, &common, control)
}

/// Compares by the degree of the field, then by its modulus: a deterministic order.
fn order(a: &Zero, b: &Zero) -> Ordering {
    let key = |z: &Zero| (z.field.degree(), z.field.modulus().coefficients().to_vec());
    key(a).cmp(&key(b))
}
