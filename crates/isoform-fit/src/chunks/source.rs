//! Interface of the sources of points in chunks.

use super::question::ChunkQuery;
use crate::Template;

/// A source of points in chunks that can evaluate queries.
pub trait Chunks: Sync {
    /// Returns the number of points by chunk.
    fn counts(&self) -> &[usize];
    /// Sends each chunk its question, if it has one, and passes the answers to `each` in the order
    /// of the chunks. `template` is `None` for questions about points alone. Returns false if a
    /// chunk gave no answer. The source must report the reason to the caller of the fit, which
    /// continues without these answers and is of no use.
    fn ask(
        &self,
        template: Option<&dyn Template>,
        question: &mut dyn FnMut(usize) -> Option<ChunkQuery>,
        each: &mut dyn FnMut(usize, &[u64]),
    ) -> bool;
}
