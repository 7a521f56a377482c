//! Intermediate files of blocks, in little-endian binary.

use super::BlocksError;
use isoform_geom::{Aabb, Point3};
use isoform_io::write_atomic;
use isoform_mesh::blocks::{OpenFace, Plan, PlannedCurve, Tetrahedra};
use isoform_mesh::features::{Corner, CornerKind};
use std::io::{self, Write};
use std::path::Path;

/// Magic number, the first bytes of every file.
const MAGIC: &[u8; 8] = b"isoblk01";

/// Writes a file, whole or not at all.
fn write(
    path: &Path,
    content: impl FnOnce(&mut NumberWriter<'_>) -> io::Result<()>,
) -> Result<(), BlocksError> {
    write_atomic(path, |out| {
        out.write_all(MAGIC)?;
        content(&mut NumberWriter(out))
    })?;
    Ok(())
}

/// Writer of numbers.
struct NumberWriter<'w>(&'w mut dyn Write);

impl NumberWriter<'_> {
    fn count(&mut self, n: usize) -> io::Result<()> {
        self.0.write_all(&(n as u64).to_le_bytes())
    }
    fn floats(&mut self, values: &[f64]) -> io::Result<()> {
        let mut each = values.iter();
        each.try_for_each(|v| self.0.write_all(&v.to_le_bytes()))
    }
    fn indices(&mut self, values: &[u32]) -> io::Result<()> {
        let mut each = values.iter();
        each.try_for_each(|v| self.0.write_all(&v.to_le_bytes()))
    }
    fn points(&mut self, points: &[Point3]) -> io::Result<()> {
        self.count(points.len())?;
        self.floats(points.as_flattened())
    }
}

/// Reader of the numbers of a file.
struct NumberReader<'b> {
    rest: &'b [u8],
}

impl NumberReader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        Some(*head)
    }
    /// Reads a count of items of `bytes` bytes each; `None` if the file has fewer.
    fn count(&mut self, bytes: usize) -> Option<usize> {
        let n = usize::try_from(u64::from_le_bytes(self.take()?)).ok()?;
        (n.checked_mul(bytes)? <= self.rest.len()).then_some(n)
    }
    fn float(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }
    fn index(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }
    fn point(&mut self) -> Option<Point3> {
        Some([self.float()?, self.float()?, self.float()?])
    }
    fn four(&mut self) -> Option<[u32; 4]> {
        Some([self.index()?, self.index()?, self.index()?, self.index()?])
    }
    fn points(&mut self) -> Option<Vec<Point3>> {
        let n = self.count(24)?;
        (0..n).map(|_| self.point()).collect()
    }
    fn fours(&mut self, n: usize) -> Option<Vec<[u32; 4]>> {
        (0..n).map(|_| self.four()).collect()
    }
}

/// Reads a whole file with `content`.
fn read<T>(
    path: &Path,
    content: impl Fn(&mut NumberReader<'_>) -> Option<T>,
) -> Result<T, BlocksError> {
    let wrong = |why: String| BlocksError::Read {
        file: path.display().to_string(),
        why,
    };
    let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
    let rest = bytes.strip_prefix(MAGIC);
    let mut bytes = NumberReader {
        rest: rest.ok_or_else(|| wrong("it is of another version".to_owned()))?,
    };
    content(&mut bytes)
        .filter(|_| bytes.rest.is_empty())
        .ok_or_else(|| wrong("it is not whole".to_owned()))
}

pub(super) fn write_tetrahedra(path: &Path, all: &Tetrahedra) -> Result<(), BlocksError> {
    write(path, |out| {
        out.points(&all.points)?;
        out.count(all.tets.len())?;
        out.indices(all.tets.as_flattened())?;
        out.indices(all.labels.as_flattened())
    })
}

pub(super) fn read_tetrahedra(path: &Path) -> Result<Tetrahedra, BlocksError> {
    read(path, |bytes| {
        let points = bytes.points()?;
        let n = bytes.count(32)?;
        let (tets, labels) = (bytes.fours(n)?, bytes.fours(n)?);
        let mut nodes = tets.iter().flatten();
        nodes
            .all(|&v| (v as usize) < points.len())
            .then_some(Tetrahedra {
                points,
                tets,
                labels,
            })
    })
}

pub(super) fn write_faces(path: &Path, faces: &[OpenFace]) -> Result<(), BlocksError> {
    write(path, |out| {
        out.count(faces.len())?;
        faces.iter().try_for_each(|f| {
            out.0.write_all(&f.key.to_le_bytes())?;
            out.indices(&[u32::from(f.is_turned)])?;
            out.floats(&f.at)
        })
    })
}

pub(super) fn read_faces(path: &Path) -> Result<Vec<OpenFace>, BlocksError> {
    read(path, |bytes| {
        let n = bytes.count(44)?;
        let face = |bytes: &mut NumberReader<'_>| {
            Some(OpenFace {
                key: u128::from_le_bytes(bytes.take()?),
                is_turned: bytes.index()? == 1,
                at: bytes.point()?,
            })
        };
        (0..n).map(|_| face(bytes)).collect()
    })
}

pub(super) fn write_plan(path: &Path, plan: &Plan) -> Result<(), BlocksError> {
    write(path, |out| {
        out.floats(&plan.region.lo)?;
        out.floats(&plan.region.hi)?;
        out.floats(&[plan.size])?;
        out.indices(&plan.counts.map(|n| n as u32))?;
        out.indices(&[plan.region_certified, plan.features_certified].map(u32::from))?;
        out.points(&plan.corners)?;
        out.count(plan.apexes.len())?;
        for apex in &plan.apexes {
            out.floats(&apex.point)?;
            out.count(apex.pieces.len())?;
            out.indices(&apex.pieces)?;
        }
        out.count(plan.crowded.len())?;
        for &(p, size) in &plan.crowded {
            out.floats(&[p[0], p[1], p[2], size])?;
        }
        out.count(plan.curves.len())?;
        plan.curves.iter().try_for_each(|curve| {
            out.indices(&curve.pieces)?;
            out.points(&curve.points)
        })
    })
}

pub(super) fn read_plan(path: &Path) -> Result<Plan, BlocksError> {
    read(path, |bytes| {
        let region = Aabb {
            lo: bytes.point()?,
            hi: bytes.point()?,
        };
        let size = bytes.float()?;
        let counts = [bytes.index()?, bytes.index()?, bytes.index()?];
        let (region_certified, features_certified) = (bytes.index()? == 1, bytes.index()? == 1);
        let corners = bytes.points()?;
        let n = bytes.count(32)?;
        let apexes = (0..n).map(|_| apex(bytes)).collect::<Option<Vec<_>>>()?;
        let n = bytes.count(32)?;
        let crowded = (0..n).map(|_| Some((bytes.point()?, bytes.float()?)));
        let crowded = crowded.collect::<Option<Vec<_>>>()?;
        let n = bytes.count(16)?;
        let curves = (0..n).map(|_| {
            Some(PlannedCurve {
                pieces: [bytes.index()?, bytes.index()?],
                points: bytes.points()?,
            })
        });
        Some(Plan {
            region,
            region_certified,
            counts: counts.map(|n| n as usize),
            size,
            curves: curves.collect::<Option<Vec<_>>>()?,
            corners,
            apexes,
            features_certified,
            crowded,
        })
    })
}

fn apex(bytes: &mut NumberReader<'_>) -> Option<Corner> {
    let point = bytes.point()?;
    let n = bytes.count(4)?;
    Some(Corner {
        point,
        pieces: (0..n).map(|_| bytes.index()).collect::<Option<_>>()?,
        kind: CornerKind::Apex,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_mesh::blocks::INNER;

    #[test]
    fn what_is_written_is_read() {
        let name = format!("isoform-store-{}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let all = Tetrahedra {
            points: vec![[0.0, -0.0, 1e-310], [1.0, 0.0, 0.0], [0.5; 3], [2.0; 3]],
            tets: vec![[0, 1, 2, 3]],
            labels: vec![[7, INNER, INNER, 0]],
        };
        write_tetrahedra(&path, &all).expect("a file");
        assert_eq!(read_tetrahedra(&path).expect("tetrahedra"), all);
        assert!(read_faces(&path).is_err());
        let faces = [OpenFace {
            key: 1 << 100,
            is_turned: true,
            at: [1.0, 2.0, 3.0],
        }];
        write_faces(&path, &faces).expect("a file");
        assert_eq!(read_faces(&path).expect("faces"), faces);
        let plan = Plan {
            region: Aabb {
                lo: [0.0; 3],
                hi: [1.0; 3],
            },
            region_certified: true,
            counts: [3, 2, 1],
            size: 0.1,
            curves: vec![PlannedCurve {
                pieces: [1, 4],
                points: vec![[0.1; 3], [0.2; 3]],
            }],
            corners: vec![[0.3; 3]],
            apexes: vec![Corner {
                point: [0.3; 3],
                pieces: vec![2, 5],
                kind: CornerKind::Apex,
            }],
            features_certified: false,
            crowded: vec![([0.4; 3], 0.05)],
        };
        write_plan(&path, &plan).expect("a file");
        assert_eq!(read_plan(&path).expect("a plan"), plan);
        let whole = std::fs::read(&path).expect("the file");
        std::fs::write(&path, &whole[..whole.len() - 1]).expect("a file");
        let error = read_plan(&path).expect_err("a part");
        assert!(error.to_string().ends_with("it is not whole"), "{error}");
        std::fs::remove_file(&path).expect("the file");
    }
}
