"""LeafSystems, one class a file, thin over the package's plain functions."""
