"""Meshes of a layer (and its substrate) for the finite-element models, made with gmsh."""
