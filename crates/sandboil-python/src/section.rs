//! The section at rest: nodes, soils, water, edges and numerics.

use crate::{
    arrays::{Points, Values, one_of, rows},
    errors::{refused, serialised},
    soil::{Soil, integrator},
};
use numpy::{PyArray1, PyArray2};
use pyo3::{
    prelude::*,
    types::{IntoPyDict, PyBytes, PyDict},
};
use sandboil_soil::VanGenuchten;
use sandboil_solver as solver;

/// Pore water.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Water(solver::Water);

#[pymethods]
impl Water {
    #[new]
    #[pyo3(signature = (*, unit_weight, bulk_modulus))]
    fn new(unit_weight: f64, bulk_modulus: f64) -> Self {
        Self(solver::Water { unit_weight, bulk_modulus })
    }
}

/// Hydraulic conductivity by its principal values.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Conductivity(solver::Conductivity);

#[pymethods]
impl Conductivity {
    #[new]
    #[pyo3(signature = (*, major, minor, direction))]
    fn new(major: f64, minor: f64, direction: (f64, f64)) -> Self {
        Self(solver::Conductivity { major, minor, direction: solver::Vec2::new(direction.0, direction.1) })
    }

    #[getter]
    fn major(&self) -> f64 {
        self.0.major
    }

    #[getter]
    fn minor(&self) -> f64 {
        self.0.minor
    }

    #[getter]
    fn direction(&self) -> (f64, f64) {
        (self.0.direction.x, self.0.direction.y)
    }
}

/// A water retention curve.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Retention(VanGenuchten);

#[pymethods]
impl Retention {
    #[new]
    #[pyo3(signature = (*, alpha, n, residual, full))]
    fn new(alpha: f64, n: f64, residual: f64, full: f64) -> PyResult<Self> {
        VanGenuchten::new(alpha, n, residual, full).map(Self).map_err(|error| refused(&error))
    }

    /// Degree of saturation at pressure heads, m.
    #[expect(clippy::needless_pass_by_value, reason = "arrays come from Python by value")]
    fn saturation<'py>(&self, py: Python<'py>, pressure_head: Values) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, pressure_head.0.iter().map(|&head| self.0.at(head).saturation))
    }
}

/// A soil with its densities and conductivity.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Region(solver::Region);

#[pymethods]
impl Region {
    #[new]
    #[pyo3(signature = (
        *,
        soil,
        porosity,
        solid_density,
        hydraulic_conductivity,
        retention,
        earth_pressure_coefficient,
        static_poisson_ratio,
    ))]
    fn new(
        soil: Soil,
        porosity: f64,
        solid_density: f64,
        hydraulic_conductivity: &Conductivity,
        retention: Option<Retention>,
        earth_pressure_coefficient: f64,
        static_poisson_ratio: f64,
    ) -> Self {
        Self(solver::Region {
            soil: soil.0,
            porosity,
            solid_density,
            hydraulic_conductivity: hydraulic_conductivity.0,
            retention: retention.map(|curve| curve.0),
            earth_pressure_coefficient,
            static_poisson_ratio,
        })
    }
}

const SUPPORTS: [(&str, solver::Support); 2] =
    [("no-slip", solver::Support::NoSlip), ("free-slip", solver::Support::FreeSlip)];

/// A vertical side.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Side(solver::Side);

#[pymethods]
impl Side {
    #[new]
    #[pyo3(signature = (*, x, bottom, top, support))]
    fn new(x: f64, bottom: f64, top: f64, support: &str) -> PyResult<Self> {
        let support = one_of("support", support, &SUPPORTS)?;
        Ok(Self(solver::Side { x, extent: [bottom, top], support }))
    }
}

/// Base and sides.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Outline(solver::Outline);

#[pymethods]
impl Outline {
    #[new]
    #[pyo3(signature = (*, base, base_support, left, right))]
    fn new(base: Points, base_support: &str, left: Option<Side>, right: Option<Side>) -> PyResult<Self> {
        Ok(Self(solver::Outline {
            base: base.0,
            base_support: one_of("base_support", base_support, &SUPPORTS)?,
            sides: [left, right].map(|side| side.map(|side| side.0)),
        }))
    }
}

const OPERATORS: [(&str, solver::Operators); 3] = [
    ("conservative", solver::Operators::Conservative),
    ("dual", solver::Operators::Dual),
    ("printed", solver::Operators::Printed),
];

const DIFFUSION: [(&str, solver::Diffusion); 3] = [
    ("auto", solver::Diffusion::Auto),
    ("implicit", solver::Diffusion::Implicit),
    ("explicit", solver::Diffusion::Explicit),
];

const ACCELERATION_TERM: [(&str, solver::AccelerationTerm); 3] = [
    ("auto", solver::AccelerationTerm::Auto),
    ("on", solver::AccelerationTerm::On),
    ("off", solver::AccelerationTerm::Off),
];

/// Numerical choices.
#[pyclass(module = "sandboil._core", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct Numerics(pub solver::Numerics);

#[pymethods]
impl Numerics {
    #[new]
    #[pyo3(signature = (
        *,
        operators,
        smoothing_ratio,
        velocity_filter,
        diffusion,
        acceleration_term,
        dispersion_correction,
        geometry_strain_limit,
        integrator,
        integrator_tolerance,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new(
        operators: &str,
        smoothing_ratio: f64,
        velocity_filter: f64,
        diffusion: &str,
        acceleration_term: &str,
        dispersion_correction: bool,
        geometry_strain_limit: Option<f64>,
        integrator: &str,
        integrator_tolerance: Option<f64>,
    ) -> PyResult<Self> {
        Ok(Self(solver::Numerics {
            operators: one_of("operators", operators, &OPERATORS)?,
            smoothing_ratio,
            velocity_filter,
            diffusion: one_of("diffusion", diffusion, &DIFFUSION)?,
            acceleration_term: one_of("acceleration_term", acceleration_term, &ACCELERATION_TERM)?,
            dispersion_correction,
            geometry_strain_limit,
            integrator: self::integrator(integrator, integrator_tolerance, None)?,
        }))
    }
}

/// A section at rest. Arrays are copied, one row for each node.
#[pyclass(module = "sandboil._core", frozen, eq)]
#[derive(PartialEq)]
pub struct Section(pub solver::Model);

#[pymethods]
impl Section {
    #[new]
    #[pyo3(signature = (
        *,
        spacing,
        position,
        volume,
        region,
        regions,
        surface_elevation,
        vertical_effective_stress,
        pore_pressure,
        saturation,
        water,
        gravity,
        period,
        outline,
        numerics,
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn new(
        spacing: (f64, f64),
        position: Points,
        volume: Values,
        region: Values<u32>,
        regions: Vec<Region>,
        surface_elevation: Values,
        vertical_effective_stress: Values,
        pore_pressure: Values,
        saturation: Values,
        water: Option<Water>,
        gravity: f64,
        period: Option<f64>,
        outline: Outline,
        numerics: &Numerics,
    ) -> Self {
        Self(solver::Model {
            spacing: solver::Vec2::new(spacing.0, spacing.1),
            position: position.0,
            volume: volume.0,
            region: region.0,
            regions: regions.into_iter().map(|region| region.0).collect(),
            surface_elevation: surface_elevation.0,
            vertical_effective_stress: vertical_effective_stress.0,
            pore_pressure: pore_pressure.0,
            saturation: saturation.0,
            water: water.map(|water| water.0),
            gravity,
            period: period.map(|width| solver::Period { width }),
            outline: outline.0,
            numerics: numerics.0,
        })
    }

    /// Places of the stress points at rest (m, 2), m: the order of `vertical_effective_stress`.
    fn stress_positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        rows(py, &solver::stress_positions(&self.0).iter().map(|at| [at.x, at.y]).collect::<Vec<_>>())
    }

    /// Width between periodic sides, m.
    #[getter]
    fn period(&self) -> Option<f64> {
        self.0.period.map(|period| period.width)
    }

    /// Every part of the description by its name, as bytes: equal parts have equal bytes.
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let solver::Model {
            spacing,
            position,
            volume,
            region,
            regions,
            surface_elevation,
            vertical_effective_stress,
            pore_pressure,
            saturation,
            water,
            gravity,
            period,
            outline,
            numerics,
        } = &self.0;
        [
            ("spacing", serialised(spacing)?),
            ("position", serialised(position)?),
            ("volume", serialised(volume)?),
            ("region", serialised(region)?),
            ("regions", serialised(regions)?),
            ("surface_elevation", serialised(surface_elevation)?),
            ("vertical_effective_stress", serialised(vertical_effective_stress)?),
            ("pore_pressure", serialised(pore_pressure)?),
            ("saturation", serialised(saturation)?),
            ("water", serialised(water)?),
            ("gravity", serialised(gravity)?),
            ("period", serialised(period)?),
            ("outline", serialised(outline)?),
            ("numerics", serialised(numerics)?),
        ]
        .map(|(name, bytes)| (name, PyBytes::new(py, &bytes)))
        .into_py_dict(py)
    }
}
