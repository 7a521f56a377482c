//! From a template's parameters to the free, scaled variables of the solvers: a = base + B x.
//!
//! Fixed, tied and linearly related parameters are eliminated, not penalised. Each free variable
//! has a unit of its own: a length or a position is measured in data scales, an angle in radians, a
//! ratio in ones. A unit step of any variable then moves the surface by about the data's size, and
//! the identity is a meaningful damping matrix.

mod limits;
mod ties;

use self::limits::{informed, limits, positive};
use self::ties::{ParameterRow, rows};
use crate::bounds::Bounds;
use crate::{FitError, Kind, Objective, Parameter, lm};
use isoform_geom::Aabb;

/// The free variables of a fit.
///
/// ```
/// use isoform_fit::{Kind, Parameter, Space, Tie};
/// use isoform_geom::Aabb;
///
/// // An outer radius, and an inner one of half its length.
/// let mut inner = Parameter::new("inner", Kind::Length);
/// inner.tie = Some(Tie { constant: 0.0, terms: vec![(0, 0.5)] });
/// let parameters = [Parameter::new("outer", Kind::Length), inner];
/// let data = Aabb { lo: [-1.0; 3], hi: [1.0; 3] };
/// let space = Space::new(&parameters, &[], data)?;
///
/// // One variable is left, and it moves both parameters.
/// assert_eq!(space.len(), 1);
/// let x = space.variables_at(&[1.6, 0.8]);
/// let a = space.parameters(&x);
/// assert!((a[0] - 1.6).abs() < 1e-12 && (a[1] - 0.8).abs() < 1e-12);
/// # Ok::<(), isoform_fit::FitError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Space {
    base: Vec<f64>,
    /// Parameters that each free variable moves, with ∂a/∂x.
    columns: Vec<Vec<(usize, f64)>>,
    /// Index of the parameter that a variable stands for.
    free: Vec<usize>,
    unit: Vec<f64>,
    /// Lower bounds of the variables.
    pub lo: Vec<f64>,
    /// Upper bounds of the variables.
    pub hi: Vec<f64>,
    /// Lower ends of the ranges from which informed starts are drawn.
    pub start_lo: Vec<f64>,
    /// Upper ends of the ranges from which informed starts are drawn.
    pub start_hi: Vec<f64>,
    /// Bounds of the parameters; infinite if there are none.
    pub bounds: Vec<(f64, f64)>,
    /// Tied parameters with bounds and several sources: (parameter, variables with factors).
    rows: Vec<(usize, Vec<(usize, f64)>)>,
}

impl Space {
    /// Resolves ties and bounds. `bounds` (empty or one per parameter) come from the caller and
    /// override those of the template.
    ///
    /// # Errors
    /// Ties that are circular or name no parameter, bounds in the wrong order or not finite, no
    /// free parameter.
    pub fn new(
        parameters: &[Parameter],
        bounds: &[Option<(f64, f64)>],
        data: Aabb,
    ) -> Result<Self, FitError> {
        let rows = rows(parameters)?;
        let mut space = Self::with_constants(rows.iter().map(|row| row.constant).collect());
        for (i, p) in parameters.iter().enumerate() {
            let is_free = rows[i].is_variable(i);
            let said = bounds.get(i).copied().flatten();
            let (lo, hi) = limits(p, said, data, is_free)?;
            space.bounds.push((lo, hi));
            if is_free {
                space.add_variable(i, p, data);
            }
        }
        if space.free.is_empty() {
            return Err(FitError::NothingFree);
        }
        space.add_rows(&rows, parameters)?;
        space.check(parameters)?;
        space.clamp_starts();
        Ok(space)
    }

    /// Makes a space without variables.
    fn with_constants(base: Vec<f64>) -> Self {
        Self {
            bounds: Vec::with_capacity(base.len()),
            base,
            columns: Vec::new(),
            free: Vec::new(),
            unit: Vec::new(),
            lo: Vec::new(),
            hi: Vec::new(),
            start_lo: Vec::new(),
            start_hi: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Adds a variable for parameter i, whose bounds are the last ones.
    fn add_variable(&mut self, i: usize, p: &Parameter, data: Aabb) {
        let (lo, hi) = self.bounds[i];
        let unit = unit_of(p.kind, hi - lo, data);
        let (from, to) = informed(p, lo, hi, data);
        self.free.push(i);
        self.unit.push(unit);
        self.lo.push(lo / unit);
        self.hi.push(hi / unit);
        self.start_lo.push(from / unit);
        self.start_hi.push(to / unit);
        self.columns.push(Vec::new());
    }

    /// Fills the columns of B, and applies the bounds of tied parameters.
    fn add_rows(
        &mut self,
        rows: &[ParameterRow],
        parameters: &[Parameter],
    ) -> Result<(), FitError> {
        for (i, row) in rows.iter().enumerate() {
            let scaled = self.in_variables(row);
            for &(k, c) in &scaled {
                self.columns[k].push((i, c));
            }
            if parameters[i].tie.is_some() {
                self.limit_tied(i, row.constant, &scaled, &parameters[i].name)?;
            }
        }
        Ok(())
    }

    /// Returns the terms of a row with variables in place of free parameters.
    fn in_variables(&self, row: &ParameterRow) -> Vec<(usize, f64)> {
        let variable = |j: usize| {
            let k = self.free.binary_search(&j);
            k.expect("rows are followed to free parameters")
        };
        let terms = row.terms.iter().map(|&(j, c)| (variable(j), c));
        terms.map(|(k, c)| (k, c * self.unit[k])).collect()
    }

    /// Applies the bounds of a tied parameter: to its one variable, or to steps if it has several.
    fn limit_tied(
        &mut self,
        i: usize,
        constant: f64,
        terms: &[(usize, f64)],
        name: &str,
    ) -> Result<(), FitError> {
        let (lo, hi) = self.bounds[i];
        if lo == f64::NEG_INFINITY && hi == f64::INFINITY {
            return Ok(());
        }
        match *terms {
            [] if constant < lo || constant > hi => {
                let name = name.to_owned();
                return Err(FitError::Bounds { name, lo, hi });
            }
            [] => {}
            [(v, c)] if c != 0.0 => {
                let (u, w) = ((lo - constant) / c, (hi - constant) / c);
                self.lo[v] = self.lo[v].max(u.min(w));
                self.hi[v] = self.hi[v].min(u.max(w));
            }
            _ => self.rows.push((i, terms.to_vec())),
        }
        Ok(())
    }

    /// Checks that every variable has room between its bounds.
    fn check(&self, parameters: &[Parameter]) -> Result<(), FitError> {
        match (0..self.len()).find(|&k| self.lo[k] >= self.hi[k]) {
            Some(k) => Err(FitError::Bounds {
                name: parameters[self.free[k]].name.clone(),
                lo: self.lo[k],
                hi: self.hi[k],
            }),
            None => Ok(()),
        }
    }

    fn clamp_starts(&mut self) {
        for k in 0..self.len() {
            let (lo, hi) = (self.lo[k], self.hi[k]);
            self.start_lo[k] = self.start_lo[k].clamp(lo, hi);
            self.start_hi[k] = self.start_hi[k].clamp(lo, hi);
        }
    }

    /// Returns the number of free variables.
    pub fn len(&self) -> usize {
        self.free.len()
    }
    /// Returns true if no variable is free; never true for a space from [`Space::new`].
    pub fn is_empty(&self) -> bool {
        self.free.is_empty()
    }
    /// Returns the parameter that variable `k` stands for.
    pub fn parameter(&self, k: usize) -> usize {
        self.free[k]
    }
    /// Returns the unit of variable `k`: a unit step adds this to its parameter.
    pub fn unit(&self, k: usize) -> f64 {
        self.unit[k]
    }
    /// Returns the parameters that variable `k` moves, with their derivatives.
    pub fn column(&self, k: usize) -> &[(usize, f64)] {
        &self.columns[k]
    }

    /// Returns the bounds of the variables.
    pub(crate) fn limits(&self) -> Bounds<'_> {
        Bounds {
            lo: &self.lo,
            hi: &self.hi,
        }
    }

    /// Returns the ranges from which informed starts are drawn.
    pub(crate) fn start_limits(&self) -> Bounds<'_> {
        Bounds {
            lo: &self.start_lo,
            hi: &self.start_hi,
        }
    }

    /// Returns the derivative by variable `k`, from the derivatives by all parameters.
    #[inline]
    pub(crate) fn derivative(&self, k: usize, by_parameter: &[f64]) -> f64 {
        let column = self.columns[k].iter();
        column.map(|&(i, c)| c * by_parameter[i]).sum()
    }

    /// Computes a = base + B x. Free parameters are kept within their bounds to the last bit.
    pub fn parameters_at(&self, x: &[f64], a: &mut [f64]) {
        a.copy_from_slice(&self.base);
        self.add_step(x, a);
        for &i in &self.free {
            a[i] = a[i].clamp(self.bounds[i].0, self.bounds[i].1);
        }
    }

    /// Returns the parameter vector a = base + B x, as [`Space::parameters_at`] computes it.
    pub fn parameters(&self, x: &[f64]) -> Vec<f64> {
        let mut a = vec![0.0; self.base.len()];
        self.parameters_at(x, &mut a);
        a
    }

    /// Adds B times a step of the variables.
    pub(crate) fn add_step(&self, step: &[f64], a: &mut [f64]) {
        for (column, v) in self.columns.iter().zip(step) {
            for &(i, c) in column {
                a[i] += c * v;
            }
        }
    }

    /// Returns the variables of a parameter vector, moved strictly inside the bounds.
    pub fn variables_at(&self, a: &[f64]) -> Vec<f64> {
        let free = self.free.iter().zip(&self.unit);
        let mut x: Vec<f64> = free.map(|(&i, u)| a[i] / u).collect();
        self.into_interior(&mut x, 1e-4);
        x
    }

    /// Draws a uniform value of variable k from the range of informed starts.
    pub(crate) fn drawn(&self, k: usize, random: &mut fastrand::Rng) -> f64 {
        self.start_limits().drawn(k, random)
    }

    /// Returns true if variable k is nearer than `within` to a bound. `within` is clamped to
    /// between a hundred-thousandth and a hundredth of the range (or of a unit).
    pub(crate) fn is_at_bound(&self, x: &[f64], k: usize, within: f64) -> bool {
        let range = (self.hi[k] - self.lo[k]).min(1.0);
        let gap = (x[k] - self.lo[k]).min(self.hi[k] - x[k]);
        gap < within.max(1e-5 * range).min(1e-2 * range)
    }

    /// Moves x inside the bounds by at least `share` of the range (or of a unit, if the range is
    /// infinite).
    pub fn into_interior(&self, x: &mut [f64], share: f64) {
        for (k, v) in x.iter_mut().enumerate() {
            let gap = share * (self.hi[k] - self.lo[k]).min(1.0);
            let (lo, hi) = (self.lo[k] + gap, self.hi[k] - gap);
            *v = if v.is_finite() {
                v.clamp(lo, hi)
            } else {
                0.5 * (lo + hi)
            };
        }
    }

    /// Minimises within the bounds of the variables.
    pub(crate) fn minimize(
        &self,
        objective: &mut dyn Objective,
        x: Vec<f64>,
        options: &lm::LmOptions,
        monitor: &mut dyn FnMut(usize, &[f64], f64) -> bool,
    ) -> lm::Minimum {
        lm::minimize(objective, x, &self.lo, &self.hi, options, monitor)
    }

    /// Returns the greatest share of the step `p` from `x` that keeps tied parameters within their
    /// bounds: up to 95 % of the way to a bound.
    pub fn step_limit(&self, x: &[f64], p: &[f64]) -> f64 {
        let mut limit: f64 = 1.0;
        for (i, row) in &self.rows {
            let at = self.base[*i] + row.iter().map(|&(v, c)| c * x[v]).sum::<f64>();
            let by: f64 = row.iter().map(|&(v, c)| c * p[v]).sum();
            let (lo, hi) = self.bounds[*i];
            let gap = if by > 0.0 { hi - at } else { at - lo };
            if by.abs() > gap.max(0.0) {
                limit = limit.min(0.95 * gap.max(0.0) / by.abs());
            }
        }
        limit
    }

    /// Transforms gradient and matrix from the parameters to the variables: Bᵀg and BᵀHB.
    pub(crate) fn pull_back(&self, ga: &[f64], ha: &[f64], g: &mut [f64], h: &mut [f64]) {
        let m = self.len();
        for j in 0..m {
            g[j] = self.derivative(j, ga);
            for k in 0..=j {
                let s = self.sandwich(j, k, ha);
                h[j * m + k] = s;
                h[k * m + j] = s;
            }
        }
    }

    /// Returns element (j, k) of BᵀHB.
    #[inline]
    fn sandwich(&self, j: usize, k: usize, ha: &[f64]) -> f64 {
        let n = self.base.len();
        let mut s = 0.0;
        for &(i, c) in &self.columns[j] {
            for &(l, d) in &self.columns[k] {
                s += c * d * ha[i * n + l];
            }
        }
        s
    }

    /// Transforms the covariance of the variables to the parameters: B C Bᵀ.
    pub(crate) fn push_forward(&self, cov: &[f64]) -> Vec<f64> {
        let (n, m) = (self.base.len(), self.len());
        let mut out = vec![0.0; n * n];
        for j in 0..m {
            for k in 0..m {
                for &(i, c) in &self.columns[j] {
                    for &(l, d) in &self.columns[k] {
                        out[i * n + l] += c * d * cov[j * m + k];
                    }
                }
            }
        }
        out
    }
}

/// Returns the unit of a variable whose bounds are `range` apart.
fn unit_of(kind: Kind, range: f64, data: Aabb) -> f64 {
    let half = 0.5 * positive(data.diagonal());
    match kind {
        Kind::X | Kind::Y | Kind::Z | Kind::Length => half,
        Kind::Angle | Kind::Ratio => 1.0,
        Kind::Number => half.min(range.max(f64::MIN_POSITIVE)),
    }
}
