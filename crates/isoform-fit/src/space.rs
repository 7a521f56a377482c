//! From a template's parameters to the free, scaled variables that the solvers see: a = base + B x.
//!
//! Fixed, tied and linearly related parameters are eliminated, not penalised. Each free variable is
//! measured in a unit of its own: a length or a position in data scales, an angle in radians, a
//! ratio in ones. A unit step of any variable then moves the surface by something of the order of
//! the data's size, and the identity is a meaningful damping matrix.

use crate::{FitError, Kind, Parameter};
use isoform_geom::Aabb;

/// Coordinates may lie in a box this many times the data's, about the same centre.
const BOX_FACTOR: f64 = 3.0;
/// Lengths are at most this many diagonals of the data's box.
const LENGTH_FACTOR: f64 = 2.0;
/// Least length, in diagonals, when nobody said otherwise: keeps radii and sizes off zero, where
/// primitives degenerate.
const LEAST_LENGTH: f64 = 1e-6;

/// A parameter as a constant and terms (index, factor) of free parameters.
type Row = (f64, Vec<(usize, f64)>);

/// The free variables of a fit.
#[derive(Clone, Debug)]
pub struct Space {
    base: Vec<f64>,
    /// For every free variable the parameters it moves, with ∂a/∂x.
    columns: Vec<Vec<(usize, f64)>>,
    /// Index of the parameter that the variable stands for.
    free: Vec<usize>,
    unit: Vec<f64>,
    /// Lower bounds of the variables.
    pub lo: Vec<f64>,
    /// Upper bounds of the variables.
    pub hi: Vec<f64>,
    /// Where starts informed by the data are drawn from.
    pub start_lo: Vec<f64>,
    /// Upper end of that.
    pub start_hi: Vec<f64>,
    /// Bounds of the parameters (infinite where there are none).
    pub bounds: Vec<(f64, f64)>,
    /// Rows for tied parameters with bounds and several sources: (parameter, variables with
    /// factors).
    rows: Vec<(usize, Vec<(usize, f64)>)>,
}

impl Space {
    /// Resolves ties and bounds. `bounds` (empty or one per parameter) come from the user and win
    /// over the template's.
    ///
    /// # Errors
    /// Ties that run in circles or point nowhere, bounds in the wrong order or not finite, nothing
    /// left to fit.
    pub fn new(
        parameters: &[Parameter],
        bounds: &[Option<(f64, f64)>],
        data: Aabb,
    ) -> Result<Self, FitError> {
        let n = parameters.len();
        // A fixed parameter stays fixed whatever it is named in; a tie is followed through other
        // ties.
        let mut rows: Vec<Option<Row>> = vec![None; n];
        for i in 0..n {
            resolve(parameters, i, &mut rows, 0)?;
        }
        let diagonal = positive(data.diagonal());
        let mut space = Self {
            base: vec![0.0; n],
            columns: Vec::new(),
            free: Vec::new(),
            unit: Vec::new(),
            lo: Vec::new(),
            hi: Vec::new(),
            start_lo: Vec::new(),
            start_hi: Vec::new(),
            bounds: Vec::with_capacity(n),
            rows: Vec::new(),
        };
        let mut variable = vec![usize::MAX; n];
        for (i, p) in parameters.iter().enumerate() {
            let (constant, terms) = rows[i].clone().unwrap_or_default();
            space.base[i] = constant;
            let is_free = terms.len() == 1 && terms[0] == (i, 1.0);
            let said = bounds.get(i).copied().flatten();
            let (lo, hi) = limits(p, said, data, is_free)?;
            space.bounds.push((lo, hi));
            if is_free {
                let range = hi - lo;
                let unit = match p.kind {
                    Kind::X | Kind::Y | Kind::Z | Kind::Length => 0.5 * diagonal,
                    Kind::Angle | Kind::Ratio => 1.0,
                    Kind::Number => (0.5 * diagonal).min(range.max(f64::MIN_POSITIVE)),
                };
                let (a, b) = informed(p, lo, hi, data);
                variable[i] = space.free.len();
                space.free.push(i);
                space.unit.push(unit);
                space.lo.push(lo / unit);
                space.hi.push(hi / unit);
                space.start_lo.push(a / unit);
                space.start_hi.push(b / unit);
                space.columns.push(Vec::new());
            }
        }
        if space.free.is_empty() {
            return Err(FitError::NothingFree);
        }
        for (i, row) in rows.iter().enumerate() {
            let Some((constant, terms)) = row else {
                continue;
            };
            let scaled: Vec<(usize, f64)> = terms
                .iter()
                .map(|&(j, c)| (variable[j], c * space.unit[variable[j]]))
                .collect();
            for &(v, c) in &scaled {
                space.columns[v].push((i, c));
            }
            if parameters[i].tie.is_some() {
                space.limit_tied(i, *constant, &scaled, &parameters[i].name)?;
            }
        }
        for k in 0..space.free.len() {
            if space.lo[k] >= space.hi[k] {
                return Err(FitError::Bounds {
                    name: parameters[space.free[k]].name.clone(),
                    lo: space.lo[k],
                    hi: space.hi[k],
                });
            }
            space.start_lo[k] = space.start_lo[k].clamp(space.lo[k], space.hi[k]);
            space.start_hi[k] = space.start_hi[k].clamp(space.lo[k], space.hi[k]);
        }
        Ok(space)
    }

    /// Bounds of a tied parameter: on its one variable directly, else kept as a row that steps must
    /// respect.
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
            [] if constant < lo || constant > hi => Err(FitError::Bounds {
                name: name.to_owned(),
                lo,
                hi,
            }),
            [] => Ok(()),
            [(v, c)] if c != 0.0 => {
                let (u, w) = ((lo - constant) / c, (hi - constant) / c);
                self.lo[v] = self.lo[v].max(u.min(w));
                self.hi[v] = self.hi[v].min(u.max(w));
                Ok(())
            }
            _ => {
                self.rows.push((i, terms.to_vec()));
                Ok(())
            }
        }
    }

    /// Number of free variables.
    pub fn len(&self) -> usize {
        self.free.len()
    }
    /// Whether nothing is free (never true for a space that was made).
    pub fn is_empty(&self) -> bool {
        self.free.is_empty()
    }
    /// Parameter that variable `k` stands for.
    pub fn parameter(&self, k: usize) -> usize {
        self.free[k]
    }
    /// Its unit: one step of the variable in the parameter.
    pub fn unit(&self, k: usize) -> f64 {
        self.unit[k]
    }
    /// Parameters moved by variable `k`, with their derivatives.
    pub fn column(&self, k: usize) -> &[(usize, f64)] {
        &self.columns[k]
    }

    /// a = base + B x. Free parameters are kept within their bounds to the last bit.
    pub fn parameters_at(&self, x: &[f64], a: &mut [f64]) {
        a.copy_from_slice(&self.base);
        for (column, v) in self.columns.iter().zip(x) {
            for &(i, c) in column {
                a[i] += c * v;
            }
        }
        for &i in &self.free {
            a[i] = a[i].clamp(self.bounds[i].0, self.bounds[i].1);
        }
    }

    /// The variables of a parameter vector, moved strictly inside the bounds.
    pub fn variables_at(&self, a: &[f64]) -> Vec<f64> {
        let mut x: Vec<f64> = self
            .free
            .iter()
            .zip(&self.unit)
            .map(|(&i, u)| a[i] / u)
            .collect();
        self.into_interior(&mut x, 1e-4);
        x
    }

    /// Whether variable k is as good as at a bound: nearer than `within`, which counts from a
    /// hundred-thousandth of the range (or of a unit) to a hundredth.
    pub(crate) fn is_at_bound(&self, x: &[f64], k: usize, within: f64) -> bool {
        let range = (self.hi[k] - self.lo[k]).min(1.0);
        let gap = (x[k] - self.lo[k]).min(self.hi[k] - x[k]);
        gap < within.max(1e-5 * range).min(1e-2 * range)
    }

    /// Moves x inside the bounds by at least `share` of the range (or of a unit, where the range is
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

    /// Greatest share of the step p from x that keeps bounded tied parameters within bounds.
    pub fn step_limit(&self, x: &[f64], p: &[f64]) -> f64 {
        let mut limit: f64 = 1.0;
        for (i, row) in &self.rows {
            let at = self.base[*i] + row.iter().map(|&(v, c)| c * x[v]).sum::<f64>();
            let by: f64 = row.iter().map(|&(v, c)| c * p[v]).sum();
            let gap = if by > 0.0 {
                self.bounds[*i].1 - at
            } else {
                at - self.bounds[*i].0
            };
            if by.abs() > gap.max(0.0) {
                limit = limit.min(0.95 * gap.max(0.0) / by.abs());
            }
        }
        limit
    }

    /// Gradient and matrix in the parameters to those in the variables.
    pub(crate) fn pull_back(&self, ga: &[f64], ha: &[f64], g: &mut [f64], h: &mut [f64]) {
        let (n, m) = (self.base.len(), self.len());
        for j in 0..m {
            g[j] = self.columns[j].iter().map(|&(i, c)| c * ga[i]).sum();
            for k in 0..=j {
                let mut s = 0.0;
                for &(i, c) in &self.columns[j] {
                    for &(l, d) in &self.columns[k] {
                        s += c * d * ha[i * n + l];
                    }
                }
                h[j * m + k] = s;
                h[k * m + j] = s;
            }
        }
    }

    /// Covariance of the parameters from that of the variables.
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

fn positive(v: f64) -> f64 {
    if v > 0.0 && v.is_finite() { v } else { 1.0 }
}

/// Constant and terms of parameter i over free parameters only.
fn resolve(
    parameters: &[Parameter],
    i: usize,
    rows: &mut [Option<Row>],
    depth: usize,
) -> Result<(), FitError> {
    if rows[i].is_some() {
        return Ok(());
    }
    let p = &parameters[i];
    if depth > parameters.len() {
        return Err(FitError::Tie {
            name: p.name.clone(),
        });
    }
    let row = match (&p.tie, p.fixed) {
        (Some(tie), _) => {
            let mut constant = tie.constant;
            let mut sum = vec![0.0; parameters.len()];
            for &(j, factor) in &tie.terms {
                if j >= parameters.len() || j == i || !factor.is_finite() {
                    return Err(FitError::Tie {
                        name: p.name.clone(),
                    });
                }
                resolve(parameters, j, rows, depth + 1)?;
                let (c, terms) = rows[j].as_ref().expect("just resolved");
                constant += factor * c;
                for &(k, t) in terms {
                    sum[k] += factor * t;
                }
            }
            (
                constant,
                sum.iter()
                    .enumerate()
                    .filter(|(_, v)| **v != 0.0)
                    .map(|(k, v)| (k, *v))
                    .collect(),
            )
        }
        (None, Some(v)) => (v, Vec::new()),
        (None, None) => (0.0, vec![(i, 1.0)]),
    };
    if !row.0.is_finite() {
        return Err(FitError::NotFinite {
            what: "a fixed or tied value",
            index: i,
        });
    }
    rows[i] = Some(row);
    Ok(())
}

/// Bounds of a parameter: the user's, else the template's, else what the data's box suggests (free
/// parameters only).
fn limits(
    p: &Parameter,
    said: Option<(f64, f64)>,
    data: Aabb,
    is_free: bool,
) -> Result<(f64, f64), FitError> {
    let (mut lo, mut hi) = said.map_or((p.min, p.max), |(a, b)| {
        (
            Some(a).filter(|v| *v != f64::NEG_INFINITY),
            Some(b).filter(|v| *v != f64::INFINITY),
        )
    });
    if lo.is_some_and(f64::is_nan)
        || hi.is_some_and(f64::is_nan)
        || lo.zip(hi).is_some_and(|(a, b)| a >= b)
    {
        return Err(FitError::Bounds {
            name: p.name.clone(),
            lo: lo.unwrap_or(f64::NAN),
            hi: hi.unwrap_or(f64::NAN),
        });
    }
    if !is_free {
        return Ok((lo.unwrap_or(f64::NEG_INFINITY), hi.unwrap_or(f64::INFINITY)));
    }
    let diagonal = positive(data.diagonal());
    let reach = data
        .lo
        .iter()
        .chain(&data.hi)
        .fold(diagonal, |m, v| m.max(v.abs()));
    let (a, b) = match p.kind {
        Kind::X | Kind::Y | Kind::Z => {
            let k = p.kind as usize;
            let half = 0.5 * BOX_FACTOR * (data.hi[k] - data.lo[k]).max(0.3 * diagonal);
            (data.center()[k] - half, data.center()[k] + half)
        }
        Kind::Length => (LEAST_LENGTH * diagonal, LENGTH_FACTOR * diagonal),
        Kind::Angle => (-2.0 * std::f64::consts::PI, 2.0 * std::f64::consts::PI),
        Kind::Ratio => (-10.0, 10.0),
        Kind::Number => (
            -(BOX_FACTOR * reach).max(10.0),
            (BOX_FACTOR * reach).max(10.0),
        ),
    };
    // A start or one given bound outside of the default range stretches it.
    let width = b - a;
    let start = p.start.filter(|v| v.is_finite());
    if lo.is_none() {
        lo = Some(
            a.min(start.map_or(a, |s| {
                if s > 0.0 && a > 0.0 {
                    0.1 * s
                } else {
                    s - width
                }
            }))
            .min(hi.map_or(a, |h| if h <= a { h - width } else { a })),
        );
    }
    if hi.is_none() {
        let l = lo.unwrap_or(a);
        hi = Some(b.max(start.map_or(b, |s| s + 0.5 * width)).max(if l >= b {
            l + width
        } else {
            b
        }));
    }
    Ok((lo.unwrap_or(a), hi.unwrap_or(b)))
}

/// Where starts informed by the data are drawn from: positions in the data's box, lengths up to its
/// size.
fn informed(p: &Parameter, lo: f64, hi: f64, data: Aabb) -> (f64, f64) {
    // The template's author knows better: around the start, a quarter of the range to each side.
    if let Some(start) = p
        .start
        .filter(|s| p.min.is_some() && p.max.is_some() && lo <= *s && *s <= hi)
    {
        let reach = 0.25 * (hi - lo);
        return ((start - reach).max(lo), (start + reach).min(hi));
    }
    let size = data.size();
    let largest = positive(size[0].max(size[1]).max(size[2]));
    let (a, b) = match p.kind {
        Kind::X | Kind::Y | Kind::Z => (data.lo[p.kind as usize], data.hi[p.kind as usize]),
        Kind::Length => (0.02 * largest, 0.75 * largest),
        Kind::Angle => (lo.max(-std::f64::consts::PI), hi.min(std::f64::consts::PI)),
        Kind::Ratio => (lo.max(-2.0), hi.min(2.0)),
        Kind::Number if lo >= 0.0 => (0.02 * largest, largest),
        Kind::Number => (
            data.lo.iter().copied().fold(f64::INFINITY, f64::min),
            data.hi.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ),
    };
    let (c, d) = (a.max(lo), b.min(hi));
    // Where bounds and data do not meet, the bounds alone decide.
    if d - c > 1e-3 * (hi - lo) {
        (c, d)
    } else {
        (lo, hi)
    }
}
