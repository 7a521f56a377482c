//! A scan, a template and settings: the input of every stage of a fit.

use crate::deviation::{self, ReferenceData};
use crate::feet::CachedFeet;
use crate::outliers::Neighbourhood;
use crate::point_distances::{PointDistances, measure_points};
use crate::polish::Polish;
use crate::scan::Scan;
use crate::space::Space;
use crate::thresholds::REPRESENTATIVE_POINTS;
use crate::{Control, FitError, Options, Parameter, Template};
use isoform_geom::{Aabb, ParamField, Point3};

/// One template and one scan, with everything that a fit of one to the other needs.
pub(crate) struct Task<'a> {
    pub(crate) scan: &'a Scan<'a>,
    /// Distinct points of the scan; of a cloud in chunks a sample.
    pub(crate) points: &'a [Point3],
    pub(crate) near: &'a Neighbourhood,
    /// A random order of the points.
    pub(crate) order: &'a [u32],
    /// Box of the data.
    pub(crate) data: Aabb,
    pub(crate) template: &'a dyn Template,
    pub(crate) options: &'a Options,
    pub(crate) control: &'a Control<'a>,
    pub(crate) space: Space,
    /// Distance of the template, if it has one.
    pub(crate) distance: Option<CachedFeet<'a>>,
}

impl<'a> Task<'a> {
    pub(crate) fn new(
        scan: &'a Scan<'a>,
        template: &'a dyn Template,
        options: &'a Options,
        control: &'a Control<'a>,
    ) -> Result<Self, FitError> {
        let parameters = template.parameters();
        check_lengths(options, parameters.len())?;
        check_start(options)?;
        let (found, free) = (scan.points().len(), free_parameters(parameters));
        if found < free.max(1) {
            return Err(FitError::TooFewPoints { found, free });
        }
        Ok(Self {
            scan,
            points: scan.points(),
            near: &scan.near,
            order: &scan.order,
            data: scan.data,
            template,
            options,
            control,
            space: Space::new(parameters, &options.bounds, scan.data)?,
            distance: template.distance().map(CachedFeet::new),
        })
    }

    /// Returns the diagonal of the data's box.
    pub(crate) fn size(&self) -> f64 {
        self.data.diagonal()
    }

    /// Returns the deviation below which noise counts as rounding.
    pub(crate) fn rounding(&self) -> f64 {
        (1e-9 * self.size()).max(self.options.rounding)
    }

    /// Returns the distance from a model below which points are on it exactly.
    pub(crate) fn exact(&self) -> f64 {
        1e-7 * self.size()
    }

    /// Returns the first points in the random order.
    pub(crate) fn some(&self, count: usize) -> Vec<Point3> {
        let first = self.order.iter().take(count);
        first.map(|&i| self.points[i as usize]).collect()
    }

    /// Returns the caller's start, or the template's, completed by the centres of the data-informed
    /// ranges.
    pub(crate) fn first(&self) -> Option<Vec<f64>> {
        if let Some(start) = &self.options.start {
            return Some(self.space.variables_at(start));
        }
        let parameters = self.template.parameters();
        let start = |k: usize| parameters[self.space.parameter(k)].start;
        let value = |k: usize| match start(k) {
            Some(v) => v / self.space.unit(k),
            None => 0.5 * (self.space.start_lo[k] + self.space.start_hi[k]),
        };
        let variables = 0..self.space.len();
        let is_told = variables.clone().any(|k| start(k).is_some());
        let mut x: Vec<f64> = variables.map(value).collect();
        self.space.into_interior(&mut x, 1e-4);
        is_told.then_some(x)
    }

    /// Sets up a polish of the metric reading; `start` is its number in the history.
    pub(crate) fn polish(&self, start: usize) -> Polish<'_> {
        self.polish_with(self.template.metric(), start)
    }

    /// Sets up a polish of the given residual.
    pub(crate) fn polish_with<'b>(&'b self, field: &'b dyn ParamField, start: usize) -> Polish<'b> {
        Polish {
            field,
            space: &self.space,
            size: self.size(),
            control: self.control,
            start,
            held: vec![false; self.space.len()],
        }
    }

    /// Returns the distance, or the metric reading if the template has none.
    pub(crate) fn measure(&self) -> &dyn ParamField {
        match &self.distance {
            Some(distance) => distance,
            None => self.template.metric(),
        }
    }

    /// Computes the distances and parts of points at some variables.
    pub(crate) fn measured(&self, points: &[Point3], x: &[f64]) -> PointDistances {
        let a = self.space.parameters(x);
        measure_points(self.template, self.distance.as_ref(), points, &a)
    }

    /// Returns the data with which the model's surface is compared.
    pub(crate) fn data(&self, noise: f64) -> ReferenceData<'_> {
        ReferenceData {
            bounds: self.data,
            near: self.near,
            noise,
        }
    }

    /// Returns the correlation of the residuals of neighbours, from some of the points for which
    /// `is_used` holds.
    pub(crate) fn correlation(&self, x: &[f64], r: &[f64], is_used: impl Fn(usize) -> bool) -> f64 {
        let used = self.order.iter().map(|&i| i as usize);
        let used = used.filter(|i| is_used(*i) && r[*i].is_finite());
        let some: Vec<usize> = used.take(REPRESENTATIVE_POINTS).collect();
        let points: Vec<Point3> = some.iter().map(|&i| self.points[i]).collect();
        let residuals: Vec<f64> = some.iter().map(|&i| r[i]).collect();
        let feet = self.polish(0).feet(&points, x);
        deviation::neighbour_correlation(&feet, &residuals)
    }
}

/// Counts the parameters that are neither fixed nor tied.
pub(crate) fn free_parameters(parameters: &[Parameter]) -> usize {
    let is_free = |p: &&Parameter| p.fixed.is_none() && p.tie.is_none();
    parameters.iter().filter(is_free).count()
}

/// Checks that start and bounds, if given, have one value per parameter.
fn check_lengths(options: &Options, expected: usize) -> Result<(), FitError> {
    let start = options.start.as_ref().map(Vec::len);
    let bounds = Some(options.bounds.len()).filter(|n| *n > 0);
    for (what, found) in [("the start", start), ("bounds", bounds)] {
        if let Some(found) = found.filter(|n| *n != expected) {
            return Err(FitError::Length {
                what,
                found,
                expected,
            });
        }
    }
    Ok(())
}

fn check_start(options: &Options) -> Result<(), FitError> {
    let start = options.start.iter().flatten();
    match start.zip(0..).find(|(v, _)| !v.is_finite()) {
        Some((_, index)) => Err(FitError::NotFinite {
            what: "the start",
            index,
        }),
        None => Ok(()),
    }
}
