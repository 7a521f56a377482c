//! Elements around each node.

/// Incidence lists: for each node, the elements that it is a corner of, in ascending order.
#[derive(Debug)]
pub(super) struct Stars {
    /// Start of each node's list in `elements`, followed by the total number.
    offsets: Vec<u32>,
    /// Elements, node by node.
    elements: Vec<u32>,
}

impl Stars {
    /// Builds the lists for elements with `N` corners. Indices must be below `nodes`, and there
    /// must be fewer than 2³² corners.
    pub(super) fn new<const N: usize>(nodes: usize, elements: &[[u32; N]]) -> Self {
        let mut offsets = vec![0u32; nodes + 1];
        for i in elements.iter().flatten() {
            offsets[*i as usize + 1] += 1;
        }
        for k in 0..nodes {
            offsets[k + 1] += offsets[k];
        }
        let mut items = vec![0; elements.len() * N];
        for (k, element) in elements.iter().enumerate() {
            for i in element {
                let slot = &mut offsets[*i as usize];
                items[*slot as usize] = k as u32;
                *slot += 1;
            }
        }
        // Each offset has advanced to the next node's start; a rotation restores them.
        offsets.rotate_right(1);
        offsets[0] = 0;
        Self {
            offsets,
            elements: items,
        }
    }

    /// Returns the elements around a node; an element that has the node twice occurs twice.
    pub(super) fn elements_at(&self, node: usize) -> &[u32] {
        &self.elements[self.offsets[node] as usize..self.offsets[node + 1] as usize]
    }
}

/// Splits `0..n` into ranges of `size` each, the last one shorter. The ranges, and hence the order
/// of summation, depend only on `n` and `size`.
pub(super) fn blocks(n: usize, size: usize) -> Vec<std::ops::Range<usize>> {
    (0..n)
        .step_by(size)
        .map(|from| from..(from + size).min(n))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_of_each_node() {
        let stars = Stars::new(5, &[[0, 1, 2], [2, 1, 4], [1, 1, 0]]);
        assert_eq!(
            (0..5)
                .map(|i| stars.elements_at(i).to_vec())
                .collect::<Vec<_>>(),
            [vec![0, 2], vec![0, 1, 2, 2], vec![0, 1], vec![], vec![1]]
        );
        assert!(Stars::new::<3>(0, &[]).offsets == [0]);
    }
}
