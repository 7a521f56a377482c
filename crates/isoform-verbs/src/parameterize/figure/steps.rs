//! The terms of the objective over the steps, on a logarithmic axis.

use super::PlotFrame;
use isoform::patch::{Phase, Row};
use std::fmt::Write;

/// The place of the graph in the picture.
const FRAME: PlotFrame = PlotFrame {
    left: 72.0,
    right: 500.0,
    top: 40.0,
    bottom: 370.0,
};
/// The most decades below the largest value that the axis shows; smaller values are drawn on its
/// lower end.
const DECADES: f64 = 10.0;

/// One term over all steps.
struct PlotLine {
    /// Name of the term, and of its class in the style.
    name: &'static str,
    /// Value of the term at each step.
    values: Vec<f64>,
}

/// Draws one line each for S, I and E, and a plus above each extrapolation.
pub(super) fn draw(svg: &mut String, trace: &[Row]) {
    let PlotFrame { left, top, .. } = FRAME;
    let _ = writeln!(
        svg,
        "<text class=\"title\" x=\"{left}\" y=\"22\">Terms of the objective over the steps</text>"
    );
    let lines = lines(trace);
    let most = largest(&lines);
    if most <= 0.0 || trace.len() < 2 {
        let _ = writeln!(
            svg,
            "<text x=\"{left}\" y=\"{}\">no steps were made</text>",
            top + 20.0
        );
        return;
    }
    let axes = Axes {
        decades: decades(&lines, most),
        steps: trace.len(),
    };
    axes.draw_decades(svg);
    axes.draw_numbers(svg);
    axes.draw_extrapolations(svg, trace);
    for (k, line) in lines.iter().enumerate() {
        axes.draw_line(svg, line);
        name_line(svg, line, k);
    }
    name_signs(svg);
}

/// The terms that are drawn, step by step.
fn lines(trace: &[Row]) -> [PlotLine; 3] {
    let line = |name, term: fn(&Row) -> f64| PlotLine {
        name,
        values: trace.iter().map(term).collect(),
    };
    [
        line("S", |r| r.sum),
        line("I", |r| r.terms.i),
        line("E", |r| r.terms.e),
    ]
}

/// All values of all lines.
fn values(lines: &[PlotLine]) -> impl Iterator<Item = f64> {
    lines.iter().flat_map(|l| &l.values).copied()
}

/// The largest value; 0 without steps.
fn largest(lines: &[PlotLine]) -> f64 {
    values(lines).fold(0.0, f64::max)
}

/// The decimal logarithms, whole numbers, of both ends of the axis.
fn decades(lines: &[PlotLine], most: f64) -> [f64; 2] {
    let hi = most.log10().ceil();
    let least = values(lines).filter(|v| *v > 0.0).fold(most, f64::min);
    let lo = least.log10().floor().max(hi - DECADES).min(hi - 1.0);
    [lo, hi]
}

/// Both axes: decades upwards, steps to the right.
struct Axes {
    /// The decimal logarithms of the lower and of the upper end.
    decades: [f64; 2],
    /// The number of steps.
    steps: usize,
}

impl Axes {
    /// The place of a step.
    fn x(&self, step: usize) -> f64 {
        FRAME.left + (FRAME.right - FRAME.left) * step as f64 / (self.steps - 1) as f64
    }
    /// The place of a value; values below the axis lie on its end.
    fn y(&self, value: f64) -> f64 {
        let [lo, hi] = self.decades;
        let share = (value.max(f64::MIN_POSITIVE).log10() - lo) / (hi - lo);
        FRAME.bottom - (FRAME.bottom - FRAME.top) * share.max(0.0)
    }

    /// Draws a line for each power of ten, for every other one where there are more than six.
    fn draw_decades(&self, svg: &mut String) {
        let PlotFrame { left, right, .. } = FRAME;
        let [lo, hi] = self.decades;
        let every = if hi - lo > 6.0 { 2 } else { 1 };
        for decade in (lo as i32..=hi as i32).rev().step_by(every) {
            let at = self.y(10f64.powi(decade));
            let _ = writeln!(svg, "<path class=\"axis\" d=\"M{left} {at:.1}H{right}\"/>");
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">1e{decade}</text>",
                left - 7.0,
                at + 4.0
            );
        }
    }

    /// Writes the numbers of some steps below the axis.
    fn draw_numbers(&self, svg: &mut String) {
        for k in (0..self.steps).step_by(pause(self.steps)) {
            let _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{k}</text>",
                self.x(k),
                FRAME.bottom + 18.0
            );
        }
    }

    /// Draws a plus above each step that extrapolates.
    fn draw_extrapolations(&self, svg: &mut String, trace: &[Row]) {
        let steps = trace.iter().enumerate();
        for (k, _) in steps.filter(|(_, r)| r.phase == Phase::Grow) {
            let _ = writeln!(
                svg,
                "<path class=\"grow\" d=\"M{:.1} {}h7m-3.5 -3.5v7\"/>",
                self.x(k) - 3.5,
                FRAME.top - 6.0
            );
        }
    }

    /// Draws a term over all steps.
    fn draw_line(&self, svg: &mut String, PlotLine { name, values }: &PlotLine) {
        let steps = values.iter().enumerate();
        let points: Vec<String> = steps
            .map(|(k, v)| format!("{:.1},{:.1}", self.x(k), self.y(*v)))
            .collect();
        let _ = writeln!(
            svg,
            "<polyline class=\"line {name}\" points=\"{}\"/>",
            points.join(" ")
        );
    }
}

/// The number of steps between two numbers below the axis: 1, 2 or 5 times a power of ten, with
/// at most some six numbers in all.
fn pause(steps: usize) -> usize {
    let rough = (steps as f64 / 6.0).max(1.0);
    let unit = 10f64.powf(rough.log10().floor());
    let round = [1.0, 2.0, 5.0, 10.0].map(|f| f * unit);
    let pause = round.into_iter().find(|s| *s >= rough).unwrap_or(rough);
    (pause as usize).max(1)
}

/// Writes the legend of the line number `k`.
fn name_line(svg: &mut String, PlotLine { name, .. }: &PlotLine, k: usize) {
    let bottom = FRAME.bottom;
    let at = FRAME.left + 40.0 * k as f64;
    let _ = writeln!(
        svg,
        "<path class=\"line {name}\" d=\"M{at} {}h16\"/>",
        bottom + 40.0
    );
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\">{name}</text>",
        at + 20.0,
        bottom + 44.0
    );
}

/// Writes the legend of the plus signs, and the name of the horizontal axis.
fn name_signs(svg: &mut String) {
    let PlotFrame { right, bottom, .. } = FRAME;
    let at = FRAME.left + 140.0;
    let _ = writeln!(
        svg,
        "<path class=\"grow\" d=\"M{at} {}h7m-3.5 -3.5v7\"/>",
        bottom + 40.0
    );
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\">extrapolation</text>",
        at + 13.0,
        bottom + 44.0
    );
    let _ = writeln!(
        svg,
        "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">step</text>",
        bottom + 44.0
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_numbered_at_round_numbers() {
        assert_eq!(
            [2, 6, 7, 12, 13, 30, 31, 60].map(pause),
            [1, 1, 2, 2, 5, 5, 10, 10]
        );
    }

    #[test]
    fn the_axis_holds_whole_decades() {
        let of = |values: &[f64]| {
            let values = values.to_vec();
            let lines = [PlotLine { name: "S", values }];
            decades(&lines, largest(&lines))
        };
        assert_eq!(of(&[0.02, 3.0]), [-2.0, 1.0]);
        // One decade at least, ten at most, and nothing of zeros.
        assert_eq!(of(&[1.0]), [-1.0, 0.0]);
        assert_eq!(of(&[1.0, 1e-30, 0.0]), [-10.0, 0.0]);
    }
}
