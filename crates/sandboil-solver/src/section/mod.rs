//! The description of a section, and what is derived from it alone: outline, edge nodes, order of the nodes.

pub mod bins;
pub mod description;
pub mod dual_lattice;
pub mod edge_nodes;
pub mod node_id;
pub mod order;
pub mod outline;
pub mod stress_layout;
