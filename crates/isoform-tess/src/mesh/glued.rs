//! Input of the drawing: the openings of base points, and the vertices that sheets share.

use super::Curves;
use super::atlas::Atlas;
use super::gluing::Gluing;
use super::names::{Name, Node, key};
use super::opening::Openings;
use super::sides::Sides;
use super::special::SpecialCurves;
use crate::claim::{Claim, Verdict};

/// The openings, the vertices with several parameters, and the places on the sides of the unit
/// triangles.
pub(super) struct Glued<'a> {
    pub(super) atlas: &'a Atlas<'a>,
    pub(super) curves: &'a SpecialCurves<'a>,
    pub(super) openings: &'a Openings<'a>,
    pub(super) sides: Sides,
    pub(super) gluing: Gluing,
}

impl<'a> Glued<'a> {
    /// Computes the places on sides and, as far as sheets or borders are joined, the partners of
    /// vertices.
    pub(super) fn new(openings: &'a Openings<'a>, curves: &Curves) -> Self {
        let mut sides = openings.sides();
        let gluing = match &curves.traced {
            Some(traced) => openings.glue_traced(traced, &mut sides),
            None if curves.is_joined() => openings.glue(
                &mut sides,
                &curves.pinches,
                &curves.isolated,
                curves.fibres.as_ref(),
            ),
            None => Gluing::default(),
        };
        Self {
            atlas: openings.atlas,
            curves: openings.curves,
            openings,
            sides,
            gluing,
        }
    }
}
impl Glued<'_> {
    /// Returns the verdicts on the claims of [`OF_MESH`](crate::claim::OF_MESH).
    pub(super) fn verdicts(&self, curves: &Curves) -> [Verdict; 12] {
        const UNOPENED: &str = "no base point is opened in the box";
        let is_opened = !self.openings.sites.is_empty();
        let has_trees = self.openings.has_trees();
        let has_images = self.curves.images().len() > 1;
        let is_folded = is_opened && curves.deck.is_some();
        let is_joined = curves.is_joined() && self.gluing.is_anything_joined();
        let has_partners = is_joined || !curves.isolated.is_empty();
        let asked = |claim: Claim, is_asked, why_not| claim.usual().or_not(is_asked, why_not);
        [
            asked(
                Claim::Images,
                has_images,
                "two contracted curves do not meet",
            ),
            asked(Claim::Tangents, is_opened, UNOPENED),
            asked(Claim::Trees, has_trees, "no base point has others near it"),
            asked(Claim::SignAtBasePoints, is_opened, UNOPENED),
            asked(Claim::Folds, is_folded, "no base point is on a fold"),
            Claim::Drawing.usual(),
            asked(Claim::Partners, has_partners, "no sheets are joined"),
            Claim::SignOfW.usual(),
            Claim::Distances.usual(),
            Claim::Shapes.usual(),
            Claim::Edges.usual(),
            Claim::Winding.usual(),
        ]
    }

    /// Returns the names of a place and of its vertex, which is that of the image on a contracted
    /// curve.
    pub(super) fn names(&self, q: usize, node: &Node) -> [Name; 2] {
        /// Sides that meet in each corner of the unit triangle.
        const SIDES: [[usize; 2]; 3] = [[0, 1], [1, 2], [0, 2]];
        let first = |sides: &[usize]| sides.iter().find_map(|&s| self.curves.on_side[s]);
        let image = node.image.or_else(|| match node.name {
            Name::Side(side, ..) => first(&[side]),
            Name::Corner(c) => first(&SIDES[c]),
            _ => None,
        });
        match image {
            Some(k) => [Name::Image(k); 2],
            None => {
                let shared = self.gluing.name(&key(node.name, q, node.at));
                [node.name, shared.unwrap_or(node.name)]
            }
        }
    }
}
