"""Classification: training of a classifier and accumulation of evidence over the windows of a slide."""
