"""Small-strain contact of rigid balls with a layered half-space: the paper's model, on numpy and scipy."""
