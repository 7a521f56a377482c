//! Functions computed by iteration, in every number type.
//!
//! The iteration runs on plain values; Newton steps in the number type then lift the result to a
//! jet, since each step doubles the order to which the jet is exact (the defining equation is
//! evaluated exactly in the jet).

use isoform_num::Real;

/// Lower bound on t + s² in units of s² for computing the foot point u s²/(t + s²). Below it the
/// root t equals −s² up to rounding: u lies on a principal plane inside the focal curve.
const OFF_PLANE_RATIO: f64 = 1e-9;
/// Maximum number of bisection steps. Most bisections end sooner, at neighbouring doubles.
const MAX_BISECTIONS: usize = 200;

/// Computes the signed distance to an axis-parallel ellipsoid about 0, positive inside: `u[0..3]`,
/// half axes `u[3..6]`.
///
/// The foot point is q = u s²/(t + s²) with Σ (u s/(t + s²))² = 1; the largest root t is bracketed
/// and bisected on values, then polished by Newton (robust at the centre and on the principal
/// planes, where the root is the end of the bracket).
pub(crate) fn ellipsoid_distance<R: Real>(args: &[R]) -> R {
    let v: Vec<f64> = args.iter().map(Real::value).collect();
    if v.iter().any(|c| !c.is_finite()) {
        return R::constant(f64::NAN);
    }
    let of = Ellipsoid {
        u: [v[0].abs(), v[1].abs(), v[2].abs()],
        s: [v[3].abs(), v[4].abs(), v[5].abs()],
    };
    if of.s.contains(&0.0) {
        return R::constant(f64::NAN);
    }
    let t = of.root();
    if (0..3).all(|i| of.is_off_plane(t, i)) {
        lifted_distance(args, t)
    } else {
        R::constant(of.distance_from_plane(t))
    }
}

/// Point in the first octant, and the half axes of an ellipsoid.
struct Ellipsoid {
    /// The point.
    u: [f64; 3],
    /// The half axes.
    s: [f64; 3],
}

impl Ellipsoid {
    /// Computes the largest t with Σ (u s/(t + s²))² = 1, by bisection.
    fn root(&self) -> f64 {
        let Self { u, s } = self;
        let least = s.iter().copied().fold(f64::INFINITY, f64::min);
        let g = |t: f64| {
            (0..3)
                .map(|i| (u[i] * s[i] / (t + s[i] * s[i])).powi(2))
                .sum::<f64>()
                - 1.0
        };
        let farthest = (0..3).map(|i| (u[i] * s[i]).powi(2)).sum::<f64>().sqrt();
        bisected(-least * least, farthest, |t| g(t) > 0.0)
    }

    /// Returns true if coordinate i of the foot point can be computed as u s²/(t + s²).
    fn is_off_plane(&self, t: f64, i: usize) -> bool {
        let s2 = self.s[i] * self.s[i];
        t + s2 > OFF_PLANE_RATIO * self.s[i] * self.s[i]
    }

    /// Returns true if the point lies inside the ellipsoid: Σ (u/s)² ≤ 1.
    fn is_inside(&self) -> bool {
        (0..3).map(|i| (self.u[i] / self.s[i]).powi(2)).sum::<f64>() <= 1.0
    }

    /// Computes the distance of a point on the medial axis: the foot point lies off the principal
    /// plane in the direction of the shortest half axis.
    fn distance_from_plane(&self, t: f64) -> f64 {
        let Self { u, s } = self;
        let mut q: [f64; 3] = std::array::from_fn(|i| {
            if self.is_off_plane(t, i) {
                u[i] * s[i] * s[i] / (t + s[i] * s[i])
            } else {
                0.0
            }
        });
        let short = (0..3).fold(0, |b, i| if s[i] < s[b] { i } else { b });
        let rest: f64 = (0..3)
            .filter(|&i| i != short)
            .map(|i| (q[i] / s[i]).powi(2))
            .sum();
        q[short] = s[short] * (1.0 - rest).max(0.0).sqrt();
        let d = (0..3).map(|i| (u[i] - q[i]).powi(2)).sum::<f64>().sqrt();
        if self.is_inside() { d } else { -d }
    }
}

/// Computes the distance in the number type from the root t of the values: Newton on g = Σ a − 1
/// with a = (u s/(t + s²))² and g' = −2 Σ a/(t + s²).
fn lifted_distance<R: Real>(args: &[R], t: f64) -> R {
    let mut t = R::constant(t);
    let s2: Vec<R> = (3..6).map(|i| args[i].square()).collect();
    for _ in 0..3 {
        let (mut value, mut slope) = (R::constant(-1.0), R::constant(0.0));
        for i in 0..3 {
            let d = t.clone() + s2[i].clone();
            let a = (args[i].clone() * args[i + 3].clone() / d.clone()).square();
            slope = slope + a.clone() / d;
            value = value + a;
        }
        t = t + value / (slope * R::constant(2.0));
    }
    // u − q = u t/(t + s²): the distance is |t| times √Σ (u/(t + s²))², and t < 0 inside.
    let mut sum = R::constant(0.0);
    for i in 0..3 {
        sum = sum + (args[i].clone() / (t.clone() + s2[i].clone())).square();
    }
    -t * sum.sqrt()
}

/// Computes the second largest real root m of the SARDF quartic for f, g > 0 and R; 0 if it has
/// fewer than two.
pub(crate) fn sardf_root<R: Real>(args: &[R]) -> R {
    let (f, g, r) = (args[0].value(), args[1].value(), args[2].value());
    if !(f > 0.0 && g > 0.0 && r > 0.0) {
        return R::constant(0.0);
    }
    let q = r.sqrt();
    let c = [-(f * f + g * g), 4.0 * q * (f + g), -4.0 * r, -4.0 * q, 1.0];
    let Some(m) = second_largest_root(&c) else {
        return R::constant(0.0);
    };
    let q = args[2].sqrt();
    let mut m = R::constant(m);
    for _ in 0..3 {
        let (value, slope) = sardf_quartic([&args[0], &args[1], &args[2], &q], &m);
        if slope.value() == 0.0 {
            break;
        }
        m = m - value / slope;
    }
    m
}

/// Evaluates m⁴ − 4q m³ − 4R m² + 4q (f + g) m − (f² + g²), q = √R, and its derivative by m.
fn sardf_quartic<R: Real>([f, g, r, q]: [&R; 4], m: &R) -> (R, R) {
    let k = R::constant;
    let m2 = m.square();
    let value =
        m2.square() - k(4.0) * q.clone() * m2.clone() * m.clone() - k(4.0) * r.clone() * m2.clone()
            + k(4.0) * q.clone() * (f.clone() + g.clone()) * m.clone()
            - (f.square() + g.square());
    let slope =
        k(4.0) * m2.clone() * m.clone() - k(12.0) * q.clone() * m2 - k(8.0) * r.clone() * m.clone()
            + k(4.0) * q.clone() * (f.clone() + g.clone());
    (value, slope)
}

/// Returns the second largest real root of a quartic with the coefficients from constant to
/// leading.
fn second_largest_root(c: &[f64; 5]) -> Option<f64> {
    let roots = real_roots(c);
    (roots.len() >= 2).then(|| roots[roots.len() - 2])
}

/// Computes the real roots of a polynomial in ascending order, by bisection between neighbouring
/// roots of the derivative, where it is monotone. Cauchy's bound 1 + max |cᵢ/cₙ| bounds all of
/// them.
fn real_roots(c: &[f64]) -> Vec<f64> {
    let degree = c.len() - 1;
    if degree == 1 {
        return if c[1] != 0.0 {
            vec![-c[0] / c[1]]
        } else {
            Vec::new()
        };
    }
    let derivative: Vec<f64> = (1..=degree).map(|i| c[i] * i as f64).collect();
    let bound = 1.0
        + c[..degree]
            .iter()
            .map(|v| (v / c[degree]).abs())
            .fold(0.0, f64::max);
    let mut cuts = vec![-bound];
    cuts.extend(
        real_roots(&derivative)
            .into_iter()
            .filter(|v| v.abs() < bound),
    );
    cuts.push(bound);
    let eval = |t: f64| c.iter().rev().fold(0.0, |s, k| s * t + k);
    let mut roots = Vec::new();
    for w in cuts.windows(2) {
        let (a, b) = (eval(w[0]), eval(w[1]));
        if a == 0.0 && w[0] > -bound {
            roots.push(w[0]);
        } else if a.signum() != b.signum() {
            roots.push(bisected(w[0], w[1], |t| eval(t).signum() == a.signum()));
        }
    }
    roots
}

/// Finds the number between `lo` and `hi` at which `is_below` changes from true to false, by
/// bisection down to neighbouring doubles.
fn bisected(mut lo: f64, mut hi: f64, is_below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..MAX_BISECTIONS {
        let m = 0.5 * (lo + hi);
        if m <= lo || m >= hi {
            break;
        }
        if is_below(m) { lo = m } else { hi = m }
    }
    0.5 * (lo + hi)
}

/// Computes C's fmod; the derivative by u is 1, by v −trunc(u/v).
pub(crate) fn fmod<R: Real>(args: &[R]) -> R {
    let (u, v) = (args[0].value(), args[1].value());
    if !(u.is_finite() && v.is_finite()) || v == 0.0 {
        return R::constant(f64::NAN);
    }
    let n = ((u - u % v) / v).round();
    args[0].clone() - args[1].clone() * R::constant(n)
}

/// Hashes a lattice point's coordinates, in place of Perlin's permutation.
fn lattice_hash(point: [f64; 3]) -> u64 {
    let mut hash = 0x9E37_79B9_7F4A_7C15u64;
    for c in point {
        let at = c.clamp(-9e15, 9e15) as i64;
        hash = (hash ^ at as u64).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        hash ^= hash >> 29;
    }
    hash
}

/// Returns the dot product of d and the gradient that the hash selects among the twelve edge
/// directions of a cube.
fn along_edge<R: Real>(hash: u64, d: &[R; 3]) -> R {
    let n = (hash >> 33) % 12;
    let (a, b) = [(0, 1), (0, 2), (1, 2)][(n / 4) as usize];
    let sign = |s: u64| R::constant(if s == 0 { 1.0 } else { -1.0 });
    sign(n & 1) * d[a].clone() + sign((n >> 1) & 1) * d[b].clone()
}

/// Computes Ken Perlin's improved noise with a fixed 64-bit hash in place of his permutation table,
/// identical on all machines.
pub(crate) fn perlin<R: Real>(args: &[R]) -> R {
    let cell: [f64; 3] = std::array::from_fn(|i| args[i].value().floor());
    let p: [R; 3] = std::array::from_fn(|i| args[i].clone() - R::constant(cell[i]));
    let k = R::constant;
    let fade = |t: &R| t.powi(3) * (t.clone() * (t.clone() * k(6.0) - k(15.0)) + k(10.0));
    let w: [R; 3] = std::array::from_fn(|i| fade(&p[i]));
    let mut sum = k(0.0);
    for corner in 0..8u32 {
        let bit = |i: usize| (corner >> i) & 1;
        let at = std::array::from_fn(|i| cell[i] + f64::from(bit(i)));
        let d: [R; 3] = std::array::from_fn(|i| p[i].clone() - k(f64::from(bit(i))));
        let mut term = along_edge(lattice_hash(at), &d);
        for (i, w) in w.iter().enumerate() {
            term = term
                * if bit(i) == 1 {
                    w.clone()
                } else {
                    k(1.0) - w.clone()
                };
        }
        sum = sum + term;
    }
    sum
}
