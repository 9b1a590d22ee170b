"""The scene: a section of ground, its water, and the stages that it goes through."""
