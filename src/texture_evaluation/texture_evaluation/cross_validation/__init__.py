"""Cross-validation of recipes on labelled slides, with scikit-learn's splitters and one in the order of time."""
