//! Round trips are exact to the bit, and files are replaced atomically.

use isoform_geom::{Column, Point3, PointCloud};
use isoform_io::{ReadOptions, Source, WriteOptions, read, write, write_atomic, write_path};
use proptest::prelude::*;
use std::path::PathBuf;

/// Generates numbers of all magnitudes, and small integers, which produce ties.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        prop::num::f64::NORMAL
            | prop::num::f64::SUBNORMAL
            | prop::num::f64::ZERO
            | prop::num::f64::POSITIVE
            | prop::num::f64::NEGATIVE,
        (-1000..1000_i32).prop_map(f64::from),
        -1e3..1e3,
    ]
}

fn unit() -> impl Strategy<Value = Point3> {
    (0.0..std::f64::consts::TAU, -1.0..1.0).prop_map(|(a, z): (f64, f64)| {
        let r = (1.0 - z * z).sqrt();
        [r * a.cos(), r * a.sin(), z]
    })
}

fn cloud() -> impl Strategy<Value = PointCloud> {
    (
        1..20_usize,
        any::<bool>(),
        any::<bool>(),
        any::<bool>(),
        0..4_usize,
    )
        .prop_flat_map(|(n, normals, colors, mesh, columns)| {
            let column = (
                prop::sample::select(vec![
                    "a", "quality", "b c", "", "x", "nx", "red", "7", "ü", "a,b",
                ]),
                prop::collection::vec(number(), n),
            );
            (
                prop::collection::vec(prop::array::uniform3(number()), n),
                prop::collection::vec(unit(), if normals { n } else { 0 }),
                // The first colour distinguishes bytes from fractions.
                prop::collection::vec(any::<[u8; 3]>(), if colors { n } else { 0 }),
                prop::collection::vec(prop::array::uniform3(0..n as u32), if mesh { 5 } else { 0 }),
                prop::collection::vec(column, columns),
            )
                .prop_map(|(points, normals, mut colors, triangles, columns)| {
                    if let Some(c) = colors.first_mut() {
                        c[0] = 255;
                    }
                    let columns = columns
                        .into_iter()
                        .map(|(name, values)| Column {
                            name: name.into(),
                            values,
                        })
                        .collect();
                    PointCloud {
                        points,
                        normals,
                        colors,
                        triangles,
                        columns,
                        ..PointCloud::default()
                    }
                })
        })
}

fn through(cloud: &PointCloud, format: &str, ascii: bool) -> PointCloud {
    let mut bytes = Vec::new();
    write(
        cloud,
        &mut bytes,
        format,
        &WriteOptions {
            ascii,
            units: Some("mm".into()),
        },
    )
    .expect("memory takes all");
    let (again, report) = read(
        Source::Bytes {
            name: "-",
            bytes: &bytes,
        },
        Some(format),
        &ReadOptions::default(),
    )
    .expect("own files are valid");
    if format != "csv" {
        assert_eq!(report.units.as_deref(), Some("mm"));
    }
    again
}

proptest! {
    #[test]
    fn bit_by_bit(cloud in cloud()) {
        for (format, ascii) in [("ply", false), ("ply", true), ("xyz", false), ("csv", false)] {
            let again = through(&cloud, format, ascii);
            let absolute: Vec<Point3> = (0..again.points.len()).map(|i| again.absolute(i)).collect();
            prop_assert_eq!(&absolute, &cloud.points);
            prop_assert_eq!(&again.normals, &cloud.normals);
            prop_assert_eq!(&again.colors, &cloud.colors);
            if format == "ply" {
                prop_assert_eq!(&again.triangles, &cloud.triangles);
            }
            let values = |c: &PointCloud| c.columns.iter().map(|c| c.values.clone()).collect::<Vec<_>>();
            prop_assert_eq!(values(&again), values(&cloud));
            // Names no longer change after the first round trip.
            let names = |c: &PointCloud| c.columns.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
            prop_assert_eq!(names(&through(&again, format, ascii)), names(&again));
        }
    }

    #[test]
    fn samples_are_rows_of_the_file(n in 1..200_usize, k in 0..250_usize, seed in any::<u64>()) {
        let points: Vec<Point3> = (0..n).map(|i| [i as f64, 0.0, 1.0]).collect();
        let columns = vec![Column { name: "row".into(), values: (0..n).map(|i| i as f64).collect() }];
        let mut bytes = Vec::new();
        let cloud = PointCloud { points, columns, ..PointCloud::default() };
        write(&cloud, &mut bytes, "ply", &WriteOptions::default()).expect("memory takes all");
        let options = ReadOptions { max_points: Some(k), seed, ..ReadOptions::default() };
        let (part, report) = read(Source::Bytes { name: "t.ply", bytes: &bytes }, None, &options).expect("valid");
        prop_assert_eq!(part.points.len(), n.min(k));
        prop_assert_eq!(report.subsampled, k < n);
        prop_assert!(part.points.is_sorted_by(|a, b| a[0] < b[0]));
        for (p, row) in part.points.iter().zip(&part.columns[0].values) {
            prop_assert_eq!(p[0], *row);
        }
    }
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("isoform-io-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    folder
}

#[test]
fn a_failed_write_leaves_the_old_file() {
    let folder = folder("atomic");
    let path = folder.join("a.ply");
    let cloud = PointCloud::from_points(vec![[1.0, 2.0, 3.0]]);
    write_path(&cloud, &path, None, &WriteOptions::default()).expect("written");
    let before = std::fs::read(&path).expect("there");
    let e = write_atomic(&path, |out| {
        out.write_all(&[0; 1 << 20])?;
        Err(std::io::Error::from(std::io::ErrorKind::StorageFull))
    });
    assert_eq!(e.expect_err("full").code, "disk-full");
    assert_eq!(std::fs::read(&path).expect("there"), before);
    assert_eq!(
        std::fs::read_dir(&folder).expect("a folder").count(),
        1,
        "no litter"
    );
    let two = PointCloud::from_points(vec![[0.0; 3], [1.0; 3]]);
    write_path(&two, &path, None, &WriteOptions::default()).expect("replaced");
    assert_eq!(
        read(Source::Path(&path), None, &ReadOptions::default())
            .expect("valid")
            .0
            .points
            .len(),
        2
    );
    std::fs::remove_dir_all(&folder).expect("removed");
}

#[test]
fn refusals_of_writing() {
    let folder = folder("refusals");
    let cloud = PointCloud {
        triangles: vec![[0, 0, 0]],
        ..PointCloud::from_points(vec![[0.0; 3]])
    };
    let code = |name: &str| {
        write_path(&cloud, &folder.join(name), None, &WriteOptions::default()).map_err(|e| e.code)
    };
    assert_eq!(code("a.las").expect_err("not written"), "format-unknown");
    assert_eq!(code("a").expect_err("no ending"), "format-unknown");
    assert_eq!(code("none/a.ply").expect_err("no folder"), "not-writable");
    assert_eq!(code("a.xyz").expect("written").warnings.len(), 1);
    std::fs::create_dir(folder.join("d.ply")).expect("made");
    assert_eq!(code("d.ply").expect_err("a folder"), "not-writable");
    assert_eq!(
        read(Source::Path(&folder), None, &ReadOptions::default())
            .expect_err("a folder")
            .code(),
        "file-unreadable"
    );
    assert_eq!(
        read(
            Source::Path(&folder.join("no.ply")),
            None,
            &ReadOptions::default()
        )
        .expect_err("missing")
        .code(),
        "file-unreadable"
    );
    std::fs::remove_dir_all(&folder).expect("removed");
}

#[cfg(target_os = "linux")]
#[test]
fn devices_are_written_directly() {
    let cloud = PointCloud::from_points(vec![[0.0; 3]; 10_000]);
    let options = WriteOptions::default();
    write_path(&cloud, "/dev/null".as_ref(), Some("ply"), &options).expect("takes all");
    let e =
        write_path(&cloud, "/dev/full".as_ref(), Some("ply"), &options).expect_err("takes nothing");
    assert_eq!(e.code, "disk-full");
}

#[cfg(unix)]
#[test]
fn a_link_stays_a_link() {
    let folder = folder("link");
    let cloud = PointCloud::from_points(vec![[0.0; 3]]);
    write_path(
        &cloud,
        &folder.join("a.ply"),
        None,
        &WriteOptions::default(),
    )
    .expect("written");
    std::os::unix::fs::symlink(folder.join("a.ply"), folder.join("b.ply")).expect("linked");
    write_path(
        &PointCloud::default(),
        &folder.join("b.ply"),
        None,
        &WriteOptions::default(),
    )
    .expect("written");
    assert!(folder.join("b.ply").is_symlink());
    assert!(
        read(
            Source::Path(&folder.join("a.ply")),
            None,
            &ReadOptions::default()
        )
        .expect("valid")
        .0
        .points
        .is_empty()
    );
    std::fs::remove_dir_all(&folder).expect("removed");
}
