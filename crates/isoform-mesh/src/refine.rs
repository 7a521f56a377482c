//! Smaller tetrahedra where they are wanted: the lattice is bisected before it is cut.
//!
//! Longest edges first, and where a tetrahedron around the edge has a longer one, that one before
//! it (Rivara, 1984): the tetrahedra of the body-centred lattice then fall into three classes of
//! shapes only, none worse than 45°, and neighbours differ in size by no more than a step or two.

use crate::complex::{Complex, EDGES, Ring};
use crate::lattice::{IN, OUT};
use crate::mesher::Options;
use crate::surface::Surface;
use isoform_control::Control;
use isoform_geom::{KdTree, Point3, cross, dot, norm, sub};
use isoform_num::Jet2;
use rayon::prelude::*;

/// Lengths that differ by less are equal: halves of lattice edges are exact but for rounding.
const SAME: f64 = 1.0 + 1e-9;
/// Tetrahedra bisected between two looks at the clock, some milliseconds.
const LOOK: usize = 256;
/// Longest chain of longer edges that is followed; in a lattice it never exceeds a few.
const CHAIN: usize = 64;

fn longest(complex: &Complex, t: u32) -> (f64, u32, u32) {
    let v = complex.tets[t as usize];
    let mut best = (0.0, 0, 0);
    for (i, j) in EDGES {
        let (a, b) = (v[i].min(v[j]), v[i].max(v[j]));
        let l = norm(sub(complex.points[a as usize], complex.points[b as usize]));
        if l > best.0 * SAME || (l * SAME > best.0 && (best.1, best.2) > (a, b)) {
            best = (l, a, b);
        }
    }
    best
}

/// Bisects tetrahedra until the longest edge of each is at most what `wanted` says for it (looked
/// at anew for the halves). `frozen` vertices keep their edges to each other. Stops at `limit`
/// tetrahedra and says whether it did, and on a stop by `control`.
pub(crate) fn bisect(
    control: &Control<'_>,
    complex: &mut Complex,
    frozen: &mut Vec<bool>,
    limit: usize,
    mut wanted: impl FnMut(&Complex, u32) -> f64,
) -> bool {
    let mut queue: std::collections::VecDeque<u32> = complex.live().collect();
    let (mut ring, mut made) = (Ring::default(), Vec::new());
    let mut done = 0usize;
    while let Some(t) = queue.pop_front() {
        if !complex.is_there(t) || longest(complex, t).0 <= wanted(complex, t) * SAME {
            continue;
        }
        if complex.tets.len() > limit {
            return true;
        }
        done += 1;
        if done.is_multiple_of(LOOK) && control.is_stopped() {
            return false;
        }
        let mut at = t;
        for _ in 0..CHAIN {
            let (length, a, b) = longest(complex, at);
            complex.ring(at, a, b, &mut ring);
            if let Some(&longer) = ring
                .tets
                .iter()
                .find(|&&n| longest(complex, n).0 > length * SAME)
            {
                at = longer;
                continue;
            }
            if frozen[a as usize] && frozen[b as usize] {
                break;
            }
            let [p, q] = [a, b].map(|v| complex.points[v as usize]);
            let m = complex.add_point(std::array::from_fn(|i| 0.5 * (p[i] + q[i])));
            frozen.push(false);
            complex.split(&ring, a, b, m, &mut made);
            queue.extend(&made);
            if !complex.is_there(t) || complex.tets[t as usize].contains(&m) {
                break;
            }
            at = t;
        }
    }
    false
}

/// Halves the edges of tetrahedra next to the places given.
pub(crate) fn bisect_near(
    control: &Control<'_>,
    complex: &mut Complex,
    frozen: &mut Vec<bool>,
    limit: usize,
    places: &KdTree,
) {
    let near: Vec<(u32, f64)> = complex
        .live()
        .filter_map(|t| {
            let (length, ..) = longest(complex, t);
            let (_, d) = places.nearest(complex.middle(t))?;
            (d < length * length).then_some((t, 0.5 * length))
        })
        .collect();
    // Halves take the slots of others: what is wanted goes by place.
    let wanted = KdTree::new(&near.iter().map(|n| complex.middle(n.0)).collect::<Vec<_>>());
    bisect(control, complex, frozen, limit, |complex, t| {
        match wanted.nearest(complex.middle(t)) {
            Some((i, d)) if d < near[i].1 * near[i].1 => near[i].1,
            _ => f64::INFINITY,
        }
    });
}

/// Largest principal curvature, by magnitude, of the level set through a point.
pub(crate) fn curvature(j: &Jet2) -> f64 {
    let l = norm(j.g);
    if !(l > 0.0 && l.is_finite()) {
        return 0.0;
    }
    let n = j.g.map(|v| v / l);
    let axis = (0..3).fold(0, |b, i| if n[i].abs() < n[b].abs() { i } else { b });
    let mut e = [0.0; 3];
    e[axis] = 1.0;
    let u = cross(n, e);
    let u = u.map(|v| v / norm(u));
    let v = cross(n, u);
    let times = |w: Point3| -> Point3 {
        std::array::from_fn(|i| (0..3).map(|k| j.second(i, k) * w[k]).sum())
    };
    let (hu, hv) = (times(u), times(v));
    let (a, b, c) = (dot(u, hu) / l, dot(u, hv) / l, dot(v, hv) / l);
    let (mean, off) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
    (mean + off).abs().max((mean - off).abs())
}

/// Edges are at most this share of the smallest radius of curvature: an arc of some 50 degrees
/// each. Coarser ones cannot tell sheets that bend into each other apart.
const RADIUS: f64 = 0.8;
/// Smallest share of the size asked for that curvature alone may lead to; sharper bends are left to
/// the chordal error, if one is asked for.
const BEND_LEAST: f64 = 0.25;

/// Edge length at which the surface in a tetrahedron is followed: within the chordal error `error`,
/// and without turning too far at once (down to a share of `size`). Infinite away from the surface.
fn curved_size(surface: &Surface<'_>, complex: &Complex, t: u32, error: f64, size: f64) -> f64 {
    let (c, middle) = (complex.corners(t), complex.middle(t));
    let k = surface.lattice.state_at(middle);
    if k == IN || k == OUT {
        return f64::INFINITY;
    }
    let reach = c.iter().map(|p| norm(sub(*p, middle))).fold(0.0, f64::max);
    let (tree, pieces) = &surface.lattice.trees[k as usize - 2];
    let values: Vec<f64> = pieces
        .iter()
        .map(|&i| surface.distance(i, middle))
        .collect();
    let mut wanted = f64::INFINITY;
    for (&piece, &v) in pieces.iter().zip(&values) {
        if v.abs() > 1.1 * reach {
            continue;
        }
        // Only where the piece bounds the solid, or nearly so.
        let value = |i: u32| {
            if i == piece {
                0.0
            } else {
                pieces
                    .iter()
                    .position(|&p| p == i)
                    .map_or(0.0, |k| values[k])
            }
        };
        if tree.value(&value).abs() > reach {
            continue;
        }
        let bend = curvature(&surface.solid.jet(piece, middle));
        if bend > 0.0 {
            // Level sets at a distance v have other radii: 1/κ changes by v. A chord of length s
            // leaves a circle of curvature κ by κ s²/8, an equilateral triangle a sphere by κ s²/6.
            let radius = (1.0 / bend - v.abs()).max(0.5 / bend);
            let by_error = (6.0 * error * radius).sqrt();
            wanted = wanted
                .min(by_error)
                .min((RADIUS * radius).max(BEND_LEAST * size));
        }
    }
    wanted
}

/// Bisects where the surface bends or a size is wished for: see [`Options`]. Cells of edge `cell`
/// hold edges of length 1. Says whether the limit of tetrahedra was met.
pub(crate) fn follow(
    surface: &Surface<'_>,
    complex: &mut Complex,
    frozen: &mut Vec<bool>,
    limit: usize,
    cell: f64,
    options: &Options,
) -> bool {
    // The error is measured on the mesh afterwards and what exceeds it split: here it may be
    // exceeded a little.
    let error = options.grade.map_or(f64::INFINITY, |e| 1.3 * e);
    let wanted = |complex: &Complex, t: u32| {
        let curved = curved_size(surface, complex, t, error, options.size);
        let wished = options.sizes.as_ref().map_or(f64::INFINITY, |sizes| {
            let c = complex.corners(t);
            c.iter().map(|p| sizes.at(*p)).fold(f64::INFINITY, f64::min)
        });
        cell * curved.min(wished)
    };
    let before = complex.tets.clone();
    let sizes: Vec<f64> = (0..before.len() as u32)
        .into_par_iter()
        .with_min_len(1024)
        .map(|t| {
            if complex.is_there(t) && !surface.control.is_stopped() {
                wanted(complex, t)
            } else {
                f64::INFINITY
            }
        })
        .collect();
    let any = sizes
        .par_iter()
        .enumerate()
        .with_min_len(1024)
        .any(|(t, s)| s.is_finite() && longest(complex, t as u32).0 > s * SAME);
    any && bisect(
        surface.control,
        complex,
        frozen,
        limit,
        |complex, t| match before.get(t as usize) {
            Some(v) if *v == complex.tets[t as usize] => sizes[t as usize],
            _ => wanted(complex, t),
        },
    )
}

/// Places on an edge where the sign is looked at: a wall or gap as thin as a quarter of the edge is
/// seen.
const LOOKS: [f64; 3] = [0.25, 0.5, 0.75];
/// Share of the edge that the surface must reach across it to count; less is the sagitta of a
/// curved surface.
const DEPTH: f64 = 0.08;
/// Times that edges are halved in search of what hides between lattice points.
const ROUNDS: usize = 4;

/// Share of the sum of the sagittas of two pieces within which two sheets that face each other are
/// too close to tell whether they meet.
const CLOSE: f64 = 2.0;

/// Whether two pieces face each other in a tetrahedron so closely that straight edges cannot tell
/// whether they meet.
fn is_close_call(surface: &Surface<'_>, complex: &Complex, t: u32) -> bool {
    let (c, middle) = (complex.corners(t), complex.middle(t));
    let k = surface.lattice.state_at(middle);
    if k == IN || k == OUT {
        return false;
    }
    let pieces = &surface.lattice.trees[k as usize - 2].1;
    if pieces.len() < 2 {
        return false;
    }
    let length = norm(sub(c[0], c[1])).max(norm(sub(c[2], c[3])));
    let near: Vec<(u32, f64, Point3)> = pieces
        .iter()
        .filter_map(|&i| {
            let (g, d) = surface.solid.gradient(i, middle);
            let l = norm(d);
            (l > 0.0 && g.abs() < 0.7 * length * l).then(|| (i, g / l, d.map(|v| v / l)))
        })
        .collect();
    near.iter().enumerate().any(|(k, a)| {
        near[..k].iter().any(|b| {
            let gap = (a.1 + b.1).abs();
            dot(a.2, b.2) < -0.8 && gap > surface.zero && gap < length && {
                let bend = [a, b]
                    .iter()
                    .map(|p| curvature(&surface.solid.jet(p.0, middle)))
                    .sum::<f64>();
                gap < CLOSE * bend * length * length / 8.0
            }
        })
    })
}

/// Halves edges that a piece of the surface crosses twice (both ends inside, or both outside, and a
/// place between that is not), so that thin walls, gaps and narrow links are met by the lattice.
/// Returns places where the last round still found such an edge.
pub(crate) fn resolve(
    surface: &Surface<'_>,
    complex: &mut Complex,
    frozen: &mut Vec<bool>,
    limit: usize,
) -> Vec<Point3> {
    let mut left = Vec::new();
    let mut values: Vec<f64> = Vec::new();
    // What was looked at in the round before need not be looked at again, except for edges that
    // could not be halved.
    let (mut before, mut twice): (Vec<[u32; 4]>, Vec<[u32; 2]>) = (Vec::new(), Vec::new());
    for round in 0..=ROUNDS {
        values.par_extend(
            complex.points[values.len()..]
                .par_iter()
                .map(|&p| surface.value(p).0),
        );
        let fresh: Vec<u32> = complex
            .live()
            .filter(|&t| before.get(t as usize) != Some(&complex.tets[t as usize]))
            .collect();
        let mut edges: Vec<[u32; 2]> = fresh
            .iter()
            .flat_map(|&t| {
                let v = complex.tets[t as usize];
                EDGES.map(|(i, j)| [v[i].min(v[j]), v[i].max(v[j])])
            })
            .filter(|&[a, b]| {
                let (f, g) = (values[a as usize], values[b as usize]);
                // Values are distances, nearly: ends farther from the surface than the edge is long
                // cannot see it twice.
                f * g > 0.0 && f.is_finite() && g.is_finite() && {
                    let d = sub(complex.points[a as usize], complex.points[b as usize]);
                    (f.abs() + g.abs()).powi(2) < dot(d, d)
                }
            })
            .collect();
        let mut ring = Ring::default();
        edges.extend(
            twice
                .iter()
                .filter(|e| complex.ring_of(e[0], e[1], &mut ring)),
        );
        edges.par_sort_unstable();
        edges.dedup();
        let close: Vec<u32> = fresh
            .into_par_iter()
            .filter(|&t| !surface.control.is_stopped() && is_close_call(surface, complex, t))
            .collect();
        twice = edges
            .into_par_iter()
            .filter(|&[a, b]| {
                let [p, q] = [a, b].map(|v| complex.points[v as usize]);
                let length = norm(sub(p, q));
                !surface.control.is_stopped()
                    && LOOKS.iter().any(|t| {
                        let at = std::array::from_fn(|i| p[i] + t * (q[i] - p[i]));
                        let (v, piece) = surface.value(at);
                        // Two pieces, one at each crossing, are told apart by their signs at the
                        // ends and cut one by one.
                        v * values[a as usize] < 0.0
                            && v.abs() > DEPTH * length
                            && v * surface.distance(piece, p) < 0.0
                            && v * surface.distance(piece, q) < 0.0
                    })
            })
            .collect();
        if twice.is_empty() && close.is_empty() {
            return left;
        }
        if round == ROUNDS || complex.tets.len() > limit || surface.control.is_stopped() {
            left = twice
                .iter()
                .map(|&[a, _]| complex.points[a as usize])
                .collect();
            return left;
        }
        before.clone_from(&complex.tets);
        let flagged = |a: u32, b: u32| twice.binary_search(&[a.min(b), a.max(b)]).is_ok();
        // Slots are reused by the halves, which are looked at in the next round: a close call
        // counts as long as its vertices are the same.
        let close: Vec<(u32, [u32; 4])> = close
            .into_iter()
            .map(|t| (t, complex.tets[t as usize]))
            .collect();
        bisect(surface.control, complex, frozen, limit, |complex, t| {
            if close.binary_search(&(t, complex.tets[t as usize])).is_ok() {
                return 0.0;
            }
            let v = complex.tets[t as usize];
            let any = EDGES.iter().any(|&(i, j)| flagged(v[i], v[j]));
            if any { 0.0 } else { f64::INFINITY }
        });
    }
    left
}
