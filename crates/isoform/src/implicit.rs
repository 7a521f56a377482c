//! Functions fitted to points, as read from files: splines and polynomials.

use isoform_field::{Placed, Polynomial};
use isoform_geom::{Aabb, Expansion, Field, Point3, PolynomialData, Terms};
use isoform_num::{Interval, Jet2, Jet3};
use isoform_spline::{ImplicitSpline, MAX_GLOBAL_DEGREE};

/// Number of intervals along each edge of a box on whose sides a function is sampled. The number of
/// samples is six times its square; fewer may miss a small region of the other sign.
const BOX_EDGE_INTERVALS: usize = 24;

/// Function f fitted to points; the solid is f ≥ 0.
#[derive(Clone, Debug)]
pub enum Implicit {
    /// Hierarchical B-spline.
    Spline(ImplicitSpline),
    /// Single polynomial.
    Polynomial(GlobalPolynomial),
}

/// Returns true if a function is positive on samples of all sides of a box.
pub(crate) fn is_inside_out(field: &dyn Field, domain: Aabb) -> bool {
    let size = domain.size();
    let at = |i: usize| i as f64 / BOX_EDGE_INTERVALS as f64;
    let places = (0..6 * (BOX_EDGE_INTERVALS + 1).pow(2)).map(|i| {
        let (side, u, v) = (
            i % 6,
            i / 6 % (BOX_EDGE_INTERVALS + 1),
            i / 6 / (BOX_EDGE_INTERVALS + 1),
        );
        let mut share = [0.0; 3];
        share[side / 2] = (side % 2) as f64;
        share[(side / 2 + 1) % 3] = at(u);
        share[(side / 2 + 2) % 3] = at(v);
        std::array::from_fn(|k| domain.lo[k] + share[k] * size[k])
    });
    let places: Vec<Point3> = places.collect();
    let mut values = vec![0.0; places.len()];
    field.values(&places, &mut values);
    values.iter().all(|v| *v > 0.0)
}

impl Implicit {
    fn field(&self) -> &dyn Field {
        match self {
            Self::Spline(spline) => spline,
            Self::Polynomial(polynomial) => &polynomial.field,
        }
    }
    /// Returns the edge length of the cells that record where the points were.
    pub fn spacing(&self) -> f64 {
        match self {
            Self::Spline(spline) => spline.spacing(),
            Self::Polynomial(polynomial) => polynomial.data.spacing,
        }
    }
    /// Returns the box of the points, in which the function was fitted.
    pub fn domain(&self) -> Aabb {
        match self {
            Self::Spline(spline) => spline.domain(),
            Self::Polynomial(polynomial) => polynomial.domain(),
        }
    }
    /// Returns true if there were points in the cell that contains `p`.
    pub fn holds_data(&self, p: Point3) -> bool {
        match self {
            Self::Spline(spline) => spline.holds_data(p),
            Self::Polynomial(polynomial) => polynomial.holds(polynomial.cell(p)),
        }
    }
    /// Returns true if the function is positive on all sides of its box: the solid is then the
    /// outside of the surface.
    pub fn is_inside_out(&self) -> bool {
        is_inside_out(self.field(), self.domain())
    }
    /// Returns true if there were points in the cell that contains `p`, or in one that shares a
    /// face with it.
    pub fn is_seen(&self, p: Point3) -> bool {
        match self {
            Self::Spline(spline) => spline.is_seen(p),
            Self::Polynomial(polynomial) => polynomial.is_seen(p),
        }
    }
}

impl From<ImplicitSpline> for Implicit {
    fn from(spline: ImplicitSpline) -> Self {
        Self::Spline(spline)
    }
}

impl Field for Implicit {
    fn value(&self, p: Point3) -> f64 {
        self.field().value(p)
    }
    fn jet(&self, p: Point3) -> Jet2 {
        self.field().jet(p)
    }
    fn bounds(&self, region: Aabb) -> Interval {
        self.field().bounds(region)
    }
    fn values(&self, points: &[Point3], out: &mut [f64]) {
        self.field().values(points, out);
    }
    fn jets(&self, points: &[Point3], out: &mut [Jet2]) {
        self.field().jets(points, out);
    }
    fn jet3(&self, p: Point3) -> Option<Jet3> {
        self.field().jet3(p)
    }
    fn expansion(&self, at: Point3, region: Aabb) -> Option<Expansion> {
        self.field().expansion(at, region)
    }
    fn terms(&self) -> Option<Terms<'_>> {
        self.field().terms()
    }
}

/// Polynomial fitted to points, with the cells that contained points.
#[derive(Clone, Debug)]
pub struct GlobalPolynomial {
    data: PolynomialData,
    field: Placed,
}

/// Reason why data do not define a polynomial.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PolynomialError {
    /// The degree is not between 1 and [`MAX_GLOBAL_DEGREE`].
    #[error("degree {0}: from 1 to {MAX_GLOBAL_DEGREE} are possible")]
    Degree(usize),
    /// The number of coefficients differs from the number of monomials.
    #[error("{found} coefficients for {wanted} monomials")]
    Coefficients {
        /// Number of coefficients given.
        found: usize,
        /// Number of monomials up to the degree.
        wanted: usize,
    },
    /// A number is not finite, or a length is not positive.
    #[error("a number is not finite, or a length not positive")]
    Number,
    /// All coefficients except the constant one are 0.
    #[error("the polynomial is constant")]
    Constant,
}

impl GlobalPolynomial {
    pub(crate) fn field(&self) -> &dyn Field {
        &self.field
    }
    /// Creates a polynomial from its data.
    ///
    /// # Errors
    /// [`PolynomialError`] if the data are not consistent.
    pub fn from_data(mut data: PolynomialData) -> Result<Self, PolynomialError> {
        if !(1..=MAX_GLOBAL_DEGREE).contains(&data.degree) {
            return Err(PolynomialError::Degree(data.degree));
        }
        let exponents = PolynomialData::exponents(data.degree);
        if data.coefficients.len() != exponents.len() {
            return Err(PolynomialError::Coefficients {
                found: data.coefficients.len(),
                wanted: exponents.len(),
            });
        }
        let lengths = [data.unit, data.spacing];
        let numbers = data.coefficients.iter().chain(&data.origin);
        let mut numbers = numbers.chain(&data.corner).chain(&lengths);
        let is_positive = lengths.iter().all(|v| *v > 0.0) && data.count.iter().all(|c| *c > 0);
        if !numbers.all(|v| v.is_finite()) || !is_positive {
            return Err(PolynomialError::Number);
        }
        // The constant term comes first.
        if data.coefficients[1..].iter().all(|c| *c == 0.0) {
            return Err(PolynomialError::Constant);
        }
        data.cells.sort_unstable();
        let terms = exponents.into_iter().zip(data.coefficients.iter().copied());
        let field = Placed::new(Polynomial::new(terms), data.origin, data.unit);
        Ok(Self { data, field })
    }

    /// Returns the data of the polynomial.
    pub fn data(&self) -> &PolynomialData {
        &self.data
    }

    /// Returns the box of the points.
    pub(crate) fn domain(&self) -> Aabb {
        let data = &self.data;
        let hi = |k: usize| data.corner[k] + data.spacing * f64::from(data.count[k]);
        Aabb {
            lo: data.corner,
            hi: std::array::from_fn(hi),
        }
    }

    /// Returns the cell that contains a point; cells beyond the lattice hold no data.
    fn cell(&self, p: Point3) -> [i32; 3] {
        let data = &self.data;
        std::array::from_fn(|k| ((p[k] - data.corner[k]) / data.spacing).floor() as i32)
    }

    fn holds(&self, cell: [i32; 3]) -> bool {
        self.data.cells.binary_search(&cell).is_ok()
    }

    fn is_seen(&self, p: Point3) -> bool {
        let cell = self.cell(p);
        let beside = |axis: usize, step: i32| {
            let mut beside = cell;
            beside[axis] = beside[axis].saturating_add(step);
            self.holds(beside)
        };
        self.holds(cell) || (0..3).any(|k| beside(k, -1) || beside(k, 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Control, ImplicitizeOptions, implicitize_scan};
    use isoform_geom::PointCloud;

    /// x in units of 2 about (1, 0, 0), with data in one cell.
    fn data() -> PolynomialData {
        PolynomialData {
            degree: 1,
            origin: [1.0, 0.0, 0.0],
            unit: 2.0,
            coefficients: vec![0.0, 1.0, 0.0, 0.0],
            corner: [-1.0; 3],
            spacing: 0.5,
            count: [4; 3],
            cells: vec![[2, 2, 2]],
        }
    }

    #[test]
    fn points_were_in_cells_and_near_them() {
        let f = Implicit::Polynomial(GlobalPolynomial::from_data(data()).expect("a polynomial"));
        assert_eq!(f.value([2.0, 5.0, 7.0]), 0.5);
        assert_eq!(f.domain().hi, [1.0; 3]);
        assert!(f.holds_data([0.1; 3]) && !f.holds_data([-0.1, 0.1, 0.1]));
        assert!(f.is_seen([-0.1, 0.1, 0.1]) && !f.is_seen([-0.1, -0.1, 0.1]));
        assert!(!f.is_seen([f64::INFINITY, 0.1, 0.1]) && !f.is_seen([-1e300; 3]));
    }

    /// Inward normals make the outside of a closed surface the solid.
    #[test]
    fn inward_normals_turn_the_solid_inside_out() {
        let point = |i: u32| {
            let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 500.0 - 0.999);
            let r = (1.0 - z * z).sqrt();
            [r * t.cos(), r * t.sin(), z]
        };
        let is_inside_out = |side: f64, part: u32| {
            let mut scan = PointCloud::from_points((0..part).map(point).collect());
            scan.normals = scan.points.iter().map(|p| p.map(|v| side * v)).collect();
            let options = ImplicitizeOptions::default();
            let made = implicitize_scan(&scan, &options, &Control::default()).expect("a spline");
            Implicit::Spline(made.spline).is_inside_out()
        };
        assert!(is_inside_out(-1.0, 1000) && !is_inside_out(1.0, 1000));
        // Half of a sphere does not enclose an inside.
        assert!(!is_inside_out(-1.0, 500));
    }

    #[test]
    fn numbers_that_do_not_fit_are_refused() {
        let made = |change: &dyn Fn(&mut PolynomialData)| {
            let mut data = data();
            change(&mut data);
            GlobalPolynomial::from_data(data).expect_err("refused")
        };
        assert_eq!(made(&|d| d.degree = 0), PolynomialError::Degree(0));
        let few = PolynomialError::Coefficients {
            found: 4,
            wanted: 10,
        };
        assert_eq!(made(&|d| d.degree = 2), few);
        assert_eq!(made(&|d| d.unit = 0.0), PolynomialError::Number);
        assert_eq!(made(&|d| d.corner[1] = f64::NAN), PolynomialError::Number);
        assert_eq!(
            made(&|d| d.coefficients[1] = 0.0),
            PolynomialError::Constant
        );
    }
}
