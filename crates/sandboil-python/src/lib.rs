//! Private binding module `sandboil._core`: converts, calls, converts.

mod errors;
mod laboratory;
mod material;
mod seepage;
mod shear_cell;
mod simulation;

/// The extension module `sandboil._core`.
#[pyo3::pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::laboratory::{Specimen, carries, pm4sand_constants};
    #[pymodule_export]
    use crate::material::{saturation, small_strain_moduli};
    #[pymodule_export]
    use crate::seepage::Seepage;
    #[pymodule_export]
    use crate::shear_cell::ShearCell;
    #[pymodule_export]
    use crate::simulation::{Simulation, stored_note, stress_node_offset};

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        m.add("ACCELERATION_TERM_CONDUCTIVITY", sandboil_solver::ACCELERATION_TERM_CONDUCTIVITY)?;
        m.add("ENERGY_NAMES", sandboil_solver::ENERGY_NAMES)?;
        // Empty if it was built outside a checkout.
        m.add("__revision__", env!("SANDBOIL_REVISION"))?;
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
