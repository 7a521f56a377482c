//! Comparison of every evaluator with the reference (the graph, node by node), on all golden models
//! and on generated trees.

use isoform_field::hyperfun::{Mode, Model};
use isoform_field::{Bound, Graph, Residual, Shape, Tape};
use isoform_geom::{Aabb, Field, ParamField, Point3};
use isoform_num::{Interval, Jet1, Jet2, Real};

const PART: &str =
    "my_model(x[3], a[12]) { array v[3], c[3], d[3]; v[1] = a[1]; v[2] = a[2]; v[3] = a[3];
  c[1] = a[7]; c[2] = a[8]; c[3] = 0; d[1] = a[10]; d[2] = a[11]; d[3] = 0;
  box = hfBlock(x, v, a[4], a[5], a[6]);
  my_model = (box \\ hfCylinderZ(x, c, a[9])) \\ hfCylinderZ(x, d, a[12]); }";
const MIXED: &str = "my_model(x[3], a[12]) { array c[3]; c = [0.1, 0.2, -0.1];
  u = cos(a[5])*sin(a[1]*x[1])*exp(0-x[2]^2) + atan2(x[3], x[1]+3) + x[2]^5/7 - cosh(x[1]/4)
    + tan(x[3]/9) + (x[1]^2+1)^(a[4]/8);
  b = hfBlendUni(hfTorusZ(x,c,2,0.7), hfEllipsoid(x,c,1,2,3), 0.4, 1, 1.5) | hfSuperell(x,c,2,1,1.5,0.8,1.2);
  v = u; if x[1] > x[2] then v = u*x[3]; else v = min(u, 0.3-x[1]); endif;
  my_model = max(v, b) & (9 - x[1]^2 - x[2]^2) | hfDConeX(x,c,0.4) + asin(x[1]/9) + sqrt(x[2]^2+0.1)+ abs(x[3]); }";
const NATIVE: &str = "my_model(x[3], a[12]) { array c[3]; c[1]=a[1]/9; c[2]=0; c[3]=0;
  e = hfDEllipsoid(x, c, 2, 1.5, 1); my_model = hfDUni(e, 1.7-x[1], 0.5, 0) | (mod(9*x[2], 4) - 3); }";
const A: [f64; 12] = [
    -5.1, -4.05, -1.95, 10.2, 6.2, 3.9, 4.6, 2.5, 1.7, 2.9, -1.85, 1.15,
];

fn models() -> Vec<(String, Model, Vec<f64>)> {
    let mut all = Vec::new();
    for (name, text) in [("part", PART), ("mixed", MIXED), ("native", NATIVE)] {
        all.push((
            name.to_owned(),
            Model::parse(text, Mode::Default).expect(name),
            A.to_vec(),
        ));
    }
    for hf in isoform_testdata::files("hyperfun", "hf") {
        let model = Model::parse(&std::fs::read_to_string(&hf).expect("text"), Mode::Default)
            .expect("a golden model");
        let csv = std::fs::read_to_string(hf.with_extension("csv")).expect("golden values");
        let line = csv
            .lines()
            .find_map(|l| l.strip_prefix("# a:"))
            .expect("parameters");
        let mut a: Vec<f64> = line
            .split(',')
            .filter_map(|v| v.trim().parse().ok())
            .collect();
        a.resize(model.n_params(), 0.0);
        if model.dimension() == 3 {
            all.push((isoform_testdata::stem(&hf), model, a));
        }
    }
    assert!(
        all.len() > 100,
        "the golden folder holds {} models",
        all.len()
    );
    all
}

fn points() -> Vec<Point3> {
    // Not a multiple of any block size.
    (0..77)
        .map(|i| {
            std::array::from_fn(|k| 5.0 * ((f64::from(i) + 1.0) * [0.754, 0.569, 0.437][k]).sin())
        })
        .collect()
}

fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// Returns true if two numbers agree relative to `scale`: derivatives are computed by different
/// formulas.
fn close(a: f64, b: f64, scale: f64) -> bool {
    same(a, b) || !b.is_finite() || (a - b).abs() <= 1e-9 * (scale + b.abs())
}

#[test]
fn all_evaluators_agree_with_the_oracle() {
    let points = points();
    let mut compared = 0;
    for (name, model, a) in models() {
        let mut graph = Graph::new();
        let Ok(root) = model.compile(&mut graph) else {
            eprintln!("{name}: no expression");
            continue;
        };
        let tape = Tape::new(&graph, &[root], 3, a.len());
        let (n, m) = (points.len(), a.len());
        let want: Vec<f64> = points.iter().map(|p| graph.eval(root, p, &a)).collect();
        let residual = Residual::new(tape.clone());
        let mut got = vec![0.0; n];
        ParamField::values(&residual, &points, &a, &mut got);
        let mut scratch = Vec::new();
        for i in 0..n {
            assert!(
                same(got[i], want[i]),
                "{name}: block {} against {} at {:?}",
                got[i],
                want[i],
                points[i]
            );
            assert!(
                same(tape.eval(&points[i], &a, &mut scratch), want[i]),
                "{name}: tape at {:?}",
                points[i]
            );
        }
        // Derivatives by x, y, z and the parameters: reverse mode against forward jets of the
        // oracle.
        let mut grad = vec![0.0; n * (3 + m)];
        residual.all_gradients(&points, &a, &mut got, &mut grad);
        let mut jets = vec![Jet2::constant(0.0); n];
        let bound = Bound::new(residual, &a);
        bound.jets(&points, &mut jets);
        for (i, p) in points
            .iter()
            .enumerate()
            .filter(|(i, _)| want[*i].is_finite())
        {
            let x: [Jet2; 3] = std::array::from_fn(|k| Jet2::variable(p[k], k));
            let fixed: Vec<Jet2> = a.iter().map(|&v| Jet2::constant(v)).collect();
            let oracle = graph.eval(root, &x, &fixed);
            let scale = 1.0
                + oracle
                    .g
                    .iter()
                    .chain(&oracle.h)
                    .fold(0.0, |s: f64, v| s.max(v.abs()));
            for k in 0..3 {
                assert!(
                    close(grad[k * n + i], oracle.g[k], scale),
                    "{name}: d{k} {} {} at {p:?}",
                    grad[k * n + i],
                    oracle.g[k]
                );
                assert!(
                    close(jets[i].g[k], oracle.g[k], scale),
                    "{name}: jet d{k} at {p:?}"
                );
            }
            for k in 0..6 {
                assert!(
                    close(jets[i].h[k], oracle.h[k], scale),
                    "{name}: jet h{k} {} {} at {p:?}",
                    jets[i].h[k],
                    oracle.h[k]
                );
            }
            for j in 0..m {
                let x = p.map(Jet1::<1>::constant);
                let b: Vec<Jet1<1>> = a
                    .iter()
                    .enumerate()
                    .map(|(k, &v)| {
                        if k == j {
                            Jet1::variable(v, 0)
                        } else {
                            Jet1::constant(v)
                        }
                    })
                    .collect();
                let d = graph.eval(root, &x, &b).g[0];
                assert!(
                    close(grad[(3 + j) * n + i], d, scale),
                    "{name}: da{j} {} {d} at {p:?}",
                    grad[(3 + j) * n + i]
                );
            }
            compared += 1;
        }
    }
    assert!(compared > 200, "{compared} points compared");
}

/// Checks that bounds enclose all values, and that the simplified tape has equal values in the box.
#[test]
fn bounds_contain_and_pruning_keeps_values() {
    let mut pruned = 0;
    for (name, model, a) in models() {
        let mut graph = Graph::new();
        let Ok(root) = model.compile(&mut graph) else {
            continue;
        };
        let shape = Shape::new(&mut graph, root);
        for root in [root, shape.distance] {
            let bound = Bound::new(Residual::new(Tape::new(&graph, &[root], 3, a.len())), &a);
            for (i, p) in points().iter().enumerate() {
                let size = [0.01, 0.3, 2.0][i % 3];
                let region = Aabb {
                    lo: *p,
                    hi: p.map(|v| v + size),
                };
                let (range, rest) = bound.bounds_and_rest(region);
                for k in 0..8 {
                    let q: Point3 = std::array::from_fn(|j| {
                        p[j] + size * [0.0, 0.37, 0.81, 1.0][(k * (j + 1) + j) % 4]
                    });
                    let v = bound.value(q);
                    assert!(
                        !v.is_finite() || range.contains(v),
                        "{name}: {v} outside {range:?} at {q:?}"
                    );
                    if let Some(short) = &rest {
                        assert!(
                            same(short.value(q), v),
                            "{name}: pruned {} against {v} at {q:?}",
                            short.value(q)
                        );
                        pruned += 1;
                    }
                }
            }
        }
    }
    assert!(pruned > 1000, "{pruned} values of pruned tapes");
}

/// Compares weighted normal equations with the Jacobian; they are bitwise identical for any number
/// of threads.
#[test]
fn normal_equations_are_the_jacobians() {
    let model = Model::parse(PART, Mode::Default).expect("the part");
    let mut graph = Graph::new();
    let root = model.compile(&mut graph).expect("an expression");
    let residual = Residual::new(Tape::new(&graph, &[root], 3, 12));
    let points: Vec<Point3> = (0..5001)
        .map(|i| {
            std::array::from_fn(|k| 5.0 * ((f64::from(i) + 1.0) * [0.754, 0.569, 0.437][k]).sin())
        })
        .collect();
    let weights: Vec<f64> = (0..5001).map(|i| 1.0 / (1.0 + f64::from(i % 7))).collect();
    let (mut f, mut jac) = (vec![0.0; 5001], vec![0.0; 5001 * 12]);
    residual.jacobian(&points, &A, &mut f, &mut jac);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        let (mut g, mut h) = (vec![0.0; 12], vec![0.0; 144]);
        let s = pool.install(|| residual.normal_equations(&points, &weights, &A, &mut g, &mut h));
        let again = pool.install(|| residual.sum_of_squares(&points, &weights, &A));
        assert_eq!(s.to_bits(), again.to_bits(), "both sums run in one order");
        (s, g, h)
    };
    let (s, g, h) = run(1);
    assert_eq!((s, g.clone(), h.clone()), run(3));
    let sum = |u: &dyn Fn(usize) -> f64| (0..5001).map(|i| weights[i] * u(i)).sum::<f64>();
    assert!((sum(&|i| f[i] * f[i]) / s - 1.0).abs() < 1e-12);
    for i in 0..12 {
        let want = sum(&|k| f[k] * jac[k * 12 + i]);
        assert!(
            (g[i] - want).abs() <= 1e-9 * (1.0 + want.abs()),
            "{i}: {} {want}",
            g[i]
        );
        for j in 0..12 {
            let want = sum(&|k| jac[k * 12 + i] * jac[k * 12 + j]);
            assert!((h[i * 12 + j] - want).abs() <= 1e-9 * (1.0 + want.abs()));
        }
    }
}

/// Checks that ranges of native functions are unbounded, since intervals cannot enclose their
/// iterations.
#[test]
fn native_functions_claim_nothing() {
    let model = Model::parse(NATIVE, Mode::Default).expect("a program");
    let mut graph = Graph::new();
    let root = model.compile(&mut graph).expect("an expression");
    let bound = Bound::new(Residual::new(Tape::new(&graph, &[root], 3, 12)), &A);
    assert_eq!(
        bound
            .bounds(Aabb {
                lo: [0.0; 3],
                hi: [1.0; 3]
            })
            .hi(),
        Interval::ALL.hi()
    );
}

/// Checks that values at many points are bitwise those of the whole function at each, for any
/// number of threads: for many disjoint balls, for values that may be NaN, and for selections.
#[test]
fn values_at_many_points_are_those_at_each() {
    let mut text = "my_model(x[3], a[2]) { t = 0 - 9;\n".to_owned();
    for k in 0..216 {
        let [x, y, z] = [k % 6, k / 6 % 6, k / 36];
        // All are different, since equal ones would share operations.
        let by = 1e-4 * f64::from(k);
        let away = format!("(x[1] - {x} - {by})^2 + (x[2] - {y} - {by})^2");
        let away = format!("{away} + (x[3] - {z} - {by} + a[2])^2");
        // Some of the last are NaN beyond a distance of 1.2, every fifth has another formula.
        text += &match k {
            k if k > 170 && k % 7 == 3 => format!("t = max(sqrt(1.44 - {away}) - 1, t);\n"),
            k if k % 5 == 2 => {
                format!("if x[1] > {x} then t = max(t, a[1]^2 - ({away})); endif;\n")
            }
            _ => format!("t = max(t, a[1] - sqrt({away}));\n"),
        };
    }
    let model = Model::parse(&(text + "my_model = t; }"), Mode::Default).expect("balls");
    let mut graph = Graph::new();
    let root = model.compile(&mut graph).expect("an expression");
    let residual = Residual::new(Tape::new(&graph, &[root], 3, 2));
    assert!(
        residual.tape().len() > 2000,
        "too short for points to be parted"
    );
    let mut random = isoform_num::Random::new(7);
    let mut points: Vec<Point3> = (0..40_000)
        .map(|_| std::array::from_fn(|_| 6.0 * random.unit() - 0.5))
        .collect();
    points.extend([points[17]; 1500]);
    let a = [0.4, 0.03];
    let bits = |threads: usize| -> Vec<u64> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let mut out = vec![0.0; points.len()];
        let pool = pool.build().expect("a pool");
        pool.install(|| residual.values(&points, &a, &mut out));
        out.into_iter().map(f64::to_bits).collect()
    };
    let found = bits(1);
    assert_eq!(found, bits(3));
    let mut scratch = Vec::new();
    for (p, found) in points.iter().zip(found) {
        let value = residual.tape().eval(p, &a, &mut scratch);
        assert!(
            value.to_bits() == found || value.is_nan() && f64::from_bits(found).is_nan(),
            "{} against {value} at {p:?}",
            f64::from_bits(found)
        );
    }
}
