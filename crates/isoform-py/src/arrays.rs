//! Exchange of points between numpy and the library.
//!
//! Incoming arrays are (n, 3) of float64 with any strides, as the Python half ensures. Outgoing
//! arrays are handed over without a copy.

use crate::error::CallError;
use isoform::geom::Point3;
use numpy::ndarray::ArrayView2;
use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Points passed from Python.
pub(crate) type PointsArg<'py> = PyReadonlyArray2<'py, f64>;

/// Rows of an array of points with any strides, accessed by blocks.
#[derive(Clone, Copy)]
pub(crate) struct PointRows<'a> {
    view: ArrayView2<'a, f64>,
    /// Rows as a slice; `None` if the array is not contiguous.
    dense: Option<&'a [Point3]>,
}

impl<'a> PointRows<'a> {
    /// Wraps an array, which must have three columns.
    pub(crate) fn new(array: &'a PointsArg<'_>) -> Result<Self, CallError> {
        let view = array.as_array();
        if view.ncols() != 3 {
            let message = format!(
                "points are (n, 3), not ({}, {})",
                view.nrows(),
                view.ncols()
            );
            return Err(CallError::new("shape", message));
        }
        // `as_slice` accepts any order of the axes.
        let flat = array.as_slice().ok().filter(|_| array.is_c_contiguous());
        let dense = flat.map(|flat| flat.as_chunks::<3>().0);
        Ok(Self { view, dense })
    }

    pub(crate) fn len(&self) -> usize {
        self.view.nrows()
    }

    /// Calls `work` with up to `count` points from index `first`.
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

    /// Copies all points, which must be finite.
    pub(crate) fn to_points(self) -> Result<Vec<Point3>, CallError> {
        let points = self.block(0, self.len(), <[Point3]>::to_vec);
        match not_finite_at(&points) {
            None => Ok(points),
            Some(row) => Err(not_finite(row)),
        }
    }
}

/// Returns true if all numbers are finite.
pub(crate) fn are_finite(values: &[f64]) -> bool {
    // Zero times a number is zero, or NaN if the number is not finite. Eight independent sums
    // compile to vector instructions on every processor; tests of bits do not.
    let (eights, rest) = values.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        for (sum, v) in sums.iter_mut().zip(eight) {
            *sum += 0.0 * v;
        }
    }
    sums.iter().sum::<f64>() == 0.0 && rest.iter().all(|v| v.is_finite())
}

/// Returns the index of the first point that is NaN or infinite.
pub(crate) fn not_finite_at(points: &[Point3]) -> Option<usize> {
    if are_finite(points.as_flattened()) {
        return None;
    }
    points.iter().position(|p| !are_finite(p))
}

/// Returns the error for a point that is NaN or infinite.
pub(crate) fn not_finite(row: usize) -> CallError {
    CallError::new("not-finite", format!("point {row} (from 0) is not finite"))
        .hint("points[numpy.isfinite(points).all(axis=1)]")
}

/// Converts rows of numbers to an array of N columns.
pub(crate) fn rows<'py, T: Element, const N: usize>(
    py: Python<'py>,
    rows: Vec<[T; N]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let shape = [rows.len(), N];
    PyArray1::from_vec(py, rows.into_flattened()).reshape(shape)
}
