//! Rational surfaces as read from files, maps or patches, and their triangles with all checks.

use crate::report::AboutSurface;
use crate::{Topology, topology};
use isoform_algebra::{Poly, QUADRANTS, RBig};
use isoform_control::Control;
use isoform_geom::Mesh;
use isoform_io::{FilePatch, MapFileError, PatchFileError, is_patch_file, read_map, read_patches};
use isoform_tess::{
    Analysis, Domain, Map, MapError, MapOptions, Mode, Patch, PatchesError, Surface, SurfaceBox,
    TriangulateOptions, triangulate, triangulate_patches,
};
use serde_json::Value;
use std::time::Duration;

/// Share of a time limit that exact computations may take; the triangulation comes after them, and
/// takes less.
const EXACT_TIME_SHARE: f64 = 0.6;

/// Rational surface that can be triangulated.
#[derive(Clone, Debug)]
pub enum RationalSurface {
    /// Surface of a map, over the whole plane of parameters.
    Map(Box<Map>),
    /// Surface of patches, each over its own domain.
    Patches(Vec<Patch>),
}

/// Reason why a text does not define a rational surface.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RationalSurfaceError {
    /// A file of patches is not valid.
    #[error(transparent)]
    Patches(#[from] PatchFileError),
    /// The text is not a file of a map.
    #[error(transparent)]
    File(#[from] MapFileError),
    /// The four polynomials do not map onto a surface.
    #[error(transparent)]
    Map(#[from] MapError),
}

/// Parses a rational number exactly, such as 2, 0.1 or 1/3; `None` for other texts.
///
/// ```
/// let tenth = isoform::exact_number("0.1").map(|x| x.to_string());
/// assert_eq!(tenth.as_deref(), Some("1/10"));
/// ```
pub fn exact_number(text: &str) -> Option<RBig> {
    Poly::parse(text.trim(), &[]).ok()?.as_constant()
}

impl RationalSurface {
    /// Parses JSON: a map with X, Y, Z and W, or patches. With `reduce`, a common factor of the
    /// four polynomials is divided out.
    ///
    /// # Errors
    /// [`RationalSurfaceError`] if the text is neither a valid map nor valid patches.
    pub fn parse(text: &str, reduce: bool) -> Result<Self, RationalSurfaceError> {
        let json = serde_json::from_str::<Value>(text).ok();
        if let Some(json) = json.filter(is_patch_file) {
            let patch = |p: FilePatch| Patch::new(p.name, p.degree, p.control.exact());
            let patches = read_patches(&json)?.into_iter().map(patch);
            return Ok(Self::Patches(patches.collect()));
        }
        let map = Map::new(read_map(text)?.polynomials, MapOptions { reduce })?;
        Ok(Self::Map(Box::new(map)))
    }

    /// Returns true if the surface is that of a map.
    pub fn is_map(&self) -> bool {
        matches!(self, Self::Map(_))
    }

    /// Returns the bounding box of the surface over a region of parameters; `None` if it is not
    /// proved to be bounded.
    pub fn bounds(&self, domain: Option<&Domain>) -> Option<SurfaceBox> {
        match self {
            Self::Map(map) => domain.and_then(|d| SurfaceBox::of_map(map, d)),
            Self::Patches(patches) => SurfaceBox::of_patches(patches),
        }
    }

    /// Returns the default options, with a time limit: sheets of maps are joined, those of patches
    /// are not.
    pub fn options(&self, around: &SurfaceBox, limit: Option<Duration>) -> TriangulateOptions {
        let mut options = TriangulateOptions::of_patches(around);
        if self.is_map() {
            options.mode = Mode::Glued;
        }
        if let Some(limit) = limit {
            options.budget.seconds = EXACT_TIME_SHARE * limit.as_secs_f64();
        }
        options
    }

    /// Triangulates the surface and checks the triangles; `is_box_chosen` states that the box of
    /// the options was computed, and not given.
    ///
    /// # Errors
    /// [`PatchesError`] if the surface cannot be triangulated, or on a stop.
    pub fn triangulate(
        self,
        options: TriangulateOptions,
        is_box_chosen: bool,
        control: &Control<'_>,
    ) -> Result<TriangulatedSurface, PatchesError> {
        let (surface, known, patches) = match self {
            Self::Map(map) => {
                let (surface, analysis) = triangulate(&map, &options, control)?;
                (surface, vec![(*map, analysis)], Vec::new())
            }
            Self::Patches(list) => {
                let names = list.iter().map(|p| p.name.clone()).collect();
                let (surface, known) = triangulate_patches(&list, &options, control)?;
                (surface, known, names)
            }
        };
        let seconds = seconds_by_phase(&known);
        let (maps, analyses) = known.into_iter().unzip();
        let topology = topology(&surface.triangles);
        Ok(TriangulatedSurface {
            maps,
            analyses,
            patches,
            is_box_chosen,
            options,
            surface,
            beyond: Vec::new(),
            topology,
            seconds,
        })
    }
}

/// Returns the total time of each phase over all maps, in seconds, in the order in which phases
/// first occur.
fn seconds_by_phase(known: &[(Map, Analysis)]) -> Vec<(&'static str, f64)> {
    let mut seconds: Vec<(&'static str, f64)> = Vec::new();
    for &(phase, s) in known.iter().flat_map(|k| &k.1.seconds) {
        match seconds.iter_mut().find(|known| known.0 == phase) {
            Some(known) => known.1 += s,
            None => seconds.push((phase, s)),
        }
    }
    seconds
}

/// Triangulated surface with all facts and claims about it.
#[derive(Debug)]
pub struct TriangulatedSurface {
    /// The map, or the map of each patch.
    pub maps: Vec<Map>,
    /// Exact facts about each map.
    pub analyses: Vec<Analysis>,
    /// Names of the patches; empty for a map.
    pub patches: Vec<String>,
    /// True if the box was computed from bounds of the surface, false if it was given.
    pub is_box_chosen: bool,
    /// Options of the triangulation.
    pub options: TriangulateOptions,
    /// Triangles, with the claims about them.
    pub surface: Surface,
    /// Triangles of the points that only complex parameters reach; empty unless requested.
    pub beyond: Vec<Surface>,
    /// Topology of the triangles.
    pub topology: Topology,
    /// Computing time by phase, in seconds.
    pub seconds: Vec<(&'static str, f64)>,
}

impl TriangulatedSurface {
    /// Triangulates the surface beyond the border of the real image, with these options, if
    /// linear deck transformations determine its parameters: see [`isoform_tess::RealBorder`].
    ///
    /// # Errors
    /// [`PatchesError::Stopped`] on a stop; other errors if that surface cannot be triangulated.
    pub fn draw_complex(&mut self, control: &Control<'_>) -> Result<(), PatchesError> {
        for map in &self.surface.real_border.beyond {
            self.beyond
                .push(triangulate(map, &self.options, control)?.0);
        }
        Ok(())
    }

    /// Returns true if no finding contradicts a claim.
    pub fn is_certified(&self) -> bool {
        self.surface.is_certified() && self.beyond.iter().all(Surface::is_certified)
    }

    /// Returns the triangles as a mesh, with a part for each patch, or with one part for the points
    /// that real parameters reach and one for those that only complex ones reach.
    pub fn mesh(&self) -> Mesh {
        let surface = &self.surface;
        let mut mesh = Mesh::from_triangles(surface.points.clone(), surface.triangles.clone());
        mesh.triangle_parts.clone_from(&surface.patches);
        mesh.parts.clone_from(&self.patches);
        if !self.beyond.is_empty() {
            mesh.triangle_parts = vec![0; mesh.triangles.len()];
            mesh.parts = ["real parameters", "complex parameters"]
                .map(String::from)
                .into();
        }
        for more in &self.beyond {
            let before = mesh.points.len() as u32;
            mesh.points.extend(&more.points);
            let moved = more.triangles.iter().map(|t| t.map(|v| v + before));
            mesh.triangles.extend(moved);
            mesh.triangle_parts.resize(mesh.triangles.len(), 1);
        }
        mesh
    }

    /// Returns the data of the report; `file` is the name of the surface's file.
    pub fn about<'a>(&'a self, file: &'a str) -> AboutSurface<'a> {
        AboutSurface {
            file,
            maps: &self.maps,
            analyses: &self.analyses,
            patches: self.patches.len(),
            options: &self.options,
            is_box_chosen: self.is_box_chosen,
            surface: &self.surface,
            beyond: &self.beyond,
            topology: &self.topology,
            seconds: &self.seconds,
        }
    }

    /// Returns the parameters s and t of each vertex, in the first triangle that contains it;
    /// infinite parameters are not finite numbers.
    pub fn parameters(&self) -> Vec<[f64; 2]> {
        let surface = &self.surface;
        let mut all = vec![[f64::NAN; 2]; surface.points.len()];
        let triangles = surface.triangles.iter().zip(&surface.charts);
        for ((triangle, chart), corners) in triangles.zip(&surface.corners).rev() {
            for (v, corner) in triangle.iter().zip(corners) {
                all[*v as usize] = affine(*chart, *corner, surface.frame.as_ref());
            }
        }
        all
    }
}

/// Returns s and t of a point of a unit triangle, mapped by a frame.
fn affine(chart: u8, [u, v]: [f64; 2], frame: Option<&[[f64; 3]; 3]>) -> [f64; 2] {
    let [s, t] = QUADRANTS[usize::from(chart)].map(|sign| sign as f64);
    let place = [s * u, t * v, 1.0 - u - v];
    let [s, t, w] = match frame {
        None => place,
        Some(rows) => rows.map(|row| (0..3).map(|k| row[k] * place[k]).sum()),
    };
    [s / w, t / w]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_lead_to_the_vertices() {
        let sphere = r#"{"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}"#;
        let surface = RationalSurface::parse(sphere, false).expect("a map");
        let around = SurfaceBox {
            half_width: RBig::from(2),
            size: 2.0,
        };
        let options = surface.options(&around, None);
        let made = surface.triangulate(options, false, &Control::default());
        let made = made.expect("triangles");
        let parameters = made.parameters();
        let finite = parameters
            .iter()
            .filter(|p| p.iter().all(|v| v.is_finite()));
        assert!(10 * finite.count() > 9 * parameters.len());
        for ([s, t], p) in parameters.iter().zip(&made.surface.points) {
            let w = s * s + t * t + 1.0;
            let at = [2.0 * s / w, 2.0 * t / w, (w - 2.0) / w];
            let off = (0..3).map(|k| (at[k] - p[k]).abs()).fold(0.0, f64::max);
            assert!(!w.is_finite() || off < 1e-9, "{s} {t}: {at:?}, not {p:?}");
        }
    }

    #[test]
    fn what_is_no_surface_is_refused() {
        let refused = |text: &str| RationalSurface::parse(text, false).expect_err("refused");
        assert!(matches!(refused("{"), RationalSurfaceError::File(_)));
        assert!(matches!(
            refused(r#"{"X": "s"}"#),
            RationalSurfaceError::File(_)
        ));
        let flat = r#"{"X": "0", "Y": "0", "Z": "0", "W": "1"}"#;
        assert!(matches!(refused(flat), RationalSurfaceError::Map(_)));
    }
}
