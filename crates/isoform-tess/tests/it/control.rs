//! Options that are refused, surfaces without triangles, and reports of progress.

use isoform_algebra::RBig;
use isoform_geom::RationalPatch;
use isoform_tess::{
    Control, Finding, Map, MeshOptions, Mode, Patch, PatchesError, SurfaceBox, TriangulateError,
    TriangulateOptions, triangulate, triangulate_once, triangulate_patches,
};
use isoform_testdata::shares_told;

fn map(polynomials: [&str; 4]) -> Map {
    Map::parse(polynomials, Default::default()).expect("a map")
}

/// The unit sphere.
fn sphere() -> Map {
    map(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"])
}

fn coarse() -> TriangulateOptions {
    let mut options = TriangulateOptions::around(2.into());
    options.mesh.tolerance = 0.1;
    options
}

/// Two squares of z = x y with a side in common, far from the origin.
fn patches() -> Vec<Patch> {
    let square = |x: f64| {
        let corner = |i: f64, j: f64| [x + i, j, (x + i) * j, 1.0];
        let corners = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]];
        let control = corners.map(|[i, j]| corner(i, j)).to_vec();
        Patch::from(&RationalPatch::new((1, 1), control).expect("a patch"))
    };
    vec![square(20.0), square(21.0)]
}

/// What every way to triangles says of options.
fn refused(options: &TriangulateOptions) -> String {
    let control = Control::default();
    let whole = triangulate(&sphere(), options, &control).expect_err("refused");
    let once = triangulate_once(&sphere(), options, &control).expect_err("refused");
    let patches = triangulate_patches(&patches(), options, &control).expect_err("refused");
    assert!(matches!(whole, TriangulateError::Option { .. }));
    assert!(matches!(patches, PatchesError::Option { .. }));
    assert_eq!(whole.to_string(), once.to_string());
    assert_eq!(whole.to_string(), patches.to_string());
    whole.to_string()
}

#[test]
fn options_out_of_range_are_refused() {
    for (half_width, value) in [(0, "0"), (-2, "-2")] {
        assert_eq!(
            refused(&TriangulateOptions::around(half_width.into())),
            format!("half the width of the box is {value}, which is out of range")
        );
    }
    let tiny = RBig::ONE / RBig::from(10).pow(400);
    refused(&TriangulateOptions::around(tiny));
    for bad in [f64::NAN, 0.0, -1.0] {
        let mut options = coarse();
        options.mesh.tolerance = bad;
        let said = format!("the tolerance is {bad}, which is out of range");
        assert_eq!(refused(&options), said);
        let mut options = coarse();
        options.mesh.longest = bad;
        let said = format!("the longest edge is {bad}, which is out of range");
        assert_eq!(refused(&options), said);
    }
}

#[test]
fn any_number_of_triangles_may_be_allowed() {
    let mut options = coarse();
    options.mesh.triangles = usize::MAX;
    let (most, _) = triangulate(&sphere(), &options, &Control::default()).expect("a surface");
    let (usual, _) = triangulate(&sphere(), &coarse(), &Control::default()).expect("a surface");
    assert!(most.is_certified());
    assert_eq!(most.triangles, usual.triangles);
}

/// A plane that is so steep in its parameters that no triangle is left of it, and no patches.
#[test]
fn without_triangles_only_what_is_outside_is_certified() {
    for size in ["1e160", "1e300"] {
        let x = format!("{size}*s");
        let steep = map([&x, "t", "0", "1"]);
        let (surface, _) = triangulate(&steep, &coarse(), &Control::default()).expect("in time");
        assert!(!surface.is_outside);
        assert_eq!(surface.is_certified(), !surface.triangles.is_empty());
        let lacks = surface.findings.contains(&Finding::NoTriangles);
        assert_eq!(lacks, surface.triangles.is_empty());
    }
    let (none, _) = triangulate_patches(&[], &coarse(), &Control::default()).expect("no error");
    assert!(none.triangles.is_empty() && !none.is_outside && !none.is_certified());
    assert_eq!(none.findings, [Finding::NoTriangles]);
    let far = map(["s", "t", "10", "1"]);
    let (outside, _) = triangulate(&far, &coarse(), &Control::default()).expect("in time");
    assert!(outside.triangles.is_empty() && outside.is_outside && outside.is_certified());
}

#[test]
fn patches_are_certified_with_their_own_options() {
    let patches = patches();
    let around = SurfaceBox::of_patches(&patches).expect("no pole");
    assert!(around.size < 12.0 && around.half_width > RBig::from(20));
    let options = TriangulateOptions::of_patches(&around);
    assert_eq!(options.mode, Mode::Normalised);
    assert_eq!(options.mesh, MeshOptions::around(around.size));
    assert_eq!(options.half_width, around.half_width);
    let (surface, _) =
        triangulate_patches(&patches, &options, &Control::default()).expect("a surface");
    assert!(surface.is_certified(), "{:?}", surface.findings);
}

/// Returns the phases that are reported during a computation.
fn told(make: impl FnOnce(&Control<'_>)) -> Vec<String> {
    let told = shares_told(|hear| {
        make(&Control {
            progress: Some(hear),
            ..Control::default()
        });
    });
    for (phase, shares) in &told {
        assert_eq!(shares[0], 0.0, "{phase}");
    }
    told.into_iter().map(|(phase, _)| phase).collect()
}

/// The phases are those whose seconds the analysis names.
#[test]
fn progress_is_told_by_phases() {
    let named = |seconds: &[(&str, f64)]| -> Vec<String> {
        seconds
            .iter()
            .map(|(phase, _)| (*phase).to_owned())
            .collect()
    };
    // Whitney's umbrella crosses itself.
    for map in [sphere(), map(["s*t", "s", "t^2", "1"])] {
        let mut seconds = Vec::new();
        let phases = told(|control| {
            let (_, analysis) = triangulate(&map, &coarse(), control).expect("a surface");
            seconds = named(&analysis.seconds);
        });
        assert_eq!(phases, seconds);
        assert!(phases.contains(&"crossings".to_owned()));
    }
    let patches = patches();
    let around = SurfaceBox::of_patches(&patches).expect("no pole");
    let options = TriangulateOptions::of_patches(&around);
    let mut seconds = Vec::new();
    let phases = told(|control| {
        let (_, known) = triangulate_patches(&patches, &options, control).expect("a surface");
        seconds = named(&known[0].1.seconds);
    });
    assert_eq!(phases, seconds);
}
