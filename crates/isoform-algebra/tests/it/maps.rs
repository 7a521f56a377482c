//! Implicit equations and degrees of rational maps: textbook surfaces, and the whole zoo where it
//! is at hand.

use isoform_algebra::{
    DEFAULT_MAX_DEGREE, MapDegrees, MapError, Poly, RBig, image_dimension, implicit, map_degrees,
};
use isoform_control::Control;
use serde_json::Value;
use std::time::Instant;

fn map(texts: [&str; 4]) -> [Poly; 4] {
    texts.map(|t| Poly::parse(t, &["s", "t"]).expect(t))
}

fn surface(text: &str) -> Poly {
    Poly::parse(text, &["x", "y", "z", "w"]).expect(text)
}

#[test]
fn textbook_surfaces() {
    let cases = [
        (
            ["2*s", "2*t", "1 - s^2 - t^2", "1 + s^2 + t^2"],
            "x^2 + y^2 + z^2 - w^2",
            1,
            2,
        ),
        // Steiner's Roman surface, Whitney's umbrella, Cayley's ruled cubic, the cuspidal edge.
        (
            ["t", "s", "s*t", "s^2 + t^2 + 1"],
            "y^2*z^2 - x*y*z*w + x^2*z^2 + x^2*y^2",
            1,
            0,
        ),
        (["s*t", "s", "t^2", "1"], "x^2*w - y^2*z", 1, 1),
        (["s", "t", "s*t - s^3", "1"], "x^3 - x*y*w + z*w^2", 1, 6),
        (["s", "t^2", "t^3", "1"], "y^3 - z^2*w", 1, 6),
        // Improper maps: a paraboloid covered twice, a plane covered four times.
        (["s^2", "t", "s^4 + t^2", "1"], "z*w - x^2 - y^2", 2, 12),
        (["s^2", "t^2", "s^2 + t^2", "1"], "x + y - z", 4, 0),
        // A map into a coordinate plane.
        (["s", "t^2", "s*t + 1", "0"], "w", 3, 1),
        // With fractions.
        (
            ["1/2*s", "1/3*t", "s*t", "2/7"],
            "12/7*x*y - 2/7*2/7*z*w",
            1,
            2,
        ),
    ];
    for (texts, equation, map_degree, base_multiplicity) in cases {
        let map = map(texts);
        let found = implicit(&map, DEFAULT_MAX_DEGREE, &Control::default())
            .expect("a surface")
            .expect("a low degree");
        assert!(found.equation.compose(&map).is_zero());
        let degrees = found.degrees;
        assert_eq!(
            (degrees.map_degree, degrees.base_multiplicity),
            (map_degree, base_multiplicity),
            "{texts:?}"
        );
        assert_eq!(map_degrees(&map, &Control::default()), Ok(degrees));
        assert_eq!(found.equation.total_degree(), degrees.implicit_degree);
        if texts[0] != "1/2*s" {
            assert!(
                found.equation.is_associate(&surface(equation)),
                "{}",
                found.equation
            );
        }
    }
}

#[test]
fn refusals() {
    assert_eq!(
        implicit(&map(["0", "0", "0", "0"]), 16, &Control::default()),
        Err(MapError::Zero)
    );
    assert_eq!(image_dimension(&map(["2", "3", "0", "1"])), Ok(0));
    assert_eq!(
        image_dimension(&map(["s + t", "2*s + 2*t", "0", "3*s + 3*t"])),
        Ok(0)
    );
    assert_eq!(
        implicit(
            &map(["s + t", "(s + t)^2", "(s + t)^3", "1"]),
            16,
            &Control::default()
        ),
        Err(MapError::NotASurface { dimension: 1 })
    );
    let common = implicit(
        &map(["s*(s + t)", "t*(s + t)", "s^2 - t^2", "(s + t)*(s*t + 1)"]),
        16,
        &Control::default(),
    );
    assert_eq!(
        common.expect_err("a common factor").to_string(),
        "the four polynomials have the common factor s + t"
    );
    assert_eq!(
        implicit(
            &map(["s", "t", "s*t", "1"]),
            16,
            &Control::default().until(Instant::now())
        ),
        Err(MapError::Stopped)
    );
    let too_high = map(["s^3 + t", "t^3 - s", "s^2*t + 2", "s*t^2 + s^3 - t^3 + 1"]);
    assert_eq!(implicit(&too_high, 8, &Control::default()), Ok(None));
    assert_eq!(
        image_dimension(&[Poly::var(2), Poly::one(), Poly::one(), Poly::one()]),
        Err(MapError::TooManyVariables)
    );
}

/// From degree 5 on equations come from lines; they vanish on the map, multiplied out by other
/// code. A map of degree 3 in space coordinates of which every base point (1:0:0:0) … (0:0:0:1)
/// lies on the surface needs another centre of projection.
#[test]
fn equations_of_higher_degree() {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut dense = |degree: u16| {
        let exponents = (0..=degree).flat_map(|i| (0..=degree - i).map(move |j| [i, j, 0, 0]));
        Poly::from_terms(
            exponents
                .map(|e| (e, RBig::from(rng.i64(-3..=3))))
                .collect::<Vec<_>>(),
        )
    };
    let general: [Poly; 4] = std::array::from_fn(|_| dense(3));
    let special = map([
        "s*(s + 2*t - 1)*(t + 3)",
        "(s - 1)*(t - 1)*(s + t)",
        "s*t^2 + s - t^2 - 1",
        "(s - t)*(s - 1)*(s + 2) + t*(t - 1)*(s - 1)",
    ]);
    let square = ["s^2", "t", "w"].map(|t| Poly::parse(t, &["s", "t", "w"]).expect(t));
    let twice: [Poly; 4] = general.clone().map(|p| p.compose(&square));
    for (map, degrees) in [
        (&general, Some((1, 9))),
        (&special, None),
        (&twice, Some((2, 9))),
    ] {
        let found = implicit(map, DEFAULT_MAX_DEGREE, &Control::default())
            .expect("a surface")
            .expect("a low degree");
        if let Some(wanted) = degrees {
            assert_eq!(
                (found.degrees.map_degree, found.degrees.implicit_degree),
                wanted
            );
        }
        assert!(found.degrees.implicit_degree >= 5 && found.equation.is_homogeneous());
        assert_eq!(found.equation.total_degree(), found.degrees.implicit_degree);
        for (s, t) in [(1, 2), (-3, 5), (7, -4)] {
            let at = map.clone().map(|p| p.eval(&[RBig::from(s), RBig::from(t)]));
            assert_eq!(found.equation.eval(&at), RBig::ZERO);
        }
    }
    // Equal surfaces have equal equations.
    let [once, again] = [&general, &twice].map(|m| {
        implicit(m, 16, &Control::default())
            .expect("a surface")
            .expect("degree 9")
            .equation
    });
    assert!(once == again);
}

/// Small random maps, sparse and dense: equations vanish on the map, in general and at once.
#[test]
fn random_maps_are_answered() {
    let mut rng = fastrand::Rng::with_seed(77);
    let mut equations = 0;
    for _ in 0..60 {
        let (degree, density) = (rng.u16(2..=3), rng.u32(2..=10));
        let map: [Poly; 4] = std::array::from_fn(|_| {
            let exponents = (0..=degree)
                .flat_map(|i| (0..=degree - i).map(move |j| [i, j, 0, 0]))
                .filter(|_| rng.u32(0..10) < density);
            Poly::from_terms(
                exponents
                    .collect::<Vec<_>>()
                    .into_iter()
                    .map(|e| (e, RBig::from(rng.i64(-3..=3)))),
            )
        });
        if let Ok(found) = implicit(&map, DEFAULT_MAX_DEGREE, &Control::default()) {
            let equation = found.expect("degree 9 at most").equation;
            assert!(equation.compose(&map).is_zero());
            assert_eq!(equation.squarefree(), [(equation.clone(), 1)]);
            equations += 1;
        }
    }
    assert!(equations >= 40, "only {equations} surfaces");
}

/// Degrees are invariant under projectivities of the parameter plane and of space.
#[test]
fn degrees_do_not_depend_on_the_frame() {
    let forms = map(["s^3 - 3*s*t^2", "t^3 + s", "s*t", "s^2 + 1"]).map(|p| p.homogenise(2, 3));
    let moved = ["2*s + t - w", "s - 3*t + w", "s + t + 2*w"]
        .map(|t| Poly::parse(t, &["s", "t", "w"]).expect(t));
    let wanted = map_degrees(
        &forms.clone().map(|p| p.dehomogenise(2)),
        &Control::default(),
    )
    .expect("a surface");
    let there = forms.map(|p| p.compose(&moved).dehomogenise(2));
    assert_eq!(map_degrees(&there, &Control::default()), Ok(wanted));
    let mixed = [
        &there[0] + &there[1],
        &there[1] - &there[3],
        &there[2] + &there[0],
        there[3].scale(&RBig::from(3)),
    ];
    assert_eq!(map_degrees(&mixed, &Control::default()), Ok(wanted));
}

#[test]
fn the_zoo() {
    let mut checked = 0;
    for path in isoform_testdata::files("zoo", "json") {
        let json: Value =
            serde_json::from_str(&std::fs::read_to_string(&path).expect("a readable file"))
                .expect("JSON");
        let name = isoform_testdata::stem(&path);
        let map: [Poly; 4] = ["X", "Y", "Z", "W"].map(|k| {
            Poly::parse(json[k].as_str().expect("a text"), &["s", "t"]).expect("a polynomial")
        });
        if json["valid"] == false {
            let error = map_degrees(&map, &Control::default()).expect_err("an invalid map");
            if let MapError::CommonFactor { factor } = &error {
                let wanted = Poly::parse(
                    json["common_factor"].as_str().expect("a text"),
                    &["s", "t", "w"],
                )
                .expect("a form");
                assert_eq!(
                    factor.homogenise(2, factor.total_degree()),
                    wanted,
                    "{name}"
                );
            }
            continue;
        }
        assert_eq!(
            image_dimension(&map),
            Ok(json["image_dim"].as_u64().unwrap_or(2) as usize),
            "{name}"
        );
        let degrees = map_degrees(&map, &Control::default()).expect("a surface");
        assert_eq!(
            Some(degrees.map_degree as u64),
            json["map_degree"].as_u64(),
            "{name}"
        );
        assert_eq!(
            Some(degrees.degree as u64),
            json["degree"].as_u64(),
            "{name}"
        );
        let Some(wanted) = json["implicit_degree"].as_u64() else {
            continue;
        };
        let multiplicity = json["base_multiplicity_total"]
            .as_str()
            .and_then(|m| m.parse().ok())
            .expect("a number in quotes");
        let implicit_degree = wanted as usize;
        assert_eq!(
            degrees,
            MapDegrees {
                implicit_degree,
                base_multiplicity: multiplicity,
                ..degrees
            },
            "{name}"
        );
        let found = implicit(&map, DEFAULT_MAX_DEGREE, &Control::default())
            .expect("a surface")
            .expect("a low degree");
        let equation = surface(json["implicit"].as_str().expect("a text"));
        assert!(found.equation.is_associate(&equation), "{name}");
        checked += 1;
    }
    println!("{checked} surfaces");
    assert!(checked >= 30, "only {checked} surfaces");
}
