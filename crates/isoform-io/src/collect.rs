//! Collection of the rows of a file into a [`PointCloud`]: sampling while streaming, removal of
//! non-finite values, recentring.
//!
//! A reader announces the values of its rows ([`Collector::with_normals`] and the like), offers
//! rows and polygons, and calls [`Collector::finish`] at the end. A row that is kept gets a slot,
//! which receives its normal, colour and columns. The report then lists everything that was left
//! out or repaired.

use crate::input::{Input, Result};
use crate::{At, ErrorKind, MeshPoints, Place, ReadError, ReadOptions, ReadReport};
use isoform_geom::{Aabb, Column, Point3, PointCloud, dot, recentering_origin};

/// Maximum deviation of the length of a normal from 1 that is not corrected; single precision stays
/// below it.
const NORMAL_SLACK: f64 = 1e-3;

/// Scale of colour values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ColorScale {
    /// 0 to 255.
    Byte,
    /// 0 to 65535 by the standard, but 0 to 255 in many files; the largest value decides.
    Word,
    /// 0 to 1, 0 to 255 or 0 to 65535; the largest value decides.
    Guess,
}

/// Accumulates the rows of a file into a cloud.
pub(crate) struct Collector {
    /// Maximum number of points to keep; `None` keeps all.
    limit: Option<usize>,
    /// Random generator of the sample, seeded by the options.
    rng: fastrand::Rng,
    /// True if kept points have normals.
    normals: bool,
    /// Scale of the colours; `None` without colours.
    scale: Option<ColorScale>,
    /// Points so far; their colours are still in `colors`.
    pub(crate) cloud: PointCloud,
    /// Colours in the numbers of the file, until the largest value reveals their scale.
    colors: Vec<[f32; 3]>,
    /// Index of each kept point among the finite rows; only filled while sampling.
    order: Vec<u64>,
    /// Number of rows with finite coordinates.
    finite: u64,
    /// Number of rows offered, valid or not.
    pub(crate) rows: u64,
    /// Number of rows with non-finite coordinates.
    dropped: u64,
    /// Indices of dropped rows, ascending; only recorded for meshes.
    dropped_rows: Vec<u32>,
    /// True if triangles may follow, whose corners are row indices.
    is_mesh: bool,
    /// Bounding box of all finite rows, including those that are not kept.
    bounds: Aabb,
    /// Largest row index in a triangle, and its position in the file.
    highest: Option<(u64, At)>,
    /// Groups of the triangles so far.
    parts: TriangleParts,
    /// Part of the triangles to come.
    part: Option<u32>,
}

/// Groups of triangles that a file names.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct TriangleParts {
    /// Part of every triangle; empty if the file has no groups.
    pub(crate) of_triangle: Vec<u32>,
    /// Names of the parts.
    pub(crate) names: Vec<String>,
}

impl Collector {
    pub(crate) fn new(options: &ReadOptions) -> Self {
        Self {
            limit: options.max_points,
            rng: fastrand::Rng::with_seed(options.seed),
            normals: false,
            scale: None,
            cloud: PointCloud::default(),
            colors: Vec::new(),
            order: Vec::new(),
            finite: 0,
            rows: 0,
            dropped: 0,
            dropped_rows: Vec::new(),
            is_mesh: false,
            bounds: Aabb::EMPTY,
            highest: None,
            parts: TriangleParts::default(),
            part: None,
        }
    }
    /// Announces triangles, whose corners are row indices. Samples of the triangles need all
    /// vertices.
    pub(crate) fn mesh(&mut self, options: &ReadOptions) {
        self.is_mesh = true;
        if matches!(options.mesh, MeshPoints::Samples(_)) {
            self.limit = None; // samples on the triangles need all vertices
        }
    }
    /// Announces normals.
    pub(crate) fn with_normals(&mut self) {
        self.normals = true;
    }
    /// Announces colours with a scale.
    pub(crate) fn with_colors(&mut self, scale: ColorScale) {
        self.scale = Some(scale);
    }
    /// Announces further values per point, by name.
    pub(crate) fn with_columns(&mut self, names: impl IntoIterator<Item = String>) {
        self.cloud
            .columns
            .extend(names.into_iter().map(|name| Column {
                name,
                values: Vec::new(),
            }));
    }

    /// Offers a row. Returns the slot for its other values if the row is kept. Reservoir sampling
    /// (Vitter 1985, Algorithm R): after i rows each of them is kept with equal probability.
    #[inline]
    pub(crate) fn offer(&mut self, p: Point3) -> Option<usize> {
        let row = self.rows;
        self.rows += 1;
        if !p.iter().all(|v| v.is_finite()) {
            self.dropped += 1;
            if self.is_mesh
                && let Ok(row) = u32::try_from(row)
            {
                self.dropped_rows.push(row);
            }
            return None;
        }
        self.bounds.add(p);
        let i = self.finite;
        self.finite += 1;
        if let Some(k) = self.limit {
            if i >= k as u64 {
                let slot = self.rng.u64(0..=i) as usize;
                if slot >= k {
                    return None;
                }
                self.cloud.points[slot] = p;
                self.order[slot] = i;
                return Some(slot);
            }
            self.order.push(i);
        }
        self.cloud.points.push(p);
        if self.normals {
            self.cloud.normals.push([0.0; 3]);
        }
        if self.scale.is_some() {
            self.colors.push([0.0; 3]);
        }
        for column in &mut self.cloud.columns {
            column.values.push(f64::NAN);
        }
        Some(self.cloud.points.len() - 1)
    }
    /// Sets the normal of a kept point.
    #[inline]
    pub(crate) fn set_normal(&mut self, slot: usize, n: Point3) {
        self.cloud.normals[slot] = n;
    }
    /// Sets the colour of a kept point, in the numbers of the file.
    #[inline]
    pub(crate) fn set_color(&mut self, slot: usize, c: [f64; 3]) {
        self.colors[slot] = c.map(|v| v as f32);
    }
    /// Sets a further value of a kept point.
    #[inline]
    pub(crate) fn set_column(&mut self, slot: usize, column: usize, v: f64) {
        self.cloud.columns[column].values[slot] = v;
    }

    /// Returns true if the limit leaves out finite rows.
    fn is_sampled(&self) -> bool {
        self.limit.is_some_and(|k| self.finite > k as u64)
    }

    /// Adds a part and returns its index.
    pub(crate) fn add_part(&mut self, name: &str) -> u32 {
        self.parts.names.push(name.to_owned());
        self.parts.names.len() as u32 - 1
    }
    /// Sets the part of the triangles to come. Earlier triangles without a part get a part of their
    /// own.
    pub(crate) fn set_part(&mut self, part: u32) {
        if self.part.replace(part).is_none() && !self.cloud.triangles.is_empty() {
            let unnamed = self.add_part("default");
            self.parts.of_triangle = vec![unnamed; self.cloud.triangles.len()];
        }
    }

    /// Adds a polygon with row indices as corners, split into a fan of triangles.
    pub(crate) fn polygon(&mut self, corners: &[u64], at: At) {
        for &c in corners {
            if self.highest.is_none_or(|(high, _)| c > high) {
                self.highest = Some((c, at));
            }
        }
        if self.is_sampled() || corners.iter().any(|&c| c > u64::from(u32::MAX)) {
            return; // the triangles of a sample are not kept; the other case is refused at the end
        }
        for k in 2..corners.len() {
            self.cloud
                .triangles
                .push([corners[0], corners[k - 1], corners[k]].map(|c| c as u32));
            self.parts.of_triangle.extend(self.part);
        }
    }

    /// Returns the cloud of the offered rows; counts and warnings are added to the report.
    pub(crate) fn finish(
        self,
        input: &Input<'_>,
        options: &ReadOptions,
        report: &mut ReadReport,
    ) -> Result<PointCloud> {
        self.finish_with_parts(input, options, report)
            .map(|(cloud, _)| cloud)
    }

    /// Returns the cloud of the offered rows and the groups of its triangles; counts and warnings
    /// are added to the report.
    pub(crate) fn finish_with_parts(
        mut self,
        input: &Input<'_>,
        options: &ReadOptions,
        report: &mut ReadReport,
    ) -> Result<(PointCloud, TriangleParts)> {
        self.check_corners(input)?;
        report.rows = self.rows;
        report.dropped_points = self.dropped;
        report.subsampled = self.is_sampled();
        self.finish_triangles(report);
        self.report_dropped(report);
        self.finish_colors(report);
        finish_normals(&mut self.cloud.normals, report);
        finish_columns(&mut self.cloud.columns, report);
        if options.recenter {
            self.cloud = self.cloud.about(recentering_origin(&self.bounds));
        }
        Ok((self.cloud, self.parts))
    }

    /// Checks that every corner of a triangle is an existing row.
    fn check_corners(&self, input: &Input<'_>) -> Result<()> {
        let Some((index, at)) = self.highest else {
            return Ok(());
        };
        let kind = if index >= self.rows {
            ErrorKind::Index
        } else if index > u64::from(u32::MAX) {
            ErrorKind::TooLarge
        } else {
            return Ok(());
        };
        Err(ReadError {
            kind,
            what: "a face names a point that is not there",
            place: Place {
                file: input.name.clone(),
                at,
            },
            why: format!(
                "index {index} (from 0) where the file has {} points",
                self.rows
            ),
            hint: "export the mesh again; if only the points matter, remove the faces",
        })
    }

    /// Sorts a sample, which has no triangles, into the order of the file; otherwise renumbers the
    /// corners of triangles by the rows that were kept.
    fn finish_triangles(&mut self, report: &mut ReadReport) {
        if self.is_sampled() {
            self.sort_by_row();
            if self.highest.is_some() {
                self.cloud.triangles = Vec::new();
                self.parts.of_triangle = Vec::new();
                report
                    .warnings
                    .push("the triangles are left out, because the points were sampled".into());
            }
        } else if !self.dropped_rows.is_empty() {
            report.dropped_triangles += self.renumber();
        }
    }

    /// Warns of dropped points and triangles.
    fn report_dropped(&self, report: &mut ReadReport) {
        if self.dropped > 0 {
            report.warnings.push(format!(
                "{} of {} points have coordinates that are not finite and were dropped",
                self.dropped, self.rows
            ));
        }
        if report.dropped_triangles > 0 {
            report.warnings.push(format!(
                "{} triangles used dropped points and were dropped too",
                report.dropped_triangles
            ));
        }
    }

    /// Restores the order of the file, which the reservoir loses.
    fn sort_by_row(&mut self) {
        let mut by_row: Vec<usize> = (0..self.order.len()).collect();
        by_row.sort_unstable_by_key(|&i| self.order[i]);
        /// Permutes values, if there are any.
        fn permute<T: Copy>(values: &mut Vec<T>, by: &[usize]) {
            if !values.is_empty() {
                *values = by.iter().map(|&i| values[i]).collect();
            }
        }
        permute(&mut self.cloud.points, &by_row);
        permute(&mut self.cloud.normals, &by_row);
        permute(&mut self.colors, &by_row);
        for column in &mut self.cloud.columns {
            permute(&mut column.values, &by_row);
        }
    }

    /// Replaces row indices in triangles by point indices, accounting for dropped rows. Returns the
    /// number of triangles that lost a corner.
    fn renumber(&mut self) -> u64 {
        let gone = &self.dropped_rows;
        let before = self.cloud.triangles.len();
        let mut kept = Vec::with_capacity(before);
        self.cloud.triangles.retain_mut(|t| {
            let whole = t.iter_mut().all(|c| match gone.binary_search(c) {
                Ok(_) => false,
                Err(lower) => {
                    *c -= lower as u32;
                    true
                }
            });
            kept.push(whole);
            whole
        });
        let mut kept = kept.into_iter();
        self.parts
            .of_triangle
            .retain(|_| kept.next().unwrap_or(true));
        (before - self.cloud.triangles.len()) as u64
    }

    /// Converts colours to 0 to 255; if the format leaves the scale open, the largest value
    /// decides.
    fn finish_colors(&mut self, report: &mut ReadReport) {
        let Some(scale) = self.scale else { return };
        let mut bad = 0;
        let mut high = 0.0_f32;
        for v in self.colors.iter_mut().flatten() {
            if !v.is_finite() {
                *v = 0.0;
                bad += 1;
            }
            high = high.max(*v);
        }
        let factor = match scale {
            ColorScale::Guess if high <= 1.0 => 255.0,
            ColorScale::Word | ColorScale::Guess if high > 255.0 => 255.0 / 65535.0,
            _ => 1.0,
        };
        self.cloud.colors = self
            .colors
            .iter()
            .map(|c| c.map(|v| (v * factor).round().clamp(0.0, 255.0) as u8))
            .collect();
        if bad > 0 {
            report.warnings.push(format!(
                "{bad} colour values are not finite and were set to 0"
            ));
        }
    }
}

/// Normalises normals; non-finite ones become 0, which stands for unknown.
fn finish_normals(normals: &mut [Point3], report: &mut ReadReport) {
    let (mut scaled, mut bad) = (0, 0);
    for n in normals {
        // Scaled first: the squares of large components overflow.
        let high = n.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        if n.iter().any(|v| !v.is_finite()) {
            *n = [0.0; 3];
            bad += 1;
        } else if high > 0.0 {
            let m = n.map(|v| v / high);
            let length = dot(m, m).sqrt();
            if (length * high - 1.0).abs() > NORMAL_SLACK {
                *n = m.map(|v| v / length);
                scaled += 1;
            }
        }
    }
    if scaled > 0 {
        report.warnings.push(format!(
            "{scaled} normals were not of length 1 and were scaled"
        ));
    }
    if bad > 0 {
        report
            .warnings
            .push(format!("{bad} normals are not finite and were set to 0"));
    }
}

/// Replaces infinite column values by NaN, and warns of columns with non-finite values.
fn finish_columns(columns: &mut [Column], report: &mut ReadReport) {
    for column in columns {
        let bad = column.values.iter().filter(|v| !v.is_finite()).count();
        if bad > 0 {
            report.warnings.push(format!(
                "column \"{}\" has {bad} values that are not finite; they are kept as NaN",
                column.name
            ));
        }
        for v in column.values.iter_mut().filter(|v| !v.is_finite()) {
            *v = f64::NAN;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;
    use proptest::prelude::*;

    fn collect(points: &[Point3], options: &ReadOptions) -> (PointCloud, ReadReport) {
        let input = Input::open(Source::Bytes {
            name: "t",
            bytes: b"",
        })
        .expect("bytes");
        let mut collector = Collector::new(options);
        for &p in points {
            collector.offer(p);
        }
        let mut report = ReadReport::new("test", "t".into());
        let cloud = collector
            .finish(&input, options, &mut report)
            .expect("no faces");
        (cloud, report)
    }

    #[test]
    fn metres_and_millimetres_stay_and_utm_moves() {
        let near = [[500.0, 20.0, 0.0], [550.0, 30.0, 5.0]];
        assert_eq!(collect(&near, &ReadOptions::default()).0.origin, [0.0; 3]);
        let utm = [
            [665_187.522077, 5_648_349.895035, 241.767693],
            [665_167.5, 5_648_300.25, 228.0],
        ];
        let (cloud, _) = collect(&utm, &ReadOptions::default());
        assert_eq!(cloud.origin, [665_180.0, 5_648_330.0, 0.0]);
        assert_eq!([cloud.absolute(0), cloud.absolute(1)], utm);
        let stay = ReadOptions {
            recenter: false,
            ..Default::default()
        };
        assert_eq!(collect(&utm, &stay).0.origin, [0.0; 3]);
        assert_eq!(
            collect(&[[1e6, 1.0, 2.0]], &ReadOptions::default())
                .0
                .origin,
            [0.0; 3],
            "one point has no extent"
        );
    }

    proptest! {
        #[test]
        fn nothing_is_lost_by_moving(center in prop::array::uniform3(-1e7..1e7), offsets in prop::collection::vec(prop::array::uniform3(-1.0..1.0), 2..20)) {
            let points: Vec<Point3> = offsets.iter().map(|o| std::array::from_fn(|k| center[k] + o[k])).collect();
            let (cloud, _) = collect(&points, &ReadOptions::default());
            for (i, p) in points.iter().enumerate() {
                prop_assert_eq!(cloud.absolute(i), *p);
            }
        }
    }

    #[test]
    fn samples_are_uniform_in_order_and_repeatable() {
        let points: Vec<Point3> = (0..1000).map(|i| [f64::from(i), 0.0, 0.0]).collect();
        let mut hits = [0_u32; 10];
        for seed in 0..400 {
            let options = ReadOptions {
                max_points: Some(100),
                seed,
                ..Default::default()
            };
            let (cloud, report) = collect(&points, &options);
            assert_eq!(cloud.points.len(), 100);
            assert!(report.subsampled && report.rows == 1000);
            assert!(cloud.points.is_sorted_by(|a, b| a[0] < b[0]));
            assert_eq!(cloud, collect(&points, &options).0);
            for p in &cloud.points {
                hits[p[0] as usize / 100] += 1;
            }
        }
        // 4000 expected per tenth, standard deviation 57 (hypergeometric); six standard deviations
        // allowed.
        assert!(hits.iter().all(|&h| h.abs_diff(4000) < 342), "{hits:?}");
    }

    #[test]
    fn extremes_do_not_break_it() {
        let huge = [
            [f64::MAX, f64::MAX, 0.0],
            [-f64::MAX, 1.0, f64::MIN_POSITIVE],
            [f64::NAN, 0.0, 0.0],
            [0.0, f64::INFINITY, 0.0],
        ];
        let (cloud, report) = collect(&huge, &ReadOptions::default());
        assert_eq!(
            (cloud.points.len(), report.dropped_points, cloud.origin),
            (2, 2, [0.0; 3])
        );
        assert_eq!(
            collect(
                &huge,
                &ReadOptions {
                    max_points: Some(0),
                    ..Default::default()
                }
            )
            .0
            .points
            .len(),
            0
        );
    }
}
