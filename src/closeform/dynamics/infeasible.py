"""That a plan cannot be flown in a field."""


class Grounded(ValueError):
    """What a flight would take nobody has, or nobody finds: thrust, changed impulses, a way back."""
