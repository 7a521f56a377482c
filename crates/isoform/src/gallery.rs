//! Templates and the example scan that are embedded in the library.

use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::PointCloud;
use isoform_io::{ReadOptions, ReadReport, Source, read};

/// Names and programs, in alphabetical order.
static GALLERY: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/gallery.rs"));

/// Scanned cup of 8190 points, as a PLY file; see examples/scans/README.md.
static CUP: &[u8] = include!(concat!(env!("OUT_DIR"), "/scan.rs"));

/// Template of the gallery: one file in examples/templates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GalleryTemplate {
    /// Name of the template: that of its file without the extension.
    pub name: &'static str,
    /// Source text of the HyperFun program.
    pub program: &'static str,
}

impl GalleryTemplate {
    /// Parses the program.
    ///
    /// # Panics
    /// Never: the programs are part of the library, and each is read by its tests.
    pub fn model(&self) -> Model {
        Model::parse(self.program, Mode::Default).expect("a program of the gallery")
    }
}

/// Returns the templates of the gallery, in alphabetical order; docs/templates.md describes them.
///
/// ```
/// let names: Vec<&str> = isoform::templates().map(|t| t.name).collect();
/// assert!(names.contains(&"cup") && names.is_sorted());
/// ```
pub fn templates() -> impl Iterator<Item = GalleryTemplate> {
    let named = |&(name, program)| GalleryTemplate { name, program };
    GALLERY.iter().map(named)
}

/// Returns the template with a name, ignoring case and an extension .hf; `None` if there is none.
///
/// ```
/// let cup = isoform::template("Cup.hf").expect("a cup");
/// assert_eq!(cup.model().params()[0].name, "outer_radius");
/// assert!(isoform::template("teapot").is_none());
/// ```
pub fn template(name: &str) -> Option<GalleryTemplate> {
    let name = name.strip_suffix(".hf").unwrap_or(name);
    templates().find(|t| t.name.eq_ignore_ascii_case(name))
}

/// Name of the file of [`example_scan`].
pub const EXAMPLE_SCAN: &str = "ycb_065-d_cup.ply";

/// Bytes of the file of [`example_scan`].
pub const EXAMPLE_SCAN_FILE: &[u8] = CUP;

/// Returns a scanned cup (YCB object 065-d, in metres), which the template `cup` fits, and the
/// reader's report.
pub fn example_scan() -> (PointCloud, ReadReport) {
    let source = Source::Bytes {
        name: EXAMPLE_SCAN,
        bytes: CUP,
    };
    read(source, None, &ReadOptions::default()).expect("a scan that the library carries")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_template_is_a_model_of_space() {
        for template in templates() {
            assert_eq!(template.model().dimension(), 3, "{}", template.name);
        }
        assert!(templates().count() >= 12);
    }

    #[test]
    fn the_scan_is_there() {
        let (cloud, report) = example_scan();
        assert_eq!((cloud.points.len(), report.dropped_points), (8190, 0));
    }
}
