//! Spheres: closed forms, methods of the paper, and inputs that make no sense.

use isoform_fit::{
    Control, Estimate, Finding, FitError, Kind, LocalMethod, Method, Options, Parameter, Status,
    Template, fit,
};
use isoform_geom::{ParamField, Point3, norm, sub};

/// r² − |p − c|² or r − |p − c|; with a fifth parameter that does nothing, if asked.
struct Ball {
    metric: bool,
    dim: usize,
    broken: bool,
}

impl ParamField for Ball {
    fn dim(&self) -> usize {
        self.dim
    }
    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
        let mut g = vec![[0.0; 3]; points.len()];
        self.gradients(points, a, out, &mut g);
    }
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
        let mut g = vec![[0.0; 3]; points.len()];
        self.gradients(points, a, out, &mut g);
        jac.fill(0.0);
        for (row, g) in jac.chunks_exact_mut(self.dim).zip(&g) {
            for i in 0..3 {
                row[i] = -g[i];
            }
            row[3] = if self.metric { 1.0 } else { 2.0 * a[3] };
        }
    }
    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        for ((p, f), g) in points.iter().zip(out).zip(gradients) {
            let d = sub(*p, [a[0], a[1], a[2]]);
            let r = norm(d).max(1e-300);
            *f = if self.metric {
                a[3] - r
            } else {
                a[3] * a[3] - r * r
            };
            *g = d.map(|v| if self.metric { -v / r } else { -2.0 * v });
            if self.broken {
                *f = f64::NAN;
            }
        }
    }
}

struct Sphere {
    parameters: Vec<Parameter>,
    names: Vec<String>,
    algebraic: Ball,
    metric: Ball,
}

impl Sphere {
    fn new(dim: usize, broken: bool) -> Self {
        let kinds = [
            ("cx", Kind::X),
            ("cy", Kind::Y),
            ("cz", Kind::Z),
            ("radius", Kind::Length),
            ("idle", Kind::Number),
        ];
        Self {
            parameters: kinds[..dim]
                .iter()
                .map(|(n, k)| Parameter::new(*n, *k))
                .collect(),
            names: vec!["ball".to_owned()],
            algebraic: Ball {
                metric: false,
                dim,
                broken,
            },
            metric: Ball {
                metric: true,
                dim,
                broken,
            },
        }
    }
}

impl Template for Sphere {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn algebraic(&self) -> &dyn ParamField {
        &self.algebraic
    }
    fn metric(&self) -> &dyn ParamField {
        &self.metric
    }
    fn part_names(&self) -> &[String] {
        &self.names
    }
    fn parts(&self, _: &[Point3], _: &[f64], out: &mut [u32]) {
        out.fill(0);
    }
}

const TRUTH: [f64; 4] = [1.0, -2.0, 30.0, 2.5];

fn points(count: usize, sigma: f64) -> Vec<Point3> {
    let mut random = fastrand::Rng::with_seed(7);
    let mut gauss =
        || (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos();
    (0..count)
        .map(|_| {
            let v = [gauss(), gauss(), gauss()];
            let r = TRUTH[3] / norm(v);
            std::array::from_fn(|i| TRUTH[i] + r * v[i] + sigma * gauss())
        })
        .collect()
}

#[test]
fn the_deviation_of_a_sphere_is_known_in_closed_form() {
    let (n, sigma) = (5000, 0.01);
    let f = fit(
        &points(n, sigma),
        &Sphere::new(4, false),
        &Options::default(),
        &Control::default(),
    )
    .expect("a fit");
    // Normals are uniform: JᵀJ = n diag(1/3, 1/3, 1/3, 1).
    let sd = sigma / (n as f64).sqrt();
    for (i, p) in f.parameters.iter().enumerate() {
        let expected = if i < 3 { 3f64.sqrt() * sd } else { sd };
        assert!((p.sd.expect("sd") / expected - 1.0).abs() < 0.05, "{p:?}");
        assert!((p.value - TRUTH[i]).abs() < 4.0 * expected, "{p:?}");
        assert_eq!(p.status, Status::Determined);
    }
    assert!(
        (f.rms / sigma - 1.0).abs() < 0.05 && f.n_outliers == 0 && f.acceptable,
        "{:?}",
        f.reasons
    );
    assert!(f.model_to_data.share_uncovered == 0.0 && f.data_to_model.max < 6.0 * sigma);
    assert!(f.part_statistics[0].count == n);
}

#[test]
fn exact_points_give_exact_parameters() {
    let f = fit(
        &points(300, 0.0),
        &Sphere::new(4, false),
        &Options::default(),
        &Control::default(),
    )
    .expect("a fit");
    assert!(
        f.values()
            .iter()
            .zip(TRUTH)
            .all(|(v, t)| (v - t).abs() < 1e-8),
        "{:?}",
        f.values()
    );
}

/// As many points as parameters: no degrees of freedom, an answer without intervals.
#[test]
fn as_many_points_as_parameters_test_nothing() {
    for sigma in [0.0, 0.02] {
        let f = fit(
            &points(4, sigma),
            &Sphere::new(4, false),
            &Options::default(),
            &Control::default(),
        )
        .expect("a fit");
        assert!(f.rms < 1e-6, "{f:?}");
        let is_open = |p: &Estimate| p.status == Status::Undetermined && p.ci95.is_none();
        assert!(f.parameters.iter().all(is_open), "{:?}", f.parameters);
        let untested = Finding::Untested { points: 4, free: 4 };
        assert!(
            !f.acceptable && f.findings.contains(&untested),
            "{:?}",
            f.findings
        );
    }
}

#[test]
fn an_idle_parameter_is_said_to_be_open() {
    let f = fit(
        &points(2000, 0.01),
        &Sphere::new(5, false),
        &Options::default(),
        &Control::default(),
    )
    .expect("a fit");
    assert_eq!(f.parameters[4].status, Status::Undetermined);
    assert!(
        f.parameters[..4]
            .iter()
            .all(|p| p.status == Status::Determined)
    );
    assert_eq!(f.undetermined[0].parameters, ["idle"]);
}

#[test]
fn the_paper_s_methods_agree() {
    let points = points(500, 0.01);
    let methods = [
        Method::Local(LocalMethod::Lm),
        Method::Local(LocalMethod::Bfgs),
        Method::Annealing,
        Method::Hybrid {
            local: LocalMethod::Lm,
            threshold: None,
        },
        Method::Hybrid {
            local: LocalMethod::Bfgs,
            threshold: Some(1.0),
        },
    ];
    for method in methods {
        let options = Options {
            method,
            annealing_evaluations: 40_000,
            ..Options::default()
        };
        let f = fit(
            &points,
            &Sphere::new(4, false),
            &options,
            &Control::default(),
        )
        .expect("a fit");
        let tolerance = if method == Method::Annealing {
            0.1
        } else {
            0.01
        };
        assert!(
            f.values()
                .iter()
                .zip(TRUTH)
                .all(|(v, t)| (v - t).abs() < tolerance),
            "{method:?} {:?}",
            f.values()
        );
    }
}

#[test]
fn senseless_inputs_are_refused_in_words() {
    let ball = Sphere::new(4, false);
    let run =
        |points: &[Point3], options: &Options| fit(points, &ball, options, &Control::default());
    let options = Options::default();
    for few in [
        vec![],
        vec![[1.0, 2.0, 3.0]],
        vec![[0.0; 3], [1.0; 3]],
        vec![[5.0; 3]; 1000],
    ] {
        assert!(matches!(
            run(&few, &options),
            Err(FitError::TooFewPoints { free: 4, .. })
        ));
    }
    let mut bad = points(100, 0.0);
    bad[17][1] = f64::NAN;
    assert!(matches!(
        run(&bad, &options),
        Err(FitError::NotFinite { index: 17, .. })
    ));
    let good = points(100, 0.0);
    let with = |start: Option<Vec<f64>>, bounds: Vec<Option<(f64, f64)>>| {
        run(
            &good,
            &Options {
                start,
                bounds,
                ..Options::default()
            },
        )
    };
    assert!(matches!(
        with(Some(vec![1.0]), vec![]),
        Err(FitError::Length {
            found: 1,
            expected: 4,
            ..
        })
    ));
    assert!(matches!(
        with(Some(vec![f64::NAN; 4]), vec![]),
        Err(FitError::NotFinite { .. })
    ));
    assert!(matches!(
        with(None, vec![None, None, None, Some((2.0, 1.0))]),
        Err(FitError::Bounds { .. })
    ));
    let broken = fit(&good, &Sphere::new(4, true), &options, &Control::default());
    assert!(matches!(broken, Err(FitError::NoFiniteStart { .. })));
    let mut fixed = Sphere::new(4, false);
    fixed
        .parameters
        .iter_mut()
        .for_each(|p| p.fixed = Some(1.0));
    assert!(matches!(
        fit(&good, &fixed, &options, &Control::default()),
        Err(FitError::NothingFree)
    ));
    // All in one line, and in one plane: no panic, some answer.
    let line: Vec<Point3> = (0..100).map(|i| [f64::from(i), 0.0, 0.0]).collect();
    let plane: Vec<Point3> = (0..100)
        .map(|i| [f64::from(i % 10), f64::from(i / 10), 0.0])
        .collect();
    for points in [line, plane] {
        assert!(run(&points, &options).is_ok());
    }
}
