//! Isoform: one shape, many forms.
#![forbid(unsafe_code)]

pub use isoform_field as field;
pub use isoform_fit as fit;
pub use isoform_geom as geom;
pub use isoform_io as io;
pub use isoform_num as num;
