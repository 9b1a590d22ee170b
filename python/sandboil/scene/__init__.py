"""The scene: what is there, and what is done to it."""
