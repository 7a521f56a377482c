//! Tests against the recursion of Cox and de Boor, and round trips.

use super::*;
use isoform_geom::bernstein;
use proptest::prelude::*;

/// Evaluates a patch by Bernstein polynomials.
fn eval(p: &FilePatch, s: f64, t: f64) -> [f64; 3] {
    let [m, n] = p.degree;
    let (b, c) = (bernstein(m, s).0, bernstein(n, t).0);
    let mut sum = [0.0; 4];
    for (k, point) in p.control.doubles().iter().enumerate() {
        let weight = b[k / (n + 1)] * c[k % (n + 1)];
        (0..4).for_each(|d| sum[d] += weight * point[d]);
    }
    [0, 1, 2].map(|k| sum[k] / sum[3])
}

#[test]
fn a_bilinear_patch() {
    let file = json!({"schema": 1, "patches": [{"degree": [1, 1], "control": [
        [[0, 0, 0, 1], [0, 2, 0, 1]], [[3, 0, 0, 1], [6, 4, 10, 2]]]}]});
    let patches = read_patches(&file).expect("patches");
    assert_eq!(eval(&patches[0], 0.0, 1.0), [0.0, 2.0, 0.0]);
    assert_eq!(eval(&patches[0], 1.0, 1.0), [3.0, 2.0, 5.0]);
    assert_eq!(eval(&patches[0], 1.0, 0.0), [3.0, 0.0, 0.0]);
    let corner = patches[0].control.exact()[3].clone();
    assert_eq!(corner, [6, 4, 10, 2].map(RBig::from));
}

#[test]
fn weights_multiply_exactly() {
    let points = json!([[[0.1, 0.2, 0.3], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]);
    let file = json!({"patches": [
        {"degree": [1, 1], "points": points, "weights": [[0.7, 1], [1, 1]]}]});
    let patches = read_patches(&file).expect("patches");
    let product = exact(0.1) * exact(0.7);
    assert_eq!(patches[0].control.exact()[0][0], product);
    // The product of two doubles has more digits than a double.
    assert_ne!(exact(patches[0].control.doubles()[0][0]), product);
    let patch = patches[0].patch().expect("finite");
    assert!(isoform_geom::distance_squared(patch.point(0.0, 0.0), [0.1, 0.2, 0.3]) < 1e-32);
    let file = json!({"patches": [
        {"degree": [1, 1], "points": points, "weights": [[1e300, 1], [1e300, 1]]}]});
    assert!(
        read_patches(&file).expect("exact numbers have no end")[0]
            .patch()
            .is_ok()
    );
    let far = json!([[[1e300, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]);
    let file = json!({"patches": [
        {"degree": [1, 1], "points": far, "weights": [[1e300, 1], [1, 1]]}]});
    let patches = read_patches(&file).expect("exact numbers have no end");
    assert_eq!(patches[0].patch(), Err(PatchError::NotFinite(0)));
}

/// Evaluates a B-spline basis function by the recursion of Cox and de Boor, in doubles.
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
    // Common sides of neighbours agree exactly.
    let row = |k: usize, i: usize| patches[k].control.exact()[3 * i..3 * i + 3].to_vec();
    assert_eq!(row(0, 2), row(2, 0));
    let column = |k: usize, j: usize| [0, 1, 2].map(|i| row(k, i)[j].clone());
    assert_eq!(column(0, 2), column(1, 0));
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
        (
            json!({"degree": [1, 1], "knots_u": knots, "knots_v": knots, "points": points,
                "wieghts": [[1, 2], [1, 1]]}),
            "nurbs 1, wieghts",
        ),
    ] {
        assert_eq!(read_patches(&file).expect_err("wrong").at, at, "{file}");
    }
}

/// Patches of degree 32 with knots that make 100 × 100 of them: 10,000,000 points.
#[test]
fn small_files_do_not_ask_for_much_memory() {
    let (p, spans) = (32, 100);
    let knots: Vec<usize> = (0..2 * p + spans + 1).collect();
    let points = vec![vec![[0, 0, 0]; p + spans]; p + spans];
    let file = json!({"degree": [p, p], "knots_u": knots, "knots_v": knots, "points": points});
    let e = read_patches(&file).expect_err("too much");
    assert_eq!(
        (e.at.as_str(), e.problem.as_str()),
        ("nurbs 1", "more than 4000000 control points")
    );
    let file = json!({"patches": [{"degree": [1_u64 << 63, 1_u64 << 63], "control": [[[0]]]}]});
    assert_eq!(
        read_patches(&file).expect_err("degree").at,
        "patch 1, degree"
    );
}

/// Runs the fuzzing target on its seeds.
#[test]
fn the_corpus_is_read() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = folder.join("../../fuzz/corpus/read_patches");
    let mut read = 0;
    for entry in std::fs::read_dir(folder).expect("a corpus") {
        let bytes = std::fs::read(entry.expect("an entry").path()).expect("readable");
        let Ok(json) = serde_json::from_slice(&bytes) else {
            continue;
        };
        if let Ok(patches) = read_patches(&json) {
            assert!(is_patch_file(&json) && !patches.is_empty());
            read += 1;
        }
    }
    assert!(read > 0);
}

fn number() -> impl Strategy<Value = f64> {
    use prop::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    prop_oneof![NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE, -1e3..1e3]
}

fn record() -> impl Strategy<Value = PatchRecord> {
    (1..5_usize, 1..5_usize).prop_flat_map(|(m, n)| {
        let points = prop::collection::vec(prop::array::uniform4(number()), (m + 1) * (n + 1));
        (
            points,
            number(),
            any::<bool>(),
            prop::array::uniform3(number()),
        )
            .prop_map(
                move |(points, distance, certified, seed_point)| PatchRecord {
                    patch: RationalPatch::new((m, n), points).expect("finite"),
                    max_distance: distance,
                    certified,
                    rms_distance: distance,
                    seed_point,
                },
            )
    })
}

/// Generates values that a file may contain in the place of others, mostly numbers.
fn junk() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        number().prop_map(Value::from),
        (0..6_u64).prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        "[a-z0-9]{0,3}".prop_map(Value::from),
    ];
    leaf.prop_recursive(4, 40, 4, |inner| {
        prop::collection::vec(inner, 0..4).prop_map(Value::from)
    })
}

proptest! {
    #[test]
    fn what_is_written_reads_back_bit_by_bit(records in prop::collection::vec(record(), 1..4)) {
        let json = serde_json::from_slice(&write_patches(&records)).expect("JSON");
        prop_assert!(is_patch_file(&json));
        let patches = read_patches(&json).expect("patches");
        prop_assert_eq!(patches.len(), records.len());
        for (k, (patch, record)) in patches.iter().zip(&records).enumerate() {
            let bits = |p: &RationalPatch| -> Vec<u64> {
                p.control().iter().flatten().map(|v| v.to_bits()).collect()
            };
            let again = patch.patch().expect("finite");
            prop_assert_eq!(again.degree(), record.patch.degree());
            prop_assert_eq!(bits(&again), bits(&record.patch));
            prop_assert_eq!(&patch.name, &format!("patch {}", k + 1));
        }
    }

    #[test]
    fn damaged_files_are_refused_or_read(
        of_patch in any::<bool>(),
        damaged in 0..6_usize,
        junk in junk(),
    ) {
        let points = json!([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]);
        let mut surface = json!({"degree": [1, 1], "knots_u": [0, 0, 1, 1], "knots_v": [0, 0, 1, 1],
            "points": points, "weights": [[1, 2], [3, 4]]});
        let key = ["degree", "knots_u", "knots_v", "points", "weights", "control"][damaged];
        surface[key] = junk;
        let file = if of_patch { json!({"patches": [surface]}) } else { json!({"nurbs": [surface]}) };
        match read_patches(&file) {
            Ok(patches) => for p in patches {
                prop_assert_eq!(p.control.len(), (p.degree[0] + 1) * (p.degree[1] + 1));
                prop_assert_eq!(p.control.exact().len(), p.control.len());
                let _ = p.patch();
            },
            Err(e) => prop_assert!(!e.at.is_empty() && !e.problem.is_empty()),
        }
    }

    #[test]
    fn any_json_is_survived(junk in junk(), key in 0..3_usize) {
        let key = ["patches", "nurbs", "knots_u"][key];
        let _ = read_patches(&json!({key: junk}));
    }
}
