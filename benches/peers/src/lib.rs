//! What the referees and isoform's programs share: the plain file in which every mesher hands over
//! its mesh, so that one and the same code measures them all, and the primitives whose values are
//! asked.
//!
//! The file is little endian: the numbers of points, triangles and tetrahedra (u64); points
//! (3 f64), triangles (3 u32), tetrahedra (4 u32).

pub mod primitives;

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};

/// Points, triangles and tetrahedra.
#[derive(Default)]
pub struct Raw {
    pub points: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub tets: Vec<[u32; 4]>,
}

impl Raw {
    /// Writes the file.
    pub fn write(&self, path: &str) -> io::Result<()> {
        let mut to = BufWriter::new(File::create(path)?);
        for n in [self.points.len(), self.triangles.len(), self.tets.len()] {
            to.write_all(&(n as u64).to_le_bytes())?;
        }
        for x in self.points.as_flattened() {
            to.write_all(&x.to_le_bytes())?;
        }
        for v in self
            .triangles
            .as_flattened()
            .iter()
            .chain(self.tets.as_flattened())
        {
            to.write_all(&v.to_le_bytes())?;
        }
        to.flush()
    }

    /// Reads the file.
    pub fn read(path: &str) -> io::Result<Self> {
        let mut from = BufReader::new(File::open(path)?);
        let [points, triangles, tets] = numbers(&mut from, u64::from_le_bytes)?;
        let points = (0..points)
            .map(|_| numbers(&mut from, f64::from_le_bytes))
            .collect::<io::Result<_>>()?;
        let triangles = (0..triangles)
            .map(|_| numbers(&mut from, u32::from_le_bytes))
            .collect::<io::Result<_>>()?;
        let tets = (0..tets)
            .map(|_| numbers(&mut from, u32::from_le_bytes))
            .collect::<io::Result<_>>()?;
        Ok(Self {
            points,
            triangles,
            tets,
        })
    }
}

/// The next `N` numbers of `B` bytes.
fn numbers<T: Copy + Default, const N: usize, const B: usize>(
    from: &mut impl Read,
    read: impl Fn([u8; B]) -> T,
) -> io::Result<[T; N]> {
    let mut all = [T::default(); N];
    for one in &mut all {
        let mut bytes = [0; B];
        from.read_exact(&mut bytes)?;
        *one = read(bytes);
    }
    Ok(all)
}
