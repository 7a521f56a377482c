//! The paper's test part (a block less two cylinders along z) written by hand: a template whose two
//! readings are known in closed form, fast enough that times of a fit mean something.

use isoform_fit::{Kind, Parameter, Template};
use isoform_geom::{ParamField, Point3};
use std::path::Path;

const LANES: usize = 8;
const N: usize = 12;
/// Blocks whose products are summed before the accumulators are touched.
const GROUP: usize = 8;
type Lanes = [f64; LANES];
type Rows = [Lanes; N + 1];

#[derive(Clone, Copy, PartialEq)]
enum Reading {
    Algebraic,
    Metric,
}

/// One reading of the test part.
pub(crate) struct Part(Reading);

/// The template.
pub(crate) struct TestPart {
    parameters: Vec<Parameter>,
    names: Vec<String>,
    algebraic: Part,
    metric: Part,
}

pub(crate) const TRUTH: [f64; N] = [
    -5.1, -4.05, -1.95, 10.2, 6.2, 3.9, 4.6, 2.5, 1.7, 2.9, -1.85, 1.15,
];
pub(crate) const SET1: [f64; N] = [
    -5.0, -4.0, -2.0, 10.0, 5.0, 4.0, 5.0, 3.0, 1.0, 3.0, -2.0, 1.0,
];
pub(crate) const SET2: [f64; N] = [1.0; N];
pub(crate) const LO: [f64; N] = [
    -15.0, -15.0, -15.0, 0.5, 0.5, 0.5, -15.0, -15.0, 0.2, -15.0, -15.0, 0.2,
];
pub(crate) const HI: [f64; N] = [
    5.0, 5.0, 5.0, 20.0, 20.0, 20.0, 15.0, 15.0, 8.0, 15.0, 15.0, 8.0,
];

impl TestPart {
    /// With kinds, as an annotated template has them; or all plain numbers, as the bare program.
    pub(crate) fn new(annotated: bool) -> Self {
        use Kind::*;
        let names = [
            "vx", "vy", "vz", "dx", "dy", "dz", "c1x", "c1y", "c1r", "c2x", "c2y", "c2r",
        ];
        let kinds = [X, Y, Z, Length, Length, Length, X, Y, Length, X, Y, Length];
        let parameters = names
            .iter()
            .zip(kinds)
            .map(|(n, k)| Parameter::new(*n, if annotated { k } else { Number }))
            .collect();
        let parts = [
            "box.x_min",
            "box.y_min",
            "box.z_min",
            "box.x_max",
            "box.y_max",
            "box.z_max",
            "c1",
            "c2",
        ];
        Self {
            parameters,
            names: parts.map(str::to_owned).to_vec(),
            algebraic: Part(Reading::Algebraic),
            metric: Part(Reading::Metric),
        }
    }
    pub(crate) fn parameters_mut(&mut self) -> &mut Vec<Parameter> {
        &mut self.parameters
    }
}

impl Template for TestPart {
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
    fn parts(&self, points: &[Point3], a: &[f64], out: &mut [u32]) {
        for (p, o) in points.iter().zip(out) {
            let d = distances(*p, a);
            *o = (0..8)
                .min_by(|&i, &j| d[i].total_cmp(&d[j]))
                .expect("eight parts") as u32;
        }
    }
}

fn distances(p: Point3, a: &[f64]) -> [f64; 8] {
    let mut d = [0.0; 8];
    for i in 0..3 {
        d[i] = p[i] - a[i];
        d[3 + i] = a[i] + a[3 + i] - p[i];
    }
    for k in 0..2 {
        let c = &a[6 + 3 * k..9 + 3 * k];
        d[6 + k] = ((p[0] - c[0]).powi(2) + (p[1] - c[1]).powi(2)).sqrt() - c[2];
    }
    d
}

/// Signed-distance like value of one point, for tests that sample the surface.
pub(crate) fn metric_value(p: Point3, a: &[f64]) -> f64 {
    distances(p, a).into_iter().fold(f64::INFINITY, f64::min)
}

#[inline(always)]
fn load(points: &[Point3]) -> [Lanes; 3] {
    let mut x = [[0.0; LANES]; 3];
    for l in 0..LANES {
        let p = points[l.min(points.len() - 1)];
        for i in 0..3 {
            x[i][l] = p[i];
        }
    }
    x
}

/// Row 0..12 derivatives, row 12 the value.
#[inline(always)]
fn rows<const JACOBIAN: bool>(reading: Reading, x: &[Lanes; 3], a: &[f64; N], r: &mut Rows) {
    if reading == Reading::Metric {
        metric::<JACOBIAN>(x, a, r)
    } else {
        algebraic::<JACOBIAN>(x, a, r)
    }
}

#[inline(always)]
fn algebraic<const JACOBIAN: bool>(x: &[Lanes; 3], a: &[f64; N], r: &mut Rows) {
    let mut g = [0.0; LANES];
    let mut d = [[1.0; LANES]; 3];
    for i in 0..3 {
        for l in 0..LANES {
            let (lo, hi) = (x[i][l] - a[i], a[i] + a[3 + i] - x[i][l]);
            let t = lo * hi;
            if i == 0 {
                g[l] = t;
            } else {
                let s = (g[l] * g[l] + t * t + 1e-300).sqrt();
                if JACOBIAN {
                    let (p, q) = (1.0 - g[l] / s, 1.0 - t / s);
                    for e in d.iter_mut().take(i) {
                        e[l] *= p;
                    }
                    d[i][l] = q;
                }
                g[l] = g[l] + t - s;
            }
        }
    }
    for k in 0..2 {
        let o = 6 + 3 * k;
        for l in 0..LANES {
            let (u, v) = (x[0][l] - a[o], x[1][l] - a[o + 1]);
            let t = u * u + v * v - a[o + 2] * a[o + 2];
            let s = (g[l] * g[l] + t * t + 1e-300).sqrt();
            if JACOBIAN {
                let (p, q) = (1.0 - g[l] / s, 1.0 - t / s);
                for e in d.iter_mut() {
                    e[l] *= p;
                }
                if k == 1 {
                    for row in r[6..9].iter_mut() {
                        row[l] *= p;
                    }
                }
                r[o][l] = -2.0 * u * q;
                r[o + 1][l] = -2.0 * v * q;
                r[o + 2][l] = -2.0 * a[o + 2] * q;
            }
            g[l] = g[l] + t - s;
        }
    }
    if JACOBIAN {
        for i in 0..3 {
            for l in 0..LANES {
                let (lo, hi) = (x[i][l] - a[i], a[i] + a[3 + i] - x[i][l]);
                r[i][l] = d[i][l] * (lo - hi);
                r[3 + i][l] = d[i][l] * lo;
            }
        }
    }
    r[N] = g;
}

#[inline(always)]
fn metric<const JACOBIAN: bool>(x: &[Lanes; 3], a: &[f64; N], r: &mut Rows) {
    let mut f = [f64::INFINITY; LANES];
    let mut which = [0.0; LANES];
    let mut c = [[[0.0; LANES]; 2]; 2];
    for i in 0..3 {
        for l in 0..LANES {
            let (lo, hi) = (x[i][l] - a[i], a[i] + a[3 + i] - x[i][l]);
            which[l] = if lo < f[l] { i as f64 } else { which[l] };
            f[l] = f[l].min(lo);
            which[l] = if hi < f[l] { (3 + i) as f64 } else { which[l] };
            f[l] = f[l].min(hi);
        }
    }
    for k in 0..2 {
        let o = 6 + 3 * k;
        for l in 0..LANES {
            let (u, v) = (x[0][l] - a[o], x[1][l] - a[o + 1]);
            let p = (u * u + v * v).sqrt();
            let t = p - a[o + 2];
            which[l] = if t < f[l] { (6 + k) as f64 } else { which[l] };
            f[l] = f[l].min(t);
            if JACOBIAN {
                let inverse = if p > 0.0 { 1.0 / p } else { 0.0 };
                c[k][0][l] = u * inverse;
                c[k][1][l] = v * inverse;
            }
        }
    }
    if JACOBIAN {
        for l in 0..LANES {
            for i in 0..3 {
                let (lo, hi) = (i as f64, (3 + i) as f64);
                r[i][l] = if which[l] == lo {
                    -1.0
                } else if which[l] == hi {
                    1.0
                } else {
                    0.0
                };
                r[3 + i][l] = if which[l] == hi { 1.0 } else { 0.0 };
            }
            for k in 0..2 {
                let on = if which[l] == (6 + k) as f64 { 1.0 } else { 0.0 };
                r[6 + 3 * k][l] = -on * c[k][0][l];
                r[7 + 3 * k][l] = -on * c[k][1][l];
                r[8 + 3 * k][l] = -on;
            }
        }
    }
    r[N] = f;
}

fn fixed(a: &[f64]) -> [f64; N] {
    a.try_into().expect("twelve parameters")
}

impl ParamField for Part {
    fn dim(&self) -> usize {
        N
    }
    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
        let a = fixed(a);
        let mut r = [[0.0; LANES]; N + 1];
        for (p, o) in points.chunks(LANES).zip(out.chunks_mut(LANES)) {
            rows::<false>(self.0, &load(p), &a, &mut r);
            o.copy_from_slice(&r[N][..o.len()]);
        }
    }
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
        let a = fixed(a);
        let mut r = [[0.0; LANES]; N + 1];
        for ((p, o), j) in points
            .chunks(LANES)
            .zip(out.chunks_mut(LANES))
            .zip(jac.chunks_mut(LANES * N))
        {
            rows::<true>(self.0, &load(p), &a, &mut r);
            o.copy_from_slice(&r[N][..o.len()]);
            for l in 0..p.len() {
                for i in 0..N {
                    j[l * N + i] = r[i][l];
                }
            }
        }
    }
    fn normal_equations(
        &self,
        points: &[Point3],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let a = fixed(a);
        let mut sums = [[0.0; LANES]; (N + 1) * (N + 2) / 2];
        let mut block = [[[0.0; LANES]; N + 1]; GROUP];
        let mut root: [Lanes; GROUP] = [[1.0; LANES]; GROUP];
        for (k, points) in points.chunks(LANES * GROUP).enumerate() {
            for (b, r) in block.iter_mut().enumerate() {
                let at = b * LANES;
                if at >= points.len() {
                    *r = [[0.0; LANES]; N + 1];
                    continue;
                }
                let left = points.len() - at;
                rows::<true>(self.0, &load(&points[at..]), &a, r);
                if !weights.is_empty() || left < LANES {
                    for l in 0..LANES {
                        let w = if l >= left {
                            0.0
                        } else {
                            weights
                                .get(k * LANES * GROUP + at + l)
                                .copied()
                                .unwrap_or(1.0)
                        };
                        root[b][l] = w.sqrt();
                    }
                    for row in r.iter_mut() {
                        for l in 0..LANES {
                            row[l] *= root[b][l];
                        }
                    }
                }
            }
            let mut at = 0;
            for i in 0..=N {
                for j in 0..=i {
                    let mut s = sums[at];
                    for r in &block {
                        for l in 0..LANES {
                            s[l] += r[i][l] * r[j][l];
                        }
                    }
                    sums[at] = s;
                    at += 1;
                }
            }
        }
        let mut at = 0;
        for i in 0..=N {
            for j in 0..=i {
                let s: f64 = sums[at].iter().sum();
                at += 1;
                if i == N && j == N {
                    return s;
                } else if i == N {
                    gradient[j] = s;
                } else {
                    hessian[i * N + j] = s;
                    hessian[j * N + i] = s;
                }
            }
        }
        0.0
    }
    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        self.values(points, a, out);
        let value = |p: Point3| {
            let mut v = [0.0];
            self.values(&[p], a, &mut v);
            v[0]
        };
        for (p, g) in points.iter().zip(gradients) {
            if self.0 == Reading::Metric {
                let d = distances(*p, a);
                let which = (0..8)
                    .min_by(|&i, &j| d[i].total_cmp(&d[j]))
                    .expect("eight parts");
                *g = [0.0; 3];
                match which {
                    0..3 => g[which] = 1.0,
                    3..6 => g[which - 3] = -1.0,
                    _ => {
                        let c = &a[6 + 3 * (which - 6)..];
                        let r = (d[which] + c[2]).max(1e-300);
                        *g = [(p[0] - c[0]) / r, (p[1] - c[1]) / r, 0.0];
                    }
                }
            } else {
                for i in 0..3 {
                    let (mut u, mut v) = (*p, *p);
                    u[i] += 1e-6;
                    v[i] -= 1e-6;
                    g[i] = (value(u) - value(v)) / 2e-6;
                }
            }
        }
    }
    fn sum_of_squares(&self, points: &[Point3], weights: &[f64], a: &[f64]) -> f64 {
        let a = fixed(a);
        let mut sum = [0.0; LANES];
        let mut r = [[0.0; LANES]; N + 1];
        for (k, p) in points.chunks(LANES).enumerate() {
            rows::<false>(self.0, &load(p), &a, &mut r);
            for l in 0..LANES {
                let w = if l >= p.len() {
                    0.0
                } else {
                    weights.get(k * LANES + l).copied().unwrap_or(1.0)
                };
                sum[l] += w * r[N][l] * r[N][l];
            }
        }
        sum.iter().sum()
    }
}

/// Rows of numbers.
pub(crate) fn rows_of(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    text.lines()
        .filter(|l| !l.starts_with('#') && !l.trim().is_empty())
        .map(|l| {
            l.split([' ', ',', '\t'])
                .filter(|w| !w.is_empty())
                .map(|w| w.parse().expect("a number"))
                .collect()
        })
        .collect()
}

/// Points of a variant of the test part, from the folder that holds the variants.
pub(crate) fn variant(folder: &Path, name: &str) -> Vec<Point3> {
    let rows = rows_of(&folder.join(format!("testpart_{name}.xyz")));
    rows.iter().map(|r| [r[0], r[1], r[2]]).collect()
}

/// About `count` points of the part's own surface, uniform by area, with Gaussian noise of
/// deviation `sigma`.
pub(crate) fn sample(count: usize, sigma: f64, seed: u64) -> Vec<Point3> {
    let mut random = fastrand::Rng::with_seed(seed);
    let a = TRUTH;
    let (dx, dy, dz) = (a[3], a[4], a[5]);
    let wall = |r: f64| std::f64::consts::TAU * r * dz;
    let areas = [
        dx * dy,
        dx * dy,
        dx * dz,
        dx * dz,
        dy * dz,
        dy * dz,
        wall(a[8]),
        wall(a[11]),
    ];
    let total: f64 = areas.iter().sum();
    let mut points = Vec::with_capacity(count);
    while points.len() < count {
        let mut t = random.f64() * total;
        let face = areas.iter().position(|s| {
            t -= s;
            t < 0.0
        });
        let (u, v) = (random.f64(), random.f64());
        let p = match face.unwrap_or(7) {
            0 => [a[0] + u * dx, a[1] + v * dy, a[2]],
            1 => [a[0] + u * dx, a[1] + v * dy, a[2] + dz],
            2 => [a[0] + u * dx, a[1], a[2] + v * dz],
            3 => [a[0] + u * dx, a[1] + dy, a[2] + v * dz],
            4 => [a[0], a[1] + u * dy, a[2] + v * dz],
            5 => [a[0] + dx, a[1] + u * dy, a[2] + v * dz],
            k => {
                let o = if k == 6 { 6 } else { 9 };
                let t = std::f64::consts::TAU * u;
                [
                    a[o] + a[o + 2] * t.cos(),
                    a[o + 1] + a[o + 2] * t.sin(),
                    a[2] + v * dz,
                ]
            }
        };
        if metric_value(p, &a).abs() < 1e-9 {
            points.push(p);
        }
    }
    noise(&mut points, sigma, seed ^ 0x5eed);
    points
}

/// Adds isotropic Gaussian noise.
pub(crate) fn noise(points: &mut [Point3], sigma: f64, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    for v in points.iter_mut().flatten() {
        let (u, t) = (1.0 - random.f64(), random.f64());
        *v += sigma * (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * t).cos();
    }
}

/// Worst relative error of the parameters, the cylinders in either order.
pub(crate) fn worst_error(a: &[f64]) -> f64 {
    let error = |order: [usize; N]| {
        (0..N)
            .map(|i| ((a[order[i]] - TRUTH[i]) / TRUTH[i]).abs())
            .fold(0.0, f64::max)
    };
    error([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]).min(error([0, 1, 2, 3, 4, 5, 9, 10, 11, 6, 7, 8]))
}

/// The parameters with the cylinders in the order nearer to the truth.
pub(crate) fn canonical(a: &[f64]) -> [f64; N] {
    let swapped = [0, 1, 2, 3, 4, 5, 9, 10, 11, 6, 7, 8].map(|i: usize| a[i]);
    let own = fixed(a);
    let error = |a: &[f64; N]| {
        (0..N)
            .map(|i| ((a[i] - TRUTH[i]) / TRUTH[i]).abs())
            .fold(0.0, f64::max)
    };
    if error(&own) <= error(&swapped) {
        own
    } else {
        swapped
    }
}

/// Cramér-Rao deviations of the parameters for unit noise along the normals of the clean points.
pub(crate) fn cramer_rao(clean: &[Point3]) -> [f64; N] {
    let (mut g, mut h) = ([0.0; N], [0.0; N * N]);
    Part(Reading::Metric).normal_equations(clean, &[], &TRUTH, &mut g, &mut h);
    let mut l = h;
    assert!(isoform_num::linalg::cholesky(&mut l, N));
    std::array::from_fn(|i| {
        let mut e = [0.0; N];
        e[i] = 1.0;
        isoform_num::linalg::cholesky_solve(&l, N, &mut e);
        e[i].sqrt()
    })
}
