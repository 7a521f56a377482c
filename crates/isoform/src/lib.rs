//! Conversion of shapes between point clouds, implicit functions, rational patches and meshes, with
//! a check of every result.
//!
//! | from | to | function |
//! |---|---|---|
//! | a scan and a HyperFun program | the program's parameters, with intervals | [`fit_scan`] |
//! | a scan | a smooth function through its points | [`implicitize_scan`], [`mesh_spline`] |
//! | a scan | the planes, spheres, cylinders, cones and tori that it consists of | [`recognize_scan`] |
//! | a program | tetrahedra, or the surface, with a certificate | [`mesh_model`], [`adapt_to_model`] |
//! | a huge program | tetrahedra in blocks, each in its own memory or process | [`mesh_in_blocks`], [`BlocksJob`] |
//! | a program | a tape with free parameters, for evaluators elsewhere | [`LiveModel`] |
//! | a program | solids of exact faces for CAD, with a certificate | [`brep_model`] |
//! | a program | a program of build123d, CadQuery or OpenSCAD | [`cad_program`] |
//! | a program or a polynomial | rational patches with proved distances | [`parameterize_surface`], [`cover_surface`] |
//! | a rational map or patches | triangles, with what is proved of them | [`triangulate_map`], [`triangulate_patches`] |
//! | a program | a level set in a 3MF package | [`level_set_file`] |
//! | a 3MF package of level sets | a program | [`io::read_implicit`] |
//! | any two of: points, a mesh, a model | distances both ways | [`compare()`] |
//! | a file | points or a mesh, and what is in it | [`io::read`], [`io::read_mesh`], [`io::inspect`] |
//!
//! Each function takes its inputs, and options for the rest; those that may take long also take a
//! [`Control`] that cancels them, ends them at a deadline and reports their progress. Each returns
//! its result together with its checks, which the module [`report`] turns into types that
//! serialize. Coordinates are f64; decisions called exact are computed over Q. Results are
//! identical on every machine, for any number of threads in rayon's pool.
//!
//! # From a scan to a model
//!
//! ```
//! use isoform::field::hyperfun::{Mode, Model};
//! use isoform::{Control, FitOptions, fit_scan, geom::PointCloud};
//!
//! // Points of a ball of radius 2 about (1, 0, 0), and a program that may be moved onto them.
//! let point = |i: u32| {
//!     let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 250.0 - 1.0);
//!     let r = (1.0 - z * z).sqrt();
//!     [1.0 + 2.0 * r * t.cos(), 2.0 * r * t.sin(), 2.0 * z]
//! };
//! let scan = PointCloud::from_points((0..500).map(point).collect());
//! let ball = "-- @pose translate
//!     -- @param a[1] radius length
//!     my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";
//! let model = Model::parse(ball, Mode::Default)?;
//! let fitted = fit_scan(&scan, &model, &FitOptions::default(), &Control::default())?;
//! assert!((fitted.values()[0] - 2.0).abs() < 1e-9);
//! println!("{}", fitted.program()); // plain HyperFun, where the scan is
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # From a model to a mesh for finite elements
//!
//! ```
//! use isoform::io::{MeshWriteOptions, write_mesh_path};
//! use isoform::{Control, MeshModelOptions, mesh_model, template};
//!
//! let ball = template("sphere").expect("a template of the gallery").model();
//! let options = MeshModelOptions { size: Some(0.25), ..MeshModelOptions::default() };
//! let made = mesh_model(&ball, &[0.0, 0.0, 0.0, 1.0], &options, &Control::default())?;
//! assert!(made.is_as_asked());
//! # let folder = std::env::temp_dir().join(format!("isoform-tour-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! # let path = folder.join("ball.msh");
//! write_mesh_path(&made.meshed.mesh, &path, None, &MeshWriteOptions::default())?;
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # From a function to rational patches for CAD
//!
//! ```
//! use isoform::geom::Aabb;
//! use isoform::patch::{Covering, Options};
//! use isoform::{Control, ImplicitSurface, cover_surface, step_faces};
//!
//! let sphere = ImplicitSurface::of_polynomial("x^2 + y^2 + z^2 - 1/4")?.expect("a surface");
//! let region = Aabb { lo: [-0.6; 3], hi: [0.6; 3] };
//! let options = Options::new((2, 2), 1e-3, region);
//! let cover = cover_surface(&sphere, &options, &Covering::default(), &Control::default())?;
//! assert!(cover.patches.iter().all(|p| p.distances.bound.is_some_and(|b| b <= 1e-3)));
//! let faces = step_faces(sphere.field.as_ref(), &cover.patches); // for io::write_step_path
//! assert_eq!(faces.len(), cover.patches.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # From a rational map to triangles
//!
//! ```
//! use isoform::tess::{Map, MapOptions, TriangulateOptions};
//! use isoform::{Control, topology, triangulate_map};
//!
//! // The sphere by stereographic projection: all of it, the pole at infinity included.
//! let map = Map::parse(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"], MapOptions::default())?;
//! let options = TriangulateOptions::around(2.into());
//! let (surface, analysis) = triangulate_map(&map, &options, &Control::default())?;
//! assert!(surface.is_certified());
//! assert_eq!(topology(&surface.triangles).euler, 2);
//! assert_eq!(analysis.degrees.map(|d| d.implicit_degree), Some(2));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Complete programs are in examples/rust, templates in examples/templates, and the pages for users
//! in docs.
#![forbid(unsafe_code)]

mod blocks;
mod brep_model;
mod cad_program;
mod compare;
mod constrained_template;
mod exact_solid;
mod facets;
mod fit_chunks;
mod fit_remarks;
mod fit_scan;
mod formula;
mod gallery;
mod implicit;
mod implicit_surface;
mod implicitize_scan;
mod level_set_file;
mod live;
mod mesh_distance;
mod mesh_model;
mod mesh_spline;
mod meshing;
mod patches;
mod rational_surface;
mod recognize_scan;
pub mod report;
mod scan_labels;
mod spline_distance;
mod template;
mod topology;

pub use blocks::{
    BlockFailure, BlockFigures, BlockReport, BlockTask, BlockWarning, BlocksError, BlocksJob,
    BlocksReport, WholeReport, mesh_in_blocks, run_block_task,
};
pub use brep_model::{BrepModelError, ModelBrep, brep_model};
pub use cad_program::{CadDialect, CadOptions, CadProgramError, cad_program};
pub use compare::{
    CompareError, Comparison, Deviations, Distances, FaceDistances, Side, compare, deviations,
};
pub use constrained_template::{Bounds, ConstrainedTemplate, ParameterError};
pub use exact_solid::{ExactSolid, SolidMeasures, measure_solid, solid_gap};
pub use facets::{CornerError, FacesError, PointsOnFaces, points_on_faces};
pub use fit_chunks::{AnswerError, ChunkReader, ChunkSource, fit_chunks};
pub use fit_scan::{FitOptions, FitScanError, FitScanWarning, NamedBounds, ScanFit, fit_scan};
pub use formula::{FormulaError, FormulaSolid, FormulaSurface};
pub use gallery::{
    EXAMPLE_SCAN, EXAMPLE_SCAN_FILE, GalleryTemplate, example_scan, template, templates,
};
pub use implicit::{GlobalPolynomial, Implicit, PolynomialError};
pub use implicit_surface::{
    Coverage, ImplicitSurface, PatchFinding, cover_surface, parameterize_surface, patch_findings,
};
pub use implicitize_scan::{
    GlobalFit, ImplicitizeError, ImplicitizeOptions, NormalsFrom, implicitize_scan,
    implicitize_scan_globally,
};
pub use isoform_algebra as algebra;
pub use isoform_brep as brep;
pub use isoform_cad as cad;
pub use isoform_check as check;
pub use isoform_control::{Control, Stopped};
pub use isoform_field as field;
pub use isoform_field::parameter_values;
pub use isoform_fit as fit;
pub use isoform_geom as geom;
pub use isoform_io as io;
pub use isoform_mesh as mesh;
pub use isoform_num as num;
pub use isoform_patch as patch;
pub use isoform_recognize as recognize;
pub use isoform_recognize::{Options as RecognizeOptions, Proposal};
pub use isoform_spline as spline;
pub use isoform_tess as tess;
pub use isoform_tess::{
    PatchesError, SurfaceBox, TriangulateError, triangulate as triangulate_map, triangulate_patches,
};
pub use level_set_file::{LevelSetFileError, level_set_file};
pub use live::{LiveModel, LiveParameter, ModelTape, undefined_at};
pub use mesh_distance::{MeshDistanceError, mesh_distance};
pub use mesh_model::{
    MeshModelError, MeshModelOptions, MeshNote, ModelMesh, RegionModel, adapt_to_model, mesh_model,
    mesh_model_regions,
};
pub use mesh_spline::{Unseen, mesh_spline};
pub use meshing::{
    RegionCertificate, certified_adaptation, certified_mesh, certified_regions, default_size,
    default_size_within, flat_triangles, solid_of, surface_of,
};
pub use patches::{
    COORDINATES, field_of, parts_of, patch_mesh, patch_records, polynomial, step_faces,
};
pub use rational_surface::{
    RationalSurface, RationalSurfaceError, TriangulatedSurface, exact_number,
};
pub use recognize_scan::{
    RecognizeError, Recognized, SeparatedPart, recognize_scan, sample_of, without_supports,
};
pub use scan_labels::{ScanLabels, ScanLabelsError, recognize_scan_labels};
pub use spline_distance::SplineDistance;
pub use template::{FrepTemplate, TemplateError};
pub use topology::{SurfaceMeasures, Topology, surface_measures, topology};
