//! The findings against claims: a proof, a check or the time came to an end.

use crate::claim::Claim;
use isoform_algebra::{ArrangementError, MapError};

/// A phase that was not done in the time there was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Phase {
    /// Finding the base points.
    #[error("base points")]
    BasePoints,
    /// Deciding which complex base points are blown up to real curves.
    #[error("seams of complex base points")]
    ComplexSeams,
    /// Factoring W.
    #[error("factors of the pole curve")]
    Pole,
    /// Counting parameters of a general point.
    #[error("the degree of the map")]
    MapDegree,
    /// Finding all curves over which the surface is singular.
    #[error("double, ramified and contracted curves")]
    SingularCurves,
    /// Finding the ramified and contracted curves, which need no implicit equation.
    #[error("contracted curves")]
    ContractedCurves,
    /// Finding the deck transformations of an improper map.
    #[error("deck transformations")]
    DeckTransformations,
    /// Finding the ends of double curves.
    #[error("pinch points")]
    PinchPoints,
    /// Tracing real points that only conjugate parameters reach.
    #[error("solitary curves")]
    SolitaryArcs,
    /// Finding the directions in which base points are opened.
    #[error("the seams of base points")]
    Tangents,
    /// Finding the partners on the double curve.
    #[error("the double curve")]
    Partners,
    /// Finding edges that fall together in space.
    #[error("edges that fall together")]
    Clashes,
}

impl Phase {
    /// The claim that is left open with it.
    pub fn claim(self) -> Claim {
        match self {
            Self::BasePoints => Claim::BasePoints,
            Self::ComplexSeams => Claim::ComplexSeams,
            Self::Pole => Claim::Pole,
            Self::MapDegree => Claim::MapDegree,
            Self::SingularCurves => Claim::DoubleCurves,
            Self::ContractedCurves => Claim::CriticalCurves,
            Self::DeckTransformations => Claim::DeckTransformations,
            Self::PinchPoints => Claim::PinchPoints,
            Self::SolitaryArcs => Claim::SolitaryArcs,
            Self::Tangents => Claim::Tangents,
            Self::Partners => Claim::Partners,
            Self::Clashes => Claim::Edges,
        }
    }
}

/// Why a base point is not opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unopened {
    /// Its seam lies in a face of the box: the surface does not cross that there.
    #[error("its seam lies in a face of the box")]
    SeamInFace,
    /// Two of its seams meet in a face of the box.
    #[error("two of its seams meet in a face of the box")]
    SeamsMeetInFace,
    /// Its seam is beyond what can be drawn.
    #[error("its seam has coefficients that no double is near to")]
    BeyondDoubles,
}

/// Vertices of which curve lack a partner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JoinedCurve {
    /// The double curve.
    #[error("double curve")]
    Double,
    /// The border of the fundamental domain of deck transformations.
    #[error("border of the fundamental domain")]
    FundamentalDomain,
}

/// Something that is not proved, or was seen not to hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Finding {
    /// The time was over.
    #[error("{0}: stopped")]
    Stopped(Phase),
    /// Complex seams are real, or may be, and no lines.
    #[error(
        "solitary curves: complex base points are blown up to a real curve, or may be, and such \
         curves are traced only where they are lines with rational coordinates"
    )]
    ComplexSeamUntraced,
    /// A complex seam that is real is the image of real parameters, too.
    #[error(
        "solitary curves: complex base points are blown up to a line that real parameters are \
         sent to, too; which part is solitary is not decided"
    )]
    ComplexSeamMet,
    /// The pole curve was not decomposed.
    #[error("the topology of the pole curve: {0}")]
    PoleTopology(ArrangementError),
    /// The parameters of a general point were not counted.
    #[error("the degree of the map: {0}")]
    DegreeUnknown(MapError),
    /// The degrees contradict the base points.
    #[error("the degree of the map: base points of multiplicity {counted} counted, {found} found")]
    DegreeRefuted {
        /// The multiplicity that the degrees leave for them.
        counted: usize,
        /// Their multiplicity.
        found: usize,
    },
    /// The base points that prove the degrees are unknown.
    #[error("the degree of the map: counted, not proven")]
    DegreeCounted,
    /// The degrees contradict the implicit equation.
    #[error("the degree of the map: counting and the implicit equation disagree")]
    DegreeContradicted,
    /// There is no implicit equation.
    #[error("self-intersections: the implicit equation: {0}")]
    NoEquation(MapError),
    /// The implicit equation was not looked for.
    #[error("self-intersections: the surface has degree {degree}, above the limit of {limit}")]
    DegreeAboveLimit {
        /// Of the surface.
        degree: usize,
        /// [`crate::Budget::implicit_degree`].
        limit: usize,
    },
    /// The implicit equation could not be looked for.
    #[error("self-intersections: the degree of the surface is unknown")]
    SurfaceDegreeUnknown,
    /// The double curve is known, but nothing could be cut along it in time.
    #[error("the parameters of the double curve: stopped; sheets that cross are not joined")]
    SheetsNotJoined,
    /// Without the double locus there is nothing to trace.
    #[error("solitary curves: the double locus is unknown")]
    DoubleLocusUnknown,
    /// A path to a section of a curve could not be followed to its end.
    #[error("solitary curves: points of a section were lost")]
    SectionLost,
    /// A solitary curve could not be followed.
    #[error(
        "a solitary curve was lost near ({:.4}, {:.4}, {:.4}) half-widths",
        at[0],
        at[1],
        at[2]
    )]
    SolitaryLost {
        /// Where, in half widths of the box.
        at: [f64; 3],
    },
    /// Arcs of the double curve that could not be followed, or made polylines of.
    #[error("the double curve could not be drawn at {0} places")]
    DoubleCurveNotDrawn(usize),
    /// A base point that is not opened.
    #[error("the base point ({} : {} : {}) is left open: {why}", point[0], point[1], point[2])]
    Unopened {
        /// (s : t : w).
        point: [f64; 3],
        /// Why.
        why: Unopened,
    },
    /// Base points are opened within the region only.
    #[error("a base point on a side of the domain is left open")]
    BasePointOnSide,
    /// All forms vanish in a point of the region that is none of the base points to rounding.
    #[error("a base point was not recognised and is left open")]
    BasePointUnrecognised,
    /// The arcs at a base point do not match its tangents.
    #[error("arcs and tangents in a base point do not agree")]
    TangentsDisagree,
    /// An arc at a base point has none of its tangents.
    #[error("an arc's tangent in a base point was not found")]
    TangentLost,
    /// No rectangle around a base point is small enough.
    #[error(
        "the surface next to base points is not near enough to it, or W may change its sign there"
    )]
    BasePointRough,
    /// The strips next to a base point have no vertices on its rectangle.
    #[error("triangles at base points are left out")]
    StripsLeftOut,
    /// The order of arcs is lost to rounding.
    #[error(
        "arcs of the region's boundary are closer together than rounding, or could not be drawn \
         to the end"
    )]
    ArcsNotDrawn,
    /// Parameters lead into the box, but there is not one triangle.
    #[error("nothing is drawn of the surface in the box")]
    NoTriangles,
    /// Edges of a curve along which sheets are joined have one sheet.
    #[error("{edges} edges of the {curve} have no partner that was found")]
    PartnersMissing {
        /// The number of these edges.
        edges: usize,
        /// The curve of these edges.
        curve: JoinedCurve,
    },
    /// Triangles that may have a pole.
    #[error("W is not proved to keep its sign on every triangle")]
    SignUnproved,
    /// Edges that are to be different have the same ends.
    #[error("edges fall together next to double or contracted curves")]
    EdgesClash,
    /// Triangles that were not refined to the end.
    #[error("the triangles are not everywhere as near to the surface as asked for")]
    TooCoarse,
    /// Vertices at which forms have no value.
    #[error("{0} vertices have no position; the triangles at them are left out")]
    NoPosition(usize),
    /// Vertices with one position.
    #[error("{0} pairs of vertices lie upon each other")]
    UponEachOther(usize),
    /// Vertices beyond the faces of the box.
    #[error("{0} vertices are outside of the box")]
    OutsideBox(usize),
    /// Triangles with corners on a line.
    #[error("{0} triangles have no area")]
    NoArea(usize),
    /// Edges of one triangle that are no border.
    #[error("the surface is open along {0} edges in the box")]
    OpenEdges(usize),
    /// Edges of too many triangles.
    #[error(
        "{0} edges have more than two triangles and are not of a double curve, or have an odd \
         number of them"
    )]
    CrowdedEdges(usize),
    /// Edges with neighbours that run the same way.
    #[error("neighbouring triangles run the same way along {0} edges")]
    Winding(usize),
    /// Edges with sheets that are not told apart.
    #[error("{0} edges have several sheets, and which triangles are neighbours is not decided")]
    NeighboursUnknown(usize),
    /// Vertices whose triangles are connected by that vertex only.
    #[error("{0} vertices may join sheets that are to stay apart")]
    PinchedVertices(usize),
    /// Several parameters have each point of the surface.
    #[error(
        "several parameters have the same image everywhere: sheets that lie upon each other are \
         not joined"
    )]
    SheetsUponEachOther,
    /// Pairs of triangles that cross.
    #[error("{0} pairs of triangles cross")]
    Crossings(usize),
    /// So many of them that not all were counted.
    #[error("more than {0} pairs of triangles cross")]
    CrossingsAbove(usize),
    /// No time was left to look for them.
    #[error("whether triangles cross was not looked for")]
    CrossingsUnknown,
    /// Sides with the same control points have other vertices.
    #[error("patches do not fit along {0} edges of sides that they have in common")]
    SidesApart(usize),
    /// Edges on sides of patches with too many triangles.
    #[error("{0} edges have more triangles than there are patches at a side")]
    SidesCrowded(usize),
    /// The implicit equations of patches are not compared.
    #[error("different patches are not cut where they cross")]
    PatchesNotCut,
    /// Something about one of several patches.
    #[error("{patch}: {finding}")]
    OfPatch {
        /// Its name.
        patch: String,
        /// What.
        finding: Box<Self>,
    },
}

impl Finding {
    /// The claim that it stands against.
    pub fn claim(&self) -> Claim {
        match self {
            Self::Stopped(phase) => phase.claim(),
            Self::ComplexSeamUntraced | Self::ComplexSeamMet => Claim::ComplexSeams,
            Self::PoleTopology(_) => Claim::Pole,
            Self::DegreeUnknown(_)
            | Self::DegreeRefuted { .. }
            | Self::DegreeCounted
            | Self::DegreeContradicted => Claim::MapDegree,
            Self::NoEquation(_) | Self::DegreeAboveLimit { .. } | Self::SurfaceDegreeUnknown => {
                Claim::DoubleCurves
            }
            Self::DoubleLocusUnknown | Self::SectionLost | Self::SolitaryLost { .. } => {
                Claim::SolitaryArcs
            }
            Self::Unopened { .. }
            | Self::BasePointOnSide
            | Self::BasePointUnrecognised
            | Self::TangentsDisagree
            | Self::TangentLost
            | Self::StripsLeftOut => Claim::Tangents,
            Self::BasePointRough => Claim::SignAtBasePoints,
            Self::ArcsNotDrawn | Self::NoTriangles => Claim::Drawing,
            Self::SheetsNotJoined | Self::DoubleCurveNotDrawn(_) | Self::PartnersMissing { .. } => {
                Claim::Partners
            }
            Self::SignUnproved => Claim::SignOfW,
            Self::TooCoarse => Claim::Distances,
            Self::NoPosition(_)
            | Self::UponEachOther(_)
            | Self::OutsideBox(_)
            | Self::NoArea(_) => Claim::Shapes,
            Self::Winding(_) | Self::NeighboursUnknown(_) => Claim::Winding,
            Self::EdgesClash | Self::OpenEdges(_) | Self::CrowdedEdges(_) => Claim::Edges,
            Self::SidesApart(_) | Self::SidesCrowded(_) => Claim::Sides,
            Self::Crossings(_)
            | Self::CrossingsAbove(_)
            | Self::CrossingsUnknown
            | Self::PatchesNotCut => Claim::Crossings,
            Self::PinchedVertices(_) | Self::SheetsUponEachOther => Claim::Sheets,
            Self::OfPatch { finding, .. } => finding.claim(),
        }
    }
    /// It, said of one of several patches.
    pub(crate) fn of_patch(self, patch: &str) -> Self {
        Self::OfPatch {
            patch: patch.to_owned(),
            finding: Box::new(self),
        }
    }
    /// Without the patch that it is about.
    pub fn kind(&self) -> &Self {
        match self {
            Self::OfPatch { finding, .. } => finding.kind(),
            other => other,
        }
    }
}
