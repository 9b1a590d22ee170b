//! The description of a section and what follows from it alone: outline, edges, order of the nodes.

pub mod bins;
pub mod description;
pub mod edge_nodes;
pub mod node_id;
pub mod order;
pub mod outline;
