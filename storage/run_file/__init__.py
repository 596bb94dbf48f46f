"""The run file: written whole, opened lazily, checked when read.

In: blocks of samples, the source's description, original files, a scene. Out: one HDF5 file, and from it the same
again, bit for bit, as blocks, a dataset or the originals. Free to change: a column or a header field may be added in
`layout` and `header`; what older files hold must still be read (docs/reference/run-file.md).
"""
