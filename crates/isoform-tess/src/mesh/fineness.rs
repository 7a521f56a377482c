//! Cells of space with a finer tolerance: the tolerance is divided by four once or more.
//!
//! The requested tolerance does not decide whether sheets that are close together cross. Where
//! their triangles cross, the surface is triangulated again, with a finer tolerance there for
//! curves, seams and triangles of all sheets.

use crate::surface::Point3;
use std::collections::BTreeMap;

/// Number of divisions of the tolerance by four, by cells of space.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fineness {
    levels: BTreeMap<[i32; 3], u8>,
}

fn cell(p: Point3, half_width: f64) -> [i32; 3] {
    // The box has 128 cells along each edge.
    p.map(|x| (0.5 * 128.0 * (x / half_width)).floor() as i32)
}

impl Fineness {
    /// Divides the tolerance once more in the cells around given boxes.
    pub(crate) fn refine(&mut self, boxes: &[[Point3; 2]], half_width: f64) {
        let mut cells = std::collections::BTreeSet::new();
        for [lo, hi] in boxes {
            let (a, b) = (cell(*lo, half_width), cell(*hi, half_width));
            for x in a[0] - 1..=b[0] + 1 {
                for y in a[1] - 1..=b[1] + 1 {
                    for z in a[2] - 1..=b[2] + 1 {
                        cells.insert([x, y, z]);
                    }
                }
            }
        }
        for cell in cells {
            let level = self.levels.entry(cell).or_default();
            // Cells are divided by four up to six times.
            *level = (*level + 1).min(6);
        }
    }
    /// Returns the factor of the tolerance at a point.
    pub(crate) fn factor(&self, p: Point3, half_width: f64) -> f64 {
        if self.levels.is_empty() {
            return 1.0;
        }
        self.levels
            .get(&cell(p, half_width))
            .map_or(1.0, |&level| 0.25f64.powi(i32::from(level)))
    }
}
