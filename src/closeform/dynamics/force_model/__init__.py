"""Force model: gravity, drag, propagation of the natural motion, and the chief's Hill frame."""
