//! Lines and figures of tables for people.

/// Returns a line of a table: a name and a text.
pub(crate) fn line(name: &str, text: String) -> String {
    format!("{name:<13}{text}\n")
}

/// A length (power 1), an area (2) or a volume (3) to ten digits, with its unit if it is known.
pub(crate) fn measure(v: f64, unit: Option<&str>, power: usize) -> String {
    let digits = (9 - v.abs().max(1e-9).log10().floor() as i32).clamp(0, 17) as usize;
    let number = if v == 0.0 || (1e-6..1e12).contains(&v.abs()) {
        let fixed = format!("{v:.digits$}");
        match fixed.contains('.') {
            true => fixed.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => fixed,
        }
    } else {
        format!("{v:e}")
    };
    match unit.filter(|u| !u.is_empty()) {
        Some(unit) => format!("{number} {unit}{}", ["", "", "²", "³"][power]),
        None => number,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measures_have_ten_digits_and_a_unit() {
        assert_eq!(measure(24591.080299382007, Some("mm"), 3), "24591.0803 mm³");
        assert_eq!(measure(24591.123456789, None, 3), "24591.12346");
        assert_eq!(measure(100.0, Some("in"), 2), "100 in²");
        assert_eq!(
            measure(0.00012345678901234, Some("m"), 1),
            "0.000123456789 m"
        );
        assert_eq!(measure(12345678901.5, None, 3), "12345678902");
        assert_eq!(measure(0.0, Some("mm"), 3), "0 mm³");
    }
}
