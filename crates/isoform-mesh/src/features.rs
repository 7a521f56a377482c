//! Feature curves and corners of a solid.
