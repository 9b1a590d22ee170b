"""Running a scene into a folder, and planning it."""
