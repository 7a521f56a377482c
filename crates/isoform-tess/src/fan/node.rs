//! The nodes of a base point: the point itself, and the base points infinitely near to it.

use super::marks::Mark;
use crate::base::{BasePoint, BinaryForm, Near, Seam};
use crate::cover::Involution;
use crate::field::Algebraic;

/// A blow-up in the direction (1 : v₀), or in the direction (0 : 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// The blow-up (u, v) = (u′, u′(v₀ + v′)).
    Along(f64),
    /// The blow-up (u, v) = (u′v′, v′).
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
    /// Converts coordinates after the blow-up to those before it.
    #[inline]
    pub(super) fn lower(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Along(v) => [x, x * (v + y)],
            Self::Across => [x * y, y],
        }
    }
    /// Converts coordinates before the blow-up to those after it.
    #[inline]
    pub(super) fn lift(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Along(v) => [x, y / x - v],
            Self::Across => [x / y, y],
        }
    }
}

/// Returns the blow-ups that lead to the last one of base points, each infinitely near to the one
/// before.
pub(super) fn steps_of(chain: &[&Near]) -> Vec<Step> {
    chain.iter().map(|near| Step::to(near)).collect()
}

/// Returns true for each of the two axes of a base point that passes through the last node of a
/// chain, too.
pub(super) fn lifts(chain: &[Step]) -> [bool; 2] {
    [Step::Across, Step::Along(0.0)].map(|along| chain.iter().all(|step| *step == along))
}

/// The exceptional line to which a base point, or one infinitely near to it, is blown up.
pub(super) struct Line<'a> {
    /// Base points that lead to it, each infinitely near to the one before.
    pub(super) chain: Vec<&'a Near>,
    /// True for each of the two axes of its coordinates that is the line of another node.
    pub(super) crosses: [bool; 2],
    pub(super) seam: &'a Seam,
    /// Indices of the lines of the points infinitely near to it.
    pub(super) children: Vec<usize>,
}

impl<'a> Line<'a> {
    /// Lists all exceptional lines of a base point, parents first.
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
