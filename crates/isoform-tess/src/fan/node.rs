//! The nodes of a base point: the point itself, and the base points infinitely near to it.

use super::blow_up::{Line, Step, steps_of};
use super::marks::Mark;
use crate::base::BinaryForm;
use crate::cover::Involution;
use crate::field::Algebraic;

/// A polynomial in the local coordinates, rounded.
#[derive(Clone, Debug, Default)]
pub(crate) struct Form {
    pub(crate) terms: Vec<([usize; 2], f64)>,
    pub(crate) order: usize,
}

impl Form {
    fn rounded(terms: &[([usize; 2], Algebraic)]) -> Self {
        let terms: Vec<([usize; 2], f64)> = terms.iter().map(|(e, c)| (*e, c.to_f64())).collect();
        Self {
            order: terms.iter().map(|([i, j], _)| i + j).min().unwrap_or(0),
            terms,
        }
    }
    fn eval(&self, [u, v]: [f64; 2]) -> f64 {
        let term = |([i, j], c): &([usize; 2], f64)| c * u.powi(*i as i32) * v.powi(*j as i32);
        self.terms.iter().map(term).sum::<f64>()
    }
}

/// A base point, or one infinitely near to it.
#[derive(Clone)]
pub(super) struct Node {
    /// Blow-ups that lead to it.
    pub(super) chain: Vec<Step>,
    /// Forms of the seam curve: coefficients of aᵈ, aᵈ⁻¹b, …, bᵈ.
    curve: [Vec<f64>; 4],
    /// True if the seam is a single point.
    pub(super) is_constant: bool,
    /// Involution of the directions with one image, if the seam covers its image twice; then the
    /// partner of each direction is a direction, too.
    pub(super) cover: Option<Involution>,
    /// True if the seam covers its image twice.
    pub(super) is_double: bool,
    /// Marks of the directions, ascending by angle in [0, π).
    pub(super) marks: Vec<Mark>,
    /// X, Y, Z and W there, without the factors that vanish on exceptional lines; empty if there is
    /// no other node.
    pub(super) forms: [Form; 4],
}

impl Node {
    pub(super) fn new(line: &Line<'_>, marks: Vec<Mark>, cover: Option<Involution>) -> Self {
        // At the starts of other seams the vertices have other names.
        let begins = (0..marks.len()).any(|k| {
            let before = &marks[(k + marks.len() - 1) % marks.len()];
            marks[k].is_near() && (marks[k].is_inside || before.is_inside)
        });
        let curve = line.seam.curve.each_ref().map(BinaryForm::to_f64);
        Self {
            chain: steps_of(&line.chain),
            is_constant: curve[0].len() == 1,
            curve,
            is_double: cover.is_some(),
            cover: cover.filter(|_| !begins),
            marks,
            forms: line.seam.forms.each_ref().map(|f| Form::rounded(f)),
        }
    }
    /// Returns X, Y, Z and W of the seam curve in a direction.
    pub(super) fn seam_at(&self, at: [f64; 2]) -> [f64; 4] {
        self.curve.each_ref().map(|form| eval(form, at))
    }
    /// Returns X, Y, Z and W at a point.
    pub(super) fn value(&self, at: [f64; 2]) -> [f64; 4] {
        self.forms.each_ref().map(|form| form.eval(at))
    }
}

/// Evaluates a form given by the coefficients of aᵈ, aᵈ⁻¹b, …, bᵈ.
fn eval(form: &[f64], [a, b]: [f64; 2]) -> f64 {
    let d = form.len() - 1;
    let term = |(j, c): (usize, &f64)| c * a.powi((d - j) as i32) * b.powi(j as i32);
    form.iter().enumerate().map(term).sum()
}
