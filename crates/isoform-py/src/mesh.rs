//! `mesh`: labelled surfaces and tetrahedra of a model, with a certificate.

use crate::arrays::rows;
use crate::document;
use crate::error::Trouble;
use crate::model::Program;
use crate::region::{Corners, length, some_region};
use crate::run::{self, Asked};
use crate::shape::Shape;
use isoform::check::Limits;
use isoform::geom::Mesh;
use isoform::io::{MeshWriteOptions, write_mesh_path};
use isoform::mesh::{Layers, Options};
use isoform::report::{MeshReport, ModelName, Seconds};
use isoform::{MeshModelOptions, RegionModel, Unseen, mesh_model_regions, mesh_spline};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Bytes of a GiB.
const GIB: f64 = (1u64 << 30) as f64;

/// How a model is meshed, as Python says it.
#[derive(FromPyObject)]
pub(crate) struct Wanted {
    #[pyo3(item)]
    size: Option<f64>,
    #[pyo3(item)]
    order: u32,
    #[pyo3(item)]
    surface_only: bool,
    #[pyo3(item)]
    region: Option<Corners>,
    #[pyo3(item)]
    periodic: [bool; 3],
    #[pyo3(item)]
    layers: Option<(Vec<String>, f64, f64, usize)>,
    #[pyo3(item)]
    grade: Option<f64>,
    #[pyo3(item)]
    angles: Option<[f64; 2]>,
    #[pyo3(item)]
    memory: Option<f64>,
    #[pyo3(item)]
    close: bool,
}

impl Wanted {
    /// Bounds of dihedral angles that some mesh may keep: a regular tetrahedron has 70.5 degrees.
    fn angles(&self) -> Result<Option<[f64; 2]>, Trouble> {
        match self.angles {
            Some([min, max]) if !((0.0..=70.0).contains(&min) && (71.0..=180.0).contains(&max)) => {
                let message = format!("angles are {min} and {max}");
                Err(Trouble::usage(message).hint("at most 70 and at least 71 degrees"))
            }
            angles => Ok(angles),
        }
    }

    /// Layers of wedges: their parts, the first thickness, the growth and the number of layers.
    fn layers(&self) -> Option<Layers> {
        let (parts, first, growth, count) = self.layers.clone()?;
        Some(Layers {
            parts,
            first,
            growth,
            count,
        })
    }

    /// As the library takes it.
    pub(crate) fn options(&self) -> Result<MeshModelOptions, Trouble> {
        let usual = Options::default();
        let memory = length("memory", self.memory)?;
        Ok(MeshModelOptions {
            size: length("size", self.size)?,
            limits: self
                .angles()?
                .map_or(Limits::default(), |[min, max]| Limits {
                    dihedral_min: min,
                    dihedral_max: max,
                    ..Limits::default()
                }),
            mesh: Options {
                grade: length("grade", self.grade)?,
                order: self.order,
                surface_only: self.surface_only,
                region: some_region(self.region)?,
                periodic: self.periodic,
                layers: self.layers(),
                angles: self.angles.unwrap_or(usual.angles),
                memory: memory.map_or(usual.memory, |gib| (gib * GIB) as u64),
                ..usual
            },
        })
    }
}

/// A mesh.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct MeshData {
    pub(crate) mesh: Mesh,
    unit: Option<String>,
    document: String,
}

impl MeshData {
    /// A mesh out of a file, or of another verb, with its document.
    pub(crate) fn new(mesh: Mesh, unit: Option<String>, document: String) -> Self {
        Self {
            mesh,
            unit,
            document,
        }
    }
}

#[pymethods]
impl MeshData {
    /// The document of `mesh --json`, as text.
    #[getter]
    fn document(&self) -> &str {
        &self.document
    }
    /// The names of the parts, of the regions and of the feature curves.
    #[getter]
    fn names(&self) -> (Vec<String>, Vec<String>, Vec<String>) {
        let curves = self.mesh.curves.iter().map(|c| c.name.clone());
        (
            self.mesh.parts.clone(),
            self.mesh.regions.clone(),
            curves.collect(),
        )
    }
    /// The nodes.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, self.mesh.points.clone())
    }
    /// The nodes of the triangles: corners, then those in the middles of edges.
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let (corners, mids) = (&self.mesh.triangles, &self.mesh.triangle_mids);
        if mids.is_empty() {
            return rows(py, corners.clone());
        }
        let both = corners.iter().zip(mids);
        let whole = |(c, m): (&[u32; 3], &[u32; 3])| [c[0], c[1], c[2], m[0], m[1], m[2]];
        rows(py, both.map(whole).collect())
    }
    /// The nodes of the tetrahedra: corners, then those in the middles of edges.
    fn tetrahedra<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let (corners, mids) = (&self.mesh.tets, &self.mesh.tet_mids);
        if mids.is_empty() {
            return rows(py, corners.clone());
        }
        let whole = |(c, m): (&[u32; 4], &[u32; 6])| {
            [c[0], c[1], c[2], c[3], m[0], m[1], m[2], m[3], m[4], m[5]]
        };
        rows(py, corners.iter().zip(mids).map(whole).collect())
    }
    /// The nodes of the wedges.
    fn wedges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        rows(py, self.mesh.wedges.clone())
    }
    /// The nodes of the quadrilaterals.
    fn quads<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        rows(py, self.mesh.quads.clone())
    }
    /// The part of each quadrilateral.
    fn quad_parts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.mesh.quad_parts)
    }
    /// The mesh with tetrahedra for wedges and triangles for quadrilaterals.
    fn simplices(&self) -> Self {
        Self {
            mesh: self.mesh.simplices().into_owned(),
            unit: self.unit.clone(),
            document: self.document.clone(),
        }
    }
    /// The part of each triangle.
    fn triangle_parts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.mesh.triangle_parts)
    }
    /// The region of each tetrahedron.
    fn regions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.mesh.tet_regions)
    }
    /// The nodes of a unit cell on its lower and upper sides, by axes along which it repeats.
    fn opposite<'py>(&self, py: Python<'py>) -> PyResult<Vec<(usize, Bound<'py, PyArray2<u32>>)>> {
        let sides = self.mesh.opposite.iter();
        sides
            .map(|sides| Ok((sides.axis, rows(py, sides.nodes.clone())?)))
            .collect()
    }
    /// Writes a file; its ending names the format, unless one is given.
    fn save(&self, py: Python<'_>, path: PathBuf, format: Option<&str>) -> PyResult<Vec<String>> {
        let options = MeshWriteOptions {
            units: self.unit.clone(),
            ..MeshWriteOptions::default()
        };
        let report = run::shortly(py, || {
            write_mesh_path(&self.mesh, &path, format, &options).map_err(Trouble::from)
        })??;
        Ok(report.warnings)
    }
}

/// Meshes a model with the values of its parameters; the name is for the document.
#[pyfunction]
pub(crate) fn mesh(
    py: Python<'_>,
    shape: Shape,
    name: String,
    regions: Vec<(String, Shape)>,
    wanted: Wanted,
    asked: Asked<'_>,
) -> PyResult<MeshData> {
    let options = wanted.options()?;
    let regions = regions_of(regions)?;
    let unseen = if wanted.close {
        Unseen::Close
    } else {
        Unseen::Cut
    };
    let shape = Arc::new(shape.checked()?);
    let theirs = shape.clone();
    let made = run::run(py, &asked, move |control| match theirs.as_ref() {
        Shape::Model(program, values) => {
            let named = regions.iter().map(|(name, region, values)| RegionModel {
                name,
                model: region.get().model(),
                values,
            });
            let regions: Vec<RegionModel<'_>> = named.collect();
            mesh_model_regions(program.get().model(), values, &regions, &options, control)
        }
        Shape::Fitted(fitted) => mesh_spline(fitted.get().function(), unseen, &options, control),
    })?;
    let made = made.map_err(Trouble::from)?;
    let about = shape.about(name);
    let unit = about.unit.clone();
    let report = MeshReport::new(&made, about, Vec::new(), Seconds::default());
    Ok(MeshData {
        document: document::text(&report),
        mesh: made.meshed.mesh,
        unit,
    })
}

/// A region: its name, its program and the values of all parameters.
type Region = (String, Py<Program>, Vec<f64>);

/// Regions with the values of all parameters.
fn regions_of(regions: Vec<(String, Shape)>) -> Result<Vec<Region>, Trouble> {
    let mut found: Vec<Region> = Vec::new();
    for (name, shape) in regions {
        let Shape::Model(program, values) = shape.checked()? else {
            return Err(Trouble::usage(format!("region {name} is no Model")));
        };
        found.push((name, program, values));
    }
    Ok(found)
}

/// What is meshed, for documents.
impl Shape {
    fn about(&self, file: String) -> ModelName {
        match self {
            Self::Model(program, values) => ModelName {
                file,
                object: program.get().model().name().to_owned(),
                parameters: values.clone(),
                unit: program.get().model().info().unit.clone(),
            },
            Self::Fitted(_) => ModelName {
                file,
                object: "surface".to_owned(),
                parameters: Vec::new(),
                unit: None,
            },
        }
    }
}
