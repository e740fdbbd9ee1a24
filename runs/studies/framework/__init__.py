"""Framework of the studies: cases, their records, the runner, tables and pages."""
