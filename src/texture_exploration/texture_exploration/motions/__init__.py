"""Exploratory motions: each plans a request and then says, step by step, what the arm shall do."""
