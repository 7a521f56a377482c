//! Fits of clouds in chunks equal the fit of all their points.

use isoform::field::hyperfun::{Mode, Model};
use isoform::geom::{Point3, PointCloud};
use isoform::{
    ChunkReader, ChunkSource, Control, FitOptions, FitScanError, ScanFit, fit_chunks, fit_scan,
};
use std::f64::consts::TAU;

/// A can without lids, in any pose.
const CAN: &str = "-- @pose axis
-- @param a[1] radius length min=0.1
-- @param a[2] height length min=0.1
my_model(x[3], a[2]) {
  side = a[1]^2 - x[1]^2 - x[2]^2;
  my_model = side & (x[3] + a[2]/2) & (a[2]/2 - x[3]);
}
";

/// Chunks in memory, with messages as to other machines.
struct ChunksInMemory {
    reader: ChunkReader,
    chunks: Vec<Vec<Point3>>,
    /// Index of a chunk that does not answer.
    lost: Option<usize>,
}

impl ChunksInMemory {
    fn new(model: &Model, points: &[Point3], size: usize) -> Self {
        Self {
            reader: ChunkReader::new(model.clone()),
            chunks: points.chunks(size).map(<[Point3]>::to_vec).collect(),
            lost: None,
        }
    }
}

impl ChunkSource for ChunksInMemory {
    fn len(&self) -> usize {
        self.chunks.len()
    }
    fn ask(
        &self,
        message: &mut dyn FnMut(usize) -> Option<Vec<u8>>,
        each: &mut dyn FnMut(usize, &[u8]),
    ) -> bool {
        for (k, points) in self.chunks.iter().enumerate() {
            if self.lost == Some(k) {
                return false;
            }
            if let Some(message) = message(k) {
                let answer = self.reader.answer(&message, points.clone());
                each(k, &answer.expect("a template"));
            }
        }
        true
    }
}

fn can() -> Model {
    Model::parse(CAN, Mode::Default).expect("a program")
}

/// Returns points of a can that lies far from the origin, with noise and some outliers.
fn points(count: u32) -> Vec<Point3> {
    let mut random = fastrand::Rng::with_seed(5);
    let mut normal = move || {
        let r = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
        (r * (TAU * random.f64()).cos(), random.f64(), random.f64())
    };
    let point = |k: u32| {
        let (noise, u, v) = normal();
        let stray = if k % 300 == 1 { 0.5 } else { 0.0 };
        let (sin, cos) = (TAU * u).sin_cos();
        let r = 2.0 + 0.01 * noise + stray;
        // The lids have a third of the side's area.
        let (r, z) = match k % 4 {
            0 => {
                let side = if k.is_multiple_of(8) { 3.0 } else { -3.0 };
                (2.0 * v.sqrt(), side + 0.01 * noise)
            }
            _ => (r, 6.0 * v - 3.0),
        };
        [900.0 + r * cos, z, r * sin - 40.0]
    };
    (0..count).map(point).collect()
}

/// Returns the largest difference of values, and the largest relative difference of deviations.
fn difference(a: &ScanFit, b: &ScanFit) -> (f64, f64) {
    let values = a.values().into_iter().zip(b.values());
    let values = values.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let pairs = a.fit.parameters.iter().zip(&b.fit.parameters);
    let deviations = pairs.map(|(a, b)| match (a.sd, b.sd) {
        (Some(a), Some(b)) => (a / b - 1.0).abs(),
        (a, b) => f64::from(u8::from(a != b)),
    });
    (values, deviations.fold(0.0, f64::max))
}

fn fitted(pieces: &ChunksInMemory, model: &Model) -> ScanFit {
    fit_chunks(pieces, model, &FitOptions::default(), &Control::default()).expect("a fit")
}

#[test]
fn a_large_cloud_is_fitted_as_the_whole_is() {
    let (model, points) = (can(), points(210_000));
    let scan = PointCloud::from_points(points.clone());
    let whole =
        fit_scan(&scan, &model, &FitOptions::default(), &Control::default()).expect("a fit");
    assert!(whole.fit.n_outliers > 500, "{}", whole.fit.n_outliers);
    for size in [50_000, 210_000] {
        let found = fitted(&ChunksInMemory::new(&model, &points, size), &model);
        let (values, deviations) = difference(&whole, &found);
        assert!(
            values < 1e-9 && deviations < 1e-6,
            "{values:e} {deviations:e}"
        );
        let (a, b) = (&whole.fit, &found.fit);
        assert!((a.rms - b.rms).abs() < 1e-9 && (a.sum_f2 / b.sum_f2 - 1.0).abs() < 1e-9);
        assert_eq!((a.n_outliers, a.n_fitted), (b.n_outliers, b.n_fitted));
        assert_eq!((a.verdict, &a.reasons), (b.verdict, &b.reasons));
        assert_eq!(a.warnings, b.warnings);
        assert_eq!(found.cloud.points.len(), 200_000);
    }
}

#[test]
fn a_small_cloud_is_fitted_to_the_last_bit() {
    let (model, points) = (can(), points(4000));
    let scan = PointCloud::from_points(points.clone());
    let whole =
        fit_scan(&scan, &model, &FitOptions::default(), &Control::default()).expect("a fit");
    let found = fitted(&ChunksInMemory::new(&model, &points, 999), &model);
    assert_eq!(found.fit.parameters, whole.fit.parameters);
    assert_eq!(found.fit.residuals, whole.fit.residuals);
}

#[test]
fn a_chunk_that_does_not_answer_stops_the_fit() {
    let model = can();
    let mut pieces = ChunksInMemory::new(&model, &points(500), 100);
    pieces.lost = Some(3);
    let found = fit_chunks(&pieces, &model, &FitOptions::default(), &Control::default());
    assert!(matches!(
        found,
        Err(FitScanError::Fit(isoform::fit::FitError::Stopped))
    ));
    pieces.chunks.clear();
    let found = fit_chunks(&pieces, &model, &FitOptions::default(), &Control::default());
    assert!(matches!(found, Err(FitScanError::NoPoints)));
}
