//! Sheets with several views.

use crate::camera::{Camera, FOV, View};
use isoform::geom::Aabb;

/// View on a sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Pane {
    /// Name, written into its corner; may be empty.
    pub name: String,
    /// Upper left corner on the sheet, in pixels.
    pub at: [u32; 2],
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Camera of the view.
    pub camera: Camera,
}

/// Projection of panes without a camera of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// True if rays are parallel.
    pub orthographic: bool,
    /// Vertical angle of view, in degrees.
    pub fov: f64,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            orthographic: false,
            fov: FOV,
        }
    }
}

/// Returns panes of equal size for several views, row by row, on a grid that is as square as
/// possible; each shows all of the box. Several views have parallel rays and one scale, as in
/// technical drawings.
///
/// ```
/// use isoform::geom::Aabb;
/// use isoform_render::{Look, View, panes};
/// let cube = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
/// let views = [("front", View::Front), ("top", View::Top), ("right", View::Right)];
/// let panes = panes(&cube, &views, [900, 600], Look::default());
/// assert_eq!(panes[2].at, [0, 300]);
/// assert_eq!(panes[2].size, [450, 300]);
/// let height = panes[0].camera.height;
/// assert!(panes.iter().all(|p| p.camera.orthographic && p.camera.height == height));
/// ```
pub fn panes(bounds: &Aabb, views: &[(&str, View)], size: [u32; 2], look: Look) -> Vec<Pane> {
    let columns = (1..).find(|c| c * c >= views.len()).unwrap_or(1) as u32;
    let rows = (views.len() as u32).div_ceil(columns);
    let grid = [columns, rows];
    let border =
        |k: usize, i: u32| (u64::from(size[k]) * u64::from(i) / u64::from(grid[k].max(1))) as u32;
    let is_flat = look.orthographic || views.len() > 1;
    let each = views.iter().zip(0..);
    let pane = |((name, view), i): (&(&str, View), u32)| {
        let cell = [i % columns, i / columns];
        let at: [u32; 2] = std::array::from_fn(|k| border(k, cell[k]));
        let size: [u32; 2] = std::array::from_fn(|k| (border(k, cell[k] + 1) - at[k]).max(1));
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        Pane {
            name: if views.len() > 1 {
                (*name).to_owned()
            } else {
                String::new()
            },
            at,
            size,
            camera: Camera::fitted(bounds, *view, aspect, look.fov, is_flat),
        }
    };
    let mut panes: Vec<Pane> = each.map(pane).collect();
    let scale = |p: &Pane| p.camera.height / f64::from(p.size[1]);
    let most = panes.iter().map(scale).fold(0.0, f64::max);
    for pane in panes.iter_mut().filter(|_| is_flat) {
        pane.camera.height = most * f64::from(pane.size[1]);
    }
    panes
}
