//! `isoform view`: pages, kinds of layers, and what is refused.

mod common;
