//! The integration tests of this crate, as one binary.

mod bias;
mod direction;
mod exact_solids;
mod features;
mod fit_chunks;
mod fit_scan;
mod level_sets;
mod moved_maps;
mod part_names;
mod proposed;
mod random_maps;
mod support;
