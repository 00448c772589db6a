"""Tables of any kind (CSV, NPZ, MAT, WAV, HDF5, Parquet, bags of standard messages) turned into labelled bags."""
