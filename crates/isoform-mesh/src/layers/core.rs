//! A solid without its layers.

use crate::error::MeshError;
use isoform_geom::{Aabb, Csg, Point3, Solid, norm};
use isoform_num::{Interval, Jet2, Real};

/// A solid whose pieces with layers lie one thickness further inside.
///
/// A piece g becomes g − T |∇g|, which vanishes where the distance to first order g/|∇g| is T. It
/// differs from a parallel surface by κT²/2, to which columns of nodes pay no heed: they end where
/// the core begins.
pub(crate) struct Core<'a> {
    solid: &'a dyn Solid,
    /// Whether each piece has layers.
    layered: &'a [bool],
    /// Thickness of all layers.
    thickness: f64,
}

impl<'a> Core<'a> {
    /// The core of a solid in a box.
    ///
    /// # Errors
    /// [`MeshError::NoSlopes`] if a piece's gradient is not bounded over boxes.
    pub(crate) fn new(
        solid: &'a dyn Solid,
        layered: &'a [bool],
        thickness: f64,
        region: Aabb,
    ) -> Result<Self, MeshError> {
        let unknown = |&piece: &usize| solid.slopes(piece as u32, region).is_none();
        let mut pieces = (0..layered.len()).filter(|&piece| layered[piece]);
        if let Some(piece) = pieces.find(unknown) {
            let part = solid.names()[piece].clone();
            return Err(MeshError::NoSlopes { part });
        }
        Ok(Self {
            solid,
            layered,
            thickness,
        })
    }

    fn is_layered(&self, piece: u32) -> bool {
        self.layered.get(piece as usize) == Some(&true)
    }

    fn value(&self, piece: u32, p: Point3) -> f64 {
        let (v, g) = self.solid.gradient(piece, p);
        v - self.thickness * norm(g)
    }

    /// What holds a piece with layers over a box, from what holds the solid's piece there.
    fn moved(&self, piece: u32, region: Aabb, values: Interval) -> Interval {
        let Some([x, y, z]) = self.solid.slopes(piece, region) else {
            return Interval::ALL;
        };
        let slope = (x.square() + y.square() + z.square()).sqrt();
        values - Interval::constant(self.thickness) * slope
    }
}

impl Solid for Core<'_> {
    fn names(&self) -> &[String] {
        self.solid.names()
    }
    fn tree(&self) -> &Csg {
        self.solid.tree()
    }
    fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
        for (&piece, out) in which.iter().zip(out.chunks_mut(points.len().max(1))) {
            match self.is_layered(piece) {
                true => out
                    .iter_mut()
                    .zip(points)
                    .for_each(|(v, p)| *v = self.value(piece, *p)),
                false => self.solid.values(&[piece], points, out),
            }
        }
    }
    fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
        match self.is_layered(piece) {
            true => {
                let jet = self.jet(piece, p);
                (jet.v, jet.g)
            }
            false => self.solid.gradient(piece, p),
        }
    }
    /// Of a piece with layers the second derivatives are those of the solid's piece: they tell how
    /// it bends, from which sizes follow, to first order in the thickness.
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let jet = self.solid.jet(piece, p);
        let slope = norm(jet.g);
        if !self.is_layered(piece) || slope == 0.0 {
            return jet;
        }
        let share = self.thickness / slope;
        let bent = |i: usize| (0..3).map(|j| jet.second(i, j) * jet.g[j]).sum::<f64>();
        Jet2 {
            v: jet.v - self.thickness * slope,
            g: std::array::from_fn(|i| jet.g[i] - share * bent(i)),
            h: jet.h,
        }
    }
    fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        self.solid.bounds(which, region, out);
        for (&piece, out) in which.iter().zip(out) {
            if self.is_layered(piece) {
                *out = self.moved(piece, region, *out);
            }
        }
    }
    fn value_bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
        self.solid.value_bounds(which, region, out);
        for (&piece, out) in which.iter().zip(out) {
            if self.is_layered(piece) {
                *out = Interval::ALL;
            }
        }
    }
    fn slopes(&self, piece: u32, region: Aabb) -> Option<[Interval; 3]> {
        match self.is_layered(piece) {
            true => None,
            false => self.solid.slopes(piece, region),
        }
    }
    fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
        for (p, out) in points.iter().zip(out) {
            let of = |piece| match self.is_layered(piece) {
                true => self.value(piece, *p),
                false => self.solid.gradient(piece, *p).0,
            };
            *out = self.tree().value(&of);
        }
    }
}
