//! `render`: pictures without a display, of what `view` shows.

use crate::error::Trouble;
use crate::model::Program;
use crate::region::{Corners, some_region};
use crate::run::{self, Asked};
use crate::view::{Shown, meshed, shown_patches};
use isoform::geom::Aabb;
use isoform::{Control, ExactSolid, LiveModel, MeshModelOptions, Unseen, mesh_spline, solid_of};
use isoform_render::{
    Camera, CameraError, Color, ColorBy, Drawing, FOV, Layer, Look, Pane, Patch, Picture, Scene,
    Section, ShownModel, Style, View, draw_legend, draw_svg, legend_width, panes, render,
    write_png,
};
use isoform_view::ShownPatch;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// How a picture is asked for.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Wanted {
    /// Width and height in pixels.
    size: [u32; 2],
    /// Names of standard views.
    views: Vec<String>,
    /// The eye, and what it looks at, in the place of a view.
    camera: Option<[f64; 6]>,
    /// A normal and an offset: what lies beyond is cut away.
    section: Option<[f64; 4]>,
    color_by: Option<String>,
    background: Color,
    legend: bool,
    /// Whether a drawing is wanted, not a picture of pixels.
    svg: bool,
}

/// What is drawn, and how.
struct Order {
    wanted: Wanted,
    section: Option<Section>,
    by: Option<ColorBy>,
    region: Option<Aabb>,
}

/// The bytes of a picture (PNG, or SVG) of some things with their names.
#[pyfunction]
pub(crate) fn picture<'py>(
    py: Python<'py>,
    layers: Vec<(String, Shown)>,
    wanted: Wanted,
    corners: Option<Corners>,
    asked: Asked<'_>,
) -> PyResult<Bound<'py, PyBytes>> {
    let order = order(wanted, some_region(corners)?)?;
    let bytes = run::run(py, &asked, move |control| order.drawn(&layers, control))?;
    Ok(PyBytes::new(py, &bytes?))
}

/// Checks what can be wrong before any work.
fn order(wanted: Wanted, region: Option<Aabb>) -> Result<Order, Trouble> {
    let section = match wanted.section {
        Some([x, y, z, d]) => Some(
            Section::new([x, y, z], d)
                .ok_or_else(|| Trouble::usage("the normal of the section is zero"))?,
        ),
        None => None,
    };
    let by = match &wanted.color_by {
        Some(text) => Some(named("color_by", text, &ColorBy::ALL)?),
        None => None,
    };
    Ok(Order {
        wanted,
        section,
        by,
        region,
    })
}

/// One of the values that have names.
fn named<T: Copy>(what: &str, text: &str, all: &[(&str, T)]) -> Result<T, Trouble> {
    let found = all.iter().find(|(name, _)| *name == text);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
        Trouble::usage(format!("{what} is {text:?}")).hint(format!("one of {}", names.join(", ")))
    })
}

/// A camera that shows nothing.
fn refused(error: CameraError) -> Trouble {
    Trouble::usage(error.to_string())
}

impl Order {
    fn drawn(&self, shown: &[(String, Shown)], control: &Control<'_>) -> Result<Vec<u8>, Trouble> {
        let mut scene = Scene {
            layers: Vec::new(),
            section: self.section,
        };
        let beside = self.first_model(shown, control)?;
        for (name, shown) in shown {
            let layer = self.layer(name, shown, beside.as_ref(), control)?;
            scene.layers.push(layer);
        }
        if !scene.is_left() {
            let message = "the section leaves nothing to be seen";
            return Err(Trouble::new("nothing", message).hint("the opposite normal"));
        }
        let room = self.room(&scene);
        let panes = self.panes(&scene.bounds(), room)?;
        if self.wanted.svg {
            let names: Vec<&str> = shown.iter().map(|(name, _)| name.as_str()).collect();
            let drawing = Drawing {
                style: self.style(),
                hidden: false,
                legend: self.wanted.legend,
                has_room: room > 0,
                title: names.join(", "),
            };
            let text = draw_svg(&scene, &panes, self.wanted.size, &drawing, control)?;
            return Ok(text.into_bytes());
        }
        self.png(&scene, &panes, room, control)
    }

    fn style(&self) -> Style {
        Style {
            background: self.wanted.background,
            ..Style::default()
        }
    }

    /// The width that several views leave for what their colours mean.
    fn room(&self, scene: &Scene) -> u32 {
        let width = legend_width(&scene.layers);
        let is_sheet = self.wanted.views.len() > 1 && self.wanted.camera.is_none();
        let is_wanted = self.wanted.legend && is_sheet && 3 * width < self.wanted.size[0];
        if is_wanted { width } else { 0 }
    }

    /// The views, in which a box is seen.
    fn panes(&self, bounds: &Aabb, room: u32) -> Result<Vec<Pane>, Trouble> {
        let size = [self.wanted.size[0] - room, self.wanted.size[1]];
        if let Some([px, py, pz, tx, ty, tz]) = self.wanted.camera {
            let camera = Camera::looking([px, py, pz], [tx, ty, tz], FOV, false);
            return Ok(vec![Pane {
                name: String::new(),
                at: [0, 0],
                size,
                camera: camera.map_err(refused)?,
            }]);
        }
        let views = self.wanted.views.iter();
        let views = views.map(|v| Ok((v.as_str(), named("view", v, &View::ALL)?)));
        let views: Vec<(&str, View)> = views.collect::<Result<_, Trouble>>()?;
        let look = Look {
            orthographic: false,
            fov: FOV,
        };
        let panes = panes(bounds, &views, size, look);
        for pane in &panes {
            pane.camera.check().map_err(refused)?;
        }
        Ok(panes)
    }

    fn png(
        &self,
        scene: &Scene,
        panes: &[Pane],
        room: u32,
        control: &Control<'_>,
    ) -> Result<Vec<u8>, Trouble> {
        let (style, background) = (self.style(), self.wanted.background);
        let mut sheet = Picture::blank(self.wanted.size, background);
        for pane in panes {
            let picture = render(scene, &pane.camera, pane.size, &style, control)?;
            sheet.put(&picture, pane.at);
        }
        for pane in panes {
            sheet.title(pane.at, &pane.name, background);
        }
        if self.wanted.legend {
            draw_legend(&mut sheet, &scene.layers, background, room > 0);
        }
        write_png(&sheet).map_err(|_| Trouble::internal())
    }

    /// The first model, from which points beside it are measured.
    fn first_model(
        &self,
        shown: &[(String, Shown)],
        control: &Control<'_>,
    ) -> Result<Option<LiveModel>, Trouble> {
        let model = shown.iter().find_map(|(_, shown)| match shown {
            Shown::Model(program, given) => Some((program.get(), given)),
            _ => None,
        });
        let Some((program, given)) = model else {
            return Ok(None);
        };
        let values = program.values_of(given)?;
        Ok(LiveModel::new(
            program.model(),
            &values,
            self.region,
            control,
        )?)
    }

    /// A layer as it is drawn.
    fn layer(
        &self,
        name: &str,
        shown: &Shown,
        beside: Option<&LiveModel>,
        control: &Control<'_>,
    ) -> Result<Layer, Trouble> {
        let (by, section) = (self.by, self.section.as_ref());
        Ok(match shown {
            Shown::Points(cloud) => {
                let cloud = &cloud.get().cloud;
                if cloud.points.is_empty() {
                    return Err(Trouble::new("no-points", "there are no points to show"));
                }
                let by = by.or_else(|| beside.map(|_| ColorBy::Deviation));
                let deviation = beside.map(|model| model.deviations(cloud));
                Layer::points(name, cloud, deviation.as_deref(), by)
            }
            Shown::Fit(fit) => {
                let found = &fit.get().found;
                let by = by.or(Some(ColorBy::Deviation));
                Layer::points(name, &found.cloud, Some(&found.deviation()), by)
            }
            Shown::Mesh(mesh) => Layer::mesh(name, &mesh.get().mesh, by, section),
            Shown::Fitted(fitted) => {
                let options = MeshModelOptions::of_surface(self.region);
                let function = fitted.get().function();
                let made = mesh_spline(function, Unseen::Cut, &options, control)?;
                Layer::meshed_model(name, &made.meshed.mesh, by, section)
            }
            Shown::Patches(patches) => {
                let patch = |p: ShownPatch| Patch {
                    patch: p.patch,
                    name: p.name,
                    distance: p.distance,
                };
                let patches = shown_patches(patches.get()).into_iter();
                Layer::patches(name, &patches.map(patch).collect::<Vec<_>>(), by)
            }
            Shown::Map(drawn) => {
                let drawn = &drawn.get().drawn;
                match drawn.maps.first().filter(|_| drawn.patches.is_empty()) {
                    Some(map) => Layer::map(name, map, &drawn.surface, by),
                    None => Layer::mesh(name, &drawn.mesh(), by, section),
                }
            }
            Shown::Solids(solids) => {
                let brep = solids.get().made.built.brep.clone();
                let solid = ExactSolid::new(brep, None, control);
                let solid = solid.map_err(|e| Trouble::new("not-closed", e))?;
                Layer::solid(name, &solid.mesh(), by, section)
            }
            Shown::Model(program, given) => self.model(name, program.get(), given, control)?,
        })
    }

    /// A model by its own function, or by its mesh where that is not known as an expression.
    fn model(
        &self,
        name: &str,
        program: &Program,
        given: &[f64],
        control: &Control<'_>,
    ) -> Result<Layer, Trouble> {
        let values = program.values_of(given)?;
        let Some(live) = LiveModel::new(program.model(), &values, self.region, control)? else {
            let mesh = meshed(program, &values, self.region, control)?;
            return Ok(Layer::meshed_model(
                name,
                &mesh,
                self.by,
                self.section.as_ref(),
            ));
        };
        let shown = ShownModel {
            solid: solid_of(program.model(), &values)?.0,
            bounds: live.bounds,
            is_cut: live.is_cut,
            names: &live.readings.part_names,
        };
        Ok(Layer::model(name, shown, self.by, control)?)
    }
}
