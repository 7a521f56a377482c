//! A distance with a cache of its last foot points: the stages after a minimisation need those of
//! its last evaluation again.

use isoform_geom::{DistanceField, Foot, ParamField, Point3};
use std::sync::{Arc, Mutex, PoisonError};

/// A distance that caches the feet of its last evaluation.
pub(crate) struct CachedFeet<'a> {
    distance: &'a dyn DistanceField,
    last: Mutex<Option<Arc<Feet>>>,
}

/// Feet with the points and parameters that they belong to.
#[derive(Default)]
pub(crate) struct Feet {
    points: Vec<Point3>,
    a: Vec<f64>,
    pub(crate) feet: Vec<Foot>,
}

impl Feet {
    /// Computes the feet of points.
    fn ask(&mut self, distance: &dyn DistanceField, points: &[Point3], a: &[f64]) {
        self.points.clear();
        self.points.extend_from_slice(points);
        a.clone_into(&mut self.a);
        self.feet.resize(points.len(), Foot::NONE);
        distance.feet(points, a, &mut self.feet);
    }
}

impl<'a> CachedFeet<'a> {
    pub(crate) fn new(distance: &'a dyn DistanceField) -> Self {
        Self {
            distance,
            last: Mutex::new(None),
        }
    }

    /// Returns the feet of points at parameters `a`.
    pub(crate) fn at(&self, points: &[Point3], a: &[f64]) -> Arc<Feet> {
        let is_asked = |last: &Arc<Feet>| last.a == a && last.points == points;
        let mut last = self.lock();
        if let Some(known) = last.clone().filter(is_asked) {
            return known;
        }
        // The memory is reused: to allocate it anew costs about a tenth of the computation.
        let mut found = last.take().and_then(Arc::into_inner).unwrap_or_default();
        drop(last);
        found.ask(self.distance, points, a);
        let found = Arc::new(found);
        *self.lock() = Some(Arc::clone(&found));
        found
    }

    /// Clears the cache.
    pub(crate) fn forget(&self) {
        *self.lock() = None;
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Option<Arc<Feet>>> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ParamField for CachedFeet<'_> {
    fn dim(&self) -> usize {
        self.distance.dim()
    }
    fn values(&self, points: &[Point3], a: &[f64], out: &mut [f64]) {
        self.distance.values(points, a, out);
    }
    fn jacobian(&self, points: &[Point3], a: &[f64], out: &mut [f64], jac: &mut [f64]) {
        self.distance.jacobian(points, a, out, jac);
    }
    fn normal_equations(
        &self,
        points: &[Point3],
        weights: &[f64],
        a: &[f64],
        gradient: &mut [f64],
        hessian: &mut [f64],
    ) -> f64 {
        let found = self.at(points, a);
        self.distance
            .normal_equations_at(&found.feet, weights, a, gradient, hessian)
    }
    fn gradients(&self, points: &[Point3], a: &[f64], out: &mut [f64], gradients: &mut [Point3]) {
        self.distance.gradients(points, a, out, gradients);
    }
}
