//! Isoform: one shape, many forms.
//!
//! This crate gathers the others under one name and holds what joins them: [`FrepTemplate`] turns a
//! HyperFun program into a template that [`fit`](mod@fit) fits to points. [`topology`] counts what
//! a mesh of any triangles consists of.
//!
//! ```
//! use isoform::FrepTemplate;
//! use isoform::field::hyperfun::{Mode, Model};
//! use isoform::fit::{Control, Options, fit};
//!
//! // Points of a ball of radius 2 about (1, 0, 0).
//! let points: Vec<[f64; 3]> = (0..500)
//!     .map(|i| {
//!         let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 250.0 - 1.0);
//!         let r = (1.0 - z * z).sqrt();
//!         [1.0 + 2.0 * r * t.cos(), 2.0 * r * t.sin(), 2.0 * z]
//!     })
//!     .collect();
//! let ball = "-- @pose translate
//!     -- @param a[1] radius length
//!     my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";
//! let model = Model::parse(ball, Mode::Default)?;
//! let template = FrepTemplate::new(&model, &points)?;
//! let result = fit(&points, &template, &Options::default(), &Control::default())?;
//! assert!((result.parameters[0].value - 2.0).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod compare;
mod facets;
mod fit_scan;
mod gallery;
mod held;
mod implicit_surface;
mod mesh_model;
mod meshing;
mod patches;
pub mod report;
mod surface_box;
mod template;
mod topology;

pub use compare::{CompareError, Distances, Side, compare};
pub use facets::points_on_faces;
pub use fit_scan::{FitOptions, FitScanError, FitScanWarning, NamedBounds, ScanFit, fit_scan};
pub use gallery::{EXAMPLE_SCAN, GalleryTemplate, example_scan, template, templates};
pub use held::{Bounds, HeldTemplate, ParameterError};
pub use implicit_surface::{
    Coverage, ImplicitSurface, PatchFinding, cover_surface, parameterize_surface, patch_findings,
};
pub use isoform_algebra as algebra;
pub use isoform_check as check;
pub use isoform_control::{Control, Stopped};
pub use isoform_field as field;
pub use isoform_fit as fit;
pub use isoform_geom as geom;
pub use isoform_io as io;
pub use isoform_mesh as mesh;
pub use isoform_num as num;
pub use isoform_patch as patch;
pub use isoform_tess as tess;
pub use isoform_tess::{PatchesError, triangulate as triangulate_map, triangulate_patches};
pub use mesh_model::{
    MeshModelError, MeshModelOptions, MeshNote, ModelMesh, adapt_to_model, mesh_model,
};
pub use meshing::{
    certified_adaptation, certified_mesh, default_size, default_size_within, solid_of, surface_of,
};
pub use patches::{COORDINATES, field_of, parts_of, patch_mesh, polynomial, step_faces};
pub use surface_box::SurfaceBox;
pub use template::{FrepTemplate, TemplateError};
pub use topology::{Topology, topology};
