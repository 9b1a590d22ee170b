"""From the shapes of a scene to the nodes of a section and their state at rest."""
