//! Rational Bézier patches, and those that a NURBS surface consists of, as maps over [0, 1]² with
//! exact coefficients.

use crate::domain::image_bounds;
use crate::map::{MAX_DEGREE, Map, MapError, Options};
use isoform_algebra::{Poly, RBig};
use serde_json::Value;

/// A homogeneous control point: x·w, y·w, z·w, w.
pub type ControlPoint = [RBig; 4];

/// A rational Bézier patch p(s, t) = Σ Bᵢᵐ(s) Bⱼⁿ(t) cᵢⱼ over [0, 1]²; weights may be of any sign.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// `patch 3`, or `nurbs 1, span 2 1`: counted from 1.
    pub name: String,
    degree: [usize; 2],
    /// Row by row of i.
    control: Vec<ControlPoint>,
}

/// What is wrong with a file of patches.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: {problem}")]
pub struct PatchFileError {
    /// Which patch or surface, and which of its keys.
    pub at: String,
    /// What is wrong there.
    pub problem: String,
}

fn wrong<T>(at: &str, problem: impl Into<String>) -> Result<T, PatchFileError> {
    Err(PatchFileError {
        at: at.to_owned(),
        problem: problem.into(),
    })
}

/// Bézier patches of one NURBS surface at most.
const MAX_PATCHES: usize = 100_000;

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
fn rows<'a>(value: &'a Value, key: &str, at: &str) -> Result<Vec<&'a [Value]>, PatchFileError> {
    let list = value.get(key).and_then(Value::as_array);
    let rows: Option<Vec<&[Value]>> =
        list.and_then(|l| l.iter().map(|r| r.as_array().map(Vec::as_slice)).collect());
    match rows {
        Some(rows)
            if rows
                .first()
                .is_some_and(|r| !r.is_empty() && rows.iter().all(|s| s.len() == r.len())) =>
        {
            Ok(rows)
        }
        _ => wrong(&format!("{at}, {key}"), "rows of one length are expected"),
    }
}
fn degree(value: &Value, at: &str) -> Result<[usize; 2], PatchFileError> {
    let list = value
        .get("degree")
        .and_then(Value::as_array)
        .map(Vec::as_slice);
    match list {
        Some([m, n]) => match [m, n].map(Value::as_u64) {
            [Some(m), Some(n)] if m > 0 && n > 0 && m + n <= MAX_DEGREE as u64 => {
                Ok([m as usize, n as usize])
            }
            [Some(_), Some(_)] => wrong(
                &format!("{at}, degree"),
                format!("both are at least 1, and at most {MAX_DEGREE} together"),
            ),
            _ => wrong(&format!("{at}, degree"), "two whole numbers are expected"),
        },
        _ => wrong(&format!("{at}, degree"), "two whole numbers are expected"),
    }
}
/// Rows of homogeneous control points, from `control`, or from `points` and `weights`.
fn control(value: &Value, at: &str) -> Result<(usize, Vec<ControlPoint>), PatchFileError> {
    let point = |value: &Value, n: usize, at: String| {
        let list = numbers(Some(value), &at)?;
        if list.len() == n {
            Ok(list)
        } else {
            wrong(
                &at,
                format!("{n} numbers are expected, {} are there", list.len()),
            )
        }
    };
    let mut found = Vec::new();
    if value.get("control").is_some() {
        let all = rows(value, "control", at)?;
        for (i, p) in all.iter().flat_map(|r| r.iter()).enumerate() {
            let p = point(p, 4, format!("{at}, control point {}", i + 1))?;
            found.push(std::array::from_fn(|k| p[k].clone()));
        }
        return Ok((all.len(), found));
    }
    let all = rows(value, "points", at)?;
    let weights = if value.get("weights").is_some() {
        Some(rows(value, "weights", at)?)
    } else {
        None
    };
    if weights
        .as_ref()
        .is_some_and(|w| w.len() != all.len() || w[0].len() != all[0].len())
    {
        return wrong(
            &format!("{at}, weights"),
            "as many are expected as there are points",
        );
    }
    for (i, row) in all.iter().enumerate() {
        for (j, p) in row.iter().enumerate() {
            let p = point(p, 3, format!("{at}, point {} {}", i + 1, j + 1))?;
            let w = match &weights {
                None => RBig::ONE,
                Some(w) => number(&w[i][j]).map_or_else(
                    || {
                        wrong(
                            &format!("{at}, weight {} {}", i + 1, j + 1),
                            "a number is expected",
                        )
                    },
                    Ok,
                )?,
            };
            found.push([&p[0] * &w, &p[1] * &w, &p[2] * &w, w]);
        }
    }
    Ok((all.len(), found))
}

fn bezier(value: &Value, at: &str) -> Result<Patch, PatchFileError> {
    let [m, n] = degree(value, at)?;
    let (rows, control) = control(value, at)?;
    if rows != m + 1 || control.len() != (m + 1) * (n + 1) {
        let columns = control.len() / rows;
        return wrong(
            &format!("{at}, control"),
            format!(
                "{} × {} points are expected, {rows} × {columns} are there",
                m + 1,
                n + 1
            ),
        );
    }
    Ok(Patch {
        name: at.to_owned(),
        degree: [m, n],
        control,
    })
}

/// The Bézier patches between the knots.
fn nurbs(value: &Value, at: &str) -> Result<Vec<Patch>, PatchFileError> {
    let [p, q] = degree(value, at)?;
    let (rows, control) = control(value, at)?;
    let columns = control.len() / rows;
    let mut knots = [Vec::new(), Vec::new()];
    for (k, (key, degree, points)) in [("knots_u", p, rows), ("knots_v", q, columns)]
        .into_iter()
        .enumerate()
    {
        let at = format!("{at}, {key}");
        let list = numbers(value.get(key), &at)?;
        if points <= degree {
            return wrong(
                &at,
                format!("{} points are too few for degree {degree}", points),
            );
        }
        if list.len() != points + degree + 1 {
            return wrong(
                &at,
                format!(
                    "{} knots are expected, {} are there",
                    points + degree + 1,
                    list.len()
                ),
            );
        }
        if list.windows(2).any(|w| w[0] > w[1]) {
            return wrong(&at, "knots must not decrease");
        }
        if list[degree] == list[points] {
            return wrong(&at, "the knots leave no interval");
        }
        if list.windows(degree + 2).any(|w| w[0] == w[degree + 1]) {
            return wrong(&at, format!("a knot occurs more than {} times", degree + 1));
        }
        knots[k] = list;
    }
    let spans = [(p, rows), (q, columns)].map(|(degree, points)| degree..points);
    let spans: [Vec<usize>; 2] = std::array::from_fn(|k| {
        spans[k]
            .clone()
            .filter(|&i| knots[k][i] < knots[k][i + 1])
            .collect()
    });
    if spans[0].len() * spans[1].len() > MAX_PATCHES {
        return wrong(at, format!("more than {MAX_PATCHES} patches"));
    }
    let mut patches = Vec::new();
    for (a, &k) in spans[0].iter().enumerate() {
        // Bézier in u, with all columns.
        let columns_of: Vec<Vec<ControlPoint>> = (0..columns)
            .map(|j| {
                let column: Vec<ControlPoint> = (0..rows)
                    .map(|i| control[i * columns + j].clone())
                    .collect();
                segment(p, &knots[0], &column, k)
            })
            .collect();
        for (b, &l) in spans[1].iter().enumerate() {
            let mut net = Vec::with_capacity((p + 1) * (q + 1));
            for i in 0..=p {
                let row: Vec<ControlPoint> = columns_of.iter().map(|c| c[i].clone()).collect();
                net.extend(segment(q, &knots[1], &row, l));
            }
            patches.push(Patch {
                name: format!("{at}, span {} {}", a + 1, b + 1),
                degree: [p, q],
                control: net,
            });
        }
    }
    Ok(patches)
}

/// The Bézier points of a B-spline between knot k and the next: the i-th is the polar form at p − i
/// times the one and i times the other.
fn segment(p: usize, knots: &[RBig], points: &[ControlPoint], k: usize) -> Vec<ControlPoint> {
    let at = |i: usize| {
        let mut d: Vec<ControlPoint> = points[k - p..=k].to_vec();
        for r in 1..=p {
            let x = if r <= p - i { &knots[k] } else { &knots[k + 1] };
            // d[j] belongs to point k − p + j.
            for j in (r..=p).rev() {
                let (lo, hi) = (&knots[k - p + j], &knots[k + j - r + 1]);
                let share = (x - lo) / (hi - lo);
                d[j] = std::array::from_fn(|c| {
                    &d[j - 1][c] * (RBig::ONE - &share) + &d[j][c] * &share
                });
            }
        }
        d.swap_remove(p)
    };
    (0..=p).map(at).collect()
}

impl Patch {
    /// The map over [0, 1]²; a common factor of its polynomials is removed.
    ///
    /// # Errors
    /// [`MapError`]: no surface, no finite point.
    pub fn map(&self) -> Result<Map, MapError> {
        Map::new(self.polynomials(), Options { reduce: true })
    }
    /// X, Y, Z and W in s and t.
    fn polynomials(&self) -> [Poly; 4] {
        let [m, n] = self.degree;
        [0, 1, 2, 3].map(|c| {
            let mut rows: Vec<Vec<RBig>> = self
                .control
                .chunks(n + 1)
                .map(|row| to_powers(row.iter().map(|p| p[c].clone()).collect()))
                .collect();
            for j in 0..=n {
                let column = to_powers((0..=m).map(|i| rows[i][j].clone()).collect());
                column
                    .into_iter()
                    .enumerate()
                    .for_each(|(i, x)| rows[i][j] = x);
            }
            let terms = rows.into_iter().enumerate().flat_map(|(i, row)| {
                row.into_iter()
                    .enumerate()
                    .map(move |(j, x)| ([i as u16, j as u16, 0, 0], x))
            });
            Poly::from_terms(terms.filter(|t| !t.1.is_zero()))
        })
    }
    /// The control points of a side, in the order of [`crate::Domain::rectangle`]: t = 0, s = 1, t
    /// = 1 backward, s = 0 backward.
    pub(crate) fn side(&self, side: usize) -> Vec<&ControlPoint> {
        let [m, n] = self.degree;
        let at = |i: usize, j: usize| &self.control[i * (n + 1) + j];
        match side {
            0 => (0..=m).map(|i| at(i, 0)).collect(),
            1 => (0..=n).map(|j| at(m, j)).collect(),
            2 => (0..=m).rev().map(|i| at(i, n)).collect(),
            _ => (0..=n).rev().map(|j| at(0, j)).collect(),
        }
    }
}

/// A box that holds all patches, if none has a pole: the least and greatest coordinates of control
/// points, of halved patches where weights have both signs.
pub fn patch_bounds(patches: &[Patch]) -> Option<[[RBig; 2]; 3]> {
    let unit = [0, 1].map(|_| [RBig::ZERO, RBig::ONE]);
    let mut all: Option<[[RBig; 2]; 3]> = None;
    for patch in patches {
        let next = image_bounds(&patch.polynomials(), &unit)?;
        all = Some(match all {
            None => next,
            Some(old) => std::array::from_fn(|k| {
                [
                    old[k][0].clone().min(next[k][0].clone()),
                    old[k][1].clone().max(next[k][1].clone()),
                ]
            }),
        });
    }
    all
}

/// From Bernstein coefficients to those of powers.
fn to_powers(line: Vec<RBig>) -> Vec<RBig> {
    // Differences: the k-th power has the k-th difference of the first coefficients, n over k
    // times.
    let n = line.len() - 1;
    let (mut differences, mut binomial, mut found) = (line, RBig::ONE, Vec::with_capacity(n + 1));
    for k in 0..=n {
        found.push(&differences[0] * &binomial);
        binomial = binomial * RBig::from(n - k) / RBig::from(k + 1);
        differences = differences.windows(2).map(|w| &w[1] - &w[0]).collect();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn eval(p: &Patch, s: f64, t: f64) -> [f64; 3] {
        let at = [s, t].map(|x| RBig::try_from(x).expect("finite"));
        let [x, y, z, w] = p.polynomials().map(|f| f.eval(&at));
        [x, y, z].map(|x| (x / &w).to_f64().value())
    }

    #[test]
    fn a_bilinear_patch() {
        let file = json!({"schema": 1, "patches": [{"degree": [1, 1], "control": [[[0, 0, 0, 1], [0, 2, 0, 1]], [[3, 0, 0, 1], [6, 4, 10, 2]]]}]});
        let patches = read_patches(&file).expect("patches");
        assert_eq!(eval(&patches[0], 0.0, 1.0), [0.0, 2.0, 0.0]);
        assert_eq!(eval(&patches[0], 1.0, 1.0), [3.0, 2.0, 5.0]);
        assert_eq!(eval(&patches[0], 1.0, 0.0), [3.0, 0.0, 0.0]);
        let bounds = patch_bounds(&patches)
            .expect("no pole")
            .map(|b| b.map(|x| x.to_f64().value()));
        assert_eq!(bounds, [[0.0, 3.0], [0.0, 2.0], [0.0, 5.0]]);
    }

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
