//! Findings against claims: facts that could not be proved, failed checks, and missing time.

use crate::claim::Claim;
use isoform_algebra::{ArrangementError, MapError};

/// A phase that was not finished within the time limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Phase {
    /// Search for the base points.
    #[error("base points")]
    BasePoints,
    /// Decision which complex base points are blown up to real curves.
    #[error("seams of complex base points")]
    ComplexSeams,
    /// Factorization of W.
    #[error("factors of the pole curve")]
    Pole,
    /// Counting of the parameters of a general point.
    #[error("the degree of the map")]
    MapDegree,
    /// Search for all curves over which the surface is singular.
    #[error("double, ramified and contracted curves")]
    SingularCurves,
    /// Search for the ramified and contracted curves, which need no implicit equation.
    #[error("contracted curves")]
    ContractedCurves,
    /// Search for the deck transformations of an improper map.
    #[error("deck transformations")]
    DeckTransformations,
    /// Search for the ends of double curves.
    #[error("pinch points")]
    PinchPoints,
    /// Tracing of real points reached by conjugate parameters only.
    #[error("solitary curves")]
    SolitaryArcs,
    /// Computation of the directions in which base points are opened.
    #[error("the seams of base points")]
    Tangents,
    /// Search for the partners on the double curve.
    #[error("the double curve")]
    Partners,
    /// Search for edges that coincide in space.
    #[error("edges that fall together")]
    Clashes,
}

impl Phase {
    /// Returns the claim that an unfinished phase leaves open.
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

/// Reason why a base point is not opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unopened {
    /// The seam lies in a face of the box, so the surface does not cross the face there.
    #[error("its seam lies in a face of the box")]
    SeamInFace,
    /// Two of the seams meet in a face of the box.
    #[error("two of its seams meet in a face of the box")]
    SeamsMeetInFace,
    /// The seam has coefficients beyond the range of doubles.
    #[error("its seam has coefficients that no double is near to")]
    BeyondDoubles,
}

/// Curve whose vertices lack a partner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JoinedCurve {
    /// The double curve.
    #[error("double curve")]
    Double,
    /// The border of the fundamental domain of deck transformations.
    #[error("border of the fundamental domain")]
    FundamentalDomain,
}

/// A claim that is not proved, or that was found to fail.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Finding {
    /// The time was over.
    #[error("{0}: stopped")]
    Stopped(Phase),
    /// Complex seams are real, or may be, and are not lines.
    #[error(
        "solitary curves: complex base points are blown up to a real curve, or may be, and such \
         curves are traced only where they are lines with rational coordinates"
    )]
    ComplexSeamUntraced,
    /// A complex seam that is real is also the image of real parameters.
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
        /// Multiplicity of the base points according to the counted degrees.
        counted: usize,
        /// Multiplicity of the base points found.
        found: usize,
    },
    /// The degrees are counted modulo primes; the base points that would prove them are unknown.
    #[error("the degree of the map: counted, not proven")]
    DegreeCounted,
    /// The degrees contradict the implicit equation.
    #[error("the degree of the map: counting and the implicit equation disagree")]
    DegreeContradicted,
    /// The implicit equation could not be computed.
    #[error("self-intersections: the implicit equation: {0}")]
    NoEquation(MapError),
    /// The degree of the implicit equation is above the limit.
    #[error("self-intersections: the surface has degree {degree}, above the limit of {limit}")]
    DegreeAboveLimit {
        /// Degree of the surface.
        degree: usize,
        /// [`crate::Budget::implicit_degree`].
        limit: usize,
    },
    /// The implicit equation could not be computed, as its degree is unknown.
    #[error("self-intersections: the degree of the surface is unknown")]
    SurfaceDegreeUnknown,
    /// The double curve is known, but there was no time to cut sheets along it.
    #[error("the parameters of the double curve: stopped; sheets that cross are not joined")]
    SheetsNotJoined,
    /// Solitary curves cannot be traced, as the double locus is unknown.
    #[error("solitary curves: the double locus is unknown")]
    DoubleLocusUnknown,
    /// A path to a section of a curve could not be tracked to its end.
    #[error("solitary curves: points of a section were lost")]
    SectionLost,
    /// A solitary curve could not be traced.
    #[error(
        "a solitary curve was lost near ({:.4}, {:.4}, {:.4}) half-widths",
        at[0],
        at[1],
        at[2]
    )]
    SolitaryLost {
        /// Position, in half widths of the box.
        at: [f64; 3],
    },
    /// Arcs of the double curve could not be traced, or not be approximated by polylines.
    #[error("the double curve could not be drawn at {0} places")]
    DoubleCurveNotDrawn(usize),
    /// A base point is not opened.
    #[error("the base point ({} : {} : {}) is left open: {why}", point[0], point[1], point[2])]
    Unopened {
        /// Homogeneous coordinates (s : t : w).
        point: [f64; 3],
        /// Reason.
        why: Unopened,
    },
    /// A base point lies on a side of the domain; base points are opened in the interior only.
    #[error("a base point on a side of the domain is left open")]
    BasePointOnSide,
    /// All forms vanish at a point of the region that does not match any base point up to rounding.
    #[error("a base point was not recognised and is left open")]
    BasePointUnrecognised,
    /// The arcs at a base point do not match its tangents.
    #[error("arcs and tangents in a base point do not agree")]
    TangentsDisagree,
    /// The tangent of an arc at a base point was not found.
    #[error("an arc's tangent in a base point was not found")]
    TangentLost,
    /// No rectangle around a base point was small enough.
    #[error(
        "the surface next to base points is not near enough to it, or W may change its sign there"
    )]
    BasePointRough,
    /// Strips next to a base point lack vertices on its rectangle.
    #[error("triangles at base points are left out")]
    StripsLeftOut,
    /// The order of arcs is lost to rounding.
    #[error(
        "arcs of the region's boundary are closer together than rounding, or could not be drawn \
         to the end"
    )]
    ArcsNotDrawn,
    /// Parameters lead into the box, but there is not a single triangle.
    #[error("nothing is drawn of the surface in the box")]
    NoTriangles,
    /// Edges of a curve along which sheets are joined have only one sheet.
    #[error("{edges} edges of the {curve} have no partner that was found")]
    PartnersMissing {
        /// Number of these edges.
        edges: usize,
        /// Curve to which the edges belong.
        curve: JoinedCurve,
    },
    /// Triangles may contain a pole.
    #[error("W is not proved to keep its sign on every triangle")]
    SignUnproved,
    /// Edges that should be distinct have common ends.
    #[error("edges fall together next to double or contracted curves")]
    EdgesClash,
    /// Triangles could not be refined to the tolerance.
    #[error("the triangles are not everywhere as near to the surface as asked for")]
    TooCoarse,
    /// All forms vanish at vertices.
    #[error("{0} vertices have no position; the triangles at them are left out")]
    NoPosition(usize),
    /// Several vertices have one position.
    #[error("{0} pairs of vertices lie upon each other")]
    CoincidentVertices(usize),
    /// Vertices are beyond the faces of the box.
    #[error("{0} vertices are outside of the box")]
    OutsideBox(usize),
    /// Triangles have collinear corners.
    #[error("{0} triangles have no area")]
    NoArea(usize),
    /// Edges inside the surface have only one triangle.
    #[error("the surface is open along {0} edges in the box")]
    OpenEdges(usize),
    /// Edges have too many triangles.
    #[error(
        "{0} edges have more than two triangles and are not of a double curve, or have an odd \
         number of them"
    )]
    CrowdedEdges(usize),
    /// Edges have neighbours of opposite orientation.
    #[error("neighbouring triangles run the same way along {0} edges")]
    Winding(usize),
    /// Edges have several sheets that cannot be told apart.
    #[error("{0} edges have several sheets, and which triangles are neighbours is not decided")]
    NeighboursUnknown(usize),
    /// Vertices join triangles that share no edge there.
    #[error("{0} vertices may join sheets that are to stay apart")]
    PinchedVertices(usize),
    /// Several parameters reach each point of the surface.
    #[error(
        "several parameters have the same image everywhere: sheets that lie upon each other are \
         not joined"
    )]
    OverlappingSheets,
    /// Pairs of triangles cross.
    #[error("{0} pairs of triangles cross")]
    Crossings(usize),
    /// Too many pairs of triangles cross for all to be counted.
    #[error("more than {0} pairs of triangles cross")]
    CrossingsAbove(usize),
    /// The time was over before triangles were tested for crossings.
    #[error("whether triangles cross was not looked for")]
    CrossingsUnknown,
    /// Sides with equal control points have different vertices.
    #[error("patches do not fit along {0} edges of sides that they have in common")]
    SidesApart(usize),
    /// Edges on sides of patches have too many triangles.
    #[error("{0} edges have more triangles than there are patches at a side")]
    SidesCrowded(usize),
    /// Different patches are not cut along each other.
    #[error("different patches are not cut where they cross")]
    PatchesNotCut,
    /// A finding about one of several patches.
    #[error("{patch}: {finding}")]
    OfPatch {
        /// Name of the patch.
        patch: String,
        /// The finding itself.
        finding: Box<Self>,
    },
}

impl Finding {
    /// Returns the claim that the finding contradicts.
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
            | Self::CoincidentVertices(_)
            | Self::OutsideBox(_)
            | Self::NoArea(_) => Claim::Shapes,
            Self::Winding(_) | Self::NeighboursUnknown(_) => Claim::Winding,
            Self::EdgesClash | Self::OpenEdges(_) | Self::CrowdedEdges(_) => Claim::Edges,
            Self::SidesApart(_) | Self::SidesCrowded(_) => Claim::Sides,
            Self::Crossings(_)
            | Self::CrossingsAbove(_)
            | Self::CrossingsUnknown
            | Self::PatchesNotCut => Claim::Crossings,
            Self::PinchedVertices(_) | Self::OverlappingSheets => Claim::Sheets,
            Self::OfPatch { finding, .. } => finding.claim(),
        }
    }
    /// Returns the finding, attributed to one patch.
    pub(crate) fn attributed_to(self, patch: &str) -> Self {
        Self::OfPatch {
            patch: patch.to_owned(),
            finding: Box::new(self),
        }
    }
    /// Returns the finding without its patch.
    pub fn kind(&self) -> &Self {
        match self {
            Self::OfPatch { finding, .. } => finding.kind(),
            other => other,
        }
    }
}
