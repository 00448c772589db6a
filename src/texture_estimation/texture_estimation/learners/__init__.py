"""What learns textures, one a file; `catalogue` lists them."""
