//! The plots: plain SVG, coloured by the page's style.
//!
//! A plot is drawn on [`Scale`]s, which take values to pixels; helpers append elements to a text.

use isoform::fit::ConvergenceStep;
use isoform::io::deviation_colors;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Width of a plot in pixels.
const WIDTH: f64 = 460.0;
/// Height of a plot in pixels.
const HEIGHT: f64 = 230.0;
/// Room for labels: left, right, top, bottom.
const MARGIN: [f64; 4] = [58.0, 12.0, 10.0, 36.0];
/// Colours of a deviation map; more cannot be told apart.
const SHADES: usize = 21;

/// Text that is safe between tags and in attributes.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A linear axis over a span of pixels.
#[derive(Clone, Copy)]
struct Scale {
    /// Pixel of `lo`.
    from: f64,
    /// Pixel of `hi`.
    to: f64,
    /// Value at the beginning of the axis.
    lo: f64,
    /// Value at its end.
    hi: f64,
}

impl Scale {
    /// The axis along the bottom.
    fn horizontal(lo: f64, hi: f64) -> Self {
        Self {
            from: MARGIN[0],
            to: WIDTH - MARGIN[1],
            lo,
            hi,
        }
    }
    /// The axis up the left side; pixels grow downwards.
    fn vertical(lo: f64, hi: f64) -> Self {
        Self {
            from: HEIGHT - MARGIN[3],
            to: MARGIN[2],
            lo,
            hi,
        }
    }
    /// The pixel of a value; the middle of an axis without length.
    fn at(&self, v: f64) -> f64 {
        let share = if self.hi > self.lo {
            (v - self.lo) / (self.hi - self.lo)
        } else {
            0.5
        };
        self.from + (self.to - self.from) * share
    }
    /// Round numbers within the axis, some five of them.
    fn ticks(&self) -> Vec<f64> {
        let rough = (self.hi - self.lo) / 5.0;
        if !(rough > 0.0 && rough.is_finite()) {
            return vec![self.lo];
        }
        let step = super::round_up(rough);
        let first = (self.lo / step).ceil() as i64;
        let last = (self.hi / step + 1e-9).floor() as i64;
        (first..=last.min(first + 20))
            .map(|k| k as f64 * step)
            .collect()
    }
}

/// A number for an axis whose ticks lie so far apart.
fn label(v: f64, step: f64) -> String {
    if v == 0.0 {
        return "0".to_owned();
    }
    if v.abs() >= 1e6 || step < 1e-5 {
        return format!("{v:.1e}");
    }
    let decimals = (-step.log10().floor()).clamp(0.0, 8.0) as usize;
    format!("{v:.decimals$}")
}

/// A plot around its elements, with a title for readers of the screen.
fn frame(title: &str, body: &str) -> String {
    format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">{body}</svg>",
        escaped(title)
    )
}

/// Draws the axis along the bottom with its numbers and its name.
fn x_axis(svg: &mut String, x: Scale, name: &str) {
    let bottom = HEIGHT - MARGIN[3];
    let _ = write!(
        svg,
        "<line class=\"axis\" x1=\"{}\" x2=\"{}\" y1=\"{bottom}\" y2=\"{bottom}\"/>",
        x.from, x.to
    );
    let ticks = x.ticks();
    let step = ticks.get(1).map_or(1.0, |t| t - ticks[0]);
    for t in ticks {
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            x.at(t),
            bottom + 15.0,
            label(t, step)
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
        0.5 * (x.from + x.to),
        HEIGHT - 4.0,
        escaped(name)
    );
}

/// A horizontal line across the frame with its name on the left.
fn mark(svg: &mut String, x: Scale, at: f64, text: &str) {
    let _ = write!(
        svg,
        "<line class=\"axis\" x1=\"{}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>",
        x.from, x.to
    );
    let _ = write!(
        svg,
        "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
        MARGIN[0] - 6.0,
        at + 4.0
    );
}

/// The decimal logarithm, finite for zero too.
fn log(v: f64) -> f64 {
    v.max(1e-300).log10()
}

/// Root mean squares over steps, one line per run, the vertical axis logarithmic; the run `best` is
/// drawn strong.
pub(crate) fn convergence(
    title: &str,
    runs: &BTreeMap<usize, Vec<&ConvergenceStep>>,
    best: Option<usize>,
    unit: &str,
) -> String {
    let Some((lo, hi)) = log_span(runs) else {
        return String::new();
    };
    // Steps count from the first of their run; the stages of a polish each count anew.
    let steps = runs.values().map(|r| r.len().saturating_sub(1));
    let most = steps.max().unwrap_or(1).max(1);
    let axes = LogAxes {
        x: Scale::horizontal(0.0, most as f64),
        y: Scale::vertical(lo - 0.05, hi + 0.05),
    };
    let mut svg = String::new();
    x_axis(&mut svg, axes.x, "step");
    for (v, text) in log_marks(lo, hi) {
        mark(&mut svg, axes.x, axes.y.at(v), &text);
    }
    for (_, run) in runs.iter().filter(|(k, _)| Some(**k) != best) {
        axes.draw(&mut svg, run, "run");
    }
    if let Some(run) = best.and_then(|k| runs.get(&k)) {
        axes.draw(&mut svg, run, "best");
    }
    let _ = write!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
        WIDTH - MARGIN[1],
        MARGIN[2] + 8.0,
        escaped(unit)
    );
    frame(title, &svg)
}

/// The decades over which the axis of a convergence goes at most: runs on data without noise end in
/// rounding, and its scatter is not worth the paper.
const DECADES: f64 = 14.0;

/// The logarithms between which the root mean squares lie; none if there is none above zero.
fn log_span(runs: &BTreeMap<usize, Vec<&ConvergenceStep>>) -> Option<(f64, f64)> {
    let steps = runs.values().flatten();
    let logs = steps
        .filter(|s| s.rms > 0.0 && s.rms.is_finite())
        .map(|s| log(s.rms));
    let (lo, hi) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(v), h.max(v))
    });
    let top = if hi - lo < 0.2 { lo + 0.2 } else { hi };
    (lo <= hi).then_some((lo.max(hi - DECADES), top))
}

/// The places of marks on a logarithmic axis with their names: some six powers of ten, or four
/// values at equal distances where fewer than two such powers lie on the axis.
fn log_marks(lo: f64, hi: f64) -> Vec<(f64, String)> {
    let whole = (lo.ceil() as i32)..=(hi.floor() as i32);
    let every = (whole.clone().count() / 6 + 1) as i32;
    let powers: Vec<(f64, String)> = whole
        .filter(|k| k % every == 0)
        .map(|k| (f64::from(k), format!("{:e}", 10_f64.powi(k))))
        .collect();
    if powers.len() >= 2 {
        return powers;
    }
    (0..4)
        .map(|k| lo + (hi - lo) * f64::from(k) / 3.0)
        .map(|v| (v, format!("{:.2e}", 10_f64.powf(v))))
        .collect()
}

/// The axes of a convergence: steps to the right, logarithms upwards.
struct LogAxes {
    x: Scale,
    y: Scale,
}

impl LogAxes {
    /// Draws one run: a line, or a dot if it has one step.
    fn draw(&self, svg: &mut String, run: &[&ConvergenceStep], class: &str) {
        let steps = run.iter().enumerate();
        let points: Vec<String> = steps
            .filter(|(_, s)| s.rms.is_finite())
            .map(|(k, s)| self.point(k, s.rms))
            .collect();
        let _ = write!(
            svg,
            "<polyline class=\"{class}\" points=\"{}\"/>",
            points.join(" ")
        );
        if let [only] = &points[..]
            && let Some((x, y)) = only.split_once(',')
        {
            let _ = write!(
                svg,
                "<circle class=\"column\" cx=\"{x}\" cy=\"{y}\" r=\"3\"/>"
            );
        }
    }
    /// The place of a step; values beyond the axis lie on its ends.
    fn point(&self, step: usize, rms: f64) -> String {
        let level = log(rms).clamp(self.y.lo, self.y.hi);
        format!("{:.1},{:.1}", self.x.at(step as f64), self.y.at(level))
    }
}

/// Columns of a histogram.
const COLUMNS: usize = 60;

/// The number of deviations in each column of the span from −limit to limit.
fn counts(values: &[f64], limit: f64) -> [usize; COLUMNS] {
    let mut counts = [0; COLUMNS];
    for v in values.iter().filter(|v| v.abs() <= limit) {
        let column = ((v + limit) / (2.0 * limit)) * COLUMNS as f64;
        counts[column.min(COLUMNS as f64 - 1.0) as usize] += 1;
    }
    counts
}

/// Draws the histogram of deviations with the normal density of the noise.
pub(crate) fn histogram(values: &[f64], noise: f64, limit: f64, unit: &str) -> String {
    let counts = counts(values, limit);
    let width = 2.0 * limit / COLUMNS as f64;
    let normal = |v: f64| {
        values.len() as f64 * width / (noise * std::f64::consts::TAU.sqrt())
            * (-0.5 * (v / noise).powi(2)).exp()
    };
    // A narrower curve would be a line upwards.
    let has_curve = noise > 0.02 * limit;
    let most = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let top = if has_curve {
        most.max(normal(0.0))
    } else {
        most
    };
    let (x, y) = (
        Scale::horizontal(-limit, limit),
        Scale::vertical(0.0, 1.05 * top),
    );
    let mut svg = String::new();
    for t in y.ticks() {
        mark(&mut svg, x, y.at(t), &label(t, 1.0));
    }
    columns(&mut svg, &counts, x, y);
    if has_curve {
        curve(&mut svg, normal, x, y);
    }
    let _ = write!(
        svg,
        "<line class=\"zero\" x1=\"{0:.1}\" x2=\"{0:.1}\" y1=\"{1}\" y2=\"{2}\"/>",
        x.at(0.0),
        y.from,
        y.to
    );
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" in {unit}")
    };
    x_axis(&mut svg, x, &format!("deviation{unit}, outside positive"));
    frame("Histogram of deviations", &svg)
}

/// Draws a function over an axis that is symmetric about 0, in 120 steps.
fn curve(svg: &mut String, f: impl Fn(f64) -> f64, x: Scale, y: Scale) {
    let limit = x.hi;
    let points: Vec<String> = (0..=120)
        .map(|k| -limit + 2.0 * limit * f64::from(k) / 120.0)
        .map(|v| format!("{:.1},{:.1}", x.at(v), y.at(f(v))))
        .collect();
    let _ = write!(
        svg,
        "<polyline class=\"curve\" points=\"{}\"/>",
        points.join(" ")
    );
}

/// Draws the columns of a histogram.
fn columns(svg: &mut String, counts: &[usize; COLUMNS], x: Scale, y: Scale) {
    let width = (x.hi - x.lo) / COLUMNS as f64;
    for (k, count) in counts.iter().enumerate().filter(|(_, c)| **c > 0) {
        let from = x.at(x.lo + k as f64 * width);
        let at = y.at(*count as f64);
        let _ = write!(
            svg,
            "<rect class=\"column\" x=\"{:.1}\" y=\"{at:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
            from + 0.4,
            (x.to - x.from) / COLUMNS as f64 - 0.8,
            y.from - at
        );
    }
}

/// The bar of colours from −limit to +limit.
pub(crate) fn color_bar(limit: f64, unit: &str) -> String {
    /// Width of the bar and its labels in pixels.
    const W: f64 = 460.0;
    let stops: Vec<f64> = (0..SHADES)
        .map(|k| limit * (2.0 * k as f64 / (SHADES - 1) as f64 - 1.0))
        .collect();
    let mut svg = String::from("<defs><linearGradient id=\"rdbu\">");
    for (k, [r, g, b]) in deviation_colors(&stops, limit).into_iter().enumerate() {
        let _ = write!(
            svg,
            "<stop offset=\"{:.3}\" stop-color=\"#{r:02x}{g:02x}{b:02x}\"/>",
            k as f64 / (SHADES - 1) as f64
        );
    }
    let _ = write!(
        svg,
        "</linearGradient></defs><rect x=\"40\" y=\"2\" width=\"{}\" height=\"11\" rx=\"3\" fill=\"url(#rdbu)\"/>",
        W - 80.0
    );
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    for share in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        let sign = if share > 0.0 { "+" } else { "" };
        let at = 40.0 + (W - 80.0) * (0.5 + 0.5 * share);
        let text = if share == 0.0 {
            "0".to_owned()
        } else {
            format!("{sign}{}{unit}", share * limit)
        };
        let _ = write!(
            svg,
            "<text x=\"{at}\" y=\"28\" text-anchor=\"middle\">{text}</text>"
        );
    }
    format!(
        "<svg viewBox=\"0 0 {W} 32\" style=\"max-width:{W}px;margin-top:10px\" role=\"img\" aria-label=\"colours of deviations\">{svg}</svg>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run without a finite step is drawn as an empty line.
    #[test]
    fn a_run_that_is_nowhere_finite_is_drawn() {
        let step = |start, iteration, rms| ConvergenceStep {
            start,
            iteration,
            rms,
        };
        let (nan, first, second) = (step(0, 0, f64::NAN), step(1, 0, 1.0), step(1, 1, 1e-3));
        let runs = BTreeMap::from([(0, vec![&nan]), (1, vec![&first, &second])]);
        let svg = convergence("rms", &runs, Some(1), "mm");
        assert_eq!(svg.matches("<polyline").count(), 2);
    }
}
