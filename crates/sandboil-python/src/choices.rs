//! The choices of a scene that exclude each other, by the core's table of rules.

use pyo3::prelude::*;
use sandboil_solver as solver;

/// The choices that a rule looks at.
#[pyclass(module = "sandboil._core", frozen, eq)]
#[derive(PartialEq)]
pub struct Choices(solver::Choices);

#[pymethods]
impl Choices {
    #[new]
    #[pyo3(signature = (
        *,
        printed_operators = false,
        dispersion_correction = false,
        water = false,
        periodic_sides = false,
        free_field = false,
        open_sides = false,
        rayleigh_damping = false,
        large_displacements = false,
        hydraulic_conditions = false,
        still_water = false,
    ))]
    #[expect(clippy::too_many_arguments, clippy::fn_params_excessive_bools, reason = "keywords of Python")]
    fn new(
        printed_operators: bool,
        dispersion_correction: bool,
        water: bool,
        periodic_sides: bool,
        free_field: bool,
        open_sides: bool,
        rayleigh_damping: bool,
        large_displacements: bool,
        hydraulic_conditions: bool,
        still_water: bool,
    ) -> Self {
        Self(solver::Choices {
            printed_operators,
            dispersion_correction,
            water,
            periodic_sides,
            free_field,
            open_sides,
            rayleigh_damping,
            large_displacements,
            hydraulic_conditions,
            still_water,
        })
    }
}

/// Names of the rules that some choices break, in the order of the table.
#[pyfunction]
pub fn broken_rules(choices: &Choices) -> Vec<&'static str> {
    solver::broken(&choices.0).map(|rule| rule.name).collect()
}
