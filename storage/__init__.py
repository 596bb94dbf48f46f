"""The run file: written whole, opened lazily.

Importing this package costs nothing; the modules are named where they are used:

- :mod:`storage.write` writes a run file (imports h5py);
- :mod:`storage.run` opens one (imports h5py; xarray only where a dataset is asked for);
- :mod:`storage.layout` is the file's layout, in one place, and :mod:`storage.header` what it believes;
- :mod:`storage.atomic` writes any file whole or not at all;
- :mod:`storage.errors` is the error tree.
"""
