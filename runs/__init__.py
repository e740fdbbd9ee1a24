"""What users run: command line, scenes, comparison of models, tables, figures and output folders."""

import os as _os

# one thread per rank: threads of BLAS beside MPI ranks fight for cores; numpy reads these when it is first imported
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    _os.environ.setdefault(_name, "1")
