"""Everything that is of the five papers: their features, learners and experiments."""
