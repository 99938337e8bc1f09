"""High-fidelity dynamics: force model, simulation under feedback, model error and tracking margins."""
