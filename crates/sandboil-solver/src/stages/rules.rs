//! Table of the choices of a scene that exclude each other.

use crate::{
    error::SolverError,
    section::description::{Model, Operators},
    stages::stage::{Displacements, Stage, WaterReference},
};

/// The choices to which the rules apply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[allow(clippy::struct_excessive_bools)] // the choices are independent
pub struct Choices {
    /// The printed operators.
    pub printed_operators: bool,
    /// Inertia corrected for dispersion.
    pub dispersion_correction: bool,
    /// Pore water.
    pub water: bool,
    /// Periodic sides.
    pub periodic_sides: bool,
    /// A free-field side.
    pub free_field: bool,
    /// A side that is removed.
    pub open_sides: bool,
    /// Rayleigh damping.
    pub rayleigh_damping: bool,
    /// Large displacements.
    pub large_displacements: bool,
    /// Hydraulic conditions while the ground moves.
    pub hydraulic_conditions: bool,
    /// Still water with a given surface.
    pub still_water: bool,
}

impl Choices {
    /// Choices of a model, without a stage.
    pub fn of_model(model: &Model) -> Self {
        Self {
            printed_operators: model.numerics.operators == Operators::Printed,
            dispersion_correction: model.numerics.dispersion_correction,
            water: model.water.is_some(),
            periodic_sides: model.period.is_some(),
            ..Self::default()
        }
    }

    /// Choices of a model and a stage.
    pub fn of_stage(model: &Model, stage: &Stage) -> Self {
        let line = match &stage.water_reference {
            WaterReference::StillWater { line } => line.as_deref(),
            WaterReference::AtRest => None,
        };
        Self {
            free_field: stage.free_field().contains(&true),
            open_sides: stage.open().contains(&true),
            rayleigh_damping: stage.damping.rayleigh.is_some(),
            large_displacements: stage.displacements == Displacements::Large,
            hydraulic_conditions: !stage.conditions.is_empty(),
            still_water: line.is_some_and(|line| !line.is_empty()),
            ..Self::of_model(model)
        }
    }
}

/// Two choices that exclude each other.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    /// Name of the rule.
    pub name: &'static str,
    /// The choice to leave out.
    pub choice: &'static str,
    /// Condition on the choice, with its reason.
    pub expected: &'static str,
    breaks: fn(&Choices) -> bool,
}

/// All rules, in the order in which they are checked.
pub const RULES: [Rule; 10] = [
    Rule {
        name: "dispersion correction with printed operators",
        choice: "dispersion_correction",
        expected: "left out with the printed operators: their force is not the transpose of their strain",
        breaks: |c| c.dispersion_correction && c.printed_operators,
    },
    Rule {
        name: "large displacements with printed operators",
        choice: "large_displacements",
        expected: "left out with the printed operators, which hold for small strains only",
        breaks: |c| c.large_displacements && c.printed_operators,
    },
    Rule {
        name: "large displacements with dispersion correction",
        choice: "dispersion_correction",
        expected: "left out with large displacements: the contacts of soils move",
        breaks: |c| c.large_displacements && c.dispersion_correction,
    },
    Rule {
        name: "large displacements with free field",
        choice: "large_displacements",
        expected: "left out beside free-field sides: ground would leave the nodes that are coupled to the columns",
        breaks: |c| c.large_displacements && c.free_field,
    },
    Rule {
        name: "large displacements with hydraulic conditions",
        choice: "large_displacements",
        expected: "left out with hydraulic conditions: the edges on which these act would move",
        breaks: |c| c.large_displacements && c.hydraulic_conditions,
    },
    Rule {
        name: "open sides with periodic sides",
        choice: "open_sides",
        expected: "left out with periodic sides, which are not edges",
        breaks: |c| c.open_sides && c.periodic_sides,
    },
    Rule {
        name: "still water without water",
        choice: "still_water",
        expected: "left out in a section without water",
        breaks: |c| c.still_water && !c.water,
    },
    Rule {
        name: "Rayleigh damping with printed operators",
        choice: "rayleigh",
        expected: "left out with the printed operators: their force is not the transpose of their strain",
        breaks: |c| c.rayleigh_damping && c.printed_operators,
    },
    Rule {
        name: "dispersion correction with free field",
        choice: "dispersion_correction",
        expected: "left out beside free-field sides, whose columns have the plain inertia",
        breaks: |c| c.dispersion_correction && c.free_field,
    },
    Rule {
        name: "printed operators with water and free field",
        choice: "operators",
        expected: "conservative in saturated ground beside free-field sides",
        breaks: |c| c.printed_operators && c.water && c.free_field,
    },
];

/// Rules that the choices break, in the order of the table.
pub fn broken(choices: &Choices) -> impl Iterator<Item = &'static Rule> {
    RULES.iter().filter(|rule| (rule.breaks)(choices))
}

/// Refuses choices that exclude each other.
///
/// # Errors
/// [`SolverError::InvalidInput`] with the first rule that is broken.
pub fn check(choices: &Choices) -> Result<(), SolverError> {
    match broken(choices).next() {
        Some(rule) => {
            Err(SolverError::InvalidInput { name: rule.choice, value: 1.0, expected: rule.expected })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each rule has its own name, and no single choice breaks a rule, except still water, which needs water.
    #[test]
    fn each_rule_needs_two_choices() {
        let set: [fn(&mut Choices); 10] = [
            |c| c.printed_operators = true,
            |c| c.dispersion_correction = true,
            |c| c.water = true,
            |c| c.periodic_sides = true,
            |c| c.free_field = true,
            |c| c.open_sides = true,
            |c| c.rayleigh_damping = true,
            |c| c.large_displacements = true,
            |c| c.hydraulic_conditions = true,
            |c| c.still_water = true,
        ];
        let with = |chosen: &[usize]| {
            let mut choices = Choices::default();
            for &k in chosen {
                set[k](&mut choices);
            }
            choices
        };
        for k in 0..set.len() {
            let names: Vec<_> = broken(&with(&[k])).map(|rule| rule.name).collect();
            // Still water needs water, which is absent here.
            assert_eq!(names.len(), usize::from(k == 9), "{names:?}");
        }
        let all: Vec<usize> = (0..set.len()).filter(|k| *k != 2).collect();
        let names: std::collections::BTreeSet<_> = broken(&with(&all)).map(|rule| rule.name).collect();
        let wet = with(&[0, 2, 4]);
        let with_water = broken(&wet).map(|rule| rule.name);
        assert_eq!(names.into_iter().chain(with_water).count(), RULES.len());
    }
}
