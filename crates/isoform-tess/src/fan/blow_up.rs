//! Blow-ups of a base point, and the exceptional lines that they add.

use crate::base::{BasePoint, Near, Seam};

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
