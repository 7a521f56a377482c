//! The claims of a certificate about a surface, and the basis of each.
//!
//! A certificate is as strong as its weakest step. Each claim therefore says how it was decided, so
//! that a reader who needs a proof knows which claims to verify by other means.

use std::fmt;

/// Basis on which a claim is decided, from the strongest to the weakest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Basis {
    /// Proof by exact arithmetic, or by counting and comparing given doubles.
    Exact,
    /// Proof in floating point with bounds on all errors, valid if these bounds are right.
    Bounded,
    /// Check without proof: in floating point up to a tolerance, or at samples.
    Floating,
}

impl Basis {
    /// All bases, from the strongest to the weakest.
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

/// A claim about a surface; the variants are in the order in which claims are decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Claim {
    /// Real base points with their trees of infinitely near ones.
    BasePoints,
    /// Complex base points are blown up to no real curves but those that are drawn.
    ComplexSeams,
    /// Factors and topology of W = 0.
    Pole,
    /// Number of parameters that reach a general point.
    MapDegree,
    /// Cuspidal and contracted curves of the parameters.
    CriticalCurves,
    /// Double curves of the parameters.
    DoubleCurves,
    /// Deck transformations of an improper map, and their folds.
    DeckTransformations,
    /// No base point is blown up to a part of the border of the fundamental domain.
    FundamentalDomain,
    /// Pinch points, at which double curves end and sheets fold.
    PinchPoints,
    /// Real points reached by conjugate parameters only.
    SolitaryArcs,
    /// W has no zero over the region of the parameters, whose image lies in the open box.
    Weights,
    /// Cells of the parameters whose image lies in the box.
    Region,
    /// Contracted curves with a common image, and the curves that pass through it.
    Images,
    /// Directions in which base points are opened, and the contents of the rectangles around them.
    Tangents,
    /// Order of rays and arcs around base points with others infinitely near to them.
    Trees,
    /// W keeps its sign between base points and the rectangles around them.
    SignAtBasePoints,
    /// Seams of base points in which the surface of an improper map ends.
    Folds,
    /// The drawing in the parameters is isotopic to the region.
    Drawing,
    /// Parameters that share an image on a double curve, or on a border that is joined.
    Partners,
    /// W keeps its sign on the triangles of the parameters.
    SignOfW,
    /// Distances of the triangles from the surface.
    Distances,
    /// Triangles have positive area; vertices are distinct and in the box.
    Shapes,
    /// Location of the boundary of the mesh, and the number of triangles at each of its edges.
    Edges,
    /// Adjacent triangles traverse their common edge in opposite directions.
    Winding,
    /// Sides shared by patches are joined.
    Sides,
    /// No triangles cross.
    Crossings,
    /// No sheets overlap, and none are joined that have to stay separate.
    Sheets,
}

/// Texts and usual verdict of a claim.
struct Row {
    claim: Claim,
    /// Usual verdict: the basis of the weakest step that decides it, or the reason why it is
    /// assumed.
    verdict: Verdict,
    name: &'static str,
    /// Statement that holds if nothing is found against the claim.
    statement: &'static str,
}

/// All claims, in the order of [`Claim`].
///
/// - *Exact*: number fields, exact division, factors and resultants over Q, signs of rational
///   numbers; counting of triangles; exact predicates on the vertices.
/// - *Bounded*: the region. Which curves meet over a wall is decided exactly; otherwise their roots
///   are isolated in floating point with error bounds, if that decides. The sign of W is bounded,
///   too: Bernstein coefficients in doubles, with a bound on their rounding.
/// - *Floating*: sections and paths in doubles; Newton's method to a tolerance; samples; base
///   points rounded to doubles, with thresholds for zero; and the rule, true only as a rule, that
///   overlapping sheets have triangles that cross.
const ROWS: [Row; Claim::COUNT] = [
    Row {
        claim: Claim::BasePoints,
        verdict: Verdict::Holds(Basis::Exact),
        name: "base points",
        statement: "the real base points, their multiplicities and the points infinitely near to \
                    them are all known",
    },
    Row {
        claim: Claim::ComplexSeams,
        verdict: Verdict::Holds(Basis::Exact),
        name: "seams of complex base points",
        statement: "complex base points are blown up to no real curve but the lines that are \
                    drawn",
    },
    Row {
        claim: Claim::Pole,
        verdict: Verdict::Holds(Basis::Bounded),
        name: "pole",
        statement: "the factors of W and the topology of its real zeros are known",
    },
    Row {
        claim: Claim::MapDegree,
        verdict: Verdict::Holds(Basis::Exact),
        name: "degree of the map",
        statement: "so many parameters reach a general point of the surface",
    },
    Row {
        claim: Claim::CriticalCurves,
        verdict: Verdict::Holds(Basis::Exact),
        name: "cuspidal and contracted curves",
        statement: "the curves of the parameters with cuspidal edges or points as images are all \
                    known",
    },
    Row {
        claim: Claim::DoubleCurves,
        verdict: Verdict::Holds(Basis::Exact),
        name: "double curves",
        statement: "the curves of the parameters along which sheets meet are all known",
    },
    Row {
        claim: Claim::DeckTransformations,
        verdict: Verdict::Holds(Basis::Exact),
        name: "deck transformations",
        statement: "the transformations that exchange parameters of a point, and their folds, are \
                    those of the map",
    },
    Row {
        claim: Claim::FundamentalDomain,
        verdict: Verdict::Assumed(
            "signs in 12 directions at each base point show none, and nothing checks what is between",
        ),
        name: "fundamental domain",
        statement: "no base point is blown up to a part of the fundamental domain's border, as 12 \
                    directions at each of them show",
    },
    Row {
        claim: Claim::PinchPoints,
        verdict: Verdict::Holds(Basis::Exact),
        name: "pinch points",
        statement: "the pinch points are all known",
    },
    Row {
        claim: Claim::SolitaryArcs,
        verdict: Verdict::Holds(Basis::Floating),
        name: "solitary arcs",
        statement: "the points that only conjugate parameters reach are on the solitary arcs; \
                    arcs that no section of the box meets may be missed",
    },
    Row {
        claim: Claim::Weights,
        verdict: Verdict::Holds(Basis::Exact),
        name: "weights",
        statement: "W has no zero over the region, which is sent into the open box",
    },
    Row {
        claim: Claim::Region,
        verdict: Verdict::Holds(Basis::Bounded),
        name: "region",
        statement: "the cells of the parameters that are sent into the box are known",
    },
    Row {
        claim: Claim::Images,
        verdict: Verdict::Assumed(
            "points that agree to rounding are taken for one, and nothing shows that they are",
        ),
        name: "images of contracted curves",
        statement: "images of contracted curves are one vertex where they are one point to \
                    rounding",
    },
    Row {
        claim: Claim::Tangents,
        verdict: Verdict::Holds(Basis::Floating),
        name: "tangents at base points",
        statement: "base points are opened in the directions of all curves that are drawn there",
    },
    Row {
        claim: Claim::Trees,
        verdict: Verdict::Assumed(
            "the order on the rectangle is compared in doubles, and nothing checks what is left of it",
        ),
        name: "trees of infinitely near base points",
        statement: "rays and arcs at infinitely near base points leave the rectangle around them \
                    in the order in which they begin",
    },
    Row {
        claim: Claim::SignAtBasePoints,
        verdict: Verdict::Holds(Basis::Floating),
        name: "sign of W at base points",
        statement: "W keeps its sign between base points and the rectangles around them",
    },
    Row {
        claim: Claim::Folds,
        verdict: Verdict::Assumed(
            "seams without another seam nearby are taken for folds, and nothing shows that they are",
        ),
        name: "folds at base points",
        statement: "the surface ends in those seams of base points along which it is folded",
    },
    Row {
        claim: Claim::Drawing,
        verdict: Verdict::Holds(Basis::Exact),
        name: "drawing",
        statement: "the polylines in the parameters lie in the order of the arcs that they stand \
                    for, and do not cross",
    },
    Row {
        claim: Claim::Partners,
        verdict: Verdict::Holds(Basis::Floating),
        name: "partners",
        statement: "edges of double curves, and of borders that are joined, have all sheets that \
                    meet there",
    },
    Row {
        claim: Claim::SignOfW,
        verdict: Verdict::Holds(Basis::Bounded),
        name: "sign of W",
        statement: "W keeps its sign on every triangle of the parameters",
    },
    Row {
        claim: Claim::Distances,
        verdict: Verdict::Holds(Basis::Floating),
        name: "distances",
        statement: "the middles of triangles and edges are as near to the surface as asked for",
    },
    Row {
        claim: Claim::Shapes,
        verdict: Verdict::Holds(Basis::Floating),
        name: "shapes",
        statement: "triangles have areas; vertices are apart, and in the box",
    },
    Row {
        claim: Claim::Edges,
        verdict: Verdict::Holds(Basis::Exact),
        name: "edges",
        statement: "the mesh ends on the box and on sides of the region only; only edges of \
                    double curves have more than two triangles",
    },
    Row {
        claim: Claim::Winding,
        verdict: Verdict::Holds(Basis::Exact),
        name: "winding",
        statement: "neighbouring triangles run opposite ways along their common edge, but for a \
                    cut through surfaces that are not orientable",
    },
    Row {
        claim: Claim::Sides,
        verdict: Verdict::Holds(Basis::Exact),
        name: "sides of patches",
        statement: "sides that patches have in common are joined",
    },
    Row {
        claim: Claim::Crossings,
        verdict: Verdict::Holds(Basis::Exact),
        name: "crossings",
        statement: "no triangles cross",
    },
    Row {
        claim: Claim::Sheets,
        verdict: Verdict::Holds(Basis::Floating),
        name: "sheets",
        statement: "no sheets lie upon each other, and none are joined that are to stay apart",
    },
];

impl Claim {
    /// Number of claims.
    pub const COUNT: usize = 27;
    /// All claims, in order.
    pub const ALL: [Self; Self::COUNT] = {
        let mut all = [Self::BasePoints; Self::COUNT];
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
    /// Returns the verdict of a claim that has to be decided and that nothing contradicts; for some
    /// surfaces other steps decide it.
    ///
    /// ```
    /// use isoform_tess::{Basis, Claim, Verdict};
    ///
    /// // A search for triangles that cross is a proof; a look at the middles of edges is none.
    /// assert_eq!(Claim::Crossings.usual(), Verdict::Holds(Basis::Exact));
    /// assert_eq!(Claim::Distances.usual(), Verdict::Holds(Basis::Floating));
    /// assert!(matches!(Claim::Folds.usual(), Verdict::Assumed(_)));
    /// assert_eq!(Claim::Crossings.to_string(), "crossings");
    /// assert_eq!(Claim::Crossings.statement(), "no triangles cross");
    /// ```
    pub fn usual(self) -> Verdict {
        self.row().verdict
    }
    /// Returns the statement that holds if nothing is found against the claim.
    pub fn statement(self) -> &'static str {
        self.row().statement
    }
}

impl fmt::Display for Claim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.row().name)
    }
}

/// Verdict on a claim, from the best to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The claim does not apply, for this reason.
    NotApplicable(&'static str),
    /// Nothing was found against it, on this basis.
    Holds(Basis),
    /// Nothing could be found against it, as no step checks it, for this reason.
    Assumed(&'static str),
    /// A finding contradicts it, or it was not decided.
    Open,
}

impl Verdict {
    /// Returns the verdict if the claim has to be decided, else [`Verdict::NotApplicable`].
    pub(crate) fn or_not(self, is_asked: bool, why_not: &'static str) -> Self {
        match is_asked {
            true => self,
            false => Self::NotApplicable(why_not),
        }
    }
    /// Returns the verdict if its premises are known, else [`Verdict::Open`].
    pub(crate) fn or_open(self, is_known: bool) -> Self {
        match is_known {
            true => self,
            false => Self::Open,
        }
    }
}

/// Claims decided by the analysis of a map.
pub(crate) const OF_ANALYSIS: [Claim; 5] = [
    Claim::BasePoints,
    Claim::ComplexSeams,
    Claim::Pole,
    Claim::MapDegree,
    Claim::CriticalCurves,
];
/// Claims decided by the search for double curves.
pub(crate) const OF_DOUBLE_CURVE: [Claim; 3] =
    [Claim::DoubleCurves, Claim::PinchPoints, Claim::SolitaryArcs];
/// Claims decided by the deck transformations.
pub(crate) const OF_DECK: [Claim; 2] = [Claim::DeckTransformations, Claim::FundamentalDomain];
/// Claims decided by the decomposition of the parameters.
pub(crate) const OF_REGION: [Claim; 2] = [Claim::Weights, Claim::Region];
/// Claims decided by the mesh.
pub(crate) const OF_MESH: [Claim; 12] = [
    Claim::Images,
    Claim::Tangents,
    Claim::Trees,
    Claim::SignAtBasePoints,
    Claim::Folds,
    Claim::Drawing,
    Claim::Partners,
    Claim::SignOfW,
    Claim::Distances,
    Claim::Shapes,
    Claim::Edges,
    Claim::Winding,
];
/// Claims decided by the finished surface.
pub(crate) const OF_SURFACE: [Claim; 3] = [Claim::Sides, Claim::Crossings, Claim::Sheets];

/// Compile-time check that exactly one stage decides each claim.
const _: () = {
    const fn count<const N: usize>(claims: &[Claim; N], seen: &mut [bool; Claim::COUNT]) {
        let mut k = 0;
        while k < N {
            assert!(!seen[claims[k] as usize], "two stages decide a claim");
            seen[claims[k] as usize] = true;
            k += 1;
        }
    }
    let mut seen = [false; Claim::COUNT];
    count(&OF_ANALYSIS, &mut seen);
    count(&OF_DOUBLE_CURVE, &mut seen);
    count(&OF_DECK, &mut seen);
    count(&OF_REGION, &mut seen);
    count(&OF_MESH, &mut seen);
    count(&OF_SURFACE, &mut seen);
    let mut k = 0;
    while k < Claim::COUNT {
        assert!(seen[k], "no stage decides a claim");
        k += 1;
    }
};

/// Verdicts of the stages so far; a claim that no stage has decided is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Decisions([Option<Verdict>; Claim::COUNT]);

impl Decisions {
    /// Records the verdicts of a stage on its claims, replacing earlier ones.
    pub(crate) fn decide<const N: usize>(&mut self, claims: [Claim; N], verdicts: [Verdict; N]) {
        for (claim, verdict) in claims.into_iter().zip(verdicts) {
            self.0[claim as usize] = Some(verdict);
        }
    }
    /// Records the verdicts of other stages, replacing earlier ones.
    pub(crate) fn decide_all(&mut self, others: &Self) {
        for (mine, other) in self.0.iter_mut().zip(others.0) {
            *mine = other.or(*mine);
        }
    }
    /// Joins the verdicts on another part of the surface: the worse verdict counts.
    pub(crate) fn join(&mut self, other: &Self) {
        for (mine, other) in self.0.iter_mut().zip(other.0) {
            *mine = match (*mine, other) {
                (Some(a), Some(b)) => Some(a.max(b)),
                _ => None,
            };
        }
    }
    pub(crate) fn verdict(&self, claim: Claim) -> Verdict {
        self.0[claim as usize].unwrap_or(Verdict::Open)
    }
}

/// Verdicts on all claims about a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Certificate([Verdict; Claim::COUNT]);

impl Certificate {
    pub(crate) fn new(of: impl Fn(Claim) -> Verdict) -> Self {
        Self(Claim::ALL.map(of))
    }
    /// Returns the verdict on a claim.
    pub fn verdict(&self, claim: Claim) -> Verdict {
        self.0[claim as usize]
    }
    /// Iterates over the claims that had to be decided, with their verdicts.
    pub fn decided(&self) -> impl Iterator<Item = (Claim, Verdict)> + '_ {
        let all = Claim::ALL.into_iter().zip(self.0);
        all.filter(|(_, verdict)| !matches!(verdict, Verdict::NotApplicable(_)))
    }
    /// Returns true if no claim is open.
    pub fn is_closed(&self) -> bool {
        !self.0.contains(&Verdict::Open)
    }
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
    fn the_worst_verdict_of_a_claim_counts() {
        let degree = [Claim::MapDegree, Claim::SignOfW];
        let of = |verdicts| {
            let mut all = Decisions::default();
            all.decide(degree, verdicts);
            all
        };
        let none = Verdict::NotApplicable("a reason");
        let mut all = of([Verdict::Holds(Basis::Exact), none]);
        all.join(&of([
            Verdict::Holds(Basis::Floating),
            Verdict::Assumed("a reason"),
        ]));
        assert_eq!(all.verdict(degree[0]), Verdict::Holds(Basis::Floating));
        assert_eq!(all.verdict(degree[1]), Verdict::Assumed("a reason"));
        // A claim decided for one part only is open for the whole.
        all.join(&Decisions::default());
        assert_eq!(all.verdict(degree[0]), Verdict::Open);
        assert!(!Certificate::new(|claim| all.verdict(claim)).is_closed());
    }

    /// The page of the certificate has a row for every claim, in order, with its basis.
    #[test]
    fn the_page_names_every_claim_and_its_basis() {
        let page = include_str!("../../../docs/rational-certificate.md");
        let mut rest = page;
        for claim in Claim::ALL {
            let basis = match claim.usual() {
                Verdict::Holds(basis) => basis.to_string(),
                _ => "assumed".to_owned(),
            };
            let row = format!("\n| {claim} | {basis} |");
            let at = rest
                .find(&row)
                .unwrap_or_else(|| panic!("no row{row} in its place"));
            rest = &rest[at + 1..];
        }
        assert!(Claim::ALL.is_sorted());
    }
}
