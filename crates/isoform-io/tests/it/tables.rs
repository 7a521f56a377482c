//! Tables of points as instruments and spreadsheets write them: any order of columns, names, units,
//! separators, quotes and numbers of points give an identical cloud.

use isoform_io::{ReadOptions, Source, read};
use proptest::prelude::*;

/// Style of a table.
#[derive(Clone, Debug)]
struct Style {
    /// Template of the names of coordinates; `#` stands for the letter of the axis.
    name: &'static str,
    /// Unit stated by the names.
    unit: Option<&'static str>,
    /// Separator of fields; `;` and tabs allow decimal commas.
    separator: char,
    is_comma: bool,
    is_quoted: bool,
    /// Kind of the field before the coordinates: 0 for none, a number, or a word.
    id: usize,
    /// First row number.
    start: i64,
    /// Order of the axes.
    order: [usize; 3],
    /// Lines before the names.
    before: &'static str,
    /// True without names.
    is_bare: bool,
}

fn style() -> impl Strategy<Value = Style> {
    let names = prop::sample::select(vec![
        ("#", None),
        ("# [mm]", Some("mm")),
        ("#_mm", Some("mm")),
        ("# (inch)", Some("in")),
        ("# in m", Some("m")),
        ("#/cm", Some("cm")),
        ("Pos#", None),
        ("#-Koordinate", None),
        ("Measured #", None),
    ]);
    let orders = vec![
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ];
    let before = vec![
        "",
        "Report\n",
        "Date;2026-01-02;12:30\n\nThree words here\n",
    ];
    (
        (
            names,
            prop::sample::select(vec![',', ';', '\t']),
            any::<bool>(),
            any::<bool>(),
        ),
        (0..3_usize, -5..100_i64, prop::sample::select(orders)),
        (prop::sample::select(before), any::<bool>()),
    )
        .prop_map(
            |((name, separator, is_comma, is_quoted), (id, start, order), (before, bare))| {
                let is_bare = bare && before.is_empty();
                Style {
                    name: name.0,
                    unit: name.1.filter(|_| !is_bare),
                    separator,
                    // Between commas only quoted fields can have decimal commas.
                    is_comma: is_comma && (separator != ',' || is_quoted),
                    is_quoted,
                    id,
                    start,
                    order: if is_bare { [0, 1, 2] } else { order },
                    before,
                    is_bare,
                }
            },
        )
}

impl Style {
    fn line(&self, id: &str, fields: [String; 3], extra: &str) -> String {
        let mut all: Vec<String> = if self.id > 0 {
            vec![id.to_owned()]
        } else {
            Vec::new()
        };
        all.extend(fields);
        all.push(extra.to_owned());
        if self.is_quoted {
            all.iter_mut().for_each(|f| *f = format!("\"{f}\""));
        }
        all.join(&self.separator.to_string()) + "\n"
    }

    fn table(&self, points: &[[f64; 3]]) -> String {
        let mut text = self.before.to_owned();
        if !self.is_bare {
            let name = |k: usize| self.name.replace('#', ["X", "Y", "Z"][k]);
            text += &self.line("Point ID", self.order.map(name), "Remark no");
        }
        for (i, p) in points.iter().enumerate() {
            let number = self.start + i as i64;
            let id = if self.id == 1 {
                number.to_string()
            } else {
                format!("P{number}")
            };
            let field = |k: usize| match self.is_comma {
                true => p[k].to_string().replace('.', ","),
                false => p[k].to_string(),
            };
            text += &self.line(&id, self.order.map(field), "0");
        }
        text
    }
}

proptest! {
    #[test]
    fn tables_of_any_style_are_one_cloud(
        style in style(),
        points in prop::collection::vec(prop::array::uniform3(-50_000..50_000_i32), 5..30),
    ) {
        // Three decimals; all coordinates of the first point have fractions.
        let mut points: Vec<[f64; 3]> =
            points.into_iter().map(|p| p.map(|v| f64::from(v) / 1000.0)).collect();
        points[0] = [0.5, -1.25, 3.375];
        let text = style.table(&points);
        let source = Source::Bytes { name: "t.csv", bytes: text.as_bytes() };
        let told = read(source, None, &ReadOptions::default());
        let (cloud, report) = told.map_err(|e| TestCaseError::fail(format!("{e}\n{text}")))?;
        prop_assert_eq!(&cloud.points, &points, "{}", text);
        prop_assert_eq!(report.units.as_deref(), style.unit, "{}", text);
        if style.id == 1 && style.is_bare {
            prop_assert!(report.warnings.iter().any(|w| w.contains("counts the rows")));
        }
    }
}
