"""The layered half-space: surface response, kernel, and the rigid punch on it."""
