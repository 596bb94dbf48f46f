"""The run file: written whole, opened lazily.

Importing this package costs nothing; the modules are named where they are used:

- :mod:`storage.run_file.writing` writes a run file (imports h5py);
- :mod:`storage.run_file.reading` opens one (imports h5py; xarray only where a dataset is asked for);
- :mod:`storage.run_file.layout` is the file's layout, in one place, and :mod:`storage.run_file.header` what it
  believes;
- :mod:`storage.atomic` writes any file whole or not at all;
- :mod:`storage.errors` is the error tree.
"""
