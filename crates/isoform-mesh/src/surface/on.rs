//! Sets of pieces that hold vertices.

/// The pieces that a vertex is held on, at most three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct On {
    pieces: [u32; 3],
    n: u8,
}

impl On {
    pub(crate) fn from_pieces(pieces: &[u32]) -> Self {
        let mut on = Self::default();
        for &p in pieces {
            on = on.with(p).unwrap_or(on);
        }
        on
    }
    #[inline]
    pub(crate) fn slice(&self) -> &[u32] {
        &self.pieces[..usize::from(self.n)]
    }
    #[inline]
    pub(crate) fn len(&self) -> usize {
        usize::from(self.n)
    }
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.n == 0
    }
    pub(crate) fn contains(&self, piece: u32) -> bool {
        self.slice().contains(&piece)
    }
    /// Returns true if all pieces belong to another set, too.
    pub(crate) fn is_within(&self, other: &Self) -> bool {
        self.slice().iter().all(|&l| other.contains(l))
    }
    /// Adds a piece; `None` if there are three already.
    pub(crate) fn with(mut self, piece: u32) -> Option<Self> {
        if self.contains(piece) {
            return Some(self);
        }
        if self.n == 3 {
            return None;
        }
        self.pieces[usize::from(self.n)] = piece;
        self.n += 1;
        Some(self)
    }
    /// Returns the common pieces, in the order of the first set.
    pub(crate) fn common(&self, other: &Self) -> Self {
        let mut common = Self::default();
        for &p in self.slice().iter().filter(|&&p| other.contains(p)) {
            common = common.with(p).unwrap_or(common);
        }
        common
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_pieces_at_most() {
        let on = On::from_pieces(&[7, 3, 7, 5, 9]);
        assert_eq!(on.slice(), [7, 3, 5]);
        assert_eq!(on.with(3), Some(on));
        assert_eq!(on.with(9), None);
        assert_eq!(on.common(&On::from_pieces(&[5, 7])).slice(), [7, 5]);
        assert!(
            On::from_pieces(&[5, 7]).is_within(&on) && !on.is_within(&On::from_pieces(&[5, 7]))
        );
    }
}
