//! Pictures of scenes without a display.
//!
//! A [`Scene`] has layers: models, points, meshes, patches, maps, solids. [`render`] casts a ray
//! for each pixel, and 16 where something changes, onto the function of a model itself, onto the
//! patches and maps themselves, and onto the triangles of meshes; [`draw_svg`] finds the lines and
//! areas of a drawing between such rays. A scene gives equal bytes for any number of threads.
//!
//! ```
//! use isoform::geom::Mesh;
//! use isoform::Control;
//! use isoform_render::{Camera, Layer, Scene, Style, View, render, write_png};
//!
//! let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let mesh = Mesh::from_triangles(points, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
//! let scene = Scene { layers: vec![Layer::mesh("corner", &mesh, None, None)], section: None };
//! let camera = Camera::fitted(&scene.bounds(), View::Iso, 1.0, 35.0, false);
//! let picture = render(&scene, &camera, [64, 64], &Style::default(), &Control::default())?;
//! assert!(write_png(&picture)?.starts_with(b"\x89PNG"));
//! assert!(picture.pixels.iter().any(|p| *p != [255; 3]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod bvh;
mod camera;
mod color;
mod exact;
mod hidden;
mod layer;
mod legend;
mod marks;
mod model;
mod network;
mod picture;
mod png;
pub mod polyline;
mod section;
mod shade;
mod sheet;
mod surface;
mod svg;
mod text;
mod trace;
mod visibility;

pub use camera::{Camera, CameraError, FOV, View};
pub use color::{Color, NEUTRAL_SHARE, Scale, part_color};
pub use layer::{ColorBy, Key, Layer, Patch, Scene, ShownModel};
pub use legend::{draw as draw_legend, legend_width};
pub use model::FINEST;
pub use picture::{Picture, Style, render};
pub use png::{write_indexed_png, write_png};
pub use section::Section;
pub use shade::OUTLIER;
pub use sheet::{Look, Pane, panes};
pub use svg::{Drawing, draw_svg};
