//! Values of arguments, as clap reads them.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use isoform::geom::Aabb;

/// Reads one of the values that have names.
pub(crate) fn one_of<T: Copy + Send + Sync + 'static>(
    all: &'static [(&'static str, T)],
) -> impl TypedValueParser<Value = T> {
    let names = PossibleValuesParser::new(all.iter().map(|named| named.0));
    names.map(|name| {
        let named = all.iter().find(|named| named.0 == name);
        named.expect("the name is one of them").1
    })
}

/// A list of numbers with commas: `1,2.5,-3`.
pub(crate) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| match word.trim().parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(format!("`{}` is not a number", word.trim())),
    };
    if text.trim().is_empty() {
        Ok(Vec::new())
    } else {
        text.split(',').map(number).collect()
    }
}

/// A positive number.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match numbers(text)?.as_slice() {
        &[v] if v > 0.0 => Ok(v),
        _ => Err("a positive number is expected".to_owned()),
    }
}

/// A box: half the width of one around the origin, or six numbers.
pub(crate) fn region(text: &str) -> Result<Aabb, String> {
    match *numbers(text)?.as_slice() {
        [half] if half > 0.0 => Ok(Aabb {
            lo: [-half; 3],
            hi: [half; 3],
        }),
        [a, b, c, d, e, f] if a < d && b < e && c < f => Ok(Aabb {
            lo: [a, b, c],
            hi: [d, e, f],
        }),
        _ => Err(
            "half a width is expected, or six numbers: lower corner and upper corner".to_owned(),
        ),
    }
}
