"""Exception for a plan that is not feasible in a force model."""


class Infeasible(ValueError):
    """Infeasible plan: insufficient thrust, no converged impulses, or no feedback law."""
