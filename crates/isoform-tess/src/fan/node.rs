//! The nodes of a base point: itself, and the base points infinitely near to it.

use super::marks::Mark;
use crate::base::{BasePoint, BinaryForm, Near, Seam};
use crate::cover::Involution;
use crate::field::Algebraic;

/// A blow-up in the direction (1 : v), or in the direction (0 : 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// (u, v) = (u′, u′(v₀ + v′)).
    Along(f64),
    /// (u, v) = (u′v′, v′).
    Across,
}

impl Step {
    fn to(near: &Near) -> Self {
        match near.direction[0].is_zero() {
            true => Self::Across,
            false => Self::Along(near.direction[1].to_f64()),
        }
    }
    pub(super) fn is_finite(self) -> bool {
        match self {
            Self::Along(v) => v.is_finite(),
            Self::Across => true,
        }
    }
    /// From the coordinates after the blow-up to those before it.
    #[inline]
    pub(super) fn lower(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Along(v) => [x, x * (v + y)],
            Self::Across => [x * y, y],
        }
    }
    /// From the coordinates before the blow-up to those after it.
    #[inline]
    pub(super) fn lift(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Along(v) => [x, y / x - v],
            Self::Across => [x / y, y],
        }
    }
}

/// The blow-ups that lead to the last one of base points, each infinitely near to the one before.
pub(super) fn steps_of(chain: &[&Near]) -> Vec<Step> {
    chain.iter().map(|near| Step::to(near)).collect()
}

/// Whether the first axis of a base point, and the second one, lead to the last node of a chain,
/// too.
pub(super) fn lifts(chain: &[Step]) -> [bool; 2] {
    [Step::Across, Step::Along(0.0)].map(|along| chain.iter().all(|step| *step == along))
}

/// An exceptional line: what a base point, or one infinitely near to it, is blown up to.
pub(super) struct Line<'a> {
    /// The base points that lead to it, each infinitely near to the one before.
    pub(super) chain: Vec<&'a Near>,
    /// Whether the first axis, and the second one, of its coordinates is the line of another node.
    pub(super) crosses: [bool; 2],
    pub(super) seam: &'a Seam,
    /// The numbers of the lines of the points that are near to it.
    pub(super) children: Vec<usize>,
}

impl<'a> Line<'a> {
    /// All exceptional lines of a base point, parents first.
    pub(super) fn all(base: &'a BasePoint) -> Vec<Self> {
        let mut found = Vec::new();
        Self::collect(&base.seam, &[], [false; 2], &mut found);
        found
    }
    fn collect(seam: &'a Seam, chain: &[&'a Near], crosses: [bool; 2], found: &mut Vec<Self>) {
        let place = found.len();
        found.push(Self {
            chain: chain.to_vec(),
            crosses,
            seam,
            children: Vec::new(),
        });
        for near in &seam.near {
            let crosses = match near.direction[0].is_zero() {
                true => [crosses[0], true],
                false => [true, crosses[1] && near.direction[1].is_zero()],
            };
            let child = found.len();
            found[place].children.push(child);
            Self::collect(&near.seam, &[chain, &[near]].concat(), crosses, found);
        }
    }
}

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
    /// The seam curve's forms: coefficients of aᵈ, aᵈ⁻¹b, …, bᵈ.
    curve: [Vec<f64>; 4],
    /// Whether the seam is one point only.
    pub(super) is_constant: bool,
    /// The pairs of directions with one image, if the seam runs twice through its points. Partners
    /// of directions are directions.
    pub(super) cover: Option<Involution>,
    /// Whether two directions have one image everywhere.
    pub(super) is_double: bool,
    /// The marks of directions, ascending by angle in [0, π).
    pub(super) marks: Vec<Mark>,
    /// X, Y, Z and W there, without what vanishes on exceptional lines; empty if there is no other
    /// node.
    pub(super) forms: [Form; 4],
}

impl Node {
    pub(super) fn new(line: &Line<'_>, marks: Vec<Mark>, cover: Option<Involution>) -> Self {
        // Where other seams begin their vertices have other names.
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
    /// X, Y, Z and W of the seam curve in a direction.
    pub(super) fn seam_at(&self, at: [f64; 2]) -> [f64; 4] {
        self.curve.each_ref().map(|form| eval(form, at))
    }
    /// X, Y, Z and W at a point.
    pub(super) fn value(&self, at: [f64; 2]) -> [f64; 4] {
        self.forms.each_ref().map(|form| form.eval(at))
    }
}

/// The value of a form of which the coefficients of aᵈ, aᵈ⁻¹b, …, bᵈ are given.
fn eval(form: &[f64], [a, b]: [f64; 2]) -> f64 {
    let d = form.len() - 1;
    let term = |(j, c): (usize, &f64)| c * a.powi((d - j) as i32) * b.powi(j as i32);
    form.iter().enumerate().map(term).sum()
}
