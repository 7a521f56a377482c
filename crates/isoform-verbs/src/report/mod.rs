//! The HTML report of a fit: one file that needs nothing else.
//!
//! The page goes from the conclusion to its grounds: the verdict with its evidence, the drawing,
//! the parameters with their intervals, the model to be turned, residuals as a map, a histogram and
//! by part, then, folded, the search itself: convergence, other minima, time, and how to repeat it.
//! Style and pictures are embedded. Lengths are in millimetres where the unit of the scan is known,
//! see [`Lengths`].
//!
//! The script of the page adds buttons to elements with `data-save`, the name of a file: tables are
//! copied and saved as CSV, drawings as SVG. Elements of the class `screen` are not printed.

mod drawing;
pub(crate) mod svg;

use crate::fit::job::Job;
use crate::fit::table::{self, counted, millimetres, rounded, starts_found, with_unit};
use isoform::LiveModel;
use isoform::fit::{ConvergenceStep, Fit, PartStatistics, Template, Verdict};
use isoform::report::brief;
use isoform_view::{Page, ShownPoints};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use svg::escaped;

/// Colours of the phases, from dark to light.
const PHASES: [&str; 8] = [
    "#2166ac", "#4393c3", "#92c5de", "#1b7837", "#7fbf7b", "#b2182b", "#f4a582", "#878787",
];

/// A round number at or above: 1, 2, 5 times a power of ten.
fn round_up(v: f64) -> f64 {
    if !(v > 0.0 && v.is_finite()) {
        return 1.0;
    }
    let power = 10_f64.powf(v.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .iter()
        .map(|m| m * power)
        .find(|c| *c >= v * (1.0 - 1e-12))
        .unwrap_or(v)
}

/// The deviation at which colours end.
pub(crate) fn color_limit(fit: &Fit) -> f64 {
    round_up(fit.data_to_model.p95)
}

/// Lengths as the page shows them: in millimetres where the scan's unit is known, else as they are.
struct Lengths {
    /// Factor from the scan's unit.
    scale: f64,
    /// Unit on the page; empty where it is not known.
    unit: String,
}

impl Lengths {
    /// The scale of a job, by the unit of its scan.
    fn new(job: &Job) -> Self {
        match millimetres(&job.unit.unit) {
            Some(scale) => Self {
                scale,
                unit: "mm".to_owned(),
            },
            None => Self {
                scale: 1.0,
                unit: job.unit.unit.clone(),
            },
        }
    }
    /// A length with its unit.
    fn text(&self, v: f64) -> String {
        with_unit(&brief(v * self.scale), &self.unit)
    }
}

/// The page; without a drawing where the time is up.
pub(crate) fn page(job: &Job, is_late: bool) -> String {
    let lengths = Lengths::new(job);
    let mut html = head(job);
    html += &verdict_box(&verdict(job, &lengths));
    let sheets = (!is_late)
        .then(|| drawing::sheets(job, color_limit(&job.found.fit)))
        .flatten();
    html += &model(sheets.as_ref().map(|s| s[0].as_str()), is_late);
    html += &parameters(job);
    html += &notes(job);
    html += &viewer(job);
    html += &maps(job, &lengths, sheets.as_ref().map(|s| s[1].as_str()));
    html += &deviations(job, &lengths);
    html += &parts(job, &lengths);
    let search = [convergence(job), minima(job), seconds(job), again(job)].concat();
    html +=
        "<details class=\"screen search\"><summary>The search, and how to repeat it</summary>\n";
    html += &search;
    html += "</details>\n</main>\n</body>\n</html>\n";
    html
}

/// The page down to its title and the line below, which names the scan and its unit.
fn head(job: &Job) -> String {
    let info = job.found.template.frep.model().info();
    let title = info
        .title
        .clone()
        .unwrap_or_else(|| job.template_name.clone());
    let unit = if job.unit.unit.is_empty() {
        String::new()
    } else {
        format!(
            ", in {} ({})",
            escaped(in_words(&job.unit.unit)),
            escaped(&job.unit.reason)
        )
    };
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta http-equiv=\"Content-Security-Policy\" content=\"{4}\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{0} fitted to {1}</title>\n<style>\n{2}</style>\n</head>\n<body>\n<main>\n<h1>{0}</h1>\n<p class=\"lead\">fitted to {1}, {3} points{unit}</p>\n",
        escaped(&title),
        escaped(&scan_name(job)),
        include_str!("style.css"),
        job.found.fit.n_points,
        policy(),
    )
}

/// Returns the name of the scan, without its folder.
fn scan_name(job: &Job) -> Cow<'_, str> {
    let name = Path::new(&job.scan).file_name().unwrap_or_default();
    name.to_string_lossy()
}

/// Returns the content policy of the page: run the viewer, and show the page's own data. Drawings
/// have inline styles.
fn policy() -> String {
    let [script, _] = isoform_view::hashes();
    format!(
        "default-src 'none'; script-src {script}; style-src 'unsafe-inline'; img-src data: blob:; \
         base-uri 'none'; form-action 'none'"
    )
}

/// The points with their deviations and the fitted model, to be turned, cut and moved.
fn viewer(job: &Job) -> String {
    let mut page = Page::new(&job.template_name);
    let points = ShownPoints {
        cloud: &job.found.cloud,
        deviation: Some(&job.found.deviation()),
        outliers: &job.found.fit.outliers,
        limit: Some(color_limit(&job.found.fit)),
    };
    page.points(&scan_name(job), &points);
    if let Some(live) = LiveModel::of_fit(&job.found).filter(Page::can_draw) {
        page.model(&job.template_name, None, &live);
    }
    format!(
        "<section class=\"screen\"><h2>Model and points</h2>{}</section>\n",
        page.embedded()
    )
}

/// Units whose symbol is a word of its own.
fn in_words(unit: &str) -> &str {
    match unit {
        "in" => "inches",
        "ft" => "feet",
        unit => unit,
    }
}

/// Verdict with its evidence.
struct Conclusion {
    verdict: Verdict,
    /// One sentence each, the weightiest first.
    evidence: Vec<String>,
}

/// The verdict of the fit, at best doubtful where the search was cut short, and its evidence.
fn verdict(job: &Job, lengths: &Lengths) -> Conclusion {
    let fit = &job.found.fit;
    let least = if fit.complete {
        Verdict::Accepted
    } else {
        Verdict::Doubtful
    };
    let mut evidence = fit.reasons.clone();
    if !fit.complete {
        evidence.push("the search was stopped early; this is the best so far".to_owned());
    }
    evidence.push(format!(
        "the points lie {} off the model (rms); 95 % of them lie within {}",
        lengths.text(fit.rms),
        lengths.text(fit.data_to_model.p95)
    ));
    evidence.push(format!(
        "{:.1} % of the model's surface is without data; {} of {} points are outliers",
        100.0 * fit.model_to_data.share_uncovered,
        fit.n_outliers,
        fit.n_points
    ));
    evidence.push(starts_found(fit.hits, fit.starts));
    evidence.extend(fit.undetermined.iter().map(|o| o.why.to_string()));
    Conclusion {
        verdict: fit.verdict.max(least),
        evidence,
    }
}

/// A text with a capital first, unless it begins with the name of a parameter.
fn capitalized(text: &str) -> String {
    let first = text.split_whitespace().next().unwrap_or_default();
    if first.contains('_') {
        return text.to_owned();
    }
    let mut letters = text.chars();
    let first = letters.next().map(char::to_uppercase);
    first.into_iter().flatten().chain(letters).collect()
}

/// A text as a sentence of the page.
fn sentence(text: &str) -> String {
    escaped(capitalized(text).trim_end_matches('.')) + "."
}

/// The conclusion, in the colour of its verdict.
fn verdict_box(conclusion: &Conclusion) -> String {
    let items: String = conclusion
        .evidence
        .iter()
        .map(|e| format!("<li>{}</li>", sentence(e)))
        .collect();
    format!(
        "<section class=\"verdict {}\"><b>{}</b><ul>{items}</ul></section>\n",
        conclusion.verdict.as_str(),
        capitalized(conclusion.verdict.as_str())
    )
}

/// The drawing, or why there is none.
fn model(sheet: Option<&str>, is_late: bool) -> String {
    let sheet = sheet.unwrap_or(if is_late {
        "<p>The time limit left no time to draw the model.</p>"
    } else {
        "<p>The model has no surface near the points.</p>"
    });
    format!(
        "<section class=\"drawing\" data-save=\"drawing.svg\"><h2>The fitted model</h2>{sheet}</section>\n"
    )
}

/// The tables of parameters: those of the template, and the pose, which is folded where the points
/// determine it.
fn parameters(job: &Job) -> String {
    let rows = table::rows(job);
    let n = job.found.template.frep.model().n_params();
    let (own, pose) = rows.split_at(n);
    let mut of_pose = job.found.fit.parameters[n..].iter();
    let is_open = of_pose.any(|p| p.status == isoform::fit::Status::Undetermined);
    let open = if is_open { " open" } else { "" };
    let folded = table::pose(job).map_or(String::new(), |place| {
        let summary = escaped(&capitalized(&place));
        let rows = parameter_rows(job, pose);
        format!("<details{open}><summary>Pose in the scan: {summary}</summary>{rows}</details>")
    });
    let rows = parameter_rows(job, own);
    let csv = escaped(&csv(job));
    format!(
        "<section data-save=\"parameters.csv\" data-csv=\"{csv}\"><h2>Parameters</h2>{rows}{folded}</section>\n"
    )
}

/// All parameters with all of their digits, for spreadsheets: lengths in the scan's unit, angles in
/// radians.
fn csv(job: &Job) -> String {
    let mut text = String::from("parameter,value,unit,low,high,status\n");
    for (i, p) in job.found.fit.parameters.iter().enumerate() {
        let shift = job.found.template.shift[i];
        let ends = p
            .ci95
            .map_or([String::new(), String::new()], |(low, high)| {
                [low, high].map(|v| format!("{}", v + shift))
            });
        let unit = job.unit_of(i).unwrap_or_default();
        let name = match p.name.contains([',', '"']) {
            true => format!("\"{}\"", p.name.replace('"', "\"\"")),
            false => p.name.clone(),
        };
        let (value, [low, high]) = (p.value + shift, ends);
        let _ = writeln!(
            text,
            "{name},{value},{unit},{low},{high},{}",
            p.status.as_str()
        );
    }
    text
}

/// A table of parameters; millimetres have a column of their own where the scan has another unit.
fn parameter_rows(job: &Job, rows: &[table::ParameterRow]) -> String {
    let infos = job.found.template.frep.model().params();
    let has_mm = rows.iter().any(|r| !r.mm.is_empty());
    let has_nominal = rows.iter().any(|r| !r.nominal.is_empty());
    let mut html = String::from(
        "<div class=\"wide\"><table><tr><th>parameter</th><th class=\"n\">value</th>\
         <th class=\"n\">± 95 %</th>",
    );
    if has_nominal {
        html += "<th class=\"n\">nominal</th>";
    }
    html += "<th class=\"n\">95 % interval</th>";
    if has_mm {
        html += "<th class=\"n\">in mm</th>";
    }
    html += "<th>status</th><th class=\"b\">bounds</th>";
    html += "</tr>\n";
    for r in rows {
        let info = infos.iter().find(|p| p.name == r.name);
        let text = info.map_or("", |p| p.description.as_str());
        let _ = write!(
            html,
            "<tr class=\"{}\"><td><b>{}</b><small>{}</small></td><td class=\"n\">{}</td>\
             <td class=\"n\">{}</td>",
            r.status,
            escaped(&r.name),
            escaped(text),
            escaped(&r.value),
            r.error,
        );
        if has_nominal {
            let _ = write!(html, "<td class=\"n\">{}</td>", r.nominal);
        }
        let _ = write!(html, "<td class=\"n\">{}</td>", r.interval);
        if has_mm {
            let _ = write!(html, "<td class=\"n\">{}</td>", r.mm);
        }
        let _ = write!(
            html,
            "<td><span class=\"status {0}\">{0}</span></td><td class=\"b\">{1}</td>",
            r.status, r.bounds
        );
        html += "</tr>\n";
    }
    html + "</table></div>"
}

/// Returns the notes on open questions, omitted points and risks.
fn notes(job: &Job) -> String {
    let fit = &job.found.fit;
    let mut items: Vec<String> = fit.undetermined.iter().map(|o| o.why.to_string()).collect();
    items.extend(job.warnings.iter().cloned());
    let mut dropped = format!("{} of {} points were used", fit.n_used, fit.n_points);
    if job.read.dropped_points > 0 {
        let _ = write!(
            dropped,
            "; {} of the file's {} points are not finite and were left out",
            job.read.dropped_points, job.read.rows
        );
    }
    if job.read.subsampled {
        let _ = write!(
            dropped,
            "; the file's {} points were subsampled",
            job.read.rows
        );
    }
    items.push(dropped);
    let items: String = items
        .iter()
        .map(|t| format!("<li>{}</li>", escaped(t)))
        .collect();
    format!("<section><h2>What to know</h2><ul>{items}</ul></section>\n")
}

/// The deviation map with its bar of colours; nothing without a drawing.
fn maps(job: &Job, lengths: &Lengths, sheet: Option<&str>) -> String {
    let Some(sheet) = sheet else {
        return String::new();
    };
    let limit = color_limit(&job.found.fit);
    let note = if job.found.fit.n_outliers > 0 {
        " Outliers are dark grey."
    } else {
        ""
    };
    format!(
        "<section class=\"drawing maps\" data-save=\"deviation.svg\"><h2>Deviation map</h2>{sheet}{}\
         <p class=\"lead\" style=\"margin:6px 0 0\">Signed distance of the points from the model: red lies outside, blue inside. \
         Points that a part of the model or a nearer point hides are not drawn.{note}</p></section>\n",
        svg::color_bar(limit * lengths.scale, &lengths.unit)
    )
}

/// Returns the finite deviations of the points that are not outliers.
fn used_deviations(job: &Job, scale: f64) -> Vec<f64> {
    job.found
        .deviation()
        .iter()
        .zip(&job.found.fit.outliers)
        .filter(|(d, out)| !**out && d.is_finite())
        .map(|(d, _)| d * scale)
        .collect()
}

/// Returns the histogram of residuals with the table of distances both ways. The axis ends at the
/// larger of 1.4 times the 95 % quantile and three deviations of the noise, rounded up.
fn deviations(job: &Job, lengths: &Lengths) -> String {
    let fit = &job.found.fit;
    let used = used_deviations(job, lengths.scale);
    let limit = round_up((1.4 * fit.data_to_model.p95).max(3.0 * fit.noise)) * lengths.scale;
    let limit = if limit > 0.0 { limit } else { 1.0 };
    let beyond = used.iter().filter(|v| v.abs() > limit).count();
    let (d, m) = (&fit.data_to_model, &fit.model_to_data);
    let far = match beyond {
        0 => String::new(),
        1 => " 1 point lies beyond the axis.".to_owned(),
        n => format!(" {n} points lie beyond the axis."),
    };
    format!(
        "<section class=\"two\"><div><h2>Residuals</h2>{}<p class=\"lead\" style=\"margin:4px 0 0\">The curve is the normal law of the noise, {}.{far}</p></div>\
         <div><h2>Two-sided deviation</h2><table><tr><th></th><th class=\"n\">rms</th><th class=\"n\">95 % within</th><th class=\"n\">max</th></tr>\
         <tr><td>points to model</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>\
         <tr><td>model to points</td><td class=\"n\"></td><td class=\"n\">{}</td><td class=\"n\"></td></tr></table>\
         <p style=\"margin-top:12px\">{:.1} % of the model's surface has no point within {} ({} samples).</p></div></section>\n",
        svg::histogram(&used, fit.noise * lengths.scale, limit, &lengths.unit),
        lengths.text(fit.noise),
        lengths.text(d.rms),
        lengths.text(d.p95),
        lengths.text(d.max),
        lengths.text(m.p95),
        100.0 * m.share_uncovered,
        lengths.text(m.uncovered_from),
        m.samples
    )
}

/// The table of parts; what has neither points nor surface near them stands below it.
fn parts(job: &Job, lengths: &Lengths) -> String {
    let stats = &job.found.fit.part_statistics;
    let worst = stats
        .iter()
        .map(|s| s.rms)
        .fold(f64::MIN_POSITIVE, f64::max);
    let digits = |v: f64| {
        with_unit(
            &rounded(v * lengths.scale, 0.05 * worst * lengths.scale),
            &lengths.unit,
        )
    };
    let mut html = String::from(
        "<section data-save=\"parts.csv\"><h2>By part of the model</h2><div class=\"wide\"><table><tr><th>part</th><th class=\"n\">points</th><th class=\"n\">rms</th>\
         <th style=\"width:28%\"></th><th class=\"n\">mean</th><th class=\"n\">max</th><th class=\"n\">without data</th></tr>\n",
    );
    let silent = |s: &&PartStatistics| s.count == 0 && s.uncovered.is_none();
    for s in stats.iter().filter(|s| !silent(s)) {
        html += &part_row(s, worst, digits);
    }
    html += "</table></div>";
    let left_out: Vec<&str> = stats
        .iter()
        .filter(silent)
        .map(|s| s.name.as_str())
        .collect();
    if !left_out.is_empty() {
        let _ = write!(
            html,
            "<p class=\"lead\" style=\"margin:8px 0 0\">Neither points nor surface near them: {}.</p>",
            escaped(&left_out.join(", "))
        );
    }
    html + "</section>\n"
}

/// A row of the table of parts; its bar is full for the worst rms.
fn part_row(s: &PartStatistics, worst: f64, digits: impl Fn(f64) -> String) -> String {
    let (rms, mean, max) = match s.count {
        0 => Default::default(),
        _ => (digits(s.rms), digits(0.0 - s.mean), digits(s.max)),
    };
    let uncovered = s.uncovered.map(|u| format!("{:.1} %", 100.0 * u));
    format!(
        "<tr><td><b>{}</b></td><td class=\"n\">{}</td><td class=\"n\">{rms}</td><td><div class=\"bar\"><i style=\"width:{:.1}%\"></i></div></td>\
         <td class=\"n\">{mean}</td><td class=\"n\">{max}</td><td class=\"n\">{}</td></tr>\n",
        escaped(&s.name),
        s.count,
        100.0 * s.rms / worst,
        uncovered.unwrap_or_default()
    )
}

/// The steps of each run, by its start.
type Runs<'s> = BTreeMap<usize, Vec<&'s ConvergenceStep>>;

/// The runs of the search, and the polish, which is the last one where there was a search.
fn runs(fit: &Fit) -> (Runs<'_>, Runs<'_>) {
    let mut runs = Runs::new();
    for step in &fit.history {
        runs.entry(step.start).or_default().push(step);
    }
    let is_searched = fit.starts > 1 || runs.len() > 1;
    let polish = if is_searched { runs.pop_last() } else { None };
    (runs, polish.into_iter().collect())
}

/// The search and the polish, each as a plot of root mean squares over steps.
fn convergence(job: &Job) -> String {
    let fit = &job.found.fit;
    let (runs, polish) = runs(fit);
    let last = |run: &[&ConvergenceStep]| run.last().map_or(f64::INFINITY, |s| s.rms);
    let best = runs
        .iter()
        .min_by(|a, b| last(a.1).total_cmp(&last(b.1)))
        .map(|r| *r.0);
    let search = svg::convergence("Convergence of the search", &runs, best, "rms of f");
    let mut html = format!(
        "<section><h2>Convergence</h2><div class=\"two\"><div><h3>search, the model's own function, {}</h3>{search}</div>",
        counted(fit.starts, "start", "starts")
    );
    if let Some((k, _)) = polish.first_key_value() {
        let unit = if job.unit.unit.is_empty() {
            "rms distance".to_owned()
        } else {
            format!("rms distance in {}", job.unit.unit)
        };
        let _ = write!(
            html,
            "<div><h3>polish, distance to the surface</h3>{}</div>",
            svg::convergence("Convergence of the polish", &polish, Some(*k), &unit)
        );
    }
    let _ = writeln!(
        html,
        "</div><p>{}</p></section>",
        sentence(&starts_found(fit.hits, fit.starts))
    );
    html
}

/// The other minima that starts led to, with their parameters; nothing where there is none.
fn minima(job: &Job) -> String {
    let fit = &job.found.fit;
    if fit.other_minima.is_empty() {
        return String::new();
    }
    let names = job
        .found
        .template
        .parameters()
        .iter()
        .map(|p| format!("<th class=\"n\">{}</th>", escaped(&p.name)))
        .collect::<String>();
    let row = |what: &str, sum: f64, hits: usize, values: &[f64]| {
        let cells: String = values
            .iter()
            .map(|v| format!("<td class=\"n\">{}</td>", brief(*v)))
            .collect();
        format!(
            "<tr><td>{what}</td><td class=\"n\">{}</td><td class=\"n\">{hits}</td>{cells}</tr>",
            brief(sum / fit.sum_f2)
        )
    };
    let mut rows = row("<b>chosen</b>", fit.sum_f2, fit.hits, &job.found.values());
    for m in &fit.other_minima {
        let values: Vec<f64> = m
            .parameters
            .iter()
            .zip(&job.found.template.shift)
            .map(|(v, s)| v + s)
            .collect();
        rows += &row("other", m.sum_f2, m.hits, &values);
    }
    format!(
        "<section><h2>Other minima</h2><div class=\"wide\"><table><tr><th></th><th class=\"n\">sum f² / chosen</th><th class=\"n\">starts</th>{names}</tr>{rows}</table></div></section>\n"
    )
}

/// The time of each phase, as a stacked bar with its key.
fn seconds(job: &Job) -> String {
    let total: f64 = job.seconds.iter().map(|s| s.1).sum();
    let (mut bar, mut key) = (String::new(), String::new());
    for (k, (phase, s)) in job.seconds.iter().enumerate() {
        let color = PHASES[k % PHASES.len()];
        let _ = write!(
            bar,
            "<i style=\"width:{:.2}%;background:{color}\"></i>",
            100.0 * s / total.max(f64::MIN_POSITIVE)
        );
        let _ = write!(
            key,
            "<span style=\"--c:{color}\">{phase} {} s</span>",
            rounded(*s, 0.01 * total)
        );
    }
    format!(
        "<section><h2>Time</h2><div class=\"stack\">{bar}</div><div class=\"key\">{key}</div></section>\n"
    )
}

/// Whatever repeats the fit: method, loss, seed, command line, and the fitted program.
fn again(job: &Job) -> String {
    let command: Vec<String> = std::env::args()
        .map(|a| if a.contains(' ') { format!("'{a}'") } else { a })
        .collect();
    format!(
        "<section><h2>To do it again</h2><p>Method {}, loss {}, seed {}, isoform {}. The result does not depend on the number of threads.</p><pre>{}</pre>\
         <details><summary>The fitted model, HyperFun</summary><pre>{}</pre></details></section>\n",
        job.method.name(),
        job.found.fit.loss.name(),
        job.seed,
        env!("CARGO_PKG_VERSION"),
        escaped(&command.join(" ")),
        escaped(&job.program())
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers() {
        assert_eq!(
            [0.3, 1.0, 2.1, 70.0, 0.0].map(round_up),
            [0.5, 1.0, 5.0, 100.0, 1.0]
        );
    }
}
