"""What a scene must fulfil so that it can be computed."""
