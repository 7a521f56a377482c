//! Reading and writing of points, meshes, patches, maps and solids.
//!
//! [`read()`] reads PLY, XYZ and CSV text, OBJ, OFF, STL, 3MF, PCD, LAS, LAZ and E57, from a path
//! or from bytes, by name or by content. It returns a [`PointCloud`](isoform_geom::PointCloud) with
//! a [`ReadReport`], or a [`ReadError`] that says what failed, where, why and what to try. Files
//! are streamed; [`ReadOptions::max_points`] takes a seeded uniform sample of a file that does not
//! fit in memory. [`write_path`] writes PLY, XYZ and CSV that read back bit by bit. [`inspect()`]
//! summarises a cloud.
//!
//! [`write_mesh_path`] and [`read_mesh`] do likewise for a [`Mesh`](isoform_geom::Mesh) with its
//! parts, curves and regions, volume or surface: Gmsh, VTK, Abaqus/CalculiX, Nastran, STL, OBJ,
//! PLY, OFF, 3MF and glTF ([`mesh_formats`]).
//!
//! [`write_step_solids`] writes solids for CAD systems, and [`write_step_path`] writes rational
//! patches as faces of a STEP file (AP242). [`read_step_solids`] reads solids back from files
//! written by this crate, and [`read_step`] the shapes of STEP files of any program.
//! [`write_solids`] and [`read_solids`] are the native file form of solids, lossless JSON.
//!
//! [`read_patches`] and [`write_patches`] are the file form of patches, [`read_map`] and
//! [`write_map`] that of rational maps, both JSON with exact numbers.
//!
//! Sizes announced by a file are checked against the bytes present before memory is reserved.
//! Points with NaN are dropped and counted.
//!
//! A new format is one file with `sniff` and `read` (and `write`), its `mod` here, and one line in
//! `registry.rs`; for meshes it is a file in `mesh/`, its `mod` in `mesh.rs`, and a line in
//! `mesh/registry.rs`.
//!
//! ```
//! use isoform_io::{ReadOptions, Source, WriteOptions, inspect, read, write};
//! let off = b"OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
//! let (mesh, report) = read(Source::Bytes { name: "tetrahedron.off", bytes: off }, None, &ReadOptions::default())?;
//! assert_eq!((mesh.points.len(), mesh.triangles.len()), (4, 4));
//! assert_eq!(inspect(&mesh, &report).spacing, Some(1.0));
//!
//! let mut ply = Vec::new();
//! write(&mesh, &mut ply, "ply", &WriteOptions::default())?;
//! let (again, _) = read(Source::Bytes { name: "-", bytes: &ply }, None, &ReadOptions::default())?;
//! assert_eq!(again, mesh);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod atomic;
mod binary;
mod choose;
mod collect;
mod color;
mod columns;
mod e57;
mod error;
mod format;
mod input;
mod inspect;
mod kind;
mod las;
mod maps;
mod mesh;
mod obj;
mod off;
mod options;
mod patches;
mod pcd;
mod ply;
mod read;
mod registry;
mod roles;
mod sample;
mod solids;
mod splines;
mod step;
mod stl;
mod text;
mod three_mf;
mod unzip;
mod write;
mod xml;

pub use atomic::{process_id, write_atomic};
pub use color::deviation_colors;
pub use error::{At, BAD_MESH, ErrorKind, Place, ReadError, WriteError};
pub use format::Format;
pub use input::Source;
pub use inspect::{ColumnRange, Inspection, UnitGuess, inspect, inspect_unit};
pub use kind::{FileKind, file_kind};
pub use maps::{MAP_KEYS, MAP_VARIABLES, MapFile, MapFileError, read_map, write_map};
pub use mesh::{
    MeshFormat, MeshReadOptions, MeshWriteOptions, mesh_format_for, mesh_format_named,
    mesh_formats, read_mesh, write_mesh, write_mesh_path, write_pvtu,
};
pub use options::{MeshPoints, ReadOptions, ReadReport, WriteOptions, WriteReport};
pub use patches::{
    ControlPoints, FilePatch, PatchFileError, PatchRecord, is_patch_file, read_patches,
    write_patches,
};
pub use read::read;
pub use registry::{format_named, formats};
pub use solids::{SolidFile, SolidFileError, is_solid_file, read_solids, write_solids};
pub use splines::{
    SplineFileError, is_polynomial_file, is_spline_file, read_polynomial, read_spline,
    write_polynomial, write_spline,
};
pub use step::{
    STEP_UNITS, ShapeFile, SolidOptions, SolidProperties, StepContent, StepFace, StepOptions,
    read_step, read_step_solids, step, step_solids, write_step_path, write_step_solids,
};
pub use three_mf::implicit::{
    ImplicitModel, ImplicitProgram, ScalarFunction, ScalarGraph, ScalarId, ScalarNode,
    ScalarOperation, is_implicit, read_implicit, write_implicit,
};
pub use write::{write, write_path};
