"""Sums over many distant loads in n log n time: a mesh, its splines, and the split of the kernel."""
