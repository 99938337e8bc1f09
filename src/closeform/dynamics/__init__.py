"""High-fidelity dynamics: force model, control, simulation, model error and tracking margins."""
