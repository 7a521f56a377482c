//! Queries about points in chunks.

use super::bits::Bits;
use super::wire::{WordReader, WordWriter};
use crate::Loss;
use crate::cells::Cells;
use isoform_geom::{Frame, Point3};

/// A residual function of the template.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The template's own function.
    Algebraic,
    /// An approximation of the distance.
    Metric,
    /// The distance, or the metric reading if the template has none.
    Distance,
}

const READINGS: [Reading; 3] = [Reading::Algebraic, Reading::Metric, Reading::Distance];
const LOSSES: [Loss; 4] = [Loss::Auto, Loss::Squares, Loss::Cauchy, Loss::Tukey];

/// Residuals that a query is about.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualRequest {
    /// Residual function.
    pub reading: Reading,
    /// Parameters.
    pub a: Vec<f64>,
    /// Flags of the points.
    pub only: Bits,
}

/// Weights by a loss of the residuals at some parameters, which need not be those of the query.
#[derive(Clone, Debug, PartialEq)]
pub struct LossWeights {
    /// Parameters.
    pub a: Vec<f64>,
    /// Loss.
    pub loss: Loss,
    /// Scale of the loss.
    pub scale: f64,
}

/// A mask that excludes the points whose nearest point of the model is on an open part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mask {
    /// Parameters at which the nearest points are computed.
    pub a: Vec<f64>,
    /// True if a part is open, by part; empty for no mask.
    pub open: Vec<bool>,
}

/// Cells of a grid in which points are counted.
#[derive(Clone, Debug, PartialEq)]
pub struct CellGrid {
    /// Frame along whose axes the cells lie.
    pub frame: Frame,
    /// Lower corner of the box.
    pub lo: Point3,
    /// Edge length of a cell.
    pub cell: f64,
    /// Number of cells along each axis.
    pub count: [usize; 3],
}

impl CellGrid {
    /// Makes a grid of cells along the axes of a frame.
    pub(crate) fn from_cells(cells: &Cells, frame: Frame) -> Self {
        Self {
            frame,
            lo: cells.lo,
            cell: cells.cell,
            count: cells.count,
        }
    }

    /// Returns the cells in the coordinates of the frame.
    pub(super) fn cells(&self) -> Cells {
        Cells {
            lo: self.lo,
            cell: self.cell,
            count: self.count,
        }
    }
}

/// A query for the statistics of points after a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticsQuery {
    /// Fitted parameters.
    pub a: Vec<f64>,
    /// Flags of distinct points.
    pub only: Bits,
    /// Distance beyond which a point is an outlier; infinite for none.
    pub limit: f64,
    /// Distance beyond which points are listed; infinite to list only those without a distance.
    pub far: f64,
    /// Distance assigned to points without one.
    pub size: f64,
    /// Interval of the distances of used points that are listed.
    pub window: (f64, f64),
    /// Parameters at which the algebraic sum is computed.
    pub minima: Vec<Vec<f64>>,
}

/// A query to a chunk; it is evaluated by `evaluate_chunk`.
#[derive(Clone, Debug, PartialEq)]
pub enum ChunkQuery {
    /// The number of points and their box, for `decode_count_and_bounds`.
    Look,
    /// A hash of each point, with this seed.
    Hashes(u64),
    /// The points with these indices.
    Points(Vec<u64>),
    /// The second moments about a centre.
    Moments(Point3),
    /// The box in the coordinates along the columns of a rotation.
    Extents([Point3; 3]),
    /// The box of flagged points in a frame.
    Within(Frame, Bits),
    /// The number of flagged points by cell.
    Cells(CellGrid, Bits),
    /// Sizes of residuals: those in a window, and the sums of squares above and within a limit.
    Sizes(ResidualRequest, (f64, f64), f64),
    /// The weighted sum of squares.
    Sum(ResidualRequest, Option<LossWeights>, Mask),
    /// The weighted normal equations.
    Normal(ResidualRequest, Option<LossWeights>, Mask),
    /// The sum of Tukey's loss at this scale.
    Losses(ResidualRequest, f64, Mask),
    /// The statistics for a report.
    Statistics(StatisticsQuery),
}

impl ChunkQuery {
    /// Encodes the query.
    pub fn to_words(&self) -> Vec<u64> {
        let mut out = WordWriter::default();
        match self {
            Self::Look => out.word(1),
            Self::Hashes(seed) => {
                out.word(0);
                out.word(*seed);
            }
            Self::Points(at) => {
                out.word(2);
                out.words(at);
            }
            Self::Moments(center) => {
                out.word(3);
                out.point(*center);
            }
            Self::Extents(base) => {
                out.word(4);
                base.iter().for_each(|row| out.point(*row));
            }
            Self::Within(frame, only) => {
                out.word(5);
                out.frame(frame);
                out.words(&only.0);
            }
            Self::Cells(grid, only) => {
                out.word(6);
                out.grid(grid);
                out.words(&only.0);
            }
            Self::Sizes(asked, window, limit) => {
                out.word(7);
                out.residual_request(asked);
                out.each(&[window.0, window.1, *limit]);
            }
            Self::Sum(asked, by, mask) | Self::Normal(asked, by, mask) => {
                out.word(if matches!(self, Self::Sum(..)) { 8 } else { 9 });
                out.residual_request(asked);
                out.loss_weights(by.as_ref());
                out.mask(mask);
            }
            Self::Losses(asked, scale, mask) => {
                out.word(10);
                out.residual_request(asked);
                out.number(*scale);
                out.mask(mask);
            }
            Self::Statistics(telling) => {
                out.word(11);
                out.statistics_query(telling);
            }
        }
        out.0
    }

    /// Decodes a query; `None` if the words do not hold one.
    pub fn from_words(words: &[u64]) -> Option<Self> {
        let mut words = WordReader::new(words);
        let question = match words.word() {
            0 => Self::Hashes(words.word()),
            2 => Self::Points(words.words()),
            3 => Self::Moments(words.point()),
            4 => Self::Extents([words.point(), words.point(), words.point()]),
            5 => Self::Within(words.frame(), Bits(words.words())),
            6 => Self::Cells(words.grid(), Bits(words.words())),
            7 => Self::Sizes(
                words.residual_request(),
                (words.number(), words.number()),
                words.number(),
            ),
            8 => Self::Sum(words.residual_request(), words.loss_weights(), words.mask()),
            9 => Self::Normal(words.residual_request(), words.loss_weights(), words.mask()),
            10 => Self::Losses(words.residual_request(), words.number(), words.mask()),
            11 => Self::Statistics(words.statistics_query()),
            1 => Self::Look,
            _ => return None,
        };
        (!words.is_short).then_some(question)
    }
}

impl WordWriter {
    fn frame(&mut self, frame: &Frame) {
        frame.rotation.iter().for_each(|row| self.point(*row));
        self.point(frame.translation);
    }
    fn grid(&mut self, grid: &CellGrid) {
        self.frame(&grid.frame);
        self.point(grid.lo);
        self.number(grid.cell);
        grid.count.into_iter().for_each(|count| self.count(count));
    }
    fn residual_request(&mut self, asked: &ResidualRequest) {
        self.word(asked.reading as u64);
        self.numbers(&asked.a);
        self.words(&asked.only.0);
    }
    fn loss_weights(&mut self, by: Option<&LossWeights>) {
        self.word(u64::from(by.is_some()));
        if let Some(by) = by {
            self.numbers(&by.a);
            self.word(by.loss as u64);
            self.number(by.scale);
        }
    }
    fn mask(&mut self, mask: &Mask) {
        self.numbers(&mask.a);
        let open: Vec<u64> = mask.open.iter().map(|open| u64::from(*open)).collect();
        self.words(&open);
    }
    fn statistics_query(&mut self, telling: &StatisticsQuery) {
        self.numbers(&telling.a);
        self.words(&telling.only.0);
        let (lo, hi) = telling.window;
        self.each(&[telling.limit, telling.far, telling.size, lo, hi]);
        self.count(telling.minima.len());
        telling.minima.iter().for_each(|a| self.numbers(a));
    }
}

impl WordReader<'_> {
    fn frame(&mut self) -> Frame {
        Frame {
            rotation: [self.point(), self.point(), self.point()],
            translation: self.point(),
        }
    }
    fn grid(&mut self) -> CellGrid {
        CellGrid {
            frame: self.frame(),
            lo: self.point(),
            cell: self.number(),
            count: [self.count(), self.count(), self.count()],
        }
    }
    fn residual_request(&mut self) -> ResidualRequest {
        ResidualRequest {
            reading: self.one_of(&READINGS),
            a: self.numbers(),
            only: Bits(self.words()),
        }
    }
    fn loss_weights(&mut self) -> Option<LossWeights> {
        (self.word() == 1).then(|| LossWeights {
            a: self.numbers(),
            loss: self.one_of(&LOSSES),
            scale: self.number(),
        })
    }
    fn mask(&mut self) -> Mask {
        Mask {
            a: self.numbers(),
            open: self.words().into_iter().map(|open| open == 1).collect(),
        }
    }
    fn statistics_query(&mut self) -> StatisticsQuery {
        StatisticsQuery {
            a: self.numbers(),
            only: Bits(self.words()),
            limit: self.number(),
            far: self.number(),
            size: self.number(),
            window: (self.number(), self.number()),
            minima: self.lists(),
        }
    }
    fn lists(&mut self) -> Vec<Vec<f64>> {
        let mut lists = Vec::new();
        for _ in 0..self.count() {
            if self.is_short {
                break;
            }
            lists.push(self.numbers());
        }
        lists
    }
}
