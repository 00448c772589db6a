"""What classifies a half in a search, one learner a file; `catalogue` lists them."""
