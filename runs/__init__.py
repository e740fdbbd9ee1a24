"""The command line and all that it uses besides the models: scenes, comparisons, tables, figures, output folders."""

import os as _os

# one thread per rank: BLAS threads would compete with MPI ranks for cores; numpy reads these on its first import
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    _os.environ.setdefault(_name, "1")
