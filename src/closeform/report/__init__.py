"""What is said of a run and of a study: a file for each subject, tables of numbers, one page."""
