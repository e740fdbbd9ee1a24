"""The discrete layer: spaces, unknowns, regions, residual and tangent, and states that other meshes can use."""
