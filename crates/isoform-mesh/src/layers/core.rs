//! A solid without its layers.

use crate::error::MeshError;
use isoform_geom::{Aabb, Csg, Point3, Solid, dot, norm};
use isoform_num::{Interval, Jet2, Real};

/// A solid whose pieces with layers are moved inward by one thickness.
///
/// A piece g becomes g(p − T ∇g/|∇g|): it vanishes where a step of one thickness T against the
/// gradient ends on the surface. For planes, spheres, cylinders and all functions whose gradients
/// are constant along their own direction this is the parallel surface. For others it is an
/// approximation; columns of nodes end on it.
pub(crate) struct Core<'a> {
    solid: &'a dyn Solid,
    /// Flag per piece: true if it has layers.
    layered: &'a [bool],
    /// Total thickness of the layers.
    thickness: f64,
}

impl<'a> Core<'a> {
    /// Creates the core of a solid in a box.
    ///
    /// # Errors
    /// [`MeshError::NoSlopes`] if a piece's gradient has no bounds over boxes.
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

    /// Returns the end of a step of one thickness against the gradient.
    fn step(&self, p: Point3, gradient: Point3) -> Point3 {
        let share = self.thickness / norm(gradient);
        std::array::from_fn(|i| p[i] - share * gradient[i])
    }

    fn value(&self, piece: u32, p: Point3) -> f64 {
        let (v, g) = self.solid.gradient(piece, p);
        match norm(g) {
            // A step from outside may cross a gap and reach the surface behind it.
            slope if v <= 0.0 => v - self.thickness * slope,
            0.0 => v,
            _ => self.solid.gradient(piece, self.step(p, g)).0,
        }
    }

    /// Returns bounds of a piece with layers over a box, from the bounds of the solid's piece
    /// there.
    ///
    /// Along the step the gradient may leave the box; it stays in the box widened by the thickness.
    /// Its component along the gradient at p is at least |∇g(p)| less the variation of the
    /// gradient, and at most the length of the longest one.
    fn moved(&self, piece: u32, region: Aabb, values: Interval) -> Interval {
        let around = Aabb {
            lo: region.lo.map(|x| x - self.thickness),
            hi: region.hi.map(|x| x + self.thickness),
        };
        let Some(slopes) = self.solid.slopes(piece, around) else {
            return Interval::ALL;
        };
        let [x, y, z] = slopes;
        let longest = (x.square() + y.square() + z.square()).sqrt();
        let [x, y, z] = slopes.map(|s| Interval::constant(s.width()));
        let apart = (x.square() + y.square() + z.square()).sqrt();
        let along = Interval::new((longest - apart).lo(), longest.hi());
        values - Interval::constant(self.thickness) * along
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
    /// Returns the jet of a piece. With layers the second derivatives are those of the solid's
    /// piece: they give the curvature, from which sizes follow, to first order in the thickness.
    fn jet(&self, piece: u32, p: Point3) -> Jet2 {
        let jet = self.solid.jet(piece, p);
        let slope = norm(jet.g);
        if !self.is_layered(piece) || slope == 0.0 {
            return jet;
        }
        let (v, there) = match jet.v <= 0.0 {
            true => (jet.v - self.thickness * slope, jet.g),
            false => self.solid.gradient(piece, self.step(p, jet.g)),
        };
        // The derivative of the end of the step is I − T (I − n nᵀ) H / |∇g|, with n the unit
        // normal and H the second derivatives at p.
        let n = jet.g.map(|x| x / slope);
        let along = dot(n, there);
        let across: Point3 = std::array::from_fn(|i| there[i] - along * n[i]);
        let share = self.thickness / slope;
        let turned = |i: usize| (0..3).map(|j| jet.second(i, j) * across[j]).sum::<f64>();
        Jet2 {
            v,
            g: std::array::from_fn(|i| there[i] - share * turned(i)),
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

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_geom::OnePiece;
    use isoform_num::Jet2 as Second;

    /// An ellipsoid as a polynomial, whose gradient turns along itself.
    struct Ellipsoid;

    impl isoform_geom::Field for Ellipsoid {
        fn value(&self, p: Point3) -> f64 {
            self.jet(p).v
        }
        fn jet(&self, [x, y, z]: Point3) -> Second {
            Second {
                v: 1.0 - x * x - y * y / 4.0 - z * z / 9.0,
                g: [-2.0 * x, -y / 2.0, -2.0 * z / 9.0],
                h: [-2.0, 0.0, 0.0, -0.5, 0.0, -2.0 / 9.0],
            }
        }
    }

    /// The gradient is that of the values: differences of these over 2e-5 agree with
    /// it to some 1e-9.
    #[test]
    fn gradients_are_those_of_the_values() {
        let solid = OnePiece::new(Ellipsoid, "e");
        let core = Core {
            solid: &solid,
            layered: &[true],
            thickness: 0.2,
        };
        for p in [[0.3, 0.5, 1.2], [0.6, -0.4, 0.3], [-0.1, 1.4, 0.9]] {
            let gradient = core.gradient(0, p).1;
            for i in 0..3 {
                let at = |h: f64| {
                    let mut q = p;
                    q[i] += h;
                    core.value(0, q)
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                assert!((slope - gradient[i]).abs() < 1e-8, "{p:?} {i}");
            }
        }
    }
}
