//! Pages that show models, meshes, points, patches and maps: one file, offline, in any browser.
//!
//! A [`Page`] is a document with the data of its layers and the viewer, a script that is built from
//! the folder web of the repository and stored in assets. The page fetches nothing; its
//! Content-Security-Policy permits only the viewer to run, and texts of files (names, comments) are
//! data that are never interpreted as HTML.
//!
//! Models are stored as their tapes: the page draws the surface itself by a shader, for any values
//! of the parameters, and computes picked points in double precision. Patches and maps are stored
//! as their control points and polynomials. Points and meshes are arrays of numbers.
//!
//! ```
//! use isoform::geom::PointCloud;
//! use isoform_view::{Page, ShownPoints};
//!
//! let mut page = Page::new("Two points");
//! let cloud = PointCloud::from_points(vec![[0.0; 3], [1.0; 3]]);
//! page.points("two.xyz", &ShownPoints::new(&cloud));
//! let html = page.html();
//! assert!(html.contains("Content-Security-Policy") && html.len() < 1_200_000);
//! ```
#![forbid(unsafe_code)]

mod blob;
mod map;
mod mesh;
mod model;
mod page;
mod patches;
mod points;
mod solid;

pub use blob::base64;
pub use page::{Page, hashes, served_policy, studio, studio_policy};
pub use patches::ShownPatch;
pub use points::ShownPoints;
