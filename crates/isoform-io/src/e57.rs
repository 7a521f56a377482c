//! E57 (ASTM E2807) through the crate `e57` (feature `e57`): all scans of the file in one frame,
//! with their poses applied.
//!
//! The unit of E57 is the metre. This module guards against two weaknesses of the crate: a file
//! whose fields all have zero bits would yield endless points, and a panic is caught and reported
//! as damage.

use crate::format::Sniff;
use crate::input::{Input, Result};
use crate::{ReadOptions, ReadReport};
use isoform_geom::PointCloud;

/// Returns `Yes` for the signature of E57.
pub(crate) fn sniff(head: &[u8]) -> Sniff {
    if head.starts_with(b"ASTM-E57") {
        Sniff::Yes
    } else {
        Sniff::No
    }
}

/// Returns an error: this build lacks a reader of E57.
#[cfg(not(feature = "e57"))]
pub(crate) fn read(
    input: &mut Input<'_>,
    _: &ReadOptions,
    _: &mut ReadReport,
) -> Result<PointCloud> {
    let (kind, at) = (crate::ErrorKind::UnsupportedFormat, crate::At::File);
    let hint = "convert it to PLY or LAS, or use a build with the feature e57";
    Err(input.error(
        kind,
        at,
        "cannot read the E57 file",
        "this build does not read E57",
        hint,
    ))
}

#[cfg(feature = "e57")]
pub(crate) use with_crate::read;

#[cfg(feature = "e57")]
mod with_crate {
    use super::*;
    use crate::collect::{Collector, ColorScale};
    use crate::roles::{Role, RowLayout};
    use crate::{At, ErrorKind, ReadError};
    use e57::{E57Reader, Error, RecordDataType, RecordName, RecordValue};
    use isoform_geom::Point3;
    use std::io::BufReader;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// Maximum number of fields of a point; the standard defines about 20.
    const MAX_POINT_FIELDS: usize = 256;

    /// Meaning of a field.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum PointField {
        /// x, y or z.
        Cartesian(usize),
        /// Range, azimuth or elevation.
        Spherical(usize),
        /// Flag; not 0 if the coordinates are invalid.
        Invalid,
        /// Component of the normal.
        Normal(usize),
        /// Red, green or blue.
        Color(usize),
        /// Intensity of the echo.
        Intensity,
        /// Any field that a cloud does not keep.
        Other,
    }

    /// Returns the meaning of a field, by its name in the standard or in the extension for normals.
    fn field(name: &RecordName) -> PointField {
        match name {
            RecordName::CartesianX => PointField::Cartesian(0),
            RecordName::CartesianY => PointField::Cartesian(1),
            RecordName::CartesianZ => PointField::Cartesian(2),
            RecordName::SphericalRange => PointField::Spherical(0),
            RecordName::SphericalAzimuth => PointField::Spherical(1),
            RecordName::SphericalElevation => PointField::Spherical(2),
            RecordName::CartesianInvalidState | RecordName::SphericalInvalidState => {
                PointField::Invalid
            }
            RecordName::ColorRed => PointField::Color(0),
            RecordName::ColorGreen => PointField::Color(1),
            RecordName::ColorBlue => PointField::Color(2),
            RecordName::Intensity => PointField::Intensity,
            // Extension http://www.libe57.org/E57_NOR_surface_normals.txt.
            RecordName::Unknown { name, .. } => match name.as_str() {
                "normalX" => PointField::Normal(0),
                "normalY" => PointField::Normal(1),
                "normalZ" => PointField::Normal(2),
                _ => PointField::Other,
            },
            _ => PointField::Other,
        }
    }

    /// Reads all scans of the file as one cloud in metres. A panic in the crate `e57` becomes an
    /// error.
    pub(crate) fn read(
        input: &mut Input<'_>,
        options: &ReadOptions,
        report: &mut ReadReport,
    ) -> Result<PointCloud> {
        report.units = Some("m".into());
        let mut collector = Collector::new(options);
        let outcome = {
            let stream = BufReader::new(input.stream());
            catch_unwind(AssertUnwindSafe(|| scans(stream, &mut collector, report)))
        };
        let failed = |kind, why: String, hint| ReadError {
            kind,
            what: "cannot read the E57 file",
            place: input.place(At::File),
            why,
            hint,
        };
        match outcome {
            Ok(Ok(())) => collector.finish(input, options, report),
            Ok(Err(e)) => {
                let kind = match e {
                    Error::NotImplemented { .. } => ErrorKind::UnsupportedFormat,
                    _ => ErrorKind::Corrupt,
                };
                Err(failed(
                    kind,
                    explain(&e),
                    "get the file again; if it opens elsewhere, save it as LAS or PLY",
                ))
            }
            Err(_) => Err(failed(
                ErrorKind::Corrupt,
                "its content contradicts itself".into(),
                "get the file again",
            )),
        }
    }

    /// Formats an error with its causes in one line.
    fn explain(e: &Error) -> String {
        let mut why = e.to_string();
        let mut cause = std::error::Error::source(e);
        while let Some(c) = cause {
            let text = c.to_string();
            if !why.contains(&text) {
                why = format!("{why}: {text}");
            }
            cause = c.source();
        }
        why
    }

    /// Returns the error for an inconsistent file.
    fn invalid(desc: &str) -> Error {
        Error::Invalid {
            desc: desc.into(),
            source: None,
        }
    }

    /// Offers the points of all scans, with their poses applied, to the collector.
    fn scans<T: std::io::Read + std::io::Seek>(
        stream: T,
        collector: &mut Collector,
        report: &mut ReadReport,
    ) -> std::result::Result<(), Error> {
        let mut reader = E57Reader::new(stream)?;
        let scans = reader.pointclouds();
        let declared = scans.iter().map(|s| s.records);
        report.declared = Some(declared.fold(0_u64, u64::saturating_add));
        let all: Vec<PosedScan> = scans
            .iter()
            .zip(0..)
            .map(PosedScan::from_numbered)
            .collect();
        let layout = layout(&all, report);
        let mut rows = ScanRows::new(layout, collector);
        for scan in all.iter().filter(|s| s.cloud.records > 0) {
            if scan.fields.len() > MAX_POINT_FIELDS || !scan.has_bits() {
                return Err(invalid(
                    "the points have no fields that hold data, or too many",
                ));
            }
            for raw in reader.pointcloud_raw(scan.cloud)? {
                rows.offer(&scan.values(&raw?)?, collector);
            }
        }
        Ok(())
    }

    /// Returns the values of a point: the union over all scans.
    fn layout(scans: &[PosedScan<'_>], report: &mut ReadReport) -> RowLayout {
        let any = |f: fn(&PointField) -> bool| scans.iter().flat_map(|s| &s.fields).any(f);
        let mut names = vec!["x", "y", "z"];
        if any(|f| matches!(f, PointField::Normal(_))) {
            names.extend(["nx", "ny", "nz"]);
        }
        if any(|f| matches!(f, PointField::Color(_))) {
            names.extend(["red", "green", "blue"]);
        }
        if any(|f| matches!(f, PointField::Intensity)) {
            names.push("intensity");
        }
        if scans.len() > 1 {
            names.push("scan");
            report.warn(format!(
                "{} scans were put together; the column \"scan\" tells them apart",
                scans.len()
            ));
        }
        let mut layout = RowLayout::named(names);
        layout.scale = Some(ColorScale::Byte);
        layout
    }

    /// Scan of the file with the data needed for its points.
    struct PosedScan<'s> {
        /// Scan as read by the crate `e57`.
        cloud: &'s e57::PointCloud,
        /// Index of the scan, from 0.
        number: u32,
        /// Meaning of each field of a record.
        fields: Vec<PointField>,
        /// Transformation from the frame of the scan to that of the file.
        pose: ScanPose,
        /// Minimum and maximum of each colour component.
        colors: [(f64, f64); 3],
    }

    /// Values of a point, in the frame of the file.
    struct PointValues {
        point: Point3,
        normal: Point3,
        color: [f64; 3],
        intensity: f64,
        scan: f64,
    }

    impl<'s> PosedScan<'s> {
        /// Prepares a scan, given with its index in the file.
        fn from_numbered((cloud, number): (&'s e57::PointCloud, u32)) -> Self {
            Self {
                cloud,
                number,
                fields: cloud.prototype.iter().map(|r| field(&r.name)).collect(),
                pose: ScanPose::from_scan(cloud),
                colors: color_ranges(cloud),
            }
        }
        /// Returns true if at least one field takes up space in the file.
        fn has_bits(&self) -> bool {
            self.cloud.prototype.iter().any(|r| has_bits(&r.data_type))
        }
        /// Decodes the values of a point from its record.
        fn values(&self, raw: &[RecordValue]) -> std::result::Result<PointValues, Error> {
            let (mut cartesian, mut spherical) = ([f64::NAN; 3], [f64::NAN; 3]);
            let (mut normal, mut color) = ([0.0; 3], [0.0; 3]);
            let (mut intensity, mut is_invalid) = (f64::NAN, false);
            for (i, f) in self.fields.iter().enumerate() {
                let value = || raw[i].to_f64(&self.cloud.prototype[i].data_type);
                match *f {
                    PointField::Cartesian(k) => cartesian[k] = value()?,
                    PointField::Spherical(k) => spherical[k] = value()?,
                    PointField::Invalid => is_invalid |= value()? != 0.0,
                    PointField::Normal(k) => normal[k] = value()?,
                    PointField::Color(k) => {
                        let (dark, bright) = self.colors[k];
                        color[k] = (value()? - dark) / (bright - dark) * 255.0;
                    }
                    PointField::Intensity => intensity = value()?,
                    PointField::Other => {}
                }
            }
            let point = if is_invalid {
                [f64::NAN; 3]
            } else if cartesian.iter().all(|v| v.is_finite()) {
                cartesian
            } else {
                from_spherical(spherical)
            };
            Ok(PointValues {
                point: self.pose.point(point),
                normal: self.pose.rotate(normal),
                color,
                intensity,
                scan: f64::from(self.number),
            })
        }
    }

    /// Offers points as rows of a layout.
    struct ScanRows {
        layout: RowLayout,
        /// True if a scan has intensities; they precede the index of the scan.
        has_intensity: bool,
        /// Present row.
        row: Vec<f64>,
    }

    impl ScanRows {
        /// Announces a layout to the collector.
        fn new(mut layout: RowLayout, collector: &mut Collector) -> Self {
            layout.announce(collector);
            Self {
                has_intensity: layout.columns.iter().any(|c| c == "intensity"),
                row: vec![0.0; layout.roles.len()],
                layout,
            }
        }
        /// Offers a point; values that only other scans have are NaN.
        fn offer(&mut self, values: &PointValues, collector: &mut Collector) {
            let columns = [values.intensity, values.scan];
            let mut columns = columns.into_iter().skip(usize::from(!self.has_intensity));
            for (v, role) in self.row.iter_mut().zip(&self.layout.roles) {
                *v = match *role {
                    Role::Position(k) => values.point[k],
                    Role::Normal(k) => values.normal[k],
                    Role::Color(k) => values.color[k],
                    _ => columns.next().unwrap_or(f64::NAN),
                };
            }
            self.layout.offer(collector, &self.row);
        }
    }

    /// Returns true if a field takes up space in the file: an integer with equal limits takes none.
    fn has_bits(kind: &RecordDataType) -> bool {
        match kind {
            RecordDataType::Single { .. } | RecordDataType::Double { .. } => true,
            RecordDataType::ScaledInteger { min, max, .. }
            | RecordDataType::Integer { min, max } => min < max,
        }
    }

    /// Converts spherical coordinates: x = r cos ε cos θ, y = r cos ε sin θ, z = r sin ε.
    fn from_spherical([r, azimuth, elevation]: Point3) -> Point3 {
        let (se, ce) = elevation.sin_cos();
        let (sa, ca) = azimuth.sin_cos();
        [r * ce * ca, r * ce * sa, r * se]
    }

    /// Returns the range of each colour component: the stated limits, else those of its type.
    fn color_ranges(scan: &e57::PointCloud) -> [(f64, f64); 3] {
        std::array::from_fn(|k| {
            stated_range(scan, k)
                .or_else(|| range_of_type(scan, k))
                .filter(|(low, high)| low < high)
                .unwrap_or((0.0, 255.0))
        })
    }

    /// Returns the limits that a scan states for colour component k.
    fn stated_range(scan: &e57::PointCloud, k: usize) -> Option<(f64, f64)> {
        let limits = scan.color_limits.as_ref()?;
        let (low, high) = [
            (&limits.red_min, &limits.red_max),
            (&limits.green_min, &limits.green_max),
            (&limits.blue_min, &limits.blue_max),
        ][k];
        low.as_ref().map(number).zip(high.as_ref().map(number))
    }

    /// Returns a limit as a number; a scaled integer remains unscaled.
    fn number(v: &RecordValue) -> f64 {
        match v {
            RecordValue::Single(v) => f64::from(*v),
            RecordValue::Double(v) => *v,
            RecordValue::ScaledInteger(v) | RecordValue::Integer(v) => *v as f64,
        }
    }

    /// Returns the limits of the type of colour component k.
    fn range_of_type(scan: &e57::PointCloud, k: usize) -> Option<(f64, f64)> {
        let is_color = |name| field(name) == PointField::Color(k);
        let record = scan.prototype.iter().find(|r| is_color(&r.name))?;
        match &record.data_type {
            RecordDataType::Integer { min, max } => Some((*min as f64, *max as f64)),
            RecordDataType::Single { min, max } => min.map(f64::from).zip(max.map(f64::from)),
            RecordDataType::Double { min, max } => min.zip(*max),
            RecordDataType::ScaledInteger { .. } => None,
        }
    }

    /// Rigid motion p ↦ R p + t, with R from a unit quaternion.
    struct ScanPose {
        rotation: [Point3; 3],
        translation: Point3,
    }

    impl ScanPose {
        /// Returns the pose of a scan. The quaternion is normalised; for a zero quaternion R is the
        /// identity.
        fn from_scan(scan: &e57::PointCloud) -> Self {
            let t = scan.transform.clone().unwrap_or_default();
            let q = &t.rotation;
            let length = (q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z).sqrt();
            let [w, x, y, z] = if length > 0.0 {
                [q.w, q.x, q.y, q.z].map(|v| v / length)
            } else {
                [1.0, 0.0, 0.0, 0.0]
            };
            Self {
                rotation: [
                    [
                        1.0 - 2.0 * (y * y + z * z),
                        2.0 * (x * y - w * z),
                        2.0 * (x * z + w * y),
                    ],
                    [
                        2.0 * (x * y + w * z),
                        1.0 - 2.0 * (x * x + z * z),
                        2.0 * (y * z - w * x),
                    ],
                    [
                        2.0 * (x * z - w * y),
                        2.0 * (y * z + w * x),
                        1.0 - 2.0 * (x * x + y * y),
                    ],
                ],
                translation: [t.translation.x, t.translation.y, t.translation.z],
            }
        }
        /// Returns R p, the image of a direction.
        fn rotate(&self, p: Point3) -> Point3 {
            self.rotation
                .map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2])
        }
        /// Returns R p + t, the image of a point.
        fn point(&self, p: Point3) -> Point3 {
            let q = self.rotate(p);
            std::array::from_fn(|k| q[k] + self.translation[k])
        }
    }
}
