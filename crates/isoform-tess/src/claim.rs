//! What a certificate claims of a surface, and on what basis.
//!
//! A certificate is as good as its weakest step, so each claim says how it was decided: a reader
//! who needs a proof knows which of them to check by other means.

use std::fmt;

/// How a claim is decided, the strongest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Basis {
    /// By exact arithmetic, or by counting and comparing doubles that are given: a proof.
    Exact,
    /// In floating point with bounds on all errors: a proof as long as these bounds are right.
    Bounded,
    /// Checked, not proved: in floating point up to a tolerance, or at samples.
    Floating,
}

impl Basis {
    /// All of them, the strongest first.
    pub const ALL: [Self; 3] = [Self::Exact, Self::Bounded, Self::Floating];
}

impl fmt::Display for Basis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Exact => "exact",
            Self::Bounded => "bounded",
            Self::Floating => "floating",
        })
    }
}

/// What is claimed of a surface, in the order in which it is found out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Claim {
    /// The real base points with their trees of infinitely near ones.
    BasePoints,
    /// Complex base points are blown up to no real curves but those that are drawn.
    ComplexSeams,
    /// The factors and the topology of W = 0.
    Pole,
    /// How many parameters reach a general point.
    MapDegree,
    /// The cuspidal and contracted curves of the parameters.
    CriticalCurves,
    /// The double curves of the parameters.
    DoubleCurves,
    /// The deck transformations of an improper map, and the folds that they make.
    DeckTransformations,
    /// No base point is blown up to a part of the border of the fundamental domain.
    FundamentalDomain,
    /// The points where double curves end and sheets fold.
    PinchPoints,
    /// The real points that only conjugate parameters reach.
    SolitaryArcs,
    /// W has no zero over the region of the parameters, which is sent into the open box.
    Weights,
    /// The cells of the parameters that are sent into the box.
    Region,
    /// Which contracted curves have one image, and what passes through it.
    Images,
    /// The directions in which base points are opened, and what lies in the rectangles around them.
    Tangents,
    /// The order of rays and arcs around base points with others infinitely near to them.
    Trees,
    /// W keeps its sign between base points and the rectangles around them.
    SignAtBasePoints,
    /// The seams of base points that the surface of an improper map ends in.
    Folds,
    /// What is drawn in the parameters is the region up to isotopy.
    Drawing,
    /// Which parameters are sent to one point of a double curve, or of a border that is joined.
    Partners,
    /// W keeps its sign on the triangles of the parameters.
    SignOfW,
    /// How far the triangles are from the surface.
    Distances,
    /// Triangles have areas, vertices are apart and in the box.
    Shapes,
    /// Where the mesh ends, and how many triangles its edges have.
    Edges,
    /// Sides that patches have in common are joined.
    Sides,
    /// No triangles cross.
    Crossings,
    /// No sheets lie upon each other, and none are joined that are to stay apart.
    Sheets,
}

impl Claim {
    /// All of them, in their order.
    pub const ALL: [Self; 26] = [
        Self::BasePoints,
        Self::ComplexSeams,
        Self::Pole,
        Self::MapDegree,
        Self::CriticalCurves,
        Self::DoubleCurves,
        Self::DeckTransformations,
        Self::FundamentalDomain,
        Self::PinchPoints,
        Self::SolitaryArcs,
        Self::Weights,
        Self::Region,
        Self::Images,
        Self::Tangents,
        Self::Trees,
        Self::SignAtBasePoints,
        Self::Folds,
        Self::Drawing,
        Self::Partners,
        Self::SignOfW,
        Self::Distances,
        Self::Shapes,
        Self::Edges,
        Self::Sides,
        Self::Crossings,
        Self::Sheets,
    ];

    /// The weakest step by which it is decided, where nothing else is said: see [`Grade`].
    pub fn basis(self) -> Basis {
        match self {
            // Number fields, exact division, factors and resultants over Q, signs of rational
            // numbers; counting of triangles; exact predicates on the vertices.
            Self::BasePoints
            | Self::ComplexSeams
            | Self::MapDegree
            | Self::CriticalCurves
            | Self::DoubleCurves
            | Self::DeckTransformations
            | Self::PinchPoints
            | Self::Weights
            | Self::Drawing
            | Self::Edges
            | Self::Sides
            | Self::Crossings => Basis::Exact,
            // Which curves meet over a wall is exact. Where they do not, their roots are isolated
            // in floating point with bounds on its errors, if that decides.
            Self::Pole | Self::Region => Basis::Bounded,
            // Bernstein coefficients in doubles, with a bound on their rounding.
            Self::SignOfW => Basis::Bounded,
            // Sections and paths in doubles; Newton's method to a tolerance; samples; base points
            // rounded to doubles, with thresholds for what is zero; triangles of sheets that lie upon
            // each other cross as a rule only.
            Self::FundamentalDomain
            | Self::SolitaryArcs
            | Self::Images
            | Self::Tangents
            | Self::Trees
            | Self::SignAtBasePoints
            | Self::Folds
            | Self::Partners
            | Self::Distances
            | Self::Shapes
            | Self::Sheets => Basis::Floating,
        }
    }

    /// What holds where nothing is found against it.
    pub fn statement(self) -> &'static str {
        match self {
            Self::BasePoints => {
                "the real base points, their multiplicities and the points infinitely near to them \
                 are all known"
            }
            Self::ComplexSeams => {
                "complex base points are blown up to no real curve but the lines that are drawn"
            }
            Self::Pole => "the factors of W and the topology of its real zeros are known",
            Self::MapDegree => "so many parameters reach a general point of the surface",
            Self::CriticalCurves => {
                "the curves of the parameters with cuspidal edges or points as images are all known"
            }
            Self::DoubleCurves => {
                "the curves of the parameters along which sheets meet are all known"
            }
            Self::DeckTransformations => {
                "the transformations that exchange parameters of a point, and their folds, are \
                 those of the map"
            }
            Self::FundamentalDomain => {
                "no base point is blown up to a part of the fundamental domain's border, as 12 \
                 directions at each of them show"
            }
            Self::PinchPoints => "the pinch points are all known",
            Self::SolitaryArcs => {
                "the points that only conjugate parameters reach are on the solitary arcs; arcs \
                 that no section of the box meets may be missed"
            }
            Self::Weights => "W has no zero over the region, which is sent into the open box",
            Self::Region => "the cells of the parameters that are sent into the box are known",
            Self::Images => {
                "images of contracted curves are one vertex where they are one point to rounding"
            }
            Self::Tangents => {
                "base points are opened in the directions of all curves that are drawn there"
            }
            Self::Trees => {
                "rays and arcs at infinitely near base points leave the rectangle around them in \
                 the order in which they begin"
            }
            Self::SignAtBasePoints => {
                "W keeps its sign between base points and the rectangles around them"
            }
            Self::Folds => {
                "the surface ends in those seams of base points along which it is folded"
            }
            Self::Drawing => {
                "the polylines in the parameters lie in the order of the arcs that they stand for, \
                 and do not cross"
            }
            Self::Partners => {
                "edges of double curves, and of borders that are joined, have all sheets that meet \
                 there"
            }
            Self::SignOfW => "W keeps its sign on every triangle of the parameters",
            Self::Distances => {
                "the middles of triangles and edges are as near to the surface as asked for"
            }
            Self::Shapes => "triangles have areas; vertices are apart, and in the box",
            Self::Edges => {
                "the mesh ends on the box and on sides of the region only; only edges of double \
                 curves have more than two triangles"
            }
            Self::Sides => "sides that patches have in common are joined",
            Self::Crossings => "no triangles cross",
            Self::Sheets => {
                "no sheets lie upon each other, and none are joined that are to stay apart"
            }
        }
    }
}

impl fmt::Display for Claim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BasePoints => "base points",
            Self::ComplexSeams => "seams of complex base points",
            Self::Pole => "pole",
            Self::MapDegree => "degree of the map",
            Self::CriticalCurves => "cuspidal and contracted curves",
            Self::DoubleCurves => "double curves",
            Self::DeckTransformations => "deck transformations",
            Self::FundamentalDomain => "fundamental domain",
            Self::PinchPoints => "pinch points",
            Self::SolitaryArcs => "solitary arcs",
            Self::Weights => "weights",
            Self::Region => "region",
            Self::Images => "images of contracted curves",
            Self::Tangents => "tangents at base points",
            Self::Trees => "trees of infinitely near base points",
            Self::SignAtBasePoints => "sign of W at base points",
            Self::Folds => "folds at base points",
            Self::Drawing => "drawing",
            Self::Partners => "partners",
            Self::SignOfW => "sign of W",
            Self::Distances => "distances",
            Self::Shapes => "shapes",
            Self::Edges => "edges",
            Self::Sides => "sides of patches",
            Self::Crossings => "crossings",
            Self::Sheets => "sheets",
        })
    }
}

/// A claim, and how it was decided of this surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Grade {
    /// What is claimed.
    pub claim: Claim,
    /// By what.
    pub basis: Basis,
}

impl From<Claim> for Grade {
    /// With the basis that the claim commonly has.
    fn from(claim: Claim) -> Self {
        let basis = claim.basis();
        Self { claim, basis }
    }
}

/// Each claim once, in their order, with the weakest basis that it has anywhere.
pub(crate) fn graded(grades: impl IntoIterator<Item = Grade>) -> Vec<Grade> {
    let mut all: Vec<Grade> = grades.into_iter().collect();
    // The weakest basis of a claim comes first, and stays.
    all.sort_by_key(|g| (g.claim, std::cmp::Reverse(g.basis)));
    all.dedup_by_key(|g| g.claim);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weakest_basis_of_a_claim_counts() {
        let degree = |basis| Grade {
            claim: Claim::MapDegree,
            basis,
        };
        let given = [
            Claim::SignOfW.into(),
            degree(Basis::Exact),
            degree(Basis::Floating),
            Claim::BasePoints.into(),
        ];
        let expected = [
            Claim::BasePoints.into(),
            degree(Basis::Floating),
            Claim::SignOfW.into(),
        ];
        assert_eq!(graded(given), expected);
    }

    /// The page of the certificate has a row for every claim, in their order, with its basis.
    #[test]
    fn the_page_names_every_claim_and_its_basis() {
        let page = include_str!("../../../docs/rational.md");
        let mut rest = page;
        for claim in Claim::ALL {
            let row = format!("\n| {claim} | {} |", claim.basis());
            let at = rest
                .find(&row)
                .unwrap_or_else(|| panic!("no row{row} in its place"));
            rest = &rest[at + 1..];
        }
        assert!(Claim::ALL.is_sorted());
    }
}
