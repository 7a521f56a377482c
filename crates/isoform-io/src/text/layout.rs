//! Roles of the columns of a table: by their names, or by the values of the first rows.
//!
//! Names are those of [`interpret_names`]. Values distinguish colours (integers from 0 to 255),
//! normals (triples of length 1) and row numbers from other columns. This is a guess, which the
//! report states.

use super::names::{InterpretedNames, are_angles, interpret_names};
use crate::ReadReport;
use crate::input::shorten;
use crate::roles::RowLayout;

/// Minimum number of rows to detect a column of row numbers: three equal steps, which two
/// coordinates lack.
const MIN_COUNTED_ROWS: usize = 4;

/// Returns the layout of columns whose names include the coordinates, and their unit; `None` if
/// they do not.
pub(super) fn by_names(
    names: &[String],
    report: &mut ReadReport,
) -> Option<(RowLayout, Option<String>)> {
    let InterpretedNames { names, units } = interpret_names(names)?;
    let unit = match units[..] {
        [] => None,
        [unit] => Some(unit.to_owned()),
        _ => {
            report.warn(format!(
                "the coordinates have several units: {}",
                units.join(", ")
            ));
            None
        }
    };
    Some((RowLayout::named(names.iter().map(String::as_str)), unit))
}

/// Returns the layout of columns without the names of coordinates: the coordinates are the first
/// three columns after those that hold words or row numbers.
pub(super) fn by_values(
    rows: &[Vec<f64>],
    names: Option<&[String]>,
    words: usize,
    is_pts: bool,
    report: &mut ReadReport,
) -> RowLayout {
    let width = rows.first().map_or(3, Vec::len);
    let is_counted = words == 0 && width > 3 && counts(rows);
    let first = if is_counted { 1 } else { words };
    if is_counted {
        report.warn(
            "the first column counts the rows and was left out; the next three were taken as x, y \
             and z (a line of names before the numbers says otherwise)",
        );
    }
    let mut columns = NamedColumns {
        rows,
        is_pts,
        first,
        names: (1..=first).map(|c| format!("column {c}")).collect(),
        has_colors: false,
        has_normals: false,
        guesses: Vec::new(),
    };
    columns.names.extend(["x", "y", "z"].map(String::from));
    match names {
        Some(names) => {
            let taken = names[first..first + 3].join(", ");
            let which = if first == 0 {
                "the first three columns"
            } else {
                "three columns"
            };
            report.warn(format!(
                "the header names no x, y and z; {which} ({}) were taken",
                shorten(&taken)
            ));
            if are_angles(names) {
                report.warn(
                    "the coordinates are longitude and latitude in degrees: angles, not lengths",
                );
            }
            columns.names.extend_from_slice(&names[first + 3..]);
        }
        None => {
            while columns.names.len() < width {
                columns.next(width - columns.names.len());
            }
        }
    }
    if !columns.guesses.is_empty() {
        report.warn(format!(
            "the columns have no names; by their values, {}",
            columns.guesses.join(" and ")
        ));
    }
    let mut layout = RowLayout::named(columns.names.iter().map(String::as_str));
    if is_counted {
        layout.ignore(0);
    }
    layout
}

/// Returns true if the first column numbers the rows: ascending integers, while all coordinates
/// vary. Steps of 1 suffice if no coordinate has steps of 1. Larger steps, where rows are missing,
/// suffice if no coordinate consists of integers. A profile, whose x may count too, is constant in
/// another coordinate.
fn counts(rows: &[Vec<f64>]) -> bool {
    let steps = |c: usize| rows.windows(2).map(move |pair| pair[1][c] - pair[0][c]);
    let is_whole = |c: usize| rows.iter().all(|r| r[c].fract() == 0.0);
    let ascends = is_whole(0) && steps(0).all(|s| s >= 1.0);
    let by_one = |c: usize| is_whole(c) && steps(c).all(|s| s == 1.0);
    let varies = |c: usize| steps(c).any(|s| s != 0.0);
    let others = || 1..4;
    rows.len() >= MIN_COUNTED_ROWS
        && ascends
        && others().all(varies)
        && (others().all(|c| !is_whole(c)) || (by_one(0) && !others().any(by_one)))
}

/// Columns that have a name so far.
struct NamedColumns<'r> {
    /// First rows of the file.
    rows: &'r [Vec<f64>],
    is_pts: bool,
    /// Number of columns before the coordinates.
    first: usize,
    /// Names so far, beginning with those of the columns up to the coordinates.
    names: Vec<String>,
    has_colors: bool,
    has_normals: bool,
    /// Roles guessed from values, for the report.
    guesses: Vec<String>,
}

impl NamedColumns<'_> {
    /// Names the next column or columns, of which `left` are unnamed.
    fn next(&mut self, left: usize) {
        let c = self.names.len();
        if left >= 3 && !self.has_colors && self.is_color(c, left) {
            self.has_colors = true;
            self.triple(["red", "green", "blue"], "colours");
            if left == 4 {
                self.names.push("alpha".into());
            }
        } else if left >= 3 && !self.has_normals && !(self.is_pts && left == 4) && self.is_normal(c)
        {
            self.has_normals = true;
            self.triple(["nx", "ny", "nz"], "normals");
        } else if c == self.first + 3 && (left == 1 || left == 4) {
            self.names.push("intensity".into());
        } else {
            self.names.push(format!("column {}", c + 1));
        }
    }

    /// Names the next three columns, and records the guess.
    fn triple(&mut self, names: [&str; 3], what: &str) {
        let c = self.names.len();
        self.names.extend(names.map(String::from));
        let (first, last) = (c + 1, c + 3);
        self.guesses
            .push(format!("columns {first} to {last} were taken as {what}"));
    }

    /// Returns true for integers from 0 to 255.
    fn is_byte(&self, c: usize) -> bool {
        let is_byte = |v: f64| (0.0..=255.0).contains(&v) && v.fract() == 0.0;
        self.rows.iter().all(|r| is_byte(r[c]))
    }

    /// Returns true if a column has one value in all rows.
    fn is_constant(&self, c: usize) -> bool {
        self.rows.iter().all(|r| r[c] == self.rows[0][c])
    }

    /// Returns true for three columns of bytes that are not all constant. PTS has x y z intensity r
    /// g b; in other formats four bytes are r g b a if the last is constant, else intensity r g b.
    fn is_color(&self, c: usize, left: usize) -> bool {
        let is_intensity_first =
            left == 4 && self.is_byte(c) && (self.is_pts || !self.is_constant(c + 3));
        !is_intensity_first
            && (c..c + 3).all(|c| self.is_byte(c))
            && !(c..c + 3).all(|c| self.is_constant(c))
    }

    /// Returns true if nine tenths of the rows have length 1 up to the rounding of three decimals,
    /// and none is longer.
    fn is_normal(&self, c: usize) -> bool {
        let length =
            |r: &Vec<f64>| (r[c] * r[c] + r[c + 1] * r[c + 1] + r[c + 2] * r[c + 2]).sqrt();
        let is_unit = |r: &&Vec<f64>| (length(r) - 1.0).abs() < 5e-3;
        let good = self.rows.iter().filter(is_unit).count();
        good * 10 >= self.rows.len() * 9 && self.rows.iter().all(|r| length(r) < 1.005)
    }
}
