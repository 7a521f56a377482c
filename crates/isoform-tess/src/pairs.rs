//! Pairs of parameters with one image, as points of a smooth curve.
//!
//! A pair of parameters p = m + h e, q = m − h e, scaled to φ(p) = φ(q), is represented by m, e and
//! λ = h². Let E be the even part and h O the odd part of the polynomial h ↦ φ(m + h e); E and O
//! are polynomials in m, e and λ. The pair is a solution of O(m, e, λ) = 0, and E(m, e, λ) is its
//! image. So the two orders of a pair are one solution. The equations are regular at a pinch point
//! of Whitney, where λ = 0 and e is in the kernel of the differential: there a pair of real
//! parameters (λ > 0) turns into a conjugate pair (λ < 0).
//!
//! The double curve is determined by its sections. The pairs in a general complex plane of space
//! are found from one of them by monodromy, and the trace test shows that none are missing: the sum
//! of their images then moves on a line with the plane (A. J. Sommese, J. Verschelde and C. W.
//! Wampler, *Symmetric functions applied to decomposing solution sets of polynomial systems*,
//! 2002). They are tracked into planes that cut the box into slices, and into its faces; arcs are
//! traced from the real pairs among them.
//!
//! - *pair*: two parameters with one image, by (m, e, λ); *real* if the parameters are real or
//!   conjugate.
//! - *section*: the pairs whose images lie in a plane.
//! - *place*: a real pair on an arc, with the arc's direction.
//! - *form* of a pair: a way to write it, by a choice of signs or phases of its vectors.
//! - *pinch*: a pair of two equal parameters, λ = 0.
//!
//! All lengths are in half widths of the box.

mod arcs;
mod real;
mod section;
mod trace;

pub(crate) use arcs::{Arcs, arcs};
pub(crate) use real::ArcPlace;
pub(crate) use section::Expected;
pub(crate) use trace::Fineness;

use crate::complex::{
    C, Form, Monomials, Plane, Stream, V, along, distance, dot, eval_all, in_half_widths, inner,
    norm, normalised, rounded,
};
use crate::homotopy::{MAX_CHART_STEP, MIN_FORM_NORM, follow, newton, runge_kutta};
use crate::map::Map;

/// A pair of parameters; m and e have the norm 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    m: V,
    e: V,
    l: C,
}

/// A step of the unknowns m, e, λ.
type Step = [C; 7];

/// |λ| below which the two parts are computed from the coefficients in h rather than from two
/// values, whose difference, divided by h, loses one digit there.
const SMALL_LAMBDA: f64 = 0.02;
/// Radius of the circle of the values h used to compute the coefficients: of the size of m and e.
const SAMPLE_RADIUS: f64 = 0.5;
/// Length of the step after which Newton's method for pairs ends: the next step would be lost in
/// rounding.
const MIN_NEWTON_STEP: f64 = 1e-8;

/// Seven linear equations for a step: rows of coefficients, each with its right-hand side.
type Rows = [[C; 8]; 7];

/// Returns the principal square root.
fn sqrt(c: C) -> C {
    let r = c.norm();
    let re = (0.5 * (r + c.re)).max(0.0).sqrt();
    let im = (0.5 * (r - c.re)).max(0.0).sqrt();
    C::new(re, if c.im < 0.0 { -im } else { im })
}

fn turn(angle: f64) -> C {
    C::new(angle.cos(), angle.sin())
}

/// The forms and their gradients at m + h e for equally spaced numbers h on a circle around 0.
struct Circle {
    values: Vec<([C; 4], [V; 4])>,
    /// Angle between successive numbers.
    angle: f64,
}

impl Circle {
    fn new(pairs: &Pairs, pair: &Pair) -> Self {
        let n = pairs.degree + 1;
        let angle = std::f64::consts::TAU / n as f64;
        let value = |j: usize| {
            let h = turn(angle * j as f64).times(SAMPLE_RADIUS);
            pairs.at(&[0, 1, 2].map(|i| pair.m[i] + pair.e[i] * h))
        };
        Self {
            values: (0..n).map(value).collect(),
            angle,
        }
    }
    /// Returns the coefficients of a power of h, of the forms and of their gradients, by the
    /// discrete Fourier transform of the values.
    fn coefficient(&self, k: usize) -> ([C; 4], [V; 4]) {
        let n = self.values.len();
        let scale = 1.0 / (n as f64 * SAMPLE_RADIUS.powi(k as i32));
        let mut c = [C::ZERO; 4];
        let mut d = [[C::ZERO; 3]; 4];
        for (j, (f, df)) in self.values.iter().enumerate() {
            let weight = turn(-self.angle * ((j * k) % n) as f64).times(scale);
            for i in 0..4 {
                c[i] = c[i] + f[i] * weight;
                for x in 0..3 {
                    d[i][x] = d[i][x] + df[i][x] * weight;
                }
            }
        }
        (c, d)
    }
}

/// The part E or O, with its derivatives.
struct PairPart {
    value: [C; 4],
    by_m: [V; 4],
    by_e: [V; 4],
    by_l: [C; 4],
}

/// The even and the odd part.
struct Parts {
    even: PairPart,
    odd: PairPart,
}

impl Parts {
    /// Creates the parts from the values, ∂E/∂m, ∂O/∂m and ∂O/∂λ: ∂O/∂e is ∂E/∂m, ∂E/∂e is λ ∂O/∂m,
    /// and ∂E/∂λ is half of ∂O/∂m applied to e.
    fn new(
        pair: &Pair,
        [even, odd]: [[C; 4]; 2],
        [even_by_m, odd_by_m]: [[V; 4]; 2],
        odd_by_l: [C; 4],
    ) -> Self {
        Self {
            even: PairPart {
                value: even,
                by_m: even_by_m,
                by_e: odd_by_m.map(|row| row.map(|c| c * pair.l)),
                by_l: odd_by_m.map(|row| dot(&row, &pair.e).times(0.5)),
            },
            odd: PairPart {
                value: odd,
                by_m: odd_by_m,
                by_e: even_by_m,
                by_l: odd_by_l,
            },
        }
    }
}

impl Pair {
    fn parameters(&self) -> [V; 2] {
        let h = sqrt(self.l);
        [h, -h].map(|h| [0, 1, 2].map(|i| self.m[i] + self.e[i] * h))
    }
    /// Creates the pair of two vectors with one image.
    fn from_vectors(p: &V, q: &V) -> Self {
        let m = [0, 1, 2].map(|i| (p[i] + q[i]).times(0.5));
        let e = [0, 1, 2].map(|i| (p[i] - q[i]).times(0.5));
        Self { m, e, l: C::ONE }.scaled()
    }
    /// Scales m and e to the norm 1.
    fn scaled(&self) -> Self {
        let size = |v: &V| v.iter().map(|c| c.norm2()).sum::<f64>();
        let (m, e) = (size(&self.m), size(&self.e));
        Self {
            m: self.m.map(|c| c.times(1.0 / m.sqrt())),
            e: self.e.map(|c| c.times(1.0 / e.sqrt())),
            l: self.l.times(e / m),
        }
    }
    fn moved(&self, d: &Step, h: f64) -> Self {
        Self {
            m: along(&self.m, &[d[0], d[1], d[2]], h),
            e: along(&self.e, &[d[3], d[4], d[5]], h),
            l: self.l + d[6].times(h),
        }
    }
    /// Returns the distance between two pairs, in the better one of the two orders.
    fn distance(&self, other: &Self) -> f64 {
        let [p, q] = self.parameters().map(|p| normalised(&p));
        let [a, b] = other.parameters().map(|p| normalised(&p));
        (distance(&p, &a) + distance(&q, &b)).min(distance(&p, &b) + distance(&q, &a))
    }
}

/// Solves a system by elimination with pivots; `None` if the system is singular.
fn solve(mut a: Rows) -> Option<Step> {
    for k in 0..7 {
        let pivot = (k..7)
            .max_by(|&i, &j| a[i][k].norm2().total_cmp(&a[j][k].norm2()))
            .expect("rows");
        if a[pivot][k].norm2() == 0.0 {
            return None;
        }
        a.swap(k, pivot);
        let inverse = a[k][k].inverse();
        for j in k..8 {
            a[k][j] = a[k][j] * inverse;
        }
        for i in 0..7 {
            if i == k {
                continue;
            }
            let factor = a[i][k];
            if factor.norm2() == 0.0 {
                continue;
            }
            for j in k + 1..8 {
                a[i][j] = a[i][j] - factor * a[k][j];
            }
        }
    }
    let x = a.map(|row| row[7]);
    norm(&x).is_finite().then_some(x)
}

/// A map with its equations for pairs of parameters.
pub(crate) struct Pairs {
    /// Forms of the map, in units in which the box has the half width 1.
    forms: [Form; 4],
    degree: usize,
}

impl Pairs {
    pub(crate) fn new(map: &Map, half_width: f64) -> Self {
        Self {
            forms: in_half_widths(rounded(map.forms().each_ref()), half_width),
            degree: map.degree(),
        }
    }

    fn at(&self, p: &V) -> ([C; 4], [V; 4]) {
        eval_all(&self.forms, &Monomials::new(p, self.degree))
    }

    fn parts(&self, pair: &Pair) -> Parts {
        if pair.l.norm() > SMALL_LAMBDA {
            self.parts_by_values(pair)
        } else {
            self.parts_by_coefficients(pair)
        }
    }

    fn parts_by_values(&self, pair: &Pair) -> Parts {
        let half = sqrt(pair.l).inverse().times(0.5);
        let [(f, df), (g, dg)] = pair.parameters().map(|p| self.at(&p));
        let all = [0, 1, 2, 3];
        let even = all.map(|i| (f[i] + g[i]).times(0.5));
        let odd = all.map(|i| (f[i] - g[i]) * half);
        let even_by_m = all.map(|i| [0, 1, 2].map(|k| (df[i][k] + dg[i][k]).times(0.5)));
        let odd_by_m = all.map(|i| [0, 1, 2].map(|k| (df[i][k] - dg[i][k]) * half));
        let twice = pair.l.times(2.0).inverse();
        let odd_by_l = all.map(|i| (dot(&even_by_m[i], &pair.e) - odd[i]) * twice);
        Parts::new(pair, [even, odd], [even_by_m, odd_by_m], odd_by_l)
    }

    /// Computes the parts from the coefficients of φ(m + h e) in h: even ones belong to E, odd ones
    /// to O.
    fn parts_by_coefficients(&self, pair: &Pair) -> Parts {
        let circle = Circle::new(self, pair);
        // Sums over even and over odd powers.
        let mut sums = [[C::ZERO; 4]; 2];
        let mut by_m = [[[C::ZERO; 3]; 4]; 2];
        let mut odd_by_l = [C::ZERO; 4];
        let mut power = C::ONE;
        let mut before = C::ZERO;
        for k in 0..=self.degree {
            let (c, d) = circle.coefficient(k);
            let (sum, by_m) = (&mut sums[k % 2], &mut by_m[k % 2]);
            for i in 0..4 {
                sum[i] = sum[i] + c[i] * power;
                for x in 0..3 {
                    by_m[i][x] = by_m[i][x] + d[i][x] * power;
                }
            }
            if k % 2 == 1 {
                // The derivative of λ^((k − 1)/2).
                let weight = before.times(((k - 1) / 2) as f64);
                for i in 0..4 {
                    odd_by_l[i] = odd_by_l[i] + c[i] * weight;
                }
                before = power;
                power = power * pair.l;
            }
        }
        Parts::new(pair, sums, by_m, odd_by_l)
    }

    /// Returns the rows of the equations that a part vanishes and that the norms of m and e are
    /// kept.
    fn rows(&self, pair: &Pair, zero: &PairPart) -> Rows {
        let mut rows = [[C::ZERO; 8]; 7];
        for (i, row) in rows.iter_mut().enumerate().take(4) {
            row[..3].copy_from_slice(&zero.by_m[i]);
            row[3..6].copy_from_slice(&zero.by_e[i]);
            row[6] = zero.by_l[i];
            row[7] = -zero.value[i];
        }
        for k in 0..3 {
            rows[5][k] = pair.m[k].conj();
            rows[6][3 + k] = pair.e[k].conj();
        }
        rows
    }
    /// Returns the row of the equation that the image lies in a plane.
    fn plane_row(image: &PairPart, plane: &Plane) -> [C; 8] {
        let mut row = [C::ZERO; 8];
        for i in 0..4 {
            for k in 0..3 {
                row[k] = row[k] + plane[i] * image.by_m[i][k];
                row[3 + k] = row[3 + k] + plane[i] * image.by_e[i][k];
            }
            row[6] = row[6] + plane[i] * image.by_l[i];
            row[7] = row[7] - plane[i] * image.value[i];
        }
        row
    }

    /// Scales m and e to the norm 1, after replacing q by its multiple by a root of unity nearest
    /// to p.
    fn settled(&self, pair: &Pair) -> Pair {
        if pair.l.norm() > SMALL_LAMBDA {
            let [p, q] = pair.parameters();
            let product = inner(&p, &q);
            let n = self.degree as f64;
            // The phase nearest to the one that makes the product positive.
            let k = (-product.im.atan2(product.re) * n / std::f64::consts::TAU).round();
            if k != 0.0 {
                let root = turn(std::f64::consts::TAU * k / n);
                return Pair::from_vectors(&p, &q.map(|c| c * root));
            }
        }
        pair.scaled()
    }

    /// Returns a step of Newton's method towards a pair in a plane.
    fn step(&self, plane: &Plane, pair: &Pair) -> Option<Step> {
        let parts = self.parts(pair);
        let mut rows = self.rows(pair, &parts.odd);
        rows[4] = Self::plane_row(&parts.even, plane);
        solve(rows)
    }

    /// Tracks a pair from the plane at the time 0 to the plane at the time 1.
    ///
    /// # Errors
    /// The time and the pair at which tracking stopped, if not at the end.
    fn follow(&self, plane: &dyn Fn(f64) -> [Plane; 2], start: &Pair) -> Result<Pair, (f64, Pair)> {
        follow(start, |pair, span| {
            let d = runge_kutta(span, |time, d, h| {
                let at = pair.moved(d, h);
                let parts = self.parts(&at);
                let [plane, speed] = plane(time);
                // The norms at the start of the step are kept.
                let mut rows = self.rows(pair, &parts.odd);
                rows[4] = Self::plane_row(&parts.even, &plane);
                for row in &mut rows {
                    row[7] = C::ZERO;
                }
                rows[4][7] = -dot(&speed, &parts.even.value);
                solve(rows)
            })?;
            if norm(&d) >= MAX_CHART_STEP {
                return None;
            }
            let [plane, _] = plane(span.to);
            let found = newton(&pair.moved(&d, 1.0), MIN_NEWTON_STEP, |pair| {
                let d = self.step(&plane, pair)?;
                Some((pair.moved(&d, 1.0).scaled(), norm(&d)))
            });
            found.map(|(next, error)| (self.settled(&next), error))
        })
    }

    /// Returns true if a solution is a pair: two distinct parameters that are not base points.
    fn is_pair(&self, pair: &Pair) -> bool {
        let [p, q] = pair.parameters();
        let image = norm(&self.parts(pair).even.value);
        let apart = distance(&normalised(&p), &normalised(&q));
        // The two parameters differ, and neither is a base point.
        apart > 1e-6 * (norm(&p) + norm(&q)) && image > MIN_FORM_NORM
    }

    /// Finds a pair in a plane from a random start.
    fn seed(&self, plane: &Plane, stream: &mut Stream) -> Option<Pair> {
        let [l]: [C; 1] = stream.complex();
        let mut pair = Pair {
            m: stream.complex(),
            e: stream.complex(),
            l,
        }
        .scaled();
        // A start that needs more steps is given up for another one.
        for _ in 0..25 {
            let d = self.step(plane, &pair)?;
            let size = norm(&d);
            // Longer steps would leave the region in which vectors have the norm 1.
            pair = pair.moved(&d, (0.5 / size).min(1.0)).scaled();
            // Tracking from here refines the pair up to `MIN_NEWTON_STEP`.
            if size < 1e-9 {
                let pair = self.settled(&pair);
                return self.is_pair(&pair).then_some(pair);
            }
        }
        None
    }
}

/// Returns the linear path from a plane, times a phase, to another one; the phase makes the
/// intermediate planes complex.
fn between(from: Plane, to: Plane, phase: C) -> impl Fn(f64) -> [Plane; 2] {
    let from = from.map(|c| c * phase);
    let speed: Plane = [0, 1, 2, 3].map(|i| to[i] - from[i]);
    move |time| [[0, 1, 2, 3].map(|i| from[i] + speed[i].times(time)), speed]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::MapOptions;
    use isoform_control::Control;

    const FINE: Fineness = Fineness {
        tolerance: 1e-4,
        longest: 0.25,
    };

    fn map(texts: [&str; 4]) -> Map {
        Map::parse(texts, MapOptions::default()).unwrap()
    }

    /// Returns a dense pseudo-random map of a degree.
    fn dense(degree: usize) -> Map {
        let mut state = 12345u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % 19
        };
        let mut form = || {
            let mut text = String::from("0");
            for i in 0..=degree {
                for j in 0..=degree - i {
                    text += &format!(" + ({} - 9)*s^{i}*t^{j}", next());
                }
            }
            text
        };
        let forms = [form(), form(), form(), form()];
        map(forms.each_ref().map(String::as_str))
    }

    /// The map (u, v) ↦ (u² − v, u (u² − v), v) sends the parameters ±√v to (0, 0, v): real ones
    /// for v > 0 and conjugate ones for v < 0, with a pinch point at the origin.
    #[test]
    fn a_line_with_a_pinch_point() {
        let map = map(["s^2 - t", "s*(s^2 - t)", "t", "1"]);
        let pairs = Pairs::new(&map, 1.0);
        let expected = Expected {
            parameters: 2,
            is_finite: true,
            ..Expected::default()
        };
        let found = arcs(&pairs, FINE, &expected, &Control::default()).unwrap();
        assert_eq!(found.lost, 0);
        assert_eq!(found.arcs.len(), 1);
        let places = &found.arcs[0].places;
        let ends = [places[0].point(), places[places.len() - 1].point()];
        assert!((ends[0][2] * ends[1][2] + 1.0).abs() < 1e-12, "{ends:?}");
        let mut pinches = 0;
        for place in places {
            let [x, y, z] = place.point();
            assert!(x.abs().max(y.abs()) < 1e-12, "({x}, {y}, {z})");
            pinches += usize::from(place.is_pinch());
            match place.real() {
                Some([p, q]) => {
                    let [p, q] = [p, q].map(|p| [p[0] / p[2], p[1] / p[2]]);
                    assert!((p[0] + q[0]).abs() < 1e-12 && (p[0] * p[0] - z).abs() < 1e-12);
                    assert!((p[1] - z).abs() < 1e-12 && (q[1] - z).abs() < 1e-12);
                }
                None => assert!(z < 0.0, "{z}"),
            }
        }
        assert_eq!(pinches, 1);
        assert_eq!(found.solitary().unwrap().len(), 1);
        assert_eq!(found.real_parts().len(), 1);
    }

    /// Conjugate parameters of an even degree have several phases for which their images agree: a
    /// pinch point may appear as λ = −1, e = ±m. Tracing must not turn back there, or two arcs
    /// would end in one point of a face.
    #[test]
    fn arcs_end_apart() {
        let map = map([
            "1 + 3*t - 2*t^4 - 3*s*t^3 - 3*s^3 + 2*s^4",
            "-2 - 2*t - 3*t^3 + 2*s*t",
            "-3 + 3*t^2 + 3*t^4 + 2*s*t^3 - 3*s^2*t - 2*s^2*t^2 + 3*s^3*t",
            "-2 - 3*t^3 - 3*s*t^3 + 3*s^2*t - 3*s^2*t^2 + 2*s^3",
        ]);
        // A general quartic map has 4 * 51 parameters in a plane.
        let expected = with_parameters(204);
        let found = arcs(&Pairs::new(&map, 3.0), FINE, &expected, &Control::default()).unwrap();
        assert_eq!(found.lost, 0);
        let mut ends: Vec<[f64; 3]> = Vec::new();
        for arc in &found.arcs {
            let places = [&arc.places[0], &arc.places[arc.places.len() - 1]];
            ends.extend(places.map(ArcPlace::point));
        }
        for (k, p) in ends.iter().enumerate() {
            let is_on_face = p.iter().any(|x| (x.abs() - 1.0).abs() < 1e-12);
            assert!(is_on_face, "{p:?}");
            for q in &ends[..k] {
                let apart = isoform_geom::norm([0, 1, 2].map(|i| p[i] - q[i]));
                assert!(apart > 1e-3, "{p:?} {q:?}");
            }
        }
    }

    /// This map is like a cube at (0 : 1 : 0), whose image is (0, 0, −1): the branches of the curve
    /// of pairs of cube roots of one number cross there, and tracing cannot tell how an arc
    /// continues.
    #[test]
    fn arcs_that_change_branches_are_lost() {
        let map = map([
            "-s + 2*s^3",
            "-2*t - 2*s*t + 3*s*t^3 + s^2 + 2*s^3",
            "1 - 3*t^4 - s*t + 2*s*t^2 + 2*s*t^3 - 3*s^3",
            "3*t^4 + 3*s*t^2",
        ]);
        // Of degree 13, with a base point and two infinitely near ones: 13 * 9 + 3 * 4 - 3.
        let expected = with_parameters(126);
        let found = arcs(&Pairs::new(&map, 3.0), FINE, &expected, &Control::default()).unwrap();
        assert!(!found.arcs.is_empty());
        assert!(found.lost > 0);
    }

    /// Returns a target with a number of parameters in a plane.
    fn with_parameters(parameters: usize) -> Expected {
        Expected {
            parameters,
            ..Expected::default()
        }
    }

    /// The map (s, t) ↦ (t, 0.99995 + 4 t² + s² − 1, s (s² − 1)) sends the parameters (±1, t) to a
    /// parabola of which a piece of length 0.007 is in the box, shorter than a step.
    #[test]
    fn an_arc_that_hardly_comes_into_the_box() {
        let map = map(["t", "19999/20000 + 4*t^2 + s^2 - 1", "s^3 - s", "1"]);
        let expected = Expected {
            is_finite: true,
            ..with_parameters(4)
        };
        let found = arcs(&Pairs::new(&map, 1.0), FINE, &expected, &Control::default()).unwrap();
        assert_eq!((found.lost, found.arcs.len()), (0, 1));
        let places = &found.arcs[0].places;
        let [p, q] = [&places[0], &places[places.len() - 1]].map(ArcPlace::point);
        let far = (0.00005f64 / 4.0).sqrt();
        assert!((p[0].abs() - far).abs() < 1e-12 && (p[0] + q[0]).abs() < 1e-12);
        assert!((p[1] - 1.0).abs() < 1e-12 && (q[1] - 1.0).abs() < 1e-12);
    }

    /// A general map of degree n has a double curve of parameters of degree n³ − 4 n + 3, so that a
    /// general plane holds n (n³ − 4 n + 3) / 2 pairs (G. Salmon, *A Treatise on the Analytic
    /// Geometry of Three Dimensions*, on surfaces with a rational parametrization).
    #[test]
    fn sections_of_general_maps() {
        let mut stream = Stream::new(3);
        for n in [2, 3, 4] {
            let pairs = Pairs::new(&dense(n), 2.0);
            let plane: Plane = stream.complex();
            let expected = Expected {
                parameters: n * (n * n * n - 4 * n + 3),
                ..Expected::default()
            };
            let section = pairs
                .first_section(&plane, &expected, &Control::default())
                .unwrap();
            assert!(section.is_complete);
            assert_eq!(2 * section.pairs.len(), expected.parameters, "{n}");
            assert_eq!(section.parameters(&pairs, false), expected.parameters);
            assert!(pairs.passes_trace_test(&plane, &section.pairs, &mut stream));
            // Without one of them the sum of the images is not linear, unless there are three
            // lines.
            let less = &section.pairs[1..];
            let is_linear = pairs.passes_trace_test(&plane, less, &mut stream);
            assert_eq!(is_linear, n == 2);
        }
    }

    /// The derivatives of both parts, by values and by coefficients, agree with difference
    /// quotients.
    #[test]
    fn parts_and_derivatives() {
        let pairs = Pairs::new(&dense(4), 1.0);
        let mut stream = Stream::new(9);
        for size in [1.0, 0.03, 0.015, 1e-6, 0.0] {
            let pair = Pair {
                m: normalised(&stream.complex()),
                e: normalised(&stream.complex()),
                l: stream.phase().times(size),
            };
            let here = pairs.parts_by_coefficients(&pair);
            if size > SMALL_LAMBDA {
                let other = pairs.parts_by_values(&pair);
                for i in 0..4 {
                    assert!((here.odd.value[i] - other.odd.value[i]).norm() < 1e-12);
                    assert!((here.even.value[i] - other.even.value[i]).norm() < 1e-12);
                    assert!((here.odd.by_l[i] - other.odd.by_l[i]).norm() < 1e-11);
                }
            }
            let plane: Plane = stream.complex();
            let mut rows = pairs.rows(&pair, &here.odd);
            rows[4] = Pairs::plane_row(&here.even, &plane);
            const DIFFERENCE_STEP: f64 = 1e-6;
            for k in 0..7 {
                let mut d = [C::ZERO; 7];
                d[k] = C::ONE;
                let [a, b] = [DIFFERENCE_STEP, -DIFFERENCE_STEP]
                    .map(|h| pairs.parts_by_coefficients(&pair.moved(&d, h)));
                for i in 0..4 {
                    let slope = (a.odd.value[i] - b.odd.value[i]).times(0.5 / DIFFERENCE_STEP);
                    assert!((slope - rows[i][k]).norm() < 1e-8, "{size} {i} {k}");
                }
                let slope = (dot(&plane, &a.even.value) - dot(&plane, &b.even.value))
                    .times(0.5 / DIFFERENCE_STEP);
                assert!((slope - rows[4][k]).norm() < 1e-8, "{size} plane {k}");
            }
        }
    }
}
