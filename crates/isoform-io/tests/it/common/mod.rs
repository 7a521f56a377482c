//! Small valid files of every format, created in memory, and a cloud that most of them contain.

pub(crate) mod cube;
pub(crate) mod damage;
pub(crate) mod layers;
pub(crate) mod meshes;
pub(crate) mod package;

use isoform_geom::{Column, PointCloud};
use std::io::Cursor;

/// Name with the usual ending, and content of a file.
pub(crate) type Fixture = (&'static str, Vec<u8>);

/// Returns a tetrahedron with normals, colours and a column.
pub(crate) fn cloud() -> PointCloud {
    PointCloud {
        points: vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.25, 1.5],
        ],
        normals: vec![
            [0.0, 0.0, -1.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.6, 0.0, 0.8],
        ],
        colors: vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 8, 7]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        columns: vec![Column {
            name: "quality".into(),
            values: vec![0.1, -2.0, 1e300, 5e-324],
        }],
        ..PointCloud::default()
    }
}

/// Returns one file per format and variant.
pub(crate) fn fixtures() -> Vec<Fixture> {
    let written = |format: &str, ascii: bool| {
        let mut bytes = Vec::new();
        let options = isoform_io::WriteOptions {
            ascii,
            ..Default::default()
        };
        isoform_io::write(&cloud(), &mut bytes, format, &options).expect("memory takes all");
        bytes
    };
    let mut all: Vec<Fixture> = vec![
        ("ascii.ply", written("ply", true)),
        ("little.ply", written("ply", false)),
        ("big.ply", big_endian_ply()),
        ("strips.ply", b"ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty list uchar float w\nend_header\n5 0 1 2 -1 3\n0 0 0 1 5\n1 0 0 0\n0 1 0 0\n1 1 1 0\n".to_vec()),
        ("named.xyz", written("xyz", false)),
        ("bare.txt", b"0 0 0 255 0 7\n1 2 3 255 1 7\n4 5 6 255 2 7\n".to_vec()),
        ("comma.asc", b"1,5;2;3,25;0,6;0,8;0\n4;5;6;0;0;1\n".to_vec()),
        ("count.pts", b"2\n1 2 3 -5 10 20 30\n4 5 6 -6 11 20 30\n".to_vec()),
        ("named.csv", written("csv", false)),
        ("mesh.obj", b"# u\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvn 0 0 1\nf 1//1 2//1 -1//-1\n".to_vec()),
        ("mesh.off", b"COFF # c\n4 2 0\n0 0 0 255 0 0 1\n1 0 0 0 9 0 1\n0 1 0 0 0 0 1\n1 1 1 0 0 0 1\n4 0 1 2 3 1 0 0\n3 0 1 3\n".to_vec()),
        ("text.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\nsolid\nendsolid\n".to_vec()),
        ("binary.stl", binary_stl()),
        ("stored.3mf", package::built(&package::tetrahedron(1))),
    ];
    all.extend(pcd());
    for format in [0, 3] {
        all.push((
            if format == 0 { "zero.las" } else { "three.las" },
            las_file(format, false, 40),
        ));
    }
    all.push(("six.las", las_file(6, false, 40)));
    if cfg!(feature = "laz") {
        all.push(("three.laz", las_file(3, true, 40)));
        all.push(("seven.laz", las_file(7, true, 40)));
    }
    #[cfg(feature = "e57")]
    all.push(("scan.e57", e57_file()));
    all
}

fn big_endian_ply() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\ncomment units: mm\nelement vertex 4\nproperty float x\nproperty double y\nproperty int z\n\
        property ushort red\nproperty ushort green\nproperty ushort blue\nelement face 1\nproperty list uint ushort vertex_index\nproperty char q\n\
        element rest 2\nproperty double w\nend_header\n"
        .to_vec();
    for i in 0..4_u16 {
        bytes.extend(f32::from(i).to_be_bytes());
        bytes.extend(f64::from(i * i).to_be_bytes());
        bytes.extend(i32::from(i % 2).to_be_bytes());
        [i, 1000 * i, 65535]
            .iter()
            .for_each(|c| bytes.extend(c.to_be_bytes()));
    }
    bytes.extend(4_u32.to_be_bytes());
    (0..4_u16).for_each(|i| bytes.extend(i.to_be_bytes()));
    bytes.push(5);
    bytes.extend([0; 16]);
    bytes
}

fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![b'-'; 80];
    bytes.extend(2_u32.to_le_bytes());
    for f in [
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0],
    ] {
        bytes.extend([0; 12]);
        f.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn pcd() -> [Fixture; 3] {
    let head = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb label\nSIZE 4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 1 1\n\
        WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ";
    let values = [[1.0_f32, 2.0, 3.0], [f32::NAN, 0.0, 0.0], [4.0, 5.0, 6.0]];
    let ascii = format!("{head}ascii\n1 2 3 4.2108e+06 7\nnan 0 0 0 8\n4 5 6 0 9\n");
    let mut binary = format!("{head}binary\n").into_bytes();
    for (i, p) in values.iter().enumerate() {
        p.iter().for_each(|v| binary.extend(v.to_le_bytes()));
        binary.extend(0x0040_8020_u32.to_le_bytes());
        binary.extend((i as u16).to_le_bytes());
    }
    let mut fields = Vec::new();
    for k in 0..3 {
        values
            .iter()
            .for_each(|p| fields.extend(p[k].to_le_bytes()));
    }
    (0..3).for_each(|_| fields.extend(0x0040_8020_u32.to_le_bytes()));
    fields.extend([1, 0, 2, 0, 3, 0]);
    // A literal run, a copy of the last colour, the labels.
    let mut packed = vec![31];
    packed.extend(&fields[..32]);
    packed.push(7);
    packed.extend(&fields[32..40]);
    packed.extend([0x40, 3]);
    packed.extend([0x40 - 0x20, 3]);
    let mut check = fields[..40].to_vec();
    for n in [4, 3] {
        (0..n).for_each(|_| check.push(check[check.len() - 4]));
    }
    let rest = fields.len() - 47;
    packed.push(rest as u8 - 1);
    packed.extend(&fields[47..]);
    assert!(
        check[..] == fields[..47],
        "the copies are what the fields say"
    );
    let mut compressed = format!("{head}binary_compressed\n").into_bytes();
    compressed.extend((packed.len() as u32).to_le_bytes());
    compressed.extend((fields.len() as u32).to_le_bytes());
    compressed.extend(packed);
    [
        ("ascii.pcd", ascii.into_bytes()),
        ("binary.pcd", binary),
        ("packed.pcd", compressed),
    ]
}

/// Returns a file of `n` points written by the crate `las`.
pub(crate) fn las_file(format: u8, compressed: bool, n: usize) -> Vec<u8> {
    las_file_of(format, compressed, (0..n).map(|i| las_point(format, i)))
}

/// Returns a file of the given points written by the crate `las`.
pub(crate) fn las_file_of(
    format: u8,
    compressed: bool,
    points: impl Iterator<Item = las::Point>,
) -> Vec<u8> {
    let mut builder = las::Builder::from((1, if format >= 6 { 4 } else { 2 }));
    builder.point_format = las::point::Format::new(format).expect("known");
    builder.point_format.is_compressed = compressed;
    let transform = |offset| las::Transform {
        scale: 0.001,
        offset,
    };
    builder.transforms = las::Vector {
        x: transform(665_000.0),
        y: transform(5_648_000.0),
        z: transform(0.0),
    };
    let mut writer = las::Writer::new(
        Cursor::new(Vec::new()),
        builder.into_header().expect("valid"),
    )
    .expect("memory");
    for point in points {
        writer.write_point(point).expect("valid");
    }
    writer.into_inner().expect("closed").into_inner()
}

/// Returns point `i` of [`las_file`].
pub(crate) fn las_point(format: u8, i: usize) -> las::Point {
    let t = i as f64;
    las::Point {
        x: 665_187.5 + (t * 0.125) % 50.0,
        y: 5_648_349.25 - (t * 0.25) % 60.0,
        z: 240.0 + (t * 0.5) % 7.0,
        intensity: (i * 7 % 300) as u16,
        return_number: 1,
        number_of_returns: 1,
        gps_time: matches!(format, 1 | 3 | 6 | 7).then_some(t * 0.001),
        color: matches!(format, 2 | 3 | 7).then(|| las::Color {
            red: (i * 257) as u16,
            green: 65535,
            blue: 0,
        }),
        ..las::Point::default()
    }
}

/// Returns a file of a rotated and a spherical scan, written by the crate `e57`.
#[cfg(feature = "e57")]
pub(crate) fn e57_file() -> Vec<u8> {
    use e57::{
        E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform,
        Translation,
    };
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "file").expect("memory");
    let byte = RecordDataType::Integer { min: 0, max: 255 };
    let prototype = vec![
        Record::CARTESIAN_X_F64,
        Record::CARTESIAN_Y_F64,
        Record::CARTESIAN_Z_F64,
        Record {
            name: RecordName::ColorRed,
            data_type: byte.clone(),
        },
        Record {
            name: RecordName::ColorGreen,
            data_type: byte.clone(),
        },
        Record {
            name: RecordName::ColorBlue,
            data_type: byte,
        },
    ];
    let mut scan = writer.add_pointcloud("turned", prototype).expect("valid");
    // A quarter turn about z, then a translation by 10 along x.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    scan.set_transform(Some(Transform {
        rotation: Quaternion {
            w: half,
            x: 0.0,
            y: 0.0,
            z: half,
        },
        translation: Translation {
            x: 10.0,
            y: 0.0,
            z: 0.0,
        },
    }));
    for i in 0..5_i64 {
        let xyz = [i as f64, 0.0, 1.0].map(RecordValue::Double);
        let rgb = [i, 255, 0].map(RecordValue::Integer);
        scan.add_point(xyz.into_iter().chain(rgb).collect())
            .expect("valid");
    }
    scan.finalize().expect("valid");
    let angle = |name| Record {
        name,
        data_type: RecordDataType::Double {
            min: None,
            max: None,
        },
    };
    let prototype = vec![
        angle(RecordName::SphericalRange),
        angle(RecordName::SphericalAzimuth),
        angle(RecordName::SphericalElevation),
        Record {
            name: RecordName::SphericalInvalidState,
            data_type: RecordDataType::Integer { min: 0, max: 2 },
        },
    ];
    let mut scan = writer
        .add_pointcloud("spherical", prototype)
        .expect("valid");
    for invalid in [0, 2] {
        let values = [2.0, std::f64::consts::FRAC_PI_2, 0.0].map(RecordValue::Double);
        scan.add_point(
            values
                .into_iter()
                .chain([RecordValue::Integer(invalid)])
                .collect(),
        )
        .expect("valid");
    }
    scan.finalize().expect("valid");
    writer.finalize().expect("valid");
    drop(writer);
    file.into_inner()
}

/// Corrects the checksums of all pages (CRC-32C, big endian), so that damage passes their
/// verification.
pub(crate) fn mend_e57(bytes: &mut [u8]) {
    for page in bytes.chunks_exact_mut(1024) {
        let mut crc = !0_u32;
        for &b in &page[..1020] {
            crc ^= u32::from(b);
            for _ in 0..8 {
                crc = crc >> 1 ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 };
            }
        }
        page[1020..].copy_from_slice(&(!crc).to_be_bytes());
    }
}
