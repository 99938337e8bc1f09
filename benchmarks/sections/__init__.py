"""One module for each section of the benchmark, each with `measure(quick) -> Report`."""
