//! Points between numpy and the library.
//!
//! Arrays that come are (n, 3) of float64, with any strides: the Python half has seen to that. What
//! goes out is handed over without a copy.

use crate::error::Trouble;
use isoform::geom::Point3;
use numpy::ndarray::ArrayView2;
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Points out of Python.
pub(crate) type PointsArg<'py> = PyReadonlyArray2<'py, f64>;

/// Points in any strides, a block of them at a time.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    view: ArrayView2<'a, f64>,
    /// The same where they lie one behind the other.
    dense: Option<&'a [Point3]>,
}

impl<'a> Rows<'a> {
    /// The rows of an array of three columns.
    pub(crate) fn new(array: &'a PointsArg<'_>) -> Result<Self, Trouble> {
        let view = array.as_array();
        if view.ncols() != 3 {
            let message = format!(
                "points are (n, 3), not ({}, {})",
                view.nrows(),
                view.ncols()
            );
            return Err(Trouble::new("shape", message));
        }
        // `as_slice` takes any order of the axes.
        let flat = array.as_slice().ok().filter(|_| array.is_c_contiguous());
        let dense = flat.map(|flat| flat.as_chunks::<3>().0);
        Ok(Self { view, dense })
    }

    pub(crate) fn len(&self) -> usize {
        self.view.nrows()
    }

    /// Calls `work` with the points from `first`, as many as `count`.
    pub(crate) fn block<T>(
        &self,
        first: usize,
        count: usize,
        work: impl FnOnce(&[Point3]) -> T,
    ) -> T {
        match self.dense {
            Some(points) => work(&points[first..first + count]),
            None => {
                let rows = first..first + count;
                let copied: Vec<Point3> = rows.map(|i| self.row(i)).collect();
                work(&copied)
            }
        }
    }

    fn row(&self, i: usize) -> Point3 {
        std::array::from_fn(|k| self.view[[i, k]])
    }

    /// All points, which must be finite.
    pub(crate) fn to_points(self) -> Result<Vec<Point3>, Trouble> {
        let points = self.block(0, self.len(), <[Point3]>::to_vec);
        match not_finite_at(&points) {
            None => Ok(points),
            Some(row) => Err(not_finite(row)),
        }
    }
}

/// Whether all numbers are finite.
pub(crate) fn are_finite(values: &[f64]) -> bool {
    // Zero times a number is zero, or NaN where it is not finite. Eight sums that do not wait for
    // one another are what vector instructions of every processor do; tests of bits are not.
    let (eights, rest) = values.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        for (sum, v) in sums.iter_mut().zip(eight) {
            *sum += 0.0 * v;
        }
    }
    sums.iter().sum::<f64>() == 0.0 && rest.iter().all(|v| v.is_finite())
}

/// The first point that is NaN or infinite.
pub(crate) fn not_finite_at(points: &[Point3]) -> Option<usize> {
    if are_finite(points.as_flattened()) {
        return None;
    }
    points.iter().position(|p| !are_finite(p))
}

/// A point is NaN or infinite.
pub(crate) fn not_finite(row: usize) -> Trouble {
    Trouble::new("not-finite", format!("point {row} (from 0) is not finite"))
        .hint("points[numpy.isfinite(points).all(axis=1)]")
}

/// Rows of numbers as an array of N columns.
pub(crate) fn rows<'py, T: Element, const N: usize>(
    py: Python<'py>,
    rows: Vec<[T; N]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let shape = [rows.len(), N];
    PyArray1::from_vec(py, rows.into_flattened()).reshape(shape)
}
