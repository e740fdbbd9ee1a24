"""Contacts of any shape on grids with the fast Fourier transform."""
