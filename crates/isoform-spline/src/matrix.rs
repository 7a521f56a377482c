//! Symmetric sparse matrices over the B-splines of a level.
//!
//! The supports of two B-splines of degree d overlap if their indices differ by at most d along
//! every axis. In the order by z, y and x the overlapping B-splines of one form (2d + 1)² runs of
//! consecutive columns: a row is stored as runs, without a column index per entry.

use crate::keys::IndexSet;
use rayon::prelude::*;

/// Consecutive columns of a row.
#[derive(Clone, Copy, Debug, Default)]
struct ColumnRun {
    first: u32,
    length: u32,
}

/// Symmetric matrix stored as runs; see the module documentation.
#[derive(Debug)]
pub(crate) struct RunMatrix {
    reach: i32,
    runs: Vec<ColumnRun>,
    /// Start of each row in `values`, and the end of the last.
    starts: Vec<usize>,
    values: Vec<f64>,
}

/// Block of rows that one thread fills.
#[derive(Debug)]
pub(crate) struct MatrixBlock<'a> {
    reach: i32,
    pub(crate) first: usize,
    pub(crate) end: usize,
    runs: &'a [ColumnRun],
    starts: &'a [usize],
    values: &'a mut [f64],
}

/// Splits a slice at these positions, the first of which is 0.
pub(crate) fn split<'a, T>(mut rest: &'a mut [T], at: &[usize]) -> Vec<&'a mut [T]> {
    let lengths = at.windows(2).map(|w| w[1] - w[0]);
    let part = |length| {
        rest.split_off_mut(..length)
            .expect("places are within the slice")
    };
    lengths.map(part).collect()
}

impl RunMatrix {
    /// Returns a matrix of zeros with an entry for every two B-splines whose supports overlap.
    pub(crate) fn new(nodes: &IndexSet, degree: usize) -> Self {
        let reach = degree as i32;
        let runs_of_row = |i: usize| {
            let [x, y, z] = nodes.at(i);
            let mut row = Vec::with_capacity(((2 * reach + 1) * (2 * reach + 1)) as usize);
            for c in -reach..=reach {
                for b in -reach..=reach {
                    let mut run = ColumnRun::default();
                    for a in -reach..=reach {
                        if let Some(j) = nodes.find([x + a, y + b, z + c]) {
                            if run.length == 0 {
                                run.first = j as u32;
                            }
                            run.length = j as u32 - run.first + 1;
                        }
                    }
                    row.push(run);
                }
            }
            row
        };
        let runs: Vec<ColumnRun> = (0..nodes.len())
            .into_par_iter()
            .flat_map_iter(runs_of_row)
            .collect();
        let width = ((2 * reach + 1) * (2 * reach + 1)) as usize;
        let mut starts = Vec::with_capacity(nodes.len() + 1);
        let mut total = 0;
        starts.push(0);
        for row in runs.chunks(width) {
            total += row.iter().map(|r| r.length as usize).sum::<usize>();
            starts.push(total);
        }
        Self {
            reach,
            runs,
            starts,
            values: vec![0.0; total],
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }
    fn width(&self) -> usize {
        ((2 * self.reach + 1) * (2 * self.reach + 1)) as usize
    }

    /// Splits the rows into this many blocks, which threads can fill in parallel.
    pub(crate) fn parts(&mut self, count: usize) -> Vec<MatrixBlock<'_>> {
        let (n, width) = (self.len(), self.width());
        let borders: Vec<usize> = (0..=count).map(|k| n * k / count).collect();
        let starts: Vec<usize> = borders.iter().map(|i| self.starts[*i]).collect();
        let values = split(&mut self.values, &starts);
        let rows = |(values, of): (_, &[usize])| MatrixBlock {
            reach: self.reach,
            first: of[0],
            end: of[1],
            runs: &self.runs[of[0] * width..of[1] * width],
            starts: &self.starts[of[0]..=of[1]],
            values,
        };
        values
            .into_iter()
            .zip(borders.windows(2))
            .map(rows)
            .collect()
    }

    /// Returns the diagonal.
    pub(crate) fn diagonal(&self) -> Vec<f64> {
        let (width, middle) = (self.width(), self.width() / 2);
        (0..self.len())
            .map(|i| {
                let row = &self.runs[i * width..(i + 1) * width];
                let before: usize = row[..middle].iter().map(|r| r.length as usize).sum();
                let column = i - row[middle].first as usize;
                self.values[self.starts[i] + before + column]
            })
            .collect()
    }

    /// Returns the columns and values of a row's entries from column `first` to the diagonal.
    pub(crate) fn left_of_diagonal(
        &self,
        i: usize,
        first: usize,
    ) -> impl Iterator<Item = (usize, f64)> + '_ {
        let width = self.width();
        let mut at = self.starts[i];
        self.runs[i * width..=i * width + width / 2]
            .iter()
            .flat_map(move |run| {
                let values = &self.values[at..at + run.length as usize];
                at += values.len();
                let columns = run.first as usize..;
                let is_before = columns.start + values.len() <= first;
                let values = if is_before { &[] } else { values };
                columns.zip(values.iter().copied())
            })
            .filter(move |(j, _)| (first..=i).contains(j))
    }

    /// Computes y = A x.
    pub(crate) fn apply(&self, x: &[f64], y: &mut [f64]) {
        let width = self.width();
        y.par_iter_mut()
            .with_min_len(1 << 10)
            .enumerate()
            .for_each(|(i, y)| {
                let mut at = self.starts[i];
                let mut sum = 0.0;
                for run in &self.runs[i * width..(i + 1) * width] {
                    let (first, length) = (run.first as usize, run.length as usize);
                    let values = &self.values[at..at + length];
                    // Separate sums per run avoid one long chain of dependent additions.
                    let products = values.iter().zip(&x[first..first + length]);
                    sum += products.map(|(a, b)| a * b).sum::<f64>();
                    at += length;
                }
                *y = sum;
            });
    }
}

impl MatrixBlock<'_> {
    /// Adds `values[k]` at row `row` and the columns `first + k`, all on the line in x at the
    /// offset `b` in y and `c` in z from the row.
    #[inline]
    pub(crate) fn add(&mut self, row: usize, [b, c]: [i32; 2], columns: &[(u32, f64)]) {
        let width = ((2 * self.reach + 1) * (2 * self.reach + 1)) as usize;
        let k = row - self.first;
        let runs = &self.runs[k * width..(k + 1) * width];
        let line = ((c + self.reach) * (2 * self.reach + 1) + b + self.reach) as usize;
        let before: usize = runs[..line].iter().map(|r| r.length as usize).sum();
        let start = self.starts[k] - self.starts[0] + before;
        for (column, value) in columns {
            self.values[start + (column - runs[line].first) as usize] += value;
        }
    }
}
