//! `view`: one page, offline, with what Isoform makes as layers.

use crate::brep::Solids;
use crate::error::Trouble;
use crate::fit::Fit;
use crate::implicitize::Fitted;
use crate::mesh::MeshData;
use crate::model::Program;
use crate::parameterize::Patches;
use crate::points::Cloud;
use crate::region::{Corners, some_region};
use crate::run::{self, Asked};
use crate::triangulate::Triangulation;
use isoform::geom::{Aabb, Mesh};
use isoform::{
    Control, ExactSolid, LiveModel, MeshModelError, MeshModelOptions, Unseen, mesh_model,
    mesh_spline,
};
use isoform_view::{Page, ShownPatch, ShownPoints};
use pyo3::prelude::*;

/// What a page can show.
#[derive(FromPyObject)]
pub(crate) enum Shown {
    #[pyo3(transparent)]
    Points(Py<Cloud>),
    #[pyo3(transparent)]
    Mesh(Py<MeshData>),
    #[pyo3(transparent)]
    Fit(Py<Fit>),
    #[pyo3(transparent)]
    Fitted(Py<Fitted>),
    #[pyo3(transparent)]
    Patches(Py<Patches>),
    #[pyo3(transparent)]
    Map(Py<Triangulation>),
    #[pyo3(transparent)]
    Solids(Py<Solids>),
    /// A program with the values of its first parameters.
    Model(Py<Program>, Vec<f64>),
}

/// The page of some things with their names, as text.
#[pyfunction]
pub(crate) fn page(
    py: Python<'_>,
    title: String,
    layers: Vec<(String, Shown)>,
    corners: Option<Corners>,
    asked: Asked<'_>,
) -> PyResult<String> {
    let region = some_region(corners)?;
    let html = run::run(py, &asked, move |control| {
        let mut page = Page::new(title);
        for (name, shown) in &layers {
            add(&mut page, name, shown, region, control)?;
        }
        Ok::<_, Trouble>(page.html())
    })?;
    Ok(html?)
}

/// Adds a layer, or two.
fn add(
    page: &mut Page,
    name: &str,
    shown: &Shown,
    region: Option<Aabb>,
    control: &Control<'_>,
) -> Result<(), Trouble> {
    match shown {
        Shown::Points(cloud) => {
            let cloud = &cloud.get().cloud;
            if cloud.points.is_empty() {
                return Err(Trouble::new("no-points", "there are no points to show"));
            }
            page.points(name, &ShownPoints::new(cloud));
        }
        Shown::Mesh(mesh) => page.mesh(name, &mesh.get().mesh),
        Shown::Fit(fit) => add_fit(page, name, fit.get()),
        Shown::Fitted(fitted) => {
            let options = MeshModelOptions::of_surface(region);
            let made = mesh_spline(fitted.get().function(), Unseen::Cut, &options, control)?;
            page.mesh(name, &made.meshed.mesh);
        }
        Shown::Patches(patches) => page.patches(name, &shown_patches(patches.get())),
        Shown::Map(drawn) => add_map(page, name, drawn.get()),
        Shown::Solids(solids) => {
            let brep = solids.get().made.built.brep.clone();
            let solid = ExactSolid::new(brep, None, control);
            page.solid(name, &solid.map_err(|e| Trouble::new("not-closed", e))?);
        }
        Shown::Model(program, given) => {
            let program = program.get();
            let values = program.values_of(given)?;
            let model = program.model();
            let live = LiveModel::new(model, &values, region, control)?;
            match live.filter(Page::can_draw) {
                Some(live) => page.model(name, model.info().title.as_deref(), &live),
                None => page.meshed_model(name, &meshed(program, &values, region, control)?),
            }
        }
    }
    Ok(())
}

/// The points of a fit with their deviations, and the model.
fn add_fit(page: &mut Page, name: &str, fit: &Fit) {
    let found = &fit.found;
    let deviation = found.deviation();
    let points = ShownPoints {
        deviation: Some(&deviation),
        outliers: &found.fit.outliers,
        ..ShownPoints::new(&found.cloud)
    };
    page.points("points", &points);
    if let Some(live) = LiveModel::of_fit(found).filter(Page::can_draw) {
        page.model(name, None, &live);
    }
}

/// A rational surface; of patches their triangles.
fn add_map(page: &mut Page, name: &str, drawn: &Triangulation) {
    let drawn = &drawn.drawn;
    let is_map = drawn.patches.is_empty();
    match (drawn.maps.first(), drawn.analyses.first()) {
        (Some(map), Some(analysis)) if is_map => {
            let half_width = drawn.options.half_width.to_f64_fast();
            page.map(name, map, &drawn.surface, analysis, half_width);
        }
        _ => page.mesh(name, &drawn.mesh()),
    }
}

pub(crate) fn shown_patches(patches: &Patches) -> Vec<ShownPatch> {
    let all = patches.patches.iter().enumerate();
    all.map(|(i, p)| ShownPatch {
        patch: p.grown.patch.clone(),
        name: format!("patch {}", i + 1),
        distance: p.distances.bound,
    })
    .collect()
}

/// The mesh of a model that a page cannot draw itself.
pub(crate) fn meshed(
    program: &Program,
    values: &[f64],
    region: Option<Aabb>,
    control: &Control<'_>,
) -> Result<Mesh, MeshModelError> {
    let made = mesh_model(
        program.model(),
        values,
        &MeshModelOptions::of_surface(region),
        control,
    )?;
    Ok(made.meshed.mesh)
}
