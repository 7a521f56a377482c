//! Rational maps as JSON: {"X": "…", "Y": "…", "Z": "…", "W": "…"} with polynomials in s and t.
//!
//! A file contains the map (s, t) ↦ (X/W, Y/W, Z/W) as four polynomials with exact rational
//! coefficients, written as text; a JSON number stands for a constant. The reader does not check
//! the map: its users find out if the image is a surface and if the polynomials share a factor.

use isoform_algebra::{ParseError, ParseProblem, Poly};
use serde_json::{Value, json};

/// Keys of the four polynomials in a file, in the order of [`MapFile::polynomials`].
pub const MAP_KEYS: [&str; 4] = ["X", "Y", "Z", "W"];
/// Names of the variables 0 and 1 of the polynomials.
pub const MAP_VARIABLES: [&str; 2] = ["s", "t"];

/// Rational map (s, t) ↦ (X/W, Y/W, Z/W), as stored in a file.
///
/// ```
/// use isoform_io::{read_map, write_map};
/// let text = r#"{"X": "2*s", "Y": "2*t", "Z": "(s^2 + t^2) - 1", "W": "s^2 + t^2 + 1"}"#;
/// let sphere = read_map(text)?;
/// assert_eq!(sphere.polynomials[2].total_degree(), 2);
/// assert_eq!(read_map(&write_map(&sphere))?, sphere);
/// # Ok::<(), isoform_io::MapFileError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MapFile {
    /// X, Y, Z and W in the variables 0 and 1, which are s and t.
    pub polynomials: [Poly; 4],
}

/// Reason why a text is not a file of a map.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MapFileError {
    /// The text is not JSON.
    #[error("line {line}, column {column}: not JSON: {problem}")]
    NotJson {
        /// Line of the error, from 1; 0 in an empty text.
        line: usize,
        /// Column of the error, from 1; 0 in an empty text.
        column: usize,
        /// Message of the JSON parser.
        problem: String,
    },
    /// One of the polynomials is missing.
    #[error("{key} is missing")]
    Missing {
        /// One of [`MAP_KEYS`].
        key: &'static str,
    },
    /// The value of a key is neither text nor a number.
    #[error("{key} is {found}, not a polynomial")]
    NotText {
        /// One of [`MAP_KEYS`].
        key: &'static str,
        /// Kind of the value found.
        found: &'static str,
    },
    /// A text is not a polynomial in s and t.
    #[error("{key}, {error}")]
    NotAPolynomial {
        /// One of [`MAP_KEYS`].
        key: &'static str,
        /// Position in the text, and what was expected there.
        error: ParseError,
    },
}

impl MapFileError {
    /// Returns a stable identifier of the case.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NotJson { .. } => "not_json",
            Self::Missing { .. } => "missing",
            Self::NotText { .. } => "not_text",
            Self::NotAPolynomial { error, .. } => match error.problem {
                ParseProblem::UnknownName { .. } => "unknown_variable",
                _ => "not_a_polynomial",
            },
        }
    }
    /// Returns the key of the polynomial concerned, an element of [`MAP_KEYS`]; `None` for errors
    /// of the whole text.
    pub fn key(&self) -> Option<&'static str> {
        match self {
            Self::NotJson { .. } => None,
            Self::Missing { key } | Self::NotText { key, .. } => Some(key),
            Self::NotAPolynomial { key, .. } => Some(key),
        }
    }
    /// Returns the suggested remedy, one sentence.
    pub fn hint(&self) -> &'static str {
        let Self::NotAPolynomial { error, .. } = self else {
            return "write {\"X\": \"…\", \"Y\": \"…\", \"Z\": \"…\", \"W\": \"…\"} with polynomials in s and t";
        };
        error.problem.hint()
    }
}

/// Parses a map from JSON; keys other than [`MAP_KEYS`], in capital or small letters, are ignored.
/// The variables may be called u and v in place of s and t.
///
/// # Errors
/// [`MapFileError`].
pub fn read_map(text: &str) -> Result<MapFile, MapFileError> {
    let json: Value = serde_json::from_str(text).map_err(|e| not_json(&e))?;
    let mut texts: [String; 4] = Default::default();
    for (target, key) in texts.iter_mut().zip(MAP_KEYS) {
        *target = polynomial_text(&json, key)?;
    }
    let is_uv = texts.iter().any(|text| text.contains(['u', 'v']));
    let names = if is_uv { ["u", "v"] } else { MAP_VARIABLES };
    let mut polynomials: [Poly; 4] = Default::default();
    for ((target, text), key) in polynomials.iter_mut().zip(&texts).zip(MAP_KEYS) {
        *target = Poly::parse(text, &names)
            .map_err(|error| MapFileError::NotAPolynomial { key, error })?;
    }
    Ok(MapFile { polynomials })
}

/// Formats a map as JSON that reads back to identical polynomials.
pub fn write_map(map: &MapFile) -> String {
    let [x, y, z, w] = map
        .polynomials
        .each_ref()
        .map(|p| p.display(&MAP_VARIABLES).to_string());
    format!("{}\n", json!({"X": x, "Y": y, "Z": z, "W": w}))
}

/// Converts a JSON error, separating its position.
fn not_json(e: &serde_json::Error) -> MapFileError {
    // The parser appends the position, which is reported separately.
    let told = e.to_string();
    let problem = told.split(" at line ").next().unwrap_or_default();
    MapFileError::NotJson {
        line: e.line(),
        column: e.column(),
        problem: problem.to_owned(),
    }
}

/// Returns the polynomial under a key: a text, or a number, which is a constant.
fn polynomial_text(json: &Value, key: &'static str) -> Result<String, MapFileError> {
    let found = match json.get(key).or_else(|| json.get(key.to_lowercase())) {
        None => return Err(MapFileError::Missing { key }),
        Some(Value::String(text)) => return Ok(text.clone()),
        Some(Value::Number(constant)) => return Ok(constant.to_string()),
        Some(Value::Null) => "null",
        Some(Value::Bool(_)) => "true or false",
        Some(Value::Array(_)) => "a list",
        Some(Value::Object(_)) => "an object",
    };
    Err(MapFileError::NotText { key, found })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_constants_and_order_does_not_matter() {
        let map = read_map(r#"{"W": 0.1, "Z": "s*t", "Y": "t", "X": "s", "name": 3}"#);
        let map = map.expect("a map");
        let [x, y, z, w] = map.polynomials.each_ref().map(Poly::total_degree);
        assert_eq!([x, y, z, w], [1, 1, 2, 0]);
        // A decimal number is taken exactly, not rounded to a double.
        assert_eq!(map.polynomials[3].scale(&10.into()), Poly::one());
    }

    #[test]
    fn small_keys_and_other_parameters_are_read() {
        let expected = read_map(r#"{"X": "2*s*t", "Y": "t", "Z": "s^2", "W": "1"}"#);
        let other = read_map(r#"{"x": "2u v", "y": "v", "z": "u²", "w": 1}"#);
        assert!(expected.is_ok());
        assert_eq!(other, expected);
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (text, code, key, message) in [
            (
                "",
                "not_json",
                None,
                "line 1, column 0: not JSON: EOF while parsing a value",
            ),
            ("[1]", "missing", Some("X"), "X is missing"),
            (
                r#"{"X": "s", "Y": ["t"], "Z": "1", "W": "1"}"#,
                "not_text",
                Some("Y"),
                "Y is a list, not a polynomial",
            ),
            (
                r#"{"X": "s", "Y": null, "Z": "1", "W": "1"}"#,
                "not_text",
                Some("Y"),
                "Y is null, not a polynomial",
            ),
        ] {
            let e = read_map(text).expect_err(text);
            assert_eq!(
                (e.code(), e.key(), e.to_string().as_str()),
                (code, key, message)
            );
            assert!(e.hint().starts_with("write {\"X\""));
        }
        let of = |x: &str| {
            let text = format!(r#"{{"X": "{x}", "Y": "t", "Z": "1", "W": "1"}}"#);
            read_map(&text).expect_err(x)
        };
        assert_eq!(of("u + 1").code(), "unknown_variable");
        assert!(of("cos(s)").hint().starts_with("on a circle"));
        assert_eq!(
            of("1/s").hint(),
            "bring all coordinates to the common denominator W"
        );
        assert_eq!(
            (of("s +").code(), of("s +").key()),
            ("not_a_polynomial", Some("X"))
        );
    }

    proptest! {
        #[test]
        fn any_text_is_survived(x in "[-+*/^()st0-9. ue\"{}:,\\[\\]]{0,24}") {
            for text in [x.clone(), json!({"X": x, "Y": "t", "Z": "1", "W": "1"}).to_string()] {
                match read_map(&text) {
                    Ok(map) => prop_assert_eq!(read_map(&write_map(&map)), Ok(map)),
                    Err(e) => prop_assert!(!e.to_string().is_empty() && !e.code().is_empty()),
                }
            }
        }
    }
}
