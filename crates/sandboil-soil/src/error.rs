/// Error of a constitutive model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SoilError {
    /// A parameter outside its range.
    #[error("{name} = {value}: must be {expected}")]
    InvalidParameter {
        /// Name of the parameter.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Allowed values, in words.
        expected: &'static str,
    },
    /// An input or a result that is not a finite number. The state is left unchanged.
    #[error("{quantity} is {value}, not a finite number")]
    NonFinite {
        /// Name of the quantity.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// A strain increment larger than the limit for one increment. The state is left unchanged.
    #[error("strain increment {value}: one increment may change a component by at most {limit}")]
    StrainIncrementTooLarge {
        /// Largest component, absolute.
        value: f64,
        /// Largest component accepted.
        limit: f64,
    },
    /// Message of a model from outside this library.
    #[error("{0}")]
    Outside(String),
}

/// Refuses an infinite value and NaN.
pub(crate) fn finite(quantity: &'static str, value: f64) -> Result<f64, SoilError> {
    if value.is_finite() { Ok(value) } else { Err(SoilError::NonFinite { quantity, value }) }
}

/// Refuses a parameter that is not finite or fails its condition.
pub(crate) fn check(
    name: &'static str,
    value: f64,
    expected: &'static str,
    ok: bool,
) -> Result<f64, SoilError> {
    if ok && value.is_finite() {
        Ok(value)
    } else {
        Err(SoilError::InvalidParameter { name, value, expected })
    }
}

/// Refuses a parameter that is not positive.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64, SoilError> {
    check(name, value, "positive and finite", value > 0.0)
}
