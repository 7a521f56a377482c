//! Sizes that follow the curvature of the surface, and sizes prescribed by the user.

use super::{LENGTH_TOLERANCE_FACTOR, MIN_TETS_PER_TASK, Refiner, longest};
use crate::complex::Complex;
use crate::distance::first_order;
use crate::lattice::{CELL_EDGE, ReducedTree};
use crate::options::Options;
use crate::points::unit;
use crate::surface::Surface;
use isoform_geom::{Point3, Solid, norm, principal_curvatures, sub};
use isoform_num::Jet2;
use rayon::prelude::*;

/// Returns the largest principal curvature, by magnitude, of the level set through a point.
pub(crate) fn curvature(j: &Jet2) -> f64 {
    let [k, l] = principal_curvatures(j);
    k.abs().max(l.abs())
}

/// Returns the smallest radius of curvature of the surface next to a point at first-order distance
/// `v`: that of the level set one Newton step away, corrected by the remaining distance. Measured
/// at the point itself it would vanish at the centre of a ball.
fn radius(solid: &dyn Solid, piece: u32, p: Point3, (v, gradient): (f64, Point3)) -> f64 {
    let n = unit(gradient);
    let j = solid.jet(piece, std::array::from_fn(|i| p[i] - v * n[i]));
    let left = first_order(j.v, j.g);
    let of = |bend: f64| {
        // Level sets of a distance are parallel: their radii grow by the distance outward.
        let radius = 1.0 / bend.abs();
        // The distance between both is of first order only, and must not cancel the whole radius.
        (radius + left * bend.signum()).max(0.5 * radius)
    };
    let [k, l] = principal_curvatures(&j).map(of);
    k.min(l)
}

/// Returns the edge length at which a surface with this radius of curvature does not turn too far
/// within an edge, given the requested `size`.
pub(crate) fn turn_size(radius: f64, size: f64) -> f64 {
    // Edges are at most 0.8 radii of curvature, arcs of about 50 degrees: coarser ones cannot
    // separate sheets that bend into each other. Curvature alone refines to a quarter of the size
    // at most; sharper bends are left to the chordal error, if given.
    (0.8 * radius).max(0.25 * size)
}

/// Returns the edge length at which a tetrahedron follows the surface: within the chordal error
/// `error`, and without turning too far per edge (limited below by a fraction of `size`). Infinite
/// away from the surface.
fn curved_size(surface: &Surface<'_>, complex: &Complex, t: u32, error: f64, size: f64) -> f64 {
    let layers = 0..=surface.dividers;
    let reduced = layers.filter_map(|layer| surface.reduced_in(layer, complex.middle(t)));
    reduced
        .map(|reduced| curved_size_of(reduced, surface, complex, t, error, size))
        .fold(f64::INFINITY, f64::min)
}

/// Returns the edge length of [`curved_size`] for one layer.
fn curved_size_of(
    reduced: &ReducedTree,
    surface: &Surface<'_>,
    complex: &Complex,
    t: u32,
    error: f64,
    size: f64,
) -> f64 {
    let (c, middle) = (complex.corners(t), complex.middle(t));
    let reach = c.iter().map(|p| norm(sub(*p, middle))).fold(0.0, f64::max);
    let gradients: Vec<(f64, Point3)> = reduced
        .pieces
        .iter()
        .map(|&i| {
            let (g, d) = surface.solid.gradient(i, middle);
            (first_order(g, d), d)
        })
        .collect();
    let values: Vec<f64> = gradients.iter().map(|g| g.0).collect();
    let mut wanted = f64::INFINITY;
    for (&piece, &near) in reduced.pieces.iter().zip(&gradients) {
        // A piece farther away than 1.1 radii of the tetrahedron does not pass through it.
        if near.0.abs() > 1.1 * reach || value_without(reduced, &values, piece).abs() > reach {
            continue;
        }
        let radius = radius(surface.solid, piece, middle, near);
        // A chord of length s deviates from a circle of radius r by s²/(8 r), an equilateral
        // triangle from a sphere by s²/(6 r).
        let by_error = (6.0 * error * radius).sqrt();
        wanted = wanted.min(by_error).min(turn_size(radius, size));
    }
    wanted
}

/// Evaluates a tree where one piece vanishes and the others have the given values: near 0 only if
/// the piece bounds the solid, or nearly so.
fn value_without(reduced: &ReducedTree, values: &[f64], piece: u32) -> f64 {
    let place = |i: u32| reduced.pieces.iter().position(|&p| p == i);
    reduced.tree.value(&|i| {
        if i == piece {
            0.0
        } else {
            place(i).map_or(0.0, |k| values[k])
        }
    })
}

/// Returns the target edge length in a tetrahedron of the lattice, whose cells of edge
/// [`CELL_EDGE`] contain edges of length 1: by curvature and prescribed sizes.
fn wanted(surface: &Surface<'_>, options: &Options, complex: &Complex, t: u32) -> f64 {
    // The chordal error is measured on the final mesh, and what exceeds it is split: the lattice
    // may exceed it a little.
    let error = options.grade.map_or(f64::INFINITY, |e| 1.3 * e);
    let curved = curved_size(surface, complex, t, error, options.size);
    let wished = options.sizes.as_ref().map_or(f64::INFINITY, |sizes| {
        let c = complex.corners(t);
        c.iter().map(|p| sizes.at(*p)).fold(f64::INFINITY, f64::min)
    });
    CELL_EDGE * curved.min(wished)
}

impl Refiner<'_> {
    /// Bisects where the surface bends or a smaller size is prescribed: see [`Options`]. Returns
    /// true if the limit of tetrahedra was reached.
    pub(crate) fn follow(&mut self, surface: &Surface<'_>, options: &Options) -> bool {
        let complex = &self.complex;
        let before = complex.tets.clone();
        let sizes: Vec<f64> = (0..before.len() as u32)
            .into_par_iter()
            .with_min_len(MIN_TETS_PER_TASK)
            .map(|t| {
                if complex.is_there(t) && !surface.control.is_stopped() {
                    wanted(surface, options, complex, t)
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        let any = sizes
            .par_iter()
            .enumerate()
            .with_min_len(MIN_TETS_PER_TASK)
            .any(|(t, s)| {
                s.is_finite() && longest(complex, t as u32).0 > s * LENGTH_TOLERANCE_FACTOR
            });
        any && self.bisect(|complex, t| match before.get(t as usize) {
            Some(v) if *v == complex.tets[t as usize] => sizes[t as usize],
            _ => wanted(surface, options, complex, t),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Pieces;
    use isoform_field::hyperfun::{Mode, Model};

    /// x² + y² has level sets of curvature 1/r across the axis and 0 along it.
    #[test]
    fn curvature_of_a_cylinder() {
        for r in [0.5, 2.0, 10.0] {
            let (x, y) = (0.6 * r, 0.8 * r);
            let mut j = Jet2 {
                v: r * r,
                g: [2.0 * x, 2.0 * y, 0.0],
                h: [0.0; 6],
            };
            let diagonal: Vec<usize> = (0..6)
                .filter(|&k| {
                    j.h = [0.0; 6];
                    j.h[k] = 1.0;
                    j.second(0, 0) == 1.0 || j.second(1, 1) == 1.0
                })
                .collect();
            j.h = [0.0; 6];
            for k in diagonal {
                j.h[k] = 2.0;
            }
            assert!((curvature(&j) - 1.0 / r).abs() < 1e-12, "radius {r}");
        }
    }

    /// The curvature radius of a ball and of its complement, from points inside and outside.
    #[test]
    fn radius_of_a_ball_from_anywhere() {
        for sign in ["1 -", "0 - 1 +"] {
            let text = format!("m(x[3], a[1]) {{ m = {sign} sqrt(x[1]^2 + x[2]^2 + x[3]^2); }}");
            let model = Model::parse(&text, Mode::Default).expect("a program");
            let solid = Pieces::of_model(&model, &[0.0]).expect("a solid");
            for way in [0.05, 0.3, 0.9, 1.1, 1.7] {
                let p = [0.48 * way, -0.6 * way, 0.64 * way];
                let (g, d) = solid.gradient(0, p);
                let radius = radius(&solid, 0, p, (first_order(g, d), d));
                assert!((radius - 1.0).abs() < 1e-9, "{radius} at {way}, {sign}");
            }
        }
    }
}
