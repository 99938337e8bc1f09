"""Lower bounds on the cost of all clear plans, and their proof by branch and bound."""
