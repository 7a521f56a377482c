//! The certificate of a mesh.
