//! Errors of the solver, with the numbers that a user needs to find the place.

use sandboil_soil::SoilError;

/// Errors of building or advancing a simulation.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum SolverError {
    /// An input outside its range, refused before any work.
    #[error("{name} = {value}: must be {expected}")]
    InvalidInput {
        /// Name of the quantity.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// An array of the wrong length.
    #[error("{name} has {found} entries, {expected} are needed")]
    Shape {
        /// Name of the array.
        name: &'static str,
        /// Length given.
        found: usize,
        /// Length needed.
        expected: usize,
    },
    /// A call that is not possible in the present state.
    #[error("{call} needs {needs} first")]
    Order {
        /// The call.
        call: &'static str,
        /// What the call needs.
        needs: &'static str,
    },
    /// A value that is not finite, or is outside its physical range.
    #[error("{quantity} of node {node} at ({x:.3}, {y:.3}) m is {value} at time {time:.6} s, step {step}")]
    Diverged {
        /// The field.
        quantity: &'static str,
        /// Node in the user's order.
        node: usize,
        /// Position, m.
        x: f64,
        /// Position, m.
        y: f64,
        /// The value.
        value: f64,
        /// Time in the stage, s.
        time: f64,
        /// Number of the step in the stage.
        step: u64,
    },
    /// A static stage that did not reach its tolerance.
    #[error(
        "gravity stage not at rest after {steps} steps: max |a|/g {residual:.2e}, tolerance {tolerance:.1e}"
    )]
    NotAtRest {
        /// Number of steps made.
        steps: u64,
        /// Largest unbalanced acceleration over gravity.
        residual: f64,
        /// The tolerance.
        tolerance: f64,
    },
    /// A step of the seepage for which no solution was found.
    #[error("seepage at time {time:.6} s: {reason}")]
    Seepage {
        /// Time in the stage, s.
        time: f64,
        /// What failed.
        reason: &'static str,
    },
    /// A soil model that refused its input or failed.
    #[error("soil model of region {region}, node {node}: {source}")]
    Soil {
        /// Region index.
        region: usize,
        /// Node in the user's order.
        node: usize,
        /// The error of the model.
        source: SoilError,
    },
    /// A free-field column that failed.
    #[error("free-field column on the {side}: {source}")]
    Column {
        /// Left or right.
        side: &'static str,
        /// The error of the column; its nodes are numbered from below.
        source: Box<SolverError>,
    },
    /// Stored bytes from which a simulation cannot continue.
    #[error(transparent)]
    State(#[from] StateError),
    /// A thread pool that could not be started.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// The message of the operating system.
        reason: String,
    },
}

impl SolverError {
    /// The error, with the node of a soil model in the user's order; `order` is the user's index of each node.
    pub(crate) fn in_user_order(mut self, order: &[usize]) -> Self {
        if let Self::Soil { node, .. } = &mut self {
            *node = order[*node];
        }
        self
    }

    /// Quantity, node and value of an error of a soil model in a step; `None` for other errors.
    pub(crate) fn soil_divergence(&self) -> Option<(&'static str, usize, f64)> {
        match self {
            Self::Soil { node, source: SoilError::StrainIncrementTooLarge { value, .. }, .. } => {
                Some(("strain of a step", *node, *value))
            }
            Self::Soil { node, .. } => Some(("soil state", *node, f64::NAN)),
            _ => None,
        }
    }
}

/// Reason why a simulation cannot continue from stored bytes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StateError {
    /// Bytes that are not a stored simulation.
    #[error("is not a stored simulation")]
    Foreign,
    /// Bytes of another format version.
    #[error("has format version {found}, this build reads {needed}")]
    Version {
        /// The version found.
        found: u32,
        /// The version of this build.
        needed: u32,
    },
    /// Bytes that have changed since they were written.
    #[error("is damaged: {0}")]
    Damaged(&'static str),
    /// Bytes written by another build.
    #[error("was stored by another build of sandboil")]
    Build,
    /// A state of another section.
    #[error("belongs to another section")]
    OtherModel,
}
