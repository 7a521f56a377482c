//! The arguments of `render` that say from where: sizes, cameras, views.

use crate::arguments;
use crate::failure::Failure;
use isoform::geom::Aabb;
use isoform_render::{Camera, CameraError, FOV, Look, Pane, View, panes};
use serde_json::{Value, json};

/// Pixels of a side, and of a picture, at most: what most viewers still open.
const MOST_SIDE: u32 = 32_768;
const MOST_PIXELS: u64 = 100_000_000;

/// The size of a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size(pub(super) [u32; 2]);

/// Reads `1200x900`, or both numbers with a comma.
fn size(text: &str) -> Result<Size, String> {
    let (width, height) = text
        .split_once(['x', 'X', '×', ','])
        .ok_or("a width and a height are expected, as in 1200x900")?;
    let side = |word: &str| match word.trim().parse::<u64>() {
        Ok(0) => Err("a picture has at least one pixel".to_owned()),
        Ok(v) => u32::try_from(v)
            .ok()
            .filter(|v| *v <= MOST_SIDE)
            .ok_or_else(|| format!("a side has at most {MOST_SIDE} pixels")),
        Err(_) => Err(format!("`{}` is no number of pixels", word.trim())),
    };
    let size = [side(width)?, side(height)?];
    if u64::from(size[0]) * u64::from(size[1]) > MOST_PIXELS {
        return Err(format!("a picture has at most {MOST_PIXELS} pixels"));
    }
    Ok(Size(size))
}

/// Positions of the eye and of the target.
#[derive(Clone, Copy, Debug)]
struct Eye([f64; 6]);

/// Reads six numbers.
fn eye(text: &str) -> Result<Eye, String> {
    let numbers = arguments::numbers(text)?;
    numbers.try_into().map(Eye).map_err(|_| {
        "six numbers are expected, x,y,z of the eye and of what it looks at".to_owned()
    })
}

/// A standard view.
#[derive(Clone, Copy, Debug)]
struct Named(&'static str, View);

/// Reads the name of a view.
fn view(text: &str) -> Result<Named, String> {
    let found = View::ALL
        .iter()
        .find(|(name, _)| name.eq_ignore_ascii_case(text.trim()));
    found.map(|(name, view)| Named(name, *view)).ok_or_else(|| {
        let names = View::ALL.map(|(name, _)| name).join(", ");
        format!("no view is called `{}`; there are {names}", text.trim())
    })
}

/// From where the picture is seen.
#[derive(clap::Args)]
pub(super) struct Cameras {
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1200x900", value_parser = size)]
    pub(super) size: Size,
    /// Positions of the eye and of the target in model units; z points up
    #[arg(long, value_name = "PX,PY,PZ,TX,TY,TZ", allow_hyphen_values = true, value_parser = eye,
        conflicts_with_all = ["view", "views"])]
    camera: Option<Eye>,
    /// A standard view in which all is seen: iso, front, back, right, left, top, bottom
    #[arg(long, value_name = "NAME", default_value = "iso", value_parser = view)]
    view: Named,
    /// Several of them on one sheet, with parallel rays and at one scale
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = view,
        conflicts_with = "view")]
    views: Vec<Named>,
    /// Parallel rays instead of perspective
    #[arg(long)]
    orthographic: bool,
    /// The angle of view over the height, in degrees
    #[arg(long, value_name = "DEGREES", default_value_t = FOV)]
    fov: f64,
}

/// Views on a sheet at most.
const MOST_VIEWS: usize = 16;

impl Cameras {
    /// Checks the numbers before the work.
    pub(super) fn check(&self) -> Result<(), Failure> {
        if !(self.fov > 0.0 && self.fov < 180.0) {
            return Err(refused(CameraError::Fov(self.fov)));
        }
        if self.views.len() > MOST_VIEWS {
            let message = format!(
                "{} views: a sheet has at most {MOST_VIEWS}",
                self.views.len()
            );
            return Err(Failure::usage(message).hint("several sheets"));
        }
        self.given().map(|_| ())
    }

    /// Returns the camera of the arguments; `None` for the default.
    fn given(&self) -> Result<Option<Camera>, Failure> {
        let Some(Eye([px, py, pz, tx, ty, tz])) = self.camera else {
            return Ok(None);
        };
        Camera::looking([px, py, pz], [tx, ty, tz], self.fov, self.orthographic)
            .map(Some)
            .map_err(refused)
    }

    /// Returns true if there are several views.
    pub(super) fn is_sheet(&self) -> bool {
        self.views.len() > 1
    }

    /// Returns the views of the picture for a box; `room` is the width kept free for the legend.
    pub(super) fn panes(&self, bounds: &Aabb, room: u32) -> Result<Vec<Pane>, Failure> {
        let size = [self.size.0[0] - room, self.size.0[1]];
        if let Some(camera) = self.given()? {
            return Ok(vec![Pane {
                name: String::new(),
                at: [0, 0],
                size,
                camera,
            }]);
        }
        let look = Look {
            orthographic: self.orthographic,
            fov: self.fov,
        };
        let one = [self.view];
        let asked = if self.views.is_empty() {
            &one[..]
        } else {
            &self.views
        };
        let views: Vec<(&str, View)> = asked.iter().map(|Named(n, v)| (*n, *v)).collect();
        let panes = panes(bounds, &views, size, look);
        for pane in &panes {
            pane.camera.check().map_err(refused)?;
        }
        Ok(panes)
    }
}

/// A camera that shows nothing.
fn refused(error: CameraError) -> Failure {
    Failure::usage(error.to_string()).hint(match error {
        CameraError::Fov(_) => "--fov 35",
        _ => "--camera with x,y,z of the eye and of another place that it looks at, or --view",
    })
}

/// A camera in reports: as the page tells its own.
pub(super) fn report(camera: &Camera) -> Value {
    json!({
        "position": camera.position,
        "target": camera.target,
        "up": camera.up,
        "orthographic": camera.orthographic,
        "fov": camera.fov,
        "height": camera.height,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_limits() {
        assert_eq!(size("640x480").expect("a size").0, [640, 480]);
        for text in [
            "0x0",
            "10x0",
            "9999999x9999999",
            "20000x20000",
            "x",
            "10",
            "-1x5",
            "1e3x5",
        ] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
