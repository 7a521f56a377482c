//! Lines of drawings: segments joined to chains, corners restored that a grid has cut, and
//! superfluous points removed.

use std::collections::BTreeMap;

/// Point of a line on a grid: to the right of a grid point (0), below it (1), or amid four (2).
pub type Node = (usize, usize, u8);

/// Joins segments to chains, open ones first, each as long as possible without a fork.
pub fn chains(segments: &[[Node; 2]]) -> Vec<Vec<Node>> {
    let mut web = SegmentGraph::new(segments);
    let ends = web.at.iter().filter(|(_, s)| s.len() != 2).map(|(n, _)| *n);
    let starts: Vec<Node> = ends.chain(web.at.keys().copied()).collect();
    let mut chains = Vec::new();
    for start in starts {
        while let Some(first) = web.unused(start) {
            chains.push(web.chain(start, first));
        }
    }
    chains
}

/// Segments by the nodes that they join.
struct SegmentGraph<'s> {
    segments: &'s [[Node; 2]],
    /// Indices of the segments at each node.
    at: BTreeMap<Node, Vec<usize>>,
    /// True, by segment, if it is part of a chain.
    used: Vec<bool>,
}

impl<'s> SegmentGraph<'s> {
    /// Collects segments, none of them used.
    fn new(segments: &'s [[Node; 2]]) -> Self {
        let mut at: BTreeMap<Node, Vec<usize>> = BTreeMap::new();
        for (i, segment) in segments.iter().enumerate() {
            for node in segment {
                at.entry(*node).or_default().push(i);
            }
        }
        Self {
            segments,
            at,
            used: vec![false; segments.len()],
        }
    }

    /// Returns the first segment at a node that is in no chain yet.
    fn unused(&self, node: Node) -> Option<usize> {
        self.at[&node].iter().copied().find(|s| !self.used[*s])
    }

    /// Returns the chain from a node along a segment, up to an end, a fork or its start.
    fn chain(&mut self, start: Node, first: usize) -> Vec<Node> {
        let (mut chain, mut node, mut segment) = (vec![start], start, first);
        loop {
            self.used[segment] = true;
            let [a, b] = self.segments[segment];
            node = if a == node { b } else { a };
            chain.push(node);
            match self.unused(node) {
                Some(next) if self.at[&node].len() == 2 => segment = next,
                _ => return chain,
            }
        }
    }
}

/// Restores corners: where two straight runs meet within a cell, the chain cuts the corner, which
/// is inserted. `pixel` is the size of a cell.
pub fn sharpened(points: Vec<[f64; 2]>, pixel: f64) -> Vec<[f64; 2]> {
    let n = points.len();
    let is_closed = n > 8 && points[0] == points[n - 1];
    let get = |i: isize| -> Option<[f64; 2]> {
        if is_closed {
            Some(points[i.rem_euclid(n as isize - 1) as usize])
        } else {
            usize::try_from(i).ok().and_then(|i| points.get(i)).copied()
        }
    };
    let mut out = Vec::with_capacity(n + 8);
    for i in 0..n {
        out.push(points[i]);
        if i + 1 == n {
            break;
        }
        let i = i as isize;
        // Two segments before and two after, each pair straight.
        let (Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)) = (
            get(i - 2),
            get(i - 1),
            get(i),
            get(i + 1),
            get(i + 2),
            get(i + 3),
        ) else {
            continue;
        };
        if is_straight(a, b, c)
            && is_straight(d, e, f)
            && let Some(corner) = meeting([a, c], [f, d])
            && distance(corner, c).max(distance(corner, d)) < 1.5 * pixel
        {
            out.push(corner);
        }
    }
    out
}

/// Returns the distance of two points on the paper.
fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Returns true if the middle one of three points lies on the chord of the others, within 3 % of
/// the chord's length.
fn is_straight(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> bool {
    let cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let length = distance(a, c);
    length > 0.0 && cross.abs() < 0.03 * length * length
}

/// Returns the intersection of the lines through two pairs of points, ahead of both; `None` if they
/// are nearly parallel.
fn meeting([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> Option<[f64; 2]> {
    let (u, v) = ([b[0] - a[0], b[1] - a[1]], [d[0] - c[0], d[1] - c[1]]);
    let cross = u[0] * v[1] - u[1] * v[0];
    let sizes = u[0].hypot(u[1]) * v[0].hypot(v[1]);
    if cross.abs() < 0.3 * sizes {
        return None;
    }
    let t = ((c[0] - a[0]) * v[1] - (c[1] - a[1]) * v[0]) / cross;
    let s = ((c[0] - a[0]) * u[1] - (c[1] - a[1]) * u[0]) / cross;
    (t >= 1.0 && s >= 1.0).then(|| [a[0] + t * u[0], a[1] + t * u[1]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform::geom::plane::simplified;

    #[test]
    fn a_corner_that_is_cut_is_put_back() {
        let mut cut: Vec<[f64; 2]> = (0..5).map(|i| [f64::from(i), 0.0]).collect();
        cut.extend((0..5).map(|i| [4.5, 0.5 + f64::from(i)]));
        let sharp = sharpened(cut, 1.0);
        assert!(sharp.contains(&[4.5, 0.0]), "{sharp:?}");
        assert_eq!(
            simplified(&sharp, 0.01),
            [[0.0, 0.0], [4.5, 0.0], [4.5, 4.5]]
        );
    }

    #[test]
    fn chains_end_at_forks() {
        let n = |x: usize| (x, 0, 0);
        let forked = [[n(0), n(1)], [n(1), n(2)], [n(2), n(3)], [n(2), n(4)]];
        let mut lengths: Vec<usize> = chains(&forked).iter().map(Vec::len).collect();
        lengths.sort_unstable();
        assert_eq!(lengths, [2, 2, 3]);
    }
}
