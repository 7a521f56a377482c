//! Clouds in chunks, which no fit holds whole.
//!
//! What a fit computes of all its points are sums, boxes, order statistics and, for the search and
//! everything about neighbours, a sample in a random order. [`Chunks`] are asked for them one
//! [`Question`] at a time, each chunk answers with [`answer`], wherever it is, and answers are added
//! in the order of the chunks. The sample, the points that settle the fit and every decision are
//! those of a fit of the whole; sums differ from that by rounding, and order statistics not at all.
//!
//! ```text
//!   Cloud ──Question──> Chunks ──> answer(question, points of a chunk, template)
//!     ^                                │
//!     └── sum in the order of chunks ──┘
//! ```
//!
//! Equal points, also of different chunks, count once; they are told by a hash of 64 bits. Beside
//! the sample a cloud keeps eight bytes by point while it looks for equal points, four while it
//! draws the order, and one or two bits where some of the points are left out.

mod answer;
mod bits;
mod cloud;
mod question;
mod sums;
mod words;

pub use self::answer::{along, answer, looked, moments};
pub use self::bits::Bits;
pub use self::cloud::Cloud;
pub(crate) use self::cloud::{Sizes, Which};
pub use self::question::{Asked, Grid, Mask, Question, Reading, Telling, Weighing};
pub(crate) use self::sums::ChunkSums;

use crate::Template;

/// Points in chunks that can be asked.
pub trait Chunks: Sync {
    /// Points by chunk.
    fn counts(&self) -> &[usize];
    /// Asks the chunks for which there is a question about the template (none for those that are
    /// about points alone), and passes their answers on in the order of the chunks. False where a
    /// chunk has not answered, and whoever waits for the fit is going to hear why from the chunks:
    /// the fit goes on without these answers, and is of no use.
    fn ask(
        &self,
        template: Option<&dyn Template>,
        question: &mut dyn FnMut(usize) -> Option<Question>,
        each: &mut dyn FnMut(usize, &[u64]),
    ) -> bool;
}
