//! Private binding module `sandboil._core`: converts, calls, converts.

mod arrays;
mod choices;
mod columns;
mod conditions;
mod errors;
mod identity;
mod laboratory;
mod section;
mod seepage;
mod shear_cell;
mod simulation;
mod soil;
mod stages;
mod stepping;
mod stored;

/// The extension module `sandboil._core`.
#[pyo3::pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::choices::{Choices, broken_rules};
    #[pymodule_export]
    use crate::columns::ColumnRecord;
    #[pymodule_export]
    use crate::conditions::{Condition, MovingCondition};
    #[pymodule_export]
    use crate::identity::column_identities;
    #[pymodule_export]
    use crate::laboratory::{Specimen, carries, pm4sand_constants, small_strain_moduli};
    #[pymodule_export]
    use crate::section::{Conductivity, Numerics, Outline, Region, Retention, Section, Side, Water};
    #[pymodule_export]
    use crate::seepage::Seepage;
    #[pymodule_export]
    use crate::shear_cell::ShearCell;
    #[pymodule_export]
    use crate::simulation::Simulation;
    #[pymodule_export]
    use crate::soil::Soil;
    #[pymodule_export]
    use crate::stages::{Base, BaseSegment, Gravity, HalfSpace, Output, Rayleigh, RunOut, Shaking, Wave};
    #[pymodule_export]
    use crate::stored::stored_note;

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        m.add("ACCELERATION_TERM_CONDUCTIVITY", sandboil_solver::ACCELERATION_TERM_CONDUCTIVITY)?;
        m.add("ENERGY_NAMES", sandboil_solver::ENERGY_NAMES)?;
        m.add("RULES", sandboil_solver::RULES.map(|rule| rule.name))?;
        // Empty if it was built outside a checkout.
        m.add("__revision__", env!("SANDBOIL_REVISION"))?;
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
