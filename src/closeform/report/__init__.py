"""Reports of runs and studies: one module per subject, tables of numbers, and one page."""
