//! Tests of every format on small files created in memory, on files of other programs in
//! tests/data/formats, and on scans if they are available.

use crate::common;
use isoform_geom::PointCloud;
use isoform_io::{MeshPoints, ReadError, ReadOptions, ReadReport, Source, inspect, read};

fn read_bytes(name: &str, bytes: &[u8]) -> Result<(PointCloud, ReadReport), ReadError> {
    read(Source::Bytes { name, bytes }, None, &ReadOptions::default())
}

#[test]
fn every_fixture_reads_and_is_recognised_without_its_name() {
    for (name, bytes) in common::fixtures() {
        let (cloud, report) = read_bytes(name, &bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(cloud.points.len() >= 2, "{name}");
        let arrays = [cloud.normals.len(), cloud.colors.len()]
            .into_iter()
            .chain(cloud.columns.iter().map(|c| c.values.len()));
        assert!(
            arrays
                .into_iter()
                .all(|n| n == 0 || n == cloud.points.len()),
            "{name}"
        );
        assert!(
            cloud
                .triangles
                .iter()
                .flatten()
                .all(|&i| (i as usize) < cloud.points.len()),
            "{name}"
        );
        let seen = inspect(&cloud, &report);
        assert_eq!(
            seen.rows,
            seen.points as u64 + seen.dropped_points,
            "{name}"
        );
        // Binary STL has no signature.
        if name != "binary.stl" {
            let (again, unnamed) =
                read_bytes("-", &bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
            let family = |f: &'static str| if f == "csv" { "xyz" } else { f };
            assert_eq!(family(unnamed.format), family(report.format), "{name}");
            if name != "count.pts" {
                assert_eq!(again.points, cloud.points, "{name}");
            }
        }
    }
}

#[test]
fn fixtures_hold_what_was_put_in() {
    let files = common::fixtures();
    let of = |name: &str| {
        let (_, bytes) = files.iter().find(|f| f.0 == name).expect("in the list");
        read_bytes(name, bytes).expect("valid")
    };
    for name in ["ascii.ply", "little.ply"] {
        assert_eq!(of(name).0, common::cloud(), "{name}");
    }
    let (cloud, report) = of("big.ply");
    assert_eq!(
        (cloud.points[3], cloud.colors[3], report.units.as_deref()),
        ([3.0, 9.0, 1.0], [0, 12, 255], Some("mm"))
    );
    assert_eq!(cloud.triangles, [[0, 1, 2], [0, 2, 3]]);
    let without_triangles = PointCloud {
        triangles: vec![],
        ..common::cloud()
    };
    for name in ["named.xyz", "named.csv"] {
        assert_eq!(of(name).0, without_triangles, "{name}");
    }
    let (cloud, report) = of("packed.pcd");
    assert_eq!(cloud.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(
        (
            cloud.colors[1],
            cloud.columns[0].values[1],
            report.dropped_points
        ),
        ([0x40, 0x80, 0x20], 3.0, 1)
    );
}

#[test]
fn las_and_laz_agree_with_another_implementation() {
    for (format, compressed) in [
        (0, false),
        (1, false),
        (2, false),
        (3, false),
        (6, false),
        (7, false),
        (0, true),
        (3, true),
        (6, true),
        (7, true),
    ] {
        if compressed && !cfg!(feature = "laz") {
            continue;
        }
        let n = 60_000; // more than one chunk of LAZ
        let bytes = common::las_file(format, compressed, n);
        let (cloud, report) =
            read_bytes("t.las", &bytes).unwrap_or_else(|e| panic!("{format} {compressed}: {e}"));
        assert_eq!((cloud.points.len(), report.declared), (n, Some(n as u64)));
        assert_ne!(cloud.origin[1], 0.0, "UTM is moved");
        for i in [0, 1, 777, 50_001, n - 1] {
            let (p, want) = (cloud.absolute(i), common::las_point(format, i));
            for (got, want) in p.into_iter().zip([want.x, want.y, want.z]) {
                assert!(
                    (got - want).abs() < 1e-8,
                    "{format} {compressed} {i}: {got} {want}"
                );
            }
            let column = |name: &str| {
                cloud
                    .columns
                    .iter()
                    .find(|c| c.name == name)
                    .map(|c| c.values[i])
            };
            assert_eq!(column("intensity"), Some(f64::from(want.intensity)));
            // The times of newer LAZ are not decompressed.
            let time = if compressed && format >= 6 {
                None
            } else {
                want.gps_time
            };
            assert_eq!(column("gps_time"), time);
            if let Some(c) = want.color {
                let byte = |v: u16| (f64::from(v) / 257.0).round() as u8;
                assert_eq!(cloud.colors[i], [byte(c.red), 255, 0]);
            }
        }
    }
}

#[test]
fn withheld_points_and_noise_are_left_out() {
    use las::point::Classification;
    for format in [0, 1, 3, 6, 7] {
        for compressed in [false, true] {
            if compressed && !cfg!(feature = "laz") {
                continue;
            }
            let point = |i| {
                let mut point = common::las_point(format, i);
                point.is_withheld = i % 5 == 0;
                point.is_synthetic = i % 3 == 0;
                point.is_key_point = i % 4 == 0;
                point.classification = match i % 7 {
                    1 => Classification::LowPoint,
                    3 if format >= 6 => Classification::HighNoise,
                    _ => Classification::Ground,
                };
                point
            };
            let bytes = common::las_file_of(format, compressed, (0..700).map(point));
            let (cloud, report) = read_bytes("t.las", &bytes).expect("valid");
            let is_noise = |i: usize| i % 7 == 1 || (i % 7 == 3 && format >= 6);
            let kept: Vec<usize> = (0..700).filter(|&i| i % 5 != 0 && !is_noise(i)).collect();
            let noise = (0..700).filter(|&i| i % 5 != 0 && is_noise(i)).count();
            assert_eq!(cloud.points.len(), kept.len(), "{format} {compressed}");
            for (k, &i) in kept.iter().enumerate() {
                assert!((cloud.absolute(k)[0] - point(i).x).abs() < 1e-8);
            }
            let told = |part: &str| report.warnings.iter().any(|w| w.contains(part));
            assert!(
                told("140 of 700 points are flagged as withheld"),
                "{:?}",
                report.warnings
            );
            assert!(told(&format!(
                "{noise} of 700 points are classified as noise"
            )));
            // LAS 1.0 gives these bits no meaning.
            if format < 2 && !compressed {
                let mut old = bytes;
                old[25] = 0;
                assert_eq!(
                    read_bytes("t.las", &old).expect("valid").0.points.len(),
                    700
                );
            }
        }
    }
}

#[cfg(feature = "e57")]
#[test]
fn e57_poses_and_angles() {
    let (cloud, report) = read_bytes("t.e57", &common::e57_file()).expect("valid");
    assert_eq!(
        (
            cloud.points.len(),
            report.dropped_points,
            report.units.as_deref()
        ),
        (6, 1, Some("m"))
    );
    let near = |p: [f64; 3], q: [f64; 3]| (0..3).all(|k| (p[k] - q[k]).abs() < 1e-12);
    assert!(
        near(cloud.points[3], [10.0, 3.0, 1.0]),
        "{:?}",
        cloud.points[3]
    );
    assert!(
        near(cloud.points[5], [0.0, 2.0, 0.0]),
        "{:?}",
        cloud.points[5]
    );
    assert_eq!(cloud.colors[3], [3, 255, 0]);
    assert_eq!(
        cloud.columns.last().expect("scan").values,
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    );
}

#[test]
fn meshes_become_samples() {
    let (_, ply) = common::fixtures().swap_remove(0);
    let options = ReadOptions {
        mesh: MeshPoints::Samples(500),
        ..ReadOptions::default()
    };
    let source = || Source::Bytes {
        name: "a.ply",
        bytes: &ply,
    };
    let (cloud, report) = read(source(), None, &options).expect("valid");
    assert_eq!(
        (
            cloud.points.len(),
            cloud.normals.len(),
            cloud.triangles.len()
        ),
        (500, 500, 0)
    );
    assert!(report.subsampled);
    assert_eq!(cloud, read(source(), None, &options).expect("valid").0);
    let few = ReadOptions {
        max_points: Some(3),
        ..ReadOptions::default()
    };
    let (cloud, report) = read(source(), None, &few).expect("valid");
    assert_eq!(
        (cloud.points.len(), cloud.triangles.len(), report.subsampled),
        (3, 0, true)
    );
    assert_eq!(
        read(
            source(),
            None,
            &ReadOptions {
                max_points: Some(4),
                ..few
            }
        )
        .expect("valid")
        .0
        .triangles
        .len(),
        4
    );
}

/// Files of other programs in every format.
#[cfg(all(feature = "laz", feature = "e57"))]
mod foreign {
    use isoform_geom::PointCloud;
    use isoform_io::{ReadError, ReadOptions, ReadReport, Source, read};
    use isoform_testdata::{data, shared_data};
    use std::path::Path;

    fn load(path: &Path) -> (PointCloud, ReadReport) {
        read(Source::Path(path), None, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
    }

    /// File, number of points (or the code of the error), number of triangles.
#[rustfmt::skip]
const FOREIGN: &[(&str, Result<usize, &str>, usize)] = &[
    ("cube-e57-1.0-unmodified-valid.e57", Ok(8), 0),
    ("cube-e57-1.0-version_modified-invalid.e57", Err("file-corrupt"), 0),
    ("minimal-e57-1.0-unmodified-valid.e57", Ok(0), 0),
    ("cube-las-1.2-creation_date_and_crs_modified-valid.las", Ok(8), 0),
    ("cube-las-1.2-creation_date_and_crs_invalid-invalid.las", Ok(8), 0),
    ("minimal-las-1.2-unmodified-valid.las", Ok(1), 0),
    ("cube-ply-1.0_ascii-unmodified-unknown.ply", Ok(8), 0),
    ("cube-ply-1.0_binary-unmodified-unknown.ply", Ok(8), 0),
    ("cube-ply-1.0_ascii-comment_renamed_to_remark-invalid.ply", Ok(8), 0),
    ("cube-ply-1.0_binary-comment_renamed_to_remark-invalid.ply", Ok(8), 0),
    ("minimal-ply-1.0_ascii-unmodified-unknown.ply", Ok(0), 0),
    ("pynt_simple.las", Ok(1065), 0),
    ("pynt_simple.laz", Ok(1065), 0),
    ("pynt_has_offsets.las", Ok(20), 0),
    ("pynt_diamond_with_bool.ply", Ok(6), 0),
    ("pynt_diamond_color.obj", Ok(6), 8),
    ("pynt_diamond_color.off", Ok(6), 8),
    ("tm_points_agisoft.xyz", Ok(100), 0),
    ("tm_points_cloudcompare.xyz", Ok(101), 0),
    ("tm_points_ascii.ply", Ok(5), 0),
    ("tm_points_bin.ply", Ok(5), 0),
    ("tm_points_ascii_with_lists.ply", Ok(5), 0),
    ("tm_points_emptyface.ply", Ok(1024), 0),
    ("tm_points_emptyascii.ply", Ok(12), 0),
    ("tm_ply_empty_header.ply", Ok(0), 0),
    ("tm_stl_empty_bin.stl", Ok(0), 0),
    ("tm_soup.stl", Ok(300), 100),
    ("tm_multibody.stl", Ok(20), 32),
    ("tm_negative_indices.obj", Ok(8), 12),
    ("tm_comments.off", Ok(8), 12),
    ("tm_nancolor.obj", Ok(8), 12),
    ("tm_two_objects_mixed_case_names.stl", Ok(16), 24),
    ("tm_insulated.msh", Err("format-unsupported"), 0),
    ("tm_P_XPM_0331_01.3mf", Ok(5), 6),
    ("pyzip_parts.3mf", Ok(12), 12),
    ("pyzip_stored_zip64.3mf", Ok(12), 12),
];

    #[test]
    fn files_of_other_programs() {
        let mut wrong = Vec::new();
        let mut files = 0;
        for entry in std::fs::read_dir(data("formats")).expect("a folder") {
            let path = entry.expect("readable").path();
            let name = path
                .file_name()
                .and_then(|n| n.to_str())
                .expect("a name")
                .to_owned();
            files += 1;
            let Some((_, want, triangles)) = FOREIGN.iter().find(|s| s.0 == name) else {
                wrong.push(format!("{name} is not in the list"));
                continue;
            };
            let got = read(Source::Path(&path), None, &ReadOptions::default());
            let brief = got
                .as_ref()
                .map(|(c, _)| c.points.len())
                .map_err(ReadError::code);
            let faces = got.as_ref().map_or(0, |(c, _)| c.triangles.len());
            println!(
                "{name}: {brief:?} {:?}",
                got.as_ref()
                    .map(|(_, r)| &r.warnings)
                    .map_err(ToString::to_string)
            );
            if (brief, faces) != (*want, *triangles) {
                wrong.push(format!(
                    "{name}: {brief:?}, {faces} triangles: {:?}",
                    got.map(|(_, r)| r)
                ));
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
        assert_eq!(files, FOREIGN.len());
    }

    #[test]
    fn details_of_files_of_other_programs() {
        let load = |name: &str| load(&data("formats").join(name));
        let (agisoft, _) = load("tm_points_agisoft.xyz");
        assert_eq!(
            agisoft.absolute(0),
            [665_187.522077, 5_648_349.895035, 241.767693]
        );
        assert_eq!(agisoft.colors[0], [117, 73, 49]);
        assert!(agisoft.points.iter().flatten().all(|v| v.abs() < 300.0));
        let (compare, _) = load("tm_points_cloudcompare.xyz");
        assert_eq!(
            (compare.colors[0], compare.columns[0].name.as_str()),
            ([117, 73, 49], "alpha")
        );
        let (date, report) = load("cube-las-1.2-creation_date_and_crs_invalid-invalid.las");
        assert!(
            date.points.len() == 8 && report.warnings.iter().any(|w| w.contains("1980")),
            "{:?}",
            report.warnings
        );
        assert_eq!(
            load("cube-las-1.2-creation_date_and_crs_modified-valid.las")
                .1
                .units
                .as_deref(),
            Some("m")
        );
        let (_, report) = load("cube-ply-1.0_ascii-comment_renamed_to_remark-invalid.ply");
        assert!(report.warnings.iter().any(|w| w.contains("remark")));
        let (e57, _) = load("cube-e57-1.0-unmodified-valid.e57");
        assert_eq!(e57.normals.len(), 8);
        let (las, laz) = (load("pynt_simple.las").0, load("pynt_simple.laz").0);
        assert_eq!(las, laz);
        let (bool, _) = load("pynt_diamond_with_bool.ply");
        assert_eq!(bool.columns[0].name, "is_green");
    }

    /// Files too large for the repository.
    #[test]
    fn scans() {
        let Some(folder) = shared_data("data") else {
            return;
        };
        let load = |name: &str| load(&folder.join(name));
        let (mug, report) = load("scan/pcl_table_scene_mug_stereo.pcd");
        assert_eq!(
            (mug.points.len(), report.dropped_points),
            (209_280, 307_200 - 209_280)
        );
        let (kinect, _) = load("scan/osd_learn33_cylinders.pcd");
        assert_eq!(
            (kinect.points.len(), kinect.columns[0].name.as_str()),
            (179_131, "label")
        );
        for (name, points, faces) in [
            ("scan/pcl_lamppost.pcd", 1771, 0),
            ("scan/pcl_milk_carton.pcd", 12575, 0),
            ("scan/pcl_bun0_partial.pcd", 112_586, 0),
            ("scan/ycb_019_pitcher_base.ply", 8192, 16384),
            ("scan/gso_frypan.obj", 5086, 9320),
            ("cad/tm_plate_holes.STL", 618, 1252),
            ("formats/tm_busted.STL", 1941, 3878),
            ("cad/berger_anchor.off", 49200, 98412),
            ("cad/newell_teapot.obj", 3644, 6320),
            ("formats/tm_counterX.3MF", 4661, 8080),
            ("derived/osd_learn33_cylinders_obj2.xyz", 15305, 0),
        ] {
            let (cloud, report) = load(name);
            assert_eq!(
                (cloud.points.len(), cloud.triangles.len()),
                (points, faces),
                "{name}: {:?}",
                report.warnings
            );
        }
        let path = folder.join("cad/tm_featuretype.STEP");
        let e = read(Source::Path(&path), None, &ReadOptions::default());
        assert_eq!(e.expect_err("no points").code(), "format-unsupported");
    }
}
