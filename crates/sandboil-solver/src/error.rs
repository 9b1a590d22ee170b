//! What can go wrong in a solve, with the numbers a user needs to find the place.

use sandboil_soil::SoilError;

/// Errors of building or advancing a simulation.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum SolverError {
    /// An input outside its range; refused before any work.
    #[error("{name} = {value}: must be {expected}")]
    InvalidInput {
        /// Name of the quantity.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// Arrays whose lengths contradict each other.
    #[error("{name} has {found} entries, {expected} are needed")]
    Shape {
        /// Name of the array.
        name: &'static str,
        /// Length given.
        found: usize,
        /// Length needed.
        expected: usize,
    },
    /// A call that needs another stage first.
    #[error("{call} needs {needs} first")]
    Order {
        /// What was called.
        call: &'static str,
        /// What has to come before.
        needs: &'static str,
    },
    /// A field left the range of finite or sensible numbers.
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
        /// The offending value.
        value: f64,
        /// Time in the stage, s.
        time: f64,
        /// Step in the stage.
        step: u64,
    },
    /// The static stage did not reach its tolerance.
    #[error(
        "gravity stage not at rest after {steps} steps: max |a|/g {residual:.2e}, wanted {tolerance:.1e}"
    )]
    NotAtRest {
        /// Steps made.
        steps: u64,
        /// Largest unbalanced acceleration over gravity.
        residual: f64,
        /// Tolerance asked.
        tolerance: f64,
    },
    /// The flow of water has no solution that could be found.
    #[error("seepage at time {time:.6} s: {reason}")]
    Seepage {
        /// Time in the stage, s.
        time: f64,
        /// What failed.
        reason: &'static str,
    },
    /// A soil model refused its input or failed.
    #[error("soil model of region {region}, node {node}: {source}")]
    Soil {
        /// Region index.
        region: usize,
        /// Node in the user's order.
        node: usize,
        /// The model's own words.
        source: SoilError,
    },
    /// A free-field column failed.
    #[error("free-field column on the {side}: {source}")]
    Column {
        /// Left or right.
        side: &'static str,
        /// What happened to it; its nodes count from below.
        source: Box<SolverError>,
    },
    /// A stored state cannot be gone on with.
    #[error(transparent)]
    State(#[from] StateError),
    /// The thread pool could not be made.
    #[error("cannot start {threads} threads: {reason}")]
    Threads {
        /// Threads asked.
        threads: usize,
        /// The operating system's words.
        reason: String,
    },
}

impl SolverError {
    /// The error of a soil model with its node in the user's order: `order` has the user's index of each node.
    pub(crate) fn in_user_order(mut self, order: &[usize]) -> Self {
        if let Self::Soil { node, .. } = &mut self {
            *node = order[*node];
        }
        self
    }

    /// Quantity, node and value of the error of a soil model in a step; `None` of other errors.
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

/// Why stored bytes cannot be gone on with.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StateError {
    /// Bytes of something else.
    #[error("is no stored simulation")]
    Foreign,
    /// Bytes of another layout.
    #[error("has format version {found}, and {needed} is needed")]
    Version {
        /// The version found.
        found: u32,
        /// The version of this build.
        needed: u32,
    },
    /// Bytes that are not as they were written.
    #[error("is damaged: {0}")]
    Damaged(&'static str),
    /// Bytes that another build wrote.
    #[error("was stored by another build of sandboil")]
    Build,
    /// A state of another section.
    #[error("is that of another section")]
    OtherModel,
}
