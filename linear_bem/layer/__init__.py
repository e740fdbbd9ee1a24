"""The layered half-space: surface response, kernel, uniform loads, and the indentation by one ball."""
