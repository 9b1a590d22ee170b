//! Arrays and names that come from Python, and arrays that go there.

use numpy::{
    Element, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, ToPyArray,
    ndarray::{Array, Dimension, IntoDimension, arr2},
};
use pyo3::{exceptions::PyValueError, prelude::*};
use sandboil_solver::Vec2;

/// Values of a one-dimensional array.
pub struct Values<T = f64>(pub Vec<T>);

impl<'py, T: Element + Clone> FromPyObject<'_, 'py> for Values<T> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let array: PyReadonlyArray1<'py, T> = object.extract()?;
        Ok(Self(array.as_slice()?.to_vec()))
    }
}

/// Points or vectors: rows of an array (n, 2).
pub struct Points(pub Vec<Vec2>);

impl<'py> FromPyObject<'_, 'py> for Points {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let Rows(rows) = object.extract()?;
        Ok(Self(rows.into_iter().map(|[x, y]| Vec2::new(x, y)).collect()))
    }
}

/// Rows of `N` values: an array (n, N).
pub struct Rows<const N: usize>(pub Vec<[f64; N]>);

impl<'py, const N: usize> FromPyObject<'_, 'py> for Rows<N> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let array: PyReadonlyArray2<'py, f64> = object.extract()?;
        let array = array.as_array();
        if array.ncols() != N {
            return Err(PyValueError::new_err(format!("{} columns: must be {N}", array.ncols())));
        }
        let row = |row: numpy::ndarray::ArrayView1<'_, f64>| std::array::from_fn(|k| row[k]);
        Ok(Self(array.outer_iter().map(row).collect()))
    }
}

/// The choice with a name.
pub fn one_of<T: Copy>(key: &str, value: &str, choices: &[(&str, T)]) -> PyResult<T> {
    choices.iter().find(|(name, _)| *name == value).map(|(_, choice)| *choice).ok_or_else(|| {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        PyValueError::new_err(format!("{key} = {value:?}: must be one of {names:?}"))
    })
}

/// Values as an array of a shape.
pub fn shaped<D: Dimension>(values: Vec<f64>, shape: impl IntoDimension<Dim = D>) -> PyResult<Array<f64, D>> {
    Array::from_shape_vec(shape.into_dimension(), values)
        .map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Vectors as an array (n, 2).
pub fn rows<'py>(py: Python<'py>, values: &[[f64; 2]]) -> Bound<'py, PyArray2<f64>> {
    arr2(values).to_pyarray(py)
}

/// Tensors at the stress points of each node as an array (n, points, N).
pub fn pages<'py, const N: usize>(
    py: Python<'py>,
    values: &[impl AsRef<[[f64; N]]>],
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let flat = values.iter().flat_map(AsRef::as_ref).flatten().copied().collect();
    let points = values.first().map_or(0, |of_node| of_node.as_ref().len());
    Ok(shaped(flat, (values.len(), points, N))?.to_pyarray(py))
}
