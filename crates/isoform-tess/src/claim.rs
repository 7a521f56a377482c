//! The claims of a certificate about a surface, and their basis.
//!
//! A certificate is as good as its weakest step, so each claim says how it was decided: a reader
//! who needs a proof knows which of them to check by other means.

use std::fmt;

/// The basis on which a claim is decided, the strongest first.
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

/// A claim about a surface, in the order in which they are decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Claim {
    /// The real base points with their trees of infinitely near ones.
    BasePoints,
    /// Complex base points are blown up to no real curves but those that are drawn.
    ComplexSeams,
    /// The factors and the topology of W = 0.
    Pole,
    /// The number of parameters that reach a general point.
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
    /// The contracted curves with one image, and the curves that pass through it.
    Images,
    /// The directions in which base points are opened, and what lies in the rectangles around them.
    Tangents,
    /// The order of rays and arcs around base points with others infinitely near to them.
    Trees,
    /// W keeps its sign between base points and the rectangles around them.
    SignAtBasePoints,
    /// The seams of base points that the surface of an improper map ends in.
    Folds,
    /// The drawing in the parameters is the region up to isotopy.
    Drawing,
    /// The parameters that are sent to one point of a double curve, or of a border that is joined.
    Partners,
    /// W keeps its sign on the triangles of the parameters.
    SignOfW,
    /// The distances of the triangles from the surface.
    Distances,
    /// Triangles have areas, vertices are apart and in the box.
    Shapes,
    /// Where the mesh ends, and how many triangles its edges have.
    Edges,
    /// Neighbouring triangles run opposite ways along their common edge.
    Winding,
    /// Sides that patches have in common are joined.
    Sides,
    /// No triangles cross.
    Crossings,
    /// No sheets lie upon each other, and none are joined that are to stay apart.
    Sheets,
}

/// The texts about a claim.
struct Row {
    claim: Claim,
    /// The weakest step by which it is decided.
    basis: Basis,
    name: &'static str,
    /// What holds where nothing is found against it.
    statement: &'static str,
}

/// All claims, in their order.
///
/// - *Exact* are number fields, exact division, factors and resultants over Q, signs of rational
///   numbers; counting of triangles; exact predicates on the vertices.
/// - *Bounded* is the region: which curves meet over a wall is exact, but where they do not, their
///   roots are isolated in floating point with bounds on its errors, if that decides. So is the
///   sign of W: by Bernstein coefficients in doubles, with a bound on their rounding.
/// - *Floating* are sections and paths in doubles; Newton's method to a tolerance; samples; base
///   points rounded to doubles, with thresholds for what is zero; and that sheets upon each other
///   have triangles that cross, which is so as a rule only.
const ROWS: [Row; 27] = [
    Row {
        claim: Claim::BasePoints,
        basis: Basis::Exact,
        name: "base points",
        statement: "the real base points, their multiplicities and the points infinitely near to \
                    them are all known",
    },
    Row {
        claim: Claim::ComplexSeams,
        basis: Basis::Exact,
        name: "seams of complex base points",
        statement: "complex base points are blown up to no real curve but the lines that are \
                    drawn",
    },
    Row {
        claim: Claim::Pole,
        basis: Basis::Bounded,
        name: "pole",
        statement: "the factors of W and the topology of its real zeros are known",
    },
    Row {
        claim: Claim::MapDegree,
        basis: Basis::Exact,
        name: "degree of the map",
        statement: "so many parameters reach a general point of the surface",
    },
    Row {
        claim: Claim::CriticalCurves,
        basis: Basis::Exact,
        name: "cuspidal and contracted curves",
        statement: "the curves of the parameters with cuspidal edges or points as images are all \
                    known",
    },
    Row {
        claim: Claim::DoubleCurves,
        basis: Basis::Exact,
        name: "double curves",
        statement: "the curves of the parameters along which sheets meet are all known",
    },
    Row {
        claim: Claim::DeckTransformations,
        basis: Basis::Exact,
        name: "deck transformations",
        statement: "the transformations that exchange parameters of a point, and their folds, are \
                    those of the map",
    },
    Row {
        claim: Claim::FundamentalDomain,
        basis: Basis::Floating,
        name: "fundamental domain",
        statement: "no base point is blown up to a part of the fundamental domain's border, as 12 \
                    directions at each of them show",
    },
    Row {
        claim: Claim::PinchPoints,
        basis: Basis::Exact,
        name: "pinch points",
        statement: "the pinch points are all known",
    },
    Row {
        claim: Claim::SolitaryArcs,
        basis: Basis::Floating,
        name: "solitary arcs",
        statement: "the points that only conjugate parameters reach are on the solitary arcs; \
                    arcs that no section of the box meets may be missed",
    },
    Row {
        claim: Claim::Weights,
        basis: Basis::Exact,
        name: "weights",
        statement: "W has no zero over the region, which is sent into the open box",
    },
    Row {
        claim: Claim::Region,
        basis: Basis::Bounded,
        name: "region",
        statement: "the cells of the parameters that are sent into the box are known",
    },
    Row {
        claim: Claim::Images,
        basis: Basis::Floating,
        name: "images of contracted curves",
        statement: "images of contracted curves are one vertex where they are one point to \
                    rounding",
    },
    Row {
        claim: Claim::Tangents,
        basis: Basis::Floating,
        name: "tangents at base points",
        statement: "base points are opened in the directions of all curves that are drawn there",
    },
    Row {
        claim: Claim::Trees,
        basis: Basis::Floating,
        name: "trees of infinitely near base points",
        statement: "rays and arcs at infinitely near base points leave the rectangle around them \
                    in the order in which they begin",
    },
    Row {
        claim: Claim::SignAtBasePoints,
        basis: Basis::Floating,
        name: "sign of W at base points",
        statement: "W keeps its sign between base points and the rectangles around them",
    },
    Row {
        claim: Claim::Folds,
        basis: Basis::Floating,
        name: "folds at base points",
        statement: "the surface ends in those seams of base points along which it is folded",
    },
    Row {
        claim: Claim::Drawing,
        basis: Basis::Exact,
        name: "drawing",
        statement: "the polylines in the parameters lie in the order of the arcs that they stand \
                    for, and do not cross",
    },
    Row {
        claim: Claim::Partners,
        basis: Basis::Floating,
        name: "partners",
        statement: "edges of double curves, and of borders that are joined, have all sheets that \
                    meet there",
    },
    Row {
        claim: Claim::SignOfW,
        basis: Basis::Bounded,
        name: "sign of W",
        statement: "W keeps its sign on every triangle of the parameters",
    },
    Row {
        claim: Claim::Distances,
        basis: Basis::Floating,
        name: "distances",
        statement: "the middles of triangles and edges are as near to the surface as asked for",
    },
    Row {
        claim: Claim::Shapes,
        basis: Basis::Floating,
        name: "shapes",
        statement: "triangles have areas; vertices are apart, and in the box",
    },
    Row {
        claim: Claim::Edges,
        basis: Basis::Exact,
        name: "edges",
        statement: "the mesh ends on the box and on sides of the region only; only edges of \
                    double curves have more than two triangles",
    },
    Row {
        claim: Claim::Winding,
        basis: Basis::Exact,
        name: "winding",
        statement: "neighbouring triangles run opposite ways along their common edge, but for a \
                    cut through surfaces that are not orientable",
    },
    Row {
        claim: Claim::Sides,
        basis: Basis::Exact,
        name: "sides of patches",
        statement: "sides that patches have in common are joined",
    },
    Row {
        claim: Claim::Crossings,
        basis: Basis::Exact,
        name: "crossings",
        statement: "no triangles cross",
    },
    Row {
        claim: Claim::Sheets,
        basis: Basis::Floating,
        name: "sheets",
        statement: "no sheets lie upon each other, and none are joined that are to stay apart",
    },
];

impl Claim {
    /// All of them, in their order.
    pub const ALL: [Self; 27] = {
        let mut all = [Self::BasePoints; 27];
        let mut k = 0;
        while k < all.len() {
            all[k] = ROWS[k].claim;
            k += 1;
        }
        all
    };
    fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }
    /// The weakest step by which it is decided, where nothing else is said: see [`Grade`].
    ///
    /// ```
    /// use isoform_tess::{Basis, Claim};
    ///
    /// // A search for triangles that cross is a proof; a look at the middles of edges is none.
    /// assert_eq!(Claim::Crossings.basis(), Basis::Exact);
    /// assert_eq!(Claim::Distances.basis(), Basis::Floating);
    /// assert_eq!(Claim::Crossings.to_string(), "crossings");
    /// assert_eq!(Claim::Crossings.statement(), "no triangles cross");
    /// ```
    pub fn basis(self) -> Basis {
        self.row().basis
    }
    /// What holds where nothing is found against it.
    pub fn statement(self) -> &'static str {
        self.row().statement
    }
}

impl fmt::Display for Claim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.row().name)
    }
}

/// A claim, and how it was decided of this surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Grade {
    /// The claim.
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
    fn rows_are_in_the_order_of_claims() {
        for (k, claim) in Claim::ALL.into_iter().enumerate() {
            assert_eq!(claim as usize, k, "{claim}");
        }
    }

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
