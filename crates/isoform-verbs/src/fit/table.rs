//! The result of a fit for people.

use super::job::Job;
use isoform::fit::{Estimate, Kind, Status, Template};
use isoform::geom::{Point3, norm, rotation};
use isoform::report::brief;

/// Returns the decimal place, as a power of ten, of the second significant digit of an error;
/// `None` without a positive error.
fn place(error: f64) -> Option<i32> {
    if !(error > 0.0 && error.is_finite()) {
        return None;
    }
    let place = error.log10().floor() as i32 - 1;
    // 0.0996 is 0.10 and not 0.100.
    let is_next = (error / 10_f64.powi(place)).round() >= 100.0;
    Some(if is_next { place + 1 } else { place })
}

/// Places below this are lost in the rounding of a number.
const LAST_PLACE: i32 = -12;

/// A value to a decimal place, never a negative zero.
fn at_place(value: f64, place: i32) -> String {
    let text = if place > 0 {
        let unit = 10_f64.powi(place);
        format!("{:.0}", (value / unit).round() * unit)
    } else {
        format!("{value:.*}", -place.max(LAST_PLACE) as usize)
    };
    match text.strip_prefix('-') {
        Some(digits) if !digits.contains(|c: char| ('1'..='9').contains(&c)) => digits.to_owned(),
        _ => text,
    }
}

/// A value to the second significant digit of its error, six decimals without one.
pub(crate) fn rounded(value: f64, error: f64) -> String {
    at_place(value, place(error).unwrap_or(-6))
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

/// A number as it was given, without the digits that a change of units adds.
fn plain(value: f64) -> String {
    let text = format!("{value:.12}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "0" | "-0" if value != 0.0 => format!("{value:e}"),
        "-0" => "0".to_owned(),
        _ => text.to_owned(),
    }
}

/// Value in print: rounded to the second significant digit of the half width of its interval.
#[derive(Debug, PartialEq)]
pub(crate) struct RoundedValue {
    /// The value.
    pub(crate) value: String,
    /// The half width, or both sides where the interval is lopsided; empty without an interval.
    pub(crate) error: String,
    /// The 95 % interval; empty without one.
    pub(crate) interval: String,
    /// The unit; empty where there is none.
    pub(crate) unit: String,
}

/// Sides of an interval that differ by more than this share of its half width are given both.
const LOPSIDED: f64 = 0.1;

impl RoundedValue {
    fn new(value: f64, interval: Option<(f64, f64)>, unit: &str) -> Self {
        let half = interval.map(|(lo, hi)| 0.5 * (hi - lo));
        let unit = unit.to_owned();
        let (Some((lo, hi)), Some(place)) = (interval, half.and_then(place)) else {
            return Self {
                value: brief(value),
                error: String::new(),
                interval: String::new(),
                unit,
            };
        };
        let at = |v: f64| at_place(v, place);
        let half = 0.5 * (hi - lo);
        let error = if (0.5 * (lo + hi) - value).abs() > LOPSIDED * half {
            format!("+{} −{}", at(hi - value), at(value - lo))
        } else {
            at(half)
        };
        Self {
            value: at(value),
            error,
            interval: format!("{} to {}", at(lo), at(hi)),
            unit,
        }
    }

    /// A number that is held is printed as it was given.
    fn held(value: f64, unit: &str) -> Self {
        Self {
            value: plain(value),
            error: String::new(),
            interval: String::new(),
            unit: unit.to_owned(),
        }
    }

    /// Value and half width, with the unit.
    pub(crate) fn text(&self) -> String {
        let number = match self.error.as_str() {
            "" => self.value.clone(),
            both if both.starts_with('+') => format!("{} {both}", self.value),
            half => format!("{} ± {half}", self.value),
        };
        let space = if self.unit == "°" || self.unit.is_empty() {
            ""
        } else {
            " "
        };
        format!("{number}{space}{}", self.unit)
    }
}

/// A parameter as a drawing shows it: lengths in millimetres where the unit is known, angles in
/// degrees.
pub(crate) fn reading(job: &Job, i: usize) -> RoundedValue {
    let unit = job.unit_of(i).unwrap_or_default();
    let (scale, unit) = match job.found.template.parameters()[i].kind {
        Kind::Angle => (1_f64.to_degrees(), "°".to_owned()),
        _ => millimetres(&unit).map_or((1.0, unit), |s| (s, "mm".to_owned())),
    };
    scaled(job, i, scale, &unit)
}

/// A parameter times a factor that changes its unit. A fixed one is printed as given, an
/// undetermined one without an interval.
fn scaled(job: &Job, i: usize, scale: f64, unit: &str) -> RoundedValue {
    let p = &job.found.fit.parameters[i];
    let shift = job.found.template.shift[i];
    let value = (p.value + shift) * scale;
    match (p.status, p.ci95) {
        (Status::Fixed, _) => RoundedValue::held(value, unit),
        (Status::Undetermined, _) => RoundedValue::new(value, None, unit),
        (_, ci) => RoundedValue::new(
            value,
            ci.map(|(lo, hi)| ((lo + shift) * scale, (hi + shift) * scale)),
            unit,
        ),
    }
}

/// One line of the table of parameters.
pub(crate) struct ParameterRow {
    pub(crate) name: String,
    pub(crate) value: String,
    /// The half width of the 95 % interval.
    pub(crate) error: String,
    /// The 95 % interval.
    pub(crate) interval: String,
    /// Value and error in millimetres, where the scan has another unit.
    pub(crate) mm: String,
    /// A round number that may be meant, with a question mark; empty without one.
    pub(crate) nominal: String,
    /// Verdict of the data on the parameter: determined, weak, ….
    pub(crate) status: &'static str,
    /// Bounds of the parameter, in words.
    pub(crate) bounds: String,
}

/// The parameters as text.
pub(crate) fn rows(job: &Job) -> Vec<ParameterRow> {
    let estimates = job.found.fit.parameters.iter().enumerate();
    estimates.map(|(i, p)| row(job, i, p)).collect()
}

/// A parameter as text.
fn row(job: &Job, i: usize, p: &Estimate) -> ParameterRow {
    let unit = job.unit_of(i).unwrap_or_default();
    let is_length = matches!(
        job.found.template.parameters()[i].kind,
        Kind::X | Kind::Y | Kind::Z | Kind::Length
    );
    let scale = millimetres(&unit).filter(|s| is_length && *s != 1.0);
    let own = scaled(job, i, 1.0, &unit);
    let shift = job.found.template.shift[i];
    ParameterRow {
        name: p.name.clone(),
        value: with_unit(&own.value, &unit),
        error: own.error,
        interval: own.interval,
        mm: scale
            .map(|s| scaled(job, i, s, "").text())
            .unwrap_or_default(),
        nominal: nominal(job, i),
        status: p.status.as_str(),
        bounds: match p.bounds {
            (f64::NEG_INFINITY, f64::INFINITY) => String::new(),
            (low, high) => format!("{} to {}", brief(low + shift), brief(high + shift)),
        },
    }
}

/// The round number that may be meant by a parameter, for people.
fn nominal(job: &Job, i: usize) -> String {
    let Some(round) = job.found.nominal(i) else {
        return String::new();
    };
    match job.found.template.parameters()[i].kind {
        Kind::Angle => format!("{}°?", plain(round.to_degrees())),
        _ => format!("{}?", plain(round)),
    }
}

/// Returns the pose of the model in the scan, in words; `None` without a pose.
pub(crate) fn pose(job: &Job) -> Option<String> {
    let place = job.found.placement()?;
    let turn = rotation::vector_of(&place.rotation);
    let angle = norm(turn);
    let list = |v: Point3, digits: usize| v.map(|x| at_place(x, -(digits as i32))).join(", ");
    let at = place.translation.map(brief).join(", ");
    let mut text = format!("origin at ({at})");
    if angle > 0.0 {
        let axis = turn.map(|x| x / angle);
        let degrees = at_place(angle.to_degrees(), -3);
        text += &format!(", turned by {degrees}° about ({})", list(axis, 4));
    }
    if place.scale != 1.0 {
        text += &format!(", scaled by {}", brief(place.scale));
    }
    Some(text)
}

/// One sentence: whether the template fits.
pub(crate) fn verdict(job: &Job) -> String {
    let fit = &job.found.fit;
    match (fit.acceptable, fit.complete) {
        (true, true) => "the template fits".to_owned(),
        (true, false) => "stopped early; the best so far fits".to_owned(),
        (false, _) if fit.verdict == isoform::fit::Verdict::Doubtful => {
            format!("doubtful: {}", fit.reasons.join("; "))
        }
        (false, _) => format!("the template does not fit: {}", fit.reasons.join("; ")),
    }
}

/// A number with its noun: no, 1 and more.
pub(crate) fn counted(n: usize, one: &str, many: &str) -> String {
    match n {
        0 => format!("no {many}"),
        1 => format!("1 {one}"),
        _ => format!("{n} {many}"),
    }
}

/// Returns the number of starts that reached the chosen minimum, in words.
pub(crate) fn starts_found(hits: usize, starts: usize) -> String {
    match (hits, starts) {
        (_, 0) => "no search".to_owned(),
        (1, 1) => "the only start found it".to_owned(),
        (0, 1) => "the only start ended elsewhere".to_owned(),
        (h, s) if h >= s => format!("all {s} starts found it"),
        (0, s) => format!("none of {s} starts found it"),
        (h, s) => format!("{h} of {s} starts found it"),
    }
}

/// The table and what else a reader should know.
pub(crate) fn text(job: &Job) -> String {
    let fit = &job.found.fit;
    let (template, scan) = (&job.template_name, &job.scan);
    let mut text = format!("{template} to {scan}: {}\n\n", verdict(job));
    text += &parameters(job);
    let outliers = counted(fit.n_outliers, "outlier", "outliers");
    let left_out = match fit.n_left_out {
        0 => String::new(),
        n => format!(", {n} left out as clutter"),
    };
    let (used, points) = (fit.n_used, fit.n_points);
    text += &format!("\npoints    {used} of {points} used, {outliers}{left_out}\n");
    text += &deviations(job);
    for open in &fit.undetermined {
        text += &format!("open      {}\n", open.why);
    }
    text + &search(job)
}

/// The table of the parameters but those of the pose, which is a line of its own.
fn parameters(job: &Job) -> String {
    let mut rows = rows(job);
    rows.truncate(job.found.template.frep.model().n_params());
    let head = |is_any: bool, text: &'static str| if is_any { text } else { "" };
    let mm = head(rows.iter().any(|r| !r.mm.is_empty()), "in mm");
    let nominal = head(rows.iter().any(|r| !r.nominal.is_empty()), "nominal");
    let names = ["parameter", "value", "± 95 %", nominal, "status", mm];
    let mut lines = vec![names.map(str::to_owned)];
    lines.extend(rows.into_iter().map(|r| {
        [
            r.name,
            r.value,
            r.error,
            r.nominal,
            r.status.to_owned(),
            r.mm,
        ]
    }));
    let pose = pose(job).map_or(String::new(), |pose| format!("pose      {pose}\n"));
    columns(&lines) + &pose
}

/// Returns the deviations between points and model, in words.
fn deviations(job: &Job) -> String {
    let unit = &job.unit.unit;
    let length = |v: f64| {
        let mm = millimetres(unit)
            .filter(|s| *s != 1.0)
            .map(|s| format!(" ({} mm)", brief(v * s)))
            .unwrap_or_default();
        with_unit(&brief(v), unit) + &mm
    };
    let (data, model) = (&job.found.fit.data_to_model, &job.found.fit.model_to_data);
    let [rms, p95, max] = [data.rms, data.p95, data.max].map(length);
    let text = format!("data to model   rms {rms}, 95 % within {p95}, max {max}\n");
    text + &format!(
        "model to data   95 % within {}, {:.1} % of the surface without data\n",
        length(model.p95),
        100.0 * model.share_uncovered
    )
}

/// Returns the search method and its effort, in words.
fn search(job: &Job) -> String {
    let fit = &job.found.fit;
    let total: f64 = job.seconds.iter().map(|s| s.1).sum();
    format!(
        "search    {} method, {}, {}, seed {}, {} s\n",
        job.method.name(),
        starts_found(fit.hits, fit.starts),
        counted(fit.other_minima.len(), "other minimum", "other minima"),
        job.seed,
        brief(total)
    )
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
            if widths[k] == 0 {
                continue;
            }
            row += &if (1..4).contains(&k) {
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
        // Rounding may make a digit more, and may reach past the point.
        assert_eq!(rounded(4.567_89, 0.0996), "4.57");
        assert_eq!(rounded(4567.8, 123.0), "4570");
        assert_eq!(rounded(-1e-9, 0.013), "0.000");
        assert_eq!(rounded(1.5, f64::NAN), "1.500000");
        assert_eq!(
            (brief(0.000_123_46), brief(1234.5), brief(0.0)),
            ("0.0001235".to_owned(), "1234".to_owned(), "0".to_owned())
        );
        assert_eq!(brief(1.23e-9), "1.230e-9");
    }

    #[test]
    fn counts_read_right() {
        let told = [(0, 0), (1, 1), (0, 1), (8, 8), (0, 8), (1, 8), (3, 8)];
        assert_eq!(
            told.map(|(h, s)| starts_found(h, s)),
            [
                "no search",
                "the only start found it",
                "the only start ended elsewhere",
                "all 8 starts found it",
                "none of 8 starts found it",
                "1 of 8 starts found it",
                "3 of 8 starts found it"
            ]
        );
        let minima = [0, 1, 2].map(|n| counted(n, "other minimum", "other minima"));
        assert_eq!(
            minima,
            ["no other minima", "1 other minimum", "2 other minima"]
        );
    }

    #[test]
    fn two_digits_of_the_half_width() {
        let text = |v: f64, lo: f64, hi: f64| {
            let r = RoundedValue::new(v, Some((lo, hi)), "mm");
            (r.text(), r.interval)
        };
        let told = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(
            text(30.229_41, 30.216_41, 30.242_41),
            told("30.229 ± 0.013 mm", "30.216 to 30.242")
        );
        assert_eq!(
            text(100.0, 98.0, 102.0),
            told("100.0 ± 2.0 mm", "98.0 to 102.0")
        );
        assert_eq!(
            text(5.0, 4.900_4, 5.099_6),
            told("5.00 ± 0.10 mm", "4.90 to 5.10")
        );
        assert_eq!(
            text(4567.8, 4444.8, 4690.8),
            told("4570 ± 120 mm", "4440 to 4690")
        );
        assert_eq!(
            text(1.0, 0.98, 1.08),
            told("1.000 +0.080 −0.020 mm", "0.980 to 1.080")
        );
    }

    #[test]
    fn without_an_interval() {
        let open = RoundedValue::new(12.345_678, None, "mm");
        assert_eq!(
            (open.text().as_str(), open.interval.as_str()),
            ("12.35 mm", "")
        );
        // A width of nought says nothing of the digits.
        assert_eq!(RoundedValue::new(2.0, Some((2.0, 2.0)), "").text(), "2.000");
        assert_eq!(RoundedValue::held(2.5, "mm").text(), "2.5 mm");
        assert_eq!(RoundedValue::held(0.0254 * 1000.0, "mm").text(), "25.4 mm");
        assert_eq!(RoundedValue::held(30.0, "°").text(), "30°");
        assert_eq!(RoundedValue::held(1e-15, "").text(), "1e-15");
    }
}
