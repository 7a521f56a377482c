//! Functions of space from files, as terms of expressions.

use isoform_geom::{Aabb, Field, Point3};
use isoform_num::{Interval, Real};
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// Function of space that is given by data instead of a formula: f ≥ 0 inside, with continuous
/// gradient. Two are equal if they share the data.
#[derive(Clone)]
pub struct Imported {
    name: Arc<str>,
    field: Arc<dyn Field>,
}

impl Imported {
    /// Returns a function with a name for its surface.
    pub fn new(name: &str, field: Arc<dyn Field>) -> Self {
        Self {
            name: name.into(),
            field,
        }
    }

    /// Returns the name of the surface.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Computes the function at points whose coordinates are the columns of `at`.
    pub(crate) fn values<const N: usize>(&self, at: [&[f64; N]; 3], out: &mut [f64; N]) {
        let points: [Point3; N] = std::array::from_fn(|l| at.map(|row| row[l]));
        self.field.values(&points, out);
    }

    /// Evaluates the function in a number type with derivatives up to order 2, by its Taylor
    /// polynomial about the values of the arguments.
    pub(crate) fn eval<R: Real>(&self, args: &[R]) -> R {
        let at: Point3 = std::array::from_fn(|i| args[i].value());
        let jet = self.field.jet(at);
        let by: [R; 3] = std::array::from_fn(|i| args[i].clone() - R::constant(at[i]));
        let mut sum = R::constant(jet.v);
        for i in 0..3 {
            let mut slope = R::constant(jet.g[i]);
            for (j, by) in by.iter().enumerate() {
                slope = slope + R::constant(0.5 * jet.second(i, j)) * by.clone();
            }
            sum = sum + slope * by[i].clone();
        }
        sum
    }

    /// Returns an interval that contains the function over a box, with its rounding.
    pub(crate) fn range(&self, args: &[Interval]) -> Interval {
        self.field.bounds(Aabb {
            lo: std::array::from_fn(|i| args[i].lo()),
            hi: std::array::from_fn(|i| args[i].hi()),
        })
    }
}

impl PartialEq for Imported {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.field, &other.field)
    }
}
impl Eq for Imported {}

impl Hash for Imported {
    /// Equal functions may have different names, so that names add nothing.
    fn hash<H: Hasher>(&self, state: &mut H) {
        Arc::as_ptr(&self.field).cast::<()>().hash(state);
    }
}

impl fmt::Debug for Imported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Imported").field(&self.name).finish()
    }
}
