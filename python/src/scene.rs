//! Scenes that rays are cast at.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use beamcast::frame::UpAxis;
use beamcast::scene::{MeshArrays, Scene, SceneBuildError, Vertices, gltf};
use beamcast::{Error, Progress, Tracer};
use numpy::{PyArray1, PyArrayMethods as _, PyReadonlyArray2};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Number, RayArgument, RayArrays, rows};
use crate::casting::{self, HitArrays, Order, Target};
use crate::errors::exception;
use crate::threads_of;
use crate::work::on_threads;

/// A mesh that belongs to the scene.
enum OwnMesh {
    F32(Vec<[f32; 3]>, Vec<[u32; 3]>),
    F64(Vec<[f64; 3]>, Vec<[u32; 3]>),
}

impl OwnMesh {
    fn arrays(&self) -> MeshArrays<'_> {
        match self {
            Self::F32(vertices, triangles) => MeshArrays { vertices: Vertices::F32(vertices), triangles },
            Self::F64(vertices, triangles) => MeshArrays { vertices: Vertices::F64(vertices), triangles },
        }
    }
}

#[derive(Default)]
struct State {
    meshes: Vec<Arc<OwnMesh>>,
    /// The scene of all of them, once it was asked for; or that of a file.
    target: Option<Arc<Target>>,
    is_of_file: bool,
}

/// A scene. The package's `Scene` documents it.
#[pyclass(frozen, module = "beamcast._native")]
pub struct NativeScene {
    state: Mutex<State>,
}

impl NativeScene {
    /// The scene, made now if meshes were added since it was last asked for.
    fn target(&self, py: Python<'_>, threads: usize) -> PyResult<Arc<Target>> {
        let meshes = {
            let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(target) = &state.target {
                return Ok(Arc::clone(target));
            }
            state.meshes.clone()
        };
        let build = |_: &Progress| -> Result<Target, SceneBuildError> {
            let arrays: Vec<MeshArrays> = meshes.iter().map(|mesh| mesh.arrays()).collect();
            let (scene, sources) = Scene::of_arrays(&arrays)?;
            Ok(Target { tracer: Tracer::build(&scene), sources: Some(sources) })
        };
        let target = on_threads(py, threads, build)?.map_err(|e| PyValueError::new_err(e.to_string()))?;
        let target = Arc::new(target);
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        // Another thread may have added a mesh meanwhile.
        if state.meshes.len() == meshes.len() {
            state.target = Some(Arc::clone(&target));
        }
        Ok(target)
    }

    fn cast<'py, T: Number>(
        &self,
        py: Python<'py>,
        rays: RayArrays<'_, T>,
        columns: usize,
        threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let target = self.target(py, threads)?;
        let count = rays.count();
        let [t_hit, uvs, normals] = [1, 2, 3].map(|each| zeros::<f32>(py, count, each, "float32"));
        let (t_hit, uvs, normals) = (t_hit?, uvs?, normals?);
        let wide = zeros::<f64>(py, count, 1, "float64")?;
        let (geometries, primitives) =
            (zeros::<u32>(py, count, 1, "uint32")?, zeros::<u32>(py, count, 1, "uint32")?);
        {
            let (mut t_hit, mut wide) = (t_hit.readwrite(), wide.readwrite());
            let (mut geometries, mut primitives) = (geometries.readwrite(), primitives.readwrite());
            let (mut uvs, mut normals) = (uvs.readwrite(), normals.readwrite());
            let out = HitArrays {
                t_hit: t_hit.as_slice_mut()?,
                t_hit_f64: wide.as_slice_mut()?,
                geometry_ids: geometries.as_slice_mut()?,
                primitive_ids: primitives.as_slice_mut()?,
                primitive_uvs: uvs.as_slice_mut()?,
                primitive_normals: normals.as_slice_mut()?,
            };
            let order = Order::of(count, columns);
            on_threads(py, threads, |progress| {
                casting::nearest(&target, &rays, order, out, &progress.cancelled);
            })?;
        }
        let found = PyDict::new(py);
        found.set_item("t_hit", t_hit)?;
        found.set_item("t_hit_f64", wide)?;
        found.set_item("geometry_ids", geometries)?;
        found.set_item("primitive_ids", primitives)?;
        found.set_item("primitive_uvs", uvs)?;
        found.set_item("primitive_normals", normals)?;
        Ok(found)
    }

    fn occlusions<'py, T: Number>(
        &self,
        py: Python<'py>,
        rays: RayArrays<'_, T>,
        limits: [f64; 2],
        threads: usize,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let target = self.target(py, threads)?;
        let blocked = zeros::<bool>(py, rays.count(), 1, "bool")?;
        {
            let mut blocked = blocked.readwrite();
            let out = blocked.as_slice_mut()?;
            on_threads(py, threads, |progress| {
                casting::occlusions(&target, &rays, limits, out, &progress.cancelled);
            })?;
        }
        Ok(blocked)
    }

    fn intersections<'py, T: Number>(
        &self,
        py: Python<'py>,
        rays: RayArrays<'_, T>,
        threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let target = self.target(py, threads)?;
        let count = rays.count();
        let (found, splits) = on_threads(py, threads, |progress| {
            let found = casting::intersections(&target, &rays, &progress.cancelled);
            let mut splits = vec![0_i64; count + 1];
            found.iter().for_each(|one| splits[one.ray + 1] += 1);
            for ray in 0..count {
                splits[ray + 1] += splits[ray];
            }
            (found, splits)
        })?;
        let all = PyDict::new(py);
        all.set_item("ray_splits", PyArray1::from_vec(py, splits))?;
        let column =
            |value: fn(&casting::Intersection) -> u32| -> Vec<u32> { found.iter().map(value).collect() };
        all.set_item("ray_ids", PyArray1::from_vec(py, column(|one| one.ray as u32)))?;
        all.set_item("geometry_ids", PyArray1::from_vec(py, column(|one| one.ids.0)))?;
        all.set_item("primitive_ids", PyArray1::from_vec(py, column(|one| one.ids.1)))?;
        let depths: Vec<f64> = found.iter().map(|one| one.t).collect();
        let narrow: Vec<f32> = depths.iter().map(|&t| t as f32).collect();
        all.set_item("t_hit", PyArray1::from_vec(py, narrow))?;
        all.set_item("t_hit_f64", PyArray1::from_vec(py, depths))?;
        let uvs: Vec<f32> = found.iter().flat_map(|one| one.uv.map(|weight| weight as f32)).collect();
        all.set_item("primitive_uvs", PyArray1::from_vec(py, uvs))?;
        Ok(all)
    }
}

#[pymethods]
impl NativeScene {
    /// A scene without triangles.
    #[new]
    fn new() -> Self {
        Self { state: Mutex::default() }
    }

    /// The scene of a glTF file.
    #[staticmethod]
    fn of_file(
        py: Python<'_>,
        path: PathBuf,
        up: &str,
        allowed_folders: Vec<PathBuf>,
        threads: Option<i64>,
    ) -> PyResult<Self> {
        let up = match up {
            "z" => UpAxis::Z,
            "y" => UpAxis::Y,
            other => return Err(PyValueError::new_err(format!("up is {other:?}: expected \"z\" or \"y\""))),
        };
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let read = |_: &Progress| -> Result<Target, Error> {
            let options = gltf::Options { up, allowed_folders: &allowed_folders, ..gltf::Options::default() };
            let scene = gltf::load(&path, &name, &options)?.scene;
            Ok(Target { tracer: Tracer::build(&scene), sources: None })
        };
        let target = on_threads(py, threads_of(threads)?, read)?.map_err(|error| exception(py, &error))?;
        let state = State { target: Some(Arc::new(target)), is_of_file: true, ..State::default() };
        Ok(Self { state: Mutex::new(state) })
    }

    /// Adds a mesh: vertices (n, 3) of 32 or 64 bits, and triangles (m, 3) of uint32. Returns its id.
    fn add_triangles(
        &self,
        vertices: &Bound<'_, PyAny>,
        triangles: PyReadonlyArray2<'_, u32>,
    ) -> PyResult<u32> {
        let triangles = rows(&triangles)?.to_vec();
        let mesh = if let Ok(vertices) = vertices.extract::<PyReadonlyArray2<'_, f32>>() {
            OwnMesh::F32(rows(&vertices)?.to_vec(), triangles)
        } else if let Ok(vertices) = vertices.extract::<PyReadonlyArray2<'_, f64>>() {
            OwnMesh::F64(rows(&vertices)?.to_vec(), triangles)
        } else {
            return Err(PyTypeError::new_err("vertices are float32 or float64, with the shape (n, 3)"));
        };
        // A mesh is checked when it is added, and not at the first cast.
        Scene::check_arrays(&mesh.arrays()).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.is_of_file {
            return Err(PyTypeError::new_err("triangles can't be added to the scene of a file"));
        }
        state.target = None;
        state.meshes.push(Arc::new(mesh));
        Ok(state.meshes.len() as u32 - 1)
    }

    /// The nearest hits of rays in rows of so many pixels, as flat arrays.
    #[pyo3(signature = (rays, directions, columns, threads))]
    fn cast_rays<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        columns: usize,
        threads: Option<i64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let threads = threads_of(threads)?;
        match RayArgument::of(rays, directions)? {
            RayArgument::F32(a, b) => self.cast(py, RayArrays::of(&a, b.as_ref())?, columns, threads),
            RayArgument::F64(a, b) => self.cast(py, RayArrays::of(&a, b.as_ref())?, columns, threads),
        }
    }

    /// Whether each ray hits anything between two depths.
    #[pyo3(signature = (rays, directions, tnear, tfar, threads))]
    fn test_occlusions<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        tnear: f64,
        tfar: f64,
        threads: Option<i64>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let threads = threads_of(threads)?;
        if tnear.is_nan() || tfar.is_nan() {
            return Err(PyValueError::new_err("tnear and tfar are depths, not NaN"));
        }
        let limits = [tnear.max(0.0), tfar];
        match RayArgument::of(rays, directions)? {
            RayArgument::F32(a, b) => self.occlusions(py, RayArrays::of(&a, b.as_ref())?, limits, threads),
            RayArgument::F64(a, b) => self.occlusions(py, RayArrays::of(&a, b.as_ref())?, limits, threads),
        }
    }

    /// All intersections of rays, ray by ray.
    #[pyo3(signature = (rays, directions, threads))]
    fn list_intersections<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        directions: Option<&Bound<'py, PyAny>>,
        threads: Option<i64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let threads = threads_of(threads)?;
        match RayArgument::of(rays, directions)? {
            RayArgument::F32(a, b) => self.intersections(py, RayArrays::of(&a, b.as_ref())?, threads),
            RayArgument::F64(a, b) => self.intersections(py, RayArrays::of(&a, b.as_ref())?, threads),
        }
    }

    /// The meshes that were added, each as flat vertices and triangles.
    fn meshes<'py>(&self, py: Python<'py>) -> Vec<(Bound<'py, PyAny>, Bound<'py, PyArray1<u32>>)> {
        let meshes = self.state.lock().unwrap_or_else(PoisonError::into_inner).meshes.clone();
        let of = |mesh: &Arc<OwnMesh>| {
            let (vertices, triangles) = match &**mesh {
                OwnMesh::F32(vertices, triangles) => {
                    (PyArray1::from_slice(py, vertices.as_flattened()).into_any(), triangles)
                }
                OwnMesh::F64(vertices, triangles) => {
                    (PyArray1::from_slice(py, vertices.as_flattened()).into_any(), triangles)
                }
            };
            (vertices, PyArray1::from_slice(py, triangles.as_flattened()))
        };
        meshes.iter().map(of).collect()
    }

    /// The number of triangles that rays can hit.
    fn triangle_count(&self, py: Python<'_>, threads: Option<i64>) -> PyResult<u64> {
        Ok(self.target(py, threads_of(threads)?)?.tracer.scene().triangle_count())
    }

    /// The names of the objects of a scene of a file, by their ids.
    fn object_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let target = self.target(py, 0)?;
        Ok(target.tracer.scene().geometry.objects.iter().map(|object| object.name.clone()).collect())
    }
}

/// An array of so many elements, all 0, which NumPy makes: it raises where memory is short.
fn zeros<'py, T: numpy::Element>(
    py: Python<'py>,
    count: usize,
    each: usize,
    dtype: &str,
) -> PyResult<Bound<'py, PyArray1<T>>> {
    let made = py.import("numpy")?.call_method1("zeros", (count.saturating_mul(each), dtype))?;
    Ok(made.cast_into::<PyArray1<T>>()?)
}
