//! What the columns are: by their names, or by the values of the first rows.
//!
//! Names are looked up in [`role_named`](crate::roles::role_named), and among the words of
//! surveyors (easting, northing, elevation) where a coordinate is missing. Values tell colours
//! (whole numbers from 0 to 255) and normals (triples of length 1) from other columns, which is a
//! guess that the report states.

use crate::ReadReport;
use crate::input::shorten;
use crate::roles::Layout;

/// The layout of columns with names; the first three are the coordinates where no names say so.
pub(super) fn by_names(names: &[String], report: &mut ReadReport) -> Layout {
    let known = |name: &str| match name.to_ascii_lowercase().as_str() {
        "easting" | "east" | "x_coordinate" | "coord_x" | "pos_x" | "x_m" => Some("x"),
        "northing" | "north" | "y_coordinate" | "coord_y" | "pos_y" | "y_m" => Some("y"),
        "elevation" | "height" | "altitude" | "z_coordinate" | "coord_z" | "pos_z" | "z_m" => {
            Some("z")
        }
        _ => None,
    };
    let layout = Layout::named(names.iter().map(String::as_str));
    if layout.missing_coordinate().is_none() {
        return layout;
    }
    let layout = Layout::named(names.iter().map(|n| match known(n) {
        Some(axis) if !names.iter().any(|m| m.eq_ignore_ascii_case(axis)) => axis,
        _ => n,
    }));
    if layout.missing_coordinate().is_none() {
        return layout;
    }
    report.warn(format!(
        "the header names no x, y and z; the first three columns ({}) were taken",
        shorten(&names[..3].join(", "))
    ));
    let rest: Vec<&str> = ["x", "y", "z"]
        .into_iter()
        .chain(names[3..].iter().map(String::as_str))
        .collect();
    Layout::named(rest)
}

/// What the columns of the first rows look like.
pub(super) fn by_values(rows: &[Vec<f64>], is_pts: bool, report: &mut ReadReport) -> Layout {
    let mut columns = Columns {
        rows,
        is_pts,
        names: ["x", "y", "z"].map(String::from).to_vec(),
        has_colors: false,
        has_normals: false,
        guesses: Vec::new(),
    };
    let width = rows.first().map_or(3, Vec::len);
    while columns.names.len() < width {
        columns.next(width - columns.names.len());
    }
    if !columns.guesses.is_empty() {
        report.warn(format!(
            "the columns have no names; by their values, {}",
            columns.guesses.join(" and ")
        ));
    }
    Layout::named(columns.names.iter().map(String::as_str))
}

/// The columns that have a name so far.
struct Columns<'r> {
    /// The first rows of the file.
    rows: &'r [Vec<f64>],
    is_pts: bool,
    /// The names so far, coordinates first.
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
        } else if c == 3 && (left == 1 || left == 4) {
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

    /// Whether a column has one value in all rows.
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
