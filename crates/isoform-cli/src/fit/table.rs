//! The result of a fit for people.

use super::document;
use super::job::Job;
use isoform::fit::{Estimate, Kind, Template};

/// Decimals that a value deserves whose error is `error`: two digits of the error.
fn decimals(error: f64) -> usize {
    if error > 0.0 && error.is_finite() {
        (1.0 - error.log10().floor()).clamp(0.0, 12.0) as usize
    } else {
        6
    }
}

/// A value with as many digits as its error deserves.
pub(crate) fn rounded(value: f64, error: f64) -> String {
    format!("{value:.*}", decimals(error))
}

/// A length, with four digits.
pub(crate) fn brief(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    let digits = 3 - v.abs().log10().floor() as i32;
    if (-3..=7).contains(&digits) {
        format!("{v:.*}", digits.max(0) as usize)
    } else {
        format!("{v:.3e}")
    }
}

/// Factor from a unit to millimetres.
pub(crate) fn millimetres(unit: &str) -> Option<f64> {
    match unit {
        "mm" => Some(1.0),
        "cm" => Some(10.0),
        "m" => Some(1000.0),
        "in" | "inch" => Some(25.4),
        "ft" => Some(304.8),
        _ => None,
    }
}

/// A number with its unit.
pub(crate) fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() {
        number.to_owned()
    } else {
        format!("{number} {unit}")
    }
}

/// Half the width of the 95 % interval.
pub(crate) fn half_width(p: &Estimate) -> Option<f64> {
    p.ci95.map(|(lo, hi)| 0.5 * (hi - lo))
}

/// One line of the table of parameters.
pub(crate) struct Row {
    pub(crate) name: String,
    pub(crate) value: String,
    /// The half width of the 95 % interval.
    pub(crate) error: String,
    /// Value and error in millimetres, where the scan has another unit.
    pub(crate) mm: String,
    pub(crate) status: &'static str,
    pub(crate) bounds: String,
}

/// The parameters as text.
pub(crate) fn rows(job: &Job) -> Vec<Row> {
    let values = job.values();
    let parameters = job.template.parameters();
    let row = |(i, p): (usize, &Estimate)| {
        let unit = job.unit_of(i).unwrap_or_default();
        let half = half_width(p);
        let error = half.unwrap_or(1e-4 * values[i].abs());
        let is_length = matches!(
            parameters[i].kind,
            Kind::X | Kind::Y | Kind::Z | Kind::Length
        );
        let scale = millimetres(&unit).filter(|s| is_length && *s != 1.0);
        let mm = |s: f64| {
            let value = rounded(values[i] * s, error * s);
            half.map_or(value.clone(), |h| {
                format!("{value} ± {}", rounded(h * s, h * s))
            })
        };
        let shift = job.template.shift[i];
        Row {
            name: p.name.clone(),
            value: with_unit(&rounded(values[i], error), &unit),
            error: half.map(|h| rounded(h, h)).unwrap_or_default(),
            mm: scale.map(mm).unwrap_or_default(),
            status: p.status.as_str(),
            bounds: format!(
                "{} to {}",
                brief(p.bounds.0 + shift),
                brief(p.bounds.1 + shift)
            ),
        }
    };
    job.fit.parameters.iter().enumerate().map(row).collect()
}

/// One sentence: whether the template fits.
pub(crate) fn verdict(job: &Job) -> String {
    let fit = &job.fit;
    match (fit.acceptable, fit.complete) {
        (true, true) => "the template fits".to_owned(),
        (true, false) => "stopped early; the best so far fits".to_owned(),
        (false, _) => format!("the template does not fit: {}", fit.reasons.join("; ")),
    }
}

/// The table and what else a reader should know.
pub(crate) fn text(job: &Job) -> String {
    let fit = &job.fit;
    let unit = &job.unit.unit;
    let rows = rows(job);
    let mut text = format!(
        "{} to {}: {}\n\n",
        job.template_name,
        job.scan,
        verdict(job)
    );
    let has_mm = rows.iter().any(|r| !r.mm.is_empty());
    let mut lines = vec![
        [
            "parameter",
            "value",
            "± 95 %",
            "status",
            if has_mm { "in mm" } else { "" },
        ]
        .map(str::to_owned),
    ];
    lines.extend(
        rows.into_iter()
            .map(|r| [r.name, r.value, r.error, r.status.to_owned(), r.mm]),
    );
    text += &columns(&lines);
    let length = |v: f64| {
        let mm = millimetres(unit)
            .filter(|s| *s != 1.0)
            .map(|s| format!(" ({} mm)", brief(v * s)))
            .unwrap_or_default();
        with_unit(&brief(v), unit) + &mm
    };
    let (data, model) = (&fit.data_to_model, &fit.model_to_data);
    text += &format!(
        "\npoints    {} of {} used, {} outliers\n",
        fit.n_used, fit.n_points, fit.n_outliers
    );
    text += &format!(
        "data to model   rms {}, 95 % within {}, max {}\n",
        length(data.rms),
        length(data.p95),
        length(data.max)
    );
    text += &format!(
        "model to data   95 % within {}, {:.1} % of the surface without data\n",
        length(model.p95),
        100.0 * model.share_uncovered
    );
    for open in &fit.undetermined {
        text += &format!("open      {}\n", open.why);
    }
    let total: f64 = job.seconds.iter().map(|s| s.1).sum();
    text += &format!(
        "search    {} method, {} of {} starts found it, {} other minima, seed {}, {} s\n",
        document::method(job.method),
        fit.hits,
        fit.starts,
        fit.other_minima.len(),
        job.seed,
        brief(total)
    );
    text
}

/// Lines of cells, aligned: names to the left, numbers to the right.
pub(crate) fn columns<const N: usize>(lines: &[[String; N]]) -> String {
    let width = |k: usize| {
        lines
            .iter()
            .map(|l| l[k].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: [usize; N] = std::array::from_fn(width);
    let mut text = String::new();
    for line in lines {
        let mut row = String::new();
        for (k, cell) in line.iter().enumerate() {
            let space = " ".repeat(widths[k] - cell.chars().count());
            row += &if k == 1 || k == 2 {
                format!("{space}{cell}  ")
            } else {
                format!("{cell}{space}  ")
            };
        }
        text += row.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_they_deserve() {
        assert_eq!(rounded(0.030_234_567, 1.234e-5), "0.030235");
        assert_eq!(rounded(1234.5678, 12.0), "1235");
        assert_eq!(rounded(1.5, f64::NAN), "1.500000");
        assert_eq!(
            (brief(0.000_123_46), brief(1234.5), brief(0.0)),
            ("0.0001235".to_owned(), "1234".to_owned(), "0".to_owned())
        );
        assert_eq!(brief(1.23e-9), "1.230e-9");
    }
}
