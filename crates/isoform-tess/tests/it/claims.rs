//! What is claimed of surfaces, and on what basis: nothing that is decided in floating point may
//! count as proved, and nothing is claimed that had not to be decided.

use crate::common::SPHERE;
use isoform_algebra::RBig;
use isoform_control::Control;
use isoform_tess::{
    Basis, Budget, Claim, Domain, Finding, JoinedCurve, Map, MeshOptions, Mode, Phase, Surface,
    TriangulateOptions, Unopened, Verdict, triangulate_once,
};

const UMBRELLA: [&str; 4] = ["s*t", "s", "t^2", "1"];
/// What is claimed of every mesh.
const MESH: [Claim; 6] = [
    Claim::Drawing,
    Claim::SignOfW,
    Claim::Distances,
    Claim::Shapes,
    Claim::Edges,
    Claim::Winding,
];
/// What is claimed of every map of which the whole plane is analysed.
const MAP: [Claim; 7] = [
    Claim::BasePoints,
    Claim::ComplexSeams,
    Claim::Pole,
    Claim::MapDegree,
    Claim::CriticalCurves,
    Claim::DoubleCurves,
    Claim::Region,
];

fn options(mode: Mode) -> TriangulateOptions {
    TriangulateOptions {
        half_width: RBig::from(2),
        domain: None,
        mode,
        mesh: MeshOptions {
            tolerance: 0.04,
            longest: 1.0,
            triangles: 100_000,
        },
        budget: Budget::default(),
    }
}

fn surface(texts: [&str; 4], options: &TriangulateOptions) -> Surface {
    let map = Map::parse(texts, Default::default()).expect("a map");
    let (surface, _) = triangulate_once(&map, options, &Control::default()).expect("not stopped");
    assert!(surface.is_certified(), "{texts:?}: {:?}", surface.findings);
    surface
}

/// Those that are claimed besides what is claimed of every mesh and map.
fn special(texts: [&str; 4], mode: Mode) -> Vec<Decided> {
    let claims = decided(&surface(texts, &options(mode)));
    for common in MAP.into_iter().chain(MESH) {
        assert!(claims.iter().any(|g| g.0 == common), "{common}");
    }
    let is_special = |g: &Decided| !MAP.contains(&g.0) && !MESH.contains(&g.0);
    claims.into_iter().filter(is_special).collect()
}

/// A claim with its verdict.
type Decided = (Claim, Verdict);

/// The claims that had to be decided of a surface.
fn decided(surface: &Surface) -> Vec<Decided> {
    surface.certificate().decided().collect()
}

fn usual<const N: usize>(claims: [Claim; N]) -> Vec<Decided> {
    claims.map(|claim| (claim, claim.usual())).to_vec()
}

fn has(found: &[Decided], claim: Claim) -> bool {
    found.contains(&(claim, claim.usual()))
}

/// The torus by half angles has two base points and contracts the line at infinity, the Whitney
/// umbrella has a double curve with an end and a base point beyond the box, and the last one a base
/// point that another one is infinitely near to: what is claimed follows.
#[test]
fn claims_follow_what_had_to_be_decided() {
    assert_eq!(special(SPHERE, Mode::Normalised), []);
    assert_eq!(special(SPHERE, Mode::Glued), []);
    let torus = [
        "(1/2)*(1 - s^2)*(3 + t^2)",
        "s*(3 + t^2)",
        "t*(1 + s^2)",
        "(1 + s^2)*(1 + t^2)",
    ];
    let opened = [Claim::Tangents, Claim::SignAtBasePoints];
    assert_eq!(
        special(torus, Mode::Normalised),
        usual([Claim::SolitaryArcs, opened[0], opened[1]])
    );
    assert_eq!(
        special(UMBRELLA, Mode::Normalised),
        usual([Claim::SolitaryArcs])
    );
    // Its double curve is traced, with the pinch point.
    let mut traced = usual([Claim::PinchPoints, Claim::SolitaryArcs, Claim::Partners]);
    traced[0].1 = Verdict::Holds(Basis::Floating);
    assert_eq!(special(UMBRELLA, Mode::Glued), traced);
    let tree = ["t*(s^2 + t)", "s^3", "t^2", "s^2 + t^2"];
    let found = special(tree, Mode::Normalised);
    assert!(has(&found, Claim::Trees), "{found:?}");
}

/// One parameter of two is drawn: the fundamental domain of (s, t) → (−s, t) has a fold as border,
/// and no base point off it.
#[test]
fn improper_maps_claim_their_transformations() {
    let found = special(["s^2", "t", "s^2*t", "1"], Mode::Normalised);
    assert!(has(&found, Claim::DeckTransformations), "{found:?}");
    assert!(has(&found, Claim::Sheets), "{found:?}");
    let domain = found.iter().find(|g| g.0 == Claim::FundamentalDomain);
    assert!(domain.is_some(), "{found:?}");
    assert!(!has(&found, Claim::Folds), "{found:?}");
    // A sphere by longitude and latitude that both go all around: two base points.
    let longitudes = [
        "(1 - s^2)*(1 - t^2)",
        "2*s*(1 - t^2)",
        "2*t*(1 + s^2)",
        "(1 + s^2)*(1 + t^2)",
    ];
    let found = special(longitudes, Mode::Normalised);
    assert!(has(&found, Claim::Folds), "{found:?}");
}

/// A region without poles needs no base points where the rest of the plane is left out; without an
/// implicit equation the degree of the map is counted only.
#[test]
fn what_was_not_looked_for_is_not_claimed() {
    let q = |n: i64| RBig::from(n) / RBig::from(4);
    let domain = Domain::rectangle([q(-1), q(1)], [q(-1), q(1)]).expect("a rectangle");
    let budget = Budget {
        implicit_degree: 0,
        ..Budget::default()
    };
    let mut options = TriangulateOptions {
        domain: Some(domain),
        budget,
        ..options(Mode::Normalised)
    };
    let certificate = surface(SPHERE, &options).certificate();
    let counted = Verdict::Holds(Basis::Floating);
    assert_eq!(certificate.verdict(Claim::MapDegree), counted);
    assert_eq!(certificate.verdict(Claim::Weights), Claim::Weights.usual());
    let curves = certificate.verdict(Claim::DoubleCurves);
    assert!(matches!(curves, Verdict::NotApplicable(_)), "{curves:?}");

    options.budget.everywhere = false;
    let claims = decided(&surface(SPHERE, &options));
    let local = [Claim::CriticalCurves, Claim::Weights, Claim::Region];
    assert_eq!(
        claims,
        usual(local)
            .into_iter()
            .chain(usual(MESH))
            .collect::<Vec<_>>()
    );
}

/// What there was no time for is open, and nothing is claimed that would follow from it.
#[test]
fn what_was_stopped_does_not_hold() {
    let mut options = options(Mode::Glued);
    options.budget.seconds = 0.0;
    let map = Map::parse(UMBRELLA, Default::default()).expect("a map");
    let (s, _) = triangulate_once(&map, &options, &Control::default()).expect("not stopped");
    assert!(!s.holds(Claim::DoubleCurves), "{:?}", s.findings);
    let certificate = s.certificate();
    assert_eq!(certificate.verdict(Claim::CriticalCurves), Verdict::Open);
    assert!(has(&decided(&s), Claim::BasePoints));
}

/// A claim with a finding does not hold, and is among the claims although it was not stated.
#[test]
fn findings_stand_against_claims() {
    let mut s = surface(SPHERE, &options(Mode::Normalised));
    let crossings = |s: &Surface| s.certificate().verdict(Claim::Crossings);
    assert!(s.holds(Claim::Edges) && matches!(crossings(&s), Verdict::NotApplicable(_)));
    s.findings = vec![Finding::OpenEdges(3), Finding::Crossings(2)];
    assert!(!s.is_certified() && !s.holds(Claim::Edges) && s.holds(Claim::Region));
    assert_eq!(crossings(&s), Verdict::Open);
}

/// Findings keep their published wording.
#[test]
fn findings_in_words() {
    let point = [0.5, 1.0, 0.0];
    let (edges, curve) = (2, JoinedCurve::FundamentalDomain);
    let said = [
        (
            Finding::Stopped(Phase::ComplexSeams),
            "seams of complex base points: stopped",
        ),
        (
            Finding::DegreeAboveLimit {
                degree: 25,
                limit: 16,
            },
            "self-intersections: the surface has degree 25, above the limit of 16",
        ),
        (
            Finding::SolitaryLost {
                at: [0.25, -1.0, 1.0 / 3.0],
            },
            "a solitary curve was lost near (0.2500, -1.0000, 0.3333) half-widths",
        ),
        (
            Finding::Unopened {
                point,
                why: Unopened::SeamInFace,
            },
            "the base point (0.5 : 1 : 0) is left open: its seam lies in a face of the box",
        ),
        (
            Finding::PartnersMissing { edges, curve },
            "2 edges of the border of the fundamental domain have no partner that was found",
        ),
        (
            Finding::OfPatch {
                patch: "patch 3".to_owned(),
                finding: Box::new(Finding::NoArea(1)),
            },
            "patch 3: 1 triangles have no area",
        ),
    ];
    for (finding, words) in said {
        assert_eq!(finding.to_string(), words);
    }
    let of_patch = Finding::OfPatch {
        patch: "patch 3".to_owned(),
        finding: Box::new(Finding::TooCoarse),
    };
    assert_eq!(
        (of_patch.claim(), of_patch.kind()),
        (Claim::Distances, &Finding::TooCoarse)
    );
}
