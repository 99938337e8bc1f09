"""Contents of reports by topic: moves, searches, conflicts, effort, uncertainty and model error."""
