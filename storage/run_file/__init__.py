"""The run file: written whole, opened lazily, checked when read.

In: blocks of samples, the source's description, original files, a scene. Out: one HDF5 file, which returns them bit
for bit as blocks, a dataset or the original files. Free to change: columns and header fields may be added in `layout`
and `header`, but older files must remain readable (docs/reference/run-file.md).
"""
