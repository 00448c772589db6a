"""The shape of surfaces: one file a kind of relief, and what is common to them."""
