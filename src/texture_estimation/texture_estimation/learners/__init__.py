# SPDX-License-Identifier: Apache-2.0
"""What learns textures, one a file; `catalogue` lists them."""
