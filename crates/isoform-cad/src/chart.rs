//! Parameters of points near a surface.

use isoform_geom::cad::{CadCurve, CadSurface, SurfaceJet};
use isoform_geom::{Aabb, Point3, distance_squared, dot, norm, sub};

/// Maximum number of steps of Newton's method; from a start in the basin ten suffice.
const MAX_NEWTON_STEPS: usize = 50;
/// Maximum number of samples of a spline surface in each direction, from which searches start.
const MAX_SAMPLES_PER_SIDE: usize = 160;
/// Distance from a pole within which a point counts as the pole, relative to the size of the face:
/// ten times the accuracy to which files hold coordinates.
const POLE_TOLERANCE: f64 = 1e-6;

/// Surface of a face, with what searches on it need.
#[derive(Debug)]
pub(crate) struct Chart {
    pub(crate) surface: CadSurface,
    /// Periods of u and v, `None` in a direction that does not close.
    pub(crate) periods: [Option<f64>; 2],
    /// Lines of one parameter that are single points.
    pub(crate) poles: Vec<Pole>,
    /// Bounds of u and v, infinite in closed directions and without a bound.
    domain: [[f64; 2]; 2],
    /// Samples from which searches start; empty for surfaces with a formula.
    samples: Vec<([f64; 2], Point3)>,
}

/// Line of one parameter that is a single point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pole {
    /// Direction that is constant: 0 for u, 1 for v.
    pub(crate) direction: usize,
    /// Value of that parameter.
    pub(crate) at: f64,
    /// Point in space.
    pub(crate) point: Point3,
    /// Distance within which a point counts as the pole.
    tolerance: f64,
}

impl Chart {
    /// Creates the chart of a face whose border lies in a box.
    pub(crate) fn new(surface: &CadSurface, border: &Aabb) -> Self {
        let periods = surface.periods();
        let mut domain = surface.domain();
        for k in 0..2 {
            if periods[k].is_some() {
                domain[k] = [f64::NEG_INFINITY, f64::INFINITY];
            }
        }
        let size = match surface {
            CadSurface::Sphere(_, r) => *r,
            CadSurface::Nurbs(spline) => {
                let control: Vec<Point3> = spline.control().collect();
                Aabb::from_points(&control).diagonal()
            }
            _ => 0.0,
        };
        let tolerance = POLE_TOLERANCE * border.diagonal().max(size);
        let poles = surface.poles().into_iter().map(|(direction, at)| {
            let other = surface.domain()[1 - direction][0];
            let other = if other.is_finite() { other } else { 0.0 };
            let place = if direction == 0 {
                [at, other]
            } else {
                [other, at]
            };
            Pole {
                direction,
                at,
                point: surface.at(place).p,
                tolerance,
            }
        });
        let poles = poles.collect();
        Self {
            samples: samples(surface, border),
            surface: surface.clone(),
            periods,
            poles,
            domain,
        }
    }

    /// Frees the samples, after which only searches from a start remain.
    pub(crate) fn forget_samples(&mut self) {
        self.samples = Vec::new();
    }

    /// Returns the pole at a point.
    pub(crate) fn pole_at(&self, p: Point3) -> Option<&Pole> {
        let near = |pole: &&Pole| norm(sub(p, pole.point)) <= pole.tolerance;
        self.poles.iter().find(near)
    }

    /// Returns the parameters of the nearest point of the surface.
    pub(crate) fn place(&self, p: Point3) -> [f64; 2] {
        if let Some(feet) = self.surface.feet(p) {
            return self.within(feet[0]);
        }
        let mut starts = self.starts(p);
        // The nearest sample may lead to a worse minimum than its rivals.
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let feet = starts.iter().take(4).map(|(_, at)| self.newton(p, *at));
        let far = |at: &[f64; 2]| distance_squared(self.surface.at(*at).p, p);
        let best = feet.min_by(|a, b| far(a).total_cmp(&far(b)));
        best.unwrap_or([0.0; 2])
    }

    /// Returns the parameters of the point of the surface that is nearest to one near `at`, in the
    /// period that is nearest to `at`.
    pub(crate) fn place_near(&self, p: Point3, at: [f64; 2]) -> [f64; 2] {
        let found = match self.surface.feet(p) {
            Some(feet) => self.within(feet[0]),
            None => self.newton(p, at),
        };
        self.unwrapped(found, at)
    }

    /// Returns parameters within the bounds of the surface, which a cone has at its apex.
    pub(crate) fn clamped(&self, at: [f64; 2]) -> [f64; 2] {
        self.within(at)
    }

    fn within(&self, at: [f64; 2]) -> [f64; 2] {
        let [u, v] = self.domain;
        [at[0].clamp(u[0], u[1]), at[1].clamp(v[0], v[1])]
    }

    /// Returns parameters shifted by periods next to others.
    pub(crate) fn unwrapped(&self, mut found: [f64; 2], at: [f64; 2]) -> [f64; 2] {
        for k in 0..2 {
            if let Some(period) = self.periods[k] {
                found[k] -= ((found[k] - at[k]) / period).round() * period;
            }
        }
        found
    }

    /// Returns the squared distances and parameters of the samples.
    fn starts(&self, p: Point3) -> Vec<(f64, [f64; 2])> {
        let place = |(at, q): &([f64; 2], Point3)| match &self.surface {
            // Samples are those of the profile; the other parameter has a formula.
            CadSurface::Extruded(_, way) => {
                let v = dot(sub(p, *q), *way) / dot(*way, *way);
                let at = [at[0], v];
                (distance_squared(self.surface.at(at).p, p), at)
            }
            CadSurface::Revolved(axes, _) => {
                let ([x, y, _], [a, b, _]) = (axes.local(p), axes.local(*q));
                let at = [y.atan2(x) - b.atan2(a), at[1]];
                (distance_squared(self.surface.at(at).p, p), at)
            }
            _ => (distance_squared(*q, p), *at),
        };
        self.samples.iter().map(place).collect()
    }

    /// Returns the parameters of a local minimum of the distance from `p`: Newton's method with
    /// steps that never lead farther away.
    pub(crate) fn newton(&self, p: Point3, from: [f64; 2]) -> [f64; 2] {
        let mut at = self.within(from);
        let mut jet = self.surface.at(at);
        let mut far = distance_squared(jet.p, p);
        for _ in 0..MAX_NEWTON_STEPS {
            // At a pole, steps of the parameter that has no effect are of any size.
            let step = self.step(p, at, &jet);
            let step = [0, 1].map(|k| {
                let [lo, hi] = self.domain[k];
                step[k].clamp(lo - hi, hi - lo)
            });
            let mut share = 1.0;
            let next = loop {
                let next = [at[0] + share * step[0], at[1] + share * step[1]];
                let next = self.within(next);
                let there = self.surface.at(next);
                let now = distance_squared(there.p, p);
                if now <= far {
                    break Some((next, there, now));
                }
                if share < 1e-4 {
                    break None;
                }
                share *= 0.5;
            };
            let Some((next, there, now)) = next else {
                break;
            };
            let moved = norm(sub(there.p, jet.p));
            (at, jet, far) = (next, there, now);
            // A step below the rounding of the coordinates is the last.
            if moved <= 2.0 * f64::EPSILON * (norm(jet.p) + norm(p)) {
                break;
            }
        }
        at
    }

    /// Returns the step of Newton's method; where the distance is not convex, that of Gauss and
    /// Newton. A parameter at its bound that would leave it stays.
    fn step(&self, p: Point3, at: [f64; 2], jet: &SurfaceJet) -> [f64; 2] {
        let r = sub(jet.p, p);
        let slope = [dot(r, jet.u), dot(r, jet.v)];
        let first = [dot(jet.u, jet.u), dot(jet.u, jet.v), dot(jet.v, jet.v)];
        let bend = [dot(r, jet.uu), dot(r, jet.uv), dot(r, jet.vv)];
        let held = [0, 1].map(|k| {
            let [lo, hi] = self.domain[k];
            (at[k] <= lo && slope[k] > 0.0) || (at[k] >= hi && slope[k] < 0.0)
        });
        let full: [f64; 3] = std::array::from_fn(|i| first[i] + bend[i]);
        let is_convex = full[0] > 1e-3 * first[0]
            && full[2] > 1e-3 * first[2]
            && full[0] * full[2] - full[1] * full[1] > 1e-6 * first[0] * first[2];
        let [a, b, c] = if is_convex { full } else { first };
        let divided = |x: f64, y: f64| if y > 0.0 { x / y } else { 0.0 };
        let det = a * c - b * b;
        match held {
            [true, true] => [0.0; 2],
            [true, false] => [0.0, divided(-slope[1], c)],
            [false, true] => [divided(-slope[0], a), 0.0],
            [false, false] if det > 1e-14 * a * c => [
                (b * slope[1] - c * slope[0]) / det,
                (b * slope[0] - a * slope[1]) / det,
            ],
            [false, false] => [divided(-slope[0], a), divided(-slope[1], c)],
        }
    }
}

/// Returns samples of a surface without a formula: of its profile, or of a spline.
fn samples(surface: &CadSurface, border: &Aabb) -> Vec<([f64; 2], Point3)> {
    let on_profile = |curve: &CadCurve, k: usize| -> Vec<([f64; 2], Point3)> {
        let values = curve_samples(curve, border);
        let place = |t: f64| if k == 0 { [t, 0.0] } else { [0.0, t] };
        values
            .into_iter()
            .map(|t| (place(t), curve.at(t)[0]))
            .collect()
    };
    match surface {
        CadSurface::Extruded(curve, _) => on_profile(curve, 0),
        CadSurface::Revolved(_, curve) => on_profile(curve, 1),
        CadSurface::Nurbs(spline) => {
            let sides = [0, 1].map(|k| {
                let breaks = spline.breaks(k);
                let spans = breaks.len() - 1;
                let each = (MAX_SAMPLES_PER_SIDE / spans).clamp(1, spline.degree(k) + 2);
                // Of very many spans some are skipped.
                let skip = spans.div_ceil(MAX_SAMPLES_PER_SIDE);
                let mut all: Vec<f64> = breaks.iter().copied().step_by(skip).collect();
                all.push(breaks[spans]);
                all.dedup();
                divided(&all, each)
            });
            let mut all = Vec::with_capacity(sides[0].len() * sides[1].len());
            for u in &sides[0] {
                all.extend(sides[1].iter().map(|v| ([*u, *v], spline.at([*u, *v]).p)));
            }
            all
        }
        _ => Vec::new(),
    }
}

/// Returns parameters of a profile: all of it, or the part near a box if it has no ends.
fn curve_samples(curve: &CadCurve, border: &Aabb) -> Vec<f64> {
    let reach = |p: Point3| norm(sub(border.center(), p)) + border.diagonal();
    let around = |half: f64| divided(&[-half, half], 64);
    match curve {
        CadCurve::Nurbs(spline) => divided(&spline.breaks(), spline.degree() + 2),
        CadCurve::Circle(..) | CadCurve::Ellipse(..) => divided(&[0.0, std::f64::consts::TAU], 32),
        CadCurve::Line(p, d) => around(reach(*p) / norm(*d)),
        CadCurve::Parabola(axes, f) => around(reach(axes.origin) / (2.0 * f)),
        CadCurve::Hyperbola(axes, _, b) => around((reach(axes.origin) / b).asinh()),
    }
}

/// Returns some values in each interval, and the ends.
fn divided(breaks: &[f64], each: usize) -> Vec<f64> {
    let mut all = vec![breaks[0]];
    for w in breaks.windows(2) {
        all.extend((1..=each).map(|k| w[0] + (w[1] - w[0]) * k as f64 / each as f64));
    }
    all
}
