//! The templates and the scan that the library carries.

use isoform_field::hyperfun::{Mode, Model};
use isoform_geom::PointCloud;
use isoform_io::{ReadOptions, ReadReport, Source, read};

/// Names and programs, in alphabetical order.
static GALLERY: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/gallery.rs"));

/// A scanned cup of 8190 points; see examples/scans/README.md.
static CUP: &[u8] = include!(concat!(env!("OUT_DIR"), "/scan.rs"));

/// A template of the gallery: one file in examples/templates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GalleryTemplate {
    /// Its name, the file's without the ending.
    pub name: &'static str,
    /// The HyperFun program.
    pub program: &'static str,
}

impl GalleryTemplate {
    /// The program as a model.
    ///
    /// # Panics
    /// Never: the programs are part of the library, and each is read by its tests.
    pub fn model(&self) -> Model {
        Model::parse(self.program, Mode::Default).expect("a program of the gallery")
    }
}

/// The templates of the gallery, in alphabetical order; docs/templates.md says what each fits.
///
/// ```
/// let names: Vec<&str> = isoform::templates().map(|t| t.name).collect();
/// assert!(names.contains(&"cup") && names.is_sorted());
/// ```
pub fn templates() -> impl Iterator<Item = GalleryTemplate> {
    let named = |&(name, program)| GalleryTemplate { name, program };
    GALLERY.iter().map(named)
}

/// The template of that name; letters fold, and an ending .hf does not matter.
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

/// The name of the file of [`example_scan`].
pub const EXAMPLE_SCAN: &str = "ycb_065-d_cup.ply";

/// A scanned cup (YCB object 065-d, in metres), which the template `cup` fits, and what its reader
/// says.
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
