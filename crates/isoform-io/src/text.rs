//! Points as lines of numbers: XYZ, TXT, ASC, PTS, CSV and their kin, streamed.
//!
//! Separators are blanks, tabs, commas or semicolons (then a comma is a decimal comma, as it is
//! where blanks separate "1,5 2,5 3,5");
//! `#`, `//` and `%` start comments. A line of names before the numbers, or in the last comment
//! before them, says what the columns are. Without names the first three are coordinates and the
//! values of the first [`PROBE`] rows tell the rest: triples of whole numbers from 0 to 255 are
//! colours, triples of length 1 are normals.

mod layout;
mod separator;

use crate::collect::Collector;
use crate::format::{Sniff, extension};
use crate::input::{Input, Result, parse_number, shorten, stated_unit};
use crate::roles::{Layout, Role};
use crate::{ErrorKind, ReadError, ReadOptions, ReadReport, WriteOptions};
use isoform_geom::PointCloud;
use layout::{by_names, by_values};
use separator::Separator;
use std::io::{self, Write};

/// Rows that decide what columns without names are: enough that chance does not make whole numbers
/// of measurements.
const PROBE: usize = 1000;
/// More columns are not points.
const MAX_COLUMNS: usize = 1000;
/// What failed, as the errors of this reader say.
const WHAT: &str = "cannot read the points";

/// Maybe, if the first line that is no comment and no header starts with three numbers.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head);
    let mut lines = text
        .lines()
        .map(str::trim)
        .filter(|l| !l.is_empty() && !is_comment(l))
        .take(3);
    let is_row = |l: &str| {
        let (separator, _) = Separator::of(l);
        let fields: Vec<&str> = separator.split(l).map(|(_, f)| f).collect();
        fields.len() >= 3 && fields[..3].iter().all(|f| parse_number(f).is_some())
    };
    if head.contains(&0) || !lines.any(is_row) {
        Sniff::No
    } else {
        Sniff::Maybe
    }
}

/// Whether a line starts like a comment.
fn is_comment(line: &str) -> bool {
    line.starts_with(['#', '%', '!']) || line.starts_with("//")
}

/// Where the comment after the fields of a line begins: at the first `#`, else at the first `//`.
fn comment_after_fields(line: &str) -> Option<usize> {
    // Most lines have neither mark: one pass over the bytes says so.
    let first = line.bytes().position(|b| matches!(b, b'#' | b'/'))?;
    let rest = &line[first..];
    let at = rest.find('#').or_else(|| rest.find("//"))?;
    Some(first + at)
}

/// Whether a line starts the header of an ESRI ASCII grid.
fn starts_a_raster(line: &str) -> bool {
    let line = line.to_ascii_lowercase();
    ["ncols", "nrows"].iter().any(|w| line.starts_with(w))
}

/// A field as a number, whose comma is the decimal point where `decimal` says so; `scratch` holds
/// the field with a point.
#[inline]
fn number(field: &str, decimal: bool, scratch: &mut String) -> Option<f64> {
    if !(decimal && field.contains(',')) {
        return parse_number(field);
    }
    scratch.clear();
    scratch.extend(field.chars().map(|c| if c == ',' { '.' } else { c }));
    parse_number(scratch)
}

/// The rows of a file, and what its lines say of them.
struct Reader<'i, 'a> {
    input: &'i mut Input<'a>,
    /// The line at hand, and its bytes.
    text: String,
    bytes: Vec<u8>,
    /// What stands between fields, and whether commas are decimal; set by the first row.
    separator: Option<(Separator, bool)>,
    /// The row at hand.
    values: Vec<f64>,
    /// Positions of the coordinates in a row, once known; a word there is an error.
    coordinates: [usize; 3],
    /// Values of a row, set by the first.
    width: usize,
    /// Whether the file is PTS, where every scan begins with its number of points.
    is_pts: bool,
    /// Names of the columns, out of a header or the last comment before the first row.
    names: Option<Vec<String>>,
    /// The last comment before the first row, without its mark.
    last_comment: String,
    /// Points that the file announces, over all its scans.
    declared: Option<u64>,
    /// Lines with more fields than the first.
    longer: u64,
    /// Fields that should be numbers and are not.
    words: u64,
    /// The unit that a comment or a name states.
    unit: Option<String>,
}

/// Reads a table of points: the rows up to [`PROBE`] decide which column is which, then all are
/// taken.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    let is_pts = extension(&input.name).as_deref() == Some("pts");
    let mut reader = Reader {
        input,
        text: String::new(),
        bytes: Vec::new(),
        separator: None,
        values: Vec::new(),
        coordinates: [0, 1, 2],
        width: 0,
        is_pts,
        names: None,
        last_comment: String::new(),
        declared: None,
        longer: 0,
        words: 0,
        unit: None,
    };
    let probe = reader.probe()?;
    let mut layout = match &reader.names {
        Some(names) => by_names(names, report),
        None => by_values(&probe, is_pts, report),
    };
    reader.place(&layout);
    let mut collector = Collector::new(options);
    layout.announce(&mut collector);
    for values in probe {
        layout.offer(&mut collector, &values);
    }
    while reader.next()? {
        layout.offer(&mut collector, &reader.values);
    }
    reader.tell(collector.rows, report);
    collector.finish(input, options, report)
}

impl Reader<'_, '_> {
    /// The first rows: one where the columns have names or are the coordinates alone, else up to
    /// [`PROBE`], from whose values the columns are told.
    fn probe(&mut self) -> Result<Vec<Vec<f64>>> {
        let mut probe: Vec<Vec<f64>> = Vec::new();
        if self.next()? {
            self.take_names();
            probe.push(self.values.clone());
            while self.names.is_none() && self.width > 3 && probe.len() < PROBE && self.next()? {
                probe.push(self.values.clone());
            }
        }
        Ok(probe)
    }

    /// Puts into the report what the file said of its points and what was odd in its `rows` rows.
    fn tell(self, rows: u64, report: &mut ReadReport) {
        report.declared = self.declared;
        report.units = self.unit;
        if let Some(n) = self.declared
            && n != rows
        {
            report.warn(format!("the file announces {n} points and has {rows}"));
        }
        if self.longer > 0 {
            report.warn(format!(
                "{} lines have more columns than the first; what was beyond was not read",
                self.longer
            ));
        }
        if self.words > 0 {
            report.warn(format!(
                "{} fields are not numbers; they are NaN in the columns",
                self.words
            ));
        }
    }

    /// Reads the next row of numbers into `values`; false at the end.
    fn next(&mut self) -> Result<bool> {
        loop {
            if !self.input.read_line(&mut self.text, &mut self.bytes)? {
                return Ok(false);
            }
            if self.input.line == 1
                && (self.bytes.starts_with(b"\xff\xfe") || self.bytes.starts_with(b"\xfe\xff"))
            {
                let hint = "save it as UTF-8 or plain ASCII";
                return Err(self.input.error(
                    ErrorKind::Corrupt,
                    self.input.at_line(0),
                    WHAT,
                    "the text is UTF-16",
                    hint,
                ));
            }
            let mut line = std::mem::take(&mut self.text);
            let found = self.line(&mut line);
            self.text = line;
            if found? {
                return Ok(true);
            }
        }
    }

    /// Takes a line; whether it was a row.
    fn line(&mut self, line: &mut String) -> Result<bool> {
        let is_first = self.width == 0;
        let start = line.trim_start();
        if start.trim_end().is_empty() {
            return Ok(false);
        }
        if is_comment(start) {
            if is_first {
                self.unit = self.unit.take().or_else(|| stated_unit(start));
                self.last_comment = start
                    .trim_start_matches(['#', '%', '!', '/', ' '])
                    .to_owned();
            }
            return Ok(false);
        }
        if let Some(at) = comment_after_fields(line) {
            line.truncate(line[..at].trim_end().len());
        }
        let line = line.trim_end_matches([' ', '\r']);
        if is_first && starts_a_raster(line) {
            return Err(self.is_raster());
        }
        if (is_first || self.is_pts)
            && let Ok(n) = line.trim().parse::<u64>()
        {
            // PTS: the number of points of each scan.
            self.declared = Some(self.declared.unwrap_or(0).saturating_add(n));
            return Ok(false);
        }
        if is_first && self.names.is_none() && self.is_header(line) {
            return Ok(false);
        }
        self.row(line)
    }

    /// The error for an ESRI ASCII grid, which has heights and no coordinates.
    fn is_raster(&self) -> ReadError {
        self.input.error(
            ErrorKind::UnsupportedFormat,
            self.input.at_line(0),
            WHAT,
            "it is an ESRI ASCII grid: heights on a raster, not points",
            "convert it to XYZ",
        )
    }

    /// Whether the line is names; then they are kept.
    fn is_header(&mut self, line: &str) -> bool {
        let (separator, _) = Separator::of(line);
        let fields: Vec<String> = separator
            .split(line)
            .map(|(_, f)| f.trim_matches(['"', '\'']).trim().to_owned())
            .collect();
        let numbers = fields
            .iter()
            .filter(|f| parse_number(f).is_some() || f.replace(',', ".").parse::<f64>().is_ok())
            .count();
        let is_header = numbers == 0 && fields.len() >= 3 && fields.len() <= MAX_COLUMNS;
        if is_header {
            self.names = Some(fields);
        }
        is_header
    }

    /// Takes a line of fields as a row of numbers; the first row sets the width.
    fn row(&mut self, line: &str) -> Result<bool> {
        let is_first = self.width == 0;
        let (separator, decimal) = *self.separator.get_or_insert_with(|| Separator::of(line));
        self.values.clear();
        let mut commas = String::new();
        for (at, field) in separator.split(line) {
            if !is_first && self.values.len() == self.width {
                self.longer += 1;
                break;
            }
            let value = match number(field, decimal, &mut commas) {
                Some(v) => v,
                None => self.other_field(field, at)?,
            };
            self.values.push(value);
        }
        // An empty last field looks like an end mark; whether it counts, the width tells.
        let width = if is_first {
            self.names.as_ref().map_or(0, Vec::len)
        } else {
            self.width
        };
        if let Separator::Char(c) = separator
            && self.values.len() + 1 == width
            && line.ends_with(c)
        {
            self.values.push(f64::NAN);
        }
        self.take_width(line)?;
        Ok(true)
    }

    /// The value of a field that is no number, at byte `at` of its line: NaN, and an error where a
    /// coordinate should stand.
    fn other_field(&mut self, field: &str, at: usize) -> Result<f64> {
        if field.is_empty() {
            return Ok(f64::NAN);
        }
        let i = self.values.len();
        let may_be_named = self.width == 0 && i >= 3 && self.names.is_some();
        if self.coordinates.contains(&i) && !may_be_named {
            let why = format!("\"{}\" is not a number", shorten(field));
            return Err(self.wrong(at, why));
        }
        self.words += 1;
        Ok(f64::NAN)
    }

    /// Sets the width by the first row, and refuses later rows that are shorter.
    fn take_width(&mut self, line: &str) -> Result<()> {
        let n = self.values.len();
        if self.width == 0 {
            if !(3..=MAX_COLUMNS).contains(&n) {
                let why = format!("a point needs three numbers; the line has {n} columns");
                return Err(self.wrong(0, why));
            }
            self.width = n;
        } else if n < self.width {
            let width = self.width;
            let why = format!("the line has {n} columns where the first has {width}");
            return Err(self.wrong(line.len(), why));
        }
        Ok(())
    }

    /// The error for a row, at a byte of its line.
    fn wrong(&self, at: usize, why: String) -> ReadError {
        let hint = "correct or remove the line; comments start with #";
        let at = self.input.at_line(at + 1);
        self.input.error(ErrorKind::Number, at, WHAT, why, hint)
    }

    /// Names out of the last comment, if they fit the first row.
    fn take_names(&mut self) {
        if self.names.is_none() {
            let fields: Vec<String> = match Separator::of(&self.last_comment) {
                (Separator::Blank, _) => self
                    .last_comment
                    .split_ascii_whitespace()
                    .map(str::to_owned)
                    .collect(),
                (separator, _) => separator
                    .split(&self.last_comment)
                    .map(|(_, f)| f.to_owned())
                    .collect(),
            };
            let plain: Vec<String> = fields.iter().map(|f| self.plain(f)).collect();
            if fields.len() == self.width
                && Layout::named(plain.iter().map(String::as_str))
                    .missing_coordinate()
                    .is_none()
            {
                self.names = Some(fields);
            }
        }
        if let Some(mut names) = self.names.take() {
            for name in &mut names {
                *name = self.plain(name);
            }
            names.truncate(self.width);
            for i in names.len()..self.width {
                names.push(format!("column {}", i + 1));
            }
            self.names = Some(names);
        }
    }

    /// A name without quotes and without its unit in brackets, which is noted.
    fn plain(&mut self, name: &str) -> String {
        let name = name
            .trim_matches(['"', '\''])
            .trim_start_matches("//")
            .trim();
        match name.find(['(', '[']) {
            Some(at) if at > 0 => {
                let (bare, unit) = (
                    name[..at].trim_end(),
                    name[at + 1..].trim_end_matches([')', ']']),
                );
                if matches!(bare.to_ascii_lowercase().as_str(), "x" | "y" | "z") {
                    self.unit = self
                        .unit
                        .take()
                        .or_else(|| stated_unit(&format!("unit {unit}")));
                    return bare.to_owned();
                }
                name.to_owned()
            }
            _ => name.to_owned(),
        }
    }

    /// Notes where the coordinates stand, so that words there are refused.
    fn place(&mut self, layout: &Layout) {
        for k in 0..3 {
            self.coordinates[k] = layout
                .roles
                .iter()
                .position(|&r| r == Role::Position(k))
                .unwrap_or(k);
        }
    }
}

/// Lines of numbers, blank-separated, after a `#` line with their names.
pub(crate) fn write_xyz(
    cloud: &PointCloud,
    out: &mut dyn Write,
    options: &WriteOptions,
) -> io::Result<()> {
    if let Some(units) = &options.units {
        writeln!(out, "# units: {}", units.replace(['\n', '\r'], " "))?;
    }
    write!(out, "# ")?;
    lines(cloud, out, ' ')
}

/// Comma-separated values after a line with their names.
pub(crate) fn write_csv(
    cloud: &PointCloud,
    out: &mut dyn Write,
    _: &WriteOptions,
) -> io::Result<()> {
    lines(cloud, out, ',')
}

/// Writes a line of names and a line per point.
fn lines(cloud: &PointCloud, out: &mut dyn Write, separator: char) -> io::Result<()> {
    let names = crate::columns::column_names(cloud);
    writeln!(out, "{}", names.all().join(&separator.to_string()))?;
    let mut line = Vec::new();
    for i in 0..cloud.points.len() {
        crate::columns::row(out, separator as u8, cloud, i, &mut line)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;

    fn read_as(name: &str, text: &str) -> Result<(PointCloud, ReadReport)> {
        crate::read(
            Source::Bytes {
                name,
                bytes: text.as_bytes(),
            },
            None,
            &ReadOptions::default(),
        )
    }
    fn points(text: &str) -> Vec<[f64; 3]> {
        read_as("t.xyz", text).expect("valid").0.points
    }

    #[test]
    fn separators_and_decimal_commas() {
        let want = [[1.5, 2.0, -3.25], [4.0, 5.5, 6.0]];
        for text in [
            "1.5 2 -3.25\n4 5.5 6\n",
            "  1.5\t2\t-3.25\r\n\r\n4\t5.5\t6",
            "1.5,2,-3.25\n4,5.5,6\n",
            "1.5, 2, -3.25,\n4, 5.5, 6,\n",
            "1,5;2;-3,25\n4;5,5;6\n",
            "1,5 2,0 -3,25\n4 5,5 6\n",
            "1,5\t2,0\t-3,25\n4\t5,5\t6\n",
            "\"X\";\"Y\";\"Z\"\n1.5;2;-3.25\n4;5.5;6\n",
            "// made by hand\n//X Y Z\n1.5 2 -3.25 // first\n4 5.5 6 # second\n",
            "% matlab\n2\n1.5 2 -3.25\n4 5.5 6\n",
            "\u{feff}x y z\n1.5D0 2 -3.25\n4 5.5 6\n",
        ] {
            assert_eq!(points(text), want, "{text}");
        }
    }

    #[test]
    fn names_say_what_columns_are() {
        let (cloud, report) =
            read_as("t.csv", "id,Z (mm),X (mm),Y (mm),R,G,B,nx,ny,nz,note\n1,3,1,2,255,0,7,0,0,1,a\n2,6,4,5,0,0,0,0,2,0,\n")
                .expect("valid");
        assert_eq!(cloud.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(cloud.colors, [[255, 0, 7], [0, 0, 0]]);
        assert_eq!(cloud.normals, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
        assert_eq!(
            cloud
                .columns
                .iter()
                .map(|c| c.name.as_str())
                .collect::<Vec<_>>(),
            ["id", "note"]
        );
        assert_eq!(report.units.as_deref(), Some("mm"));
        let (cloud, _) = read_as("t.csv", "Easting,Northing,Height\n1,2,3\n").expect("valid");
        assert_eq!(cloud.points, [[1.0, 2.0, 3.0]]);
        let (cloud, report) = read_as("t.csv", "u,v,w,t\n1,2,3,4\n").expect("valid");
        assert_eq!(
            (
                cloud.points[0],
                cloud.columns[0].values[0],
                report.warnings.len()
            ),
            ([1.0, 2.0, 3.0], 4.0, 1)
        );
    }

    #[test]
    fn values_say_what_columns_are() {
        let layout = |name: &str, row: &str, other: &str| {
            let cloud = read_as(name, &format!("{row}\n{other}\n"))
                .expect("valid")
                .0;
            (
                cloud.colors.len(),
                cloud.normals.len(),
                cloud
                    .columns
                    .into_iter()
                    .map(|c| c.name)
                    .collect::<Vec<_>>(),
            )
        };
        let none: Vec<String> = vec![];
        assert_eq!(
            layout("t.xyz", "0 0 0 10 20 30", "1 1 1 11 20 30"),
            (2, 0, none.clone())
        );
        assert_eq!(
            layout("t.xyz", "0 0 0 0.6 0.8 0", "1 1 1 0 0 -1"),
            (0, 2, none.clone())
        );
        assert_eq!(
            layout("t.xyz", "0 0 0 0.6 0.8 0.5", "1 1 1 0 3 -1").2.len(),
            3
        );
        assert_eq!(
            layout("t.xyz", "0 0 0 10 20 30 255", "1 1 1 11 20 30 255"),
            (2, 0, vec!["alpha".into()])
        );
        assert_eq!(
            layout("t.pts", "0 0 0 -800 20 30 40", "1 1 1 -801 20 30 41"),
            (2, 0, vec!["intensity".into()])
        );
        assert_eq!(
            layout("t.xyz", "0 0 0 1 2 3 0.6 0.8 0", "1 1 1 4 5 6 0 0 -1"),
            (2, 2, none.clone())
        );
        assert_eq!(
            layout("t.xyz", "0 0 0 0.6 0.8 0 1 2 3", "1 1 1 0 0 -1 4 5 6"),
            (2, 2, none)
        );
        assert_eq!(layout("t.xyz", "0 0 0 0.5", "1 1 1 0.25").2, ["intensity"]);
    }

    #[test]
    fn pts_counts() {
        let (cloud, report) = read_as("t.pts", "2\n0 0 0\n1 1 1\n1\n2 2 2\n").expect("valid");
        assert_eq!(
            (cloud.points.len(), report.declared, report.warnings.len()),
            (3, Some(3), 0)
        );
        let (_, report) = read_as("t.pts", "5\n0 0 0\n").expect("valid");
        assert_eq!(report.warnings.len(), 1);
    }

    #[test]
    fn refusals_say_where() {
        let place = |text: &str| {
            let e = read_as("t.xyz", text).expect_err("invalid");
            (e.code(), e.place.to_string())
        };
        assert_eq!(
            place("1 2 3\n4 five 6\n"),
            ("bad-number", "t.xyz:2:3".into())
        );
        assert_eq!(place("1 2 3\n\n4 5\n"), ("bad-number", "t.xyz:3:4".into()));
        assert_eq!(place("1 2\n"), ("bad-number", "t.xyz:1:1".into()));
        assert_eq!(place("ncols 4\nnrows 5\n").0, "format-unsupported");
        assert_eq!(place("\u{1}\u{2}\n").0, "bad-number");
    }
}
