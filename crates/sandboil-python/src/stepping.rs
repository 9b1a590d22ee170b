//! Chunks of steps in between looks at the clock and at signals.

use crate::errors::CoreError;
use pyo3::prelude::*;
use sandboil_solver::SolverError;
use std::time::{Duration, Instant};

/// Repeats a chunk of steps until it says that there is nothing left to do or `seconds` have passed, then lets Python
/// handle signals. The interpreter is free meanwhile.
pub fn repeat(
    py: Python<'_>,
    seconds: f64,
    mut is_over: impl FnMut() -> Result<bool, SolverError> + Send,
) -> PyResult<()> {
    let outcome = py.detach(|| {
        let budget = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let start = Instant::now();
        while !is_over()? && start.elapsed() < budget {}
        Ok(())
    });
    py.check_signals()?;
    Ok(outcome.map_err(CoreError)?)
}
