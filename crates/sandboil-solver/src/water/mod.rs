//! Pore water: conduction, hydraulic conditions, pore pressure, partly saturated soil, still water.

pub mod cell_conduction;
pub mod conditions;
pub mod conduction;
pub mod corner_edges;
pub mod corner_pressure;
pub mod corner_wetting;
pub mod edge_law;
pub mod moving_edges;
pub mod partly_saturated;
pub mod pore_pressure;
pub mod pore_water;
pub mod seepage;
pub mod still_water;
