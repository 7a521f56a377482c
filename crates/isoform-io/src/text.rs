//! Points as lines of numbers: XYZ, TXT, ASC, PTS, CSV and similar files, streamed.
//!
//! Separators are blanks, tabs, commas or semicolons. Commas are decimal if semicolons separate
//! fields, or if blanks do as in "1,5 2,5 3,5". Fields may be quoted; `#`, `//` and `%` start
//! comments. A line of names before the numbers, or in a comment before them, defines the columns
//! and may state their unit; lines before a line that names x, y and z are skipped. Without names
//! the first three columns are coordinates, and the values of the first [`MAX_PROBED_ROWS`] rows
//! decide the others: triples of integers from 0 to 255 are colours, triples of length 1 are
//! normals, and a first column that counts the rows is ignored.

mod layout;
pub(crate) mod names;
mod separator;
mod write;

use crate::collect::Collector;
use crate::format::{Sniff, extension};
use crate::input::{Input, Result, parse_number, shorten, stated_unit};
use crate::roles::{Role, RowLayout};
use crate::{ErrorKind, ReadError, ReadOptions, ReadReport};
use isoform_geom::PointCloud;
use layout::{by_names, by_values};
use names::interpret_names;
use separator::{Separator, is_decimal};
pub(crate) use write::{write_csv, write_xyz};

/// Number of rows that decide the meaning of unnamed columns: enough that measurements are not
/// integers by chance.
const MAX_PROBED_ROWS: usize = 1000;
/// Maximum number of columns of a table of points.
const MAX_TABLE_COLUMNS: usize = 1000;
/// Maximum number of lines searched for the names of columns after a line that is not a row.
const MAX_PREAMBLE_LINES: u64 = 100;
const TABLE_FAILURE: &str = "cannot read the points";

/// Returns `Maybe` if one of the first three lines that are not comments starts with three numbers,
/// or names the coordinates while another contains three numbers.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    let text = String::from_utf8_lossy(head);
    let lines = text.lines().map(str::trim);
    let lines: Vec<&str> = lines
        .filter(|l| !l.is_empty() && !is_comment(l))
        .take(3)
        .collect();
    let numbers = |l: &&str, most: usize| {
        let (separator, decimal) = Separator::detect(l);
        let fields = separator.split(l).take(most);
        let mut scratch = String::new();
        fields
            .filter(|(_, f)| number(f, decimal, &mut scratch).is_some())
            .count()
    };
    let is_table = lines.iter().any(|l| header(l).is_some_and(|h| h.1))
        && lines.iter().any(|l| numbers(l, MAX_TABLE_COLUMNS) >= 3);
    if !head.contains(&0) && (is_table || lines.iter().any(|l| numbers(l, 3) == 3)) {
        Sniff::Maybe
    } else {
        Sniff::No
    }
}

/// Returns the names in a line without numbers, and true if they include the coordinates.
fn header(line: &str) -> Option<(Vec<String>, bool)> {
    let fields = names::split(line);
    if !(3..=MAX_TABLE_COLUMNS).contains(&fields.len()) || fields.iter().any(|f| is_decimal(f)) {
        return None;
    }
    let is_named = interpret_names(&fields).is_some();
    Some((fields, is_named))
}

/// Returns true if a line starts like a comment.
fn is_comment(line: &str) -> bool {
    line.starts_with(['#', '%', '!']) || line.starts_with("//")
}

/// Returns the start of the comment after the fields of a line: the first `#` or `//` that is not
/// in quotes and does not follow a letter or colon, as in `P#1` or `http://`.
fn comment_after_fields(line: &str) -> Option<usize> {
    // Fast path: most lines contain neither mark.
    line.bytes().position(|b| matches!(b, b'#' | b'/'))?;
    let (mut is_quoted, mut before) = (false, b' ');
    for (at, b) in line.bytes().enumerate() {
        let is_mark = b == b'#' || line.as_bytes()[at..].starts_with(b"//");
        if is_mark && !is_quoted && !(before.is_ascii_alphabetic() || before == b':') {
            return Some(at);
        }
        is_quoted ^= b == b'"';
        before = b;
    }
    None
}

/// Returns true if a line starts the header of an ESRI ASCII grid.
fn starts_a_raster(line: &str) -> bool {
    let line = line.to_ascii_lowercase();
    ["ncols", "nrows"].iter().any(|w| line.starts_with(w))
}

/// Parses a field as a number, with a decimal comma if `decimal`; `scratch` holds the field with a
/// point.
#[inline]
fn number(field: &str, decimal: bool, scratch: &mut String) -> Option<f64> {
    if !(decimal && field.contains(',')) {
        return parse_number(field);
    }
    scratch.clear();
    scratch.extend(field.chars().map(|c| if c == ',' { '.' } else { c }));
    parse_number(scratch)
}

/// State of reading a table.
struct TableReader<'i, 'a> {
    input: &'i mut Input<'a>,
    /// Present line, and its bytes.
    text: String,
    bytes: Vec<u8>,
    /// Separator of fields, and true if commas are decimal; set by the first row.
    separator: Option<(Separator, bool)>,
    /// Present row.
    values: Vec<f64>,
    /// Positions of the coordinates in a row; a word there is an error.
    coordinates: [usize; 3],
    /// Number of values of a row, set by the first.
    width: usize,
    /// True for PTS, where every scan begins with its number of points.
    is_pts: bool,
    /// Names of the columns, from a line of their own or a comment before the first row.
    names: Option<Vec<String>>,
    /// True if the names include the coordinates.
    is_named: bool,
    /// Names in the last comment that includes the coordinates.
    commented: Option<Vec<String>>,
    /// Columns that held a word in the first row, with the word.
    texts: Vec<(usize, String)>,
    /// Error for the first line that is neither a row nor names, pending names on a later line.
    refused: Option<ReadError>,
    /// Number of lines before the names.
    passed: u64,
    /// Number of points announced by the file, over all its scans.
    declared: Option<u64>,
    /// Number of lines with more fields than the first.
    longer: u64,
    /// Number of fields that should be numbers but are not.
    words: u64,
    /// Unit stated by a comment or a name.
    unit: Option<String>,
}

/// Reads a table of points. Up to [`MAX_PROBED_ROWS`] rows decide the meaning of the columns, then
/// all rows are read.
pub(crate) fn read(
    input: &mut Input<'_>,
    options: &ReadOptions,
    report: &mut ReadReport,
) -> Result<PointCloud> {
    let is_pts = extension(&input.name).as_deref() == Some("pts");
    let mut reader = TableReader {
        input,
        text: String::new(),
        bytes: Vec::new(),
        separator: None,
        values: Vec::new(),
        coordinates: [0, 1, 2],
        width: 0,
        is_pts,
        names: None,
        is_named: false,
        commented: None,
        texts: Vec::new(),
        refused: None,
        passed: 0,
        declared: None,
        longer: 0,
        words: 0,
        unit: None,
    };
    let probe = reader.probe()?;
    let mut layout = reader.layout(&probe, report);
    reader.place(&layout);
    let mut collector = Collector::new(options);
    layout.announce(&mut collector);
    for values in probe {
        layout.offer(&mut collector, &values);
    }
    while reader.next()? {
        layout.offer(&mut collector, &reader.values);
    }
    reader.complete_report(collector.rows, report);
    collector.finish(input, options, report)
}

impl TableReader<'_, '_> {
    /// Reads the rows that decide the meaning of unnamed columns, at most [`MAX_PROBED_ROWS`]; one
    /// row if names include the coordinates or there are only three columns.
    fn probe(&mut self) -> Result<Vec<Vec<f64>>> {
        let mut probe: Vec<Vec<f64>> = Vec::new();
        if self.next()? {
            probe.push(self.values.clone());
            while !self.is_named
                && self.width > 3
                && probe.len() < MAX_PROBED_ROWS
                && self.next()?
            {
                probe.push(self.values.clone());
            }
        }
        match self.refused.take() {
            Some(error) => Err(error),
            None => Ok(probe),
        }
    }

    /// Returns the roles of the columns; those that hold words are ignored.
    fn layout(&mut self, probe: &[Vec<f64>], report: &mut ReadReport) -> RowLayout {
        let named = match &self.names {
            Some(names) => by_names(names, report),
            None => None,
        };
        let mut layout = match named {
            Some((layout, unit)) => {
                self.unit = unit.or(self.unit.take());
                layout
            }
            None => {
                let (names, words) = (self.names.as_deref(), self.coordinates[0]);
                by_values(probe, names, words, self.is_pts, report)
            }
        };
        let mut held = Vec::new();
        for (column, word) in &self.texts {
            let name = match &self.names {
                Some(names) => format!("\"{}\"", shorten(&names[*column])),
                None => (column + 1).to_string(),
            };
            held.push(format!("{name} (\"{}\")", shorten(word)));
            layout.ignore(*column);
        }
        if !held.is_empty() {
            let (columns, were) = match held.len() {
                1 => ("column", "holds words and was"),
                _ => ("columns", "hold words and were"),
            };
            report.warn(format!("{columns} {} {were} left out", held.join(", ")));
        }
        layout
    }

    /// Records the positions of the coordinates, so that words there are refused.
    fn place(&mut self, layout: &RowLayout) {
        let place = |k| layout.roles.iter().position(|&r| r == Role::Position(k));
        self.coordinates = [0, 1, 2].map(|k| place(k).unwrap_or(k));
    }

    /// Completes the report with the statements of the file about its points and the irregularities
    /// of its `rows` rows.
    fn complete_report(self, rows: u64, report: &mut ReadReport) {
        report.declared = self.declared;
        report.units = self.unit;
        if self.passed > 0 {
            let lines = if self.passed == 1 { "line" } else { "lines" };
            report.warn(format!(
                "{} {lines} before the names of the columns were passed over",
                self.passed
            ));
        }
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

    /// Reads the next row of numbers into `values`; returns false at the end.
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
                    TABLE_FAILURE,
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

    /// Processes a line; returns true if it was a row.
    fn line(&mut self, line: &mut String) -> Result<bool> {
        let is_first = self.width == 0;
        let start = line.trim_start();
        if start.trim_end().is_empty() {
            return Ok(false);
        }
        if is_comment(start) {
            if is_first {
                self.unit = self.unit.take().or_else(|| stated_unit(start));
                let names = names::split(start.trim_start_matches(['#', '%', '!', '/', ' ']));
                if names.len() <= MAX_TABLE_COLUMNS && interpret_names(&names).is_some() {
                    self.commented = Some(names);
                }
            }
            return Ok(false);
        }
        if is_first
            && !self.is_named
            && let Some((names, true)) = header(line)
        {
            // Before comments are removed, as `Point #` is a name.
            self.take_header(names, true);
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
            // PTS: number of points of each scan.
            self.declared = Some(self.declared.unwrap_or(0).saturating_add(n));
            return Ok(false);
        }
        if is_first {
            return self.first(line);
        }
        self.row(line)
    }

    /// Processes a line before the first row: names, units below them, or the first row. Any other
    /// line is skipped if names of the coordinates follow.
    fn first(&mut self, line: &str) -> Result<bool> {
        if self.is_units(line) {
            return Ok(false);
        }
        if !self.is_named
            && let Some((names, is_named)) = header(line)
            && (is_named || self.names.is_none())
        {
            self.take_header(names, is_named);
            return Ok(false);
        }
        let before = self.refused.take();
        let error = match (self.row(line), before) {
            (told, _) if self.is_named => return told,
            (Ok(is_row), None) => return Ok(is_row),
            (_, Some(before)) => before,
            (Err(error), None) => error,
        };
        self.passed += 1;
        if self.width > 0 || self.passed > MAX_PREAMBLE_LINES {
            return Err(error);
        }
        (self.refused, self.separator) = (Some(error), None);
        self.texts.clear();
        Ok(false)
    }

    /// Returns the error for an ESRI ASCII grid, which has heights but no coordinates.
    fn is_raster(&self) -> ReadError {
        self.input.error(
            ErrorKind::UnsupportedFormat,
            self.input.at_line(0),
            TABLE_FAILURE,
            "it is an ESRI ASCII grid: heights on a raster, not points",
            "convert it to XYZ",
        )
    }

    /// Stores names; lines before those of the coordinates are skipped.
    fn take_header(&mut self, names: Vec<String>, is_named: bool) {
        if is_named {
            self.passed += u64::from(self.names.is_some());
        }
        (self.names, self.is_named) = (Some(names), is_named);
    }

    /// Returns true if the line contains units below the names; they are added to the names.
    fn is_units(&mut self, line: &str) -> bool {
        let Some(names) = &mut self.names else {
            return false;
        };
        let Some(units) = names::unit_row(line).filter(|u| u.len() == names.len()) else {
            return false;
        };
        for (name, unit) in names
            .iter_mut()
            .zip(units)
            .filter(|(_, unit)| !unit.is_empty())
        {
            *name = format!("{name} [{unit}]");
        }
        true
    }

    /// Parses a line of fields as a row of numbers; the first row sets the width.
    fn row(&mut self, line: &str) -> Result<bool> {
        let is_first = self.width == 0;
        let (separator, decimal) = *self
            .separator
            .get_or_insert_with(|| Separator::detect(line));
        self.values.clear();
        if is_first {
            let fields = separator.split(line).count();
            let is_open = matches!(separator, Separator::Char(c) if line.ends_with(c));
            let is_one_short = self.names.as_ref().is_some_and(|n| n.len() == fields + 1);
            self.take_names(fields + usize::from(is_open && is_one_short));
        }
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
        // An empty last field looks like a terminator; the width decides if it counts.
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

    /// Returns NaN for a field that is not a number, at byte `at` of its line; an error for a
    /// coordinate. The first row of an unnamed table may begin with identifiers of the point, which
    /// contain digits; the coordinates then follow them.
    fn other_field(&mut self, field: &str, at: usize) -> Result<f64> {
        if field.is_empty() {
            return Ok(f64::NAN);
        }
        let (i, is_first) = (self.values.len(), self.width == 0);
        if is_first && !self.is_named && i == self.coordinates[0] {
            let is_id = |f: &str| f.contains(|c: char| c.is_ascii_digit());
            if self.names.is_some() || is_id(field) {
                self.coordinates = self.coordinates.map(|c| c + 1);
            }
        }
        if self.coordinates.contains(&i) {
            let why = format!("\"{}\" is not a number", shorten(field));
            return Err(self.wrong(at, why));
        }
        if is_first {
            self.texts.push((i, field.to_owned()));
        } else if !self.texts.iter().any(|t| t.0 == i) {
            self.words += 1;
        }
        Ok(f64::NAN)
    }

    /// Sets the width by the first row, and refuses later rows that are shorter.
    fn take_width(&mut self, line: &str) -> Result<()> {
        let n = self.values.len();
        if self.width == 0 {
            let is_short = n < 3 || self.coordinates.iter().any(|&c| c >= n);
            if is_short || n > MAX_TABLE_COLUMNS {
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

    /// Returns the error for a row, at a byte of its line.
    fn wrong(&self, at: usize, why: String) -> ReadError {
        let hint = "correct or remove the line; comments start with #, and a line of names, as \
                    in x,y,z, says which columns to take";
        let at = self.input.at_line(at + 1);
        self.input
            .error(ErrorKind::Number, at, TABLE_FAILURE, why, hint)
    }

    /// Completes the names for rows of `width` values: takes those of a comment if their number
    /// fits, adjusts their number to the width, and locates the coordinates.
    fn take_names(&mut self, width: usize) {
        self.coordinates = [0, 1, 2];
        if !self.is_named
            && let Some(names) = self.commented.take_if(|names| names.len() == width)
        {
            (self.names, self.is_named) = (Some(names), true);
        }
        let Some(names) = &mut self.names else {
            return;
        };
        if names.len() > width {
            // Blanks within the first name, as in `Point ID X Y Z`, or names without values.
            let more = names.len() - width;
            let joined: Vec<String> = std::iter::once(names[..=more].join(" "))
                .chain(names[more + 1..].iter().cloned())
                .collect();
            let is_better =
                interpret_names(&joined).is_some() && interpret_names(&names[more + 1..]).is_some();
            match is_better && self.separator.is_some_and(|s| s.0 == Separator::Blank) {
                true => *names = joined,
                false => names.truncate(width),
            }
        }
        for i in names.len()..width {
            names.push(format!("column {}", i + 1));
        }
        if let Some(told) = interpret_names(names) {
            let place = |name| told.names.iter().position(|n| n == name).unwrap_or(0);
            self.coordinates = ["x", "y", "z"].map(place);
        }
    }
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
            ["id"]
        );
        assert_eq!(
            report.warnings,
            [
                "column \"note\" (\"a\") holds words and was left out",
                "1 normals were not of length 1 and were scaled"
            ]
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
    fn tables_are_known_by_their_content() {
        for (text, is_table) in [
            ("X;Y;Z\n1,5;2,5;3,5\n", true),
            ("1,5;2,5;3,5\n", true),
            ("name,x,y,z\nP1,1,2,3\n", true),
            ("\"X\",\"Y\",\"Z\"\n\"1\",\"2\",\"3\"\n", true),
            ("x y z\nand other words\n", false),
            ("m(x[3], a[2]) {\n m = x + y + z;\n}\n", false),
        ] {
            assert_eq!(sniff(text.as_bytes()) == Sniff::Maybe, is_table, "{text}");
        }
    }

    #[test]
    fn names_may_follow_other_lines() {
        let want = [[1.5, 2.0, 3.0], [4.0, 5.0, 6.5]];
        for (text, unit) in [
            (
                "Export of 3 points\nDate;2020-01-01\nX;Y;Z\n1,5;2;3\n4;5;6,5\n",
                None,
            ),
            (
                "a title of words\nNo;X [cm];Y [cm];Z [cm]\nP1;1.5;2;3\nP2;4;5;6.5\n",
                Some("cm"),
            ),
            ("x,y,z\nmm,mm,mm\n1.5,2,3\n4,5,6.5\n", Some("mm")),
            (
                "Nr X Y Z\n[] [in] [in] [in]\n1 1.5 2 3\n2 4 5 6.5\n",
                Some("in"),
            ),
            ("Point # X Y Z\n1 1.5 2 3\n2 4 5 6.5\n", None),
            ("Point #,X,Y,Z\nP#1,1.5,2,3\nP#2,4,5,6.5\n", None),
            (
                "\"Name\",\"X\",\"Y\",\"Z\"\n\"a,\"\"b\"\"\",\"1,5\",\"2\",\"3\"\nc,4,5,\"6,5\"\n",
                None,
            ),
            ("# x y z t\n# of 5 points\n1.5 2 3 0\n4 5 6.5 0\n", None),
            ("A1 1.5 2 3\nA2 4 5 6.5\n", None),
            ("Point 1\t1.5\t2\t3\nPoint 2\t4\t5\t6.5\n", None),
        ] {
            let (cloud, report) = read_as("t.txt", text).unwrap_or_else(|e| panic!("{text}{e}"));
            assert_eq!(cloud.points, want, "{text}");
            assert_eq!(report.units.as_deref(), unit, "{text}");
        }
        // The first row may leave out the last column.
        let (cloud, report) = read_as("t.csv", "x,y,z,t\n1,2,3,\n4,5,6,7\n").expect("valid");
        assert_eq!(
            (&*cloud.columns[0].name, cloud.columns[0].values[1]),
            ("t", 7.0)
        );
        assert_eq!(report.warnings.len(), 1, "{:?}", report.warnings);
        for text in [
            "1 2\n3 4 5\n",
            "v 1 2 3\n",
            "1,2\n3,4\nx,y,z\n",
            "x,y,z\n1,2,a\n",
        ] {
            assert_eq!(read_as("t.txt", text).expect_err(text).code(), "bad-number");
        }
    }

    #[test]
    fn a_column_that_counts_is_no_coordinate() {
        let told = |rows: &[&str]| {
            let (cloud, report) = read_as("t.xyz", &rows.join("\n")).expect("valid");
            (
                cloud.points[0],
                report
                    .warnings
                    .iter()
                    .any(|w| w.contains("counts the rows")),
            )
        };
        let counted = ([1.5, 2.5, 3.5], true);
        let rows = ["1.5 2.5 3.5", "2 1 7", "9 4.5 0", "1 1 0"];
        let numbered = |numbers: [i32; 4]| {
            let row = |(n, r): (&i32, &&str)| format!("{n} {r}");
            let rows: Vec<String> = numbers.iter().zip(&rows).map(row).collect();
            told(&rows.iter().map(|r| &**r).collect::<Vec<_>>())
        };
        for numbers in [
            [1, 2, 3, 4],
            [0, 1, 2, 3],
            [-7, -6, -5, -4],
            [100, 104, 105, 109],
        ] {
            assert_eq!(numbered(numbers), counted, "{numbers:?}");
        }
        assert!(!numbered([1, 2, 4, 3]).1 && !numbered([1, 2, 2, 3]).1);
        // Integer coordinates, as in micrometres.
        assert_eq!(
            told(&["7 20 31 4", "8 22 30 9", "9 11 7 5", "10 3 8 1"]),
            ([20.0, 31.0, 4.0], true)
        );
        // A profile with the intensity of each point, and a diagonal.
        assert!(
            !told(&[
                "0 5 1.5 0.25",
                "1 5 1.25 0.5",
                "2 5 1 0.5",
                "3 5 1.75 0.125"
            ])
            .1
        );
        assert!(!told(&["0 0 0 8", "1 1 1 9", "2 2 2 7", "3 3 3 8"]).1);
        // Names take precedence.
        let named = "x y z t\n1 1.5 2.5 3.5\n2 2 1 7\n3 9 4.5 0\n4 1 1 0\n";
        assert_eq!(points(named)[0], [1.0, 1.5, 2.5]);
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
