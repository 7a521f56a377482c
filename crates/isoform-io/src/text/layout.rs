//! The columns of a table: by their names, or by the values of the first rows.
//!
//! Names are those of [`understood`]. Values tell colours (whole numbers from 0 to 255), normals
//! (triples of length 1) and numbers that count the rows from other columns, which is a guess that
//! the report states.

use super::names::{Named, are_angles, understood};
use crate::ReadReport;
use crate::input::shorten;
use crate::roles::Layout;

/// The fewest rows that can show that a column counts them: three steps of the same size and two
/// coordinates that take none.
const COUNTED: usize = 4;

/// The layout of columns whose names tell the coordinates, and their unit; none where they do not.
pub(super) fn by_names(
    names: &[String],
    report: &mut ReadReport,
) -> Option<(Layout, Option<String>)> {
    let Named { names, units } = understood(names)?;
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
    Some((Layout::named(names.iter().map(String::as_str)), unit))
}

/// The layout of columns whose names do not tell the coordinates, or that have none: the first
/// three behind those that hold words, or count the rows.
pub(super) fn by_values(
    rows: &[Vec<f64>],
    names: Option<&[String]>,
    words: usize,
    is_pts: bool,
    report: &mut ReadReport,
) -> Layout {
    let width = rows.first().map_or(3, Vec::len);
    let is_counted = words == 0 && width > 3 && counts(rows);
    let first = if is_counted { 1 } else { words };
    if is_counted {
        report.warn(
            "the first column counts the rows and was left out; the next three were taken as x, y \
             and z (a line of names before the numbers says otherwise)",
        );
    }
    let mut columns = Columns {
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
    let mut layout = Layout::named(columns.names.iter().map(String::as_str));
    if is_counted {
        layout.ignore(0);
    }
    layout
}

/// True if the first column numbers the rows: whole numbers that ascend, beside coordinates that
/// vary. Steps of 1 are enough where none of the coordinates does the same; larger ones, from
/// which rows are missing, where none of the coordinates is a whole number throughout. A profile,
/// whose x may count as well, is at one place in another coordinate.
fn counts(rows: &[Vec<f64>]) -> bool {
    let steps = |c: usize| rows.windows(2).map(move |pair| pair[1][c] - pair[0][c]);
    let is_whole = |c: usize| rows.iter().all(|r| r[c].fract() == 0.0);
    let ascends = is_whole(0) && steps(0).all(|s| s >= 1.0);
    let by_one = |c: usize| is_whole(c) && steps(c).all(|s| s == 1.0);
    let varies = |c: usize| steps(c).any(|s| s != 0.0);
    let others = || 1..4;
    rows.len() >= COUNTED
        && ascends
        && others().all(varies)
        && (others().all(|c| !is_whole(c)) || (by_one(0) && !others().any(by_one)))
}

/// The columns that have a name so far.
struct Columns<'r> {
    /// The first rows of the file.
    rows: &'r [Vec<f64>],
    is_pts: bool,
    /// Number of columns before the coordinates.
    first: usize,
    /// The names so far: of the columns up to the coordinates first.
    names: Vec<String>,
    has_colors: bool,
    has_normals: bool,
    /// What was told by the values alone, for the report.
    guesses: Vec<String>,
}

impl Columns<'_> {
    /// Gives a name to the next column, or to the next ones; `left` have none.
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

    /// Gives the next three columns names, and notes the guess.
    fn triple(&mut self, names: [&str; 3], what: &str) {
        let c = self.names.len();
        self.names.extend(names.map(String::from));
        let (first, last) = (c + 1, c + 3);
        self.guesses
            .push(format!("columns {first} to {last} were taken as {what}"));
    }

    /// Whole numbers from 0 to 255.
    fn is_byte(&self, c: usize) -> bool {
        let is_byte = |v: f64| (0.0..=255.0).contains(&v) && v.fract() == 0.0;
        self.rows.iter().all(|r| is_byte(r[c]))
    }

    /// True if a column has one value in all rows.
    fn is_constant(&self, c: usize) -> bool {
        self.rows.iter().all(|r| r[c] == self.rows[0][c])
    }

    /// Three columns of bytes that are not all constant. x y z intensity r g b is PTS; elsewhere
    /// four bytes are r g b a if the last is constant, else also intensity first.
    fn is_color(&self, c: usize, left: usize) -> bool {
        let is_intensity_first =
            left == 4 && self.is_byte(c) && (self.is_pts || !self.is_constant(c + 3));
        !is_intensity_first
            && (c..c + 3).all(|c| self.is_byte(c))
            && !(c..c + 3).all(|c| self.is_constant(c))
    }

    /// All rows within the noise of three decimals of length 1, a few of them without a normal.
    fn is_normal(&self, c: usize) -> bool {
        let length =
            |r: &Vec<f64>| (r[c] * r[c] + r[c + 1] * r[c + 1] + r[c + 2] * r[c + 2]).sqrt();
        let is_unit = |r: &&Vec<f64>| (length(r) - 1.0).abs() < 5e-3;
        let good = self.rows.iter().filter(is_unit).count();
        good * 10 >= self.rows.len() * 9 && self.rows.iter().all(|r| length(r) < 1.005)
    }
}
