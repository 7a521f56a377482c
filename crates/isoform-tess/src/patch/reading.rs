//! Files of patches and of NURBS surfaces.

use super::spline::segment;
use super::{ControlPoint, Patch};
use crate::map::MAX_DEGREE;
use isoform_algebra::RBig;
use serde_json::Value;

/// Bézier patches of one NURBS surface at most: a file of a few kilobytes may ask for more than
/// memory holds.
const MAX_PATCHES: usize = 100_000;

/// What is wrong with a file of patches.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: {problem}")]
pub struct PatchFileError {
    /// Which patch or surface, and which of its keys.
    pub at: String,
    /// What is wrong there.
    pub problem: String,
}

fn wrong<T>(at: impl Into<String>, problem: impl Into<String>) -> Result<T, PatchFileError> {
    Err(PatchFileError {
        at: at.into(),
        problem: problem.into(),
    })
}

/// Whether a JSON document is one of patches or of NURBS surfaces, not of a map.
pub fn is_patch_file(json: &Value) -> bool {
    ["patches", "nurbs", "knots_u"]
        .iter()
        .any(|key| json.get(key).is_some())
}

/// The patches of a document: {"patches": \[{"degree": \[m, n\], "control": rows}, …\]} as `isoform
/// parameterize` writes it, with control points \[x·w, y·w, z·w, w\]; or {"nurbs": \[{"degree":
/// \[p, q\], "knots_u": …, "knots_v": …, "points": rows of \[x, y, z\], "weights": rows}, …\]}, or
/// one such surface alone. Numbers are taken as the exact values of their doubles; other keys are
/// ignored.
///
/// # Errors
/// [`PatchFileError`].
pub fn read_patches(json: &Value) -> Result<Vec<Patch>, PatchFileError> {
    let listed = |key: &str| match json.get(key) {
        None => Ok(&[][..]),
        Some(Value::Array(list)) => Ok(list.as_slice()),
        Some(_) => wrong(key, "a list is expected"),
    };
    let mut patches = Vec::new();
    for (k, value) in listed("patches")?.iter().enumerate() {
        patches.push(bezier(value, &format!("patch {}", k + 1))?);
    }
    let alone = json.get("knots_u").map(|_| json);
    for (k, value) in listed("nurbs")?.iter().chain(alone).enumerate() {
        patches.extend(nurbs(value, &format!("nurbs {}", k + 1))?);
    }
    if patches.is_empty() {
        wrong("the file", "no patch is in it")
    } else {
        Ok(patches)
    }
}

fn number(value: &Value) -> Option<RBig> {
    value.as_f64().and_then(|x| RBig::try_from(x).ok())
}
fn numbers(value: Option<&Value>, at: &str) -> Result<Vec<RBig>, PatchFileError> {
    let list = value
        .and_then(Value::as_array)
        .and_then(|list| list.iter().map(number).collect());
    list.map_or_else(|| wrong(at, "a list of numbers is expected"), Ok)
}
/// The rows of points or weights under a key.
fn rows<'a>(value: &'a Value, key: &str, at: &str) -> Result<Vec<&'a [Value]>, PatchFileError> {
    let slice = |r: &'a Value| r.as_array().map(Vec::as_slice);
    let list = value.get(key).and_then(slice).unwrap_or_default();
    let rows: Option<Vec<&[Value]>> = list.iter().map(slice).collect();
    let rows = rows.unwrap_or_default();
    let columns = rows.first().map_or(0, |r| r.len());
    if columns > 0 && rows.iter().all(|r| r.len() == columns) {
        Ok(rows)
    } else {
        wrong(format!("{at}, {key}"), "rows of one length are expected")
    }
}
fn degree(value: &Value, at: &str) -> Result<[usize; 2], PatchFileError> {
    let at = format!("{at}, degree");
    let list = value.get("degree").and_then(Value::as_array);
    let numbers: Option<Vec<u64>> = list.and_then(|l| l.iter().map(Value::as_u64).collect());
    match numbers.as_deref() {
        Some(&[m, n]) if m > 0 && n > 0 && m.saturating_add(n) <= MAX_DEGREE as u64 => {
            Ok([m as usize, n as usize])
        }
        Some([_, _]) => wrong(
            at,
            format!("both are at least 1, and at most {MAX_DEGREE} together"),
        ),
        _ => wrong(at, "two whole numbers are expected"),
    }
}

/// Homogeneous control points, row by row.
struct Net {
    rows: usize,
    columns: usize,
    points: Vec<ControlPoint>,
}

impl Net {
    /// The control points of a patch or surface, from `control`, or from `points` and `weights`.
    fn read(value: &Value, at: &str) -> Result<Self, PatchFileError> {
        if value.get("control").is_some() {
            Self::homogeneous(value, at)
        } else {
            Self::weighted(value, at)
        }
    }
    fn homogeneous(value: &Value, at: &str) -> Result<Self, PatchFileError> {
        let rows = rows(value, "control", at)?;
        let mut points = Vec::new();
        for (i, p) in rows.iter().flat_map(|r| r.iter()).enumerate() {
            points.push(point(p, || format!("{at}, control point {}", i + 1))?);
        }
        Ok(Self {
            rows: rows.len(),
            columns: rows[0].len(),
            points,
        })
    }
    fn weighted(value: &Value, at: &str) -> Result<Self, PatchFileError> {
        let all = rows(value, "points", at)?;
        let weights = match value.get("weights") {
            Some(_) => Some(rows(value, "weights", at)?),
            None => None,
        };
        let is_other = |w: &Vec<&[Value]>| w.len() != all.len() || w[0].len() != all[0].len();
        if weights.as_ref().is_some_and(is_other) {
            return wrong(
                format!("{at}, weights"),
                "as many are expected as there are points",
            );
        }
        let mut points = Vec::new();
        for (i, row) in all.iter().enumerate() {
            for (j, p) in row.iter().enumerate() {
                let [x, y, z] = point(p, || format!("{at}, point {} {}", i + 1, j + 1))?;
                let w = match &weights {
                    None => Some(RBig::ONE),
                    Some(w) => number(&w[i][j]),
                };
                let Some(w) = w else {
                    let at = format!("{at}, weight {} {}", i + 1, j + 1);
                    return wrong(at, "a number is expected");
                };
                points.push([x * &w, y * &w, z * &w, w]);
            }
        }
        Ok(Self {
            rows: all.len(),
            columns: all[0].len(),
            points,
        })
    }
    fn column(&self, j: usize) -> Vec<ControlPoint> {
        let column = self.points.iter().skip(j).step_by(self.columns);
        column.cloned().collect()
    }
}

/// The coordinates of a point; `at` names it.
fn point<const N: usize>(
    value: &Value,
    at: impl Fn() -> String,
) -> Result<[RBig; N], PatchFileError> {
    let list = numbers(Some(value), &at())?;
    let count = list.len();
    <[RBig; N]>::try_from(list)
        .or_else(|_| wrong(at(), format!("{N} numbers are expected, {count} are there")))
}

fn bezier(value: &Value, at: &str) -> Result<Patch, PatchFileError> {
    let [m, n] = degree(value, at)?;
    let net = Net::read(value, at)?;
    let (rows, columns) = (net.rows, net.columns);
    if [rows, columns] != [m + 1, n + 1] {
        let expected = format!("{} × {} points are expected", m + 1, n + 1);
        let problem = format!("{expected}, {rows} × {columns} are there");
        return wrong(format!("{at}, control"), problem);
    }
    Ok(Patch {
        name: at.to_owned(),
        degree: [m, n],
        control: net.points,
    })
}

/// The knots of a B-spline with a number of points.
struct Knots {
    degree: usize,
    list: Vec<RBig>,
}

impl Knots {
    fn read(
        value: &Value,
        degree: usize,
        points: usize,
        at: String,
    ) -> Result<Self, PatchFileError> {
        let list = numbers(Some(value), &at)?;
        let count = points + degree + 1;
        if points <= degree {
            let problem = format!("{points} points are too few for degree {degree}");
            return wrong(at, problem);
        }
        if list.len() != count {
            let problem = format!("{count} knots are expected, {} are there", list.len());
            return wrong(at, problem);
        }
        if list.windows(2).any(|w| w[0] > w[1]) {
            return wrong(at, "knots must not decrease");
        }
        if list[degree] == list[points] {
            return wrong(at, "the knots leave no interval");
        }
        if list.windows(degree + 2).any(|w| w[0] == w[degree + 1]) {
            return wrong(at, format!("a knot occurs more than {} times", degree + 1));
        }
        Ok(Self { degree, list })
    }
    /// The knots that another one follows at a distance, where the spline is defined.
    fn spans(&self) -> Vec<usize> {
        let places = self.degree..self.list.len() - self.degree - 1;
        let spans = places.filter(|&i| self.list[i] < self.list[i + 1]);
        spans.collect()
    }
    /// The Bézier points between a knot and the next.
    fn segment(&self, points: &[ControlPoint], span: usize) -> Vec<ControlPoint> {
        segment(self.degree, &self.list, points, span)
    }
}

/// The Bézier patches between the knots.
fn nurbs(value: &Value, at: &str) -> Result<Vec<Patch>, PatchFileError> {
    let [p, q] = degree(value, at)?;
    let net = Net::read(value, at)?;
    let knots = |key: &str, degree: usize, points: usize| {
        let list = value.get(key).unwrap_or(&Value::Null);
        Knots::read(list, degree, points, format!("{at}, {key}"))
    };
    let (u, v) = (
        knots("knots_u", p, net.rows)?,
        knots("knots_v", q, net.columns)?,
    );
    let (u_spans, v_spans) = (u.spans(), v.spans());
    if u_spans.len() * v_spans.len() > MAX_PATCHES {
        return wrong(at, format!("more than {MAX_PATCHES} patches"));
    }
    let mut patches = Vec::new();
    for (a, &k) in u_spans.iter().enumerate() {
        // Bézier in u, with all columns.
        let columns = (0..net.columns).map(|j| u.segment(&net.column(j), k));
        let columns: Vec<Vec<ControlPoint>> = columns.collect();
        for (b, &l) in v_spans.iter().enumerate() {
            let row = |i: usize| columns.iter().map(|c| c[i].clone()).collect::<Vec<_>>();
            patches.push(Patch {
                name: format!("{at}, span {} {}", a + 1, b + 1),
                degree: [p, q],
                control: (0..=p).flat_map(|i| v.segment(&row(i), l)).collect(),
            });
        }
    }
    Ok(patches)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patch::patch_bounds;
    use crate::patch::tests::eval;
    use serde_json::json;

    /// A B-spline by the recursion of Cox and de Boor, in doubles.
    fn spline(p: usize, knots: &[f64], k: usize, x: f64) -> f64 {
        if p == 0 {
            return f64::from(u8::from(knots[k] <= x && x < knots[k + 1]));
        }
        let ramp = |a: f64, b: f64| if a == b { 0.0 } else { (x - a) / (b - a) };
        ramp(knots[k], knots[k + p]) * spline(p - 1, knots, k, x)
            + (1.0 - ramp(knots[k + 1], knots[k + p + 1])) * spline(p - 1, knots, k + 1, x)
    }

    #[test]
    fn nurbs_are_their_patches() {
        // Not clamped in u; a double knot in v.
        let (u, v) = (
            [0.0, 1.0, 2.5, 3.0, 4.0, 6.0, 7.0],
            [0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0],
        );
        let (p, q, rows, columns) = (2, 2, 4, 5);
        let point = |i: usize, j: usize| [i as f64, j as f64, ((3 * i + 5 * j * j) % 7) as f64];
        let weight = |i: usize, j: usize| 1.0 + 0.25 * ((i + 2 * j) % 3) as f64;
        let grid = |f: &dyn Fn(usize, usize) -> Value| {
            (0..rows)
                .map(|i| (0..columns).map(|j| f(i, j)).collect())
                .collect::<Vec<Vec<Value>>>()
        };
        let file = json!({"degree": [p, q], "knots_u": u, "knots_v": v,
            "points": grid(&|i, j| json!(point(i, j))), "weights": grid(&|i, j| json!(weight(i, j)))});
        assert!(is_patch_file(&file));
        let patches = read_patches(&file).expect("patches");
        assert_eq!(patches.len(), 2 * 2);
        for (k, patch) in patches.iter().enumerate() {
            let ([u0, u1], [v0, v1]) = (
                [[2.5, 3.0], [3.0, 4.0]][k / 2],
                [[0.0, 0.5], [0.5, 1.0]][k % 2],
            );
            for (s, t) in [(0.0, 0.0), (0.25, 0.5), (0.75, 0.125)] {
                let (x, y) = (u0 + s * (u1 - u0), v0 + t * (v1 - v0));
                let mut sum = [0.0; 4];
                for i in 0..rows {
                    for j in 0..columns {
                        let b = spline(p, &u, i, x) * spline(q, &v, j, y) * weight(i, j);
                        (0..3).for_each(|c| sum[c] += b * point(i, j)[c]);
                        sum[3] += b;
                    }
                }
                let on = eval(patch, s, t);
                assert!(
                    (0..3).all(|c| (on[c] - sum[c] / sum[3]).abs() < 1e-13),
                    "{k} {s} {t}: {on:?} {sum:?}"
                );
            }
        }
        // Neighbours have their sides in common, exactly.
        assert!(
            patches[0]
                .side(1)
                .iter()
                .eq(patches[2].side(3).iter().rev())
        );
        assert!(
            patches[0]
                .side(2)
                .iter()
                .eq(patches[1].side(0).iter().rev())
        );
    }

    /// What the fuzzing target does, on its seeds.
    #[test]
    fn the_corpus_is_read() {
        let folder =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/read_patches");
        for entry in std::fs::read_dir(folder).expect("a corpus") {
            let text = std::fs::read(entry.expect("an entry").path()).expect("readable");
            let Ok(json) = serde_json::from_slice(&text) else {
                continue;
            };
            if let Ok(patches) = read_patches(&json) {
                patch_bounds(&patches);
                assert!(
                    is_patch_file(&json)
                        && patches.iter().all(
                            |p| p.map().is_ok() || p.map().is_err_and(|e| !e.code().is_empty())
                        )
                );
            }
        }
    }

    #[test]
    fn files_that_are_wrong_are_refused() {
        let points = json!([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]);
        let knots = json!([0, 0, 1, 1]);
        for (file, at) in [
            (json!({"patches": []}), "the file"),
            (json!({"patches": 3}), "patches"),
            (json!({"patches": [{"degree": [1, 1]}]}), "patch 1, points"),
            (
                json!({"patches": [{"degree": [0, 1], "control": []}]}),
                "patch 1, degree",
            ),
            (
                json!({"patches": [{"degree": [99, 99], "control": []}]}),
                "patch 1, degree",
            ),
            (
                json!({"patches": [{"degree": [1, 2], "points": points}]}),
                "patch 1, control",
            ),
            (
                json!({"patches": [{"degree": [1, 1], "control": points}]}),
                "patch 1, control point 1",
            ),
            (
                json!({"nurbs": [{"degree": [1, 1], "knots_u": knots, "points": points}]}),
                "nurbs 1, knots_v",
            ),
            (
                json!({"nurbs": [{"degree": [1, 1], "knots_u": [0, 0, 1], "knots_v": knots, "points": points}]}),
                "nurbs 1, knots_u",
            ),
            (
                json!({"nurbs": [{"degree": [1, 1], "knots_u": [0, 1, 0, 1], "knots_v": knots, "points": points}]}),
                "nurbs 1, knots_u",
            ),
            (
                json!({"nurbs": [{"degree": [1, 1], "knots_u": [0, 1, 1, 2], "knots_v": knots, "points": points}]}),
                "nurbs 1, knots_u",
            ),
            (
                json!({"nurbs": [{"degree": [1, 1], "knots_u": ["0", 0, 1, 1], "knots_v": knots, "points": points}]}),
                "nurbs 1, knots_u",
            ),
            (
                json!({"nurbs": [{"degree": [2, 1], "knots_u": knots, "knots_v": knots, "points": points}]}),
                "nurbs 1, knots_u",
            ),
            (
                json!({"degree": [1, 1], "knots_u": knots, "knots_v": knots, "points": points, "weights": [[1, 1]]}),
                "nurbs 1, weights",
            ),
        ] {
            assert_eq!(read_patches(&file).expect_err("wrong").at, at, "{file}");
        }
    }
}
