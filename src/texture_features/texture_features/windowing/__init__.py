"""Windows: which part of a stream is classified at once."""
