"""What a run leaves behind: the file, its reader, and pictures."""
