//! `isoform eval`: the values of a model at points.

use crate::context::Context;
use crate::disk;
use crate::failure::{DONE, Failure, NO_RESULT, PARTIAL};
use crate::gallery;
use crate::language::Language;
use crate::model::GivenModel;
use crate::outcome::Outcome;
use crate::parameters::{Given, values};
use isoform::field::hyperfun::{BlockEvaluator, Model, Pose};
use isoform::fit::Template;
use isoform::geom::{Field, ParamField};
use isoform::{FrepTemplate, Implicit, SplineDistance};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Evaluates a model at points
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  isoform eval part.hf --points scan.csv --params 1,2,0.5 -o values.csv

POINTS: one point per line, x,y,z (as many columns as the model has coordinates; further columns, empty lines and
lines with # are ignored). The table has the header x,y,z,f and a row per point with numbers that read back exactly;
where a model has attributes, s1, s2, ... follow f. Where the evaluation fails, f is error:LINE:COLUMN:message.

Exit code: 0, or 3 if some rows failed, 4 if all did.")]
pub(crate) struct Args {
    /// The model: a HyperFun program (- for stdin), a formula, or a function of implicitize (.json)
    model: PathBuf,
    /// The points, a table with commas (- for stdin)
    #[arg(long, value_name = "POINTS")]
    points: PathBuf,
    #[command(flatten)]
    language: Language,
    #[command(flatten)]
    given: Given,
    /// Result per point: the model's own value, its distance-like reading, or the name of the
    /// nearest part
    #[arg(long, value_enum, default_value_t = Quantity::Algebraic)]
    reading: Quantity,
    /// The table, - or nothing for stdout
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Result that is computed for each point.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Quantity {
    Algebraic,
    Metric,
    Part,
}

/// Rows per task: enough to make up for the start of one, few enough to share among threads.
const CHUNK: usize = 2048;

/// A point as written and as numbers.
struct PointRow<'t> {
    /// Coordinates as written in the input; the table repeats them.
    text: Vec<&'t str>,
    /// Coordinates of the point.
    x: Vec<f64>,
}

/// Result at a point: a number or the name of a part, with the attributes after it, or an error.
enum PointResult {
    /// A number.
    Value(f64, Vec<f64>),
    /// The name of a part.
    Part(String, Vec<f64>),
    /// Why there is neither, with line and column in the program.
    Error(String),
}

impl PointResult {
    /// Returns the reason for a missing value.
    fn error(&self) -> Option<&str> {
        match self {
            Self::Error(error) => Some(error),
            Self::Value(..) | Self::Part(..) => None,
        }
    }

    /// Writes the cell and its attributes, whose fields are empty behind an error, into a row of a
    /// table.
    fn write(&self, attributes: usize, text: &mut String) {
        let values = match self {
            Self::Value(f, s) => {
                *text += &format!("{f:?}");
                s
            }
            Self::Part(name, s) => {
                *text += &quoted(name);
                s
            }
            Self::Error(e) => {
                *text += &quoted(e);
                *text += &",".repeat(attributes);
                return;
            }
        };
        for v in values {
            *text += &format!(",{v:?}");
        }
    }
}

/// Runs the verb.
pub(crate) fn run(args: &Args, context: &Context) -> Result<Outcome, Failure> {
    if args.model == Path::new("-") && args.points == Path::new("-") {
        return Err(
            Failure::usage("model and points cannot both be -").why("stdin can be read only once")
        );
    }
    let table = disk::text(disk::read_file(&args.points)?);
    let model = gallery::model(&args.model, &args.language, context)?;
    if let GivenModel::Fitted(spline) = model {
        let rows = points(&args.points, &table, 3)?;
        let cells = cells_of_spline(*spline, args.reading, &rows, context);
        let subject = EvaluatedModel {
            name: "surface",
            values: &[],
            dimension: 3,
            attributes: 0,
        };
        return outcome(args, &subject, &rows, &cells, context);
    }
    let model = model.into_written(&args.model)?;
    let a = values(&model, &args.given, context)?;
    let rows = points(&args.points, &table, model.dimension())?;
    let cells = cells(args, &model, &rows, &a, context)?;
    let subject = EvaluatedModel {
        name: model.name(),
        values: &a,
        dimension: model.dimension(),
        attributes: model.n_attributes(),
    };
    outcome(args, &subject, &rows, &cells, context)
}

/// Model that is evaluated, with its values.
struct EvaluatedModel<'m> {
    name: &'m str,
    /// Values of the parameters.
    values: &'m [f64],
    /// Number of its coordinates.
    dimension: usize,
    /// Number of its attributes.
    attributes: usize,
}

/// Makes the table of the results, and writes it if an output is named.
fn outcome(
    args: &Args,
    subject: &EvaluatedModel<'_>,
    rows: &[PointRow<'_>],
    cells: &[PointResult],
    context: &Context,
) -> Result<Outcome, Failure> {
    let (name, a) = (subject.name, subject.values);
    let failures = Failures::new(cells);
    failures.warn(context);
    context.note(format_args!(
        "{} rows of `{name}` with a = {a:?}",
        cells.len()
    ));
    let (columns, csv) = csv(subject, rows, cells);
    let mut json = json!({
        "object": name,
        "parameters": a,
        "rows": cells.len(),
        "failed": failures.count,
        "columns": columns,
    });
    let file = args.output.as_deref().filter(|p| *p != Path::new("-"));
    let stdout = if let Some(path) = file {
        disk::write_file(path, csv.as_bytes())?;
        json["output"] = json!(path.display().to_string());
        Vec::new()
    } else {
        let rows = rows.iter().zip(cells);
        json["table"] = rows.map(|(row, cell)| json_row(row, cell)).collect();
        csv.into_bytes()
    };
    let exit = failures.exit();
    if exit == NO_RESULT {
        json["error"] = json!({"code": "evaluation", "message": "every row failed", "where": {}, "why": failures.first, "hint": "see the f column"});
    }
    Ok(Outcome { exit, json, stdout })
}

/// Evaluates every row in the requested reading; chunks of rows run in parallel.
fn cells(
    args: &Args,
    model: &Model,
    rows: &[PointRow<'_>],
    a: &[f64],
    context: &Context,
) -> Result<Vec<PointResult>, Failure> {
    let template = (args.reading != Quantity::Algebraic)
        .then(|| template(&args.model, model))
        .transpose()?;
    let of_chunk = |rows: &[PointRow<'_>]| {
        let mut cells = evaluate(model, rows, a, context);
        if let Some(template) = &template {
            read_otherwise(template, args.reading, rows, a, &mut cells);
        }
        cells
    };
    Ok(rows.par_chunks(CHUNK).flat_map_iter(of_chunk).collect())
}

/// The cells of a function fitted to points; chunks of rows run in parallel.
fn cells_of_spline(
    spline: Implicit,
    reading: Quantity,
    rows: &[PointRow<'_>],
    context: &Context,
) -> Vec<PointResult> {
    let metric = SplineDistance(spline);
    let of_row = |row: &PointRow<'_>| {
        if context.is_late() {
            return PointResult::Error("error:1:1:not reached within the time limit".to_owned());
        }
        let p = [row.x[0], row.x[1], row.x[2]];
        let mut distance = [0.0];
        match reading {
            Quantity::Algebraic => PointResult::Value(metric.0.value(p), Vec::new()),
            Quantity::Metric => {
                metric.values(&[p], &[], &mut distance);
                PointResult::Value(distance[0], Vec::new())
            }
            Quantity::Part if metric.0.is_seen(p) => {
                PointResult::Part("surface".to_owned(), Vec::new())
            }
            Quantity::Part => PointResult::Part("unseen".to_owned(), Vec::new()),
        }
    };
    rows.par_iter().with_min_len(CHUNK).map(of_row).collect()
}

/// The rows without a value.
struct Failures<'c> {
    /// Rows that failed.
    count: usize,
    /// The number of all rows.
    rows: usize,
    /// Why the first of them failed.
    first: Option<&'c str>,
}

impl<'c> Failures<'c> {
    /// The failures among all cells.
    fn new(cells: &'c [PointResult]) -> Self {
        let mut errors = cells.iter().filter_map(PointResult::error);
        let first = errors.next();
        Self {
            count: errors.count() + usize::from(first.is_some()),
            rows: cells.len(),
            first,
        }
    }
    /// Says how many rows failed.
    fn warn(&self, context: &Context) {
        if let Some(first) = self.first {
            context.warn(format_args!(
                "{} of {} rows failed, the first with {first}",
                self.count, self.rows
            ));
        }
    }
    /// 0 without failures, 4 where every row failed, 3 between.
    fn exit(&self) -> u8 {
        if self.count == 0 {
            DONE
        } else if self.count == self.rows {
            NO_RESULT
        } else {
            PARTIAL
        }
    }
}

/// The model's own values at some rows; rows that the time limit does not let through are errors.
fn evaluate(
    model: &Model,
    rows: &[PointRow<'_>],
    a: &[f64],
    context: &Context,
) -> Vec<PointResult> {
    let mut evaluator = model.block_evaluator();
    let mut cells = Vec::with_capacity(rows.len());
    for block in rows.chunks(BlockEvaluator::POINTS) {
        if context.is_late() {
            let late =
                || PointResult::Error("error:1:1:not reached within the time limit".to_owned());
            cells.extend(block.iter().map(|_| late()));
            continue;
        }
        let points: Vec<&[f64]> = block.iter().map(|row| row.x.as_slice()).collect();
        cells.extend(
            evaluator
                .eval(&points, a)
                .into_iter()
                .map(|found| match found {
                    Ok(e) => PointResult::Value(e.f, e.s),
                    Err(e) => {
                        PointResult::Error(format!("error:{}:{}:{}", e.line, e.column, e.message))
                    }
                }),
        );
    }
    cells
}

/// The model compiled for its metric and parts readings.
fn template(path: &Path, model: &Model) -> Result<FrepTemplate, Failure> {
    FrepTemplate::with_pose(model, Pose::None, &[]).map_err(|e| {
        Failure::input("no-reading", format!("{}: {e}", path.display()))
            .hint("--reading algebraic evaluates every program")
    })
}

/// Replaces the values by the ones of another reading; rows that have no value keep their error.
fn read_otherwise(
    template: &FrepTemplate,
    reading: Quantity,
    rows: &[PointRow<'_>],
    a: &[f64],
    cells: &mut [PointResult],
) {
    let points: Vec<[f64; 3]> = rows.iter().map(|r| [r.x[0], r.x[1], r.x[2]]).collect();
    let (mut distances, mut parts) = (vec![0.0; points.len()], vec![0; points.len()]);
    template.metric().values(&points, a, &mut distances);
    template.parts(&points, a, &mut parts);
    let names = template.part_names();
    for (cell, (distance, part)) in cells.iter_mut().zip(distances.into_iter().zip(parts)) {
        let PointResult::Value(_, s) = cell else {
            continue;
        };
        let s = std::mem::take(s);
        *cell = match reading {
            Quantity::Part => PointResult::Part(names[part as usize].clone(), s),
            _ => PointResult::Value(distance, s),
        };
    }
}

/// Names of the coordinates.
fn coordinates(dimension: usize) -> Vec<String> {
    match dimension {
        1..=3 => ["x", "y", "z"][..dimension]
            .iter()
            .map(|&s| s.to_owned())
            .collect(),
        _ => (1..=dimension).map(|i| format!("x{i}")).collect(),
    }
}

/// Reads the first `dimension` columns of a table. A first line that holds the names of the
/// coordinates is a header.
fn points<'t>(path: &Path, table: &'t str, dimension: usize) -> Result<Vec<PointRow<'t>>, Failure> {
    let table = table.strip_prefix('\u{feff}').unwrap_or(table);
    let lines = table.lines().enumerate();
    let mut lines = lines.filter(|(_, line)| holds_data(line)).peekable();
    let names = coordinates(dimension);
    lines.next_if(|(_, line)| is_header(&words(line, dimension), &names));
    lines
        .map(|(i, line)| {
            row(line, dimension).map_err(|Fault { at, message }| {
                let column = line[..at.min(line.len())].chars().count() + 1;
                Failure::input("points", message)
                    .at(path, i + 1, column)
                    .drawn(line)
            })
        })
        .collect()
}

/// Returns true if a line is neither empty nor a comment.
fn holds_data(line: &str) -> bool {
    !line.trim().is_empty() && !line.trim_start().starts_with('#')
}

/// Returns true if the words of a line are the names of the coordinates, in quotes or not.
fn is_header(words: &[&str], names: &[String]) -> bool {
    let words = words.iter().map(|t| t.trim_matches('"'));
    words.eq(names.iter().map(String::as_str))
}

/// The first columns of a line, parted by commas if it holds one, else by spaces, tabs and
/// semicolons.
fn words(line: &str, dimension: usize) -> Vec<&str> {
    if line.contains(',') {
        return line.split(',').map(str::trim).take(dimension).collect();
    }
    let words = line.split([' ', '\t', ';']).filter(|w| !w.is_empty());
    words.take(dimension).collect()
}

/// Error in a line of the input, with its byte position.
struct Fault {
    at: usize,
    message: String,
}

/// The coordinates of a line, which must be finite numbers; further columns are ignored.
fn row(line: &str, dimension: usize) -> Result<PointRow<'_>, Fault> {
    let text = words(line, dimension);
    if text.len() < dimension {
        let count = text.len();
        return Err(Fault {
            at: line.len(),
            message: format!("{count} columns, the model has {dimension} coordinates"),
        });
    }
    let number = |word: &&str| match word.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(Fault {
            at: word.as_ptr() as usize - line.as_ptr() as usize,
            message: format!("`{word}` is not a finite number"),
        }),
    };
    let x = text.iter().map(number).collect::<Result<_, _>>()?;
    Ok(PointRow { text, x })
}

/// The header's names and the table.
fn csv(
    subject: &EvaluatedModel<'_>,
    rows: &[PointRow<'_>],
    cells: &[PointResult],
) -> (Vec<String>, String) {
    let attributes = subject.attributes;
    let mut columns = coordinates(subject.dimension);
    columns.push("f".to_owned());
    columns.extend((1..=attributes).map(|i| format!("s{i}")));
    let mut text = columns.join(",") + "\n";
    for (row, cell) in rows.iter().zip(cells) {
        for word in &row.text {
            text += word;
            text.push(',');
        }
        cell.write(attributes, &mut text);
        text.push('\n');
    }
    (columns, text)
}

/// A field of a table, in quotes where it holds a comma or a quote.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

/// A row of the table in the document: coordinates, value, attributes.
fn json_row(row: &PointRow<'_>, cell: &PointResult) -> Value {
    let mut values: Vec<Value> = row.x.iter().map(|v| json!(v)).collect();
    match cell {
        PointResult::Value(f, s) => {
            values.push(json!(f));
            values.extend(s.iter().map(|v| json!(v)));
        }
        PointResult::Part(name, s) => {
            values.push(json!(name));
            values.extend(s.iter().map(|v| json!(v)));
        }
        PointResult::Error(e) => values.push(json!(e)),
    }
    Value::Array(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_points() {
        let read = |t: &str| {
            points(Path::new("p"), t, 2).map(|r| r.into_iter().map(|r| r.x).collect::<Vec<_>>())
        };
        let ok = |t: &str| read(t).unwrap_or_else(|e| panic!("{}", e.message));
        assert_eq!(
            ok("\u{feff}x,y\r\n# c\n\n1, 2.50 ,z\n-3e1\t4\n"),
            [[1.0, 2.5], [-30.0, 4.0]]
        );
        for (bad, line, column) in [
            ("1,2\n1,oops", 2, 3),
            ("1", 1, 2),
            ("1,nan", 1, 3),
            ("a,b", 1, 1),
            ("é,1", 1, 1),
            ("1,é,2", 1, 3),
        ] {
            let e = read(bad).err().unwrap_or_else(|| panic!("{bad} was read"));
            assert_eq!(
                (e.place.line, e.place.column),
                (Some(line), Some(column)),
                "{bad}"
            );
        }
    }
}
