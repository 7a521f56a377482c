//! Rational surfaces, by the names of this crate.

pub use isoform_tess::{
    PatchesError, triangulate as rational_surface, triangulate_patches as rational_patches,
};
