"""What is not known exactly: errors of states and of thrust, and how near craft come with them."""
