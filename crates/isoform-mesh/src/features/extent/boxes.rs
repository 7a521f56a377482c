//! Operations on axis-aligned boxes.

use isoform_geom::Aabb;

/// Weight of the sides of a box that protrude from the known part when the longest side is chosen:
/// slabs over a face of the solid get thin up to this ratio. Larger values suit faces along the
/// axes, smaller ones oblique faces.
const PROTRUDING_SIDE_WEIGHT: f64 = 16.0;

/// Splits a cell at a face of `known` that passes well through it, else in the middle of the
/// longest side. Protruding sides count `PROTRUDING_SIDE_WEIGHT` times: thin slabs over a face of
/// the solid are halved outwards before they are cut along it.
pub(super) fn split(cell: Aabb, known: Aabb) -> (Aabb, Aabb) {
    let size = cell.size();
    let weight = |i: usize| {
        let sticks_out = cell.lo[i] < known.lo[i] || cell.hi[i] > known.hi[i];
        size[i]
            * if sticks_out {
                PROTRUDING_SIDE_WEIGHT
            } else {
                1.0
            }
    };
    let longest = (0..3)
        .max_by(|a, b| weight(*a).total_cmp(&weight(*b)))
        .unwrap_or(0);
    let middle = (longest, cell.center()[longest]);
    // A cut leaves a share of the side on both sides.
    let (axis, at) = best_face(cell, known, 1e-3 * size[longest]).unwrap_or(middle);
    let (mut a, mut b) = (cell, cell);
    a.hi[axis] = at;
    b.lo[axis] = at;
    (a, b)
}

/// Returns the axis and coordinate of the face of `known` that leaves most of a cell on both sides;
/// `None` if none leaves more than `least`.
fn best_face(cell: Aabb, known: Aabb, least: f64) -> Option<(usize, f64)> {
    let overlap = |i: usize| known.lo[i] < cell.hi[i] && known.hi[i] > cell.lo[i];
    if known.is_empty() || !(0..3).all(overlap) {
        return None;
    }
    let (mut best, mut cut) = (0.0, None);
    for i in 0..3 {
        for at in [known.lo[i], known.hi[i]] {
            let part = (at - cell.lo[i]).min(cell.hi[i] - at);
            if part > best && part > least {
                (best, cut) = (part, Some((i, at)));
            }
        }
    }
    cut
}

/// Returns true if a part reaches the border of a region.
pub(super) fn touches(part: Aabb, region: Aabb) -> bool {
    !part.is_empty() && (0..3).any(|i| part.lo[i] <= region.lo[i] || part.hi[i] >= region.hi[i])
}

/// Returns the smallest box around two boxes.
pub(super) fn union(a: Aabb, b: Aabb) -> Aabb {
    Aabb {
        lo: std::array::from_fn(|i| a.lo[i].min(b.lo[i])),
        hi: std::array::from_fn(|i| a.hi[i].max(b.hi[i])),
    }
}

/// Returns the intersection of two boxes.
pub(super) fn clipped(a: Aabb, b: Aabb) -> Aabb {
    Aabb {
        lo: std::array::from_fn(|i| a.lo[i].max(b.lo[i])),
        hi: std::array::from_fn(|i| a.hi[i].min(b.hi[i])),
    }
}

/// Returns true if the first box lies within the second.
pub(super) fn is_within(a: Aabb, b: Aabb) -> bool {
    (0..3).all(|i| b.lo[i] <= a.lo[i] && a.hi[i] <= b.hi[i])
}

/// Returns a cube about the centre of a box, twice as large as its longest side, clipped at the
/// limit.
pub(super) fn doubled(b: Aabb, limit: f64) -> Aabb {
    let (c, s) = (b.center(), b.size());
    // Doubling makes a degenerate box grow, too.
    let half = s.into_iter().fold(0.0, f64::max).max(1e-3);
    Aabb {
        lo: std::array::from_fn(|i: usize| (c[i] - half).max(-limit)),
        hi: std::array::from_fn(|i: usize| (c[i] + half).min(limit)),
    }
}

/// Splits the part of `outer` outside of `inner` into at most six boxes.
pub(super) fn shell(inner: Aabb, outer: Aabb) -> Vec<Aabb> {
    let mut rest = outer;
    let mut slabs = Vec::with_capacity(6);
    for i in 0..3 {
        let (mut below, mut above) = (rest, rest);
        below.hi[i] = inner.lo[i];
        above.lo[i] = inner.hi[i];
        slabs.extend(
            [below, above]
                .into_iter()
                .filter(|b| (0..3).all(|k| b.lo[k] < b.hi[k])),
        );
        rest.lo[i] = inner.lo[i];
        rest.hi[i] = inner.hi[i];
    }
    slabs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(half: f64) -> Aabb {
        Aabb {
            lo: [-half; 3],
            hi: [half; 3],
        }
    }

    #[test]
    fn a_shell_fills_what_is_between_two_boxes() {
        let volume = |b: &Aabb| b.size().iter().product::<f64>();
        let slabs = shell(cube(1.0), cube(2.0));
        assert_eq!(slabs.len(), 6);
        assert_eq!(slabs.iter().map(volume).sum::<f64>(), 64.0 - 8.0);
        assert_eq!(doubled(cube(1.0), 1.5), cube(1.5));
        assert_eq!(doubled(cube(1.0), 9.0), cube(2.0));
    }

    #[test]
    fn cells_are_cut_where_the_known_part_ends() {
        let known = Aabb {
            lo: [-9.0; 3],
            hi: [0.25, 9.0, 9.0],
        };
        let (a, b) = split(cube(1.0), known);
        assert_eq!((a.hi[0], b.lo[0]), (0.25, 0.25));
        let (a, _) = split(cube(1.0), Aabb::EMPTY);
        assert!(a.hi.contains(&0.0));
    }
}
