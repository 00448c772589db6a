"""The robots that carry the exploring finger, behind one small protocol."""
