//! Moments of plane points, and the lines and circles fitted from them.

use super::curve::{CurveFamily, PlanePoint, ProfileCurve, inner, minus, norm};

/// Sums over points: of 1, x, y, xx, xy, yy, and with z = xx + yy of zx, zy, zz.
#[derive(Clone, Copy, Default)]
pub(super) struct Moments {
    pub(super) count: f64,
    first: PlanePoint,
    second: [f64; 3],
    third: PlanePoint,
    fourth: f64,
}

impl Moments {
    pub(super) fn from_point(p: PlanePoint, weight: f64) -> Self {
        let mut new = Self::default();
        new.add(p, weight);
        new
    }

    pub(super) fn add(&mut self, p: PlanePoint, weight: f64) {
        let [x, y] = p;
        let z = x * x + y * y;
        self.count += weight;
        self.first = [self.first[0] + weight * x, self.first[1] + weight * y];
        let square = [x * x, x * y, y * y];
        (0..3).for_each(|k| self.second[k] += weight * square[k]);
        self.third = [
            self.third[0] + weight * z * x,
            self.third[1] + weight * z * y,
        ];
        self.fourth += weight * z * z;
    }

    /// Returns the sums over the points that `other` lacks.
    pub(super) fn less(&self, other: &Self) -> Self {
        Self {
            count: self.count - other.count,
            first: std::array::from_fn(|k| self.first[k] - other.first[k]),
            second: std::array::from_fn(|k| self.second[k] - other.second[k]),
            third: std::array::from_fn(|k| self.third[k] - other.third[k]),
            fourth: self.fourth - other.fourth,
        }
    }

    fn mean(&self) -> PlanePoint {
        self.first.map(|x| x / self.count)
    }

    /// Returns the central second moments Σ xx, xy, yy.
    fn spread(&self) -> [f64; 3] {
        let [x, y] = self.first;
        let [xx, xy, yy] = self.second;
        let n = self.count;
        [xx - x * x / n, xy - x * y / n, yy - y * y / n]
    }

    /// Returns the curve of a shape through the points, and the sum of their squared distances.
    pub(super) fn fitted(&self, shape: CurveFamily) -> Option<(ProfileCurve, f64)> {
        let [xx, _, yy] = self.spread();
        match shape {
            CurveFamily::Along => Some((ProfileCurve::Line(self.mean(), [1.0, 0.0]), yy.max(0.0))),
            CurveFamily::Across => Some((ProfileCurve::Line(self.mean(), [0.0, 1.0]), xx.max(0.0))),
            CurveFamily::Line => self.line(),
            CurveFamily::Circle => self.circle(),
            CurveFamily::Centred => self.centred_circle(),
        }
    }

    /// Returns true if a curve is wide enough for the noise, and the points extend farther along it
    /// than noise does across it.
    pub(super) fn is_long(&self, curve: &ProfileCurve, noise: f64) -> bool {
        let [a, b] = match curve {
            ProfileCurve::Line(_, along) => *along,
            ProfileCurve::Circle(center, _) => {
                let away = minus(self.mean(), *center);
                let size = norm(away);
                [-away[1] / size, away[0] / size]
            }
        };
        let [xx, xy, yy] = self.spread();
        let squares = a * a * xx + 2.0 * a * b * xy + b * b * yy;
        // A face is about four deviations long. Short stretches of noise are wider than long, and
        // lines across them follow it well: their points have the variance 1 along these.
        curve.is_wider_than(noise) && squares >= 1.5 * noise * noise * self.count
    }

    pub(super) fn line(&self) -> Option<(ProfileCurve, f64)> {
        let [xx, xy, yy] = self.spread();
        // Half the difference of the principal moments, and the sine and cosine of twice the angle.
        let half = (((xx - yy) / 2.0).powi(2) + xy * xy).sqrt();
        let squares = (xx + yy) / 2.0 - half;
        let (sin, cos) = match half > 0.0 {
            true => (xy / half, (xx - yy) / (2.0 * half)),
            false => (0.0, 1.0),
        };
        // The larger component is a root, from which the other follows: this avoids cancellation.
        let root = ((1.0 + cos.abs()) / 2.0).sqrt();
        let other = sin.abs() / (2.0 * root);
        let along = match cos >= 0.0 {
            true => [root, other.copysign(sin)],
            false => [other, root.copysign(sin)],
        };
        (self.count > 1.0).then(|| (ProfileCurve::Line(self.mean(), along), squares.max(0.0)))
    }

    /// Returns the central moments of z with x, y and z.
    fn spread_of_z(&self) -> [f64; 3] {
        let z = self.second[0] + self.second[2];
        let n = self.count;
        [
            self.third[0] - z * self.first[0] / n,
            self.third[1] - z * self.first[1] / n,
            self.fourth - z * z / n,
        ]
    }

    /// Returns the circle of least algebraic distance (Kåsa 1976): z = 2ax + 2by + c is linear in
    /// a, b, c.
    fn circle(&self) -> Option<(ProfileCurve, f64)> {
        let ([xx, xy, yy], [zx, zy, zz]) = (self.spread(), self.spread_of_z());
        let d = xx * yy - xy * xy;
        let (a, b) = ((zx * yy - zy * xy) / d, (zy * xx - zx * xy) / d);
        self.circle_about([a / 2.0, b / 2.0], zz - a * zx - b * zy)
    }

    fn centred_circle(&self) -> Option<(ProfileCurve, f64)> {
        let ([xx, ..], [zx, _, zz]) = (self.spread(), self.spread_of_z());
        let a = zx / xx;
        self.circle_about([a / 2.0, 0.0], zz - a * zx)
    }

    /// Returns the circle about a centre; `rest` is the sum of the squared residuals of its
    /// equation.
    fn circle_about(&self, center: PlanePoint, rest: f64) -> Option<(ProfileCurve, f64)> {
        let [x, y] = self.mean();
        let z = (self.second[0] + self.second[2]) / self.count;
        let squared = z - 2.0 * (center[0] * x + center[1] * y) + inner(center, center);
        let is_proper = squared > 0.0 && squared.is_finite() && rest.is_finite();
        is_proper.then(|| {
            let squares = rest.max(0.0) / (4.0 * squared);
            (ProfileCurve::Circle(center, squared.sqrt()), squares)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines in every direction, also along the axes, from points strewn about them.
    #[test]
    fn lines_have_the_direction_of_their_points() {
        for k in 0..48 {
            let (sin, cos) = (f64::from(k) * std::f64::consts::PI / 48.0).sin_cos();
            let mut sums = Moments::default();
            for t in -5..=5 {
                let (t, off) = (f64::from(t), if t % 2 == 0 { 0.01 } else { -0.012 });
                sums.add([0.3 + t * cos - off * sin, t * sin + off * cos], 1.0);
            }
            let Some((ProfileCurve::Line(_, [a, b]), squares)) = sums.line() else {
                panic!("there is a line");
            };
            assert!((a * a + b * b - 1.0).abs() < 1e-14);
            assert!((a * sin - b * cos).abs() < 1e-12, "{k}: {a} {b}");
            assert!((squares - 1.32e-3).abs() < 1e-4, "{squares}");
        }
    }
}
