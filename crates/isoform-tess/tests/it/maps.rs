//! Reading and refusing maps.

use isoform_io::read_map;
use isoform_tess::{Map, MapError, MapOptions};

/// The invalid files of the acceptance check, each with the code and the polynomial that must be
/// named.
const INVALID: [(&str, &str, Option<&str>); 12] = [
    (
        r#"{"X":"s","Y":"s^2","Z":"s^3","W":"1"}"#,
        "not_a_surface",
        None,
    ),
    (
        r#"{"X":"2*s+2*t","Y":"s+t","Z":"3*s+3*t","W":"s+t"}"#,
        "not_a_surface",
        None,
    ),
    (r#"{"X":"0","Y":"0","Z":"0","W":"0"}"#, "all_zero", None),
    (
        r#"{"X":"s","Y":"t","Z":"s*t","W":"0"}"#,
        "zero_denominator",
        Some("W"),
    ),
    (
        r#"{"X":"1/s","Y":"t","Z":"s*t","W":"1"}"#,
        "not_a_polynomial",
        Some("X"),
    ),
    (
        r#"{"X":"s+q","Y":"t","Z":"s*t","W":"1"}"#,
        "unknown_variable",
        Some("X"),
    ),
    (
        r#"{"X":"s","Y":"t","Z":"nan","W":"1"}"#,
        "unknown_variable",
        Some("Z"),
    ),
    (r#"{"X":"s","Y":"t","Z":"s*t"}"#, "missing", Some("W")),
    (r#"{"X":"s","Y":"#, "not_json", None),
    ("", "not_json", None),
    (
        r#"{"X":"s","Y":["t"],"Z":"s*t","W":"1"}"#,
        "not_text",
        Some("Y"),
    ),
    (
        r#"{"X":"s^65","Y":"t","Z":"s*t","W":"1"}"#,
        "degree_too_large",
        None,
    ),
];

/// Code, key, hint and message of what is wrong with a text.
type Refusal = (&'static str, Option<&'static str>, &'static str, String);

fn refusal(text: &str, options: MapOptions) -> Option<Refusal> {
    match read_map(text) {
        Err(e) => Some((e.code(), e.key(), e.hint(), e.to_string())),
        Ok(file) => Map::new(file.polynomials, options)
            .err()
            .map(|e| (e.code(), e.key(), e.hint(), e.to_string())),
    }
}

#[test]
fn invalid_maps_are_refused_with_the_reason() {
    for (text, code, key) in INVALID {
        let refused = refusal(text, MapOptions::default()).expect(text);
        let (found_code, found_key, hint, message) = &refused;
        assert_eq!((*found_code, *found_key), (code, key), "{text}: {message}");
        assert!(!hint.is_empty() && !message.is_empty());
        assert_eq!(refusal(text, MapOptions { reduce: true }), Some(refused));
    }
}

/// Texts and files are refused for equal reasons, with equal messages.
#[test]
fn texts_are_refused_as_their_file_is() {
    for bad in ["1/s", "s+q", "s +", "s^2000"] {
        let of_texts = Map::parse([bad, "t", "s*t", "1"], MapOptions::default()).expect_err(bad);
        let file = format!(r#"{{"X":"{bad}","Y":"t","Z":"s*t","W":"1"}}"#);
        let of_file = read_map(&file).expect_err(bad);
        assert_eq!(of_texts.to_string(), of_file.to_string());
        assert_eq!(
            (of_texts.code(), of_texts.key(), of_texts.hint()),
            (of_file.code(), of_file.key(), of_file.hint())
        );
    }
}

#[test]
fn a_common_factor_is_named_and_removed_on_demand() {
    let texts = [
        "s*(s + t + 1)",
        "t*(s + t + 1)",
        "s + t + 1",
        "(s + t + 1)*(s^2 + t^2 + 1)",
    ];
    let error = Map::parse(texts, MapOptions::default()).expect_err("a common factor");
    assert_eq!(
        error.to_string(),
        "X, Y, Z and W have the common factor s + t + 1"
    );
    let map = Map::parse(texts, MapOptions { reduce: true }).expect("a surface");
    assert_eq!(map.degree(), 2);
    assert_eq!(
        map.removed().map(|f| f.display(&["s", "t"]).to_string()),
        Some("s + t + 1".to_owned())
    );
    assert_eq!(
        map.affine(),
        Map::parse(["s", "t", "1", "s^2 + t^2 + 1"], MapOptions::default())
            .expect("a surface")
            .affine()
    );
}

#[test]
fn denominators_are_cleared_jointly() {
    let map = Map::parse(["s/2", "t/3", "s*t", "5"], MapOptions::default()).expect("a surface");
    let texts = map
        .forms()
        .each_ref()
        .map(|f| f.display(&["s", "t", "w"]).to_string());
    assert_eq!(texts, ["3*s*w", "2*t*w", "6*s*t", "30*w^2"]);
}

#[test]
fn floats_are_read_exactly() {
    let tenth: [&[([u16; 2], f64)]; 4] = [
        &[([1, 0], 0.1)],
        &[([0, 1], 1.0)],
        &[([1, 1], 1.0)],
        &[([0, 0], 1.0)],
    ];
    let map = Map::from_f64(tenth, MapOptions::default()).expect("a surface");
    let [x, y, ..] = map.affine();
    assert_eq!(
        x.coefficient([1, 0, 0, 0]) / y.coefficient([0, 1, 0, 0]),
        isoform_algebra::RBig::try_from(0.1).expect("finite")
    );
    let bad: [&[([u16; 2], f64)]; 4] = [&[([1, 0], f64::NAN)], &[], &[], &[([0, 0], 1.0)]];
    assert_eq!(
        Map::from_f64(bad, MapOptions::default()),
        Err(MapError::NotFinite { key: "X" })
    );
}
