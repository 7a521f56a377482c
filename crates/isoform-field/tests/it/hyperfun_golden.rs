//! Comparison of HyperFun programs with values of the reference implementation, in
//! tests/data/hyperfun.

use isoform_field::Graph;
use isoform_field::hyperfun::{Mode, Model};
use std::fs;
use std::path::Path;

struct Golden {
    tolerance: f64,
    columns: usize,
    blocks: Vec<(Vec<f64>, Vec<Vec<f64>>)>,
}

fn numbers(text: &str) -> Vec<f64> {
    text.split(',')
        .map(|w| {
            w.trim()
                .parse()
                .unwrap_or_else(|_| panic!("{w} is no number"))
        })
        .collect()
}

fn golden(path: &Path) -> Golden {
    let mut g = Golden {
        tolerance: f64::NAN,
        columns: 0,
        blocks: Vec::new(),
    };
    for line in fs::read_to_string(path).expect("readable").lines() {
        if let Some(a) = line.strip_prefix("# a:") {
            g.blocks.push((numbers(a), Vec::new()));
        } else if let Some(columns) = line.strip_prefix("# columns:") {
            g.columns = columns
                .split(',')
                .position(|c| c.trim() == "f")
                .expect("a column f");
        } else if let Some((_, t)) = line.split_once("|df| <= ") {
            g.tolerance = t
                .split('*')
                .next()
                .and_then(|t| t.parse().ok())
                .expect("a tolerance");
        } else if !line.starts_with('#') && !line.is_empty() {
            g.blocks.last_mut().expect("a block").1.push(numbers(line));
        }
    }
    g
}

fn model(path: &Path, mode: Mode) -> Model {
    let text = fs::read_to_string(path).expect("readable");
    Model::parse(&text, mode).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Compares the strict value and the attributes with the table, and the expression with the
/// interpreter in both modes. Returns the number of compared values.
fn check(hf: &Path) -> usize {
    let table = golden(&hf.with_extension("csv"));
    let mut compared = 0;
    for mode in [Mode::Strict, Mode::Default] {
        let m = model(hf, mode);
        let mut graph = Graph::new();
        let root = m.compile(&mut graph);
        let mut evaluator = m.evaluator::<f64>();
        for (a, rows) in &table.blocks {
            for row in rows {
                let (x, want) = row.split_at(table.columns);
                let place = || format!("{} {mode:?} a = {a:?} x = {x:?}", hf.display());
                let f = evaluator
                    .eval(x, a, &[])
                    .unwrap_or_else(|e| panic!("{}: {e}", place()));
                if let Ok(root) = root {
                    let g = graph.eval(root, x, a);
                    assert!(
                        (g - f).abs() <= 1e-12 * f.abs().max(1.0),
                        "{}: expression {g}, program {f}",
                        place()
                    );
                }
                if mode == Mode::Strict {
                    assert!(
                        (f - want[0]).abs() <= table.tolerance * want[0].abs().max(1.0),
                        "{}: {f} for {}",
                        place(),
                        want[0]
                    );
                    for (s, want) in evaluator.attributes().iter().zip(&want[1..]) {
                        assert!(
                            (s - want).abs() <= table.tolerance * want.abs().max(1.0),
                            "{}: {s} for {want}",
                            place()
                        );
                    }
                    compared += 1;
                }
            }
        }
        // Printed programs are equivalent.
        let pretty = m.pretty();
        let again = Model::parse(&pretty, mode)
            .unwrap_or_else(|e| panic!("{}: {e}\n{pretty}", hf.display()));
        assert_eq!(again.pretty(), pretty);
        let (a, rows) = &table.blocks[0];
        let fitted = Model::parse(&m.print_fitted(a, None), mode)
            .unwrap_or_else(|e| panic!("{}: {e}", hf.display()));
        for row in rows.iter().take(5) {
            let x = &row[..table.columns];
            let defaults = fitted.params().iter().map(|p| p.typical.unwrap_or(0.0));
            let defaults: Vec<f64> = defaults.collect();
            let f = m.eval(x, a, &[]).expect("it ran before");
            assert_eq!(again.eval(x, a, &[]), Ok(f.clone()));
            assert_eq!(fitted.eval(x, &defaults, &[]), Ok(f));
        }
    }
    compared
}

#[test]
fn golden_values() {
    let found = isoform_testdata::files("hyperfun", "hf");
    assert_eq!(found.len(), 119, "golden models");
    let compared: usize = found.iter().map(|hf| check(hf)).sum();
    println!("{compared} values of {} models", found.len());
    assert_eq!(compared, 119 * 40, "rows of the tables");
}
